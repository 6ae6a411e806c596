#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/io/mesh/voxel_comments.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/seams.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/surface/repair/repair.hpp"

#include <fmt/format.h>

#include <cmath>

namespace fs = std::filesystem;
using namespace tunica;

namespace {

constexpr double interval_width = 1e-5;                                   // of the diagonal: what the report certifies
constexpr std::size_t least_splits = 1'000'000, splits_per_triangle = 8;  // of the certificate

struct Arguments {
  fs::path in, out;
  std::optional<std::string> triangles;
  std::optional<LengthTolerance> max_error;
  std::optional<std::string> min_angle;
  bool soft_angle = false;
  bool repair = false;
  std::optional<std::string> mesh_unit;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  app.add_option("IN", given.in, "surface mesh: PLY, OBJ, STL, OFF or GLB")->required();
  app.add_option("OUT.ply", given.out, "the coarser mesh")->required();
  tool.group("How far");
  app.add_option("--triangles", given.triangles, "at most N triangles")->type_name("N");
  tool.tolerance(
      "--max-error", given.max_error,
      "largest distance to IN, both ways, e.g. 0.5% of IN's diagonal or 0.2mm; with --triangles it wins, and "
      "the exit code is 4 when both cannot hold");
  tool.group("Input");
  app.add_option("--mesh-unit", given.mesh_unit, "unit of mesh files that do not state one: mm, cm, m or um")
      ->type_name("mm|cm|m|um");
  tool.group("How far");
  app.add_option(
         "--min-angle", given.min_angle,
         "well-shaped triangles for a larger error: no angle below DEG degrees (e.g. 20, at most 40; 0: any) but "
         "where IN's own corners are sharper; exit code 4 when that cannot be held")
      ->type_name("DEG");
  app.add_flag("--soft-angle", given.soft_angle,
               "where --min-angle cannot be held, take the best mesh with a warning in place of exit code 4");
  tool.group("Input");
  app.add_flag(
      "--repair", given.repair,
      "mend IN: join boundary edges that coincide (seams, T-junctions), drop double triangles and pieces without "
      "area, turn triangles that face the wrong way, take apart what meets at too many; holes stay");
}

std::optional<std::size_t> wanted_triangles(const Arguments& given) {
  if (!given.triangles && !given.max_error) {
    throw UsageError("say how far to go: --triangles N, --max-error TOL, or both");
  }
  if (!given.triangles) {
    return std::nullopt;
  }
  const auto number = parse_number(*given.triangles);
  if (!number || *number < 1 || *number > real(max_index) || *number != std::floor(*number)) {
    throw UsageError(fmt::format("--triangles: '{}' is not a whole number from 1 to {}", *given.triangles, max_index));
  }
  return truncated<std::size_t>(*number);
}

std::optional<double> wanted_angle(const Arguments& given) {
  if (!given.min_angle) {
    return std::nullopt;
  }
  const auto number = parse_number(*given.min_angle);
  if (!number || !(*number >= 0 && *number <= 40)) {
    throw UsageError(fmt::format("--min-angle: '{}' is not a number of degrees from 0 to 40", *given.min_angle));
  }
  return *number > 0 ? number : std::nullopt;
}

// What IN is, beside fit for the work: open where it looks whole, or inside out. Both stay as they are.
// @param repaired  boundary edges that still coincide are those that could not agree, which `repairs` counts
void warn_of_surface(const cli::Tool& tool, const fs::path& path, const TriangleMesh& mesh, const MeshFacts& facts,
                     bool repaired) {
  for (const Warning& warning : repaired ? std::vector<Warning>() : seam_warnings(mesh, facts, path, Weight::major)) {
    tool.warn(warning);
  }
  if (const Facing facing = facing_of(mesh); facing.inward > 0) {
    tool.warn({Weight::minor, "faces inward",
               fmt::format("{}: {}; they are kept as they are, and tunica-relax turns them outward", path.string(),
                           facing_phrase(facing))});
  }
}

MeshFile read_surface(const cli::Tool& tool, const fs::path& path, const std::optional<double>& unit_mm,
                      bool require_unit, std::optional<Repairs>& repairs) {
  MeshFile file = read_mesh(path, unit_mm, require_unit);
  require_no_other_unit(file, unit_mm, path);
  if (const auto note = unit_note(file, path)) {
    tool.warn(*note);
  }
  if (repairs) {
    try {
      Repaired result = repaired(file.mesh);
      file.mesh = std::move(result.mesh);
      repairs = result.repairs;
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", path.string(), error.what()));
    }
  }
  const MeshFacts facts = examine(file.mesh);
  if (const auto reason = why_unfit_surface(file.mesh, facts)) {
    throw InputError(fmt::format(
        "{}: {}; decimation needs a surface where every edge has at most two triangles that face the same way: mend it "
        "with --repair",
        path.string(), *reason));
  }
  if (!(diagonal(file.mesh) > 0)) {
    throw InputError(fmt::format("{}: all its vertices lie in one point", path.string()));
  }
  warn_of_surface(tool, path, file.mesh, facts, repairs.has_value());
  return file;
}

// What became of the input's triangles without area, where that is more than the same surface without them.
void warn_of_changes(const cli::Tool& tool, const fs::path& in, const DecimateResult& result, std::size_t degenerate) {
  if (result.closed_loops > 0) {
    tool.warn(
        {Weight::minor, "holes closed",
         fmt::format("{}: {} hole(s) whose rim was a single point are closed", in.string(), result.closed_loops)});
  }
  if (result.longest_spike > 0) {
    tool.warn({Weight::minor, "spikes",
               fmt::format("{}: spikes without area, up to {:.4g} mm long, are taken away from its boundary",
                           in.string(), result.longest_spike)});
  }
  if (degenerate > 0) {
    tool.warn({Weight::minor, "triangles without area",
               fmt::format("{} triangle(s) without area are left: {}", degenerate,
                           result.long_spikes > 0 ? "--max-error is too small for their spikes to go"
                                                  : "without them pieces would be lost or parts fall apart")});
  }
}

// Which requirement was not met, in words; none when all were. @param angle  degrees, the smallest of the mesh
std::optional<std::string> what_failed(const Arguments& given, const DecimateResult& result, double angle) {
  const std::size_t count = result.mesh.triangles.size();
  if (!result.error_kept && result.long_spikes > 0) {
    return fmt::format(
        "its spikes without area, up to {:.4g} mm long, cannot stay with --min-angle nor go within "
        "--max-error; allow more error",
        result.longest_spike);
  }
  if (!result.error_kept && wanted_angle(given) && !given.soft_angle) {
    return fmt::format(
        "no mesh was found that keeps both --max-error and --min-angle ({:.3g} mm at {:.3g} degrees); "
        "allow more error or smaller angles",
        result.error->upper, angle);
  }
  if (!result.error_kept) {
    return fmt::format("the error asked for by --max-error is below what double precision can certify ({:.3g} mm)",
                       result.error->upper);
  }
  if (!result.angle_held && !given.soft_angle) {
    return fmt::format(
        "the smallest angle that could be reached{} is {:.3g} degrees; lower --min-angle or allow more {}",
        given.max_error ? " within the error" : "", angle, given.max_error ? "error" : "triangles");
  }
  if (!result.count_reached && given.max_error) {
    return fmt::format("{} triangles are the fewest found that keep --max-error; raise one of the two", count);
  }
  if (!result.count_reached) {
    return fmt::format("{} triangles are the fewest that keep its pieces, holes and handles without folds", count);
  }
  return std::nullopt;
}

// A coarse mesh and what there is to say of it.
struct Coarse {
  DecimateResult made;
  std::optional<Repairs> repairs;
  Interval distance;                            // mm, to the input, two-sided
  std::vector<std::array<Index, 2>> crossings;  // pairs of its triangles that cross
  double diagonal = 0;                          // mm
  double angle = 0;                             // degrees, smallest
};

DecimateResult decimated(cli::Tool& tool, const Arguments& given, const TriangleMesh& mesh, double diagonal_mm) {
  const auto stage = tool.stage("decimate");
  DecimateOptions options;
  options.triangles = wanted_triangles(given);
  options.min_angle = wanted_angle(given);
  if (given.max_error) {
    options.max_error = given.max_error->millimetres(diagonal_mm);
  }
  options.progress = tool.progress("decimate");
  try {
    DecimateResult made = decimate(mesh, options);
    if (given.soft_angle && options.min_angle && !(made.error_kept && made.count_reached)) {
      const double wish = *std::exchange(options.min_angle, std::nullopt);  // what else is asked for goes before
      made = decimate(mesh, options);
      made.angle_held = min_angle_degrees(made.mesh) >= wish;
    }
    return made;
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", given.in.string(), error.what()));
  }
}

Interval measured(cli::Tool& tool, const DecimateResult& coarse, const TriangleMesh& fine, double diagonal_mm) {
  HausdorffOptions options;
  options.width = interval_width * diagonal_mm;
  options.samples = 0;
  // Among collinear needles of the input no number of cuts is enough; others need far fewer.
  options.max_splits = std::max(least_splits, splits_per_triangle * fine.triangles.size());
  options.progress = tool.progress("measure");
  Interval distance = hausdorff(coarse.mesh, fine, options).both;
  if (coarse.error) {
    distance.upper = std::min(distance.upper, coarse.error->upper);
  }
  return distance;
}

// Sheets that were nearer to each other than the error: triangles of one pass through the other.
void warn_of_crossings(const cli::Tool& tool, const Arguments& given, const Coarse& coarse, const TriangleMesh& in) {
  const auto& crossings = coarse.crossings;
  if (crossings.empty() || find_seams(in).edges > 0) {
    return;  // both sides of a seam touch, and that it is one has been said
  }
  const Vec3& place = coarse.made.mesh.vertices[coarse.made.mesh.triangles[crossings.front()[0]][0]];
  const std::string where = fmt::format(
      "{}: {} pairs of triangles of the coarser mesh cross, the first near ({:.4g}, "
      "{:.4g}, {:.4g})",
      given.in.string(), crossings.size(), place.x(), place.y(), place.z());
  const std::size_t before = count_self_intersections(in);
  tool.warn({crossings.size() > before ? Weight::major : Weight::minor, "surface crosses itself",
             before > 0 ? fmt::format("{}, and {} pairs of IN do: the wall passes through itself there; make IN anew "
                                      "without crossings",
                                      where, before)
                        : fmt::format("{}, because parts of IN lie nearer to each other than the error of {:.3g} mm: "
                                      "allow more --triangles, or a --max-error smaller than half their distance",
                                      where, coarse.distance.upper)});
}

// A count that is far from reached from below. With --repair a count is named to keep all.
void warn_of_count(const cli::Tool& tool, const Arguments& given, std::size_t triangles, std::size_t triangles_in) {
  constexpr double about = 0.95;
  const auto wanted = wanted_triangles(given);
  if (!wanted || given.max_error || given.repair || real(triangles) >= about * real(*wanted)) {
    return;
  }
  tool.warn({Weight::minor, "fewer than asked for",
             fmt::format("{}: {} triangles instead of {}: {}", given.in.string(), triangles, *wanted,
                         *wanted > triangles_in
                             ? fmt::format("IN has only {}, and decimation makes none; for more, extract from a finer "
                                           "image, or split shells by tunica-relax --refine",
                                           triangles_in)
                             : "its shape and --min-angle leave no more; name more triangles")});
}

void tell(cli::Tool& tool, const Arguments& given, const Coarse& coarse, const TriangleMesh& in) {
  const TriangleMesh& mesh = coarse.made.mesh;
  const std::size_t triangles_in = in.triangles.size();
  const MeshFacts facts = examine(mesh);
  const std::size_t degenerate = count_degenerate(mesh);
  const auto min_angle = wanted_angle(given);
  warn_of_changes(tool, given.in, coarse.made, degenerate);
  warn_of_crossings(tool, given, coarse, in);
  warn_of_count(tool, given, mesh.triangles.size(), triangles_in);
  if (min_angle && coarse.angle < *min_angle) {
    tool.warn({Weight::minor, "narrow angles",
               fmt::format("the smallest angle is {:.3g} degrees, below --min-angle: {}", coarse.angle,
                           coarse.made.angle_held ? "there IN's own corners are sharper"
                                                  : "no better mesh was found, allow more triangles")});
  }
  const Interval &mm = coarse.distance, percent{100 * mm.lower / coarse.diagonal, 100 * mm.upper / coarse.diagonal};
  tool.result() = {
      {"triangles_in", triangles_in},
      {"triangles", mesh.triangles.size()},
      {"hausdorff_percent", {{"lower", percent.lower}, {"upper", percent.upper}}},
      {"hausdorff_mm", {{"lower", mm.lower}, {"upper", mm.upper}}},
      {"min_angle_deg", coarse.angle},
      {"min_angle_held", min_angle ? Json(coarse.made.angle_held) : Json()},
      {"mean_quality", mean_quality(mesh)},
      {"manifold", facts.manifold && facts.oriented},
      {"euler", facts.euler},
      {"boundary_loops", facts.boundary_loops},
      {"self_intersections", coarse.crossings.size()},
      {"degenerate_triangles", degenerate},
      {"closed_loops", coarse.made.closed_loops},
      {"longest_spike_mm", coarse.made.longest_spike},
      {"diagonal_mm", coarse.diagonal},
  };
  if (const auto& repairs = coarse.repairs) {
    tool.result()["repairs"] = {{"dropped_triangles", repairs->dropped_triangles},
                                {"joined_edges", repairs->joined_edges},
                                {"split_edges", repairs->split_edges},
                                {"turned_triangles", repairs->turned_triangles},
                                {"opened_edges", repairs->opened_edges},
                                {"split_vertices", repairs->split_vertices},
                                {"cut_edges", repairs->cut_edges}};
  }
  tool.note(
      fmt::format("{} of {} triangles, at most {:.4g} % ({:.4g} mm) from the input, no angle below {:.3g} degrees",
                  mesh.triangles.size(), triangles_in, rounded_upwards(percent.upper, 4), rounded_upwards(mm.upper, 4),
                  std::floor(1000 * coarse.angle) / 1000));
}

void run(cli::Tool& tool, const Arguments& given) {
  wanted_triangles(given);  // refused before the work
  wanted_angle(given);
  std::optional<double> unit_mm;
  if (given.mesh_unit) {
    unit_mm = parse_length_unit(*given.mesh_unit);
  }
  tool.output(given.out, {".ply"});

  Coarse coarse;
  if (given.repair) {
    coarse.repairs.emplace();
  }
  MeshFile in;
  {
    const auto stage = tool.stage("read");
    const bool in_millimetres = given.max_error && !given.max_error->relative;
    in = read_surface(tool, tool.input(given.in), unit_mm, in_millimetres, coarse.repairs);
    tool.require_unchanged_inputs();
  }
  if (in.unit_unknown) {
    tool.warn(
        {Weight::minor, "unit of length",
         fmt::format("{}: says no unit of length, so {} says none either, and the other tools take its numbers for "
                     "mm: give --mesh-unit mm|cm|m|um",
                     given.in.string(), given.out.string())});
  }
  coarse.diagonal = diagonal(in.mesh);
  coarse.made = decimated(tool, given, in.mesh, coarse.diagonal);
  coarse.angle = min_angle_degrees(coarse.made.mesh);
  {
    const auto stage = tool.stage("measure");
    coarse.distance = measured(tool, coarse.made, in.mesh, coarse.diagonal);
    coarse.crossings = find_self_intersections(coarse.made.mesh);
    tell(tool, given, coarse, in.mesh);
  }

  const auto stage = tool.stage("write");
  const auto failure = what_failed(given, coarse.made, coarse.angle);
  PlyOptions options;
  options.comments = voxel_comments(in);
  options.comments.push_back("made by " + tool.made_by());
  options.space = in.space.value_or(options.space);
  options.millimetres = !in.unit_unknown;
  options.overwrite = tool.force();
  options.partial = failure.has_value();
  write_ply(given.out, coarse.made.mesh, options);
  if (failure) {
    throw RequirementError(
        fmt::format("{}: {}; the best mesh is in {}.part", given.in.string(), *failure, given.out.string()));
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("decimate",
                 "Quadric edge collapse: fewer triangles for the same surface. Boundaries and topology are kept, no "
                 "triangle is flipped, those without area go, and the two-sided distance to the input is certified.",
                 "tunica-decimate surface.ply coarse.ply --triangles 800\n"
                 "  tunica-decimate surface.ply within.ply --max-error 0.5% --report decimate.json\n"
                 "  tunica-decimate surface.ply shaped.ply --triangles 800 --min-angle 20");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "decimate", "measure", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
