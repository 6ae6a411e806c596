#include "tunica/cli/label_choice.hpp"
#include "tunica/cli/scene_flags.hpp"
#include "tunica/cli/surface_result.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"
#include "tunica/cli/volume_contents.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/surface/mesh/cut_open.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/doubts.hpp"
#include "tunica/volume/cubes/label_index.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/cubes/openings.hpp"
#include "tunica/volume/cubes/outward.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/labels/hollows.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "tunica/wall/face_distance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
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
  std::vector<std::string> cuts;    // as they are written
  std::optional<std::string> face;  // of a wall
  std::optional<fs::path> other_face;
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
  Inside inside;             // of several labels the first
  std::string name;          // "label 3 (aorta)", "above 200"
  std::string in_file_name;  // for {label}
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
         "the volume (scan.tsv, .ctbl, .label, .lut, .txt, .csv of scan.nii.gz) gives it; A+B: several as one organ")
      ->type_name("N[+N]");
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
               "leave open, trimmed flat, the ends of vessels that the image's border cuts, instead of closing them");
  app.add_option("--cut", arguments.cuts,
                 "cut the surface open along a plane and drop what lies beyond, may repeat: 'above z=40mm', 'below "
                 "x=-2cm', in the axes of --space")
      ->type_name("WHERE")
      ->expected(1)
      ->allow_extra_args(false)  // the next word is a file
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--face", arguments.face,
                 "of a label that is the wall itself: this face alone, closed or open as a vessel, normals outward")
      ->check(CLI::IsMember({"inner", "outer"}))
      ->type_name("inner|outer");
  app.add_option("--other-face", arguments.other_face, "with --face: write the wall's other face here")
      ->type_name("OUT.ply");
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

HalfSpaceNodes parse_cut(const std::string& text) {
  const auto half = cli::parse_half_space(text, "--cut");
  if (!half) {
    throw UsageError(fmt::format("--cut: '{}' is not understood: write 'above z=40mm' or 'below x=-2cm'", text));
  }
  return *half;
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
  for (const std::string& cut : arguments.cuts) {
    (void)parse_cut(cut);
  }
  if (arguments.face && arguments.all_labels) {
    refuse("--face is of one wall: name it by --label instead of --all-labels");
  }
  if (arguments.other_face && !arguments.face) {
    refuse("--other-face needs --face inner or outer, which says what OUT.ply is");
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

VolumeContents contents_of(cli::Tool& tool, const Arguments& arguments, const cli::LabelTables& names) {
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
    contents.places.push_back(cli::place_of(index->mask(label.value)));
  }
  return contents;
}

Target isovalue_target(const Arguments& arguments) {
  const bool below = arguments.inside == "below";
  const double value = *parse_number(*arguments.isovalue);
  return {{below ? Inside::Rule::below : Inside::Rule::above, value},
          fmt::format("{} {}", below ? "below" : "above", value),
          {}};
}

fs::path output_path(const fs::path& pattern, const Target& target) {
  std::string text = pattern.string();
  if (target.inside.rule == Inside::Rule::label) {
    const std::string word = "{label}";
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at)) {
      text.replace(at, word.size(), target.in_file_name);
    }
  }
  return text;
}

struct Surface {
  TriangleMesh mesh;
  Mask mask;                                 // the selection the mesh bounds
  bool outward = false;                      // of the surface before the staircase was smoothed
  std::optional<StaircaseResult> staircase;  // what that smoothing did
  Openings openings;                         // of an open border
};

// Voxels that were selected, and how their surface is made of them.
struct Selection {
  Target target;
  Mask mask;
  std::optional<MaskBounds> bounds;  // where the mask holds anything, if known
  const Volume* volume = nullptr;    // the values of a grey volume that is at hand
  std::optional<std::string> face;   // of the wall that was selected: the mask is what it bounds
};

// By which a surface lies between the values of a grey volume: what the inner face of a wall bounds is its hollow.
Inside surface_rule(const Selection& selection) {
  Inside rule = selection.target.inside;
  if (selection.face == "inner" && rule.rule != Inside::Rule::label) {
    rule.rule = rule.rule == Inside::Rule::above ? Inside::Rule::below : Inside::Rule::above;
  }
  return rule;
}

Mask solid_of(const Mask& wall, const Hollows& hollows, const std::string& face) {
  return face == "inner" ? inner_solid(hollows) : outer_solid(wall, hollows);
}

void keep_wanted_pieces(Mask& mask, const Arguments& arguments) {
  if (arguments.largest) {
    keep_largest_piece(mask);
  }
  if (arguments.fill_cavities) {
    fill_cavities(mask);
  }
}

void warn_all(const cli::Tool& tool, const std::vector<Warning>& warnings) {
  for (const Warning& warning : warnings) {
    tool.warn(warning);
  }
}

// Keeps the pieces that are wanted, and says what that left out or filled, and what is odd about the rest.
void keep_and_doubt(cli::Tool& tool, const Subject& subject, Selection& selection, const Arguments& arguments) {
  Mask& mask = selection.mask;
  const std::size_t selected = count_voxels(mask);
  std::optional<Hollows> hollows;
  if (!selection.face) {
    hollows = find_hollows(mask);
  }
  if (arguments.largest) {
    keep_largest_piece(mask);
    warn_all(tool, doubt_pieces(subject, 1 - real(count_voxels(mask)) / real(selected)));
  }
  if (hollows) {
    Mask filled = mask;
    CavityFacts cavities{fill_cavities(filled), 0, arguments.fill_cavities};
    cavities.voxels = count_voxels(filled) - count_voxels(mask);
    warn_all(tool, doubt_hollows(subject, mask, *hollows, cavities));
    if (arguments.fill_cavities) {
      mask = std::move(filled);
    }
  }
  warn_all(tool, doubt_bridge(subject, find_bridge(mask)));
}

// Values that are not at hand are read a second time.
TriangleMesh marching_cubes_of(const Selection& selection, const Arguments& arguments,
                               const MarchingCubesOptions& options) {
  const Mask& mask = selection.mask;
  const Inside inside = surface_rule(selection);
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

[[noreturn]] void throw_nothing(cli::Tool& tool, const std::string& name, const Arguments& arguments,
                                const cli::LabelTables& names) {
  const VolumeContents contents = contents_of(tool, arguments, names);
  if (arguments.label) {
    cli::throw_no_label(arguments.volume, contents, *arguments.label);
  }
  throw InputError(fmt::format("{}: no voxel is {}; its values are {:.6g} to {:.6g}", arguments.volume.string(), name,
                               contents.values.lower, contents.values.upper));
}

// The surface of what Gaussian smoothing makes of a selection, which becomes the selection's mask.
std::function<TriangleMesh(const MarchingCubesOptions&)> smoothed_surface(cli::Tool& tool, const Subject& subject,
                                                                          Selection& selection,
                                                                          const Arguments& arguments, double sigma) {
  auto smoothed = std::make_shared<SmoothedField>(smoothed_field(tool, selection, sigma));
  const auto stage = tool.stage("extract");
  Mask mask = select(smoothed->field, smoothed->rule);
  if (selection.volume != nullptr && selection.face) {
    mask = solid_of(mask, find_hollows(mask), *selection.face);
    smoothed->rule = surface_rule(selection);
  }
  keep_wanted_pieces(mask, arguments);
  // Smoothing keeps the volume, so that only the voxels tell what it did to the shape.
  warn_all(tool,
           doubt_smoothing(subject, real(count_differing(selection.mask, mask)) / real(count_voxels(selection.mask))));
  selection.mask = std::move(mask);
  return [smoothed, &selection](const MarchingCubesOptions& options) {
    return marching_cubes(smoothed->field, smoothed->rule, selection.mask, options);
  };
}

// Along planes in the axes of the output. What is said of the image's border afterwards concerns what is left.
void cut_open(Surface& surface, const Subject& subject, const Arguments& arguments) {
  TriangleMesh& mesh = surface.mesh;
  for (const std::string& text : arguments.cuts) {
    const HalfSpaceNodes half = parse_cut(text);
    const double turned = subject.ras && half.axis < 2 ? -1 : 1;
    Interval range{infinity, -infinity};
    for (const Vec3& x : mesh.vertices) {
      range.lower = std::min(range.lower, turned * x[half.axis]);
      range.upper = std::max(range.upper, turned * x[half.axis]);
    }
    if (!(range.lower < half.at && half.at < range.upper)) {
      throw InputError(
          fmt::format("{}: --cut '{}' does not meet the surface of {}, which reaches from {:.6g} to {:.6g} "
                      "mm along {}",
                      arguments.volume.string(), text, subject.name, range.lower, range.upper, "xyz"[half.axis]));
    }
    const double kept = half.below ? -1 : 1;  // what lies beyond is above the plane along this normal
    const Vec3 normal = kept * turned * Vec3::Unit(half.axis);
    const double offset = kept * half.at;
    mesh = tunica::cut_open(mesh, normal, offset);
    drop_beyond(surface.mask, normal, offset);
    std::erase_if(surface.openings.openings,
                  [&](const Opening& opening) { return !opening.is_end && normal.dot(opening.middle) > offset; });
  }
}

Surface extract(cli::Tool& tool, const Subject& subject, Selection selection, const Arguments& arguments,
                const Smoothing& smoothing) {
  const bool gaussian = smoothing.kind == Smoothing::Kind::gaussian;
  {
    const auto stage = tool.stage("extract");
    keep_and_doubt(tool, subject, selection, arguments);
  }
  MarchingCubesOptions options;
  options.open_border = arguments.open_border;
  options.progress = tool.progress("extract");
  std::function<TriangleMesh(const MarchingCubesOptions&)> cubes = [&](const MarchingCubesOptions& chosen) {
    return marching_cubes_of(selection, arguments, chosen);
  };
  if (gaussian) {
    cubes = smoothed_surface(tool, subject, selection, arguments, smoothing.sigma);
  } else {
    options.bounds = selection.bounds;
  }
  Surface surface{{}, selection.mask, false, {}, {}};
  {
    const auto stage = tool.stage("extract");
    surface.mesh = cubes(options);
    if (arguments.open_border && !surface.mesh.triangles.empty()) {
      surface.openings = find_openings(surface.mask, surface.mesh);
      if (surface.openings.lids.any()) {
        options.lids = &surface.openings.lids;
        surface.mesh = cubes(options);
      }
    }
  }
  if (surface.mesh.triangles.empty()) {
    throw InputError(fmt::format("{}: the surface of {} is empty: {}", arguments.volume.string(), subject.name,
                                 gaussian ? "the smoothing removes it; pass a smaller sigma"
                                          : "it fills the whole image; leave out --open-border"));
  }
  surface.outward = faces_outward(surface.mesh, surface.mask, arguments.open_border);
  if (smoothing.kind == Smoothing::Kind::staircase) {
    const auto stage = tool.stage("smooth");
    const StaircaseOptions staircase{arguments.open_border, tool.progress("smooth")};
    surface.staircase = smooth_staircase(surface.mesh, surface.mask, staircase);
  }
  cut_open(surface, subject, arguments);
  return surface;
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

void doubt(cli::Tool& tool, const Subject& subject, const Surface& surface, const Target& target, const Json& result,
           const Arguments& arguments) {
  if (!result["volume_mm3"].is_null()) {
    warn_all(tool, doubt_volume(subject, surface.mask, result["volume_mm3"].get<double>()));
  }
  if (arguments.open_border) {
    if (arguments.cuts.empty() || !surface.openings.openings.empty()) {
      warn_all(tool, doubt_openings(subject, surface.openings, result["area_mm2"].get<double>()));
    }
    warn_all(tool, doubt_rims(subject, surface.mask, surface.mesh, boundary_loops(surface.mesh)));
  } else {
    warn_all(tool, doubt_closed_border(subject, surface.mask, target.inside));
  }
}

void write(cli::Tool& tool, const fs::path& out, TriangleMesh mesh, const std::string& name, const Vec3& voxel,
           const std::optional<std::string>& face, const Arguments& arguments) {
  const auto stage = tool.stage("write");
  PlyOptions options;
  options.comments = {fmt::format("tunica-extract {}", version), printable("made by " + tool.made_by()),
                      printable("source " + tool.provenance().name_of(arguments.volume)), printable(name),
                      fmt::format("voxel {:.6g} {:.6g} {:.6g} mm", voxel.x(), voxel.y(), voxel.z())};
  if (face) {
    options.comments.push_back("face " + *face);
  }
  options.space = arguments.space == "ras" ? "RAS" : "LPS";
  options.overwrite = tool.force();
  to_space(mesh, arguments.space);
  write_surface(out, mesh, options);
  tool.note(fmt::format("{}: {} triangles, {:.6g} mm2", out.string(), mesh.triangles.size(), area(mesh)));
}

// The selection by which a face of a wall is extracted.
Selection face_of(const Selection& wall, const Hollows& hollows, const std::string& face) {
  Selection selection{wall.target, solid_of(wall.mask, hollows, face), {}, wall.volume, face};
  selection.target.name += ", " + face + " face";
  return selection;
}

// What is extracted of a wall: one face, and the other one.
std::array<Selection, 2> both_faces(cli::Tool& tool, const Subject& subject, const Selection& wall,
                                    const Arguments& arguments) {
  const Hollows hollows = find_hollows(wall.mask);
  if (hollows.sizes.empty()) {
    throw InputError(fmt::format(
        "{}: {} is no wall around a hollow, so it has no inner and no outer face: leave out --face; where it "
        "is a wall with a hole or a slit, close that in the segmentation, and where it ends within the image, crop the "
        "image so that its border cuts the wall",
        arguments.volume.string(), wall.target.name));
  }
  warn_all(tool, doubt_wall(subject, hollows));
  const std::string& face = *arguments.face;
  return {face_of(wall, hollows, face), face_of(wall, hollows, face == "inner" ? "outer" : "inner")};
}

// Extracts one surface, writes it and returns what the report says of it.
Json extract_to_file(cli::Tool& tool, Selection selection, const Arguments& arguments, const cli::LabelTables& names,
                     const Smoothing& smoothing) {
  const Target target = selection.target;
  const Vec3 voxel = selection.mask.affine().leftCols<3>().colwise().norm();
  const double voxel_volume = real(count_voxels(selection.mask)) * selection.mask.voxel_volume();
  if (voxel_volume == 0) {
    throw_nothing(tool, target.name, arguments, names);
  }
  Subject subject{target.name, arguments.space == "ras"};
  std::optional<Surface> other;
  if (arguments.face) {
    auto [face, behind] = both_faces(tool, subject, selection, arguments);
    other = extract(tool, {behind.target.name, subject.ras}, behind, arguments, smoothing);
    selection = std::move(face);
    subject.name = selection.target.name;
  }
  const std::string name = selection.target.name;
  const Surface surface = extract(tool, subject, std::move(selection), arguments, smoothing);
  Json result = cli::measure_surface(surface.mesh, surface.outward, arguments.open_border || !arguments.cuts.empty());
  result["openings"] = boundary_loops(surface.mesh).size();
  result["voxel_volume_mm3"] = voxel_volume;
  if (surface.staircase) {
    result["staircase"] = {{"largest_move_voxels", surface.staircase->largest_move},
                           {"volume_change", surface.staircase->volume_change},
                           {"held_back", surface.staircase->held_back}};
  }
  doubt(tool, subject, surface, target, result, arguments);
  tool.require_unchanged_inputs();
  write(tool, output_path(arguments.out, target), surface.mesh, name, voxel, arguments.face, arguments);
  if (other) {
    const FaceDistance thickness =
        distance_of_faces(without_border(surface.mesh, surface.mask), without_border(other->mesh, other->mask));
    result["face"] = *arguments.face;
    result["wall_thickness_mm"] = {{"mean", thickness.mean}, {"p5", thickness.p5}, {"p95", thickness.p95}};
    tool.note(fmt::format("{}: the wall is {:.4g} mm thick in the mean, {:.4g} to {:.4g} mm over nine tenths of it",
                          target.name, thickness.mean, thickness.p5, thickness.p95));
    if (arguments.other_face) {
      const std::string& behind = *arguments.face == "inner" ? "outer" : "inner";
      write(tool, output_path(*arguments.other_face, target), other->mesh, target.name + ", " + behind + " face", voxel,
            behind, arguments);
    }
  }
  return result;
}

// Registers what one selection is written to.
void claim_outputs(cli::Tool& tool, const Arguments& arguments, const Target& target) {
  tool.output(output_path(arguments.out, target), surface_endings());
  if (arguments.other_face) {
    tool.output(output_path(*arguments.other_face, target), surface_endings());
  }
}

void set_result(cli::Tool& tool, const Json& result) {
  for (const auto& [key, value] : result.items()) {
    tool.result()[key] = value;
  }
}

// One pass over the volume, whatever the number of labels.
void run_all_labels(cli::Tool& tool, const Arguments& arguments, const cli::LabelTables& names,
                    const Smoothing& smoothing) {
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
    targets.push_back({{Inside::Rule::label, label.value}, "label " + named(label), fmt::format("{}", label.value)});
    tool.output(output_path(arguments.out, targets.back()), surface_endings());
  }
  Json results;
  for (const Target& target : targets) {
    std::optional<Selection> selection;
    {
      const auto stage = tool.stage("extract");
      const double value = target.inside.value;
      selection.emplace(Selection{target, index->mask(value), index->bounds(value), nullptr, {}});
    }
    results[fmt::format("{}", target.inside.value)] =
        extract_to_file(tool, std::move(*selection), arguments, names, smoothing);
  }
  set_result(tool, cli::sum_of_surfaces(results));
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

Json run_isovalue(cli::Tool& tool, const Arguments& arguments, const cli::LabelTables& names,
                  const Smoothing& smoothing) {
  const Target target = isovalue_target(arguments);
  claim_outputs(tool, arguments, target);
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
  return extract_to_file(tool, {target, std::move(*mask), {}, held ? &file->volume : nullptr, {}}, arguments, names,
                         smoothing);
}

Json run_label(cli::Tool& tool, const Arguments& arguments, const cli::LabelTables& names, const Smoothing& smoothing) {
  std::optional<Target> target;
  std::optional<cli::LabelSelection> selection;
  std::string absent;
  const VolumeFile file = read_slabs(
      tool, arguments, "extract", [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
        if (first_slice == 0) {
          auto [choice, missing] = naming(arguments.volume.string(), [&] {
            return cli::choose_labels(names.of(header), names.unfolded(*arguments.label));
          });
          absent = missing;
          if (choice) {
            target = {{Inside::Rule::label, choice->values[0]}, choice->name, choice->in_file_name};
            claim_outputs(tool, arguments, *target);
            selection.emplace(std::move(*choice), header.volume);
          }
        }
        if (selection) {
          selection->add(slab, first_slice);
        }
      });
  note_file(tool, file);
  if (selection) {
    absent = selection->absent();
  }
  if (!selection || !absent.empty()) {
    cli::throw_no_label(arguments.volume, contents_of(tool, arguments, names), absent);
  }
  return extract_to_file(tool, {*target, std::move(selection->mask()), {}, nullptr, {}}, arguments, names, smoothing);
}

void run(cli::Tool& tool, Arguments& arguments) {
  refuse_contradictions(arguments);
  const Smoothing smoothing = parse_smoothing(arguments.smooth);
  if (arguments.spacing) {
    arguments.volume_options.spacing = parse_spacing(*arguments.spacing);
  }
  tool.input(arguments.volume);
  cli::LabelTables names;
  names.read(tool, arguments.volume, arguments.names);
  if (arguments.label && !arguments.names) {
    arguments.volume_options.segment = *arguments.label;
  }
  if (arguments.info) {
    VolumeFile header = read_volume_header(arguments.volume, arguments.volume_options);
    const VolumeContents contents = contents_of(tool, arguments, names);
    header.warnings = contents.warnings;
    const auto [text, info] = cli::volume_info(arguments.volume, header, contents, arguments.shells.value_or(800));
    tool.result() = cli::undefined_surface();
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
