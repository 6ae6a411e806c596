#include "tunica/shell/patch/tessellate_conforming.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/require.hpp"
#include "tunica/shell/patch/detail/pieces.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace tunica {
namespace {

constexpr int coarsest = 3;  // pieces per edge: with fewer a patch has no vertex of its own between its strips
constexpr double finer = 1.2;

using Edge = std::pair<Index, Index>;  // its nodes, the smaller first

Edge edge_of(const std::array<Index, 3>& nodes, std::size_t k) { return std::minmax(nodes[k], nodes[(k + 1) % 3]); }

/// How a patch is cut: `inside` pieces per edge, but for the pieces of its edges.
struct Cut {
  int inside;
  std::array<int, 3> edges;
};

/// A vertex of the pieces of a patch: barycentric weights in whole parts.
struct Place {
  std::array<int, 3> weights;
  int parts;

  [[nodiscard]] Vec2 parameters() const { return {real(weights[1]) / parts, real(weights[2]) / parts}; }
};

Place on_edge(std::size_t k, int i, int pieces) {
  Place place{{0, 0, 0}, pieces};
  place.weights[k] = pieces - i;
  place.weights[(k + 1) % 3] = i;
  return place;
}

/// The i-th of the vertices next to edge k, from 1 to pieces - 2, as the edge runs.
Place beside_edge(std::size_t k, int i, int pieces) {
  Place place{{1, 1, 1}, pieces};
  place.weights[k] = pieces - 1 - i;
  place.weights[(k + 1) % 3] = i;
  return place;
}

/// The corner where edge k begins, and the strip from there along the edge: each step takes the vertex that comes next,
/// on the edge or beside it. Where edges and inside have as many pieces, all are alike.
template <typename Visit>
void visit_strip(const Cut& cut, std::size_t k, const Visit& visit) {
  const int outer = cut.edges[k], inner = cut.inside;
  const std::size_t previous = (k + 2) % 3;
  const Place before = on_edge(previous, cut.edges[previous] - 1, cut.edges[previous]);
  int on = 1, beside = 1;
  visit(on_edge(k, 0, outer), on_edge(k, on, outer), before);
  visit(on_edge(k, on, outer), beside_edge(k, beside, inner), before);
  while (on < outer - 1 || beside < inner - 2) {
    const bool along_edge =
        beside == inner - 2 || (on < outer - 1 && real(on + 1) * inner <= (real(beside) + 1.5) * outer);
    if (along_edge) {
      visit(on_edge(k, on, outer), on_edge(k, on + 1, outer), beside_edge(k, beside, inner));
      ++on;
    } else {
      visit(on_edge(k, on, outer), beside_edge(k, beside + 1, inner), beside_edge(k, beside, inner));
      ++beside;
    }
  }
}

template <typename Visit>
void visit_pieces(const Cut& cut, const Visit& visit) {
  for (std::size_t k = 0; k < 3; ++k) {
    visit_strip(cut, k, visit);
  }
  const int m = cut.inside;
  const auto at = [&](int second, int third) { return Place{{m - second - third, second, third}, m}; };
  for (int third = 1; third <= m - 3; ++third) {
    for (int second = 1; second + third <= m - 2; ++second) {
      visit(at(second, third), at(second + 1, third), at(second, third + 1));
      if (second + third <= m - 3) {
        visit(at(second + 1, third), at(second + 1, third + 1), at(second, third + 1));
      }
    }
  }
}

using EdgePieces = std::map<Edge, int>;

EdgePieces pieces_of_edges(const ShellMesh& shell, const std::vector<int>& inside) {
  EdgePieces pieces;
  for (std::size_t t = 0; t < inside.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      int& of_edge = pieces[edge_of(shell.triangles[t], k)];
      of_edge = std::max(of_edge, inside[t]);
    }
  }
  return pieces;
}

Cut cut_of(const ShellMesh& shell, std::size_t t, int inside, const EdgePieces& pieces) {
  Cut cut{inside, {}};
  for (std::size_t k = 0; k < 3; ++k) {
    cut.edges[k] = pieces.at(edge_of(shell.triangles[t], k));
  }
  return cut;
}

double strips_flatness(const CubicPatch& patch, const Cut& cut) {
  double largest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    visit_strip(cut, k, [&](const Place& a, const Place& b, const Place& c) {
      largest = std::max(largest, flatness(patch, {a.parameters(), b.parameters(), c.parameters()}));
    });
  }
  return largest;
}

/// Pieces per edge inside of each patch, so many that its strips are flat enough, too: their triangles lean.
std::vector<int> pieces_inside(const ShellMesh& shell, const std::vector<CubicPatch>& patches, double deviation,
                               std::size_t most_triangles) {
  std::vector<int> inside(patches.size(), coarsest);
  double total = 0;
  const auto refine = [&](std::size_t t, double pieces) {
    total += pieces * pieces;
    require_few_triangles(total, most_triangles, deviation);
    inside[t] = std::max(coarsest, truncated<int>(pieces));
  };
  for (std::size_t t = 0; t < patches.size(); ++t) {
    refine(t, pieces_for(patches[t], deviation));
  }
  for (bool again = true; again;) {
    again = false;
    const EdgePieces pieces = pieces_of_edges(shell, inside);
    for (std::size_t t = 0; t < patches.size(); ++t) {
      check_interrupt();
      if (strips_flatness(patches[t], cut_of(shell, t, inside[t], pieces)) > deviation) {
        refine(t, std::ceil(finer * inside[t]));
        again = true;
      }
    }
  }
  return inside;
}

}  // namespace

TriangleMesh tessellate_conforming(const ShellMesh& shell, double deviation, std::size_t most_triangles) {
  require_positive(deviation, "the deviation of the fine triangles");
  if (shell.patch != Patch::watertight) {
    throw InputError("the patches do not meet at their edges: their surface has no conforming triangles");
  }
  const std::vector<CubicPatch> patches = curved_patches(shell);
  const std::vector<int> inside = pieces_inside(shell, patches, deviation, most_triangles);
  const EdgePieces pieces = pieces_of_edges(shell, inside);
  TriangleMesh mesh{shell.vertices, {}};
  std::map<Edge, std::size_t> first_on_edge;  // vertices from its smaller node on
  for (std::size_t t = 0; t < patches.size(); ++t) {
    check_interrupt();
    const auto& nodes = shell.triangles[t];
    const Cut cut = cut_of(shell, t, inside[t], pieces);
    const auto add = [&](const Place& place) { mesh.vertices.push_back(patches[t].point(place.parameters())); };
    std::array<std::size_t, 3> first{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [found, is_new] = first_on_edge.try_emplace(edge_of(nodes, k), mesh.vertices.size());
      first[k] = found->second;
      const bool forward = nodes[k] < nodes[(k + 1) % 3];
      for (int i = 1; is_new && i < cut.edges[k]; ++i) {
        add(on_edge(k, forward ? i : cut.edges[k] - i, cut.edges[k]));
      }
    }
    const std::size_t first_inside = mesh.vertices.size();
    for (int third = 1; third <= cut.inside - 2; ++third) {
      for (int second = 1; second + third < cut.inside; ++second) {
        add({{cut.inside - second - third, second, third}, cut.inside});
      }
    }
    const auto vertex = [&](const Place& place) {
      const auto& [w0, w1, w2] = place.weights;
      if (const auto* const all = std::ranges::find(place.weights, place.parts); all != place.weights.end()) {
        return nodes[narrow<std::size_t>(all - place.weights.begin())];
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t next = (k + 1) % 3;
        if (place.weights[k] + place.weights[next] == place.parts) {
          const int from_smaller = place.weights[nodes[k] < nodes[next] ? next : k];
          return narrow<Index>(first[k] + narrow<std::size_t>(from_smaller - 1));
        }
      }
      // Before row `third` lie those of 1 to third - 1, of parts - 1 - row vertices each.
      const int before = (w2 - 1) * (place.parts - 1) - w2 * (w2 - 1) / 2;
      return narrow<Index>(first_inside + narrow<std::size_t>(before + w1 - 1));
    };
    visit_pieces(cut, [&](const Place& a, const Place& b, const Place& c) {
      mesh.triangles.push_back({vertex(a), vertex(b), vertex(c)});
    });
  }
  if (std::max(mesh.vertices.size(), mesh.triangles.size()) > max_index) {
    throw RequirementError("the curved surface would need more than 2^31 fine triangles; allow a larger deviation");
  }
  return mesh;
}

}  // namespace tunica
