#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/report/detail/command_words.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <array>

namespace tunica::report {
namespace {

constexpr std::array references{
    "O. Comas, C. Duriez, S. Cotin: Shell Model for Reconstruction and Real-Time Simulation of Thin Anatomical "
    "Structures. MICCAI 2010.",
    "W. E. Lorensen, H. E. Cline: Marching Cubes: A High Resolution 3D Surface Construction Algorithm. SIGGRAPH 1987.",
    "M. Garland, P. S. Heckbert: Surface Simplification Using Quadric Error Metrics. SIGGRAPH 1997."};

std::string with_unit(const CaseReport& one, const char* key) {
  const Measure& what = measure(key);
  const auto value = what.value(one.source);
  return value ? what.text(*value) + (what.unit.empty() || what.unit == "%" ? "" : " ") + what.unit : "";
}

std::string surface_sentence(const CaseReport& one) {
  const std::vector<std::string> words = words_of(one.source, "extract");
  const Json version = one.source.at("extract", "version");
  const auto label = flag_value(words, "--label");
  const auto level = flag_value(words, "--isovalue");
  const auto smoothing = flag_value(words, "--smooth");
  std::string text = "The surface of the organ was extracted with tunica " +
                     (version.is_string() ? version.get<std::string>() : std::string()) + " by marching cubes [2]";
  text += label ? " from label " + *label + " of the segmentation" : level ? " at the isovalue " + *level : "";
  return text + (smoothing == "staircase" ? " and smoothed within half a voxel. " : ". ");
}

std::string shell_sentence(const CaseReport& one) {
  const std::string count = with_unit(one, "shells");
  const std::string distance = with_unit(one, "distance_mm");
  if (count.empty()) {
    return {};
  }
  const auto method = flag_value(words_of(one.source, "relax"), "--method");
  const Json middle = one.source.at("relax", "result.mid_surface");
  const bool in_middle = middle.is_object() && middle.value("error_mm", Json()).is_object();
  const std::string target = in_middle ? "surface half of the wall's thickness " +
                                             std::string(middle.value("target", "") == "inner" ? "outside" : "inside") +
                                             " of the extracted one"
                                       : "extracted surface";
  const std::string text = "It was decimated by quadric edge collapse [3] and " +
                           std::string(method == "barycentre" ? "relaxed to" : "fitted by") + " " + count +
                           " curved triangular shells with one cubic shape function each [1]";
  const std::string mean = with_unit(one, "mean_distance_mm");
  if (!distance.empty()) {
    return text + "; the two-sided Hausdorff distance of the curved shells to the " + target +
           " is certified to be at most " + distance + " (" + with_unit(one, "distance_percent") +
           " of its diagonal). ";
  }
  return text + (mean.empty() ? ". " : ", " + mean + " from the " + target + " in the mean. ");
}

// As the resolved scene states it; empty: unloaded.
std::string imaging_pressure(const CaseReport& one) {
  const std::string_view key = "imaged_at = \"";
  const std::size_t said = one.scene.find(key);
  if (said == std::string::npos) {
    return {};
  }
  const std::size_t begin = said + key.size();
  const std::string stated = one.scene.substr(begin, one.scene.find('"', begin) - begin);
  try {
    return figure(parse_quantity(stated, dimension::pressure) * 1e3) + " kPa";
  } catch (const UsageError&) {
    return stated;
  }
}

std::string load_sentence(const CaseReport& one) {
  const std::string stress = with_unit(one, "stress_p99_kpa");
  if (stress.empty()) {
    return {};
  }
  const std::string young = with_unit(one, "young_mpa");
  const std::string pressure = with_unit(one, "pressure_kpa");
  const auto fixed = flag_value(words_of(one.source, "simulate"), "--fix");
  const bool dynamic = one.scene.find("kind = \"dynamic\"") != std::string::npos;
  const bool linear = one.scene.find("geometry = \"linear\"") != std::string::npos;
  std::string text = "The wall was linear elastic and isotropic";
  text += young.empty() ? "" : " (Young's modulus " + young + ", Poisson's ratio " + with_unit(one, "poisson") + ")";
  const std::string thickness = with_unit(one, "thickness_mm");
  text += thickness.empty() ? ". " : " and " + thickness + " thick. ";
  const std::string imaged = imaging_pressure(one);
  text += imaged.empty()
              ? "The image was taken as unloaded. "
              : "The image was taken under a pressure of " + imaged + "; the shape without it was found first. ";
  text += pressure.empty() ? "It was loaded" : "A pressure of " + pressure + " was put on it";
  text += fixed ? " with " + std::string(*fixed == "boundary"        ? "the boundary held"
                                         : *fixed == "rigid-motions" ? "only its rigid motions held"
                                                                     : "the region '" + *fixed + "' held")
                : "";
  text += std::string("; the equations were solved ") +
          (linear ? "linearly" : "with large rotations (co-rotational), by Newton's method") +
          (dynamic ? ", in time" : ", in statics") + ". ";
  return text + "Stresses are von Mises stresses at either face of the wall, as the 99th percentile by area.";
}

}  // namespace

Markup methods_section(const CaseReport& one, int level) {
  Markup made = heading(level, "Methods, to paste");
  made += html("<p class=\"methods\">{}</p>\n<ol class=\"references\">\n",
               one.redacted(surface_sentence(one)) + shell_sentence(one) + load_sentence(one));
  for (const char* reference : references) {
    made += html("<li>{}</li>\n", reference);
  }
  return made += html("</ol>\n");
}

}  // namespace tunica::report
