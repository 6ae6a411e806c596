#include "tunica/volume/cubes/detail/pinched_vertices.hpp"
#include "tunica/core/narrow.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace tunica {
namespace {

constexpr Index none = std::numeric_limits<Index>::max();

/// A triangle whose area is below this fraction of its longest edge squared counts as degenerate.
constexpr double least_area_ratio = 1e-9;

class Joiner {
public:
  Joiner(TriangleMesh& mesh, const std::vector<PinchedVertex>& pinched)
      : mesh_(mesh), pinched_(pinched), slot_(mesh.vertices.size(), none), around_(pinched.size()) {
    for (std::size_t s = 0; s < pinched.size(); ++s) {
      slot_[pinched[s].vertex] = narrow<Index>(s);
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (const Index v : mesh.triangles[t]) {
        if (slot_[v] != none) {
          around_[slot_[v]].push_back(narrow<Index>(t));
        }
      }
    }
  }

  void run() {
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t s = 0; s < pinched_.size(); ++s) {
        while (!around_[s].empty() && join_one_neighbour(pinched_[s].vertex)) {
          changed = true;
        }
      }
    }
    for (const PinchedVertex& p : pinched_) {
      if (!partners(p.vertex).empty()) {
        mesh_.vertices[p.vertex] = p.apart;
      }
    }
    compact();
  }

private:
  [[nodiscard]] const Vec3& place(Index v) const {
    return slot_[v] == none ? mesh_.vertices[v] : pinched_[slot_[v]].apart;
  }
  [[nodiscard]] const std::vector<Index>& around(Index v) const { return around_[slot_[v]]; }

  /// Neighbours of a pinched vertex at the same sample, in increasing order.
  [[nodiscard]] std::vector<Index> partners(Index u) const {
    std::vector<Index> result;
    for (const Index t : around(u)) {
      for (const Index v : mesh_.triangles[t]) {
        if (v != u && slot_[v] != none && pinched_[slot_[v]].sample == pinched_[slot_[u]].sample) {
          result.push_back(v);
        }
      }
    }
    std::ranges::sort(result);
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

  bool join_one_neighbour(Index u) {
    for (const Index v : partners(u)) {
      if (keeps_topology(u, v) && keeps_shape(u, v)) {
        collapse(u, v);
        return true;
      }
    }
    return false;
  }

  /// The link of a vertex: the edges opposite to it, as (from, to); an open link is closed over one further, virtual
  /// vertex, which stands for the boundary.
  [[nodiscard]] std::vector<std::array<Index, 2>> link(Index u) const {
    std::vector<std::array<Index, 2>> edges;
    for (const Index t : around(u)) {
      const auto& corner = mesh_.triangles[t];
      const std::size_t i = std::ranges::find(corner, u) - corner.begin();
      edges.push_back({corner[(i + 1) % 3], corner[(i + 2) % 3]});
    }
    const std::size_t given = edges.size();
    for (std::size_t e = 0; e < given; ++e) {
      const auto [from, to] = edges[e];
      const auto end = edges.begin() + given;
      const bool has_previous =
          std::any_of(edges.begin(), end, [from = from](const auto& edge) { return edge[1] == from; });
      const bool has_next = std::any_of(edges.begin(), end, [to = to](const auto& edge) { return edge[0] == to; });
      if (!has_previous) {
        edges.push_back({none, from});
      }
      if (!has_next) {
        edges.push_back({to, none});
      }
    }
    return edges;
  }

  /// Link condition: what the links of u and v share is the link of their edge, two vertices.
  [[nodiscard]] bool keeps_topology(Index u, Index v) const {
    const auto link_u = link(u);
    const auto link_v = link(v);
    std::vector<Index> common;
    for (const auto& [a, b] : link_u) {
      if (std::ranges::any_of(link_v, [a = a](const auto& edge) { return edge[0] == a; })) {
        common.push_back(a);
      }
      const bool shared_edge = std::ranges::any_of(link_v, [a = a, b = b](const auto& edge) {
        return (edge[0] == a && edge[1] == b) || (edge[0] == b && edge[1] == a);
      });
      if (shared_edge) {
        return false;
      }
    }
    return common.size() == 2;
  }

  /// No triangle around v turns over or loses its area when v moves to u.
  [[nodiscard]] bool keeps_shape(Index u, Index v) const {
    return std::ranges::all_of(around(v), [&](Index t) {
      const auto& corner = mesh_.triangles[t];
      if (std::ranges::find(corner, u) != corner.end()) {
        return true;
      }
      const Vec3 before = normal(corner, v, v);
      const Vec3 after = normal(corner, v, u);
      double longest_squared = 0;
      for (int i = 0; i < 3; ++i) {
        const Vec3& p = place(corner[i] == v ? u : corner[i]);
        const Vec3& q = place(corner[(i + 1) % 3] == v ? u : corner[(i + 1) % 3]);
        longest_squared = std::max(longest_squared, (q - p).squaredNorm());
      }
      return before.dot(after) > 0 && after.norm() > least_area_ratio * longest_squared;
    });
  }

  [[nodiscard]] Vec3 normal(const std::array<Index, 3>& corner, Index moved, Index to) const {
    const auto at = [&](int i) -> const Vec3& { return place(corner[i] == moved ? to : corner[i]); };
    return (at(1) - at(0)).cross(at(2) - at(0));
  }

  void collapse(Index u, Index v) {
    std::vector<Index> moved;
    for (const Index t : around(v)) {
      auto& corner = mesh_.triangles[t];
      if (std::ranges::find(corner, u) == corner.end()) {
        std::ranges::replace(corner, v, u);
        moved.push_back(t);
        continue;
      }
      for (const Index w : corner) {
        if (w != v && slot_[w] != none) {
          std::erase(around_[slot_[w]], t);
        }
      }
      corner = {none, none, none};
    }
    around_[slot_[v]].clear();
    auto& list = around_[slot_[u]];
    list.insert(list.end(), moved.begin(), moved.end());
  }

  void compact() {
    std::erase_if(mesh_.triangles, [](const auto& corner) { return corner[0] == none; });
    std::size_t kept = 0;
    std::vector<Index> number(mesh_.vertices.size(), none);
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
      if (slot_[v] == none || !around_[slot_[v]].empty()) {
        number[v] = narrow<Index>(kept);
        mesh_.vertices[kept++] = mesh_.vertices[v];
      }
    }
    mesh_.vertices.resize(kept);
    for (auto& corner : mesh_.triangles) {
      for (Index& v : corner) {
        v = number[v];
      }
    }
  }

  TriangleMesh& mesh_;
  const std::vector<PinchedVertex>& pinched_;
  std::vector<Index> slot_;                 ///< number of a vertex among the pinched
  std::vector<std::vector<Index>> around_;  ///< triangles of each pinched vertex; none once it was joined to another
};

}  // namespace

void join_pinched_vertices(TriangleMesh& mesh, const std::vector<PinchedVertex>& pinched) {
  if (!pinched.empty()) {
    Joiner(mesh, pinched).run();
  }
}

}  // namespace tunica
