#pragma once

#include "tunica/chain/extract.hpp"
#include "tunica/chain/label_choice.hpp"
#include "tunica/chain/volume_contents.hpp"
#include "tunica/io/volume/volume_file.hpp"

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// From volumes that are read slab by slab to surfaces in files.
namespace tunica::chain {

/// A volume, and what of it goes where: that of labels by name or value ("1+2": their union), of a grey value, or of
/// every label.
struct ExtractFiles {
  std::filesystem::path volume, out;                ///< {label} in a name is the label
  std::optional<std::filesystem::path> other_face;  ///< of a wall
  std::optional<std::filesystem::path> names;       ///< a table of labels
  VolumeOptions reading;
  std::optional<std::size_t> slab;   ///< slices read at a time; none: 64 MiB, a grey volume up to 1 GiB at once
  std::optional<std::string> label;  ///< one of these three
  std::optional<Inside> grey;
  bool all_labels = false;
};

/// A volume with the names of its labels.
struct OpenedVolume {
  ExtractFiles files;
  LabelTables names;
};

/// Reads the tables of names. Errors: as LabelTables::read().
OpenedVolume open_volume(ExtractFiles files, const Context& context);

/// What was selected of it, in memory one at a time.
struct VolumeSelection {
  std::vector<Warning> warnings;                      ///< of the file
  std::optional<std::string> nothing;                 ///< why there is nothing to take
  std::vector<std::string> labels;                    ///< by their values, where all are wanted
  std::function<SelectedVoxels(std::size_t i)> take;  ///< once each
};

/// One pass over the volume, whatever the number of labels. Errors: UsageError: nothing is wanted, with what there is.
VolumeSelection select_voxels(const OpenedVolume& volume, const ExtractSettings& settings, const Context& context);

/// Extracts one surface and writes it. @return what is known of it. Errors: as extract(); InputError: no voxel is
/// selected; OutputError.
SurfaceNumbers extract_to_file(const OpenedVolume& volume, SelectedVoxels selected, const ExtractSettings& settings,
                               const Context& context);

/// What is in a volume, as a text and for the report. @param shells  of the chain whose memory is estimated per label
std::pair<std::string, Json> describe_volume(const OpenedVolume& volume, std::size_t shells, const Context& context);

}  // namespace tunica::chain
