#include "tunica/io/mesh/surface_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"

#include <assimp/scene.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <assimp/Exporter.hpp>
#include <cmath>
#include <memory>

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

// @param provenance  the name of the mesh: assimp 5.2 writes no other text to a GLB (of a node's metadata nothing)
std::unique_ptr<aiScene> assimp_scene(std::unique_ptr<aiMesh> mesh, bool metres, const std::string& provenance) {
  auto scene = std::make_unique<aiScene>();
  scene->mMetaData = new aiMetadata();
  scene->mNumMaterials = 1;
  scene->mMaterials = new aiMaterial* [1] { new aiMaterial() };
  constexpr std::size_t longest_name = 1000;                                     // aiString holds 1023 bytes
  mesh->mName = aiString(as_utf8(as_utf8(provenance).substr(0, longest_name)));  // a sign that is cut in two is none
  scene->mNumMeshes = 1;
  scene->mMeshes = new aiMesh* [1] { mesh.release() };
  scene->mRootNode = new aiNode("surface");
  scene->mRootNode->mNumMeshes = 1;
  scene->mRootNode->mMeshes = new unsigned[1]{0};
  if (metres) {
    // By the node: assimp joins vertices nearer than 1e-5 of the unit, which must not be 0.01 mm.
    constexpr ai_real metres_per_mm = 1e-3F;
    aiMatrix4x4::Scaling(aiVector3D(metres_per_mm), scene->mRootNode->mTransformation);
  }
  return scene;
}

std::string joined(const PlyOptions& options) {
  std::string text = fmt::format("SPACE={}; {}", options.space, fmt::join(options.comments, "; "));
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return text;
}

}  // namespace

const std::vector<std::string>& surface_endings() {
  static const std::vector<std::string> endings{".ply", ".glb", ".obj", ".stl"};
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
    std::string head = provenance.substr(0, header);
    head.resize(header, ' ');
    bytes.replace(0, header, head);
  }
  write_file(path, bytes, options.overwrite);
}

}  // namespace tunica
