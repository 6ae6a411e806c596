#include "tunica/mechanics/runs/unloaded.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include <algorithm>
#include <deque>
#include <utility>

namespace tunica {
namespace {

// Of the mean displacement, in the mean: what an iteration still changes, and the loaded shape's distance from the
// image.
constexpr double wanted = 1e-3;
constexpr double farthest = 1e-2;  // more is no such shape; enough under a part of the pressure
constexpr double elsewhere = 0.1;  // a state of rest farther from the image is another one
constexpr std::size_t most_iterations = 40;
constexpr std::size_t patience = 8;       // iterations in a row that come no nearer
constexpr std::size_t iterates_kept = 5;  // iterates that the acceleration combines
constexpr double step_share = 0.5;        // of the residual they leave: more overshoots waves as short as the shells
constexpr double smallest_part = 1.0 / 32;
constexpr std::string_view key = "imaged_at";

RunSettings for_statics(RunSettings settings) {
  settings.kind = StaticRun{false, {1}};
  settings.cg_fixed_count = false;
  settings.converge = std::min(settings.converge, RunSettings().converge);
  settings.settled = 0;
  settings.newton_max = std::max(settings.newton_max, RunSettings().newton_max);
  settings.every = 1;
  return settings;
}

/// The imaged model under the pressures of the image alone, held where the image shows it.
Model under_imaging_pressure(Model model) {
  std::erase_if(model.loads, [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure == nullptr || !pressure->imaged_at;
  });
  for (Load& load : model.loads) {
    auto& pressure = std::get<PressureLoad>(load.kind);
    pressure.value = *std::exchange(pressure.imaged_at, std::nullopt);
    load.ramp = {};
  }
  for (Fix& fix : model.fixes) {
    fix.displacement.setZero();
    fix.ramp = {};
  }
  return model;
}

/// The middle of the shell that lies least in the plane that its normals give it.
Vec3 sharpest_place(const Model& model) {
  double least = infinity;
  Vec3 place = Vec3::Zero();
  for (const ShellBody& body : model.shells) {
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      if (const double agreement = normal_agreement(body.mesh, t); !(agreement >= least)) {
        least = agreement;
        const auto& [i, j, k] = body.mesh.triangles[t];
        place = (body.mesh.vertices[i] + body.mesh.vertices[j] + body.mesh.vertices[k]) / 3;
      }
    }
  }
  return place;
}

/// The equilibrium on the image, solved for the motion that led there from the reference: displacements and rotation
/// vectors (times a length) of all nodes, one after the other.
class InverseStatics {
public:
  InverseStatics(const Model& imaged, const RunSettings& settings)
      : imaged_(imaged),
        pressed_(under_imaging_pressure(imaged)),
        settings_(for_statics(settings)),
        image_(make_checked_system(pressed_, settings_)),
        solver_(image_, settings_),
        stiffness_(image_.pattern) {
    linear_stiffness(image_, stiffness_);
  }

  [[nodiscard]] VectorX no_motion() const { return VectorX::Zero(first_freedom(imaged_.node_count())); }

  /// The imaged model, its shells moved back.
  [[nodiscard]] Model reference(const VectorX& motion) const { return moved_back(imaged_, motion); }

  /// What a part of the pressures leaves out of balance on the image corrects the motion, by the linear stiffness of
  /// the image. None, and `reason`, where the wall folds.
  std::optional<VectorX> improved(const VectorX& motion, double part) {
    ++iterations;
    Model model = under(part, motion);
    std::optional<ShellSystem> system;
    try {
      system = make_checked_system(model, settings_);
    } catch (const InputError&) {  // of shells that were good in the image; what it advises is for images
      reason = "on the way to it the wall folds near " + where(sharpest_place(model));
      return {};
    }
    Configuration there = configuration(motion);
    Forces forces;
    evaluate(*system, {there, load_factors(model, true, 1)}, forces, nullptr);
    VectorX left = forces.external - forces.internal;
    mask(solver_.free(), left);
    VectorX increment;
    const bool solved = forces.valid && solver_.solve(stiffness_, left, increment, factored_).solved;
    if (!solved) {
      reason = forces.valid ? "the linear stiffness is singular" : "on the way to it elements collapse or fold";
      return {};
    }
    factored_ = true;
    advance_configuration(image_, increment, there);
    for (const Piece& piece : system->pieces) {
      if (piece.balanced) {
        take_out_rigid_motion(*system, piece, there);
      }
    }
    return motion_of(there.displacement, [&](std::size_t i) { return logarithm(there.rotation[i]); });
  }

  /// The motion by the pressures from the reference of a motion. None, and `reason`, where there is no rest, or not
  /// near the image. Source: Sellier 2011, "An iterative method for the inverse elasto-static problem".
  std::optional<VectorX> loaded(const VectorX& motion) {
    ++iterations;
    const Configuration there = configuration(motion);
    Resumption near;
    Checkpoint& start = near.near.emplace();
    start.displacement = there.displacement;
    start.rotation = there.rotation;
    State last;
    try {
      (void)solve(
          under(1, motion), settings_, [&](const State& state) { last = state; }, {}, near);
    } catch (const RequirementError& error) {
      reason = error.what();
      return {};
    }
    VectorX result = motion_of(last.displacement, [&](std::size_t i) { return last.rotation[i]; });
    if (lengths(result - motion)[0] > elsewhere * lengths(motion)[0]) {
      reason = "from the shape that would be in balance there the pressure leads to another state of rest";
      return {};
    }
    return result;
  }

  /// mm^3, of the closed shells of the reference.
  [[nodiscard]] std::optional<double> volume(const VectorX& motion) const {
    const Model model = under(0, motion);
    const ShellSystem system = make_system(model);
    return enclosed_volume(system, reference_configuration(system));
  }

  /// Mean and largest length of the displacements.
  [[nodiscard]] std::array<double, 2> lengths(const VectorX& motion) const {
    double sum = 0, largest = 0;
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      const double length = displacement(motion, i).norm();
      sum += length;
      largest = std::max(largest, length);
    }
    return {sum / real(imaged_.node_count()), largest};
  }

  std::size_t iterations = 0;
  std::string reason;  ///< why there is no answer

private:
  [[nodiscard]] Vec3 displacement(const VectorX& motion, std::size_t node) const {
    return motion.segment<3>(first_freedom(node));
  }
  [[nodiscard]] Vec3 rotation(const VectorX& motion, std::size_t node) const {
    return motion.segment<3>(first_freedom(node) + 3) / image_.length;
  }

  [[nodiscard]] VectorX motion_of(const std::vector<Vec3>& displacement, const auto& rotation) const {
    VectorX motion = no_motion();
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      motion.segment<3>(first_freedom(i)) = displacement[i];
      motion.segment<3>(first_freedom(i) + 3) = image_.length * rotation(i);
    }
    return motion;
  }

  [[nodiscard]] Configuration configuration(const VectorX& motion) const {
    Configuration there = reference_configuration(image_);
    for (std::size_t i = 0; i < imaged_.node_count(); ++i) {
      there.displacement[i] = displacement(motion, i);
      there.rotation[i] = exponential(rotation(motion, i));
    }
    return there;
  }

  [[nodiscard]] Model moved_back(Model model, const VectorX& motion) const {
    for (std::size_t b = 0; b < model.shells.size(); ++b) {
      ShellMesh& mesh = model.shells[b].mesh;
      const std::size_t first = model.first_node(b);
      const auto turned_back = [&](Index node, const Vec3& normal) {
        return Vec3(exponential(-rotation(motion, first + node)) * normal);
      };
      for (Index i = 0; i < mesh.vertices.size(); ++i) {
        mesh.vertices[i] -= displacement(motion, first + i);
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

  /// The reference of a motion, with a part of the pressures.
  [[nodiscard]] Model under(double part, const VectorX& motion) const {
    Model model = moved_back(pressed_, motion);
    for (Load& load : model.loads) {
      std::get<PressureLoad>(load.kind).value *= part;
    }
    return model;
  }

  const Model& imaged_;
  const Model pressed_;
  const RunSettings settings_;
  const ShellSystem image_;
  TangentSolver solver_;
  BlockMatrix stiffness_;
  bool factored_ = false;
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
      if (residual_changes_.size() > iterates_kept) {
        residual_changes_.pop_front();
        image_changes_.pop_front();
      }
    }
    last_residual_ = residual;
    last_image_ = g;
    VectorX result = y + step_share * residual;
    if (!residual_changes_.empty()) {
      Eigen::MatrixXd changes(y.size(), narrow<Eigen::Index>(residual_changes_.size()));
      for (std::size_t k = 0; k < residual_changes_.size(); ++k) {
        changes.col(narrow<Eigen::Index>(k)) = residual_changes_[k];
      }
      const VectorX weights = changes.colPivHouseholderQr().solve(residual);
      for (std::size_t k = 0; k < residual_changes_.size(); ++k) {
        result -= weights[narrow<Eigen::Index>(k)] * (image_changes_[k] - (1 - step_share) * residual_changes_[k]);
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

struct Approach {
  VectorX motion;
  std::array<double, 2> off{infinity, infinity};  ///< mean and largest change by the map
  bool near = false;                              ///< it is less than `farthest`
};

/// Finds a motion that a map leaves where it is. @param tolerance  of the mean displacement, what it may still change
Approach approach(InverseStatics& inverse, VectorX motion, double tolerance,
                  const std::function<std::optional<VectorX>(const VectorX&)>& map) {
  inverse.reason = "the iterations do not converge";
  Acceleration acceleration;
  Approach best{motion};
  double size = 0;
  std::size_t in_vain = 0;
  for (std::size_t iteration = 0; iteration < most_iterations && in_vain < patience; ++iteration) {
    const auto next = map(motion);
    if (!next) {
      break;
    }
    const auto off = inverse.lengths(*next - motion);
    ++in_vain;
    if (off[0] < best.off[0]) {
      in_vain = 0;
      best = {motion, off};
      size = inverse.lengths(*next)[0];
    }
    if (off[0] <= tolerance * size) {
      break;
    }
    motion = acceleration.next(motion, *next);
  }
  best.near = best.off[0] <= farthest * size;
  return best;
}

/// Of both shapes at planes across the longest axis of the imaged one, which the unloaded one keeps.
std::optional<Unloaded::Roundness> least_roundness(const Model& imaged, const Model& unloaded) {
  constexpr int planes = 15;
  std::optional<Unloaded::Roundness> least;
  for (std::size_t b = 0; b < imaged.shells.size(); ++b) {
    const TriangleMesh image = flat_facets(imaged.shells[b].mesh);
    const TriangleMesh without = flat_facets(unloaded.shells[b].mesh);
    Vec3 centre = Vec3::Zero();
    for (const Vec3& v : image.vertices) {
      centre += v / real(image.vertices.size());
    }
    Mat3 spread = Mat3::Zero();
    for (const Vec3& v : image.vertices) {
      spread += (v - centre) * (v - centre).transpose();
    }
    const Vec3 axis = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors().col(2);
    const auto roundness_at = [&](const TriangleMesh& mesh, double part) {
      double low = infinity, high = -infinity;
      for (const Vec3& v : mesh.vertices) {
        low = std::min(low, axis.dot(v - centre));
        high = std::max(high, axis.dot(v - centre));
      }
      return section_roundness(mesh, centre + (low + part * (high - low)) * axis, axis);
    };
    for (int i = 1; i <= planes; ++i) {  // near its ends a shape of facets has sections of few corners
      const auto before = roundness_at(image, real(i + 1) / (planes + 3));
      const auto after = roundness_at(without, real(i + 1) / (planes + 3));
      if (before && after && (!least || *after * least->image < least->unloaded * *before)) {
        least = {*before, *after};
      }
    }
  }
  return least;
}

[[noreturn]] void refuse(double part, const std::string& reason) {
  throw RequirementError(fmt::format(
      "no unloaded shape was found that lies where the image shows it under {:.4g} times the pressure {}: "
      "{}; was the wall as thick and as stiff, and the pressure as high, when the image was taken? Where they were, "
      "take more shells",
      part, key, reason));
}

}  // namespace

Unloaded find_unloaded(const Model& imaged, const RunSettings& settings,
                       const std::function<void(double, double)>& on_iteration) {
  require_valid(imaged);
  require_shells_only(imaged);
  InverseStatics inverse(imaged, settings);
  VectorX found = inverse.no_motion();
  double part = 0, step = 1;
  while (part < 1) {
    const double next = std::min(1.0, part + step);
    const Approach there = approach(inverse, part > 0 ? VectorX(next / part * found) : found,
                                    next == 1 ? wanted : farthest, [&](const VectorX& motion) {
                                      auto improved = inverse.improved(motion, next);
                                      if (improved && on_iteration) {
                                        on_iteration(next, inverse.lengths(*improved - motion)[0]);
                                      }
                                      return improved;
                                    });
    if (there.near) {
      found = there.motion;
      part = next;
      step *= 2;
      continue;
    }
    step /= 2;
    if (step < smallest_part) {
      refuse(next, inverse.reason);
    }
  }
  const Approach loaded =
      approach(inverse, found, wanted, [&](const VectorX& motion) { return inverse.loaded(motion); });
  if (!loaded.near) {
    refuse(1, inverse.reason);
  }
  Unloaded unloaded{inverse.reference(loaded.motion),
                    inverse.volume(loaded.motion),
                    loaded.off[0],
                    loaded.off[1],
                    inverse.iterations,
                    {}};
  unloaded.roundness = least_roundness(imaged, unloaded.model);
  for (Load& load : unloaded.model.loads) {
    if (auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
      pressure->imaged_at.reset();
      pressure->unload = false;
    }
  }
  return unloaded;
}

}  // namespace tunica
