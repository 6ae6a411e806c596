// tunica-relax COARSE TARGET OUT.ply: a coarse mesh becomes curved shells on its target, with a certified distance.
#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/fit/fit.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/io/mesh/voxel_comments.hpp"
#include "tunica/shell/distance/mean_bound.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/shell/distance/shell_quality.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/patch_edges.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/wall/mid_surface.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace fs = std::filesystem;
using namespace tunica;

namespace {

constexpr double interval_width = 1e-4;  // of the diagonal: what the report certifies
constexpr double curved_deviation =
    0.8e-5;  // of the diagonal; the contract of --curved, 1e-5, may be taken of either surface
constexpr double most_for_spikes = 0.9;             // of the tolerance
constexpr double usual_angle = 20;                  // degrees
constexpr double rounded_up = 0.9975;               // of it: what prints as less
constexpr double least_angle = 1, most_angle = 30;  // degrees
constexpr double farthest_by_mean = 8;  // what a largest distance is tried first for a mean; then half of it, and so on
constexpr double mean_slack = 0.2;      // of the mean asked for: about how far above it its bound may lie
constexpr std::size_t map_triangles = 200'000;

struct Arguments {
  fs::path coarse, target, out;
  std::optional<fs::path> map, picture, curved;
  std::optional<std::string> tolerance_text;
  std::optional<LengthTolerance> tolerance, picture_range;
  std::optional<double> thickness, mean;  ///< mm; of the distance, where it is asked for as a part of the wall
  std::optional<std::string> mid_surface;
  std::optional<fs::path> other_face;
  std::string method = "fit";
  std::optional<std::string> surface;
  std::optional<std::string> mesh_unit;
  bool refine = false;
  std::optional<std::size_t> shells, max_shells;
  std::optional<std::string> min_angle;
  std::optional<int> max_iterations;
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& app = tool.arguments();
  app.add_option("COARSE", given.coarse, "coarse mesh, e.g. from tunica-decimate")->required();
  app.add_option("TARGET", given.target, "surface that the shells are to become")->required();
  app.add_option("OUT.ply", given.out, "shell mesh: positions and unit normals")->required();
  tool.group("How close, with how many");
  app.add_option(
         "--tolerance", given.tolerance_text,
         "stop when the two-sided distance is certainly below it, e.g. 0.5% of the target's diagonal or 0.2mm, or "
         "when its mean is certainly below a part of the wall, e.g. 5%t; exit code 4 when it cannot be reached")
      ->type_name("TOLERANCE");
  tool.quantity("--thickness", given.thickness, dimension::length,
                "of the wall, for a --tolerance such as 5%t, and for --mid-surface");
  tool.group("Wall");
  app.add_option("--mid-surface", given.mid_surface,
                 "TARGET is the outer or the inner face of the wall: the shells are fitted to its middle, half of the "
                 "--thickness away, or lie half way to --other-face")
      ->check(CLI::IsMember({"inner", "outer"}));
  app.add_option("--other-face", given.other_face,
                 "the wall's other face: the thickness is measured, and written as the vertices' property thickness")
      ->type_name("SURFACE");
  tool.group("Method");
  app.add_option(
         "--method", given.method,
         "fit (least error: positions, normals and connectivity are chosen together; the default) or barycentre (the "
         "paper's rule: keeps COARSE's triangles)")
      ->check(CLI::IsMember({"barycentre", "fit"}));
  app.add_option("--surface", given.surface,
                 "the patch: watertight (the default: cubics that meet exactly) or comas (the paper's 9-term cubic)")
      ->check(CLI::IsMember({"comas", "watertight"}));
  tool.group("How close, with how many");
  app.add_flag("--refine", given.refine,
               "keep COARSE's triangles and split them where the distance is above the tolerance; without a "
               "tolerance split every shell in four and refit, once or as --max-shells or --max-iterations say; "
               "without --refine, fit looks for the fewest shells, whatever COARSE has");
  app.add_option("--shells", given.shells,
                 "fit: at most N shells instead of as many as COARSE has (with --tolerance: as few as it takes)")
      ->check(cli::whole_number(1))
      ->type_name("N");
  app.add_option("--max-shells", given.max_shells, "at most N shells")->check(cli::whole_number(1))->type_name("N");
  app.add_option(
         "--min-angle", given.min_angle,
         "fit: degrees that the angles of the shells keep where the target's boundaries and creases allow it (default "
         "20, from 1 to 30)")
      ->type_name("DEG");
  app.add_option(
         "--max-iterations", given.max_iterations,
         "at most N iterations (barycentre: 20, with --refine 60), rounds of the search (fit: 12) or levels (fit with "
         "--refine and no tolerance: 2, the first is COARSE's own)")
      ->check(cli::whole_number(1, 100000))
      ->type_name("N");
  tool.group("Output");
  app.add_option("--map", given.map, "error map: the curved surface with its distance to the target, PLY")
      ->type_name("OUT.ply");
  app.add_option("--picture", given.picture, "picture of the error map, PNG")->type_name("OUT.png");
  tool.tolerance("--picture-range", given.picture_range,
                 "where the picture's colours end, so that pictures can be compared (default: the largest distance)");
  app.add_option("--curved", given.curved, "the curved surface as a fine triangle mesh: .ply, .glb, .obj, .stl or .3mf")
      ->type_name("OUT.ply");
  tool.group("Input");
  app.add_option("--mesh-unit", given.mesh_unit, "unit of mesh files that do not state one: mm, cm, m or um")
      ->type_name("mm|cm|m|um");
}

/// The error of a load's answer goes with the mean distance over the thickness of the wall.
void understand_tolerance(Arguments& given) {
  std::string_view text = given.tolerance_text ? std::string_view(*given.tolerance_text) : std::string_view();
  const bool of_wall = text.ends_with('t');
  if (given.thickness && !of_wall && !given.mid_surface) {
    throw UsageError("--thickness belongs to a --tolerance in parts of the wall, for example 5%t, or to --mid-surface");
  }
  if (given.thickness && !(*given.thickness > 0)) {
    throw UsageError("--thickness must be greater than zero");
  }
  if (!given.tolerance_text) {
    return;
  }
  try {
    if (!of_wall) {
      given.tolerance = parse_length_tolerance(text);
      return;
    }
    text.remove_suffix(1);
    const double part = parse_percent(text);
    if (!given.thickness) {
      throw UsageError("it is a part of the wall: give --thickness too, for example --thickness 1.5mm");
    }
    if (!(part > 0)) {
      throw UsageError("must be greater than zero");
    }
    given.mean = part * *given.thickness;
    given.tolerance = LengthTolerance{farthest_by_mean * *given.mean, false};
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--tolerance: {}", error.what()));
  }
}

void refuse_contradictions(const Arguments& given) {
  if (given.other_face && !given.mid_surface) {
    throw UsageError("--other-face belongs to --mid-surface: say which face TARGET is");
  }
  if (given.mid_surface && !given.other_face && !given.thickness) {
    throw UsageError("--mid-surface needs the wall's thickness: give --thickness, for example 1.5mm, or --other-face");
  }
  const bool fit = given.method == "fit";
  if (given.shells && !fit) {
    throw UsageError(
        "--shells belongs to --method fit; barycentre has as many shells as COARSE, or with --refine more");
  }
  if (given.shells && given.max_shells) {
    throw UsageError("--shells and --max-shells say the same to --method fit; give one of them");
  }
  if (given.max_shells && !given.refine && !(fit && given.tolerance)) {
    throw UsageError("--max-shells limits --refine, or a fit to a --tolerance; else the number of shells is given");
  }
  if (given.picture_range && !given.picture) {
    throw UsageError("--picture-range belongs to --picture: give both");
  }
  if (given.min_angle && !fit) {
    throw UsageError("--min-angle belongs to --method fit");
  }
  if (given.refine && !fit && !given.tolerance && !given.max_shells && !given.max_iterations) {
    throw UsageError(
        "--method barycentre --refine needs to know where to end: --tolerance, --max-shells or --max-iterations");
  }
}

/// What an option says, degrees.
std::optional<double> degrees(const std::string& option, const std::optional<std::string>& said, double least,
                              double most) {
  if (!said) {
    return {};
  }
  const auto number = parse_number(*said);
  if (!number || !(*number >= least) || *number > most) {
    throw UsageError(
        fmt::format("{}: '{}' is not a number of degrees from {:.0f} to {:.0f}", option, *said, least, most));
  }
  return number;
}

struct Surface {
  MeshFile file;
  MeshFacts facts;
  std::optional<TriangleMesh> with_spikes;  ///< as it was given, where triangles without area were taken away
  double moved = 0;                         ///< mm, by that
};

// Shells have area: what hangs on a surface without any can only be taken away. Caps within it would be creases.
void take_spikes(const cli::Tool& tool, const fs::path& path, Surface& surface) {
  TriangleMesh& mesh = surface.file.mesh;
  if (count_degenerate(mesh) == 0) {
    return;
  }
  WithoutDegenerate cleaned = without_degenerate_triangles(mesh);
  if (cleaned.longest_spike > 0) {
    tool.warn({Weight::minor, "spikes",
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
void turn_outward(const cli::Tool& tool, const fs::path& path, TriangleMesh& mesh) {
  const Facing facing = facing_of(mesh);
  if (facing.inward == 0) {
    return;
  }
  mesh = turned_outward(std::move(mesh), facing);
  if (facing.outermost_inward == 0) {
    tool.warn(
        {Weight::minor, "faces inward",
         fmt::format("{}: {} of its {} pieces lie within others: they are taken for the walls of hollows, and are "
                     "turned around to face into them; a surface of its own is to be a mesh of its own",
                     path.string(), facing.inward, facing.pieces)});
  } else {
    tool.warn(
        {Weight::minor, "faces inward",
         fmt::format("{}: {}: they are turned around, so that a positive pressure pushes outward; give a negative "
                     "one to push inward",
                     path.string(), facing_phrase(facing))});
  }
}

Surface read_surface(const cli::Tool& tool, const fs::path& path, const std::optional<double>& unit_mm) {
  Surface surface{read_mesh(path, unit_mm, true), {}, {}, 0};
  if (const auto note = unit_note(surface.file, path)) {
    tool.warn(*note);
  }
  surface.facts = require_surface(surface.file, path);
  for (const Warning& warning : seam_warnings(surface.file.mesh, surface.facts, path, Weight::major)) {
    tool.warn(warning);
  }
  turn_outward(tool, path, surface.file.mesh);
  take_spikes(tool, path, surface);
  return surface;
}

void warn_of_mismatch(const cli::Tool& tool, const MeshFacts& a, const MeshFacts& b) {
  const auto differ = [&](std::size_t of_coarse, std::size_t of_target, const std::string& what) {
    if (of_coarse != of_target) {
      tool.warn(
          {Weight::major, "another topology",
           fmt::format("COARSE has {} {}, TARGET has {}: what COARSE lacks stays uncovered, and the distance shows "
                       "it; make COARSE of this TARGET by tunica-decimate",
                       of_coarse, what, of_target)});
    }
  };
  differ(a.components, b.components, "component(s)");
  differ(a.boundary_loops, b.boundary_loops, "boundary loop(s)");
}

Json interval(const Interval& mm, double scale) { return {{"lower", mm.lower * scale}, {"upper", mm.upper * scale}}; }

PlyOptions ply_options(const cli::Tool& tool, const std::string& space) {
  PlyOptions options;
  options.comments = {"made by " + tool.made_by()};
  options.space = space;
  options.overwrite = tool.force();
  return options;
}

/// Distances at the vertices of a surface fine enough to be looked at, with the edges of the shells.
/// @param written  outputs that are finished: what joins them
void write_maps(cli::Tool& tool, const Arguments& given, const ShellMesh& shell, const Target& target,
                const ShellDistance& distance, const PlyOptions& ply, std::vector<fs::path>& written) {
  const double per_shell = real(map_triangles) / real(shell.triangles.size());
  const int level = std::clamp(truncated<int>(std::sqrt(per_shell)), 4, 24);
  const Tessellation fine = tessellate_uniformly(shell, level);
  const auto distances = vertex_distances(fine.mesh, target.tree());
  if (given.map) {
    write_ply(*given.map, fine.mesh, distances, ply);
    written.push_back(*given.map);
  }
  if (given.picture) {
    PictureOptions options;
    options.title = "Distance of the curved shells to the surface they stand for";
    options.caption =
        fmt::format("{} shells; two-sided distance at most {:.3g} mm ({:.3g} % of the diagonal), mean {:.3g} mm",
                    shell.triangles.size(), rounded_upwards(distance.both.upper, 3),
                    rounded_upwards(100 * distance.both.upper / target.diagonal(), 3), distance.mean);
    options.diagonal = target.diagonal();
    if (given.picture_range) {
      options.maximum = given.picture_range->millimetres(target.diagonal());
    }
    for (const auto& [from, to] : patch_edges(fine)) {
      options.lines.push_back({fine.mesh.vertices[from], fine.mesh.vertices[to]});
    }
    write_file(*given.picture, png_made_by(surface_picture(fine.mesh, distances, options), tool.made_by()),
               tool.force());
  }
}

void warn_of_crossings(const cli::Tool& tool, const ShellMesh& shell,
                       const std::vector<std::array<Index, 2>>& crossings) {
  if (crossings.empty()) {
    return;
  }
  const Vec3& place = shell.vertices[shell.triangles[crossings.front()[0]][0]];
  tool.warn({Weight::minor, "shells cross",
             fmt::format("{} pair(s) of curved shells cross, the first near ({:.4g}, {:.4g}, {:.4g}): the wall passes "
                         "through itself there; more shells part them (of the pipeline SHELLS), or a TARGET that does "
                         "not cross itself",
                         crossings.size(), place.x(), place.y(), place.z())});
}

/// A count that the target itself does not reach.
/// @param coarse  triangles of COARSE
void warn_if_few(const cli::Tool& tool, const Arguments& given, std::size_t coarse, const ShellMesh& made,
                 const Target& target) {
  constexpr double about = 0.95, few = 0.5;
  const std::size_t wanted = given.shells.value_or(coarse);
  const bool is_to_count = given.method == "fit" && !given.tolerance && !given.refine;
  if (is_to_count && real(made.triangles.size()) < about * real(wanted)) {
    tool.warn(
        {real(made.triangles.size()) < few * real(wanted) ? Weight::minor : Weight::note, "fewer than asked for",
         fmt::format("{}: {} shells instead of {}: TARGET has {} triangles, and what they allow is all there is; "
                     "for more, extract TARGET from a finer image, or split these shells by --refine (RELAX=--refine)",
                     given.target.string(), made.triangles.size(), wanted, target.mesh().triangles.size())});
  }
}

std::size_t handles(const MeshFacts& facts) {
  const long without = 2 * narrow<long>(facts.components) - narrow<long>(facts.boundary_loops);
  return narrow<std::size_t>(std::max(0L, without - facts.euler) / 2);
}

void warn_of_middle(const cli::Tool& tool, const HalfWaySurface& middle) {
  if (middle.left_out > 0) {
    tool.warn({Weight::minor, "left out",
               fmt::format("{} piece(s) of the middle of the wall, {:.3g} mm2 together, are left out: half of the wall "
                           "closes a gap of TARGET or parts it there",
                           middle.left_out, middle.left_out_area)});
  }
  if (middle.crossing > 0) {
    tool.warn({Weight::major, "wall crosses itself",
               fmt::format("the middle of the wall crosses itself at {} pair(s) of its triangles: a thinner wall or a "
                           "smoother TARGET parts them",
                           middle.crossing)});
  }
}

/// TARGET may say which face of a wall it is.
void require_that_face(const Arguments& given, const MeshFile& target) {
  for (const std::string face : {"inner", "outer"}) {
    if (given.mid_surface && *given.mid_surface != face &&
        std::ranges::find(target.comments, "face " + face) != target.comments.end()) {
      throw InputError(
          fmt::format("{} is the {} face of a wall, as it says, and --mid-surface (MID_SURFACE) the {}: "
                      "name the same",
                      given.target.string(), face, *given.mid_surface));
    }
  }
}

/// Areas of parallel surfaces are A + M x + 2 pi chi x^2, x from the middle (Steiner; rims that are cut straight).
/// @param face, middle  areas of TARGET and of the middle, mm^2
/// @param euler  chi, of the middle
void warn_of_pressure(const cli::Tool& tool, WallFace which, double face, double middle, long euler, double thickness) {
  constexpr double notable = 1.05;
  const double curved = std::numbers::pi * real(euler) * thickness * thickness;
  const double inner = which == WallFace::inner ? face : 2 * middle - face + curved;
  if (inner > 0 && middle > notable * inner) {
    tool.warn(
        {Weight::minor, "pressure on the middle",
         fmt::format(
             "the middle of the wall has {:.2g} times the area of its inner face, and a pressure on these "
             "shells acts on the middle: stress is larger by as much than by a pressure inside; divide "
             "the pressure (--pressure, --imaged-at; PRESSURE, IMAGED_AT) by {:.4g}, unless it is divided already",
             middle / inner, middle / inner)});
  }
}

/// One run: read, relax, measure, write.
class Run {
public:
  Run(cli::Tool& tool, const Arguments& given) : tool_(tool), given_(given), fits_(given.method == "fit") {}

  void operator()() {
    refuse_contradictions(given_);
    min_angle_ = degrees("--min-angle", given_.min_angle, least_angle, most_angle);
    name_outputs();
    read();
    relax();
    measure();
    write();
  }

private:
  void name_outputs() {
    tool_.output(given_.out, {".ply"});
    for (const auto& [path, endings] : {std::pair(given_.map, std::vector<std::string>{".ply"}),
                                        {given_.picture, {".png"}},
                                        {given_.curved, surface_endings()}}) {
      if (path) {
        tool_.output(*path, endings);
      }
    }
  }

  void read() {
    const auto stage = tool_.stage("read");
    std::optional<double> unit_mm;
    if (given_.mesh_unit) {
      unit_mm = parse_length_unit(*given_.mesh_unit);
    }
    Surface start = read_surface(tool_, tool_.input(given_.coarse), unit_mm);
    tool_.input(given_.target);
    Surface surface = given_.coarse == given_.target ? start : read_surface(tool_, given_.target, unit_mm);
    require_same_scale(start.file, given_.coarse, surface.file, given_.target, unit_mm);
    require_near(start.file, given_.coarse, surface.file, given_.target);
    ply_ = ply_options(tool_, common_space(start.file, given_.coarse, surface.file, given_.target));
    const auto kept = voxel_comments(voxel_comments(surface.file).empty() ? start.file : surface.file);
    ply_.comments.insert(ply_.comments.begin(), kept.begin(), kept.end());
    require_that_face(given_, surface.file);
    if (given_.other_face) {
      tool_.input(*given_.other_face);
      Surface other = read_surface(tool_, *given_.other_face, unit_mm);
      require_same_scale(surface.file, given_.target, other.file, *given_.other_face, unit_mm);
      require_near(surface.file, given_.target, other.file, *given_.other_face);
      common_space(surface.file, given_.target, other.file, *given_.other_face);
      other_.emplace(std::move(other.file.mesh));
    }
    tool_.require_unchanged_inputs();
    coarse_ = std::move(start.file.mesh);
    asked_ = coarse_.triangles.size();
    const bool looks_for_middle = given_.mid_surface && !other_;
    Target& face = (looks_for_middle ? face_ : target_).emplace(std::move(surface.file.mesh));
    if (surface.with_spikes && !looks_for_middle) {
      with_spikes_.emplace(*std::move(surface.with_spikes));
      moved_ = surface.moved;
    }
    if (start.facts.boundary_loops != surface.facts.boundary_loops) {
      surface.facts.boundary_loops -= face.point_loops();  // decimation closes them
    }
    warn_of_mismatch(tool_, start.facts, surface.facts);
    if (faces_other_way(coarse_, face)) {
      coarse_ = turned_around(std::move(coarse_));
      tool_.warn({Weight::minor, "faces the other way",
                  fmt::format("{}: faces the other way than {}: its triangles are turned around to agree",
                              given_.coarse.string(), given_.target.string())});
    }
    if (fits_ && given_.tolerance && !given_.refine && given_.coarse != given_.target) {
      tool_.note(
          "COARSE's triangles are not kept: the fewest shells for the tolerance are looked for (--refine keeps them)");
    }
  }

  /// What distances are to: the target with its spikes.
  [[nodiscard]] const Target& whole() const { return with_spikes_ ? *with_spikes_ : *target_; }
  [[nodiscard]] double percent() const { return 100 / whole().diagonal(); }

  [[nodiscard]] FitOptions options() {
    FitOptions out;
    out.surface = given_.surface == "comas" ? Patch::comas : Patch::watertight;
    out.refine = given_.refine;
    out.shells = given_.shells;
    out.max_shells = given_.max_shells;
    out.max_iterations = given_.max_iterations;
    if (given_.refine && !given_.tolerance && !given_.max_shells && !given_.max_iterations) {
      out.max_iterations = 2;
    }
    out.min_angle = min_angle_.value_or(usual_angle);
    out.width = interval_width * whole().diagonal();
    out.progress = tool_.progress("relax");
    if (given_.tolerance) {
      tolerance_ = given_.tolerance->millimetres(whole().diagonal());
      out.tolerance = moved_ < most_for_spikes * *tolerance_ ? *tolerance_ - moved_ : *tolerance_;
    }
    out.on_iteration = [this](const RelaxIteration& iteration, const ShellMesh& so_far) {
      best_ = so_far;
      tool_.detail(fmt::format(
          "{} shells: {:.4f} to {:.4f} %; nodes by the rule {}, to the closest point {}, on the boundary {}, held back "
          "{}; {:.2f} s",
          iteration.shells, percent() * iteration.hausdorff.lower, percent() * iteration.hausdorff.upper,
          iteration.moves.by_rule, iteration.moves.to_closest_point, iteration.moves.on_boundary,
          iteration.moves.shortened, iteration.seconds));
    };
    return out;
  }

  [[nodiscard]] WallFace which_face() const {
    return given_.mid_surface == "outer" ? WallFace::outer : WallFace::inner;
  }

  /// The surface half of the wall away becomes the target, and COARSE a mesh on it.
  void go_half_way() {
    HalfWaySurface middle = naming(given_.target.string(), [&] {
      return half_way_surface(*face_, which_face(), *given_.thickness, tool_.progress("find the middle of the wall"));
    });
    tool_.detail(
        fmt::format("the middle of the wall: {} triangles by cells of {:.3g} mm; {:.3g} mm in the mean and "
                    "{:.3g} mm at most from half a wall away",
                    middle.mesh.triangles.size(), middle.cell, middle.error[0], middle.error[1]));
    warn_of_middle(tool_, middle);
    const MeshFacts before = examine(face_->mesh()), after = examine(middle.mesh), coarse = examine(coarse_);
    if (before.euler != after.euler || before.boundary_loops != after.boundary_loops + face_->point_loops()) {
      tool_.warn(
          {Weight::major, "another topology",
           fmt::format("the middle of the wall has {} rim(s) and {} handle(s), TARGET has {} and {}: half of the "
                       "wall closes a gap, or a branch is too narrow for it; a thinner wall leaves them",
                       after.boundary_loops, handles(after), before.boundary_loops, handles(before))});
    }
    warn_of_pressure(tool_, which_face(), area(face_->mesh()), area(middle.mesh), after.euler, *given_.thickness);
    Json& said = tool_.result()["mid_surface"];
    said["grid_mm"] = middle.cell;
    said["left_out"] = {{"pieces", middle.left_out}, {"area_mm2", middle.left_out_area}};
    target_.emplace(std::move(middle.mesh));
    if (coarse.euler == after.euler && coarse.boundary_loops == after.boundary_loops) {
      coarse_ = moved_half_way(std::move(coarse_), *face_, which_face(), *given_.thickness, *target_);
    } else {
      DecimateOptions few;
      few.triangles = coarse_.triangles.size();
      coarse_ = decimate(target_->mesh(), few).mesh;
    }
  }

  void relax() {
    const auto stage = tool_.stage("relax");
    if (face_) {
      go_half_way();
    }
    FitOptions how = options();
    try {
      relaxed_ = fits_ ? fit(coarse_, *target_, how) : relax_by_barycentre(coarse_, *target_, how);
      // A largest distance of the mean asked for serves for certain.
      while (given_.mean && !is_near_in_the_mean() && *how.tolerance > *given_.mean) {
        how.tolerance = *how.tolerance / 2;
        relaxed_ = fits_ ? fit(coarse_, *target_, how) : relax_by_barycentre(coarse_, *target_, how);
      }
    } catch (const Interrupted&) {
      if (!best_.triangles.empty()) {
        keep_partial(best_);
        tool_.warn({Weight::note, "partial result",
                    fmt::format("the best mesh so far, {} shells, is in {}.part", best_.triangles.size(),
                                given_.out.string())});
      }
      throw;
    } catch (const InputError& error) {
      throw InputError(given_.coarse.string() + ": " + error.what());
    }
  }

  bool is_near_in_the_mean() {
    mean_ = shell_quality(relaxed_.shell, *target_).mean_distance;  // sampled: what is above needs no certificate
    mean_bound_.reset();
    if (mean_ <= *given_.mean) {
      mean_bound_ = mean_ = moved_ + mean_distance_bound(relaxed_.shell, *target_, mean_slack * *given_.mean);
    }
    relaxed_.reached = mean_ <= *given_.mean;
    return *relaxed_.reached;
  }

  void measure() {
    const auto stage = tool_.stage("measure");
    ShellDistanceOptions measuring;
    measuring.width = interval_width * whole().diagonal();
    const ShellDistance flat = flat_distance(relaxed_.shell, whole(), measuring);
    if (tolerance_) {
      measuring.width = std::min(measuring.width, std::max(*tolerance_, relaxed_.distance.both.lower) / 20);
    }
    measuring.progress = tool_.progress("measure");
    distance_ = certified_distance(relaxed_, whole(), moved_, measuring);
    const double farthest = relaxed_.distance.boundary ? distance_.upper() : distance_.both.upper;
    if (moved_ > 0 && !given_.mean && relaxed_.reached && farthest > *tolerance_) {
      relaxed_.reached = false;
      relaxed_.stopped = "no shells reach the target's spikes without area";
    }
    Json& result = tool_.result();
    result["shells"] = relaxed_.shell.triangles.size();
    result["hausdorff_mm"] = interval(distance_.both, 1);
    result["hausdorff_percent"] = interval(distance_.both, percent());
    result["one_sided_percent"] = {{"shell_to_target", interval(distance_.shell_to_target, percent())},
                                   {"target_to_shell", interval(distance_.target_to_shell, percent())}};
    result["boundary_percent"] = distance_.boundary ? interval(*distance_.boundary, percent()) : Json();
    result["mean_percent"] = distance_.mean * percent();
    result["rms_percent"] = distance_.rms * percent();
    result["flat_hausdorff_percent"] = interval(flat.both, percent());
    result["iterations"] = Json::array();
    for (const RelaxIteration& iteration : relaxed_.iterations) {
      result["iterations"].push_back({{"shells", iteration.shells},
                                      {"hausdorff_percent", interval(iteration.hausdorff, percent())},
                                      {"seconds", iteration.seconds}});
    }
    result["reached"] = relaxed_.reached ? Json(*relaxed_.reached) : Json();
    result["stopped"] = relaxed_.stopped;
    result["diagonal_mm"] = whole().diagonal();
    result["mean_distance_bound_mm"] = mean_bound_ ? Json(*mean_bound_) : Json();
    warn_if_far();
    warn_if_few(tool_, given_, asked_, relaxed_.shell, *target_);
    measure_shapes();
    if (mean_bound_) {
      tool_.note(fmt::format("mean distance certainly below {:.4g} mm, {:.3g} % of the wall",
                             rounded_upwards(*mean_bound_, 4),
                             rounded_upwards(100 * *mean_bound_ / *given_.thickness, 3)));
    }
    tool_.note(fmt::format("{} shells, two-sided distance {:.4g} to {:.4g} % of the diagonal: {}",
                           relaxed_.shell.triangles.size(), percent() * distance_.both.lower,
                           rounded_upwards(percent() * distance_.both.upper, 4), relaxed_.stopped));
  }

  /// Shells that are fitted come nearer, whatever their number.
  void warn_if_far() {
    constexpr double far = 20;  // % of the diagonal
    if (const double apart = percent() * distance_.both.lower; apart > far) {
      tool_.warn(
          {Weight::major, "another surface",
           fmt::format("shells and surface are {:.3g} % of the surface's diagonal apart: are COARSE and TARGET of one "
                       "organ, in this "
                       "order and in the same place?",
                       apart)});
    }
  }

  void measure_shapes() {
    Json& result = tool_.result();
    const double angle = min_angle_degrees(flat_facets(relaxed_.shell));
    result["min_angle_deg"] = angle;
    if (const double wanted = min_angle_.value_or(usual_angle); fits_ && angle < rounded_up * wanted) {
      tool_.note(
          fmt::format("the smallest angle of the shells is {:.3g} degrees, below {:.3g}: boundaries, creases, the "
                      "tolerance or the number of shells allow no more",
                      angle, wanted));
    }
    const auto crossings = crossing_patches(relaxed_.shell);
    result["self_intersections"] = crossings.size();
    warn_of_crossings(tool_, relaxed_.shell, crossings);
    const ShellQuality quality = shell_quality(relaxed_.shell, whole());
    result["mean_distance_mm"] = quality.mean_distance;
    result["normal_error_deg"] = {{"mean", quality.mean_normal_error}, {"max", quality.max_normal_error}};
    result["gap_mm"] = quality.gap;
    result["size_ratio"] = quality.size_ratio;
  }

  void keep_partial(const ShellMesh& shell) const {
    PlyOptions partial = ply_;
    partial.partial = true;
    partial.overwrite = true;
    write_ply(given_.out, shell, partial);
  }

  /// Keeps the mesh as the best there is, and fails.
  [[noreturn]] void fail(const std::string& message) const {
    keep_partial(relaxed_.shell);
    throw RequirementError(message);
  }

  void require_what_was_asked() const {
    const std::string out = given_.out.string();
    const auto most = given_.shells ? given_.shells : given_.max_shells;
    if (most && relaxed_.shell.triangles.size() > *most) {
      fail(
          fmt::format("{}: {} shells are the fewest found that keep its pieces, holes and handles without folds, {} "
                      "are allowed; the best mesh is in {}.part",
                      given_.target.string(), relaxed_.shell.triangles.size(), *most, out));
    }
    if (given_.mean && !*relaxed_.reached) {
      fail(fmt::format(
          "{}: a mean distance of {:.4g} mm is not reached: {:.4g} mm with {} shells ({}); the best mesh is "
          "{}.part. Allow more shells or iterations, or a wider tolerance",
          out, *given_.mean, mean_, relaxed_.shell.triangles.size(), relaxed_.stopped, out));
    }
    if (tolerance_ && !given_.mean && !*relaxed_.reached) {
      fail(fmt::format(
          "{}: the tolerance of {:.4g} % is not reached: {:.4g} %{} with {} shells ({}); the best mesh is {}.part. {}",
          out, percent() * *tolerance_, percent() * distance_.both.upper,
          distance_.boundary && fits_
              ? fmt::format(", {:.4g} % of the boundaries", percent() * distance_.boundary->upper)
              : "",
          relaxed_.shell.triangles.size(), relaxed_.stopped, out,
          fits_           ? "Allow more shells or iterations, or a wider tolerance"
          : given_.refine ? "Allow more shells or iterations"
                          : "Add --refine, or take a coarse mesh with more triangles"));
    }
    if (const std::size_t without_area = count_without_area(relaxed_.shell); without_area > 0) {
      fail(
          fmt::format("{}: {} shell(s) have no area, as the surface has none there; the best mesh is {}.part. Make "
                      "the surface anew, or take such parts away first",
                      out, without_area, out));
    }
    require_fit(relaxed_.shell, out);
  }

  /// Two faces that are no farther apart than the shells lie from one of them have no wall between them.
  void require_wall(const std::vector<double>& thickness) const {
    constexpr double least = 2;  // below it half of what is measured is the shells' own error
    const double mean = std::accumulate(thickness.begin(), thickness.end(), 0.0) / real(thickness.size());
    const double off = tool_.result()["mean_distance_mm"].get<double>();
    if (mean < least * off) {
      throw InputError(
          fmt::format("{}: lies {:.3g} mm from the shells in the mean, hardly farther than they from "
                      "{} ({:.3g} mm): is it the other face of the wall?",
                      given_.other_face->string(), mean, given_.target.string(), off));
    }
  }

  /// The shells as they are written: those on the target, or half way to the other face.
  MidSurface written_shell() {
    if (!given_.mid_surface) {
      return {relaxed_.shell, {}};
    }
    Json& said = tool_.result()["mid_surface"];
    MidSurface middle{relaxed_.shell, {}};
    if (other_) {
      middle = naming(given_.other_face->string(),
                      [&] { return mid_surface_between(relaxed_.shell, which_face(), *other_); });
      const std::size_t crossings = crossing_patches(middle.shell).size();
      tool_.result()["self_intersections"] = crossings;
      if (crossings > 0) {
        tool_.warn({Weight::major, "wall crosses itself",
                    fmt::format("{} pair(s) of curved shells cross in the middle of the wall", crossings)});
      }
      said["error_mm"] = nullptr;
      require_wall(middle.thickness);
      const auto [thinnest, thickest] = std::minmax_element(middle.thickness.begin(), middle.thickness.end());
      said["thickness_mm"] = {{"min", *thinnest}, {"max", *thickest}};
    } else {
      const auto [mean, largest] = half_wall_error(middle.shell, *face_, *given_.thickness);
      said["error_mm"] = {{"mean", mean}, {"max", largest}};
      said["thickness_mm"] = {{"min", *given_.thickness}, {"max", *given_.thickness}};
    }
    said["target"] = *given_.mid_surface;
    return middle;
  }

  void write() {
    const auto stage = tool_.stage("write");
    require_what_was_asked();
    const MidSurface made = written_shell();
    std::vector<fs::path> written;
    try {
      write_ply(given_.out, made.shell, given_.other_face ? made.thickness : std::vector<double>(), ply_);
      written.push_back(given_.out);
      if (given_.curved) {
        write_surface(*given_.curved, tessellate(made.shell, curved_deviation * whole().diagonal()).mesh, ply_);
        written.push_back(*given_.curved);
      }
      if (given_.map || given_.picture) {
        write_maps(tool_, given_, relaxed_.shell, whole(), distance_, ply_, written);
      }
    } catch (...) {
      // Of a run that failed nothing looks finished.
      for (const fs::path& path : written) {
        std::error_code ignored;
        fs::remove(path, ignored);
      }
      throw;
    }
  }

  cli::Tool& tool_;
  const Arguments& given_;
  bool fits_;
  std::optional<double> min_angle_;  // degrees
  TriangleMesh coarse_;
  std::size_t asked_ = 0;       // triangles of COARSE
  std::optional<Target> face_;  // TARGET, where the middle of the wall takes its place
  std::optional<Target> target_, with_spikes_;
  std::optional<Target> other_;  // the wall's other face
  double moved_ = 0;             // of the target, mm: by taking its spikes
  PlyOptions ply_;
  std::optional<double> tolerance_;   // mm
  double mean_ = 0;                   // mm, of the distance, where that is asked for
  std::optional<double> mean_bound_;  // mm, certain
  ShellMesh best_;
  RelaxResult relaxed_;
  ShellDistance distance_;
};

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool(
      "relax",
      "Moves a coarse mesh onto its target as curved shells, and certifies the distance of the curved surface "
      "to the target, both ways.",
      "tunica-relax coarse.ply surface.ply shell.ply --tolerance 1% --refine --picture map.png --report relax.json\n"
      "tunica-relax coarse.ply surface.ply paper.ply --method barycentre --max-iterations 5\n"
      "tunica-relax surface.ply surface.ply fewest.ply --tolerance 1%");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "relax", "measure", "write"});
  return tool.run(argc, argv, [&] {
    understand_tolerance(given);
    Run(tool, given)();
  });
}
