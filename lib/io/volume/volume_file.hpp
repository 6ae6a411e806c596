#pragma once

#include "tunica/core/types.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/volume/labels/volume.hpp"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

/// The choices a volume file may need.
struct VolumeOptions {
  std::optional<std::size_t> frame;  ///< which 3-D volume of a time series, from 0
  std::optional<std::size_t> layer;  ///< which layer of overlapping segments (a `list` axis), from 0
  /// The segment that is wanted, by name or value, or several with + between them: its layer is read where `layer`
  /// chooses none. InputError where the file names it in another layer than `layer`, or in several.
  std::optional<std::string> segment;
  bool prefer_qform = false;    ///< NIfTI: the qform wins where both transforms are set
  std::optional<Vec3> spacing;  ///< slice stacks: mm per column, row and slice
};

/// A segment as a .seg.nrrd names it: the voxels of `label` in one of the layers.
struct Segment {
  std::string name;
  double label = 1;
  std::optional<std::size_t> layer;  ///< none: the file has several layers, and does not say in which it is
};

/// A volume as read, and what the file said about itself.
struct VolumeFile {
  Volume volume;
  std::string format;             ///< "NIfTI-1", "NRRD", "MetaImage", "TIFF stack", …
  std::string datatype;           ///< stored type of a voxel, "uint8" … "float64"
  Vec3 spacing = Vec3::Ones();    ///< mm between neighbouring voxels along i, j, k
  std::string orientation;        ///< where i, j, k point to, e.g. "RAS", "LPS"
  std::string transform;          ///< where the orientation comes from, e.g. "sform", "space directions"
  std::size_t frames = 1;         ///< in the file; one of them is in `volume`
  std::size_t layers = 1;         ///< in the file; one of them is in `volume`
  std::vector<Segment> segments;  ///< of all layers; the names of that in `volume` are its label_names
  std::vector<Warning> warnings;
  std::vector<std::filesystem::path> data_files;  ///< further files that were read (detached data, slices)
};

/// Reads NIfTI-1/2 (.nii, .nii.gz, .hdr/.img, either named), NRRD (.nrrd, .seg.nrrd, .nhdr), MetaImage (.mha, .mhd),
/// multi-page TIFF, or a folder of TIFF or PNG slices. The format is known by content, not by name. Errors: InputError
/// naming the file: missing, not a volume, truncated (with the bytes that are missing), hostile, or with more than one
/// frame or layer and none chosen, with channels. UsageError: a slice stack without spacing, a spacing for others.
/// Cost: memory for the voxels of one frame, and never more than the bytes in the file can hold.
VolumeFile read_volume(const std::filesystem::path& path, const VolumeOptions& options = {});

/// Takes the slices [first_slice, first_slice + slab.dims[2]) of a volume. `file` is what read_volume() returns, but
/// for the voxels; the slab's affine, slope and intercept are those of the whole volume.
using SlabVisitor = std::function<void(const VolumeFile& file, const Volume& slab, std::size_t first_slice)>;

/// How much is read at a time: as many slices as both allow, one at least.
struct SlabSize {
  std::size_t bytes = std::size_t{64} << 20;
  std::optional<std::size_t> slices;
};

/// As read_volume(), giving the voxels slab by slab, in order, each slice once, so that a volume larger than memory can
/// be read. Compressed streams are inflated on the way.
/// @return the file without voxels
/// Errors: as read_volume(); those about the end of the file come after the last slab. What `visit` throws.
/// Cost: memory for one slab.
VolumeFile read_volume_slabs(const std::filesystem::path& path, const VolumeOptions& options, const SlabSize& size,
                             const SlabVisitor& visit);

/// What read_volume() returns, but for the voxels, which are not read: its data is empty, of their type. Errors: as
/// read_volume(), but for those about the voxels themselves and the end of the file.
VolumeFile read_volume_header(const std::filesystem::path& path, const VolumeOptions& options = {});

/// Writes NIfTI-1, gzip-compressed when the name ends in ".gz". World transform as sform (float32), and as qform too
/// where it has no shear; the same volume gives the same bytes. Errors: OutputError; InputError when a dimension is
/// over 32767, NIfTI-1's limit.
/// @param made_by  provenance, kept as a comment
void write_nifti(const std::filesystem::path& path, const Volume& volume, bool overwrite,
                 const std::string& made_by = {});

}  // namespace tunica
