#pragma once

#include "tunica/core/lanes.hpp"
#include "tunica/core/narrow.hpp"

#include <array>
#if defined(__AVX__) && defined(TUNICA_STANDARD_SIMD)
#include <immintrin.h>
#endif

/// Matrices of shell elements, several elements at once.
namespace tunica {

using LaneVector6 = Eigen::Matrix<Lanes, 6, 1>;
using LaneVector18 = Eigen::Matrix<Lanes, 18, 1>;
using LaneMat2 = Eigen::Matrix<Lanes, 2, 2>;
using LaneMat3 = Eigen::Matrix<Lanes, 3, 3>;
using LaneMat23 = Eigen::Matrix<Lanes, 2, 3>;
using LaneMatrix6 = Eigen::Matrix<Lanes, 6, 6>;
using LaneMatrix9 = Eigen::Matrix<Lanes, 9, 9>;
using LaneMatrix18 = Eigen::Matrix<Lanes, 18, 18>;

/// One lane of a matrix.
template <typename Matrix>
auto lane(const Matrix& matrix, std::size_t k) {
  Eigen::Matrix<double, Matrix::RowsAtCompileTime, Matrix::ColsAtCompileTime> result;
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    result.coeffRef(i) = matrix.coeff(i)[k];
  }
  return result;
}

/// Element k of vector i becomes element i of vector k.
inline void transpose(std::array<Lanes, lane_count>& vectors) {
#if defined(__AVX__) && defined(TUNICA_STANDARD_SIMD)
  const auto bits = [&](std::size_t i) { return static_cast<__m256d>(vectors[i]); };
  const __m256d even_low = _mm256_unpacklo_pd(bits(0), bits(1));
  const __m256d odd_low = _mm256_unpackhi_pd(bits(0), bits(1));
  const __m256d even_high = _mm256_unpacklo_pd(bits(2), bits(3));
  const __m256d odd_high = _mm256_unpackhi_pd(bits(2), bits(3));
  vectors = {
      Lanes(_mm256_permute2f128_pd(even_low, even_high, 0x20)), Lanes(_mm256_permute2f128_pd(odd_low, odd_high, 0x20)),
      Lanes(_mm256_permute2f128_pd(even_low, even_high, 0x31)), Lanes(_mm256_permute2f128_pd(odd_low, odd_high, 0x31))};
#else
  const std::array<Lanes, lane_count> from = vectors;
  for (std::size_t k = 0; k < lane_count; ++k) {
    vectors[k] = Lanes([&](auto i) { return from[i][k]; });
  }
#endif
}

/// Makes the matrix whose lane k is matrix(k), a plain matrix of doubles with the same storage order.
template <typename To, typename Get>
void set_lanes(To& result, const Get& matrix) {
  Eigen::Index i = 0;
  for (; i + narrow<Eigen::Index>(lane_count) <= result.size(); i += lane_count) {
    std::array<Lanes, lane_count> part;
    for (std::size_t k = 0; k < lane_count; ++k) {
      part[k].copy_from(matrix(k).data() + i, simd::element_aligned);
    }
    transpose(part);
    for (std::size_t k = 0; k < lane_count; ++k) {
      result.coeffRef(i + k) = part[k];
    }
  }
  for (; i < result.size(); ++i) {
    result.coeffRef(i) = Lanes([&](auto k) { return matrix(std::size_t{k}).coeff(i); });
  }
}

}  // namespace tunica
