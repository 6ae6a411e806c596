#include "tunica/cli/run_flags.hpp"

#include "tunica/cli/scene_flags.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace tunica::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* scene_flag = "--scene";

// OUT.hdf of a run that goes on.
fs::path resumed_output(const fs::path& resume, bool check) {
  fs::path out = resume;
  out.replace_extension();
  if (resume.extension() != ".part" || out.empty()) {
    throw UsageError(
        fmt::format("{} {}: name the partial result, which ends with .part", RunFlags::resume_flag, resume.string()));
  }
  if (check) {
    throw UsageError(fmt::format("--check and {} contradict each other: give one", RunFlags::resume_flag));
  }
  return out;
}

}  // namespace

void RunFlags::declare_files(Tool& tool) {
  CLI::App& app = tool.arguments();
  app.add_option("FILES", files, "SHELL.ply OUT.hdf; with --scene only OUT.hdf; with --check OUT.hdf may be left out")
      ->expected(0, 2)
      ->type_name("FILE");
  tool.group("Scene");
  app.add_option(scene_flag, scene, "read everything from a scene file (TOML)")->type_name("SCENE.toml");
}

void RunFlags::declare_run(Tool& tool) {
  CLI::App& app = tool.arguments();
  tool.group("Run");
  app.add_flag("--check", check, "validate, print the resolved scene in SI units, and stop");
  app.add_option(resume_flag, resume,
                 "go on with a run that was interrupted, also by kill -9: alone, or beside the same command as before")
      ->type_name("OUT.hdf.part");
  tool.group("Output");
  app.add_option("--tessellation", tessellation,
                 "pieces per edge into which a curved shell is cut for drawing (default 4, less for many shells)")
      ->type_name("N");
  app.add_option("--unloaded", unloaded,
                 "with --imaged-at: find the shape without that pressure, begin there, and write it")
      ->type_name("OUT.ply");
  app.add_option("--export", exports,
                 "write beside OUT.hdf, may repeat: pvd (OUT.pvd with a .vtu per state) | xmf (OUT.xmf, XDMF) | "
                 "inp (the model for CalculiX and Abaqus) | feb (the model for FEBio) | "
                 "glb, obj, stl, 3mf (the last state's shells; glb and obj coloured by stress)")
      ->type_name("pvd|xmf|inp|feb|glb|obj|stl|3mf")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

fs::path RunFlags::output(const CLI::App& app) const {
  const bool from_scene = !scene.empty();
  const bool resumed = !resume.empty();
  // A run that goes on knows its scene and its output, and may be told them again.
  const bool alone = resumed && !from_scene && files.size() < 2;
  for (const char* flag : SceneFlags::names) {
    if ((from_scene || alone) && app.count(flag) > 0) {
      throw UsageError(
          from_scene
              ? fmt::format("{} and {} contradict each other: write it in the scene file", scene_flag, flag)
              : fmt::format("{} and {}: name SHELL.ply and OUT.hdf too, or nothing of the scene", resume_flag, flag));
    }
  }
  const std::size_t inputs = from_scene || alone ? 0 : 1;
  const std::size_t wanted = inputs + (check || resumed ? 0 : 1);
  if (files.size() < wanted) {
    throw UsageError(from_scene || files.size() == 1 ? "OUT.hdf is missing: name the result file"
                                                     : "SHELL.ply and OUT.hdf are missing: name them, or --scene");
  }
  if (files.size() > inputs + 1) {
    throw UsageError(
        fmt::format("{}: one file too many, with {} only OUT.hdf is named", files.back().string(), scene_flag));
  }
  const fs::path named = files.size() > inputs ? files.back() : fs::path();
  if (!resumed) {
    return named;
  }
  const fs::path out = resumed_output(resume, check);
  if (!named.empty() && fs::weakly_canonical(fs::absolute(named)) != fs::weakly_canonical(fs::absolute(out))) {
    throw UsageError(fmt::format("{}: {} goes on with {}, name that", named.string(), resume_flag, out.string()));
  }
  return out;
}

chain::Drawing RunFlags::drawing(const RunIdentity* before) const {
  constexpr double finest = 64;
  chain::Drawing drawing;
  drawing.tessellation = count_of(tessellation, "--tessellation", finest);
  for (const std::string& format : exports) {
    const auto* const found = std::ranges::find(chain::Drawing::formats, format);
    if (found == chain::Drawing::formats.end()) {
      throw UsageError(
          fmt::format("--export: '{}' is not one of {}", format, fmt::join(chain::Drawing::formats, ", ")));
    }
    drawing.exported[found - chain::Drawing::formats.begin()] = true;
  }
  if (before == nullptr) {
    return drawing;
  }
  for (const auto& [flag, value] : before->options) {
    if (flag == "--tessellation" && !tessellation && value != "default") {
      drawing.tessellation = std::stoul(value);
    }
    drawing.no_paths = drawing.no_paths || (flag == "--no-paths" && value == "yes");
    if (flag == "--export" && exports.empty()) {
      std::ranges::transform(chain::Drawing::formats, drawing.exported.begin(),
                             [&](const char* name) { return value.find(name) != std::string::npos; });
    }
  }
  return drawing;
}

}  // namespace tunica::cli
