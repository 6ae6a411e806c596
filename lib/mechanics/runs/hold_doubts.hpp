#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/mechanics/runs/solve.hpp"

#include <array>
#include <optional>
#include <vector>

/// What of a run hints that an organ is not held as it is in the body. Each sentence begins with the place and says
/// what to do. Errors: InputError as require_valid() of the model and its state.
namespace tunica {

/// Open ends of a shell under pressure that nothing holds and no force pulls: what continues the vessel there would
/// pull with the pressure times the lumen. And rims that slide in planes that the wall meets at a slant, where it would
/// pull in the plane as well (slant_of_rim()). And edges that run beside each other within half of the wall, where
/// parts should join; and what doubts_of_meeting_walls() finds, at its cost.
std::vector<Warning> doubts_of_ends(const Model& model);

/// Swings of a state: the rigid motion nearest to what a connected piece under pressure does makes more than half of
/// its largest displacement, and more than half of its wall's thickness, and nothing prescribes it. Cost: linear.
std::vector<Warning> swings_of(const Model& model, const State& state);

/// Bodies of a static run of which contact without friction alone holds some rigid motion: round or flat, they may spin
/// or slide, and displacements count that. Notes. Cost: making the system ready, where there is contact.
std::vector<Warning> doubts_of_loose_bodies(const Model& model, const RunSettings& settings);

/// A static run under suction above a fifth of the load at which the perfect shell buckles by the linear theory: real
/// shells, never perfect, yield at a part of it (a sphere with a dimple one wall deep at .36). Nothing where shells are
/// not alone. Cost: a linear buckling analysis, where there is suction at all.
/// @param snaps  of the run itself, which may come before the load of linear buckling
std::vector<Warning> doubts_of_suction(const Model& model, const RunSettings& settings, const std::vector<Snap>& snaps);

}  // namespace tunica
