#include "tunica/mechanics/runs/detail/stepped_run.hpp"

#include "tunica/core/clock.hpp"
#include "tunica/core/narrow.hpp"

namespace tunica {

Summary SteppedRun::follow(const Progress& progress, const Resumption& resumption) {
  if (resumption.from) {
    summary_ = resumption.from->summary;
    if (summary_.stiffened_from) {
      stiffen_short_waves(system_);
    }
    shown_ = summary_.steps / settings_.every * settings_.every;
    resume(*resumption.from);
  } else {
    const State state = begin();
    hand_over(state);
    summary_.volume_before = state.volume;
    summary_.volume_after = state.volume;
  }
  while (!ended_ && summary_.steps < most_steps_) {
    const auto start = Clock::now();
    const State state = take_step();
    const bool wanted = wants_state();
    record_step(state, seconds_since(start), summary_);
    if (wanted) {
      hand_over(state);
    }
    resumption.offer([&] {
      Checkpoint made = checkpoint();
      made.summary = summary_;
      return made;
    });
    advance(progress, part_done());
  }
  return summary_;
}

double SteppedRun::part_done() const { return real(summary_.steps) / real(most_steps_); }

State SteppedRun::reference_state() const {
  State state = make_state(system_, model_, reference_configuration(system_), 0);
  state.converged = true;
  return state;
}

void SteppedRun::hand_over(const State& state) {
  on_state_(state);
  shown_ = summary_.steps;
}

}  // namespace tunica
