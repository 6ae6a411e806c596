#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/chain/result_picture.hpp"
#include "tunica/io/result/run_journal.hpp"
#include "tunica/io/result/run_report.hpp"
#include "tunica/io/scene/scene.hpp"
#include "tunica/shell/distance/target.hpp"

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tunica::chain {

/// How a result is drawn and what other programs get of it: what shapes the outputs beside the scene.
struct Drawing {
  static constexpr std::array<const char*, 8> formats{"pvd", "xmf", "inp", "feb", "glb", "obj", "stl", "3mf"};

  std::optional<std::size_t> tessellation;  ///< pieces per edge of a shell; none: by their number
  std::array<bool, formats.size()> exported{};
  bool no_paths = false;  ///< files are not named

  [[nodiscard]] bool has(std::string_view format) const;
  /// As flags and their values, for the journal.
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> as_options() const;
};

/// A scene, and what is to be done with it.
struct SimulateSettings {
  Scene scene;
  bool check = false;                           ///< only whether it can be run
  std::filesystem::path out;                    ///< the result; empty: it, its journal and its exports are not written
  std::vector<std::filesystem::path> inputs;    ///< that have been read, the first in messages; none: all is in memory
  std::optional<std::filesystem::path> resume;  ///< the partial result that goes on
  Drawing drawing;
  std::optional<std::filesystem::path> picture;
  ResultPictureOptions look;                       ///< of the picture
  std::optional<std::filesystem::path> target;     ///< what the first shells were fitted to, without an accuracy
  std::optional<std::filesystem::path> shell_out;  ///< the shells that an accuracy ended with
  std::optional<std::filesystem::path> unloaded;   ///< those without the pressure of the image
  std::optional<std::size_t> max_shells;           ///< of an accuracy
  std::optional<double> max_seconds;               ///< of an accuracy
};

/// A scene with its meshes at hand.
struct LoadedRun {
  std::string asked;                          ///< the scene as a text
  std::vector<std::filesystem::path> inputs;  ///< all that have been read, those of the settings first
  Model model;
  std::vector<std::unique_ptr<Target>> targets;  ///< what each body's shells were fitted to, or none
  bool on_own_patches = false;                   ///< the mesh is judged by splits on the shells' own patches
  std::optional<double> voxel;                   ///< mm, longest edge, of the image behind them
  std::optional<std::string> space;              ///< world axes, where a mesh says them
};

/// Asks the scene for the shells without the pressure of the image. Errors: UsageError: it has none, or several bodies.
void ask_for_unloaded(Scene& scene);

/// Says which files a run is going to write, but for shells.
/// @param resumed  exports that are there are of the same run, stopped between its renames, and go
void announce_outputs(const SimulateSettings& settings, bool resumed, const Context& context);

/// Reads the meshes of a scene and the targets of its shells, and warns of what they are.
/// Errors: InputError: as load_scene(); a target that the shells were not fitted to.
LoadedRun load_run(const SimulateSettings& settings, const Context& context);

/// Solves a scene: for an accuracy, under the pressure of the image, from where a run was stopped. Writes the result,
/// exports and picture, and warns of what makes the answers doubtful.
/// @param loaded  by load_run(); or, in memory, a model that resolve_scene() made of the scene and its bodies, and
///   their targets
/// @param record  what is known so far, also where this fails; @param journal  of a run that goes on
/// Errors: InputError: as System and solve(), or another run goes on; RequirementError: no state of rest, or an
/// accuracy that is not reached: what there is stays in `out`.part; OutputError.
void simulate(SimulateSettings settings, LoadedRun loaded, RunRecord& record, const Context& context = {},
              std::optional<RunJournal> journal = {});

}  // namespace tunica::chain
