#include "tunica/volume/labels/whole_labels.hpp"

#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"

#include <algorithm>
#include <type_traits>
#include <vector>

namespace tunica {
namespace {

template <typename T>
Wholeness wholeness_of(const T* values, std::size_t count, const Volume& slab) {
  Wholeness sum;
  for (std::size_t i = 0; i < count; ++i) {
    const double value = slab.slope * static_cast<double>(values[i]) + slab.intercept;
    if (!std::isfinite(value)) {
      continue;
    }
    const double off = std::abs(value - std::nearbyint(value));
    if (off > label_rounding) {
      sum.example = sum.between == 0 ? value : sum.example;
      ++sum.between;
      ++sum.not_zero;
      continue;
    }
    sum.not_zero += label_meant(value) != 0 ? 1 : 0;
    sum.rounded += off > 0 ? 1 : 0;
    sum.farthest = std::max(sum.farthest, off);
  }
  return sum;
}

constexpr std::size_t many_values = 32;
constexpr double many_differ = 0.2;  // of neighbours: between labels it is a few in a hundred

}  // namespace

void Neighbours::add(const Volume& slab) {
  require_volume(slab);
  std::visit(
      [&](const auto& stored) {
        const std::size_t row = slab.dims[0];
        for (std::size_t i = 0; i < stored.size(); ++i) {
          if (i % (1 << 20) == 0) {
            check_interrupt();
          }
          const double value = slab.slope * static_cast<double>(stored[i]) + slab.intercept;
          if (value == 0 || !std::isfinite(value)) {
            continue;
          }
          if (values.size() < many_values) {
            values.insert(value);
          }
          if (i % row == 0) {
            continue;
          }
          const double before = slab.slope * static_cast<double>(stored[i - 1]) + slab.intercept;
          pairs += before != 0 ? 1 : 0;
          differing += before != 0 && before != value ? 1 : 0;
        }
      },
      slab.data);
}

bool Neighbours::are_grey() const {
  return values.size() >= many_values && real(differing) > many_differ * real(pairs);
}

void Wholeness::add(const Volume& slab) {
  require_volume(slab);
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if (std::is_integral_v<T> && slab.slope == 1 && slab.intercept == 0) {
          return;
        }
        constexpr std::size_t block = 1 << 16;
        std::vector<Wholeness> parts((values.size() + block - 1) / block);
        parallel_for_blocks(values.size(), block, [&](std::size_t begin, std::size_t end) {
          check_interrupt();
          parts[begin / block] = wholeness_of(values.data() + begin, end - begin, slab);
        });
        for (const Wholeness& part : parts) {
          example = between == 0 ? part.example : example;
          not_zero += part.not_zero;
          rounded += part.rounded;
          between += part.between;
          farthest = std::max(farthest, part.farthest);
        }
      },
      slab.data);
}

}  // namespace tunica
