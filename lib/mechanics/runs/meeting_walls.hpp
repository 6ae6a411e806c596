#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/mechanics/contact/surface_faces.hpp"
#include "tunica/mechanics/runs/solve.hpp"

#include <array>
#include <optional>
#include <vector>

/// Bodies that pass through each other, or walls that overlap, where no contact holds them apart.
namespace tunica {

/// Bodies that pass through each other or themselves before anything moves. Contact refuses those that it holds apart.
/// Errors: InputError as require_valid() of the model. Cost: that of crossing_patches().
std::vector<Warning> doubts_of_meeting_walls(const Model& model);

/// Looks at each state of a run, in their order, for shells and boundaries of solids that pass through each other
/// (whole pairs of curved surfaces; by their facets where these are all that is known, or a surface folds over), for
/// walls that overlap by more than half, and for what has passed through another since the state before, each node
/// going straight. What is so in the reference, and what is tied, is left out. The model must outlive it. Limits: a
/// body wholly within another from the start crosses nothing. Of walls that pass each other wholly, only those are seen
/// whose nodes meet a shell of the other, and whose middles are then farther apart than the wall and a tenth of a
/// shell's edge.
class CrossingWatch {
public:
  /// Errors: InputError as require_valid() of the model.
  explicit CrossingWatch(const Model& model);

  /// Nothing once some are found. Errors: InputError as require_valid() of the state. Cost: crossing_patches(), and the
  /// pairs of shells whose ways cross.
  void see(const State& state);
  [[nodiscard]] const std::optional<Warning>& found() const { return found_; }

private:
  const Model& model_;
  std::vector<SurfaceFace> faces_;                           ///< of all bodies
  std::vector<Vec3> reference_, last_;                       ///< mm, nodes there and in the state seen before
  std::optional<std::vector<std::array<Index, 2>>> before_;  ///< crossings of the reference, once they are wanted
  std::optional<Warning> found_;
};

}  // namespace tunica
