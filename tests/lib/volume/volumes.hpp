#pragma once

#include "tunica/volume/labels/mask.hpp"
#include "tunica/volume/labels/volume.hpp"

#include <utility>
#include <vector>

namespace tunica::test {

template <typename T, typename Value>
Volume make_volume(const std::array<std::size_t, 3>& dims, Value&& value) {
  Volume volume;
  volume.dims = dims;
  std::vector<T> data;
  data.reserve(volume.voxels());
  for (std::size_t k = 0; k < dims[2]; ++k) {
    for (std::size_t j = 0; j < dims[1]; ++j) {
      for (std::size_t i = 0; i < dims[0]; ++i) {
        data.push_back(static_cast<T>(value(i, j, k)));
      }
    }
  }
  volume.data = std::move(data);
  return volume;
}

inline constexpr Inside label_one{Inside::Rule::label, 1};
inline Inside above(double value) { return {Inside::Rule::above, value}; }
inline Inside below(double value) { return {Inside::Rule::below, value}; }

/// Distance to a sphere in voxels, positive inside.
inline double sphere_value(std::size_t i, std::size_t j, std::size_t k, const Vec3& centre, double radius) {
  return radius - (Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)) - centre).norm();
}

}  // namespace tunica::test
