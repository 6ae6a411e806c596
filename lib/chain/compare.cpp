#include "tunica/chain/compare.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica::chain {
namespace {

constexpr double usual_width = 1e-4;      // of the diagonal
constexpr double narrowest_width = 1e-6;  // of the diagonal: where deciding what may be ends

HausdorffResult measure(const ComparedSurface& a, const ReferenceSurface& b, double width,
                        const std::optional<double>& limit, const Progress& progress) {
  if (!a.shell) {
    HausdorffOptions options;
    options.width = width;
    options.limit = limit;
    options.progress = progress;
    return hausdorff(ClosestPoint(a.flat), b.tree(), options);
  }
  const ShellDistance found =
      shell_distance(*a.shell, *b.target, {.width = width, .with_mean = true, .limit = limit, .progress = progress});
  HausdorffResult result{found.both, found.shell_to_target, found.target_to_shell, found.mean, found.rms};
  if (found.shell_to_target.lower >= found.target_to_shell.lower) {
    result.worst_a = found.farthest_of_shell;
    result.worst_b = b.tree().closest(result.worst_a).point;
  } else {
    result.worst_b = found.farthest_of_target;
    result.worst_a = found.closest_to_farthest_of_target;
  }
  return result;
}

// The interval, narrowed as far as it takes to decide whether the distance is at most `limit`.
HausdorffResult measure_and_decide(const ComparedSurface& a, const ReferenceSurface& b, double width,
                                   const std::optional<double>& limit, const Progress& progress) {
  const double narrowest = std::min(width, narrowest_width * b.diagonal);
  HausdorffResult result = measure(a, b, width, {}, progress);
  while (limit && result.both.lower <= *limit && result.both.upper > *limit && width > narrowest) {
    width = std::max(narrowest, width / 8);
    const HausdorffResult finer = measure(a, b, width, limit, progress);
    const auto narrowed = [](const Interval& x, const Interval& y) {
      return Interval{std::max(x.lower, y.lower), std::min(x.upper, y.upper)};
    };
    result.both = narrowed(result.both, finer.both);
    result.a_to_b = narrowed(result.a_to_b, finer.a_to_b);
    result.b_to_a = narrowed(result.b_to_a, finer.b_to_a);
  }
  return result;
}

void tell(const Comparison& found, const Context& context) {
  const HausdorffResult& distance = found.distance;
  const double percent = 100 / found.diagonal;
  const std::string means = std::isfinite(distance.mean) ? fmt::format(", mean {:.4f} %, rms {:.4f} %",
                                                                       percent * distance.mean, percent * distance.rms)
                                                         : ", no mean over a surface without area";
  context.note(fmt::format("distance {:.6g} to {:.6g} mm ({:.4g} to {:.4g} %){}", distance.both.lower,
                           rounded_upwards(distance.both.upper, 6), percent * distance.both.lower,
                           rounded_upwards(percent * distance.both.upper, 4), means));
  if (distance.both.upper - distance.both.lower > 1.01 * found.width) {
    context.warn(
        {Weight::minor, "wide interval",
         fmt::format("the distance is known to {:.3g} mm, and {:.3g} mm were asked for: rounding, or the bound of "
                     "the work, allows no less; both ends of the interval hold",
                     distance.both.upper - distance.both.lower, found.width)});
  }
}

// What the files hold beside what is compared: curved shells that are read as flat triangles, open seams.
void warn_of_surfaces(const CompareFiles& files, const MeshFile& file_a, const MeshFile& file_b,
                      const Context& context) {
  const auto is_shell = [](const MeshFile& file) { return file.patch && !file.normals.empty(); };
  if (!files.shell && is_shell(file_a)) {
    context.warn(
        {Weight::minor, "shell read flat",
         fmt::format("{}: is a shell mesh, and only its flat facets are compared, whose distance is many times "
                     "that of the curved shells: pass --shell to compare these",
                     files.a.string())});
  }
  if (is_shell(file_b)) {
    context.warn(
        {Weight::minor, "shell read flat",
         fmt::format("{}: is a shell mesh, and only its flat facets are compared: name it first, with --shell, to "
                     "compare its curved shells",
                     files.b.string())});
  }
  for (const auto& [file, path] : {std::pair(&file_a, &files.a), std::pair(&file_b, &files.b)}) {
    std::ranges::for_each(seam_warnings(file->mesh, examine(file->mesh), *path, Weight::minor), context.warn);
  }
}

}  // namespace

ReferenceSurface::ReferenceSurface(TriangleMesh mesh, bool for_shells, std::string called)
    : name(std::move(called)), diagonal(tunica::diagonal(mesh)) {
  if (!(diagonal > 0)) {
    throw InputError(fmt::format("{}: all its vertices lie in one point: it has no diagonal to refer to", name));
  }
  if (for_shells) {
    target.emplace(std::move(mesh));
  } else {
    flat.emplace(mesh);
  }
}

Comparison compare(const ComparedSurface& a, const ReferenceSurface& b, const CompareSettings& settings,
                   const Context& context) {
  Comparison found;
  found.of_shells = a.shell.has_value();
  found.diagonal = b.diagonal;
  found.width = settings.width.value_or(LengthTolerance{usual_width, true}).millimetres(b.diagonal);
  found.triangles_a = a.flat.triangles.size();
  found.triangles_b = b.tree().triangles().size();
  std::optional<double> limit;
  if (settings.most) {
    limit = settings.most->millimetres(b.diagonal);
  }
  found.distance = measure_and_decide(a, b, found.width, limit, context.progress("compare"));
  if (a.shell) {
    if (const auto boundary = boundary_distance(boundary_curves(*a.shell), *b.target, found.width)) {
      found.boundary = boundary->both;
    }
  }
  tell(found, context);
  if (const Interval& both = found.distance.both; limit && both.upper > *limit) {
    const bool certain = both.lower > *limit;
    const double mm = certain ? both.lower : both.upper, percent = 100 / b.diagonal;
    found.unmet = fmt::format(
        "{}: its distance to {} is {} {:.6g} mm ({:.4f} %), not at most {:.6g} mm ({:.4f} %) as --max demands", a.name,
        b.name, certain ? "at least" : "not certainly below", mm, percent * mm, *limit, percent * *limit);
  }
  return found;
}

ComparedFiles read_compared(const CompareFiles& files, const CompareSettings& settings, const Context& context) {
  context.reads(files.a);
  context.reads(files.b);
  const auto in_millimetres = [](const auto& length) { return length && !length->relative; };
  const bool require_unit = files.out.map || in_millimetres(settings.most) || in_millimetres(settings.width) ||
                            in_millimetres(files.out.picture_range);
  MeshFile file_a = read_mesh(files.a, files.unit_mm, require_unit);
  MeshFile file_b = read_mesh(files.b, files.unit_mm, require_unit);
  for (const auto& note : {unit_note(file_a, files.a, files.unit_mm), unit_note(file_b, files.b, files.unit_mm)}) {
    if (note) {
      context.warn(*note);
    }
  }
  ComparedFiles read;
  read.space = common_space(file_a, files.a, file_b, files.b);
  require_same_scale(file_a, files.a, file_b, files.b, files.unit_mm);
  warn_of_surfaces(files, file_a, file_b, context);
  read.a.name = files.a.string();
  if (files.shell) {
    read.a.shell = shell_of(file_a, files.a);
    require_fit(*read.a.shell, read.a.name);
  }
  read.a.flat = std::move(file_a.mesh);
  read.b = std::move(file_b.mesh);
  context.has_read();
  return read;
}

void write_comparison(const CompareFiles& files, const ComparedSurface& a, const std::string& space,
                      const ReferenceSurface& b, const Comparison& found, const Context& context) {
  constexpr std::size_t map_triangles = 400'000;
  PlyOptions ply;
  ply.comments = {"made by " + context.made_by()};
  ply.space = space;
  ply.overwrite = context.overwrite;
  FilesTogether written;
  if (files.out.curved) {
    write_curved(*files.out.curved, *a.shell, found.diagonal, ply);
    written.add(*files.out.curved);
  }
  if (files.out.map || files.out.picture) {
    const double upper = found.distance.both.upper;
    PictureOptions look;
    look.title = a.shell ? "Distance of curved shells to a surface" : "Distance of a surface to another one";
    look.caption = fmt::format("{} against {}: two-sided distance at most {:.3g} mm ({:.3g} % of the diagonal)",
                               context.name_of(files.a), context.name_of(files.b), rounded_upwards(upper, 3),
                               rounded_upwards(100 * upper / found.diagonal, 3));
    look.quantity = "Distance";
    look.diagonal = found.diagonal;
    const ErrorMap map = a.shell ? map_of_shells(*a.shell, b.tree(), map_triangles)
                                 : map_of_facets(a.flat, b.tree(), map_triangles, found.diagonal);
    write_map(files.out, map, look, ply, context, written);
  }
  written.keep();
}

}  // namespace tunica::chain
