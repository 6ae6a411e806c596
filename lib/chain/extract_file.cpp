#include "tunica/chain/extract_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/label_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace tunica::chain {
namespace {

namespace fs = std::filesystem;

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

SlabSize slab_size(const ExtractFiles& files) {
  SlabSize size;
  size.slices = files.slab;
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
VolumeFile read_slabs(const ExtractFiles& files, const char* doing, const Context& context, const SlabVisitor& visit,
                      Wholeness* values = nullptr) {
  std::shared_ptr<void> reading = context.stage("read");
  std::size_t not_finite = 0;
  Wholeness whole;
  VolumeFile read = read_volume_slabs(files.volume, files.reading, slab_size(files),
                                      [&](const VolumeFile& file, const Volume& slab, std::size_t first_slice) {
                                        reading.reset();
                                        {
                                          const auto stage = context.stage(doing);
                                          not_finite += count_not_finite(slab);
                                          whole.add(slab);
                                          visit(file, slab, first_slice);
                                        }
                                        reading = context.stage("read");
                                      });
  note_not_finite(read, files.volume, not_finite);
  if (!files.grey) {
    note_rounded(read, files.volume, whole);
  }
  if (files.label || files.all_labels) {
    require_whole(files.volume, whole, files.label);
  }
  if (values != nullptr) {
    *values = whole;
  }
  return read;
}

// Takes all slabs into an index of the labels.
SlabVisitor indexing(const fs::path& path, std::optional<LabelIndex>& index) {
  return [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
    if (!index) {
      index.emplace(header.volume.dims, header.volume.affine);
    }
    naming(path.string(), [&] { index->add(slab, first_slice); });
  };
}

VolumeContents contents_of(const OpenedVolume& opened, const Context& context) {
  VolumeContents contents;
  std::optional<LabelIndex> index;
  const SlabVisitor take = indexing(opened.files.volume, index);
  const VolumeFile file = read_slabs(
      opened.files, "read", context,
      [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
        take(header, slab, first_slice);
        widen(contents.values, slab);
      },
      &contents.whole);
  contents.warnings = file.warnings;
  contents.names = opened.names.of(file);
  contents.labels = index->labels(contents.names);
  if (!are_labels(contents.labels)) {
    contents.labels.reset();
    return contents;
  }
  for (const Label& label : *contents.labels) {
    contents.surface_vertices.push_back(index->surface_vertices(label.value));
    contents.places.push_back(place_of(index->mask(label.value)));
  }
  return contents;
}

// @param label  in a file name; empty where a grey value was selected
fs::path output_path(const fs::path& pattern, const std::string& label) {
  std::string text = pattern.string();
  const std::string word = "{label}";
  for (std::size_t at = text.find(word); !label.empty() && at != std::string::npos; at = text.find(word, at)) {
    text.replace(at, word.size(), label);
  }
  return text;
}

// Says what one selection is going to be written to.
void announce_outputs(const ExtractFiles& files, const std::string& label, const Context& context) {
  context.writes(output_path(files.out, label), surface_endings());
  if (files.other_face) {
    context.writes(output_path(*files.other_face, label), surface_endings());
  }
}

// What a file says of itself.
void tell_of(const VolumeFile& file, const Context& context) {
  std::ranges::for_each(file.data_files, context.reads);
  std::ranges::for_each(file.warnings, context.warn);
}

VolumeSelection selection_of(const VolumeFile& file, const ExtractFiles& files, SelectedVoxels selected) {
  selected.file = files.volume.string();
  const auto kept = std::make_shared<SelectedVoxels>(std::move(selected));
  return {file.warnings, {}, {}, [kept](std::size_t) { return std::move(*kept); }};
}

VolumeSelection select_all_labels(const OpenedVolume& opened, const Context& context) {
  const ExtractFiles& files = opened.files;
  std::optional<LabelIndex> read_index;
  const VolumeFile file = read_slabs(files, "extract", context, indexing(files.volume, read_index));
  tell_of(file, context);
  const auto index = std::make_shared<LabelIndex>(*std::move(read_index));
  const auto labels = index->labels(opened.names.of(file));
  VolumeSelection selection{file.warnings, {}, {}, {}};
  if (!are_labels(labels) || labels->empty()) {
    selection.nothing = fmt::format("{}: {}", files.volume.string(),
                                    are_labels(labels) ? "holds no label: every voxel is 0"
                                                       : "is a grey volume, which has no labels: pass --isovalue V");
    return selection;
  }
  for (const Label& label : *labels) {
    selection.labels.push_back(fmt::format("{}", label.value));
    context.writes(output_path(files.out, selection.labels.back()), surface_endings());
  }
  selection.take = [index, labels = *labels, context, name = files.volume.string()](std::size_t i) {
    const auto stage = context.stage("extract");
    const double value = labels[i].value;
    return SelectedVoxels{{Inside::Rule::label, value},
                          "label " + named(labels[i]),
                          fmt::format("{}", value),
                          index->mask(value),
                          index->bounds(value),
                          nullptr,
                          {},
                          name,
                          {}};
  };
  return selection;
}

// The values of a grey volume are held where they are smoothed, or where that spares a second reading for little: a
// quarter of the memory that a case of the pipeline has.
bool holds_values(const ExtractFiles& files, const ExtractSettings& settings, const VolumeFile& header) {
  constexpr std::size_t most_bytes = std::size_t{1} << 30;
  const std::size_t voxel_bytes = std::visit([](const auto& values) { return sizeof(values[0]); }, header.volume.data);
  return settings.sigma || (!files.slab && header.volume.voxels() <= most_bytes / voxel_bytes);
}

VolumeSelection select_grey(const ExtractFiles& files, const ExtractSettings& settings, const Context& context) {
  const Inside inside = *files.grey;
  announce_outputs(files, {}, context);
  std::optional<Mask> mask;
  std::shared_ptr<VolumeFile> held;
  VolumeFile file;
  {
    const auto stage = context.stage("read");
    if (holds_values(files, settings, read_volume_header(files.volume, files.reading))) {
      held = std::make_shared<VolumeFile>(read_volume(files.volume, files.reading));
    }
  }
  if (held) {
    const auto stage = context.stage("extract");
    mask.emplace(select(held->volume, inside));
    note_not_finite(*held, files.volume, count_not_finite(held->volume));
  } else {
    file = read_slabs(files, "extract", context,
                      [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
                        if (!mask) {
                          mask.emplace(header.volume.dims, header.volume.affine);
                        }
                        select(slab, first_slice, inside, *mask);
                      });
  }
  tell_of(held ? *held : file, context);
  SelectedVoxels selected{
      inside, fmt::format("{} {}", inside.rule == Inside::Rule::below ? "below" : "above", inside.value),
      {},     *std::move(mask),
      {},     held ? &held->volume : nullptr};
  // Holds the values, or reads them once more.
  selected.show_values = [held, files](const std::function<void(const Volume&, std::size_t)>& show) {
    read_volume_slabs(files.volume, files.reading, slab_size(files),
                      [&](const VolumeFile&, const Volume& slab, std::size_t first_slice) { show(slab, first_slice); });
  };
  return selection_of(held ? *held : file, files, std::move(selected));
}

VolumeSelection select_label(const OpenedVolume& opened, const Context& context) {
  const ExtractFiles& files = opened.files;
  std::optional<LabelSelection> selection;
  std::string absent;
  Neighbours neighbours;
  VolumeFile file =
      read_slabs(files, "extract", context, [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
        if (first_slice == 0) {
          auto [choice, missing] = naming(files.volume.string(), [&] {
            return choose_labels(opened.names.of(header), opened.names.unfolded(*files.label));
          });
          absent = missing;
          if (choice) {
            announce_outputs(files, choice->in_file_name, context);
            selection.emplace(std::move(*choice), header.volume);
          }
        }
        if (selection) {
          selection->add(slab, first_slice);
          neighbours.add(slab);
        }
      });
  if (neighbours.are_grey()) {
    file.warnings.push_back(
        {Weight::major, "grey volume",
         fmt::format("{}: looks like a grey volume or a map of probabilities, not like labels: {:.0f} % of its "
                     "neighbouring voxels differ; the surface is around the voxels of this one value. For a surface "
                     "between values pass --isovalue V (ISOVALUE=V)",
                     files.volume.string(), 100 * real(neighbours.differing) / real(neighbours.pairs))});
  }
  tell_of(file, context);
  if (selection) {
    absent = selection->absent();
  }
  if (!selection || !absent.empty()) {
    return {file.warnings, no_label_text(files.volume, contents_of(opened, context), absent), {}, {}};
  }
  const LabelChoice& choice = selection->choice();
  return selection_of(
      file, files,
      {{Inside::Rule::label, choice.values[0]}, choice.name, choice.in_file_name, std::move(selection->mask())});
}

void write(const fs::path& out, TriangleMesh mesh, const std::string& name, const Vec3& voxel,
           const std::optional<WallFace>& face, const fs::path& volume, bool ras, const Context& context) {
  const auto stage = context.stage("write");
  PlyOptions ply;
  ply.comments = {fmt::format("tunica-extract {}", version), printable("made by " + context.made_by()),
                  printable("source " + context.name_of(volume)), printable(name),
                  fmt::format("voxel {:.6g} {:.6g} {:.6g} mm", voxel.x(), voxel.y(), voxel.z())};
  if (face) {
    ply.comments.push_back(fmt::format("face {}", name_of(*face)));
  }
  ply.space = ras ? "RAS" : "LPS";
  ply.overwrite = context.overwrite;
  for (Vec3& vertex : mesh.vertices) {
    if (ras) {
      vertex = {-vertex.x(), -vertex.y(), vertex.z()};
    }
  }
  write_surface(out, mesh, ply);
  context.note(fmt::format("{}: {} triangles, {:.6g} mm2", out.string(), mesh.triangles.size(), area(mesh)));
}

[[noreturn]] void throw_nothing(const OpenedVolume& opened, const std::string& name, const Context& context) {
  const VolumeContents contents = contents_of(opened, context);
  if (opened.files.label) {
    throw InputError(no_label_text(opened.files.volume, contents, *opened.files.label));
  }
  throw InputError(fmt::format("{}: no voxel is {}; its values are {:.6g} to {:.6g}", opened.files.volume.string(),
                               name, contents.values.lower, contents.values.upper));
}

}  // namespace

OpenedVolume open_volume(ExtractFiles files, const Context& context) {
  context.reads(files.volume);
  OpenedVolume opened{std::move(files), {}};
  opened.names.read(opened.files.volume, opened.files.names, context);
  if (opened.files.label && !opened.files.names) {
    opened.files.reading.segment = *opened.files.label;
  }
  return opened;
}

VolumeSelection select_voxels(const OpenedVolume& opened, const ExtractSettings& settings, const Context& context) {
  if (opened.files.label) {
    return select_label(opened, context);
  }
  if (opened.files.grey) {
    return select_grey(opened.files, settings, context);
  }
  if (opened.files.all_labels) {
    return select_all_labels(opened, context);
  }
  throw_choice(opened.files.volume, contents_of(opened, context));
}

SurfaceNumbers extract_to_file(const OpenedVolume& opened, SelectedVoxels selected, const ExtractSettings& settings,
                               const Context& context) {
  const ExtractFiles& files = opened.files;
  const std::string name = selected.name, label = selected.in_file_name;
  const Vec3 voxel = selected.mask.affine().leftCols<3>().colwise().norm();
  if (count_voxels(selected.mask) == 0) {
    throw_nothing(opened, name, context);
  }
  Extraction found = extract(std::move(selected), settings, context);
  context.has_read();
  write(output_path(files.out, label), std::move(found.mesh), found.name, voxel, settings.face, files.volume,
        settings.ras, context);
  if (const auto& thickness = found.numbers.thickness) {
    context.note(fmt::format("{}: the wall is {:.4g} mm thick in the mean, {:.4g} to {:.4g} mm over nine tenths of it",
                             name, thickness->mean, thickness->p5, thickness->p95));
  }
  if (files.other_face) {
    const WallFace hidden = behind(*settings.face);
    write(output_path(*files.other_face, label), *std::move(found.other),
          fmt::format("{}, {} face", name, name_of(hidden)), voxel, hidden, files.volume, settings.ras, context);
  }
  return found.numbers;
}

std::pair<std::string, Json> describe_volume(const OpenedVolume& opened, std::size_t shells, const Context& context) {
  VolumeFile header = read_volume_header(opened.files.volume, opened.files.reading);
  const VolumeContents contents = contents_of(opened, context);
  header.warnings = contents.warnings;
  auto [text, info] = volume_info(opened.files.volume, header, contents, shells);
  info["warnings"] = texts_of(header.warnings);
  tell_of(header, context);
  return {std::move(text), std::move(info)};
}

}  // namespace tunica::chain
