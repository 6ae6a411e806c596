#include "tunica/mechanics/runs/detail/stepped_run.hpp"

#include "tunica/core/clock.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <utility>

namespace tunica {

Summary SteppedRun::follow(const Progress& progress, const Resumption& resumption) {
  on_slow_step_ = resumption.on_slow_step;
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
    if (system_.contact) {
      summary_.contact_pressures = system_.contact->pressed();
    }
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
  State state = make_state(system_, reference_configuration(system_), 0);
  state.converged = true;
  return state;
}

Checkpoint SteppedRun::keep(double position, const Configuration& configuration) const {
  Checkpoint now;
  now.position = position;
  now.displacement = configuration.displacement;
  now.rotation = configuration.rotation;
  now.solid_pressure = configuration.pressure;
  if (system_.contact) {
    now.contact = system_.contact->memory();
  }
  return now;
}

Configuration SteppedRun::recall(const Checkpoint& from) {
  Configuration configuration{from.displacement, from.rotation};
  if (!system_.solids.empty()) {
    require_count(from.solid_pressure.size(), system_.node_count(), "pressures");
    configuration.pressure = from.solid_pressure;
  }
  if (system_.contact) {
    system_.contact->recall(from.contact, configuration, from.position);
  }
  return configuration;
}

void SteppedRun::tell_slow_step(std::size_t iterations, const std::string& at, const std::string& why) {
  constexpr std::size_t slow = 100;  // iterations: a step with contact that goes well takes 5 to 20
  if (!system_.contact || !on_slow_step_ || iterations < slow) {
    return;
  }
  std::exchange(on_slow_step_, nullptr)(
      fmt::format("{}: this step hardly gets on: {} iterations so far; {}; if it takes too long, stop it and {}", at,
                  iterations, why,
                  system_.contact->closest_place().empty() ? "let the wall move there by a dynamic run with damping"
                                                           : "let that [[contact]] be softer by a larger resolution"));
}

void SteppedRun::hand_over(const State& state) {
  on_state_(state);
  shown_ = summary_.steps;
}

}  // namespace tunica
