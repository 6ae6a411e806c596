#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/surface/distance/facing.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/// What a user has to know of a surface that was read, in the same words wherever it enters.
namespace tunica {

/// Of boundary edges that coincide: seams and T-junctions, with their number, the place, and what to do, which is
/// tried. Cost: where there are any, that of repaired().
/// @param facts  of the mesh: a closed one costs nothing
/// @param weight  how far the answer may be off
std::vector<Warning> seam_warnings(const TriangleMesh& mesh, const MeshFacts& facts, const std::filesystem::path& path,
                                   Weight weight);

/// why_unfit(), but T-junctions are called what they are.
std::optional<std::string> why_unfit_surface(const TriangleMesh& mesh, const MeshFacts& facts);

/// "its normals point inward", "2 of its 5 pieces have normals that point the wrong way (the largest near (1, 2, 3))".
/// @param facing  with pieces that face the wrong way
std::string facing_phrase(const Facing& facing);

/// Of shells that carry a pressure: normals that point inward, pieces that lie within others.
/// @param pressure  MPa
std::vector<Warning> pressed_side_warnings(const TriangleMesh& mesh, double pressure,
                                           const std::filesystem::path& path);

}  // namespace tunica
