#pragma once

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

/// Mends thin triangles, if need be by way of larger errors that all nodes together make good, as long as that lowers
/// the price. @param limit  mm; @param most  shells
void shape_up(FitSamples& samples, FitState& state, double limit, std::size_t most);

}  // namespace tunica
