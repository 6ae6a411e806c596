#include "tunica/mechanics/contact/detail/own_surface.hpp"
#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/seams.hpp"

#include <functional>
#include <map>
#include <queue>

namespace tunica {

void number_parts(const Model& model, std::size_t body, Surfaces& surfaces) {
  const auto offset = narrow<Index>(model.first_node(body));
  DisjointSets joined(model.first_node(body + 1) - model.first_node(body));
  if (model.is_solid(body)) {
    for (const auto& tetrahedron : model.solids[body - model.shells.size()].mesh.tetrahedra) {
      for (const Index node : tetrahedron) {
        joined.join(tetrahedron[0], node);
      }
    }
  } else {
    const TriangleMesh mesh = flat_facets(model.shells[body].mesh);
    for (const auto& triangle : mesh.triangles) {
      joined.join(triangle[0], triangle[1]);
      joined.join(triangle[0], triangle[2]);
    }
    for (const auto& [one, other] : find_seams(mesh).meeting) {
      joined.join(mesh.triangles[one][0], mesh.triangles[other][0]);
    }
  }
  for (std::size_t f = surfaces.first[body]; f < surfaces.first[body + 1]; ++f) {
    surfaces.faces[f].part = joined.root(surfaces.faces[f].nodes[0] - offset);
  }
}

SurfacePaths::SurfacePaths(const Model& model, std::size_t shell)
    : first_(narrow<Index>(model.first_node(shell))), ways_(model.shells[shell].mesh.vertices.size()) {
  const TriangleMesh mesh = flat_facets(model.shells[shell].mesh);
  const auto length = [&](Index i, Index j) { return (mesh.vertices[i] - mesh.vertices[j]).norm(); };
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      link(t[k], t[(k + 1) % 3], length(t[k], t[(k + 1) % 3]));
    }
  }
  for (const auto& [one, other] : find_seams(mesh).meeting) {
    for (const Index i : mesh.triangles[one]) {
      for (const Index j : mesh.triangles[other]) {
        link(i, j, length(i, j));
      }
    }
  }
}

void SurfacePaths::link(Index i, Index j, double length) {
  ways_[i].emplace_back(j, length);
  ways_[j].emplace_back(i, length);
}

/// Source: Dijkstra 1959, "A note on two problems in connexion with graphs".
bool SurfacePaths::connect(const SurfaceFace& from, const SurfaceFace& to, double reach) const {
  using Reached = std::pair<double, Index>;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  std::map<Index, double> shortest;
  const auto reached = [&](Index node, double way) {
    const auto known = shortest.find(node);
    if (way <= reach && (known == shortest.end() || way < known->second)) {
      shortest[node] = way;
      open.emplace(way, node);
    }
  };
  for (const Index node : from.nodes) {
    reached(node - first_, 0);
  }
  while (!open.empty()) {
    const auto [way, node] = open.top();
    open.pop();
    if (std::ranges::find(to.nodes, node + first_) != to.nodes.end()) {
      return true;
    }
    for (const auto& [next, length] : ways_[node]) {
      if (way <= shortest.at(node)) {
        reached(next, way + length);
      }
    }
  }
  return false;
}

}  // namespace tunica
