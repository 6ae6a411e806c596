#include "tunica/chain/simulate.hpp"

#include "tunica/accuracy/accuracy.hpp"
#include "tunica/accuracy/estimates.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/fit/relax.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/provenance_comments.hpp"
#include "tunica/io/result/page_file.hpp"
#include "tunica/io/result/result_export.hpp"
#include "tunica/io/result/result_file.hpp"
#include "tunica/io/scene/scene_file.hpp"
#include "tunica/io/scene/stated.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/hold_doubts.hpp"
#include "tunica/mechanics/runs/meeting_walls.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/mechanics/runs/unloaded.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>

namespace tunica::chain {
namespace {

namespace fs = std::filesystem;

template <typename Kind>
bool is_kind(const RunSettings& run) {
  return std::holds_alternative<Kind>(run.kind);
}

bool is_modes(const RunSettings& run) { return is_kind<FrequencyRun>(run) || is_kind<BucklingRun>(run); }

/// The parts of a run, one after the other.
struct Stages {
  const Context& context;
  std::shared_ptr<void> now{};

  void operator()(const char* name) {
    now.reset();
    now = context.stage(name);
  }
};

void warn_of(const std::string& subject, std::vector<Warning> warnings, const Context& context) {
  for (Warning& warning : warnings) {
    warning.text = fmt::format("{}: {}", subject, warning.text);
    context.warn(warning);
  }
}

/// Which state it is, below a panel of a picture. @param number  of a mode
std::string moment_text(const RunSettings& run, const State& state, std::size_t number) {
  return is_kind<FrequencyRun>(run)  ? fmt::format("mode {}: {:.4g} Hz", number, state.time)
         : is_kind<BucklingRun>(run) ? fmt::format("mode {}: {:.4g} times the load", number, state.time)
         : is_kind<DynamicRun>(run)  ? fmt::format("{:.4g} s", state.time)
                                     : fmt::format("load factor {:.4g}", state.load_factor);
}

/// The states that a picture shows: the nearest to each moment asked for, else the last one, or the first mode.
class Pictured {
public:
  explicit Pictured(const SimulateSettings& settings)
      : settings_(settings), states_(settings.look.moments.size(), {PicturedState(), infinity}) {}

  void take(const State& state, const ElementFields& fields) {
    const RunSettings& run = settings_.scene.run;
    const std::size_t mode = count_++;
    if (is_modes(run) && mode == 0) {
      return;  // what the modes are of
    }
    const double place = is_modes(run) ? real(mode) : is_kind<DynamicRun>(run) ? state.time : state.load_factor;
    for (std::size_t i = 0; i < states_.size(); ++i) {
      auto& [nearest, away] = states_[i];
      const double distance = std::abs(place - settings_.look.moments[i]);
      if (distance < away) {
        nearest = {state, fields, moment_text(run, state, mode)};
        away = distance;
      }
    }
  }

  /// @param last  of the run
  [[nodiscard]] std::vector<PicturedState> states(PicturedState last) const {
    std::vector<PicturedState> all;
    for (const auto& [state, away] : states_) {
      all.push_back(state);
    }
    return all.empty() ? std::vector{std::move(last)} : all;
  }

private:
  const SimulateSettings& settings_;
  std::vector<std::pair<PicturedState, double>> states_;  ///< and how far it is from what was asked for
  std::size_t count_ = 0;
};

std::vector<std::string> surface_exports(const Drawing& drawing) {
  std::vector<std::string> endings;
  for (const char* format : {"glb", "obj", "stl", "3mf"}) {
    if (drawing.has(format)) {
      endings.push_back(fmt::format(".{}", format));
    }
  }
  return endings;
}

ExportOptions export_options(const SimulateSettings& settings) {
  const Drawing& drawing = settings.drawing;
  return {.pvd = drawing.has("pvd"),
          .xmf = drawing.has("xmf"),
          .inp = drawing.has("inp"),
          .feb = drawing.has("feb"),
          .surfaces = surface_exports(drawing),
          .run = settings.scene.run,
          .tessellation = static_cast<int>(drawing.tessellation.value_or(0))};
}

/// What messages are about: the file that was read first.
std::string subject_of(const SimulateSettings& settings) {
  return settings.inputs.empty() ? "the scene" : settings.inputs.front().string();
}

/// Where states go: the record, the result file, and what other programs draw.
class Recorder {
public:
  /// @param journal  of a run that writes files
  Recorder(const SimulateSettings& settings, const System& system, const LoadedRun& loaded,
           const std::optional<RunJournal>& journal, RunRecord& record, const Context& context)
      : pictured(settings),
        context_(context),
        model_(system.model()),
        is_modes_(chain::is_modes(settings.scene.run)),
        record_(record),
        fields_(system),
        crossings_(model_) {
    if (!journal) {
      return;
    }
    file_.emplace(settings.out, model_, result_options(settings, journal->identity(), record, context));
    if (std::ranges::find(settings.drawing.exported, true) != settings.drawing.exported.end()) {
      ExportOptions options = export_options(settings);
      options.made_by = fmt::format("tunica {}: {}", version,
                                    settings.resume ? context.redact(journal->identity().command) : context.command());
      options.overwrite = context.overwrite || settings.resume;
      options.space = loaded.space.value_or(options.space);
      exports_.emplace(settings.out, model_, options);
    }
  }

  void operator()(const State& state) {
    const ElementFields of_state = fields_(state);
    record_.take(model_, state, of_state);
    if (file_) {
      file_->append(state, of_state);
    }
    if (const auto written = exports_ ? exports_->append(state, of_state) : std::nullopt) {
      context_.wrote(*written);
    }
    if (!is_modes_ || !drawn || drawn->first.time == 0) {
      drawn.emplace(state, of_state);
    }
    pictured.take(state, of_state);
    ended = state;
    if (!is_modes_) {
      crossings_.see(state);
    }
  }

  /// Gives the files their names.
  void commit(bool converged) {
    if (exports_) {
      exports_->commit();
    }
    if (file_) {
      file_->commit(converged);  // last: what is not renamed can still be resumed
    }
  }

  [[nodiscard]] const std::optional<Warning>& crossing() const { return crossings_.found(); }

  std::optional<std::pair<State, ElementFields>> drawn;  ///< the last state, or the first mode
  Pictured pictured;
  State ended;

private:
  static ResultOptions result_options(const SimulateSettings& settings, const RunIdentity& origin,
                                      const RunRecord& record, const Context& context) {
    std::vector<std::pair<std::string, std::string>> inputs = origin.inputs;
    for (auto& [path, hash] : inputs) {
      path = context.redact(path);
    }
    return {settings.scene.run,
            record.unloaded != nullptr,
            context.redact(origin.command),
            context.redact(origin.scene),
            record.accuracy ? context.redact(accuracy_report(*record.accuracy, false).dump(1)) : "",
            inputs,
            static_cast<int>(settings.drawing.tessellation.value_or(0)),
            context.overwrite};
  }

  const Context& context_;
  const Model& model_;
  bool is_modes_;
  RunRecord& record_;
  std::optional<ResultFile> file_;
  std::optional<ResultExport> exports_;
  ElementFieldEvaluator fields_;
  CrossingWatch crossings_;
};

/// A target that cannot be what the shells were fitted to: no finer than they are, or somewhere else.
/// What a target is for: an accuracy that has to be reached, one that is aimed at, or an estimate by one refinement.
/// All but the first do without one that is hardly finer than the shells, with a warning.
enum class Need { must, aim, estimate };

/// @return whether it can be used
bool require_own_target(const ShellMesh& shell, const Target& target, const fs::path& path, Need need,
                        const Context& context) {
  constexpr std::size_t facets_per_shell = 2;
  constexpr double farthest_mean = 0.02;       // of the diagonal
  constexpr double farthest_of_shells = 0.25;  // of the root of their mean area: a few follow a surface no better
  const std::size_t facets = target.mesh().triangles.size();
  const bool is_finer = facets >= facets_per_shell * shell.triangles.size();
  if (!is_finer && need == Need::must) {
    throw InputError(fmt::format(
        "{}: has {} triangles, and the shells are {}: name the fine surface that they were fitted to; where "
        "there is none finer, take fewer shells (SHELLS={})",
        path.string(), facets, shell.triangles.size(), facets / facets_per_shell));
  }
  const double farthest =
      std::max(farthest_mean * target.diagonal(),
               farthest_of_shells * std::sqrt(area(flat_facets(shell)) / real(shell.triangles.size())));
  if (const double mean = mean_distance(shell, target).first; mean > farthest) {
    throw InputError(
        fmt::format("{}: lies {:.3g} mm from the shells in the mean, {:.2g} % of its diagonal: it is not the "
                    "surface that they were fitted to",
                    path.string(), mean, 100 * mean / target.diagonal()));
  }
  if (!is_finer && need == Need::aim) {
    context.warn({Weight::minor, "no target",
                  fmt::format("{}: has {} triangles, too few to fit more than these {} shells to it: finer ones lie on "
                              "the shells' own patches, and the error of the geometry is not seen",
                              path.string(), facets, shell.triangles.size())});
  } else if (!is_finer) {
    context.warn(
        {Weight::minor, "error of the mesh",
         fmt::format("{}: has {} triangles, too few to fit four times the {} shells to it: how far the answers "
                     "may be off by the mesh is not estimated; up to {} shells it can be (SHELLS={})",
                     path.string(), facets, shell.triangles.size(), facets / facets_per_shell,
                     facets / facets_per_shell)});
  }
  return is_finer;
}

/// Reads the target of a body, which then faces as its shells do; null where it cannot be used.
std::unique_ptr<Target> read_target(const SceneShell& shell, const ShellMesh& mesh, const fs::path& path, Need need,
                                    LoadedRun& loaded, const Context& context) {
  MeshFile file = read_mesh(path, shell.unit_mm, true);
  if (const auto note = unit_note(file, path, shell.unit_mm)) {
    context.warn(*note);
  }
  require_surface(file, path);
  const MeshFile own = read_mesh(shell.mesh, shell.unit_mm);
  if (is_middle_of_wall(own)) {
    throw InputError(
        fmt::format("{}: lies half a wall away from {}, which relax moved to the middle of the wall: leave the target "
                    "out; how far answers may be off by the mesh is then found on the shells' own surface",
                    path.string(), shell.mesh.string()));
  }
  require_same_scale(own, shell.mesh, file, path, shell.unit_mm);
  require_near(own, shell.mesh, file, path);
  (void)common_space(own, shell.mesh, file, path);
  loaded.space = loaded.space ? loaded.space : file.space;
  if (file.voxel) {
    loaded.voxel = std::max(loaded.voxel.value_or(0), shell.scale * *file.voxel);
  }
  for (Vec3& vertex : file.mesh.vertices) {
    vertex *= shell.scale;
  }
  auto target = std::make_unique<Target>(std::move(file.mesh));
  if (faces_other_way({mesh.vertices, mesh.triangles}, *target)) {
    context.warn({Weight::minor, "faces the other way",
                  fmt::format("{}: faces the other way than the shells: its triangles are turned around to agree",
                              path.string())});
    target = std::make_unique<Target>(turned_around(target->mesh()));
  }
  if (!require_own_target(mesh, *target, path, need, context)) {
    target.reset();
  }
  return target;
}

void read_targets(const SimulateSettings& settings, LoadedRun& loaded, const Context& context) {
  const Scene& scene = settings.scene;
  loaded.targets.resize(scene.shells.size());
  std::map<std::string, fs::path> paths;
  if (scene.accuracy) {
    paths = scene.accuracy->targets;
  } else if (settings.target && !scene.shells.empty()) {
    paths = {{scene.shells.front().name, *settings.target}};
  }
  if (paths.empty() && scene.shells.size() == 1) {
    loaded.on_own_patches = is_middle_of_wall(read_mesh(scene.shells.front().mesh, scene.shells.front().unit_mm));
  }
  for (const auto& [name, path] : paths) {
    const auto found = std::ranges::find(scene.shells, name, &SceneShell::name);
    const std::size_t b = found - scene.shells.begin();
    loaded.inputs.push_back(path);
    context.reads(path);
    const Need need = !scene.accuracy ? Need::estimate : settings.max_seconds ? Need::aim : Need::must;
    loaded.targets[b] = read_target(*found, loaded.model.shells[b].mesh, path, need, loaded, context);
  }
}

/// Goes from level to level; the settings become those of the last one. @return its system
System choose_model(SimulateSettings& settings, const LoadedRun& loaded, const Model& model, RunRecord& record,
                    const Context& context) {
  Scene& scene = settings.scene;
  const SceneAccuracy& asked = *scene.accuracy;
  const AccuracyRequest request{
      asked.within,        asked.of,   settings.max_shells.value_or(AccuracyRequest().max_shells),
      asked.probe,         asked.axis, loaded.voxel,
      settings.max_seconds};
  std::vector<const Target*> targets;
  for (const auto& target : loaded.targets) {
    targets.push_back(target.get());
  }
  const auto accuracy = std::make_shared<const Accuracy>(naming(subject_of(settings), [&] {
    return solve_within(
        model.shells, targets, request, scene.run,
        [&](std::vector<ShellBody> bodies) { return resolve_scene(scene, std::move(bodies)); },
        [&](const AccuracyLevel& level) { context.note(level_note(level, request)); });
  }));
  if (is_kind<DynamicRun>(scene.run) && is_kind<StaticRun>(accuracy->settings)) {
    context.note("the loads rise so slowly that rest under them serves: the result holds that state, not the motion");
  }
  scene.run = accuracy->settings;
  record = RunRecord(accuracy->system->model(), scene.run);
  record.accuracy = accuracy;
  return *accuracy->system;
}

/// Puts the stress of the image into the walls, or takes the shells back to what they are without its pressure.
void take_as_imaged(std::optional<System>& system, const SimulateSettings& settings, RunRecord& record,
                    const Context& context) {
  const std::string subject = subject_of(settings);
  const Model& model = system->model();
  bool unload = false;
  for (const Load& load : model.loads) {
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind); pressure != nullptr && pressure->imaged_at) {
      unload = unload || pressure->unload;
      const bool same = !record.imaging_pressure || *record.imaging_pressure == *pressure->imaged_at;
      record.imaging_pressure = same ? pressure->imaged_at : std::nullopt;
    }
  }
  if (!unload) {
    record.prestress_residual = naming(subject, [&] { return *system->prestress_residual(); });
    record.rests_as_imaged = system->rests_as_imaged();
    warn_of(subject, prestress_warnings(record), context);
    return;
  }
  auto found = std::make_shared<Unloaded>(naming(subject, [&] {
    return find_unloaded(model, settings.scene.run, [&](double part, double change) {
      context.detail(
          fmt::format("unloaded shape: {:.3g} of the pressure, moved by {:.3g} mm in the mean", part, change));
    });
  }));
  record.unloaded = found;
  warn_of(subject, unloaded_warnings(*found), context);
  context.note(fmt::format(
      "the unloaded shape is found: under the pressure of the image it lies {:.2g} mm from the image, {:.2g} "
      "mm at most",
      found->mean_distance, found->largest_distance));
  system.emplace(std::move(found->model), settings.scene.run);
}

RunJournal begin_journal(const SimulateSettings& settings, const LoadedRun& loaded, std::optional<RunJournal> before,
                         const Context& context) {
  RunIdentity identity{version, loaded.asked, context.command(), {}, {}, settings.drawing.as_options()};
  for (const fs::path& path : settings.inputs) {
    identity.inputs.emplace_back(path.string(), sha256_of_file(path));
  }
  for (const fs::path& mesh : mesh_files(settings.scene)) {
    identity.meshes.emplace_back(mesh.string(), sha256_of_file(mesh));
  }
  context.has_read();  // the hashes are of what was read
  if (!before) {
    return RunJournal::create(part_of(settings.out), identity);
  }
  if (const std::string differs = difference(before->identity(), identity); !differs.empty()) {
    throw InputError(fmt::format("{}: is another run: {}", settings.resume->string(), differs));
  }
  return *std::move(before);
}

/// Ends a run that does not go on: its states are kept where files are written, and its journal goes.
[[noreturn]] void fail_in_part(const std::string& why, const SimulateSettings& settings,
                               std::optional<RunJournal>& journal) {
  if (!journal) {
    throw RequirementError(why);
  }
  journal->remove();
  throw RequirementError(fmt::format("{}; what there is stays in {}.part", why, settings.out.string()));
}

/// @param journal  of a run that writes files
Summary solve_and_record(const System& system, const SimulateSettings& settings, std::optional<RunJournal>& journal,
                         Recorder& record, Stages& stage, const Context& context) {
  const std::string subject = subject_of(settings);
  Resumption resumption;
  if (settings.resume && journal) {
    const std::string part = settings.resume->string();
    resumption.from = journal->replay(system.model(), std::ref(record));
    context.note(resumption.from ? fmt::format("{}: goes on after step {}", part, resumption.from->summary.steps)
                                 : fmt::format("{}: begins again, it has no checkpoint yet", part));
  }
  stage("solve");
  if (journal) {
    resumption.on_step = [&](const std::function<Checkpoint()>& make) {
      stage("write");
      journal->offer(make);
      stage("solve");
    };
  }
  resumption.on_slow_step = [&](const std::string& text) {
    context.warn({Weight::note, "slow step", fmt::format("{}: {}", subject, text)});
  };
  const auto on_state = [&](const State& state) {
    stage("write");
    if (journal) {
      journal->append(state);
    }
    record(state);
    stage("solve");
  };
  try {
    return naming(subject, [&] { return solve(system, on_state, context.progress("solve"), resumption); });
  } catch (const InputError&) {
    if (journal) {
      journal->remove();
    }
    throw;
  } catch (const RequirementError& error) {
    fail_in_part(error.what(), settings, journal);  // it would end at the same step again
  }
}

void write_shells(const fs::path& out, const ShellMesh& mesh, const std::optional<std::string>& space, bool partial,
                  const Context& context) {
  PlyOptions ply;
  ply.comments = {"made by " + context.made_by()};
  ply.space = space.value_or(ply.space);
  ply.overwrite = context.overwrite;
  ply.partial = partial;
  write_ply(out, mesh, ply);
}

/// Of shells that leave the run as relax's do the report says what relax's says.
ShellCertificate certify(const ShellMesh& shell, const Target* target, const Progress& progress) {
  ShellCertificate made{min_angle_degrees(flat_facets(shell)), {}, 0};
  if (target != nullptr) {
    made.diagonal = target->diagonal();
    ShellDistanceOptions measuring;
    measuring.width = 1e-4 * made.diagonal;
    measuring.progress = progress;
    made.distance = shell_distance(shell, *target, measuring).both;
  }
  return made;
}

/// Whether one refinement can be solved besides.
bool may_refine(const SimulateSettings& settings, const LoadedRun& loaded) {
  return is_kind<StaticRun>(settings.scene.run) && !loaded.targets.empty() &&
         (loaded.targets.front() || loaded.on_own_patches) && !settings.unloaded &&
         holds_for_finer_meshes(settings.scene);
}

/// Whether all that acts is what the wall bears in its image already, so that nothing moves.
bool only_bears_its_image(const Model& model) {
  return !model.loads.empty() && std::ranges::none_of(model.fixes, prescribes) && model.contacts.empty() &&
         std::ranges::all_of(model.loads, [](const Load& load) {
           const auto* pressure = std::get_if<PressureLoad>(&load.kind);
           return pressure != nullptr && pressure->imaged_at == pressure->value && !pressure->unload;
         });
}

/// What moves by round-off alone is zero, and no part of it an error.
void take_rest_as_exact(const Model& model, Estimates& estimates) {
  if (only_bears_its_image(model)) {
    for (const char* key : {"max_displacement_mm", "strain_p99_percent", "strain_max_percent", "strain_energy_mj"}) {
      if (const auto found = estimates.find(key); found != estimates.end()) {
        found->second.error = 0;
      }
    }
  }
}

/// Says how far the answers may be off: by the levels of an accuracy, or by one refinement solved besides.
void estimate(const System& system, const SimulateSettings& settings, const LoadedRun& loaded, const Recorder& recorded,
              Stages& stage, RunRecord& record, const Context& context) {
  const std::string subject = subject_of(settings);
  if (record.accuracy) {
    record.estimates = record.accuracy->estimates;
    take_rest_as_exact(system.model(), record.estimates);
    warn_of(subject, estimate_warnings(record.estimates, record.accuracy->request.of), context);
    return;
  }
  if (may_refine(settings, loaded) && recorded.drawn) {
    stage("solve");
    RefinedAnswers refined = naming(subject, [&] {
      return estimate_by_refinement(
          system.model(), recorded.drawn->first, recorded.drawn->second, {loaded.targets.front().get()},
          system.settings(),
          [&](std::vector<ShellBody> bodies) { return resolve_scene(settings.scene, std::move(bodies)); });
    });
    if (!refined.reason.empty()) {
      context.warn(
          {Weight::minor, "error of the mesh",
           fmt::format("{}: how far the answers may be off by the mesh is not known, for on shells split in four {}: "
                       "take more shells (SHELLS)",
                       subject, refined.reason)});
    }
    record.estimates = std::move(refined.estimates);
    take_rest_as_exact(system.model(), record.estimates);
    stage("write");
  }
  warn_of(subject, estimate_warnings(record.estimates, {}), context);
}

void require_accuracy(const Accuracy& accuracy, const SimulateSettings& settings, std::optional<RunJournal>& journal,
                      const Context& context) {
  const std::string subject = subject_of(settings);
  std::ranges::for_each(accuracy_notes(accuracy), context.note);
  if (accuracy.reasons.empty()) {
    return;
  }
  if (!accuracy.request.max_seconds) {
    fail_in_part(fmt::format("{}: {}", subject, missed_accuracy(accuracy)), settings, journal);
  }
  context.warn(
      {Weight::minor, "accuracy not reached",
       fmt::format("{}: {}. Fit four times as many shells to the surface, as far as it has them (tunica-relax; in the "
                   "pipeline SHELLS={} in place of ACCURACY, OF and --max-seconds)",
                   subject, missed_accuracy(accuracy), 4 * accuracy.levels.back().shells)});
}

/// Of which state a picture is: the last one, or the first mode.
std::string when(const RunSettings& run, const State& state) {
  return is_modes(run)              ? "of the first mode (only the shape counts)"
         : is_kind<DynamicRun>(run) ? fmt::format("after {:.4g} s", state.time)
         : state.load_factor == 1   ? "under the whole load"
                                    : fmt::format("under {:.4g} times the load", state.load_factor);
}

void tell_modes(const Summary& summary, const RunSettings& run, const std::string& subject, const Context& context) {
  const auto* frequencies = std::get_if<FrequencyRun>(&run.kind);
  if (auto snap = snap_warning(summary)) {
    warn_of(subject, {*std::move(snap)}, context);
  }
  context.note(
      modes_note(summary, frequencies != nullptr ? frequencies->count : std::get<BucklingRun>(run.kind).count));
  if (summary.stiffened_from && frequencies == nullptr) {
    context.warn(
        {Weight::major, "coarse shells",
         fmt::format("{}: the mesh is coarse for so thin a curved shell (h^2 > 3 R t): buckles shorter than its "
                     "elements are not seen, and the factors may be too high: refine it",
                     subject)});
  }
}

/// The answer in a line.
std::string answer_text(const LastState& last, bool with_wall) {
  const bool rests = last.largest_displacement == 0 && !last.peak;
  std::string text = rests ? "nothing moves" : fmt::format("largest displacement {:.4g} mm", last.largest_displacement);
  if (last.peak) {
    text += fmt::format(" at the end of the motion ({:.4g} mm at most in the states written, at {:.4g} s)",
                        last.peak->displacement, last.peak->time);
  }
  if (with_wall) {
    text += rests ? "" : fmt::format(" (99 % of the wall below {:.4g} mm)", last.displacement_p99);
    text += fmt::format(", membrane stress of the wall {} (99th percentile), at its faces {}{}",
                        pressure_text(last.wall.membrane_p99), pressure_text(last.wall.stress_p99),
                        last.peak ? ", both at the end, too: other states may bear more" : "");
  }
  return text;
}

void tell(const Model& model, const SimulateSettings& settings, const Recorder& recorded, const RunRecord& record,
          const Context& context) {
  const std::string subject = subject_of(settings);
  const LastState last = record.last.value_or(LastState());
  context.note(fmt::format(
      "{} nodes in {} step{}, {}: {}", model.node_count(), record.summary->steps, record.summary->steps == 1 ? "" : "s",
      record.converged ? "converged" : "not asked to converge", answer_text(last, !model.shells.empty())));
  Summary without = *record.summary;
  if (record.accuracy) {
    without.linear_departure.reset();  // a linear model was held against a nonlinear one
  }
  warn_of(subject, run_warnings(settings.scene.run, without, last), context);
  constexpr double notable = 0.02;
  if (const double open = open_at_faces(model); open > notable) {
    warn_of(
        subject,
        {{Weight::note, "thin-shell theory",
          fmt::format("stress at the faces: thin-shell theory itself is uncertain by about {} here, in the mean over "
                      "the wall, beside any error of the mesh; the membrane stress is not affected",
                      percent_text(open))}},
        context);
  }
  warn_of(subject, contact_warnings(record), context);
  if (recorded.crossing()) {
    context.warn(*recorded.crossing());
  }
  // Sentences that name their places themselves.
  std::ranges::for_each(doubts_of_solids(model, last.solid_error, last.roughness), context.warn);
  std::ranges::for_each(doubts_of_layers(model, last.layer_error), context.warn);
  std::ranges::for_each(swings_of(model, recorded.ended), context.warn);
  std::ranges::for_each(doubts_of_suction(model, settings.scene.run, record.summary->snaps), context.warn);
}

}  // namespace

bool Drawing::has(std::string_view format) const {
  return exported[static_cast<std::size_t>(std::ranges::find(formats, format) - formats.begin())];
}

std::vector<std::pair<std::string, std::string>> Drawing::as_options() const {
  std::vector<std::string_view> names;
  std::ranges::copy_if(formats, std::back_inserter(names), [&](std::string_view name) { return has(name); });
  return {{"--tessellation", tessellation ? std::to_string(*tessellation) : "default"},
          {"--export", names.empty() ? "nothing" : fmt::format("{}", fmt::join(names, ", "))},
          {"--no-paths", no_paths ? "yes" : "no"}};
}

void ask_for_unloaded(Scene& scene) {
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
}

void announce_outputs(const SimulateSettings& settings, bool resumed, const Context& context) {
  context.writes(settings.out, {".hdf", ".vtkhdf", ".h5", ".hdf5"});
  std::vector<fs::path> beside = export_paths(settings.out, export_options(settings));
  beside.insert(beside.begin(), page_path(settings.out));
  for (const fs::path& path : beside) {
    if (resumed) {
      fs::remove(path);
    }
    context.writes(path, {});
  }
  if (settings.picture) {
    context.writes(*settings.picture, {".png"});
  }
}

LoadedRun load_run(const SimulateSettings& settings, const Context& context) {
  const Scene& scene = settings.scene;
  LoadedRun loaded;
  loaded.asked = scene_text(scene, settings.out);
  loaded.inputs = settings.inputs;
  LoadedScene read = load_scene(scene);
  loaded.model = std::move(read.model);
  loaded.space = std::move(read.space);
  read_targets(settings, loaded, context);
  std::ranges::for_each(read.warnings, context.warn);
  for (std::size_t b = 0; scene.accuracy && b < loaded.targets.size(); ++b) {
    const bool is_named = scene.accuracy->targets.contains(scene.shells[b].name);
    if (!is_named && loaded.model.shells[b].curved && !loaded.on_own_patches) {
      context.warn({Weight::minor, "no target",
                    fmt::format("{}: has no target: finer shells lie on its own patches, and the error of its geometry "
                                "is not seen (--target, or target in [accuracy])",
                                scene.shells[b].mesh.string())});
    }
  }
  return loaded;
}

void simulate(SimulateSettings settings, LoadedRun loaded, RunRecord& record, const Context& context,
              std::optional<RunJournal> before) {
  Scene& scene = settings.scene;
  settings.inputs = loaded.inputs;
  const std::string subject = subject_of(settings);
  Stages stage{context};
  stage("setup");
  record = RunRecord(loaded.model, scene.run);
  std::optional<System> system;
  naming(subject, [&] { system.emplace(std::move(loaded.model), scene.run); });
  if (scene.accuracy && !settings.check) {
    stage("solve");
    system = choose_model(settings, loaded, system->model(), record, context);
  }
  // A target that is named and cannot serve is warned of with what to do about it.
  const bool has_estimates = record.accuracy || may_refine(settings, loaded) || settings.target;
  std::ranges::for_each(doubts(system->model(), scene.run, has_estimates), context.warn);
  std::ranges::for_each(doubts_of_ends(system->model()), context.warn);
  std::ranges::for_each(doubts_of_loose_bodies(system->model(), scene.run), context.warn);
  if (settings.check) {
    return;
  }
  if (system->model().is_imaged_under_pressure()) {
    stage("solve");
    take_as_imaged(system, settings, record, context);
  }
  const Model& model = system->model();
  std::optional<RunJournal> journal;
  if (!settings.out.empty()) {
    journal.emplace(begin_journal(settings, loaded, std::move(before), context));
  }
  stage("write");
  Recorder recorded(settings, *system, loaded, journal, record, context);
  if (record.accuracy) {
    for (const State& state : record.accuracy->states) {
      if (journal) {
        journal->append(state);
      }
      recorded(state);
    }
    record.summary = record.accuracy->summary;
  } else {
    record.summary = solve_and_record(*system, settings, journal, recorded, stage, context);
  }
  stage("write");
  if (settings.shell_out) {
    const ShellMesh& shell = model.shells.front().mesh;
    record.certificate = certify(shell, loaded.targets.front().get(), context.progress("certify"));
    write_shells(*settings.shell_out, shell, loaded.space,
                 !record.accuracy->reasons.empty() && !record.accuracy->request.max_seconds, context);
  }
  // A fixed count of iterations asks for no convergence, so none is claimed.
  record.converged = record.summary->converged && !scene.run.cg_fixed_count;
  if (const auto* dynamic = std::get_if<DynamicRun>(&scene.run.kind)) {
    record.duration = dynamic->duration;
  }
  estimate(*system, settings, loaded, recorded, stage, record, context);
  if (record.accuracy) {
    require_accuracy(*record.accuracy, settings, journal, context);
  }
  if (settings.unloaded) {
    write_shells(*settings.unloaded, model.shells.front().mesh, loaded.space, false, context);
  }
  if (settings.picture) {
    const auto& [state, fields] = *recorded.drawn;
    ResultPictureOptions look = settings.look;
    look.is_unloaded = record.unloaded != nullptr;
    look.caption = is_modes(scene.run) ? "Of a mode only the shape counts" : stated_line(scene);
    look.axes = loaded.space.value_or(look.axes);
    const auto states = recorded.pictured.states({state, fields, when(scene.run, state)});
    write_file(*settings.picture, result_picture(model, states, look), context.overwrite);
  }
  if (is_modes(scene.run)) {
    tell_modes(*record.summary, scene.run, subject, context);
  } else {
    tell(model, settings, recorded, record, context);
  }
  // Last: a run that is killed before can be resumed, and after it only the report is left to write.
  recorded.commit(record.converged);
  if (journal) {
    journal->remove();
  }
}

}  // namespace tunica::chain
