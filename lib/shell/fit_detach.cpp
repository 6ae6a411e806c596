#include "shell/fit_detach.hpp"

#include "shell/fit_trial.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double radians_per_degree = 3.14159265358979323846 / 180;
constexpr double worth_a_crease = 0.6;  // of its error a patch may keep when it gets normals of its own

/// What the triangles across have at the ends of a triangle's edges.
NormalsAcross normals_across(const FitMesh& mesh, Index t) {
  const auto slots = mesh.slots_across(t);
  NormalsAcross out;
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = {mesh.normals[slots[k][0]], mesh.normals[slots[k][1]]};
  }
  return out;
}

/// Whether the neighbours of a triangle whose normals have changed are within `most`, or no worse than before: a
/// watertight patch shares its edges with them. They are measured.
bool neighbours_bear(FitState& state, Index t, double most) {
  const auto& v = state.mesh.triangles[t];
  std::vector<std::pair<Index, FitState::Patch>> before;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto pair = state.mesh.on_edge(v[k], v[(k + 1) % 3]);
    const Index other = pair.triangle[0] == t ? pair.triangle[1] : pair.triangle[0];
    if (other != no_index) {
      before.emplace_back(other, state.patches[other]);
      state.measure(other, std::numeric_limits<double>::infinity());
    }
  }
  const bool bear = std::all_of(before.begin(), before.end(), [&](const auto& b) {
    return state.patches[b.first].error <= std::max(most, b.second.error);
  });
  for (auto& [other, patch] : before) {
    if (!bear) {
      state.patches[other] = std::move(patch);
    }
  }
  return bear;
}

}  // namespace

std::size_t detach_worst(FitState& state, double limit) {
  FitMesh& mesh = state.mesh;
  std::size_t detached = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    if (!mesh.is_alive(t) || state.patches[t].error <= limit) {
      continue;
    }
    Trial trial;
    trial.limits = {state.limits.agreement, 0};
    trial.patches.push_back(placed(state, t));
    link(state, {mesh.triangles[t]}, {t}, trial);
    PlacedPatch& patch = trial.patches[0];
    patch.attached = state.patches[t].attached;
    patch.shape.normals.fill(facing_of(patch.shape.corners));
    if (mesh.kind == Patch::watertight) {
      patch.shape.across = normals_across(mesh, t);
    }
    turn_normals(state.samples(), patch, trial.limits, placing_steps);
    const double before = state.patches[t].error;
    if (!(patch.error < worth_a_crease * before)) {
      continue;
    }
    const auto old_slots = mesh.slots[t];
    for (std::size_t k = 0; k < 3; ++k) {
      mesh.slots[t][k] = mesh.add_slot(patch.shape.normals[k], mesh.fresh_sector(mesh.triangles[t][k]));
    }
    if (mesh.kind == Patch::watertight && !neighbours_bear(state, t, std::max(limit, worth_a_crease * before))) {
      mesh.slots[t] = old_slots;
      mesh.normals.resize(mesh.normals.size() - 3);
      mesh.sectors.resize(mesh.normals.size());
      continue;
    }
    state.patches[t] = {std::move(patch.guesses), std::move(patch.attached), std::move(patch.residuals), patch.error};
    ++detached;
  }
  return detached;
}

void part_normals(FitState& state) {
  FitMesh& mesh = state.mesh;
  std::vector<std::uint8_t> taken(mesh.normals.size(), 0);
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; mesh.is_alive(t) && k < 3; ++k) {
      const Index s = mesh.slots[t][k];
      if (taken[s] != 0) {
        mesh.slots[t][k] = mesh.add_slot(mesh.normals[s], mesh.sectors[s]);
      }
      taken[s] = 1;
    }
  }
}

double share_parted_by(const FitMesh& mesh, double degrees) {
  const double cosine = std::cos(degrees * radians_per_degree);
  std::size_t nodes = 0, parted = 0;
  std::vector<Index> slots;
  for (Index v = 0; v < mesh.around.size(); ++v) {
    if (mesh.around[v].empty()) {
      continue;
    }
    ++nodes;
    mesh.slots_of(v, slots);
    const bool far = std::any_of(slots.begin(), slots.end(), [&](Index a) {
      return std::any_of(slots.begin(), slots.end(), [&](Index b) {
        return mesh.sectors[a] == mesh.sectors[b] && mesh.normals[a].dot(mesh.normals[b]) < cosine;
      });
    });
    parted += far ? 1 : 0;
  }
  return static_cast<double>(parted) / static_cast<double>(nodes);
}

}  // namespace tunica
