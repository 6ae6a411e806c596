// tunica-simulate SHELL.ply OUT.hdf, or --scene SCENE.toml OUT.hdf: what a load does to shells.
#include "tunica/chain/simulate.hpp"
#include "tunica/cli/picture_flags.hpp"
#include "tunica/cli/run_flags.hpp"
#include "tunica/cli/scene_flags.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/scene/scene_file.hpp"
#include "tunica/io/scene/stated.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace {

using namespace tunica;
namespace fs = std::filesystem;

struct Arguments {
  cli::RunFlags run;
  cli::SceneFlags scene;
  cli::AccuracyFlags accuracy;
  cli::PictureFlags picture;
};

// The scene, from wherever the command line says; what it was read from is registered.
void read_scene_of_run(cli::Tool& tool, const Arguments& a, const std::optional<RunJournal>& before,
                       chain::SimulateSettings& settings) {
  if (!a.run.scene.empty()) {
    settings.inputs.push_back(tool.input(a.run.scene));
    settings.scene = read_scene(a.run.scene);
  } else if (before && a.run.files.size() < 2) {
    settings.scene = parse_scene(before->identity().scene, a.run.resume);
  } else {
    settings.scene = a.scene.scene(a.run.files.front());
    cli::SceneFlags::keep_typed(tool.arguments(), settings.scene);
  }
  for (const fs::path& mesh : mesh_files(settings.scene)) {
    if (std::ranges::find(settings.inputs, mesh) == settings.inputs.end()) {
      settings.inputs.push_back(tool.input(mesh));
    }
  }
}

// What flags say of a run that has a scene.
void ask(cli::Tool& tool, const Arguments& a, bool goes_on, chain::SimulateSettings& settings) {
  if (a.run.check && a.picture.out) {
    throw UsageError("--check and --picture contradict each other: a picture needs a result");
  }
  settings.look = a.picture.options(settings.scene.run);
  a.accuracy.ask(tool.arguments(), settings.scene);
  settings.target = a.accuracy.target;
  settings.max_shells = cli::count_of(a.accuracy.max_shells, "--max-shells", real(max_index));
  settings.max_seconds = a.accuracy.max_seconds;
  if (settings.scene.accuracy && goes_on) {  // its meshes are not in the partial result
    throw UsageError(fmt::format("{}: a run for an accuracy does not go on: begin again", cli::RunFlags::resume_flag));
  }
  if (settings.scene.accuracy && a.accuracy.shell_out) {
    if (settings.scene.shells.size() > 1) {
      throw UsageError("--shell-out: the scene has more than one body, one can be written");
    }
    settings.shell_out = tool.output(*a.accuracy.shell_out, {".ply"});
  }
  if (a.run.unloaded) {
    chain::ask_for_unloaded(settings.scene);
    settings.unloaded = tool.output(*a.run.unloaded, {".ply"});
  }
}

void run(cli::Tool& tool, const Arguments& a, RunRecord& record) {
  const chain::Context context = tool.context();
  chain::SimulateSettings settings;
  std::optional<RunJournal> journal;
  const fs::path out = a.run.output(tool.arguments());
  auto stage = context.stage("read");
  if (!a.run.resume.empty()) {
    settings.resume = a.run.resume;
    journal.emplace(RunJournal::open(a.run.resume));
  }
  settings.drawing = a.run.drawing(journal ? &journal->identity() : nullptr);
  if (journal && (settings.drawing.no_paths || tool.provenance().hides_paths())) {
    tool.provenance().hide_paths();
    for (const auto& [path, hash] : journal->identity().inputs) {
      tool.provenance().add_input(path);
    }
  }
  settings.drawing.no_paths = tool.provenance().hides_paths();
  read_scene_of_run(tool, a, journal, settings);
  settings.check = a.run.check;
  if (!a.run.check) {
    settings.out = out;
    settings.picture = a.picture.out;
    chain::announce_outputs(settings, journal.has_value(), context);
  }
  ask(tool, a, journal.has_value(), settings);
  tool.stated() = stated_inputs(settings.scene);
  chain::LoadedRun loaded = chain::load_run(settings, context);
  stage.reset();
  chain::simulate(settings, std::move(loaded), record, context, std::move(journal));
  if (a.run.check) {
    tool.print(scene_text(settings.scene));
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("simulate", "Pressure load on thin curved shells, static or dynamic.",
                 "tunica-simulate shell.ply result.hdf --young 1MPa --poisson 0.45 --thickness 1.5mm --pressure 1kPa "
                 "--fix boundary --static\n"
                 "  tunica-simulate shell.ply motion.hdf --young 1MPa --poisson 0.45 --thickness 1.5mm --density "
                 "1100kg/m3 --pressure 1kPa --fix boundary --duration 100ms --step 10ms --ramp 50ms");
  Arguments arguments;
  RunRecord record;
  arguments.run.declare_files(tool);
  arguments.scene.declare(tool);
  arguments.accuracy.declare(tool);
  arguments.run.declare_run(tool);
  arguments.picture.declare(tool);
  tool.stages({"read", "setup", "solve", "write"});
  tool.result_by([&] { return run_report(record); });
  return tool.run(argc, argv, [&] { run(tool, arguments, record); });
}
