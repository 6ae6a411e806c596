// tunica-relax COARSE TARGET OUT.ply: a coarse mesh becomes curved shells on its target, with a certified distance.
#include "tunica/chain/relax.hpp"
#include "tunica/chain/report.hpp"
#include "tunica/cli/scene_flags.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"

#include <fmt/core.h>

namespace {

using namespace tunica;

struct Arguments {
  chain::RelaxFiles files;
  chain::RelaxSettings settings;
  std::optional<std::string> tolerance, mid_surface, min_angle;
  std::string method = "fit";
  std::optional<std::string> surface;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  auto& [files, settings, tolerance, mid_surface, min_angle, method, surface] = given;
  app.add_option("COARSE", files.coarse, "coarse mesh, e.g. from tunica-decimate")->required();
  app.add_option("TARGET", files.target, "surface that the shells are to become")->required();
  app.add_option("OUT.ply", files.out, "shell mesh: positions and unit normals")->required();
  tool.group("How close, with how many");
  app.add_option(
         "--tolerance", tolerance,
         "stop when the two-sided distance is certainly below it, e.g. 0.5% of the target's diagonal or 0.2mm, or "
         "when its mean is certainly below a part of the wall, e.g. 5%t; exit code 4 when it cannot be reached")
      ->type_name("TOLERANCE");
  tool.quantity("--thickness", settings.thickness, dimension::length,
                "of the wall, for a --tolerance such as 5%t, and for --mid-surface");
  tool.group("Wall");
  app.add_option("--mid-surface", mid_surface,
                 "TARGET is the outer or the inner face of the wall: the shells are fitted to its middle, half of the "
                 "--thickness away, or lie half way to --other-face")
      ->check(CLI::IsMember({"inner", "outer"}));
  app.add_option("--other-face", files.other_face,
                 "the wall's other face: the thickness is measured, and written as the vertices' property thickness")
      ->type_name("SURFACE");
  tool.group("Method");
  app.add_option(
         "--method", method,
         "fit (least error: positions, normals and connectivity are chosen together; the default) or barycentre (the "
         "paper's rule: keeps COARSE's triangles)")
      ->check(CLI::IsMember({"barycentre", "fit"}));
  app.add_option("--surface", surface,
                 "the patch: watertight (the default: cubics that meet exactly) or comas (the paper's 9-term cubic)")
      ->check(CLI::IsMember({"comas", "watertight"}));
  tool.group("How close, with how many");
  app.add_flag("--refine", settings.refine,
               "keep COARSE's triangles and split them where the distance is above the tolerance; without a "
               "tolerance split every shell in four and refit, once or as --max-shells or --max-iterations say; "
               "without --refine, fit looks for the fewest shells, whatever COARSE has");
  app.add_option("--shells", settings.shells,
                 "fit: at most N shells instead of as many as COARSE has (with --tolerance: as few as it takes)")
      ->check(cli::whole_number(1))
      ->type_name("N");
  app.add_option("--max-shells", settings.max_shells, "at most N shells")->check(cli::whole_number(1))->type_name("N");
  app.add_option(
         "--min-angle", min_angle,
         "fit: degrees that the angles of the shells keep where the target's boundaries and creases allow it (default "
         "20, from 1 to 30)")
      ->type_name("DEG");
  app.add_option(
         "--max-iterations", settings.max_iterations,
         "at most N iterations (barycentre: 20, with --refine 60), rounds of the search (fit: 12) or levels (fit with "
         "--refine and no tolerance: 2, the first is COARSE's own)")
      ->check(cli::whole_number(1, 100000))
      ->type_name("N");
  tool.group("Output");
  app.add_option("--map", files.maps.map, "error map: the curved surface with its distance to the target, PLY")
      ->type_name("OUT.ply");
  app.add_option("--picture", files.maps.picture, "picture of the error map, PNG")->type_name("OUT.png");
  tool.tolerance("--picture-range", files.maps.picture_range,
                 "where the picture's colours end, so that pictures can be compared (default: the largest distance)");
  app.add_option("--curved", files.maps.curved,
                 "the curved surface as a fine triangle mesh: .ply, .glb, .obj, .stl or .3mf")
      ->type_name("OUT.ply");
  tool.group("Input");
  tool.mesh_unit(files.unit_mm);
}

/// The error of a load's answer goes with the mean distance over the thickness of the wall.
void understand_tolerance(Arguments& given) {
  constexpr double farthest_by_mean =
      8;  // what a largest distance is tried first for a mean; then half of it, and so on
  chain::RelaxSettings& settings = given.settings;
  std::string_view text = given.tolerance ? std::string_view(*given.tolerance) : std::string_view();
  const bool of_wall = text.ends_with('t');
  if (settings.thickness && !of_wall && !given.mid_surface) {
    throw UsageError("--thickness belongs to a --tolerance in parts of the wall, for example 5%t, or to --mid-surface");
  }
  if (settings.thickness && !(*settings.thickness > 0)) {
    throw UsageError("--thickness must be greater than zero");
  }
  if (!given.tolerance) {
    return;
  }
  try {
    if (!of_wall) {
      settings.tolerance = parse_length_tolerance(text);
      return;
    }
    text.remove_suffix(1);
    const double part = parse_percent(text);
    if (!settings.thickness) {
      throw UsageError("it is a part of the wall: give --thickness too, for example --thickness 1.5mm");
    }
    if (!(part > 0)) {
      throw UsageError("must be greater than zero");
    }
    settings.mean = part * *settings.thickness;
    settings.tolerance = LengthTolerance{farthest_by_mean * *settings.mean, false};
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--tolerance: {}", error.what()));
  }
}

void refuse_contradictions(const Arguments& given) {
  const chain::RelaxSettings& settings = given.settings;
  if (given.files.other_face && !given.mid_surface) {
    throw UsageError("--other-face belongs to --mid-surface: say which face TARGET is");
  }
  if (given.mid_surface && !given.files.other_face && !settings.thickness) {
    throw UsageError("--mid-surface needs the wall's thickness: give --thickness, for example 1.5mm, or --other-face");
  }
  const bool fit = given.method == "fit";
  if (settings.shells && !fit) {
    throw UsageError(
        "--shells belongs to --method fit; barycentre has as many shells as COARSE, or with --refine more");
  }
  if (settings.shells && settings.max_shells) {
    throw UsageError("--shells and --max-shells say the same to --method fit; give one of them");
  }
  if (settings.max_shells && !settings.refine && !(fit && settings.tolerance)) {
    throw UsageError("--max-shells limits --refine, or a fit to a --tolerance; else the number of shells is given");
  }
  if (given.files.maps.picture_range && !given.files.maps.picture) {
    throw UsageError("--picture-range belongs to --picture: give both");
  }
  if (given.min_angle && !fit) {
    throw UsageError("--min-angle belongs to --method fit");
  }
  if (settings.refine && !fit && !settings.tolerance && !settings.max_shells && !settings.max_iterations) {
    throw UsageError(
        "--method barycentre --refine needs to know where to end: --tolerance, --max-shells or --max-iterations");
  }
}

void run(cli::Tool& tool, Arguments& given) {
  auto& [files, settings, tolerance, mid_surface, min_angle, method, surface] = given;
  understand_tolerance(given);
  refuse_contradictions(given);
  constexpr double least_angle = 1, most_angle = 30;  // degrees
  settings.min_angle = cli::degrees_of(min_angle, "--min-angle", least_angle, most_angle);
  settings.by_barycentre = method == "barycentre";
  settings.surface = surface == "comas" ? Patch::comas : Patch::watertight;
  if (mid_surface) {
    settings.face = *mid_surface == "outer" ? WallFace::outer : WallFace::inner;
  }
  tool.output(files.out, {".ply"});
  const chain::Context context = tool.context();
  files.maps.announce(context);
  chain::RelaxSurfaces surfaces = chain::read_relaxed(files, settings, context);
  settings.keep = [&](const ShellMesh& best) {
    chain::write_partial(given.files.out, best, surfaces.ply);
    tool.warn({Weight::note, "partial result",
               fmt::format("the best mesh so far, {} shells, is in {}.part", best.triangles.size(),
                           given.files.out.string())});
  };
  chain::Relaxation found = chain::relax(surfaces, settings, context);
  tool.result() = chain::report(found);
  const auto stage = tool.stage("write");
  chain::require_what_was_asked(files.out, surfaces, found, settings);
  chain::take_middle(found, surfaces, settings, context);
  tool.result() = chain::report(found);
  chain::write_relaxation(files, surfaces, found, context);
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool(
      "relax",
      "Moves a coarse mesh onto its target as curved shells, and certifies the distance of the curved surface "
      "to the target, both ways.",
      "tunica-relax coarse.ply surface.ply shell.ply --tolerance 1% --refine --picture map.png --report relax.json\n"
      "tunica-relax coarse.ply surface.ply paper.ply --method barycentre --max-iterations 5\n"
      "tunica-relax surface.ply surface.ply fewest.ply --tolerance 1%");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "relax", "measure", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
