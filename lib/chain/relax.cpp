#include "tunica/chain/relax.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/fit/fit.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/provenance_comments.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/shell/distance/mean_bound.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace tunica::chain {
namespace {

namespace fs = std::filesystem;

constexpr double certified_width = 1e-4;  // of the diagonal: of the intervals
constexpr double usual_angle = 20;        // degrees

struct ReadSurface {
  MeshFile file;
  MeshFacts facts;
  std::optional<TriangleMesh> with_spikes;  ///< as it was given, where triangles without area were taken away
  double moved = 0;                         ///< mm, by that
};

// Shells have area: what hangs on a surface without any can only be taken away. Caps within it would be creases.
void take_spikes(const fs::path& path, ReadSurface& surface, const Context& context) {
  TriangleMesh& mesh = surface.file.mesh;
  if (count_degenerate(mesh) == 0) {
    return;
  }
  WithoutDegenerate cleaned = without_degenerate_triangles(mesh);
  if (cleaned.longest_spike > 0) {
    context.warn({Weight::minor, "spikes",
                  fmt::format("{}: spikes without area, up to {:.4g} mm long, are taken away from its boundary",
                              path.string(), cleaned.longest_spike)});
  }
  // A boundary loop that is a point stays one of the target's.
  if (cleaned.longest_spike > 0 || cleaned.closed_loops == 0) {
    surface.moved = cleaned.moved;
    surface.with_spikes = std::exchange(mesh, std::move(cleaned.mesh));
  }
}

// Pressure pushes along the normals: they are to point outward.
void turn_outward(const fs::path& path, TriangleMesh& mesh, const Context& context) {
  const Facing facing = facing_of(mesh);
  if (facing.inward == 0) {
    return;
  }
  mesh = turned_outward(std::move(mesh), facing);
  if (facing.outermost_inward == 0) {
    context.warn(
        {Weight::minor, "faces inward",
         fmt::format("{}: {} of its {} pieces lie within others: they are taken for the walls of hollows, and are "
                     "turned around to face into them; where one is another organ, put it into a file of its own",
                     path.string(), facing.inward, facing.pieces)});
  } else {
    context.warn(
        {Weight::minor, "faces inward",
         fmt::format("{}: {}: they are turned around, so that a positive pressure pushes outward; give a negative "
                     "one to push inward",
                     path.string(), facing_phrase(facing))});
  }
}

ReadSurface read_oriented(const fs::path& path, const std::optional<double>& unit_mm, const Context& context) {
  context.reads(path);
  ReadSurface surface{read_mesh(path, unit_mm, true), {}, {}, 0};
  if (const auto note = unit_note(surface.file, path, unit_mm)) {
    context.warn(*note);
  }
  surface.facts = require_surface(surface.file, path);
  std::ranges::for_each(seam_warnings(surface.file.mesh, surface.facts, path, Weight::major), context.warn);
  turn_outward(path, surface.file.mesh, context);
  take_spikes(path, surface, context);
  return surface;
}

void warn_of_mismatch(const MeshFacts& a, const MeshFacts& b, const Context& context) {
  const auto differ = [&](std::size_t of_coarse, std::size_t of_target, const std::string& what) {
    if (of_coarse != of_target) {
      context.warn(
          {Weight::major, "another topology",
           fmt::format("COARSE has {} {}, TARGET has {}: what COARSE lacks stays uncovered, and the distance shows "
                       "it; make COARSE of this TARGET by tunica-decimate",
                       of_coarse, what, of_target)});
    }
  };
  differ(a.components, b.components, "component(s)");
  differ(a.boundary_loops, b.boundary_loops, "boundary loop(s)");
}

void warn_of_crossings(const ShellMesh& shell, const std::vector<std::array<Index, 2>>& crossings,
                       const Context& context) {
  if (crossings.empty()) {
    return;
  }
  const Vec3& place = shell.vertices[shell.triangles[crossings.front()[0]][0]];
  context.warn(
      {Weight::minor, "shells cross",
       fmt::format("{} pair(s) of curved shells cross, the first near ({:.4g}, {:.4g}, {:.4g}): the wall passes "
                   "through itself there; more shells part them (of the pipeline SHELLS), or a TARGET that does "
                   "not cross itself",
                   crossings.size(), place.x(), place.y(), place.z())});
}

/// A count that the target itself does not reach.
/// @param wanted  shells
void warn_if_few(std::size_t wanted, const ShellMesh& made, const RelaxSurfaces& surfaces, const Context& context) {
  constexpr double about = 0.95, few = 0.5;
  if (real(made.triangles.size()) < about * real(wanted)) {
    context.warn(
        {real(made.triangles.size()) < few * real(wanted) ? Weight::minor : Weight::note, "fewer than asked for",
         fmt::format("{}: {} shells instead of {}: TARGET has {} triangles, and what they allow is all there is; "
                     "for more, extract TARGET from a finer image, or split these shells by --refine (RELAX=--refine)",
                     surfaces.target_name, made.triangles.size(), wanted, surfaces.target->mesh().triangles.size())});
  }
}

std::size_t handles(const MeshFacts& facts) {
  const long without = 2 * narrow<long>(facts.components) - narrow<long>(facts.boundary_loops);
  return narrow<std::size_t>(std::max(0L, without - facts.euler) / 2);
}

void warn_of_middle(const HalfWaySurface& middle, const Context& context) {
  if (middle.left_out > 0) {
    context.warn(
        {Weight::minor, "left out",
         fmt::format("{} piece(s) of the middle of the wall, {:.3g} mm2 together, are left out: half of the wall "
                     "closes a gap of TARGET or parts it there",
                     middle.left_out, middle.left_out_area)});
  }
  if (middle.crossing > 0) {
    context.warn(
        {Weight::major, "wall crosses itself",
         fmt::format("the middle of the wall crosses itself at {} pair(s) of its triangles: a thinner wall or a "
                     "smoother TARGET parts them",
                     middle.crossing)});
  }
}

/// TARGET may say which face of a wall it is.
void require_that_face(WallFace said, const MeshFile& target, const fs::path& path) {
  const std::string other = name_of(behind(said));
  if (std::ranges::find(target.comments, "face " + other) != target.comments.end()) {
    throw InputError(
        fmt::format("{} is the {} face of a wall, as it says, and --mid-surface (MID_SURFACE) the {}: "
                    "name the same",
                    path.string(), other, name_of(said)));
  }
}

/// Areas of parallel surfaces are A + M x + 2 pi chi x^2, x from the middle (Steiner; rims that are cut straight).
/// @param face, middle  areas of TARGET and of the middle, mm^2
/// @param euler  chi, of the middle
void warn_of_pressure(WallFace which, double face, double middle, long euler, double thickness,
                      const Context& context) {
  constexpr double notable = 1.05;
  const double curved = std::numbers::pi * real(euler) * thickness * thickness;
  const double inner = which == WallFace::inner ? face : 2 * middle - face + curved;
  if (inner > 0 && middle > notable * inner) {
    context.warn(
        {Weight::minor, "pressure on the middle",
         fmt::format(
             "the middle of the wall has {:.4g} times the area of its inner face, and a pressure on these "
             "shells acts on the middle: stress is larger by as much than by a pressure inside; divide "
             "the pressure (--pressure, --imaged-at; PRESSURE, IMAGED_AT) by {:.4g}, unless it is divided already",
             middle / inner, middle / inner)});
  }
}

/// The surface half of the wall away becomes the target, and COARSE a mesh on it.
WallMiddle go_half_way(RelaxSurfaces& surfaces, WallFace which, double thickness, const Context& context) {
  const Target& face = *surfaces.face;
  HalfWaySurface middle = naming(surfaces.target_name, [&] {
    return half_way_surface(face, which, thickness, context.progress("find the middle of the wall"));
  });
  context.detail(
      fmt::format("the middle of the wall: {} triangles by cells of {:.3g} mm; {:.3g} mm in the mean and "
                  "{:.3g} mm at most from half a wall away",
                  middle.mesh.triangles.size(), middle.cell, middle.error[0], middle.error[1]));
  warn_of_middle(middle, context);
  const MeshFacts before = examine(face.mesh()), after = examine(middle.mesh), coarse = examine(surfaces.coarse);
  if (before.euler != after.euler || before.boundary_loops != after.boundary_loops + face.point_loops()) {
    context.warn(
        {Weight::major, "another topology",
         fmt::format("the middle of the wall has {} rim(s) and {} handle(s), TARGET has {} and {}: half of the "
                     "wall closes a gap, or a branch is too narrow for it; a thinner wall leaves them",
                     after.boundary_loops, handles(after), before.boundary_loops, handles(before))});
  }
  warn_of_pressure(which, area(face.mesh()), area(middle.mesh), after.euler, thickness, context);
  surfaces.target = std::make_unique<Target>(std::move(middle.mesh));
  if (coarse.euler == after.euler && coarse.boundary_loops == after.boundary_loops) {
    surfaces.coarse = moved_half_way(std::move(surfaces.coarse), face, which, thickness, *surfaces.target);
  } else {
    DecimateOptions few;
    few.triangles = surfaces.coarse.triangles.size();
    surfaces.coarse = tunica::decimate(surfaces.target->mesh(), few).mesh;
  }
  return {.half_way = std::move(middle)};
}

FitOptions fit_options(const RelaxSurfaces& surfaces, const RelaxSettings& settings,
                       const std::optional<double>& tolerance, const Context& context) {
  constexpr double most_for_spikes = 0.9;  // of the tolerance
  FitOptions options;
  options.surface = settings.surface;
  options.refine = settings.refine;
  options.shells = settings.shells;
  options.max_shells = settings.max_shells;
  options.max_iterations = settings.max_iterations;
  if (settings.refine && !settings.tolerance && !settings.max_shells && !settings.max_iterations) {
    options.max_iterations = 2;
  }
  options.min_angle = settings.min_angle.value_or(usual_angle);
  options.width = certified_width * surfaces.whole().diagonal();
  options.progress = context.progress("relax");
  if (tolerance) {
    options.tolerance = surfaces.moved < most_for_spikes * *tolerance ? *tolerance - surfaces.moved : *tolerance;
  }
  return options;
}

/// Measures the mean distance. @return whether it is certainly what is asked for
bool is_near_in_the_mean(Relaxation& found, const RelaxSurfaces& surfaces, double asked) {
  constexpr double slack = 0.2;  // of the mean asked for: about how far above it its bound may lie
  const ShellMesh& shell = found.relaxed.shell;
  found.mean = shell_quality(shell, *surfaces.target).mean_distance;  // sampled: what is above needs no certificate
  found.mean_bound.reset();
  if (found.mean <= asked) {
    found.mean_bound = found.mean = surfaces.moved + mean_distance_bound(shell, *surfaces.target, slack * asked);
  }
  found.relaxed.reached = found.mean <= asked;
  return *found.relaxed.reached;
}

void put_on_target(Relaxation& found, const RelaxSurfaces& surfaces, const RelaxSettings& settings,
                   const Context& context) {
  FitOptions options = fit_options(surfaces, settings, found.tolerance, context);
  ShellMesh best;
  options.on_iteration = [&](const RelaxIteration& iteration, const ShellMesh& so_far) {
    const double percent = 100 / surfaces.whole().diagonal();
    best = so_far;
    context.detail(fmt::format(
        "{} shells: {:.4f} to {:.4f} %; nodes by the rule {}, to the closest point {}, on the boundary {}, held back "
        "{}; {:.2f} s",
        iteration.shells, percent * iteration.hausdorff.lower, percent * iteration.hausdorff.upper,
        iteration.moves.by_rule, iteration.moves.to_closest_point, iteration.moves.on_boundary,
        iteration.moves.shortened, iteration.seconds));
  };
  const auto relaxed = [&] {
    return settings.by_barycentre ? relax_by_barycentre(surfaces.coarse, *surfaces.target, options)
                                  : fit(surfaces.coarse, *surfaces.target, options);
  };
  try {
    found.relaxed = relaxed();
    // A largest distance of the mean asked for serves for certain.
    while (settings.mean && !is_near_in_the_mean(found, surfaces, *settings.mean) &&
           *options.tolerance > *settings.mean) {
      options.tolerance = *options.tolerance / 2;
      found.relaxed = relaxed();
    }
  } catch (const Interrupted&) {
    if (!best.triangles.empty() && settings.keep) {
      settings.keep(best);
    }
    throw;
  } catch (const InputError& error) {
    throw InputError(surfaces.coarse_name + ": " + error.what());
  }
}

void certify(Relaxation& found, const RelaxSurfaces& surfaces, const RelaxSettings& settings, const Context& context) {
  RelaxResult& relaxed = found.relaxed;
  ShellDistanceOptions measuring;
  measuring.width = certified_width * found.diagonal;
  found.flat = flat_distance(relaxed.shell, surfaces.whole(), measuring).both;
  if (found.tolerance) {
    measuring.width = std::min(measuring.width, std::max(*found.tolerance, relaxed.distance.both.lower) / 20);
  }
  measuring.progress = context.progress("measure");
  found.distance = certified_distance(relaxed, surfaces.whole(), surfaces.moved, measuring);
  const double farthest = relaxed.distance.boundary ? found.distance.upper() : found.distance.both.upper;
  if (surfaces.moved > 0 && !settings.mean && relaxed.reached && farthest > *found.tolerance) {
    relaxed.reached = false;
    relaxed.stopped = "no shells reach the target's spikes without area";
  }
  constexpr double far = 20;  // % of the diagonal: shells that are fitted come nearer, whatever their number
  if (const double apart = 100 / found.diagonal * found.distance.both.lower; apart > far) {
    context.warn(
        {Weight::major, "another surface",
         fmt::format("shells and surface are {:.3g} % of the surface's diagonal apart: are COARSE and TARGET of one "
                     "organ, in this "
                     "order and in the same place?",
                     apart)});
  }
}

void measure_shapes(Relaxation& found, const RelaxSurfaces& surfaces, const RelaxSettings& settings,
                    const Context& context) {
  constexpr double rounded_up = 0.9975;  // of an angle: what prints as less
  const ShellMesh& shell = found.relaxed.shell;
  found.angle = min_angle_degrees(flat_facets(shell));
  if (const double wanted = settings.min_angle.value_or(usual_angle);
      !settings.by_barycentre && found.angle < rounded_up * wanted) {
    context.note(
        fmt::format("the smallest angle of the shells is {:.3g} degrees, below {:.3g}: boundaries, creases, the "
                    "tolerance or the number of shells allow no more",
                    found.angle, wanted));
  }
  const auto crossings = crossing_patches(shell);
  found.crossings = crossings.size();
  warn_of_crossings(shell, crossings, context);
  found.quality = shell_quality(shell, surfaces.whole());
}

/// Two faces that are no farther apart than the shells lie from one of them have no wall between them.
void require_wall(const Relaxation& found, const RelaxSurfaces& surfaces) {
  constexpr double least = 2;  // below it half of what is measured is the shells' own error
  const auto& thickness = found.thickness;
  const double mean = std::accumulate(thickness.begin(), thickness.end(), 0.0) / real(thickness.size());
  const double off = found.quality.mean_distance;
  if (mean < least * off) {
    throw InputError(
        fmt::format("{}: lies {:.3g} mm from the shells in the mean, hardly farther than they from "
                    "{} ({:.3g} mm): is it the other face of the wall?",
                    surfaces.other_name, mean, surfaces.target_name, off));
  }
}

/// What was asked for and is not there, in words; none where all is. @param out  where the best mesh will be
std::optional<std::string> what_lacks(const std::string& out, const RelaxSurfaces& surfaces, const Relaxation& found,
                                      const RelaxSettings& settings) {
  const RelaxResult& relaxed = found.relaxed;
  const std::size_t shells = relaxed.shell.triangles.size();
  const double percent = 100 / found.diagonal;
  const bool fits = !settings.by_barycentre;
  if (const auto most = settings.shells ? settings.shells : settings.max_shells; most && shells > *most) {
    return fmt::format(
        "{}: {} shells are the fewest found that keep its pieces, holes and handles without folds, {} "
        "are allowed; the best mesh is in {}.part",
        surfaces.target_name, shells, *most, out);
  }
  if (settings.mean && !*relaxed.reached) {
    return fmt::format(
        "{}: a mean distance of {:.4g} mm is not reached: {:.4g} mm with {} shells ({}); the best mesh is "
        "{}.part. Allow more shells or iterations, or a wider tolerance",
        out, *settings.mean, found.mean, shells, relaxed.stopped, out);
  }
  if (found.tolerance && !settings.mean && !*relaxed.reached) {
    const auto& boundary = found.distance.boundary;
    return fmt::format(
        "{}: the tolerance of {:.4g} % is not reached: {:.4g} %{} with {} shells ({}); the best mesh is {}.part. {}",
        out, percent * *found.tolerance, percent * found.distance.both.upper,
        boundary && fits ? fmt::format(", {:.4g} % of the boundaries", percent * boundary->upper) : "", shells,
        relaxed.stopped, out,
        fits              ? "Allow more shells or iterations, or a wider tolerance"
        : settings.refine ? "Allow more shells or iterations"
                          : "Add --refine, or take a coarse mesh with more triangles");
  }
  if (const std::size_t without_area = count_without_area(relaxed.shell); without_area > 0) {
    return fmt::format(
        "{}: {} shell(s) have no area, as the surface has none there; the best mesh is {}.part. Make "
        "the surface anew, or take such parts away first",
        out, without_area, out);
  }
  return std::nullopt;
}

}  // namespace

Relaxation relax(RelaxSurfaces& surfaces, const RelaxSettings& settings, const Context& context) {
  Relaxation found;
  const std::size_t wanted = settings.shells.value_or(surfaces.coarse.triangles.size());
  {
    const auto stage = context.stage("relax");
    if (surfaces.face) {
      found.middle = go_half_way(surfaces, *settings.face, *settings.thickness, context);
    }
    found.diagonal = surfaces.whole().diagonal();
    if (settings.tolerance) {
      found.tolerance = settings.tolerance->millimetres(found.diagonal);
    }
    put_on_target(found, surfaces, settings, context);
  }
  const auto stage = context.stage("measure");
  certify(found, surfaces, settings, context);
  found.shell = found.relaxed.shell;
  if (!settings.by_barycentre && !settings.tolerance && !settings.refine) {
    warn_if_few(wanted, found.shell, surfaces, context);
  }
  measure_shapes(found, surfaces, settings, context);
  if (found.mean_bound) {
    context.note(fmt::format("mean distance certainly below {:.4g} mm, {:.3g} % of the wall",
                             rounded_upwards(*found.mean_bound, 4),
                             rounded_upwards(100 * *found.mean_bound / *settings.thickness, 3)));
  }
  const double percent = 100 / found.diagonal;
  context.note(fmt::format("{} shells, two-sided distance {:.4g} to {:.4g} % of the diagonal: {}",
                           found.shell.triangles.size(), percent * found.distance.both.lower,
                           rounded_upwards(percent * found.distance.both.upper, 4), found.relaxed.stopped));
  return found;
}

void take_middle(Relaxation& found, const RelaxSurfaces& surfaces, const RelaxSettings& settings,
                 const Context& context) {
  if (!settings.face) {
    return;
  }
  WallMiddle middle = found.middle.value_or(WallMiddle());
  if (surfaces.other) {
    MidSurface moved =
        naming(surfaces.other_name, [&] { return mid_surface_between(found.shell, *settings.face, *surfaces.other); });
    found.shell = std::move(moved.shell);
    found.thickness = std::move(moved.thickness);
    found.crossings = crossing_patches(found.shell).size();
    if (found.crossings > 0) {
      context.warn({Weight::major, "wall crosses itself",
                    fmt::format("{} pair(s) of curved shells cross in the middle of the wall", found.crossings)});
    }
    require_wall(found, surfaces);
    const auto [thinnest, thickest] = std::ranges::minmax(found.thickness);
    middle.range = {thinnest, thickest};
  } else {
    middle.error = half_wall_error(found.shell, *surfaces.face, *settings.thickness);
    middle.range.fill(*settings.thickness);
  }
  middle.face = settings.face;
  found.middle = std::move(middle);
}

RelaxSurfaces read_relaxed(const RelaxFiles& files, const RelaxSettings& settings, const Context& context) {
  const auto stage = context.stage("read");
  ReadSurface start = read_oriented(files.coarse, files.unit_mm, context);
  const bool same = files.coarse == files.target;
  if (same) {
    context.reads(files.target);
  }
  ReadSurface surface = same ? start : read_oriented(files.target, files.unit_mm, context);
  require_same_scale(start.file, files.coarse, surface.file, files.target, files.unit_mm);
  require_near(start.file, files.coarse, surface.file, files.target);
  RelaxSurfaces read;
  read.coarse_name = files.coarse.string();
  read.target_name = files.target.string();
  read.ply.comments = voxel_comments(voxel_comments(surface.file).empty() ? start.file : surface.file);
  if (settings.face) {
    read.ply.comments.emplace_back(middle_of_wall);
  }
  read.ply.comments.push_back("made by " + context.made_by());
  read.ply.space = common_space(start.file, files.coarse, surface.file, files.target);
  read.ply.overwrite = context.overwrite;
  if (settings.face) {
    require_that_face(*settings.face, surface.file, files.target);
  }
  if (files.other_face) {
    ReadSurface other = read_oriented(*files.other_face, files.unit_mm, context);
    require_same_scale(surface.file, files.target, other.file, *files.other_face, files.unit_mm);
    require_near(surface.file, files.target, other.file, *files.other_face);
    common_space(surface.file, files.target, other.file, *files.other_face);
    read.other = std::make_unique<Target>(std::move(other.file.mesh));
    read.other_name = files.other_face->string();
  }
  context.has_read();
  read.coarse = std::move(start.file.mesh);
  const bool looks_for_middle = settings.face && !read.other;
  std::unique_ptr<Target>& face = looks_for_middle ? read.face : read.target;
  face = std::make_unique<Target>(std::move(surface.file.mesh));
  if (surface.with_spikes && !looks_for_middle) {
    read.with_spikes = std::make_unique<Target>(*std::move(surface.with_spikes));
    read.moved = surface.moved;
  }
  if (start.facts.boundary_loops != surface.facts.boundary_loops) {
    surface.facts.boundary_loops -= face->point_loops();  // decimation closes them
  }
  warn_of_mismatch(start.facts, surface.facts, context);
  if (faces_other_way(read.coarse, *face)) {
    read.coarse = turned_around(std::move(read.coarse));
    context.warn({Weight::minor, "faces the other way",
                  fmt::format("{}: faces the other way than {}: its triangles are turned around to agree",
                              read.coarse_name, read.target_name)});
  }
  if (!settings.by_barycentre && settings.tolerance && !settings.refine && !same) {
    context.note(
        "COARSE's triangles are not kept: the fewest shells for the tolerance are looked for (--refine keeps them)");
  }
  return read;
}

void write_partial(const fs::path& out, const ShellMesh& shell, PlyOptions ply) {
  ply.partial = true;
  ply.overwrite = true;
  write_ply(out, shell, ply);
}

void require_what_was_asked(const fs::path& out, const RelaxSurfaces& surfaces, const Relaxation& found,
                            const RelaxSettings& settings) {
  if (const auto lack = what_lacks(out.string(), surfaces, found, settings)) {
    write_partial(out, found.relaxed.shell, surfaces.ply);
    throw RequirementError(*lack);
  }
  require_fit(found.relaxed.shell, out.string());
}

void write_relaxation(const RelaxFiles& files, const RelaxSurfaces& surfaces, const Relaxation& found,
                      const Context& context) {
  constexpr std::size_t map_triangles = 200'000;
  FilesTogether written;
  write_ply(files.out, found.shell, found.thickness, surfaces.ply);
  written.add(files.out);
  if (files.maps.curved) {
    write_curved(*files.maps.curved, found.shell, found.diagonal, surfaces.ply);
    written.add(*files.maps.curved);
  }
  if (files.maps.map || files.maps.picture) {
    PictureOptions look;
    look.title = "Distance of the curved shells to the surface they stand for";
    look.caption =
        fmt::format("{} shells; two-sided distance at most {:.3g} mm ({:.3g} % of the diagonal), mean {:.3g} mm",
                    found.relaxed.shell.triangles.size(), rounded_upwards(found.distance.both.upper, 3),
                    rounded_upwards(100 * found.distance.both.upper / found.diagonal, 3), found.distance.mean);
    look.diagonal = found.diagonal;
    write_map(files.maps, map_of_shells(found.relaxed.shell, surfaces.whole().tree(), map_triangles), look,
              surfaces.ply, context, written);
  }
  written.keep();
}

}  // namespace tunica::chain
