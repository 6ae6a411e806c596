#include "tunica/io/result/run_report.hpp"

#include "tunica/core/quantity.hpp"
#include "tunica/io/result/detail/contact_record.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/doubts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
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

Json list_of_when(const std::vector<RunRecord::When>& when, bool is_motion) {
  Json record{{"time_s", Json::array()}, {"load_factor", Json::array()}};
  for (const RunRecord::When& one : when) {
    record["time_s"].push_back(is_motion ? Json(one.time) : Json());
    record["load_factor"].push_back(one.load_factor);
  }
  return record;
}

/// A list of what `of` makes of each value.
template <typename Value, typename Of>
Json list(const std::vector<Value>& values, const Of& of) {
  Json made = Json::array();
  std::ranges::transform(values, std::back_inserter(made), of);
  return made;
}

void report_tracks(Json& result, const RunRecord& record) {
  for (const auto& [name, values] : record.probes) {
    Json& track = result["probes"][name] = list_of_when(record.when, record.is_motion);
    track["displacement_mm"] = list(values, [](const auto& value) { return triple(value.displacement); });
    track["rotation_rad"] = list(values, [](const auto& value) { return triple(value.rotation); });
  }
  for (const auto& [name, values] : record.contacts) {
    Json& track = result["contacts"][name] = list_of_when(record.moved, record.is_motion);
    track["force_n"] = list(values, [](const ContactState& now) { return triple(now.force); });
    track["moment_n_mm"] = list(values, [](const ContactState& now) { return triple(now.moment); });
    track["area_mm2"] = list(values, [](const ContactState& now) { return known(now.area); });
    track["smallest_gap_mm"] = list(values, [](const ContactState& now) {
      return Json{{"lower", known(now.gap_lower)}, {"upper", known(now.gap_upper)}};
    });
    track["points"] = list(values, [](const ContactState& now) { return Json(now.points); });
    track["slip_mm"] = list(values, [](const ContactState& now) { return known(now.slip); });
  }
  for (const auto& [name, values] : record.rigids) {
    Json& track = result["rigid"][name] = list_of_when(record.moved, record.is_motion);
    track["force_n"] = list(values, [](const RigidState& now) { return triple(now.force); });
    track["moment_n_mm"] = list(values, [](const RigidState& now) { return triple(now.moment); });
    track["position_mm"] = list(values, [](const RigidState& now) { return triple(now.position); });
  }
  if (!record.contacts.empty()) {
    result["balance"] = {{"force", or_null(record.force_imbalance)}, {"moment", or_null(record.moment_imbalance)}};
  }
}

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

void report_last_state(Json& result, const RunRecord& record) {
  if (!record.last) {
    return;
  }
  const LastState& last = *record.last;
  result["max_displacement_mm"] = last.largest_displacement;
  result["max_node_displacement_mm"] = record.node_displacement;
  if (record.shells > 0) {
    result["displacement_p99_mm"] = last.displacement_p99;
    result["wall"] = wall_report(last.wall);
    result["wall"]["left_out_percent"] = 1e2 * last.wall.left_out;
    result["wall"]["whole"] = wall_report(last.wall.whole);
  }
  result["volume_before_mm3"] = or_null(record.volume_before);
  result["volume_after_mm3"] = or_null(record.volume_after);
  result["strain_energy_mj"] = record.strain_energy;
  result["residual"] = record.residual;
  if (last.peak) {
    result["peak"] = {{"max_displacement_mm", last.peak->displacement}, {"time_s", last.peak->time}};
  }
}

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

// Modes have shapes, but no size.
void report_modes(Json& result, const Summary& summary) {
  for (const char* key : {"max_displacement_mm", "displacement_p99_mm", "max_node_displacement_mm", "wall",
                          "volume_after_mm3", "strain_energy_mj"}) {
    result[key] = nullptr;
  }
  result["frequencies_hz"] = summary.frequencies;
  result["buckling_factors"] = summary.buckling_factors;
}

Json unloaded_report(const Unloaded& unloaded) {
  return {{"volume_mm3", or_null(unloaded.volume)},
          {"distance_mm", {{"mean", unloaded.mean_distance}, {"max", unloaded.largest_distance}}},
          {"roundness", unloaded.roundness
                            ? Json{{"image", unloaded.roundness->image}, {"unloaded", unloaded.roundness->unloaded}}
                            : Json()},
          {"iterations", unloaded.iterations}};
}

Json estimates_report(const Estimates& estimates) {
  Json report = Json::object();
  for (const auto& [key, estimate] : estimates) {
    report[key] = {{"percent", known(100 * estimate.error)}, {"credible", estimate.credible}, {"from", estimate.from}};
  }
  return report;
}

}  // namespace

RunRecord::RunRecord(const Model& model, const RunSettings& run)
    : begun(true),
      nodes(model.node_count()),
      is_motion(std::holds_alternative<DynamicRun>(run.kind)),
      is_modes(std::holds_alternative<FrequencyRun>(run.kind) || std::holds_alternative<BucklingRun>(run.kind)) {
  for (const ShellBody& body : model.shells) {
    shells += body.mesh.triangles.size();
  }
  for (const SolidBody& body : model.solids) {
    tetrahedra += body.mesh.tetrahedra.size();
  }
  const auto begin = [](auto& tracks, const auto& named) {
    for (const auto& one : named) {
      tracks.push_back({one.name, {}});
    }
  };
  begin(probes, model.probes);
  begin(contacts, model.contacts);
  begin(rigids, model.rigids);
}

void RunRecord::take(const Model& model, const State& state, const ElementFields& fields) {
  constexpr double most_bending = std::numbers::pi / 6;
  node_displacement = 0;
  for (const Vec3& u : state.displacement) {
    node_displacement = std::max(node_displacement, u.norm());
  }
  std::optional<Peak> peak = last ? last->peak : std::nullopt;
  if (is_motion && (!peak || peak->displacement < fields.largest_displacement)) {
    peak = {fields.largest_displacement, state.time};
  }
  const double energy = std::abs(state.strain_energy);
  const bool is_most = !last || energy >= last->most_strain_energy;
  last = {fields.wall,
          fields.largest_displacement,
          fields.displacement_p99,
          fields.solid_strain_p99,
          is_most ? fields.solid_error : last->solid_error,
          is_most ? fields.layer_error : last->layer_error,
          is_most ? fields.roughness : last->roughness,
          is_most ? energy : last->most_strain_energy,
          count_unresolved(model, state, most_bending),
          peak};
  if (!volume_before) {
    volume_before = state.volume;
  }
  volume_after = state.volume;
  strain_energy = state.strain_energy;
  residual = state.residual;
  when.push_back({state.time, state.load_factor});
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const std::size_t node = model.first_node(model.probes[i].body) + model.probes[i].node;
    probes[i].values.push_back({state.displacement[node], state.rotation[node]});
  }
  if (state.time == 0) {
    return;  // the reference, before anything moves
  }
  moved.push_back(when.back());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    contacts[i].values.push_back(contact_of(state, i));
  }
  for (std::size_t i = 0; i < rigids.size(); ++i) {
    rigids[i].values.push_back(rigid_of(state, i));
  }
  const auto largest = [](std::optional<double>& so_far, double now) {
    now = so_far ? std::max(*so_far, now) : now;
    so_far = std::isfinite(now) ? std::optional(now) : std::nullopt;
  };
  if (!state.contacts.empty()) {
    largest(force_imbalance, state.force_imbalance);
    largest(moment_imbalance, state.moment_imbalance);
  }
}

Json accuracy_report(const Accuracy& accuracy, bool times) {
  Json levels = Json::array(), choices = Json::array();
  for (const AccuracyLevel& level : accuracy.levels) {
    levels.push_back({{"shells", level.shells},
                      {"value", level.value},
                      {"mean_distance_mm", or_null(level.mean_distance)},
                      {"newton_iterations", level.newton_iterations}});
    if (times) {
      levels.back()["seconds"] = level.seconds;
    }
  }
  for (const AccuracyChoice& choice : accuracy.choices) {
    choices.push_back({{"part", choice.part},
                       {"chosen", choice.chosen},
                       {"error_percent", choice.error ? Json(100 * *choice.error) : Json()},
                       {"instead", choice.instead}});
    if (times) {
      choices.back()["would_cost"] = choice.would_cost;
    }
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

Json run_report(const RunRecord& record) {
  if (!record.begun) {
    return Json::object();
  }
  Json result = {{"shells", record.shells},
                 {"tetrahedra", record.tetrahedra},
                 {"nodes", record.nodes},
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
                 {"estimates", estimates_report(record.estimates)},
                 {"short_waves_stiffened_from", nullptr}};
  report_tracks(result, record);
  report_last_state(result, record);
  if (record.accuracy) {
    Json& claim = result["accuracy"] = accuracy_report(*record.accuracy);
    if (const auto& made = record.certificate) {
      claim["min_angle_deg"] = made->angle;
      if (const auto& distance = made->distance) {
        claim["hausdorff_mm"] = {{"lower", distance->lower}, {"upper", distance->upper}};
        claim["hausdorff_percent"] = {{"lower", 100 * distance->lower / made->diagonal},
                                      {"upper", 100 * distance->upper / made->diagonal}};
      }
    }
  }
  if (record.prestress_residual) {
    result["prestress"] = {{"pressure_mpa", or_null(record.imaging_pressure)},
                           {"residual", *record.prestress_residual},
                           {"stable", or_null(record.rests_as_imaged)}};
  }
  if (record.unloaded) {
    result["unloaded"] = unloaded_report(*record.unloaded);
  }
  if (record.summary) {
    report_summary(result, *record.summary, record.converged, record.duration);
    if (record.is_modes) {
      report_modes(result, *record.summary);
    }
  }
  return result;
}

std::vector<Warning> prestress_warnings(const RunRecord& record) {
  if (record.rests_as_imaged.value_or(true)) {
    return {};
  }
  return {
      {Weight::major, "unstable image",
       "under the pressure of the image a wall of this stiffness and thickness is not stable in the shape of the "
       "image: "
       "a dent would snap out by itself. The stress in that shape balances the pressure and holds. Displacements, and "
       "stresses under another pressure, are those after the snap: smooth the surface (SMOOTH), take a stiffer or "
       "thicker wall, or put it into a bed (--support 1e5N/m3, SUPPORT=1e5N/m3)"}};
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

std::vector<Warning> estimate_warnings(const Estimates& estimates, const std::optional<Quantity>& asked) {
  std::vector<Warning> warnings;
  for_each_notable(estimates, [&](const TellingAnswer& answer, const Estimate& estimate) {
    const Weight weight = estimate.error < answer.large ? Weight::minor : Weight::major;
    if (asked) {
      if (answer.of != *asked) {
        warnings.push_back(
            {weight, "error of the mesh",
             fmt::format("{} was not asked for, and may be off by {} by its mesh and model ({}): --of {} "
                         "(OF={}) asks for it",
                         answer.name, percent_text(estimate.error), estimate.from, name_of(answer.of),
                         name_of(answer.of))});
      }
      return;
    }
    warnings.push_back({weight, "error of the mesh",
                        fmt::format("{} may be off by {} by its mesh ({}): take more shells (SHELLS), or let "
                                    "--accuracy 5% --of {} (ACCURACY=5% OF={}) choose them",
                                    answer.name, percent_text(estimate.error), estimate.from, name_of(answer.of),
                                    name_of(answer.of))});
  });
  return warnings;
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
  return fmt::format("accuracy not reached: {} {} with {} shells, {}, {:.3g} % asked: {}", name_of(accuracy.request.of),
                     value_text(accuracy.request.of, accuracy.levels.back().value), accuracy.levels.back().shells,
                     accuracy.estimate
                         ? fmt::format("estimated error {}{}", percent_text(*accuracy.estimate),
                                       *accuracy.estimate < accuracy.request.within ? " (not credible)" : "")
                         : "without a credible estimate of its error",
                     100 * accuracy.request.within, fmt::join(accuracy.reasons, "; "));
}

std::vector<std::string> accuracy_notes(const Accuracy& accuracy) {
  const AccuracyRequest& request = accuracy.request;
  std::vector<std::string> lines;
  if (accuracy.estimate && accuracy.reasons.empty()) {
    lines.push_back(fmt::format(
        "the error of the {} is estimated to be below {:.2g} % of it, from levels that agree ({:.2g} % asked for)",
        name_of(request.of), 100 * *accuracy.estimate, 100 * request.within));
  }
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

std::vector<Warning> contact_warnings(const RunRecord& record) {
  std::vector<Warning> warnings;
  for (std::size_t c = 0; c < record.contacts.size(); ++c) {
    const auto& [name, states] = record.contacts[c];
    if (states.empty() || std::ranges::any_of(states, [](const ContactState& state) { return state.points != 0; })) {
      continue;
    }
    const std::vector<double>& pressures = record.summary->contact_pressures;
    if (c < pressures.size() && pressures[c] > 0) {
      warnings.push_back({Weight::note, "contact within steps",
                          fmt::format("{}: touches within steps only, with up to {}, and at the end of none: shorter "
                                      "steps show where",
                                      name, pressure_text(pressures[c]))});
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
  } else if (constexpr double most = 0.5; wall.left_out > most) {
    warnings.push_back({Weight::note, "little of the wall counted",
                        fmt::format("{:.0f} % of the wall lies within two bending lengths sqrt(R t) of rims, supports, "
                                    "point loads or jumps of the thickness: the numbers of the wall are of the rest",
                                    100 * wall.left_out)});
  }
  constexpr double notable = 1.05;
  if (wall.is_max_on_held && wall.whole.stress_max > notable * wall.whole.stress_p99) {
    warnings.push_back({Weight::note, "largest stress at a support",
                        fmt::format("the largest stress of the whole wall, {}, lies on a held rim or another support, "
                                    "and says more of the support than of the organ",
                                    pressure_text(wall.whole.stress_max))});
  }
}

/// @param touches  there is contact
std::vector<Warning> energy_warnings(const EnergyBalance& energy, bool touches, Integrator integrator) {
  std::vector<Warning> warnings;
  if (energy.gaining_step > 0) {
    warnings.push_back(
        {Weight::major, "long steps",
         fmt::format("time integration gains energy, {} of the largest so far, more than 10 % from step {} ({:.6g} s) "
                     "on: what moves is faster than it should be: {}",
                     percent_text(energy.gained), energy.gaining_step, energy.gaining_time,
                     !touches ? "take shorter steps, or a smaller spectral_radius"
                     : integrator == Integrator::backward_euler
                         ? "let bodies begin farther apart than the resolution of their contact, or take a finer one"
                         : "take integrator = \"backward-euler\", or adaptive = \"0.01%\"")});
  }
  constexpr double notable_loss = 0.05;
  if (energy.lost > notable_loss * energy.largest) {
    warnings.push_back(
        {Weight::minor, "long steps",
         fmt::format("time integration took {:.3g} % of the energy: what swings does so too little, what falls is "
                     "ahead by about as much; the state of rest is right. For the motion take shorter steps{}",
                     1e2 * energy.lost / energy.largest,
                     integrator != Integrator::backward_euler ? ", or a larger spectral_radius"
                     : touches                                ? ""
                                                              : ", or integrator = \"generalised-alpha\" in a scene")});
  }
  return warnings;
}

/// The first of some load factors.
std::string factors_text(std::vector<double> factors) {
  constexpr std::size_t most = 3;
  const bool more = factors.size() > most;
  factors.resize(std::min(factors.size(), most));
  return fmt::format("{:.4g}{}", fmt::join(factors, ", "), more ? " …" : "");
}

/// What is wrong with the last state of a path, or of iterations that were counted.
std::string unstable_text(const Summary& summary) {
  std::string text =
      "the last state is not stable: a body under its load alone leaves it, and stress and "
      "displacement are not those that it comes to";
  if (!summary.branch_factors.empty()) {
    text += fmt::format("; other paths leave this one at load factor {}", factors_text(summary.branch_factors));
  }
  if (!summary.limit_factors.empty()) {
    text += fmt::format("; the load factor turns at {}", factors_text(summary.limit_factors));
  }
  return text + ". A static run with load control, the default solver and no newton_max goes on to a state of rest";
}

}  // namespace

std::optional<Warning> snap_warning(const Summary& summary) {
  if (summary.snaps.empty()) {
    return std::nullopt;
  }
  std::vector<double> factors;
  std::ranges::transform(summary.snaps, std::back_inserter(factors), &Snap::load_factor);
  return Warning{
      Weight::major, "limit load",
      fmt::format("beyond load factor {} the path is not stable: the body buckles or snaps, and goes on from the next "
                  "state of rest that was found, up to {:.3g} mm away. Others may be near: a dynamic run shows which "
                  "one the motion takes, arc length how the path itself goes on",
                  factors_text(factors), std::ranges::max(summary.snaps, {}, &Snap::distance).distance)};
}

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
  if (last.solid_strain_p99 > small_strain) {
    warnings.push_back(
        {Weight::major, "large strain",
         fmt::format("1 % of the solids of law corotational is strained by more than {:.3g} %: that law is meant for "
                     "strains of up to about 10 %: take law = \"neo-hookean\"",
                     1e2 * last.solid_strain_p99)});
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
  if (auto snap = snap_warning(summary)) {
    warnings.push_back(*std::move(snap));
  }
  if (summary.short_of_factor) {
    warnings.push_back(
        {Weight::major, "partial path",
         fmt::format("the path took all of its {} steps and ended at load factor {:.4g}: the numbers are "
                     "those of that load: more steps (max_steps) go on",
                     summary.steps, *summary.short_of_factor)});
  }
  if (summary.ends_unstable) {
    warnings.push_back({Weight::major, "unstable state", unstable_text(summary)});
  }
  if (summary.energy) {
    std::ranges::move(
        energy_warnings(*summary.energy, !summary.contact_pressures.empty(), std::get<DynamicRun>(run.kind).integrator),
        std::back_inserter(warnings));
  }
  constexpr double notable_bend = 0.25;  // of what swings with half of the largest motion: a ninth of its period
  if (summary.largest_bend > notable_bend * summary.largest_motion) {
    warnings.push_back(
        {Weight::minor, "long steps",
         fmt::format("the steps are long for this motion: between two of them it departs from a straight line by {} "
                     "of its largest value: take shorter ones, or error control (adaptive)",
                     percent_text(summary.largest_bend / summary.largest_motion))});
  }
  if (summary.stiffened_from) {
    warnings.push_back(
        {Weight::major, "coarse shells",
         fmt::format("the mesh is coarse for so thin a curved shell (h^2 > 3 R t): from {} {:.4g} on it would "
                     "have buckled edge by edge, so its elements were stiffened; whether the wall itself buckles this "
                     "mesh does not show: refine it",
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
