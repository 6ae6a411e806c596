#include "volume/marching_cubes.hpp"

#include "core/error.hpp"
#include "core/threads.hpp"
#include "volume/cell_layers.hpp"
#include "volume/fresh_memory.hpp"
#include "volume/pinched_vertices.hpp"

#include <fmt/format.h>

#include <cmath>
#include <type_traits>

namespace tunica {
namespace {

using cell_layers::Crossings;
using cell_layers::LayerCounts;

template <typename T>
class Interpolated final : public Crossings {
public:
  Interpolated(const Volume& volume, const std::vector<T>& values, double value)
      : values_(values.data()), slope_(volume.slope), intercept_(volume.intercept), value_(value) {}

  void place(const std::size_t* first, const std::size_t* second, std::size_t count, double* fractions) const override {
    for (std::size_t i = 0; i < count; ++i) {
      // Halved, because the difference of two finite numbers may not be finite.
      const double a = 0.5 * meaning(first[i]);
      const double b = 0.5 * meaning(second[i]);
      const double t = (0.5 * value_ - a) / (b - a);
      fractions[i] = std::isfinite(a) && std::isfinite(b) && t >= 0 && t <= 1 ? t : 0.5;
    }
  }

private:
  [[nodiscard]] double meaning(std::size_t sample) const {
    return slope_ * static_cast<double>(values_[sample]) + intercept_;
  }

  const T* values_;
  double slope_;
  double intercept_;
  double value_;
};

/// @param crossings  null: every edge is crossed half-way, and no two crossings meet at a sample
TriangleMesh extract(const Mask& mask, const Crossings* crossings, const MarchingCubesOptions& options) {
  const cell_layers::PaddedGrid grid(mask, {mask.dims(), {0, 0, 0}, mask.dims(), 0}, options.open_border);
  const std::size_t slices = grid.size(2);
  constexpr std::size_t grain = 8;

  std::vector<LayerCounts> counts(slices + 1);
  parallel_for_blocks(slices, grain, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    cell_layers::count_layers(grid, begin, end, counts.data() + begin);
  });
  std::vector<std::size_t> first_vertex(slices + 1, 0);
  std::vector<std::size_t> first_triangle(slices + 1, 0);
  for (std::size_t slice = 0; slice < slices; ++slice) {
    first_vertex[slice + 1] = first_vertex[slice] + counts[slice].vertices();
    first_triangle[slice + 1] = first_triangle[slice] + counts[slice].triangles;
  }
  if (first_vertex[slices] > max_index || first_triangle[slices] > max_index) {
    throw InputError(
        fmt::format("the surface has {} triangles, a mesh holds at most {}: select less or crop the volume",
                    first_triangle[slices], max_index));
  }
  tunica::advance(options.progress, 0.3);

  TriangleMesh mesh;
  resize_fresh(mesh.vertices, first_vertex[slices]);
  resize_fresh(mesh.triangles, first_triangle[slices]);
  std::vector<std::vector<PinchedVertex>> pinched((slices + grain - 1) / grain);
  parallel_for_blocks(slices, grain, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    const cell_layers::Output out{first_vertex[begin], mesh.vertices.data() + first_vertex[begin],
                                  mesh.triangles.data() + first_triangle[begin]};
    cell_layers::write_layers(grid, begin, end, counts.data() + begin, out, crossings, pinched[begin / grain]);
  });
  tunica::advance(options.progress, 0.9);
  if (crossings != nullptr) {
    std::vector<PinchedVertex> all;
    for (const auto& block : pinched) {
      all.insert(all.end(), block.begin(), block.end());
    }
    join_pinched_vertices(mesh, all);
  }
  tunica::advance(options.progress, 1.0);
  return mesh;
}

}  // namespace

TriangleMesh marching_cubes(const Mask& mask, const MarchingCubesOptions& options) {
  return extract(mask, nullptr, options);
}

TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const Mask& mask,
                            const MarchingCubesOptions& options) {
  TUNICA_ASSERT(volume.dims == mask.dims());
  if (rule.rule == Inside::Rule::label) {
    return marching_cubes(mask, options);
  }
  return std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        const Interpolated<T> crossings(volume, values, rule.value);
        return extract(mask, &crossings, options);
      },
      volume.data);
}

TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const MarchingCubesOptions& options) {
  return marching_cubes(volume, rule, select(volume, rule), options);
}

}  // namespace tunica
