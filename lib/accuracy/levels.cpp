#include "tunica/accuracy/detail/levels.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/fit/fit.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/shell/patch/refine.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace tunica {
namespace {

constexpr double refit_angle = 20;  // degrees

}  // namespace

std::size_t Level::shell_count() const {
  std::size_t count = 0;
  for (const ShellBody& body : bodies) {
    count += body.mesh.triangles.size();
  }
  return count;
}

Level finer_level(const std::vector<ShellBody>& bodies, const std::vector<const Target*>& targets) {
  Level fine{bodies, std::vector<std::vector<std::array<Index, 2>>>(bodies.size())};
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    ShellBody& body = fine.bodies[b];
    auto& parents = fine.parents[b];
    const std::vector<Split> all(body.mesh.triangles.size(), Split::all_edges);
    body.mesh = targets[b] != nullptr ? refit(body.mesh, *targets[b], refit_angle, &parents)
                                      : split_shells(body.mesh, all, &parents);
    if (body.thickness.size() > 1) {
      for (const auto& [a, c] : parents) {
        body.thickness.push_back((body.thickness[a] + body.thickness[c]) / 2);
      }
    }
  }
  return fine;
}

Checkpoint interpolated(const State& state, const std::vector<ShellBody>& coarse, const Level& fine) {
  Checkpoint out;
  std::size_t first = 0;
  for (std::size_t b = 0; b < coarse.size(); ++b) {
    const auto& vertices = coarse[b].mesh.vertices;
    const std::size_t count = vertices.size();
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Quaterniond turn = exponential(state.rotation[first + i]);
      const Vec3 shift = fine.bodies[b].mesh.vertices[i] - vertices[i];  // of the refit
      out.displacement.emplace_back(state.displacement[first + i] + (turn * shift - shift));
      out.rotation.push_back(turn);
    }
    for (std::size_t i = 0; i < fine.parents[b].size(); ++i) {
      const auto [a, c] = fine.parents[b][i];
      const Eigen::Quaterniond at_a = exponential(state.rotation[first + a]),
                               at_c = exponential(state.rotation[first + c]);
      const Vec3 along = vertices[c] - vertices[a];
      const Vec3 sag = fine.bodies[b].mesh.vertices[count + i] - (vertices[a] + vertices[c]) / 2;
      // The edge leaves a towards along + 4 sag and comes to c from along - 4 sag; both turn with their nodes.
      const Vec3 from_a = along + 4 * sag, to_c = along - 4 * sag;
      out.displacement.emplace_back((state.displacement[first + a] + state.displacement[first + c]) / 2 +
                                    ((at_a * from_a - from_a) - (at_c * to_c - to_c)) / 8);
      out.rotation.push_back(at_a.slerp(0.5, at_c));
    }
    first += count;
  }
  return out;
}

namespace {

using Edge = std::array<Index, 2>;

Edge sorted(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

/// Selections of one body, from a level to the finer one.
class Carrier {
public:
  Carrier(const ShellMesh& coarse, const std::vector<Edge>& parents) : coarse_(coarse) {
    for (std::size_t i = 0; i < parents.size(); ++i) {
      between_[sorted(parents[i][0], parents[i][1])] = narrow<Index>(coarse.vertices.size() + i);
    }
    const TriangleMesh facets = flat_facets(coarse);
    for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {
      rim_.insert(sorted(facets.triangles[t][k], facets.triangles[t][(k + 1) % 3]));
    }
  }

  void carry(const std::vector<Index>& from, std::vector<Index>& to) const {
    if (from.size() == 1 && to.size() == 1) {
      return;
    }
    std::vector<std::uint8_t> selected(coarse_.vertices.size(), 0);
    for (const Index node : from) {
      selected[node] = 1;
    }
    std::set<Edge> across;
    for (const auto& t : coarse_.triangles) {
      for (std::size_t k = 0; k < 3 && selected[t[0]] + selected[t[1]] + selected[t[2]] == 3; ++k) {
        across.insert(sorted(t[k], t[(k + 1) % 3]));
      }
    }
    to.insert(to.end(), from.begin(), from.end());
    for (const auto& [edge, node] : between_) {
      if (selected[edge[0]] != 0 && selected[edge[1]] != 0 && (rim_.contains(edge) || !across.contains(edge))) {
        to.push_back(node);
      }
    }
    std::sort(to.begin(), to.end());
    to.erase(std::unique(to.begin(), to.end()), to.end());
  }

  /// The halves of an edge that is meant as a whole; others where their own place says so.
  void carry(const EdgeLoad& from, EdgeLoad& to) const {
    std::map<Edge, double> shares;
    for (std::size_t i = 0; i < to.edges.size(); ++i) {
      const auto& [a, b] = to.edges[i];
      if (std::max(a, b) >= coarse_.vertices.size()) {  // a half, no edge that the finer level has no more
        shares[to.edges[i]] = share_of(to.shares, i);
      }
    }
    for (std::size_t i = 0; i < from.edges.size(); ++i) {
      const auto& [a, b] = from.edges[i];
      if (share_of(from.shares, i) == 1) {
        const Index middle = between_.at(sorted(a, b));
        shares[{a, middle}] = shares[{middle, b}] = 1;
      }
    }
    to.edges.clear();
    to.shares.clear();
    for (const auto& [edge, share] : shares) {
      to.edges.push_back(edge);
      to.shares.push_back(share);
    }
  }

private:
  const ShellMesh& coarse_;
  std::map<Edge, Index> between_;  // the node that halves an edge
  std::set<Edge> rim_;
};

}  // namespace

void carry_selections(const Model& coarse, const Level& level, Model& fine) {
  std::vector<Carrier> carriers;
  for (std::size_t b = 0; b < level.bodies.size(); ++b) {
    carriers.emplace_back(coarse.shells[b].mesh, level.parents[b]);
  }
  for (std::size_t i = 0; i < coarse.fixes.size(); ++i) {
    carriers[coarse.fixes[i].body].carry(coarse.fixes[i].nodes, fine.fixes[i].nodes);
  }
  for (std::size_t i = 0; i < coarse.loads.size(); ++i) {
    const Carrier& carrier = carriers[coarse.loads[i].body];
    const auto& from = coarse.loads[i].kind;
    auto& to = fine.loads[i].kind;
    if (const auto* force = std::get_if<ForceLoad>(&from)) {
      carrier.carry(force->nodes, std::get<ForceLoad>(to).nodes);
    } else if (const auto* moment = std::get_if<MomentLoad>(&from)) {
      carrier.carry(moment->nodes, std::get<MomentLoad>(to).nodes);
    } else if (const auto* edge = std::get_if<EdgeLoad>(&from)) {
      carrier.carry(*edge, std::get<EdgeLoad>(to));
    }
  }
}

double field_change(const State& coarse, const State& fine, const Level& level) {
  double change = 0, largest = 0;
  std::size_t of_coarse = 0, of_fine = 0;
  for (std::size_t b = 0; b < level.bodies.size(); ++b) {
    const std::size_t count = level.bodies[b].mesh.vertices.size(), before = count - level.parents[b].size();
    for (std::size_t i = 0; i < before; ++i) {
      change = std::max(change, (fine.displacement[of_fine + i] - coarse.displacement[of_coarse + i]).norm());
    }
    of_coarse += before;
    of_fine += count;
  }
  for (const Vec3& u : fine.displacement) {
    largest = std::max(largest, u.norm());
  }
  return change / largest;
}

double edges_per_layer(const Model& model) {
  double least = infinity;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const auto curvatures = curvatures_of(body.mesh, body.curved);
    const auto disturbed = disturbed_nodes(model, b);
    const TriangleMesh facets = flat_facets(body.mesh);
    const double share = 1 / std::pow(3 * (1 - std::pow(body.material.poisson, 2)), 0.25);
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      const auto& triangle = body.mesh.triangles[t];
      if (curvatures[t].largest > 0 &&
          (disturbed[triangle[0]] | disturbed[triangle[1]] | disturbed[triangle[2]]) != 0) {
        const double thickness = body.thickness.size() == 1 ? body.thickness[0] : body.thickness[triangle[0]];
        least = std::min(least,
                         share * std::sqrt(thickness / curvatures[t].largest) / longest_edge(facets, narrow<Index>(t)));
      }
    }
  }
  return least;
}

}  // namespace tunica
