// Tetrahedra by CGAL's Mesh_3: Delaunay refinement of a restricted triangulation, then the two optimisers of slivers
// that CGAL has, perturb and exude.
//
// What makes the result the same on every run: one thread; every random number from generators seeded here; no time
// limits, which would let the speed of the machine decide; no manifold() among the criteria, with which exude depends
// on addresses (CGAL issue 8775); and vertices and cells in the order in which the triangulation's containers hold
// them, which is the order of their creation and of the places set free in between, whatever their addresses.
#include "tunica/surface/filling/fill.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polyhedral_mesh_domain_with_features_3.h>
#include <CGAL/Random.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/make_mesh_3.h>
#include <fmt/format.h>

#include <cmath>
#include <unordered_map>

namespace tunica {
namespace {

using FillKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using FillSurface = CGAL::Surface_mesh<FillKernel::Point_3>;
using FillDomain = CGAL::Polyhedral_mesh_domain_with_features_3<FillKernel, FillSurface>;
using FillTriangulation = CGAL::Mesh_triangulation_3<FillDomain, CGAL::Default, CGAL::Sequential_tag>::type;
using FillComplex =
    CGAL::Mesh_complex_3_in_triangulation_3<FillTriangulation, FillDomain::Corner_index, FillDomain::Curve_index>;
using FillCriteria = CGAL::Mesh_criteria_3<FillTriangulation>;

constexpr unsigned seed = 1;
constexpr double sharp_degrees = 60;
constexpr double wanted_dihedral = 8;     // degrees
constexpr double aimed_dihedral = 12;     // degrees: what the optimisers are asked for, since they stop at it
constexpr double most_tetrahedra = 20e6;  // some 20 GB of triangulation
constexpr double most_volume_lost = 0.1;  // of the surface's; facets within size / 10 of it lose far less
constexpr int rounds_of_smoothing = 20;   // of the vertices; later ones move them hardly at all
constexpr double facet_angle = 25;        // degrees; below 30 the refinement is proven to end
constexpr double radius_edge_ratio = 2;   // likewise, from 2 on
// A ball through the corners of a tetrahedron whose edges are 1 has the radius 0.61, of a triangle 0.58. Criteria bound
// these radii from above; with these bounds the mean edge comes out as 1.
constexpr double cell_radius = 1.0;
constexpr double facet_radius = 1.0;
// The sag of an edge of length s on a curve of radius r is s^2 / (8 r): a tenth of s leaves the edges at their length
// where r > 1.25 s, and shortens them where a feature would be cut off.
constexpr double facet_distance = 0.1;

// The size everywhere. Asked at every step of the refinement, it is also where a stop is noticed.
struct UniformSize {
  using FT = FillKernel::FT;
  FT size;
  FT operator()(const FillKernel::Point_3&, int, const FillDomain::Index&) const {
    check_interrupt();
    return size;
  }
};

void require_fillable(const TriangleMesh& surface, double size) {
  if (!(size > 0) || !std::isfinite(size)) {
    throw InputError(fmt::format("the size of the tetrahedra is {} mm, it must be greater than zero", size));
  }
  const MeshFacts facts = examine(surface);
  if (const auto why = why_unfit(facts, Boundary::forbidden)) {
    throw InputError(fmt::format("the surface cannot be filled: {}", *why));
  }
  if (const auto crossing = find_self_intersections(surface); !crossing.empty()) {
    const Vec3& place = surface.vertices[surface.triangles[crossing.front()[0]][0]];
    throw InputError(fmt::format(
        "the surface cannot be filled: {} of triangles touch or cross, the first are {} and {} near ({:.6g}, {:.6g}, "
        "{:.6g})",
        crossing.size() == 1 ? "one pair" : fmt::format("{} pairs", crossing.size()), crossing.front()[0],
        crossing.front()[1], place.x(), place.y(), place.z()));
  }
  const double volume = std::abs(signed_volume(surface));
  // Half of the regular one's: what a mesh of unequal ones has on average.
  const double needed = volume / (size * size * size * std::sqrt(2.0) / 12);
  if (!(needed < most_tetrahedra)) {
    throw InputError(
        fmt::format("the surface holds some {:.2g} tetrahedra of {} mm, at most {:.2g} are made: choose a larger size",
                    needed, size, most_tetrahedra));
  }
}

FillSurface cgal_surface(const TriangleMesh& mesh) {
  FillSurface surface;
  const TriangleMesh used = without_unused(mesh);
  for (const Vec3& v : used.vertices) {
    surface.add_vertex({v.x(), v.y(), v.z()});
  }
  for (const auto& [i, j, k] : used.triangles) {
    surface.add_face(FillSurface::Vertex_index(i), FillSurface::Vertex_index(j), FillSurface::Vertex_index(k));
  }
  return surface;
}

TetMesh tetrahedra_of(const FillComplex& complex) {
  TetMesh mesh;
  const FillTriangulation& triangulation = complex.triangulation();
  std::unordered_map<FillTriangulation::Vertex_handle, Index> numbers;  // looked up only: its order is never used
  std::vector<FillTriangulation::Cell_handle> cells;
  for (const auto cell : triangulation.finite_cell_handles()) {
    if (complex.is_in_complex(cell)) {
      cells.push_back(cell);
      for (int corner = 0; corner < 4; ++corner) {
        numbers.emplace(cell->vertex(corner), Index{0});
      }
    }
  }
  for (const auto vertex : triangulation.finite_vertex_handles()) {
    if (const auto found = numbers.find(vertex); found != numbers.end()) {
      found->second = narrow<Index>(mesh.vertices.size());
      mesh.vertices.emplace_back(vertex->point().x(), vertex->point().y(), vertex->point().z());
    }
  }
  for (const auto cell : cells) {
    std::array<Index, 4> corners{};
    for (int corner = 0; corner < 4; ++corner) {
      corners[narrow<std::size_t>(corner)] = numbers.at(cell->vertex(corner));
    }
    mesh.tetrahedra.push_back(corners);
  }
  return mesh;
}

// Pieces connected through vertices.
std::size_t pieces_of(const std::vector<std::array<Index, 3>>& triangles, std::size_t vertices) {
  DisjointSets<> sets(vertices);
  std::vector<bool> used(vertices, false);
  std::size_t pieces = 0;
  const auto use = [&](Index v) {
    pieces += used[v] ? 0 : 1;
    used[v] = true;
  };
  for (const auto& [i, j, k] : triangles) {
    use(i);
    use(j);
    use(k);
    pieces -= (sets.join(i, j) ? 1 : 0) + (sets.join(i, k) ? 1 : 0);
  }
  return pieces;
}

double volume_of(const TetMesh& mesh, const std::vector<std::array<Index, 3>>& boundary) {
  return signed_volume({mesh.vertices, boundary});
}

// Initial points are thrown at random: a small piece of the surface may get none, and then no mesh.
void require_whole(const TetMesh& mesh, const TriangleMesh& surface, double size) {
  const auto advice = fmt::format("with tetrahedra of {} mm: choose a smaller size", size);
  if (mesh.tetrahedra.empty()) {
    throw RequirementError(fmt::format("no mesh was found inside the surface {}", advice));
  }
  const auto boundary = boundary_triangles(mesh);
  const std::size_t wanted = pieces_of(surface.triangles, surface.vertices.size());
  if (const std::size_t found = pieces_of(boundary, mesh.vertices.size()); found < wanted) {
    throw RequirementError(
        fmt::format("the surface has {} pieces, the mesh inside it only {}, {}", wanted, found, advice));
  }
  const double volume = std::abs(signed_volume(surface));
  if (const double reached = volume_of(mesh, boundary); !(std::abs(reached - volume) <= most_volume_lost * volume)) {
    throw RequirementError(
        fmt::format("the surface holds {:.4g} mm^3, the mesh inside it {:.4g} mm^3, {}", volume, reached, advice));
  }
}

// The mesh of better shape of two that are whole.
struct BestMesh {
  TetMesh mesh;
  double dihedral = -1;

  void offer(TetMesh other) {
    const double reached = other.tetrahedra.empty() ? -1 : smallest_dihedral(other);
    if (reached > dihedral) {
      dihedral = reached;
      mesh = std::move(other);
    }
  }
};

TetMesh meshed(const FillDomain& domain, double size) {
  namespace params = CGAL::parameters;
  const UniformSize cell_size{cell_radius * size};
  const UniformSize facet_size{facet_radius * size};
  const FillCriteria criteria(params::edge_size = size, params::facet_angle = facet_angle,
                              params::facet_size = facet_size, params::facet_distance = facet_distance * size,
                              params::cell_radius_edge_ratio = radius_edge_ratio, params::cell_size = cell_size);
  FillComplex complex = CGAL::make_mesh_3<FillComplex>(domain, criteria, params::no_perturb(), params::no_exude());
  BestMesh best;
  const auto without_slivers = [&] {
    CGAL::perturb_mesh_3(complex, domain, params::time_limit = 0, params::sliver_bound = aimed_dihedral);
    best.offer(tetrahedra_of(complex));
    check_interrupt();
    CGAL::exude_mesh_3(complex, params::time_limit = 0, params::sliver_bound = aimed_dihedral);
    best.offer(tetrahedra_of(complex));
    check_interrupt();
  };
  without_slivers();
  if (best.dihedral < wanted_dihedral && !best.mesh.tetrahedra.empty()) {
    CGAL::lloyd_optimize_mesh_3(complex, domain, params::time_limit = 0,
                                params::max_iteration_number = rounds_of_smoothing);
    check_interrupt();
    without_slivers();
  }
  return std::move(best.mesh);
}

}  // namespace

TetMesh fill(const TriangleMesh& closed_surface, double size) {
  require_fillable(closed_surface, size);
  const FillSurface surface = cgal_surface(closed_surface);
  CGAL::Random random(seed);
  CGAL::get_default_random() = CGAL::Random(seed);
  TetMesh mesh;
  try {
    FillDomain domain(surface, &random);
    domain.detect_features(sharp_degrees);
    mesh = meshed(domain, size);
  } catch (const CGAL::Failure_exception& failure) {
    throw RequirementError(fmt::format(
        "no mesh of tetrahedra of {} mm was found inside the surface ({}): choose another size", size, failure.what()));
  }
  require_whole(mesh, closed_surface, size);
  require_sound(mesh, "the mesh inside the surface");
  return mesh;
}

}  // namespace tunica
