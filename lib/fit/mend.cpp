#include "fit/mend.hpp"

#include "core/progress.hpp"
#include "fit/normals.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr double good_angle = 1.5;  // times the limit: from here on an angle costs nothing
constexpr double fold_weight = 4;
constexpr double least_gain = 1e-3;
constexpr int passes = 8;
constexpr Index gone = 0xffffffff;

using Corners = std::array<Index, 3>;

/// One way to change the mesh: triangles that go, triangles that come, a node that moves.
struct Change {
  enum class Kind { turn, merge, shift } kind;
  std::vector<Index> old_triangles;
  std::vector<Corners> new_triangles;
  Index moved = gone;
  Vec3 to = Vec3::Zero();
};

class Mender {
public:
  Mender(const Target& target, TriangleMesh& mesh, double off_target, const MendLimits& limits)
      : target_(target), mesh_(mesh), off_target_(off_target), limits_(limits), fans_(mesh.vertices.size()) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (const Index v : mesh.triangles[t]) {
        fans_[v].push_back(static_cast<Index>(t));
      }
    }
    on_boundary_.assign(mesh.vertices.size(), 0);
    for (const auto& loop : boundary_loops(mesh)) {
      for (const Index v : loop) {
        on_boundary_[v] = 1;
      }
    }
  }

  Mending run() {
    for (int pass = 0; pass < passes; ++pass) {
      bool changed = false;
      for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
        if (alive(t) && smallest_angle(mesh_.triangles[t]) < limits_.angle) {
          changed = repair({static_cast<Index>(t)}) || changed;
        }
      }
      for (std::size_t v = 0; v < fans_.size(); ++v) {
        if (!fans_[v].empty() && fold_cost(normals_of(fans_[v])) > 0) {
          changed = repair(fans_[v]) || changed;
        }
      }
      if (!changed) {
        break;
      }
    }
    drop_the_gone();
    return done_;
  }

private:
  [[nodiscard]] bool alive(std::size_t t) const { return mesh_.triangles[t][0] != gone; }

  [[nodiscard]] const Vec3& at(Index v) const { return v == moved_ ? moved_to_ : mesh_.vertices[v]; }

  [[nodiscard]] Vec3 normal(const Corners& v) const {
    return (at(v[1]) - at(v[0])).cross(at(v[2]) - at(v[0])).stableNormalized();
  }

  [[nodiscard]] double smallest_angle(const Corners& v) const {
    return smallest_angle_degrees(at(v[0]), at(v[1]), at(v[2]));
  }

  [[nodiscard]] std::vector<Vec3> normals_of(const std::vector<Index>& triangles) const {
    std::vector<Vec3> out;
    for (const Index t : triangles) {
      out.push_back(normal(mesh_.triangles[t]));
    }
    return out;
  }

  [[nodiscard]] double fold_cost(const std::vector<Vec3>& normals) const {
    const auto agreement = [&](const Vec3& n) {
      double least = 1;
      for (const Vec3& f : normals) {
        least = std::min(least, n.dot(f));
      }
      return least;
    };
    Vec3 mean = Vec3::Zero();
    for (const Vec3& f : normals) {
      mean += f;
    }
    if (agreement(mean.stableNormalized()) >= limits_.agreement) {
      return 0;
    }
    const double shortfall = std::max(0.0, 1 - most_compatible_normal(normals).agreement / limits_.agreement);
    return fold_weight * shortfall * shortfall;
  }

  [[nodiscard]] double angle_cost(const Corners& v) const {
    const double shortfall = std::max(0.0, 1 - smallest_angle(v) / (good_angle * limits_.angle));
    return shortfall * shortfall;
  }

  /// What some triangles and their nodes cost, where the nodes' other triangles are those around them `without` some.
  double cost(const std::vector<Corners>& triangles, const std::vector<Index>& nodes,
              const std::vector<Index>& without) const {
    double sum = 0;
    std::vector<Vec3> facing;
    for (const Corners& v : triangles) {
      sum += angle_cost(v);
      facing.push_back(normal(v));
    }
    for (const Index v : nodes) {
      std::vector<Vec3> fan;
      for (std::size_t i = 0; i < triangles.size(); ++i) {
        if (std::find(triangles[i].begin(), triangles[i].end(), v) != triangles[i].end()) {
          fan.push_back(facing[i]);
        }
      }
      for (const Index t : fans_[v]) {
        if (std::find(without.begin(), without.end(), t) == without.end()) {
          fan.push_back(normal(mesh_.triangles[t]));
        }
      }
      if (!fan.empty()) {
        sum += fold_cost(fan);
      }
    }
    return sum;
  }

  /// Largest distance from the target of the triangles' centroids and edge middles.
  double straying(const std::vector<Corners>& triangles) const {
    double largest = 0;
    for (const auto& [a, b, c] : triangles) {
      const Vec3 &p = at(a), &q = at(b), &r = at(c);
      for (const Vec3& x : {Vec3((p + q + r) / 3), Vec3((p + q) / 2), Vec3((q + r) / 2), Vec3((r + p) / 2)}) {
        largest = std::max(largest, target_.closest(x).distance);
      }
    }
    return largest;
  }

  std::vector<Corners> corners_of(const std::vector<Index>& triangles) const {
    std::vector<Corners> out;
    for (const Index t : triangles) {
      out.push_back(mesh_.triangles[t]);
    }
    return out;
  }

  /// How much a change lessens the cost; nothing when it strays or brings nothing.
  std::optional<double> gain(const Change& change) {
    const auto before = corners_of(change.old_triangles);
    std::vector<Index> nodes;
    for (const Corners& v : before) {
      nodes.insert(nodes.end(), v.begin(), v.end());
    }
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    const double cost_before = cost(before, nodes, change.old_triangles);
    moved_ = change.moved;
    moved_to_ = change.to;
    const double cost_after = cost(change.new_triangles, nodes, change.old_triangles);
    std::optional<double> found;
    if (cost_after < cost_before - least_gain) {
      const double strayed = straying(change.new_triangles);
      moved_ = gone;
      if (strayed <= off_target_ || strayed <= limits_.straying * straying(before)) {
        found = cost_before - cost_after;
      }
    }
    moved_ = gone;
    return found;
  }

  /// Does the best change around some triangles, if any.
  bool repair(const std::vector<Index>& where) {
    check_interrupt();
    std::vector<std::array<Index, 2>> edges;
    std::vector<Index> nodes;
    for (const Index t : where) {
      const Corners& v = mesh_.triangles[t];
      for (std::size_t i = 0; i < 3; ++i) {
        const Index w = v[(i + 1) % 3];
        edges.push_back({std::min(v[i], w), std::max(v[i], w)});
        nodes.push_back(v[i]);
      }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());

    std::optional<Change> best;
    double best_gain = 0;
    const auto consider = [&](const std::optional<Change>& change) {
      if (change) {
        if (const auto g = gain(*change); g && *g > best_gain) {
          best_gain = *g;
          best = change;
        }
      }
    };
    for (const auto& [a, b] : edges) {
      consider(turn(a, b));
      for (const auto& [kept, lost] : {std::pair(a, b), std::pair(b, a)}) {
        consider(merge(kept, lost, mesh_.vertices[kept]));
      }
      if (on_boundary_[a] == 0 && on_boundary_[b] == 0) {
        consider(merge(a, b, target_.closest((mesh_.vertices[a] + mesh_.vertices[b]) / 2).point));
      }
    }
    for (const Index v : nodes) {
      for (const double part : {1.0, 0.5}) {
        consider(shift(v, part));
      }
    }
    if (best) {
      apply(*best);
    }
    return best.has_value();
  }

  std::vector<Index> triangles_on(Index a, Index b) const {
    std::vector<Index> out;
    for (const Index t : fans_[a]) {
      const Corners& v = mesh_.triangles[t];
      if (std::find(v.begin(), v.end(), b) != v.end()) {
        out.push_back(t);
      }
    }
    return out;
  }

  std::vector<Index> ring(Index v) const {
    std::vector<Index> out;
    for (const Index t : fans_[v]) {
      for (const Index w : mesh_.triangles[t]) {
        if (w != v) {
          out.push_back(w);
        }
      }
    }
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
  }

  /// The other diagonal of the two triangles on the edge.
  std::optional<Change> turn(Index a, Index b) const {
    const auto pair = triangles_on(a, b);
    if (pair.size() != 2) {
      return {};
    }
    std::array<Index, 2> apex{};
    for (std::size_t i = 0; i < 2; ++i) {
      const Corners& v = mesh_.triangles[pair[i]];
      apex[i] = v[0] != a && v[0] != b ? v[0] : (v[1] != a && v[1] != b ? v[1] : v[2]);
    }
    if (apex[0] == apex[1] || !triangles_on(apex[0], apex[1]).empty()) {
      return {};
    }
    // In each triangle the far apex takes the place of one end of the edge.
    Corners first = mesh_.triangles[pair[0]], second = mesh_.triangles[pair[1]];
    std::replace(first.begin(), first.end(), a, apex[1]);
    std::replace(second.begin(), second.end(), b, apex[0]);
    return Change{Change::Kind::turn, pair, {first, second}, gone, Vec3::Zero()};
  }

  /// Both nodes become `kept`, at `to`, where the link condition allows it.
  std::optional<Change> merge(Index kept, Index lost, const Vec3& to) const {
    if (on_boundary_[lost] != 0 || triangles_on(kept, lost).size() != 2) {
      return {};
    }
    const auto of_kept = ring(kept), of_lost = ring(lost);
    std::vector<Index> common;
    std::set_intersection(of_kept.begin(), of_kept.end(), of_lost.begin(), of_lost.end(), std::back_inserter(common));
    const auto keeps_enough = [&](Index v) { return ring(v).size() > (on_boundary_[v] == 0 ? 3U : 2U); };
    if (common.size() != 2 || !keeps_enough(common[0]) || !keeps_enough(common[1])) {
      return {};
    }
    Change change{Change::Kind::merge, fans_[kept], {}, kept, to};
    for (const Index t : fans_[lost]) {
      const Corners& v = mesh_.triangles[t];
      if (std::find(v.begin(), v.end(), kept) == v.end()) {
        change.old_triangles.push_back(t);
      }
    }
    for (const Index t : change.old_triangles) {
      Corners v = mesh_.triangles[t];
      std::replace(v.begin(), v.end(), lost, kept);
      if (std::count(v.begin(), v.end(), kept) == 1) {
        change.new_triangles.push_back(v);
      }
    }
    return change;
  }

  /// Part of the way to the middle of the ring, on the target.
  std::optional<Change> shift(Index v, double part) const {
    if (on_boundary_[v] != 0) {
      return {};
    }
    Vec3 middle = Vec3::Zero();
    const auto neighbours = ring(v);
    for (const Index w : neighbours) {
      middle += mesh_.vertices[w] / static_cast<double>(neighbours.size());
    }
    const Vec3 to = target_.closest(mesh_.vertices[v] + part * (middle - mesh_.vertices[v])).point;
    return Change{Change::Kind::shift, fans_[v], corners_of(fans_[v]), v, to};
  }

  void apply(const Change& change) {
    for (const Index t : change.old_triangles) {
      for (const Index v : mesh_.triangles[t]) {
        std::erase(fans_[v], t);
      }
      mesh_.triangles[t].fill(gone);
    }
    for (std::size_t i = 0; i < change.new_triangles.size(); ++i) {
      const Index t = change.old_triangles[i];
      mesh_.triangles[t] = change.new_triangles[i];
      for (const Index v : mesh_.triangles[t]) {
        fans_[v].push_back(t);
      }
    }
    if (change.moved != gone) {
      mesh_.vertices[change.moved] = change.to;
    }
    ++(change.kind == Change::Kind::turn    ? done_.turned
       : change.kind == Change::Kind::merge ? done_.merged
                                            : done_.shifted);
  }

  void drop_the_gone() {
    std::erase_if(mesh_.triangles, [](const Corners& v) { return v[0] == gone; });
    std::vector<Index> number(mesh_.vertices.size(), gone);
    Index count = 0;
    for (std::size_t v = 0; v < fans_.size(); ++v) {
      if (!fans_[v].empty()) {
        mesh_.vertices[count] = Vec3(mesh_.vertices[v]);
        number[v] = count++;
      }
    }
    mesh_.vertices.resize(count);
    for (Corners& corners : mesh_.triangles) {
      for (Index& v : corners) {
        v = number[v];
      }
    }
  }

  const Target& target_;
  TriangleMesh& mesh_;
  double off_target_;
  MendLimits limits_;
  std::vector<std::vector<Index>> fans_;  // the triangles around each node; none: the node is gone
  std::vector<std::uint8_t> on_boundary_;
  Index moved_ = gone;  // while a change is judged
  Vec3 moved_to_ = Vec3::Zero();
  Mending done_;
};

}  // namespace

Mending mend(const Target& target, TriangleMesh& mesh, double off_target, const MendLimits& limits) {
  return Mender(target, mesh, off_target, limits).run();
}

}  // namespace tunica
