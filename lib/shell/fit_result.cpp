#include "shell/fit_result.hpp"

#include "core/error.hpp"
#include "shell/boundary_distance.hpp"
#include "shell/curved_surface.hpp"
#include "shell/fit_parts.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/shell_distance.hpp"
#include "surface/decimate.hpp"
#include "surface/measure.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr double clearly_below = 0.998;
constexpr double noted_width = 1.5;    // of the error, on the way
constexpr double far_from_flat = 0.6;  // of the flat facets that the tolerance would take
constexpr std::array<double, 5> parts_for_boundaries{1, 0.7, 0.4, 0.2, 0.1};  // of the tolerance

}  // namespace

FitResult::FitResult(const Target& target, const RelaxOptions& options, double width, bool boundaries,
                     const Target* real)
    : target_(target),
      real_(real != nullptr ? *real : target),
      options_(options),
      width_(width),
      boundaries_(boundaries && target.boundary_tree()) {}

bool FitResult::certify(const FitState& state, std::optional<double> tolerance, bool list_beyond) {
  std::vector<Index> triangles;
  ShellMesh shell = state.mesh.shell(&triangles);
  ShellDistanceOptions measuring;
  measuring.width = std::max(width_, state.error() / 20);
  measuring.limit = tolerance;
  measuring.list_beyond = list_beyond;
  ShellDistance distance = shell_distance(shell, target_, measuring);
  if (tolerance && distance.both.lower <= clearly_below * *tolerance && distance.both.upper > *tolerance) {
    // An open question deserves a closer look, but where the answer would be a narrow one shells are mended sooner.
    measuring.width = std::min(*tolerance / 200, (*tolerance - distance.both.lower) / 2);
    distance = shell_distance(shell, target_, measuring);
  }
  farthest_.clear();
  if (distance.target_to_shell.lower > 0) {
    farthest_.push_back({distance.farthest_of_target});
  }
  for (const FarPlace& place : distance.beyond_of_target) {
    farthest_.push_back({place.point});
  }
  beyond_of_shell_ = std::move(distance.beyond_of_shell);
  for (FarPlace& place : beyond_of_shell_) {
    place.patch = triangles[place.patch];
  }
  least_distance_ = distance.both.lower;
  if (boundaries_) {
    const double width = tolerance ? std::min(measuring.width, *tolerance / 200) : measuring.width;
    if (const auto between = boundary_distance(boundary_curves(shell), target_, width, tolerance)) {
      distance.boundary = between->both;
      least_distance_ = std::max(least_distance_, between->both.lower);
      for (const Vec3& p : between->farthest) {
        farthest_.push_back({p, true});
      }
    }
  }
  const bool within = tolerance && distance.upper() <= *tolerance;
  const bool better =
      tolerance && holds(*tolerance) ? within && price(state) < price_ : distance.upper() < found.distance.upper();
  if (is_empty() || better) {
    take(std::move(shell), distance);
    price_ = price(state);
    mesh_ = state.mesh;
  }
  return within;
}

void FitResult::no_worse_than_flat(std::optional<double> tolerance, std::size_t most, const FitStart& start) {
  if (start.own_topology) {
    return;
  }
  const bool within = tolerance && holds(*tolerance);
  // Flat errors fall as 1 / count: far from that nothing needs to be tried.
  const double flat_count =
      tolerance ? static_cast<double>(start.mesh.triangles.size()) * start.flat_error / *tolerance : 0;
  if (within && static_cast<double>(found.shell.triangles.size()) < far_from_flat * flat_count) {
    return;
  }
  if (!tolerance && !is_empty() && found.distance.upper() < start.flat_error) {
    return;
  }
  DecimateOptions decimating;
  decimating.min_angle = options_.min_angle;
  if (!tolerance) {
    decimating.triangles = most;
  }
  // What decimation certifies is the distance of the surfaces: where boundaries are farther apart, with less of that.
  for (const double part : parts_for_boundaries) {
    if (tolerance) {
      decimating.max_error = part * *tolerance;
    }
    const DecimateResult flat = decimate(target_.mesh(), decimating);
    ShellMesh shell = flat_shells(flat.mesh, options_.surface);
    if (count_without_area(shell) > 0) {
      if (is_empty()) {
        throw InputError("too many triangles without area: no shells are left without them; make the surface anew");
      }
      return;
    }
    ShellDistance distance = distance_of(shell);
    if (flat.error) {
      lower_uppers(distance, *flat.error, *flat.error, *flat.error);
    }
    if (!is_empty() && !flat.angle_held) {
      return;
    }
    const bool flat_within = tolerance && distance.upper() <= *tolerance;
    const bool fewer = shell.triangles.size() < found.shell.triangles.size();
    const bool better = tolerance ? flat_within && (!within || fewer) : distance.upper() < found.distance.upper();
    if (is_empty() || better) {
      take(std::move(shell), distance);
      flat_ = true;
    }
    if (!tolerance || flat_within || (within && !fewer)) {
      return;
    }
  }
}

void FitResult::take(ShellMesh shell, const ShellDistance& distance) {
  found.shell = std::move(shell);
  found.distance = distance;
  mesh_.reset();
}

void FitResult::note(const FitState& state) {
  const ShellMesh shell = state.mesh.shell();
  ShellDistanceOptions measuring;
  measuring.width = std::max(width_, noted_width * state.error());
  record(shell, shell_distance(shell, real_, measuring).both);
}

void FitResult::record(const ShellMesh& shell, const Interval& distance) {
  RelaxIteration iteration;
  iteration.shells = shell.triangles.size();
  iteration.hausdorff = distance;
  iteration.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - last_).count();
  last_ = std::chrono::steady_clock::now();
  found.iterations.push_back(iteration);
  if (options_.on_iteration) {
    options_.on_iteration(iteration, shell);
  }
}

void FitResult::add_iterations(const std::vector<RelaxIteration>& of) {
  found.iterations.insert(found.iterations.end(), of.begin(), of.end());
  last_ = std::chrono::steady_clock::now();
}

ShellDistance FitResult::distance_of(const ShellMesh& shell, std::optional<double> limit) const {
  ShellDistanceOptions measuring;
  measuring.width = width_;
  measuring.limit = limit;
  ShellDistance distance = shell_distance(shell, target_, measuring);
  if (boundaries_) {
    if (const auto between = boundary_distance(boundary_curves(shell), target_, width_, limit)) {
      distance.boundary = between->both;
    }
  }
  return distance;
}

void lower_uppers(ShellDistance& distance, const Interval& both, const Interval& to_target, const Interval& to_shell) {
  distance.both.upper = std::min(distance.both.upper, both.upper);
  distance.shell_to_target.upper = std::min(distance.shell_to_target.upper, to_target.upper);
  distance.target_to_shell.upper = std::min(distance.target_to_shell.upper, to_shell.upper);
}

}  // namespace tunica
