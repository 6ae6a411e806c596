// tunica-compare A B: the two-sided distance of two surfaces, as an interval.
#include "tunica/chain/compare.hpp"
#include "tunica/chain/report.hpp"
#include "tunica/cli/tool.hpp"

namespace {

using namespace tunica;

struct Arguments {
  chain::CompareFiles files;
  chain::CompareSettings settings;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  auto& [a, b, shell, unit_mm, out] = given.files;
  app.add_option("A", a, "a surface, or with --shell a shell mesh")->required();
  app.add_option("B", b, "the surface it is compared with; percentages are of its diagonal")->required();
  tool.group("Input");
  app.add_flag("--shell", shell, "A is curved shells: positions and unit normals");
  tool.group("Distance");
  tool.tolerance("--tolerance", given.settings.width, "width of the certified intervals (default: 0.01%)");
  tool.tolerance("--max", given.settings.most, "exit code 4 unless the distance is certainly at most this");
  tool.group("Output");
  app.add_option("--map", out.map, "error map: A with its distance to B as 'quality', mm, PLY")->type_name("OUT.ply");
  app.add_option("--picture", out.picture, "picture of the error map")->type_name("OUT.png");
  tool.tolerance("--picture-range", out.picture_range,
                 "where the picture's colours end, so that pictures can be compared (default: the largest distance)");
  app.add_option("--curved", out.curved, "the curved surface of A as a fine triangle mesh (needs --shell)")
      ->type_name("OUT.ply");
  tool.group("Input");
  tool.mesh_unit(unit_mm);
}

void run(cli::Tool& tool, const Arguments& given) {
  const auto& [files, settings] = given;
  if (files.out.curved && !files.shell) {
    throw UsageError("--curved writes the curved surface of shells: it needs --shell");
  }
  if (files.out.picture_range && !files.out.picture) {
    throw UsageError("--picture-range belongs to --picture: give both");
  }
  const chain::Context context = tool.context();
  files.out.announce(context);
  chain::ComparedFiles read = [&] {
    const auto stage = tool.stage("read");
    return chain::read_compared(files, settings, context);
  }();
  const auto stage = tool.stage("compare");
  const chain::ReferenceSurface b(std::move(read.b), files.shell, files.b.string());
  const chain::Comparison found = chain::compare(read.a, b, settings, context);
  tool.result() = chain::report(found);
  chain::write_comparison(files, read.a, read.space, b, found, context);
  if (found.unmet) {
    throw RequirementError(*found.unmet);
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool(
      "compare",
      "Two-sided Hausdorff distance of two surfaces, flat or curved, as an interval that certainly holds the "
      "true value.",
      "tunica-compare coarse.ply surface.ply --max 1%\n"
      "  tunica-compare shell.ply surface.ply --shell --picture compare.png --report compare.json");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "compare"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
