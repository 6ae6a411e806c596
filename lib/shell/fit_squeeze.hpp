#pragma once

#include "core/progress.hpp"
#include "shell/fit_state.hpp"

namespace tunica {

/// What a search for few shells lessens: shells, and for each thin triangle FitLimits::price_of_a_thin_one.
std::size_t price(const FitState& state);

/// Moves all nodes until no error, nor that of points that the samples missed, is above `limit` (mm).
/// @return whether that was possible
bool regains(FitSamples& samples, FitState& state, double limit);

/// The same where few points are too far off, with as few further shells as it takes: at most three splits, `most`
/// shells in all. The state need not have been attached to samples that were added, and is only changed where this is
/// possible.
bool regains_with_few(FitSamples& samples, FitState& state, double limit, std::size_t most);

/// Finds fewer shells by mergers that no single node can make good but all nodes together do: many at once, then ever
/// fewer. No error gets above `limit` (mm), and no more shells cross. Cost: 12 searches at most, 2 of many shells.
void squeeze(FitSamples& samples, FitState& state, double limit);

/// Finds fewer shells by less error everywhere: steps of all nodes lessen the largest error (see lessen_largest()), part
/// of the room that this leaves is used up by mergers, cheapest first, whatever their error, and further steps make
/// them good. What no samples saw joins them in every round. It ends with the largest error as small as it gets, below
/// `limit` (mm) where it was so. Cost: a round some 2 ms per shell.
void condense(FitSamples& samples, FitState& state, double limit, int rounds, const Progress& progress);

/// Mends thin triangles, if need be by way of larger errors that all nodes together make good, as long as that lowers
/// the price. @param limit  mm; @param most  shells
void shape_up(FitSamples& samples, FitState& state, double limit, std::size_t most);

}  // namespace tunica
