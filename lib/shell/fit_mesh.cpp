#include "shell/fit_mesh.hpp"

#include <algorithm>

namespace tunica {

FitMesh::FitMesh(const TriangleMesh& mesh, const std::vector<Vec3>& node_normals)
    : positions(mesh.vertices),
      normals(node_normals),
      sectors(node_normals.size(), 0),
      triangles(mesh.triangles),
      slots(mesh.triangles),
      around(mesh.vertices.size()),
      on_boundary(mesh.vertices.size(), 0),
      alive(mesh.triangles.size()) {
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const Index v : triangles[t]) {
      around[v].push_back(static_cast<Index>(t));
    }
  }
  const auto across = neighbours(mesh, incidence(mesh));
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (across[t][k] == no_neighbour) {
        on_boundary[triangles[t][k]] = on_boundary[triangles[t][(k + 1) % 3]] = 1;
      }
    }
  }
}

FitMesh::Pair FitMesh::on_edge(Index u, Index v) const {
  Pair pair;
  std::size_t n = 0;
  for (const Index t : around[u]) {
    if (has_node(t, v) && n < 2) {
      pair.triangle[n++] = t;
    }
  }
  return pair;
}

CubicPatch FitMesh::patch(Index t) const {
  const auto across = creases(t);
  return across ? watertight_patch(corners(t), corner_normals(t), *across)
                : smooth_patch(kind, corners(t), corner_normals(t));
}

std::array<std::array<Index, 2>, 3> FitMesh::slots_across(Index t) const {
  const auto &v = triangles[t], &s = slots[t];
  std::array<std::array<Index, 2>, 3> across{{{s[0], s[1]}, {s[1], s[2]}, {s[2], s[0]}}};
  for (std::size_t k = 0; k < 3; ++k) {
    const Index from = v[k], to = v[(k + 1) % 3];
    const Pair pair = on_edge(from, to);
    const Index other = pair.triangle[0] == t ? pair.triangle[1] : pair.triangle[0];
    if (other != no_index) {
      across[k] = {slots[other][corner_of(other, from)], slots[other][corner_of(other, to)]};
    }
  }
  return across;
}

std::optional<NormalsAcross> FitMesh::creases(Index t) const {
  if (kind != Patch::watertight) {
    return {};
  }
  const auto &v = triangles[t], &s = slots[t];
  std::optional<NormalsAcross> out;
  const auto set = [&](std::size_t edge, std::size_t end, const Vec3& normal) {
    if (!out) {
      out = own_normals_across(corner_normals(t));
    }
    (*out)[edge][end] = normal;
  };
  const auto across = slots_across(t);
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t end = 0; end < 2; ++end) {
      if (across[k][end] != s[(k + end) % 3]) {
        set(k, end, normals[across[k][end]]);
      }
    }
  }
  for (const RimEdge& edge : rim) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (edge.nodes == std::array<Index, 2>{v[k], v[(k + 1) % 3]}) {
        set(k, 0, edge.normals[0]);
        set(k, 1, edge.normals[1]);
      }
    }
  }
  return out;
}

void FitMesh::ring(Index node, std::vector<Index>& out) const {
  out.clear();
  for (const Index t : around[node]) {
    for (const Index v : triangles[t]) {
      if (v != node) {
        out.push_back(v);
      }
    }
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

void FitMesh::slots_of(Index node, std::vector<Index>& out) const {
  out.clear();
  for (const Index t : around[node]) {
    out.push_back(slots[t][corner_of(t, node)]);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

Index FitMesh::add_slot(const Vec3& normal, Index sector) {
  normals.push_back(normal);
  sectors.push_back(sector);
  return static_cast<Index>(normals.size() - 1);
}

Index FitMesh::fresh_sector(Index node) const {
  Index fresh = 0;
  for (const Index t : around[node]) {
    fresh = std::max(fresh, sectors[slots[t][corner_of(t, node)]] + 1);
  }
  return fresh;
}

Index FitMesh::add_triangle(const std::array<Index, 3>& nodes, const std::array<Index, 3>& corner_slots) {
  Index t = no_index;
  if (free_triangles.empty()) {
    t = static_cast<Index>(triangles.size());
    triangles.push_back(nodes);
    slots.push_back(corner_slots);
  } else {
    t = free_triangles.back();
    free_triangles.pop_back();
    triangles[t] = nodes;
    slots[t] = corner_slots;
  }
  for (const Index v : nodes) {
    around[v].push_back(t);
  }
  ++alive;
  return t;
}

void FitMesh::remove_triangle(Index t) {
  for (const Index v : triangles[t]) {
    auto& list = around[v];
    list.erase(std::find(list.begin(), list.end(), t));
  }
  triangles[t] = {no_index, no_index, no_index};
  free_triangles.push_back(t);
  --alive;
}

const FitMesh::CutEdge* FitMesh::cut_edge(Index u, Index v) const {
  const std::array<Index, 2> nodes{std::min(u, v), std::max(u, v)};
  const auto found = std::lower_bound(cut.begin(), cut.end(), nodes,
                                      [](const CutEdge& edge, const auto& n) { return edge.nodes < n; });
  return found != cut.end() && found->nodes == nodes ? &*found : nullptr;
}

std::optional<std::array<Vec3, 3>> FitMesh::points_beyond(Index u, Index v) const {
  const CutEdge* edge = cut_edge(u, v);
  if (edge == nullptr || !edge->points) {
    return {};
  }
  const auto& points = *edge->points;
  return u < v ? points : std::array<Vec3, 3>{points[2], points[1], points[0]};
}

bool FitMesh::is_boundary_edge(Index u, Index v) const {
  return on_boundary[u] != 0 && on_boundary[v] != 0 && on_edge(u, v).count() == 1 && !is_cut(u, v);
}

EdgeBits FitMesh::boundary_edges(Index t) const {
  const auto& v = triangles[t];
  EdgeBits bits = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    bits |= static_cast<EdgeBits>(is_boundary_edge(v[k], v[(k + 1) % 3]) ? 1U << k : 0U);
  }
  return bits;
}

std::vector<FitMesh::BoundaryEdge> FitMesh::boundary() const {
  std::vector<BoundaryEdge> out;
  for (Index t = 0; t < triangles.size(); ++t) {
    const EdgeBits bits = is_alive(t) ? boundary_edges(t) : EdgeBits{0};
    for (std::size_t k = 0; k < 3; ++k) {
      if ((bits >> k & 1) != 0) {
        out.push_back({t, edge_curve(patch(t), k)});
      }
    }
  }
  return out;
}

std::vector<std::array<Index, 2>> FitMesh::edges() const {
  std::vector<std::array<Index, 2>> out;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; is_alive(static_cast<Index>(t)) && k < 3; ++k) {
      const Index u = triangles[t][k], v = triangles[t][(k + 1) % 3];
      // An inner edge is met twice, once in each direction; a boundary edge in one.
      if (u < v || (on_boundary[u] != 0 && on_boundary[v] != 0 && on_edge(u, v).count() == 1)) {
        out.push_back({std::min(u, v), std::max(u, v)});
      }
    }
  }
  return out;
}

ShellMesh FitMesh::shell(std::vector<Index>* kept) const {
  ShellMesh out;
  out.patch = kind;
  std::vector<Index> number(positions.size(), no_index), first_slot(positions.size(), no_index);
  bool creased = false;
  if (kept != nullptr) {
    kept->clear();
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (!is_alive(static_cast<Index>(t))) {
      continue;
    }
    auto v = triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      const Index node = v[k];
      if (number[node] == no_index) {
        number[node] = static_cast<Index>(out.vertices.size());
        first_slot[node] = slots[t][k];
        out.vertices.push_back(positions[node]);
        out.normals.push_back(normals[slots[t][k]]);
      }
      creased = creased || first_slot[node] != slots[t][k];
      v[k] = number[node];
    }
    out.triangles.push_back(v);
    out.corner_normals.push_back(corner_normals(static_cast<Index>(t)));
    if (kept != nullptr) {
      kept->push_back(static_cast<Index>(t));
    }
  }
  if (!creased) {
    out.corner_normals.clear();
    return out;
  }
  // Where sides meet, the node's own normal is their mean.
  for (Vec3& n : out.normals) {
    n.setZero();
  }
  for (std::size_t t = 0; t < out.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      out.normals[out.triangles[t][k]] += out.corner_normals[t][k];
    }
  }
  for (std::size_t v = 0; v < out.normals.size(); ++v) {
    Vec3& n = out.normals[v];
    n = n.norm() > 1e-6 ? Vec3(n.normalized()) : Vec3(Vec3::UnitZ());
  }
  return out;
}

}  // namespace tunica
