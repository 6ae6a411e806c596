// Fewer and better shells by steps that make the fit worse for the time being.
#include "shell/fit_squeeze.hpp"

#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_worst.hpp"
#include "surface/closest_point.hpp"
#include "surface/hausdorff.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double first_part = 0.05;             // of the shells: how many fewer are tried at once
constexpr double loosened = 1.5;                // limits: error of a merger that all nodes together may make good
constexpr std::size_t squeezed_shells = 4'000;  // of all tries: what they may cost
constexpr std::size_t least_squeezes = 2, most_squeezes = 12;
constexpr int regaining = 8;                     // steps of all nodes
constexpr int looks = 4;                         // for points that the samples missed
constexpr std::size_t checked_points = 200'000;  // of the target, for places that the samples miss
constexpr int checking_level = 6;                // pieces per edge of the patches there
constexpr int fine_level = 12;  // where errors are wanted: ridges of a coarse target lie between the grid points
constexpr std::size_t price_of_a_thin_one = 10;  // shells
constexpr double narrow = 0.05;                  // of the limit: gaps that add nothing
constexpr double exact = 1.025;  // limits: what is looked at above gaps is the worst, so with less margin

/// Where patches part sideways and are off as well, the target above the gap is farther from both than either measure
/// says: its points there that are too far off.
std::vector<Vec3> missed_over_gaps(const FitState& state, double limit) {
  const FitMesh& mesh = state.mesh;
  const Target& target = state.samples().target();
  std::vector<Vec3> found;
  for (const auto& [u, v] : mesh.edges()) {
    const auto pair = mesh.on_edge(u, v);
    if (pair.count() < 2) {
      continue;
    }
    const Index one = pair.triangle[0], other = pair.triangle[1];
    const CubicPatch here = mesh.patch(one), there = mesh.patch(other);
    const auto on_here = edge_points(here, mesh.corner_of(one, u), mesh.corner_of(one, v));
    const auto on_there = edge_points(there, mesh.corner_of(other, u), mesh.corner_of(other, v));
    for (std::size_t i = 0; i < on_here.size(); ++i) {
      if ((on_here[i] - on_there[i]).norm() < narrow * limit) {
        continue;
      }
      const Vec3 p = target.closest((on_here[i] + on_there[i]) / 2).point;
      const double squared =
          std::min(foot_on_patch(here, p).squared_distance, foot_on_patch(there, p).squared_distance);
      if (squared > limit * limit) {
        found.push_back(p);
      }
    }
  }
  return found;
}

}  // namespace

std::size_t price(const FitState& state) { return state.mesh.alive + price_of_a_thin_one * count_thin(state); }

std::size_t add_missed(FitSamples& samples, FitState& state, double limit, bool errors) {
  std::vector<Index> triangles;
  const Tessellation fine = tessellate_uniformly(state.mesh.shell(&triangles), errors ? fine_level : checking_level);
  const ClosestPoint tree(fine.mesh);
  const auto raise = [&](Index patch, double error) {
    if (errors) {
      double& known = state.patches[triangles[patch]].error;
      known = std::max(known, error);
    }
  };
  const TriangleMesh& mesh = samples.target().mesh();
  std::vector<Vec3> points = mesh.vertices;
  if (mesh.triangles.size() < checked_points / 4) {
    // Few: what lies between them counts too.
    for (const auto& v : mesh.triangles) {
      points.emplace_back((mesh.vertices[v[0]] + mesh.vertices[v[1]] + mesh.vertices[v[2]]) / 3);
      for (std::size_t k = 0; k < 3; ++k) {
        points.emplace_back((mesh.vertices[v[k]] + mesh.vertices[v[(k + 1) % 3]]) / 2);
      }
    }
  }
  const std::size_t stride = std::max<std::size_t>(1, points.size() / checked_points);
  std::vector<ClosestPoint::Hit> hits(points.size() / stride);
  parallel_for_blocks(points.size() / stride, 512, [&](std::size_t begin, std::size_t end) {
    std::optional<Index> guess;
    for (std::size_t i = begin; i < end; ++i) {
      const auto hit = guess ? tree.closest(points[i * stride], *guess) : tree.closest(points[i * stride]);
      guess = hit.triangle;
      hits[i] = hit;
    }
  });
  std::size_t added = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (hits[i].squared_distance <= limit * limit) {
      continue;
    }
    // The flat pieces of the patch may be farther off than the patch.
    const Vec3& p = points[i * stride];
    const Index patch = fine.shell[hits[i].triangle];
    const double distance = std::sqrt(foot_on_patch(state.mesh.patch(triangles[patch]), p).squared_distance);
    if (distance > limit) {
      samples.add(p);
      ++added;
      raise(patch, distance);
    }
  }
  for (const Vec3& p : missed_over_gaps(state, exact * limit)) {
    samples.add(p);
    ++added;
  }
  if (errors) {
    const auto distances = vertex_distances(fine.mesh, samples.target().tree());
    for (std::size_t v = 0; v < distances.size(); ++v) {
      raise(fine.vertex_shell[v], distances[v]);
    }
  }
  return added;
}

bool regains(FitSamples& samples, FitState& state, double limit) {
  for (int look = 0; look < looks; ++look) {
    for (int i = 0; i < regaining && state.error() > limit; ++i) {
      flip_edges(state, limit);
      state.solve(i == 0 ? 4 : 8, 1);
      place_worst(state, 0.9 * limit);
      state.attach();
      state.measure();
    }
    if (state.error() > limit) {
      return false;
    }
    mend_angles(state, limit);
    if (add_missed(samples, state, limit) == 0) {
      return true;
    }
    state.attach();
    state.measure();
  }
  return false;
}

void squeeze(FitSamples& samples, FitState& state, double limit) {
  double part = first_part;
  const std::size_t crossings = crossing_shells(state.mesh.shell()).size();
  const std::size_t tries = std::clamp(squeezed_shells / state.mesh.alive, least_squeezes, most_squeezes);
  for (std::size_t i = 0; i < tries; ++i) {
    const auto fewer = static_cast<std::size_t>(std::max(2.0, part * static_cast<double>(state.mesh.alive)));
    FitState trial = state;
    collapse_edges(trial, loosened * limit, state.mesh.alive - std::min(fewer, state.mesh.alive - 4), {});
    trial.attach();
    trial.measure();
    if (trial.mesh.alive < state.mesh.alive && regains(samples, trial, limit) && price(trial) < price(state) &&
        part_crossings(trial, limit, state.mesh.alive) <= crossings && price(trial) < price(state)) {
      state = std::move(trial);
    } else if (fewer <= 2) {
      break;
    } else {
      part /= 2;
    }
  }
}

void shape_up(FitSamples& samples, FitState& state, double limit, std::size_t most) {
  for (const double by_way_of : {1.0, 1.3, 2.0}) {
    const std::size_t thin = count_thin(state);
    if (thin == 0) {
      return;
    }
    FitState trial = state;
    rid_of_thin(trial, by_way_of * limit, most);
    if (count_thin(trial) < thin) {
      trial.attach();
      trial.measure();
      if (regains(samples, trial, limit) && price(trial) < price(state)) {
        state = std::move(trial);
      }
    }
  }
}

}  // namespace tunica
