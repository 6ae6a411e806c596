// The co-rotational element: forces are the gradient of the energy, the tangent is the gradient of the forces.

#include "random.hpp"

#include "tunica/mechanics/elements/element_lanes.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/elements/shell_element.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace tunica {
namespace {

/// A triangle of a surface that curves.
ShellElement some_element(Membrane membrane = Membrane::opt, Bending bending = Bending::dkt) {
  const std::array<Vec3, 3> corners{Vec3(0.1, 0.2, 0.3), Vec3(1.3, 0.1, 0.5), Vec3(0.4, 1.1, -0.2)};
  const Vec3 n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  Random random(7);
  ShellSurface surface{{}, true};
  for (Vec3& normal : surface.normals) {
    normal = (n + random.vector(0.3)).normalized();
  }
  ShellElement element = make_shell_element(corners, surface, {1000, 0.3, {}}, 0.1, membrane, bending, 0.7);
  element.skewing = element.short_waves;
  return element;
}

/// The same, under stress where it lies.
ShellElement some_prestressed_element() {
  ShellElement element = some_element();
  Random random(9);
  for (double& strain : element.prestrain) {
    strain = random(0.1);
  }
  return element;
}

/// A large rigid motion and a deformation of some 20 %.
CornerMotion large_motion(const ShellElement& element, Random& random) {
  const Mat3 turn = exponential(Vec3(0.9, -1.4, 0.8)).toRotationMatrix();
  CornerMotion motion;
  for (int k = 0; k < 3; ++k) {
    motion.displacement.col(k) =
        turn * (element.from_centroid.col(k) + random.vector(0.2)) - element.from_centroid.col(k) + Vec3(3, 4, 5);
    motion.rotation[static_cast<std::size_t>(k)] = exponential(random.vector(0.4)).toRotationMatrix() * turn;
  }
  return motion;
}

CornerMotion moved(const CornerMotion& motion, int freedom, double amount) {
  CornerMotion result = motion;
  const int corner = freedom / 6;
  if (freedom % 6 < 3) {
    result.displacement(freedom % 6, corner) += amount;
  } else {
    auto& rotation = result.rotation[static_cast<std::size_t>(corner)];
    rotation = exponential(amount * Vec3::Unit(freedom % 6 - 3)).toRotationMatrix() * rotation;
  }
  return result;
}

TEST(Corotation, ForceIsTheGradientOfTheEnergy) {
  for (const ShellElement& element : {some_element(), some_prestressed_element()}) {
    Random random(7);
    const CornerMotion motion = large_motion(element, random);
    ElementResponse response, plus, minus;
    ASSERT_TRUE(corotational_response(element, motion, {}, response, nullptr));
    EXPECT_NEAR(response.energy, strain_energy(element, response.deformation), 1e-12 * std::abs(response.energy));
    constexpr double step = 1e-5;
    for (int i = 0; i < 18; ++i) {
      ASSERT_TRUE(corotational_response(element, moved(motion, i, step), {}, plus, nullptr));
      ASSERT_TRUE(corotational_response(element, moved(motion, i, -step), {}, minus, nullptr));
      EXPECT_NEAR(response.force[i], (plus.energy - minus.energy) / (2 * step), 1e-8 * response.force.norm()) << i;
    }
  }
}

TEST(Corotation, TangentIsTheGradientOfTheForce) {
  Random random(7);
  const ShellElement element = some_prestressed_element();
  const CornerMotion motion = large_motion(element, random);
  ElementResponse response, plus, minus;
  Matrix18 tangent;
  ElementState previous;
  for (int i = 0; i < previous.size(); ++i) {
    previous[i] = random(0.1);
  }
  for (const double damping : {0.0, 0.7}) {
    const Viscous viscous{damping, &previous};
    ASSERT_TRUE(corotational_response(element, motion, viscous, response, &tangent));
    constexpr double step = 1e-5;
    for (int i = 0; i < 18; ++i) {
      ASSERT_TRUE(corotational_response(element, moved(motion, i, step), viscous, plus, nullptr));
      ASSERT_TRUE(corotational_response(element, moved(motion, i, -step), viscous, minus, nullptr));
      const Vector18 difference = (plus.force - minus.force) / (2 * step);
      EXPECT_LT((difference - tangent.col(i)).norm(), 1e-7 * tangent.norm()) << i << ' ' << damping;
    }
  }
}

TEST(Corotation, ReferenceIsFreeOfForcesToTheLastBit) {
  const ShellElement element = some_element();
  CornerMotion motion{Mat3::Zero(), {Mat3::Identity(), Mat3::Identity(), Mat3::Identity()}};
  ElementResponse response;
  Matrix18 tangent;
  ASSERT_TRUE(corotational_response(element, motion, {}, response, &tangent));
  EXPECT_LT(response.force.norm(), 1e-13);
  EXPECT_LT((tangent - linear_stiffness(element)).norm(), 1e-13 * tangent.norm());
}

TEST(Corotation, RigidMotionGivesNoForces) {
  for (const Bending bending : {Bending::comas, Bending::comas_consistent, Bending::dkt, Bending::dkt_comas}) {
    for (const Membrane membrane : {Membrane::cst, Membrane::opt}) {
      const ShellElement element = some_element(membrane, bending);
      const Mat3 turn = exponential(Vec3(1.9, -1.4, 0.8)).toRotationMatrix();
      CornerMotion motion{Mat3((turn - Mat3::Identity()) * element.from_centroid).colwise() + Vec3(1, 2, 3),
                          {turn, turn, turn}};
      ElementResponse response;
      ASSERT_TRUE(corotational_response(element, motion, {}, response, nullptr));
      EXPECT_LT(response.force.norm(), 1e-12 * 1000 * 0.1);
    }
  }
}

TEST(Corotation, ForcesAreInBalance) {
  Random random(7);
  const ShellElement element = some_element();
  const CornerMotion motion = large_motion(element, random);
  ElementResponse response;
  ASSERT_TRUE(corotational_response(element, motion, {}, response, nullptr));
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 f = response.force.segment<3>(6 * k);
    force += f;
    moment +=
        (element.from_centroid.col(k) + motion.displacement.col(k)).cross(f) + response.force.segment<3>(6 * k + 3);
  }
  EXPECT_LT(force.norm(), 1e-13 * response.force.norm());
  EXPECT_LT(moment.norm(), 2e-14 * 10 * response.force.norm());
}

// Four at once against one after the other. One lane turns far, so that all take the formulas for large rotations where
// each alone takes series; one has collapsed, and must not spoil the others.
TEST(Lanes, DoNotSeeEachOther) {
  Random random(7);
  const ShellElement one = some_element();
  const ShellElement other = some_element(Membrane::cst, Bending::comas);
  const std::array<const ShellElement*, lane_count> elements{&one, &other, &one, &other};
  std::array<CornerMotion, lane_count> motions;
  for (std::size_t l = 0; l < lane_count; ++l) {
    motions[l] = large_motion(*elements[l], random);
    for (int k = 0; k < 3 && l < 2; ++k) {
      const Mat3 turn = exponential(Vec3(0.3, 2, -1)).toRotationMatrix();
      motions[l].displacement.col(k) =
          turn * (elements[l]->from_centroid.col(k) + random.vector(0.01)) - elements[l]->from_centroid.col(k);
      motions[l].rotation[static_cast<std::size_t>(k)] = exponential(random.vector(0.02)).toRotationMatrix() * turn;
    }
  }
  motions[3].displacement = motions[3].displacement.col(0).rowwise().replicate(3) - other.from_centroid;
  ElementLanes lanes;
  gather(elements, lanes);
  MotionLanes moved;
  const auto set = [](auto& to, const auto& from) {
    set_lanes(
        to, [&](std::size_t l) -> const auto& { return from[l]; });
  };
  std::array<Mat3, lane_count> values;
  std::transform(motions.begin(), motions.end(), values.begin(), [](const auto& m) { return m.displacement; });
  set(moved.displacement, values);
  for (std::size_t k = 0; k < 3; ++k) {
    std::transform(motions.begin(), motions.end(), values.begin(), [&](const auto& m) { return m.rotation[k]; });
    set(moved.rotation[k], values);
  }
  ResponseLanes together;
  LaneMatrix18 tangents, push_stiffnesses;
  LaneVector18 pushed;
  const LaneMask valid = corotational_response(lanes, moved, {}, together, &tangents);
  unit_pressure(lanes, moved, pushed, &push_stiffnesses);
  EXPECT_FALSE(valid[3]);
  for (std::size_t l = 0; l < 3; ++l) {
    ElementResponse alone;
    Matrix18 tangent, push_stiffness;
    Vector18 push;
    ASSERT_TRUE(valid[l]);
    ASSERT_TRUE(corotational_response(*elements[l], motions[l], {}, alone, &tangent));
    unit_pressure(*elements[l], motions[l], push, &push_stiffness);
    EXPECT_NEAR(together.energy[l], alone.energy, 1e-13 * alone.energy) << l;
    EXPECT_LT((lane(together.force, l) - alone.force).norm(), 1e-13 * alone.force.norm()) << l;
    EXPECT_LT((lane(tangents, l) - tangent).norm(), 1e-13 * tangent.norm()) << l;
    EXPECT_LT((lane(pushed, l) - push).norm(), 1e-13 * push.norm()) << l;
    EXPECT_LT((lane(push_stiffnesses, l) - push_stiffness).norm(), 1e-13 * push_stiffness.norm()) << l;
  }
}

TEST(Corotation, CollapsedTriangleIsReported) {
  const ShellElement element = some_element();
  CornerMotion motion{Mat3::Zero(), {Mat3::Identity(), Mat3::Identity(), Mat3::Identity()}};
  motion.displacement.col(2) = element.from_centroid.col(1) - element.from_centroid.col(2);
  ElementResponse response;
  EXPECT_FALSE(corotational_response(element, motion, {}, response, nullptr));
}

struct MovedPatch {
  std::array<Vec3, 3> corners{Vec3(0.1, 0.2, 0.3), Vec3(1.3, 0.1, 0.5), Vec3(0.4, 1.1, -0.2)};
  std::array<Vec3, 3> normals;
};

MovedPatch some_patch() {
  Random random(7);
  MovedPatch patch;
  const Vec3 n = (patch.corners[1] - patch.corners[0]).cross(patch.corners[2] - patch.corners[0]).normalized();
  for (Vec3& normal : patch.normals) {
    normal = (n + random.vector(0.4)).normalized();
  }
  return patch;
}

/// Corners after a large motion with strains of some 20 %.
std::array<Vec3, 3> moved_corners(const MovedPatch& patch) {
  Random random(7);
  std::array<Vec3, 3> corners = patch.corners;
  for (Vec3& corner : corners) {
    corner = exponential(Vec3(0.3, 1.1, -0.4)) * corner + random.vector(0.2) + Vec3(1, 2, 3);
  }
  return corners;
}

TEST(Pressure, HeightIsThatOfTheCurvedPatch) {
  const MovedPatch patch = some_patch();
  const Deflection deflection = comas_deflection(patch.corners, patch.normals);
  double mean = 0;
  for (const double ordinate : deflection.ordinates) {
    mean += ordinate / 10;
  }
  const double area = (patch.corners[1] - patch.corners[0]).cross(patch.corners[2] - patch.corners[0]).norm() / 2;
  EXPECT_NEAR(patch_volume(patch.corners, patch_height(patch.corners, patch.normals)), mean * area, 1e-15);
}

TEST(Pressure, ForceIsTheGradientOfTheVolumeWithTheFacetsShare) {
  const MovedPatch patch = some_patch();
  const PatchHeight height = patch_height(patch.corners, patch.normals);
  const auto corners = moved_corners(patch);
  Vector9 force, flat;
  unit_pressure(corners, height, force, nullptr);
  unit_pressure(corners, {}, flat, nullptr);
  const Vec3 facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]) / 6;
  constexpr double step = 1e-5;
  for (int i = 0; i < 9; ++i) {
    std::array<double, 2> values{};
    for (std::size_t side = 0; side < 2; ++side) {
      auto other = corners;
      other[static_cast<std::size_t>(i / 3)][i % 3] += side == 0 ? step : -step;
      values[side] = patch_volume(other, height);
    }
    EXPECT_NEAR(force[i] - flat[i], (values[0] - values[1]) / (2 * step), 1e-9) << i;
    EXPECT_NEAR(flat[i], facet[i % 3], 1e-15) << i;
  }
}

TEST(Pressure, StiffnessIsTheGradientOfTheForce) {
  const MovedPatch patch = some_patch();
  const PatchHeight height = patch_height(patch.corners, patch.normals);
  const auto corners = moved_corners(patch);
  Vector9 force;
  Matrix9 stiffness;
  unit_pressure(corners, height, force, &stiffness);
  constexpr double step = 1e-5;
  for (int i = 0; i < 9; ++i) {
    std::array<Vector9, 2> forces;
    for (std::size_t side = 0; side < 2; ++side) {
      auto other = corners;
      other[static_cast<std::size_t>(i / 3)][i % 3] += side == 0 ? step : -step;
      unit_pressure(other, height, forces[side], nullptr);
    }
    EXPECT_LT(((forces[0] - forces[1]) / (2 * step) - stiffness.col(i)).norm(), 1e-9) << i;
  }
}

TEST(Pressure, PartOfThePatchIsInBalanceByItself) {
  const MovedPatch patch = some_patch();
  const PatchHeight height = patch_height(patch.corners, patch.normals);
  const auto corners = moved_corners(patch);
  Vector9 curved, flat;
  unit_pressure(corners, height, curved, nullptr);
  unit_pressure(corners, {}, flat, nullptr);
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 difference = curved.segment<3>(3 * k) - flat.segment<3>(3 * k);
    force += difference;
    moment += corners[static_cast<std::size_t>(k)].cross(difference);
  }
  EXPECT_LT(force.norm(), 1e-15);
  EXPECT_LT(moment.norm(), 1e-14);
}

/// Volume between the facet and the origin, and between patch and facet.
double volume_of(const ShellElement& element, const CornerMotion& motion) {
  Vector18 force;
  double patch = 0;
  unit_pressure(element, motion, force, nullptr, &patch);
  return patch;
}

TEST(Pressure, OnSlopesThatCountForceIsTheGradientOfTheVolume) {
  Random random(7);
  const ShellElement element = some_element();
  const CornerMotion motion = large_motion(element, random);
  Vector18 force;
  unit_pressure(element, motion, force, nullptr);
  const Mat3 x = element.from_centroid + motion.displacement;
  const Vec3 facet = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)) / 6;
  constexpr double step = 1e-5;
  for (int i = 0; i < 18; ++i) {
    const double gradient =
        (volume_of(element, moved(motion, i, step)) - volume_of(element, moved(motion, i, -step))) / (2 * step);
    EXPECT_NEAR(force[i] - (i % 6 < 3 ? facet[i % 6] : 0), gradient, 1e-9) << i;
  }
}

TEST(Pressure, OnSlopesThatCountStiffnessIsTheGradientOfTheForce) {
  Random random(7);
  const ShellElement element = some_element();
  const CornerMotion motion = large_motion(element, random);
  Vector18 force, plus, minus;
  Matrix18 stiffness;
  unit_pressure(element, motion, force, &stiffness);
  constexpr double step = 1e-5;
  for (int i = 0; i < 18; ++i) {
    unit_pressure(element, moved(motion, i, step), plus, nullptr);
    unit_pressure(element, moved(motion, i, -step), minus, nullptr);
    EXPECT_LT(((plus - minus) / (2 * step) - stiffness.col(i)).norm(), 1e-9) << i;
  }
}

TEST(Pressure, OnSlopesThatCountIsInBalance) {
  Random random(7);
  const ShellElement element = some_element();
  const CornerMotion motion = large_motion(element, random);
  Vector18 force;
  unit_pressure(element, motion, force, nullptr);
  const Mat3 x = element.from_centroid + motion.displacement;
  const Vec3 facet = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)) / 6;
  Vec3 sum = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 f = force.segment<3>(6 * k) - facet;
    sum += f;
    moment += x.col(k).cross(f) + force.segment<3>(6 * k + 3);
  }
  EXPECT_LT(sum.norm(), 1e-15);
  EXPECT_LT(moment.norm(), 1e-14);
}

}  // namespace
}  // namespace tunica
