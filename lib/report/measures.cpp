#include "tunica/report/detail/measures.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/report/detail/command_words.hpp"
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
Value reported(const char* stage, const char* key, double scale = 1) {
  return [=](const PipelineCase& one) {
    const auto value = number(one.at(stage, key));
    return value ? std::optional(*value * scale) : std::nullopt;
  };
}

// Of a run that came to its end: the last state of one that did not is under another load than the stated one.
Value answered(const char* key, double scale = 1) {
  return [value = reported("simulate", key, scale)](const PipelineCase& one) {
    return one.at("simulate", "ok") == true ? value(one) : std::nullopt;
  };
}

// A quantity that the command of tunica-simulate states.
Value stated(const char* flag, Dimension dimension, double scale = 1) {
  return [=](const PipelineCase& one) -> std::optional<double> {
    const auto text = flag_value(words_of(one, "simulate"), flag);
    try {
      return text ? std::optional(parse_quantity(*text, dimension) * scale) : std::nullopt;
    } catch (const UsageError&) {
      return std::nullopt;
    }
  };
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
           "Volume that the extracted surface encloses; where it is open, that of the label's voxels.",
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
          {"mean_distance_mm", "Mean distance", "mm", "Mean distance of the curved shells to the surface.",
           "relax: result.mean_distance_mm; with an accuracy simulate: mean_distance_mm of the last of "
           "result.accuracy.levels",
           false, mean_distance},
          {"min_angle_deg", "Least angle", "°", "Smallest angle of a shell.",
           "relax: result.min_angle_deg; with an accuracy simulate: result.accuracy.min_angle_deg", true,
           of_shells("min_angle_deg")}};
}

std::vector<Measure> make_mechanics() {
  return {
      {"stress_p99_kpa", "Stress p99", "kPa",
       "99th percentile, by area, of the von Mises stress at either face of the wall.",
       "simulate: result.wall.stress_p99_mpa × 1000", true, answered("result.wall.stress_p99_mpa", 1e3)},
      {"stress_max_kpa", "Stress max.", "kPa", "Largest von Mises stress at either face of the wall.",
       "simulate: result.wall.stress_max_mpa × 1000", false, answered("result.wall.stress_max_mpa", 1e3)},
      {"strain_p99_percent", "Strain p99", "%",
       "99th percentile, by area, of the largest principal strain at either face of the wall.",
       "simulate: result.wall.strain_p99_percent", true, answered("result.wall.strain_p99_percent")},
      {"max_displacement_mm", "Displacement", "mm", "Largest displacement of the curved surface.",
       "simulate: result.max_displacement_mm", true, answered("result.max_displacement_mm")},
      {"volume_change_percent", "Volume change", "%", "Change of the volume that a closed organ encloses.",
       "simulate: result.volume_after_mm3 / result.volume_before_mm3 - 1", true, volume_change},
      {"pressure_kpa", "Pressure", "kPa", "Pressure on the wall, as stated.", "simulate: command, --pressure", false,
       stated("--pressure", dimension::pressure, 1e3)},
      {"thickness_mm", "Thickness", "mm", "Thickness of the wall, as stated.", "simulate: command, --thickness", false,
       stated("--thickness", dimension::length)},
      {"young_mpa", "Young's modulus", "MPa", "Young's modulus of the wall, as stated.", "simulate: command, --young",
       false, stated("--young", dimension::pressure)},
      {"poisson", "Poisson's ratio", "", "Poisson's ratio of the wall, as stated.", "simulate: command, --poisson",
       false,
       [](const PipelineCase& one) -> std::optional<double> {
         const auto text = flag_value(words_of(one, "simulate"), "--poisson");
         return text ? parse_number(*text) : std::nullopt;
       }},
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

bool is_refitted(const PipelineCase& one) {
  // A run that did not come to its accuracy leaves no shells under their own name.
  return one.at("simulate", "ok") == true && one.at("simulate", "result.accuracy").is_object() &&
         one.at("simulate", "result.shells") != one.at("relax", "result.shells");
}

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

}  // namespace tunica::report
