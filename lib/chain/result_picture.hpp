#pragma once

#include "tunica/mechanics/runs/drawn_state.hpp"

#include <optional>
#include <string>

namespace tunica::chain {

struct ResultPictureOptions {
  Colouring colour = Colouring::membrane;
  double magnify = 1;           ///< > 0: displacements are drawn that many times as large; rigid bodies stay
  std::optional<double> range;  ///< MPa, mm, or 1: where the colours end; none: at the largest value
  std::string when;             ///< which state it is, e.g. "under the whole load"
  bool is_unloaded = false;     ///< the reference is not what was imaged, but the shape without the pressure of then
};

/// A picture of a state of all bodies, as moved_picture(): the curved shells, the outer faces of solids, rigid bodies
/// in grey (a plane only from the side on which the others are). @return PNG. Limits: a model without bodies that
/// deform has no picture.
std::string result_picture(const Model& model, const State& state, const ElementFields& fields,
                           const ResultPictureOptions& options);

}  // namespace tunica::chain
