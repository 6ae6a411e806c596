// The early part of a decimation: many collapses at once, in the order of memory.
#include "tunica/core/narrow.hpp"
#include "tunica/surface/decimation/detail/edge_collapse.hpp"

#include <algorithm>
#include <limits>

namespace tunica {
namespace {

constexpr double sweep_fraction = 0.3;          // of all edges: the cheapest, that one sweep looks at
constexpr std::size_t most_looked_at = 20'000;  // edges for a quantile of their costs

}  // namespace

/// Collapses cheap edges in the order of memory, far from each other, as long as the result will have many times fewer
/// triangles: there the order hardly matters.
void EdgeCollapse::sweep(std::size_t triangles, const Progress& progress) {
  heap_ = EdgeHeap(half_of_.size());
  touched_.assign(vertex_.size(), 1);
  sweep_cost_.assign(half_of_.size(), forbidden_cost);
  for (std::size_t before = triangles_ + 1; triangles_ > triangles && triangles_ < before;) {
    before = triangles_;
    evaluate_touched();
    touched_.assign(vertex_.size(), 0);
    const double limit = cost_quantile(sweep_fraction);
    for (Index edge = 0; edge < half_of_.size() && triangles_ > triangles; ++edge) {
      if (!(sweep_cost_[edge] <= limit) || half_of_[edge] == none) {
        continue;
      }
      const HalfEdge h = half_of_[edge];
      const Index u = from(h);
      const Index v = to(h);
      if (touched_[u] != 0 || touched_[v] != 0) {
        continue;
      }
      const auto chosen = target(h, Placement::best);
      const double penalty = keeps_topology(h) ? shape_penalty(h, chosen->position) : forbidden_cost;
      const double cost = penalty == forbidden_cost ? forbidden_cost : chosen->cost(penalty);
      if (cost > limit) {
        sweep_cost_[edge] = cost;
        continue;
      }
      collapse(h, *chosen);
      touched_[u] = 1;  // and is left alone until the next sweep: sizes stay even
    }
    if (2 * 3 * triangles_ < half_.size()) {
      compact();  // most of what the next sweep would read is gone
    }
    tunica::advance(progress, 0.0);
  }
  compact();
}

void EdgeCollapse::evaluate_touched() {
  changed_.clear();
  for (Index edge = 0; edge < half_of_.size(); ++edge) {
    const HalfEdge h = half_of_[edge];
    if (h != none && (touched_[from(h)] != 0 || touched_[to(h)] != 0)) {
      changed_.push_back(edge);
    }
  }
  costs_of(changed_, changed_cost_);
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    sweep_cost_[changed_[i]] = changed_cost_[i];
  }
}

/// The costs of edges in their best places, `forbidden_cost` for those that cannot collapse: inner ones several at
/// once.
void EdgeCollapse::costs_of(const std::vector<Index>& edges, std::vector<double>& costs) const {
  costs.assign(edges.size(), forbidden_cost);
  std::array<HalfEdge, lane_count> together{};
  std::array<std::size_t, lane_count> place{};
  std::size_t waiting = 0;
  const auto flush = [&] {
    for (std::size_t k = waiting; k < lane_count; ++k) {
      together[k] = together[0];
    }
    const Lanes found = inner_costs(together);
    for (std::size_t k = 0; k < waiting; ++k) {
      costs[place[k]] = found[k];
    }
    waiting = 0;
  };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const HalfEdge h = half_of_[edges[i]];
    if (vertex_[from(h)].curve == none && vertex_[to(h)].curve == none) {
      together[waiting] = h;
      place[waiting++] = i;
      if (waiting == lane_count) {
        flush();
      }
    } else if (const auto found = target(h, Placement::best)) {
      costs[i] = found->cost();
    }
  }
  if (waiting > 0) {
    flush();
  }
}

double EdgeCollapse::cost_quantile(double fraction) const {
  std::vector<double> costs;
  const std::size_t stride = 1 + half_of_.size() / most_looked_at;
  for (std::size_t edge = 0; edge < half_of_.size(); edge += stride) {
    if (half_of_[edge] != none) {
      costs.push_back(sweep_cost_[edge]);
    }
  }
  const auto at = costs.begin() + truncated<std::size_t>(fraction * real(costs.size() - 1));
  std::nth_element(costs.begin(), at, costs.end());
  return std::min(*at, std::numeric_limits<double>::max());
}

/// Drops what is gone: what is left lies together again.
void EdgeCollapse::compact() {
  std::vector<Index> new_vertex(vertex_.size(), none), new_edge(half_of_.size(), none);
  std::vector<HalfEdge> new_half(half_.size(), none);
  std::vector<std::uint8_t> alive(half_.size() / 3, 0);
  for (const HalfEdge h : half_of_) {
    if (h != none) {
      alive[h / 3] = 1;
      if (half_[h].twin != none) {
        alive[half_[h].twin / 3] = 1;
      }
    }
  }
  HalfEdge halves = 0;
  Index vertices = 0, edges = 0;
  std::vector<Vertex> vertex;
  std::vector<double> place;
  std::vector<Quadric> wall;
  std::vector<Index> given;
  for (std::size_t t = 0; t < alive.size(); ++t) {
    for (HalfEdge h = narrow<HalfEdge>(3 * t); alive[t] != 0 && h < 3 * t + 3; ++h) {
      new_half[h] = halves++;
      const Index v = from(h);
      if (new_vertex[v] == none) {
        new_vertex[v] = vertices++;
        vertex.push_back(vertex_[v]);
        place.push_back(curve_place_[v]);
        given.push_back(given_[v]);
        if (!wall_.empty()) {
          wall.push_back(wall_[v]);
        }
      }
      if (new_edge[half_[h].edge] == none) {
        new_edge[half_[h].edge] = edges++;
      }
    }
  }
  std::vector<HalfEdge> half_of(edges, none);
  std::vector<double> sweep_cost(edges, forbidden_cost);
  std::vector<std::uint8_t> touched(vertices, 0);
  for (std::size_t e = 0; e < half_of_.size(); ++e) {
    if (new_edge[e] != none) {
      half_of[new_edge[e]] = new_half[half_of_[e]];
      sweep_cost[new_edge[e]] = sweep_cost_[e];
    }
  }
  for (std::size_t v = 0; v < vertex_.size(); ++v) {
    if (new_vertex[v] != none) {
      touched[new_vertex[v]] = touched_[v];
    }
  }
  std::vector<Half> half(halves);
  for (HalfEdge h = 0; h < half_.size(); ++h) {
    if (new_half[h] != none) {
      const Half& old = half_[h];
      half[new_half[h]] = {new_vertex[old.from], old.twin == none ? none : new_half[old.twin], new_edge[old.edge]};
    }
  }
  for (Vertex& v : vertex) {
    v.outgoing = new_half[v.outgoing];
  }
  vertex_ = std::move(vertex);
  half_ = std::move(half);
  half_of_ = std::move(half_of);
  sweep_cost_ = std::move(sweep_cost);
  touched_ = std::move(touched);
  curve_place_ = std::move(place);
  wall_ = std::move(wall);
  given_ = std::move(given);
  placement_.assign(half_of_.size(), Placement::best);
  heap_ = EdgeHeap(half_of_.size());
}

}  // namespace tunica
