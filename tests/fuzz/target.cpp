#include "fuzz/target.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/tet_file.hpp"
#include "tunica/io/volume/volume_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <utility>

namespace tunica::fuzz {
namespace fs = std::filesystem;
namespace {

struct OwnFolder {
  OwnFolder() {
    std::string name = (fs::temp_directory_path() / "tunica-fuzz-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      fail("no folder for the files can be made");
    }
    path = name;
  }
  ~OwnFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;

  fs::path path;
};

std::size_t voxels_in(const Volume& volume) {
  return std::visit([](const auto& values) { return values.size(); }, volume.data);
}

void read_volume_in_all_ways(const fs::path& path, const VolumeOptions& options) {
  std::optional<VolumeFile> whole;
  const std::string place = path.parent_path().string();
  accepted([&] { whole = read_volume(path, options); }, place);
  if (whole) {
    require(voxels_in(whole->volume) == whole->volume.voxels(), "a volume has a value for each voxel");
    require(whole->volume.affine.allFinite(), "the place of a volume is finite");
  }
  std::size_t slices = 0, voxels = 0;
  SlabSize one;
  one.slices = 1;
  const bool in_slabs = accepted(
      [&] {
        read_volume_slabs(path, options, one, [&](const VolumeFile&, const Volume& slab, std::size_t first) {
          require(first == slices, "slabs come in order");
          slices += slab.dims[2];
          voxels += voxels_in(slab);
        });
      },
      place);
  require(in_slabs == whole.has_value(), "a volume is read whole and in slabs, or in neither way");
  require(!whole || (slices == whole->volume.dims[2] && voxels == whole->volume.voxels()), "slabs are the whole");
  const bool header = accepted([&] { read_volume_header(path, options); }, place);
  require(header || !whole, "a volume that can be read has a header");
}

}  // namespace

const fs::path& folder() {
  static const OwnFolder own;
  return own.path;
}

fs::path file(const std::string& name, std::string_view bytes) {
  const fs::path path = folder() / name;
  ::unlink(path.c_str());
  const int descriptor = ::open(path.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600);
  while (descriptor >= 0 && !bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written <= 0) {
      break;
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  if (descriptor < 0 || !bytes.empty()) {
    fail("a file of the harness cannot be written");
  }
  ::close(descriptor);
  return path;
}

void fail(const std::string& why) {
  std::fprintf(stderr, "broken promise: %s\n", why.c_str());
  std::abort();
}

bool accepted(const std::function<void()>& reader, const std::string& place) {
  try {
    reader();
    return true;
  } catch (const InputError& error) {
    if (!std::string_view(error.what()).starts_with(place)) {
      fail(std::string("a message does not begin with the file: ") + error.what());
    }
  } catch (const Error&) {
  }
  return false;
}

void volume_at(const fs::path& path, bool slices) {
  VolumeOptions options;
  if (slices) {
    options.spacing = Vec3(1, 1, 2);
  }
  read_volume_in_all_ways(path, options);
  options.segment = "aorta";
  read_volume_in_all_ways(path, options);
  options.segment.reset();
  options.prefer_qform = true;
  options.frame = 0;
  options.layer = 0;
  read_volume_in_all_ways(path, options);
}

void volume(const std::string& name, std::string_view bytes) { volume_at(file(name, bytes), false); }

void mesh(const std::string& name, std::string_view bytes) {
  const fs::path path = file(name, bytes);
  accepted(
      [&] {
        const MeshFile read = read_mesh(path);
        require(!read.mesh.triangles.empty(), "a mesh has triangles");
        for (const auto& triangle : read.mesh.triangles) {
          for (const Index corner : triangle) {
            require(corner < read.mesh.vertices.size(), "corners are there");
          }
        }
        for (const Vec3& vertex : read.mesh.vertices) {
          require(vertex.allFinite(), "vertices are finite");
        }
        require(read.normals.empty() || read.normals.size() == read.mesh.vertices.size(), "a normal each");
        require(read.corner_normals.empty() || read.corner_normals.size() == read.mesh.triangles.size(),
                "three normals each");
        for (const auto& property : read.vertex_properties) {
          require(property.second.size() == read.mesh.vertices.size(), "a value each");
        }
        shell_of(read, path);
      },
      path.string());
}

void tetrahedra(const std::string& name, std::string_view bytes) {
  const fs::path path = file(name, bytes);
  accepted(
      [&] {
        const TetFile read = read_tetrahedra(path, 1.0, 1.0);
        require(!read.mesh.tetrahedra.empty(), "there are tetrahedra");
        for (const auto& tetrahedron : read.mesh.tetrahedra) {
          for (const Index corner : tetrahedron) {
            require(corner < read.mesh.vertices.size(), "corners are there");
          }
        }
        for (const Vec3& vertex : read.mesh.vertices) {
          require(vertex.allFinite(), "vertices are finite");
        }
      },
      path.string());
}

}  // namespace tunica::fuzz
