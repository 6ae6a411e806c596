#include "shell/fit_cross.hpp"

#include "shell/fit_edit.hpp"
#include "shell/fit_shape.hpp"
#include "surface/self_intersections.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr int drawing_level = 4;  // pieces per edge
constexpr int most_rounds = 10;
constexpr int patience = 3;  // rounds that leave as many pairs
constexpr int placing_sweeps = 2;

/// The triangles of the mesh under edit that take part in a crossing.
std::vector<Index> crossing_triangles(const FitState& state, std::size_t& pairs) {
  std::vector<Index> kept, out;
  const auto found = crossing_shells(state.mesh.shell(&kept));
  pairs = found.size();
  for (const auto& [one, other] : found) {
    out.push_back(kept[one]);
    out.push_back(kept[other]);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

/// Each node where the patches around it come closest to the target.
void place_nodes_of(FitState& state, const std::vector<Index>& triangles) {
  for (int sweep = 0; sweep < placing_sweeps; ++sweep) {
    for (const Index t : triangles) {
      for (const Index v : state.mesh.triangles[t]) {
        double error = 0;
        for (const Index around : state.mesh.around[v]) {
          error = std::max(error, state.patches[around].error);
        }
        move_node(state, v, state.mesh.positions[v], 0, 0.999 * error);
      }
    }
  }
}

/// Cuts the longest edge of each triangle that is still there.
void split(FitState& state, const std::vector<Index>& triangles, double limit) {
  for (const Index t : triangles) {
    if (!state.mesh.is_alive(t)) {
      continue;
    }
    const auto v = state.mesh.triangles[t];
    const auto length = [&](std::size_t k) {
      return (state.mesh.positions[v[(k + 1) % 3]] - state.mesh.positions[v[k]]).norm();
    };
    const std::size_t longest = length(0) >= length(1)   ? (length(0) >= length(2) ? 0 : 2)
                                : length(1) >= length(2) ? 1
                                                         : 2;
    split_edge(state, v[longest], v[(longest + 1) % 3], limit);
  }
}

}  // namespace

std::vector<std::array<Index, 2>> crossing_shells(const ShellMesh& shell) {
  const Tessellation fine = tessellate_uniformly(shell, drawing_level);
  return find_self_intersections(fine.mesh, fine.shell, shell.triangles);
}

std::size_t part_crossings(FitState& state, double limit, std::size_t most) {
  std::size_t left = 0;
  std::vector<Index> crossing = crossing_triangles(state, left);
  const double allowed = std::max(limit, state.error());
  FitState trial = state;
  int fruitless = 0;
  for (int round = 0; round < most_rounds && left > 0 && fruitless < patience; ++round) {
    if (round > 0) {
      if (trial.mesh.alive + 2 * crossing.size() > most) {
        break;
      }
      split(trial, crossing, allowed);
      std::size_t now = 0;
      crossing = crossing_triangles(trial, now);
    }
    place_nodes_of(trial, crossing);
    trial.attach();
    trial.measure();
    rid_of_thin(trial, allowed, most);
    std::size_t now = 0;
    crossing = crossing_triangles(trial, now);
    if (now < left && trial.error() <= allowed) {
      state = trial;
      left = now;
      fruitless = 0;
    } else {
      ++fruitless;
    }
  }
  return left;
}

}  // namespace tunica
