#include "tunica/cli/tool.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/result_export.hpp"
#include "tunica/io/result/result_file.hpp"
#include "tunica/io/result/run_journal.hpp"
#include "tunica/io/result/run_report.hpp"
#include "tunica/io/scene/scene.hpp"
#include "tunica/io/scene/scene_file.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/solve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<fs::path> files;
  fs::path scene, resume;
  std::optional<double> young, thickness, density, pressure, duration, step, ramp;
  std::optional<std::string> poisson, mesh_unit, membrane, bending, solver, cg_tolerance, converge;
  std::optional<std::string> load_steps, cg_iterations, every;
  std::optional<std::string> tessellation;
  std::vector<std::string> fixes, exports;
  bool is_static = false;
  bool check = false;
};

constexpr const char* scene_flag = "--scene";
constexpr const char* resume_flag = "--resume";

// What --scene contradicts: all that a scene file says itself.
constexpr std::array scene_says{"--young",         "--poisson",  "--thickness",  "--density",  "--pressure",
                                "--fix",           "--static",   "--load-steps", "--duration", "--step",
                                "--ramp",          "--membrane", "--bending",    "--solver",   "--cg-tolerance",
                                "--cg-iterations", "--converge", "--every",      "--mesh-unit"};

void declare(cli::Tool& tool, Arguments& a) {
  CLI::App& app = tool.arguments();
  app.add_option("FILES", a.files, "SHELL.ply OUT.hdf; with --scene only OUT.hdf; with --check OUT.hdf may be left out")
      ->expected(0, 2)
      ->type_name("FILE");
  app.add_option(scene_flag, a.scene, "read everything from a scene file (TOML)")->type_name("SCENE.toml");
  tool.quantity("--young", a.young, dimension::pressure, "Young's modulus, e.g. 1MPa");
  app.add_option("--poisson", a.poisson, "Poisson's ratio, in (-1, 0.5)")->type_name("NUMBER");
  tool.quantity("--thickness", a.thickness, dimension::length, "thickness of the shell, e.g. 1.5mm");
  tool.quantity("--density", a.density, dimension::density, "mass density, e.g. 1100kg/m3 (dynamic runs need it)");
  tool.quantity("--pressure", a.pressure, dimension::pressure,
                "pressure that follows the surface; positive pushes along the normals, outward");
  app.add_option("--fix", a.fixes,
                 "what is held, may repeat: boundary | 'below z=-10mm' | 'above x=3cm' | rigid-motions (a closed organ "
                 "under its own pressure)")
      ->type_name("WHERE")
      ->expected(1)
      ->allow_extra_args(false)  // the next word is a file
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_flag("--static", a.is_static, "solve for the state of rest");
  app.add_option("--load-steps", a.load_steps,
                 "static: steps in which the load grows, each written (default: all at once)")
      ->type_name("N");
  tool.quantity("--duration", a.duration, dimension::time, "dynamic: time simulated, e.g. 2s");
  tool.quantity("--step", a.step, dimension::time, "dynamic: time step, e.g. 40ms");
  tool.quantity("--ramp", a.ramp, dimension::time,
                "dynamic: the load grows from zero over this time (default: at once)");
  app.add_option("--membrane", a.membrane, "membrane element: cst | opt | adapt (default adapt)")->type_name("NAME");
  app.add_option("--bending", a.bending,
                 "bending element: comas (the paper's) | comas-consistent | dkt | dkt-comas (default dkt-comas)")
      ->type_name("NAME");
  app.add_option("--solver", a.solver, "cg | direct | auto (default auto)")->type_name("NAME");
  app.add_option("--cg-tolerance", a.cg_tolerance, "relative residual at which CG stops, e.g. 5% (the paper's)")
      ->type_name("PERCENT");
  app.add_option("--cg-iterations", a.cg_iterations,
                 "at most N CG iterations; without --cg-tolerance a fixed count that asks for no convergence")
      ->type_name("N");
  app.add_option("--converge", a.converge, "relative residual at which a step counts as solved (default 1e-8)")
      ->type_name("NUMBER");
  app.add_option("--every", a.every, "write every N-th state (default 1); the first and the last always")
      ->type_name("N");
  app.add_option("--mesh-unit", a.mesh_unit, "unit of length of a mesh in a format that carries none: mm | cm | m | um")
      ->type_name("mm|cm|m|um");
  app.add_flag("--check", a.check, "validate, print the resolved scene in SI units, and stop");
  app.add_option(resume_flag, a.resume,
                 "go on with a run that was interrupted, also by kill -9: alone, or beside the same command as before")
      ->type_name("OUT.hdf.part");
  app.add_option("--tessellation", a.tessellation,
                 "pieces per edge into which a curved shell is cut for drawing (default 4, less for many shells)")
      ->type_name("N");
  app.add_option("--export", a.exports,
                 "write beside OUT.hdf, may repeat: pvd (OUT.pvd with a .vtu per state) | xmf (OUT.xmf, XDMF)")
      ->type_name("pvd|xmf")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

template <typename Value>
Value required(const std::optional<Value>& value, const char* flag, const char* example) {
  if (!value) {
    throw UsageError(fmt::format("{0} is missing: give it, for example {0} {1}", flag, example));
  }
  return *value;
}

double number(const std::optional<std::string>& text, const char* flag, double otherwise) {
  if (!text) {
    return otherwise;
  }
  const auto value = parse_number(*text);
  if (!value) {
    throw UsageError(fmt::format("{}: '{}' is not a number", flag, *text));
  }
  return *value;
}

std::optional<std::size_t> count(const std::optional<std::string>& text, const char* flag, double most) {
  if (!text) {
    return std::nullopt;
  }
  const auto value = parse_number(*text);
  if (!value || *value < 1 || *value > most || *value != std::floor(*value)) {
    throw UsageError(fmt::format("{}: '{}' is not a whole number from 1 to {:.0f}", flag, *text, most));
  }
  return static_cast<std::size_t>(*value);
}

template <typename Value>
void choose(const std::optional<std::string>& word, const char* flag, Value& value,
            std::initializer_list<std::pair<std::string_view, Value>> choices) {
  if (!word) {
    return;
  }
  std::string known;
  for (const auto& [name, meaning] : choices) {
    if (*word == name) {
      value = meaning;
      return;
    }
    known += fmt::format("{}{}", known.empty() ? "" : ", ", name);
  }
  throw UsageError(fmt::format("{}: '{}' is not one of {}", flag, *word, known));
}

Places flags_as_places(std::initializer_list<const char*> keys) {
  Places places{{"command line", true}, {}};
  for (const char* key : keys) {
    places.keys[key] = {std::string("--") + key, true};
  }
  return places;
}

// "boundary", "rigid-motions", "below z=-10mm", "above x = 3cm".
Selection parse_fix(const std::string& text) {
  if (text == "boundary") {
    return BoundaryNodes{};
  }
  if (text == "rigid-motions") {
    return RigidMotions{};
  }
  const auto unknown = [&] {
    throw UsageError(fmt::format(
        "--fix: '{}' is not understood: write boundary, rigid-motions, 'below z=-10mm' or 'above x=3cm'", text));
  };
  HalfSpaceNodes half;
  half.below = text.starts_with("below ");
  if (!half.below && !text.starts_with("above ")) {
    unknown();
  }
  const std::size_t axis = text.find_first_not_of(' ', 6);
  const std::size_t equals = text.find('=');
  if (axis == std::string::npos || text[axis] < 'x' || text[axis] > 'z' || equals == std::string::npos ||
      text.find_first_not_of(' ', axis + 1) != equals) {
    unknown();
  }
  half.axis = text[axis] - 'x';
  try {
    half.at = parse_quantity(text.substr(equals + 1), dimension::length);
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--fix '{}': {}", text, error.what()));
  }
  return half;
}

void set_kind(const Arguments& a, Scene& scene, Ramp& load_ramp) {
  if (a.is_static) {
    for (const auto& [given, flag] :
         {std::pair{a.duration.has_value(), "--duration"}, std::pair{a.step.has_value(), "--step"},
          std::pair{a.ramp.has_value(), "--ramp"}}) {
      if (given) {
        throw UsageError(fmt::format("--static and {} contradict each other: give one", flag));
      }
    }
    scene.run.kind = StaticRun{false, equal_load_factors(count(a.load_steps, "--load-steps", 1e6).value_or(1))};
    return;
  }
  if (!a.duration && !a.step) {
    throw UsageError("--static is missing: give it, or --duration and --step for a dynamic run");
  }
  if (a.load_steps) {
    throw UsageError("--load-steps belongs to --static: in a dynamic run give --ramp");
  }
  DynamicRun& dynamic = scene.run.kind.emplace<DynamicRun>();
  dynamic.duration = required(a.duration, "--duration", "2s");
  dynamic.step = required(a.step, "--step", "40ms");
  if (a.ramp) {
    if (!(*a.ramp > 0)) {
      throw UsageError("--ramp: must be greater than zero");
    }
    load_ramp.points = {{0, 0}, {*a.ramp, 1}};
  }
}

// The scene that the flags describe: one shell under pressure.
Scene scene_of_flags(const Arguments& a) {
  Scene scene;
  SceneLoad load{"shell", std::nullopt, PressureLoad{}, {}, flags_as_places({})};
  scene.run_places = flags_as_places({"duration", "step", "solver", "converge", "every"});
  scene.run_places.keys["cg_tolerance"] = {"--cg-tolerance", true};
  scene.run_places.keys["cg_iterations"] = {"--cg-iterations", true};
  set_kind(a, scene, load.ramp);
  choose<Solver>(a.solver, "--solver", scene.run.solver,
                 {{"auto", Solver::automatic}, {"cg", Solver::cg}, {"direct", Solver::direct}});
  if (a.cg_tolerance) {
    scene.run.cg_tolerance = parse_percent(*a.cg_tolerance);
    scene.cg_tolerance_stated = true;
  }
  scene.run.cg_iterations = count(a.cg_iterations, "--cg-iterations", 1e9);
  scene.run.converge = number(a.converge, "--converge", scene.run.converge);
  scene.run.every = count(a.every, "--every", 1e9).value_or(1);

  SceneShell shell;
  shell.name = load.body;
  shell.places = flags_as_places({"thickness", "young", "poisson", "density"});
  shell.mesh = a.files.front();
  if (a.mesh_unit) {
    shell.unit_mm = parse_length_unit(*a.mesh_unit);
  }
  shell.material.young = required(a.young, "--young", "1MPa");
  (void)required(a.poisson, "--poisson", "0.45");
  shell.material.poisson = number(a.poisson, "--poisson", 0);
  shell.thickness = required(a.thickness, "--thickness", "1.5mm");
  if (!a.is_static) {
    (void)required(a.density, "--density", "1100kg/m3");
  }
  shell.material.density = a.density;
  choose<Membrane>(a.membrane, "--membrane", shell.membrane,
                   {{"cst", Membrane::cst}, {"opt", Membrane::opt}, {"adapt", Membrane::adapt}});
  choose<Bending>(a.bending, "--bending", shell.bending,
                  {{"comas", Bending::comas},
                   {"comas-consistent", Bending::comas_consistent},
                   {"dkt", Bending::dkt},
                   {"dkt-comas", Bending::dkt_comas}});
  scene.shells.push_back(shell);

  load.kind = PressureLoad{required(a.pressure, "--pressure", "100mmHg"), true};
  scene.loads.push_back(load);
  for (const std::string& text : a.fixes) {
    SceneFix fix;
    fix.body = shell.name;
    fix.where = parse_fix(text);
    fix.places = {{fmt::format("{}: --fix '{}'", shell.mesh.string(), text), true}, {}};
    scene.fixes.push_back(fix);
  }
  settle_solver(scene);
  check_scene(scene);
  return scene;
}

// Mechanics knows bodies, and where some of them were said: says which file a refused or unsolved model came from.
template <typename Work>
auto naming(const fs::path& file, const Work& work) {
  try {
    return work();
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string() + ":") ? what : fmt::format("{}: {}", file.string(), what));
  } catch (const RequirementError& error) {
    throw RequirementError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

// OUT.hdf of a run that goes on.
fs::path resumed_output(const Arguments& a) {
  fs::path out = a.resume;
  out.replace_extension();
  if (a.resume.extension() != ".part" || out.empty()) {
    throw UsageError(
        fmt::format("{} {}: name the partial result, which ends with .part", resume_flag, a.resume.string()));
  }
  if (a.check) {
    throw UsageError(fmt::format("--check and {} contradict each other: give one", resume_flag));
  }
  return out;
}

// Which file is written; empty where --check needs none.
fs::path output_path(const CLI::App& app, const Arguments& a) {
  const bool from_scene = !a.scene.empty();
  const bool resumed = !a.resume.empty();
  // A run that goes on knows its scene and its output, and may be told them again.
  const bool alone = resumed && !from_scene && a.files.size() < 2;
  for (const char* flag : scene_says) {
    if ((from_scene || alone) && app.count(flag) > 0) {
      throw UsageError(
          from_scene
              ? fmt::format("{} and {} contradict each other: write it in the scene file", scene_flag, flag)
              : fmt::format("{} and {}: name SHELL.ply and OUT.hdf too, or nothing of the scene", resume_flag, flag));
    }
  }
  const std::size_t inputs = from_scene || alone ? 0 : 1;
  const std::size_t wanted = inputs + (a.check || resumed ? 0 : 1);
  if (a.files.size() < wanted) {
    throw UsageError(from_scene || a.files.size() == 1 ? "OUT.hdf is missing: name the result file"
                                                       : "SHELL.ply and OUT.hdf are missing: name them, or --scene");
  }
  if (a.files.size() > inputs + 1) {
    throw UsageError(
        fmt::format("{}: one file too many, with {} only OUT.hdf is named", a.files.back().string(), scene_flag));
  }
  const fs::path named = a.files.size() > inputs ? a.files.back() : fs::path();
  if (!resumed) {
    return named;
  }
  const fs::path out = resumed_output(a);
  if (!named.empty() && fs::weakly_canonical(fs::absolute(named)) != fs::weakly_canonical(fs::absolute(out))) {
    throw UsageError(fmt::format("{}: {} goes on with {}, name that", named.string(), resume_flag, out.string()));
  }
  return out;
}

// The scene, from wherever the command line says; what it was read from is registered.
Scene read_scene_of_run(cli::Tool& tool, const Arguments& a, const std::optional<RunJournal>& before,
                        std::vector<fs::path>& inputs) {
  Scene scene;
  if (!a.scene.empty()) {
    inputs.push_back(tool.input(a.scene));
    scene = read_scene(a.scene);
  } else if (before && a.files.size() < 2) {
    scene = parse_scene(before->identity().scene, a.resume);
  } else {
    scene = scene_of_flags(a);
  }
  for (const SceneShell& shell : scene.shells) {
    if (std::find(inputs.begin(), inputs.end(), shell.mesh) == inputs.end()) {
      inputs.push_back(tool.input(shell.mesh));
    }
  }
  return scene;
}

struct Drawing {
  std::string tessellation = "default";
  bool pvd = false;
  bool xmf = false;

  [[nodiscard]] std::vector<std::pair<std::string, std::string>> as_options() const {
    return {{"--tessellation", tessellation},
            {"--export", pvd && xmf ? "pvd, xmf"
                         : pvd      ? "pvd"
                         : xmf      ? "xmf"
                                    : "nothing"}};
  }
  [[nodiscard]] int level() const { return tessellation == "default" ? 0 : std::stoi(tessellation); }
};

Drawing drawing_of_flags(const Arguments& a) {
  Drawing drawing;
  constexpr double finest = 64;
  if (const auto pieces = count(a.tessellation, "--tessellation", finest)) {
    drawing.tessellation = std::to_string(*pieces);
  }
  for (const std::string& format : a.exports) {
    if (format != "pvd" && format != "xmf") {
      throw UsageError(fmt::format("--export: '{}' is not one of pvd, xmf", format));
    }
    (format == "pvd" ? drawing.pvd : drawing.xmf) = true;
  }
  return drawing;
}

// A run that goes on draws as it began where nothing else is said.
Drawing drawing_of_run(const Arguments& a, const RunIdentity& before) {
  Drawing drawing = drawing_of_flags(a);
  for (const auto& [flag, value] : before.options) {
    if (flag == "--tessellation" && !a.tessellation) {
      drawing.tessellation = value;
    }
    if (flag == "--export" && a.exports.empty()) {
      drawing.pvd = value.find("pvd") != std::string::npos;
      drawing.xmf = value.find("xmf") != std::string::npos;
    }
  }
  return drawing;
}

RunIdentity identity_of_run(const cli::Tool& tool, const Scene& scene, const std::vector<fs::path>& inputs,
                            const Drawing& drawing) {
  RunIdentity identity{version, scene_text(scene), tool.command(), {}, {}, drawing.as_options()};
  for (const fs::path& path : inputs) {
    identity.inputs.emplace_back(path.string(), sha256_of_file(path));
  }
  for (const SceneShell& shell : scene.shells) {
    identity.meshes.emplace_back(shell.mesh.string(), sha256_of_file(shell.mesh));
  }
  return identity;
}

void simulate(cli::Tool& tool, const Arguments& a) {
  const fs::path out = output_path(tool.arguments(), a);
  std::optional<cli::Tool::Stage> stage(std::in_place, tool, "read");
  std::optional<RunJournal> journal;
  if (!a.resume.empty()) {
    journal.emplace(RunJournal::open(a.resume));
  }
  const Drawing drawing = journal ? drawing_of_run(a, journal->identity()) : drawing_of_flags(a);
  std::vector<fs::path> inputs;
  const Scene scene = read_scene_of_run(tool, a, journal, inputs);
  const auto* dynamic = std::get_if<DynamicRun>(&scene.run.kind);
  const auto* frequencies = std::get_if<FrequencyRun>(&scene.run.kind);
  const auto* buckling = std::get_if<BucklingRun>(&scene.run.kind);
  const bool modes = frequencies != nullptr || buckling != nullptr;
  const bool by_arc_length = std::holds_alternative<ArcLengthRun>(scene.run.kind);
  const bool series = dynamic != nullptr || modes || by_arc_length;
  // A run that goes on replaces what it has exported itself.
  const bool replace_exports = tool.force() || journal.has_value();
  const ExportOptions exports{drawing.pvd, drawing.xmf, series, drawing.level(), replace_exports};
  if (!a.check) {
    tool.output(out);
    for (const fs::path& path : export_paths(out, exports)) {
      if (journal) {
        fs::remove(path);  // of the same run, stopped between its renames
      }
      tool.output(path);
    }
  }
  const LoadedScene loaded = load_scene(scene);
  const Model& model = loaded.model;
  for (const std::string& note : loaded.notes) {
    tool.note(note);
  }

  stage.emplace(tool, "setup");
  prepare_result(tool.result(), model);
  const fs::path& subject = inputs.front();
  naming(subject, [&] { check_model(model, scene.run); });
  for (const std::string& doubt : doubts(model, scene.run)) {
    tool.warn(doubt);
  }
  if (a.check) {
    tool.print(scene_text(scene));
    return;
  }
  const RunIdentity identity = identity_of_run(tool, scene, inputs, drawing);
  if (!journal) {
    journal.emplace(RunJournal::create(part_of(out), identity));
  } else if (const std::string differs = difference(journal->identity(), identity); !differs.empty()) {
    throw InputError(fmt::format("{}: is another run: {}", a.resume.string(), differs));
  }
  const RunIdentity& origin = journal->identity();

  stage.emplace(tool, "write");
  const char* const time_units = dynamic != nullptr ? "s" : frequencies != nullptr ? "Hz" : "1";
  ResultFile file(out, model,
                  {series, time_units, origin.command, origin.scene, origin.inputs, drawing.level(), tool.force()});
  std::optional<ResultExport> exported;
  if (drawing.pvd || drawing.xmf) {
    exported.emplace(out, model, exports);
  }
  const ElementFieldEvaluator fields(model);
  constexpr double most_bending = std::numbers::pi / 6;
  std::size_t unresolved = 0;
  const auto record = [&](const State& state) {
    const ElementFields of_state = fields(state);
    report_state(tool.result(), model, state, of_state, dynamic != nullptr);
    file.append(state, of_state);
    if (const auto written = exported ? exported->append(state, of_state) : std::nullopt) {
      tool.wrote(*written);
    }
    unresolved = count_unresolved(model, state, most_bending);
  };
  Resumption resumption;
  if (!a.resume.empty()) {
    resumption.from = journal->replay(model.node_count(), record);
    tool.note(resumption.from
                  ? fmt::format("{}: goes on after step {}", a.resume.string(), resumption.from->summary.steps)
                  : fmt::format("{}: begins again, it has no checkpoint yet", a.resume.string()));
  }
  stage.emplace(tool, "solve");
  resumption.on_step = [&](const std::function<Checkpoint()>& make) {
    stage.emplace(tool, "write");
    journal->offer(make);
    stage.emplace(tool, "solve");
  };
  const auto on_state = [&](const State& state) {
    stage.emplace(tool, "write");
    journal->append(state);
    record(state);
    stage.emplace(tool, "solve");
  };
  Summary summary;
  try {
    summary = naming(subject, [&] { return solve(model, scene.run, on_state, tool.progress("solve"), resumption); });
  } catch (const InputError&) {
    journal->remove();
    throw;
  } catch (const RequirementError&) {
    journal->remove();  // it would end at the same step again
    throw;
  }
  stage.emplace(tool, "write");
  // A fixed count of iterations asks for no convergence, so none is claimed.
  const bool converged = summary.converged && !scene.run.cg_fixed_count;
  report_summary(tool.result(), summary, converged,
                 dynamic != nullptr ? std::optional(dynamic->duration) : std::nullopt);
  if (exported) {
    exported->commit();
  }
  file.commit(converged);  // last: what is not renamed can still be resumed
  journal->remove();
  if (modes) {
    report_modes(tool.result(), summary);
    tool.note(modes_note(summary, frequencies != nullptr ? frequencies->count : buckling->count));
    if (summary.stiffened_from && buckling != nullptr) {
      tool.warn(
          fmt::format("{}: the mesh is coarse for so thin a curved shell (h^2 > 3 R t): buckles shorter than its "
                      "elements are not seen, and the factors may be too high: refine it",
                      subject.string()));
    }
    return;
  }
  tool.note(fmt::format("{} nodes in {} steps, {}: largest displacement {:.4g} mm", model.node_count(), summary.steps,
                        converged ? "converged" : "not asked to converge",
                        tool.result()["max_displacement_mm"].get<double>()));
  for (const std::string& text : run_warnings(scene.run, summary, unresolved)) {
    tool.warn(fmt::format("{}: {}", subject.string(), text));
  }
}

}  // namespace
}  // namespace tunica

int main(int argc, char** argv) {
  using namespace tunica;
  cli::Tool tool("simulate", "Pressure load on thin curved shells, static or dynamic.",
                 "tunica-simulate shell.ply result.hdf --young 1MPa --poisson 0.45 --thickness 1.5mm --pressure 1kPa "
                 "--fix boundary --static\n"
                 "  tunica-simulate shell.ply motion.hdf --young 1MPa --poisson 0.45 --thickness 1.5mm --density "
                 "1100kg/m3 --pressure 1kPa --fix boundary --duration 100ms --step 10ms --ramp 50ms");
  Arguments arguments;
  declare(tool, arguments);
  tool.stages({"read", "setup", "solve", "write"});
  return tool.run(argc, argv, [&] { simulate(tool, arguments); });
}
