#include "tunica/chain/volume_contents.hpp"

#include "tunica/chain/case_memory.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/volume/cubes/openings.hpp"
#include "tunica/volume/labels/components.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace tunica::chain {
namespace {

std::string list_of(const std::vector<Label>& labels) {
  constexpr std::size_t shown = 80;
  std::string text;
  for (std::size_t i = 0; i < std::min(labels.size(), shown); ++i) {
    text += (i > 0 ? ", " : "") + named(labels[i]);
  }
  return labels.size() > shown ? fmt::format("{}, and {} more", text, labels.size() - shown) : text;
}

// "x -12.5 to 30, y ..."
std::string box_text(const LabelPlace& place) {
  std::string text;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    text +=
        fmt::format("{}{} {:.6g} to {:.6g}", axis == 0 ? "" : ", ", "xyz"[axis], place.lower[axis], place.upper[axis]);
  }
  return text;
}

// The labels as lines of text, and for the report.
std::pair<std::string, Json> list_labels(const VolumeFile& file, const VolumeContents& contents, std::size_t shells) {
  std::string text = fmt::format("labels       {}, with MiB of memory of extract and of the chain to {} shells\n",
                                 contents.labels->size(), shells);
  Json list = Json::array();
  const std::size_t voxel_bytes = std::visit([](const auto& values) { return sizeof(values[0]); }, file.volume.data);
  for (std::size_t i = 0; i < contents.labels->size(); ++i) {
    const Label& label = (*contents.labels)[i];
    const auto memory = estimate_memory(contents.surface_vertices[i], shells, file.volume.voxels(), voxel_bytes);
    text += fmt::format("  {:<8} {:>12} voxels {:>14.1f} mm3 {:>7.0f} {:>7.0f} MiB  {}\n", label.value, label.voxels,
                        label.volume_mm3, memory.extract, memory.chain(), printable(label.name));
    const LabelPlace& place = contents.places[i];
    text += fmt::format("  {:<8} {} mm (LPS); {} piece(s), {} opening(s) where the image's border cuts it\n", "",
                        box_text(place), place.pieces, place.openings);
    list.push_back(
        {{"label", label.value},
         {"box_mm",
          {{place.lower.x(), place.lower.y(), place.lower.z()}, {place.upper.x(), place.upper.y(), place.upper.z()}}},
         {"pieces", place.pieces},
         {"openings", place.openings},
         {"voxels", label.voxels},
         {"volume_mm3", label.volume_mm3},
         {"name", label.name.empty() ? Json() : Json(label.name)},
         {"memory_mib",
          {{"extract", memory.extract},
           {"decimate", memory.decimate},
           {"relax", memory.relax},
           {"simulate", memory.simulate},
           {"chain", memory.chain()}}}});
  }
  return {std::move(text), std::move(list)};
}

// "12.5 % of its voxels that are not 0 (812) lie between whole numbers, such as 0.37"
std::string fractions(const Wholeness& whole) {
  return fmt::format("{:.3g} % of its voxels that are not 0 ({}) lie between whole numbers, such as {:.6g}",
                     1e2 * real(whole.between) / real(whole.not_zero), whole.between, whole.example);
}

// Why no labels are listed.
std::string grey(const Wholeness& whole) {
  return whole.between > 0 ? fmt::format("a grey volume: {}", fractions(whole)) : "a grey volume";
}

}  // namespace

namespace {

/// The first and the last voxel of a row that are inside; none: the first is beyond the last.
std::pair<std::size_t, std::size_t> ends_of_row(const Mask& mask, std::size_t j, std::size_t k) {
  constexpr std::size_t bits = 64;
  std::size_t first = mask.dims()[0], last = 0;
  const std::uint64_t* const words = mask.row(j, k);
  for (std::size_t w = 0; w < mask.words_per_row(); ++w) {
    if (words[w] != 0) {
      first = std::min(first, bits * w + narrow<std::size_t>(std::countr_zero(words[w])));
      last = bits * w + bits - 1 - narrow<std::size_t>(std::countl_zero(words[w]));
    }
  }
  return {first, last};
}

}  // namespace

LabelPlace place_of(const Mask& label) {
  LabelPlace place{Vec3::Constant(infinity), Vec3::Constant(-infinity), piece_sizes(label).size(),
                   count_border_cuts(label)};
  const auto& [columns, rows, slices] = label.dims();
  for (std::size_t k = 0; k < slices; ++k) {
    for (std::size_t j = 0; j < rows; ++j) {
      const auto [first, last] = ends_of_row(label, j, k);
      if (first > last) {
        continue;
      }
      // Both ends of the row of voxels, at the four edges of their outer faces.
      for (const double i : {real(first) - 0.5, real(last) + 0.5}) {
        for (const int corner : {0, 1, 2, 3}) {
          const Vec3 index(i, real(j) - 0.5 + (corner & 1), real(k) - 0.5 + (corner >> 1));
          const Vec3 at = label.affine().leftCols<3>() * index + label.affine().col(3);
          place.lower = place.lower.cwiseMin(at);
          place.upper = place.upper.cwiseMax(at);
        }
      }
    }
  }
  return place;
}

void note_rounded(VolumeFile& file, const std::filesystem::path& path, const Wholeness& whole) {
  if (whole.rounded > 0) {
    file.warnings.push_back(
        {Weight::note, "rounded labels",
         fmt::format("{}: {} of its voxels are not quite whole numbers, by {:.2g} at most: they are "
                     "taken as the labels next to them",
                     path.string(), whole.rounded, whole.farthest)});
  }
}

void require_whole(const std::filesystem::path& path, const Wholeness& whole, const std::optional<std::string>& asked) {
  const auto label = asked ? parse_number(*asked) : std::nullopt;
  if (whole.between == 0 || (label && *label != std::floor(*label))) {
    return;
  }
  throw InputError(fmt::format(
      "{}: {}: it is a grey volume, or labels that were resampled by interpolation, which eats their borders; pass "
      "--isovalue {}, or resample the labels again by nearest neighbour",
      path.string(), fractions(whole),
      label && *label != 0 ? fmt::format("{:g} if it is a mask of 0 and {:g}", *label / 2, *label)
                           : "V (0.5 of a mask of 0 and 1)"));
}

bool are_labels(const std::optional<std::vector<Label>>& labels) {
  return labels && std::all_of(labels->begin(), labels->end(),
                               [](const Label& label) { return label.value == std::floor(label.value); });
}

std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

std::string named(const Label& label) {
  return label.name.empty() ? fmt::format("{}", label.value)
                            : fmt::format("{} ({})", label.value, printable(label.name));
}

void throw_choice(const std::filesystem::path& path, const VolumeContents& contents) {
  const auto& labels = contents.labels;
  if (!labels || labels->size() > 100) {
    throw UsageError(
        fmt::format("{}: is a grey volume with values from {:.6g} to {:.6g}: pass --isovalue V, with --inside "
                    "below where the organ is darker",
                    path.string(), contents.values.lower, contents.values.upper));
  }
  if (labels->empty()) {
    throw InputError(fmt::format("{}: holds no label: every voxel is 0", path.string()));
  }
  throw UsageError(fmt::format("{}: pass --label N, --all-labels or --isovalue V; its labels are {}", path.string(),
                               list_of(*labels)));
}

std::string no_label_text(const std::filesystem::path& path, const VolumeContents& contents, const std::string& text) {
  const auto& labels = contents.labels;
  if (!parse_number(text) && !find_label(contents.names, text)) {
    const std::string near = nearest_label(contents.names, text);
    const std::string hint =
        !near.empty() ? fmt::format("did you mean '{}'?", printable(near))
        : labels && !labels->empty()
            ? fmt::format("{}its labels are {}",
                          contents.names.empty() ? "nothing names its labels (--names FILE); " : "", list_of(*labels))
            : std::string(labels ? "every voxel is 0" : "it is a grey volume; pass --isovalue V");
    return fmt::format("{}: has no label of the name '{}': {}", path.string(), printable(text), hint);
  }
  return labels && !labels->empty()
             ? fmt::format("{}: has no voxel with label {}; its labels are {}", path.string(), text, list_of(*labels))
             : fmt::format("{}: has no voxel with label {}: {}", path.string(), text,
                           labels ? "every voxel is 0" : "it is a grey volume; pass --isovalue V");
}

std::pair<std::string, Json> volume_info(const std::filesystem::path& path, const VolumeFile& file,
                                         const VolumeContents& contents, std::size_t shells) {
  const Volume& volume = file.volume;
  const auto& labels = contents.labels;
  const Interval& range = contents.values;
  std::string text = path.string() + "\n";
  text += fmt::format("format       {}, {}\n", file.format, file.datatype);
  text += fmt::format("dims         {} x {} x {}\n", volume.dims[0], volume.dims[1], volume.dims[2]);
  text +=
      fmt::format("spacing      {:.6g} x {:.6g} x {:.6g} mm\n", file.spacing.x(), file.spacing.y(), file.spacing.z());
  text += fmt::format("orientation  {} (from {})\n", file.orientation, file.transform);
  for (Eigen::Index row = 0; row < 3; ++row) {
    const auto at = volume.affine.row(row);
    text += fmt::format("{:<12} {:10.6g} {:10.6g} {:10.6g} {:10.6g}\n", row == 0 ? "affine (LPS)" : "", at[0], at[1],
                        at[2], at[3]);
  }
  if (file.frames > 1) {
    text += fmt::format("frames       {}\n", file.frames);
  }
  if (file.layers > 1) {
    text += fmt::format("layers       {}\n", file.layers);
  }
  text += fmt::format("values       {:.6g} .. {:.6g}\n", range.lower, range.upper);
  Json list;
  if (labels) {
    auto [lines, entries] = list_labels(file, contents, shells);
    text += lines;
    list = std::move(entries);
  } else {
    text += fmt::format("labels       none: {}\n", grey(contents.whole));
  }
  Json result;
  result["format"] = file.format;
  result["datatype"] = file.datatype;
  result["dims"] = volume.dims;
  result["spacing_mm"] = {file.spacing.x(), file.spacing.y(), file.spacing.z()};
  result["orientation"] = file.orientation;
  result["transform"] = file.transform;
  result["voxel_to_world_mm"] = Json::array();
  for (Eigen::Index row = 0; row < 3; ++row) {
    const auto at = volume.affine.row(row);
    result["voxel_to_world_mm"].push_back({at[0], at[1], at[2], at[3]});
  }
  result["frames"] = file.frames;
  result["layers"] = file.layers;
  result["values"] = {range.lower, range.upper};
  result["labels"] = list;
  return {std::move(text), std::move(result)};
}

}  // namespace tunica::chain
