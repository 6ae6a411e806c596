#include "tunica/fit/barycentre.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t nodes_per_block = 64;
constexpr double least_facing = 0.2;  // agreement of a facet with the target's normals below which it counts as flipped
constexpr double collapsed = 0.05;    // height over longest edge
constexpr int halvings = 6;

/// Length along a closed polyline at its closest point to p, and the direction of the segment there.
struct OnCurve {
  double arc;
  double squared_distance;
  Vec3 direction;
};

class ClosedCurve {
public:
  explicit ClosedCurve(const std::vector<Vec3>& points) : points_(points), arc_(points.size() + 1, 0) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      arc_[i + 1] = arc_[i] + (next(i) - points[i]).norm();
    }
  }
  [[nodiscard]] double length() const { return arc_.back(); }

  [[nodiscard]] OnCurve closest(const Vec3& p) const {
    OnCurve best{0, infinity, Vec3::Zero()};
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Vec3 along = next(i) - points_[i];
      const double squared = along.squaredNorm();
      const double s = squared > 0 ? std::clamp((p - points_[i]).dot(along) / squared, 0.0, 1.0) : 0;
      const double d = (points_[i] + s * along - p).squaredNorm();
      if (d < best.squared_distance) {
        best = {arc_[i] + s * (arc_[i + 1] - arc_[i]), d, along};
      }
    }
    return best;
  }

  [[nodiscard]] Vec3 at(double arc) const {
    arc -= length() * std::floor(arc / length());
    const auto after = std::upper_bound(arc_.begin(), arc_.end(), arc);
    const auto i =
        std::min(points_.size() - 1, narrow<std::size_t>(std::max<std::ptrdiff_t>(0, after - arc_.begin() - 1)));
    const double step = arc_[i + 1] - arc_[i];
    const double s = step > 0 ? (arc - arc_[i]) / step : 0;
    return (1 - s) * points_[i] + s * next(i);
  }

private:
  [[nodiscard]] const Vec3& next(std::size_t i) const { return points_[(i + 1) % points_.size()]; }
  const std::vector<Vec3>& points_;
  std::vector<double> arc_;
};

/// Closest points on the curve for a loop of nodes. Where these do not run once around the curve in one direction, the
/// nodes are spread over it in proportion to the loop's own lengths, from the node that is closest to it.
std::vector<Vec3> along_curve(const ClosedCurve& curve, const std::vector<Vec3>& loop) {
  const std::size_t n = loop.size();
  std::vector<OnCurve> found(n);
  for (std::size_t i = 0; i < n; ++i) {
    found[i] = curve.closest(loop[i]);
  }
  const double length = curve.length();
  int direction = 0;
  for (const int sign : {1, -1}) {
    double around = 0;
    bool forward = true;
    for (std::size_t i = 0; i < n; ++i) {
      double step = sign * (found[(i + 1) % n].arc - found[i].arc);
      step -= length * std::floor(step / length);
      forward = forward && step > 1e-9 * length;
      around += step;
    }
    if (forward && std::abs(around - length) < 1e-6 * length) {
      direction = sign;
    }
  }
  std::vector<Vec3> out(n);
  if (direction != 0) {
    for (std::size_t i = 0; i < n; ++i) {
      out[i] = curve.at(found[i].arc);
    }
    return out;
  }
  std::vector<double> own(n + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    own[i + 1] = own[i] + (loop[(i + 1) % n] - loop[i]).norm();
  }
  if (!(own[n] > 0)) {
    return loop;
  }
  const std::size_t first =
      std::min_element(found.begin(), found.end(),
                       [](const OnCurve& a, const OnCurve& b) { return a.squared_distance < b.squared_distance; }) -
      found.begin();
  double best = infinity;
  for (const int sign : {1, -1}) {
    std::vector<Vec3> spread(n);
    double squared = 0;
    for (std::size_t i = 0; i < n; ++i) {
      spread[i] = curve.at(found[first].arc + sign * (own[i] - own[first]) / own[n] * length);
      squared += (spread[i] - loop[i]).squaredNorm();
    }
    if (squared < best) {
      best = squared;
      out = spread;
    }
  }
  return out;
}

/// What the guard against flips compares: how well a facet agrees with the normals at its corners, and its shape.
struct FacetState {
  double agreement;
  double height;  // smallest height over longest edge
};

FacetState facet_state(const std::array<Index, 3>& v, const std::vector<Vec3>& p, const std::vector<Vec3>& normals) {
  const Vec3 &a = p[v[0]], &b = p[v[1]], &c = p[v[2]];
  const Vec3 n = (b - a).cross(c - a);
  const double squared_longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  const double twice = n.norm();
  if (!(twice > 0)) {
    return {-1, 0};
  }
  return {std::min({n.dot(normals[v[0]]), n.dot(normals[v[1]]), n.dot(normals[v[2]])}) / twice,
          twice / squared_longest};
}

bool is_worse(const FacetState& now, const FacetState& before) {
  return (now.agreement < least_facing && now.agreement < before.agreement) ||
         (now.height < collapsed && now.height < 0.5 * before.height);
}

/// Halves, at last drops, the moves of the corners of triangles that would flip or collapse.
std::vector<Vec3> without_flips(const TriangleMesh& mesh, const std::vector<Vec3>& goal,
                                const std::vector<Vec3>& normals, std::size_t& shortened) {
  std::vector<int> halved(goal.size(), 0);
  std::vector<Vec3> moved = goal;
  for (bool again = true; again;) {
    again = false;
    std::vector<std::uint8_t> marked(goal.size(), 0);
    for (const auto& v : mesh.triangles) {
      if (std::any_of(v.begin(), v.end(), [&](Index i) { return halved[i] < halvings; }) &&
          is_worse(facet_state(v, moved, normals), facet_state(v, mesh.vertices, normals))) {
        for (const Index i : v) {
          marked[i] = 1;
        }
      }
    }
    for (std::size_t i = 0; i < goal.size(); ++i) {
      if (marked[i] != 0 && halved[i] < halvings) {
        again = true;
        const double part = ++halved[i] == halvings ? 0 : std::ldexp(1.0, -halved[i]);
        moved[i] = mesh.vertices[i] + part * (goal[i] - mesh.vertices[i]);
      }
    }
  }
  shortened = narrow<std::size_t>(std::count_if(halved.begin(), halved.end(), [](int h) { return h > 0; }));
  return moved;
}

/// How badly a loop fits a curve: the mean distance, and far more when they run opposite ways, as the rims of the two
/// walls of a thin organ do.
double misfit(const ClosedCurve& curve, const TriangleMesh& mesh, const std::vector<Index>& loop) {
  double sum = 0, along = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Vec3& p = mesh.vertices[loop[i]];
    const Vec3& next = mesh.vertices[loop[(i + 1) % loop.size()]];
    const OnCurve found = curve.closest((p + next) / 2);
    sum += std::sqrt(found.squared_distance);
    along += (next - p).dot(found.direction.stableNormalized());
  }
  const double mean = sum / real(loop.size());
  return along >= 0 ? mean : 10 * (mean + curve.length());
}

}  // namespace

std::vector<std::optional<std::size_t>> match_boundaries(const Target& target, const TriangleMesh& mesh,
                                                         const std::vector<std::vector<Index>>& loops) {
  for (const std::vector<Index>& loop : loops) {
    for (const Index v : loop) {
      if (v >= mesh.vertices.size()) {
        throw InputError(fmt::format("a boundary loop names vertex {}, but there are {}", v, mesh.vertices.size()));
      }
    }
  }
  struct Pair {
    double distance;
    std::size_t loop, curve;
  };
  std::vector<Pair> pairs;
  for (std::size_t c = 0; c < target.boundary().size(); ++c) {
    const ClosedCurve curve(target.boundary()[c]);
    if (curve.length() > 0) {
      for (std::size_t l = 0; l < loops.size(); ++l) {
        pairs.push_back({misfit(curve, mesh, loops[l]), l, c});
      }
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::vector<std::optional<std::size_t>> out(loops.size());
  std::vector<std::uint8_t> taken(target.boundary().size(), 0);
  for (const bool twice : {false, true}) {
    for (const Pair& pair : pairs) {
      if (!out[pair.loop] && (twice || taken[pair.curve] == 0)) {
        out[pair.loop] = pair.curve;
        taken[pair.curve] = 1;
      }
    }
  }
  return out;
}

NodeMoves move_by_barycentre(const Target& target, TriangleMesh& mesh, double off_target) {
  require_not_negative(off_target, "the distance that a node may lie off the target");
  NodeMoves moves;
  const std::size_t count = mesh.vertices.size();
  const auto sides = vertex_normals(mesh);
  std::vector<double> shortest_edge(count, infinity);
  for (const auto& v : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const double length = (mesh.vertices[v[i]] - mesh.vertices[v[(i + 1) % 3]]).norm();
      shortest_edge[v[i]] = std::min(shortest_edge[v[i]], length);
      shortest_edge[v[(i + 1) % 3]] = std::min(shortest_edge[v[(i + 1) % 3]], length);
    }
  }

  enum class Way : std::uint8_t { stay, rule, closest, boundary };
  std::vector<Way> way(count, Way::stay);
  std::vector<Vec3> goal = mesh.vertices;
  std::vector<Vec3> normals = sides;
  parallel_for_blocks(count, nodes_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (sides[v].squaredNorm() < 0.5) {
        continue;
      }
      const auto foot = target.closest_facing(mesh.vertices[v], sides[v], target.diagonal());
      if (!foot) {
        continue;
      }
      normals[v] = foot->normal;
      goal[v] = foot->point;
      way[v] = Way::closest;
      const auto barycentre = target.barycentre_of_three(mesh.vertices[v], sides[v], target.diagonal());
      if (barycentre && (*barycentre - foot->point).norm() <= shortest_edge[v] / 2) {
        const auto there = target.closest_facing(*barycentre, sides[v], target.diagonal());
        if (there && there->distance <= off_target) {
          goal[v] = *barycentre;
          way[v] = Way::rule;
        }
      }
    }
  });

  const auto loops = boundary_loops(mesh);
  const auto curves = match_boundaries(target, mesh, loops);
  for (std::size_t l = 0; l < loops.size(); ++l) {
    std::vector<Vec3> nodes;
    for (const Index v : loops[l]) {
      nodes.push_back(mesh.vertices[v]);
    }
    if (curves[l]) {
      nodes = along_curve(ClosedCurve(target.boundary()[*curves[l]]), nodes);
    }
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Index v = loops[l][i];
      // A loop that the target lacks stays where it is, but on the target: the rule would shrink it.
      if (curves[l]) {
        goal[v] = nodes[i];
      } else if (const auto foot = target.closest_facing(nodes[i], sides[v], target.diagonal())) {
        goal[v] = foot->point;
      }
      way[v] = Way::boundary;
    }
  }

  const auto moved = without_flips(mesh, goal, normals, moves.shortened);
  for (std::size_t v = 0; v < count; ++v) {
    moves.largest = std::max(moves.largest, (moved[v] - mesh.vertices[v]).norm());
    moves.by_rule += way[v] == Way::rule;
    moves.to_closest_point += way[v] == Way::closest;
    moves.on_boundary += way[v] == Way::boundary;
  }
  mesh.vertices = moved;
  return moves;
}

}  // namespace tunica
