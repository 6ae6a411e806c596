#include "tunica/mechanics/runs/unloaded.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <fmt/format.h>

#include <Eigen/QR>

#include <algorithm>
#include <deque>

namespace tunica {
namespace {

constexpr double close_enough = 1e-3;      // of the mean displacement: the loaded shape's mean distance from the image
constexpr double close_on_the_way = 1e-2;  // the same, under a part of the pressure
constexpr double farthest = 1e-2;          // the same: more is no such shape
constexpr std::size_t most_iterations = 40;
constexpr std::size_t patience = 8;    // iterations in a row that come no nearer
constexpr std::size_t remembered = 5;  // iterates that the acceleration combines
constexpr double smallest_part = 1.0 / 32;
constexpr std::string_view key = "imaged_at";

/// Displacements and rotation vectors (times a length) of all nodes from the reference to the image, one after the
/// other.
class FixedPoint {
public:
  FixedPoint(const Model& imaged, const RunSettings& settings) : imaged_(imaged), settings_(settings) {
    settings_.kind = StaticRun{false, {1}};
    settings_.cg_fixed_count = false;
    settings_.converge = std::min(settings_.converge, RunSettings().converge);
    settings_.settled = 0;
    settings_.newton_max = std::max(settings_.newton_max, RunSettings().newton_max);
    settings_.every = 1;
    std::size_t edges = 0;
    for (const ShellBody& body : imaged.shells) {
      for (const auto& v : body.mesh.triangles) {
        length_ += (body.mesh.vertices[v[1]] - body.mesh.vertices[v[0]]).norm();
        ++edges;
      }
    }
    length_ /= real(edges);
  }

  [[nodiscard]] Eigen::Index size() const { return narrow<Eigen::Index>(6 * imaged_.node_count()); }

  /// The imaged model, its shells moved back.
  [[nodiscard]] Model reference(const VectorX& from) const {
    Model model = imaged_;
    for (std::size_t b = 0; b < model.shells.size(); ++b) {
      ShellMesh& mesh = model.shells[b].mesh;
      const std::size_t first = model.first_node(b);
      const auto turned_back = [&](Index node, const Vec3& normal) {
        return Vec3(exponential(-rotation(from, first + node)) * normal);
      };
      for (Index i = 0; i < mesh.vertices.size(); ++i) {
        mesh.vertices[i] -= displacement(from, first + i);
        if (!mesh.normals.empty()) {
          mesh.normals[i] = turned_back(i, mesh.normals[i]);
        }
      }
      for (std::size_t t = 0; t < mesh.corner_normals.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
          mesh.corner_normals[t][k] = turned_back(mesh.triangles[t][k], mesh.corner_normals[t][k]);
        }
      }
    }
    return model;
  }

  /// What a part of the pressures makes of the reference; none, and `reason`, where it is in no state of rest.
  std::optional<VectorX> solved(const VectorX& from, double part) {
    Model model = reference(from);
    std::erase_if(model.loads, [](const Load& load) {
      const auto* pressure = std::get_if<PressureLoad>(&load.kind);
      return pressure == nullptr || !pressure->imaged_at;
    });
    for (Load& load : model.loads) {
      auto& pressure = std::get<PressureLoad>(load.kind);
      pressure.value = part * *pressure.imaged_at;
      load.ramp = {};
    }
    for (Fix& fix : model.fixes) {
      fix.displacement.setZero();
      fix.ramp = {};
    }
    Resumption near;
    Checkpoint& start = near.near.emplace();
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      start.displacement.push_back(displacement(from, i));
      start.rotation.push_back(exponential(rotation(from, i)));
    }
    State last;
    ++iterations;
    try {
      (void)solve(
          model, settings_,
          [&](const State& state) {
            volume = state.time == 0 ? state.volume : volume;
            last = state;
          },
          {}, near);
    } catch (const RequirementError& error) {
      reason = error.what();
      return {};
    } catch (const InputError& error) {
      if (from.isZero(0)) {
        throw;  // of the image itself
      }
      // Shells that were good in the image: what is said of them names the fold, and what it advises is for images.
      const std::string fault = error.what();
      reason = "on the way to it the wall folds (" + fault.substr(0, fault.find("; ")) + ")";
      return {};
    }
    VectorX to(size());
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      to.segment<3>(first_of(i)) = last.displacement[i];
      to.segment<3>(first_of(i) + 3) = length_ * last.rotation[i];
    }
    return to;
  }

  /// Mean and largest length of the displacements.
  [[nodiscard]] std::array<double, 2> lengths(const VectorX& of) const {
    double sum = 0, largest = 0;
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      const double length = displacement(of, i).norm();
      sum += length;
      largest = std::max(largest, length);
    }
    return {sum / real(imaged_.node_count()), largest};
  }

  std::size_t iterations = 0;
  std::optional<double> volume;  ///< of the last reference
  std::string reason;

private:
  static Eigen::Index first_of(std::size_t node) { return narrow<Eigen::Index>(6 * node); }
  [[nodiscard]] Vec3 displacement(const VectorX& of, std::size_t node) const { return of.segment<3>(first_of(node)); }
  [[nodiscard]] Vec3 rotation(const VectorX& of, std::size_t node) const {
    return of.segment<3>(first_of(node) + 3) / length_;
  }

  const Model& imaged_;
  RunSettings settings_;
  double length_ = 0;  ///< mm, mean edge
};

/// The next iterate of a fixed point y = G(y) from the last ones: the combination of them whose residuals G(y) - y
/// cancel best, by least squares. Source: Walker, Ni 2011, "Anderson acceleration for fixed-point iterations".
class Acceleration {
public:
  VectorX next(const VectorX& y, const VectorX& g) {
    const VectorX residual = g - y;
    if (last_residual_.size() > 0) {
      residual_changes_.push_back(residual - last_residual_);
      image_changes_.push_back(g - last_image_);
      if (residual_changes_.size() > remembered) {
        residual_changes_.pop_front();
        image_changes_.pop_front();
      }
    }
    last_residual_ = residual;
    last_image_ = g;
    VectorX result = g;
    if (!residual_changes_.empty()) {
      Eigen::MatrixXd changes(y.size(), narrow<Eigen::Index>(residual_changes_.size()));
      for (std::size_t k = 0; k < residual_changes_.size(); ++k) {
        changes.col(narrow<Eigen::Index>(k)) = residual_changes_[k];
      }
      const VectorX weights = changes.colPivHouseholderQr().solve(residual);
      for (std::size_t k = 0; k < residual_changes_.size(); ++k) {
        result -= weights[narrow<Eigen::Index>(k)] * image_changes_[k];
      }
    }
    return result;
  }

private:
  std::deque<VectorX> residual_changes_, image_changes_;
  VectorX last_residual_, last_image_;
};

void require_shells_only(const Model& model) {
  for (const Load& load : model.loads) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure == nullptr || !pressure->imaged_at) {
      continue;
    }
    if (!model.solids.empty() || !model.rigids.empty() || !model.contacts.empty() || !model.attachments.empty()) {
      throw InputError(
          fmt::format("{}{}: the unloaded shape is found for shells alone: leave out solids, rigid bodies, "
                      "contacts and attachments",
                      load.said_at.empty() ? "" : load.said_at + ": ", key));
    }
  }
}

}  // namespace

bool is_imaged_under_pressure(const Model& model) {
  return std::any_of(model.loads.begin(), model.loads.end(), [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure != nullptr && pressure->imaged_at.has_value();
  });
}

Unloaded find_unloaded(const Model& imaged, const RunSettings& settings,
                       const std::function<void(double, double)>& on_iteration) {
  require_shells_only(imaged);
  FixedPoint map(imaged, settings);
  VectorX found = VectorX::Zero(map.size());
  std::array<double, 2> distance{0, 0};
  // To the fixed point under a part of the pressures. @return whether it is near enough
  const auto approach = [&](VectorX& y, double part) {
    const double wanted = part == 1 ? close_enough : close_on_the_way;
    Acceleration acceleration;
    VectorX best = y;
    std::array<double, 2> least{infinity, infinity};
    double size = 0;
    std::size_t in_vain = 0;
    for (std::size_t iteration = 0; iteration < most_iterations && in_vain < patience; ++iteration) {
      const auto image = map.solved(y, part);
      if (!image) {
        break;
      }
      const auto off = map.lengths(*image - y);
      if (on_iteration) {
        on_iteration(part, off[0]);
      }
      ++in_vain;
      if (off[0] < least[0]) {
        in_vain = 0;
        least = off;
        best = y;
        size = map.lengths(*image)[0];
      }
      if (off[0] <= wanted * size) {
        break;
      }
      y = acceleration.next(y, *image);
    }
    y = best;
    distance = least;
    return least[0] <= std::max(wanted, farthest) * size;
  };
  double part = 0, step = 1;
  while (part < 1) {
    const double next = std::min(1.0, part + step);
    VectorX attempt = part > 0 ? VectorX(next / part * found) : found;
    if (approach(attempt, next)) {
      found = attempt;
      part = next;
      step *= 2;
      continue;
    }
    step /= 2;
    if (step < smallest_part) {
      throw RequirementError(fmt::format(
          "no unloaded shape was found that lies where the image shows it under {:.4g} times the pressure {}: {}; was "
          "the wall as thick and as stiff, and the pressure as high, when the image was taken? Where they were, more "
          "shells may follow the way",
          next, key, map.reason.empty() ? "the iterations do not converge" : map.reason));
    }
  }
  Unloaded unloaded{map.reference(found), map.volume, distance[0], distance[1], map.iterations};
  for (Load& load : unloaded.model.loads) {
    if (auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
      pressure->imaged_at.reset();
    }
  }
  return unloaded;
}

}  // namespace tunica
