#include "shell/fit_trial.hpp"

#include "shell/normals.hpp"
#include "surface/measure.hpp"

#include <algorithm>
#include <map>

namespace tunica {

double smallest_angle(const FitState& state, Index t) {
  const auto c = state.mesh.corners(t);
  return smallest_angle_degrees(c[0], c[1], c[2]);
}

void gather(const FitState& state, Index t, Trial& trial) {
  const auto& attached = state.patches[t].attached;
  trial.points.insert(trial.points.end(), attached.begin(), attached.end());
}

void ease_limits(const FitState& state, Index t, FitLimits& limits) {
  limits.angle = std::min(limits.angle, least_angle(state.limits.angle, smallest_angle(state, t)));
  limits.agreement =
      std::min(limits.agreement, normal_agreement(state.mesh.corners(t), state.mesh.corner_normals(t)) - 1e-9);
  limits.agreement = std::max(limits.agreement, least_normal_agreement + 1e-6);
}

PlacedPatch placed(const FitState& state, Index t) {
  PlacedPatch patch;
  patch.shape = state.shape(t);
  patch.guesses = state.patches[t].guesses;
  return patch;
}

namespace {

/// Sets what a watertight patch of the trial finds at the start or the end of an edge on the other side.
/// @param slot  of the trial's node, where that is the corner
void set_across(PlacedPatch& patch, std::size_t edge, std::size_t end, const Vec3& normal, std::size_t slot) {
  const std::size_t corner = (edge + end) % 3;
  const bool at_node = corner == patch.corner;
  if (at_node) {
    patch.beside[end] = slot;
  }
  if (at_node ? slot == patch.slot : normal == patch.shape.normals[corner]) {
    return;
  }
  if (!patch.shape.across) {
    patch.shape.across = own_normals_across(patch.shape.normals);
  }
  (*patch.shape.across)[edge][end] = normal;
}

}  // namespace

void link(const FitState& state, const std::vector<std::array<Index, 3>>& nodes, const std::vector<Index>& replaced,
          Trial& trial) {
  const FitMesh& mesh = state.mesh;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    PlacedPatch& patch = trial.patches[i];
    const bool watertight = patch.shape.kind == Patch::watertight;
    patch.beside = {patch.slot, patch.slot};
    patch.shape.across.reset();
    patch.boundary = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index from = nodes[i][k], to = nodes[i][(k + 1) % 3];
      auto& across = patch.across[k];
      across = {};
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        for (std::size_t l = 0; l < 3; ++l) {
          if (nodes[j][l] == to && nodes[j][(l + 1) % 3] == from) {
            const PlacedPatch& other = trial.patches[j];
            across.patch = j;
            across.from = (l + 1) % 3;
            across.to = l;
            if (watertight) {
              set_across(patch, k, 0, other.shape.normals[across.from], other.slot);
              set_across(patch, k, 1, other.shape.normals[across.to], other.slot);
            }
          }
        }
      }
      if (across.patch != PlacedPatch::Across::none) {
        continue;
      }
      const auto bit = static_cast<EdgeBits>(1U << k);
      patch.boundary |= bit;  // unless there is something across
      if (from >= mesh.around.size() || to >= mesh.around.size()) {
        continue;
      }
      for (const Index t : mesh.around[from]) {
        const std::size_t c = mesh.corner_of(t, from);
        if (mesh.triangles[t][(c + 2) % 3] == to && std::find(replaced.begin(), replaced.end(), t) == replaced.end()) {
          patch.boundary &= static_cast<EdgeBits>(~bit);
          if (watertight) {
            set_across(patch, k, 0, mesh.normals[mesh.slots[t][c]], patch.slot);
            set_across(patch, k, 1, mesh.normals[mesh.slots[t][(c + 2) % 3]], patch.slot);
          } else {
            across.points = edge_points(mesh.patch(t), c, (c + 2) % 3);
          }
        }
      }
      if (mesh.is_cut(from, to)) {
        patch.boundary &= static_cast<EdgeBits>(~bit);
      }
      if (const auto beyond = mesh.points_beyond(from, to); beyond && !watertight) {
        across.points = beyond;
      }
      for (const FitMesh::RimEdge& edge : mesh.rim) {
        if (edge.nodes == std::array<Index, 2>{from, to}) {
          set_across(patch, k, 0, edge.normals[0], patch.slot);
          set_across(patch, k, 1, edge.normals[1], patch.slot);
        }
      }
    }
  }
}

void make_compatible(Trial& trial) {
  PlacedNode& node = trial.node;
  const double least = trial.limits.agreement + 0.05;
  const std::size_t slots = node.normals.size();
  std::vector<Vec3> facing(slots, Vec3::Zero());  // of all facets of a slot
  std::vector<std::uint8_t> agrees(slots, 1);
  std::map<Index, std::vector<Vec3>> of_sector;
  for (const PlacedPatch& p : trial.patches) {
    if (p.corner == PlacedPatch::no_corner) {
      continue;
    }
    auto corners = p.shape.corners;
    corners[p.corner] = node.position;
    const Vec3 facet = facing_of(corners);
    facing[p.slot] += facet;
    of_sector[node.sectors[p.slot]].push_back(facet);
    if (node.normals[p.slot].dot(facet) < least) {
      agrees[p.slot] = 0;
    }
  }
  for (const auto& [sector, facets] : of_sector) {
    Vec3 wanted = Vec3::Zero();
    for (std::size_t s = 0; s < slots; ++s) {
      wanted += node.sectors[s] == sector ? node.normals[s] : Vec3::Zero();
    }
    const auto normal = compatible_normal(wanted.stableNormalized(), facets, least);
    for (std::size_t s = 0; s < slots; ++s) {
      if (node.sectors[s] != sector || agrees[s] != 0) {
        continue;
      }
      if (normal) {
        node.normals[s] = *normal;
      } else if (trial.limits.kink > 0 && facing[s].norm() > 1e-3) {
        node.normals[s] = facing[s].normalized();  // as far as these may part: see hold_together()
      }
    }
  }
}

}  // namespace tunica
