#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/wall/mid_surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

using namespace tunica;

namespace {

using Body = std::function<double(const Vec3&)>;  // mm, negative inside

/// The surface of a body between two corners; open where the box cuts it.
TriangleMesh surface_of(const Body& body, const Vec3& lower, const Vec3& upper, double cell, bool open = false) {
  Volume volume;
  for (std::size_t k = 0; k < 3; ++k) {
    volume.dims[k] = static_cast<std::size_t>(std::lround((upper - lower)[static_cast<int>(k)] / cell));
  }
  volume.affine.leftCols<3>() = cell * Mat3::Identity();
  volume.affine.col(3) = lower + Vec3::Constant(cell / 2);
  std::vector<double> values;
  for (std::size_t k = 0; k < volume.dims[2]; ++k) {
    for (std::size_t j = 0; j < volume.dims[1]; ++j) {
      for (std::size_t i = 0; i < volume.dims[0]; ++i) {
        const double value = body(volume.affine * Eigen::Vector4d(double(i), double(j), double(k), 1));
        values.push_back(std::abs(value) < 0.2 * cell ? 0 : value);
      }
    }
  }
  volume.data = std::move(values);
  MarchingCubesOptions options;
  options.open_border = open;
  TriangleMesh mesh = marching_cubes(volume, {Inside::Rule::below, 0}, options);
  for (Vec3& p : mesh.vertices) {
    const Vec3 start = p;
    for (int step = 0; step < 5; ++step) {
      Vec3 gradient;
      for (int k = 0; k < 3; ++k) {
        gradient[k] = (body(p + 1e-5 * Vec3::Unit(k)) - body(p - 1e-5 * Vec3::Unit(k))) / 2e-5;
        const bool held = open && (start[k] <= lower[k] + 1e-9 || start[k] >= upper[k] - 1e-9);
        gradient[k] = held ? 0 : gradient[k];
      }
      p -= body(p) / std::max(gradient.squaredNorm(), 0.1) * gradient;
    }
  }
  return mesh;
}

Body capsule(const Vec3& from, const Vec3& to, double radius) {
  return [=](const Vec3& p) {
    const Vec3 way = to - from;
    const double at = std::clamp((p - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
    return (p - from - at * way).norm() - radius;
  };
}

Body ball(double radius, const Vec3& centre = Vec3::Zero()) {
  return [=](const Vec3& p) { return (p - centre).norm() - radius; };
}

/// Two bodies as one, with a fillet of about `radius` between them.
Body blended(const Body& a, const Body& b, double radius) {
  return [=](const Vec3& p) {
    const double x = a(p), y = b(p), mixed = std::max(radius - std::abs(x - y), 0.0) / radius;
    return std::min(x, y) - mixed * mixed * radius / 4;
  };
}

struct Off {
  double largest = 0;
  double share = 0;  ///< of the vertices that are farther than a thousandth from half a wall away
};

Off off_half(const TriangleMesh& mesh, const Target& face, double half) {
  Off off;
  for (const Vec3& p : mesh.vertices) {
    const double by = std::abs(std::sqrt(face.tree().closest(p).squared_distance) - half);
    off.largest = std::max(off.largest, by);
    off.share += by > 1e-3 * half ? 1.0 / static_cast<double>(mesh.vertices.size()) : 0;
  }
  return off;
}

void expect_sound(const TriangleMesh& mesh, std::size_t rims) {
  const MeshFacts facts = examine(mesh);
  EXPECT_EQ(why_unfit(facts).value_or(""), "");
  EXPECT_EQ(facts.components, 1U);
  EXPECT_EQ(facts.boundary_loops, rims);
  EXPECT_EQ(facts.euler, 2 - static_cast<long>(rims));
  EXPECT_EQ(count_self_intersections(mesh), 0U);
}

}  // namespace

TEST(HalfWay, OfASphereIsASphere) {
  const Target face(surface_of(ball(10), Vec3::Constant(-12), Vec3::Constant(12), 0.3));
  for (const auto& [which, radius] : {std::pair(WallFace::outer, 9.0), {WallFace::inner, 11.0}}) {
    const HalfWaySurface middle = half_way_surface(face, which, 2);
    expect_sound(middle.mesh, 0);
    EXPECT_EQ(middle.left_out, 0U);
    EXPECT_GT(signed_volume(middle.mesh), 0);
    for (const Vec3& p : middle.mesh.vertices) {
      ASSERT_NEAR(p.norm(), radius, 1e-3 * radius);
    }
    EXPECT_LT(off_half(middle.mesh, face, 1).largest, 1e-5);
    EXPECT_LT(middle.error[0], 4e-3);
  }
}

TEST(HalfWay, AWallFarThinnerThanTheTrianglesTakesNoFinerGridThanItsErrorAsksFor) {
  const Target face(surface_of(ball(100), Vec3::Constant(-110), Vec3::Constant(110), 5));
  const HalfWaySurface middle = half_way_surface(face, WallFace::inner, 1);
  expect_sound(middle.mesh, 0);
  EXPECT_LT(off_half(middle.mesh, face, 0.5).largest, 1e-5);
  EXPECT_LT(middle.mesh.triangles.size(), 400'000U);
}

TEST(HalfWay, OfACutTubeEndsInThePlanesOfItsRims) {
  // The tube's axis leans against the box's faces, which cut it.
  const Vec3 axis = Vec3(0.4, 0.1, 1).normalized();
  const Body tube = capsule(-100 * axis, 100 * axis, 6);
  const Target face(surface_of(tube, {-20, -20, -12}, {20, 20, 12}, 0.25, true));
  for (const auto& [which, radius] : {std::pair(WallFace::outer, 5.0), {WallFace::inner, 7.0}}) {
    const HalfWaySurface middle = half_way_surface(face, which, 2);
    expect_sound(middle.mesh, 2);
    for (const auto& rim : boundary_loops(middle.mesh)) {
      for (const Index v : rim) {
        ASSERT_NEAR(std::abs(middle.mesh.vertices[v].z()), 12, 1e-9);
      }
    }
    for (const Vec3& p : middle.mesh.vertices) {
      ASSERT_LE(std::abs(p.z()), 12 + 1e-9);
      // Beyond the rims the face is continued as it ends.
      ASSERT_NEAR(tube(p) + 6, radius, (std::abs(p.z()) < 8 ? 1e-3 : 5e-3) * radius);
    }
  }
}

TEST(HalfWay, OfARimInNoPlaneEndsBesideIt) {
  // A ball whose cap is taken away by a wavy surface.
  TriangleMesh mesh = surface_of(ball(10), Vec3::Constant(-12), Vec3::Constant(12), 0.5);
  std::erase_if(mesh.triangles, [&](const auto& v) {
    const Vec3 p = (mesh.vertices[v[0]] + mesh.vertices[v[1]] + mesh.vertices[v[2]]) / 3;
    return p.z() > 3 + 2 * std::sin(2 * std::atan2(p.y(), p.x()));
  });
  const Target face(std::move(mesh));
  ASSERT_EQ(face.boundary().size(), 1U);
  const HalfWaySurface middle = half_way_surface(face, WallFace::inner, 2);
  expect_sound(middle.mesh, 1);
  for (const auto& rim : boundary_loops(middle.mesh)) {
    for (const Index v : rim) {
      const Vec3& p = middle.mesh.vertices[v];
      EXPECT_NEAR(std::sqrt(face.boundary_tree()->closest(p).squared_distance), 1, 0.35);
    }
  }
}

TEST(HalfWay, InACrotchSharperThanHalfTheWallNoPointIsNearerThanThat) {
  // The fillet between the branches has a radius of about half a millimetre.
  const Body vessel =
      blended(capsule({0, 0, -30}, {0, 0, 0}, 5),
              blended(capsule({0, 0, 0}, {12, 0, 24}, 3.5), capsule({0, 0, 0}, {-12, 0, 24}, 3.5), 1), 2);
  const double cell = 0.5, half = 2;
  const Target face(surface_of(vessel, {-18, -8, -37}, {18, 8, 30}, cell));
  const HalfWaySurface middle = half_way_surface(face, WallFace::inner, 2 * half);
  expect_sound(middle.mesh, 0);
  const Off off = off_half(middle.mesh, face, half);
  EXPECT_LT(off.largest, middle.cell);
  EXPECT_LT(off.share, 0.01);
  EXPECT_LT(middle.error[0], 4e-3 * half);
}

TEST(HalfWay, OfAnOuterFaceSharperThanHalfTheWall) {
  // The radius of curvature at the ends of the ellipsoid is 1.6 mm.
  const Body ellipsoid = [](const Vec3& p) { return (p.cwiseQuotient(Vec3(4, 4, 10)).norm() - 1) * 4; };
  const Target face(surface_of(ellipsoid, {-6, -6, -12}, {6, 6, 12}, 0.4));
  const HalfWaySurface middle = half_way_surface(face, WallFace::outer, 4);
  expect_sound(middle.mesh, 0);
  EXPECT_LT(off_half(middle.mesh, face, 2).largest, middle.cell);
  EXPECT_LT(off_half(middle.mesh, face, 2).share, 0.01);
}

TEST(HalfWay, WhatIsCutOffIsTold) {
  const Body dumbbell =
      blended(blended(ball(5, {-8, 0, 0}), ball(4, {8, 0, 0}), 0.1), capsule({-8, 0, 0}, {8, 0, 0}, 1), 0.5);
  const Target face(surface_of(dumbbell, {-15, -7, -7}, {15, 7, 7}, 0.4));
  const HalfWaySurface middle = half_way_surface(face, WallFace::outer, 3);
  expect_sound(middle.mesh, 0);
  EXPECT_EQ(middle.left_out, 1U);
  EXPECT_NEAR(middle.left_out_area, 4 * 3.14159 * 2.5 * 2.5, 2);
  EXPECT_LT(bounding_box(middle.mesh).upper.x(), 0);
}

TEST(HalfWay, Refusals) {
  const Target face(surface_of(ball(10), Vec3::Constant(-12), Vec3::Constant(12), 1));
  EXPECT_THROW((void)half_way_surface(face, WallFace::outer, 21), RequirementError);
  EXPECT_THROW((void)half_way_surface(face, WallFace::inner, 1e-9), RequirementError);  // of another unit
  TriangleMesh two = face.mesh();
  const auto first = static_cast<Index>(two.vertices.size());
  for (const Vec3& p : face.mesh().vertices) {
    two.vertices.emplace_back(p + Vec3::Constant(5000));
  }
  for (const auto& [a, b, c] : face.mesh().triangles) {
    two.triangles.push_back({a + first, b + first, c + first});
  }
  EXPECT_THROW((void)half_way_surface(Target(two), WallFace::outer, 2), RequirementError);
}
