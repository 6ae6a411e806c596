#pragma once

#include "shell/fit_start.hpp"
#include "shell/fit_state.hpp"
#include "shell/relax.hpp"

#include <chrono>
#include <optional>

namespace tunica {

/// The best shells of a fit so far, what is certain of their distance to the target, and what was noted on the way.
class FitResult {
public:
  /// @param options  of the whole fit: surface, on_iteration; they and the target must live as long
  /// @param width       mm: of certified intervals
  /// @param boundaries  whether the shells' boundary is to be the target's: then the tolerance holds for it as well
  /// @param real  the surface that `target` stands for: what is noted is measured against that
  FitResult(const Target& target, const RelaxOptions& options, double width, bool boundaries,
            const Target* real = nullptr);

  [[nodiscard]] bool is_empty() const { return found.shell.triangles.empty(); }
  /// Whether there are shells, certainly within the tolerance, mm.
  [[nodiscard]] bool holds(double tolerance) const { return !is_empty() && found.distance.upper() <= tolerance; }
  [[nodiscard]] double width() const { return width_; }
  /// The shells as they were under edit, where they came so.
  [[nodiscard]] const std::optional<FitMesh>& mesh() const { return mesh_; }
  /// Whether the shells are the target's flat facets.
  [[nodiscard]] bool is_flat() const { return flat_; }

  /// Takes the mesh when it is better: to a tolerance (mm) cheaper within it, see price(), else closer.
  /// @return whether the tolerance certainly holds
  /// @param list_beyond  whether farthest() and beyond_of_shell() are to tell of all patches beyond the tolerance
  bool certify(const FitState& state, std::optional<double> tolerance, bool list_beyond = false);

  /// Flat facets instead, where they do better: fewer within the tolerance (mm), or closer with at most so many.
  /// Errors: InputError where nothing else was found and facets have no area.
  void no_worse_than_flat(std::optional<double> tolerance, std::size_t most, const FitStart& start);

  void take(ShellMesh shell, const ShellDistance& distance);

  /// Certifies shells, roughly, for the record alone.
  void note(const FitState& state);
  void record(const ShellMesh& shell, const Interval& distance);

  /// Adds what another fit noted, whose time is not to be counted again.
  void add_iterations(const std::vector<RelaxIteration>& of);

  /// The certified distance of shells, mm, with that of the boundaries where it counts.
  /// @param limit  mm: see ShellDistanceOptions
  [[nodiscard]] ShellDistance distance_of(const ShellMesh& shell, std::optional<double> limit = {}) const;

  /// Where on the target the largest distances were, when last certified; none where that was not looked for.
  [[nodiscard]] const std::vector<SamplePoint>& farthest() const { return farthest_; }
  /// Places of the mesh under edit beyond the tolerance, where they were to be listed when last certified.
  [[nodiscard]] const std::vector<FarPlace>& beyond_of_shell() const { return beyond_of_shell_; }
  /// mm: what the last certified distance certainly is at least.
  [[nodiscard]] double least_distance() const { return least_distance_; }

  RelaxResult found;

private:
  const Target& target_;
  const Target& real_;
  const RelaxOptions& options_;
  double width_;
  bool boundaries_;
  std::size_t price_ = 0;  // of what was found
  std::optional<FitMesh> mesh_;
  bool flat_ = false;
  std::vector<SamplePoint> farthest_;
  std::vector<FarPlace> beyond_of_shell_;  // patches of the mesh under edit
  double least_distance_ = 0;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// What is certain of a distance from elsewhere.
void lower_uppers(ShellDistance& distance, const Interval& both, const Interval& to_target, const Interval& to_shell);

}  // namespace tunica
