// tunica-relax COARSE TARGET OUT.ply: a coarse mesh becomes curved shells on its target, with a certified distance.
#include "shell/relax.hpp"
#include "cli/tool.hpp"
#include "cli/usage.hpp"
#include "core/quantity.hpp"
#include "io/mesh_file.hpp"
#include "io/mesh_pair.hpp"
#include "io/picture.hpp"
#include "shell/boundary_distance.hpp"
#include "shell/curved_surface.hpp"
#include "shell/shell_crossings.hpp"
#include "surface/checks.hpp"
#include "surface/degenerate.hpp"
#include "surface/hausdorff.hpp"
#include "surface/measure.hpp"

#include <fmt/core.h>

#include <cmath>
#include <tuple>
#include <utility>

namespace fs = std::filesystem;
using namespace tunica;

namespace {

constexpr double interval_width = 1e-4;  // of the diagonal: what the report certifies
constexpr double rounding = 1e-9;        // of the diagonal: by which a certified interval may be wider than asked
constexpr double curved_deviation =
    0.8e-5;  // of the diagonal; the contract of --curved, 1e-5, may be taken of either surface
constexpr double most_for_spikes = 0.9;  // of the tolerance
constexpr double usual_angle = 20;       // degrees
constexpr double rounded_up = 0.9975;    // of it: what prints as less
constexpr double most_effort = 100;
constexpr double largest_kink = 90;                 // degrees
constexpr double least_angle = 1, most_angle = 30;  // degrees
constexpr std::size_t map_triangles = 200'000;

struct Arguments {
  fs::path coarse, target, out;
  std::optional<fs::path> map, picture, curved;
  std::optional<LengthTolerance> tolerance;
  std::string method = "fit";
  std::optional<std::string> surface;
  std::optional<std::string> mesh_unit;
  bool refine = false;
  std::optional<std::size_t> shells, max_shells;
  std::optional<std::string> kink, min_angle, effort;
  std::optional<int> max_iterations;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  app.add_option("COARSE", given.coarse, "coarse mesh, e.g. from tunica-decimate")->required();
  app.add_option("TARGET", given.target, "surface that the shells are to become")->required();
  app.add_option("OUT.ply", given.out, "shell mesh: positions and unit normals")->required();
  tool.tolerance("--tolerance", given.tolerance,
                 "stop when the two-sided distance is certainly below it, e.g. 0.5% of the target's diagonal or 0.2mm; "
                 "exit code 4 when it cannot be reached");
  app.add_option(
         "--method", given.method,
         "fit (least error: positions, normals and connectivity are chosen together; the default) or barycentre (the "
         "paper's rule: keeps COARSE's triangles)")
      ->check(CLI::IsMember({"barycentre", "fit"}));
  app.add_option(
         "--surface", given.surface,
         "the patch: comas (the paper's 9-term cubic) or watertight (cubics that meet exactly); neither given: "
         "comas, but where fit to a --tolerance finds long shells, as along cylinders, the one that takes fewer")
      ->check(CLI::IsMember({"comas", "watertight"}));
  app.add_flag("--refine", given.refine,
               "keep COARSE's triangles and split them where the distance is above the tolerance (without one: four "
               "times as many); without --refine, fit looks for the fewest shells, whatever COARSE has");
  app.add_option("--shells", given.shells,
                 "fit: at most N shells instead of as many as COARSE has (with --tolerance: as few as it takes)")
      ->check(cli::whole_number(1))
      ->type_name("N");
  app.add_option("--max-shells", given.max_shells, "at most N shells")->check(cli::whole_number(1))->type_name("N");
  app.add_option(
         "--kink", given.kink,
         "fit to a --tolerance, comas: degrees by which the normals of shells that meet at a node may part where "
         "that saves shells (default 75; 0: several normals only at creases and where facets turn too far for one)")
      ->type_name("DEG");
  app.add_option(
         "--min-angle", given.min_angle,
         "fit: degrees that the angles of the shells keep where folds, rims and creases allow it (default 20; to "
         "a --tolerance less where that saves shells: 10 or 5 along cylinders, and any where flat ones are as few)")
      ->type_name("DEG");
  app.add_option("--effort", given.effort,
                 "fit to a --tolerance: how long fewer shells are looked for, times the usual (default 1; 0: a fifth "
                 "of the time, or less, for a fifth to nine tenths more shells; at most 100)")
      ->type_name("X");
  app.add_option("--max-iterations", given.max_iterations,
                 "at most N iterations (barycentre: 20, with --refine 60; fit: 8 rounds, or 1 to many shells on a "
                 "smooth target; to a tolerance as many, and no limit of exchanges)")
      ->check(cli::whole_number(1, 100000))
      ->type_name("N");
  app.add_option("--map", given.map, "error map: the curved surface with its distance to the target, PLY")
      ->type_name("OUT.ply");
  app.add_option("--picture", given.picture, "picture of the error map, PNG")->type_name("OUT.png");
  app.add_option("--curved", given.curved, "the curved surface as a fine triangle mesh, PLY")->type_name("OUT.ply");
  app.add_option("--mesh-unit", given.mesh_unit, "unit of mesh files that do not state one: mm, cm, m or um")
      ->type_name("mm|cm|m|um");
}

void refuse_contradictions(const Arguments& given) {
  const bool fit = given.method == "fit";
  if (given.shells && !fit) {
    throw UsageError(
        "--shells belongs to --method fit; barycentre has as many shells as COARSE, or with --refine more");
  }
  if (given.shells && given.max_shells) {
    throw UsageError("--shells and --max-shells say the same to --method fit; give one of them");
  }
  if (given.max_shells && !given.refine && !(fit && given.tolerance)) {
    throw UsageError("--max-shells limits --refine, or a fit to a --tolerance; else the number of shells is given");
  }
  if (given.kink && (!fit || !given.tolerance || given.refine || given.surface == "watertight")) {
    throw UsageError("--kink belongs to --method fit with --tolerance, without --refine, and comas patches");
  }
  if (given.effort && (!fit || !given.tolerance || given.refine)) {
    throw UsageError("--effort belongs to --method fit with --tolerance, without --refine");
  }
  if (given.min_angle && !fit) {
    throw UsageError("--min-angle belongs to --method fit");
  }
  if (given.refine && !given.tolerance && !given.max_shells && !given.max_iterations) {
    throw UsageError("--refine needs to know where to end: --tolerance, --max-shells or --max-iterations");
  }
}

/// What an option says, degrees.
std::optional<double> degrees(const std::string& option, const std::optional<std::string>& said, double least,
                              double most) {
  if (!said) {
    return {};
  }
  const auto number = parse_number(*said);
  if (!number || !(*number >= least) || *number > most) {
    throw UsageError(
        fmt::format("{}: '{}' is not a number of degrees from {:.0f} to {:.0f}", option, *said, least, most));
  }
  return number;
}

struct Surface {
  MeshFile file;
  MeshFacts facts;
  std::optional<TriangleMesh> with_spikes;  ///< as it was given, where spikes were taken away
  double moved = 0;                         ///< mm, by that
};

// Shells have area: what hangs on a surface without any can only be taken away.
void take_spikes(const cli::Tool& tool, const fs::path& path, Surface& surface) {
  TriangleMesh& mesh = surface.file.mesh;
  if (count_degenerate(mesh) == 0) {
    return;
  }
  WithoutDegenerate cleaned = without_degenerate_triangles(mesh);
  if (cleaned.longest_spike > 0) {
    tool.warn(fmt::format("{}: spikes without area, up to {:.4g} mm long, are taken away from its boundary",
                          path.string(), cleaned.longest_spike));
    surface.moved = cleaned.moved;
    surface.with_spikes = std::exchange(mesh, std::move(cleaned.mesh));
  }
}

Surface read_surface(const cli::Tool& tool, const fs::path& path, const std::optional<double>& unit_mm) {
  Surface surface{read_mesh(path, unit_mm, true), {}, {}, 0};
  surface.facts = examine(surface.file.mesh);
  if (const auto why = why_unfit(surface.facts)) {
    throw InputError(path.string() + ": " + *why +
                     "; mend it with tunica-decimate --repair, --triangles as many as it has to keep all");
  }
  if (!(diagonal(surface.file.mesh) > 0)) {
    throw InputError(path.string() + ": the mesh has no extent");
  }
  take_spikes(tool, path, surface);
  return surface;
}

void warn_of_mismatch(const cli::Tool& tool, const MeshFacts& a, const MeshFacts& b) {
  const auto differ = [&](std::size_t of_coarse, std::size_t of_target, const std::string& what) {
    if (of_coarse != of_target) {
      tool.warn(fmt::format("COARSE has {} {}, TARGET has {}; the distance will show what cannot be covered", of_coarse,
                            what, of_target));
    }
  };
  differ(a.components, b.components, "component(s)");
  differ(a.boundary_loops, b.boundary_loops, "boundary loop(s)");
}

Json interval(const Interval& mm, double scale) { return {{"lower", mm.lower * scale}, {"upper", mm.upper * scale}}; }

Interval intersection(const Interval& a, const Interval& b) {
  return {std::max(a.lower, b.lower), std::min(a.upper, b.upper)};
}

// What relax() proved is narrowed where it is too wide.
// @param whole  the target with its spikes; relax() knew it without them, `moved` mm from it at most
ShellDistance certified_distance(const RelaxResult& relaxed, const Target& whole, double moved,
                                 const ShellDistanceOptions& measuring) {
  const auto widened = [&](const Interval& known) {
    return Interval{std::max(0.0, known.lower - moved), known.upper + moved};
  };
  ShellDistance distance = relaxed.distance;
  for (Interval* known : {&distance.both, &distance.shell_to_target, &distance.target_to_shell}) {
    *known = widened(*known);
  }
  const auto narrow = [&](const Interval& known) {
    return known.upper - known.lower <= measuring.width + rounding * whole.diagonal();
  };
  if (!narrow(distance.shell_to_target) || !narrow(distance.target_to_shell)) {
    // Both intervals are certain, so their intersection is.
    const ShellDistance measured = shell_distance(relaxed.shell, whole, measuring);
    distance.both = intersection(distance.both, measured.both);
    distance.shell_to_target = intersection(distance.shell_to_target, measured.shell_to_target);
    distance.target_to_shell = intersection(distance.target_to_shell, measured.target_to_shell);
  }
  std::tie(distance.mean, distance.rms) = mean_distance(relaxed.shell, whole);
  if (const auto between = boundary_distance(boundary_curves(relaxed.shell), whole, measuring.width)) {
    const auto& known = relaxed.distance.boundary;
    distance.boundary = known ? intersection(between->both, widened(*known)) : between->both;
  }
  return distance;
}

PlyOptions ply_options(const cli::Tool& tool, const std::string& space) {
  PlyOptions options;
  options.comments = {"made by " + tool.command()};
  options.space = space;
  options.overwrite = tool.force();
  return options;
}

/// Distances at the vertices of a surface fine enough to be looked at, with the edges of the shells.
/// @param written  outputs that are finished: what joins them
void write_maps(cli::Tool& tool, const Arguments& given, const ShellMesh& shell, const Target& target,
                const ShellDistance& distance, const PlyOptions& ply, std::vector<fs::path>& written) {
  const double per_shell = static_cast<double>(map_triangles) / static_cast<double>(shell.triangles.size());
  const int level = std::clamp(static_cast<int>(std::sqrt(per_shell)), 4, 24);
  const Tessellation fine = tessellate_uniformly(shell, level);
  const auto distances = vertex_distances(fine.mesh, target.tree());
  if (given.map) {
    write_ply(*given.map, fine.mesh, distances, ply);
    written.push_back(*given.map);
  }
  if (given.picture) {
    PictureOptions options;
    options.title = fmt::format("{}: {} shells", given.out.filename().string(), shell.triangles.size());
    options.caption = fmt::format("two-sided Hausdorff distance at most {:.4g} mm ({:.3g} %), mean {:.3g} mm",
                                  distance.both.upper, 100 * distance.both.upper / target.diagonal(), distance.mean);
    options.quantity = "distance to the target";
    options.diagonal = target.diagonal();
    options.overwrite = tool.force();
    const auto on_edge = [](const Vec2& a, const Vec2& b) {
      return (a[0] == 0 && b[0] == 0) || (a[1] == 0 && b[1] == 0) || (a[0] + a[1] > 1 - 1e-9 && b[0] + b[1] > 1 - 1e-9);
    };
    for (const auto& v : fine.mesh.triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Index a = v[i], b = v[(i + 1) % 3];
        if (on_edge(fine.barycentric[a], fine.barycentric[b])) {
          options.lines.push_back({fine.mesh.vertices[a], fine.mesh.vertices[b]});
        }
      }
    }
    write_error_map_picture(*given.picture, fine.mesh, distances, options);
  }
}

void run(cli::Tool& tool, const Arguments& given) {
  refuse_contradictions(given);
  const auto largest_part = degrees("--kink", given.kink, 0, largest_kink);
  const auto min_angle = degrees("--min-angle", given.min_angle, least_angle, most_angle);
  std::optional<double> effort;
  if (given.effort) {
    effort = parse_number(*given.effort);
    if (!effort || !(*effort >= 0 && *effort <= most_effort)) {
      throw UsageError(fmt::format("--effort: '{}' is not a number from 0 to {:.0f}", *given.effort, most_effort));
    }
  }
  tool.output(given.out, {".ply"});
  for (const auto& [path, ending] : {std::pair(given.map, ".ply"), {given.picture, ".png"}, {given.curved, ".ply"}}) {
    if (path) {
      tool.output(*path, {ending});
    }
  }

  std::optional<double> unit_mm;
  if (given.mesh_unit) {
    unit_mm = parse_length_unit(*given.mesh_unit);
  }
  TriangleMesh coarse;
  std::optional<Target> target, with_spikes;
  double moved = 0;  // of the target, mm: by taking its spikes
  PlyOptions ply;
  {
    const auto stage = tool.stage("read");
    Surface start = read_surface(tool, tool.input(given.coarse), unit_mm);
    tool.input(given.target);
    Surface surface = given.coarse == given.target ? start : read_surface(tool, given.target, unit_mm);
    require_same_scale(start.file, given.coarse, surface.file, given.target, unit_mm);
    require_near(start.file, given.coarse, surface.file, given.target);
    ply = ply_options(tool, common_space(start.file, given.coarse, surface.file, given.target));
    coarse = std::move(start.file.mesh);
    target.emplace(std::move(surface.file.mesh));
    if (surface.with_spikes) {
      with_spikes.emplace(*std::move(surface.with_spikes));
      moved = surface.moved;
    }
    if (start.facts.boundary_loops != surface.facts.boundary_loops) {
      surface.facts.boundary_loops -= target->point_loops();  // decimation closes them
    }
    warn_of_mismatch(tool, start.facts, surface.facts);
  }
  const Target& whole = with_spikes ? *with_spikes : *target;  // what distances are to
  const double diagonal = whole.diagonal();
  const double percent = 100 / diagonal;

  const auto keep_partial = [&](const ShellMesh& shell) {
    PlyOptions partial = ply;
    partial.partial = true;
    partial.overwrite = true;
    write_ply(given.out, shell, partial);
  };
  ShellMesh best;
  std::optional<double> tolerance;  // mm
  RelaxOptions options;
  options.method = given.method == "fit" ? RelaxMethod::fit : RelaxMethod::barycentre;
  options.surface = given.surface == "watertight" ? Patch::watertight : Patch::comas;
  options.either_surface = !given.surface && !given.kink;
  options.refine = given.refine;
  options.shells = given.shells;
  options.max_shells = given.max_shells;
  options.max_iterations = given.max_iterations;
  options.kink = largest_part.value_or(options.kink);
  options.effort = effort.value_or(options.effort);
  options.min_angle = min_angle;
  options.width = interval_width * diagonal;
  options.progress = tool.progress("relax");
  if (given.tolerance) {
    tolerance = given.tolerance->millimetres(diagonal);
    options.tolerance = moved < most_for_spikes * *tolerance ? *tolerance - moved : *tolerance;
  }
  options.on_iteration = [&](const RelaxIteration& iteration, const ShellMesh& so_far) {
    best = so_far;
    tool.detail(
        fmt::format("{} shells: {:.4f} to {:.4f} %; nodes by the rule {}, to the closest point {}, on the boundary {}, "
                    "held back {}; {:.2f} s",
                    iteration.shells, percent * iteration.hausdorff.lower, percent * iteration.hausdorff.upper,
                    iteration.moves.by_rule, iteration.moves.to_closest_point, iteration.moves.on_boundary,
                    iteration.moves.shortened, iteration.seconds));
  };
  RelaxResult relaxed;
  try {
    const auto stage = tool.stage("relax");
    relaxed = relax(coarse, *target, options);
  } catch (const Interrupted&) {
    if (!best.triangles.empty()) {
      keep_partial(best);
      tool.warn(
          fmt::format("the best mesh so far, {} shells, is in {}.part", best.triangles.size(), given.out.string()));
    }
    throw;
  } catch (const InputError& error) {
    throw InputError(given.coarse.string() + ": " + error.what());
  }
  if (relaxed.turned_around) {
    tool.warn("COARSE faces the other way than TARGET; its triangles were turned around");
  }

  ShellDistance distance;
  {
    const auto stage = tool.stage("measure");
    ShellDistanceOptions measuring;
    measuring.width = interval_width * diagonal;
    if (tolerance) {
      measuring.width = std::min(measuring.width, *tolerance / 20);
    }
    const ShellDistance flat = flat_distance(relaxed.shell, whole, measuring);
    measuring.progress = tool.progress("measure");
    distance = certified_distance(relaxed, whole, moved, measuring);
    const double farthest = relaxed.distance.boundary ? distance.upper() : distance.both.upper;
    if (moved > 0 && relaxed.reached && farthest > *tolerance) {
      relaxed.reached = false;
      relaxed.stopped = "no shells reach the target's spikes without area";
    }

    Json& result = tool.result();
    result["shells"] = relaxed.shell.triangles.size();
    result["hausdorff_mm"] = interval(distance.both, 1);
    result["hausdorff_percent"] = interval(distance.both, percent);
    result["one_sided_percent"] = {{"shell_to_target", interval(distance.shell_to_target, percent)},
                                   {"target_to_shell", interval(distance.target_to_shell, percent)}};
    result["boundary_percent"] = distance.boundary ? interval(*distance.boundary, percent) : Json();
    result["mean_percent"] = distance.mean * percent;
    result["rms_percent"] = distance.rms * percent;
    result["flat_hausdorff_percent"] = interval(flat.both, percent);
    result["iterations"] = Json::array();
    for (const RelaxIteration& iteration : relaxed.iterations) {
      result["iterations"].push_back({{"shells", iteration.shells},
                                      {"hausdorff_percent", interval(iteration.hausdorff, percent)},
                                      {"seconds", iteration.seconds}});
    }
    const double angle = min_angle_degrees(flat_facets(relaxed.shell));
    result["min_angle_deg"] = angle;
    if (options.min_angle && angle < *options.min_angle) {
      tool.warn(fmt::format(
          "the smallest angle is {:.3g} degrees: folds, rims or creases do not allow {:.3g} everywhere, or the error "
          "would be larger",
          angle, *options.min_angle));
    } else if (options.method == RelaxMethod::fit && !options.min_angle && angle < rounded_up * usual_angle) {
      tool.warn(fmt::format("the smallest angle is {:.3g} degrees, below the usual {:.0f}: {}", angle, usual_angle,
                            tolerance ? "so it takes fewer shells (--min-angle says otherwise), or folds, rims or "
                                        "creases do not allow more"
                                      : "folds, rims or creases do not allow more, or the error would be larger"));
    }
    const std::size_t crossings = crossing_patches(relaxed.shell).size();
    result["self_intersections"] = crossings;
    if (crossings > 0) {
      tool.warn(fmt::format(
          "{} pair(s) of curved shells cross: more shells, or a target that does not cross itself, will part them",
          crossings));
    }
    result["reached"] = relaxed.reached ? Json(*relaxed.reached) : Json();
    result["stopped"] = relaxed.stopped;
    result["edges_turned"] = relaxed.flips;
    result["diagonal_mm"] = diagonal;
  }
  tool.note(fmt::format("{} shells, two-sided distance {:.4f} to {:.4f} % of the diagonal: {}",
                        relaxed.shell.triangles.size(), percent * distance.both.lower, percent * distance.both.upper,
                        relaxed.stopped));

  const auto stage = tool.stage("write");
  const auto most = given.shells ? given.shells : given.max_shells;
  if (most && relaxed.shell.triangles.size() > *most) {
    keep_partial(relaxed.shell);
    throw RequirementError(
        fmt::format("{}: {} shells are the fewest found that keep its pieces, holes and handles without folds, {} are "
                    "allowed; the best mesh is in {}.part",
                    given.target.string(), relaxed.shell.triangles.size(), *most, given.out.string()));
  }
  if (tolerance && !*relaxed.reached) {
    keep_partial(relaxed.shell);
    throw RequirementError(fmt::format(
        "{}: the tolerance of {:.4g} % is not reached: {:.4g} %{} with {} shells ({}); the best mesh is {}.part. {}",
        given.out.string(), percent * *tolerance, percent * distance.both.upper,
        distance.boundary && options.method == RelaxMethod::fit
            ? fmt::format(", {:.4g} % of the boundaries", percent * distance.boundary->upper)
            : "",
        relaxed.shell.triangles.size(), relaxed.stopped, given.out.string(),
        options.method == RelaxMethod::fit ? "Allow more shells or iterations, or a wider tolerance"
        : given.refine                     ? "Allow more shells or iterations"
                                           : "Add --refine, or take a coarse mesh with more triangles"));
  }
  if (const std::size_t without_area = count_without_area(relaxed.shell); without_area > 0) {
    keep_partial(relaxed.shell);
    throw RequirementError(
        fmt::format("{}: {} shell(s) have no area, as the surface has none there; the best mesh is "
                    "{}.part. Make the surface anew, or take such parts away first",
                    given.out.string(), without_area, given.out.string()));
  }
  require_fit(relaxed.shell, given.out.string());
  std::vector<fs::path> written;
  try {
    write_ply(given.out, relaxed.shell, ply);
    written.push_back(given.out);
    if (given.curved) {
      write_ply(*given.curved, tessellate(relaxed.shell, curved_deviation * diagonal).mesh, ply);
      written.push_back(*given.curved);
    }
    if (given.map || given.picture) {
      write_maps(tool, given, relaxed.shell, whole, distance, ply, written);
    }
  } catch (...) {
    // Of a run that failed nothing looks finished.
    for (const fs::path& path : written) {
      std::error_code ignored;
      fs::remove(path, ignored);
    }
    throw;
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool(
      "relax",
      "Moves a coarse mesh onto its target as curved shells, and certifies the distance of the curved surface "
      "to the target, both ways.",
      "tunica-relax coarse.ply surface.ply shell.ply --tolerance 1% --refine --picture map.png --report relax.json\n"
      "tunica-relax coarse.ply surface.ply paper.ply --method barycentre --max-iterations 5\n"
      "tunica-relax surface.ply surface.ply quick.ply --tolerance 1% --effort 0");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "relax", "measure", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
