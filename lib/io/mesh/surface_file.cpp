#include "tunica/io/mesh/surface_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"

#include <assimp/DefaultIOSystem.h>
#include <assimp/material.h>
#include <assimp/scene.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <assimp/Exporter.hpp>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <sstream>
#include <string_view>

namespace tunica {
namespace {

aiVector3D vector_of(const Vec3& v) {
  return {static_cast<ai_real>(v.x()), static_cast<ai_real>(v.y()), static_cast<ai_real>(v.z())};
}

// glTF's colours are linear light. Source: IEC 61966-2-1.
float linear_light(double srgb) {
  return static_cast<float>(srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4));
}

// assimp's scene owns all of it, as bare arrays.
std::unique_ptr<aiMesh> assimp_mesh(const TriangleMesh& mesh, const SurfaceLook& look, bool linear_colours) {
  auto made = std::make_unique<aiMesh>();
  made->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
  made->mNumVertices = narrow<unsigned>(mesh.vertices.size());
  made->mVertices = new aiVector3D[mesh.vertices.size()];
  std::ranges::transform(mesh.vertices, made->mVertices, vector_of);
  if (!look.normals.empty()) {
    made->mNormals = new aiVector3D[mesh.vertices.size()];
    std::ranges::transform(look.normals, made->mNormals, vector_of);
  }
  if (!look.colours.empty()) {
    made->mColors[0] = new aiColor4D[mesh.vertices.size()];
    std::ranges::transform(look.colours, made->mColors[0], [&](const auto& c) {
      const auto part = [&](double value) { return linear_colours ? linear_light(value) : static_cast<float>(value); };
      return aiColor4D(part(c[0]), part(c[1]), part(c[2]), 1);
    });
  }
  made->mNumFaces = narrow<unsigned>(mesh.triangles.size());
  made->mFaces = new aiFace[mesh.triangles.size()];
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    aiFace& face = made->mFaces[t];
    face.mNumIndices = 3;
    face.mIndices = new unsigned[3];
    std::ranges::copy(mesh.triangles[t], face.mIndices);
  }
  return made;
}

// As much of a text as an aiString holds when it is written that way.
aiString in_short(std::string text, std::string (*written)(const std::string&)) {
  constexpr std::size_t longest = sizeof(aiString::data) - 1;
  text.resize(std::min(text.size(), longest));
  while (written(text).size() > longest) {
    text.pop_back();
  }
  return aiString(written(text));
}

// @param provenance  the name of the mesh: assimp 5.2 writes no other text to a GLB (of a node's metadata nothing)
std::unique_ptr<aiScene> assimp_scene(std::unique_ptr<aiMesh> mesh, bool metres, const std::string& provenance) {
  auto scene = std::make_unique<aiScene>();
  scene->mMetaData = new aiMetadata();
  scene->mNumMaterials = 1;
  scene->mMaterials = new aiMaterial* [1] { new aiMaterial() };
  mesh->mName = in_short(provenance, as_utf8);
  scene->mNumMeshes = 1;
  scene->mMeshes = new aiMesh* [1] { mesh.release() };
  auto* node = new aiNode("surface");
  node->mNumMeshes = 1;
  node->mMeshes = new unsigned[1]{0};
  if (metres) {
    // By the node: assimp joins vertices nearer than 1e-5 of the unit, which must not be 0.01 mm.
    constexpr ai_real metres_per_mm = 1e-3F;
    aiMatrix4x4::Scaling(aiVector3D(metres_per_mm), node->mTransformation);
  }
  scene->mRootNode = new aiNode("scene");
  scene->mRootNode->addChildren(1, &node);  // 3MF holds what hangs below the root
  return scene;
}

std::string joined(const PlyOptions& options) {
  std::string text = fmt::format("SPACE={}; {}", options.space, fmt::join(options.comments, "; "));
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return text;
}

std::uint32_t number_at(std::string_view bytes, std::size_t at, std::size_t width) {
  TUNICA_ASSERT(at + width <= bytes.size());
  std::uint32_t number = 0;
  for (std::size_t i = width; i-- > 0;) {
    number = number << 8U | static_cast<unsigned char>(bytes[at + i]);
  }
  return number;
}

// The same surface makes the same bytes: no member of the archive keeps the time of its making. @return false when the
// archive is not whole. Source: APPNOTE.TXT 6.3 (PKWARE), 4.3.7, 4.3.12, 4.3.16.
bool clear_times(std::string& zip) {
  constexpr std::size_t end_size = 22;  // of the record at the end, which has no comment
  constexpr std::size_t entry_size = 46;
  constexpr std::size_t member_size = 30;
  const std::string_view first_day("\0\0\x21\0", 4);  // midnight, and 1 January 1980: there is no earlier one
  const auto is = [&](std::size_t at, std::size_t size, std::string_view signature) {
    return at + size <= zip.size() && zip.compare(at, signature.size(), signature) == 0;
  };
  const std::size_t end = std::max(zip.size(), end_size) - end_size;
  if (!is(end, end_size, "PK\5\6")) {
    return false;
  }
  std::size_t entry = number_at(zip, end + 16, 4);
  for (std::uint32_t left = number_at(zip, end + 10, 2); left > 0; --left) {
    if (!is(entry, entry_size, "PK\1\2")) {
      return false;
    }
    const std::size_t member = number_at(zip, entry + 42, 4);
    if (!is(member, member_size, "PK\3\4")) {
      return false;
    }
    zip.replace(entry + 12, first_day.size(), first_day);
    zip.replace(member + 10, first_day.size(), first_day);
    entry += entry_size + number_at(zip, entry + 28, 2) + number_at(zip, entry + 30, 2) + number_at(zip, entry + 32, 2);
  }
  return entry == end;
}

// assimp removes a file that is there.
struct NothingThere : Assimp::DefaultIOSystem {
  bool Exists(const char* /*file*/) const override { return false; }
};

// What made the surface is the name of its material: metadata would come where 3MF allows none, and of a mesh's name
// assimp writes nothing.
std::string bytes_of_3mf(const aiScene& scene, const std::string& provenance, const std::filesystem::path& path) {
  const aiString name = in_short(provenance, [](const std::string& text) { return xml_escaped(as_utf8(text)); });
  scene.mMaterials[0]->AddProperty(&name, AI_MATKEY_NAME);
  // assimp writes this archive into a file alone, and passes over the errors of its archiver: one of memory has no full
  // disk.
  const int descriptor = ::memfd_create("tunica", MFD_CLOEXEC);
  const std::string file = fmt::format("/proc/self/fd/{}", descriptor);
  Assimp::Exporter exporter;
  exporter.SetIOHandler(new NothingThere);  // which it deletes
  const bool made = descriptor >= 0 && exporter.Export(&scene, "3mf", file) == aiReturn_SUCCESS;
  std::stringstream bytes;
  bytes << std::ifstream(file, std::ios::binary).rdbuf();
  ::close(descriptor);
  std::string archive = std::move(bytes).str();
  if (!made || !clear_times(archive)) {
    throw OutputError(
        fmt::format("{}: cannot be made: {}", path.string(),
                    made ? "the archive is not whole; is there no /proc here?" : exporter.GetErrorString()));
  }
  return archive;
}

}  // namespace

const std::vector<std::string>& surface_endings() {
  static const std::vector<std::string> endings{".ply", ".glb", ".obj", ".stl", ".3mf"};
  return endings;
}

void write_surface(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyOptions& options,
                   const SurfaceLook& look) {
  const std::string ending = path.extension().string();
  if (ending == ".ply") {
    write_ply(path, mesh, options);
    return;
  }
  TUNICA_ASSERT(std::ranges::find(surface_endings(), ending) != surface_endings().end());
  TUNICA_ASSERT(!options.partial && options.millimetres);
  const bool glb = ending == ".glb";
  const std::string provenance = joined(options);
  const auto scene = assimp_scene(assimp_mesh(mesh, look, glb), glb, provenance);
  if (ending == ".3mf") {
    write_file(path, bytes_of_3mf(*scene, provenance, path), options.overwrite);
    return;
  }
  Assimp::Exporter exporter;
  const aiExportDataBlob* blob = exporter.ExportToBlob(scene.get(), glb                ? "glb2"
                                                                    : ending == ".obj" ? "objnomtl"
                                                                                       : "stlb");
  if (blob == nullptr) {
    throw OutputError(fmt::format("{}: cannot be made: {}", path.string(), exporter.GetErrorString()));
  }
  std::string bytes(static_cast<const char*>(blob->data), blob->size);
  if (ending == ".obj") {
    bytes = fmt::format("# {}\n# units mm\n", provenance) + bytes;
  } else if (ending == ".stl") {
    constexpr std::size_t header = 80;
    std::string head = "units=mm; " + provenance;
    head.resize(header, ' ');
    bytes.replace(0, header, head);
  }
  write_file(path, bytes, options.overwrite);
}

}  // namespace tunica
