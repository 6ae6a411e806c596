#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/chain/error_map.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"
#include "tunica/surface/distance/hausdorff.hpp"

#include <optional>
#include <string>

namespace tunica::chain {

struct CompareSettings {
  std::optional<LengthTolerance> width;  ///< of the intervals; none: 0.01 % of B's diagonal
  std::optional<LengthTolerance> most;   ///< that the distance may be: intervals are narrowed until they decide it
};

/// What is compared: flat triangles, or curved shells.
struct ComparedSurface {
  TriangleMesh flat;
  std::optional<ShellMesh> shell;  ///< none: the flat triangles are meant
  std::string name = "A";          ///< in messages
};

/// The surface it is compared with, with what is asked of it again and again.
struct ReferenceSurface {
  /// Errors: InputError: without an extent, or as for Target and ClosestPoint.
  /// @param for_shells  it is to be compared with curved shells
  ReferenceSurface(TriangleMesh mesh, bool for_shells, std::string called = "B");
  [[nodiscard]] const ClosestPoint& tree() const { return target ? target->tree() : *flat; }

  std::string name;  ///< in messages
  double diagonal;   ///< mm
  std::optional<Target> target;
  std::optional<ClosestPoint> flat;
};

struct Comparison {
  HausdorffResult distance;          ///< mm
  std::optional<Interval> boundary;  ///< mm, of the boundaries as curves, where shells and reference have some
  bool of_shells = false;
  double width = 0;     ///< mm, of the intervals asked for
  double diagonal = 0;  ///< mm, of B: what percentages are of
  std::size_t triangles_a = 0, triangles_b = 0;
  std::optional<std::string> unmet;  ///< why the distance is not certainly what may be
};

/// The two-sided distance of two surfaces, with a note on it. Errors and cost: as hausdorff() and shell_distance().
Comparison compare(const ComparedSurface& a, const ReferenceSurface& b, const CompareSettings& settings,
                   const Context& context = {});

/// Two surfaces from files, and what is written of their distance.
struct CompareFiles {
  std::filesystem::path a, b;
  bool shell = false;             ///< A is curved shells
  std::optional<double> unit_mm;  ///< size in mm of the unit of files that state none
  MapFiles out;
};

struct ComparedFiles {
  ComparedSurface a;
  TriangleMesh b;
  std::string space;  ///< of both
};

/// Reads both and warns of what they hold beside what is compared. Errors: InputError: no surface, other axes or
/// another unit than the other one; UsageError: a unit is needed and not known.
ComparedFiles read_compared(const CompareFiles& files, const CompareSettings& settings, const Context& context);

/// Writes the files that are asked for, all or none. Errors: OutputError.
void write_comparison(const CompareFiles& files, const ComparedSurface& a, const std::string& space,
                      const ReferenceSurface& b, const Comparison& found, const Context& context);

}  // namespace tunica::chain
