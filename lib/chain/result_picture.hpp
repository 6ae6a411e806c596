#pragma once

#include "tunica/mechanics/runs/drawn_state.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tunica::chain {

struct ResultPictureOptions {
  Colouring colour = Colouring::membrane;
  double magnify = 1;           ///< > 0: displacements are drawn that many times as large; rigid bodies stay
  std::optional<double> range;  ///< MPa, mm, or 1: where the colours end; none: at the largest value
  /// Of the run, one panel each: the load factor, s of a motion, the number of a mode. None: the last state, or the
  /// first mode, from two sides.
  std::vector<double> moments{};
  /// What lies on the side to which this points is left away, and one looks from there; none: nothing.
  std::optional<Vec3> cut{};
  std::optional<double> cut_at{};  ///< mm along it; none: the middle of the bodies
  std::string caption{};           ///< what bodies and loads are
  std::string axes = "xyz";        ///< as PictureOptions
  bool is_unloaded = false;        ///< the reference is not what was imaged, but the shape without the pressure of then
};

/// A state that is drawn.
struct PicturedState {
  State state;
  ElementFields fields;
  std::string when;  ///< which it is, e.g. "under the whole load"
};

/// A picture of states of all bodies, as moved_picture() or, of moments or cut open, as moments_picture(): the curved
/// shells, the outer faces of solids, rigid bodies in grey and whole (a plane only from the side on which the others
/// are). @return PNG. Limits: a model without bodies that deform has no picture.
/// @param states  at least one
std::string result_picture(const Model& model, const std::vector<PicturedState>& states,
                           const ResultPictureOptions& options);

}  // namespace tunica::chain
