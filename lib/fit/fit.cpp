#include "tunica/fit/fit.hpp"

#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/fit/detail/edits.hpp"
#include "tunica/fit/detail/least_squares.hpp"
#include "tunica/fit/detail/start.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/distance/curved_hausdorff.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/shell/patch/refine.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double margin = 0.97;      // of the tolerance: what the samples may say, for they miss a little
constexpr double surplus = 1.5;      // of triangles at the start of a search for a count
constexpr double longest_edge = 2;   // of the mean: no region without nodes of its own
constexpr double fewest_across = 4;  // of the longest edges: along a square of the surface's area, likewise
constexpr int passes = 3;            // of collapses, of mending, steps of settling: the last bring hardly anything
constexpr int default_rounds = 12;   // of exchanges
constexpr double fewer_by = 0.92;    // of the shells: the next count to be tried
constexpr int certificates = 16;     // each followed by splits
constexpr int attempts = 5;          // at a tolerance, from ever finer triangles:
constexpr double tighter = 0.5;      // of what the attempt before had to keep
constexpr int patience = 3;          // rounds in a row that bring nothing
constexpr std::size_t fewest_sampled = 8;  // shells: as few want no fewer points of the target
constexpr double exchange_share = 0.05;    // of the shells, in a round; half as many where that brought nothing

/// Certifies shells, says what is wrong with them, and keeps the best.
class Certifier {
public:
  Certifier(const Target& target, const FitOptions& options, bool like_target)
      : target_(target),
        options_(options),
        like_target_(like_target),
        width_(options.width.value_or(default_width * target.diagonal())) {
    if (options.tolerance) {
      width_ = std::min(width_, *options.tolerance / 100);
    }
  }

  /// @param result gets an iteration, and the shell when it is better than the one there
  ShellDistance certified(const ShellMesh& shell, RelaxResult& result) {
    ShellDistanceOptions measuring;
    measuring.width = width_;
    measuring.limit = options_.tolerance;
    measuring.list_beyond = options_.tolerance.has_value();
    ShellDistance distance = curved_hausdorff(shell, target_, measuring);
    if (like_target_) {
      if (const auto between = boundary_distance(boundary_curves(shell), target_, width_, options_.tolerance)) {
        distance.boundary = between->both;
      }
    }
    crossings = crossing_patches(shell);
    thin = thin_triangles(shell);
    const bool holds = options_.tolerance && distance.upper() <= *options_.tolerance;
    const auto rank = std::array{holds ? 1.0 : 0.0, crossings.empty() ? 1.0 : 0.0,
                                 holds ? -real(thin.size()) : -distance.upper(), -real(shell.triangles.size())};
    if (result.shell.triangles.empty() || rank > rank_) {
      result.shell = shell;
      result.distance = distance;
      rank_ = rank;
      if (options_.tolerance) {
        result.reached = holds;
      }
    }
    result.iterations.push_back({shell.triangles.size(), distance.both, seconds_since(last_), {}});
    last_ = Clock::now();
    if (options_.on_iteration) {
      options_.on_iteration(result.iterations.back(), result.shell);
    }
    return distance;
  }

  /// Of the best.
  [[nodiscard]] bool holds_without_crossings() const { return rank_[0] == 1 && rank_[1] == 1; }

  std::vector<std::array<Index, 2>> crossings;  // of the shells that were certified last: pairs
  std::vector<Index> thin;                      // likewise: below the smallest angle

private:
  [[nodiscard]] std::vector<Index> thin_triangles(const ShellMesh& shell) const {
    const double least = (1 - std::sqrt(negligible_shortfall)) * options_.min_angle;
    std::vector<Index> out;
    for (Index t = 0; t < shell.triangles.size(); ++t) {
      const auto& [a, b, c] = shell.triangles[t];
      if (smallest_angle_degrees(shell.vertices[a], shell.vertices[b], shell.vertices[c]) < least) {
        out.push_back(t);
      }
    }
    return out;
  }

  const Target& target_;
  const FitOptions& options_;
  bool like_target_;
  double width_;
  std::array<double, 4> rank_{};  // of the best
  Clock::time_point last_ = Clock::now();
};

class Fitting {
public:
  Fitting(const TriangleMesh& coarse, const Target& target, const FitOptions& options)
      : coarse_(without_unused(coarse)),
        target_(target),
        options_(options),
        like_target_(same_topology(coarse_, target)),
        best_(target, options, like_target_) {
    limits_.shape.min_angle = options.min_angle;
    const bool is_limit = options.tolerance || options.refine;
    most_ = options.max_shells.value_or(is_limit ? options.shells.value_or(max_index) : max_index);
    rounds_ = options.max_iterations.value_or(default_rounds);
  }

  RelaxResult run() {
    if (options_.refine && !options_.tolerance) {
      split_everywhere();
    } else if (options_.tolerance) {
      to_tolerance(*options_.tolerance);
    } else {
      to_count(options_.shells.value_or(coarse_.triangles.size()));
    }
    return std::move(result_);
  }

private:
  [[nodiscard]] FitSamples samples_for(double shells) const {
    return {target_, std::max(fewest_sampled, truncated<std::size_t>(shells)), like_target_};
  }

  enum class Lessened { mean, largest };

  /// Least squares of all nodes. @return the largest error left, mm
  double settle(FitMesh& mesh, const FitSamples& samples, Lessened what) const {
    double error = measured(mesh, samples);
    SquaresOptions squares;
    squares.shape = limits_.shape;
    squares.largest = what == Lessened::largest;
    squares.smooth = what == Lessened::mean;
    for (int i = 0; i < passes; ++i) {
      const double left = least_squares_step(mesh, samples, squares);
      error = measured(mesh, samples);
      if (left > worth_it) {
        break;
      }
    }
    return error;
  }

  static double measured(FitMesh& mesh, const FitSamples& samples) {
    samples.attach(mesh);
    return samples.measure(mesh);
  }

  /// As they should be with so many shells; while the fewest are looked for, whatever their mean is.
  void limit_lengths(const FitMesh& mesh, std::size_t shells) {
    const double mean = mesh.mean_edge() * std::sqrt(real(mesh.alive) / real(shells));
    limits_.shape.longest = std::sqrt(mesh.area()) / fewest_across;
    if (!options_.tolerance || options_.refine) {
      limits_.shape.longest = std::min(limits_.shape.longest, longest_edge * mean);
    }
  }

  /// What is to be fitted. Folds of the decimation are mended where no error gets larger than the largest; what is left
  /// of them gets creases.
  FitMesh started(const TriangleMesh& coarse, const FitSamples& samples) {
    FitMesh mesh(shells_on(target_, coarse, options_.surface));
    if (!(mesh.area() > 1e-12 * target_.diagonal() * target_.diagonal())) {
      throw InputError("all of its triangles are without area");
    }
    limit_lengths(mesh, mesh.alive);
    FitLimits limits = limits_;
    limits.error = std::max(limits_.error, measured(mesh, samples));
    for (int pass = 0; pass < passes; ++pass) {
      mend_shapes(mesh, samples, limits, most_, no_shell);
    }
    return FitMesh(creased_where_folded(mesh.shell()));
  }

  /// Flips and mends, with at most so many shells.
  void improve(FitMesh& mesh, const FitSamples& samples, std::size_t most, bool may_collapse = true) {
    limit_lengths(mesh, mesh.alive);
    flip_edges(mesh, samples, limits_);
    for (int pass = 0; pass < passes; ++pass) {
      mend_shapes(mesh, samples, limits_, most, 0, may_collapse);
    }
  }

  /// Certifies, and keeps what is better.
  ShellDistance certified(const ShellMesh& shell) { return best_.certified(shell, result_); }

  void to_tolerance(double tolerance) {
    const bool keep_coarse = options_.refine || !like_target_;
    double within = tolerance;  // what coarse triangles have lost of a spike or fold no split brings back
    for (int attempt = 0; attempt < attempts && !best_.holds_without_crossings(); ++attempt, within *= tighter) {
      limits_.error = margin * within;
      const TriangleMesh start = keep_coarse ? coarse_ : decimation_within(target_, within);
      FitSamples samples = samples_for(real(start.triangles.size()) / (keep_coarse ? 1 : 3));
      FitMesh mesh = started(start, samples);
      settle(mesh, samples, Lessened::mean);
      improve(mesh, samples, most_);
      if (options_.refine) {
        settle(mesh, samples, Lessened::mean);
        make_certain(mesh, samples, tolerance);
        return;
      }
      const std::size_t allowed = most_;
      most_ = max_index;  // the fewest may be few enough, though more are on the way
      fewer(mesh, samples);
      most_ = allowed;
      if (mesh.alive > allowed) {
        closest(mesh, samples, allowed, 0);
        certified(mesh.shell());
        result_.stopped = "the limit of shells was reached";
        return;
      }
      make_certain(mesh, samples, tolerance);
    }
    if (result_.reached.value_or(false)) {  // by an attempt before the last
      result_.stopped = "the tolerance holds";
    }
  }

  /// Collapses and settles in turn as long as that leaves fewer shells; then as many fewer as exchanges make good.
  void fewer(FitMesh& mesh, const FitSamples& samples) {
    const double limit = limits_.error;
    for (int round = 0; round < passes; ++round) {
      const std::size_t before = mesh.alive;
      collapse_edges(mesh, samples, limits_, 4, options_.progress);
      settle(mesh, samples, Lessened::largest);
      improve(mesh, samples, most_);
      if (real(mesh.alive) > worth_it * real(before)) {
        break;
      }
    }
    while (rounds_ > 0) {
      FitMesh other = mesh;
      const auto shells = truncated<std::size_t>(fewer_by * real(mesh.alive));
      if (closest(other, samples, shells, limit) > limit || other.alive >= mesh.alive) {
        break;
      }
      mesh = std::move(other);
    }
    limits_.error = limit;
  }

  /// How far a certificate found each patch to be, mm, 0 within the limit.
  /// @param around  patches that meet one as far off as it is
  static std::vector<double> far_by_patch(const FitMesh& mesh, const ShellDistance& distance,
                                          const std::vector<Index>& patch_of, bool around) {
    std::vector<double> far(mesh.patches.size(), 0);
    for (const auto* places : {&distance.beyond_of_shell, &distance.beyond_of_target}) {
      for (const FarPlace& place : *places) {
        far[patch_of[place.patch]] = std::max(far[patch_of[place.patch]], place.distance);
      }
    }
    const std::vector<double> own = far;
    for (std::size_t t = 0; around && t < own.size(); ++t) {
      for (std::size_t k = 0; own[t] > 0 && k < 3; ++k) {
        for (const Index other : mesh.around[mesh.patches[t].nodes[k]]) {
          far[other] = std::max(far[other], own[t]);
        }
      }
    }
    return far;
  }

  /// What the samples miss is found by a certificate, added to them, and mended; where that does not do, split; where
  /// that was in vain twice, with what lies around, and nothing is collapsed for shapes.
  void make_certain(FitMesh& mesh, FitSamples& samples, double tolerance) {
    result_.stopped = "further splits bring too little";
    std::size_t fewest_faults = std::numeric_limits<std::size_t>::max();
    double closest = infinity, seen = infinity;
    int fruitless = 0;  // certificates in a row
    for (int i = 0; i < certificates && fruitless <= patience; ++i) {
      std::vector<Index> patch_of;
      const ShellDistance distance = certified(mesh.shell(&patch_of));
      if (distance.upper() <= tolerance) {
        result_.stopped = "the tolerance holds";
        const std::size_t faults = best_.crossings.size() + best_.thin.size();
        if (faults == 0) {
          return;
        }
        fruitless = faults < fewest_faults ? 0 : fruitless + 1;
        fewest_faults = std::min(fewest_faults, faults);
      } else {
        best_.crossings.clear();  // first things first
        best_.thin.clear();
        if (i >= patience && distance.both.lower > out_of_reach * tolerance) {
          return;
        }
        const bool helped = distance.upper() < worth_it * closest || distance.both.lower < worth_it * seen;
        fruitless = helped ? 0 : fruitless + 1;
        closest = std::min(closest, distance.upper());
        seen = std::min(seen, distance.both.lower);
      }
      for (const FarPlace& place : distance.beyond_of_target) {
        samples.add({place.point});
      }
      settle(mesh, samples, Lessened::largest);
      // The certificate says where: samples alone see errors, too, where the target itself is rough. Of boundaries as
      // curves it says nothing; and where it was said in vain all is tried.
      const bool in_vain = fruitless > 1;
      const std::vector<double> far = far_by_patch(mesh, distance, patch_of, in_vain);
      for (std::size_t t = 0; t < mesh.patches.size(); ++t) {
        double& error = mesh.patches[t].error;
        const bool is_known = mesh.patches[t].boundary == 0 && !in_vain;
        error = std::max(is_known ? std::min(error, limits_.error) : error, far[t]);
      }
      // Finer ones follow the target between its walls, and leave room for better shapes.
      const auto wants_splits = [&](Index patch) {
        double& error = mesh.patches[patch_of[patch]].error;
        error = std::max(error, 2 * limits_.error);
      };
      for (const auto& pair : best_.crossings) {
        wants_splits(pair[0]);
        wants_splits(pair[1]);
      }
      std::for_each(best_.thin.begin(), best_.thin.end(), wants_splits);
      if (mesh.alive >= most_) {
        if (!result_.reached.value_or(false)) {
          result_.stopped = "the limit of shells was reached";
        }
        return;
      }
      split_worst(mesh, samples, limits_, std::min((most_ - mesh.alive) / 2, mesh.alive / 4 + fewest_sampled));
      settle(mesh, samples, Lessened::largest);
      improve(mesh, samples, most_, !in_vain);
    }
  }

  /// Collapses edges until so many shells are left, whatever the error, and settles. @return the largest error, mm
  double reduce(FitMesh& mesh, const FitSamples& samples, std::size_t shells) {
    limit_lengths(mesh, shells);
    limits_.error = infinity;
    collapse_edges(mesh, samples, limits_, shells, options_.progress);
    if (mesh.alive > shells) {  // a count outweighs shapes
      FitLimits any = limits_;
      any.may_miss = no_shell / 2;
      collapse_edges(mesh, samples, any, shells, options_.progress);
    }
    limits_.error = settle(mesh, samples, Lessened::largest);
    flip_edges(mesh, samples, limits_);
    mend_shapes(mesh, samples, limits_, shells);
    return settle(mesh, samples, Lessened::largest);
  }

  /// Reduces to so many shells; then moves some from where they are hardly needed to where the error is largest, as
  /// long as that brings them closer, they are not within `enough` (mm), and rounds are left.
  /// @return the largest error, mm
  double closest(FitMesh& mesh, const FitSamples& samples, std::size_t shells, double enough) {
    double error = reduce(mesh, samples, shells);
    double share = exchange_share;
    for (int fruitless = 0; error > enough && rounds_ > 0 && fruitless < patience;) {
      --rounds_;
      FitMesh other = mesh;
      limits_.error = error / 2;
      const double many = share * real(shells);
      split_worst(other, samples, limits_, std::max<std::size_t>(1, truncated<std::size_t>(many)));
      const double now = reduce(other, samples, shells);
      const bool helped = other.alive <= shells && now < worth_it * error;
      fruitless = helped ? 0 : fruitless + 1;
      share = helped ? share : share / 2;
      if (other.alive <= shells && now < error) {
        mesh = std::move(other);
        error = now;
      }
    }
    result_.stopped = rounds_ > 0 ? "further rounds bring too little" : "the limit of rounds was reached";
    return error;
  }

  void to_count(std::size_t shells) {
    const FitSamples samples = samples_for(real(shells));
    FitMesh mesh =
        started(like_target_ ? decimation(target_, truncated<std::size_t>(surplus * real(shells))) : coarse_, samples);
    settle(mesh, samples, Lessened::mean);
    if (mesh.alive > shells) {
      limits_.error = closest(mesh, samples, shells, 0);
      improve(mesh, samples, shells);
      settle(mesh, samples, Lessened::largest);
    } else {
      result_.stopped = "the surface has no more triangles than shells are allowed";
    }
    certified(mesh.shell());
  }

  void split_everywhere() {
    const FitSamples samples = samples_for(real(coarse_.triangles.size()));
    FitMesh mesh = started(coarse_, samples);
    limits_.error = settle(mesh, samples, Lessened::mean);
    improve(mesh, samples, most_);
    settle(mesh, samples, Lessened::mean);
    ShellMesh shell = mesh.shell();
    certified(shell);
    result_.stopped = "the limit of iterations was reached";
    for (int level = 1; level < options_.max_iterations.value_or(std::numeric_limits<int>::max()); ++level) {
      if (4 * shell.triangles.size() > most_) {
        result_.stopped = "the limit of shells was reached";
        break;
      }
      tunica::advance(options_.progress, 0);
      shell = refit(shell, target_, options_.min_angle);
      result_.shell = {};  // the last level is what is asked for
      certified(shell);
    }
  }

  TriangleMesh coarse_;
  const Target& target_;
  const FitOptions& options_;
  bool like_target_;  // COARSE has the target's topology: its boundaries are the target's
  Certifier best_;
  FitLimits limits_;
  std::size_t most_;  // shells
  int rounds_;        // of exchanges that are left
  RelaxResult result_;
};

void require_min_angle(double degrees) {
  if (!(degrees >= 1 && degrees <= 30)) {
    throw InputError(fmt::format("angles of {} degrees cannot be kept: choose 1 to 30", degrees));
  }
}

}  // namespace

RelaxResult fit(const TriangleMesh& coarse, const Target& target, const FitOptions& options) {
  require_surface(coarse);
  require_valid(options);
  require_min_angle(options.min_angle);
  return Fitting(coarse, target, options).run();
}

ShellMesh refit(const ShellMesh& shell, const Target& target, double min_angle,
                std::vector<std::array<Index, 2>>* halved) {
  require_shells(shell);
  require_min_angle(min_angle);
  FitMesh mesh(split_shells(shell, std::vector<Split>(shell.triangles.size(), Split::all_edges), halved));
  const FitSamples samples(target, mesh.alive, true);
  SquaresOptions squares;
  squares.shape.min_angle = min_angle / 2;  // quarters have the angles of the whole: without room they cannot follow
  FitLimits limits;
  limits.shape = squares.shape;
  limits.error = infinity;
  for (int step = 0; step < 2; ++step) {
    samples.attach(mesh);
    samples.measure(mesh);
    least_squares_step(mesh, samples, squares);
    mend_shapes(mesh, samples, limits, mesh.alive, no_shell / 2, false);  // what the splits have folded
  }
  return creased_where_folded(mesh.shell());
}

void fit_normals(const Target& target, ShellMesh& shell) {
  require_shells(shell);
  if (!shell.corner_normals.empty()) {
    throw InputError("normals at corners cannot be fitted: take those of the target, one at each vertex");
  }
  FitMesh mesh(shell);
  const FitSamples samples(target, mesh.alive, true);
  SquaresOptions squares;
  squares.positions = false;
  for (const bool largest : {false, true, true}) {
    samples.attach(mesh);
    samples.measure(mesh);
    squares.largest = largest;
    least_squares_step(mesh, samples, squares);
  }
  for (std::size_t s = 0; s < mesh.normals.size(); ++s) {
    shell.normals[mesh.node_of_slot[s]] = mesh.normals[s];
  }
}

}  // namespace tunica
