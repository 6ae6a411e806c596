#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/surface/repair/repair.hpp"
#include "tunica/wall/detail/level_set.hpp"
#include "tunica/wall/detail/rim_cut.hpp"
#include "tunica/wall/mid_surface.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>

namespace tunica {
namespace {

constexpr double error_of_diagonal = 1e-4;  // mean error
constexpr double error_of_wall = 1e-3;      // of the thickness: or this, if that is more
constexpr double most_of_wall = 1e-2;       // of the thickness, at most
constexpr double cells_across = 32;         // of the diagonal, at least
constexpr double most_points = 1.5e8;       // of a grid
constexpr double thinnest = 1e-4;           // of the diagonal
constexpr double coarsest = 2;              // times the detail that the grid should show: no surface from coarser ones
constexpr int finer_grids = 3;              // at most
constexpr double least_turned = 0.2;        // cosine: a triangle that turns by more while its corners move is folded
constexpr int most_partings = 12;
constexpr double strip_of_half = 2, strip_of_cell = 3;

/// The length that a grid has to show, mm: of the face's triangles, and of the body where these are large.
double detail_of(const Target& face) {
  double edges = 0;
  for (Index t = 0; t < face.mesh().triangles.size(); ++t) {
    const auto& v = face.mesh().triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      edges += (face.mesh().vertices[v[k]] - face.mesh().vertices[v[(k + 1) % 3]]).norm();
    }
  }
  double detail = std::min(edges / (3 * real(face.mesh().triangles.size())), face.diagonal() / cells_across);
  if (face.boundary().empty()) {
    // Half of what is between two walls, a third of a ball's radius.
    detail = std::min(detail, std::abs(signed_volume(face.mesh())) / area(face.mesh()));
  }
  return detail;
}

Vec3 area_vector(const TriangleMesh& mesh, const std::array<Index, 3>& v) {
  return (mesh.vertices[v[1]] - mesh.vertices[v[0]]).cross(mesh.vertices[v[2]] - mesh.vertices[v[0]]);
}

/// Moves the vertices onto the level; those of triangles that fold or cross by it stay where marching cubes put them.
/// @return pairs of triangles that cross all the same
std::size_t move_onto(const HalfWayLevel& level, TriangleMesh& mesh) {
  const TriangleMesh before = mesh;
  parallel_for_blocks(mesh.vertices.size(), 256, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t v = begin; v < end; ++v) {
      mesh.vertices[v] = level.moved_onto(before.vertices[v]);
    }
  });
  std::size_t crossing = 0;
  for (int round = 0; round < most_partings; ++round) {
    std::vector<Index> bad;
    for (Index t = 0; t < mesh.triangles.size(); ++t) {
      const Vec3 now = area_vector(mesh, mesh.triangles[t]), then = area_vector(before, before.triangles[t]);
      if (now.dot(then) < least_turned * now.norm() * then.norm()) {
        bad.push_back(t);
      }
    }
    const auto pairs = find_self_intersections(mesh);
    crossing = pairs.size();
    for (const auto& [a, b] : pairs) {
      bad.insert(bad.end(), {a, b});
    }
    bool any = false;
    for (const Index t : bad) {
      for (const Index v : mesh.triangles[t]) {
        any = any || mesh.vertices[v] != before.vertices[v];
        mesh.vertices[v] = before.vertices[v];
      }
    }
    if (!any) {
      break;
    }
  }
  return crossing;
}

/// Without the triangles that cross or touch others: at the cut, where a jagged rim folds it, and where vertices were
/// parted.
TriangleMesh without_crossings(TriangleMesh mesh) {
  for (int round = 0; round < most_partings; ++round) {
    const auto pairs = find_self_intersections(mesh);
    if (pairs.empty()) {
      break;
    }
    std::vector<bool> crosses(mesh.triangles.size(), false);
    for (const auto& [a, b] : pairs) {
      crosses[a] = crosses[b] = true;
    }
    std::size_t t = 0;
    std::erase_if(mesh.triangles, [&](const auto&) { return crosses[t++]; });
    mesh = without_unused(std::move(mesh));
    if (!mesh.triangles.empty() && why_unfit(examine(mesh))) {
      mesh = repaired(mesh).mesh;
    }
  }
  return mesh;
}

/// The largest `count` pieces; what is left out is told.
TriangleMesh largest_pieces(TriangleMesh mesh, std::size_t count, HalfWaySurface& told) {
  DisjointSets pieces(mesh.vertices.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    pieces.join(a, b);
    pieces.join(b, c);
  }
  std::map<Index, double> area_of;
  for (const auto& v : mesh.triangles) {
    area_of[pieces.root(v[0])] += area_vector(mesh, v).norm() / 2;
  }
  std::vector<std::pair<double, Index>> largest;
  for (const auto& [root, area] : area_of) {
    largest.emplace_back(-area, root);
  }
  std::ranges::sort(largest);
  told.left_out = 0;
  told.left_out_area = 0;
  for (std::size_t i = count; i < largest.size(); ++i) {
    ++told.left_out;
    told.left_out_area -= largest[i].first;
    area_of.erase(largest[i].second);
  }
  std::erase_if(mesh.triangles, [&](const auto& v) { return !area_of.contains(pieces.root(v[0])); });
  return without_unused(std::move(mesh));
}

/// Mean and largest distance of the triangles' middles from the level.
std::array<double, 2> error_of(const TriangleMesh& mesh, const HalfWayLevel& level) {
  std::vector<double> off(mesh.triangles.size());
  parallel_for_blocks(off.size(), 256, [&](std::size_t begin, std::size_t end) {
    Index guess = 0;
    for (std::size_t t = begin; t < end; ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const auto hit = level.face.at((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3, guess);
      guess = hit.triangle;
      off[t] = std::abs(level.value(hit));
    }
  });
  double sum = 0, whole = 0;
  for (std::size_t t = 0; t < off.size(); ++t) {
    const double area = area_vector(mesh, mesh.triangles[t]).norm();
    sum += area * off[t];
    whole += area;
  }
  return {whole > 0 ? sum / whole : 0, off.empty() ? 0 : *std::ranges::max_element(off)};
}

HalfWaySurface with_cells(const Target& face, std::size_t pieces, WallFace which, double half, double cell,
                          const Progress& progress) {
  const ContinuedFace continued(face, half, strip_of_half * half + strip_of_cell * cell);
  const HalfWayLevel level{continued, half, which == WallFace::inner ? 1 : -1};
  if (const double points = grid_points(level, cell); points > most_points) {
    throw RequirementError(fmt::format(
        "the middle of the wall would take a grid of {:.3g} million points, {:.3g} mm apart; at most {:.0f} "
        "million are allowed: take a part of the organ, or a surface of fewer, larger triangles",
        points / 1e6, cell, most_points / 1e6));
  }
  HalfWaySurface surface;
  surface.cell = cell;
  TriangleMesh mesh = marched_level(level, cell, progress);
  surface.crossing = move_onto(level, mesh);
  if (!continued.is_closed()) {
    mesh = cut_at_rims(mesh, level, cell);
    surface.crossing = 0;
  }
  if (!mesh.triangles.empty() && why_unfit(examine(mesh))) {
    mesh = repaired(mesh).mesh;
  }
  if (!continued.is_closed()) {
    mesh = without_crossings(std::move(mesh));
  }
  mesh = largest_pieces(std::move(mesh), pieces, surface);
  if (mesh.triangles.empty()) {
    throw RequirementError(
        fmt::format("no point inside is half of the wall, {:.4g} mm, away from its outer face: take a "
                    "smaller thickness",
                    half));
  }
  surface.mesh = std::move(mesh);
  surface.error = error_of(surface.mesh, level);
  return surface;
}

}  // namespace

HalfWaySurface half_way_surface(const Target& face, WallFace which, double thickness, const Progress& progress) {
  require_positive(thickness, "the thickness");
  if (thickness < thinnest * face.diagonal()) {
    throw RequirementError(fmt::format(
        "the wall, {:.3g} mm thick, is thinner than a ten-thousandth of the diagonal, {:.4g} mm: its face is "
        "its middle, as far as shells can tell; is the unit right?",
        thickness, face.diagonal()));
  }
  const double half = thickness / 2;
  const double allowed =
      std::clamp(error_of_diagonal * face.diagonal(), error_of_wall * thickness, most_of_wall * thickness);
  const std::size_t pieces = examine(face.mesh()).components;
  const Vec3 sides = [&] {
    const Box box = bounding_box(face.mesh());
    return Vec3(box.upper - box.lower + Vec3::Constant(6 * half));
  }();
  // Of a grid that is as large as it may be.
  const double finest = 1.1 * std::cbrt(sides.prod() / most_points);
  const double detail = detail_of(face);
  double cell = std::clamp(detail, std::min(finest, coarsest * detail), infinity);
  HalfWaySurface surface = with_cells(face, pieces, which, half, cell, progress);
  for (int i = 0; i < finer_grids && surface.error[0] > allowed; ++i) {
    // The error goes with the square of the cells.
    const double finer = std::max(cell * std::clamp(0.9 * std::sqrt(allowed / surface.error[0]), 0.25, 0.8), finest);
    if (finer >= 0.95 * cell) {
      break;
    }
    cell = finer;
    surface = with_cells(face, pieces, which, half, cell, progress);
  }
  tunica::advance(progress, 1);
  return surface;
}

}  // namespace tunica
