#include "tunica/surface/distance/facing.hpp"

#include "surface/shapes.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tunica {
namespace {

TriangleMesh turned(TriangleMesh mesh) {
  for (auto& t : mesh.triangles) {
    std::swap(t[1], t[2]);
  }
  return mesh;
}

/// The part of a sphere above a height, as a share of its radius.
TriangleMesh cap(double height) {
  TriangleMesh mesh = shapes::sphere(5, 10);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]).z() < 30 * height;
  });
  return without_unused(std::move(mesh));
}

TEST(Facing, WhatHasAnInsideIsTurnedOutward) {
  const std::vector<TriangleMesh> shapes{shapes::sphere(3, 10),
                                         shapes::torus(24, 12),
                                         shapes::tube(48, 40, 5, 30),
                                         shapes::tube(24, 10, 5, 18),  // not twice as long as wide
                                         cap(-0.5),
                                         shapes::moved(shapes::tube(48, 40, 5, 30), Vec3(1000, -2000, 3000))};
  for (const TriangleMesh& mesh : shapes) {
    const TriangleMesh inward = turned(mesh);
    const Facing good = facing_of(mesh), bad = facing_of(inward);
    // What the shapes call a tube faces as it likes.
    EXPECT_EQ(good.inward + bad.inward, 1U);
    EXPECT_EQ(good.pieces, 1U);
    const TriangleMesh outward = turned_outward(mesh, good);
    EXPECT_EQ(facing_of(outward).inward, 0U);
    EXPECT_EQ(facing_of(turned_outward(inward, bad)).inward, 0U);
    if (examine(mesh).closed) {
      EXPECT_GT(signed_volume(outward), 0);
    }
  }
}

TEST(Facing, OfWhatHasNoInsideNothingIsSaid) {
  for (const TriangleMesh& mesh : {shapes::plane(10, 10), cap(0), cap(0.9), shapes::tube(24, 3, 5, 3)}) {
    EXPECT_EQ(facing_of(mesh).inward, 0U);
    EXPECT_EQ(facing_of(turned(mesh)).inward, 0U);
  }
}

TEST(Facing, ShallowSurfacesBulge) {
  for (const TriangleMesh& mesh : {cap(0), cap(0.5), cap(0.9)}) {
    EXPECT_EQ(facing_of(mesh).bulging, 0U);
    EXPECT_EQ(facing_of(turned(mesh)).bulging, 1U);
  }
  TriangleMesh wave = shapes::plane(20, 20, 10, 10);
  for (Vec3& p : wave.vertices) {
    p.z() = std::sin(0.4 * std::numbers::pi * p.x()) * std::sin(0.4 * std::numbers::pi * p.y());  // whole waves
  }
  for (const TriangleMesh& mesh : {shapes::plane(10, 10), wave, shapes::sphere(2, 1)}) {
    EXPECT_EQ(facing_of(mesh).bulging + facing_of(turned(mesh)).bulging, 0U);
  }
}

TEST(Facing, EachPieceByWhatLiesAroundIt) {
  const TriangleMesh outer = shapes::sphere(3, 10), inner = shapes::sphere(3, 8), core = shapes::sphere(2, 3);
  const TriangleMesh wall = shapes::together(outer, turned(inner));
  Facing facing = facing_of(wall);
  EXPECT_EQ(facing.pieces, 2U);
  EXPECT_EQ(facing.hollows, 1U);
  EXPECT_EQ(facing.inward, 0U);
  facing = facing_of(turned(wall));
  EXPECT_EQ(facing.inward, 2U);
  EXPECT_EQ(facing_of(turned_outward(turned(wall), facing)).inward, 0U);
  facing = facing_of(shapes::together(outer, inner));  // a balloon in a balloon
  EXPECT_EQ(facing.inward, 1U);
  EXPECT_EQ(facing.outermost_inward, 0U);
  EXPECT_EQ(facing.hollows, 0U);
  facing = facing_of(shapes::together(wall, turned(core)));  // within both: outward again
  EXPECT_EQ(facing.inward, 1U);
  EXPECT_LT(facing.place.norm(), 4);
  EXPECT_EQ(facing_of(shapes::together(wall, core)).inward, 0U);
  // Side by side nothing lies within anything.
  facing = facing_of(shapes::together(outer, shapes::moved(turned(inner), Vec3(30, 0, 0))));
  EXPECT_EQ(facing.hollows, 0U);
  EXPECT_EQ(facing.inward, 1U);
  EXPECT_GT(facing.place.x(), 20);
}

TEST(Facing, BothFacesOfATubesWallAreRight) {
  TriangleMesh outer = shapes::tube(48, 40, 11, 60), inner = shapes::tube(48, 40, 9, 60);
  outer = turned_outward(outer, facing_of(outer));
  inner = turned(turned_outward(inner, facing_of(inner)));
  EXPECT_EQ(facing_of(shapes::together(outer, inner)).inward, 0U);
  EXPECT_EQ(facing_of(turned(shapes::together(outer, inner))).inward, 2U);
  // A hollow in the material of an open tube faces its hollow.
  EXPECT_EQ(facing_of(shapes::together(outer, shapes::moved(turned(shapes::sphere(2, 1)), Vec3(10, 0, 30)))).inward,
            0U);
}

}  // namespace
}  // namespace tunica
