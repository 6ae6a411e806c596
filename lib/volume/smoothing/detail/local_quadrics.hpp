#pragma once

#include "tunica/volume/smoothing/detail/vertex_neighbours.hpp"

#include <cstddef>
#include <vector>

namespace tunica {

/// What a voxel's edge says about the surface that crosses it: that it does so somewhere within half the edge's length
/// of its middle.
struct EdgeCrossing {
  Vec3 place = Vec3::Zero();   ///< about where the surface is, mm
  Vec3 normal = Vec3::Zero();  ///< about the surface's there, of length 1
  Vec3 middle = Vec3::Zero();  ///< of the edge, mm
  Vec3 half = Vec3::Zero();    ///< of the edge, mm
};

/// How far from each crossing's place, along its normal, the surface is: the height there of a quadric, a polynomial of
/// second order over the plane across the normal, through the middles of the edges around, by weighted least squares.
///
/// The true surface is uniformly distributed along an edge, so a middle's height has a variance of a third of the
/// square of the edge's half, taken along the normal: its weight is one over that. A slice 5 mm thick so counts little
/// where the surface lies along the slices, and as much as any other where it stands across. The fit is repeated over
/// radii of 4, 5.7, 8 and 11.3 `voxel` (of what is farther than 7, every other crossing, for two), and a larger one
/// counts only as far as its quadric keeps crossing the edges: what passes by them, in variances of a middle and as a
/// weighted mean, is to be below 0.5 (in noise, 1.3 times what the smallest passes by), and fades out up to twice that.
/// The same to the bit whatever the number of threads.
/// @param neighbours  of the crossings as vertices of a mesh, along which the surroundings are gathered
/// @param skip  crossings whose offset is not wanted: theirs is 0
/// @param voxel  edge of a cube of a voxel's volume, mm
/// @return offset of each crossing, mm, outward along its normal
/// Source: moving least squares (Levin 1998; Alexa et al. 2003); the choice of scale by stagewise aggregation after
/// Belomestny and Spokoiny 2007, with the edges in place of a test.
/// Cost: some 7 microseconds per crossing.
std::vector<double> local_quadric_offsets(const std::vector<EdgeCrossing>& crossings,
                                          const VertexNeighbours& neighbours, const std::vector<bool>& skip,
                                          double voxel);

}  // namespace tunica
