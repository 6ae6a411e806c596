#pragma once

#include "tunica/mechanics/runs/detail/run.hpp"

namespace tunica {

/// A run step by step: what load steps, time steps and paths share. The reference state, or what a checkpoint holds, is
/// where it begins; every step is timed, counted, handed over where it is wanted, and offered as a checkpoint.
class SteppedRun {
public:
  /// All steps. Errors: as take_step().
  Summary follow(const Progress& progress, const Resumption& resumption = {});

protected:
  /// @param most_steps  after which the run ends
  SteppedRun(ShellSystem& system, const RunSettings& settings, const StateCallback& on_state, std::size_t most_steps)
      : system_(system), model_(*system.model), settings_(settings), most_steps_(most_steps), on_state_(on_state) {}
  ~SteppedRun() = default;

  /// Makes ready for the first step. @return the reference state
  virtual State begin() = 0;
  /// Goes on from a checkpoint, whose summary has been taken; not where no step needs the one before.
  virtual void resume(const Checkpoint& /*from*/) {}
  /// Where the run is, but for its summary; not where a run is not resumed.
  [[nodiscard]] virtual Checkpoint checkpoint() const { return {}; }
  /// The next step. @return its state; without displacements where !wants_state(). Errors: RequirementError.
  virtual State take_step() = 0;
  [[nodiscard]] virtual double part_done() const;

  [[nodiscard]] State reference_state() const;
  /// A checkpoint with what every kind of run keeps: the configuration, what contact remembers.
  [[nodiscard]] Checkpoint keep(double position, const Configuration& configuration) const;
  /// The configuration of a checkpoint; contact remembers.
  [[nodiscard]] Configuration recall(const Checkpoint& from);
  [[nodiscard]] bool is_last() const { return ended_ || summary_.steps + 1 == most_steps_; }
  /// Whether the state of the step that is being taken is handed over.
  [[nodiscard]] bool wants_state() const { return (summary_.steps + 1) % settings_.every == 0 || is_last(); }
  void hand_over(const State& state);

  /// Tells whoever waits, once a run, that a step takes long; of models with contact.
  /// @param iterations  of Newton's method in this step; at  "load factor 0.2 of 1"; why  its parts are short, and
  /// where
  void tell_slow_step(std::size_t iterations, const std::string& at, const std::string& why);

  ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  const std::size_t most_steps_;
  Summary summary_;
  std::size_t shown_ = 0;  ///< steps done at the last state handed over
  bool ended_ = false;     ///< by the step that is being taken

private:
  std::function<void(const std::string&)> on_slow_step_;  ///< empty: nobody listens, or it was called
  const StateCallback& on_state_;
};

}  // namespace tunica
