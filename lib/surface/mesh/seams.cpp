#include "tunica/surface/mesh/seams.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/point_tree.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>

namespace tunica {
namespace {

constexpr double share_of_edge = 0.01;  // vertices farther apart than that are none in one place

/// A boundary edge, as its triangle runs along it.
struct Rim {
  Index triangle = 0;
  Index side = 0;
  Index from = 0, to = 0;
};

/// A part of a boundary edge, between places.
struct Part {
  std::array<Index, 2> ends;  // places, the smaller number first
  Index rim;
};

class SeamFinder {
public:
  explicit SeamFinder(const TriangleMesh& mesh) : mesh_(mesh) {
    gather();
    if (!rims_.empty()) {
      find_places();
      pair_whole_edges();
      pair_parts();
    }
  }

  [[nodiscard]] Seams seams() const {
    Seams found;
    found.meeting = meeting_;
    found.whole_edges = whole_edges_;
    for (Index r = 0; r < rims_.size(); ++r) {
      if (!paired_[r]) {
        continue;
      }
      const Vec3 middle = 0.5 * (mesh_.vertices[rims_[r].from] + mesh_.vertices[rims_[r].to]);
      if (found.edges++ == 0) {
        found.place = middle;
      }
      if (between_.contains(r) && found.t_junctions++ == 0) {
        found.t_place = middle;
      }
    }
    return found;
  }

  [[nodiscard]] TriangleMesh joined() const {
    TriangleMesh mesh;
    mesh.vertices = mesh_.vertices;
    std::vector<Corners> left = with_chains();
    while (!left.empty()) {
      const Corners now = left.back();
      left.pop_back();
      const auto chain = std::ranges::find_if(now.chains, [](const auto* along) { return along != nullptr; });
      if (chain == now.chains.end()) {
        mesh.triangles.push_back(now.corners);
      } else {
        split(now, narrow<std::size_t>(chain - now.chains.begin()), left);
      }
    }
    std::ranges::reverse(mesh.triangles);  // of a stack: as they were given
    std::vector<Index> stands_for(mesh.vertices.size());
    std::iota(stands_for.begin(), stands_for.end(), Index{0});
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      if (is_joined_[place_of_[i]]) {
        stands_for[vertices_[i]] = vertices_[place_of_[i]];
      }
    }
    for (auto& corners : mesh.triangles) {
      for (Index& v : corners) {
        v = stands_for[v];
      }
    }
    return mesh;
  }

private:
  /// A triangle that is still to be split where a side has vertices along it.
  struct Corners {
    std::array<Index, 3> corners;
    std::array<const std::vector<Index>*, 3> chains;  // of places
  };

  [[nodiscard]] std::vector<Corners> with_chains() const {
    std::vector<Corners> all;
    all.reserve(mesh_.triangles.size());
    for (const auto& corners : mesh_.triangles) {
      all.push_back({corners, {}});
    }
    for (const auto& [rim, along] : between_) {
      if (paired_[rim]) {
        all[rims_[rim].triangle].chains[rims_[rim].side] = &along;
      }
    }
    return all;
  }

  /// A fan from the corner across; its first and last triangle keep the other two sides.
  void split(const Corners& now, std::size_t side, std::vector<Corners>& left) const {
    std::vector<Index> line{now.corners[side]};
    for (const Index place : *now.chains[side]) {
      line.push_back(vertices_[place]);
    }
    line.push_back(now.corners[(side + 1) % 3]);
    const Index apex = now.corners[(side + 2) % 3];
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      left.push_back({{line[i], line[i + 1], apex},
                      {nullptr, i + 2 == line.size() ? now.chains[(side + 1) % 3] : nullptr,
                       i == 0 ? now.chains[(side + 2) % 3] : nullptr}});
    }
  }

  [[nodiscard]] double length(const Rim& rim) const {
    return (mesh_.vertices[rim.to] - mesh_.vertices[rim.from]).norm();
  }

  void gather() {
    std::vector<Rim> sides;
    for (const auto& [t, k] : boundary_edges(neighbours(mesh_, incidence(mesh_)))) {
      sides.push_back({t, k, mesh_.triangles[t][k], mesh_.triangles[t][(k + 1) % 3]});
    }
    const auto ends = [](const Rim& rim) { return std::minmax(rim.from, rim.to); };
    std::vector<Index> order(sides.size());
    std::iota(order.begin(), order.end(), Index{0});
    std::ranges::sort(order, {}, [&](Index i) { return std::tuple(ends(sides[i]), i); });
    std::vector<bool> crowded(sides.size(), false);  // three triangles and more share it: no boundary
    for (std::size_t i = 1; i < order.size(); ++i) {
      if (ends(sides[order[i]]) == ends(sides[order[i - 1]])) {
        crowded[order[i]] = crowded[order[i - 1]] = true;
      }
    }
    for (std::size_t i = 0; i < sides.size(); ++i) {
      if (!crowded[i]) {
        rims_.push_back(sides[i]);
      }
    }
    paired_.assign(rims_.size(), false);
  }

  /// Vertices of the boundary that are in one place, by their order along a line that no plane of an image is across.
  void find_places() {
    for (const Rim& rim : rims_) {
      vertices_.push_back(rim.from);
      vertices_.push_back(rim.to);
    }
    std::ranges::sort(vertices_);
    vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
    reach_.assign(vertices_.size(), infinity);
    for (const Rim& rim : rims_) {
      for (const Index v : {rim.from, rim.to}) {
        double& reach = reach_[local(v)];
        reach = std::min(reach, share_of_edge * length(rim));
      }
    }
    const Vec3 line(0.5377, 0.7123, 0.4512);
    std::vector<std::pair<double, Index>> along;
    for (Index i = 0; i < vertices_.size(); ++i) {
      along.emplace_back(line.dot(at(i)), i);
    }
    std::ranges::sort(along);
    DisjointSets<> places(vertices_.size());
    for (std::size_t i = 0; i < along.size(); ++i) {
      const Index one = along[i].second;
      for (std::size_t j = i + 1; j < along.size() && along[j].first - along[i].first <= reach_[one]; ++j) {
        const Index other = along[j].second;
        if ((at(one) - at(other)).norm() <= std::min(reach_[one], reach_[other])) {
          places.join(one, other);
        }
      }
      if (i % 65536 == 0) {
        check_interrupt();
      }
    }
    place_of_.resize(vertices_.size());
    for (Index i = 0; i < vertices_.size(); ++i) {
      place_of_[i] = places.root(i);
    }
    is_joined_.assign(vertices_.size(), false);
  }

  [[nodiscard]] Index local(Index vertex) const {
    return narrow<Index>(std::ranges::lower_bound(vertices_, vertex) - vertices_.begin());
  }
  [[nodiscard]] const Vec3& at(Index local_vertex) const { return mesh_.vertices[vertices_[local_vertex]]; }
  [[nodiscard]] std::array<Index, 2> places_of(const Rim& rim) const {
    return {place_of_[local(rim.from)], place_of_[local(rim.to)]};
  }

  /// Parts between the same places are one edge.
  void pair(std::vector<Part> parts) {
    std::ranges::sort(parts, {}, [](const Part& part) { return std::tuple(part.ends, part.rim); });
    for (std::size_t i = 1; i < parts.size(); ++i) {
      const Part &one = parts[i - 1], &other = parts[i];
      if (one.ends == other.ends && one.rim != other.rim) {
        paired_[one.rim] = paired_[other.rim] = true;
        is_joined_[one.ends[0]] = is_joined_[one.ends[1]] = true;
        meeting_.push_back({rims_[one.rim].triangle, rims_[other.rim].triangle});
      }
    }
  }

  static Part part(Index from, Index to, Index rim) { return {{std::min(from, to), std::max(from, to)}, rim}; }

  void pair_whole_edges() {
    std::vector<Part> whole;
    for (Index r = 0; r < rims_.size(); ++r) {
      const auto [from, to] = places_of(rims_[r]);
      if (from != to) {
        whole.push_back(part(from, to, r));
      }
    }
    pair(std::move(whole));
    whole_edges_ = narrow<std::size_t>(std::ranges::count(paired_, true));
  }

  /// What is not paired yet, with the vertices of others along it.
  void pair_parts() {
    std::vector<Index> open;
    std::vector<Index> ends;
    for (Index r = 0; r < rims_.size(); ++r) {
      if (!paired_[r]) {
        open.push_back(r);
        ends.push_back(local(rims_[r].from));
        ends.push_back(local(rims_[r].to));
      }
    }
    std::ranges::sort(ends);
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    std::vector<Vec3> places;
    places.reserve(ends.size());
    for (const Index i : ends) {
      places.push_back(at(i));
    }
    const PointTree tree(places);
    const std::vector<std::pair<Index, Index>> meeting = by_places(open);
    std::map<Index, std::vector<std::pair<double, Index>>> along;  // by edge: how far along, and the place
    for (std::size_t i = 0; i < open.size(); ++i) {
      if (i % 65536 == 0) {
        check_interrupt();
      }
      if (!has_edge_along(open[i], meeting)) {
        continue;
      }
      const Rim& rim = rims_[open[i]];
      const double reach = std::max(reach_[local(rim.from)], reach_[local(rim.to)]);
      for (const Index beside : tree.beside(mesh_.vertices[rim.from], mesh_.vertices[rim.to], reach)) {
        if (const auto fraction = fraction_along(open[i], ends[beside])) {
          along[open[i]].emplace_back(*fraction, place_of_[ends[beside]]);
        }
      }
    }
    std::vector<Part> parts;
    for (const Index r : open) {
      auto [from, to] = places_of(rims_[r]);
      if (const auto found = along.find(r); found != along.end()) {
        std::ranges::sort(found->second);
        for (const auto& [fraction, place] : found->second) {
          if (std::vector<Index>& chain = between_[r]; std::ranges::find(chain, place) == chain.end()) {
            chain.push_back(place);
            parts.push_back(part(from, place, r));
            from = place;
          }
        }
      }
      if (from != to) {
        parts.push_back(part(from, to, r));
      }
    }
    pair(std::move(parts));
  }

  /// Edges with the places of their ends, ascending.
  [[nodiscard]] std::vector<std::pair<Index, Index>> by_places(const std::vector<Index>& edges) const {
    std::vector<std::pair<Index, Index>> found;
    for (const Index r : edges) {
      for (const Index place : places_of(rims_[r])) {
        found.emplace_back(place, r);
      }
    }
    std::ranges::sort(found);
    return found;
  }

  /// Whether another edge at one of its ends runs along it or goes on in its line: else nothing can be joined to it.
  /// Most edges of what is no surface are told by that, without a search of the space along them.
  [[nodiscard]] bool has_edge_along(Index r, const std::vector<std::pair<Index, Index>>& by_place) const {
    constexpr double largest_sine = 2 * share_of_edge;
    const auto way_of = [&](Index edge) {
      return Vec3((mesh_.vertices[rims_[edge].to] - mesh_.vertices[rims_[edge].from]).normalized());
    };
    const Vec3 way = way_of(r);
    return std::ranges::any_of(places_of(rims_[r]), [&](Index place) {
      return std::ranges::any_of(std::ranges::equal_range(by_place, place, {}, &std::pair<Index, Index>::first),
                                 [&](const auto& other) {
                                   return other.second != r && way.cross(way_of(other.second)).norm() <= largest_sine;
                                 });
    });
  }

  /// Where a vertex lies along an edge of another triangle, between its ends; none if it does not.
  [[nodiscard]] std::optional<double> fraction_along(Index r, Index vertex) const {
    const Rim& rim = rims_[r];
    const auto& corners = mesh_.triangles[rim.triangle];
    const auto [from, to] = places_of(rim);
    const Index place = place_of_[vertex];
    if (place == from || place == to || std::ranges::find(corners, vertices_[vertex]) != corners.end()) {
      return std::nullopt;
    }
    const Vec3 way = mesh_.vertices[rim.to] - mesh_.vertices[rim.from];
    const Vec3 there = at(vertex) - mesh_.vertices[rim.from];
    const double fraction = there.dot(way) / way.squaredNorm();
    return fraction > 0 && fraction < 1 && (there - fraction * way).norm() <= reach_[vertex] ? std::optional(fraction)
                                                                                             : std::nullopt;
  }

  const TriangleMesh& mesh_;
  std::vector<Rim> rims_;
  std::vector<bool> paired_;
  std::vector<Index> vertices_;                  // of the boundary, ascending; what follows counts in them
  std::vector<double> reach_;                    // mm, within which another vertex is in the same place
  std::vector<Index> place_of_;                  // the first vertex in the same place
  std::vector<bool> is_joined_;                  // of a place: some edges are paired there
  std::map<Index, std::vector<Index>> between_;  // by edge: places along it
  std::size_t whole_edges_ = 0;                  // that are paired from end to end
  std::vector<std::array<Index, 2>> meeting_;
};

}  // namespace

Seams find_seams(const TriangleMesh& mesh) {
  require_valid(mesh);
  return SeamFinder(mesh).seams();
}

WithoutSeams without_seams(TriangleMesh mesh) {
  require_valid(mesh);
  const SeamFinder finder(mesh);
  const Seams found = finder.seams();
  if (found.edges == 0) {
    return {std::move(mesh), 0, 0};
  }
  return {finder.joined(), found.edges, found.t_junctions};
}

}  // namespace tunica
