#pragma once

#include "tunica/shell/patch/shell_mesh.hpp"

namespace tunica {

/// How a shell is to be split.
enum class Split : std::uint8_t {
  none,
  longest_edge,  ///< 1:2
  all_edges,     ///< 1:4
};

/// Splits shells so that the mesh stays conforming: an edge is cut for both its triangles, and a triangle with a cut
/// edge has its longest edge cut too, so that angles do not get smaller from split to split. Of the ways to join the
/// cuts the one with the better worst triangle is taken. New nodes lie on the curved patches (the mean of two
/// neighbours' edge curves), with their normals: one for each side along creases.
/// Errors: InputError as require_valid(), or where `wanted` is not of these shells.
/// @param wanted  #F; neighbours may get split as well
/// @param halved  gets the ends of the edge that each new node halves; the others keep their numbers
/// Source: Rivara, "Algorithms for refining triangular grids", IJNME 20, 1984. Cost: linear.
ShellMesh split_shells(const ShellMesh& shell, const std::vector<Split>& wanted,
                       std::vector<std::array<Index, 2>>* halved = nullptr);

/// Splits those shells whose error is above `tolerance`, worst first as far as `most` shells allow: above 3 tolerances
/// 1:4, else 1:2.
/// @param errors  #F, mm
/// @return the mesh; the same number of triangles as before when nothing could be split
ShellMesh refine_where(const ShellMesh& shell, const std::vector<double>& errors, double tolerance, std::size_t most);

}  // namespace tunica
