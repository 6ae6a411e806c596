#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace tunica {
namespace {

/// Weights 0 … radius of a Gaussian, and their sums for normalising at the image's border.
struct Kernel {
  std::vector<float> weights;

  Kernel(double sigma, std::size_t size) {
    const double reach = std::min(std::ceil(4 * sigma), real(size));
    for (std::size_t i = 0; i <= truncated<std::size_t>(reach); ++i) {
      const double x = real(i) / sigma;
      weights.push_back(static_cast<float>(std::exp(-0.5 * x * x)));
    }
  }

  [[nodiscard]] std::size_t radius() const { return weights.size() - 1; }
  [[nodiscard]] std::size_t first(std::size_t at) const { return at - std::min(at, radius()); }
  [[nodiscard]] std::size_t last(std::size_t at, std::size_t size) const { return std::min(at + radius(), size - 1); }
  [[nodiscard]] float weight(std::size_t at, std::size_t other) const {
    return weights[at < other ? other - at : at - other];
  }
  /// One over the sum of the weights that lie in the image.
  [[nodiscard]] float scale(std::size_t at, std::size_t size) const {
    float sum = 0;
    for (std::size_t other = first(at); other <= last(at, size); ++other) {
      sum += weight(at, other);
    }
    return 1 / sum;
  }
};

std::array<Kernel, 3> kernels(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine,
                              double sigma) {
  if (!(sigma > 0) || !std::isfinite(sigma)) {
    throw UsageError(fmt::format("smoothing by {} mm is not possible: give a positive length, as in 1mm", sigma));
  }
  const auto kernel = [&](int axis) { return Kernel(sigma / affine.col(axis).norm(), dims[axis]); };
  return {kernel(0), kernel(1), kernel(2)};
}

/// Convolves along i; fill(row, out) writes the values of a row of the field to be smoothed.
void smooth_rows(const std::array<std::size_t, 3>& dims, const Kernel& kernel,
                 const std::function<void(std::size_t row, float* out)>& fill, std::vector<float>& out) {
  const std::size_t columns = dims[0];
  std::vector<float> scale(columns);
  for (std::size_t i = 0; i < columns; ++i) {
    scale[i] = kernel.scale(i, columns);
  }
  parallel_for_blocks(dims[1] * dims[2], 64, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    const std::size_t radius = kernel.radius();
    std::vector<float> padded(columns + 2 * radius, 0.0F);
    for (std::size_t row = begin; row < end; ++row) {
      fill(row, padded.data() + radius);
      float* const result = out.data() + row * columns;
      for (std::size_t i = 0; i < columns; ++i) {
        result[i] = kernel.weights[0] * padded[i + radius];
      }
      for (std::size_t d = 1; d <= radius; ++d) {
        for (std::size_t i = 0; i < columns; ++i) {
          result[i] += kernel.weights[d] * (padded[i + radius - d] + padded[i + radius + d]);
        }
      }
      for (std::size_t i = 0; i < columns; ++i) {
        result[i] *= scale[i];
      }
    }
  });
}

/// Convolves along j or k: lines of `columns` values, `step` apart, `count` of them in a sequence that starts at
/// start(sequence).
void smooth_across(std::size_t columns, std::size_t step, std::size_t count, std::size_t sequences,
                   const std::function<std::size_t(std::size_t sequence)>& start, const Kernel& kernel,
                   const std::vector<float>& in, std::vector<float>& out) {
  parallel_for_blocks(sequences * count, 16, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t line = begin; line < end; ++line) {
      const std::size_t at = line % count;
      const std::size_t origin = start(line / count);
      float* const result = out.data() + origin + at * step;
      std::fill_n(result, columns, 0.0F);
      const float scale = kernel.scale(at, count);
      for (std::size_t other = kernel.first(at); other <= kernel.last(at, count); ++other) {
        const float weight = kernel.weight(at, other) * scale;
        const float* const values = in.data() + origin + other * step;
        for (std::size_t i = 0; i < columns; ++i) {
          result[i] += weight * values[i];
        }
      }
    }
  });
}

Volume smooth(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine, double sigma,
              const std::function<void(std::size_t row, float* out)>& fill, const Progress& progress) {
  const std::array<Kernel, 3> kernel = kernels(dims, affine, sigma);
  const auto [columns, rows, slices] = dims;
  const std::size_t plane = columns * rows;
  std::vector<float> a(plane * slices);
  std::vector<float> b(plane * slices);
  smooth_rows(dims, kernel[0], fill, a);
  advance(progress, 0.3);
  smooth_across(
      columns, columns, rows, slices, [plane](std::size_t slice) { return slice * plane; }, kernel[1], a, b);
  advance(progress, 0.6);
  smooth_across(
      columns, plane, slices, rows, [columns = columns](std::size_t row) { return row * columns; }, kernel[2], b, a);
  advance(progress, 0.9);
  Volume result;
  result.dims = dims;
  result.affine = affine;
  result.data = std::move(a);
  return result;
}

/// The level above which there are `count` of the values: half-way between the values before and after the cut.
float level_above_which(const std::vector<float>& values, std::size_t count) {
  // A histogram first: the whole need not be sorted.
  constexpr std::size_t bins = 65536;
  const auto bin_of = [](float v) {
    return truncated<std::size_t>(std::clamp(v, 0.0F, 1.0F) * static_cast<float>(bins - 1));
  };
  std::vector<std::size_t> histogram(bins, 0);
  for (const float v : values) {
    ++histogram[bin_of(v)];
  }
  // The count-th value from above, 1-based, or the highest when count is 0.
  const auto from_above = [&](std::size_t rank) {
    std::size_t bin = bins;
    std::size_t above = 0;
    do {
      --bin;
      above += histogram[bin];
    } while (above < rank && bin > 0);
    std::vector<float> inside_bin;
    std::ranges::copy_if(values, std::back_inserter(inside_bin), [&](float v) { return bin_of(v) == bin; });
    const std::size_t place = rank - (above - histogram[bin]) - 1;
    std::ranges::nth_element(inside_bin, inside_bin.begin() + place, std::greater{});
    return inside_bin[place];
  };
  if (count == 0 || count >= values.size()) {
    return 0.5F;
  }
  return 0.5F * (from_above(count) + from_above(count + 1));
}

/// The level at which the surface encloses `volume` mm^3, by regula falsi (Illinois) from a first guess.
double level_of_volume(const Volume& field, double volume, double guess) {
  const auto excess = [&](double level) {
    return signed_volume(marching_cubes(field, {Inside::Rule::above, level})) / volume - 1;
  };
  constexpr double tolerance = 1e-4;
  constexpr int most_steps = 10;
  // The volume falls as the level rises.
  double low = 0;
  double high = 1;
  double excess_low = 0;
  double excess_high = 0;
  int last_side = 0;
  bool has_low = false;
  bool has_high = false;
  double best = guess;
  double best_excess = infinity;
  double level = guess;
  for (int step = 0; step < most_steps; ++step) {
    const double e = excess(level);
    if (std::abs(e) < std::abs(best_excess)) {
      best = level;
      best_excess = e;
    }
    if (std::abs(e) < tolerance) {
      break;
    }
    if (e > 0) {
      low = level;
      excess_high *= last_side > 0 ? 0.5 : 1;
      excess_low = e;
      has_low = true;
      last_side = 1;
    } else {
      high = level;
      excess_low *= last_side < 0 ? 0.5 : 1;
      excess_high = e;
      has_high = true;
      last_side = -1;
    }
    level = has_low && has_high ? low + (high - low) * excess_low / (excess_low - excess_high)
                                : (e > 0 ? level + 0.1 * (1 - level) : 0.9 * level);
  }
  return best;
}

}  // namespace

SmoothedField smooth_mask(const Mask& mask, double sigma, const Progress& progress) {
  const std::size_t columns = mask.dims()[0];
  const auto fill = [&](std::size_t row, float* out) {
    const std::uint64_t* const words = mask.row(row, 0);
    for (std::size_t i = 0; i < columns; ++i) {
      out[i] = (words[i / 64] >> (i % 64) & 1) != 0 ? 1.0F : 0.0F;
    }
  };
  SmoothedField result;
  result.field = smooth(mask.dims(), mask.affine(), sigma, fill, progress);
  const std::size_t voxels = count_voxels(mask);
  const float guess = level_above_which(std::get<std::vector<float>>(result.field.data), voxels);
  const double volume = real(voxels) * mask.voxel_volume();
  result.rule = {Inside::Rule::above, voxels == 0 ? 0.5 : level_of_volume(result.field, volume, guess)};
  advance(progress, 1.0);
  return result;
}

Volume smooth_values(const Volume& volume, double sigma, const Progress& progress) {
  require_volume(volume);
  const std::size_t columns = volume.dims[0];
  return std::visit(
      [&](const auto& values) {
        const auto fill = [&](std::size_t row, float* out) {
          for (std::size_t i = 0; i < columns; ++i) {
            out[i] =
                static_cast<float>(volume.slope * static_cast<double>(values[row * columns + i]) + volume.intercept);
          }
        };
        Volume result = smooth(volume.dims, volume.affine, sigma, fill, progress);
        advance(progress, 1.0);
        return result;
      },
      volume.data);
}

}  // namespace tunica
