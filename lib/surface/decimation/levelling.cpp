#include "tunica/surface/decimation/detail/levelling.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/decimation/detail/shape_patch.hpp"
#include "tunica/surface/distance/facet_distances.hpp"
#include "tunica/surface/distance/surface_walk.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/subdivide.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <queue>

namespace tunica {
namespace {

constexpr int doublings = 4;             // errors count by their 16th power: nearly the largest alone
constexpr double least_gain = 0.15;      // of the worst triangle's cost, for a change to be made
constexpr double collapse_share = 0.85;  // of the largest error, at most, may a collapse leave
constexpr double beside_share = 0.3;     // of the largest error, at least, that a triangle beside it is mended for
constexpr double renew_share = 0.8;      // of the error that costs refer to, below which they are computed anew
constexpr double certain_share = 0.5;  // of the largest squared error: points that look farther off are looked at again
constexpr std::array<double, 3> may_be_larger{3, 1.3, 1};  // than known, is a triangle's error: see Leveller::Known
constexpr double least_angle = 3;                          // degrees: thinner triangles cost something
constexpr double large_triangle = 1.5;                     // steps: longer ones of the target are cut
constexpr double most_parts = 8;           // into which the edges of a large triangle of the target are cut
constexpr std::size_t many_vertices = 24;  // per triangle of the mesh: no more are looked at
// Work is counted in distances between a point and a triangle.
constexpr std::size_t work_per_query = 30;
std::size_t work_of(const PatchTrial& trial) {
  return trial.corners.size() * (trial.samples.size() + 3 * work_per_query);
}
constexpr std::size_t least_work = 150'000;
constexpr std::size_t work_per_collapsed = 35;  // triangle of the target
constexpr std::size_t work_per_triangle = 25;   // of the target, at least: the worst places have to be found
// Where much stays the collapses took little time, and half of that work does: from the first share of the target's
// triangles on ever less, from the second on half.
constexpr std::array<double, 2> much_stays{0.05, 0.1};
constexpr std::size_t shaped_work_per_triangle = 20'000;  // of the mesh, where shape counts
std::size_t levelling_work(std::size_t given, std::size_t left, bool thorough) {
  const std::size_t collapsed = given - std::min(given, left);
  const std::size_t work = std::max({least_work, work_per_collapsed * collapsed, work_per_triangle * given});
  const double share = real(left) / real(given);
  const double much = thorough ? 0 : std::clamp((share - much_stays[0]) / (much_stays[1] - much_stays[0]), 0.0, 1.0);
  return truncated<std::size_t>((1 - 0.5 * much) * real(work));
}
constexpr double good_shape_weight = 0.3;  // of the lack of radius ratio, where shape counts
constexpr double hard_angle_weight = 1e6;  // so that no angle gets too small

/// The target's points that the mesh is to be close to, each with the triangle of the mesh nearest to it. Owners come
/// from around the vertex that the point was merged into; points that look far off are looked at again.
class Sampling {
public:
  Sampling(const TriangleMesh& mesh, const TriangleMesh& target, const DecimationOrigins& origins)
      : mesh_(mesh), target_(target), stands_for_(origins.stands_for), around_(incidence(mesh)) {
    samples_.near = origins.triangles;
    samples_.on_target.assign(mesh.vertices.size(), 0);
    add_vertices();
    add_within();
    find_owners();
    look_again();
  }

  TargetSamples samples() && { return std::move(samples_); }

private:
  // A point, with the vertex of the mesh that stands for its surroundings.
  struct Given {
    Vec3 point;
    Index vertex;
  };

  void add_vertices() {
    const std::size_t stride = 1 + target_.vertices.size() / (many_vertices * mesh_.triangles.size());
    std::vector<std::uint8_t> taken(target_.vertices.size(), 0);
    for (const auto& corners : target_.triangles) {
      for (const Index v : corners) {
        if (v % stride == 0 && taken[v] == 0) {
          taken[v] = 1;
          given_.push_back({target_.vertices[v], stands_for_[v]});
        }
      }
    }
  }

  // Target triangles that are as large as the mesh's need points within. The mesh's mean edge is 1.5 steps long.
  void add_within() {
    const double step = std::sqrt(area(mesh_) / real(mesh_.triangles.size()));
    const std::vector<int> parts_of = parts_for_points(
        target_,
        [&](double longest) {
          return longest > large_triangle * step ? std::min(std::ceil(longest / step), most_parts) : 0;
        },
        real(many_vertices * mesh_.triangles.size()));
    for (Index t = 0; t < target_.triangles.size(); ++t) {
      const auto& c = target_.triangles[t];
      const std::array<Vec3, 3> p{target_.vertices[c[0]], target_.vertices[c[1]], target_.vertices[c[2]]};
      const int parts = parts_of[t];
      for (int i = 0; i <= parts; ++i) {
        for (int j = i == 0 ? 1 : 0; i + j <= parts && i < parts && j < parts; ++j) {
          given_.push_back({p[0] + (real(i) * (p[1] - p[0]) + real(j) * (p[2] - p[0])) / parts, stands_for_[c[0]]});
        }
      }
    }
  }

  // Points of one vertex together: several at once against the triangles around it.
  void find_owners() {
    std::vector<Index> offsets(mesh_.vertices.size() + 1, 0);
    for (const Given& g : given_) {
      ++offsets[g.vertex + 1];
    }
    std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
    std::vector<Index> next(offsets.begin(), offsets.end() - 1);
    samples_.points.resize(given_.size());
    for (const Given& g : given_) {
      samples_.points[next[g.vertex]++] = g.point;
    }
    samples_.owner.resize(given_.size());
    samples_.squared.resize(given_.size());
    std::vector<FacetDistances> facets;
    facets.reserve(mesh_.triangles.size());
    for (const auto& [i, j, k] : mesh_.triangles) {
      facets.emplace_back(std::array<Vec3, 3>{mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]});
    }
    for (Index v = 0; v < mesh_.vertices.size(); ++v) {
      const std::size_t end = offsets[v + 1];
      if (end == offsets[v] + 1 && samples_.points[offsets[v]] == mesh_.vertices[v]) {
        samples_.owner[offsets[v]] = around_.of(v)[0];
        samples_.squared[offsets[v]] = 0;
        samples_.on_target[v] = 1;
        continue;
      }
      for (std::size_t first = offsets[v]; first < end; first += lane_count) {
        const LaneVec3 p =
            lane_points([&](std::size_t lane) { return samples_.points[std::min(first + lane, end - 1)]; });
        NearestFacet nearest;
        for (const Index t : around_.of(v)) {
          nearest.try_facet(facets[t], p, t);
        }
        for (std::size_t s = first; s < std::min(first + lane_count, end); ++s) {
          samples_.owner[s] = truncated<Index>(nearest.which[s - first]);
          samples_.squared[s] = nearest.squared[s - first];
        }
      }
    }
  }

  void look_again() {
    const SurfaceWalk walk(mesh_);
    const auto nearer = [&](Index l, Index r) {
      return samples_.squared[l] < samples_.squared[r] || (samples_.squared[l] == samples_.squared[r] && l > r);
    };
    std::vector<Index> farthest(samples_.points.size());
    std::iota(farthest.begin(), farthest.end(), Index{0});
    std::make_heap(farthest.begin(), farthest.end(), nearer);
    double certain = 0;
    while (!farthest.empty() && samples_.squared[farthest.front()] >= certain_share * certain) {
      const Index s = farthest.front();
      std::pop_heap(farthest.begin(), farthest.end(), nearer);
      farthest.pop_back();
      const auto hit = walk.closest(samples_.points[s], samples_.owner[s]);
      if (hit.squared_distance < samples_.squared[s]) {
        samples_.squared[s] = hit.squared_distance;
        samples_.owner[s] = hit.triangle;
      }
      certain = std::max(certain, samples_.squared[s]);
    }
  }

  const TriangleMesh& mesh_;
  const TriangleMesh& target_;
  const std::vector<Index>& stands_for_;
  const Incidence around_;
  std::vector<Given> given_;
  TargetSamples samples_;
};

class Leveller {
public:
  /// How well a triangle's error is known: by the points of the target and its corners, by its middle as well, by all.
  enum class Known : std::uint8_t { by_samples, nearly, certainly };
  /// How a mesh is levelled.
  struct Plan {
    ShapeWeights weights;
    NearestPoint near_by;   ///< quick, may be too far
    Known known;            ///< how well errors are known at the start
    std::size_t triangles;  ///< at most
    std::size_t work;       ///< at most
    double diagonal;        ///< mm, of the target
  };

  Leveller(ShapedMesh& state, Plan plan, const std::vector<CheapCollapse>& collapses)
      : state_(state),
        plan_(std::move(plan)),
        collapses_(collapses),
        weights_(plan_.weights),
        known_(mesh().triangles.size(), plan_.known),
        work_left_(plan_.work) {
    weights_.error = infinity;
    weights_.doublings = doublings;
    weights_.most_error = 0;
  }

  void run() {
    std::vector<Worst> all;
    all.reserve(mesh().triangles.size());
    for (Index t = 0; t < mesh().triangles.size(); ++t) {
      if (mesh().is_alive(t)) {
        all.push_back({may_be(t), t});
      }
    }
    queue_ = std::priority_queue<Worst>({}, std::move(all));
    while (work_left_ > 0 && !queue_.empty()) {
      const auto [error, t] = queue_.top();
      if (!mesh().is_alive(t) || may_be(t) != error) {
        queue_.pop();
        continue;
      }
      if (known_[t] != Known::certainly) {
        queue_.pop();
        measure(t);
        continue;
      }
      if (!(error > negligible_error * plan_.diagonal)) {
        break;
      }
      if (error < renew_share * weights_.error || error > weights_.error) {
        weights_.error = error;
        state_.set_weights(weights_);
      }
      if (!mend(t) && !mend_beside(t)) {
        break;
      }
    }
  }

private:
  struct Worst {
    double error;
    Index triangle;
    friend bool operator<(const Worst& l, const Worst& r) {
      return l.error < r.error || (l.error == r.error && l.triangle > r.triangle);
    }
  };
  [[nodiscard]] const EditMesh& mesh() const { return state_.mesh(); }

  [[nodiscard]] double may_be(Index t) const {
    return state_.error(t) * may_be_larger[static_cast<std::size_t>(known_[t])];
  }

  void measure(Index t) {
    if (known_[t] == Known::by_samples) {
      known_[t] = Known::nearly;
      spend(work_per_query);
      state_.measure_middle(t, plan_.near_by);
    } else {
      known_[t] = Known::certainly;
      spend(6 * work_per_query);
      state_.measure(t);
    }
    queue_.push({may_be(t), t});
  }

  void spend(std::size_t work) { work_left_ -= std::min(work_left_, work); }

  double evaluate(PatchTrial& trial, double limit) {
    const double cost = state_.evaluate(trial, limit);
    spend(work_of(trial));
    return cost;
  }

  bool mend(Index t) {
    // What changes replace must be known as well as they themselves will be.
    for (const Index v : mesh().triangles[t]) {
      for (const Index neighbour : mesh().around[v]) {
        if (known_[neighbour] == Known::by_samples) {
          measure(neighbour);
        }
      }
    }
    error_ = state_.error(t);
    least_gain_ = least_gain * state_.cost(t);
    farthest_ = state_.farthest_sample(t);
    return flip(t) || move(t) || collapse(t) || split(t);
  }

  // Where the worst triangle cannot be mended, mending one beside it may make room.
  bool mend_beside(Index t) {
    std::vector<Worst> beside;
    for (const Index v : mesh().triangles[t]) {
      for (const Index n : mesh().around[v]) {
        if (n != t) {
          beside.push_back({state_.error(n), n});
        }
      }
    }
    std::sort(beside.begin(), beside.end(), [](const Worst& l, const Worst& r) { return r < l; });
    return std::any_of(beside.begin(), beside.end(), [&](const Worst& n) {
      return work_left_ > 0 && n.error > beside_share * state_.error(t) && mend(n.triangle);
    });
  }

  // The best of several trials, and then it is done.
  void begin() {
    best_cost_ = -least_gain_;
    found_ = false;
  }
  void consider() {
    const double cost = evaluate(trial_, best_cost_);
    if (!(cost < best_cost_)) {
      return;
    }
    spend(4 * work_per_query * trial_.corners.size());
    if (state_.measure_within(trial_) < error_) {
      best_cost_ = cost;
      std::swap(trial_, best_);
      found_ = true;
    }
  }
  bool finish() {
    if (found_) {
      accept(best_);
    }
    return found_;
  }

  void accept(const PatchTrial& trial) {
    state_.commit(trial);
    known_.resize(mesh().triangles.size(), Known::by_samples);
    for (const auto& c : trial.corners) {
      for (const Index t : mesh().around[c[0]]) {
        if (mesh().triangles[t] == c) {
          known_[t] = Known::certainly;
          queue_.push({state_.error(t), t});
        }
      }
    }
  }

  bool flip(Index t) {
    const auto c = mesh().triangles[t];
    begin();
    for (std::size_t k = 0; k < 3; ++k) {
      if (state_.make_flip(c[k], c[(k + 1) % 3], trial_)) {
        consider();
      }
    }
    return finish();
  }

  bool move(Index t) {
    const auto c = mesh().triangles[t];
    begin();
    for (const Index v : c) {
      if (mesh().on_boundary[v] != 0) {
        for (const double fraction : {0.5, 0.4, 0.6}) {
          consider_move(v, state_.slide(v, fraction));
        }
        continue;
      }
      const Vec3 here = mesh().positions[v];
      places_ = {state_.proposal(v, 0.001), state_.proposal(v, 0.03), state_.foot(v)};
      if (farthest_) {
        places_.push_back(*farthest_);
      }
      for (const Vec3& there : places_) {
        consider_move(v, there);
        consider_move(v, 0.5 * (here + there));
      }
    }
    return finish();
  }

  void consider_move(Index v, const Vec3& place) {
    state_.make_move(v, place, trial_);
    consider();
  }

  bool collapse(Index t) {
    const auto c = mesh().triangles[t];
    begin();
    for (std::size_t k = 0; k < 3; ++k) {
      if (state_.make_collapse(c[k], c[(k + 1) % 3], trial_)) {
        consider_places(mesh().on_boundary[trial_.moved] == 0);
      }
    }
    return finish();
  }

  bool split(Index t) {
    while (mesh().alive + 2 > plan_.triangles) {
      if (!collapse_cheaply()) {
        return false;
      }
      if (!mesh().is_alive(t)) {
        return true;
      }
    }
    const auto c = mesh().triangles[t];
    begin();
    for (std::size_t k = 0; k < 3; ++k) {
      state_.make_split(c[k], c[(k + 1) % 3], trial_);
      consider_places(trial_.removed.size() == 2);
    }
    state_.make_centre_split(t, trial_);
    consider_places(true);
    return finish();
  }

  // The trial as it is, and with its vertex at other places, if it is free.
  void consider_places(bool free) {
    state_.limit_error(infinity);
    PatchTrial first = trial_;
    const double cost = evaluate(first, infinity);
    state_.limit_error(0);
    if (!(cost < infinity)) {
      return;
    }
    consider();
    if (!free) {
      return;
    }
    places_ = {state_.proposal(first, 0.001), state_.proposal(first, 0.03)};
    if (farthest_) {
      places_.push_back(*farthest_);
    }
    for (const Vec3& place : places_) {
      trial_ = first;
      trial_.position = place;
      consider();
    }
  }

  // Makes room for a split where that leaves clearly less than the largest error.
  bool collapse_cheaply() {
    const double most_error = collapse_share * error_;
    double limit = most_error / weights_.error;
    for (int i = 0; i < doublings; ++i) {
      limit *= limit;
    }
    bool found = false;
    while (!found && next_ < collapses_.size() && work_left_ > 0) {
      const auto& [u, v, position] = collapses_[next_++];
      if (mesh().around[u].empty() || mesh().around[v].empty() || !state_.make_collapse(u, v, trial_)) {
        continue;
      }
      const bool free = mesh().on_boundary[trial_.moved] == 0;
      if (free) {
        trial_.position = position;
      }
      state_.limit_error(infinity);
      const double cost = evaluate(trial_, infinity);
      state_.limit_error(most_error);
      found = cost < limit && state_.measure_within(trial_) < most_error;
      if (!found && free && cost < infinity) {
        trial_.position = state_.proposal(trial_, 0.03);
        found = evaluate(trial_, limit) < limit && state_.measure_within(trial_) < most_error;
      }
    }
    state_.limit_error(0);
    if (found) {
      accept(trial_);
    }
    return found;
  }

  ShapedMesh& state_;
  Plan plan_;
  const std::vector<CheapCollapse>& collapses_;
  ShapeWeights weights_;
  std::priority_queue<Worst> queue_;
  std::vector<Known> known_;  // #F how well the error is known
  PatchTrial trial_, best_;
  std::vector<Vec3> places_;
  std::optional<Vec3> farthest_;
  double error_ = 0, least_gain_ = 0, best_cost_ = 0;
  bool found_ = false;
  std::size_t next_ = 0, work_left_;
};

}  // namespace

TriangleMesh levelled(const TriangleMesh& mesh, const TriangleMesh& target, const LevellingOptions& options) {
  const BoundaryCurves curves(options.closed || boundary_loops(mesh).empty() ? TriangleMesh{} : target);
  const SurfaceWalk walk(target);
  const NearestPoint nearest = [&walk](const Vec3& p, Index near, double enough) {
    return walk.closest(p, near, enough);
  };
  Leveller::Plan plan;
  plan.near_by = [&walk](const Vec3& p, Index near, double enough) { return walk.near_by(p, near, enough); };
  plan.weights.quality = 1e-4;
  plan.weights.angle = 1;
  plan.weights.angle_wanted = least_angle;
  plan.weights.fold_cosine = -0.9;
  plan.known = Leveller::Known::by_samples;
  plan.triangles = options.triangles;
  plan.work = levelling_work(target.triangles.size(), mesh.triangles.size(), options.thorough);
  plan.diagonal = diagonal(target);
  ShapedMesh state(mesh, target, nearest, Sampling(mesh, target, options.origins).samples(), curves);
  state.measure_corners(plan.near_by);
  Leveller(state, plan, options.collapses).run();
  return state.mesh().mesh();
}

void level_well_shaped(ShapedMesh& state, const TriangleMesh& target, const WellShapedOptions& options) {
  const EditMesh& mesh = state.mesh();
  Leveller::Plan plan;
  plan.near_by = options.nearest;
  plan.weights.quality = good_shape_weight;
  plan.weights.angle = hard_angle_weight;
  plan.weights.angle_wanted = options.angle;
  plan.known = Leveller::Known::certainly;
  plan.triangles = options.triangles;
  plan.work = shaped_work_per_triangle * mesh.alive;
  plan.diagonal = diagonal(target);
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.is_alive(t)) {
      state.measure(t);
    }
  }
  // The edges whose triangles are close to the target, short ones first.
  std::vector<std::pair<double, CheapCollapse>> found;
  for (const auto& [u, v] : mesh.edges()) {
    double error = 0;
    for (const Index end : {u, v}) {
      for (const Index t : mesh.around[end]) {
        error = std::max(error, state.error(t));
      }
    }
    const Vec3 middle = 0.5 * (mesh.positions[u] + mesh.positions[v]);
    found.push_back({error * (mesh.positions[u] - mesh.positions[v]).norm(), {u, v, middle}});
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<CheapCollapse> collapses;
  for (const auto& [cost, collapse] : found) {
    collapses.push_back(collapse);
  }
  Leveller(state, plan, collapses).run();
}

}  // namespace tunica
