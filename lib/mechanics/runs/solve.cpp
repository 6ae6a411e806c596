#include "tunica/mechanics/runs/solve.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/prestress.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/doubts.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tunica {

State make_state(const ShellSystem& system, const Configuration& configuration, double time) {
  State state;
  state.time = time;
  state.displacement = configuration.displacement;
  state.rotation.reserve(configuration.rotation.size());
  for (const Eigen::Quaterniond& q : configuration.rotation) {
    state.rotation.push_back(logarithm(q));
  }
  state.pressure = configuration.pressure;
  state.volume = enclosed_volume(system, configuration);
  for (const auto& term : system.terms) {
    state.strain_energy += term->energy(system, configuration);
  }
  if (system.contact) {
    state.contacts = system.contact->results(configuration);
    state.rigids = system.contact->on_rigids();
    state.force_imbalance = system.contact->imbalance()[0];
    state.moment_imbalance = system.contact->imbalance()[1];
  }
  return state;
}

std::string describe_loads(const Model& model, const std::vector<double>& reached, const std::vector<double>& wanted) {
  std::string text;
  for (std::size_t l = 0; l < model.loads.size(); ++l) {
    if (const auto* pressure = std::get_if<PressureLoad>(&model.loads[l].kind)) {
      // kPa are what organs bear; what is out of all bounds is told as it is kept, for it may be the last number.
      constexpr double most_in_kpa = 1e6;
      const double part = pressure->at(reached[l]);
      const double whole = pressure->at(wanted[l]);
      const bool in_kpa = std::max(std::abs(part), std::abs(whole)) < most_in_kpa;
      text += fmt::format("{}{:.4g} {} of {:.4g} {} on {}", text.empty() ? "" : "; ", (in_kpa ? 1e3 : 1) * part,
                          in_kpa ? "kPa" : "MPa", (in_kpa ? 1e3 : 1) * whole, in_kpa ? "kPa" : "MPa",
                          model.name_of(model.loads[l].body));
      if (model.is_solid(model.loads[l].body)) {
        continue;
      }
      const ShellBody& body = model.shells[model.loads[l].body];
      text += fmt::format(", {:.4g} mm thick{}", *std::min_element(body.thickness.begin(), body.thickness.end()),
                          body.thickness.size() > 1 ? " at its thinnest" : "");
    }
  }
  if (model.loads.empty()) {
    const bool of_nodes = std::any_of(model.fixes.begin(), model.fixes.end(), prescribes);
    return of_nodes ? "of the prescribed displacements" : "of the rigid bodies' motion";
  }
  return text.empty() ? fmt::format("{:.4g} of {:.4g} times the loads", reached.front(), wanted.front()) : text;
}

std::string remedy_of_failure(const Model& model, const std::vector<double>& reached) {
  const bool slides = std::ranges::any_of(model.fixes, [](const Fix& fix) { return fix.across.has_value(); });
  if (slides && model.supports.empty()) {
    return "; between ends that slide a vessel under pressure gives way sideways, as a column does: put it into a bed "
           "(--support 1e5N/m3, SUPPORT=1e5N/m3), or hold its ends (--fix boundary, FIX=boundary)";
  }
  constexpr double far_below = 0.05;
  for (std::size_t l = 0; l < model.loads.size(); ++l) {
    const Load& load = model.loads[l];
    double most = load.ramp.points.empty() ? 1 : 0;
    for (const auto& [time, factor] : load.ramp.points) {
      most = std::max(most, std::abs(factor));
    }
    // Of a wall imaged under pressure: of what is put on it besides.
    if (!std::holds_alternative<PressureLoad>(load.kind) || std::abs(reached[l]) >= far_below * most) {
      continue;
    }
    const Material& material = model.is_solid(load.body) ? model.solids[load.body - model.shells.size()].material
                                                         : model.shells[load.body].material;
    if (!material.young_stated) {
      continue;
    }
    return fmt::format(
        "; the pressure that {} bears grows with its Young's modulus, {}: is the unit of one of them "
        "wrong?",
        model.name_of(load.body), pressure_text(material.young));
  }
  return {};
}

void set_algebraic_error(const std::optional<AlgebraicError>& error, State& state) {
  if (error) {
    state.algebraic_error = error->relative();
    state.algebraic_error_is_bound = error->is_lower_bound;
  }
}

void record_step(const State& state, double seconds, Summary& summary) {
  ++summary.steps;
  summary.converged = state.converged && (summary.steps == 1 || summary.converged);
  summary.residual = state.residual;
  summary.newton_iterations += state.newton_iterations;
  summary.cg_iterations += state.cg_iterations;
  summary.seconds_per_step.push_back(seconds);
  if (state.algebraic_error) {
    summary.algebraic_error = std::max(summary.algebraic_error.value_or(0), *state.algebraic_error);
    summary.algebraic_error_is_bound = summary.algebraic_error_is_bound || state.algebraic_error_is_bound;
  }
  if (state.displacement.empty()) {
    return;
  }
  summary.volume_after = state.volume;
  summary.strain_energy = state.strain_energy;
  summary.max_displacement = 0;
  for (const Vec3& u : state.displacement) {
    summary.max_displacement = std::max(summary.max_displacement, u.norm());
  }
}

void require_count(std::size_t found, std::size_t count, std::string_view name) {
  if (found != count) {
    throw InputError(fmt::format("a checkpoint with {} numbers of {}, and the model has {}", found, name, count));
  }
}

Summary solve(const Model& model, const RunSettings& settings, const std::function<void(const State&)>& on_state,
              const Progress& progress, const Resumption& resumption) {
  return solve(System(model, settings), on_state, progress, resumption);
}

Summary solve(const System& whole, const std::function<void(const State&)>& on_state, const Progress& progress,
              const Resumption& resumption) {
  const Model& model = whole.model();
  const RunSettings& settings = whole.settings();
  ShellSystem& system = whole.parts();
  const auto* statics = std::get_if<StaticRun>(&settings.kind);
  const bool has_no_way = statics != nullptr && statics->linear;  // a linear step needs nothing of the one before
  for (const auto* checkpoint : {&resumption.from, &resumption.near}) {
    if (*checkpoint && !has_no_way &&
        ((*checkpoint)->displacement.size() != model.node_count() ||
         (*checkpoint)->rotation.size() != model.node_count())) {
      throw InputError(fmt::format("a checkpoint of {} nodes is not of a model of {}",
                                   (*checkpoint)->displacement.size(), model.node_count()));
    }
  }
  if (const auto* dynamic = std::get_if<DynamicRun>(&settings.kind)) {
    return run_dynamic(system, settings, *dynamic, on_state, progress, resumption);
  }
  if (const auto* frequencies = std::get_if<FrequencyRun>(&settings.kind)) {
    return run_frequencies(system, settings, *frequencies, on_state, progress);
  }
  if (const auto* buckling = std::get_if<BucklingRun>(&settings.kind)) {
    return run_buckling(system, settings, *buckling, on_state, progress);
  }
  if (const auto* path = std::get_if<ArcLengthRun>(&settings.kind)) {
    return run_arc_length(system, settings, *path, on_state, progress);
  }
  const auto& run = std::get<StaticRun>(settings.kind);
  return run.linear ? run_linear(system, settings, run, on_state, progress, resumption)
                    : run_static(system, settings, run, on_state, progress, resumption);
}

}  // namespace tunica
