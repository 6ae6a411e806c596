#include "fit/fit.hpp"

#include "core/error.hpp"
#include "fit/edits.hpp"
#include "fit/least_squares.hpp"
#include "fit/start.hpp"
#include "shell/boundary_distance.hpp"
#include "shell/curved_hausdorff.hpp"
#include "shell/refine.hpp"
#include "shell/shell_crossings.hpp"
#include "surface/checks.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace tunica {
namespace {

constexpr double default_width = 1e-4;  // of the diagonal: of certified intervals
constexpr double margin = 0.97;         // of the tolerance: what the samples may say, for they miss a little
constexpr double start_error = 1;       // of the tolerance: flat error of the mesh that the search starts from
constexpr double surplus = 1.5;         // of triangles at the start of a search for a count
constexpr double longest_edge = 3;      // of the mean: no region without nodes of its own
constexpr int mean_power = 2, largest_power = 4;  // of residuals: the mean counts, or the largest
constexpr int settling_steps = 6;
constexpr double eased_angle = 0.5;  // of the smallest angle, while edges collapse; mended afterwards
constexpr int mending_passes = 3;
constexpr double smoothing = 0.1;               // of the stiffness against sliding
constexpr int default_rounds = 12;              // of exchanges
constexpr double fewer_by = 0.92;               // of the shells: the next count to be tried
constexpr int certificates = 12, patience = 4;  // of these in a row that are no better
constexpr double worth_it = 0.985;              // a round that leaves more than this brings nothing
constexpr std::size_t fewest_sampled = 8;       // shells: as few want no fewer points of the target
constexpr std::array<double, 3> exchanged{1.0 / 40, 1.0 / 150, 1.0 / 15};  // of the shells, in a round

class Fitting {
public:
  Fitting(const TriangleMesh& coarse, const Target& target, const FitOptions& options)
      : coarse_(without_unused(coarse)),
        target_(target),
        options_(options),
        like_target_(same_topology(coarse_, target)) {
    limits_.shape.min_angle = options.min_angle;
    rounds_ = options.max_iterations.value_or(default_rounds);
    width_ = options.width.value_or(default_width * target.diagonal());
    if (options.tolerance) {
      width_ = std::min(width_, *options.tolerance / 100);
    }
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
  [[nodiscard]] std::size_t most() const {
    return options_.max_shells.value_or(options_.tolerance ? options_.shells.value_or(max_index) : max_index);
  }

  [[nodiscard]] FitMesh started(const TriangleMesh& mesh) const {
    return FitMesh(shells_on(target_, mesh, options_.surface));
  }

  [[nodiscard]] FitSamples samples_for(double shells) const {
    return {target_, std::max(fewest_sampled, static_cast<std::size_t>(shells)), like_target_};
  }

  /// Least squares of all nodes. @return the largest error left, mm
  double settle(FitMesh& mesh, const FitSamples& samples, int power, int steps) const {
    samples.attach(mesh);
    double error = samples.measure(mesh);
    for (int i = 0; i < steps; ++i) {
      SquaresOptions squares;
      squares.shape = limits_.shape;
      squares.power = power;
      squares.smoothing = power == mean_power ? smoothing : 0;
      const double left = least_squares_step(mesh, samples, squares);
      samples.attach(mesh);
      error = samples.measure(mesh);
      if (left > worth_it) {
        break;
      }
    }
    return error;
  }

  void improve(FitMesh& mesh, const FitSamples& samples) {
    limits_.shape.longest = longest_edge * mesh.mean_edge();
    flip_edges(mesh, samples, limits_);
    for (int pass = 0; pass < mending_passes; ++pass) {
      mend_shapes(mesh, samples, limits_, most());
    }
  }

  /// Certifies, keeps what is better, and notes it.
  ShellDistance certified(const ShellMesh& shell) {
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
    crossings_ = crossing_patches(shell);
    const bool holds = options_.tolerance && distance.upper() <= *options_.tolerance;
    const auto rank = std::array{holds ? 1.0 : 0.0, crossings_.empty() ? 1.0 : 0.0,
                                 holds ? -static_cast<double>(shell.triangles.size()) : -distance.upper()};
    const bool is_better = result_.shell.triangles.empty() || rank > rank_;
    if (is_better) {
      result_.shell = shell;
      result_.distance = distance;
      rank_ = rank;
      if (options_.tolerance) {
        result_.reached = holds;
      }
    }
    const auto now = std::chrono::steady_clock::now();
    result_.iterations.push_back(
        {shell.triangles.size(), distance.both, std::chrono::duration<double>(now - last_).count(), {}});
    last_ = now;
    if (options_.on_iteration) {
      options_.on_iteration(result_.iterations.back(), result_.shell);
    }
    return distance;
  }

  void to_tolerance(double tolerance) {
    limits_.error = margin * tolerance;
    const bool keep_coarse = options_.refine || !like_target_;
    TriangleMesh start = keep_coarse ? coarse_ : decimation_within(target_, start_error * tolerance);
    if (const double enough = surplus * static_cast<double>(most());
        !keep_coarse && static_cast<double>(start.triangles.size()) > enough) {
      start = decimation(target_, static_cast<std::size_t>(enough));
    }
    FitMesh mesh = started(start);
    FitSamples samples = samples_for(static_cast<double>(mesh.alive) / (keep_coarse ? 1 : 3));
    settle(mesh, samples, mean_power, 4);
    improve(mesh, samples);
    if (options_.refine) {
      settle(mesh, samples, mean_power, 2);
    } else {
      fewer(mesh, samples);
      if (mesh.alive > most()) {
        reduce(mesh, samples, most());
        limits_.error = margin * tolerance;
      }
    }
    make_certain(mesh, samples, tolerance);
  }

  /// Collapses and settles in turn as long as that leaves fewer shells; then as many fewer as exchanges make good.
  void fewer(FitMesh& mesh, const FitSamples& samples) {
    const double limit = limits_.error;
    for (int round = 0; round < 3; ++round) {
      const std::size_t before = mesh.alive;
      limits_.shape.min_angle = eased_angle * options_.min_angle;
      collapse_edges(mesh, samples, limits_, 4, options_.progress);
      limits_.shape.min_angle = options_.min_angle;
      settle(mesh, samples, largest_power, settling_steps);
      improve(mesh, samples);
      if (static_cast<double>(mesh.alive) > worth_it * static_cast<double>(before)) {
        break;
      }
    }
    while (rounds_ > 0) {
      FitMesh other = mesh;
      const auto shells = static_cast<std::size_t>(fewer_by * static_cast<double>(mesh.alive));
      reduce(other, samples, shells);
      if (exchange(other, samples, shells, limit) > limit || other.alive >= mesh.alive) {
        break;
      }
      mesh = std::move(other);
    }
    limits_.error = limit;
  }

  /// What the samples miss is found by a certificate, added to them, and mended; where that does not do, split.
  void make_certain(FitMesh& mesh, FitSamples& samples, double tolerance) {
    result_.stopped = "further splits bring too little";
    std::size_t crossed = std::numeric_limits<std::size_t>::max();
    double closest = std::numeric_limits<double>::infinity();
    int fruitless = 0;  // certificates in a row
    for (int i = 0; i < certificates && fruitless < patience; ++i) {
      std::vector<Index> patch_of;
      const ShellDistance distance = certified(mesh.shell(&patch_of));
      if (distance.upper() <= tolerance) {
        result_.stopped = "the tolerance holds";
        if (crossings_.empty() || crossings_.size() >= crossed) {
          return;
        }
        crossed = crossings_.size();
      } else {
        crossings_.clear();  // first things first
        fruitless = distance.upper() < worth_it * closest ? 0 : fruitless + 1;
        closest = std::min(closest, distance.upper());
      }
      for (const FarPlace& place : distance.beyond_of_target) {
        samples.add({place.point});
      }
      settle(mesh, samples, largest_power, 2);
      if (i > 0) {
        for (const FarPlace& place : distance.beyond_of_shell) {
          double& error = mesh.patches[patch_of[place.patch]].error;
          error = std::max(error, place.distance);
        }
      }
      for (const auto& pair : crossings_) {
        for (const Index patch : pair) {
          double& error = mesh.patches[patch_of[patch]].error;
          error = std::max(error, 2 * limits_.error);  // finer ones follow the target between its walls
        }
      }
      if (mesh.alive >= most()) {
        if (!result_.reached.value_or(false)) {
          result_.stopped = "the limit of shells was reached";
        }
        return;
      }
      split_worst(mesh, samples, limits_, std::min((most() - mesh.alive) / 2, mesh.alive / 4 + fewest_sampled));
      settle(mesh, samples, largest_power, 2);
      improve(mesh, samples);
    }
  }

  /// Collapses edges until so many shells are left, whatever the error, and settles. @return the largest error, mm
  double reduce(FitMesh& mesh, const FitSamples& samples, std::size_t shells) {
    limits_.shape.longest =
        longest_edge * mesh.mean_edge() * std::sqrt(static_cast<double>(mesh.alive) / static_cast<double>(shells));
    limits_.error = std::numeric_limits<double>::infinity();
    collapse_edges(mesh, samples, limits_, shells, options_.progress);
    if (mesh.alive > shells) {  // a count outweighs shapes
      FitLimits any = limits_;
      any.may_miss = std::numeric_limits<double>::infinity();
      collapse_edges(mesh, samples, any, shells, options_.progress);
    }
    limits_.error = settle(mesh, samples, largest_power, 4);
    flip_edges(mesh, samples, limits_);
    mend_shapes(mesh, samples, limits_, shells);
    return settle(mesh, samples, largest_power, 1);
  }

  /// Moves shells from where they are hardly needed to where the error is largest, as long as that brings them closer,
  /// they are not within `enough` (mm), and rounds are left.
  /// @return the largest error, mm
  double exchange(FitMesh& mesh, const FitSamples& samples, std::size_t shells, double enough) {
    double error = samples.measure(mesh);
    std::size_t fruitless = 0;
    while (error > enough && rounds_ > 0 && fruitless < exchanged.size()) {
      --rounds_;
      FitMesh other = mesh;
      limits_.error = error / 2;
      const double many = exchanged[fruitless] * static_cast<double>(shells);
      split_worst(other, samples, limits_, std::max<std::size_t>(1, static_cast<std::size_t>(many)));
      const double now = reduce(other, samples, shells);
      fruitless = other.alive <= shells && now < worth_it * error ? 0 : fruitless + 1;
      if (other.alive <= shells && now < error) {
        mesh = std::move(other);
        error = now;
      }
    }
    result_.stopped = rounds_ > 0 ? "further rounds bring too little" : "the limit of rounds was reached";
    return error;
  }

  void to_count(std::size_t shells) {
    FitMesh mesh = started(
        like_target_ ? decimation(target_, static_cast<std::size_t>(surplus * static_cast<double>(shells))) : coarse_);
    const FitSamples samples = samples_for(static_cast<double>(shells));
    settle(mesh, samples, mean_power, 3);
    if (mesh.alive > shells) {
      reduce(mesh, samples, shells);
      exchange(mesh, samples, shells, 0);
    } else {
      result_.stopped = "the surface has no more triangles than shells are allowed";
    }
    certified(mesh.shell());
  }

  void split_everywhere() {
    FitMesh mesh = started(coarse_);
    FitSamples samples = samples_for(static_cast<double>(mesh.alive));
    limits_.error = settle(mesh, samples, mean_power, 3);
    improve(mesh, samples);
    settle(mesh, samples, mean_power, 2);
    ShellMesh shell = mesh.shell();
    certified(shell);
    result_.stopped = "the limit of iterations was reached";
    for (int level = 1; level < options_.max_iterations.value_or(std::numeric_limits<int>::max()); ++level) {
      if (4 * shell.triangles.size() > most()) {
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
  double width_;
  FitLimits limits_;
  int rounds_;  // of exchanges that are left
  RelaxResult result_;
  std::array<double, 3> rank_{};                 // of the result: see certified()
  std::vector<std::array<Index, 2>> crossings_;  // of the shells that were certified last
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

RelaxResult fit(const TriangleMesh& coarse, const Target& target, const FitOptions& options) {
  return Fitting(coarse, target, options).run();
}

ShellMesh refit(const ShellMesh& shell, const Target& target, double min_angle) {
  FitMesh mesh(split_shells(shell, std::vector<Split>(shell.triangles.size(), Split::all_edges)));
  const FitSamples samples(target, mesh.alive, true);
  SquaresOptions squares;
  squares.shape.min_angle = min_angle;
  for (int step = 0; step < 2; ++step) {
    samples.attach(mesh);
    samples.measure(mesh);
    least_squares_step(mesh, samples, squares);
  }
  return mesh.shell();
}

void fit_normals(const Target& target, ShellMesh& shell) {
  FitMesh mesh(shell);
  const FitSamples samples(target, mesh.alive, true);
  SquaresOptions squares;
  squares.positions = false;
  for (const int power : {mean_power, largest_power, largest_power}) {
    samples.attach(mesh);
    samples.measure(mesh);
    squares.power = power;
    least_squares_step(mesh, samples, squares);
  }
  for (std::size_t s = 0; s < mesh.normals.size(); ++s) {
    shell.normals[mesh.node_of_slot[s]] = mesh.normals[s];
  }
}

}  // namespace tunica
