#pragma once

#include "tunica/io/volume/detail/byte_stream.hpp"
#include "tunica/io/volume/volume_file.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// What the volume formats share. Internal to lib/io.
namespace tunica::volume_format {

/// Stored types, in the order of Volume::Data's alternatives.
enum class VoxelType { uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64 };

/// Bytes of one stored voxel, and the type's name for messages.
std::size_t size_of(VoxelType type);
std::string name_of(VoxelType type);

/// An axis of the stored array. With `pick`, only that one of its `size` slabs is wanted.
struct Axis {
  std::uint64_t size = 1;
  std::optional<std::uint64_t> pick;
};

/// Takes the voxels of a volume slab by slab, instead of the file's volume.
struct SlabSink {
  SlabSize size;
  SlabVisitor visit;  ///< none: the voxels are not read

  /// Slices of `type` in a slab.
  [[nodiscard]] std::size_t slices(const std::array<std::size_t, 3>& dims, VoxelType type) const;
};

/// Reads an array whose first axis runs fastest, and checks that the stream holds all of it, before memory is taken:
/// into the file's volume, whose dims are those of the array's axes without a pick, or with a sink into that.
/// Trailing bytes become a warning.
/// @param more  bytes that follow are no surprise
/// Errors: InputError: overflow, truncated.
void read_voxels(VolumeFile& file, ByteStream& stream, VoxelType type, bool big_endian, const std::vector<Axis>& axes,
                 const SlabSink* sink, bool more = false);

/// Bytes of the array; the largest number where they overflow it.
std::uint64_t stored_bytes(const std::vector<Axis>& axes, VoxelType type);

/// As read_voxels, for numbers written as text.
void read_text_voxels(VolumeFile& file, ByteStream& stream, VoxelType type, const std::vector<Axis>& axes,
                      const SlabSink* sink);

/// `count` voxels of 0.
Volume::Data make_voxels(VoxelType type, std::size_t count);

/// Sets the name of the voxels' type, and the volume's data to no voxels of it.
inline void set_type(VolumeFile& file, VoxelType type) {
  file.datatype = name_of(type);
  file.volume.data = make_voxels(type, 0);
}

/// Index of the frame (layer) to read of `count`: the only one, or the one chosen.
/// @param what  "frame" or "layer"; @param hint  added to the message that asks for the choice
/// Errors: InputError: none chosen of several, or the choice does not exist.
std::size_t choose(const std::filesystem::path& path, const char* what, std::uint64_t count,
                   std::optional<std::size_t> chosen, const std::string& hint = {});

/// How many leading axes of one sample are channels of deep learning (1, X, Y, Z), not space: those before exactly
/// three longer ones; 0 where there is none.
std::size_t leading_channels(std::span<const std::uint64_t> sizes);

/// The note of that.
Warning channel_note(const std::filesystem::path& path, std::span<const std::uint64_t> sizes);

/// Index of the frame to read of an array whose first three axes are space, and the fourth time. Where the first is
/// the shortest of four it is rather of channels, one class each: that is said. Errors: as choose().
std::size_t choose_frame(VolumeFile& file, const std::filesystem::path& path, std::span<const std::uint64_t> sizes,
                         std::optional<std::size_t> chosen);

/// Why no volume can lie so in space; none where one can.
std::optional<std::string> affine_error(const Eigen::Matrix<double, 3, 4>& affine);

/// Sets the volume's affine (index to LPS mm), spacing and orientation letters.
/// Errors: InputError: not finite, singular, or beyond any scanner.
void set_affine(VolumeFile& file, const std::filesystem::path& path, const Eigen::Matrix<double, 3, 4>& lps);

/// RAS to LPS and back.
Eigen::Matrix<double, 3, 4> flip_xy(Eigen::Matrix<double, 3, 4> affine);

/// Warns where a label in the volume has several names.
void warn_of_several_names(VolumeFile& file, const std::filesystem::path& path);

/// Sets volume.dims. Errors: InputError: a size is 0 or the count overflows.
void set_dims(VolumeFile& file, const std::filesystem::path& path, std::span<const std::uint64_t, 3> dims);

/// The data file a header names, beside the header. Errors: InputError: absolute, in another folder, missing.
std::filesystem::path data_file_beside(const std::filesystem::path& header, const std::string& name);

/// What a file says, fit for a message: without control characters, not longer than 200 bytes.
std::string shown(std::string_view text);

/// Text of a header line without the white space around it.
std::string_view trimmed(std::string_view text);
/// The words of a line, split at white space.
std::vector<std::string_view> words(std::string_view text);
std::string lower_case(std::string_view text);
/// A whole number >= 0 that fills the text.
std::optional<std::uint64_t> parse_count(std::string_view text);

/// One reader per format. `head` is the beginning of the file's content, inflated if need be.
bool looks_like_nifti(std::string_view head);
bool looks_like_nrrd(std::string_view head);
bool looks_like_metaimage(std::string_view head);
bool looks_like_tiff(std::string_view head);
bool looks_like_png(std::string_view head);

/// Each reads a whole file of its format, detached data included; the voxels into the sink where there is one.
/// Errors: InputError naming the file.
/// @param image  NIfTI pairs: the file with the voxels; without it that beside the header
VolumeFile read_nifti(const std::filesystem::path& path, const VolumeOptions& options, const SlabSink* sink,
                      const std::optional<std::filesystem::path>& image = {});
VolumeFile read_nrrd(const std::filesystem::path& path, const VolumeOptions& options, const SlabSink* sink);
VolumeFile read_metaimage(const std::filesystem::path& path, const VolumeOptions& options, const SlabSink* sink);
VolumeFile read_slices(const std::filesystem::path& path, const VolumeOptions& options, const SlabSink* sink);

}  // namespace tunica::volume_format
