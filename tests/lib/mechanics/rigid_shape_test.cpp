// Rigid bodies: distance, normal, curvature, and where they are over time.

#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "benchmarks.hpp"
#include "random.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

template <typename Value>
Table<Value> always(Value value) {
  return {{{0, value}}};
}

const Vec3 from(1, 2, -1), to(3, 1.5, 2);
constexpr double radius = 0.8;

RigidBody body_of(decltype(RigidBody::shape) shape) { return {"body", std::move(shape), std::nullopt}; }

RigidBody sphere() { return body_of(RigidSphere{always(from), always(radius)}); }
RigidBody capsule() { return body_of(RigidCapsule{always(from), always(to), always(radius)}); }
RigidBody cylinder() { return body_of(RigidCylinder{always(from), always(to), always(radius)}); }
RigidBody plane() { return body_of(RigidPlane{always(from), Vec3(Vec3(1, -2, 0.5).normalized())}); }

std::map<std::string, RigidBody> convex_bodies() {
  return {{"sphere", sphere()}, {"capsule", capsule()}, {"cylinder", cylinder()}, {"plane", plane()}};
}

/// Many points of a body's surface.
std::vector<Vec3> surface_of(const std::string& name) {
  std::vector<Vec3> points;
  const Vec3 axis = (to - from).normalized();
  const Vec3 e1 = axis.unitOrthogonal(), e2 = axis.cross(e1);
  constexpr int n = 240;
  for (int i = 0; i < n; ++i) {
    const Vec3 around = std::cos(2 * pi * i / n) * e1 + std::sin(2 * pi * i / n) * e2;
    for (int j = 0; j <= n; ++j) {
      const double t = static_cast<double>(j) / n;
      const Vec3 on_ball = std::cos(pi * t) * axis + std::sin(pi * t) * around;
      if (name == "sphere") {
        points.push_back(from + radius * on_ball);
        continue;
      }
      points.push_back(from + t * (to - from) + radius * around);
      if (name == "capsule") {
        points.push_back((t < 0.5 ? to : from) + radius * on_ball);
      } else {
        points.push_back(from + t * radius * around);
        points.push_back(to + t * radius * around);
      }
    }
  }
  return points;
}

TEST(RigidShape, DistancesAreThoseToTheNearestPoint) {
  for (const char* name : {"sphere", "capsule", "cylinder"}) {
    SCOPED_TRACE(name);
    const RigidBody body = convex_bodies().at(name);
    const RigidShape shape(body);
    const std::vector<Vec3> surface = surface_of(name);
    Random random(7);
    for (int i = 0; i < 60; ++i) {
      const Vec3 p = (from + to) / 2 + random.vector(3);
      double nearest = infinity;
      for (const Vec3& q : surface) {
        nearest = std::min(nearest, (p - q).norm());
      }
      const RigidDistance at = shape.at(p);
      // The sampled surface is nearer by less than the chord of its samples.
      ASSERT_NEAR(std::abs(at.distance), nearest, 4e-3) << p.transpose();
      const Vec3 on_surface = p - at.distance * at.normal;
      ASSERT_NEAR(shape.at(on_surface).distance, 0, 1e-13);
      ASSERT_NEAR(at.normal.norm(), 1, 1e-14);
    }
  }
}

TEST(RigidShape, InsideIsNegative) {
  const Vec3 middle = (from + to) / 2;
  const RigidBody c = capsule(), y = cylinder(), s = sphere(), p = plane();
  EXPECT_NEAR(RigidShape(c).at(middle).distance, -radius, 1e-14);
  EXPECT_NEAR(RigidShape(y).at(middle).distance, -radius, 1e-14);
  EXPECT_NEAR(RigidShape(s).at(from + Vec3(0.3, 0, 0)).distance, 0.3 - radius, 1e-14);
  EXPECT_NEAR(RigidShape(p).at(from - Vec3(1, -2, 0.5)).distance, -Vec3(1, -2, 0.5).norm(), 1e-14);
  // Near a cap the cap is nearest, not the side.
  const Vec3 axis = (to - from).normalized();
  const RigidDistance near_cap = RigidShape(y).at(to - 0.1 * axis);
  EXPECT_NEAR(near_cap.distance, -0.1, 1e-14);
  EXPECT_LT((near_cap.normal - axis).norm(), 1e-14);
}

/// One point per part of the surface where the distance has another formula.
std::map<std::string, std::pair<RigidBody, Vec3>> places() {
  const Vec3 axis = (to - from).normalized(), across = axis.unitOrthogonal();
  const Vec3 middle = from + 0.4 * (to - from);
  return {{"sphere", {sphere(), from + Vec3(1, 1, 0.5)}},
          {"sphere, inside", {sphere(), from + Vec3(0.2, 0.1, -0.3)}},
          {"capsule's side", {capsule(), middle + 1.3 * across}},
          {"capsule's end", {capsule(), to + 0.7 * axis + 0.6 * across}},
          {"capsule's other end", {capsule(), from - 0.4 * axis + 0.9 * across}},
          {"capsule, inside", {capsule(), middle + 0.3 * across}},
          {"cylinder's side", {cylinder(), middle + 1.3 * across}},
          {"cylinder's cap", {cylinder(), to + 0.5 * axis + 0.3 * across}},
          {"cylinder's other cap", {cylinder(), from - 0.5 * axis + 0.3 * across}},
          {"cylinder's rim", {cylinder(), to + 0.5 * axis + 1.4 * across}},
          {"cylinder's other rim", {cylinder(), from - 0.2 * axis + 0.9 * across}},
          {"cylinder, inside by the side", {cylinder(), middle + 0.6 * across}},
          {"cylinder, inside by the cap", {cylinder(), to - 0.1 * axis + 0.2 * across}},
          {"plane", {plane(), from + Vec3(0.3, 0.2, 1)}}};
}

TEST(RigidShape, NormalsAreTheDerivativeOfTheDistanceAndCurvaturesThatOfTheNormals) {
  constexpr double step = 1e-5;
  for (const auto& [name, place] : places()) {
    SCOPED_TRACE(name);
    const auto& [body, p] = place;
    const RigidShape shape(body);
    const RigidDistance at = shape.at(p);
    for (int k = 0; k < 3; ++k) {
      const Vec3 along = step * Vec3::Unit(k);
      const RigidDistance after = shape.at(p + along), before = shape.at(p - along);
      EXPECT_NEAR(at.normal[k], (after.distance - before.distance) / (2 * step), 1e-9);
      EXPECT_LT((at.curvature.col(k) - (after.normal - before.normal) / (2 * step)).norm(), 1e-8);
    }
    EXPECT_LT((at.curvature - at.curvature.transpose()).norm(), 1e-14);
    EXPECT_LT((at.curvature * at.normal).norm(), 1e-14);
  }
}

/// The solver takes the tangent plane at a point for a bound on the whole body.
TEST(RigidShape, DistancesAreConvexOutside) {
  for (const auto& [name, body] : convex_bodies()) {
    SCOPED_TRACE(name);
    const RigidShape shape(body);
    Random random(7);
    for (int i = 0; i < 500; ++i) {
      const Vec3 p = (from + to) / 2 + random.vector(4), q = (from + to) / 2 + random.vector(4);
      const RigidDistance at = shape.at(p);
      ASSERT_GE(shape.at(q).distance, at.distance + at.normal.dot(q - p) - 1e-12);
    }
  }
}

TEST(RigidShape, SupportIsTheFarthestOfTheSurface) {
  for (const char* name : {"sphere", "capsule", "cylinder"}) {
    SCOPED_TRACE(name);
    const RigidBody body = convex_bodies().at(name);
    const RigidShape shape(body);
    const std::vector<Vec3> surface = surface_of(name);
    Random random(7);
    for (int i = 0; i < 30; ++i) {
      const Vec3 n = random.vector(1).normalized();
      double farthest = -infinity;
      for (const Vec3& p : surface) {
        farthest = std::max(farthest, n.dot(p));
      }
      ASSERT_GE(shape.support(n), farthest - 1e-12);
      ASSERT_LE(shape.support(n), farthest + 1e-3);
    }
  }
}

TEST(RigidShape, APlaneBoundsOnlyItsOwnDirection) {
  const RigidBody body = plane();
  const RigidShape shape(body);
  const Vec3 n = Vec3(1, -2, 0.5).normalized();
  EXPECT_NEAR(shape.support(n), n.dot(from), 1e-14);
  EXPECT_EQ(shape.support(-n), infinity);
  EXPECT_EQ(shape.support(Vec3::UnitX()), infinity);
}

TEST(RigidShape, ASphereAsAMeshKnowsInsideFromOutside) {
  const ShellMesh sphere = make_geodesic(2, 3);
  const RigidBody body = body_of(RigidMesh{{sphere.vertices, sphere.triangles}, {}, {}});
  const RigidShape shape(body);
  EXPECT_FALSE(shape.convex());
  double sag = 0;
  for (const auto& t : sphere.triangles) {
    const Vec3& x = sphere.vertices[t[0]];
    sag = std::max(sag, 2 - x.dot((sphere.vertices[t[1]] - x).cross(sphere.vertices[t[2]] - x).normalized()));
  }
  Random random(7);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = random.vector(3);
    const RigidDistance at = shape.at(p);
    ASSERT_GE(at.distance, p.norm() - 2 - 1e-12);
    ASSERT_LE(at.distance, p.norm() - 2 + sag + 1e-12);
    ASSERT_NEAR(at.normal.norm(), 1, 1e-12);
  }
}

/// A wedge of 20 degrees: near its sharp edge the normal of the triangle that happens to be nearest is wrong by sign.
TEST(RigidShape, SignsAreRightNearSharpEdgesAndCornersOfAMesh) {
  // A thin tetrahedron: every edge and corner is sharp.
  TriangleMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(4, 0, 0), Vec3(0, 4, 0), Vec3(0.1, 0.1, 0.5)};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const RigidBody body = body_of(RigidMesh{mesh, {}, {}});
  const RigidShape shape(body);
  Mat3 edges;
  edges << mesh.vertices[1], mesh.vertices[2], mesh.vertices[3];
  const Mat3 inverse = edges.inverse();
  const auto inside = [&](const Vec3& p) {
    const Vec3 b = inverse * p;
    return b.minCoeff() > 0 && b.sum() < 1;
  };
  Random random(7);
  int within = 0;
  for (int i = 0; i < 20000; ++i) {
    // About a random point of an edge, or a corner.
    const Vec3 &a = mesh.vertices[static_cast<std::size_t>(i) % 4],
               &b = mesh.vertices[static_cast<std::size_t>(i / 4) % 4];
    const double t = i % 3 == 0 ? 0 : 0.5 + random(0.5);
    const Vec3 p = a + t * (b - a) + random.vector(0.05);
    const RigidDistance at = shape.at(p);
    ASSERT_EQ(at.distance < 0, inside(p)) << p.transpose() << ", distance " << at.distance;
    within += inside(p) ? 1 : 0;
    // The normal is the distance's gradient, away from the body.
    ASSERT_NEAR(shape.at(p - at.distance * at.normal).distance, 0, 1e-12);
  }
  EXPECT_GT(within, 500);
}

TEST(RigidShape, OnTheSurfaceOfAMeshTheNormalIsThatOfTheSurface) {
  const ShellMesh sphere = make_geodesic(2, 3);
  const RigidBody body = body_of(RigidMesh{{sphere.vertices, sphere.triangles}, {}, {}});
  const RigidShape shape(body);
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
    const auto& v = sphere.triangles[t];
    for (const Vec3& p : {Vec3((sphere.vertices[v[0]] + sphere.vertices[v[1]] + sphere.vertices[v[2]]) / 3),
                          Vec3((sphere.vertices[v[0]] + sphere.vertices[v[1]]) / 2), sphere.vertices[v[2]]}) {
      const RigidDistance at = shape.at(p);
      EXPECT_NEAR(at.distance, 0, 1e-14);
      EXPECT_GT(at.normal.dot(p.normalized()), 0.95);
    }
  }
}

TEST(RigidShape, FollowsItsTablesAndItsMotion) {
  RigidBody body = body_of(RigidCapsule{
      {{{0, from}, {2, from + Vec3(0, 0, 2)}}}, {{{0, to}, {2, to + Vec3(0, 0, 2)}}}, {{{1, 0.5}, {3, 1.5}}}});
  body.motion = Table<Vec3>{{{0, Vec3::Zero()}, {4, Vec3(8, 0, 0)}}};
  RigidShape shape(body);
  const Vec3 middle = (from + to) / 2;
  const std::vector<std::array<double, 4>> expected{{0, 0, 0, 0.5}, {1, 1, 2, 0.5}, {2, 2, 4, 1}, {5, 2, 8, 1.5}};
  for (const auto& [time, up, along, size] : expected) {
    shape.set_time(time);
    const Vec3 now = middle + Vec3(along, 0, up);
    EXPECT_LT((shape.position() - now).norm(), 1e-14) << time;
    EXPECT_NEAR(shape.at(now).distance, -size, 1e-14) << time;
  }
  EXPECT_NEAR(shape.largest_curvature(), 2, 1e-15);
}

TEST(RigidShape, WhatMovesCarriesItsPointsAndWhatSwellsGrows) {
  RigidBody body = body_of(RigidSphere{{{{0, from}, {1, to}}}, {{{0, 0.5}, {1, 0.8}}}});
  RigidShape before(body), after(body);
  EXPECT_FALSE(before.moves_to(after));
  after.set_time(1);
  EXPECT_TRUE(before.moves_to(after));
  EXPECT_LT((after.carried(from + Vec3(0.5, 0, 0), before) - (to + Vec3(0.5, 0, 0))).norm(), 1e-14);
  EXPECT_NEAR(after.growth_since(before), 0.3, 1e-14);
}

/// A point of the surface moves by no more than carried() and growth_since() say, when the ends part too.
TEST(RigidShape, GrowthBoundsWhatASurfacePointMovesBeyondItsBody) {
  RigidBody body = body_of(RigidCapsule{
      {{{0, from}, {1, from + Vec3(0.5, 0, 0)}}}, {{{0, to}, {1, to + Vec3(0.5, 1, 0)}}}, {{{0, 0.5}, {1, 0.7}}}});
  RigidShape before(body), after(body);
  after.set_time(1);
  Random random(7);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = (from + to) / 2 + random.vector(3);
    const double moved = after.at(after.carried(p, before)).distance - before.at(p).distance;
    ASSERT_LE(std::abs(moved), after.growth_since(before) + 1e-12);
  }
}

/// Turned about an axis off its centre, then moved; its material points go along.
TEST(RigidShape, AMeshTurnsAndMoves) {
  ShellMesh ball = make_geodesic(1, 3);
  for (Vec3& v : ball.vertices) {
    v += Vec3(3, 0, 0);
  }
  const Vec3 axis = Vec3::UnitZ(), point(1, 0, 0);
  RigidMesh mesh{{ball.vertices, ball.triangles}, RigidMesh::Turn{point, axis, {{{0, 0.0}, {1, pi / 2}}}}, {}};
  RigidBody body = body_of(mesh);
  body.motion = Table<Vec3>{{{0, Vec3::Zero()}, {1, Vec3(0, 0, 5)}}};
  RigidShape shape(body);
  const RigidShape before = shape;
  shape.set_time(1);
  EXPECT_TRUE(before.moves_to(shape));
  const Eigen::AngleAxisd turn(pi / 2, axis);
  Random random(7);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = Vec3(3, 0, 0) + random.vector(2);
    const Vec3 now = point + turn * (p - point) + Vec3(0, 0, 5);
    EXPECT_LT((shape.carried(p, before) - now).norm(), 1e-13);
    const RigidDistance then = before.at(p), at = shape.at(now);
    EXPECT_NEAR(at.distance, then.distance, 1e-12);
    EXPECT_LT((at.normal - turn * then.normal).norm(), 1e-9);
  }
  EXPECT_EQ(shape.growth_since(before), 0);
}

/// A tube as a mesh, expanded from its axis as a balloon: its radius grows, its length does not.
TEST(RigidShape, AMeshExpandsFromItsAxis) {
  ShellMesh tube;
  for (std::size_t j = 0; j <= 4; ++j) {
    for (std::size_t i = 0; i < 48; ++i) {
      const double angle = 2 * pi * (static_cast<double>(i) + (j % 2 == 1 ? 0.5 : 0)) / 48;
      tube.vertices.emplace_back(std::cos(angle), std::sin(angle), static_cast<double>(j));
    }
  }
  add_tube_triangles(48, 4, tube);
  const RigidMesh mesh{
      {tube.vertices, tube.triangles}, {}, RigidMesh::Expansion{Vec3::Zero(), Vec3::UnitZ(), {{{0, 1.0}, {1, 1.5}}}}};
  const RigidBody body = body_of(mesh);
  RigidShape shape(body);
  const RigidShape before = shape;
  EXPECT_NEAR(shape.at(Vec3(2, 0, 2)).distance, 1, 1e-3);
  EXPECT_NEAR(shape.at(Vec3(0.4, 0, 2)).distance, -0.6, 5e-3);
  shape.set_time(1);
  EXPECT_NEAR(shape.at(Vec3(2, 0, 2)).distance, 0.5, 2e-3);
  EXPECT_NEAR(shape.at(Vec3(1.2, 0, 2)).distance, -0.3, 5e-3);
  EXPECT_LT((shape.carried(Vec3(1, 0, 2), before) - Vec3(1.5, 0, 2)).norm(), 1e-14);
  EXPECT_LT((shape.at(Vec3(2, 0, 2)).normal - Vec3(1, 0, 0)).norm(), 2e-2);
}

/// A sphere that expands to an ellipsoid, at 45 degrees.
TEST(RigidShape, AnExpandedMeshHasItsOwnNormals) {
  const ShellMesh sphere = make_geodesic(2, 12);
  const RigidMesh mesh{{sphere.vertices, sphere.triangles},
                       {},
                       RigidMesh::Expansion{Vec3::Zero(), Vec3::UnitZ(), {{{0, 1.0}, {1, 1.5}}}}};
  const RigidBody body = body_of(mesh);
  RigidShape shape(body);
  shape.set_time(1);
  const Vec3 on_surface(3 * std::sqrt(0.5), 0, 2 * std::sqrt(0.5));
  const Vec3 normal = Vec3(on_surface.x() / 9, 0, on_surface.z() / 4).normalized();
  const RigidDistance at = shape.at(on_surface + 0.2 * normal);
  EXPECT_NEAR(at.distance, 0.2, 0.01);
  EXPECT_GT(at.normal.dot(normal), std::cos(5 * pi / 180));
}

}  // namespace
}  // namespace tunica
