#pragma once

#include "shell/fit_mesh.hpp"
#include "shell/fit_place.hpp"

namespace tunica {

/// A shell mesh under edit with what is known of the distance of each of its patches to the target.
class FitState {
public:
  FitState(const FitSamples& samples, FitMesh mesh, const FitLimits& limits);

  FitMesh mesh;
  FitLimits limits;

  struct Patch {
    std::vector<Index> guesses;   ///< see FitSamples::from_patch
    std::vector<Index> attached;  ///< points of the target
    std::vector<Residual> residuals;
    double error = 0;               ///< mm, largest residual
    std::vector<Vec2> places = {};  ///< of the patch, measured besides those of the grid, until it is another patch
  };
  std::vector<Patch> patches;  ///< #T

  [[nodiscard]] const FitSamples& samples() const { return *samples_; }

  /// Attaches every point of the target to the patch it is closest to. Parallel.
  void attach();

  /// The same, and the nearest triangle of a tessellation is not always of the nearest patch: from there to neighbours
  /// that are closer. A tenth dearer. Parallel.
  void attach_closely() {
    attach();
    attach_again();
  }

  /// The same where the patches have moved little since: from patch to patch, downhill. Ten times as fast. Parallel.
  void attach_again();

  /// Measures all patches, or one. Parallel.
  void measure();
  /// @param doubted  mm: see FitSamples::from_patch
  void measure(Index t, double doubted);

  [[nodiscard]] PatchShape shape(Index t) const {
    return {mesh.corners(t), mesh.corner_normals(t), mesh.kind, mesh.creases(t)};
  }
  [[nodiscard]] bool is_sound(Index t, double agreement, double angle) const {
    return tunica::is_sound(shape(t), agreement, angle);
  }

  /// Largest residual of all patches.
  [[nodiscard]] double error() const;

  /// Moves all nodes and turns all normals at once by one Gauss-Newton step on the residuals weighted by
  /// (|residual| / largest)^(power - 2), where that lessens the sum of the powers around each node.
  /// @param power  even, >= 2; smoothing  pull towards the middle of the ring, relative to what keeps nodes from
  /// sliding
  /// @return how much of the cost is left, <= 1
  double solve(int power, double smoothing);

private:
  [[nodiscard]] double cost_of(const Patch& patch, int power, double scale) const;
  /// Patches whose residuals change when these nodes move: theirs, and those that meet them along an edge.
  void changed_patches(const std::vector<std::uint8_t>& moved, std::vector<std::uint8_t>& changed) const;
  [[nodiscard]] Vec3 middle_of_ring(Index node) const;

  const FitSamples* samples_;
};

}  // namespace tunica
