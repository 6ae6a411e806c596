#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/patch_edges.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/subdivide.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fs = std::filesystem;
using namespace tunica;

namespace {

constexpr double default_width = 1e-4;    // of the diagonal: width of the interval
constexpr double narrowest_width = 1e-6;  // of the diagonal: where deciding --max ends
constexpr double curved_deviation =
    0.8e-5;  // of the diagonal; the contract of --curved, 1e-5, may be taken of either surface
constexpr double map_edge = 1.0 / 200;  // of the diagonal: longest edge of the triangles of a map
constexpr std::size_t map_triangles = 400'000;

struct Arguments {
  fs::path a, b;
  bool shell = false;
  std::optional<LengthTolerance> width, max, picture_range;
  std::optional<fs::path> map, picture, curved;
  std::optional<std::string> mesh_unit;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  app.add_option("A", given.a, "a surface, or with --shell a shell mesh")->required();
  app.add_option("B", given.b, "the surface it is compared with; percentages are of its diagonal")->required();
  tool.group("Input");
  app.add_flag("--shell", given.shell, "A is curved shells: positions and unit normals");
  tool.group("Distance");
  tool.tolerance("--tolerance", given.width, "width of the certified intervals (default: 0.01%)");
  tool.tolerance("--max", given.max, "exit code 4 unless the distance is certainly at most this");
  tool.group("Output");
  app.add_option("--map", given.map, "error map: A with its distance to B as 'quality', mm, PLY")->type_name("OUT.ply");
  app.add_option("--picture", given.picture, "picture of the error map")->type_name("OUT.png");
  tool.tolerance("--picture-range", given.picture_range,
                 "where the picture's colours end, so that pictures can be compared (default: the largest distance)");
  app.add_option("--curved", given.curved, "the curved surface of A as a fine triangle mesh (needs --shell)")
      ->type_name("OUT.ply");
  tool.group("Input");
  app.add_option("--mesh-unit", given.mesh_unit, "unit of mesh files that do not state one: mm, cm, m or um")
      ->type_name("mm|cm|m|um");
}

// A as it was read: flat triangles, and the shells when it is curved.
struct Surface {
  TriangleMesh flat;
  std::optional<ShellMesh> shell;
  std::string space;
};

Surface surface_of(MeshFile file, const Arguments& given) {
  Surface a;
  if (given.shell) {
    a.shell = shell_of(file, given.a);
    require_fit(*a.shell, given.a.string());
  }
  a.flat = std::move(file.mesh);
  return a;
}

// B, with what is asked of it.
struct Other {
  explicit Other(TriangleMesh mesh, bool for_shells) {
    if (for_shells) {
      target.emplace(std::move(mesh));
    } else {
      flat.emplace(mesh);
    }
  }
  [[nodiscard]] const ClosestPoint& tree() const { return target ? target->tree() : *flat; }

  std::optional<Target> target;
  std::optional<ClosestPoint> flat;
};

HausdorffResult measure(const Surface& a, const Other& b, double width, const std::optional<double>& limit,
                        const Progress& progress) {
  if (!a.shell) {
    HausdorffOptions options;
    options.width = width;
    options.limit = limit;
    options.progress = progress;
    return hausdorff(ClosestPoint(a.flat), b.tree(), options);
  }
  ShellDistanceOptions options;
  options.width = width;
  options.limit = limit;
  options.with_mean = true;
  options.progress = progress;
  const ShellDistance found = shell_distance(*a.shell, *b.target, options);
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
HausdorffResult measure_and_decide(const Surface& a, const Other& b, double width, const std::optional<double>& limit,
                                   double narrowest, const Progress& progress) {
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

// A in triangles small enough to be coloured, and the edges of its facets or shells.
struct Map {
  TriangleMesh mesh;
  std::vector<double> distances;
  std::vector<std::array<Vec3, 2>> edges;
};

Map make_map(const Surface& a, const ClosestPoint& b, double diagonal_mm) {
  Map map;
  const std::size_t facets = a.flat.triangles.size();
  if (a.shell) {
    const double per_shell = real(map_triangles) / real(facets);
    const int level = std::clamp(truncated<int>(std::sqrt(per_shell)), 4, 24);
    const Tessellation fine = tessellate_uniformly(*a.shell, level);
    for (const auto& [from, to] : patch_edges(fine)) {
      map.edges.push_back({fine.mesh.vertices[from], fine.mesh.vertices[to]});
    }
    map.mesh = fine.mesh;
  } else {
    map.mesh = subdivided(a.flat, map_edge * diagonal_mm, map_triangles);
    for (std::size_t t = 0; t < facets && facets <= 20'000; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        map.edges.push_back(
            {a.flat.vertices[a.flat.triangles[t][k]], a.flat.vertices[a.flat.triangles[t][(k + 1) % 3]]});
      }
    }
  }
  map.distances = vertex_distances(map.mesh, b);
  return map;
}

void write_files(const cli::Tool& tool, const Arguments& given, const Surface& a, const Other& b,
                 const HausdorffResult& distance, double diagonal_mm, std::vector<fs::path>& written) {
  PlyOptions options;
  options.comments = {"made by " + tool.made_by()};
  options.space = a.space;
  options.overwrite = tool.force();
  if (given.curved) {
    write_surface(*given.curved, tessellate(*a.shell, curved_deviation * diagonal_mm).mesh, options);
    written.push_back(*given.curved);
  }
  if (!given.map && !given.picture) {
    return;
  }
  const Map map = make_map(a, b.tree(), diagonal_mm);
  if (given.map) {
    write_ply(*given.map, map.mesh, map.distances, options);
    written.push_back(*given.map);
  }
  if (given.picture) {
    PictureOptions look;
    look.title = a.shell ? "Distance of curved shells to a surface" : "Distance of a surface to another one";
    look.caption = fmt::format("{} against {}: two-sided distance at most {:.3g} mm ({:.3g} % of the diagonal)",
                               tool.provenance().name_of(given.a), tool.provenance().name_of(given.b),
                               rounded_upwards(distance.both.upper, 3),
                               rounded_upwards(100 * distance.both.upper / diagonal_mm, 3));
    look.quantity = "Distance";
    look.diagonal = diagonal_mm;
    if (given.picture_range) {
      look.maximum = given.picture_range->millimetres(diagonal_mm);
    }
    look.lines = map.edges;
    write_file(*given.picture, png_made_by(surface_picture(map.mesh, map.distances, look), tool.made_by()),
               tool.force());
  }
}

// All of the files, or none: a run that fails leaves nothing behind that looks finished.
void write_outputs(const cli::Tool& tool, const Arguments& given, const Surface& a, const Other& b,
                   const HausdorffResult& distance, double diagonal_mm) {
  std::vector<fs::path> written;
  try {
    write_files(tool, given, a, b, distance, diagonal_mm, written);
  } catch (...) {
    for (const fs::path& path : written) {
      std::error_code ignored;
      fs::remove(path, ignored);
    }
    throw;
  }
}

Json interval(const Interval& mm, double scale) { return {{"lower", mm.lower * scale}, {"upper", mm.upper * scale}}; }

void tell(cli::Tool& tool, const Surface& a, const Other& b, const HausdorffResult& distance, double diagonal_mm,
          double width) {
  const double percent = 100 / diagonal_mm;
  tool.result() = {
      {"hausdorff_mm", interval(distance.both, 1)},
      {"hausdorff_percent", interval(distance.both, percent)},
      {"one_sided_percent",
       {{"a_to_b", interval(distance.a_to_b, percent)}, {"b_to_a", interval(distance.b_to_a, percent)}}},
      {"mean_percent", distance.mean * percent},
      {"rms_percent", distance.rms * percent},
      {"diagonal_mm", diagonal_mm},
      {"triangles_a", a.flat.triangles.size()},
      {"triangles_b", b.tree().triangles().size()},
      {"farthest_mm",
       {{"a", {distance.worst_a.x(), distance.worst_a.y(), distance.worst_a.z()}},
        {"b", {distance.worst_b.x(), distance.worst_b.y(), distance.worst_b.z()}}}},
  };
  if (a.shell) {
    const auto boundary = boundary_distance(boundary_curves(*a.shell), *b.target, width);
    tool.result()["boundary_percent"] = boundary ? interval(boundary->both, percent) : Json();
  }
  const std::string means = std::isfinite(distance.mean) ? fmt::format(", mean {:.4f} %, rms {:.4f} %",
                                                                       percent * distance.mean, percent * distance.rms)
                                                         : ", no mean over a surface without area";
  tool.note(fmt::format("distance {:.6g} to {:.6g} mm ({:.4g} to {:.4g} %){}", distance.both.lower,
                        rounded_upwards(distance.both.upper, 6), percent * distance.both.lower,
                        rounded_upwards(percent * distance.both.upper, 4), means));
  if (distance.both.upper - distance.both.lower > 1.01 * width) {
    tool.warn(
        {Weight::minor, "wide interval",
         fmt::format("the distance is known to {:.3g} mm, and {:.3g} mm were asked for: rounding, or the bound of "
                     "the work, allows no less; both ends of the interval hold",
                     distance.both.upper - distance.both.lower, width)});
  }
}

// What the files hold beside what is compared: curved shells that are read as flat triangles, open seams.
void warn_of_surfaces(const cli::Tool& tool, const Arguments& given, const MeshFile& file_a, const MeshFile& file_b) {
  const auto is_shell = [](const MeshFile& file) { return file.patch && !file.normals.empty(); };
  if (!given.shell && is_shell(file_a)) {
    tool.warn({Weight::minor, "shell read flat",
               fmt::format("{}: is a shell mesh, and only its flat facets are compared, whose distance is many times "
                           "that of the curved shells: pass --shell to compare these",
                           given.a.string())});
  }
  if (is_shell(file_b)) {
    tool.warn(
        {Weight::minor, "shell read flat",
         fmt::format("{}: is a shell mesh, and only its flat facets are compared: name it first, with --shell, to "
                     "compare its curved shells",
                     given.b.string())});
  }
  for (const auto& [file, path] : {std::pair(&file_a, &given.a), std::pair(&file_b, &given.b)}) {
    for (const Warning& warning : seam_warnings(file->mesh, examine(file->mesh), *path, Weight::minor)) {
      tool.warn(warning);
    }
  }
}

void run(cli::Tool& tool, const Arguments& given) {
  if (given.curved && !given.shell) {
    throw UsageError("--curved writes the curved surface of shells: it needs --shell");
  }
  if (given.picture_range && !given.picture) {
    throw UsageError("--picture-range belongs to --picture: give both");
  }
  std::optional<double> unit_mm;
  if (given.mesh_unit) {
    unit_mm = parse_length_unit(*given.mesh_unit);
  }
  for (const auto& [path, endings] : {std::pair(given.map, std::vector<std::string>{".ply"}),
                                      {given.picture, {".png"}},
                                      {given.curved, surface_endings()}}) {
    if (path) {
      tool.output(*path, endings);
    }
  }

  Surface a;
  TriangleMesh target;
  {
    const auto stage = tool.stage("read");
    tool.input(given.a);
    tool.input(given.b);
    const auto in_millimetres = [](const auto& length) { return length && !length->relative; };
    const bool require_unit =
        given.map || in_millimetres(given.max) || in_millimetres(given.width) || in_millimetres(given.picture_range);
    MeshFile file_a = read_mesh(given.a, unit_mm, require_unit);
    MeshFile file_b = read_mesh(given.b, unit_mm, require_unit);
    for (const auto& note : {unit_note(file_a, given.a), unit_note(file_b, given.b)}) {
      if (note) {
        tool.warn(*note);
      }
    }
    const std::string space = common_space(file_a, given.a, file_b, given.b);
    require_same_scale(file_a, given.a, file_b, given.b, unit_mm);
    warn_of_surfaces(tool, given, file_a, file_b);
    a = surface_of(std::move(file_a), given);
    a.space = space;
    target = std::move(file_b.mesh);
    tool.require_unchanged_inputs();
  }
  const double diagonal_mm = diagonal(target);
  if (!(diagonal_mm > 0)) {
    throw InputError(
        fmt::format("{}: all its vertices lie in one point: it has no diagonal to refer to", given.b.string()));
  }
  const double width = given.width ? given.width->millimetres(diagonal_mm) : default_width * diagonal_mm;
  std::optional<double> limit;
  if (given.max) {
    limit = given.max->millimetres(diagonal_mm);
  }

  const auto stage = tool.stage("compare");
  const Other b(std::move(target), given.shell);
  const HausdorffResult distance =
      measure_and_decide(a, b, width, limit, std::min(width, narrowest_width * diagonal_mm), tool.progress("compare"));
  tell(tool, a, b, distance, diagonal_mm, width);
  write_outputs(tool, given, a, b, distance, diagonal_mm);
  if (limit && distance.both.upper > *limit) {
    const bool certain = distance.both.lower > *limit;
    const double mm = certain ? distance.both.lower : distance.both.upper, percent = 100 / diagonal_mm;
    throw RequirementError(fmt::format(
        "{}: its distance to {} is {} {:.6g} mm ({:.4f} %), not at most {:.6g} mm ({:.4f} %) as --max demands",
        given.a.string(), given.b.string(), certain ? "at least" : "not certainly below", mm, percent * mm, *limit,
        percent * *limit));
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool(
      "compare",
      "Two-sided Hausdorff distance of two surfaces, flat or curved, as an interval that certainly holds the "
      "true value.",
      "tunica-compare coarse.ply surface.ply --max 1%\n"
      "  tunica-compare shell.ply surface.ply --shell --picture compare.png --report compare.json");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "compare"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
