// W. E. Lorensen, H. E. Cline: Marching cubes: a high resolution 3D surface construction algorithm. SIGGRAPH 1987.
// W. Schroeder, R. Maynard, B. Geveci: Flying edges: a high-performance scalable isocontouring algorithm. LDAV 2015.
#include "volume/marching_cubes.hpp"

#include "core/error.hpp"
#include "core/threads.hpp"
#include "volume/cube_cases.hpp"
#include "volume/pinched_vertices.hpp"

#include <fmt/format.h>
#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <type_traits>

namespace tunica {
namespace {

using Word = std::uint64_t;
constexpr std::size_t word_bits = 64;

/// A crossing nearer than this to a sample (a fraction of the voxel) counts as being at the sample.
constexpr double at_sample = 1e-6;
/// Where such crossings cannot be joined to one vertex they are kept this far from the sample, so that the triangles
/// between them have an area.
constexpr double beside_sample = 1e-3;

/// The mask with one layer of samples around it: outside, or with an open border what the border's samples are.
/// A padded row is a sequence of words with one more, for reading one bit ahead.
class PaddedGrid {
public:
  PaddedGrid(const Mask& mask, bool open) : mask_(mask), open_(open) {
    for (int axis = 0; axis < 3; ++axis) {
      size_[axis] = mask.dims()[axis] + 2;
    }
    words_ = (size_[0] + word_bits - 1) / word_bits;
  }

  [[nodiscard]] std::size_t size(int axis) const { return size_[axis]; }
  [[nodiscard]] std::size_t words() const { return words_; }

  /// Bits of word `w` that are samples of a row, and those that are edges along it (or cells).
  [[nodiscard]] Word samples(std::size_t w) const { return first_bits(size_[0], w); }
  [[nodiscard]] Word edges(std::size_t w) const { return first_bits(size_[0] - 1, w); }

  void load(std::size_t row, std::size_t slice, Word* out) const {
    const std::size_t j = unpadded(row, 1);
    const std::size_t k = unpadded(slice, 2);
    const bool beyond = row == 0 || slice == 0 || row == size_[1] - 1 || slice == size_[2] - 1;
    if (beyond && !open_) {
      std::fill_n(out, words_ + 1, Word{0});
      return;
    }
    const Word* const in = mask_.row(j, k);
    const std::size_t given = mask_.words_per_row();
    out[0] = in[0] << 1;
    for (std::size_t w = 1; w < given; ++w) {
      out[w] = in[w] << 1 | in[w - 1] >> (word_bits - 1);
    }
    out[given] = in[given - 1] >> (word_bits - 1);
    out[words_] = 0;
    if (open_) {
      out[0] |= in[0] & 1;
      const std::size_t last = size_[0] - 1;
      const Word end = out[(last - 1) / word_bits] >> ((last - 1) % word_bits) & 1;
      out[last / word_bits] |= end << (last % word_bits);
    }
  }

  /// Index of the volume's sample behind a padded one (the nearest, in the padding).
  [[nodiscard]] std::size_t unpadded(std::size_t padded, int axis) const {
    return std::clamp<std::size_t>(padded, 1, size_[axis] - 2) - 1;
  }
  [[nodiscard]] bool is_padding(std::size_t padded, int axis) const { return padded == 0 || padded == size_[axis] - 1; }
  /// Voxel coordinate of a padded sample. With an open border the padding lies on the outer voxel faces: half a voxel
  /// out, where the surface ends.
  [[nodiscard]] double coordinate(std::size_t padded, int axis) const {
    const double c = static_cast<double>(padded) - 1;
    return open_ ? std::clamp(c, -0.5, static_cast<double>(size_[axis]) - 2.5) : c;
  }

private:
  static Word first_bits(std::size_t count, std::size_t w) {
    const std::size_t before = w * word_bits;
    if (count >= before + word_bits) {
      return ~Word{0};
    }
    return count <= before ? 0 : (Word{1} << (count - before)) - 1;
  }

  const Mask& mask_;
  bool open_;
  std::array<std::size_t, 3> size_{};
  std::size_t words_ = 0;
};

Word shifted(const Word* row, std::size_t w) { return row[w] >> 1 | row[w + 1] << (word_bits - 1); }

/// The four padded rows around a row of cells, as (row + 1 or not, slice + 1 or not). Where the grid ends, the missing
/// row is a copy, so that no edge towards it is crossed.
class RowWindow {
public:
  RowWindow(const PaddedGrid& grid, std::size_t slice)
      : grid_(grid), slice_(slice), stride_(grid.words() + 1), rows_(6 * stride_), active_(stride_) {
    load_pair(0, 1);
  }

  void advance(std::size_t row) {
    std::swap(near_, far_);
    if (row + 1 < grid_.size(1)) {
      load_pair(row + 1, far_);
    } else {
      std::copy_n(pair(near_), 2 * stride_, pair(far_));
    }
    find_active();
  }

  /// Numbers of the words in which some cell is neither all inside nor all outside; crossed edges are in no others.
  [[nodiscard]] const std::vector<std::uint32_t>& active() const { return active_list_; }
  [[nodiscard]] Word active(std::size_t w) const { return active_[w]; }

  [[nodiscard]] const Word* a0() const { return pair(near_); }
  [[nodiscard]] const Word* a1() const { return pair(far_); }
  [[nodiscard]] const Word* b0() const { return pair(near_) + stride_; }
  [[nodiscard]] const Word* b1() const { return pair(far_) + stride_; }

private:
  [[nodiscard]] const Word* pair(std::size_t which) const { return rows_.data() + 2 * stride_ * which; }
  [[nodiscard]] Word* pair(std::size_t which) { return rows_.data() + 2 * stride_ * which; }

  void load_pair(std::size_t row, std::size_t which) {
    grid_.load(row, slice_, pair(which));
    if (slice_ + 1 < grid_.size(2)) {
      grid_.load(row, slice_ + 1, pair(which) + stride_);
    } else {
      std::copy_n(pair(which), stride_, pair(which) + stride_);
    }
  }

  void find_active() {
    Word* const any = rows_.data() + 4 * stride_;
    Word* const all = any + stride_;
    for (std::size_t w = 0; w < stride_; ++w) {
      any[w] = a0()[w] | a1()[w] | b0()[w] | b1()[w];
      all[w] = a0()[w] & a1()[w] & b0()[w] & b1()[w];
    }
    active_list_.clear();
    for (std::size_t w = 0; w + 1 < stride_; ++w) {
      active_[w] = (any[w] | shifted(any, w)) & ~(all[w] & shifted(all, w));
      if (active_[w] != 0) {
        active_list_.push_back(static_cast<std::uint32_t>(w));
      }
    }
  }

  const PaddedGrid& grid_;
  std::size_t slice_;
  std::size_t stride_;
  std::vector<Word> rows_;
  std::vector<Word> active_;
  std::vector<std::uint32_t> active_list_;
  std::size_t near_ = 0;
  std::size_t far_ = 1;
};

Word crossed_along(const PaddedGrid& grid, const Word* row, std::size_t w) {
  return (row[w] ^ shifted(row, w)) & grid.edges(w);
}

/// The eight corners of 64 cells, corner by corner.
struct CellWord {
  std::array<Word, 8> corners;

  CellWord(const RowWindow& rows, std::size_t w)
      : corners{rows.a0()[w], shifted(rows.a0(), w), rows.a1()[w], shifted(rows.a1(), w),
                rows.b0()[w], shifted(rows.b0(), w), rows.b1()[w], shifted(rows.b1(), w)} {}

  [[nodiscard]] unsigned case_of(int bit) const {
    unsigned result = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      result |= static_cast<unsigned>(corners[corner] >> bit & 1) << corner;
    }
    return result;
  }
};

/// What one slice of samples, and the layer of cells above it, contribute to the mesh; or the sums before it.
struct SliceCounts {
  std::size_t in_plane = 0;  ///< vertices on edges along x and y: first in the slice's block of vertices
  std::size_t upright = 0;   ///< vertices on edges along z, to the next slice
  std::size_t triangles = 0;
};

SliceCounts count_slice(const PaddedGrid& grid, std::size_t slice) {
  const std::array<CubeCase, 256>& cases = cube_cases();
  SliceCounts counts;
  RowWindow rows(grid, slice);
  for (std::size_t row = 0; row < grid.size(1); ++row) {
    rows.advance(row);
    const bool cells = row + 1 < grid.size(1) && slice + 1 < grid.size(2);
    for (const std::size_t w : rows.active()) {
      const Word a0 = rows.a0()[w];
      const Word samples = grid.samples(w);
      counts.in_plane += static_cast<std::size_t>(std::popcount(crossed_along(grid, rows.a0(), w)) +
                                                  std::popcount((a0 ^ rows.a1()[w]) & samples));
      counts.upright += static_cast<std::size_t>(std::popcount((a0 ^ rows.b0()[w]) & samples));
      if (!cells) {
        continue;
      }
      const CellWord word(rows, w);
      for (Word active = rows.active(w) & grid.edges(w); active != 0; active &= active - 1) {
        counts.triangles += cases[word.case_of(std::countr_zero(active))].count;
      }
    }
  }
  return counts;
}

/// Where an edge between two samples is crossed: a fraction of the way from the first to the second.
class Crossings {
public:
  virtual ~Crossings() = default;
  /// Vertices may come to lie at a sample.
  [[nodiscard]] virtual bool may_pinch() const = 0;
  [[nodiscard]] virtual double fraction(std::size_t first, std::size_t second) const = 0;
};

class HalfWay final : public Crossings {
public:
  [[nodiscard]] bool may_pinch() const override { return false; }
  [[nodiscard]] double fraction(std::size_t, std::size_t) const override { return 0.5; }
};

template <typename T>
class Interpolated final : public Crossings {
public:
  Interpolated(const Volume& volume, const std::vector<T>& values, double value)
      : values_(values), slope_(volume.slope), intercept_(volume.intercept), value_(value) {}

  [[nodiscard]] bool may_pinch() const override { return true; }
  [[nodiscard]] double fraction(std::size_t first, std::size_t second) const override {
    // Halved, because the difference of two finite numbers may not be finite.
    const double a = 0.5 * meaning(first);
    const double b = 0.5 * meaning(second);
    const double t = (0.5 * value_ - a) / (b - a);
    return std::isfinite(a) && std::isfinite(b) && t >= 0 && t <= 1 ? t : 0.5;
  }

private:
  [[nodiscard]] double meaning(std::size_t sample) const {
    return slope_ * static_cast<double>(values_[sample]) + intercept_;
  }

  const std::vector<T>& values_;
  double slope_;
  double intercept_;
  double value_;
};

/// Writes the vertices and triangles of one slice to their places in the mesh.
class SliceWriter {
public:
  SliceWriter(const PaddedGrid& grid, const Mask& mask, const Crossings& crossings, TriangleMesh& mesh)
      : grid_(grid),
        mask_(mask),
        crossings_(crossings),
        mesh_(mesh),
        mirrored_(mask.affine().leftCols<3>().determinant() < 0) {}

  /// @param start  sums of all slices before this one
  /// @param next   those before the next one
  void write(std::size_t slice, const SliceCounts& start, const SliceCounts& next,
             std::vector<PinchedVertex>& pinched) {
    const std::array<CubeCase, 256>& cases = cube_cases();
    RowWindow rows(grid_, slice);
    RowStart here{start.in_plane + start.upright, 0, 0};
    RowStart above{next.in_plane + next.upright, 0, 0};
    std::size_t upright = start.in_plane + start.upright + (next.in_plane - start.in_plane);
    std::size_t triangle = start.triangles;
    for (std::size_t row = 0; row < grid_.size(1); ++row) {
      rows.advance(row);
      count_row(rows, rows.a0(), rows.a1(), here);
      count_row(rows, rows.b0(), rows.b1(), above);
      const bool cells = row + 1 < grid_.size(1) && slice + 1 < grid_.size(2);
      // Running numbers of the next vertex on each of the cell's edges: along x in four rows, y in two slices, z in two
      // rows.
      std::array<std::size_t, 8> number{here.first,
                                        here.next(),
                                        above.first,
                                        above.next(),
                                        here.first + here.along_x,
                                        above.first + above.along_x,
                                        upright,
                                        0};
      std::size_t upright_in_row = 0;
      for (const std::size_t w : rows.active()) {
        upright_in_row += static_cast<std::size_t>(std::popcount((rows.a0()[w] ^ rows.b0()[w]) & grid_.samples(w)));
      }
      number[7] = upright + upright_in_row;
      for (const std::size_t w : rows.active()) {
        const CellWord word(rows, w);
        const Word samples = grid_.samples(w);
        const std::array<Word, 8> crossed{
            crossed_along(grid_, rows.a0(), w),      crossed_along(grid_, rows.a1(), w),
            crossed_along(grid_, rows.b0(), w),      crossed_along(grid_, rows.b1(), w),
            (rows.a0()[w] ^ rows.a1()[w]) & samples, (rows.b0()[w] ^ rows.b1()[w]) & samples,
            (rows.a0()[w] ^ rows.b0()[w]) & samples, (rows.a1()[w] ^ rows.b1()[w]) & samples};
        add_vertices(w, row, slice, 0, crossed[0], number[0], pinched);
        add_vertices(w, row, slice, 1, crossed[4], number[4], pinched);
        add_vertices(w, row, slice, 2, crossed[6], number[6], pinched);
        for (Word active = cells ? rows.active(w) & grid_.edges(w) : 0; active != 0; active &= active - 1) {
          const int bit = std::countr_zero(active);
          const Word before = (Word{1} << bit) - 1;
          std::array<std::size_t, 8> id;
          for (std::size_t e = 0; e < 8; ++e) {
            id[e] = number[e] + static_cast<std::size_t>(std::popcount(crossed[e] & before));
          }
          const auto following = [&](std::size_t e) { return id[e] + (crossed[e] >> bit & 1); };
          const std::array<std::size_t, 12> edge{id[0], id[1],        id[2], id[3],        id[4], following(4),
                                                 id[5], following(5), id[6], following(6), id[7], following(7)};
          const CubeCase& cube = cases[word.case_of(bit)];
          for (std::size_t t = 0; t < cube.count; ++t) {
            const auto& corner = cube.triangles[t];
            auto& out = mesh_.triangles[triangle++];
            out = {static_cast<Index>(edge[corner[0]]), static_cast<Index>(edge[corner[1]]),
                   static_cast<Index>(edge[corner[2]])};
            if (mirrored_) {
              std::swap(out[1], out[2]);
            }
          }
        }
        for (std::size_t e = 0; e < 8; ++e) {
          number[e] += static_cast<std::size_t>(std::popcount(crossed[e]));
        }
      }
      upright += upright_in_row;
      here.first = here.next();
      above.first = above.next();
    }
  }

private:
  /// Numbering of a row's vertices: those along x first, then those along y.
  struct RowStart {
    std::size_t first;
    std::size_t along_x;
    std::size_t along_y;
    [[nodiscard]] std::size_t next() const { return first + along_x + along_y; }
  };

  void count_row(const RowWindow& rows, const Word* row, const Word* next, RowStart& start) const {
    start.along_x = 0;
    start.along_y = 0;
    for (const std::size_t w : rows.active()) {
      start.along_x += static_cast<std::size_t>(std::popcount(crossed_along(grid_, row, w)));
      start.along_y += static_cast<std::size_t>(std::popcount((row[w] ^ next[w]) & grid_.samples(w)));
    }
  }

  void add_vertices(std::size_t w, std::size_t row, std::size_t slice, int axis, Word crossed, std::size_t number,
                    std::vector<PinchedVertex>& pinched) {
    for (; crossed != 0; crossed &= crossed - 1, ++number) {
      const std::size_t column = w * word_bits + static_cast<std::size_t>(std::countr_zero(crossed));
      const std::array<std::size_t, 3> first{column, row, slice};
      std::array<std::size_t, 3> second = first;
      ++second[axis];
      // Between a sample and the padding there is nothing to interpolate.
      const bool border = grid_.is_padding(first[axis], axis) || grid_.is_padding(second[axis], axis);
      const double t = border ? 0.5 : crossings_.fraction(sample(first), sample(second));
      if (t >= at_sample && t <= 1 - at_sample) {
        mesh_.vertices[number] = position(first, axis, t);
        continue;
      }
      const bool low = t < 0.5;
      mesh_.vertices[number] = position(first, axis, low ? at_sample : 1 - at_sample);
      // Numbered with the padding: with an open border a sample there has the same value as the border's.
      pinched.push_back({static_cast<Index>(number), padded_number(low ? first : second),
                         position(first, axis, low ? beside_sample : 1 - beside_sample)});
    }
  }

  [[nodiscard]] std::size_t sample(const std::array<std::size_t, 3>& padded) const {
    return grid_.unpadded(padded[0], 0) +
           mask_.dims()[0] * (grid_.unpadded(padded[1], 1) + mask_.dims()[1] * grid_.unpadded(padded[2], 2));
  }

  [[nodiscard]] std::size_t padded_number(const std::array<std::size_t, 3>& padded) const {
    return padded[0] + grid_.size(0) * (padded[1] + grid_.size(1) * padded[2]);
  }

  [[nodiscard]] Vec3 position(const std::array<std::size_t, 3>& first, int axis, double t) const {
    Vec3 voxel(grid_.coordinate(first[0], 0), grid_.coordinate(first[1], 1), grid_.coordinate(first[2], 2));
    voxel[axis] += t;
    return mask_.affine().leftCols<3>() * voxel + mask_.affine().col(3);
  }

  const PaddedGrid& grid_;
  const Mask& mask_;
  const Crossings& crossings_;
  TriangleMesh& mesh_;
  bool mirrored_;
};

TriangleMesh extract(const Mask& mask, const Crossings& crossings, const MarchingCubesOptions& options) {
  const PaddedGrid grid(mask, options.open_border);
  const std::size_t slices = grid.size(2);
  constexpr std::size_t grain = 4;

  // start[s]: sums over the slices before s.
  std::vector<SliceCounts> start(slices + 1);
  parallel_for_blocks(slices, grain, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t slice = begin; slice < end; ++slice) {
      start[slice + 1] = count_slice(grid, slice);
    }
  });
  for (std::size_t slice = 0; slice < slices; ++slice) {
    start[slice + 1].in_plane += start[slice].in_plane;
    start[slice + 1].upright += start[slice].upright;
    start[slice + 1].triangles += start[slice].triangles;
  }
  const std::size_t vertices = start[slices].in_plane + start[slices].upright;
  if (vertices > max_index || start[slices].triangles > max_index) {
    throw InputError(
        fmt::format("the surface has {} triangles, a mesh holds at most {}: select less or crop the volume",
                    start[slices].triangles, max_index));
  }
  tunica::advance(options.progress, 0.3);

  TriangleMesh mesh;
  mesh.vertices.resize(vertices);
  mesh.triangles.resize(start[slices].triangles);
  std::vector<std::vector<PinchedVertex>> pinched((slices + grain - 1) / grain);
  SliceWriter writer(grid, mask, crossings, mesh);
  parallel_for_blocks(slices, grain, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t slice = begin; slice < end; ++slice) {
      writer.write(slice, start[slice], start[slice + 1], pinched[begin / grain]);
    }
  });
  tunica::advance(options.progress, 0.9);
  if (crossings.may_pinch()) {
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
  return extract(mask, HalfWay{}, options);
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
        return extract(mask, Interpolated<T>(volume, values, rule.value), options);
      },
      volume.data);
}

TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const MarchingCubesOptions& options) {
  return marching_cubes(volume, rule, select(volume, rule), options);
}

}  // namespace tunica
