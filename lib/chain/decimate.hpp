#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/repair/repair.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace tunica::chain {

/// How far to go: at least one of the first two.
struct DecimateSettings {
  std::optional<std::size_t> triangles;      ///< at most this many
  std::optional<LengthTolerance> max_error;  ///< largest distance to the input, both ways
  std::optional<double> min_angle;           ///< degrees, at most 40: no angle smaller, but where the input's own are
  bool soft_angle = false;                   ///< where that cannot be held, the best mesh serves
};

struct Decimation {
  DecimateResult made;
  Interval distance;                            ///< mm, to the input, two-sided
  std::vector<std::array<Index, 2>> crossings;  ///< pairs of its triangles that cross
  double diagonal = 0;                          ///< mm, of the input
  double angle = 0;                             ///< degrees, smallest
  std::size_t degenerate = 0;                   ///< triangles without area
  std::size_t triangles_in = 0;
  std::optional<double> min_angle;   ///< degrees, that was asked for
  std::optional<Repairs> repairs;    ///< of the input, where it was mended
  std::optional<std::string> unmet;  ///< which requirement was not met
};

/// A surface to be made coarser, as it was read.
struct SurfaceToDecimate {
  MeshFile file;
  std::optional<Repairs> repairs;  ///< where it was mended
};

/// Reads a surface, mends it where that is wanted, and warns of what it is beside fit for the work.
/// Errors: InputError: not an oriented manifold, without extent, or another unit than the one given.
/// @param unit_mm  size in mm of the file's unit where it states none
SurfaceToDecimate read_surface(const std::filesystem::path& path, std::optional<double> unit_mm, bool repair,
                               const DecimateSettings& settings, const Context& context);

/// The same surface with fewer triangles, and its distance to the input. Warns of what it lost or gained by that.
/// Errors and cost: as tunica::decimate() and hausdorff().
/// @param name  of the surface, in messages
Decimation decimate(const SurfaceToDecimate& surface, const DecimateSettings& settings, const Context& context = {},
                    const std::string& name = "IN");

/// Writes the coarser mesh, as `out`.part where a requirement was not met. Errors: OutputError; RequirementError.
void write_decimation(const std::filesystem::path& out, const SurfaceToDecimate& surface, const Decimation& found,
                      const Context& context, const std::string& name);

}  // namespace tunica::chain
