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
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polyhedral_mesh_domain_with_features_3.h>
#include <CGAL/Random.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/make_mesh_3.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
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
constexpr double most_tetrahedra = 20e6;  // some 20 GB of triangulations
constexpr double most_volume_lost = 0.1;  // of the surface's; facets within size / 10 of it lose far less
constexpr int rounds_of_smoothing = 20;   // of the vertices; later ones move them hardly at all
constexpr double facet_angle = 25;        // degrees; below 30 the refinement is proven to end
constexpr double radius_edge_ratio = 2;   // likewise, from 2 on
// A ball through the corners of a tetrahedron whose edges are 1 has the radius 0.61, of a triangle 0.58. Criteria bound
// these radii from above; with these bounds the mean edge comes out as 1.
constexpr double cell_radius = 0.75;
constexpr double facet_radius = 0.8;
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
}

void require_affordable(double volume, double size) {
  const double needed = volume / (size * size * size * std::sqrt(2.0) / 12);  // of regular ones
  if (!(needed < most_tetrahedra)) {
    throw InputError(
        fmt::format("the surface holds some {:.2g} tetrahedra of {} mm, at most {:.2g} are made: choose a larger size",
                    needed, size, most_tetrahedra));
  }
}

FillSurface cgal_surface(const TriangleMesh& mesh) {
  FillSurface surface;
  for (const Vec3& v : mesh.vertices) {
    surface.add_vertex({v.x(), v.y(), v.z()});
  }
  for (const auto& [i, j, k] : mesh.triangles) {
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

// The pieces of a surface, connected through vertices.
class Pieces {
public:
  Pieces(const std::vector<std::array<Index, 3>>& triangles, std::size_t vertices) : sets_(vertices) {
    for (const auto& [i, j, k] : triangles) {
      sets_.join(i, j);
      sets_.join(i, k);
    }
    for (const auto& corners : triangles) {
      roots_.insert(sets_.root(corners[0]));
    }
  }

  [[nodiscard]] std::size_t count() const { return roots_.size(); }
  [[nodiscard]] const std::set<Index>& names() const { return roots_; }
  Index name_of(Index vertex) { return sets_.root(vertex); }

private:
  DisjointSets<> sets_;
  std::set<Index> roots_;
};

// Where nothing is sharp, CGAL looks for the surface along a few random lines, and where something is, nowhere else: a
// piece of several may be missed, however small the tetrahedra. Those without sharp edges get fixed vertices to start
// from, the outermost along each axis.
void seed_pieces(FillDomain& domain, const TriangleMesh& surface) {
  Pieces pieces(surface.triangles, surface.vertices.size());
  if (pieces.count() == 1) {
    return;
  }
  std::map<FillKernel::Point_3, Index> vertex_at;
  std::map<Index, std::array<Index, 6>> outermost;
  for (Index v = 0; v < surface.vertices.size(); ++v) {
    const Vec3& p = surface.vertices[v];
    vertex_at[{p.x(), p.y(), p.z()}] = v;
    std::array<Index, 6>& farthest =
        outermost.try_emplace(pieces.name_of(v), std::array{v, v, v, v, v, v}).first->second;
    for (std::size_t side = 0; side < 6; ++side) {
      const Eigen::Index axis = narrow<Eigen::Index>(side / 2);
      const double ahead = p[axis] - surface.vertices[farthest[side]][axis];
      if (side % 2 == 0 ? ahead > 0 : ahead < 0) {
        farthest[side] = v;
      }
    }
  }
  using Ends = std::pair<FillKernel::Point_3, FillDomain::Index>;
  std::vector<std::tuple<FillDomain::Curve_index, Ends, Ends>> curves;
  domain.get_curves(std::back_inserter(curves));
  for (const auto& curve : curves) {
    if (const auto found = vertex_at.find(std::get<1>(curve).first); found != vertex_at.end()) {
      outermost.erase(pieces.name_of(found->second));
    }
  }
  for (const auto& [piece, vertices] : outermost) {
    for (const Index v : std::set<Index>(vertices.begin(), vertices.end())) {
      const Vec3& p = surface.vertices[v];
      domain.add_corner({p.x(), p.y(), p.z()});
    }
  }
}

// What was found may still not be all there is, above all where the tetrahedra are large.
// @param volume  of the surface, mm^3
void require_whole(const TetMesh& mesh, const TriangleMesh& surface, double volume, double size) {
  const auto advice = fmt::format("with tetrahedra of {} mm: choose a smaller size", size);
  if (mesh.tetrahedra.empty()) {
    throw RequirementError(fmt::format("no mesh was found inside the surface {}", advice));
  }
  const auto boundary = boundary_triangles(mesh);
  const std::size_t wanted = Pieces(surface.triangles, surface.vertices.size()).count();
  if (const std::size_t found = Pieces(boundary, mesh.vertices.size()).count(); found < wanted) {
    throw RequirementError(
        fmt::format("the surface has {} pieces, the mesh inside it only {}, {}", wanted, found, advice));
  }
  const double reached = signed_volume({mesh.vertices, boundary});
  if (!(std::abs(reached - volume) <= most_volume_lost * volume)) {
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
    // Exuding gives the vertices weights, with which no other optimiser can go on.
    FillComplex exuded = complex;
    CGAL::exude_mesh_3(exuded, params::time_limit = 0, params::sliver_bound = aimed_dihedral);
    best.offer(tetrahedra_of(exuded));
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
  const TriangleMesh used = without_unused(closed_surface);
  FillSurface surface = cgal_surface(used);
  CGAL::Random random(seed);
  CGAL::get_default_random() = CGAL::Random(seed);
  TetMesh mesh;
  double volume = 0;
  try {
    // Pieces within others are cavities, whichever way they face.
    CGAL::Polygon_mesh_processing::orient_to_bound_a_volume(surface);
    volume = CGAL::Polygon_mesh_processing::volume(surface);
    require_affordable(volume, size);
    FillDomain domain(surface, &random);
    domain.detect_features(sharp_degrees);
    seed_pieces(domain, used);
    mesh = meshed(domain, size);
  } catch (const CGAL::Failure_exception& failure) {
    throw RequirementError(fmt::format(
        "no mesh of tetrahedra of {} mm was found inside the surface ({}): choose another size", size, failure.what()));
  }
  require_whole(mesh, used, volume, size);
  require_sound(mesh, "the mesh inside the surface");
  return mesh;
}

}  // namespace tunica
