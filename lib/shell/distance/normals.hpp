#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <optional>
#include <span>

namespace tunica {

/// A unit normal and its smallest product with the normals of the facets around a node.
struct CompatibleNormal {
  Vec3 normal;
  double agreement;
};

/// The unit vector whose smallest product with the given unit normals is largest: the nearest point of their convex
/// hull to the origin, normalised. agreement <= 0: they do not lie in one half space.
/// Cost: k^4 for k normals; beyond 24 the ones that matter are gathered one by one.
CompatibleNormal most_compatible_normal(std::span<const Vec3> facet_normals);

/// `wanted` when its product with every facet normal is at least `least`; else the last vector on the way from the most
/// compatible one to it for which this holds; nothing when it holds for none.
std::optional<Vec3> compatible_normal(const Vec3& wanted, std::span<const Vec3> facet_normals, double least);

/// Gives every node the target's normal at its closest point on the side that the facets around it face, made
/// compatible with these facets: N·n >= least_normal_agreement certainly, and 0.5 where that can be had.
/// @return the nodes whose facets fold so sharply that no normal is compatible; they get the most compatible one
std::vector<Index> take_normals_from(const Target& target, ShellMesh& shell);

}  // namespace tunica
