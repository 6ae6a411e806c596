#pragma once

#include "core/progress.hpp"
#include "shell/fit_result.hpp"
#include "shell/fit_state.hpp"

namespace tunica {

inline constexpr int usual_condensing = 9;  ///< rounds

struct CondenseOptions {
  double limit = 0;  ///< mm: no error of the samples is above it
  double kink = 0;   ///< degrees by which normals that meet at a node may part; 0: not at all
  int rounds = usual_condensing;
  /// Whether the mesh is a piece of many shells: then it may end close to the limit, as what certificates find is
  /// mended in the whole; else what ends there is given up.
  bool is_piece = false;
  double exchanging = 0;  ///< of the usual effort: shells of pieces are exchanged afterwards
  Progress progress = {};
};

/// Finds fewer shells by less error everywhere: steps of all nodes lessen the largest error (see lessen_largest()),
/// part of the room that this leaves is used up by mergers, cheapest first, whatever their error, and further steps
/// make them good. What no samples saw joins them in every round. It ends with the largest error as small as it gets,
/// below the limit where it was so. Cost: a round some 2 ms per shell.
void condense(FitSamples& samples, FitState& state, const CondenseOptions& options);

/// Brings patches with an error above `limit` (mm) below it, each by steps of its nodes and, if need be, of one or two
/// rings around. The state must have been attached and measured, and is so in the end. @return how many are left
/// Cost: some 10 ms each.
std::size_t mend_pieces(FitState& state, double limit);

/// What takes most of what exchanges bring in a fraction of their time, for meshes of many shells: normals may part at
/// once, see exchange_pieces(), and all nodes together make mergers good, see condense(); of more than some 450 shells
/// those of pieces of 300, five times with other pieces. The state need not be certain before, and is not afterwards;
/// normals stay parted. Cost: linear in the shells, some 10 ms each.
void condense_parted(FitSamples& samples, FitState& state, const CondenseOptions& options);

/// The same, where asked for followed by exchanges within pieces, see exchange_in_piece(), and by mending what
/// certificates find, with more shells where nothing else does. @param tolerance  mm
/// @return whether the tolerance certainly holds for what it became: then that is in `result`, where it is better
/// Cost of exchanging: some 60 ms per shell.
bool condense_certainly(FitSamples& samples, FitState& state, FitResult& result, double tolerance,
                        const CondenseOptions& options);

/// By how far normals that meet at a node may part at first, degrees.
inline constexpr double first_kink = 45;

/// Whether so many normals part by nearly `kink` degrees that more would serve: as on targets with folds.
bool many_part_by(const FitMesh& mesh, double kink);

}  // namespace tunica
