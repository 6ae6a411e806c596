#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/report/detail/arguments.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

namespace tunica::report {
namespace {

std::string text_at(const PipelineCase& one, const std::string& stage, const std::string& key) {
  const Json value = one.at(stage, key);
  return value.is_string() ? value.get<std::string>() : "";
}

Markup next_lines(const CaseReport& one) {
  Markup lines;
  for (const NextStep& next : next_steps(one)) {
    lines += part("next_step", {{"what", next.what}, {"command", next.command}});
  }
  return lines;
}

Markup verdict(const CaseReport& one) {
  const PipelineCase& source = one.source;
  const std::string status = status_of(one);
  if (is_inaccurate(source)) {
    Markup line = part("verdict_inaccurate",
                       {{"reached", one.redacted(accuracy_reached(source)->text())}, {"why", why_inaccurate(one)}});
    return line += next_lines(one);
  }
  if (status == "failed") {
    Markup line = part("verdict_failed", {{"stage", source.stage == "none" ? "the start" : source.stage},
                                          {"exit", told_exit(source)},
                                          {"message", one.redacted(source.message)}});
    return line += next_lines(one);
  }
  const std::string warnings = one.warnings.empty()       ? "no warning"
                               : one.warnings.size() == 1 ? "1 warning"
                                                          : fmt::format("{} warnings", one.warnings.size());
  const bool converged = source.at("simulate", "result.converged") == true;
  return part("verdict",
              {{"status", status}, {"done", converged ? "Done and converged" : "Done"}, {"warnings", warnings}});
}

Markup big_number(const char* key, const std::string& label, const CaseReport& one, const std::string& aside) {
  const Measure& what = measure(key);
  const auto value = what.value(one.source);
  return part("big_number", {{"label", label},
                             {"value", value ? what.text(*value) : "–"},
                             {"unit", value ? what.unit : ""},
                             {"aside", aside}});
}

// Whether shells were fitted to the surface half of a wall away.
bool is_fitted_to_middle(const CaseReport& one) {
  return one.source.at("relax", "result.mid_surface.error_mm").is_object();
}

bool is_prestressed(const CaseReport& one) { return one.source.at("simulate", "result.prestress").is_object(); }

bool is_unloaded(const CaseReport& one) { return one.source.at("simulate", "result.unloaded").is_object(); }

// How far a number may be off by its mesh and model, where that is known.
// @param answer  of the estimates in the report
std::string plus_minus(const CaseReport& one, const char* key, const std::string& answer) {
  const auto percent = measure(key).value(one.source);
  const bool doubtful = one.source.at("simulate", "result.estimates." + answer + ".credible") == false;
  return percent ? "estimated error " + figure_above(*percent) + (doubtful ? " %, not credible; " : " %; ") : "";
}

std::string share_of_bending(const CaseReport& one) {
  const auto share = measure("bending_share_percent").value(one.source);
  return share ? figure(*share) + " % of it bending; " : "";
}

// Of a motion the numbers are those of its end.
std::string on_the_way(const CaseReport& one) {
  const Json peak = one.source.at("simulate", "result.peak.max_displacement_mm");
  return peak.is_number()
             ? ", at the end of the motion; " + figure(peak.get<double>()) + " mm at most in the states written"
             : "";
}

Markup three_numbers(const CaseReport& one) {
  const auto maximum = measure("stress_max_kpa").value(one.source);
  const auto percent = measure("distance_percent").value(one.source);
  const std::string pressure = shown(one.source, "pressure_kpa");
  const std::string whence = is_unloaded(one)      ? ", from the shape without load"
                             : is_prestressed(one) ? ", from the image on, which shows the wall under pressure"
                                                   : "";
  Markup list;
  const std::string at_faces = maximum ? plus_minus(one, "stress_error_percent", "stress_p99_mpa") +
                                             "von Mises, at either face; largest " + figure(*maximum) + " kPa"
                                       : "not computed";
  if (measure("membrane_p99_kpa").value(one.source)) {
    list += big_number("membrane_p99_kpa", "Membrane stress, 99th percentile", one,
                       plus_minus(one, "membrane_error_percent", "membrane_p99_mpa") +
                           "von Mises, mean over the wall; at its faces " + shown(one.source, "stress_p99_kpa") + " (" +
                           share_of_bending(one) + at_faces + ")");
  } else {
    list += big_number("stress_p99_kpa", "Wall stress, 99th percentile", one, at_faces);
  }
  list +=
      big_number("max_displacement_mm", "Largest displacement", one,
                 !measure("max_displacement_mm").value(one.source) ? "not computed"
                 : rests_as_imaged(one.source)
                     ? "by construction: under " + one.redacted(pressure) + " the wall rests where the image shows it"
                     : plus_minus(one, "displacement_error_percent", "max_displacement_mm") +
                           (pressure.empty() ? "of the curved surface" : "under " + one.redacted(pressure) + whence) +
                           on_the_way(one));
  const bool in_middle = is_fitted_to_middle(one);
  list +=
      big_number("distance_mm", in_middle ? "Shells to middle of the wall, at most" : "Shells to surface, at most", one,
                 percent ? "certified, both ways; " + measure("distance_percent").text(*percent) +
                               " % of the organ's diagonal; of the shape, not of stress"
                         : "not certified");
  return part("three_numbers", {{"numbers", list}});
}

// What is known of the error that the shells' number makes in the answer.
Markup discretisation(const CaseReport& one) {
  if (!measure("max_displacement_mm").value(one.source)) {
    return {};
  }
  const auto reached = accuracy_reached(one.source);
  if (!reached && measure("stress_error_percent").value(one.source)) {
    return part("error_beside");
  }
  if (!reached) {
    return part(is_fitted_to_middle(one) || is_unloaded(one) ? "error_by_second_run" : "error_by_accuracy");
  }
  const std::string of = one.redacted(reached->of);
  const bool credible = one.source.at("simulate", "result.accuracy.credible") == true;
  if (!reached->percent) {
    return part("error_unknown", {{"of", of}});
  }
  return part("error_of_accuracy", {{"of", of},
                                    {"how", credible ? "below" : "estimated at"},
                                    {"percent", figure_above(*reached->percent)},
                                    {"asked", figure(reached->asked)},
                                    {"doubt", credible ? "" : ", which is not credible"}});
}

// The colour bar, whose texts the page's script changes with the colours.
Markup legend(const CaseReport& one) {
  if (one.organ.empty()) {
    return {};
  }
  Markup stops;
  const auto colours = surface_colours();
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const auto [red, green, blue] = colours[i];
    stops += part("stop", {{"offset", fmt::format("{:.4g}", real(i) / real(colours.size() - 1))},
                           {"colour", fmt::format("#{:02x}{:02x}{:02x}", red, green, blue)}});
  }
  const bool loaded = one.picture_top > 0;
  return part("legend", {{"quantity", loaded ? "Membrane stress (von Mises)" : "Shells"},
                         {"hidden", Markup{loaded ? "" : " hidden"}},
                         {"id", one.id()},
                         {"stops", stops},
                         {"top", loaded ? figure(one.picture_top * 1e3) + " kPa" : ""},
                         {"drawn", loaded ? fmt::format("Loaded; displacement drawn × {}.", figure(one.magnification))
                                          : "Drawn as imaged."}});
}

Markup organ_figure(const CaseReport& one, int level) {
  if (one.picture.empty()) {
    return {};
  }
  Markup made = heading(level, "The organ");
  const std::string what =
      one.picture_top > 0 ? "The loaded organ, coloured by the membrane stress of its wall" : "The organ as imaged";
  const Markup data = one.organ.empty() ? Markup{} : part("organ_attribute", {{"id", one.id()}});
  made += part(
      "organ",
      {{"data", data}, {"picture", data_address("image/png", one.picture)}, {"what", what}, {"legend", legend(one)}});
  if (!one.organ.empty()) {
    made += part("organ_data", {{"id", one.id()}, {"bytes", one.organ}});
  }
  return made;
}

Markup slices_figure(const CaseReport& one, int level) {
  if (one.slices.empty()) {
    return {};
  }
  Markup made = heading(level, "Shells on the image");
  return made += part("slices", {{"picture", data_address("image/png", one.slices)}});
}

struct Line {
  std::string head;
  std::string value;
};

Markup table_of(const std::string& caption, const std::vector<Line>& lines) {
  if (lines.empty()) {
    return {};
  }
  Markup rows;
  for (const Line& line : lines) {
    rows += part("fact", {{"head", line.head}, {"value", line.value}});
  }
  return part("facts", {{"caption", caption}, {"rows", rows}});
}

// Values of a cohort's columns; what is not known has no line.
std::vector<Line> lines_of(const CaseReport& one, const std::vector<const char*>& keys) {
  std::vector<Line> lines;
  for (const char* key : keys) {
    const Measure& what = measure(key);
    if (const auto value = what.value(one.source)) {
      lines.push_back({what.title, what.text(*value) + " " + what.unit});
    }
  }
  return lines;
}

void add_if_known(std::vector<Line>& lines, const CaseReport& one, const char* stage, const char* key,
                  const std::string& head, const std::string& unit = "") {
  const Json value = one.source.at(stage, key);
  if (value.is_boolean()) {
    lines.push_back({head, value.get<bool>() ? "yes" : "no"});
  } else if (value.is_number_integer()) {
    lines.push_back({head, fmt::format("{} {}", value.get<long long>(), unit)});
  } else if (value.is_number()) {
    lines.push_back({head, figure(value.get<double>()) + " " + unit});
  } else if (value.is_string()) {
    lines.push_back({head, one.redacted(value.get<std::string>())});
  }
}

Markup geometry_and_mesh(const CaseReport& one) {
  std::vector<Line> geometry = lines_of(one, {"volume_ml", "area_cm2", "diagonal_mm"});
  add_if_known(geometry, one, "extract", "result.triangles", "Triangles");
  add_if_known(geometry, one, "extract", "result.components", "Components");
  add_if_known(geometry, one, "extract", "result.euler", "Euler number");
  add_if_known(geometry, one, "extract", "result.closed", "Closed");
  std::vector<Line> mesh =
      lines_of(one, {"shells", "distance_mm", "distance_percent", "mean_distance_mm", "min_angle_deg"});
  if (!is_refitted(one.source)) {
    add_if_known(mesh, one, "relax", "result.normal_error_deg.mean", "Normals, mean error", "°");
    add_if_known(mesh, one, "relax", "result.size_ratio", "Neighbours' size ratio");
    add_if_known(mesh, one, "relax", "result.self_intersections", "Self-intersections");
    add_if_known(mesh, one, "relax", "result.stopped", "Fit ended");
  }
  return table_of("Geometry", geometry) += table_of("Mesh", mesh);
}

Markup mechanics(const CaseReport& one) {
  if (one.source.at("simulate", "ok") != true) {
    return {};
  }
  std::vector<Line> lines =
      lines_of(one, {"membrane_p99_kpa", "membrane_mean_kpa", "tension_p99_n_per_mm", "stress_p99_kpa",
                     "bending_share_percent", "stress_max_kpa", "left_out_percent", "strain_p99_percent",
                     "max_displacement_mm", "volume_change_percent"});
  if (const Json volume = one.source.at("simulate", "result.unloaded.volume_mm3"); volume.is_number()) {
    lines.push_back({"Volume within the shells, without load", figure(1e-3 * volume.get<double>()) + " ml"});
  }
  add_if_known(lines, one, "simulate", "result.unloaded.distance_mm.mean", "Off the image under its pressure, mean",
               "mm");
  add_if_known(lines, one, "simulate", "result.strain_energy_mj", "Strain energy", "mJ");
  add_if_known(lines, one, "simulate", "result.converged", "Converged");
  add_if_known(lines, one, "simulate", "result.residual", "Residual");
  add_if_known(lines, one, "simulate", "result.newton_iterations", "Newton iterations");
  add_if_known(lines, one, "simulate", "result.steps", "Steps");
  add_if_known(lines, one, "simulate", "result.dof", "Degrees of freedom");
  return table_of("Mechanics", lines);
}

// As the user wrote them, in his units.
std::vector<Line> stated_lines(const CaseReport& one) {
  std::vector<Line> lines;
  for (const char* key :
       {"pressure_kpa", "imaged_at_kpa", "thickness_mm", "young_mpa", "poisson", "density_kg_per_m3"}) {
    if (const std::string text = shown(one.source, key); !text.empty()) {
      lines.push_back({measure(key).title, one.redacted(text)});
    }
  }
  const Json fixes = one.source.at("simulate", "stated.fix");
  for (const Json& fix : fixes.is_array() ? fixes : Json::array()) {
    if (fix.is_string()) {
      lines.push_back({"Held", one.redacted(fix.get<std::string>())});
    }
  }
  return lines;
}

// A quantity of the resolved scene, whose digits are those that give the same number again, for people.
std::string rounded_quantity(const std::string& text) {
  const std::size_t end = text.find_first_not_of("+-.0123456789");
  const std::size_t unit =
      end != std::string::npos && text[end] == 'e' ? text.find_first_not_of("+-0123456789", end + 1) : end;
  const auto value = unit == std::string::npos ? std::nullopt : parse_number(text.substr(0, unit));
  return value ? fmt::format("{:.6g} {}", *value, text.substr(unit)) : text;
}

// The resolved scene, but for the places of meshes.
Markup inputs(const CaseReport& one) {
  std::vector<Line> lines;
  const Json scene = one.source.at("simulate", "stated.scene");
  for (const auto& [section, tables] : scene.items()) {
    for (const Json& item : tables.is_array() ? tables : Json::array({tables})) {
      for (const auto& [key, value] : item.items()) {
        if (key != "mesh") {
          lines.push_back(
              {one.redacted(section + " · " + key),
               one.redacted(value.is_string() ? rounded_quantity(value.get<std::string>()) : value.dump())});
        }
      }
    }
  }
  return table_of("Inputs as stated", stated_lines(one)) += table_of("All settings as resolved, SI units", lines);
}

Markup costs(const CaseReport& one) {
  Markup rows;
  for (const char* stage : pipeline_stages) {
    const Json seconds = one.source.at(stage, "seconds.total");
    const Json memory = one.source.at(stage, "peak_mib");
    const Json threads = one.source.at(stage, "threads");
    if (seconds.is_number()) {
      rows += part("cost", {{"stage", stage},
                            {"seconds", figure(seconds.get<double>())},
                            {"memory", memory.is_number() ? figure(memory.get<double>()) : "–"},
                            {"threads", threads.is_number() ? figure(threads.get<double>()) : "–"}});
    }
  }
  return rows.text.empty() ? Markup{} : part("costs", {{"rows", rows}});
}

Markup warnings_section(const CaseReport& one, int level) {
  if (one.warnings.empty()) {
    return {};
  }
  Markup items;
  for (const ToldWarning& told : one.warnings) {
    const std::string& kind = told.warning.kind;
    items += part("warning", {{"kind", kind.empty() ? Markup{} : part("warning_kind", {{"kind", kind}})},
                              {"stage", told.stage},
                              {"serious", told.warning.weight == Weight::major ? ", serious" : ""},
                              {"text", told.warning.text}});
  }
  return heading(level, "Warnings") += part("list", {{"class", "warnings"}, {"items", items}});
}

Markup list_section(const std::string& title, const std::vector<std::string>& texts, int level) {
  Markup items;
  for (const std::string& text : texts) {
    items += part("item", {{"text", text}});
  }
  return texts.empty() ? Markup{} : heading(level, title) += part("list", {{"class", "warnings"}, {"items", items}});
}

Markup files(const CaseReport& one, int level, bool paths) {
  Markup rows;
  for (const char* stage : pipeline_stages) {
    for (const char* kind : {"inputs", "outputs"}) {
      for (const auto& [path, hash] : one.source.files(stage, kind)) {
        if (path.empty()) {
          continue;
        }
        rows += part("file", {{"stage", stage},
                              {"did", std::string(kind) == "inputs" ? "read" : "wrote"},
                              {"path", paths ? path.string() : one.redacted(path.string())},
                              {"hash", hash.empty() ? "–" : hash}});
      }
    }
  }
  if (rows.text.empty()) {
    return {};
  }
  return heading(level, "Files") +=
         part("scroll", {{"name", "Files of " + one.name}, {"table", part("files", {{"rows", rows}})}});
}

Markup commands(const CaseReport& one, int level) {
  std::string lines;
  std::string version;
  for (const char* stage : pipeline_stages) {
    const std::string command = text_at(one.source, stage, "command");
    lines += command.empty() ? "" : one.redacted(command) + "\n";
    version = version.empty() ? text_at(one.source, stage, "version") : version;
  }
  if (lines.empty()) {
    return {};
  }
  return heading(level, "Commands") += part("commands", {{"version", version}, {"commands", lines}});
}

}  // namespace

std::string why_inaccurate(const CaseReport& one) {
  std::string why;
  const Json reasons = one.source.at("simulate", "result.accuracy.reasons");
  for (const Json& reason : reasons.is_array() ? reasons : Json::array()) {
    why += reason.is_string() ? (why.empty() ? "" : "; ") + one.redacted(reason.get<std::string>()) : "";
  }
  return why.empty() ? one.redacted(one.source.message) : why;
}

std::string told_exit(const PipelineCase& one) {
  return one.exit.empty() || one.exit == "0" ? "" : ", exit code " + one.exit;
}

namespace {

// The command of the stage that failed, with another value of a flag.
std::string command_with(const CaseReport& one, const char* flag, const Json& value) {
  Json arguments = arguments_of(one.source, one.source.stage);
  arguments[flag] = value;
  arguments["--force"] = true;  // its report is there
  return one.redacted(command_of("tunica-" + one.source.stage, arguments));
}

// Of a run whose accuracy was not reached: finer shells, or what was reached as the request.
std::vector<NextStep> steps_to_accuracy(const CaseReport& one) {
  constexpr double margin = 1.25;  // of the estimate, which is to be below the request
  const Json levels = one.source.at("simulate", "result.accuracy.levels");
  const Json last = levels.is_array() && !levels.empty() && levels.back().is_object() ? levels.back() : Json::object();
  const Json shells = last.value("shells", Json());
  std::vector<NextStep> steps;
  if (shells.is_number_unsigned()) {
    constexpr std::size_t split = 4;  // each shell of a level in the next one
    // Two levels more, as the next one alone may fall short.
    const std::size_t most = split * split * shells.get<std::size_t>();
    steps.push_back(
        {fmt::format("Next, finer (up to {} shells)", most), command_with(one, "--max-shells", std::to_string(most))});
  }
  const Json reasons = one.source.at("simulate", "result.accuracy.reasons");
  const auto percent = accuracy_reached(one.source)->percent;
  // With more than one reason another one than the number of shells stands against any accuracy.
  if (percent && reasons.is_array() && reasons.size() == 1) {
    steps.push_back(
        {"Or, content with what was reached", command_with(one, "--accuracy", figure_above(margin * *percent) + "%")});
  }
  return steps;
}

}  // namespace

std::vector<NextStep> next_steps(const CaseReport& one) {
  const PipelineCase& source = one.source;
  const std::string command = text_at(source, source.stage, "command");
  if (command.empty()) {
    return {};
  }
  if (is_inaccurate(source)) {
    return steps_to_accuracy(one);
  }
  const Json volumes = source.at("extract", "inputs");
  if (source.stage == "extract" && source.exit == "3" && volumes.is_array() && !volumes.empty()) {
    // What is in the volume is what to look at.
    std::error_code unknown;
    if (const auto volume = argument(source, "extract", "VOLUME");
        volume && std::filesystem::exists(*volume, unknown)) {
      return {{"Next", one.redacted(command_of("tunica-extract", {{"VOLUME", *volume}, {"--info", true}}))}};
    }
  }
  return {{"Next", arguments_of(source, source.stage).empty() ? one.redacted(command + " --verbose")
                                                              : command_with(one, "--verbose", true)}};
}

Markup case_section(const CaseReport& one, int level, bool paths) {
  Markup tables = geometry_and_mesh(one);
  tables += mechanics(one);
  tables += inputs(one);
  tables += costs(one);
  return part("case", {{"verdict", verdict(one)},
                       {"numbers", three_numbers(one)},
                       {"discretisation", discretisation(one)},
                       {"warnings", warnings_section(one, level)},
                       {"different", list_section("Outputs that are not what the reports say", one.different, level)},
                       {"organ", organ_figure(one, level)},
                       {"slices", slices_figure(one, level)},
                       {"missing", list_section("Not drawn", one.missing, level)},
                       {"notes", list_section("Notes", one.notes, level)},
                       {"numbers_head", heading(level, "Numbers")},
                       {"tables", tables},
                       {"files", files(one, level, paths)},
                       {"commands", commands(one, level)},
                       {"methods", methods_section(one, level)}});
}

}  // namespace tunica::report
