// One tetrahedron: its energy, forces and tangent.

#include "tunica/mechanics/solids/solid_element.hpp"
#include "random.hpp"
#include "tets.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

namespace tunica {
namespace {

using namespace benchmarks;

constexpr std::array<SolidLaw, 2> laws{SolidLaw::corotational, SolidLaw::neo_hookean};
constexpr std::array<double, 4> poissons{-0.3, 0.3, 0.45, 0.4999};

std::string name_of(SolidLaw law) { return law == SolidLaw::corotational ? "corotational" : "neo-Hookean"; }

/// A tetrahedron of about unit edges, not regular, anywhere.
Corners4 random_corners(Random& random) {
  Corners4 corners;
  corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  const Mat3 turn = random.rotation(1.7).toRotationMatrix();
  const Vec3 place = random.vector(3);
  for (int k = 0; k < 4; ++k) {
    corners.col(k) = place + turn * (corners.col(k) + random.vector(0.15));
  }
  return corners;
}

/// Turned as far as it likes, strained by up to some tenths.
SolidMotion random_motion(Random& random, const Corners4& corners, double strain) {
  const Mat3 turn = random.rotation(1.7).toRotationMatrix();
  SolidMotion motion;
  for (int k = 0; k < 4; ++k) {
    motion.displacement.col(k) = turn * (corners.col(k) + random.vector(strain)) - corners.col(k);
    motion.pressure[k] = random(0.5);
  }
  return motion;
}

SolidMotion stepped(const SolidMotion& motion, int freedom, double step) {
  SolidMotion result = motion;
  (freedom % 4 == 3 ? result.pressure[freedom / 4] : result.displacement(freedom % 4, freedom / 4)) += step;
  return result;
}

Mat3 symmetric_part(const Mat3& m) { return 0.5 * (m + m.transpose()); }

template <typename Check>
void for_all(const Check& check) {
  Random random(11);
  for (const SolidLaw law : laws) {
    for (const double poisson : poissons) {
      SCOPED_TRACE(name_of(law) + ", Poisson's ratio " + std::to_string(poisson));
      for (int sample = 0; sample < 20; ++sample) {
        const Corners4 corners = random_corners(random);
        check(make_solid_element(corners, {2.5, poisson, std::nullopt}, law), corners, random);
      }
    }
  }
}

TEST(SolidElement, ForcesAreTheDerivativeOfTheEnergyAndTheTangentThatOfTheForces) {
  constexpr double step = 1e-5;
  for_all([&](SolidElement element, const Corners4& corners, Random& random) {
    for (int k = 0; k < 3; ++k) {
      element.prestress.col(k) = random.vector(0.1);
    }
    element.prestress = symmetric_part(element.prestress);
    const SolidMotion motion = random_motion(random, corners, 0.12);
    SolidResponse response, before, after;
    Matrix16 tangent;
    ASSERT_TRUE(solid_response(element, motion, response, &tangent));
    const double scale = tangent.norm();
    for (int i = 0; i < 16; ++i) {
      ASSERT_TRUE(solid_response(element, stepped(motion, i, -step), before, nullptr));
      ASSERT_TRUE(solid_response(element, stepped(motion, i, step), after, nullptr));
      ASSERT_NEAR(response.force[i], (after.energy - before.energy) / (2 * step), 1e-8 * scale) << "freedom " << i;
      ASSERT_LT((tangent.col(i) - (after.force - before.force) / (2 * step)).norm(), 1e-8 * scale) << "freedom " << i;
    }
    ASSERT_LT((tangent - tangent.transpose()).norm(), 1e-13 * scale);
  });
}

TEST(SolidElement, RigidMotionsLeaveNoForceAndNoEnergy) {
  for_all([](const SolidElement& element, const Corners4& corners, Random& random) {
    const SolidMotion moved = random_motion(random, corners, 0);
    SolidResponse response;
    ASSERT_TRUE(solid_response(element, {moved.displacement, Eigen::Vector4d::Zero()}, response, nullptr));
    const double stiffness = linear_stiffness(element).norm();
    ASSERT_LT(response.force.norm(), 2e-14 * stiffness);
    ASSERT_LT(std::abs(response.energy), 1e-14 * stiffness);
  });
}

/// Where the rotation were that of one corner's edges, a strained element would feel how it is turned.
TEST(SolidElement, ForcesTurnWithTheElement) {
  for_all([](const SolidElement& element, const Corners4& corners, Random& random) {
    const SolidMotion motion = random_motion(random, corners, 0.15);
    const Mat3 turn = random.rotation(1.7).toRotationMatrix();
    const Vec3 shift = random.vector(2);
    SolidMotion turned = motion;
    for (int k = 0; k < 4; ++k) {
      turned.displacement.col(k) = turn * (corners.col(k) + motion.displacement.col(k)) + shift - corners.col(k);
    }
    SolidResponse response, of_turned;
    ASSERT_TRUE(solid_response(element, motion, response, nullptr));
    ASSERT_TRUE(solid_response(element, turned, of_turned, nullptr));
    const double scale = linear_stiffness(element).norm();
    for (int k = 0; k < 4; ++k) {
      const Vec3 expected = turn * response.force.segment<3>(4 * k);
      ASSERT_LT((of_turned.force.segment<3>(4 * k) - expected).norm(), 1e-13 * scale);
      ASSERT_NEAR(of_turned.force[4 * k + 3], response.force[4 * k + 3], 1e-13 * scale);
    }
    ASSERT_NEAR(of_turned.energy, response.energy, 1e-13 * scale);
    const Mat3 stress = solid_stress(element, motion, false);
    ASSERT_LT((solid_stress(element, turned, false) - turn * stress * turn.transpose()).norm(), 1e-12 * scale);
  });
}

TEST(SolidElement, ForcesAreInBalance) {
  for_all([](const SolidElement& element, const Corners4& corners, Random& random) {
    const SolidMotion motion = random_motion(random, corners, 0.15);
    SolidResponse response;
    ASSERT_TRUE(solid_response(element, motion, response, nullptr));
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (int k = 0; k < 4; ++k) {
      const Vec3 f = response.force.segment<3>(4 * k);
      force += f;
      moment += Vec3(corners.col(k) + motion.displacement.col(k)).cross(f);
    }
    ASSERT_LT(force.norm(), 1e-13 * response.force.norm());
    ASSERT_LT(moment.norm(), 1e-12 * response.force.norm());
  });
}

/// The solver counts instabilities by negative pivots less pressures: one more or less would be called a snap.
TEST(SolidElement, TheTangentAtRestHasAsManyNegativeEigenvaluesAsPressures) {
  for_all([](const SolidElement& element, const Corners4&, Random&) {
    const Matrix16 stiffness = linear_stiffness(element);
    const auto values = Eigen::SelfAdjointEigenSolver<Matrix16>(stiffness).eigenvalues();
    const double zero = 1e-12 * stiffness.norm();
    ASSERT_EQ((values.array() < -zero).count(), 4) << values.transpose();
    ASSERT_EQ((values.array() > zero).count(), 6) << values.transpose();
  });
}

/// Pressures of both signs that the elements leave undetermined: a checkerboard.
TEST(SolidElement, NoPressureIsWithoutStiffness) {
  for_all([](const SolidElement& element, const Corners4&, Random&) {
    Eigen::Matrix4d of_pressures;
    const Matrix16 stiffness = linear_stiffness(element);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        of_pressures(i, j) = -stiffness(4 * i + 3, 4 * j + 3) / (element.shear * element.volume);
      }
    }
    const double compliance = element.shear / element.bulk_of_pressure;
    const Eigen::Vector4d constant = Eigen::Vector4d::Ones(), other(1, -1, 1, -1), one(1, -1, 0, 0);
    EXPECT_LT((of_pressures * constant - compliance / 4 * constant).norm(), 1e-13);  // no projection here
    EXPECT_LT((of_pressures * other - 0.05 * (1 + compliance) * other).norm(), 1e-13 * (1 + compliance));
    EXPECT_LT((of_pressures * one - 0.05 * (1 + compliance) * one).norm(), 1e-13 * (1 + compliance));
  });
}

TEST(SolidElement, InsideOutIsFalse) {
  for_all([](const SolidElement& element, const Corners4& corners, Random&) {
    SolidResponse response;
    Matrix16 tangent;
    // The first corner passes the plane of the others.
    const Vec3 middle = corners.rightCols<3>().rowwise().mean();
    SolidMotion motion{Corners4::Zero(), Eigen::Vector4d::Zero()};
    motion.displacement.col(0) = 0.98 * (middle - corners.col(0));
    EXPECT_TRUE(solid_response(element, motion, response, nullptr));
    motion.displacement.col(0) = 1.02 * (middle - corners.col(0));
    EXPECT_FALSE(solid_response(element, motion, response, nullptr));
    EXPECT_FALSE(solid_response(element, motion, response, &tangent));
    motion.displacement.setConstant(std::numeric_limits<double>::quiet_NaN());
    EXPECT_FALSE(solid_response(element, motion, response, nullptr));
  });
}

/// At small strains both laws are Hooke's, the split of the bulk modulus put together again.
TEST(SolidElement, BothLawsAreLinearElasticityAtSmallStrains) {
  constexpr double small = 1e-6;
  for_all([&](const SolidElement& element, const Corners4& corners, Random& random) {
    Mat3 gradient;
    gradient << random.vector(small), random.vector(small), random.vector(small);
    SolidMotion motion{gradient * corners, Eigen::Vector4d::Zero()};
    motion.pressure.setConstant(element.bulk_of_pressure * gradient.trace() / element.shear);
    const double bulk = element.bulk_of_displacement + element.bulk_of_pressure;
    const Mat3 strain = symmetric_part(gradient);
    const Mat3 expected =
        2 * element.shear * strain + (bulk - 2 * element.shear / 3) * strain.trace() * Mat3::Identity();
    const double scale = (bulk + element.shear) * small;
    ASSERT_LT((solid_stress(element, motion, true) - expected).norm(), 1e-12 * scale);
    ASSERT_LT((solid_stress(element, motion, false) - expected).norm(), 1e-4 * scale);
    SolidResponse response;
    ASSERT_TRUE(solid_response(element, motion, response, nullptr));
    const Vector16 linear = linear_stiffness(element) * [&] {
      Vector16 all;
      for (int k = 0; k < 4; ++k) {
        all.segment<4>(4 * k) << motion.displacement.col(k), motion.pressure[k];
      }
      return all;
    }();
    for (int k = 0; k < 4; ++k) {
      const Vec3 exact = element.volume * expected * element.gradients.col(k);
      ASSERT_LT((linear.segment<3>(4 * k) - exact).norm(), 1e-10 * scale);
      ASSERT_LT((response.force.segment<3>(4 * k) - exact).norm(), 1e-4 * scale);
      // The pressure that the volume's change makes by the bulk modulus is at rest.
      ASSERT_NEAR(linear[4 * k + 3], 0, 1e-10 * scale);
      ASSERT_NEAR(response.force[4 * k + 3], 0, 1e-4 * scale);
    }
  });
}

/// Tunica's unit of pressures is the shear modulus: a stiffer material moves alike.
/// The forces of a tetrahedron say its nominal stress P, that with F the true one: P F' / det F.
TEST(SolidElement, StressIsCauchys) {
  for_all([&](SolidElement element, const Corners4& corners, Random& random) {
    element.prestress = 0.1 * Mat3::Identity();
    const SolidMotion motion = random_motion(random, corners, 0.12);
    SolidResponse response;
    ASSERT_TRUE(solid_response(element, motion, response, nullptr));
    Mat3 nominal = Mat3::Zero();
    for (int k = 0; k < 4; ++k) {
      nominal += response.force.segment<3>(4 * k) * corners.col(k).transpose() / element.volume;
    }
    const Mat3 f = Mat3::Identity() + motion.displacement * element.gradients.transpose();
    const Mat3 expected = nominal * f.transpose() / f.determinant();
    ASSERT_LT((solid_stress(element, motion, false) - expected).norm(), 1e-9 * (1 + expected.norm()));
  });
}

TEST(SolidElement, ForcesAreProportionalToYoungsModulus) {
  Random random(11);
  const Corners4 corners = random_corners(random);
  const SolidMotion motion = random_motion(random, corners, 0.1);
  for (const SolidLaw law : laws) {
    SolidResponse soft, stiff;
    ASSERT_TRUE(solid_response(make_solid_element(corners, {0.005, 0.45, {}}, law), motion, soft, nullptr));
    ASSERT_TRUE(solid_response(make_solid_element(corners, {5000, 0.45, {}}, law), motion, stiff, nullptr));
    EXPECT_LT((1e6 * soft.force - stiff.force).norm(), 1e-12 * stiff.force.norm());
  }
}

/// Of the law: uniaxial stretch at lambda, its sides free, against a solution by bisection.
TEST(SolidElement, NeoHookeanStretchIsThatOfItsEnergy) {
  Random random(11);
  const Corners4 corners = random_corners(random);
  for (const double poisson : {0.3, 0.45}) {
    const SolidElement element = make_solid_element(corners, {2.5, poisson, {}}, SolidLaw::neo_hookean);
    const double mu = element.shear, k = element.bulk_of_displacement + element.bulk_of_pressure;
    for (const double stretch : {0.6, 0.9, 1.3, 1.8}) {
      // W = mu (F:F - 3) / 2 - mu ln J + lambda (ln J)^2 / 2, lambda = K - 2 mu / 3; p = K1 ln J.
      const double lambda = k - 2 * mu / 3;
      double low = 0.2, high = 3;
      for (int i = 0; i < 200; ++i) {
        const double side = (low + high) / 2, j = stretch * side * side;
        (mu * side * side + lambda * std::log(j) - mu > 0 ? high : low) = side;
      }
      const double j = stretch * low * low;
      const double stress = (mu * stretch * stretch + lambda * std::log(j) - mu) / j;
      SolidMotion motion;
      motion.displacement = Vec3(low - 1, low - 1, stretch - 1).asDiagonal() * corners;
      motion.pressure.setConstant(element.bulk_of_pressure * std::log(j) / mu);
      const Mat3 cauchy = solid_stress(element, motion, false);
      EXPECT_NEAR(cauchy(2, 2), stress, 1e-12 * k);
      EXPECT_NEAR(cauchy(0, 0), 0, 1e-12 * k);
      EXPECT_NEAR(cauchy(0, 1), 0, 1e-12 * k);
    }
  }
}

/// Linear displacements on the boundary of a distorted cluster; the inner node is off its middle.
TEST(SolidPatch, LinearDisplacementsAreExact) {
  Random random(11);
  Mat3 gradient;
  gradient << random.vector(1e-2), random.vector(1e-2), random.vector(1e-2);
  gradient.diagonal().array() += (1e-4 - gradient.trace()) / 3;
  const auto exact = [&](const Vec3& x) { return Vec3(gradient * x + Vec3(0.3, -0.2, 0.1)); };
  for (const SolidLaw law : laws) {
    for (const double poisson : {0.3, 0.4999}) {
      for (const bool linear : {true, false}) {
        SCOPED_TRACE(name_of(law) + (linear ? ", linear, " : ", nonlinear, ") + std::to_string(poisson));
        const auto outside = [](const Vec3& x) { return x.cwiseAbs().maxCoeff() > 0.7; };
        Model model = one_solid(make_block(2, 2, 2,
                                           [&](const Vec3& u) {
                                             const Vec3 x = 2 * u - Vec3::Ones();
                                             return Vec3(x + (x.norm() < 0.1 ? 1.5 : 1.0) * random.vector(0.15));
                                           }),
                                2.5, poisson, law);
        ASSERT_EQ(nodes_of(model, 0, outside).size(), 26U);
        move_nodes(model, 0, outside, exact);
        RunSettings settings = linear ? linear_run() : nonlinear_run({1});
        settings.converge = 1e-13;
        const State state = last_state(model, settings);
        const double shear = 2.5 / (2 * (1 + poisson)), bulk = 2.5 / (3 * (1 - 2 * poisson));
        const double of_pressure = bulk - std::min(shear, bulk / 2);
        const Mat3 f = Mat3::Identity() + gradient;
        const double volume_strain = linear                          ? gradient.trace()
                                     : law == SolidLaw::corotational ? f.determinant() - 1
                                                                     : std::log(f.determinant());
        const double pressure = of_pressure * volume_strain / shear;
        for (std::size_t i = 0; i < model.solids[0].mesh.vertices.size(); ++i) {
          EXPECT_LT((state.displacement[i] - exact(model.solids[0].mesh.vertices[i])).norm(), 1e-12);
          EXPECT_NEAR(state.pressure[i], pressure, 1e-12 * std::max(1.0, of_pressure / shear));
        }
      }
    }
  }
}

/// With trace(S - 1) for its volume strain the co-rotational law would buckle inside under twice its shear modulus.
TEST(SolidPatch, PressureDoesNotBuckleTheInside) {
  constexpr double poisson = 0.4999;
  const auto squeezed = [&](SolidLaw law, double pressure, std::vector<double> factors) {
    Model model = one_solid(make_block(4, 4, 4, [](const Vec3& u) { return Vec3(4 * u); }), 1, poisson, law);
    const double shear = 1 / (2 * (1 + poisson)), bulk = 1 / (3 * (1 - 2 * poisson));
    const double strain = -pressure * shear / (3 * bulk);
    move_nodes(
        model, 0, [](const Vec3& x) { return (x - Vec3::Constant(2)).cwiseAbs().maxCoeff() > 1.9; },
        [&](const Vec3& x) { return Vec3(strain * x); });
    return error_of(model, nonlinear_run(std::move(factors)));
  };
  EXPECT_EQ(squeezed(SolidLaw::corotational, 20, {0.99, 1}), "");
  EXPECT_EQ(squeezed(SolidLaw::neo_hookean, 20, {0.99, 1}), "");
}

}  // namespace
}  // namespace tunica
