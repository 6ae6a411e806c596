#include "tunica/surface/repair/repair.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/seams.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>

namespace tunica {
namespace {

constexpr Index none = 0xffffffff;

// Side k of triangle t, from its corner k to the next: 3 t + k.
using Side = std::size_t;

// Pieces of triangles that know whether they face the same way as another member.
class ParityUnion {
public:
  explicit ParityUnion(std::size_t size) : parent_(size), turned_(size, 0) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }

  // The root, and whether the member is turned against it.
  std::pair<Index, bool> find(Index i) {
    Index root = i;
    bool turned = false;
    while (parent_[root] != root) {
      turned ^= turned_[root] != 0;
      root = parent_[root];
    }
    bool rest = turned;
    while (parent_[i] != root && i != root) {  // path compression
      const Index next = parent_[i];
      const bool own = turned_[i] != 0;
      parent_[i] = root;
      turned_[i] = rest ? 1 : 0;
      rest ^= own;
      i = next;
    }
    return {root, turned};
  }

  // Lets the two face the same way, or opposite ways. @return false when that contradicts what is known
  bool join(Index i, Index j, bool opposite) {
    const auto [a, a_turned] = find(i);
    const auto [b, b_turned] = find(j);
    const bool turned = a_turned ^ b_turned ^ opposite;
    if (a == b) {
      return !turned;
    }
    parent_[std::max(a, b)] = std::min(a, b);
    turned_[std::max(a, b)] = turned ? 1 : 0;
    return true;
  }

private:
  std::vector<Index> parent_;
  std::vector<std::uint8_t> turned_;
};

class Repairer {
public:
  explicit Repairer(const TriangleMesh& mesh) : mesh_(mesh) {}

  Repaired run() {
    drop();
    if (mesh_.triangles.empty()) {
      throw InputError("no triangle is left when those without corners of their own are dropped");
    }
    close_seams();
    join();
    turn();
    split();
    cut();
    drop_pieces_without_area();
    compact();
    return {std::move(mesh_), repairs_};
  }

private:
  void drop() {
    std::vector<std::array<Index, 3>> kept;
    std::map<std::array<Index, 3>, bool> seen;
    for (const auto& t : mesh_.triangles) {
      const bool finite = std::all_of(t.begin(), t.end(), [&](Index v) { return mesh_.vertices[v].allFinite(); });
      auto sorted = t;
      std::sort(sorted.begin(), sorted.end());
      if (finite && sorted[0] != sorted[1] && sorted[1] != sorted[2] && seen.try_emplace(sorted, true).second) {
        kept.push_back(t);
      }
    }
    repairs_.dropped_triangles += mesh_.triangles.size() - kept.size();
    mesh_.triangles = std::move(kept);
  }

  // What coincides becomes one; triangles narrower than that, and those that lie on others, go.
  void close_seams() {
    WithoutSeams whole = without_seams(std::move(mesh_));
    mesh_ = std::move(whole.mesh);
    repairs_.joined_edges = whole.joined_edges;
    repairs_.split_edges = whole.split_edges;
    if (whole.joined_edges > 0) {
      drop();
    }
  }

  [[nodiscard]] Index from(Side s) const { return mesh_.triangles[s / 3][s % 3]; }
  [[nodiscard]] Index to(Side s) const { return mesh_.triangles[s / 3][(s % 3 + 1) % 3]; }
  [[nodiscard]] std::pair<Index, Index> ends(Side s) const { return std::minmax(from(s), to(s)); }

  [[nodiscard]] Vec3 area_vector(std::size_t t) const {
    const auto& [i, j, k] = mesh_.triangles[t];
    return (mesh_.vertices[j] - mesh_.vertices[i]).cross(mesh_.vertices[k] - mesh_.vertices[i]);
  }

  // 1 where two triangles continue each other in one plane, -1 where one lies on the other.
  [[nodiscard]] double smoothness(Side a, Side b) const {
    const Vec3 n = area_vector(a / 3);
    const Vec3 m = area_vector(b / 3);
    const double lengths = n.norm() * m.norm();
    const double cosine = lengths > 0 ? n.dot(m) / lengths : 0;
    return from(a) == to(b) ? cosine : -cosine;
  }

  // Decides which sides of triangles are one edge.
  void join() {
    const std::size_t sides = 3 * mesh_.triangles.size();
    other_.assign(sides, sides);
    std::vector<Side> by_edge(sides);
    std::iota(by_edge.begin(), by_edge.end(), Side{0});
    std::sort(by_edge.begin(), by_edge.end(),
              [&](Side l, Side r) { return std::pair(ends(l), l) < std::pair(ends(r), r); });
    ParityUnion faces(mesh_.triangles.size());
    const auto pair_up = [&](Side a, Side b) {
      if (faces.join(narrow<Index>(a / 3), narrow<Index>(b / 3), from(a) == from(b))) {
        other_[a] = b;
        other_[b] = a;
      } else {
        repairs_.opened_edges += 1;
      }
    };
    struct Pair {
      bool agree;  // they face the same way as given
      double smoothness;
      Side a, b;
    };
    std::vector<Pair> crowded;
    for (auto begin = by_edge.begin(); begin != by_edge.end();) {
      const auto end = std::find_if(begin, by_edge.end(), [&](Side s) { return ends(s) != ends(*begin); });
      if (end - begin == 2) {
        pair_up(begin[0], begin[1]);
      }
      for (auto a = begin; end - begin > 2 && a != end; ++a) {
        for (auto b = a + 1; b != end; ++b) {
          crowded.push_back({from(*a) == to(*b), smoothness(*a, *b), *a, *b});
        }
      }
      repairs_.opened_edges += end - begin > 2 ? 1 : 0;
      begin = end;
    }
    // Where more than two meet, the smoothest continuation first, of those that face the same way.
    std::sort(crowded.begin(), crowded.end(), [](const Pair& l, const Pair& r) {
      return std::tuple(!l.agree, -l.smoothness, l.a, l.b) < std::tuple(!r.agree, -r.smoothness, r.a, r.b);
    });
    for (const Pair& p : crowded) {
      if (other_[p.a] == sides && other_[p.b] == sides &&
          faces.join(narrow<Index>(p.a / 3), narrow<Index>(p.b / 3), from(p.a) == from(p.b))) {
        other_[p.a] = p.b;
        other_[p.b] = p.a;
      }
    }
    facing_.resize(mesh_.triangles.size());
    for (std::size_t t = 0; t < facing_.size(); ++t) {
      facing_[t] = faces.find(narrow<Index>(t));
    }
  }

  // Turns the smaller part (by area) of each piece.
  void turn() {
    std::vector<double> balance(mesh_.triangles.size(), 0);
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      balance[facing_[t].first] += (facing_[t].second ? -1 : 1) * area_vector(t).norm();
    }
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const bool most_are_turned = balance[facing_[t].first] < 0;
      if (facing_[t].second == most_are_turned) {
        continue;
      }
      std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]);
      ++repairs_.turned_triangles;
      // Sides 0 and 2 change places.
      const Side first = 3 * t;
      std::swap(other_[first], other_[first + 2]);
      for (const Side s : {first, first + 2}) {
        if (other_[s] < other_.size()) {
          other_[other_[s]] = s;
        }
      }
    }
  }

  // Every fan of triangles that hang together at a vertex gets a vertex of its own.
  void split() {
    const std::size_t corners = other_.size();
    const auto before = [](Side s) { return s % 3 == 0 ? s + 2 : s - 1; };
    const auto after = [](Side s) { return s % 3 == 2 ? s - 2 : s + 1; };
    const std::vector<std::array<Index, 3>> given = mesh_.triangles;
    std::vector<bool> done(corners, false);
    std::vector<bool> taken(mesh_.vertices.size(), false);
    for (Side corner = 0; corner < corners; ++corner) {
      if (done[corner]) {
        continue;
      }
      const Index vertex = given[corner / 3][corner % 3];
      Index own = vertex;
      if (taken[vertex]) {
        own = narrow<Index>(mesh_.vertices.size());
        const Vec3 position = mesh_.vertices[vertex];
        mesh_.vertices.push_back(position);
        ++repairs_.split_vertices;
      }
      taken[vertex] = true;
      const auto visit = [&](Side c) {
        done[c] = true;
        mesh_.triangles[c / 3][c % 3] = own;
      };
      // Corner c begins side c and ends side before(c): across the first, the corner after the other side.
      Side c = corner;
      visit(c);
      while (other_[c] < corners && !done[after(other_[c])]) {
        c = after(other_[c]);
        visit(c);
      }
      c = corner;
      while (other_[before(c)] < corners && !done[other_[before(c)]]) {
        c = other_[before(c)];
        visit(c);
      }
    }
  }

  // Different edges with the same ends: all but the first get a vertex in the middle.
  void cut() {
    std::map<std::pair<Index, Index>, std::size_t> edges_between;
    const std::size_t sides = other_.size();
    std::vector<std::array<Index, 3>> middle(mesh_.triangles.size(), {none, none, none});
    for (Side s = 0; s < sides; ++s) {
      if (other_[s] < s || edges_between[ends(s)]++ == 0) {
        continue;
      }
      const auto m = narrow<Index>(mesh_.vertices.size());
      const Vec3 position = 0.5 * (mesh_.vertices[from(s)] + mesh_.vertices[to(s)]);
      mesh_.vertices.push_back(position);
      ++repairs_.cut_edges;
      middle[s / 3][s % 3] = m;
      if (other_[s] < sides) {
        middle[other_[s] / 3][other_[s] % 3] = m;
      }
    }
    const std::size_t triangles = mesh_.triangles.size();
    for (std::size_t t = 0; t < triangles; ++t) {
      divide(t, middle[t]);
    }
  }

  void divide(std::size_t t, const std::array<Index, 3>& middle) {
    std::vector<Index> outline;
    std::size_t cuts = 0;
    std::size_t first = 0;  // where the fan starts: at a cut, so that no part is flat
    for (std::size_t k = 0; k < 3; ++k) {
      outline.push_back(mesh_.triangles[t][k]);
      if (middle[k] != none) {
        first = outline.size();
        outline.push_back(middle[k]);
        ++cuts;
      }
    }
    if (cuts == 0) {
      return;
    }
    if (cuts == 3) {
      const auto corners = mesh_.triangles[t];
      mesh_.triangles[t] = middle;
      for (std::size_t k = 0; k < 3; ++k) {
        mesh_.triangles.push_back({corners[k], middle[k], middle[(k + 2) % 3]});
      }
      return;
    }
    const auto at = [&](std::size_t i) { return outline[(first + i) % outline.size()]; };
    mesh_.triangles[t] = {at(0), at(1), at(2)};
    for (std::size_t i = 2; i + 1 < outline.size(); ++i) {
      mesh_.triangles.push_back({at(0), at(i), at(i + 1)});
    }
  }

  void drop_pieces_without_area() {
    std::vector<Index> piece(mesh_.vertices.size());
    std::iota(piece.begin(), piece.end(), Index{0});
    const auto root = [&](Index v) {
      while (piece[v] != v) {
        v = piece[v] = piece[piece[v]];
      }
      return v;
    };
    for (const auto& [i, j, k] : mesh_.triangles) {
      piece[root(j)] = root(i);
      piece[root(k)] = root(i);
    }
    std::vector<std::uint8_t> has_area(mesh_.vertices.size(), 0);
    for (const auto& [i, j, k] : mesh_.triangles) {
      if (!is_degenerate(mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k])) {
        has_area[root(i)] = 1;
      }
    }
    const auto kept = std::remove_if(mesh_.triangles.begin(), mesh_.triangles.end(),
                                     [&](const auto& t) { return has_area[root(t[0])] == 0; });
    repairs_.dropped_triangles += narrow<std::size_t>(mesh_.triangles.end() - kept);
    mesh_.triangles.erase(kept, mesh_.triangles.end());
    if (mesh_.triangles.empty()) {
      throw InputError("no triangle is left when pieces without area are dropped");
    }
  }

  void compact() {
    TriangleMesh result;
    std::vector<Index> renumbered(mesh_.vertices.size(), none);
    for (const auto& t : mesh_.triangles) {
      for (const Index v : t) {
        renumbered[v] = 0;
      }
    }
    for (std::size_t v = 0; v < renumbered.size(); ++v) {
      if (renumbered[v] != none) {
        renumbered[v] = narrow<Index>(result.vertices.size());
        result.vertices.push_back(mesh_.vertices[v]);
      }
    }
    for (const auto& [i, j, k] : mesh_.triangles) {
      result.triangles.push_back({renumbered[i], renumbered[j], renumbered[k]});
    }
    mesh_ = std::move(result);
  }

  TriangleMesh mesh_;
  Repairs repairs_;
  std::vector<Side> other_;                     // #3T the side it is joined to; 3T: none
  std::vector<std::pair<Index, bool>> facing_;  // #T piece, and whether it is turned within it
};

}  // namespace

Repaired repaired(const TriangleMesh& mesh) {
  require_corners(mesh.vertices.size(), mesh.triangles);
  return Repairer(mesh).run();
}

}  // namespace tunica
