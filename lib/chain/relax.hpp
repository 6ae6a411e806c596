#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/chain/error_map.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/fit/relax.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/shell/distance/shell_quality.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/wall/mid_surface.hpp"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tunica::chain {

struct RelaxSettings {
  bool by_barycentre = false;  ///< the paper's rule in place of the least-error fit
  Patch surface = Patch::watertight;
  std::optional<LengthTolerance> tolerance;    ///< of the two-sided distance: done when it certainly holds
  std::optional<double> mean;                  ///< mm: of the mean distance; `tolerance` is then what is tried first
  bool refine = false;                         ///< split COARSE's triangles, see FitOptions
  std::optional<std::size_t> shells;           ///< at most, of a fit; none: as many as COARSE has
  std::optional<std::size_t> max_shells;       ///< at most, where their number is free
  std::optional<int> max_iterations;           ///< see RelaxOptions and FitOptions
  std::optional<double> min_angle;             ///< degrees, of a fit; none: 20
  std::optional<WallFace> face{};              ///< of a wall: TARGET is this one, and shells go to the middle
  std::optional<double> thickness;             ///< mm, of the wall
  std::function<void(const ShellMesh&)> keep;  ///< takes the best shells so far where the work is stopped
};

/// What is relaxed onto what: oriented manifolds that face the same way.
struct RelaxSurfaces {
  TriangleMesh coarse;
  std::unique_ptr<Target> target;  ///< what the shells are fitted to; none yet where that is to be found from `face`
  std::unique_ptr<Target> face;    ///< of a wall, with its `thickness`: the middle takes its place
  std::unique_ptr<Target> other;   ///< the wall's other face, half way to which the shells go
  std::unique_ptr<Target> with_spikes;  ///< TARGET as it was given, where triangles without area were taken away
  double moved = 0;                     ///< mm, by that
  std::string coarse_name = "COARSE", target_name = "TARGET", other_name = "OTHER";  ///< in messages
  PlyOptions ply = {};                                                               ///< of what is written

  /// What distances are to.
  [[nodiscard]] const Target& whole() const { return with_spikes ? *with_spikes : *target; }
};

/// Shells in the middle of a wall, of which TARGET is a face.
struct WallMiddle {
  std::optional<HalfWaySurface> half_way{};      ///< what was found from one face; its mesh has become the target
  std::optional<WallFace> face{};                ///< that TARGET is; none before take_middle()
  std::optional<std::array<double, 2>> error{};  ///< mm, mean and largest: of being half a wall away from one face
  std::array<double, 2> range{};                 ///< mm, least and largest thickness
};

struct Relaxation {
  ShellMesh shell;                ///< what is written: on the target, or after take_middle() in the middle of the wall
  std::vector<double> thickness;  ///< mm, per vertex, where it was measured
  RelaxResult relaxed;            ///< the shells on the target
  ShellDistance distance;         ///< mm, certified, of these from the whole target
  Interval flat;                  ///< mm, of their flat facets
  ShellQuality quality;
  double angle = 0;                  ///< degrees, smallest of the facets
  std::size_t crossings = 0;         ///< pairs of shells that cross
  double diagonal = 0;               ///< mm, of the target
  std::optional<double> tolerance;   ///< mm
  double mean = 0;                   ///< mm, of the distance, where that is asked for
  std::optional<double> mean_bound;  ///< mm, certain
  std::optional<WallMiddle> middle;
};

/// Curved shells on a target, with the certified distance. Errors and cost: as fit(), relax_by_barycentre() and
/// half_way_surface().
Relaxation relax(RelaxSurfaces& surfaces, const RelaxSettings& settings, const Context& context = {});

/// Moves the shells to the middle of the wall, where `face` is set. Errors: as mid_surface_between(); InputError: the
/// other face lies no farther away than the shells from theirs.
void take_middle(Relaxation& found, const RelaxSurfaces& surfaces, const RelaxSettings& settings,
                 const Context& context = {});

struct RelaxFiles {
  std::filesystem::path coarse, target, out;
  std::optional<std::filesystem::path> other_face;
  std::optional<double> unit_mm;  ///< size in mm of the unit of files that state none
  MapFiles maps;
};

/// Reads what is relaxed and makes it agree: axes, unit, the side that it faces. Warns of what that took.
/// Errors: InputError: not oriented manifolds, or not of one thing.
RelaxSurfaces read_relaxed(const RelaxFiles& files, const RelaxSettings& settings, const Context& context);

/// Errors: RequirementError: what was asked for is not reached, and the best shells are kept in `out`.part.
void require_what_was_asked(const std::filesystem::path& out, const RelaxSurfaces& surfaces, const Relaxation& found,
                            const RelaxSettings& settings);

/// Writes a mesh as `out`.part, the best there is of a run that fails. Errors: OutputError.
void write_partial(const std::filesystem::path& out, const ShellMesh& shell, PlyOptions ply);

/// Writes shells and maps, all or none. Errors: OutputError.
void write_relaxation(const RelaxFiles& files, const RelaxSurfaces& surfaces, const Relaxation& found,
                      const Context& context);

}  // namespace tunica::chain
