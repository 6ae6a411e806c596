#pragma once

#include "shell/fit_state.hpp"
#include "surface/measure.hpp"

namespace tunica {

/// Of the tolerance: how wide the intervals are that holds_within() ends with.
inline constexpr double width_of_certificates = 0.005;

/// Points of the target farther from the curved surface than `limit` (mm), or of its boundary from the curved edges
/// there, join the samples; the state has to be
/// attached and measured anew to heed them. Of more than 2,000 an even share joins. @return how many
/// @param both_ways  points of the patches that far from the target count too, by the target's points closest to them,
/// and what is found of each patch's distance raises its error
/// Cost: linear in the target's vertices, of which at most 200,000 are looked at: some 0.3 microseconds each; both ways
/// some 0.1 s more.
std::size_t add_missed(FitSamples& samples, FitState& state, double limit, bool both_ways = false);

/// The shells that come as close as `reach` (mm) to a box, so all that its points can have within that. All of them
/// where patches follow the normals across their edges.
ShellMesh shells_near(ShellMesh shell, const Box& box, double reach);

/// What add_missed() finds one way within a box, without adding it. Cost: as there, but of the points outside only a
/// comparison.
std::vector<SamplePoint> missed_within(const FitState& state, const Box& box, double limit);

/// Has places of patches that are farther from the target than `limit` (mm) measured from now on; they are looked for
/// as certificates do. @return whether there are none
bool add_places_beyond(FitState& state, double limit);

/// Certifies the distance of what lies within a box, both ways, but for rounding, and of the whole boundary where some
/// of it does.
/// @param farthest  out: where it is above `tolerance` (mm): the points of the target there, one per direction
/// Cost: linear in the target's triangles, and what a certificate costs of those within.
bool holds_within(const FitState& state, const Box& box, double tolerance, std::vector<SamplePoint>& farthest);

}  // namespace tunica
