#include "tunica/io/volume/volume_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace fs = std::filesystem;
namespace {

using namespace volume_format;

// The beginning of a file's content, inflated if need be.
std::string head_of(const fs::path& path) {
  ByteStream stream(path, 0, coding_of(path));
  std::string head(1024, '\0');
  head.resize(stream.read(head.data(), head.size()));
  return head;
}

// What the content is, when it is something else that people have in such folders.
std::string other_content(const fs::path& path, std::string_view head) {
  const auto begins = [&](std::string_view magic) { return head.starts_with(magic); };
  const std::string extension = lower_case(path.extension().string());
  if (begins("ply") || begins("OFF") || begins("glTF") || begins("solid") || begins("# vtk DataFile") ||
      begins("<?xml") || begins("<VTKFile") || extension == ".stl" || extension == ".obj" || extension == ".off" ||
      extension == ".vtk" || extension == ".vtp") {
    return "is a surface mesh or another VTK file, not a volume; the volume is wanted here";
  }
  if (head.size() >= 132 && head.substr(128, 4) == "DICM") {
    return "is DICOM: convert the series to NIfTI first (for example with dcm2niix)";
  }
  if (begins("\x89HDF")) {
    return "is an HDF5 file: convert the volume to NIfTI, NRRD or MetaImage first";
  }
  if (begins("\xff\xd8\xff") || begins("GIF8") || begins("BM")) {
    return "is a picture whose format is not exact enough for labels: save the slices as PNG or TIFF";
  }
  return "is not a volume that tunica knows: NIfTI (.nii, .nii.gz), NRRD (.nrrd, .seg.nrrd, .nhdr), MetaImage (.mha, "
         ".mhd), a multi-page TIFF, or a folder of TIFF or PNG slices";
}

// The NIfTI header beside X.img or X.img.gz.
std::optional<fs::path> header_of_image(const fs::path& path) {
  fs::path base = path;
  if (lower_case(base.extension().string()) == ".gz") {
    base.replace_extension();
  }
  if (lower_case(base.extension().string()) != ".img") {
    return {};
  }
  for (const char* extension : {".hdr", ".hdr.gz", ".HDR"}) {
    const fs::path header = fs::path(base).replace_extension(extension);
    std::error_code error;
    if (fs::is_regular_file(header, error) && looks_like_nifti(head_of(header))) {
      return header;
    }
  }
  return {};
}

// The header that names data without one: X.mhd or X.nhdr of X.raw, X.zraw, X.raw.gz.
std::string header_hint(const fs::path& path) {
  const fs::path base = lower_case(path.extension().string()) == ".gz" ? path.parent_path() / path.stem() : path;
  for (const char* extension : {".mhd", ".nhdr", ".hdr"}) {
    const fs::path header = fs::path(base).replace_extension(extension);
    std::error_code error;
    if (header != path && fs::is_regular_file(header, error)) {
      return fmt::format("holds voxels without a header: name {}, which is beside it", header.string());
    }
  }
  return {};
}

VolumeFile read_known(const fs::path& path, const VolumeOptions& options, const SlabSink* sink) {
  const auto refuse_spacing = [&] {
    if (options.spacing) {
      throw UsageError(fmt::format("{}: --spacing is for slice stacks; this file brings its own", path.string()));
    }
  };
  std::error_code error;
  if (fs::is_directory(path, error)) {
    return read_slices(path, options, sink);
  }
  const std::string head = head_of(path);
  if (head.empty()) {
    throw InputError(fmt::format("{}: is empty", path.string()));
  }
  if (const auto header = looks_like_nifti(head) ? std::nullopt : header_of_image(path)) {
    refuse_spacing();
    return read_nifti(*header, options, sink, path);
  }
  if (looks_like_tiff(head) || looks_like_png(head)) {
    return read_slices(path, options, sink);
  }
  if (looks_like_nifti(head)) {
    refuse_spacing();
    return read_nifti(path, options, sink);
  }
  if (looks_like_nrrd(head)) {
    refuse_spacing();
    return read_nrrd(path, options, sink);
  }
  if (looks_like_metaimage(head)) {
    refuse_spacing();
    return read_metaimage(path, options, sink);
  }
  const std::string hint = header_hint(path);
  throw InputError(fmt::format("{}: {}", path.string(), hint.empty() ? other_content(path, head) : hint));
}

VolumeFile read_any(const fs::path& path, const VolumeOptions& options, const SlabSink* sink) {
  constexpr double shortest = 1e-4, longest = 50;  // mm: of a microscope, and more than any scanner's
  VolumeFile file = read_known(path, options, sink);
  const Vec3& edges = file.spacing;
  if (edges.maxCoeff() > longest || edges.minCoeff() < shortest) {
    file.warnings.push_back({Weight::major, "voxel size",
                             fmt::format("{}: its voxels are {:.3g} x {:.3g} x {:.3g} mm: is their unit right?",
                                         path.string(), edges[0], edges[1], edges[2])});
  }
  // Twice as long as wide: from there on the slices, not the pixels, decide how well the surface is known.
  constexpr double notable = 2;
  if (edges.maxCoeff() > notable * edges.minCoeff()) {
    file.warnings.push_back(
        {Weight::minor, "anisotropic voxels",
         fmt::format("{}: its voxels are {:.3g} x {:.3g} x {:.3g} mm: where the organ's surface lies along the slices, "
                     "it is known to half a slice, {:.3g} mm; displacements and stresses of single places are as "
                     "uncertain there: trust means over the organ, or take thinner slices",
                     path.string(), edges[0], edges[1], edges[2], edges.maxCoeff() / 2)});
  }
  const auto& dims = file.volume.dims;
  if (std::ranges::count(dims, std::size_t{1}) == 1 && file.volume.voxels() > 1) {
    file.warnings.push_back(
        {Weight::major, "single slice",
         fmt::format("{}: is {} x {} x {} voxels, a single slice: its surface is that of a sheet one voxel thick; name "
                     "the whole volume (of slices in files: the folder or a multi-page TIFF)",
                     path.string(), dims[0], dims[1], dims[2])});
  }
  return file;
}

}  // namespace

VolumeFile read_volume(const fs::path& path, const VolumeOptions& options) {
  VolumeFile file = read_any(path, options, nullptr);
  const std::size_t values = std::visit([](const auto& data) { return data.size(); }, file.volume.data);
  TUNICA_ASSERT(values == file.volume.voxels());
  return file;
}

VolumeFile read_volume_slabs(const fs::path& path, const VolumeOptions& options, const SlabSize& size,
                             const SlabVisitor& visit) {
  std::size_t taken = 0;
  const SlabSink sink{size, [&](const VolumeFile& file, const Volume& slab, std::size_t first_slice) {
                        TUNICA_ASSERT(first_slice == taken && slab.dims[0] == file.volume.dims[0] &&
                                      slab.dims[1] == file.volume.dims[1]);
                        taken += slab.dims[2];
                        visit(file, slab, first_slice);
                      }};
  VolumeFile file = read_any(path, options, &sink);
  TUNICA_ASSERT(taken == file.volume.dims[2]);
  return file;
}

VolumeFile read_volume_header(const fs::path& path, const VolumeOptions& options) {
  const SlabSink nowhere{};
  return read_any(path, options, &nowhere);
}

}  // namespace tunica
