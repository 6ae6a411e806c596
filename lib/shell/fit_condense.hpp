#pragma once

#include "core/progress.hpp"
#include "shell/fit_state.hpp"

namespace tunica {

inline constexpr int usual_condensing = 9;  ///< rounds

/// Finds fewer shells by less error everywhere: steps of all nodes lessen the largest error (see lessen_largest()),
/// part of the room that this leaves is used up by mergers, cheapest first, whatever their error, and further steps
/// make them good. What no samples saw joins them in every round. It ends with the largest error as small as it gets,
/// below `limit` (mm) where it was so. Cost: a round some 2 ms per shell.
void condense(FitSamples& samples, FitState& state, double limit, int rounds, const Progress& progress);

/// Brings patches with an error above `limit` (mm) below it, each by steps of its nodes and, if need be, of one or two
/// rings around. The state must have been attached and measured, and is so in the end. @return how many are left
/// Cost: some 10 ms each.
std::size_t mend_pieces(FitState& state, double limit);

struct CondenseOptions {
  double limit = 0;  ///< mm: no error of the samples is above it
  double kink = 0;   ///< degrees by which normals that meet at a node may part; 0: not at all
  int rounds = usual_condensing;
  Progress progress = {};
};

/// What takes most of what exchanges bring in a fraction of their time, for meshes of many shells: normals may part at
/// once, see exchange_pieces(), and all nodes together make mergers good, see condense(). The state need not be certain
/// before, and is not afterwards; normals stay parted.
void condense_parted(FitSamples& samples, FitState& state, const CondenseOptions& options);

/// By how far normals that meet at a node may part at first, degrees.
inline constexpr double first_kink = 45;

/// Whether so many normals part by nearly `kink` degrees that more would serve: as on targets with folds.
bool many_part_by(const FitMesh& mesh, double kink);

}  // namespace tunica
