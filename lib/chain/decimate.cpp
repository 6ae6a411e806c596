#include "tunica/chain/decimate.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/mesh/provenance_comments.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/seams.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica::chain {
namespace {

constexpr double interval_width = 1e-5;                                   // of the diagonal: what the report certifies
constexpr std::size_t least_splits = 1'000'000, splits_per_triangle = 8;  // of the certificate

// What IN is, beside fit for the work: open where it looks whole, or inside out. Both stay as they are.
// @param repaired  boundary edges that still coincide are those that could not agree, which `repairs` counts
void warn_of_surface(const std::filesystem::path& path, const TriangleMesh& mesh, const MeshFacts& facts, bool repaired,
                     const Context& context) {
  if (!repaired) {
    std::ranges::for_each(seam_warnings(mesh, facts, path, Weight::major), context.warn);
  }
  if (const Facing facing = facing_of(mesh); facing.inward > 0) {
    context.warn({Weight::minor, "faces inward",
                  fmt::format("{}: {}; they are kept as they are, and tunica-relax turns them outward", path.string(),
                              facing_phrase(facing))});
  }
}

// What became of the input's triangles without area, where that is more than the same surface without them.
void warn_of_changes(const DecimateResult& result, std::size_t degenerate, const Context& context,
                     const std::string& name) {
  if (result.closed_loops > 0) {
    context.warn({Weight::minor, "holes closed",
                  fmt::format("{}: {} hole(s) whose rim was a single point are closed", name, result.closed_loops)});
  }
  if (result.longest_spike > 0) {
    context.warn({Weight::minor, "spikes",
                  fmt::format("{}: spikes without area, up to {:.4g} mm long, are taken away from its boundary", name,
                              result.longest_spike)});
  }
  if (degenerate > 0) {
    context.warn({Weight::minor, "triangles without area",
                  fmt::format("{} triangle(s) without area are left: {}", degenerate,
                              result.long_spikes > 0 ? "--max-error is too small for their spikes to go"
                                                     : "without them pieces would be lost or parts fall apart")});
  }
}

// Which requirement was not met, in words; none when all were. @param angle  degrees, the smallest of the mesh
std::optional<std::string> what_failed(const DecimateSettings& given, const DecimateResult& result, double angle) {
  const std::size_t count = result.mesh.triangles.size();
  if (!result.error_kept && result.long_spikes > 0) {
    return fmt::format(
        "its spikes without area, up to {:.4g} mm long, cannot stay with --min-angle nor go within "
        "--max-error; allow more error",
        result.longest_spike);
  }
  if (!result.error_kept && given.min_angle && !given.soft_angle) {
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

DecimateResult decimated(const TriangleMesh& mesh, const DecimateSettings& settings, double diagonal_mm,
                         const Context& context, const std::string& name) {
  const auto stage = context.stage("decimate");
  DecimateOptions options;
  options.triangles = settings.triangles;
  options.min_angle = settings.min_angle;
  if (settings.max_error) {
    options.max_error = settings.max_error->millimetres(diagonal_mm);
  }
  options.progress = context.progress("decimate");
  return naming(name, [&] {
    DecimateResult made = tunica::decimate(mesh, options);
    if (settings.soft_angle && options.min_angle && !(made.error_kept && made.count_reached)) {
      const double wish = *std::exchange(options.min_angle, std::nullopt);  // what else is asked for goes before
      made = tunica::decimate(mesh, options);
      made.angle_held = min_angle_degrees(made.mesh) >= wish;
    }
    return made;
  });
}

Interval measured(const DecimateResult& coarse, const TriangleMesh& fine, double diagonal_mm, const Context& context) {
  HausdorffOptions options;
  options.width = interval_width * diagonal_mm;
  options.samples = 0;
  // Among collinear needles of the input no number of cuts is enough; others need far fewer.
  options.max_splits = std::max(least_splits, splits_per_triangle * fine.triangles.size());
  options.progress = context.progress("measure");
  Interval distance = hausdorff(coarse.mesh, fine, options).both;
  if (coarse.error) {
    distance.upper = std::min(distance.upper, coarse.error->upper);
  }
  return distance;
}

// Sheets that were nearer to each other than the error: triangles of one pass through the other.
void warn_of_crossings(const Decimation& coarse, const TriangleMesh& in, const Context& context,
                       const std::string& name) {
  const auto& crossings = coarse.crossings;
  if (crossings.empty() || find_seams(in).edges > 0) {
    return;  // both sides of a seam touch, and that it is one has been said
  }
  const Vec3& place = coarse.made.mesh.vertices[coarse.made.mesh.triangles[crossings.front()[0]][0]];
  const std::string where = fmt::format(
      "{}: {} pairs of triangles of the coarser mesh cross, the first near ({:.4g}, "
      "{:.4g}, {:.4g})",
      name, crossings.size(), place.x(), place.y(), place.z());
  const std::size_t before = count_self_intersections(in);
  context.warn({crossings.size() > before ? Weight::major : Weight::minor, "surface crosses itself",
                before > 0
                    ? fmt::format("{}, and {} pairs of IN do: the wall passes through itself there; make IN anew "
                                  "without crossings",
                                  where, before)
                    : fmt::format("{}, because parts of IN lie nearer to each other than the error of {:.3g} mm: "
                                  "allow more --triangles, or a --max-error smaller than half their distance",
                                  where, coarse.distance.upper)});
}

// A count that is far from reached from below. With --repair a count is named to keep all.
void warn_of_count(const DecimateSettings& given, const Decimation& coarse, const Context& context,
                   const std::string& name) {
  constexpr double about = 0.95;
  const std::size_t triangles = coarse.made.mesh.triangles.size(), triangles_in = coarse.triangles_in;
  const auto wanted = given.triangles;
  if (!wanted || given.max_error || coarse.repairs || real(triangles) >= about * real(*wanted)) {
    return;
  }
  context.warn(
      {Weight::minor, "fewer than asked for",
       fmt::format("{}: {} triangles instead of {}: {}", name, triangles, *wanted,
                   *wanted > triangles_in
                       ? fmt::format("IN has only {}, and decimation makes none; for more, extract from a finer "
                                     "image, or split shells by tunica-relax --refine",
                                     triangles_in)
                       : "its shape and --min-angle leave no more; name more triangles")});
}

// What came of it, in warnings and a line.
void tell(const Decimation& found, const Context& context) {
  if (found.min_angle && found.angle < *found.min_angle) {
    context.warn({Weight::minor, "narrow angles",
                  fmt::format("the smallest angle is {:.3g} degrees, below --min-angle: {}", found.angle,
                              found.made.angle_held ? "there IN's own corners are sharper"
                                                    : "no better mesh was found, allow more triangles")});
  }
  const double upper = found.distance.upper;
  context.note(fmt::format(
      "{} of {} triangles, at most {:.4g} % ({:.4g} mm) from the input, no angle below {:.3g} degrees",
      found.made.mesh.triangles.size(), found.triangles_in, rounded_upwards(100 * upper / found.diagonal, 4),
      rounded_upwards(upper, 4), std::floor(1000 * found.angle) / 1000));
}

}  // namespace

SurfaceToDecimate read_surface(const std::filesystem::path& path, std::optional<double> unit_mm, bool repair,
                               const DecimateSettings& settings, const Context& context) {
  const auto stage = context.stage("read");
  context.reads(path);
  const bool in_millimetres = settings.max_error && !settings.max_error->relative;
  SurfaceToDecimate surface{read_mesh(path, unit_mm, in_millimetres), {}};
  MeshFile& file = surface.file;
  require_no_other_unit(file, unit_mm, path);
  if (const auto note = unit_note(file, path, unit_mm)) {
    context.warn(*note);
  }
  if (repair) {
    Repaired mended = naming(path.string(), [&] { return repaired(file.mesh); });
    file.mesh = std::move(mended.mesh);
    surface.repairs = mended.repairs;
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
  warn_of_surface(path, file.mesh, facts, repair, context);
  context.has_read();
  return surface;
}

Decimation decimate(const SurfaceToDecimate& surface, const DecimateSettings& settings, const Context& context,
                    const std::string& name) {
  const TriangleMesh& in = surface.file.mesh;
  Decimation found;
  found.repairs = surface.repairs;
  found.triangles_in = in.triangles.size();
  found.min_angle = settings.min_angle;
  found.diagonal = diagonal(in);
  found.made = decimated(in, settings, found.diagonal, context, name);
  found.angle = min_angle_degrees(found.made.mesh);
  found.degenerate = count_degenerate(found.made.mesh);
  const auto stage = context.stage("measure");
  found.distance = measured(found.made, in, found.diagonal, context);
  found.crossings = find_self_intersections(found.made.mesh);
  found.unmet = what_failed(settings, found.made, found.angle);
  warn_of_changes(found.made, found.degenerate, context, name);
  warn_of_crossings(found, in, context, name);
  warn_of_count(settings, found, context, name);
  tell(found, context);
  return found;
}

void write_decimation(const std::filesystem::path& out, const SurfaceToDecimate& surface, const Decimation& found,
                      const Context& context, const std::string& name) {
  const auto stage = context.stage("write");
  PlyOptions options;
  options.comments = voxel_comments(surface.file);
  options.comments.push_back("made by " + context.made_by());
  options.space = surface.file.space.value_or(options.space);
  options.millimetres = !surface.file.unit_unknown;
  options.overwrite = context.overwrite;
  options.partial = found.unmet.has_value();
  write_ply(out, found.made.mesh, options);
  if (found.unmet) {
    throw RequirementError(fmt::format("{}: {}; the best mesh is in {}.part", name, *found.unmet, out.string()));
  }
}

}  // namespace tunica::chain
