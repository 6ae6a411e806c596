#include "io/mesh/helpers.hpp"
#include "support/mutate.hpp"

namespace tunica {
namespace {

/// A file of a format; the test damages it in thousands of seeded ways.
struct Sample {
  const char* name;
  std::function<std::string()> bytes;
};
void PrintTo(const Sample& sample, std::ostream* out) { *out << sample.name; }

std::string ply(bool shell) {
  const test::TemporaryFolder folder;
  TriangleMesh mesh;
  for (int v = 0; v < 30; ++v) {
    mesh.vertices.emplace_back(v % 5, v / 5, 0.25 * v);
  }
  for (Index v = 0; v + 6 < 30; ++v) {
    mesh.triangles.push_back({v, v + 1, v + 6});
  }
  if (shell) {
    const std::array<Vec3, 3> corner = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()};
    write_ply(folder / "a.ply",
              ShellMesh{mesh.vertices,
                        mesh.triangles,
                        std::vector<Vec3>(30, Vec3::UnitZ()),
                        {mesh.triangles.size(), corner},
                        Patch::comas},
              PlyOptions{});
  } else {
    write_ply(folder / "a.ply", mesh, std::vector<double>(30, 0.5), PlyOptions{});
  }
  return test::bytes_of(folder / "a.ply");
}

std::string ascii_ply() {
  return "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 5\nproperty double x\nproperty double y\n"
         "property double z\nproperty list uchar float lobes\nproperty short s\nelement face 2\n"
         "property list uchar int vertex_indices\nproperty uchar red\nend_header\n"
         "0 0 0 0 1\n1 0 0 2 0.5 0.5 1\n1 1 0 0 1\n0 1 0 0 1\n0.5 0.5 1 0 -7\n4 0 1 2 3 255\n3 0 1 4 0\n";
}

class MeshFuzz : public ::testing::TestWithParam<Sample> {};
INSTANTIATE_TEST_SUITE_P(
    Formats, MeshFuzz,
    ::testing::Values(Sample{"a.ply", [] { return ply(false); }}, Sample{"shell.ply", [] { return ply(true); }},
                      Sample{"ascii.ply", ascii_ply}, Sample{"a.obj", [] { return test::tetrahedron_obj; }},
                      Sample{"a.off", [] { return test::tetrahedron_off; }},
                      Sample{"ascii.stl", [] { return test::ascii_stl(); }},
                      Sample{"binary.stl", [] { return test::binary_stl(); }}, Sample{"a.glb", test::tetrahedron_glb}));

TEST_P(MeshFuzz, EndsWithAMeshOrAnInputError) {
  const test::TemporaryFolder folder;
  const std::string whole = GetParam().bytes();
  ASSERT_NO_THROW(read_mesh(folder.file(GetParam().name, whole)));
  int refused = 0;
  constexpr int rounds = 4000;
  for (std::uint64_t seed = 0; seed < rounds; ++seed) {
    const auto path = folder.file(GetParam().name, test::mutate(whole, seed));
    try {
      const MeshFile file = read_mesh(path);
      ASSERT_FALSE(file.mesh.triangles.empty()) << seed;
      for (const auto& triangle : file.mesh.triangles) {
        for (const Index corner : triangle) {
          ASSERT_LT(corner, file.mesh.vertices.size()) << seed;
        }
      }
      for (const Vec3& vertex : file.mesh.vertices) {
        ASSERT_TRUE(vertex.allFinite()) << seed;
      }
      ASSERT_TRUE(file.normals.empty() || file.normals.size() == file.mesh.vertices.size()) << seed;
      ASSERT_TRUE(file.corner_normals.empty() || file.corner_normals.size() == file.mesh.triangles.size()) << seed;
      for (const auto& property : file.vertex_properties) {
        ASSERT_EQ(property.second.size(), file.mesh.vertices.size()) << seed;
      }
      if (!file.normals.empty()) {
        shell_of(file, path);
      }
    } catch (const InputError& error) {
      ASSERT_TRUE(std::string_view(error.what()).starts_with(path.string())) << seed << ": " << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, rounds / 4) << "the damage must be felt";
}

}  // namespace
}  // namespace tunica
