#include "tunica/mechanics/terms/support.hpp"

#include "tunica/core/narrow.hpp"

#include <algorithm>

namespace tunica {

SupportTerm::SupportTerm(const Model& model, std::span<const ShellElement> elements,
                         std::span<const std::array<Vec3, 3>> normals) {
  stiffness_.assign(model.node_count(), Mat3::Zero());
  for (const Support& support : model.supports) {
    const std::vector<char> selected = triangles_within(model.shells[support.body].mesh, support.nodes);
    std::size_t triangle = 0;
    for (std::size_t e = 0; e < elements.size(); ++e) {
      if (elements[e].body != support.body || selected[triangle++] == 0) {
        continue;
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& n = normals[e][k];
        const Mat3 along = support.normal_only ? Mat3(n * n.transpose()) : Mat3(Mat3::Identity());
        stiffness_[elements[e].nodes[k]] += support.stiffness * elements[e].area / 3 * along;
      }
    }
  }
}

bool SupportTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    forces.internal.segment<3>(first_freedom(i)) += stiffness_[i] * at.configuration.displacement[i];
  }
  forces.energy += energy(system, at.configuration);
  if (tangent != nullptr) {
    add_linear_stiffness(system, *tangent);
  }
  return true;
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
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    sum += configuration.displacement[i].dot(stiffness_[i] * configuration.displacement[i]);
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
