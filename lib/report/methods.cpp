#include "tunica/report/detail/arguments.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace tunica::report {
namespace {

/// What a paragraph cites, numbered in the order of its first citations.
class References {
public:
  enum Work : std::size_t { comas, marching_cubes, quadrics, andes, dkt };

  /// "[2]".
  std::string cite(Work work) {
    auto found = std::ranges::find(cited_, work);
    if (found == cited_.end()) {
      cited_.push_back(work);
      found = cited_.end() - 1;
    }
    return fmt::format("[{}]", found - cited_.begin() + 1);
  }
  [[nodiscard]] Markup list() const {
    static constexpr std::array texts{
        "O. Comas, C. Duriez, S. Cotin: Shell Model for Reconstruction and Real-Time Simulation of Thin Anatomical "
        "Structures. MICCAI 2010.",
        "W. E. Lorensen, H. E. Cline: Marching Cubes: A High Resolution 3D Surface Construction Algorithm. SIGGRAPH "
        "1987.",
        "M. Garland, P. S. Heckbert: Surface Simplification Using Quadric Error Metrics. SIGGRAPH 1997.",
        "C. A. Felippa: A Study of Optimal Membrane Triangles with Drilling Freedoms. Comput. Methods Appl. Mech. "
        "Engrg. 192, 2003.",
        "J.-L. Batoz, K.-J. Bathe, L.-W. Ho: A Study of Three-Node Triangular Plate Bending Elements. Int. J. Numer. "
        "Methods Eng. 15, 1980."};
    Markup items;
    for (const Work work : cited_) {
      items += part("item", {{"text", texts[work]}});
    }
    return items;
  }

private:
  std::vector<Work> cited_;
};

// A text of the stated inputs; empty where there is none.
std::string stated(const CaseReport& one, const std::string& key) {
  const Json value = one.source.at("simulate", "stated." + key);
  return value.is_string() ? value.get<std::string>() : "";
}

// The versions of the tools; one where they are all of the same.
std::string versions(const CaseReport& one) {
  std::vector<std::string> found;
  for (const char* stage : pipeline_stages) {
    const Json version = one.source.at(stage, "version");
    if (version.is_string() && std::ranges::find(found, version.get<std::string>()) == found.end()) {
      found.push_back(version.get<std::string>());
    }
  }
  return fmt::format("{}", fmt::join(found, " and "));
}

std::string surface_sentence(const CaseReport& one, References& works) {
  const auto label = argument(one.source, "extract", "--label");
  const auto level = argument(one.source, "extract", "--isovalue");
  const auto smoothing = argument(one.source, "extract", "--smooth");
  std::string text = "The surface of the organ was extracted with tunica " + versions(one) + " by marching cubes " +
                     works.cite(References::marching_cubes);
  text += label ? " from label " + *label + " of the segmentation" : level ? " at the isovalue " + *level : "";
  return text + (smoothing == "staircase" ? " and smoothed within half a voxel. " : ". ");
}

std::string shell_sentence(const CaseReport& one, References& works) {
  const std::string count = shown(one.source, "shells");
  const std::string distance = shown(one.source, "distance_mm");
  if (count.empty()) {
    return {};
  }
  const Json middle = one.source.at("relax", "result.mid_surface");
  const bool in_middle = middle.is_object() && middle.value("error_mm", Json()).is_object();
  const std::string target = in_middle ? "surface half of the wall's thickness " +
                                             std::string(middle.value("target", "") == "inner" ? "outside" : "inside") +
                                             " of the extracted one"
                             : one.source.reports.contains("extract") ? "extracted surface"
                                                                      : "surface";
  std::string text =
      (one.source.reports.contains("decimate")
           ? "It was decimated by quadric edge collapse " + works.cite(References::quadrics) + " and "
           : "It was ") +
      std::string(argument(one.source, "relax", "--method") == "barycentre" ? "relaxed to" : "fitted by") + " " +
      count + " curved triangular shells, each ";
  text += argument(one.source, "relax", "--surface") == "comas"
              ? "a cubic over its facet " + works.cite(References::comas)
              : "a cubic patch that meets its neighbours without a gap, after " + works.cite(References::comas);
  const std::string mean = shown(one.source, "mean_distance_mm");
  if (!distance.empty()) {
    return text + "; the two-sided Hausdorff distance of the curved shells to the " + target +
           " is certified to be at most " + distance + " (" + shown(one.source, "distance_percent") +
           " of its diagonal). ";
  }
  return text + (mean.empty() ? ". " : ", " + mean + " from the " + target + " in the mean. ");
}

// Which finite elements carry the load; empty where no scene tells.
std::string element_sentence(const CaseReport& one, References& works) {
  const std::string membrane = stated(one, "membrane");
  const std::string bending = stated(one, "bending");
  if (membrane.empty() || bending.empty()) {
    return {};
  }
  std::string text = "As finite elements they have six degrees of freedom per node; in their plane they are ";
  text += membrane == "cst"   ? "constant-strain triangles"
          : membrane == "opt" ? "optimal ANDES triangles with drilling freedoms " + works.cite(References::andes)
                              : "optimal ANDES triangles with drilling freedoms " + works.cite(References::andes) +
                                    ", whose higher-order part is reduced where the shell curves within an element";
  text += " (" + membrane + "), in bending ";
  if (bending == "comas") {
    text += "the 9-term cubic of " + works.cite(References::comas);
  } else if (bending == "comas-consistent") {
    text += "the 9-term cubic of " + works.cite(References::comas) + " with the mean curvature that its boundary gives";
  } else if (bending == "dkt") {
    text += "discrete Kirchhoff triangles " + works.cite(References::dkt);
  } else {
    text += "four fifths discrete Kirchhoff triangles " + works.cite(References::dkt) +
            " and one fifth the 9-term cubic of " + works.cite(References::comas) +
            " with the mean curvature that its boundary gives";
  }
  return text + " (" + bending + "). ";
}

// The texts under a key of the objects of a list of the stated inputs; empty ones where it is none.
std::vector<std::string> texts_of(const CaseReport& one, const std::string& list, const char* key) {
  std::vector<std::string> texts;
  const Json items = one.source.at("simulate", "stated." + list);
  for (const Json& item : items.is_array() ? items : Json::array()) {
    const Json value = item.is_object() ? item.value(key, Json()) : item;
    texts.push_back(value.is_string() ? value.get<std::string>() : value == true ? "true" : "");
  }
  return texts;
}

std::string in_region(const std::string& region) { return region.empty() ? "" : " in the region '" + region + "'"; }

// What holds the organ, "with … held".
std::string support_words(const CaseReport& one) {
  std::vector<std::string> held = texts_of(one, "fix", "");
  std::erase(held, "");
  for (std::string& what : held) {
    what = what == "boundary"        ? "the nodes of its boundary"
           : what == "rigid-motions" ? "only its six rigid motions"
                                     : "the region '" + what + "'";
  }
  std::string text = held.empty() ? "" : fmt::format(" with {} held", fmt::join(held, " and "));
  const Json stiffness = one.source.at("simulate", "stated.support.stiffness_n_per_m3");
  if (stiffness.is_number()) {
    text += fmt::format("{}an elastic bed of {:g} N/m³{}{}", text.empty() ? " on " : ", on ", stiffness.get<double>(),
                        stated(one, "support.direction") == "normal" ? " along its normals" : "",
                        in_region(stated(one, "support.where")));
  } else if (!texts_of(one, "scene.support", "body").empty()) {
    text += text.empty() ? " on elastic beds" : ", on elastic beds";
  }
  return text;
}

// "A pressure of 16 kPa that follows the surface was put on it"
std::string load_words(const CaseReport& one) {
  const std::vector<std::string> kinds = texts_of(one, "loads", "kind");
  const std::vector<std::string> regions = texts_of(one, "loads", "where");
  const std::vector<std::string> follower = texts_of(one, "loads", "follower");
  const std::vector<std::string> ramped = texts_of(one, "loads", "ramped");
  const std::string pressure = shown(one.source, "pressure_kpa");
  std::string text;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const bool is_pressure = kinds[i] == "pressure";
    const std::string value = is_pressure && !pressure.empty() ? " of " + pressure : "";
    const std::string follows = is_pressure && follower[i] == "true" ? " that follows the surface" : "";
    text += (text.empty() ? "A " : ", a ") + (is_pressure ? "pressure" : "load of the kind '" + kinds[i] + "'") +
            value + (ramped[i] == "true" ? ", times a table over time or load factor," : "") + follows +
            " was put on it" + in_region(regions[i]);
  }
  return text.empty() ? "No load was put on it" : text;
}

std::string solution_words(const CaseReport& one) {
  const std::string kind = stated(one, "kind");
  const std::string solver = stated(one, "solver");
  const std::string typed = stated(one, "typed.step");
  std::string text = stated(one, "geometry") == "linear"
                         ? "; the equations were solved linearly"
                         : "; the equations were solved with large rotations (co-rotational), by Newton's method";
  text += kind == "dynamic" ? ", in time (" + stated(one, "scene.run.integrator") + ", steps of " +
                                  (typed.empty() ? stated(one, "scene.run.step") : typed) + ")"
          : kind == "static" ? ", in statics"
                             : "";
  return text + (solver == "cg"       ? ", with a conjugate gradient solver"
                 : solver == "direct" ? ", with a direct solver"
                                      : "");
}

std::string load_sentence(const CaseReport& one) {
  if (shown(one.source, "stress_p99_kpa").empty()) {
    const std::string kind = stated(one, "kind");
    return kind == "frequencies"
               ? "Its lowest natural frequencies and their modes were computed" + support_words(one) + ". "
           : kind == "buckling"
               ? "Its smallest buckling factors and their modes were computed" + support_words(one) + ". "
               : "";
  }
  const std::string young = shown(one.source, "young_mpa");
  std::string text = "The wall was linear elastic and isotropic";
  text += young.empty() ? "" : " (Young's modulus " + young + ", Poisson's ratio " + shown(one.source, "poisson") + ")";
  const std::string thickness = shown(one.source, "thickness_mm");
  text += thickness.empty() ? ". " : " and " + thickness + " thick. ";
  std::string imaged = shown(one.source, "imaged_at_kpa");
  const Json prestress = one.source.at("simulate", "result.prestress.pressure_mpa");
  if (imaged.empty() && prestress.is_number()) {  // of one pressure among others
    imaged = figure(1e3 * prestress.get<double>()) + " kPa";
  }
  text += imaged.empty() || (measure("imaged_at_kpa").value(one.source) == 0 && !prestress.is_number())
              ? "The image was taken as unloaded. "
          : one.source.at("simulate", "result.unloaded").is_object()
              ? "The image was taken under a pressure of " + imaged + "; the shape without it was found first. "
              : "The image was taken under a pressure of " + imaged +
                    ", with which the wall was in equilibrium as imaged (prestress by one linear solution). ";
  if (rests_as_imaged(one.source)) {
    text += "No other load was put on it, so that nothing moves" + support_words(one) + ". ";
  } else {
    text += load_words(one);
    text += support_words(one) + solution_words(one) + ". ";
  }
  text +=
      "Stresses are von Mises values of Cauchy stresses, of their mean over the wall (membrane stress) and at either "
      "face of the wall, as the 99th percentile by area";
  const Json left_out = one.source.at("simulate", "result.wall.left_out_percent");
  text += left_out.is_number() && left_out.get<double>() > 0
              ? ", without the " + figure(left_out.get<double>()) + " % of it near rims, supports and loads."
              : ".";
  const auto reached = accuracy_reached(one.source);
  if (reached && reached->percent) {
    const bool credible = one.source.at("simulate", "result.accuracy.credible") == true;
    text += fmt::format(" The error of the {} by number of shells and model is estimated at {} %{}.", reached->of,
                        figure_above(*reached->percent), credible ? "" : ", which is not credible");
  }
  return text;
}

}  // namespace

Markup methods_section(const CaseReport& one, int level) {
  References works;
  std::string text = one.source.reports.contains("extract") ? surface_sentence(one, works) : "";
  text += shell_sentence(one, works);
  text += shown(one.source, "stress_p99_kpa").empty() ? "" : element_sentence(one, works);
  text += load_sentence(one);
  Markup made = heading(level, "Methods, to paste");
  return made += part("methods", {{"text", one.redacted(text)}, {"references", works.list()}});
}

}  // namespace tunica::report
