// io/scene: scene files.
#pragma once

#include "tunica/accuracy/accuracy.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/model/selection.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// What a scene says, before any mesh is read. The scene file (scene_file.hpp) and the flags of tunica-simulate fill
/// this one structure; check_scene() and load_scene() turn it into a Model for both.
namespace tunica {

/// Where something was said: "FILE:line:column" or a flag. Every message about it starts with this.
struct Place {
  std::string text;
  bool flag = false;    ///< said on the command line: what is wrong with the value itself is a UsageError
  std::string typed{};  ///< the value as it was written, such as "120mmHg"; empty: not a text, or not known

  /// Throws InputError, or UsageError for a flag, with "text: what".
  [[noreturn]] void fail(const std::string& what) const;
  void require(bool fine, const std::string& what) const {
    if (!fine) {
      fail(what);
    }
  }
  /// Throws UsageError: it will be understood one day.
  [[noreturn]] void fail_later(const std::string& what) const;
};

/// The place of an item and of each of its keys.
struct Places {
  Place item;
  std::map<std::string, Place, std::less<>> keys;

  /// The place of `key`, or of the item where the key was not given.
  [[nodiscard]] const Place& of(std::string_view key) const;
};

struct SceneShell {
  std::string name;
  std::filesystem::path mesh;
  std::optional<double> unit_mm;  ///< size in mm of the mesh file's unit, for formats that carry none
  double scale = 1;
  double thickness = 0;                       ///< mm; not used beside `thickness_from`
  std::optional<std::string> thickness_from;  ///< per-vertex property of the mesh file, mm
  Material material;
  Membrane membrane = Membrane::adapt;
  Bending bending = Bending::dkt_comas;
  Rest rest = Rest::curved;
  Places places;
};

struct SceneSolid {
  std::string name;
  std::filesystem::path mesh;       ///< of tetrahedra; beside `fill_size` the closed surface that they are to fill
  std::optional<double> fill_size;  ///< mm, edge of the tetrahedra to be made
  std::optional<double> unit_mm;    ///< as of a shell
  double scale = 1;
  Material material;
  SolidLaw law = SolidLaw::corotational;
  Places places;
};

/// A rigid body whose shape is in a file.
struct SceneRigidMesh {
  static constexpr std::string_view name = "mesh";
  std::filesystem::path mesh;
  std::optional<double> unit_mm;  ///< as of a shell
  double scale = 1;
  std::optional<RigidMesh::Turn> turn;
  std::optional<RigidMesh::Expansion> expansion;
};

struct SceneRigid {
  std::string name;
  std::variant<RigidSphere, RigidCapsule, RigidCylinder, RigidPlane, SceneRigidMesh> shape;
  std::optional<Table<Vec3>> motion;  ///< mm
  Places places;
};

struct SceneFix {
  std::string body;
  Selection where;
  std::array<bool, 3> translation{true, true, true};
  std::array<bool, 3> rotation{true, true, true};
  std::optional<Vec3> displacement;  ///< mm
  Ramp ramp;
  bool slide = false;  ///< the rims wholly in `where` stay in their planes, and nothing else is held
  Places places;
};

/// An elastic bed of a shell.
struct SceneSupport {
  std::string body;
  std::optional<Selection> where;  ///< none: all of it
  double stiffness = 0;            ///< MPa/mm
  bool normal_only = false;
  Places places;
};

struct SceneLoad {
  std::string body;
  std::optional<Selection> where;  ///< pressure, where it is not all; force, moment, edge
  decltype(Load::kind) kind;       ///< nodes and edges still empty
  Ramp ramp;
  Places places;
};

struct SceneAttach {
  std::string body;
  Selection where;
  std::string to;
  Attachment::Side side = Attachment::Side::middle;
  Places places;
};

struct SceneContact {
  std::string name;
  std::array<std::string, 2> between;
  double friction = 0;
  double resolution = 0.05;  ///< as in Contact
  bool curved = true;
  bool consistent = true;
  Places places;
};

struct SceneProbe {
  std::string name;
  std::string body;
  Vec3 nearest = Vec3::Zero();  ///< mm
  Places places;
};

struct SceneAnswer {
  Quantity of = Quantity::displacement;
  std::string probe;  ///< of Quantity::probe
  int axis = 0;       ///< of its displacement
};

/// How accurate the answer is to be: meshes and model are then chosen.
struct SceneAccuracy : SceneAnswer {
  double within = 0;                                     ///< of the quantity, relative
  std::map<std::string, std::filesystem::path> targets;  ///< by body: the surface that its mesh was fitted to
  Places places;
};

/// Where a path by arc length ends, its probe by name.
struct SceneUntil {
  std::string probe;
  int axis = 0;
  double reaches = 0;  ///< mm
};

/// MPa: the stiffness of a wall of which none is stated, because none is needed.
inline constexpr double any_young = 1;

struct Scene {
  RunSettings run;
  std::optional<SceneAccuracy> accuracy;
  bool cg_tolerance_stated = false;
  std::optional<SceneUntil> until;  ///< of an arc-length run
  Places run_places;
  std::vector<SceneShell> shells;
  std::vector<SceneSolid> solids;
  std::vector<SceneRigid> rigids;
  std::vector<SceneFix> fixes;
  std::vector<SceneSupport> supports;
  std::vector<SceneLoad> loads;
  std::vector<SceneAttach> attachments;
  std::vector<SceneContact> contacts;
  std::vector<SceneProbe> probes;
  std::vector<Warning> warnings;  ///< what was understood in a way that the user should know
};

/// The files of meshes that a scene names, each once, in the order of its bodies.
std::vector<std::filesystem::path> mesh_files(const Scene& scene);

/// The load factors 1/n, 2/n … 1.
std::vector<double> equal_load_factors(std::size_t steps);

/// Decides what the statements about CG mean together: a tolerance or a count asks for CG; a count alone is a fixed
/// count without a requirement (the paper's setting). Errors: a contradiction with solver = "direct".
void settle_solver(Scene& scene);

/// Finds the probe that `until` names, and tells the run. Errors: there is none of that name.
void settle_until(Scene& scene);

/// Checks all that can be checked without a mesh: ranges, signs, required densities, names, duplicates.
/// Errors: InputError or UsageError that starts with the place.
void check_scene(const Scene& scene);

/// Whether what a scene says of places, loads and supports can be said of finer meshes of the same bodies.
bool holds_for_finer_meshes(const Scene& scene);

struct LoadedScene {
  Model model;
  std::vector<Warning> warnings;     ///< of its meshes: which way they face, where they are open unawares
  std::optional<std::string> space;  ///< world axes, of the first mesh that says them
};

/// The meshes of a scene at hand: shells, solids and rigid bodies each in the scene's order.
struct SceneBodies {
  std::vector<ShellBody> shells;
  std::vector<SolidBody> solids;
  std::vector<RigidBody> rigids;
};

/// Reads the meshes and resolves every name and selection. A mesh without normals is simulated as the flat facets it
/// holds; a note says so. A rigid mesh that faces inward is turned; a warning says so. Shells stay as they are: a
/// warning says where a pressure meets normals that point inward. Errors: InputError: as read_mesh; meshes that say
/// different spaces; a selection that is empty, a node that does not exist, or that two bodies carry.
LoadedScene load_scene(const Scene& scene);

/// The same on bodies that are at hand, such as finer meshes of the same.
Model resolve_scene(const Scene& scene, SceneBodies bodies);
/// Of a scene of shells alone.
Model resolve_scene(const Scene& scene, std::vector<ShellBody> shells);

/// The scene as a scene file with everything resolved: SI units, defaults written out. Reading it gives the same scene.
/// Paths are absolute; those within the folder of `file` are relative to it, so that both may move together.
std::string scene_text(const Scene& scene, const std::filesystem::path& file = {});

}  // namespace tunica
