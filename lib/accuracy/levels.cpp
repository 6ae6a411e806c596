#include "tunica/accuracy/detail/levels.hpp"

#include "tunica/fit/fit.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/shell/patch/refine.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

double largest_edge(const ShellMesh& mesh, const std::array<Index, 3>& t) {
  double largest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    largest = std::max(largest, (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm());
  }
  return largest;
}

}  // namespace

ShellBody finer_level(const ShellBody& body, const Target* target, std::vector<std::array<Index, 2>>& parents) {
  ShellBody fine = body;
  parents.clear();
  fine.mesh = target != nullptr
                  ? refit(body.mesh, *target, 20, &parents)
                  : split_shells(body.mesh, std::vector<Split>(body.mesh.triangles.size(), Split::all_edges), &parents);
  if (body.thickness.size() > 1) {
    for (const auto& [a, b] : parents) {
      fine.thickness.push_back((body.thickness[a] + body.thickness[b]) / 2);
    }
  }
  return fine;
}

Checkpoint interpolated(const State& state, const ShellBody& coarse, const ShellBody& fine,
                   const std::vector<std::array<Index, 2>>& parents) {
  Checkpoint out;
  out.displacement = state.displacement;
  for (const Vec3& vector : state.rotation) {
    out.rotation.push_back(exponential(vector));
  }
  for (std::size_t i = 0; i < parents.size(); ++i) {
    const auto [a, b] = parents[i];
    const Eigen::Quaterniond at_a = out.rotation[a], at_b = out.rotation[b];
    const Vec3 along = coarse.mesh.vertices[b] - coarse.mesh.vertices[a];
    const Vec3 sag =
        fine.mesh.vertices[coarse.mesh.vertices.size() + i] - (coarse.mesh.vertices[a] + coarse.mesh.vertices[b]) / 2;
    // The edge leaves a towards along + 4 sag and comes to b from along - 4 sag; both turn with their nodes.
    const Vec3 from_a = along + 4 * sag, to_b = along - 4 * sag;
    out.displacement.emplace_back((state.displacement[a] + state.displacement[b]) / 2 +
                                  ((at_a * from_a - from_a) - (at_b * to_b - to_b)) / 8);
    out.rotation.push_back(at_a.slerp(0.5, at_b));
  }
  return out;
}

double field_change(const State& coarse, const State& fine) {
  double change = 0, largest = 0;
  for (std::size_t i = 0; i < coarse.displacement.size(); ++i) {
    change = std::max(change, (fine.displacement[i] - coarse.displacement[i]).norm());
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
    const auto curvatures = largest_curvatures(body.mesh, body.curved);
    std::vector<std::uint8_t> disturbed(body.mesh.vertices.size(), 0);
    for (const Fix& fix : model.fixes) {
      for (const Index node : fix.body == b ? fix.nodes : std::vector<Index>{}) {
        disturbed[node] = 1;
      }
    }
    const TriangleMesh facets = flat_facets(body.mesh);
    for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {
      disturbed[facets.triangles[t][k]] = disturbed[facets.triangles[t][(k + 1) % 3]] = 1;
    }
    const double share = 1 / std::pow(3 * (1 - std::pow(body.material.poisson, 2)), 0.25);
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      const auto& triangle = body.mesh.triangles[t];
      if (curvatures[t] > 0 && (disturbed[triangle[0]] | disturbed[triangle[1]] | disturbed[triangle[2]]) != 0) {
        const double thickness = body.thickness.size() == 1 ? body.thickness[0] : body.thickness[triangle[0]];
        least = std::min(least, share * std::sqrt(thickness / curvatures[t]) / largest_edge(body.mesh, triangle));
      }
    }
  }
  return least;
}

}  // namespace tunica
