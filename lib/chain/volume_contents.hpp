#pragma once

#include "tunica/core/json.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/io/volume/label_names.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/volume/cubes/label_index.hpp"
#include "tunica/volume/labels/whole_labels.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// What is in a volume, for who chooses from it.
namespace tunica::chain {

/// Where a label is.
struct LabelPlace {
  Vec3 lower = Vec3::Zero(), upper = Vec3::Zero();  ///< mm, LPS: the box around its voxels
  std::size_t pieces = 0;                           ///< 6-connected
  std::size_t openings = 0;                         ///< connected parts of the image's border that cut it
};
LabelPlace place_of(const Mask& label);

struct VolumeContents {
  std::vector<Warning> warnings;
  std::optional<std::vector<Label>> labels;   ///< none: a grey volume
  std::vector<std::size_t> surface_vertices;  ///< per label, of its surface before decimation
  std::vector<LabelPlace> places;             ///< per label
  LabelNames names;
  Interval values{infinity, -infinity};  ///< of all voxels
  Wholeness whole;                       ///< of all voxels
};

/// Adds the note that values were rounded to labels, where some were.
void note_rounded(VolumeFile& file, const std::filesystem::path& path, const Wholeness& whole);

/// Errors: InputError where values lie between whole numbers: labels of such a volume have lost their borders.
/// @param asked  the label, by value or name; none: all. A value that is no whole number is taken as it stands.
void require_whole(const std::filesystem::path& path, const Wholeness& whole, const std::optional<std::string>& asked);

/// Whether a volume of these values is a segmentation: whole numbers, and not too many of them.
bool are_labels(const std::optional<std::vector<Label>>& labels);

/// One line of printable text, whatever a file says or is called: '?' for each control character.
std::string printable(std::string text);

/// "3 (aorta)".
std::string named(const Label& label);

/// Says what can be chosen. Errors: UsageError always; InputError where a segmentation holds no label.
[[noreturn]] void throw_choice(const std::filesystem::path& volume, const VolumeContents& contents);

/// What there is in the place of the label asked for, a sentence.
/// @param asked  a value or a name
std::string no_label_text(const std::filesystem::path& volume, const VolumeContents& contents,
                          const std::string& asked);

/// What `tunica-extract --info` prints of a volume and adds to its report (`docs/report-keys.md`).
/// @param shells  of the chain whose memory is estimated per label
std::pair<std::string, Json> volume_info(const std::filesystem::path& volume, const VolumeFile& file,
                                         const VolumeContents& contents, std::size_t shells);

}  // namespace tunica::chain
