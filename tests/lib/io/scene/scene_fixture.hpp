#pragma once

#include "support/temporary_folder.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/scene/scene_file.hpp"

namespace tunica::test {

/// The plate of plate.ply, six lines.
inline constexpr const char* plate =
    "[[shell]]\nname = \"plate\"\nmesh = \"plate.ply\"\nthickness = \"0.1mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n";

/// A scene that is refused.
struct Wrong {
  const char* name;
  std::string text;
  const char* place;  ///< ":line:column: "
  const char* says;
};

inline void PrintTo(const Wrong& wrong, std::ostream* out) { *out << wrong.name; }

/// A square of 10 mm in n x n cells, each cut in two; nodes row by row from (0, 0).
inline TriangleMesh square(Index n) {
  TriangleMesh mesh;
  for (Index j = 0; j <= n; ++j) {
    for (Index i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(10.0 * i / n, 10.0 * j / n, 0);
    }
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      const Index v = j * (n + 1) + i;
      mesh.triangles.push_back({v, v + 1, v + n + 2});
      mesh.triangles.push_back({v, v + n + 2, v + n + 1});
    }
  }
  return mesh;
}

/// An octahedron around the origin with the normals of its sphere: closed and curved.
inline ShellMesh octahedron(double radius) {
  ShellMesh shell;
  for (const Vec3& axis :
       {Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)}) {
    shell.normals.push_back(axis);
    shell.vertices.push_back(radius * axis);
  }
  shell.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  return shell;
}

/// A folder of its own with plate.ply (4 x 4 cells, no normals), ball.ply (curved) and plate.off (no unit).
class SceneTest : public ::testing::Test {
protected:
  SceneTest() {
    write_ply(folder_ / "plate.ply", square(4), {});
    write_ply(folder_ / "ball.ply", octahedron(10), {});
    (void)folder_.file("plate.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  }

  [[nodiscard]] std::filesystem::path path() const { return folder_ / "scene.toml"; }

  [[nodiscard]] Scene read(const std::string& text) const { return read_scene(folder_.file("scene.toml", text)); }

  [[nodiscard]] LoadedScene load(const std::string& text) const { return load_scene(read(text)); }

  /// Every byte of a scene replaced by each of these, and the scene cut off there: any sentence will do, a crash will
  /// not.
  void load_damaged(const std::string& text, std::initializer_list<char> replacements) const {
    const auto loaded = [&](const std::string& damaged) {
      try {
        (void)load(damaged);
      } catch (const Error&) {
      }
    };
    for (std::size_t i = 0; i < text.size(); ++i) {
      for (const char c : replacements) {
        std::string damaged = text;
        damaged[i] = c;
        loaded(damaged);
      }
      loaded(text.substr(0, i));
    }
  }

  TemporaryFolder folder_;
};

}  // namespace tunica::test
