#include "fuzz/target.hpp"

#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/scene/scene_file.hpp"

namespace tunica::fuzz {
namespace {

// What scenes name: a plate of two triangles, a closed ball with normals, a tetrahedron.
void write_meshes() {
  file("plate.ply",
       "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 4\nproperty double x\nproperty double y\n"
       "property double z\nproperty double wall\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
       "0 0 0 1\n10 0 0 1\n10 10 0 1\n0 10 0 2\n3 0 1 2\n3 0 2 3\n");
  file("ball.ply",
       "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 6\nproperty double x\nproperty double y\n"
       "property double z\nproperty double nx\nproperty double ny\nproperty double nz\nelement face 8\n"
       "property list uchar int vertex_indices\nend_header\n"
       "10 0 0 1 0 0\n-10 0 0 -1 0 0\n0 10 0 0 1 0\n0 -10 0 0 -1 0\n0 0 10 0 0 1\n0 0 -10 0 0 -1\n"
       "3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n");
  file("cube.msh",
       "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 9 0 0\n3 0 9 0\n4 0 0 9\n$EndNodes\n"
       "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n");
}

// Filling takes as long as the scene asks for: what asks for more than a few thousand tetrahedra is not of interest.
bool is_soon_loaded(const Scene& scene) {
  for (const SceneSolid& solid : scene.solids) {
    if (solid.fill_size && *solid.fill_size < 2 * solid.scale) {
      return false;
    }
  }
  return true;
}

}  // namespace
}  // namespace tunica::fuzz

// Scenes: parsing, the text of what was understood, and the bodies that they name.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  static const bool written = (fuzz::write_meshes(), true);
  const std::filesystem::path path = fuzz::folder() / "scene.toml";
  std::optional<Scene> scene;
  fuzz::accepted([&] { scene = parse_scene(std::string(fuzz::text_of(data, size)), path); }, path.string());
  if (!scene) {
    return 0;
  }
  const std::string resolved = scene_text(*scene);
  try {
    fuzz::require(scene_text(parse_scene(resolved, path)) == resolved, "the text of a scene is the same scene");
  } catch (const std::exception& error) {
    fuzz::fail("the text of a scene is no scene: " + std::string(error.what()) + "\n" + resolved);
  }
  if (fuzz::is_soon_loaded(*scene)) {
    fuzz::accepted([&] { (void)load_scene(*scene); });
  }
  return written ? 0 : -1;
}
