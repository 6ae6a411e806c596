#include "shell/fit_missed.hpp"

#include "core/threads.hpp"
#include "shell/boundary_distance.hpp"
#include "shell/certificate.hpp"
#include "shell/curved_surface.hpp"
#include "shell/fit_boundary_edges.hpp"
#include "shell/patch_search.hpp"
#include "surface/hausdorff.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace tunica {
namespace {

constexpr std::size_t grain = 2048;
constexpr double doubted = 0.8;  // of the limit: a foot beside the last one's that is farther may not be the closest
constexpr double grid_points = 60'000;              // of all patches
constexpr int coarsest_grid = 8, finest_grid = 12;  // ridges of a coarse target lie between the points of a coarse grid
constexpr int gap_points = 11;                      // per edge
constexpr double narrow = 0.05;                     // of the limit: gaps that add nothing
constexpr std::size_t most_added = 2000;            // points, at once
constexpr std::size_t boundary_chords = 16;         // per edge, for a look at the boundary
constexpr double exact = 1.025;  // limits: what is looked at above gaps is the worst, so with less margin

const Box everywhere{Vec3::Constant(-std::numeric_limits<double>::infinity()),
                     Vec3::Constant(std::numeric_limits<double>::infinity())};

struct Missed {
  Vec3 point;
  Index patch;
  double distance;
};

/// Points of the target whose closest patch is farther off than most of the limit.
std::vector<Missed> far_points(const std::vector<Vec3>& points, const PatchSearch& search, double limit) {
  std::vector<std::vector<Missed>> blocks((points.size() + grain - 1) / grain);
  parallel_for_blocks(points.size(), grain, [&](std::size_t begin, std::size_t end) {
    std::optional<Index> guess;
    SurfaceFoot last = search.near(points[begin], guess);
    for (std::size_t i = begin; i < end; ++i) {
      SurfaceFoot foot = search.near(points[i], last.patch, last.at);
      if (foot.distance > doubted * limit) {
        foot = search.near(points[i], guess);
        if (foot.distance > doubted * limit) {
          blocks[begin / grain].push_back({points[i], foot.patch, foot.distance});
        }
      }
      last = foot;
    }
  });
  std::vector<Missed> found;
  for (const auto& block : blocks) {
    found.insert(found.end(), block.begin(), block.end());
  }
  return found;
}

/// Some of so many that every step would cost what all of them do: evenly spread, as neighbours follow each other, and
/// the farthest of each patch.
std::vector<Missed> thinned(const std::vector<Missed>& missed) {
  if (missed.size() <= most_added) {
    return missed;
  }
  std::map<Index, std::size_t> farthest;
  for (std::size_t i = 0; i < missed.size(); ++i) {
    const auto [found, is_first] = farthest.emplace(missed[i].patch, i);
    if (!is_first && missed[i].distance > missed[found->second].distance) {
      found->second = i;
    }
  }
  std::vector<Missed> kept;
  const std::size_t step = missed.size() / most_added + 1;
  for (std::size_t i = 0; i < missed.size(); ++i) {
    if (i % step == 0 || farthest.at(missed[i].patch) == i) {
      kept.push_back(missed[i]);
    }
  }
  return kept;
}

Vec3 on_edge(const CubicPatch& patch, std::size_t from, std::size_t to, double s) {
  const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  return patch.point((1 - s) * corners[from] + s * corners[to]);
}

bool is_within(const Box& box, const Vec3& p) {
  return (p.array() >= box.lower.array()).all() && (p.array() <= box.upper.array()).all();
}

/// The boundary edges, where they are to be the target's boundary.
std::vector<FitMesh::BoundaryEdge> boundary_of(const FitState& state) {
  return state.samples().has_boundaries() ? state.mesh.boundary() : std::vector<FitMesh::BoundaryEdge>{};
}

/// Points of the target's boundary that are far from all boundary edges.
/// @param box  none outside are looked at; @param raise  told of the triangle and the distance
template <typename Raise>
std::vector<Missed> far_boundary_points(const FitState& state, const Box& box, double limit, const Raise& raise) {
  std::vector<Missed> found;
  if (!state.samples().has_boundaries()) {
    return found;
  }
  const BoundaryEdges edges(state.mesh, boundary_chords);
  if (edges.empty()) {
    return found;
  }
  for (const Vec3& p : state.samples().further_boundary_points()) {
    if (!is_within(box, p)) {
      continue;
    }
    const auto [triangle, distance] = edges.closest(p);
    raise(triangle, distance);
    if (distance > limit) {
      found.push_back({p, triangle, distance});
    }
  }
  return found;
}

/// Where patches part sideways and are off as well, the target above the gap is farther from both than either measure
/// says: its points there that are too far off.
std::vector<Vec3> missed_over_gaps(const FitState& state, const std::vector<std::array<Index, 2>>& edges,
                                   double limit) {
  const FitMesh& mesh = state.mesh;
  const Target& target = state.samples().target();
  std::vector<std::vector<Vec3>> of_edge(edges.size());
  parallel_for_blocks(edges.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const auto& [u, v] = edges[e];
      const auto pair = mesh.on_edge(u, v);
      if (pair.count() < 2) {
        continue;
      }
      const Index one = pair.triangle[0], other = pair.triangle[1];
      const CubicPatch here = mesh.patch(one), there = mesh.patch(other);
      for (int i = 1; i <= gap_points; ++i) {
        const double s = static_cast<double>(i) / (gap_points + 1);
        const Vec3 a = on_edge(here, mesh.corner_of(one, u), mesh.corner_of(one, v), s);
        const Vec3 b = on_edge(there, mesh.corner_of(other, u), mesh.corner_of(other, v), s);
        if ((a - b).norm() < narrow * limit) {
          continue;
        }
        const Vec3 p = target.closest((a + b) / 2).point;
        const double squared =
            std::min(foot_on_patch(here, p).squared_distance, foot_on_patch(there, p).squared_distance);
        if (squared > limit * limit) {
          of_edge[e].push_back(p);
        }
      }
    }
  });
  std::vector<Vec3> found;
  for (const auto& points : of_edge) {
    found.insert(found.end(), points.begin(), points.end());
  }
  return found;
}

}  // namespace

ShellMesh shells_near(ShellMesh shell, const Box& box, double reach) {
  if (shell.patch == Patch::watertight) {
    return shell;
  }
  const Box wide{box.lower - Vec3::Constant(reach), box.upper + Vec3::Constant(reach)};
  const std::vector<CubicPatch> patches = curved_patches(shell);
  ShellMesh near = shell;
  near.triangles.clear();
  near.corner_normals.clear();
  for (std::size_t t = 0; t < patches.size(); ++t) {
    Box hull{patches[t].control[0], patches[t].control[0]};
    for (const Vec3& p : patches[t].control) {
      hull.lower = hull.lower.cwiseMin(p);
      hull.upper = hull.upper.cwiseMax(p);
    }
    if ((hull.lower.array() <= wide.upper.array()).all() && (hull.upper.array() >= wide.lower.array()).all()) {
      near.triangles.push_back(shell.triangles[t]);
      if (!shell.corner_normals.empty()) {
        near.corner_normals.push_back(shell.corner_normals[t]);
      }
    }
  }
  return near;
}

std::size_t add_missed(FitSamples& samples, FitState& state, double limit, bool both_ways) {
  std::vector<Index> triangles;
  const ShellMesh shell = state.mesh.shell(&triangles);
  const std::vector<CubicPatch> patches = curved_patches(shell);
  const auto raise = [&](Index patch, double error) {
    if (both_ways) {
      double& known = state.patches[triangles[patch]].error;
      known = std::max(known, error);
    }
  };
  std::size_t added = 0;
  std::vector<Missed> missed = far_points(samples.further_points(), PatchSearch(shell, patches), limit);
  for (const Missed& far : missed) {
    raise(far.patch, far.distance);
  }
  std::erase_if(missed, [&](const Missed& far) { return far.distance <= limit; });
  for (const Missed& far : thinned(missed)) {
    samples.add({far.point});
    ++added;
  }
  const auto raise_edge = [&](Index triangle, double error) {
    double& known = state.patches[triangle].error;
    known = both_ways ? std::max(known, error) : known;
  };
  for (const Missed& far : thinned(far_boundary_points(state, everywhere, limit, raise_edge))) {
    samples.add({far.point, true});
    ++added;
  }
  for (const Vec3& p : missed_over_gaps(state, state.mesh.edges(), exact * limit)) {
    samples.add({p});
    ++added;
  }
  if (both_ways) {
    const double per_patch = grid_points / static_cast<double>(patches.size());
    const int level = std::clamp(static_cast<int>(std::sqrt(2 * per_patch)), coarsest_grid, finest_grid);
    const Tessellation fine = tessellate_uniformly(shell, level);
    const auto distances = vertex_distances(fine.mesh, samples.target().tree());
    for (std::size_t v = 0; v < distances.size(); ++v) {
      raise(fine.vertex_shell[v], distances[v]);
      if (distances[v] > limit) {
        samples.add({samples.target().closest(fine.mesh.vertices[v]).point});
        ++added;
      }
    }
  }
  return added;
}

std::vector<SamplePoint> missed_within(const FitState& state, const Box& box, double limit) {
  const FitSamples& samples = state.samples();
  std::vector<Vec3> points;
  std::vector<SamplePoint> found;
  for (const Vec3& p : samples.further_points()) {
    if (is_within(box, p)) {
      points.push_back(p);
    }
  }
  const ShellMesh shell = shells_near(state.mesh.shell(), box, limit);
  const std::vector<CubicPatch> patches = curved_patches(shell);
  for (const Missed& far : far_points(points, PatchSearch(shell, patches), limit)) {
    if (far.distance > limit) {
      found.push_back({far.point});
    }
  }
  for (const Missed& far : far_boundary_points(state, box, limit, [](Index, double) {})) {
    found.push_back({far.point, true});
  }
  auto edges = state.mesh.edges();
  std::erase_if(edges, [&](const auto& edge) {
    return !is_within(box, state.mesh.positions[edge[0]]) && !is_within(box, state.mesh.positions[edge[1]]);
  });
  for (const Vec3& p : missed_over_gaps(state, edges, exact * limit)) {
    found.push_back({p});
  }
  return found;
}

bool add_places_beyond(FitState& state, double limit) {
  std::vector<Index> triangles;
  const std::vector<CubicPatch> patches = curved_patches(state.mesh.shell(&triangles));
  Aim aim{width_of_certificates * limit, limit, 0};
  aim.list_beyond = true;
  const OneSided found = shell_to_target(patches, state.samples().target(), aim);
  if (found.distance.upper <= limit) {
    return true;
  }
  for (const FarPlace& place : found.beyond) {
    state.patches[triangles[place.patch]].places.push_back(place.at);
  }
  return false;
}

bool holds_within(const FitState& state, const Box& box, double tolerance, std::vector<SamplePoint>& farthest) {
  const Target& target = state.samples().target();
  const ShellMesh shell = shells_near(state.mesh.shell(), box, tolerance);
  const std::vector<CubicPatch> patches = curved_patches(shell);
  std::vector<CubicPatch> here;
  for (const CubicPatch& patch : patches) {
    if (std::any_of(patch.control.begin(), patch.control.end(), [&](const Vec3& p) { return is_within(box, p); })) {
      here.push_back(patch);
    }
  }
  TriangleMesh part;
  std::vector<Index> number(target.mesh().vertices.size(), no_index), order;
  for (const Index t : target.tree().spatial_order()) {
    auto corners = target.mesh().triangles[t];
    if (std::none_of(corners.begin(), corners.end(),
                     [&](Index v) { return is_within(box, target.mesh().vertices[v]); })) {
      continue;
    }
    for (Index& v : corners) {
      if (number[v] == no_index) {
        number[v] = static_cast<Index>(part.vertices.size());
        part.vertices.push_back(target.mesh().vertices[v]);
      }
      v = number[v];
    }
    order.push_back(static_cast<Index>(part.triangles.size()));
    part.triangles.push_back(corners);
  }
  const Aim aim{width_of_certificates * tolerance, tolerance, 0};
  const OneSided from_shell = here.empty() ? OneSided{} : shell_to_target(here, target, aim);
  const OneSided from_target =
      part.triangles.empty()
          ? OneSided{}
          : target_to_shell(shell, patches, {part.vertices, part.triangles, order}, aim, state.error());
  farthest.clear();
  if (from_shell.distance.upper > tolerance) {
    farthest.push_back({target.closest(from_shell.farthest).point});
  }
  if (from_target.distance.upper > tolerance) {
    farthest.push_back({from_target.farthest});
  }
  std::vector<CubicCurve> curves;
  bool any = false;
  for (const FitMesh::BoundaryEdge& edge : boundary_of(state)) {
    curves.push_back(edge.curve);
    any = any || std::any_of(edge.curve.begin(), edge.curve.end(), [&](const Vec3& p) { return is_within(box, p); });
  }
  const auto between = any ? boundary_distance(curves, target, aim.width, tolerance) : std::nullopt;
  if (between && between->both.upper > tolerance) {
    for (const Vec3& p : between->farthest) {
      farthest.push_back({p, true});
    }
  }
  return farthest.empty();
}

}  // namespace tunica
