#include "tunica/report/detail/measures.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/report/detail/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica::report {
namespace {

using Value = std::function<std::optional<double>(const PipelineCase&)>;

std::optional<double> number(const Json& value) {
  return value.is_number() && std::isfinite(value.get<double>()) ? std::optional(value.get<double>()) : std::nullopt;
}

// A key of a stage's report.
Value reported(const char* stage, std::string key, double scale = 1) {
  return [stage, key = std::move(key), scale](const PipelineCase& one) {
    const auto value = number(one.at(stage, key));
    return value ? std::optional(*value * scale) : std::nullopt;
  };
}

// Of a run that came to its end: the last state of one that did not is under another load than the stated one.
Value answered(const char* key, double scale = 1) {
  return [value = reported("simulate", key, scale)](const PipelineCase& one) {
    return is_answered(one) ? value(one) : std::nullopt;
  };
}

// The estimated error of an answer: of the quantity that an accuracy was asked of, or as estimated besides.
// @param key  of the answer among the estimates
Value estimated(const char* of, const char* key) {
  return [of = std::string(of), place = fmt::format("result.estimates.{}.percent", key)](const PipelineCase& one) {
    const auto reached = is_answered(one) ? accuracy_reached(one) : std::nullopt;
    if (reached && reached->of == of && reached->percent) {
      return reached->percent;
    }
    return is_answered(one) ? number(one.at("simulate", place)) : std::nullopt;
  };
}

// An input as it was written; null where that is not known.
Json typed(const PipelineCase& one, const std::string& key) {
  const Json text = one.at("simulate", "stated.typed." + key);
  // A pressure left out is that of the image.
  const bool is_of_image = key == "pressure" && text.is_null() &&
                           one.at("simulate", "stated.pressure_mpa") == one.at("simulate", "stated.imaged_at_mpa");
  return is_of_image ? one.at("simulate", "stated.typed.imaged_at") : text;
}

// "120mmHg" as "120 mmHg"; empty where there is no number with a unit.
std::string with_blank_before_unit(const std::string& text) {
  // What follows the number, its exponent too, is the unit.
  constexpr const char* of_numbers = "+-.0123456789 ";
  std::size_t end = text.find_first_not_of(of_numbers);
  if (end != std::string::npos && end > 0 && (text[end] == 'e' || text[end] == 'E')) {
    end = text.find_first_not_of(of_numbers, end + 1);
  }
  if (end == std::string::npos || end == 0) {
    return {};
  }
  return text.substr(0, text.find_last_not_of(' ', end - 1) + 1) + " " + text.substr(end);
}

// An input as a number. @param key  in the report's `stated`, @param input  in its `typed`, @param scale  of that to
// the column's unit
Measure stated(Measure column, const std::string& key, const char* input, double scale = 1) {
  column.source = "simulate: stated." + key;
  column.input = input;
  column.value = reported("simulate", "stated." + key, scale);
  return column;
}

std::optional<double> shells(const PipelineCase& one) {
  return number(one.at(is_refitted(one) ? "simulate" : "relax", "result.shells"));
}

// Of the shells that carry the load: those that relax left, or finer ones that an accuracy asked for.
Value of_shells(const std::string& key) {
  return [=](const PipelineCase& one) {
    return number(is_refitted(one) ? one.at("simulate", "result.accuracy." + key) : one.at("relax", "result." + key));
  };
}

std::optional<double> mean_distance(const PipelineCase& one) {
  if (!is_refitted(one)) {
    return number(one.at("relax", "result.mean_distance_mm"));
  }
  const Json levels = one.at("simulate", "result.accuracy.levels");
  const bool told = levels.is_array() && !levels.empty() && levels.back().is_object();
  return told ? number(levels.back().value("mean_distance_mm", Json())) : std::nullopt;
}

// What was meshed; the report's volume of voxels is that of the whole label, with pieces that were left out.
std::optional<double> volume(const PipelineCase& one) {
  const auto enclosed = number(one.at("extract", "result.volume_mm3"));
  const auto voxels = number(one.at("extract", "result.voxel_volume_mm3"));
  const auto known = enclosed ? enclosed : voxels;
  return known ? std::optional(*known * 1e-3) : std::nullopt;
}

std::optional<double> volume_change(const PipelineCase& one) {
  const auto before = answered("result.volume_before_mm3")(one);
  const auto after = answered("result.volume_after_mm3")(one);
  return before && after && *before != 0 ? std::optional(100 * (*after / *before - 1)) : std::nullopt;
}

std::optional<double> seconds(const PipelineCase& one) {
  double sum = 0;
  for (const char* stage : pipeline_stages) {
    sum += number(one.at(stage, "seconds.total")).value_or(0);
  }
  return sum;
}

std::optional<double> memory(const PipelineCase& one) {
  double most = 0;
  for (const char* stage : pipeline_stages) {
    most = std::max(most, number(one.at(stage, "peak_mib")).value_or(0));
  }
  return most > 0 ? std::optional(most) : std::nullopt;
}

std::vector<Measure> make_geometry() {
  return {{"volume_ml", "Volume", "ml",
           "Volume that the extracted surface encloses; where it is open, that of the label's voxels, of a cut organ "
           "of those that are left.",
           "extract: result.volume_mm3 / 1000, or else result.voxel_volume_mm3 / 1000", true, volume},
          {"area_cm2", "Area", "cm²", "Area of the extracted surface.", "extract: result.area_mm2 / 100", true,
           reported("extract", "result.area_mm2", 1e-2)},
          {"diagonal_mm", "Diagonal", "mm", "Diagonal of the bounding box of the extracted surface.",
           "extract: result.diagonal_mm", false, reported("extract", "result.diagonal_mm")},
          {"shells", "Shells", "", "Number of curved triangles that carry the load.",
           "relax: result.shells; with an accuracy simulate: result.shells", false, shells},
          {"distance_mm", "Distance", "mm",
           "Certified upper bound of the two-sided Hausdorff distance between the curved shells and the extracted "
           "surface, or with a mid-surface and a thickness the middle of the wall.",
           "relax: result.hausdorff_mm.upper; with an accuracy simulate: result.accuracy.hausdorff_mm.upper", false,
           of_shells("hausdorff_mm.upper"), true},
          {"distance_percent", "Distance", "%", "The same, in percent of the surface's diagonal.",
           "relax: result.hausdorff_percent.upper; with an accuracy simulate: result.accuracy.hausdorff_percent.upper",
           true, of_shells("hausdorff_percent.upper"), true},
          {"mean_distance_mm", "Mean distance", "mm",
           "Mean distance of the curved shells from the surface and of that from them, the larger of the two.",
           "relax: result.mean_distance_mm; with an accuracy simulate: mean_distance_mm of the last of "
           "result.accuracy.levels",
           false, mean_distance},
          {"min_angle_deg", "Least angle", "°", "Smallest angle of a shell.",
           "relax: result.min_angle_deg; with an accuracy simulate: result.accuracy.min_angle_deg", true,
           of_shells("min_angle_deg")}};
}

std::vector<Measure> make_mechanics() {
  return {
      {"membrane_p99_kpa", "Membrane stress p99", "kPa",
       "99th percentile, by area, of the von Mises value of the mean stress over the wall.",
       "simulate: result.wall.membrane_p99_mpa × 1000", true, answered("result.wall.membrane_p99_mpa", 1e3)},
      {"membrane_error_percent", "Error of membrane stress", "%",
       "Estimated error of the 99th percentile of membrane stress by number of shells and model.",
       "simulate: result.estimates.membrane_p99_mpa.percent, or result.accuracy.estimate_percent of an accuracy of it",
       false, estimated("membrane", "membrane_p99_mpa"), true},
      {"membrane_mean_kpa", "Membrane stress mean", "kPa",
       "Mean, by area, of the von Mises value of the mean stress over the wall.",
       "simulate: result.wall.membrane_mean_mpa × 1000", false, answered("result.wall.membrane_mean_mpa", 1e3)},
      {"tension_p99_n_per_mm", "Tension p99", "N/mm",
       "99th percentile, by area, of the largest principal tension of the wall, per current length.",
       "simulate: result.wall.tension_p99_n_per_mm", false, answered("result.wall.tension_p99_n_per_mm")},
      {"stress_p99_kpa", "Stress p99", "kPa",
       "99th percentile, by area, of the von Mises stress at either face of the wall.",
       "simulate: result.wall.stress_p99_mpa × 1000", true, answered("result.wall.stress_p99_mpa", 1e3)},
      {"bending_share_percent", "Bending share", "%",
       "Part of the stress at the faces, where it passes its 99th percentile, that is bending.",
       "simulate: result.wall.bending_share_percent", false, answered("result.wall.bending_share_percent")},
      {"left_out_percent", "Area left out", "%",
       "Area near held or cut rims, point and edge loads and jumps that stress and strain leave out.",
       "simulate: result.wall.left_out_percent", false, answered("result.wall.left_out_percent")},
      {"stress_max_kpa", "Stress max.", "kPa", "Largest von Mises stress at either face of the wall.",
       "simulate: result.wall.stress_max_mpa × 1000", false, answered("result.wall.stress_max_mpa", 1e3)},
      {"stress_error_percent", "Error of stress", "%",
       "Estimated error of the 99th percentile of stress by number of shells and model.",
       "simulate: result.estimates.stress_p99_mpa.percent, or result.accuracy.estimate_percent of an accuracy of it",
       false, estimated("stress", "stress_p99_mpa"), true},
      {"strain_p99_percent", "Strain p99", "%",
       "99th percentile, by area, of the largest principal strain at either face of the wall.",
       "simulate: result.wall.strain_p99_percent", true, answered("result.wall.strain_p99_percent")},
      {"max_displacement_mm", "Displacement", "mm", "Largest displacement of the curved surface.",
       "simulate: result.max_displacement_mm", true, answered("result.max_displacement_mm")},
      {"displacement_error_percent", "Error of displacement", "%",
       "Estimated error of the largest displacement by number of shells and model.",
       "simulate: result.estimates.max_displacement_mm.percent, or result.accuracy.estimate_percent of an accuracy of "
       "it",
       false, estimated("displacement", "max_displacement_mm"), true},
      {"volume_change_percent", "Volume change", "%", "Change of the volume that a closed organ encloses.",
       "simulate: result.volume_after_mm3 / result.volume_before_mm3 - 1", true, volume_change},
      stated({"pressure_kpa", "Pressure", "kPa", "Pressure on the wall, as stated.", "", false, {}}, "pressure_mpa",
             "pressure", 1e3),
      stated(
          {"imaged_at_kpa", "Imaged at", "kPa", "Pressure under which the organ was imaged, as stated.", "", false, {}},
          "imaged_at_mpa", "imaged_at", 1e3),
      stated({"thickness_mm", "Thickness", "mm", "Thickness of the wall, as stated.", "", false, {}}, "thickness_mm",
             "thickness"),
      stated({"young_mpa", "Young's modulus", "MPa", "Young's modulus of the wall, as stated.", "", false, {}},
             "young_mpa", "young"),
      stated({"poisson", "Poisson's ratio", "", "Poisson's ratio of the wall, as stated.", "", false, {}}, "poisson",
             "poisson"),
      stated({"density_kg_per_m3", "Density", "kg/m3", "Density of the wall, as stated.", "", false, {}},
             "density_kg_per_m3", "density"),
      {"seconds", "Time", "s", "Seconds of all stages.", "all stages: seconds.total", false, seconds},
      {"peak_mib", "Memory", "MiB", "Largest memory that a stage had in use.", "all stages: peak_mib", false, memory}};
}

}  // namespace

const std::vector<Measure>& measures() {
  static const std::vector<Measure> all = [] {
    std::vector<Measure> made = make_geometry();
    std::ranges::move(make_mechanics(), std::back_inserter(made));
    return made;
  }();
  return all;
}

const Measure& measure(const std::string& key) {
  const auto found = std::ranges::find(measures(), key, &Measure::key);
  TUNICA_ASSERT(found != measures().end());
  return *found;
}

std::string Measure::text(double of) const {
  return is_bound ? figure_above(of) : unit.empty() && of == std::floor(of) ? fmt::format("{:.0f}", of) : figure(of);
}

std::string shown(const PipelineCase& one, const std::string& key) {
  const Measure& what = measure(key);
  const auto value = what.value(one);
  if (!value) {
    return {};
  }
  const std::string own = what.text(*value) + (what.unit.empty() || what.unit == "%" ? "" : " ") + what.unit;
  const Json text = what.input.empty() ? Json() : typed(one, what.input);
  const std::string said = text.is_string() ? with_blank_before_unit(text.get<std::string>()) : "";
  if (what.unit.empty() || said.empty()) {
    return own;
  }
  return said.ends_with(" " + what.unit) ? said : fmt::format("{} ({})", said, own);
}

std::string Reached::text() const {
  return fmt::format("{} {}, {}, {} % asked", of, value,
                     percent ? fmt::format("estimated error {} %", figure_above(*percent))
                             : "without a credible estimate of its error",
                     figure(asked));
}

std::optional<Reached> accuracy_reached(const PipelineCase& one) {
  const Json of = one.at("simulate", "result.accuracy.of");
  const auto value = number(one.at("simulate", "result.accuracy.value"));
  if (!value) {
    return std::nullopt;
  }
  Reached reached;
  const std::string name = of.is_string() ? of.get<std::string>() : "";
  if (of.is_object() && of.value("probe", Json()).is_string() && of.value("axis", Json()).is_string()) {
    reached.of =
        fmt::format("displacement of {} along {}", of["probe"].get<std::string>(), of["axis"].get<std::string>());
  } else {
    reached.of = name.empty() ? "answer" : name;
  }
  reached.value = name == "stress" || name == "membrane" ? figure(*value * 1e3) + " kPa"
                  : name == "tension"                    ? figure(*value) + " N/mm"
                  : name == "energy"                     ? figure(*value) + " mJ"
                  : name == "volume"                     ? figure(*value * 1e-3) + " ml"
                                                         : figure(*value) + " mm";
  reached.percent = number(one.at("simulate", "result.accuracy.estimate_percent"));
  reached.asked = number(one.at("simulate", "result.accuracy.requested_percent")).value_or(0);
  return reached;
}

bool is_inaccurate(const PipelineCase& one) {
  return one.at("simulate", "ok") == false && one.at("simulate", "result.accuracy.credible") == false &&
         accuracy_reached(one).has_value();
}

bool is_answered(const PipelineCase& one) { return one.at("simulate", "ok") == true || is_inaccurate(one); }

bool is_refitted(const PipelineCase& one) {
  return is_answered(one) && one.at("simulate", "result.accuracy").is_object() &&
         one.at("simulate", "result.shells") != one.at("relax", "result.shells");
}

bool has_refined_shells(const PipelineCase& one) { return one.at("simulate", "ok") == true && is_refitted(one); }

double median(std::vector<double> values) {
  TUNICA_ASSERT(!values.empty());
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

std::vector<Outlier> outliers(std::span<const std::optional<double>> values) {
  constexpr double normal_quartile = 0.6745;  // MAD of a standard normal distribution
  constexpr double farthest = 3.5;
  constexpr double least_spread = 0.01;
  std::vector<double> defined;
  for (const auto& value : values) {
    if (value) {
      defined.push_back(*value);
    }
  }
  if (defined.size() < fewest_compared) {
    return {};
  }
  const double middle = median(defined);
  std::ranges::for_each(defined, [&](double& value) { value = std::abs(value - middle); });
  const double spread = std::max(median(defined), least_spread * std::abs(middle));
  std::vector<Outlier> found;
  for (std::size_t i = 0; i < values.size() && spread > 0; ++i) {
    const double z = values[i] ? normal_quartile * (*values[i] - middle) / spread : 0;
    if (std::abs(z) > farthest) {
      found.push_back({i, z});
    }
  }
  return found;
}

std::string status_of(const CaseReport& one) {
  return !one.source.done() ? "failed" : one.warnings.empty() ? "done" : "warned";
}

bool rests_as_imaged(const PipelineCase& one) {
  return one.at("simulate", "result.prestress").is_object() && measure("max_displacement_mm").value(one) == 0;
}

}  // namespace tunica::report
