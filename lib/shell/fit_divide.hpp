#pragma once

#include "shell/fit_state.hpp"

#include <functional>

namespace tunica {

/// Divides a mesh into pieces side by side and changes each by itself, in parallel: where all together would wait for
/// the worst place of all, each waits for its own. Nodes at the rims of pieces stay where they are; other cuts, see
/// `turn`, free them the next time. Points that the samples of a piece gained are kept.
/// @param shells  per piece, roughly
/// @param turn    0, 1, ...: pieces are cut along other planes each time
/// @param change  of a piece; it heeds the points of the target that are closest to the piece alone. Called from
/// several threads at once; what comes of it does not depend on their number
/// The state must have been attached and measured, and is so in the end. Cost beside the changes: some 0.3
/// microseconds per vertex of the target (of 200,000 at most), and per piece a copy of what the whole consists of.
void change_pieces(FitSamples& samples, FitState& state, std::size_t shells, int turn,
                   const std::function<void(FitSamples&, FitState&)>& change);

}  // namespace tunica
