#include "tunica/io/result/run_report.hpp"

#include "tunica/io/result/detail/contact_record.hpp"
#include "tunica/mechanics/runs/doubts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

namespace tunica {
namespace {

double median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// What is no number has no value.
Json known(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json triple(const Vec3& v) { return Json::array({known(v.x()), known(v.y()), known(v.z())}); }

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

/// The records of contacts and rigid bodies, where there are any.
void prepare_contacts(Json& result, const Model& model) {
  const auto lists = [](Json& record, std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      record[key] = Json::array();
    }
  };
  for (const Contact& contact : model.contacts) {
    lists(result["contacts"][contact.name],
          {"time_s", "load_factor", "force_n", "moment_n_mm", "area_mm2", "smallest_gap_mm", "points", "slip_mm"});
  }
  for (const RigidBody& rigid : model.rigids) {
    lists(result["rigid"][rigid.name], {"time_s", "load_factor", "force_n", "moment_n_mm", "position_mm"});
  }
  if (!model.contacts.empty()) {
    result["balance"] = {{"force", nullptr}, {"moment", nullptr}};
  }
}

void report_contacts(Json& result, const Model& model, const State& state, bool dynamic) {
  if (state.time == 0) {
    return;  // the reference, before anything moves
  }
  const auto when = [&](Json& record) {
    record["time_s"].push_back(dynamic ? Json(state.time) : Json());
    record["load_factor"].push_back(state.load_factor);
  };
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const ContactState now = contact_of(state, i);
    Json& record = result["contacts"][model.contacts[i].name];
    when(record);
    record["force_n"].push_back(triple(now.force));
    record["moment_n_mm"].push_back(triple(now.moment));
    record["area_mm2"].push_back(known(now.area));
    record["smallest_gap_mm"].push_back({{"lower", known(now.gap_lower)}, {"upper", known(now.gap_upper)}});
    record["points"].push_back(now.points);
    record["slip_mm"].push_back(known(now.slip));
  }
  for (std::size_t i = 0; i < model.rigids.size(); ++i) {
    const RigidState now = rigid_of(state, i);
    Json& record = result["rigid"][model.rigids[i].name];
    when(record);
    record["force_n"].push_back(triple(now.force));
    record["moment_n_mm"].push_back(triple(now.moment));
    record["position_mm"].push_back(triple(now.position));
  }
  const auto largest = [](Json& so_far, double now) {
    so_far = known(so_far.is_null() ? now : std::max(so_far.get<double>(), now));
  };
  if (!state.contacts.empty()) {
    largest(result["balance"]["force"], state.force_imbalance);
    largest(result["balance"]["moment"], state.moment_imbalance);
  }
}

}  // namespace

void prepare_result(Json& result, const Model& model) {
  std::size_t shells = 0;
  for (const ShellBody& body : model.shells) {
    shells += body.mesh.triangles.size();
  }
  std::size_t tetrahedra = 0;
  for (const SolidBody& body : model.solids) {
    tetrahedra += body.mesh.tetrahedra.size();
  }
  result = {{"shells", shells},
            {"tetrahedra", tetrahedra},
            {"nodes", model.node_count()},
            {"dof", nullptr},
            {"steps", 0},
            {"step_parts", 0},
            {"converged", false},
            {"max_displacement_mm", nullptr},
            {"peak", nullptr},
            {"displacement_p99_mm", nullptr},
            {"max_node_displacement_mm", nullptr},
            {"wall", nullptr},
            {"volume_before_mm3", nullptr},
            {"volume_after_mm3", nullptr},
            {"strain_energy_mj", nullptr},
            {"residual", nullptr},
            {"algebraic_error_percent", nullptr},
            {"algebraic_error_is_lower_bound", false},
            {"newton_iterations", 0},
            {"cg_iterations", 0},
            {"ms_per_step", {{"median", nullptr}, {"max", nullptr}}},
            {"real_time_factor", nullptr},
            {"probes", Json::object()},
            {"frequencies_hz", Json::array()},
            {"buckling_factors", Json::array()},
            {"limit_load_factors", Json::array()},
            {"branch_load_factors", Json::array()},
            {"snaps", Json::array()},
            {"energy", nullptr},
            {"estimates", Json::object()},
            {"short_waves_stiffened_from", nullptr}};
  for (const Probe& probe : model.probes) {
    result["probes"][probe.name] = {{"time_s", Json::array()},
                                    {"load_factor", Json::array()},
                                    {"displacement_mm", Json::array()},
                                    {"rotation_rad", Json::array()}};
  }
  prepare_contacts(result, model);
}

namespace {

Json wall_report(const WallNumbers& wall) {
  return {{"membrane_p99_mpa", wall.membrane_p99},
          {"membrane_max_mpa", wall.membrane_max},
          {"membrane_mean_mpa", wall.membrane_mean},
          {"tension_p99_n_per_mm", wall.tension_p99},
          {"stress_p99_mpa", wall.stress_p99},
          {"stress_max_mpa", wall.stress_max},
          {"stress_max_at_mm", triple(wall.stress_max_at)},
          {"bending_share_percent", 1e2 * wall.bending_share},
          {"strain_p99_percent", 1e2 * wall.strain_p99},
          {"strain_max_percent", 1e2 * wall.strain_max}};
}

}  // namespace

void report_state(Json& result, const Model& model, const State& state, const ElementFields& fields, bool dynamic) {
  double most = 0;
  for (const Vec3& u : state.displacement) {
    most = std::max(most, u.norm());
  }
  result["max_displacement_mm"] = fields.largest_displacement;
  result["max_node_displacement_mm"] = most;
  if (!model.shells.empty()) {
    result["displacement_p99_mm"] = fields.displacement_p99;
    result["wall"] = wall_report(fields.wall);
    result["wall"]["left_out_percent"] = 1e2 * fields.wall.left_out;
    result["wall"]["whole"] = wall_report(fields.wall.whole);
  }
  if (result["volume_before_mm3"].is_null()) {
    result["volume_before_mm3"] = or_null(state.volume);
  }
  result["volume_after_mm3"] = or_null(state.volume);
  result["strain_energy_mj"] = state.strain_energy;
  result["residual"] = state.residual;
  for (const Probe& probe : model.probes) {
    const std::size_t node = model.first_node(probe.body) + probe.node;
    Json& record = result["probes"][probe.name];
    record["time_s"].push_back(dynamic ? Json(state.time) : Json());
    record["load_factor"].push_back(state.load_factor);
    record["displacement_mm"].push_back(triple(state.displacement[node]));
    record["rotation_rad"].push_back(triple(state.rotation[node]));
  }
  report_contacts(result, model, state, dynamic);
}

Json peak_report(const Peak& peak) { return {{"max_displacement_mm", peak.displacement}, {"time_s", peak.time}}; }

void report_summary(Json& result, const Summary& summary, bool converged, std::optional<double> duration) {
  result["dof"] = summary.dof;
  result["steps"] = summary.steps;
  result["step_parts"] = summary.parts;
  result["converged"] = converged;
  result["volume_before_mm3"] = or_null(summary.volume_before);
  result["volume_after_mm3"] = or_null(summary.volume_after);
  result["strain_energy_mj"] = summary.strain_energy;
  result["residual"] = summary.residual;
  result["algebraic_error_percent"] = summary.algebraic_error ? Json(1e2 * *summary.algebraic_error) : Json();
  result["algebraic_error_is_lower_bound"] = summary.algebraic_error_is_bound;
  result["newton_iterations"] = summary.newton_iterations;
  result["short_waves_stiffened_from"] = or_null(summary.stiffened_from);
  result["limit_load_factors"] = summary.limit_factors;
  result["branch_load_factors"] = summary.branch_factors;
  result["cg_iterations"] = summary.cg_iterations;
  for (const Snap& snap : summary.snaps) {
    result["snaps"].push_back({{"load_factor", snap.load_factor}, {"distance_mm", snap.distance}});
  }
  if (const auto& energy = summary.energy) {
    result["energy"] = {{"work_mj", energy->work},
                        {"damped_mj", energy->damped},
                        {"lost_mj", energy->lost},
                        {"gained_percent", 1e2 * energy->gained},
                        {"gaining_step", energy->gaining_step > 0 ? Json(energy->gaining_step) : Json()}};
  }
  const std::vector<double>& seconds = summary.seconds_per_step;
  if (!seconds.empty()) {
    result["ms_per_step"] = {{"median", 1e3 * median(seconds)},
                             {"max", 1e3 * *std::max_element(seconds.begin(), seconds.end())}};
    double wall = 0;
    for (const double s : seconds) {
      wall += s;
    }
    if (duration && wall > 0) {
      result["real_time_factor"] = *duration / wall;
    }
  }
}

void report_modes(Json& result, const Summary& summary) {
  for (const char* key : {"max_displacement_mm", "displacement_p99_mm", "max_node_displacement_mm", "wall",
                          "volume_after_mm3", "strain_energy_mj"}) {
    result[key] = nullptr;
  }
  result["frequencies_hz"] = summary.frequencies;
  result["buckling_factors"] = summary.buckling_factors;
}

Json accuracy_report(const Accuracy& accuracy) {
  Json levels = Json::array(), choices = Json::array();
  for (const AccuracyLevel& level : accuracy.levels) {
    levels.push_back({{"shells", level.shells},
                      {"value", level.value},
                      {"seconds", level.seconds},
                      {"mean_distance_mm", or_null(level.mean_distance)},
                      {"newton_iterations", level.newton_iterations}});
  }
  for (const AccuracyChoice& choice : accuracy.choices) {
    choices.push_back({{"part", choice.part},
                       {"chosen", choice.chosen},
                       {"error_percent", choice.error ? Json(100 * *choice.error) : Json()},
                       {"instead", choice.instead},
                       {"would_cost", choice.would_cost}});
  }
  const AccuracyRequest& request = accuracy.request;
  const bool probed = request.of == Quantity::probe;
  return {{"requested_percent", 100 * request.within},
          {"of", probed ? Json{{"probe", request.probe}, {"axis", std::string(1, "xyz"[request.axis])}}
                        : Json(name_of(request.of))},
          {"value", accuracy.levels.back().value},
          {"estimate_percent", accuracy.estimate ? Json(100 * *accuracy.estimate) : Json()},
          {"credible", accuracy.reasons.empty()},
          {"reasons", accuracy.reasons},
          {"levels", levels},
          {"choices", choices},
          {"surface_uncertainty_mm", or_null(accuracy.surface_error)},
          {"not_included", accuracy.not_included}};
}

Json unloaded_report(const Unloaded& unloaded) {
  return {{"volume_mm3", or_null(unloaded.volume)},
          {"distance_mm", {{"mean", unloaded.mean_distance}, {"max", unloaded.largest_distance}}},
          {"roundness", unloaded.roundness
                            ? Json{{"image", unloaded.roundness->image}, {"unloaded", unloaded.roundness->unloaded}}
                            : Json()},
          {"iterations", unloaded.iterations}};
}

std::vector<Warning> unloaded_warnings(const Unloaded& unloaded) {
  constexpr double doubtful = 0.5;
  if (!unloaded.roundness || unloaded.roundness->unloaded >= doubtful * unloaded.roundness->image) {
    return {};
  }
  return {
      {Weight::major, "unloaded shape",
       fmt::format("without its pressure a section is no longer round (4 pi area / perimeter^2 falls from {:.2g} to "
                   "{:.2g}): a living wall hardly folds like that, so the unloaded shape is doubtful; without "
                   "--unloaded the wall is prestressed as imaged instead",
                   unloaded.roundness->image, unloaded.roundness->unloaded)}};
}

Json estimates_report(const Estimates& estimates) {
  Json report = Json::object();
  for (const auto& [key, estimate] : estimates) {
    report[key] = {{"percent", known(100 * estimate.error)}, {"credible", estimate.credible}, {"from", estimate.from}};
  }
  return report;
}

namespace {

/// An answer of which a notable error is told.
struct TellingAnswer {
  const char* key;
  const char* name;
  Quantity of;
  double notable, large;
};

// The faces' stress holds bending, of which a mesh of the same shells says less.
constexpr std::array<TellingAnswer, 3> telling_answers{
    {{"membrane_p99_mpa", "the membrane stress of the wall", Quantity::membrane, 0.05, 0.15},
     {"stress_p99_mpa", "the stress at the wall's faces", Quantity::stress, 0.15, 0.3},
     {"max_displacement_mm", "the largest displacement", Quantity::displacement, 0.05, 0.15}}};

/// Calls tell(answer, estimate) for what may be off by more than is notable.
template <typename Tell>
void for_each_notable(const Estimates& estimates, const Tell& tell) {
  for (const TellingAnswer& answer : telling_answers) {
    const auto found = estimates.find(answer.key);
    // An answer of zero has no relative error.
    if (found != estimates.end() && std::isfinite(found->second.error) && found->second.error >= answer.notable) {
      tell(answer, found->second);
    }
  }
}

}  // namespace

std::vector<Warning> estimate_warnings(const Estimates& estimates) {
  std::vector<Warning> warnings;
  for_each_notable(estimates, [&](const TellingAnswer& answer, const Estimate& estimate) {
    warnings.push_back(
        {estimate.error < answer.large ? Weight::minor : Weight::major, "error of the mesh",
         fmt::format("{} may be off by {:.2g} % by its mesh ({}): take more shells (SHELLS), or let "
                     "--accuracy 5% --of {} (ACCURACY=5% OF={}) choose them",
                     answer.name, 100 * estimate.error, estimate.from, name_of(answer.of), name_of(answer.of))});
  });
  return warnings;
}

Json prestress_report(const Model& model, double residual) {
  Json pressure;
  for (const Load& load : model.loads) {
    if (const auto* p = std::get_if<PressureLoad>(&load.kind); p != nullptr && p->imaged_at) {
      pressure = pressure.is_null() || pressure == *p->imaged_at ? Json(*p->imaged_at) : Json();
    }
  }
  return {{"pressure_mpa", pressure}, {"residual", residual}};
}

namespace {

// Stress in kPa, as pictures and pages have it.
std::string value_text(Quantity of, double value) {
  return of == Quantity::stress || of == Quantity::membrane ? fmt::format("{:.5g} kPa", 1e3 * value)
                                                            : fmt::format("{:.5g} {}", value, unit_of(of));
}

}  // namespace

std::string level_note(const AccuracyLevel& level, const AccuracyRequest& request) {
  if (!level.failure.empty()) {
    return fmt::format("{:>7} shells: {}", level.shells, level.failure);
  }
  return fmt::format("{:>7} shells: {} {}, {:.2g} s", level.shells, name_of(request.of),
                     value_text(request.of, level.value), level.seconds);
}

std::string missed_accuracy(const Accuracy& accuracy) {
  return fmt::format(
      "accuracy not reached: {} {} with {} shells, {}, {:.3g} % asked: {}", name_of(accuracy.request.of),
      value_text(accuracy.request.of, accuracy.levels.back().value), accuracy.levels.back().shells,
      accuracy.estimate ? fmt::format("estimated error {:.2g} %", 100 * *accuracy.estimate) : "error not estimated",
      100 * accuracy.request.within, fmt::join(accuracy.reasons, "; "));
}

std::vector<std::string> accuracy_notes(const Accuracy& accuracy) {
  const AccuracyRequest& request = accuracy.request;
  std::vector<std::string> lines;
  if (accuracy.estimate && accuracy.reasons.empty()) {
    lines.push_back(fmt::format("the error of the {} is credibly below {:.2g} % of it ({:.2g} % asked for)",
                                name_of(request.of), 100 * *accuracy.estimate, 100 * request.within));
  }
  for_each_notable(accuracy.estimates, [&](const TellingAnswer& answer, const Estimate& estimate) {
    if (answer.of != request.of) {
      lines.push_back(
          fmt::format("{} was not asked for, and may be off by {:.2g} % by mesh and model: --of {} (OF={}) asks "
                      "for it",
                      answer.name, 100 * estimate.error, name_of(answer.of), name_of(answer.of)));
    }
  });
  for (const AccuracyChoice& choice : accuracy.choices) {
    lines.push_back(
        fmt::format("{}: {}; {} instead: {}", choice.part, choice.chosen, choice.instead, choice.would_cost));
  }
  lines.push_back(fmt::format("not included: {}", fmt::join(accuracy.not_included, ", ")));
  if (accuracy.surface_error) {
    lines.push_back(fmt::format(
        "this is of this surface: at voxels of {:.3g} mm the surface itself is uncertain by about {:.2g} mm",
        *accuracy.request.voxel, *accuracy.surface_error));
  }
  return lines;
}

std::string modes_note(const Summary& summary, std::size_t asked) {
  const bool vibrates = !summary.frequencies.empty();
  const std::vector<double>& values = vibrates ? summary.frequencies : summary.buckling_factors;
  std::string text =
      fmt::format("{} {}: {:.6g}", values.size(), vibrates ? "frequencies" : "buckling factors", values.front());
  if (values.size() > 1) {
    text += fmt::format(" to {:.6g}", values.back());
  }
  return fmt::format("{}{}{}", text, vibrates ? " Hz" : "",
                     values.size() < asked ? fmt::format(", of {} asked for: there are no more", asked) : "");
}

std::vector<Warning> contact_warnings(const Model& model, const Summary& summary, const Json& result) {
  std::vector<Warning> warnings;
  for (std::size_t c = 0; c < model.contacts.size() && result.contains("contacts"); ++c) {
    const std::string& name = model.contacts[c].name;
    const Json& points = result["contacts"][name]["points"];
    if (points.empty() || std::any_of(points.begin(), points.end(), [](const Json& n) { return n != 0; })) {
      continue;
    }
    if (c < summary.contact_pressures.size() && summary.contact_pressures[c] > 0) {
      warnings.push_back({Weight::note, "contact within steps",
                          fmt::format("{}: touches within steps only, with up to {}, and at the end of none: shorter "
                                      "steps show where",
                                      name, pressure_text(summary.contact_pressures[c]))});
    } else {
      warnings.push_back({Weight::major, "no contact",
                          fmt::format("{}: nothing touches in any step: do these bodies come together?", name)});
    }
  }
  return warnings;
}

namespace {

/// What the numbers of the wall are of.
void add_wall_notes(const Wall& wall, std::vector<Warning>& warnings) {
  if (wall.is_all_near) {
    warnings.push_back({Weight::note, "whole wall counted",
                        "all of the wall lies within two bending lengths sqrt(R t) of rims, supports, point loads or "
                        "jumps of the thickness, so nothing of it is left out of the numbers of the wall"});
  }
  if (wall.is_max_on_held) {
    warnings.push_back({Weight::note, "largest stress at a support",
                        fmt::format("the largest stress of the whole wall, {}, lies on a held rim or another support, "
                                    "and says more of the support than of the organ",
                                    pressure_text(wall.whole.stress_max))});
  }
}

}  // namespace

std::vector<Warning> run_warnings(const RunSettings& run, const Summary& summary, const LastState& last) {
  std::vector<Warning> warnings;
  constexpr double small_strain = 0.1;
  if (last.wall.strain_p99 > small_strain) {
    warnings.push_back(
        {Weight::major, "large strain",
         fmt::format(
             "1 % of the wall is strained by more than {:.3g} %: linear elasticity is meant for strains of up to "
             "about 10 %",
             1e2 * last.wall.strain_p99)});
  }
  add_wall_notes(last.wall, warnings);
  constexpr double notable_departure = 0.05, large_departure = 0.2;
  if (const double off = summary.linear_departure.value_or(0); off > notable_departure) {
    warnings.push_back(
        {off > large_departure ? Weight::major : Weight::minor, "linear run",
         fmt::format("a linear run takes displacements and rotations for small, and these are not: they may be off by "
                     "{} in size or direction, stresses by as much or more; write geometry = \"nonlinear\"",
                     off < 1 ? fmt::format("{:.0f} %", 1e2 * off) : "100 % and more")});
  }
  for (const Snap& snap : summary.snaps) {
    warnings.push_back(
        {Weight::major, "limit load",
         fmt::format("at load factor {:.6g} the path of equilibria breaks off (limit load): the shell snaps, by up "
                     "to {:.3g} mm, to the next state of rest, from which the load goes on; arc length shows the path, "
                     "a dynamic run the motion",
                     snap.load_factor, snap.distance)});
  }
  if (summary.energy && summary.energy->gaining_step > 0) {
    warnings.push_back(
        {Weight::major, "long steps",
         fmt::format("time integration gains energy, {:.3g} % of the largest so far, more than 10 % from step {} "
                     "({:.6g} s) on: the steps are too coarse for the motion: take shorter ones, or a smaller "
                     "spectral_radius",
                     1e2 * summary.energy->gained, summary.energy->gaining_step, summary.energy->gaining_time)});
  }
  constexpr double notable_loss = 0.1;
  if (summary.energy && summary.energy->lost > notable_loss * summary.energy->largest) {
    warnings.push_back(
        {Weight::minor, "long steps",
         fmt::format(
             "time integration took {:.3g} % of the energy: what swings is smaller than it should be, the state "
             "of rest is not: for the motion take shorter steps, or integrator = \"generalised-alpha\"",
             1e2 * summary.energy->lost / summary.energy->largest)});
  }
  constexpr double notable_bend = 0.25;  // of what swings with half of the largest motion: a ninth of its period
  if (summary.largest_bend > notable_bend * summary.largest_motion) {
    warnings.push_back(
        {Weight::minor, "long steps",
         fmt::format("the steps are long for what swings: from one to the next the motion bends by {:.2g} % of its "
                     "largest value: take shorter ones, or error control (adaptive)",
                     1e2 * summary.largest_bend / summary.largest_motion)});
  }
  if (summary.stiffened_from) {
    warnings.push_back(
        {Weight::major, "coarse shells",
         fmt::format("the mesh is coarse for so thin a curved shell (h^2 > 3 R t): from {} {:.4g} on, where it "
                     "would have buckled in waves as short as its elements, these were made stiff; whether the shell "
                     "itself buckles this mesh does not resolve: refine it",
                     std::holds_alternative<DynamicRun>(run.kind) ? "second" : "load factor",
                     *summary.stiffened_from)});
  }
  constexpr double notable_residual = 1e-3;
  if (run.newton_max == 1 && summary.residual > notable_residual) {
    warnings.push_back(
        {Weight::minor, "not in balance",
         fmt::format("one linearisation per step left {:.2g} of the forces unbalanced in the last one: take "
                     "smaller steps, or leave newton_max at its default",
                     summary.residual)});
  }
  if (last.unresolved > 0) {
    warnings.push_back(
        {Weight::minor, "coarse shells",
         fmt::format("{} shells bend by more than 30 degrees within themselves: the mesh is too coarse for "
                     "this load, refine it there",
                     last.unresolved)});
  }
  return warnings;
}

}  // namespace tunica
