#include "tunica/accuracy/estimates.hpp"

#include "tunica/accuracy/detail/levels.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>

namespace tunica {
namespace {

constexpr double left_by_second_order = 0.25;  // of the change before
constexpr double slowest_fall = 1.0 / 3;       // of changes, minus 1: slower is counted as this
/// What a change to a mesh of half the size leaves of the coarse mesh's error. Stresses by bending are of an order
/// between one and two while their layers are not resolved (`Estimates.StressAtTheFaces*`): the lower counts.
constexpr double by_second_order = 4.0 / 3, by_first_order = 2;
constexpr double largest_credible = 0.25;  // a larger change is none of an asymptotic range

double relative(double change, double of) { return change == 0 ? 0 : std::abs(change / of); }

/// An answer that is a 99th percentile, and the quantiles beside it.
struct Percentile {
  const char* key;
  double WallNumbers::*p99;
  std::array<double, 2> WallNumbers::Beside::*beside;
  double unit;             ///< of the key, per that of the wall's numbers
  double error_of_change;  ///< to a mesh of half the size
};
constexpr std::array percentiles{
    Percentile{"membrane_p99_mpa", &WallNumbers::membrane_p99, &WallNumbers::Beside::membrane, 1, by_second_order},
    Percentile{"tension_p99_n_per_mm", &WallNumbers::tension_p99, &WallNumbers::Beside::tension, 1, by_second_order},
    Percentile{"stress_p99_mpa", &WallNumbers::stress_p99, &WallNumbers::Beside::stress, 1, by_first_order},
    Percentile{"strain_p99_percent", &WallNumbers::strain_p99, &WallNumbers::Beside::strain, 100, by_first_order},
};

/// The value at one place, which moves from mesh to mesh: two of them may be alike by chance.
constexpr std::array<std::string_view, 3> maxima{"membrane_max_mpa", "stress_max_mpa", "strain_max_percent"};

// A largest stress or strain moves from mesh to mesh.
bool is_at_one_place(const std::string& name) { return std::ranges::find(maxima, name) != maxima.end(); }

}  // namespace

Answers answers_of(const State& state, const ElementFields& fields) {
  constexpr double percent = 100;
  const Wall& wall = fields.wall;
  Answers answers{{"membrane_max_mpa", wall.membrane_max},
                  {"membrane_mean_mpa", wall.membrane_mean},
                  {"stress_max_mpa", wall.stress_max},
                  {"strain_max_percent", percent * wall.strain_max},
                  {"max_displacement_mm", fields.largest_displacement},
                  {"strain_energy_mj", state.strain_energy}};
  for (const Percentile& one : percentiles) {
    answers.emplace_back(one.key, one.unit * wall.*one.p99);
  }
  if (state.volume) {
    answers.emplace_back("volume_after_mm3", *state.volume);
  }
  return answers;
}

double error_of_last(std::span<const double> values) {
  if (values.size() < 2) {
    throw InputError("an estimate takes two values or more");
  }
  const auto change = [&](std::size_t k) { return relative(values[k] - values[k - 1], values.back()); };
  const std::size_t last = values.size() - 1;
  if (last == 1 || change(last) == 0) {
    return change(last);
  }
  const double fall = change(last - 1) / change(last);
  const double to_come = fall < 2 ? change(last) / std::max(fall - 1, slowest_fall) : change(last);
  return std::max(to_come, left_by_second_order * change(last - 1));
}

std::map<std::string, double> changes(const Answers& from, const Answers& to) {
  std::map<std::string, double> found;
  for (std::size_t i = 0; i < to.size(); ++i) {
    found[to[i].first] = relative(to[i].second - from[i].second, to[i].second);
  }
  return found;
}

const std::pair<const std::string, double>& largest(const std::map<std::string, double>& changes) {
  return *std::ranges::max_element(changes, {}, [](const auto& one) { return one.second; });
}

Estimates estimates_of(const std::vector<Answers>& levels, const std::function<double(const std::string&)>& besides,
                       bool doubtful) {
  Estimates estimates;
  if (levels.size() < 2) {
    return estimates;
  }
  for (std::size_t i = 0; i < levels.back().size(); ++i) {
    std::vector<double> values;
    for (const Answers& level : levels) {
      values.push_back(level[i].second);
    }
    const auto& name = levels.back()[i].first;
    const double error = error_of_last(values) + (values.back() == 0 ? 0 : besides(name));
    estimates[name] = {error, !doubtful && levels.size() > 2 && error < largest_credible && !is_at_one_place(name),
                       fmt::format("{} levels", levels.size())};
  }
  return estimates;
}

RefinedAnswers estimate_by_refinement(const Model& model, const State& state, const ElementFields& fields,
                                      const std::vector<const Target*>& targets, const RunSettings& settings,
                                      const ModelOf& model_of) {
  const Level level = finer_level(model.shells, targets);
  Model fine = model_of(level.bodies);
  carry_selections(model, level, fine);
  RunSettings run = settings;
  run.kind = StaticRun{std::get<StaticRun>(settings.kind).linear, {state.load_factor}};
  Resumption near;
  if (!state.linear) {
    near.near = interpolated(state, model.shells, level);
  }
  try {
    const System system(std::move(fine), run);
    State last;
    (void)solve(
        system, [&](const State& handed) { last = handed; }, {}, near);
    const ElementFields finer_fields = ElementFieldEvaluator(system)(last);
    // Relative to what is shown.
    std::map<std::string, double> errors = changes(answers_of(last, finer_fields), answers_of(state, fields));
    for (auto& [name, error] : errors) {
      error *= by_second_order;
    }
    for (const Percentile& one : percentiles) {
      const std::array<double, 2>&before = fields.wall.beside.*one.beside,
                               &after = finer_fields.wall.beside.*one.beside;
      double change = errors[one.key] / by_second_order;
      for (std::size_t k = 0; k < after.size(); ++k) {
        change = std::max(change, relative(after[k] - before[k], before[k]));
      }
      errors[one.key] = one.error_of_change * change;
    }
    RefinedAnswers refined;
    for (const auto& [name, error] : errors) {
      refined.estimates[name] = {error, error < largest_credible && !is_at_one_place(name),
                                 fmt::format("one refinement to {} shells", level.shell_count())};
    }
    return refined;
  } catch (const RequirementError& error) {
    return {{}, error.what()};
  }
}

}  // namespace tunica
