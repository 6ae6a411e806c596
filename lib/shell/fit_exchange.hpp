#pragma once

#include "core/progress.hpp"
#include "shell/fit_state.hpp"

#include <functional>
#include <limits>

namespace tunica {

struct ExchangeOptions {
  double limit = 0;      ///< mm: no error of the samples is above it
  double tolerance = 0;  ///< mm: what certificates are to hold
  double kink = 0;       ///< degrees by which normals that meet at a node may part; 0: not at all
  double effort = 1;     ///< times the pieces that are fitted anew
  int rounds = std::numeric_limits<int>::max();         ///< searches at most: of the whole, then after kicks
  std::function<void(const FitState&)> on_better = {};  ///< told of every one with fewer shells
  Progress progress = {};
};

/// Fewer shells by changes of small pieces, each by itself: an edge taken at random is merged, or one of its nodes
/// taken out where that is not possible, whatever that does to errors and angles for the time being, and the piece
/// around it is fitted anew so that its largest error is least (see lessen_largest()), if need be with a split where it
/// is then worst. What is neither dearer (see price()) nor above `limit` (mm) nor crosses more is kept, so that also
/// steps that bring nothing lead on to others, where a certificate of the surroundings finds nothing above `tolerance`
/// (mm). Larger pieces once a round of smaller ones brought nothing. Eight changes are tried at once, one of them is
/// kept. All that with normals that may part, at corners that meet at a node, by `kink` degrees (none for 0; by more
/// than 45 only where many nodes make use of that, as on targets with folds): every patch follows the target more
/// closely, so that fewer do; what the limit does not ask for is joined again, and the state keeps FitLimits::kink. Not
/// for watertight patches: their edges follow the normals of both sides. Once that brings nothing more, edges are split
/// somewhere, to search on there: what does not come back to as few is undone. Deterministic, whatever the number of
/// threads. Parallel. Cost: eight pieces per shell are fitted anew, at least 600 (20 per shell, where that is less) and
/// at most 6,000, some 30 ms each: where too large an error is foretold they are given up.
void exchange_pieces(FitSamples& samples, FitState& state, const ExchangeOptions& options);

/// The same once, within a piece of a mesh and without certificates, which would need what is around it: what samples
/// miss is left to be mended in the whole. Normals part as FitLimits::kink allows. @param most  pieces fitted anew
void exchange_in_piece(FitSamples& samples, FitState& state, double limit, std::size_t most);

}  // namespace tunica
