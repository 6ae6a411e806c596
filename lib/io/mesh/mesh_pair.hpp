#pragma once

#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <filesystem>
#include <optional>

namespace tunica {

/// What a surface that shells are fitted to must be: an oriented manifold with an extent.
/// Errors: InputError that names the file and what to do. Cost: linear.
MeshFacts require_surface(const MeshFile& file, const std::filesystem::path& path);

/// Two meshes of one thing, as they were read. Refuses, from their boxes alone, what only a wrong unit explains: sizes
/// in the ratio of two units of length, along every axis to a quarter, or 500 times and more apart.
/// @param unit_mm  what read_mesh() was given for files that state none
/// Errors: InputError that names the file, the factor and the likely unit. Cost: linear.
void require_same_scale(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                        const std::filesystem::path& path_b, std::optional<double> unit_mm);

/// For meshes of which one is to become the other. Errors: InputError when a diagonal of the larger one and more lies
/// between their boxes. Cost: linear.
void require_near(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                  const std::filesystem::path& path_b);

}  // namespace tunica
