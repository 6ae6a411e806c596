#include "tunica/shell/patch/refine.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <numeric>
#include <unordered_map>

namespace tunica {
namespace {

constexpr double split_in_four_above = 3;  // tolerances

/// Edges by number, and the three of each triangle: edge k runs from corner k to corner k + 1.
struct Edges {
  std::vector<std::array<Index, 3>> of_triangle;
  std::vector<std::array<Index, 2>> ends;
  std::vector<std::array<Index, 2>> triangles;  // the second is none at a boundary
};
constexpr Index none = 0xffffffff;

Edges edges_of(const ShellMesh& shell) {
  Edges edges;
  std::unordered_map<std::uint64_t, Index> number;
  number.reserve(2 * shell.triangles.size());
  edges.of_triangle.resize(shell.triangles.size());
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = shell.triangles[t][k], b = shell.triangles[t][(k + 1) % 3];
      const auto key = (std::uint64_t{std::min(a, b)} << 32) | std::max(a, b);
      const auto [at, is_new] = number.try_emplace(key, narrow<Index>(edges.ends.size()));
      if (is_new) {
        edges.ends.push_back({std::min(a, b), std::max(a, b)});
        edges.triangles.push_back({narrow<Index>(t), none});
      } else {
        edges.triangles[at->second][1] = narrow<Index>(t);
      }
      edges.of_triangle[t][k] = at->second;
    }
  }
  return edges;
}

/// Of equal lengths both neighbours must choose alike: the edge with the smaller number.
std::size_t longest(const ShellMesh& shell, const Edges& edges, std::size_t t) {
  std::size_t best = 0;
  double best_length = -1;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& [a, b] = edges.ends[edges.of_triangle[t][k]];
    const double length = (shell.vertices[a] - shell.vertices[b]).squaredNorm();
    if (length > best_length || (length == best_length && edges.of_triangle[t][k] < edges.of_triangle[t][best])) {
      best = k;
      best_length = length;
    }
  }
  return best;
}

std::size_t place_of(const Edges& edges, std::size_t t, Index edge) {
  const auto& own = edges.of_triangle[t];
  return std::find(own.begin(), own.end(), edge) - own.begin();
}

/// Whether the normals at an end of an edge differ from one side to the other.
bool is_crease(const ShellMesh& shell, const Edges& edges, Index edge) {
  const auto& [s, t] = edges.triangles[edge];
  if (t == none || shell.corner_normals.empty()) {
    return false;
  }
  const auto normal_at = [&](Index triangle, Index node) {
    const auto& v = shell.triangles[triangle];
    return shell.corner_normals[triangle][std::find(v.begin(), v.end(), node) - v.begin()];
  };
  const auto differs = [&](Index node) { return normal_at(s, node) != normal_at(t, node); };
  return differs(edges.ends[edge][0]) || differs(edges.ends[edge][1]);
}

using Triangles = std::vector<std::array<Index, 3>>;

/// Where an edge runs, among the places of a patch.
constexpr std::array<std::array<double, 2>, 3> halfway{{{0.5, 0}, {0.5, 0.5}, {0, 0.5}}};

/// The way to cut a triangle whose worst piece has the better shape.
const Triangles& better(const std::vector<Vec3>& p, const Triangles& one, const Triangles& other) {
  const auto worst = [&](const Triangles& pieces) {
    double least = 1;
    for (const auto& [a, b, c] : pieces) {
      least = std::min(least, radius_ratio(p[a], p[b], p[c]));
    }
    return least;
  };
  return worst(other) > worst(one) ? other : one;
}

/// Which edges are cut: those wanted, and the longest one of every triangle that has a cut edge.
std::vector<std::uint8_t> edges_to_cut(const ShellMesh& shell, const Edges& edges, const std::vector<Split>& wanted) {
  std::vector<std::uint8_t> cut(edges.ends.size(), 0);
  std::vector<std::size_t> waiting;
  const auto cut_edge = [&](Index e) {
    if (cut[e] == 0) {
      cut[e] = 1;
      for (const Index t : edges.triangles[e]) {
        if (t != none) {
          waiting.push_back(t);
        }
      }
    }
  };
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    if (wanted[t] == Split::all_edges) {
      for (const Index e : edges.of_triangle[t]) {
        cut_edge(e);
      }
    } else if (wanted[t] == Split::longest_edge) {
      cut_edge(edges.of_triangle[t][longest(shell, edges, t)]);
    }
  }
  while (!waiting.empty()) {
    const std::size_t t = waiting.back();
    waiting.pop_back();
    cut_edge(edges.of_triangle[t][longest(shell, edges, t)]);
  }
  return cut;
}

/// The new node of a cut edge.
struct Middle {
  Index node = none;
  std::array<Vec3, 2> normals;  ///< on either side
};

std::vector<Middle> add_middles(const ShellMesh& shell, const Edges& edges, const std::vector<std::uint8_t>& cut,
                                ShellMesh& out) {
  const auto patches = curved_patches(shell);
  std::vector<Middle> middles(edges.ends.size());
  for (std::size_t e = 0; e < edges.ends.size(); ++e) {
    if (cut[e] == 0) {
      continue;
    }
    auto& [node, normals] = middles[e];
    Vec3 point = Vec3::Zero();
    double sides = 0;
    for (std::size_t side = 0; side < 2; ++side) {
      const Index t = edges.triangles[e][side];
      if (t != none) {
        const std::size_t k = place_of(edges, t, narrow<Index>(e));
        const Vec2 at(halfway[k][0], halfway[k][1]);
        point += patches[t].point(at);
        normals[side] = patches[t].normal(at);
        sides += 1;
      }
    }
    if (sides == 1) {
      normals[1] = normals[0];
    }
    const Vec3 mean = (normals[0] + normals[1]).stableNormalized();
    if (!is_crease(shell, edges, narrow<Index>(e))) {
      normals = {mean, mean};
    }
    node = narrow<Index>(out.vertices.size());
    out.vertices.emplace_back(point / sides);
    out.normals.push_back(mean);
  }
  return middles;
}

/// One to four triangles in place of one. @param p  positions of all nodes
Triangles pieces_of(const ShellMesh& shell, const Edges& edges, const std::vector<Middle>& middles, std::size_t t,
                    const std::vector<Vec3>& p) {
  // Turned so that the longest edge runs from a to b; it is cut if any is.
  const std::size_t k = longest(shell, edges, t);
  const auto& v = shell.triangles[t];
  const auto& e = edges.of_triangle[t];
  const Index a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3];
  const Index ab = middles[e[k]].node, bc = middles[e[(k + 1) % 3]].node, ca = middles[e[(k + 2) % 3]].node;
  if (ab == none) {
    return {{a, b, c}};
  }
  if (bc == none && ca == none) {
    return {{a, ab, c}, {ab, b, c}};
  }
  if (ca == none) {
    return better(p, {{a, ab, c}, {ab, b, bc}, {ab, bc, c}}, {{a, ab, bc}, {a, bc, c}, {ab, b, bc}});
  }
  if (bc == none) {
    return better(p, {{a, ab, ca}, {ab, b, c}, {ab, c, ca}}, {{a, ab, ca}, {ab, b, ca}, {b, c, ca}});
  }
  return better(p, {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}},
                {{a, ab, ca}, {ab, b, bc}, {ab, c, ca}, {ab, bc, c}});
}

}  // namespace

ShellMesh split_shells(const ShellMesh& shell, const std::vector<Split>& wanted,
                       std::vector<std::array<Index, 2>>* halved) {
  require_valid(shell);
  if (wanted.size() != shell.triangles.size()) {
    throw InputError(
        fmt::format("{} splits for {} shells: one for each is needed", wanted.size(), shell.triangles.size()));
  }
  const Edges edges = edges_of(shell);
  ShellMesh out{shell.vertices, {}, shell.normals, {}, shell.patch};
  const std::vector<Middle> middles = add_middles(shell, edges, edges_to_cut(shell, edges, wanted), out);
  for (std::size_t e = 0; e < middles.size() && halved != nullptr; ++e) {
    if (middles[e].node != none) {
      halved->push_back(edges.ends[e]);
    }
  }
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    const Triangles pieces = pieces_of(shell, edges, middles, t, out.vertices);
    out.triangles.insert(out.triangles.end(), pieces.begin(), pieces.end());
    for (std::size_t i = 0; i < pieces.size() && !shell.corner_normals.empty(); ++i) {
      auto& normals = out.corner_normals.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner) {
        for (std::size_t j = 0; j < 3; ++j) {
          const Index e = edges.of_triangle[t][j];
          if (pieces[i][corner] == shell.triangles[t][j]) {
            normals[corner] = shell.corner_normals[t][j];
          } else if (pieces[i][corner] == middles[e].node) {
            normals[corner] = middles[e].normals[edges.triangles[e][0] == t ? 0 : 1];
          }
        }
      }
    }
  }
  return out;
}

ShellMesh refine_where(const ShellMesh& shell, const std::vector<double>& errors, double tolerance, std::size_t most) {
  require_not_negative(tolerance, "the tolerance");
  std::vector<std::size_t> order;
  for (std::size_t t = 0; t < errors.size(); ++t) {
    if (errors[t] > tolerance) {
      order.push_back(t);
    }
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return errors[a] > errors[b]; });
  const auto with_first = [&](std::size_t count) {
    std::vector<Split> wanted(errors.size(), Split::none);
    for (std::size_t i = 0; i < count; ++i) {
      wanted[order[i]] = errors[order[i]] > split_in_four_above * tolerance ? Split::all_edges : Split::longest_edge;
    }
    return split_shells(shell, wanted);
  };
  ShellMesh best = with_first(order.size());
  if (best.triangles.size() <= most) {
    return best;
  }
  std::size_t fits = 0, too_many = order.size();
  best = with_first(0);
  while (too_many - fits > 1) {
    const std::size_t count = fits + (too_many - fits) / 2;
    ShellMesh candidate = with_first(count);
    if (candidate.triangles.size() <= most) {
      fits = count;
      best = std::move(candidate);
    } else {
      too_many = count;
    }
  }
  return best;
}

}  // namespace tunica
