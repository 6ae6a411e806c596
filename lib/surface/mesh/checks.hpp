// surface/mesh: triangle meshes, their checks and measures.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <optional>
#include <span>
#include <string>

namespace tunica {

/// What every function of a mesh relies on: corners that exist, and vertices of triangles at finite places, so near
/// that their squares are numbers, too. Vertices of no triangle may be anywhere. The public functions of this room ask
/// it of the meshes that they are given, unless they say otherwise. Errors: InputError that names the first triangle at
/// fault. Cost: linear, some nanoseconds per triangle.
void require_valid(std::span<const Vec3> vertices, std::span<const std::array<Index, 3>> triangles);
inline void require_valid(const TriangleMesh& mesh) { require_valid(mesh.vertices, mesh.triangles); }

/// require_valid() of a mesh that has a triangle. Errors: InputError.
void require_surface(const TriangleMesh& mesh);

/// Of these only that corners exist. Errors: InputError.
void require_corners(std::size_t vertices, std::span<const std::array<Index, 3>> triangles);

/// What a mesh is. Edges and vertices are counted once each; unused vertices are left out.
struct MeshFacts {
  std::size_t vertices = 0;  ///< used by a triangle
  std::size_t unused_vertices = 0;
  std::size_t edges = 0;
  std::size_t triangles = 0;
  std::size_t components = 0;  ///< pieces connected through edges
  std::size_t boundary_edges = 0;
  std::size_t boundary_loops = 0;         ///< connected pieces of the boundary
  std::size_t non_manifold_edges = 0;     ///< shared by three triangles or more
  std::size_t non_manifold_vertices = 0;  ///< triangles around it are not one fan, though its edges are manifold
  std::size_t degenerate_triangles = 0;   ///< a corner twice, or no height within rounding
  std::size_t duplicate_triangles = 0;    ///< further triangles on three corners that already have one
  std::size_t inconsistent_edges = 0;     ///< two triangles run through it in the same direction
  std::size_t non_finite_vertices = 0;
  long euler = 0;         ///< V - E + F
  bool closed = false;    ///< no boundary edge
  bool manifold = false;  ///< no non-manifold edge or vertex, no duplicate triangle, no corner twice
  bool oriented = false;  ///< no inconsistent edge

  /// The first place of each kind, in words with indices and coordinates; empty where there is none.
  std::string first_non_manifold_edge, first_non_manifold_vertex, first_degenerate_triangle, first_duplicate_triangle,
      first_inconsistent_edge, first_boundary_edge, first_non_finite_vertex;
};

/// @param mesh  corners exist, else: InputError; vertices may be anything
/// Cost: linear in the size (quadratic in the number of triangles at one vertex).
MeshFacts examine(const TriangleMesh& mesh);

/// The same without the vertices that belong to no triangle; the others keep their order.
TriangleMesh without_unused(TriangleMesh mesh);

enum class Boundary { allowed, forbidden };

/// Why a mesh is not an oriented manifold without degenerate connectivity: one phrase with count and first place
/// ("195 edges are shared by three or more triangles, the first between vertices 3 and 17 near (1.5, 2, 3)"), or
/// nothing when it is fit. Triangles without height are allowed: they are bad shape, not bad connectivity.
std::optional<std::string> why_unfit(const MeshFacts& facts, Boundary boundary = Boundary::allowed);

}  // namespace tunica
