#include "cli/tool.hpp"
#include "cli/usage.hpp"
#include "core/version.hpp"
#include "io/mesh_file.hpp"
#include "io/volume_file.hpp"
#include "surface/checks.hpp"
#include "surface/measure.hpp"
#include "volume/components.hpp"
#include "volume/labels.hpp"
#include "volume/marching_cubes.hpp"
#include "volume/outward.hpp"
#include "volume/smoothing.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace {

using namespace tunica;
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
  VolumeOptions volume_options;
  bool info = false;
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

void declare(CLI::App& app, Arguments& arguments) {
  app.add_option("VOLUME", arguments.volume, "segmented or grey volume: NIfTI, NRRD, MetaImage, slices")->required();
  app.add_option("OUT.ply", arguments.out, "the surface; with --all-labels {label} in it is the label");
  app.add_option("--label", arguments.label, "the label whose surface is wanted, by value or by the name in the file")
      ->type_name("N");
  app.add_option("--isovalue", arguments.isovalue, "the value on the surface of a grey volume")->type_name("V");
  app.add_option("--inside", arguments.inside,
                 "which side of the isovalue is inside (default above; a sample equal to it is outside)")
      ->check(CLI::IsMember({"above", "below"}))
      ->type_name("above|below");
  app.add_flag("--all-labels", arguments.all_labels, "one file per label");
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
  app.add_option("--frame", arguments.volume_options.frame, "which volume of a time series, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_option("--layer", arguments.volume_options.layer, "which layer of overlapping segments, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_flag("--prefer-qform", arguments.volume_options.prefer_qform,
               "NIfTI: take the qform where sform and qform are both set");
  app.add_option("--spacing", arguments.spacing, "mm per column, row and slice of a slice stack")->type_name("X,Y,Z");
  app.add_flag("--info", arguments.info, "print size, spacing, orientation and labels with volumes, and stop");
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

std::string named(const Label& label) {
  return label.name.empty() ? fmt::format("{}", label.value) : fmt::format("{} ({})", label.value, label.name);
}

std::string list_of(const std::vector<Label>& labels) {
  constexpr std::size_t shown = 80;
  std::string text;
  for (std::size_t i = 0; i < std::min(labels.size(), shown); ++i) {
    text += (i > 0 ? ", " : "") + named(labels[i]);
  }
  return labels.size() > shown ? fmt::format("{}, and {} more", text, labels.size() - shown) : text;
}

// A volume is a segmentation when its values are whole numbers, and not too many of them.
std::optional<std::vector<Label>> labels_of(const Volume& volume) {
  auto labels = list_labels(volume);
  const auto whole = [](const Label& label) { return label.value == std::floor(label.value); };
  if (labels && !std::all_of(labels->begin(), labels->end(), whole)) {
    labels.reset();
  }
  return labels;
}

Interval range_of(const Volume& volume) {
  Interval range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  std::visit(
      [&](const auto& values) {
        for (const auto stored : values) {
          const double value = volume.slope * static_cast<double>(stored) + volume.intercept;
          range.lower = value < range.lower ? value : range.lower;
          range.upper = value > range.upper ? value : range.upper;
        }
      },
      volume.data);
  return range;
}

[[noreturn]] void throw_choice(const fs::path& path, const Volume& volume) {
  const auto labels = labels_of(volume);
  const Interval range = range_of(volume);
  if (!labels || labels->size() > 100) {
    throw UsageError(
        fmt::format("{}: is a grey volume with values from {:.6g} to {:.6g}: pass --isovalue V, with --inside "
                    "below where the organ is darker",
                    path.string(), range.lower, range.upper));
  }
  if (labels->empty()) {
    throw InputError(fmt::format("{}: holds no label: every voxel is 0", path.string()));
  }
  throw UsageError(fmt::format("{}: pass --label N, --all-labels or --isovalue V; its labels are {}", path.string(),
                               list_of(*labels)));
}

// The label asked for, by value or by name.
Target label_target(const fs::path& path, const Volume& volume, const std::string& text) {
  const auto labels = labels_of(volume);
  const auto value = parse_number(text);
  if (!labels && value) {
    return {{Inside::Rule::label, *value}, fmt::format("label {}", *value)};
  }
  if (labels) {
    for (const Label& label : *labels) {
      if (value ? label.value == *value : label.name == text) {
        return {{Inside::Rule::label, label.value}, "label " + named(label)};
      }
    }
  }
  throw InputError(
      labels && !labels->empty()
          ? fmt::format("{}: has no voxel with label {}; its labels are {}", path.string(), text, list_of(*labels))
          : fmt::format("{}: has no voxel with label {}: {}", path.string(), text,
                        labels ? "every voxel is 0" : "it is a grey volume; pass --isovalue V"));
}

std::vector<Target> targets_of(const fs::path& path, const Volume& volume, const Arguments& arguments) {
  if (arguments.label) {
    return {label_target(path, volume, *arguments.label)};
  }
  if (arguments.isovalue) {
    const bool below = arguments.inside == "below";
    const double value = *parse_number(*arguments.isovalue);
    return {{{below ? Inside::Rule::below : Inside::Rule::above, value},
             fmt::format("{} {}", below ? "below" : "above", value)}};
  }
  if (!arguments.all_labels) {
    throw_choice(path, volume);
  }
  const auto labels = labels_of(volume);
  if (!labels || labels->empty()) {
    throw InputError(fmt::format(
        "{}: {}", path.string(),
        labels ? "holds no label: every voxel is 0" : "is a grey volume, which has no labels: pass --isovalue V"));
  }
  std::vector<Target> targets;
  for (const Label& label : *labels) {
    targets.push_back({{Inside::Rule::label, label.value}, "label " + named(label)});
  }
  return targets;
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

void keep_wanted_pieces(Mask& mask, const Arguments& arguments) {
  if (arguments.largest) {
    keep_largest_piece(mask);
  }
  if (arguments.fill_cavities) {
    fill_cavities(mask);
  }
}

Surface extract(cli::Tool& tool, const fs::path& path, const Volume& volume, const Target& target,
                const Arguments& arguments, const Smoothing& smoothing) {
  std::optional<Mask> mask;
  double voxel_volume = 0;
  {
    const auto stage = tool.stage("extract");
    mask.emplace(select(volume, target.inside));
    voxel_volume = static_cast<double>(count_voxels(*mask)) * mask->voxel_volume();
    if (voxel_volume == 0) {
      const Interval range = range_of(volume);
      throw InputError(fmt::format("{}: no voxel is {}; its values are {:.6g} to {:.6g}", path.string(), target.name,
                                   range.lower, range.upper));
    }
    keep_wanted_pieces(*mask, arguments);
  }
  SmoothedField smoothed;
  const bool gaussian = smoothing.kind == Smoothing::Kind::gaussian;
  if (gaussian) {
    const auto stage = tool.stage("smooth");
    if (target.inside.rule == Inside::Rule::label) {
      smoothed = smooth_mask(*mask, smoothing.sigma, tool.progress("smooth"));
    } else {
      smoothed = {smooth_values(volume, smoothing.sigma, tool.progress("smooth")), target.inside};
    }
  }
  std::optional<Surface> surface;
  {
    const auto stage = tool.stage("extract");
    const MarchingCubesOptions options{arguments.open_border, tool.progress("extract")};
    if (gaussian) {
      mask.emplace(select(smoothed.field, smoothed.rule));
      keep_wanted_pieces(*mask, arguments);
    }
    TriangleMesh mesh =
        marching_cubes(gaussian ? smoothed.field : volume, gaussian ? smoothed.rule : target.inside, *mask, options);
    surface.emplace(Surface{std::move(mesh), std::move(*mask), voxel_volume, false, {}});
  }
  if (surface->mesh.triangles.empty()) {
    throw InputError(fmt::format("{}: the surface of {} is empty: {}", path.string(), target.name,
                                 gaussian ? "the smoothing removes it; pass a smaller sigma"
                                          : "it fills the whole image; leave out --open-border"));
  }
  surface->outward = faces_outward(surface->mesh, surface->mask, arguments.open_border);
  if (smoothing.kind == Smoothing::Kind::staircase) {
    const auto stage = tool.stage("smooth");
    const StaircaseOptions options{arguments.open_border, tool.progress("smooth")};
    surface->staircase = smooth_staircase(surface->mesh, surface->mask, options);
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

// A comment is one line of printable text, whatever the file is called.
std::string comment(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

void print_info(cli::Tool& tool, const fs::path& path, const VolumeFile& file) {
  const Volume& volume = file.volume;
  const auto labels = labels_of(volume);
  const Interval range = range_of(volume);
  fmt::print("{}\n", path.string());
  fmt::print("format       {}, {}\n", file.format, file.datatype);
  fmt::print("dims         {} x {} x {}\n", volume.dims[0], volume.dims[1], volume.dims[2]);
  fmt::print("spacing      {:.6g} x {:.6g} x {:.6g} mm\n", file.spacing.x(), file.spacing.y(), file.spacing.z());
  fmt::print("orientation  {} (from {})\n", file.orientation, file.transform);
  if (file.frames > 1) {
    fmt::print("frames       {}\n", file.frames);
  }
  if (file.layers > 1) {
    fmt::print("layers       {}\n", file.layers);
  }
  fmt::print("values       {:.6g} .. {:.6g}\n", range.lower, range.upper);
  Json list = Json::array();
  if (labels) {
    fmt::print("labels       {}\n", labels->size());
    for (const Label& label : *labels) {
      fmt::print("  {:<8} {:>12} voxels {:>14.1f} mm3  {}\n", label.value, label.voxels, label.volume_mm3,
                 comment(label.name));
      list.push_back({{"label", label.value},
                      {"voxels", label.voxels},
                      {"volume_mm3", label.volume_mm3},
                      {"name", label.name.empty() ? Json() : Json(label.name)}});
    }
  } else {
    fmt::print("labels       none: a grey volume\n");
  }
  Json& result = tool.result();
  result = undefined_result();
  result["format"] = file.format;
  result["datatype"] = file.datatype;
  result["dims"] = volume.dims;
  result["spacing_mm"] = {file.spacing.x(), file.spacing.y(), file.spacing.z()};
  result["orientation"] = file.orientation;
  result["transform"] = file.transform;
  result["frames"] = file.frames;
  result["layers"] = file.layers;
  result["values"] = {range.lower, range.upper};
  result["labels"] = labels ? list : Json();
}

VolumeFile read(cli::Tool& tool, const Arguments& arguments) {
  const auto stage = tool.stage("read");
  VolumeFile file = read_volume(tool.input(arguments.volume), arguments.volume_options);
  for (const fs::path& path : file.data_files) {
    tool.input(path);
  }
  for (const std::string& warning : file.warnings) {
    tool.warn(warning);
  }
  return file;
}

void run(cli::Tool& tool, Arguments& arguments) {
  refuse_contradictions(arguments);
  const Smoothing smoothing = parse_smoothing(arguments.smooth);
  if (arguments.spacing) {
    arguments.volume_options.spacing = parse_spacing(*arguments.spacing);
  }
  const VolumeFile file = read(tool, arguments);
  if (arguments.info) {
    print_info(tool, arguments.volume, file);
    return;
  }
  const std::vector<Target> targets = targets_of(arguments.volume, file.volume, arguments);
  for (const Target& target : targets) {
    tool.output(output_path(arguments.out, target), {".ply"});
  }
  Json results;
  for (const Target& target : targets) {
    Surface surface = extract(tool, arguments.volume, file.volume, target, arguments, smoothing);
    const Json result = measured(surface, arguments.open_border);
    const fs::path out = output_path(arguments.out, target);
    {
      const auto stage = tool.stage("write");
      PlyOptions options;
      options.comments = {fmt::format("tunica-extract {}", version),
                          comment("source " + arguments.volume.filename().string()), comment(target.name)};
      options.space = arguments.space == "ras" ? "RAS" : "LPS";
      options.overwrite = tool.force();
      to_space(surface.mesh, arguments.space);
      write_ply(out, surface.mesh, options);
    }
    tool.note(fmt::format("{}: {} triangles, {:.6g} mm2", out.string(), result["triangles"].get<std::size_t>(),
                          result["area_mm2"].get<double>()));
    results[fmt::format("{}", target.inside.value)] = result;
  }
  if (arguments.all_labels) {
    tool.result() = summed(results);
    tool.result()["labels"] = results;
  } else {
    tool.result() = results.front();
  }
  tool.result()["warnings"] = file.warnings;
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("extract", "Marching cubes: the closed surface of a label, or of an isovalue, in world millimetres.",
                 "tunica-extract organs.nii.gz aorta.ply --label 1 --largest\n"
                 "  tunica-extract ct.nii.gz bone.ply --isovalue 200\n"
                 "  tunica-extract slices/ organ.ply --label 255 --spacing 0.5,0.5,1.25");
  Arguments arguments;
  declare(tool.arguments(), arguments);
  tool.stages({"read", "smooth", "extract", "write"});
  return tool.run(argc, argv, [&] { run(tool, arguments); });
}
