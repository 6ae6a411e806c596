#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

/// Where something other than the shape of a wall decides its stress.
namespace tunica {

/// The normal of the plane in which a fix lets nodes slide as in a plane of symmetry: Fix::across, or the axis along
/// which it holds translations at zero and about which alone it leaves rotations. None of other fixes.
std::optional<Vec3> plane_of_symmetry(const Fix& fix);

/// How far the wall stands off a right angle to the plane in which a rim slides: the root mean square
/// along the rim of the sine of that angle, times sqrt(2): the angle at which a straight tube is cut. A vessel that
/// goes on pulls at its rim in that plane as well. Where nothing does, what 1 % of the membrane stress of a straight
/// tube under pressure exceeds is too large by .8 to 2.1 times that angle, at radii of 3 to 100 walls, however fine the
/// mesh. 0: a rim as in a plane of symmetry, or no plane_of_symmetry(). Errors: InputError: as require_valid() of the
/// mesh. Cost: linear in the body.
double slant_of_rim(const ShellBody& body, const Fix& fix);

/// The slant up to which a rim that slides disturbs nothing.
constexpr double negligible_slant = 0.05;

/// Whether the thickness at the corners of a triangle differs by more than a quarter: the shell stands for a step, not
/// for a place of the wall. Errors: InputError: no such triangle, not as many thicknesses as nodes.
bool is_step(const ShellBody& body, std::size_t triangle);

/// Nodes of a body at which its wall bends over a short length: those that are held or bear point loads, rims, where
/// edge loads act as well, but for those that slide across the wall, and steps of the thickness.
/// Errors: InputError: as require_valid(), no such body. Cost: linear.
std::vector<std::uint8_t> disturbed_nodes(const Model& model, std::size_t body);

/// A triangle within a shell; the shells of all bodies are numbered in order.
struct ShellPart {
  std::size_t shell = 0;
  std::array<Vec3, 3> corners;  ///< in the shell's barycentric coordinates

  /// Of the shell's area.
  [[nodiscard]] double share() const { return std::abs(corners[0].dot(corners[1].cross(corners[2]))); }
};

/// What of the shells lies farther than two bending lengths sqrt(R t) from such nodes, along the facets: there a layer
/// of e^(-2 x 1.24) of its height is left. R is the smaller radius of curvature, of the wall within two thicknesses of
/// a node, in the mean over nodes that hang together, as a rim does, t the thickness there; flat shells have no layer.
/// Of a shell with such a node nothing is far. Errors: InputError as require_valid(). Cost: n log n.
std::vector<ShellPart> far_from_disturbances(const Model& model);

}  // namespace tunica
