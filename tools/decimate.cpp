// tunica-decimate IN OUT.ply: fewer triangles for the same surface.
#include "tunica/chain/decimate.hpp"
#include "tunica/chain/report.hpp"
#include "tunica/cli/scene_flags.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

namespace {

using namespace tunica;

struct Arguments {
  std::filesystem::path in, out;
  std::optional<std::string> triangles, min_angle;
  chain::DecimateSettings settings;
  bool repair = false;
  std::optional<double> unit_mm;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  app.add_option("IN", given.in, "surface mesh: PLY, OBJ, STL, OFF or GLB")->required();
  app.add_option("OUT.ply", given.out, "the coarser mesh")->required();
  tool.group("How far");
  app.add_option("--triangles", given.triangles, "at most N triangles")->type_name("N");
  tool.tolerance(
      "--max-error", given.settings.max_error,
      "largest distance to IN, both ways, e.g. 0.5% of IN's diagonal or 0.2mm; with --triangles it wins, and "
      "the exit code is 4 when both cannot hold");
  tool.group("Input");
  tool.mesh_unit(given.unit_mm);
  tool.group("How far");
  app.add_option(
         "--min-angle", given.min_angle,
         "well-shaped triangles for a larger error: no angle below DEG degrees (e.g. 20, at most 40; 0: any) but "
         "where IN's own corners are sharper; exit code 4 when that cannot be held")
      ->type_name("DEG");
  app.add_flag("--soft-angle", given.settings.soft_angle,
               "where --min-angle cannot be held, take the best mesh with a warning in place of exit code 4");
  tool.group("Input");
  app.add_flag(
      "--repair", given.repair,
      "mend IN: join boundary edges that coincide (seams, T-junctions), drop double triangles and pieces without "
      "area, turn triangles that face the wrong way, take apart what meets at too many; holes stay");
}

void run(cli::Tool& tool, Arguments& given) {
  if (!given.triangles && !given.settings.max_error) {
    throw UsageError("say how far to go: --triangles N, --max-error TOL, or both");
  }
  constexpr double largest_angle = 40;  // degrees
  given.settings.triangles = cli::count_of(given.triangles, "--triangles", real(max_index));
  given.settings.min_angle = cli::degrees_of(given.min_angle, "--min-angle", 0, largest_angle);
  if (given.settings.min_angle == 0) {
    given.settings.min_angle.reset();
  }
  tool.output(given.out, {".ply"});
  const chain::Context context = tool.context();
  const std::string name = given.in.string();
  const chain::SurfaceToDecimate surface =
      chain::read_surface(given.in, given.unit_mm, given.repair, given.settings, context);
  if (surface.file.unit_unknown) {
    tool.warn(
        {Weight::minor, "unit of length",
         fmt::format("{}: says no unit of length, so {} says none either, and the other tools take its numbers for "
                     "mm: give --mesh-unit mm|cm|m|um",
                     name, given.out.string())});
  }
  const chain::Decimation found = chain::decimate(surface, given.settings, context, name);
  tool.result() = chain::report(found);
  chain::write_decimation(given.out, surface, found, context, name);
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("decimate",
                 "Quadric edge collapse: fewer triangles for the same surface. Boundaries and topology are kept, no "
                 "triangle is flipped, those without area go, and the two-sided distance to the input is certified.",
                 "tunica-decimate surface.ply coarse.ply --triangles 800\n"
                 "  tunica-decimate surface.ply within.ply --max-error 0.5% --report decimate.json\n"
                 "  tunica-decimate surface.ply shaped.ply --triangles 800 --min-angle 20");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "decimate", "measure", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
