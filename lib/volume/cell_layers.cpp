// W. E. Lorensen, H. E. Cline: Marching cubes: a high resolution 3D surface construction algorithm. SIGGRAPH 1987.
// W. Schroeder, R. Maynard, B. Geveci: Flying edges: a high-performance scalable isocontouring algorithm. LDAV 2015.
#include "volume/cell_layers.hpp"

#include "core/error.hpp"
#include "volume/cube_cases.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace tunica::cell_layers {
namespace {

/// A crossing nearer than this to a sample (a fraction of the voxel) counts as being at the sample.
constexpr double at_sample = 1e-6;
/// Where such crossings cannot be joined to one vertex they are kept this far from the sample, so that the triangles
/// between them have an area.
constexpr double beside_sample = 1e-3;

std::size_t ones(Word word) { return static_cast<std::size_t>(std::popcount(word)); }
Index bits_of(Word word) { return static_cast<Index>(std::popcount(word)); }
Word shifted(const Word* row, std::size_t w) { return row[w] >> 1 | row[w + 1] << (word_bits - 1); }

/// A cell's edges as places in sixteen numbers: the first eight are those of the next vertices on edges 0 to 3 along x,
/// 4 and 6 along y, 8 and 10 along z when the walk along the row comes to the cell, the others those after it.
constexpr std::array<std::uint8_t, 12> place_of_edge{0, 1, 2, 3, 4, 12, 5, 13, 6, 14, 7, 15};
constexpr std::array<std::uint8_t, 8> edge_of_place{0, 1, 2, 3, 4, 6, 8, 10};

/// A case as the writer wants it.
struct alignas(32) PackedCase {
  std::array<std::uint8_t, 16> corners{};  ///< places of the triangles' corners, one after the other
  std::array<std::uint8_t, 8> crossed{};   ///< 1 for each edge of edge_of_place that is crossed
  std::uint32_t count = 0;                 ///< triangles
};

std::array<PackedCase, 256> pack_cases(bool mirrored) {
  std::array<PackedCase, 256> packed;
  for (std::size_t which = 0; which < packed.size(); ++which) {
    const CubeCase& cube = cube_cases()[which];
    packed[which].count = static_cast<std::uint32_t>(cube.count);
    for (std::size_t t = 0; t < cube.count; ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        packed[which].corners[3 * t + corner] = place_of_edge[cube.triangles[t][mirrored ? (3 - corner) % 3 : corner]];
      }
    }
    for (std::size_t place = 0; place < edge_of_place.size(); ++place) {
      const auto [first, second] = cube_edges[edge_of_place[place]];
      packed[which].crossed[place] = static_cast<std::uint8_t>((which >> first ^ which >> second) & 1);
    }
  }
  return packed;
}

const std::array<PackedCase, 256>& packed_cases(bool mirrored) {
  static const std::array<std::array<PackedCase, 256>, 2> packed{pack_cases(false), pack_cases(true)};
  return packed[mirrored ? 1 : 0];
}

/// Numbers of the next vertices on the eight edges of edge_of_place, as a walk along a row of cells comes by.
class RunningNumbers {
public:
#ifdef __AVX2__
  explicit RunningNumbers(const std::array<Index, 8>& start)
      : before_(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(start.data()))) {}

  /// Writes the triangles of a cell and steps over it. Whatever their number, sixteen corners are written.
  Index* write(const PackedCase& cube, Index* corner) {
    const auto bytes = [](const std::uint8_t* from) {
      return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from)));
    };
    const __m256i after = _mm256_add_epi32(before_, bytes(cube.crossed.data()));
    for (int half = 0; half < 2; ++half) {
      const __m256i place = bytes(cube.corners.data() + 8 * half);
      const __m256 from_before = _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(before_, place));
      const __m256 from_after = _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(after, place));
      // Bit 3 of the place says which, as the sign.
      const __m256 which = _mm256_castsi256_ps(_mm256_slli_epi32(place, 28));
      _mm256_storeu_ps(reinterpret_cast<float*>(corner + 8 * half), _mm256_blendv_ps(from_before, from_after, which));
    }
    before_ = after;
    return corner + 3 * cube.count;
  }

private:
  __m256i before_;
#else
  explicit RunningNumbers(const std::array<Index, 8>& start) { std::ranges::copy(start, numbers_.begin()); }

  Index* write(const PackedCase& cube, Index* corner) {
    for (std::size_t i = 0; i < 8; ++i) {
      numbers_[8 + i] = numbers_[i] + cube.crossed[i];
    }
    for (std::size_t i = 0; i < 16; ++i) {
      corner[i] = numbers_[cube.corners[i]];
    }
    std::copy_n(numbers_.begin() + 8, 8, numbers_.begin());
    return corner + 3 * cube.count;
  }

private:
  std::array<Index, 16> numbers_{};
#endif
};

/// A slice of padded rows, with a copy of the last one after it, so that no edge towards it is crossed.
class Plane {
public:
  explicit Plane(const PaddedGrid& grid)
      : rows_(grid.size(1)), stride_(grid.words() + 1), words_((rows_ + 1) * stride_), inside_(rows_ + 1) {}

  void load(const PaddedGrid& grid, std::size_t slice) {
    for (std::size_t r = 0; r < rows_; ++r) {
      inside_[r] = grid.load(r, slice, words_.data() + r * stride_) ? 1 : 0;
    }
    std::copy_n(row(rows_ - 1), stride_, words_.data() + rows_ * stride_);
    inside_[rows_] = inside_[rows_ - 1];
  }
  [[nodiscard]] const Word* row(std::size_t r) const { return words_.data() + r * stride_; }
  /// Whether anything in rows r and r + 1 is inside.
  [[nodiscard]] bool any_inside(std::size_t r) const { return (inside_[r] | inside_[r + 1]) != 0; }

private:
  std::size_t rows_;
  std::size_t stride_;
  std::vector<Word> words_;
  std::vector<std::uint8_t> inside_;
};

/// The bits around 64 cells, and which of the edges there are crossed.
struct CellWord {
  Word a0, a0s, a1, a1s, b0, b0s, b1, b1s;  // corners in the order of their numbers
  Word x0, x1, x2, x3;                      // edges 0 to 3
  Word y0, y1;                              // edges 4 and 6
  Word z0, z1;                              // edges 8 and 10

  CellWord(const PaddedGrid& grid, const Plane& a, const Plane& b, std::size_t row, std::size_t w)
      : a0(a.row(row)[w]),
        a0s(shifted(a.row(row), w)),
        a1(a.row(row + 1)[w]),
        a1s(shifted(a.row(row + 1), w)),
        b0(b.row(row)[w]),
        b0s(shifted(b.row(row), w)),
        b1(b.row(row + 1)[w]),
        b1s(shifted(b.row(row + 1), w)),
        x0((a0 ^ a0s) & grid.edges(w)),
        x1((a1 ^ a1s) & grid.edges(w)),
        x2((b0 ^ b0s) & grid.edges(w)),
        x3((b1 ^ b1s) & grid.edges(w)),
        y0((a0 ^ a1) & grid.samples(w)),
        y1((b0 ^ b1) & grid.samples(w)),
        z0((a0 ^ b0) & grid.samples(w)),
        z1((a1 ^ b1) & grid.samples(w)) {}

  [[nodiscard]] std::size_t case_of(int bit) const {
    if (bit == word_bits - 1) {
      return pairs(bit, 1) | (a0s >> bit & 1) << 1 | (a1s >> bit & 1) << 3 | (b0s >> bit & 1) << 5 |
             (b1s >> bit & 1) << 7;
    }
    return pairs(bit, 3);
  }

private:
  [[nodiscard]] std::size_t pairs(int bit, Word mask) const {
    return (a0 >> bit & mask) | (a1 >> bit & mask) << 2 | (b0 >> bit & mask) << 4 | (b1 >> bit & mask) << 6;
  }
};

/// The words of a layer in which some cell is neither all inside nor all outside; crossed edges of its rows are in no
/// others. Where the grid ends, b is a itself.
class ActiveWords {
public:
  explicit ActiveWords(std::size_t words) : active_(words) {}

  /// Calls visit(w, bits of the active cells) for each such word of a row.
  template <typename Visit>
  void visit_row(const Plane& a, const Plane& b, std::size_t row, const Visit& visit) {
    if (!a.any_inside(row) && !b.any_inside(row)) {
      return;
    }
    const Word* const a0 = a.row(row);
    const Word* const a1 = a.row(row + 1);
    const Word* const b0 = b.row(row);
    const Word* const b1 = b.row(row + 1);
    Word* const active = active_.data();
    const std::size_t words = active_.size();
    for (std::size_t w = 0; w < words; ++w) {
      const Word any = a0[w] | a1[w] | b0[w] | b1[w];
      const Word all = a0[w] & a1[w] & b0[w] & b1[w];
      const Word any_next = a0[w + 1] | a1[w + 1] | b0[w + 1] | b1[w + 1];
      const Word all_next = a0[w + 1] & a1[w + 1] & b0[w + 1] & b1[w + 1];
      active[w] = (any | any >> 1 | any_next << (word_bits - 1)) & ~(all & (all >> 1 | all_next << (word_bits - 1)));
    }
    for (std::size_t w = 0; w < words; ++w) {
      if (active[w] != 0) {
        visit(w, active[w]);
      }
    }
  }

private:
  std::vector<Word> active_;
};

/// Triangles of the cells: a loop around n crossed edges makes n - 2.
std::size_t count_triangles(const CellWord& c, Word cells) {
  const Word y0s = c.a0s ^ c.a1s;
  const Word y1s = c.b0s ^ c.b1s;
  const Word z0s = c.a0s ^ c.b0s;
  const Word z1s = c.a1s ^ c.b1s;
  const std::size_t crossed = ones(c.x0 & cells) + ones(c.x1 & cells) + ones(c.x2 & cells) + ones(c.x3 & cells) +
                              ones(c.y0 & cells) + ones(y0s & cells) + ones(c.y1 & cells) + ones(y1s & cells) +
                              ones(c.z0 & cells) + ones(z0s & cells) + ones(c.z1 & cells) + ones(z1s & cells);
  std::size_t triangles = crossed - 2 * ones(cells);
  // More than one loop: only with two inside corners across the diagonal of a face, or with two opposite corners that
  // differ from all their neighbours.
  const Word face = (c.x0 & c.x1 & c.y0) | (c.x2 & c.x3 & c.y1) | (c.x0 & c.x2 & c.z0) | (c.x1 & c.x3 & c.z1) |
                    (c.y0 & c.y1 & c.z0) | (y0s & y1s & z0s);
  const Word opposite = (c.x0 & c.y0 & c.z0 & c.x3 & y1s & z1s) | (c.x0 & y0s & z0s & c.x3 & c.y1 & c.z1) |
                        (c.x1 & c.y0 & c.z1 & c.x2 & y1s & z0s) | (c.x1 & y0s & z1s & c.x2 & c.y1 & c.z0);
  for (Word several = (face | opposite) & cells; several != 0; several &= several - 1) {
    const int bit = std::countr_zero(several);
    const auto crossed_here = [bit](auto... words) { return (static_cast<std::size_t>(words >> bit & 1) + ...); };
    triangles += packed_cases(false)[c.case_of(bit)].count + 2;
    triangles -= crossed_here(c.x0, c.x1, c.x2, c.x3, c.y0, y0s, c.y1, y1s, c.z0, z0s, c.z1, z1s);
  }
  return triangles;
}

LayerCounts count_layer(const PaddedGrid& grid, const Plane& a, const Plane& b, bool last) {
  ActiveWords active(grid.words());
  LayerCounts sum;
  for (std::size_t row = 0; row < grid.size(1); ++row) {
    const bool cells = !last && row + 1 < grid.size(1);
    active.visit_row(a, b, row, [&](std::size_t w, Word bits) {
      const CellWord c(grid, a, b, row, w);
      sum.along_x += ones(c.x0);
      sum.along_y += ones(c.y0);
      sum.upright += ones(c.z0);
      if (cells) {
        sum.triangles += count_triangles(c, bits & grid.edges(w));
      }
    });
  }
  return sum;
}

/// Appends the set bits of a word. Four at a time without a branch: most words have fewer.
/// @return one past the last one; up to four places beyond it are overwritten
CrossedEdge* append(CrossedEdge* out, std::size_t row, std::size_t w, Word bits) {
  const std::size_t count = ones(bits);
  const auto r = static_cast<std::uint32_t>(row);
  const auto column = static_cast<std::uint32_t>(w * word_bits);
  CrossedEdge* const end = out + count;
  do {
    for (int i = 0; i < 4; ++i) {
      out[i] = {r, column + static_cast<std::uint32_t>(std::countr_zero(bits))};
      bits &= bits - 1;
    }
    out += 4;
  } while (bits != 0);
  return end;
}

/// Positions of the samples, as sums of a term of the column and one of row and slice; in four numbers, the last one
/// without meaning, which is what the processor adds at once.
class Places {
public:
  using Place = Eigen::Vector4d;

  explicit Places(const PaddedGrid& grid) : grid_(grid), column_(grid.size(0)), row_(grid.size(1)) {
    for (std::size_t i = 0; i < column_.size(); ++i) {
      column_[i] = padded(grid.affine().col(0) * grid.coordinate(i, 0));
    }
  }
  void move_to(std::size_t slice) {
    const Vec3 origin = grid_.affine().col(3) + grid_.affine().col(2) * grid_.coordinate(slice, 2);
    for (std::size_t j = 0; j < row_.size(); ++j) {
      row_[j] = padded(origin + grid_.affine().col(1) * grid_.coordinate(j, 1));
    }
  }
  [[nodiscard]] Place operator()(const CrossedEdge& edge) const { return column_[edge.column] + row_[edge.row]; }

  static Place padded(const Vec3& p) { return {p[0], p[1], p[2], 0}; }

private:
  const PaddedGrid& grid_;
  std::vector<Place> column_;
  std::vector<Place> row_;
};

class LayerWriter {
public:
  LayerWriter(const PaddedGrid& grid, const Output& out, const Crossings* crossings,
              std::vector<PinchedVertex>& pinched)
      : grid_(grid),
        cases_(packed_cases(grid.affine().leftCols<3>().determinant() < 0)),
        crossings_(crossings),
        pinched_(pinched),
        vertices_(out.vertices),
        triangles_(out.triangles),
        first_(static_cast<Index>(out.first_vertex)),
        places_(grid),
        a_(grid),
        b_(grid),
        rows_a_(grid.size(1) + 1),
        rows_b_(grid.size(1) + 1) {}

  void write(std::size_t begin, std::size_t end, const LayerCounts* counts) {
    a_.load(grid_, begin);
    number_rows(counts[0]);
    for (std::size_t slice = begin; slice < end; ++slice, ++counts) {
      write_layer(slice, counts);
      std::swap(a_, b_);
      std::swap(rows_a_, rows_b_);
      vertices_ += counts->vertices();
      triangles_ += counts->triangles;
      first_ += static_cast<Index>(counts->vertices());
    }
  }

private:
  /// Numbers of the first vertices on edges along x and y of a row, and upright from it.
  struct RowStart {
    Index x;
    Index y;
    Index z;
  };

  /// Of the first slice; those of the others are found when they are next to the slice before them.
  void number_rows(const LayerCounts& counts) {
    ActiveWords active(grid_.words());
    RowStart next{first_, first_ + static_cast<Index>(counts.along_x), 0};
    for (std::size_t row = 0; row < grid_.size(1); ++row) {
      rows_a_[row].x = next.x;
      rows_a_[row].y = next.y;
      active.visit_row(a_, a_, row, [&](std::size_t w, Word) {
        const Word word = a_.row(row)[w];
        next.x += bits_of((word ^ shifted(a_.row(row), w)) & grid_.edges(w));
        next.y += bits_of((word ^ a_.row(row + 1)[w]) & grid_.samples(w));
      });
    }
    rows_a_.back() = next;
  }

  void write_layer(std::size_t slice, const LayerCounts* counts) {
    const bool last = slice + 1 == grid_.size(2);
    if (!last) {
      b_.load(grid_, slice + 1);
    }
    const Plane& b = last ? a_ : b_;
    find_words(b, first_ + static_cast<Index>(counts->vertices()), last ? LayerCounts{} : counts[1], *counts);
    edges_.resize(counts->vertices() + 3 * spare_edges);
    CrossedEdge* const x = edges_.data();
    CrossedEdge* const y = x + counts->along_x + spare_edges;
    CrossedEdge* const z = y + counts->along_y + spare_edges;
    corners_.resize(3 * counts->triangles + spare_corners);
    CrossedEdge* x_end = x;
    CrossedEdge* y_end = y;
    CrossedEdge* z_end = z;
    Index* corner = corners_.data();
    for (std::size_t row = 0, next = 0; row < grid_.size(1); ++row) {
      const bool cells = !last && row + 1 < grid_.size(1);
      const std::size_t end = word_rows_[row];
      if (next == end) {
        continue;
      }
      RunningNumbers numbers({rows_a_[row].x, rows_a_[row + 1].x, rows_b_[row].x, rows_b_[row + 1].x, rows_a_[row].y,
                              rows_b_[row].y, rows_a_[row].z, rows_a_[row + 1].z});
      for (; next < end; ++next) {
        const std::size_t w = words_[next].word;
        const CellWord c(grid_, a_, b, row, w);
        x_end = append(x_end, row, w, c.x0);
        y_end = append(y_end, row, w, c.y0);
        z_end = append(z_end, row, w, c.z0);
        for (Word active = cells ? words_[next].cells & grid_.edges(w) : 0; active != 0; active &= active - 1) {
          corner = numbers.write(cases_[c.case_of(std::countr_zero(active))], corner);
        }
      }
    }
    TUNICA_ASSERT(x_end - x == static_cast<std::ptrdiff_t>(counts->along_x) &&
                  y_end - y == static_cast<std::ptrdiff_t>(counts->along_y) &&
                  z_end - z == static_cast<std::ptrdiff_t>(counts->upright) &&
                  corner - corners_.data() == static_cast<std::ptrdiff_t>(3 * counts->triangles));
    std::memcpy(static_cast<void*>(triangles_), corners_.data(), 3 * counts->triangles * sizeof(Index));
    places_.move_to(slice);
    write_vertices(x, counts->along_x, slice, 0, 0);
    write_vertices(y, counts->along_y, slice, 1, counts->along_x);
    write_vertices(z, counts->upright, slice, 2, counts->along_x + counts->along_y);
  }

  /// Lists the active words of the layer, and numbers the rows of the next slice and the upright edges.
  void find_words(const Plane& b, Index first_of_b, const LayerCounts& counts_b, const LayerCounts& counts) {
    words_.clear();
    word_rows_.resize(grid_.size(1));
    ActiveWords active(grid_.words());
    RowStart next_b{first_of_b, first_of_b + static_cast<Index>(counts_b.along_x), 0};
    Index upright = first_ + static_cast<Index>(counts.along_x + counts.along_y);
    for (std::size_t row = 0; row < grid_.size(1); ++row) {
      rows_b_[row].x = next_b.x;
      rows_b_[row].y = next_b.y;
      rows_a_[row].z = upright;
      active.visit_row(a_, b, row, [&](std::size_t w, Word cells) {
        words_.push_back({static_cast<std::uint32_t>(w), cells});
        const Word word = b.row(row)[w];
        next_b.x += bits_of((word ^ shifted(b.row(row), w)) & grid_.edges(w));
        next_b.y += bits_of((word ^ b.row(row + 1)[w]) & grid_.samples(w));
        upright += bits_of((a_.row(row)[w] ^ word) & grid_.samples(w));
      });
      word_rows_[row] = words_.size();
    }
    rows_b_.back() = next_b;
    rows_a_.back().z = upright;
  }

  void write_vertices(const CrossedEdge* edges, std::size_t count, std::size_t slice, int axis, std::size_t offset) {
    const Vec3 along = grid_.affine().col(axis);
    Vec3* const out = vertices_ + offset;
    if (crossings_ == nullptr) {
      const Places::Place half = Places::padded(0.5 * along);
      for (std::size_t i = 0; i < count; ++i) {
        const Places::Place place = places_(edges[i]) + half;
        out[i] = place.head<3>();
      }
      return;
    }
    constexpr std::size_t batch = 256;
    std::array<std::size_t, batch> from;
    std::array<std::size_t, batch> to;
    std::array<double, batch> fractions;
    for (std::size_t begin = 0; begin < count; begin += batch) {
      const std::size_t size = std::min(batch, count - begin);
      for (std::size_t i = 0; i < size; ++i) {
        std::array<std::size_t, 3> sample{edges[begin + i].column, edges[begin + i].row, slice};
        from[i] = grid_.at_hand(sample);
        ++sample[axis];
        to[i] = grid_.at_hand(sample);
      }
      crossings_->place(from.data(), to.data(), size, fractions.data());
      for (std::size_t i = 0; i < size; ++i) {
        const CrossedEdge& edge = edges[begin + i];
        const std::array<std::size_t, 3> first{edge.column, edge.row, slice};
        place_vertex(first, axis, fractions[i], places_(edge).head<3>(), along, out[begin + i],
                     first_ + offset + begin + i);
      }
    }
  }

  void place_vertex(const std::array<std::size_t, 3>& first, int axis, double t, const Vec3& start, const Vec3& along,
                    Vec3& vertex, std::size_t number) {
    std::array<std::size_t, 3> second = first;
    ++second[axis];
    // Between a sample and the padding there is nothing to interpolate.
    if (grid_.is_padding(first[axis], axis) || grid_.is_padding(second[axis], axis)) {
      t = 0.5;
    }
    if (t >= at_sample && t <= 1 - at_sample) {
      vertex = start + t * along;
      return;
    }
    const bool low = t < 0.5;
    vertex = start + (low ? at_sample : 1 - at_sample) * along;
    // Numbered with the padding: with an open border a sample there has the same value as the border's.
    pinched_.push_back({static_cast<Index>(number), grid_.number(low ? first : second),
                        start + (low ? beside_sample : 1 - beside_sample) * along});
  }

  struct ActiveWord {
    std::uint32_t word;
    Word cells;
  };

  static constexpr std::size_t spare_edges = 4;     // that append() may overwrite
  static constexpr std::size_t spare_corners = 16;  // that RunningNumbers::write() may

  const PaddedGrid& grid_;
  const std::array<PackedCase, 256>& cases_;
  const Crossings* crossings_;
  std::vector<PinchedVertex>& pinched_;
  Vec3* vertices_;                   // of the slice
  std::array<Index, 3>* triangles_;  // of the layer above it
  Index first_;                      // number of the slice's first vertex
  Places places_;
  Plane a_;
  Plane b_;
  std::vector<RowStart> rows_a_;
  std::vector<RowStart> rows_b_;
  std::vector<ActiveWord> words_;
  std::vector<std::size_t> word_rows_;  // one past each row's last in words_
  std::vector<CrossedEdge> edges_;
  std::vector<Index> corners_;
};

}  // namespace

PaddedGrid::PaddedGrid(const Mask& mask, const Window& window, bool open) : mask_(mask), window_(window) {
  TUNICA_ASSERT(window.first[0] == 0 && window.size[0] == mask.dims()[0]);
  for (int axis = 0; axis < 3; ++axis) {
    size_[axis] = window.size[axis] + 2;
    open_[axis] = {open && window.first[axis] == 0,
                   open && window.first[axis] + window.size[axis] == mask.dims()[axis]};
  }
  const auto first_bits = [](std::size_t count, std::size_t w) {
    const std::size_t before = w * word_bits;
    return count >= before + word_bits ? ~Word{0} : count <= before ? Word{0} : (Word{1} << (count - before)) - 1;
  };
  const std::size_t words = (size_[0] + word_bits - 1) / word_bits;
  for (std::size_t w = 0; w < words; ++w) {
    samples_.push_back(first_bits(size_[0], w));
    edges_.push_back(first_bits(size_[0] - 1, w));
  }
}

bool PaddedGrid::load(std::size_t row, std::size_t slice, Word* out) const {
  const auto beyond = [&](std::size_t at, int axis) {
    return (at == 0 && !open_[axis][0]) || (at == size_[axis] - 1 && !open_[axis][1]);
  };
  const std::size_t words = samples_.size();
  if (beyond(row, 1) || beyond(slice, 2)) {
    std::fill_n(out, words + 1, Word{0});
    return false;
  }
  const Word* const in = mask_.row(in_image(row, 1), in_image(slice, 2));
  const std::size_t given = mask_.words_per_row();
  Word any = in[0];
  out[0] = in[0] << 1;
  for (std::size_t w = 1; w < given; ++w) {
    out[w] = in[w] << 1 | in[w - 1] >> (word_bits - 1);
    any |= in[w];
  }
  out[given] = in[given - 1] >> (word_bits - 1);
  out[words] = 0;
  if (open_[0][0]) {
    out[0] |= in[0] & 1;
  }
  if (open_[0][1]) {
    const std::size_t last = size_[0] - 1;
    const Word end = out[(last - 1) / word_bits] >> ((last - 1) % word_bits) & 1;
    out[last / word_bits] |= end << (last % word_bits);
  }
  return any != 0;
}

std::size_t PaddedGrid::at_hand(const std::array<std::size_t, 3>& padded) const {
  const auto& dims = mask_.dims();
  return in_image(padded[0], 0) +
         dims[0] * (in_image(padded[1], 1) + dims[1] * (in_image(padded[2], 2) - window_.first_slice));
}

std::size_t PaddedGrid::number(const std::array<std::size_t, 3>& padded) const {
  const auto& dims = mask_.dims();
  const auto in_padded_image = [&](int axis) { return padded[axis] + window_.first[axis]; };
  return in_padded_image(0) + (dims[0] + 2) * (in_padded_image(1) + (dims[1] + 2) * in_padded_image(2));
}

double PaddedGrid::coordinate(std::size_t padded, int axis) const {
  if (padded == 0 && open_[axis][0]) {
    return -0.5;
  }
  if (padded == size_[axis] - 1 && open_[axis][1]) {
    return static_cast<double>(mask_.dims()[axis]) - 0.5;
  }
  return static_cast<double>(window_.first[axis]) - 1 + static_cast<double>(padded);
}

void count_layers(const PaddedGrid& grid, std::size_t begin, std::size_t end, LayerCounts* counts) {
  Plane a(grid);
  Plane b(grid);
  a.load(grid, begin);
  for (std::size_t slice = begin; slice < end; ++slice, ++counts) {
    const bool last = slice + 1 == grid.size(2);
    if (!last) {
      b.load(grid, slice + 1);
    }
    *counts = count_layer(grid, a, last ? a : b, last);
    std::swap(a, b);
  }
}

void write_layers(const PaddedGrid& grid, std::size_t begin, std::size_t end, const LayerCounts* counts,
                  const Output& out, const Crossings* crossings, std::vector<PinchedVertex>& pinched) {
  LayerWriter(grid, out, crossings, pinched).write(begin, end, counts);
}

}  // namespace tunica::cell_layers
