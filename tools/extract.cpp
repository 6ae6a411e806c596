#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"
#include "tunica/cli/volume_contents.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/io/volume/label_names.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/label_index.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/cubes/outward.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

namespace {

using namespace tunica;
using cli::are_labels;
using cli::named;
using cli::printable;
using cli::VolumeContents;
namespace fs = std::filesystem;

struct Arguments {
  fs::path volume;
  fs::path out;
  std::optional<std::string> label;
  std::optional<std::string> isovalue;
  std::optional<std::string> inside;
  bool all_labels = false;
  bool largest = false;
  bool fill_cavities = false;
  bool open_border = false;
  std::string smooth = "none";
  std::string space = "lps";
  std::optional<std::string> spacing;
  std::optional<fs::path> names;  // a table of labels
  std::optional<std::size_t> slab;
  VolumeOptions volume_options;
  bool info = false;
  std::optional<std::size_t> shells;  // of which the memory is told
};

struct Smoothing {
  enum class Kind { none, staircase, gaussian } kind = Kind::none;
  double sigma = 0;  // mm
};

// What is extracted: one selection of voxels, and how it is called.
struct Target {
  Inside inside;
  std::string name;  // "label 3 (aorta)", "above 200"
};

void declare(cli::Tool& tool, Arguments& arguments) {
  CLI::App& app = tool.arguments();
  app.add_option("VOLUME", arguments.volume, "segmented or grey volume: NIfTI, NRRD, MetaImage, slices")->required();
  app.add_option("OUT.ply", arguments.out,
                 "the surface (.ply, .glb, .obj, .stl or .3mf); with --all-labels {label} in it is the label");
  tool.group("What is inside");
  app.add_option(
         "--label", arguments.label,
         "the label whose surface is wanted, by value or by the name that the volume, --names or a table beside "
         "the volume (scan.tsv, .ctbl, .label, .lut, .txt, .csv of scan.nii.gz) gives it")
      ->type_name("N");
  app.add_option(
         "--names", arguments.names,
         "a table of label names: BIDS _dseg.tsv, ITK-SNAP's, Slicer's .ctbl, FreeSurfer's look-up table, CSV, JSON")
      ->type_name("FILE");
  app.add_option("--isovalue", arguments.isovalue, "the value on the surface of a grey volume")->type_name("V");
  app.add_option("--inside", arguments.inside,
                 "which side of the isovalue is inside (default above; a sample equal to it is outside)")
      ->check(CLI::IsMember({"above", "below"}))
      ->type_name("above|below");
  app.add_flag("--all-labels", arguments.all_labels, "one file per label");
  tool.group("Surface");
  app.add_flag("--largest", arguments.largest, "keep the largest component only");
  app.add_flag("--fill-cavities", arguments.fill_cavities, "drop the surfaces of cavities");
  app.add_flag("--open-border", arguments.open_border,
               "leave open, trimmed flat, what the image's border cuts, instead of closing it");
  app.add_option("--smooth", arguments.smooth,
                 "none, staircase (steps of the voxels, within half a voxel), or a Gaussian's sigma such as 1.5mm")
      ->type_name("none|staircase|SIGMA");
  app.add_option("--space", arguments.space, "world axes of the surface (default lps)")
      ->check(CLI::IsMember({"lps", "ras"}))
      ->type_name("lps|ras");
  tool.group("Reading");
  app.add_option("--frame", arguments.volume_options.frame, "which volume of a time series, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_option("--layer", arguments.volume_options.layer, "which layer of overlapping segments, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_flag("--prefer-qform", arguments.volume_options.prefer_qform,
               "NIfTI: take the qform where sform and qform are both set");
  app.add_option("--spacing", arguments.spacing, "mm per column, row and slice of a slice stack")->type_name("X,Y,Z");
  app.add_option(
         "--slab", arguments.slab,
         "read N slices at a time and never hold the whole volume; the same surface (default: 64 MiB at a time, a grey "
         "volume up to 1 GiB at once)")
      ->check(cli::whole_number(1))
      ->type_name("N");
  app.add_flag("--info", arguments.info,
               "print size, spacing, orientation and labels with volumes, names and the memory they take, and stop");
  app.add_option("--shells", arguments.shells,
                 "with --info: the shells of the chain whose memory is estimated (default 800, as the pipeline's)")
      ->check(cli::whole_number(4))
      ->type_name("N");
}

Vec3 parse_spacing(const std::string& text) {
  std::vector<double> values;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    const auto number = parse_number(word);
    values.push_back(number ? *number : parse_quantity(word, dimension::length));
    begin = end + 1;
  }
  if (values.size() == 1) {
    values.resize(3, values.front());
  }
  if (values.size() != 3 || !(*std::min_element(values.begin(), values.end()) > 0)) {
    throw UsageError(
        fmt::format("--spacing: '{}' is not three lengths above 0: write --spacing X,Y,Z in mm, for example "
                    "--spacing 0.5,0.5,1.25",
                    text));
  }
  return {values[0], values[1], values[2]};
}

Smoothing parse_smoothing(const std::string& text) {
  if (text == "none") {
    return {};
  }
  if (text == "staircase") {
    return {Smoothing::Kind::staircase, 0};
  }
  try {
    const double sigma = parse_quantity(text, dimension::length);
    if (sigma > 0) {
      return {Smoothing::Kind::gaussian, sigma};
    }
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--smooth: {}; or write none or staircase", error.what()));
  }
  throw UsageError(fmt::format("--smooth: sigma has to be above 0, '{}' is not", text));
}

void refuse_contradictions(const Arguments& arguments) {
  const auto refuse = [](const char* message) { throw UsageError(message); };
  if (arguments.label && arguments.isovalue) {
    refuse("--label and --isovalue contradict each other: give one");
  }
  if (arguments.all_labels && (arguments.label || arguments.isovalue)) {
    refuse("--all-labels contradicts --label and --isovalue: give one of them");
  }
  if (arguments.inside && !arguments.isovalue) {
    refuse("--inside says which side of an isovalue is inside: give --isovalue V too, or leave it out");
  }
  if (arguments.isovalue && !parse_number(*arguments.isovalue)) {
    throw UsageError(fmt::format("--isovalue: '{}' is not a number", *arguments.isovalue));
  }
  if (arguments.info) {
    return;
  }
  if (arguments.shells) {
    refuse("--shells is of the estimate that --info prints: leave it out here; tunica-relax --shells takes a count");
  }
  if (arguments.out.empty()) {
    refuse("OUT.ply is missing: name the surface to write, or pass --info to look at the volume");
  }
  if (arguments.all_labels && arguments.out.string().find("{label}") == std::string::npos) {
    throw UsageError(
        fmt::format("{}: --all-labels writes a file per label: put {{label}} into the name, for example "
                    "organ-{{label}}.ply",
                    arguments.out.string()));
  }
}

// The names of a volume's labels: those of --names, else the volume's own, else those of a table beside it.
class Names {
public:
  void read(cli::Tool& tool, const Arguments& arguments) {
    if (arguments.names) {
      given_ = read_label_names(tool.input(*arguments.names));
      warn_of_several(tool, *arguments.names, given_);
      return;
    }
    for (const fs::path& table : label_tables_beside(arguments.volume)) {
      try {
        beside_ = read_label_names(table);
        tool.input(table);
        warn_of_several(tool, table, beside_);
        return;
      } catch (const InputError& error) {
        tool.warn({Weight::minor, "label table",
                   fmt::format("{}; left out, the volume's labels have no names of it", error.what())});
      }
    }
  }

  [[nodiscard]] const LabelNames& of(const VolumeFile& file) const {
    return !given_.empty() ? given_ : !file.volume.label_names.empty() ? file.volume.label_names : beside_;
  }

private:
  static void warn_of_several(const cli::Tool& tool, const fs::path& table, const LabelNames& names) {
    if (const auto warning = several_names(table, names)) {
      tool.warn(*warning);
    }
  }

  LabelNames given_;
  LabelNames beside_;
};

void widen(Interval& range, const Volume& volume) {
  std::visit(
      [&](const auto& values) {
        for (const auto stored : values) {
          const double value = volume.slope * static_cast<double>(stored) + volume.intercept;
          range.lower = value < range.lower ? value : range.lower;
          range.upper = value > range.upper ? value : range.upper;
        }
      },
      volume.data);
}

SlabSize slab_size(const Arguments& arguments) {
  SlabSize size;
  size.slices = arguments.slab;
  return size;
}

void note_not_finite(VolumeFile& file, const fs::path& path, std::size_t count) {
  if (count > 0) {
    file.warnings.push_back(
        {Weight::minor, "no numbers",
         fmt::format(
             "{}: {} of {} voxels are no finite numbers: not-a-number is outside, and a surface beside one lies "
             "in the middle",
             path.string(), count, file.volume.dims[0] * file.volume.dims[1] * file.volume.dims[2])});
  }
}

// Reads the volume slab by slab; the visits count as the stage `doing`.
VolumeFile read_slabs(cli::Tool& tool, const Arguments& arguments, const char* doing, const SlabVisitor& visit,
                      Wholeness* values = nullptr) {
  std::optional<cli::Tool::Stage> reading(std::in_place, tool, "read");
  std::size_t not_finite = 0;
  Wholeness whole;
  VolumeFile read = read_volume_slabs(arguments.volume, arguments.volume_options, slab_size(arguments),
                                      [&](const VolumeFile& file, const Volume& slab, std::size_t first_slice) {
                                        reading.reset();
                                        {
                                          const auto stage = tool.stage(doing);
                                          not_finite += count_not_finite(slab);
                                          whole.add(slab);
                                          visit(file, slab, first_slice);
                                        }
                                        reading.emplace(tool, "read");
                                      });
  note_not_finite(read, arguments.volume, not_finite);
  if (!arguments.isovalue) {
    cli::note_rounded(read, arguments.volume, whole);
  }
  if (arguments.label || arguments.all_labels) {
    cli::require_whole(arguments.volume, whole, arguments.label);
  }
  if (values != nullptr) {
    *values = whole;
  }
  return read;
}

VolumeContents contents_of(cli::Tool& tool, const Arguments& arguments, const Names& names) {
  VolumeContents contents;
  std::optional<LabelIndex> index;
  const VolumeFile file = read_slabs(
      tool, arguments, "read",
      [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
        if (!index) {
          index.emplace(header.volume.dims, header.volume.affine);
        }
        naming(arguments.volume.string(), [&] { index->add(slab, first_slice); });
        widen(contents.values, slab);
      },
      &contents.whole);
  contents.warnings = file.warnings;
  contents.names = names.of(file);
  contents.labels = index->labels(contents.names);
  if (!are_labels(contents.labels)) {
    contents.labels.reset();
    return contents;
  }
  for (const Label& label : *contents.labels) {
    contents.surface_vertices.push_back(index->surface_vertices(label.value));
  }
  return contents;
}

// The label asked for, by value or by name; none where there is none of that name, or the background.
std::optional<Target> label_target(const fs::path& path, const LabelNames& names, const std::string& text) {
  const auto value = naming(path.string(), [&] { return find_label(names, text); });
  if (!value || *value == 0) {
    return {};
  }
  const auto at = std::ranges::find(names, *value, [](const auto& label) { return label.first; });
  const std::string name = parse_number(text) ? (at == names.end() ? "" : at->second) : text;
  return Target{{Inside::Rule::label, *value}, "label " + named({*value, 0, 0, name})};
}

Target isovalue_target(const Arguments& arguments) {
  const bool below = arguments.inside == "below";
  const double value = *parse_number(*arguments.isovalue);
  return {{below ? Inside::Rule::below : Inside::Rule::above, value},
          fmt::format("{} {}", below ? "below" : "above", value)};
}

fs::path output_path(const fs::path& pattern, const Target& target) {
  std::string text = pattern.string();
  if (target.inside.rule == Inside::Rule::label) {
    const std::string word = "{label}";
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at)) {
      text.replace(at, word.size(), fmt::format("{}", target.inside.value));
    }
  }
  return text;
}

Json undefined_result() {
  Json result;
  for (const char* key : {"vertices", "triangles", "components", "euler", "closed", "manifold", "oriented_outward",
                          "volume_mm3", "voxel_volume_mm3", "area_mm2", "diagonal_mm"}) {
    result[key] = nullptr;
  }
  return result;
}

struct Surface {
  TriangleMesh mesh;
  Mask mask;                                 // the selection the mesh bounds
  double voxel_volume_mm3 = 0;               // of the whole selection, before pieces were dropped
  bool outward = false;                      // of the surface before the staircase was smoothed
  std::optional<StaircaseResult> staircase;  // what that smoothing did
};

// @return the share of the voxels that pieces had which are left out
double keep_wanted_pieces(Mask& mask, const Arguments& arguments) {
  double left_out = 0;
  if (arguments.largest) {
    const std::size_t selected = count_voxels(mask);
    keep_largest_piece(mask);
    left_out = selected > 0 ? 1 - real(count_voxels(mask)) / real(selected) : 0;
  }
  if (arguments.fill_cavities) {
    fill_cavities(mask);
  }
  return left_out;
}

// Voxels that were selected, and how their surface is made of them.
struct Selection {
  Target target;
  Mask mask;
  std::optional<MaskBounds> bounds;  // where the mask holds anything, if known
  const Volume* volume = nullptr;    // the values of a grey volume that is at hand
};

// Values that are not at hand are read a second time.
TriangleMesh marching_cubes_of(const Selection& selection, const Arguments& arguments,
                               const MarchingCubesOptions& options) {
  const Mask& mask = selection.mask;
  const Inside& inside = selection.target.inside;
  if (inside.rule == Inside::Rule::label) {
    return marching_cubes(mask, options);
  }
  if (selection.volume != nullptr) {
    return marching_cubes(*selection.volume, inside, mask, options);
  }
  SlabMarchingCubes cubes(mask, inside, options);
  read_volume_slabs(
      arguments.volume, arguments.volume_options, slab_size(arguments),
      [&](const VolumeFile&, const Volume& slab, std::size_t first_slice) { cubes.add(slab, first_slice); });
  return cubes.finish();
}

SmoothedField smoothed_field(cli::Tool& tool, const Selection& selection, double sigma) {
  const auto stage = tool.stage("smooth");
  const auto progress = tool.progress("smooth");
  return selection.volume != nullptr
             ? SmoothedField{smooth_values(*selection.volume, sigma, progress), selection.target.inside}
             : smooth_mask(selection.mask, sigma, progress);
}

// Smoothing keeps the volume, so that only the voxels tell what it did to the shape.
void warn_of_smoothing(const cli::Tool& tool, const Selection& selection, const Mask& smoothed) {
  constexpr double notable = 0.1;
  const double changed = real(count_differing(selection.mask, smoothed)) / real(count_voxels(selection.mask));
  if (changed > notable) {
    tool.warn({Weight::minor, "smoothing",
               fmt::format(
                   "{}: smoothing changes the shape: it moves as many voxels in or out as {:.3g} % of its own; pass a "
                   "smaller sigma",
                   selection.target.name, 1e2 * changed)});
  }
}

void warn_of_pieces(const cli::Tool& tool, const std::string& name, double left_out) {
  constexpr double notable = 0.01;
  if (left_out > notable) {
    tool.warn(
        {Weight::minor, "pieces left out",
         fmt::format(
             "{}: only its largest piece is taken: {:.3g} % of its voxels lie in others, which are left out; without "
             "--largest, LARGEST=0 of the pipeline, they stay",
             name, 1e2 * left_out)});
  }
}

Surface extract(cli::Tool& tool, Selection selection, const Arguments& arguments, const Names& names,
                const Smoothing& smoothing) {
  double voxel_volume = 0;
  {
    const auto stage = tool.stage("extract");
    voxel_volume = real(count_voxels(selection.mask)) * selection.mask.voxel_volume();
    if (voxel_volume > 0) {
      warn_of_pieces(tool, selection.target.name, keep_wanted_pieces(selection.mask, arguments));
    }
  }
  const Target target = selection.target;
  if (voxel_volume == 0) {
    const VolumeContents contents = contents_of(tool, arguments, names);
    if (arguments.label) {
      cli::throw_no_label(arguments.volume, contents, *arguments.label);
    }
    throw InputError(fmt::format("{}: no voxel is {}; its values are {:.6g} to {:.6g}", arguments.volume.string(),
                                 target.name, contents.values.lower, contents.values.upper));
  }
  MarchingCubesOptions options;
  options.open_border = arguments.open_border;
  options.progress = tool.progress("extract");
  std::optional<Surface> surface;
  const bool gaussian = smoothing.kind == Smoothing::Kind::gaussian;
  if (gaussian) {
    const SmoothedField smoothed = smoothed_field(tool, selection, smoothing.sigma);
    const auto stage = tool.stage("extract");
    Mask mask = select(smoothed.field, smoothed.rule);
    keep_wanted_pieces(mask, arguments);
    warn_of_smoothing(tool, selection, mask);
    TriangleMesh mesh = marching_cubes(smoothed.field, smoothed.rule, mask, options);
    surface.emplace(Surface{std::move(mesh), std::move(mask), voxel_volume, false, {}});
  } else {
    const auto stage = tool.stage("extract");
    options.bounds = selection.bounds;
    TriangleMesh mesh = marching_cubes_of(selection, arguments, options);
    surface.emplace(Surface{std::move(mesh), std::move(selection.mask), voxel_volume, false, {}});
  }
  if (surface->mesh.triangles.empty()) {
    throw InputError(fmt::format("{}: the surface of {} is empty: {}", arguments.volume.string(), target.name,
                                 gaussian ? "the smoothing removes it; pass a smaller sigma"
                                          : "it fills the whole image; leave out --open-border"));
  }
  surface->outward = faces_outward(surface->mesh, surface->mask, arguments.open_border);
  if (smoothing.kind == Smoothing::Kind::staircase) {
    const auto stage = tool.stage("smooth");
    const StaircaseOptions staircase{arguments.open_border, tool.progress("smooth")};
    surface->staircase = smooth_staircase(surface->mesh, surface->mask, staircase);
  }
  return std::move(*surface);
}

// Measures what was made; a surface that is not what marching cubes promises is a defect of ours.
Json measured(const Surface& surface, bool open_border) {
  const MeshFacts facts = examine(surface.mesh);
  if (const auto why = why_unfit(facts, open_border ? Boundary::allowed : Boundary::forbidden)) {
    throw InternalError("the extracted surface is not a manifold: " + *why);
  }
  const double volume = signed_volume(surface.mesh);
  Json result = undefined_result();
  result["vertices"] = facts.vertices;
  result["triangles"] = facts.triangles;
  result["components"] = facts.components;
  result["euler"] = facts.euler;
  result["closed"] = facts.closed;
  result["manifold"] = facts.manifold;
  result["oriented_outward"] = facts.oriented && surface.outward && (!facts.closed || volume > 0);
  result["volume_mm3"] = facts.closed ? Json(volume) : Json();
  result["voxel_volume_mm3"] = surface.voxel_volume_mm3;
  result["area_mm2"] = area(surface.mesh);
  result["diagonal_mm"] = diagonal(surface.mesh);
  if (surface.staircase) {
    result["staircase"] = {{"largest_move_voxels", surface.staircase->largest_move},
                           {"volume_change", surface.staircase->volume_change},
                           {"held_back", surface.staircase->held_back}};
  }
  return result;
}

// Sums of what can be summed; the report's top level for several labels.
Json summed(const Json& labels) {
  Json total = undefined_result();
  for (const auto& [label, result] : labels.items()) {
    for (const auto& [key, value] : result.items()) {
      if (key == "diagonal_mm") {
        continue;  // boxes of several surfaces do not add up
      }
      if (value.is_boolean()) {
        total[key] = (total[key].is_null() || total[key].get<bool>()) && value.get<bool>();
      } else if (value.is_number_integer()) {
        total[key] = (total[key].is_null() ? 0L : total[key].get<long>()) + value.get<long>();
      } else if (value.is_number()) {
        total[key] = (total[key].is_null() ? 0.0 : total[key].get<double>()) + value.get<double>();
      }
    }
  }
  return total;
}

void to_space(TriangleMesh& mesh, const std::string& space) {
  if (space == "ras") {
    for (Vec3& vertex : mesh.vertices) {
      vertex = {-vertex.x(), -vertex.y(), vertex.z()};
    }
  }
}

void note_file(cli::Tool& tool, const VolumeFile& file) {
  for (const fs::path& path : file.data_files) {
    tool.input(path);
  }
  for (const Warning& warning : file.warnings) {
    tool.warn(warning);
  }
  tool.result()["warnings"] = texts_of(file.warnings);
}

// A surface runs halfway between the middles of voxels and is rounded off there: what is a few voxels thick loses
// volume.
void warn_of_few_voxels(const cli::Tool& tool, const Surface& surface, const Json& result, const std::string& name) {
  constexpr double notable = 0.05;
  if (result["volume_mm3"].is_null()) {
    return;
  }
  const double voxels = real(count_voxels(surface.mask)) * surface.mask.voxel_volume();
  const double change = result["volume_mm3"].get<double>() / voxels - 1;
  if (std::abs(change) > notable) {
    tool.warn(
        {Weight::minor, "few voxels",
         fmt::format(
             "{}: the surface encloses {:.3g} % {} than its voxels: it is few voxels thick, and neither volume need "
             "be right within that; take finer voxels",
             name, 1e2 * std::abs(change), change < 0 ? "less" : "more")});
  }
}

void warn_of_cut(const cli::Tool& tool, const Surface& surface, const Target& target) {
  const std::size_t cut = count_at_border(surface.mask);
  if (cut == 0) {
    return;
  }
  const auto& dims = surface.mask.dims();
  const auto inner = [](std::size_t count) { return count - std::min<std::size_t>(count, 2); };
  const std::size_t border = dims[0] * dims[1] * dims[2] - inner(dims[0]) * inner(dims[1]) * inner(dims[2]);
  if (const auto rule = target.inside.rule; rule != Inside::Rule::label && 2 * cut > border) {
    tool.warn({Weight::major, "other side",
               fmt::format("{}: it is most of the image's border: what is meant may be the other side (--inside {})",
                           target.name, rule == Inside::Rule::above ? "below" : "above")});
  }
  tool.warn(
      {Weight::minor, "cut by the border",
       fmt::format("{}: the image's border cuts it ({} voxels), and flat lids close it there; --open-border, OPEN=1 "
                   "of the pipeline, leaves it open, as a vessel is",
                   target.name, cut)});
}

// A cut of a few voxels is no end of a vessel, but would be held as one.
void warn_of_narrow_rims(const cli::Tool& tool, const Surface& surface, const std::string& name) {
  constexpr std::size_t narrow_rim = 12;  // vertices, one per face of a voxel around it: 3 x 3 voxels
  const auto rims = boundary_loops(surface.mesh);
  const auto few = std::ranges::count_if(rims, [](const auto& rim) { return rim.size() < narrow_rim; });
  if (few > 0) {
    tool.warn({Weight::minor, "narrow opening",
               fmt::format(
                   "{}: the image's border leaves {} of its {} opening(s) a few voxels wide: supports at the boundary "
                   "hold these as they do the ends of a vessel; leave the outermost slices out of the image, or "
                   "hold the ends by where they are (--fix 'above z=...', FIX of the pipeline)",
                   name, few, rims.size())});
  }
}

// Extracts one surface, writes it and returns what the report says of it.
Json extract_to_file(cli::Tool& tool, Selection selection, const Arguments& arguments, const Names& names,
                     const Smoothing& smoothing) {
  const Target target = selection.target;
  const Vec3 voxel = selection.mask.affine().leftCols<3>().colwise().norm();
  Surface surface = extract(tool, std::move(selection), arguments, names, smoothing);
  Json result = measured(surface, arguments.open_border);
  warn_of_few_voxels(tool, surface, result, target.name);
  if (arguments.open_border) {
    warn_of_narrow_rims(tool, surface, target.name);
  } else {
    warn_of_cut(tool, surface, target);
  }
  const fs::path out = output_path(arguments.out, target);
  tool.require_unchanged_inputs();
  {
    const auto stage = tool.stage("write");
    PlyOptions options;
    options.comments = {fmt::format("tunica-extract {}", version), printable("made by " + tool.made_by()),
                        printable("source " + tool.provenance().name_of(arguments.volume)), printable(target.name),
                        fmt::format("voxel {:.6g} {:.6g} {:.6g} mm", voxel.x(), voxel.y(), voxel.z())};
    options.space = arguments.space == "ras" ? "RAS" : "LPS";
    options.overwrite = tool.force();
    to_space(surface.mesh, arguments.space);
    write_surface(out, surface.mesh, options);
  }
  tool.note(fmt::format("{}: {} triangles, {:.6g} mm2", out.string(), result["triangles"].get<std::size_t>(),
                        result["area_mm2"].get<double>()));
  return result;
}

void set_result(cli::Tool& tool, const Json& result) {
  for (const auto& [key, value] : result.items()) {
    tool.result()[key] = value;
  }
}

// One pass over the volume, whatever the number of labels.
void run_all_labels(cli::Tool& tool, const Arguments& arguments, const Names& names, const Smoothing& smoothing) {
  std::optional<LabelIndex> index;
  const VolumeFile file = read_slabs(tool, arguments, "extract",
                                     [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
                                       if (!index) {
                                         index.emplace(header.volume.dims, header.volume.affine);
                                       }
                                       naming(arguments.volume.string(), [&] { index->add(slab, first_slice); });
                                     });
  note_file(tool, file);
  const auto labels = index->labels(names.of(file));
  if (!are_labels(labels) || labels->empty()) {
    throw InputError(fmt::format("{}: {}", arguments.volume.string(),
                                 are_labels(labels) ? "holds no label: every voxel is 0"
                                                    : "is a grey volume, which has no labels: pass --isovalue V"));
  }
  std::vector<Target> targets;
  for (const Label& label : *labels) {
    targets.push_back({{Inside::Rule::label, label.value}, "label " + named(label)});
    tool.output(output_path(arguments.out, targets.back()), surface_endings());
  }
  Json results;
  for (const Target& target : targets) {
    std::optional<Selection> selection;
    {
      const auto stage = tool.stage("extract");
      const double value = target.inside.value;
      selection.emplace(Selection{target, index->mask(value), index->bounds(value)});
    }
    results[fmt::format("{}", target.inside.value)] =
        extract_to_file(tool, std::move(*selection), arguments, names, smoothing);
  }
  set_result(tool, summed(results));
  tool.result()["labels"] = results;
}

// The values of a grey volume are held where they are smoothed, or where that spares a second reading for little: a
// quarter of the memory that a case of the pipeline has.
bool hold_values(const Arguments& arguments, const Smoothing& smoothing, const VolumeFile& header) {
  constexpr std::size_t most_bytes = std::size_t{1} << 30;
  const std::size_t voxel_bytes = std::visit([](const auto& values) { return sizeof(values[0]); }, header.volume.data);
  return smoothing.kind == Smoothing::Kind::gaussian ||
         (!arguments.slab && header.volume.voxels() <= most_bytes / voxel_bytes);
}

Json run_isovalue(cli::Tool& tool, const Arguments& arguments, const Names& names, const Smoothing& smoothing) {
  const Target target = isovalue_target(arguments);
  tool.output(arguments.out, surface_endings());
  std::optional<VolumeFile> file;
  std::optional<Mask> mask;
  {
    const auto stage = tool.stage("read");
    if (hold_values(arguments, smoothing, read_volume_header(arguments.volume, arguments.volume_options))) {
      file = read_volume(arguments.volume, arguments.volume_options);
    }
  }
  const bool held = file.has_value();
  if (held) {
    const auto stage = tool.stage("extract");
    mask.emplace(select(file->volume, target.inside));
    note_not_finite(*file, arguments.volume, count_not_finite(file->volume));
  } else {
    file = read_slabs(tool, arguments, "extract",
                      [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
                        if (!mask) {
                          mask.emplace(header.volume.dims, header.volume.affine);
                        }
                        select(slab, first_slice, target.inside, *mask);
                      });
  }
  note_file(tool, *file);
  return extract_to_file(tool, {target, std::move(*mask), {}, held ? &file->volume : nullptr}, arguments, names,
                         smoothing);
}

Json run_label(cli::Tool& tool, const Arguments& arguments, const Names& names, const Smoothing& smoothing) {
  std::optional<Target> target;
  std::optional<Mask> mask;
  const VolumeFile file = read_slabs(tool, arguments, "extract",
                                     [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
                                       if (!mask) {
                                         mask.emplace(header.volume.dims, header.volume.affine);
                                         target = label_target(arguments.volume, names.of(header), *arguments.label);
                                         if (target) {
                                           tool.output(output_path(arguments.out, *target), surface_endings());
                                         }
                                       }
                                       if (target) {
                                         select(slab, first_slice, target->inside, *mask);
                                       }
                                     });
  note_file(tool, file);
  if (!target) {
    cli::throw_no_label(arguments.volume, contents_of(tool, arguments, names), *arguments.label);
  }
  return extract_to_file(tool, {*target, std::move(*mask), {}, nullptr}, arguments, names, smoothing);
}

void run(cli::Tool& tool, Arguments& arguments) {
  refuse_contradictions(arguments);
  const Smoothing smoothing = parse_smoothing(arguments.smooth);
  if (arguments.spacing) {
    arguments.volume_options.spacing = parse_spacing(*arguments.spacing);
  }
  tool.input(arguments.volume);
  Names names;
  names.read(tool, arguments);
  if (arguments.label && !arguments.names) {
    arguments.volume_options.segment = *arguments.label;
  }
  if (arguments.info) {
    VolumeFile header = read_volume_header(arguments.volume, arguments.volume_options);
    const VolumeContents contents = contents_of(tool, arguments, names);
    header.warnings = contents.warnings;
    const auto [text, info] = cli::volume_info(arguments.volume, header, contents, arguments.shells.value_or(800));
    tool.result() = undefined_result();
    tool.result().update(info);
    note_file(tool, header);
    tool.print(text);
  } else if (arguments.label) {
    set_result(tool, run_label(tool, arguments, names, smoothing));
  } else if (arguments.isovalue) {
    set_result(tool, run_isovalue(tool, arguments, names, smoothing));
  } else if (arguments.all_labels) {
    run_all_labels(tool, arguments, names, smoothing);
  } else {
    cli::throw_choice(arguments.volume, contents_of(tool, arguments, names));
  }
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("extract", "Marching cubes: the closed surface of a label, or of an isovalue, in world millimetres.",
                 "tunica-extract aneurysm.nii.gz --info\n"
                 "  tunica-extract aneurysm.nii.gz surface.ply --label 1 --largest --open-border --smooth staircase\n"
                 "  tunica-extract aneurysm.nii.gz grey.ply --isovalue 0.5 --smooth 1mm");
  Arguments arguments;
  declare(tool, arguments);
  tool.stages({"read", "smooth", "extract", "write"});
  return tool.run(argc, argv, [&] { run(tool, arguments); });
}
