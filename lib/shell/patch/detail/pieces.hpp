#pragma once

#include "tunica/shell/patch/curved_surface.hpp"

/// Inside shell/patch: into how many pieces patches are cut.
namespace tunica {

/// Pieces per edge, 1 and more, for which flatness() is at most `deviation` (mm, > 0).
double pieces_for(const CubicPatch& patch, double deviation);

/// Errors: RequirementError: so many triangles are more than `most`.
void require_few_triangles(double triangles, std::size_t most, double deviation);

}  // namespace tunica
