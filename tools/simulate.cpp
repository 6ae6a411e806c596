#include "tunica/accuracy/accuracy.hpp"
#include "tunica/accuracy/estimates.hpp"
#include "tunica/cli/picture_flags.hpp"
#include "tunica/cli/scene_flags.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/fit/relax.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/result/result_export.hpp"
#include "tunica/io/result/result_file.hpp"
#include "tunica/io/result/result_picture.hpp"
#include "tunica/io/result/run_journal.hpp"
#include "tunica/io/result/run_report.hpp"
#include "tunica/io/scene/scene.hpp"
#include "tunica/io/scene/scene_file.hpp"
#include "tunica/io/scene/stated.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/hold_doubts.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/mechanics/runs/unloaded.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <numbers>

namespace tunica {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<fs::path> files;
  fs::path scene, resume;
  cli::SceneFlags flags;
  cli::AccuracyFlags accuracy;
  cli::PictureFlags picture;
  std::optional<std::string> tessellation;
  std::vector<std::string> exports;
  std::optional<fs::path> unloaded;
  bool check = false;
};

constexpr const char* scene_flag = "--scene";
constexpr const char* resume_flag = "--resume";

void declare(cli::Tool& tool, Arguments& a) {
  CLI::App& app = tool.arguments();
  app.add_option("FILES", a.files, "SHELL.ply OUT.hdf; with --scene only OUT.hdf; with --check OUT.hdf may be left out")
      ->expected(0, 2)
      ->type_name("FILE");
  tool.group("Scene");
  app.add_option(scene_flag, a.scene, "read everything from a scene file (TOML)")->type_name("SCENE.toml");
  a.flags.declare(tool);
  a.accuracy.declare(tool);
  tool.group("Run");
  app.add_flag("--check", a.check, "validate, print the resolved scene in SI units, and stop");
  app.add_option(resume_flag, a.resume,
                 "go on with a run that was interrupted, also by kill -9: alone, or beside the same command as before")
      ->type_name("OUT.hdf.part");
  tool.group("Output");
  app.add_option("--tessellation", a.tessellation,
                 "pieces per edge into which a curved shell is cut for drawing (default 4, less for many shells)")
      ->type_name("N");
  app.add_option("--unloaded", a.unloaded,
                 "with --imaged-at: find the shape without that pressure, begin there, and write it")
      ->type_name("OUT.ply");
  app.add_option("--export", a.exports,
                 "write beside OUT.hdf, may repeat: pvd (OUT.pvd with a .vtu per state) | xmf (OUT.xmf, XDMF) | "
                 "inp (the model for CalculiX and Abaqus) | feb (the model for FEBio) | "
                 "glb, obj, stl, 3mf (the last state's shells; glb and obj coloured by stress)")
      ->type_name("pvd|xmf|inp|feb|glb|obj|stl|3mf")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  a.picture.declare(tool);
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
  for (const char* flag : cli::SceneFlags::names) {
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
    scene = a.flags.scene(a.files.front());
    cli::SceneFlags::keep_typed(tool.arguments(), scene);
  }
  for (const fs::path& mesh : mesh_files(scene)) {
    if (std::find(inputs.begin(), inputs.end(), mesh) == inputs.end()) {
      inputs.push_back(tool.input(mesh));
    }
  }
  return scene;
}

struct Drawing {
  static constexpr std::array<const char*, 8> formats{"pvd", "xmf", "inp", "feb", "glb", "obj", "stl", "3mf"};
  static constexpr std::size_t first_surface = 4;

  std::string tessellation = "default";
  std::array<bool, formats.size()> wanted{};
  bool no_paths = false;

  [[nodiscard]] bool has(std::string_view format) const {
    return wanted[std::ranges::find(formats, format) - formats.begin()];
  }
  [[nodiscard]] std::vector<std::string> surface_endings() const {
    std::vector<std::string> endings;
    for (std::size_t i = first_surface; i < formats.size(); ++i) {
      if (wanted[i]) {
        endings.push_back(fmt::format(".{}", formats[i]));
      }
    }
    return endings;
  }
  [[nodiscard]] bool any() const { return std::ranges::find(wanted, true) != wanted.end(); }
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> as_options() const {
    std::vector<std::string_view> names;
    std::ranges::copy_if(formats, std::back_inserter(names), [&](std::string_view name) { return has(name); });
    return {{"--tessellation", tessellation},
            {"--export", names.empty() ? "nothing" : fmt::format("{}", fmt::join(names, ", "))},
            {"--no-paths", no_paths ? "yes" : "no"}};
  }
  [[nodiscard]] int level() const { return tessellation == "default" ? 0 : std::stoi(tessellation); }
};

Drawing drawing_of_flags(const Arguments& a) {
  Drawing drawing;
  constexpr double finest = 64;
  if (const auto pieces = cli::count_of(a.tessellation, "--tessellation", finest)) {
    drawing.tessellation = std::to_string(*pieces);
  }
  for (const std::string& format : a.exports) {
    const auto* const found = std::ranges::find(Drawing::formats, format);
    if (found == Drawing::formats.end()) {
      throw UsageError(fmt::format("--export: '{}' is not one of {}", format, fmt::join(Drawing::formats, ", ")));
    }
    drawing.wanted[found - Drawing::formats.begin()] = true;
  }
  return drawing;
}

// A run that goes on draws as it began where nothing else is said.
void go_on_drawing(Drawing& drawing, const Arguments& a, const RunIdentity& before) {
  for (const auto& [flag, value] : before.options) {
    if (flag == "--tessellation" && !a.tessellation) {
      drawing.tessellation = value;
    }
    drawing.no_paths = drawing.no_paths || (flag == "--no-paths" && value == "yes");
    if (flag == "--export" && a.exports.empty()) {
      std::ranges::transform(Drawing::formats, drawing.wanted.begin(),
                             [&](const char* name) { return value.find(name) != std::string::npos; });
    }
  }
}

// How long a level took changes from run to run, and the result does not.
Json without_times(Json accuracy) {
  for (Json& level : accuracy["levels"]) {
    level.erase("seconds");
  }
  for (Json& choice : accuracy["choices"]) {
    choice.erase("would_cost");
  }
  return accuracy;
}

/// Of shells that leave the run as relax's do the report says what relax's says.
void certify(const ShellMesh& shell, const Target* target, const Progress& progress, Json& told) {
  told["min_angle_deg"] = min_angle_degrees(flat_facets(shell));
  if (target != nullptr) {
    const double diagonal = target->diagonal();
    ShellDistanceOptions measuring;
    measuring.width = 1e-4 * diagonal;
    measuring.progress = progress;
    const Interval distance = shell_distance(shell, *target, measuring).both;
    told["hausdorff_mm"] = {{"lower", distance.lower}, {"upper", distance.upper}};
    told["hausdorff_percent"] = {{"lower", 100 * distance.lower / diagonal},
                                 {"upper", 100 * distance.upper / diagonal}};
  }
}

RunIdentity identity_of_run(const cli::Tool& tool, const Scene& scene, const std::string& asked,
                            const std::vector<fs::path>& inputs, const Drawing& drawing) {
  RunIdentity identity{version, asked, tool.provenance().lasting_command(), {}, {}, drawing.as_options()};
  for (const fs::path& path : inputs) {
    identity.inputs.emplace_back(path.string(), sha256_of_file(path));
  }
  for (const fs::path& mesh : mesh_files(scene)) {
    identity.meshes.emplace_back(mesh.string(), sha256_of_file(mesh));
  }
  tool.require_unchanged_inputs();  // the hashes are of what was read
  return identity;
}

std::vector<std::pair<std::string, std::string>> shown_inputs(const cli::Tool& tool, const RunIdentity& origin) {
  std::vector<std::pair<std::string, std::string>> inputs = origin.inputs;
  for (auto& [path, hash] : inputs) {
    path = tool.provenance().redact(path);
  }
  return inputs;
}

/// What the meshes of a scene say beside what they hold.
void tell_findings(const cli::Tool& tool, const LoadedScene& loaded) {
  for (const std::string& note : loaded.notes) {
    tool.note(note);
  }
  for (const Warning& warning : loaded.warnings) {
    tool.warn(warning);
  }
}

void warn_of_no_target(const cli::Tool& tool, const fs::path& shells) {
  tool.warn({Weight::minor, "no target",
             fmt::format("{}: has no target: finer shells lie on its own patches, and the error of its geometry is not "
                         "seen (--target, or target in [accuracy])",
                         shells.string())});
}

/// A target that faces as the shells do.
std::unique_ptr<Target> target_like(const cli::Tool& tool, const ShellMesh& shell, TriangleMesh mesh,
                                    const fs::path& path) {
  auto target = std::make_unique<Target>(std::move(mesh));
  if (faces_other_way({shell.vertices, shell.triangles}, *target)) {
    tool.warn({Weight::minor, "faces the other way",
               fmt::format("{}: faces the other way than the shells: its triangles are turned around to agree",
                           path.string())});
    target = std::make_unique<Target>(turned_around(target->mesh()));
  }
  return target;
}

/// A target that cannot be what the shells were fitted to: no finer than they are, or somewhere else.
/// @param needed  else, where it is hardly finer, it is left out with a warning
/// @return whether it can be used
bool require_own_target(const cli::Tool& tool, const ShellMesh& shell, const Target& target, const fs::path& path,
                        bool needed) {
  constexpr std::size_t facets_per_shell = 2;
  constexpr double farthest_mean = 0.02;  // of the diagonal
  const std::size_t facets = target.mesh().triangles.size();
  const bool is_finer = facets >= facets_per_shell * shell.triangles.size();
  if (!is_finer && needed) {
    throw InputError(
        fmt::format("{}: has {} triangles, and the shells are {}: name the fine surface that they were fitted to",
                    path.string(), facets, shell.triangles.size()));
  }
  if (const double mean = mean_distance(shell, target).first; mean > farthest_mean * target.diagonal()) {
    throw InputError(
        fmt::format("{}: lies {:.3g} mm from the shells in the mean, {:.2g} % of its diagonal: it is not the "
                    "surface that they were fitted to",
                    path.string(), mean, 100 * mean / target.diagonal()));
  }
  if (!is_finer) {
    tool.warn({Weight::minor, "error of the mesh",
               fmt::format("{}: has {} triangles, too few to fit four times the {} shells to it: how far the answers "
                           "may be off by the mesh is not estimated; up to {} shells it can be (SHELLS={})",
                           path.string(), facets, shell.triangles.size(), facets / facets_per_shell,
                           facets / facets_per_shell)});
  }
  return is_finer;
}

/// Asks the scene for the unloaded shells, and names them as an output.
void name_unloaded(cli::Tool& tool, const Arguments& given, Scene& scene) {
  if (!given.unloaded) {
    return;
  }
  bool imaged = false;
  for (SceneLoad& load : scene.loads) {
    if (auto* pressure = std::get_if<PressureLoad>(&load.kind); pressure != nullptr && pressure->imaged_at) {
      pressure->unload = imaged = true;
      load.places.keys.try_emplace("unload", Place{"--unloaded", true});
    }
  }
  if (!imaged || scene.shells.size() > 1) {
    throw UsageError(imaged ? "--unloaded: the scene has more than one body, one can be written"
                            : "--unloaded belongs to --imaged-at, or imaged_at in a scene: give that too");
  }
  check_scene(scene);
  tool.output(*given.unloaded, {".ply"});
}

void warn_of(const cli::Tool& tool, const fs::path& subject, std::vector<Warning> warnings) {
  for (Warning& warning : warnings) {
    warning.text = fmt::format("{}: {}", subject.string(), warning.text);
    tool.warn(std::move(warning));
  }
}

std::function<void(const std::string&)> slow_step_note(const cli::Tool& tool, const fs::path& subject) {
  return [&tool, name = subject.string()](const std::string& text) {
    tool.warn({Weight::note, "slow step", fmt::format("{}: {}", name, text)});
  };
}

/// The world axes that the mesh of the first shells says.
std::string space_of_shells(const Scene& scene, const std::string& otherwise) {
  return scene.shells.empty()
             ? otherwise
             : read_mesh(scene.shells.front().mesh, scene.shells.front().unit_mm).space.value_or(otherwise);
}

/// The surfaces that the bodies' meshes were fitted to, by body.
std::map<std::string, fs::path> target_paths(const Scene& scene, const Arguments& given) {
  if (scene.accuracy) {
    return scene.accuracy->targets;
  }
  return given.accuracy.target && !scene.shells.empty()
             ? std::map<std::string, fs::path>{{scene.shells.front().name, *given.accuracy.target}}
             : std::map<std::string, fs::path>();
}

struct ReadTarget {
  std::unique_ptr<Target> target;
  std::string space;
  std::optional<double> voxel;  ///< mm, longest edge, of the image behind it
};

ReadTarget read_target(const cli::Tool& tool, const SceneShell& shell, const ShellMesh& mesh, const fs::path& path,
                       bool needed) {
  MeshFile file = read_mesh(path, shell.unit_mm, true);
  if (const auto note = unit_note(file, path)) {
    tool.warn(*note);
  }
  require_surface(file, path);
  const MeshFile own = read_mesh(shell.mesh, shell.unit_mm);
  require_same_scale(own, shell.mesh, file, path, shell.unit_mm);
  require_near(own, shell.mesh, file, path);
  ReadTarget read;
  read.space = common_space(own, shell.mesh, file, path);
  if (file.voxel) {
    read.voxel = shell.scale * *file.voxel;
  }
  for (Vec3& vertex : file.mesh.vertices) {
    vertex *= shell.scale;
  }
  read.target = target_like(tool, mesh, std::move(file.mesh), path);
  if (!require_own_target(tool, mesh, *read.target, path, needed)) {
    read.target.reset();
  }
  return read;
}

/// The shells without the pressure of the image, which is told.
Model unloaded_model(cli::Tool& tool, const Model& imaged, const RunSettings& run, const fs::path& subject) {
  Unloaded found = naming(subject.string(), [&] {
    return find_unloaded(imaged, run, [&](double part, double change) {
      tool.detail(fmt::format("unloaded shape: {:.3g} of the pressure, moved by {:.3g} mm in the mean", part, change));
    });
  });
  tool.result()["unloaded"] = unloaded_report(found);
  warn_of(tool, subject, unloaded_warnings(found));
  tool.note(fmt::format(
      "the unloaded shape is found: under the pressure of the image it lies {:.2g} mm from the image, {:.2g} "
      "mm at most",
      found.mean_distance, found.largest_distance));
  return std::move(found.model);
}

/// How far the answers of a static run may be off, by one refinement solved besides.
Estimates refined_estimates(const cli::Tool& tool, const System& system, const Scene& scene, const Target& target,
                            const std::pair<State, ElementFields>& last, const fs::path& subject) {
  RefinedAnswers refined = naming(subject.string(), [&] {
    return estimate_by_refinement(
        system.model(), last.first, last.second, {&target}, system.settings(),
        [&](std::vector<ShellBody> bodies) { return resolve_scene(scene, std::move(bodies)); });
  });
  if (!refined.reason.empty()) {
    tool.warn(
        {Weight::minor, "error of the mesh",
         fmt::format("{}: how far the answers may be off by the mesh is not known, for on shells split in four {}: "
                     "take more shells (SHELLS)",
                     subject.string(), refined.reason)});
  }
  return std::move(refined.estimates);
}

/// Sentences that name their places themselves.
void tell_doubts(const cli::Tool& tool, const std::vector<Warning>& some, const std::vector<Warning>& more) {
  for (const auto* doubts : {&some, &more}) {
    for (const Warning& doubt : *doubts) {
      tool.warn(doubt);
    }
  }
}

void write_shells(const cli::Tool& tool, const fs::path& out, const ShellMesh& mesh, const std::string& space,
                  bool partial) {
  PlyOptions options;
  options.comments = {"made by " + tool.made_by()};
  options.space = space;
  options.overwrite = tool.force();
  options.partial = partial;
  write_ply(out, mesh, options);
}

/// Of which state a picture is: the last one, or the first mode.
std::string when(const RunSettings& run, const State& state) {
  return std::holds_alternative<FrequencyRun>(run.kind) || std::holds_alternative<BucklingRun>(run.kind)
             ? "of the first mode (only the shape counts)"
         : std::holds_alternative<DynamicRun>(run.kind) ? fmt::format("after {:.4g} s", state.time)
         : state.load_factor == 1                       ? "under the whole load"
                                                        : fmt::format("under {:.4g} times the load", state.load_factor);
}

void tell_modes(cli::Tool& tool, const Summary& summary, const RunSettings& run, const fs::path& subject) {
  const auto* frequencies = std::get_if<FrequencyRun>(&run.kind);
  report_modes(tool.result(), summary);
  tool.note(modes_note(summary, frequencies != nullptr ? frequencies->count : std::get<BucklingRun>(run.kind).count));
  if (summary.stiffened_from && frequencies == nullptr) {
    tool.warn({Weight::major, "coarse shells",
               fmt::format("{}: the mesh is coarse for so thin a curved shell (h^2 > 3 R t): buckles shorter than its "
                           "elements are not seen, and the factors may be too high: refine it",
                           subject.string())});
  }
}

/// The answer in a line.
std::string answer_text(const LastState& last, bool with_wall) {
  std::string text = fmt::format("largest displacement {:.4g} mm", last.largest_displacement);
  if (last.peak) {
    text += fmt::format(" at the end of the motion ({:.4g} mm at most in the states written, at {:.4g} s)",
                        last.peak->displacement, last.peak->time);
  }
  if (with_wall) {
    text += fmt::format(
        " (99 % of the wall below {:.4g} mm), membrane stress of the wall {} (99th percentile), at its faces {}",
        last.displacement_p99, pressure_text(last.wall.membrane_p99), pressure_text(last.wall.stress_p99));
  }
  return text;
}

class Simulation {
public:
  Simulation(cli::Tool& tool, const Arguments& given) : tool_(tool), given_(given) {}

  void run() {
    stage("read");
    read();
    stage("setup");
    prepare_result(tool_.result(), model());
    naming(subject().string(), [&] { system_.emplace(std::move(loaded_->model), scene_.run); });
    if (scene_.accuracy && !given_.check) {
      choose_model();
    }
    tell_doubts(tool_, doubts(model(), scene_.run, accuracy_ || may_refine()), doubts_of_ends(model()));
    if (given_.check) {
      tool_.print(scene_text(scene_));
      return;
    }
    if (model().is_imaged_under_pressure()) {
      take_as_imaged();
    }
    begin();
    const Summary summary = accuracy_ ? recorded() : solved();
    stage("write");
    if (given_.accuracy.shell_out) {
      certify(model().shells.front().mesh, targets_.front().get(), tool_.progress("certify"),
              tool_.result()["accuracy"]);
      write_shells(tool_, *given_.accuracy.shell_out, model().shells.front().mesh, space_,
                   !accuracy_->reasons.empty() && !accuracy_->request.max_seconds);
    }
    // A fixed count of iterations asks for no convergence, so none is claimed.
    const bool converged = summary.converged && !scene_.run.cg_fixed_count;
    const auto* dynamic = kind<DynamicRun>();
    report_summary(tool_.result(), summary, converged,
                   dynamic != nullptr ? std::optional(dynamic->duration) : std::nullopt);
    estimate();
    require_accuracy();
    if (given_.unloaded) {
      space_ = space_of_shells(scene_, space_);
      write_shells(tool_, *given_.unloaded, model().shells.front().mesh, space_, false);
    }
    if (given_.picture.out) {
      draw();
    }
    if (exported_) {
      exported_->commit();
    }
    file_->commit(converged);  // last: what is not renamed can still be resumed
    journal_->remove();
    if (is_modes()) {
      tell_modes(tool_, summary, scene_.run, subject());
    } else {
      tell(summary, converged);
    }
  }

private:
  void stage(const char* name) { stage_.emplace(tool_, name); }

  [[nodiscard]] const Model& model() const { return system_ ? system_->model() : loaded_->model; }
  [[nodiscard]] const fs::path& subject() const { return inputs_.front(); }

  template <typename Kind>
  [[nodiscard]] const Kind* kind() const {
    return std::get_if<Kind>(&scene_.run.kind);
  }

  [[nodiscard]] bool is_modes() const { return kind<FrequencyRun>() != nullptr || kind<BucklingRun>() != nullptr; }

  /// States that follow each other, in a file that says when.
  [[nodiscard]] bool is_series() const {
    return kind<DynamicRun>() != nullptr || is_modes() || kind<ArcLengthRun>() != nullptr;
  }

  [[nodiscard]] ExportOptions exports() const {
    // A run that goes on replaces what it has exported itself.
    return {
        .pvd = drawing_.has("pvd"),
        .xmf = drawing_.has("xmf"),
        .inp = drawing_.has("inp"),
        .feb = drawing_.has("feb"),
        .surfaces = drawing_.surface_endings(),
        .run = scene_.run,
        .made_by = fmt::format("tunica {}: {}", version,
                               journal_ ? redact(journal_->identity().command) : tool_.provenance().lasting_command()),
        .series = is_series(),
        .tessellation = drawing_.level(),
        .overwrite = tool_.force() || !given_.resume.empty(),
        .space = drawing_.surface_endings().empty() ? space_ : space_of_shells(scene_, space_)};
  }

  void read() {
    out_ = output_path(tool_.arguments(), given_);
    if (!given_.resume.empty()) {
      journal_.emplace(RunJournal::open(given_.resume));
    }
    drawing_ = drawing_of_flags(given_);
    drawing_.no_paths = tool_.provenance().hides_paths();
    if (journal_) {
      go_on_drawing(drawing_, given_, journal_->identity());
      if (drawing_.no_paths) {
        tool_.provenance().hide_paths();
        for (const auto& [path, hash] : journal_->identity().inputs) {
          tool_.provenance().add_input(path);
        }
      }
    }
    scene_ = read_scene_of_run(tool_, given_, journal_, inputs_);
    if (!given_.check) {
      tool_.output(out_, {".hdf", ".vtkhdf", ".h5", ".hdf5"});
      for (const fs::path& path : export_paths(out_, exports())) {
        if (journal_) {
          fs::remove(path);  // of the same run, stopped between its renames
        }
        tool_.output(path);
      }
      if (given_.picture.out) {
        tool_.output(*given_.picture.out, {".png"});
      }
    } else if (given_.picture.out) {
      throw UsageError("--check and --picture contradict each other: a picture needs a result");
    }
    picture_ = given_.picture.options(is_modes());
    given_.accuracy.ask(tool_.arguments(), scene_);
    require_fresh();
    name_unloaded(tool_, given_, scene_);
    asked_ = scene_text(scene_, out_);
    tool_.stated() = stated_inputs(scene_);
    loaded_.emplace(load_scene(scene_));
    read_targets();
    tell_findings(tool_, *loaded_);
    for (std::size_t b = 0; scene_.accuracy && b < targets_.size(); ++b) {
      if (!targets_[b] && model().shells[b].curved) {
        warn_of_no_target(tool_, scene_.shells[b].mesh);
      }
    }
  }

  /// An accuracy begins again with each run: its meshes are not in the partial result.
  void require_fresh() {
    if (!scene_.accuracy) {
      return;
    }
    if (journal_) {
      throw UsageError(fmt::format("{}: a run for an accuracy does not go on: begin again", resume_flag));
    }
    if (given_.accuracy.shell_out) {
      if (scene_.shells.size() > 1) {
        throw UsageError("--shell-out: the scene has more than one body, one can be written");
      }
      tool_.output(*given_.accuracy.shell_out, {".ply"});
    }
  }

  void read_targets() {
    targets_.resize(scene_.shells.size());
    for (const auto& [name, path] : target_paths(scene_, given_)) {
      const auto found = std::ranges::find(scene_.shells, name, &SceneShell::name);
      const std::size_t b = found - scene_.shells.begin();
      inputs_.push_back(tool_.input(path));
      ReadTarget read = read_target(tool_, *found, model().shells[b].mesh, path, scene_.accuracy.has_value());
      space_ = read.space;
      if (read.voxel) {
        voxel_ = std::max(voxel_.value_or(0), *read.voxel);
      }
      targets_[b] = std::move(read.target);
    }
  }

  [[nodiscard]] AccuracyRequest request() const {
    const SceneAccuracy& asked = *scene_.accuracy;
    const auto most = cli::count_of(given_.accuracy.max_shells, "--max-shells", real(max_index));
    return {asked.within,
            asked.of,
            most.value_or(AccuracyRequest().max_shells),
            asked.probe,
            asked.axis,
            voxel_,
            given_.accuracy.max_seconds};
  }

  /// Goes from level to level; the model is then the last one's.
  void choose_model() {
    const AccuracyRequest request = this->request();
    stage("solve");
    std::vector<const Target*> targets;
    for (const auto& target : targets_) {
      targets.push_back(target.get());
    }
    accuracy_ = naming(subject().string(), [&] {
      return solve_within(
          model().shells, targets, request, scene_.run,
          [&](std::vector<ShellBody> bodies) { return resolve_scene(scene_, std::move(bodies)); },
          [&](const AccuracyLevel& level) { tool_.note(level_note(level, request)); });
    });
    system_ = accuracy_->system;
    if (kind<DynamicRun>() != nullptr && std::holds_alternative<StaticRun>(accuracy_->settings.kind)) {
      tool_.note("the loads rise so slowly that rest under them serves: the result holds that state, not the motion");
    }
    scene_.run = accuracy_->settings;
    prepare_result(tool_.result(), model());
    tool_.result()["accuracy"] = accuracy_report(*accuracy_);
  }

  /// Puts the stress of the image into the walls, or takes the shells back to what they are without its pressure.
  void take_as_imaged() {
    stage("solve");
    const bool unload = std::ranges::any_of(model().loads, [](const Load& load) {
      const auto* pressure = std::get_if<PressureLoad>(&load.kind);
      return pressure != nullptr && pressure->unload;
    });
    if (!unload) {
      const double residual = naming(subject().string(), [&] { return *system_->prestress_residual(); });
      tool_.result()["prestress"] = prestress_report(model(), residual);
      return;
    }
    system_.emplace(unloaded_model(tool_, model(), scene_.run, subject()), scene_.run);
  }

  /// What choose_model() has solved, as solved() hands it over.
  Summary recorded() {
    stage("write");
    for (const State& state : accuracy_->states) {
      journal_->append(state);
      record(state);
    }
    return accuracy_->summary;
  }

  void draw() const {
    ResultPictureOptions options = picture_;
    options.when = when(scene_.run, drawn_->first);
    write_file(*given_.picture.out, result_picture(model(), drawn_->first, drawn_->second, options), tool_.force());
  }

  /// Whether one refinement can be solved besides.
  [[nodiscard]] bool may_refine() const {
    return kind<StaticRun>() != nullptr && !targets_.empty() && targets_.front() && !given_.unloaded &&
           holds_for_finer_meshes(scene_);
  }

  /// Says how far the answers may be off: by the levels of an accuracy, or by one refinement solved besides.
  void estimate() {
    Estimates estimates;
    if (accuracy_) {
      estimates = accuracy_->estimates;
    } else if (may_refine() && drawn_) {
      stage("solve");
      estimates = refined_estimates(tool_, *system_, scene_, *targets_.front(), *drawn_, subject());
      stage("write");
    }
    tool_.result()["estimates"] = estimates_report(estimates);
    if (!accuracy_) {
      warn_of(tool_, subject(), estimate_warnings(estimates));
    }
  }

  void require_accuracy() {
    if (!accuracy_) {
      return;
    }
    for (const std::string& line : accuracy_notes(*accuracy_)) {
      tool_.note(line);
    }
    if (!accuracy_->reasons.empty() && accuracy_->request.max_seconds) {
      tool_.warn(
          {Weight::minor, "accuracy not reached",
           fmt::format("{}: {}; shells made anew of this surface, four times as many (of the pipeline SHELLS={} in "
                       "place of ACCURACY, OF and --max-seconds), may do better, as far as the surface has them",
                       subject().string(), missed_accuracy(*accuracy_), 4 * accuracy_->levels.back().shells)});
    } else if (!accuracy_->reasons.empty()) {
      journal_->remove();
      throw RequirementError(fmt::format("{}: {}; what there is stays in {}.part", subject().string(),
                                         missed_accuracy(*accuracy_), out_.string()));
    }
  }

  /// Opens what the run writes: its journal, the result, what other programs draw.
  void begin() {
    const RunIdentity identity = identity_of_run(tool_, scene_, asked_, inputs_, drawing_);
    if (!journal_) {
      journal_.emplace(RunJournal::create(part_of(out_), identity));
    } else if (const std::string differs = difference(journal_->identity(), identity); !differs.empty()) {
      throw InputError(fmt::format("{}: is another run: {}", given_.resume.string(), differs));
    }
    const RunIdentity& origin = journal_->identity();
    stage("write");
    const char* const time_units = kind<DynamicRun>() != nullptr ? "s" : kind<FrequencyRun>() != nullptr ? "Hz" : "1";
    file_.emplace(out_, model(),
                  ResultOptions{is_series(), time_units, redact(origin.command), redact(origin.scene),
                                accuracy_ ? redact(without_times(tool_.result()["accuracy"]).dump(1)) : "",
                                shown_inputs(tool_, origin), drawing_.level(), tool_.force()});
    if (drawing_.any()) {
      exported_.emplace(out_, model(), exports());
    }
    fields_.emplace(*system_);
    crossings_.emplace(model());
  }

  [[nodiscard]] std::string redact(const std::string& text) const { return tool_.provenance().redact(text); }

  void record(const State& state) {
    constexpr double most_bending = std::numbers::pi / 6;
    const ElementFields of_state = (*fields_)(state);
    report_state(tool_.result(), model(), state, of_state, kind<DynamicRun>() != nullptr);
    file_->append(state, of_state);
    if (const auto written = exported_ ? exported_->append(state, of_state) : std::nullopt) {
      tool_.wrote(*written);
    }
    if (!is_modes() || !drawn_ || drawn_->first.time == 0) {
      drawn_.emplace(state, of_state);
    }
    ended_ = state;
    if (!is_modes()) {
      crossings_->see(state);
    }
    last_ = {of_state.wall, of_state.largest_displacement, of_state.displacement_p99,
             count_unresolved(model(), state, most_bending), last_.peak};
    if (kind<DynamicRun>() != nullptr) {
      if (!last_.peak || last_.peak->displacement < last_.largest_displacement) {
        last_.peak = {last_.largest_displacement, state.time};
      }
      tool_.result()["peak"] = peak_report(*last_.peak);
    }
  }

  Summary solved() {
    Resumption resumption;
    if (!given_.resume.empty()) {
      resumption.from = journal_->replay(model(), [&](const State& state) { record(state); });
      tool_.note(resumption.from
                     ? fmt::format("{}: goes on after step {}", given_.resume.string(), resumption.from->summary.steps)
                     : fmt::format("{}: begins again, it has no checkpoint yet", given_.resume.string()));
    }
    stage("solve");
    resumption.on_step = [&](const std::function<Checkpoint()>& make) {
      stage("write");
      journal_->offer(make);
      stage("solve");
    };
    resumption.on_slow_step = slow_step_note(tool_, subject());
    const auto on_state = [&](const State& state) {
      stage("write");
      journal_->append(state);
      record(state);
      stage("solve");
    };
    try {
      return naming(subject().string(), [&] { return solve(*system_, on_state, tool_.progress("solve"), resumption); });
    } catch (const InputError&) {
      journal_->remove();
      throw;
    } catch (const RequirementError& error) {
      journal_->remove();  // it would end at the same step again
      throw RequirementError(fmt::format("{}; what there is stays in {}.part", error.what(), out_.string()));
    }
  }

  void tell(const Summary& summary, bool converged) {
    tool_.note(fmt::format("{} nodes in {} steps, {}: {}", model().node_count(), summary.steps,
                           converged ? "converged" : "not asked to converge",
                           answer_text(last_, !model().shells.empty())));
    Summary without = summary;
    if (accuracy_) {
      without.linear_departure.reset();  // a linear model was held against a nonlinear one
    }
    warn_of(tool_, subject(), run_warnings(scene_.run, without, last_));
    warn_of(tool_, subject(), contact_warnings(model(), summary, tool_.result()));
    if (crossings_->found()) {
      tool_.warn(*crossings_->found());
    }
    tell_doubts(tool_, swings_of(model(), ended_), doubts_of_suction(model(), scene_.run));
  }

  cli::Tool& tool_;
  const Arguments& given_;
  std::optional<cli::Tool::Stage> stage_;
  fs::path out_;
  std::vector<fs::path> inputs_;
  Scene scene_;
  std::optional<LoadedScene> loaded_;  // its model moves on into the system
  std::optional<System> system_;
  std::string asked_;                             // the scene as a text, before an accuracy chose of it
  std::vector<std::unique_ptr<Target>> targets_;  // of each body, or none
  std::optional<double> voxel_;                   // mm, longest edge, of the image behind them
  std::string space_ = "LPS";                     // of the target, for the shells that are written
  std::optional<Accuracy> accuracy_;
  Drawing drawing_;
  ResultPictureOptions picture_;
  std::optional<std::pair<State, ElementFields>> drawn_;  // the last state, or the first mode
  std::optional<RunJournal> journal_;
  std::optional<ResultFile> file_;
  std::optional<ResultExport> exported_;
  std::optional<ElementFieldEvaluator> fields_;
  std::optional<CrossingWatch> crossings_;
  LastState last_;
  State ended_;
};

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
  return tool.run(argc, argv, [&] { Simulation(tool, arguments).run(); });
}
