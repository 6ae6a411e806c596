#include "tunica/mechanics/terms/support.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/model/curvature.hpp"

#include <algorithm>

namespace tunica {

SupportTerm::SupportTerm(const Model& model, std::span<const ShellElement> elements,
                         std::span<const std::array<Vec3, 3>> normals) {
  sticking_.assign(model.node_count(), 0);
  stiffness_.assign(model.node_count(), Mat3::Zero());
  for (const Support& support : model.supports) {
    const ShellBody& body = model.shells[support.body];
    const std::vector<Mat3> shapes =
        support.normal_only ? shape_operators_of(body.mesh, body.curved) : std::vector<Mat3>();
    std::size_t triangle = 0;
    for (std::size_t e = 0; e < elements.size(); ++e) {
      if (elements[e].body != support.body) {
        continue;
      }
      const std::size_t t = triangle++;
      const double share = share_of(support.shares, t);
      if (share == 0) {
        continue;
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const Index node = elements[e].nodes[k];
        const double stiffness = share * support.stiffness * elements[e].area / 3;
        const Vec3& n = normals[e][k];
        if (support.normal_only) {
          sliding_.push_back({node, stiffness, n, shapes[t]});
          stiffness_[node] += stiffness * n * n.transpose();
        } else {
          sticking_[node] += stiffness;
          stiffness_[node] += stiffness * Mat3::Identity();
        }
      }
    }
  }
}

bool SupportTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  const auto block_of = [&](std::size_t i) {
    const auto node = narrow<Index>(i);
    return tangent->block(tangent->find(node, node));
  };
  for (std::size_t i = 0; i < sticking_.size(); ++i) {
    forces.internal.segment<3>(first_freedom(i)) += sticking_[i] * at.configuration.displacement[i];
    if (tangent != nullptr) {
      block_of(i).diagonal().head<3>().array() += sticking_[i];
    }
  }
  for (const Sliding& corner : sliding_) {
    const Vec3& u = at.configuration.displacement[corner.node];
    const double d = distance(corner, u);
    const Vec3 away = corner.normal + corner.shape * u;
    forces.internal.segment<3>(first_freedom(corner.node)) += corner.stiffness * d * away;
    if (tangent != nullptr) {
      block_of(corner.node).topLeftCorner<3, 3>() += corner.stiffness * (away * away.transpose() + d * corner.shape);
    }
  }
  forces.energy += energy(system, at.configuration);
  return true;
}

double SupportTerm::distance(const Sliding& at, const Vec3& displacement) {
  return (at.normal + at.shape * displacement / 2).dot(displacement);
}

void SupportTerm::add_linear_stiffness(const ShellSystem& /*system*/, BlockMatrix& matrix) const {
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    const auto node = narrow<Index>(i);
    matrix.block(matrix.find(node, node)).topLeftCorner<3, 3>() += stiffness_[i];
  }
}

void SupportTerm::add_linear_forces(const ShellSystem& /*system*/, const VectorX& displacement, VectorX& forces) const {
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    forces.segment<3>(first_freedom(i)) += stiffness_[i] * displacement.segment<3>(first_freedom(i));
  }
}

double SupportTerm::energy(const ShellSystem& /*system*/, const Configuration& configuration) const {
  double sum = 0;
  for (std::size_t i = 0; i < sticking_.size(); ++i) {
    sum += sticking_[i] * configuration.displacement[i].squaredNorm();
  }
  for (const Sliding& corner : sliding_) {
    const double d = distance(corner, configuration.displacement[corner.node]);
    sum += corner.stiffness * d * d;
  }
  return sum / 2;
}

std::array<double, 2> SupportTerm::squared_stiffness(const ShellSystem& /*system*/) const {
  double sum = 0;
  for (const Mat3& stiffness : stiffness_) {
    sum += stiffness.squaredNorm();
  }
  return {sum, 0};
}

Mat3 SupportTerm::at(std::size_t node) const { return stiffness_[node]; }

}  // namespace tunica
