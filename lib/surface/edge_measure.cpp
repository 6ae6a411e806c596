// How far off a collapse is, measured.
#include "surface/closest_point.hpp"
#include "surface/edge_collapse.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tunica {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// A point counts as over a triangle up to this share of its height beside it.
constexpr double beside = 0.05;

}  // namespace

EdgeCollapse::Facet::Facet(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  normal = ab.cross(ac);
  const double squared = normal.squaredNorm();
  if (!(squared > 0)) {
    return;
  }
  inverse = 1 / squared;
  height = -normal.dot(a);
  along[0] = inverse * ac.cross(normal);
  along[1] = inverse * normal.cross(ab);
  share = {-along[0].dot(a), -along[1].dot(a)};
}

Lanes EdgeCollapse::Facet::squared_height(const LaneVec3& p) const {
  const auto linear = [&p](const Vec3& n, double offset) {
    return Lanes(p[0] * n[0] + p[1] * n[1] + p[2] * n[2] + offset);
  };
  const Lanes s = linear(along[0], share[0]);
  const Lanes t = linear(along[1], share[1]);
  const Lanes h = linear(normal, height);
  Lanes result = infinity;
  std::experimental::where(s > -beside && t > -beside && s + t < 1 + beside, result) = inverse * h * h;
  return result;
}

void EdgeCollapse::prepare_measuring(const TriangleMesh& mesh) {
  given_facets_.reserve(mesh.triangles.size());
  for (HalfEdge h = 0; h < half_.size(); h += 3) {
    given_facets_.emplace_back(vertex_[from(h)].position, vertex_[from(h + 1)].position, vertex_[from(h + 2)].position);
  }
  given_mesh_ = &mesh;
  measured_.assign(half_of_.size(), 0);
  next_merged_.assign(vertex_.size(), none);
  last_merged_.resize(vertex_.size());
  std::iota(last_merged_.begin(), last_merged_.end(), Index{0});
}

/// The largest squared distance between what a collapse makes and what was given, at the places where it is large: from
/// the new vertex and the middles of the edges that will leave it to the given triangles at the vertices that were
/// merged, and from the middles of the given edges that go now to the new triangles.
/// @param enough  up to it, it may come out too large
double EdgeCollapse::squared_distance_off(HalfEdge h, const Vec3& position, double enough) {
  const Index u = from(h);
  const Index v = to(h);
  const Index left = from(previous(h));
  const Index right = half_[h].twin == none ? none : from(previous(half_[h].twin));
  off_.assign(1, position);
  off_from_.clear();
  for (const Index end : {u, v}) {
    neighbours_of(end, [&](Index w) {
      if (w != u && w != v && (end == u || (w != left && w != right))) {
        off_.emplace_back(0.5 * (position + vertex_[w].position));
      }
    });
    for (Index merged = end; merged != none; merged = next_merged_[merged]) {
      const auto given = given_around_.of(given_[merged]);
      off_from_.insert(off_from_.end(), given.begin(), given.end());
    }
  }
  const auto given_facet = [&](std::size_t i) -> const Facet& { return given_facets_[off_from_[i]]; };
  const auto given_corners = [&](std::size_t i) {
    const auto& c = given_mesh_->triangles[off_from_[i]];
    return std::array<Vec3, 3>{given_position(c[0]), given_position(c[1]), given_position(c[2])};
  };
  const double ahead = farthest_off(off_from_.size(), given_facet, given_corners, enough);
  if (next_merged_[u] != none && next_merged_[v] != none) {
    return ahead;
  }
  off_.clear();
  made_.clear();
  made_corners_.clear();
  for (const Index end : {u, v}) {
    if (next_merged_[end] == none) {
      for (const Index t : given_around_.of(given_[end])) {
        const auto& c = given_mesh_->triangles[t];
        const std::size_t k = c[0] == given_[end] ? 0 : c[1] == given_[end] ? 1 : 2;
        off_.emplace_back(0.5 * (vertex_[end].position + given_position(c[(k + 1) % 3])));
        if (vertex_[end].curve != none) {
          off_.emplace_back(0.5 * (vertex_[end].position + given_position(c[(k + 2) % 3])));
        }
      }
    }
    around(end, [&](HalfEdge spoke) {
      const Index i = to(spoke);
      const Index j = to(next(spoke));
      if (i != u && i != v && j != u && j != v) {
        made_corners_.push_back({position, vertex_[i].position, vertex_[j].position});
        made_.emplace_back(position, vertex_[i].position, vertex_[j].position);
      }
    });
  }
  const auto made_facet = [&](std::size_t i) -> const Facet& { return made_[i]; };
  const auto made_corners = [&](std::size_t i) -> const std::array<Vec3, 3>& { return made_corners_[i]; };
  return std::max(ahead, farthest_off(made_.size(), made_facet, made_corners, enough));
}

/// The largest squared distance from the points in `off_` to so many triangles.
template <typename FacetOf, typename CornersOf>
double EdgeCollapse::farthest_off(std::size_t facets, const FacetOf& facet, const CornersOf& corners,
                                  double enough) const {
  double most = 0;
  for (std::size_t first = 0; first < off_.size(); first += lane_count) {
    const LaneVec3 p =
        lane_points([&](std::size_t lane) -> const Vec3& { return off_[std::min(first + lane, off_.size() - 1)]; });
    Lanes least = infinity;
    for (std::size_t i = 0; i < facets; ++i) {
      least = std::experimental::min(least, facet(i).squared_height(p));
      if (std::experimental::all_of(least <= enough)) {
        break;
      }
    }
    for (std::size_t s = first; s < std::min(first + lane_count, off_.size()); ++s) {
      double squared = least[s - first];
      if (squared == infinity) {  // over none of them
        for (std::size_t i = 0; i < facets; ++i) {
          const auto& c = corners(i);
          squared = std::min(squared, (off_[s] - closest_point_on_triangle(off_[s], c[0], c[1], c[2])).squaredNorm());
        }
      }
      most = std::max(most, squared);
    }
  }
  return most;
}

}  // namespace tunica
