#pragma once

#include "tunica/mechanics/elements/shell_element.hpp"

/// The parts of a shell element's reference, for make_shell_element() alone. Each fills its members of the element, in
/// the order below.
namespace tunica {

constexpr int next_corner(int k) { return (k + 1) % 3; }
/// Corner at the start (end 0) or end (1) of an edge.
constexpr int corner_at(int edge, int end) { return end == 0 ? edge : next_corner(edge); }

/// The edges' surface normals and sides, and what the corners' normals make of the slopes along them.
/// Fills edge_normals, edge_sides, slopes.
void find_edges(const ShellSurface& surface, ShellElement& element);

/// Mean products of the gradient of the patch as quadratic forms of the slopes at the ends of the edges, the mean
/// height, and what a bulging edge adds where it moves in the plane. Fills bulging, height_weights, sideways, tilts and
/// edge_directions; needs plane, gradients, edge_normals and the facet's area.
void find_bulging(ShellElement& element);

/// Stiffness to the skewness of the edges; `stretching` is E t (N/mm). Fills short_waves and thinness; needs plane,
/// gradients, axes, thickness and the facet's area.
void find_short_waves(const ShellSurface& surface, double stretching, ShellElement& element);

/// Bending, and the higher-order membrane part: corners drill about the mean of their own and the facet's normal, as
/// the turn of a surface that only bends has no part about the normal halfway. Fills rotational and curvature.
void find_rotational(const ShellSurface& surface, const PlaneStiffness& bending, const Mat3& higher_order,
                     ShellElement& element);

}  // namespace tunica
