#include "tunica/volume/cubes/marching_cubes.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/fresh_memory.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/cubes/detail/cell_layers.hpp"
#include "tunica/volume/cubes/detail/pinched_vertices.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <span>
#include <type_traits>
#include <utility>

namespace tunica {
namespace {

using cell_layers::Crossings;
using cell_layers::LayerCounts;
using cell_layers::Layers;
using cell_layers::PaddedGrid;

constexpr std::size_t slices_per_block = 8;  // slices in a block

/// Has the layers of [0, size) done in blocks, body(layers, begin, end), by whatever thread is free.
template <typename Body>
void for_each_block(const PaddedGrid& grid, std::size_t size, const Body& body) {
  const std::size_t blocks = (size + slices_per_block - 1) / slices_per_block;
  std::atomic<std::size_t> next = 0;
  parallel_for_blocks(std::min(blocks, thread_count()), 1, [&](std::size_t, std::size_t) {
    Layers layers(grid);
    for (std::size_t block = next++; block < blocks; block = next++) {
      check_interrupt();
      body(layers, block * slices_per_block, std::min(size, (block + 1) * slices_per_block));
    }
  });
}

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

void require_lids(const BorderLids* lids, const std::array<std::size_t, 3>& dims) {
  for (std::size_t axis = 0; lids != nullptr && axis < 3; ++axis) {
    const std::size_t voxels = dims[0] * dims[1] * dims[2] / dims[axis];
    for (const std::vector<bool>& side : lids->closed[axis]) {
      if (!side.empty() && side.size() != voxels) {
        throw InputError(fmt::format("lids of {} voxels are not of a side of {}", side.size(), voxels));
      }
    }
  }
}

void require_range(const std::array<std::size_t, 2>& range, std::size_t count) {
  if (range[0] > range[1] || range[1] > count) {
    throw InputError(fmt::format("bounds from {} to {} are not within {} rows or slices", range[0], range[1], count));
  }
}

}  // namespace

/// The mesh of a selection, counted and laid out at the start, and then written in any parts.
class SlabMarchingCubes::Writer {
public:
  Writer(const Mask& mask, const MarchingCubesOptions& options) : mask_(mask), options_(options) {
    window_.size = mask.dims();
    require_lids(options.lids, mask.dims());
    if (const auto& bounds = options.bounds) {
      require_range(bounds->rows, mask.dims()[1]);
      require_range(bounds->slices, mask.dims()[2]);
      window_.first = {0, bounds->rows[0], bounds->slices[0]};
      window_.size = {mask.dims()[0], bounds->rows[1] - bounds->rows[0], bounds->slices[1] - bounds->slices[0]};
    }
    const PaddedGrid grid(mask, window_, options.open_border, options.lids);
    const std::size_t slices = grid.size(2);
    counts_.resize(slices + 1);
    for_each_block(grid, slices, [&](Layers& layers, std::size_t begin, std::size_t end) {
      layers.count(begin, end, counts_.data() + begin);
    });
    cell_layers::count_triangles(std::span(counts_).first(slices));
    first_vertex_.resize(slices + 1, 0);
    first_triangle_.resize(slices + 1, 0);
    for (std::size_t slice = 0; slice < slices; ++slice) {
      first_vertex_[slice + 1] = first_vertex_[slice] + counts_[slice].vertices();
      first_triangle_[slice + 1] = first_triangle_[slice] + counts_[slice].triangles;
    }
    if (first_vertex_[slices] > max_index || first_triangle_[slices] > max_index) {
      throw InputError(
          fmt::format("the surface has {} triangles, a mesh holds at most {}: select less or crop the volume",
                      first_triangle_[slices], max_index));
    }
    tunica::advance(options.progress, 0.3);
    reserve_fresh(mesh_.vertices, first_vertex_[slices]);
    mesh_.vertices.resize(first_vertex_[slices]);  // their constructor writes nothing
    reserve_fresh(mesh_.triangles, first_triangle_[slices]);
  }

  [[nodiscard]] std::size_t slices() const { return counts_.size() - 1; }

  /// Writes what belongs to the padded slices [begin, end).
  /// @param crossings  null: every edge is crossed half-way, and no two crossings meet at a sample
  /// @param first_slice  of the values that `crossings` looks up
  void write(std::size_t begin, std::size_t end, const Crossings* crossings, std::size_t first_slice) {
    cell_layers::Window window = window_;
    window.first_slice = first_slice;
    const PaddedGrid grid(mask_, window, options_.open_border, options_.lids);
    std::array<Index, 3>* const triangles = mesh_.triangles.data();
    std::vector<std::vector<PinchedVertex>> pinched((end - begin + slices_per_block - 1) / slices_per_block);
    for_each_block(grid, end - begin, [&](Layers& layers, std::size_t from, std::size_t to) {
      const std::size_t slice = begin + from;
      grow_triangles(first_triangle_[begin + to]);
      const cell_layers::Output out{first_vertex_[slice], mesh_.vertices.data() + first_vertex_[slice],
                                    triangles + first_triangle_[slice]};
      layers.write(slice, begin + to, counts_.data() + slice, out, crossings, pinched[from / slices_per_block]);
    });
    for (const auto& block : pinched) {
      pinched_.insert(pinched_.end(), block.begin(), block.end());
    }
    tunica::advance(options_.progress, 0.3 + 0.6 * real(end) / real(slices()));
  }

  TriangleMesh finish() {
    join_pinched_vertices(mesh_, pinched_);
    tunica::advance(options_.progress, 1.0);
    return std::move(mesh_);
  }

private:
  /// A vector writes zeros to what it grows by: block by block, so that they are overwritten before they leave the
  /// cache, and no thread waits for all of them. There is room for all, so that nothing moves.
  void grow_triangles(std::size_t size) {
    const std::lock_guard lock(growing_);
    if (mesh_.triangles.size() < size) {
      mesh_.triangles.resize(size);
    }
  }

  const Mask& mask_;
  MarchingCubesOptions options_;
  cell_layers::Window window_;
  std::vector<LayerCounts> counts_;
  std::vector<std::size_t> first_vertex_;  // sums over the slices before each
  std::vector<std::size_t> first_triangle_;
  TriangleMesh mesh_;
  std::mutex growing_;  // of its triangles
  std::vector<PinchedVertex> pinched_;
};

SlabMarchingCubes::SlabMarchingCubes(const Mask& mask, const Inside& rule, const MarchingCubesOptions& options)
    : writer_(std::make_unique<Writer>(mask, options)), mask_(mask), value_(rule.value) {
  if (rule.rule == Inside::Rule::label || options.bounds) {
    throw InputError(
        "a surface by label needs no values, and one by values has no bounds: marching_cubes() of the mask");
  }
  if (std::isnan(rule.value)) {
    throw InputError("not-a-number is no isovalue");
  }
}

SlabMarchingCubes::~SlabMarchingCubes() = default;

void SlabMarchingCubes::add(const Volume& slab, std::size_t first_slice) {
  const auto& dims = mask_.dims();
  require_slab(slab, first_slice, dims);
  if (first_slice != next_slice_ || slab.data.index() != (first_slice > 0 ? carry_ : slab.data).index()) {
    throw InputError(
        fmt::format("slices from {} on, or of another type, come where slice {} is next", first_slice, next_slice_));
  }
  const std::size_t slice_voxels = dims[0] * dims[1];
  // The last slice of the slab before, for the edges from it to this slab's first one.
  const std::size_t carried = first_slice > 0 ? 1 : 0;
  next_slice_ += slab.dims[2];
  const bool last = next_slice_ == dims[2];
  std::visit(
      [&](const auto& values) {
        using Values = std::decay_t<decltype(values)>;
        Values window;
        if (carried > 0) {
          window = std::move(std::get<Values>(carry_));
          window.insert(window.end(), values.begin(), values.end());
        }
        const Values& at_hand = carried > 0 ? window : values;
        const Interpolated<typename Values::value_type> crossings(slab, at_hand, value_);
        // Padded slices are one more; the edges along z of the last one at hand wait for the next slab.
        writer_->write(first_slice == 0 ? 0 : first_slice, last ? writer_->slices() : next_slice_, &crossings,
                       first_slice - carried);
        if (!last) {
          carry_ = Values(values.end() - slice_voxels, values.end());
        }
      },
      slab.data);
}

TriangleMesh SlabMarchingCubes::finish() {
  if (next_slice_ != mask_.dims()[2]) {
    throw InputError(fmt::format("only {} of {} slices came", next_slice_, mask_.dims()[2]));
  }
  return writer_->finish();
}

TriangleMesh marching_cubes(const Mask& mask, const MarchingCubesOptions& options) {
  SlabMarchingCubes::Writer writer(mask, options);
  writer.write(0, writer.slices(), nullptr, 0);
  return writer.finish();
}

TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const Mask& mask,
                            const MarchingCubesOptions& options) {
  require_volume(volume);
  if (volume.dims != mask.dims()) {
    throw InputError("volume and mask have different dimensions");
  }
  if (rule.rule == Inside::Rule::label) {
    return marching_cubes(mask, options);
  }
  SlabMarchingCubes slabs(mask, rule, options);
  slabs.add(volume, 0);
  return slabs.finish();
}

TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const MarchingCubesOptions& options) {
  return marching_cubes(volume, rule, select(volume, rule), options);
}

}  // namespace tunica
