#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Fewer shells by changes of small pieces, each by itself: an edge taken at random is merged whatever that does to
/// errors and angles for the time being, and the piece around it is fitted anew, if need be with a split where it is
/// then worst. What is neither dearer (see price()) nor above `limit` (mm) nor crosses more is kept, so that also
/// steps that bring nothing lead on to others.
/// Deterministic. Cost: four tries per shell up to 1,000, most of which end at once; at most 200 pieces are fitted
/// anew, some 50 ms each. Of more than 400 shells none.
void exchange_pieces(FitSamples& samples, FitState& state, double limit);

}  // namespace tunica
