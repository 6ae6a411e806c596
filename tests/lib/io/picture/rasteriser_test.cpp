#include "tunica/draw/detail/rasteriser.hpp"

#include "io/picture/shapes.hpp"
#include "tunica/core/threads.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

namespace tunica {
namespace {

constexpr double pi = 3.14159265358979323846;

Camera front_camera(int size, double scale) {
  Camera camera;
  camera.width = size;
  camera.height = size;
  camera.scale = scale;
  return camera;
}

Raster draw(const TriangleMesh& mesh, const Camera& camera, const std::vector<double>& values = {}) {
  return rasterise(mesh, shading_normals(mesh), values, camera);
}

bool same_floats(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

TEST(Rasteriser, SphereCoversItsDiscWithoutCracksAtItsDepth) {
  const double radius = 10;
  const TriangleMesh sphere = make_sphere(radius, 5);
  const Camera camera = front_camera(240, 10);
  const Raster raster = draw(sphere, camera);
  double covered = 0;
  for (int y = 0; y < raster.height; ++y) {
    for (int x = 0; x < raster.width; ++x) {
      const double distance = std::hypot(x + 0.5 - 120, y + 0.5 - 120) / camera.scale;
      const float depth = raster.depth[raster.at(x, y)];
      if (distance < 0.99 * radius) {
        ASSERT_NE(depth, Raster::empty) << "crack at " << x << ", " << y;
        EXPECT_NEAR(depth, std::sqrt(radius * radius - distance * distance), 0.15);
        EXPECT_EQ(raster.inner[raster.at(x, y)], 0);
      }
      covered += depth != Raster::empty ? 1 : 0;
    }
  }
  EXPECT_NEAR(covered / (pi * radius * radius * camera.scale * camera.scale), 1, 0.01);
}

TEST(Rasteriser, NearerSurfaceHidesFartherWhateverTheOrder) {
  for (const bool nearer_first : {true, false}) {
    TriangleMesh mesh;
    const double first = nearer_first ? -1 : 1;  // the camera looks along +y: smaller y is nearer
    append_square(mesh, 5, first);
    append_square(mesh, 5, -first);
    std::vector<double> values(8, nearer_first ? 7 : 3);
    std::fill(values.begin() + 4, values.end(), nearer_first ? 3 : 7);
    const Raster raster = draw(mesh, front_camera(64, 5), values);
    EXPECT_EQ(raster.value[raster.at(32, 32)], 7);
    EXPECT_EQ(raster.depth[raster.at(32, 32)], 1);
  }
}

TEST(Rasteriser, ValueOfAPlaneIsLinear) {
  TriangleMesh mesh;
  append_square(mesh, 5, 0);
  std::vector<double> values;
  for (const Vec3& p : mesh.vertices) {
    values.push_back(2 * p.x() + 3 * p.z() + 1);
  }
  const Camera camera = front_camera(100, 8);
  const Raster raster = draw(mesh, camera, values);
  for (const auto& [px, py] : {std::pair{50, 50}, {20, 77}, {80, 15}, {33, 60}}) {
    const double x = (px + 0.5 - 50) / camera.scale;
    const double z = -(py + 0.5 - 50) / camera.scale;
    EXPECT_NEAR(raster.value[raster.at(px, py)], 2 * x + 3 * z + 1, 1e-5);
  }
}

TEST(Rasteriser, BackOfATriangleIsInnerAndLitLikeItsFront) {
  TriangleMesh front;
  append_square(front, 5, 0);
  TriangleMesh back = front;
  for (auto& triangle : back.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  const Raster a = draw(front, front_camera(64, 4));
  const Raster b = draw(back, front_camera(64, 4));
  EXPECT_NE(a.inner[a.at(32, 32)], b.inner[b.at(32, 32)]);
  EXPECT_FLOAT_EQ(a.light[a.at(32, 32)], b.light[b.at(32, 32)]);
}

TEST(Rasteriser, DegenerateAndFarAwayTrianglesDrawNothingAndDoNotCrash) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {0, 0, 0}, {1, 0, 1}, {1e12, 0, 1e12}, {-1e12, 0, 2e12}, {3e12, 5, 1e12}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}, {3, 4, 5}};
  const Raster raster = draw(mesh, front_camera(32, 1));
  EXPECT_TRUE(std::ranges::all_of(raster.depth, [](float depth) { return depth == Raster::empty; }));
}

TEST(Rasteriser, TriangleMuchLargerThanThePictureFillsIt) {
  TriangleMesh mesh;
  append_square(mesh, 1e7, 0);
  const Raster raster = draw(mesh, front_camera(32, 1));
  EXPECT_TRUE(std::ranges::none_of(raster.depth, [](float depth) { return depth == Raster::empty; }));
}

TEST(Rasteriser, ValueThatIsNotFiniteSpoilsItsTrianglesOnly) {
  TriangleMesh mesh = make_sphere(10, 3);
  std::vector<double> values(mesh.vertices.size(), 1);
  values[0] = std::nan("");
  const Raster raster = draw(mesh, front_camera(100, 4), values);
  const auto missing = std::ranges::count_if(raster.value, [](float value) { return std::isnan(value); });
  EXPECT_LT(missing, 1000);
  EXPECT_GT(std::ranges::count(raster.value, 1.0f), 4000);
}

TEST(Rasteriser, DoesNotDependOnTheNumberOfThreads) {
  const TriangleMesh sphere = make_sphere(10, 5);
  std::vector<double> values;
  for (const Vec3& p : sphere.vertices) {
    values.push_back(p.x());
  }
  set_thread_count(1);
  const Raster one = draw(sphere, front_camera(300, 13), values);
  set_thread_count(5);
  const Raster five = draw(sphere, front_camera(300, 13), values);
  set_thread_count(default_thread_count());
  EXPECT_TRUE(same_floats(one.depth, five.depth));
  EXPECT_TRUE(same_floats(one.value, five.value));
  EXPECT_TRUE(same_floats(one.light, five.light));
}

TEST(ShadingNormals, FollowASmoothSurfaceAndKeepAnEdge) {
  const TriangleMesh sphere = make_sphere(3, 4);
  const auto smooth = shading_normals(sphere);
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 radial = sphere.vertices[sphere.triangles[t][i]].normalized();
      EXPECT_GT(smooth[t][i].dot(radial), 0.999);
    }
  }
  const TriangleMesh box = make_box();
  const auto sharp = shading_normals(box);
  for (std::size_t t = 0; t < box.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(sharp[t][i].cwiseAbs().maxCoeff(), 1, 1e-12);
    }
  }
}

}  // namespace
}  // namespace tunica
