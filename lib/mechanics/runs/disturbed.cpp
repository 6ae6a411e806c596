#include "tunica/mechanics/runs/disturbed.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/model/corner_normals.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <queue>
#include <set>

namespace tunica {
namespace {

constexpr double step = 1.25;      // of the thickness within a shell, from which on it bends the wall
constexpr double layers = 2;       // bending lengths, within which stress is that of what disturbs it
constexpr double flattest = 1e-6;  // curvature times the body's diagonal, below which it is round-off

/// Per node of a body, the bending length of what it belongs to where it is disturbed, else 0.
std::vector<double> bending_lengths(const Model& model, std::size_t b) {
  const ShellBody& body = model.shells[b];
  const auto& triangles = body.mesh.triangles;
  const std::vector<std::uint8_t> disturbed = disturbed_nodes(model, b);
  std::vector<double> lengths(disturbed.size(), 0);
  if (std::ranges::find(disturbed, 1) == disturbed.end()) {
    return lengths;
  }
  const TriangleMesh facets = flat_facets(body.mesh);
  const std::vector<Curvature> curvatures = curvatures_of(body.mesh, body.curved);
  DisjointSets<> together(disturbed.size());
  for (const auto& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (disturbed[t[k]] != 0 && disturbed[t[(k + 1) % 3]] != 0) {
        together.join(t[k], t[(k + 1) % 3]);
      }
    }
  }
  std::vector<double> area(disturbed.size(), 0), curvature(area), thickness(area);  // sums over the shells around
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [i, j, k] = triangles[t];
    const auto& v = facets.vertices;
    const double of_shell = (v[j] - v[i]).cross(v[k] - v[i]).norm() / 2;
    for (const Index node : triangles[t]) {
      if (disturbed[node] != 0) {
        const Index root = together.root(node);
        area[root] += of_shell;
        curvature[root] += of_shell * curvatures[t].largest;
        thickness[root] += of_shell * body.thickness[body.thickness.size() == 1 ? 0 : node];
      }
    }
  }
  const double straight = flattest / diagonal(facets);
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const Index root = together.root(narrow<Index>(i));
    if (disturbed[i] != 0 && curvature[root] > straight * area[root]) {
      lengths[i] = std::sqrt(thickness[root] / curvature[root]);
    }
  }
  return lengths;
}

/// Distances of a body's nodes along its edges from those that have a length, in these lengths; infinite beyond.
std::vector<double> scaled_distances(const ShellMesh& mesh, std::vector<double> lengths) {
  std::vector<std::vector<Index>> beside(lengths.size());
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      beside[t[k]].push_back(t[(k + 1) % 3]);
      beside[t[(k + 1) % 3]].push_back(t[k]);
    }
  }
  std::vector<double> distances(lengths.size(), infinity);
  std::priority_queue<std::pair<double, Index>, std::vector<std::pair<double, Index>>, std::greater<>> next;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] > 0) {
      distances[i] = 0;
      next.emplace(0, narrow<Index>(i));
    }
  }
  while (!next.empty()) {
    const auto [distance, node] = next.top();
    next.pop();
    if (distance > distances[node]) {
      continue;
    }
    for (const Index other : beside[node]) {
      const double there = distance + (mesh.vertices[other] - mesh.vertices[node]).norm() / lengths[node];
      if (there < distances[other]) {
        distances[other] = there;
        lengths[other] = lengths[node];
        next.emplace(there, other);
      }
    }
  }
  return distances;
}

}  // namespace

double slant_of_rim(const ShellBody& body, const Fix& fix) {
  if (!fix.across) {
    return 0;
  }
  const std::set<Index> nodes(fix.nodes.begin(), fix.nodes.end());
  const CornerNormals normal(body.mesh, body.curved);
  const Vec3 aside = fix.across->unitOrthogonal(), across = fix.across->cross(aside);
  double length = 0;
  Mat3 left = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  const TriangleMesh facets = flat_facets(body.mesh);
  for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {
    const std::array<Index, 3>& v = facets.triangles[t];
    const std::size_t next = (k + 1) % 3;
    if (nodes.contains(v[k]) && nodes.contains(v[next])) {
      const double part = (facets.vertices[v[next]] - facets.vertices[v[k]]).norm();
      const Vec3 n = (normal(t, k) + normal(t, next)).normalized();
      const Vec3 terms(1, n.dot(aside), n.dot(across));
      length += part;
      left += part * terms * terms.transpose();
      right += part * n.dot(*fix.across) * terms;
    }
  }
  if (!(length > 0)) {
    return 0;
  }
  const Vec3 fitted = left.completeOrthogonalDecomposition().solve(right);
  return std::sqrt(2 * fitted.dot(left * fitted) / length);
}

bool is_step(const ShellBody& body, std::size_t triangle) {
  if (body.thickness.size() == 1) {
    return false;
  }
  if (triangle >= body.mesh.triangles.size() || body.thickness.size() != body.mesh.vertices.size()) {
    throw InputError(fmt::format("{}: there is no triangle {}, or not one thickness per node", body.name, triangle));
  }
  const auto& t = body.mesh.triangles[triangle];
  const auto [least, most] = std::minmax({body.thickness[t[0]], body.thickness[t[1]], body.thickness[t[2]]});
  return most > step * least;
}

std::vector<std::uint8_t> disturbed_nodes(const Model& model, std::size_t b) {
  require_valid(model);
  if (b >= model.shells.size()) {
    throw InputError(fmt::format("there is no shell {}", b));
  }
  const ShellBody& body = model.shells[b];
  std::vector<std::uint8_t> disturbed(body.mesh.vertices.size(), 0);
  const auto mark = [&](const std::vector<Index>& nodes) {
    for (const Index node : nodes) {
      disturbed[node] = 1;
    }
  };
  std::vector<std::uint8_t> slides(disturbed.size(), 0);  // as in a plane of symmetry: nothing bends there
  for (const Fix& fix : model.fixes) {
    if (fix.body == b && fix.across && slant_of_rim(body, fix) <= negligible_slant) {
      for (const Index node : fix.nodes) {
        slides[node] = 1;
      }
    } else if (fix.body == b) {
      mark(fix.nodes);
    }
  }
  for (const Load& load : model.loads) {
    if (load.body != b) {
      continue;
    }
    if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      mark(force->nodes);
    } else if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
      mark(moment->nodes);
    }
  }
  const TriangleMesh facets = flat_facets(body.mesh);
  for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {  // edge loads act there too
    const auto& v = facets.triangles[t];
    if (slides[v[k]] == 0 || slides[v[(k + 1) % 3]] == 0) {
      mark({v[k], v[(k + 1) % 3]});
    }
  }
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    if (is_step(body, t)) {
      const auto& [i, j, k] = body.mesh.triangles[t];
      mark({i, j, k});
    }
  }
  return disturbed;
}

std::vector<std::uint8_t> near_disturbances(const Model& model) {
  require_valid(model);
  std::vector<std::uint8_t> near;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellMesh& mesh = model.shells[b].mesh;
    const std::vector<double> distances = scaled_distances(mesh, bending_lengths(model, b));
    for (const auto& [i, j, k] : mesh.triangles) {
      const double least = std::min({distances[i], distances[j], distances[k]});
      near.push_back((distances[i] + distances[j] + distances[k]) / 3 < layers || least == 0 ? 1 : 0);
    }
  }
  return near;
}

}  // namespace tunica
