#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <optional>
#include <string>

namespace tunica {

enum class Colouring {
  membrane,      ///< von Mises stress of the mean over the wall; of solids of the stress
  stress,        ///< von Mises: of shells the larger of both faces
  displacement,  ///< its length
  strain,        ///< the largest principal one: as stress
};

struct ResultPictureOptions {
  Colouring colour = Colouring::membrane;
  double magnify = 1;           ///< > 0: displacements are drawn that many times as large; rigid bodies stay
  std::optional<double> range;  ///< MPa, mm, or 1: where the colours end; none: at the largest value
  std::string when;             ///< which state it is, e.g. "under the whole load"
};

/// A picture of a state of all bodies, as surface_picture(): the curved shells, welded where patches do not quite meet,
/// the surfaces of solids, rigid bodies in grey (a plane only from the side on which the others are), the outline of
/// the reference where it differs visibly from the state. @return PNG.
/// Limits: a model without bodies that deform has no picture.
std::string result_picture(const Model& model, const State& state, const ElementFields& fields,
                           const ResultPictureOptions& options);

}  // namespace tunica
