#include "tunica/surface/decimation/detail/shaping.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/decimation/detail/levelling.hpp"
#include "tunica/surface/decimation/detail/shape_patch.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tunica {
namespace {

constexpr int rounds = 8;             // over all triangles: the last gain less than 1 %
constexpr int mending_rounds = 24;    // over those that miss the angle, which are few
constexpr double large_error = 0.85;  // quantile of the triangles' errors that counts as large
constexpr double safe_angle = 1.04;   // of the angle asked for: what is worked towards
/// Of these, what a change may leave: as much as an edge of twice the length sags, which shape may ask for.
constexpr double most_large_errors = 4;
/// Of the square root of a triangle's area, about a third of an edge: what is farther off has lost a part of the
/// target.
constexpr double most_for_size = 0.5;
constexpr double least_shaping_gain = 1e-4;  // smaller ones are not worth another look at the neighbours
constexpr double good_quality = 0.875;       // mean radius ratio that is worked towards
constexpr double least_quality = 0.86;       // below it there are further rounds
constexpr int further_rounds = 6;            // each weighs shape twice as much at most
constexpr double most_loss = 4;              // that a collapse may cost so that a split elsewhere may win more
constexpr double crease_cosine = 0.5;        // of 60 degrees, as in lib/fit: the angle there is the input's own

// The narrowest sector around a vertex between boundary or crease edges, degrees; 360 if there is none.
double narrowest_sector(const TriangleMesh& mesh, Index v, std::span<const Index> triangles,
                        const std::vector<std::array<Index, 3>>& across) {
  const auto normal = [&](Index t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Vec3& a = mesh.vertices[i];
    return Vec3((mesh.vertices[j] - a).cross(mesh.vertices[k] - a).normalized());
  };
  const auto corner = [&](Index t) {
    const auto& c = mesh.triangles[t];
    return std::find(c.begin(), c.end(), v) - c.begin();
  };
  const auto is_feature = [&](Index t, Index other) {
    return other == no_neighbour || normal(t).dot(normal(other)) < crease_cosine;
  };
  double narrowest = 360;
  for (const Index first : triangles) {
    // A sector begins at a triangle behind a feature edge, and runs counter-clockwise to the next one.
    if (!is_feature(first, across[first][corner(first)])) {
      continue;
    }
    double angle = 0;
    Index t = first;
    for (std::size_t step = 0; step < triangles.size(); ++step) {
      const std::size_t k = corner(t);
      const Vec3& p = mesh.vertices[v];
      const Vec3& a = mesh.vertices[mesh.triangles[t][(k + 1) % 3]];
      const Vec3& b = mesh.vertices[mesh.triangles[t][(k + 2) % 3]];
      angle += angle_degrees(p, a, b);
      const Index other = across[t][(k + 2) % 3];
      if (is_feature(t, other)) {
        break;
      }
      t = other;
    }
    narrowest = std::min(narrowest, angle);
  }
  return narrowest;
}

// Where the target has a corner sharper than the angle asked for, and the mesh has it too, the vertex there is put
// into it for good: to widen the corner would cost its tip, and the angle does not count.
void pin_sharp_corners(TriangleMesh coarse, const ShapingOptions& options, ShapedMesh& state) {
  if (options.sharp_corners.empty()) {
    return;
  }
  const Incidence around = incidence(coarse);
  const auto across = neighbours(coarse, around);
  const ClosestPoint tree(coarse);
  std::vector<Index> rim;
  for (Index v = 0; v < coarse.vertices.size(); ++v) {
    if (state.mesh().on_boundary[v] != 0) {
      rim.push_back(v);
    }
  }
  for (const SharpCorner& corner : options.sharp_corners) {
    const auto& near = coarse.triangles[tree.closest(corner.at).triangle];
    const std::vector<Index> candidates = corner.on_boundary ? rim : std::vector<Index>(near.begin(), near.end());
    const auto apart = [&](Index v) { return (coarse.vertices[v] - corner.at).squaredNorm(); };
    const auto closest =
        std::min_element(candidates.begin(), candidates.end(), [&](Index l, Index r) { return apart(l) < apart(r); });
    if (closest == candidates.end() || state.is_pinned(*closest) ||
        (state.mesh().on_boundary[*closest] != 0) != corner.on_boundary) {
      continue;
    }
    const Vec3 before = std::exchange(coarse.vertices[*closest], corner.at);
    const double sector = narrowest_sector(coarse, *closest, around.of(*closest), across);
    const bool has_it = sector < options.min_angle && sector >= corner.least_angle();
    if (!has_it || !state.pin(*closest, corner.at, corner.least_angle())) {
      coarse.vertices[*closest] = before;
    }
  }
}

std::array<Index, 2> edge_by_length(const EditMesh& mesh, Index t, bool longest) {
  const auto& c = mesh.triangles[t];
  std::array<Index, 2> best{c[0], c[1]};
  double best_length = longest ? -1 : infinity;
  for (std::size_t k = 0; k < 3; ++k) {
    const double length = (mesh.positions[c[k]] - mesh.positions[c[(k + 1) % 3]]).norm();
    if (longest ? length > best_length : length < best_length) {
      best_length = length;
      best = {c[k], c[(k + 1) % 3]};
    }
  }
  return best;
}

bool share_triangles(const PatchTrial& a, const PatchTrial& b) {
  return std::any_of(a.removed.begin(), a.removed.end(),
                     [&](Index t) { return std::find(b.removed.begin(), b.removed.end(), t) != b.removed.end(); });
}

template <typename Visit>
void for_each_triangle(const EditMesh& mesh, const Visit& visit) {
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.is_alive(t)) {
      visit(t);
    }
  }
}

std::vector<Index> below_angle(const ShapedMesh& state, double angle) {
  std::vector<Index> bad;
  for_each_triangle(state.mesh(), [&](Index t) {
    if (state.smallest_angle(t) < angle) {
      bad.push_back(t);
    }
  });
  return bad;
}

class Shaper {
public:
  Shaper(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree, const BoundaryCurves& curves,
         const ShapingOptions& options, const NearestPoint& nearest)
      : state_(mesh, target, nearest, sample_target(mesh, target, tree), curves),
        target_(target),
        tree_(tree),
        nearest_(nearest),
        options_(options) {
    state_.measure_all();
    pin_sharp_corners(mesh, options, state_);
    most_error_ = most_for_size * std::sqrt(area(target) / real(options.triangles));
    weights_.error = 1e-3 * diagonal(target);
    weights_.angle_wanted = safe_angle * options.min_angle;
  }

  TriangleMesh run() {
    state_.set_weights(weights_);
    for (int round = 0; round < rounds; ++round) {
      improve();
      if (round + 2 < rounds) {
        fill();
        trade();
      }
      advance(options_.progress, real(round + 1) / (rounds + 1));
    }
    for (int round = 0; round < further_rounds && mean_quality(mesh().mesh()) < least_quality; ++round) {
      improve();
    }
    mend();
    level_well_shaped(state_, target_, {1.01 * options_.min_angle, options_.triangles, nearest_});
    advance(options_.progress, 1.0);
    return state_.mesh().mesh();
  }

private:
  [[nodiscard]] const EditMesh& mesh() const { return state_.mesh(); }

  void improve() {
    adapt();
    for (int pass = 0; pass < 3; ++pass) {
      flips();
      moves();
    }
  }

  // What counts as a large error, what no change may leave, and how much shape weighs, follow from the state. Where
  // most of a surface is flat the quantile is that of nothing, and the mean square tells.
  void adapt() {
    std::vector<double> errors;
    double squares = 0;
    for_each_triangle(mesh(), [&](Index t) {
      errors.push_back(state_.error(t));
      squares += state_.error(t) * state_.error(t);
    });
    const auto at = errors.begin() + truncated<std::size_t>(large_error * real(errors.size() - 1));
    std::nth_element(errors.begin(), at, errors.end());
    set_large_error(std::max({*at, std::sqrt(squares / real(errors.size())), negligible_error * diagonal(target_)}));
    weights_.quality *= std::clamp(std::exp(40 * (good_quality - mean_quality(mesh().mesh()))), 0.5, 2.0);
    state_.set_weights(weights_);
    dirty_.assign(mesh().positions.size(), 1);
  }

  void set_large_error(double error) {
    weights_.error = error;
    weights_.most_error = std::min(most_large_errors * error, most_error_);
  }

  void accept(const PatchTrial& trial) {
    state_.commit(trial);
    dirty_.resize(mesh().positions.size(), 1);
    for (const auto& c : trial.corners) {
      for (const Index v : c) {
        dirty_[v] = 1;
      }
    }
  }

  bool flip(Index u, Index v) {
    if (state_.make_flip(u, v, trial_) && state_.evaluate(trial_, -least_shaping_gain) < -least_shaping_gain) {
      accept(trial_);
      return true;
    }
    return false;
  }

  void flips() {
    for (const auto& [u, v] : mesh().edges()) {
      const auto on = mesh().on_edge(u, v);
      if ((dirty_[u] != 0 || dirty_[v] != 0) && on[0] != EditMesh::none && on[1] != EditMesh::none) {
        flip(u, v);
      }
    }
    check_interrupt();
  }

  void moves() {
    for (Index v = 0; v < mesh().positions.size(); ++v) {
      if (v % 1024 == 0) {
        check_interrupt();
      }
      if (dirty_[v] != 0 && !mesh().around[v].empty()) {
        dirty_[v] = 0;
        move(v);
      }
    }
  }

  // Takes the best of some places for a vertex. @return whether one was better
  bool move(Index v) {
    candidates_.clear();
    const Vec3 here = mesh().positions[v];
    if (mesh().on_boundary[v] != 0) {
      for (const double fraction : {0.5, 0.4, 0.6}) {
        candidates_.push_back(state_.slide(v, fraction));
      }
    } else {
      for (const double pull : {0.003, 0.03, 0.3}) {
        const Vec3 there = state_.proposal(v, pull);
        candidates_.push_back(there);
        candidates_.emplace_back(0.5 * (here + there));
      }
    }
    return take_best(v);
  }

  bool take_best(Index v) {
    double best = -least_shaping_gain;
    bool found = false;
    for (const Vec3& candidate : candidates_) {
      state_.make_move(v, candidate, trial_);
      const double gain = state_.evaluate(trial_, best);
      if (gain < best) {
        best = gain;
        std::swap(trial_, best_);
        found = true;
      }
    }
    if (found) {
      accept(best_);
    }
    return found;
  }

  // A collapse in the better of two places: halfway, and where least squares put it from there.
  double evaluate_collapse(Index u, Index v, double limit, PatchTrial& trial) {
    if (!state_.make_collapse(u, v, trial)) {
      return infinity;
    }
    double cost = state_.evaluate(trial, limit);
    if (cost < infinity && mesh().on_boundary[trial.moved] == 0) {
      PatchTrial refined = trial;
      refined.position = state_.proposal(trial, 0.03);
      const double refined_cost = state_.evaluate(refined, std::min(limit, cost));
      if (refined_cost < cost) {
        cost = refined_cost;
        std::swap(trial, refined);
      }
    }
    return cost;
  }

  // The triangles with the largest errors, worst first, but no more than `most`.
  [[nodiscard]] std::vector<Index> worst(std::size_t most, double above) const {
    std::vector<Index> found;
    for_each_triangle(mesh(), [&](Index t) {
      if (state_.error(t) > above) {
        found.push_back(t);
      }
    });
    std::sort(found.begin(), found.end(), [&](Index l, Index r) {
      return state_.error(l) > state_.error(r) || (state_.error(l) == state_.error(r) && l < r);
    });
    found.resize(std::min(found.size(), most));
    return found;
  }

  // The longest edge, which gives the better shapes; an edge of the rim, where the error may be the rim's own.
  double split_worst(Index t, double limit) {
    const auto c = mesh().triangles[t];
    double best = infinity;
    const auto try_edge = [&](Index u, Index v) {
      PatchTrial trial;
      state_.make_split(u, v, trial);
      const double cost = state_.evaluate(trial, std::min(limit, best));
      if (cost < std::min(limit, best)) {
        best = cost;
        trial_ = std::move(trial);
      }
    };
    const auto longest = edge_by_length(mesh(), t, true);
    try_edge(longest[0], longest[1]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Index u = c[k], v = c[(k + 1) % 3];
      if (mesh().on_edge(u, v)[1] == EditMesh::none && std::minmax(u, v) != std::minmax(longest[0], longest[1])) {
        try_edge(u, v);
      }
    }
    return best;
  }

  // Uses up the triangles that are allowed where the error is largest.
  void fill() {
    while (mesh().alive + 2 <= options_.triangles) {
      bool any = false;
      for (const Index t : worst((options_.triangles - mesh().alive) / 2, 0)) {
        if (mesh().alive + 2 <= options_.triangles && mesh().is_alive(t) && split_worst(t, infinity) < 1e300) {
          accept(trial_);
          any = true;
        }
      }
      if (!any) {
        return;
      }
    }
  }

  struct Candidate {
    double key;
    std::array<Index, 2> edge;
    friend bool operator<(const Candidate& l, const Candidate& r) {
      return l.key < r.key || (l.key == r.key && l.edge < r.edge);
    }
  };

  // Edges whose collapse costs least, cheapest first, among those that look cheap.
  std::vector<Candidate> cheap_collapses(std::size_t most) {
    std::vector<Candidate> found;
    for (const auto& edge : mesh().edges()) {
      double error = 0;
      for (const Index end : edge) {
        for (const Index t : mesh().around[end]) {
          error = std::max(error, state_.error(t));
        }
      }
      if (error < 0.9 * weights_.error) {
        found.push_back({error * (mesh().positions[edge[0]] - mesh().positions[edge[1]]).norm(), edge});
      }
    }
    std::sort(found.begin(), found.end());
    found.resize(std::min(found.size(), most));
    for (Candidate& c : found) {
      c.key = evaluate_collapse(c.edge[0], c.edge[1], most_loss, trial_);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::find_if(found.begin(), found.end(), [](const Candidate& c) { return !(c.key < most_loss); }),
                found.end());
    return found;
  }

  // Pairs of a collapse where little is lost and a split where much is won.
  void trade() {
    const std::vector<Index> large = worst(mesh().alive / 12 + 1, weights_.error);
    const auto collapses = cheap_collapses(8 * large.size() + 100);
    touched_.assign(mesh().positions.size(), 0);
    auto next = collapses.begin();
    for (const Index t : large) {
      if (!mesh().is_alive(t) || touches(mesh().triangles[t])) {
        continue;
      }
      next = std::find_if(next, collapses.end(), [&](const Candidate& c) { return !touches(c.edge); });
      if (next == collapses.end()) {
        return;
      }
      const double worth_it = -next->key - 0.05;
      if (!(split_worst(t, worth_it) < worth_it)) {
        continue;
      }
      const PatchTrial split = trial_;
      const auto [u, v] = next->edge;
      ++next;
      // At a boundary a collapse takes away only one triangle.
      const auto fits = [&](const PatchTrial& collapse) {
        return mesh().alive + split.corners.size() + collapse.corners.size() <=
               options_.triangles + split.removed.size() + collapse.removed.size();
      };
      if (evaluate_collapse(u, v, most_loss, trial_) < most_loss && !share_triangles(split, trial_) && fits(trial_)) {
        const PatchTrial collapse = trial_;
        touch(split);
        touch(collapse);
        accept(collapse);
        accept(split);
      }
    }
  }

  // Lets go of up to `count` edges where little is lost, so that there is room for splits.
  void make_room(std::size_t count) {
    touched_.assign(mesh().positions.size(), 0);
    for (const Candidate& c : cheap_collapses(4 * count + 50)) {
      if (count == 0) {
        return;
      }
      if (!touches(c.edge) && evaluate_collapse(c.edge[0], c.edge[1], most_loss, trial_) < most_loss) {
        const PatchTrial collapse = trial_;
        touch(collapse);
        accept(collapse);
        --count;
      }
    }
  }

  template <typename Indices>
  [[nodiscard]] bool touches(const Indices& vertices) const {
    return std::any_of(vertices.begin(), vertices.end(), [&](Index v) { return touched_[v] != 0; });
  }
  void touch(const PatchTrial& trial) {
    for (const Index t : trial.removed) {
      for (const Index v : mesh().triangles[t]) {
        touched_[v] = 1;
      }
    }
    touched_.resize(touched_.size() + 1, 1);
  }
  // Triangles with angles still too small: shape weighs more and more, and everything may be tried.
  void mend() {
    for (int round = 0; round < mending_rounds; ++round) {
      const auto bad = below_angle(state_, 1.005 * options_.min_angle);
      if (bad.empty()) {
        return;
      }
      weights_.angle *= 1.6;
      set_large_error(weights_.error * (round < 12 ? 1.15 : 1));
      state_.set_weights(weights_);
      dirty_.assign(mesh().positions.size(), 0);
      if (round % 6 == 3 && mesh().alive + 2 * bad.size() > options_.triangles) {
        make_room(std::min(bad.size() + 1, mesh().alive / 100));
      }
      for (const Index t : bad) {
        if (mesh().is_alive(t) && state_.smallest_angle(t) < 1.005 * options_.min_angle) {
          mend(t);
        }
      }
      flips();
      moves();
    }
  }

  void mend(Index t) {
    const auto c = mesh().triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      if (flip(c[k], c[(k + 1) % 3])) {
        return;
      }
    }
    bool moved = false;
    for (const Index v : c) {
      moved = move_anywhere(v) || moved;
    }
    if (moved) {
      return;
    }
    const auto [a, b] = edge_by_length(mesh(), t, false);
    if (evaluate_collapse(a, b, 0, trial_) < 0) {
      const PatchTrial collapse = trial_;
      accept(collapse);
      return;
    }
    if (mesh().alive + 2 <= options_.triangles && split_worst(t, 0) < 0) {
      accept(trial_);
    }
  }

  // Also places a little towards each neighbour.
  bool move_anywhere(Index v) {
    if (mesh().on_boundary[v] != 0) {
      candidates_.clear();
      for (int i = 1; i < 10; ++i) {
        candidates_.push_back(state_.slide(v, 0.1 * i));
      }
      return take_best(v);
    }
    if (move(v)) {
      return true;
    }
    candidates_.clear();
    std::vector<Index> ring;
    mesh().ring(v, ring);
    const Vec3 here = mesh().positions[v];
    for (const Index w : ring) {
      for (const double step : {-0.2, 0.1, 0.3}) {
        candidates_.push_back(tree_.closest(here + step * (mesh().positions[w] - here)).point);
      }
    }
    return take_best(v);
  }

  ShapedMesh state_;
  const TriangleMesh& target_;
  const ClosestPoint& tree_;
  const NearestPoint& nearest_;
  const ShapingOptions& options_;
  ShapeWeights weights_;
  double most_error_;
  PatchTrial trial_, best_;
  std::vector<Vec3> candidates_;
  std::vector<std::uint8_t> dirty_, touched_;
};

}  // namespace

TriangleMesh shaped(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree,
                    const ShapingOptions& options) {
  const BoundaryCurves curves(target);
  const NearestPoint nearest = [&tree](const Vec3& p, Index near, double /*enough*/) { return tree.closest(p, near); };
  return Shaper(mesh, target, tree, curves, options, nearest).run();
}

std::vector<SharpCorner> sharp_corners(const TriangleMesh& mesh, double limit) {
  const Incidence around = incidence(mesh);
  const auto across = neighbours(mesh, around);
  std::vector<SharpCorner> found;
  for (Index v = 0; v < mesh.vertices.size(); ++v) {
    const auto triangles = around.of(v);
    const double sector = narrowest_sector(mesh, v, triangles, across);
    if (sector < limit) {
      const bool on_boundary = std::any_of(triangles.begin(), triangles.end(), [&](Index t) {
        const auto& c = mesh.triangles[t];
        return across[t][std::find(c.begin(), c.end(), v) - c.begin()] == no_neighbour;
      });
      found.push_back({mesh.vertices[v], on_boundary, sector});
    }
  }
  return found;
}

double smallest_free_angle(const TriangleMesh& mesh, std::span<const SharpCorner> sharp, double limit) {
  struct Small {
    Vec3 at;
    double angle, reach;
  };
  std::vector<Small> small;
  double least = 60;
  for (const auto& c : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& p = mesh.vertices[c[k]];
      const Vec3& a = mesh.vertices[c[(k + 1) % 3]];
      const Vec3& b = mesh.vertices[c[(k + 2) % 3]];
      const double angle = angle_degrees(p, a, b);
      if (angle < limit) {
        small.push_back({p, angle, 0.5 * std::min((a - p).norm(), (b - p).norm())});
      } else {
        least = std::min(least, angle);
      }
    }
  }
  for (const Small& s : small) {
    if (std::none_of(sharp.begin(), sharp.end(), [&](const SharpCorner& c) {
          return (c.at - s.at).norm() <= s.reach && s.angle >= c.least_angle();
        })) {
      least = std::min(least, s.angle);
    }
  }
  return least;
}

}  // namespace tunica
