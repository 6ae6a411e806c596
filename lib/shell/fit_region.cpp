#include "shell/fit_region.hpp"

#include <algorithm>

namespace tunica {
namespace {

/// Numbers things in the order in which they are first asked for.
class Numbering {
public:
  explicit Numbering(std::size_t size) : number_(size, no_index) {}

  Index of(Index old) {
    if (number_[old] == no_index) {
      number_[old] = static_cast<Index>(old_.size());
      old_.push_back(old);
    }
    return number_[old];
  }
  [[nodiscard]] std::vector<Index>& old() { return old_; }

private:
  std::vector<Index> number_, old_;
};

/// Where the edges between these triangles and the others are creases: what lies on the other side.
std::vector<FitMesh::RimEdge> creases_beyond(const FitMesh& mesh, const std::vector<Index>& triangles,
                                             Numbering& node) {
  std::vector<FitMesh::RimEdge> out;
  for (const Index t : triangles) {
    const auto &v = mesh.triangles[t], &s = mesh.slots[t];
    const auto across = mesh.slots_across(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      const auto pair = mesh.on_edge(v[k], v[next]);
      const bool creased = across[k][0] != s[k] || across[k][1] != s[next];
      if (creased && std::any_of(pair.triangle.begin(), pair.triangle.end(), [&](Index other) {
            return !std::binary_search(triangles.begin(), triangles.end(), other);
          })) {
        out.push_back({{node.of(v[k]), node.of(v[next])}, {mesh.normals[across[k][0]], mesh.normals[across[k][1]]}});
      }
    }
  }
  return out;
}

/// The edges between these triangles and the others, or those of what they are a piece of themselves.
std::vector<FitMesh::CutEdge> edges_cut(const FitMesh& mesh, const std::vector<Index>& triangles, Numbering& node,
                                        bool heed_rim) {
  std::vector<FitMesh::CutEdge> out;
  for (const Index t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      Index u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
      if (node.of(v) < node.of(u)) {
        std::swap(u, v);
      }
      bool is_cut = mesh.is_cut(u, v);
      auto points = mesh.points_beyond(u, v);
      for (const Index other : mesh.on_edge(u, v).triangle) {
        if (other != no_index && !std::binary_search(triangles.begin(), triangles.end(), other)) {
          is_cut = true;
          if (heed_rim) {
            points = edge_points(mesh.patch(other), mesh.corner_of(other, u), mesh.corner_of(other, v));
          }
        }
      }
      if (is_cut) {
        out.push_back({{node.of(u), node.of(v)}, points});
      }
    }
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.nodes < b.nodes; });
  return out;
}

}  // namespace

FitRegion cut_out(const FitState& whole, const std::vector<Index>& nodes, int rings, bool heed_rim) {
  const FitMesh& mesh = whole.mesh;
  std::vector<Index> free = nodes, ring, triangles;
  for (int i = 0; i < rings; ++i) {
    std::vector<Index> wider = free;
    for (const Index v : free) {
      mesh.ring(v, ring);
      wider.insert(wider.end(), ring.begin(), ring.end());
    }
    std::sort(wider.begin(), wider.end());
    wider.erase(std::unique(wider.begin(), wider.end()), wider.end());
    free = std::move(wider);
  }
  for (const Index v : free) {
    triangles.insert(triangles.end(), mesh.around[v].begin(), mesh.around[v].end());
  }
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());

  Numbering node(mesh.positions.size()), slot(mesh.normals.size());
  TriangleMesh facets;
  std::vector<std::array<Index, 3>> corner_slots;
  for (const Index t : triangles) {
    const auto &v = mesh.triangles[t], &s = mesh.slots[t];
    facets.triangles.push_back({node.of(v[0]), node.of(v[1]), node.of(v[2])});
    corner_slots.push_back({slot.of(s[0]), slot.of(s[1]), slot.of(s[2])});
  }
  std::vector<Vec3> normals;
  std::vector<Index> sectors;
  for (const Index v : node.old()) {
    facets.vertices.push_back(mesh.positions[v]);
  }
  for (const Index s : slot.old()) {
    normals.push_back(mesh.normals[s]);
    sectors.push_back(mesh.sectors[s]);
  }
  FitMesh piece(facets, normals);
  piece.slots = std::move(corner_slots);
  piece.sectors = std::move(sectors);
  piece.kind = mesh.kind;
  piece.held.assign(node.old().size(), 1);
  for (std::size_t i = 0; i < node.old().size(); ++i) {
    piece.on_boundary[i] = mesh.on_boundary[node.old()[i]];
  }
  piece.cut = edges_cut(mesh, triangles, node, heed_rim);
  if (mesh.kind == Patch::watertight) {
    piece.rim = creases_beyond(mesh, triangles, node);
  }
  for (const Index v : free) {
    if (!mesh.around[v].empty()) {
      piece.held[node.of(v)] = mesh.is_held(v) ? 1 : 0;
    }
  }
  FitRegion region{FitState(whole.samples(), std::move(piece), whole.limits), std::move(triangles),
                   std::move(node.old()), std::move(slot.old())};
  for (std::size_t i = 0; i < region.triangles.size(); ++i) {
    region.state.patches[i] = whole.patches[region.triangles[i]];
  }
  return region;
}

double put_back(const FitRegion& region, FitState& whole) {
  const FitMesh& piece = region.state.mesh;
  FitMesh& mesh = whole.mesh;
  for (const Index t : region.triangles) {
    mesh.remove_triangle(t);
    whole.patches[t] = {};
  }
  std::vector<Index> node = region.nodes, slot = region.slots;
  for (std::size_t v = node.size(); v < piece.positions.size(); ++v) {
    node.push_back(static_cast<Index>(mesh.positions.size()));
    mesh.positions.emplace_back();
    mesh.on_boundary.push_back(0);
    mesh.around.emplace_back();
  }
  for (std::size_t s = slot.size(); s < piece.normals.size(); ++s) {
    slot.push_back(mesh.add_slot(piece.normals[s], piece.sectors[s]));
  }
  for (std::size_t v = 0; v < node.size(); ++v) {
    mesh.positions[node[v]] = piece.positions[v];
    mesh.on_boundary[node[v]] = piece.on_boundary[v];
  }
  for (std::size_t s = 0; s < slot.size(); ++s) {
    mesh.normals[slot[s]] = piece.normals[s];
    mesh.sectors[slot[s]] = piece.sectors[s];
  }
  std::vector<Index> changed;
  for (Index i = 0; i < piece.triangles.size(); ++i) {
    if (!piece.is_alive(i)) {
      continue;
    }
    const auto &v = piece.triangles[i], &s = piece.slots[i];
    const Index t = mesh.add_triangle({node[v[0]], node[v[1]], node[v[2]]}, {slot[s[0]], slot[s[1]], slot[s[2]]});
    whole.patches.resize(mesh.triangles.size());
    whole.patches[t] = region.state.patches[i];
    changed.push_back(t);
  }
  // What the rim's neighbours gape at has changed as well.
  const std::size_t own = changed.size();
  for (std::size_t i = 0; i < own; ++i) {
    const auto v = mesh.triangles[changed[i]];
    for (std::size_t k = 0; k < 3; ++k) {
      for (const Index t : mesh.on_edge(v[k], v[(k + 1) % 3]).triangle) {
        if (t != no_index) {
          changed.push_back(t);
        }
      }
    }
  }
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  double error = 0;
  for (const Index t : changed) {
    whole.measure(t, std::numeric_limits<double>::infinity());
    error = std::max(error, whole.patches[t].error);
  }
  return error;
}

}  // namespace tunica
