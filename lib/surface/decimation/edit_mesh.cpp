#include "tunica/surface/decimation/detail/edit_mesh.hpp"
#include "tunica/core/narrow.hpp"

namespace tunica {
namespace {

constexpr std::size_t spare_places = 2;  // around a vertex, for triangles to come

}  // namespace

EditMesh::EditMesh(const TriangleMesh& mesh)
    : positions(mesh.vertices),
      triangles(mesh.triangles),
      around(mesh.vertices.size()),
      on_boundary(mesh.vertices.size(), 0),
      alive(mesh.triangles.size()) {
  // Inside, each neighbour of a vertex follows it in one triangle and precedes it in another; at a boundary the first
  // one only follows, the last one only precedes.
  std::vector<std::uint64_t> following(mesh.vertices.size(), 0), preceding(mesh.vertices.size(), 0);
  std::vector<std::uint32_t> valence(mesh.vertices.size(), 0);
  for (const auto& c : triangles) {
    for (const Index v : c) {
      ++valence[v];
    }
  }
  for (std::size_t v = 0; v < valence.size(); ++v) {
    around[v].reserve(valence[v] + spare_places);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = triangles[t][k];
      around[v].push_back(narrow<Index>(t));
      following[v] += triangles[t][(k + 1) % 3];
      preceding[v] += triangles[t][(k + 2) % 3];
    }
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    on_boundary[v] = following[v] != preceding[v] ? 1 : 0;
  }
}

std::array<Index, 2> EditMesh::on_edge(Index u, Index v) const {
  if (around[v].size() < around[u].size()) {
    const auto [to_u, from_u] = on_edge(v, u);
    return {from_u, to_u};
  }
  std::array<Index, 2> found{none, none};
  for (const Index t : around[u]) {
    const auto& c = triangles[t];
    const std::size_t k = corner_of(t, u);
    if (c[(k + 1) % 3] == v) {
      found[0] = t;
    } else if (c[(k + 2) % 3] == v) {
      found[1] = t;
    }
  }
  return found;
}

void EditMesh::ring(Index vertex, std::vector<Index>& out) const {
  out.clear();
  for (const Index t : around[vertex]) {
    for (const Index v : triangles[t]) {
      if (v != vertex) {
        out.push_back(v);
      }
    }
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

bool EditMesh::may_collapse(Index u, Index v) const {
  const auto on = on_edge(u, v);
  const std::size_t triangles_on_edge = (on[0] != none ? 1U : 0U) + (on[1] != none ? 1U : 0U);
  if (triangles_on_edge == 0 || (triangles_on_edge == 2 && on_boundary[u] != 0 && on_boundary[v] != 0)) {
    return false;
  }
  std::vector<Index> ring_u, ring_v, common;
  ring(u, ring_u);
  ring(v, ring_v);
  std::set_intersection(ring_u.begin(), ring_u.end(), ring_v.begin(), ring_v.end(), std::back_inserter(common));
  if (common.size() != triangles_on_edge) {
    return false;
  }
  return std::all_of(common.begin(), common.end(),
                     [&](Index w) { return around[w].size() > (on_boundary[w] != 0 ? 1U : 3U); });
}

bool EditMesh::may_flip(Index u, Index v) const {
  const auto on = on_edge(u, v);
  if (on[0] == none || on[1] == none) {
    return false;
  }
  const Index c = apex(on[0], u, v);
  const Index d = apex(on[1], u, v);
  const auto other = on_edge(c, d);
  const auto keeps_enough = [&](Index w) { return around[w].size() > (on_boundary[w] != 0 ? 1U : 3U); };
  return c != d && other[0] == none && other[1] == none && keeps_enough(u) && keeps_enough(v);
}

Index EditMesh::add_triangle(const std::array<Index, 3>& corners) {
  Index t = 0;
  if (free_triangles.empty()) {
    t = narrow<Index>(triangles.size());
    triangles.push_back(corners);
  } else {
    t = free_triangles.back();
    free_triangles.pop_back();
    triangles[t] = corners;
  }
  for (const Index v : corners) {
    around[v].insert(std::upper_bound(around[v].begin(), around[v].end(), t), t);
  }
  ++alive;
  return t;
}

void EditMesh::remove_triangle(Index t) {
  for (const Index v : triangles[t]) {
    around[v].erase(std::lower_bound(around[v].begin(), around[v].end(), t));
  }
  triangles[t] = {none, none, none};
  free_triangles.push_back(t);
  --alive;
}

Index EditMesh::add_vertex(const Vec3& position, bool boundary) {
  positions.push_back(position);
  around.emplace_back();
  on_boundary.push_back(boundary ? 1 : 0);
  return narrow<Index>(positions.size() - 1);
}

std::vector<std::array<Index, 2>> EditMesh::edges() const {
  std::vector<std::array<Index, 2>> result;
  result.reserve(alive * 3 / 2);
  for (const auto& c : triangles) {
    for (std::size_t k = 0; k < 3 && c[0] != none; ++k) {
      const Index u = c[k];
      const Index v = c[(k + 1) % 3];
      if (u < v || on_edge(u, v)[1] == none) {
        result.push_back({std::min(u, v), std::max(u, v)});
      }
    }
  }
  return result;
}

TriangleMesh EditMesh::mesh() const {
  TriangleMesh result;
  std::vector<Index> renumbered(positions.size(), none);
  for (const auto& c : triangles) {
    if (c[0] == none) {
      continue;
    }
    auto corners = c;
    for (Index& v : corners) {
      if (renumbered[v] == none) {
        renumbered[v] = narrow<Index>(result.vertices.size());
        result.vertices.push_back(positions[v]);
      }
      v = renumbered[v];
    }
    result.triangles.push_back(corners);
  }
  return result;
}

}  // namespace tunica
