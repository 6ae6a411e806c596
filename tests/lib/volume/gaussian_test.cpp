#include "mesh_check.hpp"
#include "tunica/core/error.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tunica {
namespace {

using test::check_mesh;
using test::label_one;
using test::make_volume;
using test::sphere_value;

TEST(Gaussian, AConstantStaysConstantUpToTheBorder) {
  const Volume volume = make_volume<std::int16_t>({9, 20, 13}, [](auto...) { return 42; });
  const Volume smooth = smooth_values(volume, 2.5);
  for (const float v : std::get<std::vector<float>>(smooth.data)) {
    EXPECT_NEAR(v, 42, 1e-4);
  }
}

TEST(Gaussian, AnImpulseSpreadsByTheSameMillimetresAlongEveryAxis) {
  Volume volume =
      make_volume<float>({41, 41, 21}, [](auto i, auto j, auto k) { return i == 20 && j == 20 && k == 10 ? 1 : 0; });
  volume.affine.leftCols<3>() = Vec3(0.5, -1, 2).asDiagonal();
  const double sigma = 2;
  const Volume smooth = smooth_values(volume, sigma);
  const auto& values = std::get<std::vector<float>>(smooth.data);
  Vec3 variance = Vec3::Zero();
  double sum = 0;
  std::size_t at = 0;
  for (int k = 0; k < 21; ++k) {
    for (int j = 0; j < 41; ++j) {
      for (int i = 0; i < 41; ++i, ++at) {
        const Vec3 p = volume.affine.leftCols<3>() * Vec3(i - 20, j - 20, k - 10);
        sum += static_cast<double>(values[at]);
        variance += static_cast<double>(values[at]) * p.cwiseAbs2();
      }
    }
  }
  EXPECT_NEAR(sum, 1, 1e-3);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(std::sqrt(variance[axis] / sum), sigma, 0.02 * sigma);
  }
}

TEST(Gaussian, ASmoothedMaskKeepsItsVolume) {
  for (const double radius : {5.0, 9.0}) {
    for (const double sigma : {0.01, 0.5, 1.0, 2.0}) {
      const Volume volume = make_volume<std::uint8_t>({30, 30, 30}, [&](auto i, auto j, auto k) {
        return sphere_value(i, j, k, Vec3(14.3, 14.6, 14.9), radius) > 0;
      });
      const Mask mask = select(volume, label_one);
      const SmoothedField smooth = smooth_mask(mask, sigma);
      const auto check = check_mesh(marching_cubes(smooth.field, smooth.rule));
      EXPECT_TRUE(check.closed() && check.manifold());
      const auto voxels = static_cast<double>(count_voxels(mask));
      EXPECT_NEAR(check.volume, voxels, 2e-4 * voxels) << radius << ' ' << sigma;
    }
  }
}

TEST(Gaussian, SmoothingComesCloserToTheSphere) {
  const Vec3 centre(24.3, 24.1, 23.7);
  const Volume volume = make_volume<std::uint8_t>(
      {48, 48, 48}, [&](auto i, auto j, auto k) { return sphere_value(i, j, k, centre, 18) > 0; });
  const auto mean_error = [&](const TriangleMesh& mesh) {
    double sum = 0;
    for (const Vec3& p : mesh.vertices) {
      sum += std::abs((p - centre).norm() - 18);
    }
    return sum / static_cast<double>(mesh.vertices.size());
  };
  const SmoothedField smooth = smooth_mask(select(volume, label_one), 1.0);
  EXPECT_LT(mean_error(marching_cubes(smooth.field, smooth.rule)), 0.4 * mean_error(marching_cubes(volume, label_one)));
}

TEST(Gaussian, RefusesASigmaThatIsNotALength) {
  const Mask mask({3, 3, 3}, Eigen::Matrix<double, 3, 4>::Identity());
  for (const double sigma : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(smooth_mask(mask, sigma), UsageError);
  }
}

TEST(Gaussian, AWidthBeyondTheImageIsTheMean) {
  const Volume volume = make_volume<float>({6, 5, 4}, [](auto i, auto, auto) { return i; });
  const Volume smooth = smooth_values(volume, 1e6);
  for (const float v : std::get<std::vector<float>>(smooth.data)) {
    EXPECT_NEAR(v, 2.5, 1e-5);
  }
}

}  // namespace
}  // namespace tunica
