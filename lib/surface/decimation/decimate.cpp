#include "tunica/surface/decimation/decimate.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/decimation/detail/edge_collapse.hpp"
#include "tunica/surface/decimation/detail/levelling.hpp"
#include "tunica/surface/decimation/detail/shaping.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t hopeless_count = 4;  // times the triangles that the error alone takes
/// A well-shaped mesh whose error is below this share of the one allowed says that fewer triangles can do, whatever
/// became of a mesh with fewer: errors of single counts scatter by a tenth.
constexpr double much_below = 0.8;
constexpr int most_attempts = 14, attempts_below = 7;  // counts; their bisection ends at 4 %
/// The greedy order's next collapses, of the triangles: from them comes what is spent where the error is largest.
constexpr double more_collapses = 0.1;
/// Where more than this share of the triangles stays there is no levelling: finding the places that it should mend
/// would take longer than all collapses.
constexpr double much = 0.2;
/// For an error, levelling is tried down to this share of the triangles that do without, in so many steps.
constexpr double least_levelled = 0.4;
constexpr int level_steps = 6;
/// What a certificate may take: a mesh that needs more counts as one that does not keep the error.
constexpr std::size_t least_splits = 100'000;
constexpr std::size_t splits_per_triangle = 4;  // of the target
/// Of the error asked for: what spikes may take, so that something is left for the collapses.
constexpr double most_for_spikes = 0.9;
constexpr double largest_min_angle = 40;  // degrees: of shaped()
constexpr double least_size = 1e-100;     // mm: squares of edges below vanish

// The mesh after the first `steps` collapses; `origins` tells which vertices and triangles came from where.
TriangleMesh replay(const TriangleMesh& mesh, const std::vector<Collapse>& history, std::size_t steps,
                    DecimationOrigins* origins = nullptr) {
  std::vector<Vec3> position = mesh.vertices;
  std::vector<Index> root(mesh.vertices.size());
  std::iota(root.begin(), root.end(), Index{0});
  for (std::size_t i = 0; i < steps; ++i) {
    root[history[i].removed] = history[i].kept;
    position[history[i].kept] = history[i].position;
  }
  // A vertex is removed once, into one that lives longer: backwards, every root is final when it is needed.
  for (std::size_t i = steps; i-- > 0;) {
    root[history[i].removed] = root[history[i].kept];
  }
  TriangleMesh result;
  const std::size_t left = steps > 0 ? history[steps - 1].triangles_left : mesh.triangles.size();
  result.triangles.reserve(left);
  result.vertices.reserve(mesh.vertices.size() - steps);
  constexpr Index unused = 0xffffffff;
  std::vector<Index> renumbered(mesh.vertices.size(), unused);
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    const auto& triangle = mesh.triangles[t];
    std::array<Index, 3> corners{root[triangle[0]], root[triangle[1]], root[triangle[2]]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) {
      continue;
    }
    for (Index& v : corners) {
      if (renumbered[v] == unused) {
        renumbered[v] = narrow<Index>(result.vertices.size());
        result.vertices.push_back(position[v]);
      }
      v = renumbered[v];
    }
    result.triangles.push_back(corners);
    if (origins != nullptr) {
      origins->triangles.push_back(t);
    }
  }
  if (origins != nullptr) {
    for (Index& r : root) {
      r = renumbered[r];
    }
    origins->stands_for = std::move(root);
  }
  return result;
}

// The mesh after the first `steps` collapses, its largest error lessened at that count; what the history says to
// collapse next is what may be spent on that.
TriangleMesh level(const TriangleMesh& mesh, const EdgeCollapse& collapse, std::size_t steps, bool thorough) {
  const std::vector<Collapse>& history = collapse.history();
  LevellingOptions options;
  const TriangleMesh coarse = replay(mesh, history, steps, &options.origins);
  options.triangles = coarse.triangles.size();
  options.thorough = thorough;
  options.closed = !collapse.has_boundary();
  const auto end = truncated<std::size_t>((1 - more_collapses) * real(options.triangles));
  for (std::size_t i = steps; i < history.size() && history[i].triangles_left >= end; ++i) {
    const Collapse& further = history[i];
    options.collapses.push_back(
        {options.origins.stands_for[further.kept], options.origins.stands_for[further.removed], further.position});
  }
  return levelled(coarse, mesh, options);
}

// Finds how far along the history the error still holds.
class ErrorSearch {
public:
  ErrorSearch(const TriangleMesh& mesh, const EdgeCollapse& collapse, double max_error, bool levelled)
      : mesh_(mesh),
        collapse_(collapse),
        history_(collapse.history()),
        max_error_(max_error),
        levelled_(levelled),
        tree_(mesh) {
    options_.limit = max_error;
    options_.width = 1e-3 * max_error;
    options_.samples = 0;
    options_.max_splits = std::max(least_splits, splits_per_triangle * mesh.triangles.size());
  }

  DecimateResult run(const Progress& progress) {
    std::size_t holds = 0;
    std::size_t fails = history_.size() + 1;
    best_ = replay(mesh_, history_, 0);
    if (try_steps(history_.size())) {
      return result();
    }
    fails = history_.size();
    // The error grows like a power of the count: halve the interval in the logarithm of the count.
    const double width = std::log(remaining(holds) / remaining(fails));
    while (fails - holds > 1 && remaining(holds) - remaining(fails) > 1e-3 * remaining(fails)) {
      const double middle = std::sqrt(remaining(holds) * remaining(fails));
      const auto steps = std::clamp(truncated<std::size_t>(remaining(0) - middle), holds + 1, fails - 1);
      (try_steps(steps) ? holds : fails) = steps;
      advance(progress, 1 - std::log(remaining(holds) / remaining(fails)) / width);
    }
    // The error need not grow at every step: somewhat later it may hold again.
    for (const double further : {0.99, 0.97, 0.95, 0.92, 0.88}) {
      const auto steps = truncated<std::size_t>(remaining(0) - further * remaining(holds));
      if (steps < history_.size() && steps > holds) {
        try_steps(steps);
      }
    }
    if (levelled_) {
      level_further();
    }
    return result();
  }

private:
  [[nodiscard]] double remaining(std::size_t steps) const { return real(history_.size() + 4 - steps); }

  // Fewer triangles, their largest error lessened.
  void level_further() {
    double holds = real(best_.triangles.size());
    double fails = least_levelled * holds;
    for (int step = 0; step < level_steps && fails + 1 < holds; ++step) {
      const double middle = std::sqrt(holds * fails);
      const auto found = std::find_if(history_.begin(), history_.end(),
                                      [&](const Collapse& c) { return real(c.triangles_left) <= middle; });
      if (found == history_.end()) {
        return;
      }
      const std::size_t steps = found + 1 - history_.begin();
      (accept(level(mesh_, collapse_, steps, true)) ? holds : fails) = middle;
    }
  }

  bool try_steps(std::size_t steps) { return accept(replay(mesh_, history_, steps)); }

  bool accept(TriangleMesh candidate) {
    const Interval error = hausdorff(ClosestPoint(candidate), tree_, options_).both;
    if (error.upper > max_error_) {
      return false;
    }
    if (candidate.triangles.size() <= best_.triangles.size()) {
      best_ = std::move(candidate);
      error_ = error;
    }
    return true;
  }

  DecimateResult result() {
    DecimateResult found;
    found.error = error_ ? *error_ : hausdorff(ClosestPoint(best_), tree_, options_).both;
    found.error_kept = found.error->upper <= max_error_;
    found.mesh = std::move(best_);
    return found;
  }

  const TriangleMesh& mesh_;
  const EdgeCollapse& collapse_;
  const std::vector<Collapse>& history_;
  double max_error_;
  bool levelled_;
  ClosestPoint tree_;
  HausdorffOptions options_;
  TriangleMesh best_;
  std::optional<Interval> error_;
};

// Well-shaped meshes of the counts that are asked for, or that an error needs.
class ShapedSearch {
public:
  ShapedSearch(const TriangleMesh& mesh, const DecimateOptions& options, EdgeCollapse collapse)
      : mesh_(mesh),
        options_(options),
        sharp_(sharp_corners(mesh, *options.min_angle)),
        tree_(mesh),
        collapse_(std::move(collapse)) {
    distance_.width = 1e-3 * options.max_error.value_or(0);
    distance_.samples = 0;
    distance_.max_splits = 2'000'000;
  }

  DecimateResult run() {
    collapse_.run(options_.max_error ? 0 : *options_.triangles, {});
    advance(options_.progress, 0.1);
    std::size_t count = options_.triangles.value_or(0);
    if (count > 0) {
      DecimateResult found = attempt(std::min(count, mesh_.triangles.size()));
      if (!options_.max_error || found.error_kept) {
        return found;
      }
      count = grown(count, *found.error);
    } else {
      count = std::max<std::size_t>(64, collapse_.history().empty() ? 0 : collapse_.history().back().triangles_left);
    }
    return search(count);
  }

private:
  // The error falls as one over the count, or slower: the step is bounded both ways.
  [[nodiscard]] std::size_t grown(std::size_t count, const Interval& error) const {
    const double factor = std::clamp(1.02 * error.upper / *options_.max_error, 0.25, 4.0);
    return truncated<std::size_t>(factor * real(count));
  }

  // The fewest triangles that keep the error and the angle, to some percent; where none of those looked at keep both,
  // the largest angle within the error. A mesh may fail by bad luck: where the best one is far closer than it need be,
  // the search begins again below it.
  DecimateResult search(std::size_t count) {
    std::optional<DecimateResult> best, within;
    DecimateResult found;
    std::size_t fails = 0;
    std::size_t holds = mesh_.triangles.size() + 1;
    std::size_t looked_below = holds;
    std::size_t fewest_within = mesh_.triangles.size();
    int attempts = most_attempts;
    for (int step = 0; step < attempts; ++step) {
      count = std::clamp(count, fails + 1, std::max(fails + 1, holds - 1));
      found = attempt(std::min(count, mesh_.triangles.size()));
      advance(options_.progress, 0.1 + 0.9 * (step + 1) / attempts);
      if (found.error_kept && found.angle_held) {
        holds = std::min(count, found.mesh.triangles.size());
        best = found;
      } else {
        fails = count;
        if (found.error_kept && (!within || found.smallest_angle > within->smallest_angle)) {
          within = found;
        }
        fewest_within = found.error_kept ? std::min(fewest_within, count) : fewest_within;
      }
      // Where the error has long been kept, more triangles do not mend angles: they follow what is too thin for them.
      if (!best && fails > hopeless_count * fewest_within) {
        break;
      }
      count = grown(count, *found.error);
      const bool done = real(holds) < 1.04 * real(fails);
      if (done && best && best->error->upper < much_below * *options_.max_error && holds < looked_below) {
        looked_below = holds;
        attempts = step + 1 + attempts_below;
        fails = 0;
        count = grown(holds, *best->error);
      } else if (done || fails >= mesh_.triangles.size()) {
        break;
      } else if (fails > 0 && (count <= fails || count >= holds)) {
        count = truncated<std::size_t>(std::sqrt(real(fails) * real(holds)));
      }
    }
    if (best) {
      return *best;
    }
    // The mesh itself is a last resort.
    DecimateResult given;
    given.mesh = replay(mesh_, collapse_.history(), 0);
    measure(given);
    if (given.error_kept && given.angle_held) {
      return given;
    }
    return within ? std::move(*within) : std::move(found);
  }

  DecimateResult attempt(std::size_t count) {
    const auto& history = collapse_.history();
    const auto reached =
        std::find_if(history.begin(), history.end(), [&](const Collapse& c) { return c.triangles_left <= count; });
    const std::size_t steps = std::min(reached + 1, history.end()) - history.begin();
    const bool all_of_it = count >= mesh_.triangles.size();
    ShapingOptions shape;
    shape.min_angle = *options_.min_angle;
    shape.triangles = count;
    shape.sharp_corners = sharp_;
    if (!options_.max_error) {
      shape.progress = [&](double fraction) { advance(options_.progress, 0.1 + 0.9 * fraction); };
    }
    DecimateResult found;
    found.mesh = shaped(replay(mesh_, history, all_of_it ? 0 : steps), mesh_, tree_, shape);
    measure(found);
    return found;
  }

  void measure(DecimateResult& found) const {
    found.smallest_angle = smallest_free_angle(found.mesh, sharp_, *options_.min_angle);
    found.angle_held = found.smallest_angle >= *options_.min_angle;
    found.count_reached = !options_.triangles || found.mesh.triangles.size() <= *options_.triangles;
    if (options_.max_error) {
      found.error = hausdorff(ClosestPoint(found.mesh), tree_, distance_).both;
      found.error_kept = found.error->upper <= *options_.max_error;
    }
  }

  const TriangleMesh& mesh_;
  const DecimateOptions& options_;
  std::vector<SharpCorner> sharp_;
  ClosestPoint tree_;
  EdgeCollapse collapse_;
  HausdorffOptions distance_;
};

[[noreturn]] void refuse(const TriangleMesh& mesh) {
  if (const auto reason = why_unfit(examine(mesh))) {
    throw InputError(fmt::format("not an oriented manifold: {}", *reason));
  }
  throw InputError(diagonal(mesh) > 0 ? "its vertices are too far apart to reckon with"
                                      : "all its vertices lie in one point");
}

/// @param mesh  without degenerate triangles, but where they cannot go
DecimateResult decimate_sound(const TriangleMesh& mesh, const DecimateOptions& options) {
  const double share = real(options.triangles.value_or(0)) / real(mesh.triangles.size());
  const bool to_count = options.levelled && !options.max_error && !options.min_angle;
  EdgeCollapse collapse(mesh, options.min_angle          ? EdgeCollapse::Aim::good_shape
                              : to_count && share > much ? EdgeCollapse::Aim::few_collapses
                                                         : EdgeCollapse::Aim::least_error);
  if (!collapse.is_fit()) {
    refuse(mesh);
  }
  if (options.min_angle) {
    return ShapedSearch(mesh, options, std::move(collapse)).run();
  }
  const auto part = [&](double begin, double end) -> Progress {
    if (!options.progress) {
      return {};
    }
    return [&options, begin, end](double fraction) { options.progress(begin + (end - begin) * fraction); };
  };
  const double collapsing = options.max_error ? 0.2 : 0.8;
  collapse.run(options.triangles.value_or(0), part(0, collapsing), options.max_error.has_value());
  DecimateResult result;
  if (options.max_error) {
    result = ErrorSearch(mesh, collapse, *options.max_error, options.levelled).run(part(collapsing, 1));
  } else {
    const std::size_t steps = collapse.history().size();
    if (to_count && share <= much && steps > 0 && collapse.history().back().triangles_left <= *options.triangles) {
      collapse.run(truncated<std::size_t>((1 - more_collapses) * real(*options.triangles)), {});
      result.mesh = level(mesh, collapse, steps, false);
    } else {
      result.mesh = replay(mesh, collapse.history(), steps);
    }
    advance(options.progress, 1.0);
  }
  result.count_reached = !options.triangles || result.mesh.triangles.size() <= *options.triangles;
  return result;
}

}  // namespace

DecimateResult decimate(const TriangleMesh& mesh, const DecimateOptions& options) {
  if (options.max_error) {
    require_not_negative(*options.max_error, "the largest error");
  }
  if (options.min_angle && !(*options.min_angle >= 0 && *options.min_angle <= largest_min_angle)) {
    throw InputError(fmt::format("the smallest angle is {} degrees: it must be from 0 to {}", *options.min_angle,
                                 largest_min_angle));
  }
  const double size = diagonal(mesh);
  if (count_degenerate(mesh) == 0 || !(size > least_size && size < 1 / least_size) || why_unfit(examine(mesh))) {
    return decimate_sound(mesh, options);
  }
  if (count_degenerate(mesh) == mesh.triangles.size()) {
    throw InputError("all of its triangles are without area");
  }
  const double for_spikes = options.max_error ? most_for_spikes * *options.max_error : infinity;
  WithoutDegenerate cleaned = without_degenerate_triangles(mesh, for_spikes);
  DecimateOptions within = options;
  if (options.max_error) {
    within.max_error = std::max(0.0, *options.max_error - cleaned.moved);
  }
  if (options.min_angle && cleaned.long_spikes > 0) {
    // Angles and error cannot both hold: what comes back has the angles.
    const std::size_t too_long = cleaned.long_spikes;
    cleaned = without_degenerate_triangles(mesh, infinity);
    cleaned.long_spikes = too_long;
    within.max_error = options.max_error;
  }
  DecimateResult result = decimate_sound(cleaned.mesh, within);
  if (result.error) {
    result.error->lower = std::max(0.0, result.error->lower - cleaned.moved);
    result.error->upper += cleaned.moved;
    result.error_kept = result.error->upper <= *options.max_error;
  }
  if (options.min_angle && count_degenerate(result.mesh) > 0) {
    result.angle_held = false;
    result.smallest_angle = 0;
  }
  result.closed_loops = cleaned.closed_loops;
  result.longest_spike = cleaned.longest_spike;
  result.long_spikes = cleaned.long_spikes;
  return result;
}

}  // namespace tunica
