#include "tunica/mechanics/runs/solve.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/detail/loads.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/prestress.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tunica {

State make_state(const ShellSystem& system, const Model& model, const Configuration& configuration, double time) {
  State state;
  state.time = time;
  state.displacement = configuration.displacement;
  state.rotation.reserve(configuration.rotation.size());
  for (const Eigen::Quaterniond& q : configuration.rotation) {
    state.rotation.push_back(logarithm(q));
  }
  state.pressure = configuration.pressure;
  state.volume = enclosed_volume(system, model, configuration);
  for (const ShellElement& element : system.elements) {
    CornerMotion motion;
    for (int k = 0; k < 3; ++k) {
      const Index node = element.nodes[k];
      motion.displacement.col(k) = configuration.displacement[node];
      motion.rotation[k] = configuration.rotation[node].toRotationMatrix();
    }
    ElementState d;
    if (deformation(element, motion, d)) {
      state.strain_energy += strain_energy(element, d);
    }
  }
  for (const SolidElement& element : system.solids) {
    SolidResponse response;
    if (solid_response(element, corner_motion(element, configuration), response, nullptr)) {
      state.strain_energy += response.energy;
    }
  }
  if (system.bed) {
    state.strain_energy += system.bed->energy(configuration.displacement);
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

std::string doubt_of_stiffness(const Model& model, const std::vector<double>& reached) {
  constexpr double far_below = 0.05;
  for (std::size_t l = 0; l < model.loads.size(); ++l) {
    const Load& load = model.loads[l];
    double most = load.ramp.points.empty() ? 1 : 0;
    for (const auto& [time, factor] : load.ramp.points) {
      most = std::max(most, std::abs(factor));
    }
    if (!std::holds_alternative<PressureLoad>(load.kind) || std::abs(reached[l]) >= far_below * most) {
      continue;
    }
    const double young = model.is_solid(load.body) ? model.solids[load.body - model.shells.size()].material.young
                                                   : model.shells[load.body].material.young;
    return fmt::format(
        "; the pressure that {} bears grows with its Young's modulus, {}: is the unit of one of them "
        "wrong?",
        model.name_of(load.body), pressure_text(young));
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

const std::vector<double>& remembered(const Checkpoint& from, std::string_view name, std::optional<std::size_t> count) {
  const auto found = from.memory.find(name);
  if (found == from.memory.end() || found->second.size() != count.value_or(found->second.size())) {
    throw InputError(fmt::format("a checkpoint without \"{}\", or with that of another model", name));
  }
  return found->second;
}

Summary solve(const Model& model, const RunSettings& settings, const std::function<void(const State&)>& on_state,
              const Progress& progress, const Resumption& resumption) {
  if (is_imaged_under_pressure(model) && !model.prestress) {
    throw InputError("a pressure has an imaged_at, and the model is not prestressed: call prestressed()");
  }
  ShellSystem system = make_checked_system(model, settings);
  for (const auto* checkpoint : {&resumption.from, &resumption.near}) {
    if (*checkpoint && ((*checkpoint)->displacement.size() != model.node_count() ||
                        (*checkpoint)->rotation.size() != model.node_count())) {
      throw InputError(fmt::format("a checkpoint of {} nodes is not of a model of {}",
                                   (*checkpoint)->displacement.size(), model.node_count()));
    }
  }
  if (const auto* dynamic = std::get_if<DynamicRun>(&settings.kind)) {
    return run_dynamic(system, model, settings, *dynamic, on_state, progress, resumption);
  }
  if (const auto* frequencies = std::get_if<FrequencyRun>(&settings.kind)) {
    return run_frequencies(system, model, settings, *frequencies, on_state, progress);
  }
  if (const auto* buckling = std::get_if<BucklingRun>(&settings.kind)) {
    return run_buckling(system, model, settings, *buckling, on_state, progress);
  }
  if (const auto* path = std::get_if<ArcLengthRun>(&settings.kind)) {
    return run_arc_length(system, model, settings, *path, on_state, progress);
  }
  const auto& run = std::get<StaticRun>(settings.kind);
  return run.linear ? run_linear(system, model, settings, run, on_state, progress, resumption)
                    : run_static(system, model, settings, run, on_state, progress, resumption);
}

namespace {

constexpr double rare = 0.01;  // of the area, on which a 99th percentile is passed

std::vector<double> lengths(const std::vector<Vec3>& vectors) {
  std::vector<double> result;
  for (const Vec3& v : vectors) {
    result.push_back(v.norm());
  }
  return result;
}

/// By which angle the shells' nodes or the tetrahedra of a linear state turn at least where they turn most.
double turn_of(const Model& model, const ShellSystem& system, const State& state) {
  double turn = system.elements.empty() ? 0 : area_quantile(model, lengths(state.rotation), rare);
  std::vector<std::pair<double, double>> turns;  // with the volumes
  double left = 0;
  for (const SolidElement& element : system.solids) {
    Mat3 displacement;
    for (int k = 0; k < 3; ++k) {
      displacement.col(k) = state.displacement[element.nodes[k + 1]] - state.displacement[element.nodes[0]];
    }
    Mat3 edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) = system.reference[element.nodes[k + 1]] - system.reference[element.nodes[0]];
    }
    const Mat3 gradient = displacement * edges.inverse();
    const double volume = std::abs(edges.determinant()) / 6;
    turns.emplace_back((gradient - gradient.transpose()).norm() / std::sqrt(8.0), volume);
    left += rare * volume;
  }
  std::ranges::sort(turns, std::greater());
  for (const auto& [of_element, volume] : turns) {
    left -= volume;
    if (left <= 0) {
      return std::max(turn, of_element);
    }
  }
  return turn;
}

const Model& checked(const Model& model) {
  require_valid(model);
  return model;
}

/// From the fields of the elements what of them is large.
void find_wall(const Model& model, ElementFields& fields) {
  constexpr double equal_stress = 1e-6;
  const auto larger = [&](std::vector<double> top, const std::vector<double>& bottom) {
    top = averaged_at_nodes(model, top);
    const std::vector<double> other = averaged_at_nodes(model, bottom);
    std::transform(top.begin(), top.end(), other.begin(), top.begin(),
                   [](double a, double b) { return std::max(a, b); });
    return top;
  };
  const auto first = [](const std::vector<Vec2>& pairs) {
    std::vector<double> values;
    for (const Vec2& pair : pairs) {
      values.push_back(pair[0]);
    }
    return values;
  };
  Wall& wall = fields.wall;
  fields.von_mises = larger(fields.von_mises_top, fields.von_mises_bottom);
  wall.stress_max = *std::max_element(fields.von_mises.begin(), fields.von_mises.end());
  // The first of equal ones, so that on a symmetric body it is not round-off that chooses.
  const auto highest = std::ranges::find_if(
      fields.von_mises, [&](double stress) { return stress >= (1 - equal_stress) * wall.stress_max; });
  auto node = narrow<std::size_t>(highest - fields.von_mises.begin());
  wall.stress_p99 = area_quantile(model, fields.von_mises, rare);
  for (const ShellBody& body : model.shells) {
    if (node < body.mesh.vertices.size()) {
      wall.stress_max_at = body.mesh.vertices[node];
      break;
    }
    node -= body.mesh.vertices.size();
  }
  const std::vector<double> strain = larger(first(fields.principal_strain_top), first(fields.principal_strain_bottom));
  wall.strain_max = *std::max_element(strain.begin(), strain.end());
  wall.strain_p99 = area_quantile(model, strain, rare);
}

}  // namespace

struct ElementFieldEvaluator::Implementation {
  const Model& model;
  ShellSystem system;
};

ElementFieldEvaluator::ElementFieldEvaluator(const Model& model)
    : implementation_(new Implementation{checked(model), make_system(model)}) {}
ElementFieldEvaluator::~ElementFieldEvaluator() = default;

ElementFields element_fields(const Model& model, const State& state) { return ElementFieldEvaluator(model)(state); }

ElementFields ElementFieldEvaluator::operator()(const State& state) const {
  const auto& [model, system] = *implementation_;
  ElementFields fields;
  const std::size_t nodes = model.node_count();
  require_valid(model, state);
  if (!system.solids.empty() && state.pressure.size() != nodes) {
    throw InputError(fmt::format("a state with {} pressures for {} nodes", state.pressure.size(), nodes));
  }
  std::vector<double> factors;
  for (const Load& load : model.loads) {
    factors.push_back(
        factor_of(load.ramp, state.velocity.empty(), state.velocity.empty() ? state.load_factor : state.time));
  }
  fields.pressure = shell_pressures(system, model, factors);
  const auto von_mises = [](const Vec3& s) {
    return std::sqrt(std::max(0.0, s[0] * s[0] - s[0] * s[1] + s[1] * s[1] + 3 * s[2] * s[2]));
  };
  const auto principal = [](const Vec3& strain) {  // xx, yy, and twice the tensor's xy
    const double mean = (strain[0] + strain[1]) / 2;
    const double radius = std::hypot((strain[0] - strain[1]) / 2, strain[2] / 2);
    return Vec2(mean + radius, mean - radius);
  };
  for (const ShellElement& element : system.elements) {
    ElementState d = ElementState::Zero();
    if (state.linear) {
      Vector18 moved;
      for (int k = 0; k < 3; ++k) {
        const Index node = element.nodes[k];
        moved.segment<3>(6 * k) = state.displacement[node];
        moved.segment<3>(6 * k + 3) = state.rotation[node];
      }
      d = linear_deformation(element, moved);
    } else {
      CornerMotion motion;
      for (int k = 0; k < 3; ++k) {
        const Index node = element.nodes[k];
        motion.displacement.col(k) = state.displacement[node];
        motion.rotation[k] = exponential(state.rotation[node]).toRotationMatrix();
      }
      deformation(element, motion, d);
    }
    const double t = element.thickness;
    const Mat3 elasticity = plane_stress(model.shells[element.body].material);
    const Vec3 strain = d.head<3>();
    const Vec3 curvature = element.curvature * d.segment<9>(3);
    const ElementState stressed = d + element.prestrain;
    const Vec3 force = t * elasticity * stressed.head<3>();
    const Vec3 moment = t * t * t / 12 * elasticity * (element.curvature * stressed.segment<9>(3));
    fields.membrane_force.push_back(force);
    fields.bending_moment.push_back(moment);
    fields.von_mises_top.push_back(von_mises(force / t + 6 / (t * t) * moment));
    fields.von_mises_bottom.push_back(von_mises(force / t - 6 / (t * t) * moment));
    fields.principal_strain_top.push_back(principal(strain + t / 2 * curvature));
    fields.principal_strain_bottom.push_back(principal(strain - t / 2 * curvature));
  }
  for (const SolidElement& element : system.solids) {
    SolidMotion motion;
    for (int k = 0; k < 4; ++k) {
      motion.displacement.col(k) = state.displacement[element.nodes[k]];
      motion.pressure[k] = state.pressure[element.nodes[k]];
    }
    const Mat3 stress = solid_stress(element, motion, state.linear);
    const double mean = stress.trace() / 3;
    fields.solid_von_mises.push_back(std::sqrt(1.5) * (stress - mean * Mat3::Identity()).norm());
    fields.solid_pressure.push_back(-mean);
  }
  if (!system.elements.empty()) {
    find_wall(model, fields);
    fields.displacement_p99 = area_quantile(model, lengths(state.displacement), rare);
  }
  if (state.linear) {
    fields.turn_p99 = turn_of(model, system, state);
  }
  fields.largest_displacement = largest_displacement(model, state);
  return fields;
}

}  // namespace tunica
