#include "tunica/accuracy/detail/answer.hpp"

#include "tunica/accuracy/estimates.hpp"
#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t most_halvings = 8;  // of a time step
constexpr std::size_t fewest_runs = 3;    // two changes: one may be small by chance

/// Values of one model's states.
class Measure {
public:
  Measure(const System& system, const AccuracyRequest& request) : model_(system.model()), request_(request) {
    const Model& model = model_;
    if (is_stress(request.of)) {
      fields_.emplace(system);
    } else if (request.of == Quantity::probe) {
      const auto probe = std::find_if(model.probes.begin(), model.probes.end(),
                                      [&](const Probe& candidate) { return candidate.name == request.probe; });
      if (probe == model.probes.end()) {
        throw InputError(fmt::format("there is no probe \"{}\"", request.probe));
      }
      node_ = model.first_node(probe->body) + probe->node;
    }
  }

  double operator()(const State& state) {
    if (!volume_before_) {
      volume_before_ = state.volume;
    }
    switch (request_.of) {
      case Quantity::displacement:
        return largest_displacement(model_, state);
      case Quantity::energy:
        return state.strain_energy;
      case Quantity::volume:
        if (!state.volume || !volume_before_) {
          throw InputError(
              fmt::format("{}: is open and encloses no volume: ask for another quantity", model_.shells.front().name));
        }
        return *state.volume - *volume_before_;
      case Quantity::stress:
        return (*fields_)(state).wall.stress_p99;
      case Quantity::membrane:
        return (*fields_)(state).wall.membrane_p99;
      case Quantity::tension:
        return (*fields_)(state).wall.tension_p99;
      case Quantity::probe:
        return state.displacement[node_][request_.axis];
    }
    throw InternalError("a quantity without a rule");
  }

private:
  const Model& model_;
  const AccuracyRequest& request_;
  std::optional<ElementFieldEvaluator> fields_;
  std::optional<double> volume_before_;
  std::size_t node_ = 0;  // of the probe
};

/// The factor that a ramp ends with; none where it is larger before, or still changes then.
std::optional<double> end_of(const Ramp& ramp, double duration) {
  if (ramp.points.empty()) {
    return 1;
  }
  const double last = ramp.points.back().second;
  const bool grows = std::all_of(ramp.points.begin(), ramp.points.end(),
                                 [&](const auto& point) { return std::abs(point.second) <= std::abs(last); });
  return grows && ramp.points.back().first <= duration ? std::optional(last) : std::nullopt;
}

}  // namespace

Answer answer_of(Model model, const RunSettings& settings, const AccuracyRequest& request,
                 const std::optional<Checkpoint>& near) {
  const auto start = Clock::now();
  RunSettings all = settings;
  all.every = 1;
  Answer answer{System(std::move(model), all), {}, {}, {}};
  Measure measure(answer.system, request);
  const bool moves = std::holds_alternative<DynamicRun>(settings.kind);
  std::size_t count = 0;
  State last;
  Resumption resumption;
  resumption.near = near;
  answer.summary = solve(
      answer.system,
      [&](const State& state) {
        const double value = measure(state);
        if (!moves || count == 0 || std::abs(value) > std::abs(answer.value)) {
          answer.value = value;
          answer.at = state;
        }
        if (count++ % settings.every == 0) {
          answer.states.push_back(state);
        }
        last = state;
      },
      {}, resumption);
  if ((count - 1) % settings.every != 0) {
    answer.states.push_back(std::move(last));
  }
  answer.all = answers_of(answer.at, ElementFieldEvaluator(answer.system)(answer.at));
  answer.seconds = seconds_since(start);
  return answer;
}

std::optional<Model> at_its_end(const Model& model, double duration) {
  Model rest = model;
  const auto stays = [&](Ramp& ramp) {
    const auto end = end_of(ramp, duration);
    ramp.points = {{0, 0}, {1, end.value_or(0)}};
    return end.has_value();
  };
  for (Load& load : rest.loads) {
    if (!stays(load.ramp)) {
      return std::nullopt;
    }
  }
  for (Fix& fix : rest.fixes) {
    if (!stays(fix.ramp)) {
      return std::nullopt;
    }
  }
  return rest;
}

std::string errors_text(double asked, const std::string& name, double most) {
  return fmt::format("an error of {}, and of {} in {}", percent_text(asked), percent_text(most), name);
}

MotionChoice choose_motion(const RunSettings& settings, double share, double within, bool may_rest,
                           const std::function<Answer(const RunSettings&)>& solve_for_answer) {
  const auto& given = std::get<DynamicRun>(settings.kind);
  const double left_by_order = given.integrator == Integrator::backward_euler ? 0.5 : 0.25;
  std::vector<RunSettings> runs;
  std::vector<double> values, seconds;
  std::vector<Answers> all;
  const auto off = [&](double value) { return std::abs(value / values.back() - 1); };
  double left = infinity;
  std::size_t chosen = 0;
  const auto error_of = [&](std::size_t run) { return (run + 1 < values.size() ? off(values[run]) : 0) + left; };
  for (;;) {
    RunSettings finer = settings;
    std::get<DynamicRun>(finer.kind).step = std::ldexp(given.step, -narrow<int>(runs.size()));
    const Answer answer = solve_for_answer(finer);
    runs.push_back(finer);
    values.push_back(answer.value);
    all.push_back(answer.all);
    seconds.push_back(answer.seconds);
    const std::size_t n = values.size();
    if (n < fewest_runs) {
      continue;
    }
    left =
        std::max(off(values[n - 2]), left_by_order * std::abs(values[n - 2] - values[n - 3]) / std::abs(values[n - 1]));
    for (chosen = 0; chosen + 1 < n && error_of(chosen) >= share; ++chosen) {
    }
    if (error_of(chosen) < share || n > most_halvings) {
      break;
    }
  }
  const auto milliseconds = [&](std::size_t run) {
    return fmt::format("{:.4g} ms", 1e3 * std::get<DynamicRun>(runs[run].kind).step);
  };
  const std::map<std::string, double> last = changes(all[all.size() - 2], all.back());
  const auto errors_of = [&](const Answers& answers) {
    std::map<std::string, double> errors = changes(answers, all.back());
    for (auto& [name, error] : errors) {
      error += last.at(name);
    }
    return errors;
  };
  MotionChoice choice{runs[chosen], error_of(chosen), errors_of(all[chosen]), {}};
  const std::size_t other = chosen > 0 ? chosen - 1 : 1;
  choice.choices.push_back({"step", milliseconds(chosen), choice.error, milliseconds(other),
                            chosen > 0 ? fmt::format("an error of {}", percent_text(error_of(other)))
                                       : fmt::format("{:.2g} times the time", seconds[1] / seconds[0])});
  if (!may_rest) {
    return choice;
  }
  RunSettings rest = settings;
  rest.kind = StaticRun{false, {1}};
  try {
    const Answer answer = solve_for_answer(rest);
    const double error = off(answer.value) + left;
    const std::map<std::string, double> errors = errors_of(answer.all);
    const auto& [name, most] = largest(errors);
    if (error < share && most < within) {
      const std::string cost = fmt::format("{:.2g} times the time", seconds[chosen] / answer.seconds);
      return {rest, error, errors, {{"run", "static", error, "dynamic", cost}}};
    }
    choice.choices.push_back({"run", "dynamic", 0, "static", errors_text(error, name, most)});
  } catch (const InputError&) {  // what can move freely has no state of rest
  } catch (const RequirementError&) {
  }
  return choice;
}

}  // namespace tunica
