// W. E. Lorensen, H. E. Cline: Marching cubes: a high resolution 3D surface construction algorithm. SIGGRAPH 1987.
// W. Schroeder, R. Maynard, B. Geveci: Flying edges: a high-performance scalable isocontouring algorithm. LDAV 2015.
#include "tunica/volume/cubes/detail/cell_layers.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/volume/cubes/detail/cube_cases.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
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

std::size_t ones(Word word) { return std::popcount(word); }
Index bits_of(Word word) { return std::popcount(word); }
Word shifted(const Word* word) { return word[0] >> 1 | word[1] << (word_bits - 1); }

/// A running number for each of these edges of a cell: that of the next vertex on it when the walk along the rows comes
/// to the cell. The cell's other edges have the number after the one on the parallel edge at its left.
constexpr std::array<std::uint8_t, 8> running_edges{0, 1, 2, 3, 4, 6, 8, 10};

/// The running number of an edge, and whether it is an edge at the cell's right.
struct EdgeNumber {
  std::uint8_t running;
  bool right;
};
constexpr std::array<EdgeNumber, 12> edge_numbers{{{0, false},
                                                   {1, false},
                                                   {2, false},
                                                   {3, false},
                                                   {4, false},
                                                   {4, true},
                                                   {5, false},
                                                   {5, true},
                                                   {6, false},
                                                   {6, true},
                                                   {7, false},
                                                   {7, true}}};

/// A case as the writer wants it.
struct alignas(32) PackedCase {
  /// The triangles' corners, one after the other: which running number, and eight if it has just been used at the left.
  std::array<std::uint8_t, 16> corners{};
  std::array<std::uint8_t, 8> crossed{};  ///< 1 for each of running_edges that is crossed
  std::uint32_t count = 0;                ///< triangles
};

/// The cases twice: of cells, and of places after the last cell of a row or layer, which have edges but no triangles.
constexpr std::size_t no_cell = 256;
using PackedCases = std::array<PackedCase, 2 * no_cell>;

PackedCases pack_cases(bool mirrored) {
  PackedCases packed;
  for (std::size_t which = 0; which < no_cell; ++which) {
    const CubeCase& cube = cube_cases()[which];
    PackedCase& cell = packed[which];
    for (std::size_t i = 0; i < running_edges.size(); ++i) {
      const auto [first, second] = cube_edges[running_edges[i]];
      cell.crossed[i] = narrow<std::uint8_t>((which >> first ^ which >> second) & 1);
    }
    packed[which + no_cell].crossed = cell.crossed;
    cell.count = narrow<std::uint32_t>(cube.count);
    for (std::size_t t = 0; t < cube.count; ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const auto [running, right] = edge_numbers[cube.triangles[t][mirrored ? (3 - corner) % 3 : corner]];
        cell.corners[3 * t + corner] = narrow<std::uint8_t>(running | (right ? cell.crossed[running] << 3 : 0));
      }
    }
  }
  return packed;
}

const PackedCases& packed_cases(bool mirrored) {
  static const std::array<PackedCases, 2> packed{pack_cases(false), pack_cases(true)};
  return packed[mirrored ? 1 : 0];
}

/// The running numbers, as a walk along the rows of a layer comes by.
class RunningNumbers {
public:
#ifdef __AVX2__
  explicit RunningNumbers(const std::array<Index, 8>& start)
      : numbers_(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(start.data()))) {}

  /// Writes the triangles of a cell and steps over it. Whatever their number, sixteen corners are written.
  Index* write(const PackedCase& cube, Index* corner) {
    const auto bytes = [](const std::uint8_t* from) {
      return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from)));
    };
    for (int half = 0; half < 2; ++half) {
      const __m256i packed = bytes(cube.corners.data() + 8 * half);
      // Of the packed number this looks at the lowest three bits only.
      const __m256i next = _mm256_permutevar8x32_epi32(numbers_, packed);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(corner + 8 * half),
                          _mm256_add_epi32(next, _mm256_srli_epi32(packed, 3)));
    }
    numbers_ = _mm256_add_epi32(numbers_, bytes(cube.crossed.data()));
    return corner + 3 * cube.count;
  }

private:
  __m256i numbers_;
#else
  explicit RunningNumbers(const std::array<Index, 8>& start) : numbers_(start) {}

  Index* write(const PackedCase& cube, Index* corner) {
    for (std::size_t i = 0; i < 16; ++i) {
      corner[i] = numbers_[cube.corners[i] & 7] + (cube.corners[i] >> 3);
    }
    for (std::size_t i = 0; i < 8; ++i) {
      numbers_[i] += cube.crossed[i];
    }
    return corner + 3 * cube.count;
  }

private:
  std::array<Index, 8> numbers_;
#endif
};

/// A slice of padded rows, one after the other, with a copy of the last one after it, so that no edge towards it is
/// crossed.
class Plane {
public:
  explicit Plane(const PaddedGrid& grid)
      : rows_(grid.size(1)), stride_(grid.words()), words_((rows_ + 1) * stride_ + 1), inside_(rows_ + 1) {}

  void load(const PaddedGrid& grid, std::size_t slice) {
    grid.load(slice, words_.data(), inside_.data());
    std::copy_n(row(rows_ - 1), stride_, words_.data() + rows_ * stride_);
    inside_[rows_] = inside_[rows_ - 1];
  }
  [[nodiscard]] const Word* row(std::size_t r) const { return words_.data() + r * stride_; }
  /// Whether anything in rows r and r + 1 is inside.
  [[nodiscard]] bool any_inside(std::size_t r) const { return (inside_[r] | inside_[r + 1]) != 0; }

private:
  std::size_t rows_;
  std::size_t stride_;
  std::vector<Word> words_;  // and one more, for reading ahead
  std::vector<std::uint8_t> inside_;
};

/// The bits around 64 cells.
struct CellWord {
  Word a0, a0s, a1, a1s, b0, b0s, b1, b1s;  // corners in the order of their numbers

  /// From the words of the four rows, each followed by the next word of its row.
  CellWord(const Word* row_a0, const Word* row_a1, const Word* row_b0, const Word* row_b1)
      : a0(row_a0[0]),
        a0s(shifted(row_a0)),
        a1(row_a1[0]),
        a1s(shifted(row_a1)),
        b0(row_b0[0]),
        b0s(shifted(row_b0)),
        b1(row_b1[0]),
        b1s(shifted(row_b1)) {}
  CellWord(const Plane& a, const Plane& b, std::size_t row, std::size_t w)
      : CellWord(a.row(row) + w, a.row(row + 1) + w, b.row(row) + w, b.row(row + 1) + w) {}
};

/// Which of their edges are crossed: those along x, and along y and z at the left and at the right.
struct CellEdges {
  Word x0, x1, x2, x3;
  Word y0, y1, y0s, y1s;
  Word z0, z1, z0s, z1s;

  explicit CellEdges(const CellWord& c)
      : x0(c.a0 ^ c.a0s),
        x1(c.a1 ^ c.a1s),
        x2(c.b0 ^ c.b0s),
        x3(c.b1 ^ c.b1s),
        y0(c.a0 ^ c.a1),
        y1(c.b0 ^ c.b1),
        y0s(c.a0s ^ c.a1s),
        y1s(c.b0s ^ c.b1s),
        z0(c.a0 ^ c.b0),
        z1(c.a1 ^ c.b1),
        z0s(c.a0s ^ c.b0s),
        z1s(c.a1s ^ c.b1s) {}
};

/// The cells whose crossed edges make more than one loop, and some with one: those with two inside corners across the
/// diagonal of a face, or with two opposite corners that differ from all their neighbours. Always inlined: a loop that
/// called it would not be vectorised.
[[gnu::always_inline]] inline Word several_loops(const CellEdges& e) {
  const Word face = (e.x0 & e.x1 & e.y0) | (e.x2 & e.x3 & e.y1) | (e.x0 & e.x2 & e.z0) | (e.x1 & e.x3 & e.z1) |
                    (e.y0 & e.y1 & e.z0) | (e.y0s & e.y1s & e.z0s);
  const Word opposite = (e.x0 & e.x3 & ((e.y0 & e.z0 & e.y1s & e.z1s) | (e.y0s & e.z0s & e.y1 & e.z1))) |
                        (e.x1 & e.x2 & ((e.y0 & e.z1 & e.y1s & e.z0s) | (e.y0s & e.z1s & e.y1 & e.z0)));
  return face | opposite;
}

/// A word of a row in which not all cells, or places after the last one, are all inside or all outside.
struct ActiveWord {
  std::uint32_t row;
  std::uint32_t word;
  Word places;
};

/// Finds the active words of a layer. Crossed edges of its rows are in no others.
class ActiveWords {
public:
  explicit ActiveWords(const PaddedGrid& grid)
      : grid_(grid), places_(grid.size(1) * grid.words()), found_(places_.size() + 1) {}

  /// @param look_for_loops  so that several_loops_found() is known
  /// @return in the order of the rows, valid until the next call
  std::span<const ActiveWord> find(const Plane& a, const Plane& b, bool look_for_loops) {
    const std::size_t rows = grid_.size(1);
    ActiveWord* out = found_.data();
    several_loops_ = false;
    for (std::size_t row = 0; row < rows; ++row) {
      std::size_t end = row;
      while (end < rows && (a.any_inside(end) || b.any_inside(end))) {
        ++end;
      }
      if (end > row) {
        if (look_for_loops) {
          find_places<true>(a, b, row, end);
        } else {
          find_places<false>(a, b, row, end);
        }
        out = list(row, end, out);
        row = end;
      }
    }
    return {found_.data(), out};
  }

  /// Whether several_loops() holds for any cell found the last time.
  [[nodiscard]] bool several_loops_found() const { return several_loops_; }

private:
  template <bool loops>
  void find_places(const Plane& a, const Plane& b, std::size_t begin, std::size_t end) {
    const Word* const a0 = a.row(begin);
    const Word* const a1 = a.row(begin + 1);
    const Word* const b0 = b.row(begin);
    const Word* const b1 = b.row(begin + 1);
    Word* const places = places_.data();
    Word several = 0;
    const std::size_t words = (end - begin) * grid_.words();
    for (std::size_t i = 0; i < words; ++i) {
      const CellWord c(a0 + i, a1 + i, b0 + i, b1 + i);
      const CellEdges e(c);
      // The edges that join all corners: where none is crossed the corners are alike.
      places[i] = e.x0 | e.x1 | e.x2 | e.x3 | e.y0 | e.y1 | e.z0;
      if constexpr (loops) {
        several |= several_loops(e);
      }
    }
    several_loops_ = several_loops_ || several != 0;
  }

  ActiveWord* list(std::size_t begin, std::size_t end, ActiveWord* out) const {
    const Word* places = places_.data();
    for (std::size_t row = begin; row < end; ++row) {
      for (std::size_t w = 0; w < grid_.words(); ++w, ++places) {
        *out = {narrow<std::uint32_t>(row), narrow<std::uint32_t>(w), *places & grid_.samples(w)};
        out += out->places != 0 ? 1 : 0;
      }
    }
    return out;
  }

  const PaddedGrid& grid_;
  std::vector<Word> places_;
  std::vector<ActiveWord> found_;
  bool several_loops_ = false;
};

/// The cases of the cells between two slices: which of their corners are inside.
class Cases {
public:
  Cases(const Plane& a, const Plane& b)
      : a_(bytes(a.row(0))), b_(bytes(b.row(0))), row_(narrow<std::size_t>(bytes(a.row(1)) - a_)) {}

  [[nodiscard]] std::size_t operator()(const CrossedEdge& first) const {
    static_assert(std::endian::native == std::endian::little, "eight columns in a byte");
    const std::size_t at = first.row * row_ + first.column / 8;
    const unsigned bit = first.column % 8;
    const auto pair = [bit](const char* from) {
      std::uint16_t bits = 0;
      std::memcpy(&bits, from, sizeof bits);
      return narrow<std::size_t>(bits >> bit & 3);
    };
    return pair(a_ + at) | pair(a_ + at + row_) << 2 | pair(b_ + at) << 4 | pair(b_ + at + row_) << 6;
  }

private:
  static const char* bytes(const Word* words) { return reinterpret_cast<const char*>(words); }

  const char* a_;
  const char* b_;
  std::size_t row_;  // bytes
};

/// Triangles of a case beyond those of a single loop around its crossed edges.
std::ptrdiff_t beyond_one_loop(std::size_t which) {
  std::ptrdiff_t triangles = narrow<std::ptrdiff_t>(packed_cases(false)[which].count) + 2;
  for (const auto& [first, second] : cube_edges) {
    triangles -= narrow<std::ptrdiff_t>((which >> first ^ which >> second) & 1);
  }
  return triangles;
}

/// What a layer is counted by is taken as if every slice, row and column had neighbours on both sides. @return how much
/// less it is where the grid ends at an open border
LayerCounts count_missing(const PaddedGrid& grid, const Plane& a, const Plane& b, std::span<const ActiveWord> active,
                          std::size_t slice) {
  LayerCounts missing;
  for (const auto& [row, w, places] : active) {
    const CellEdges e(CellWord(a, b, row, w));
    const Word ends = grid.ends(w) & places;
    const bool last_row = row + 1 == grid.size(1);
    if (row == 0 || last_row) {
      missing.in_slice += ones(e.x0 & places);
      missing.in_layer += narrow<std::ptrdiff_t>(2 * ones(e.z0 & places) - ones(e.z0 & ends));
    }
    missing.in_slice += ones(e.y0 & ends);
    missing.in_layer += narrow<std::ptrdiff_t>(2 * ones(e.z0 & ends));
    missing.in_layer -= narrow<std::ptrdiff_t>(2 * ones(places & ~grid.cells(slice, row, w)));
  }
  return missing;
}

/// A loop around n crossed edges makes n - 2 triangles. Of the cells of one layer two have an edge in one of its slices
/// in common, and four an edge along z.
LayerCounts count_layer(const PaddedGrid& grid, const Plane& a, const Plane& b, ActiveWords& active,
                        std::size_t slice) {
  LayerCounts sum;
  std::size_t cells = 0;
  const std::span<const ActiveWord> found = active.find(a, b, true);
  for (const auto& [row, w, places] : found) {
    const Word* const a0 = a.row(row) + w;
    sum.along_x += ones((a0[0] ^ shifted(a0)) & places);
    sum.along_y += ones((a0[0] ^ a.row(row + 1)[w]) & places);
    sum.along_z += ones((a0[0] ^ b.row(row)[w]) & places);
    cells += ones(places);
  }
  sum.in_slice = 2 * (sum.along_x + sum.along_y);
  sum.in_layer = narrow<std::ptrdiff_t>(4 * sum.along_z) - narrow<std::ptrdiff_t>(2 * cells);
  if (grid.is_open()) {
    const LayerCounts missing = count_missing(grid, a, b, found, slice);
    sum.in_slice -= missing.in_slice;
    sum.in_layer -= missing.in_layer;
  }
  if (active.several_loops_found()) {
    const Cases case_at(a, b);
    for (const auto& [row, w, places] : found) {
      Word several = several_loops(CellEdges(CellWord(a, b, row, w))) & places & grid.cells(slice, row, w);
      for (; several != 0; several &= several - 1) {
        const auto column = narrow<std::uint32_t>(w * word_bits) + std::countr_zero(several);
        sum.in_layer += beyond_one_loop(case_at({row, column}));
      }
    }
  }
  return sum;
}

/// Appends the set bits of a word. Four at a time without a branch: most words have no more.
/// @return one past the last one; up to four places beyond it are overwritten
CrossedEdge* append(CrossedEdge* out, const ActiveWord& active) {
  Word places = active.places;
  const auto column = narrow<std::uint32_t>(active.word * word_bits);
  CrossedEdge* const end = out + ones(places);
  do {
    for (int i = 0; i < 4; ++i) {
      out[i] = {active.row, column + std::countr_zero(places)};
      places &= places - 1;
    }
    out += 4;
  } while (places != 0);
  return end;
}

/// Positions of the samples, as sums of a term of the column and one of row and slice; in four numbers, the last one
/// without meaning, which is what the processor adds at once.
class Samples {
public:
  using Place = Eigen::Vector4d;

  explicit Samples(const PaddedGrid& grid) : grid_(grid), column_(grid.size(0)), row_(grid.size(1)) {
    for (std::size_t i = 0; i < column_.size(); ++i) {
      column_[i] = padded(grid.affine().col(0) * grid.coordinate(i, 0));
    }
  }
  /// To the rows [begin, end) of a slice.
  void move_to(std::size_t slice, std::size_t begin, std::size_t end) {
    const Vec3 origin = grid_.affine().col(3) + grid_.affine().col(2) * grid_.coordinate(slice, 2);
    for (std::size_t j = begin; j < end; ++j) {
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

/// What a thread works in.
struct Workspace {
  explicit Workspace(const PaddedGrid& grid) : a(grid), b(grid), active(grid), samples(grid) {}

  Plane a;
  Plane b;
  ActiveWords active;
  Samples samples;
  std::vector<CrossedEdge> places;
  std::vector<CrossedEdge> edges;
  std::vector<std::array<Index, 3>> triangles;
};

class LayerWriter {
public:
  LayerWriter(const PaddedGrid& grid, const Output& out, const Crossings* crossings,
              std::vector<PinchedVertex>& pinched, Workspace& workspace)
      : grid_(grid),
        cases_(packed_cases(grid.affine().leftCols<3>().determinant() < 0)),
        crossings_(crossings),
        pinched_(pinched),
        vertices_(out.vertices),
        triangles_(out.triangles),
        first_(narrow<Index>(out.first_vertex)),
        in_(workspace) {}

  void write(std::size_t begin, std::size_t end, const LayerCounts* counts) {
    for (std::size_t layer = 0; layer < end - begin; ++layer) {
      triangles_left_ += counts[layer].triangles;
    }
    in_.a.load(grid_, begin);
    for (std::size_t slice = begin; slice < end; ++slice, ++counts) {
      write_layer(slice, counts);
      std::swap(in_.a, in_.b);
      vertices_ += counts->vertices();
      triangles_ += counts->triangles;
      triangles_left_ -= counts->triangles;
      first_ += narrow<Index>(counts->vertices());
    }
  }

private:
  void write_layer(std::size_t slice, const LayerCounts* counts) {
    const bool last = slice + 1 == grid_.size(2);
    if (!last) {
      in_.b.load(grid_, slice + 1);
    }
    const Plane& b = last ? in_.a : in_.b;
    const std::span<const CrossedEdge> places = find_places(b);
    if (places.empty()) {
      return;
    }
    grow(in_.edges, counts->vertices() + 3);
    CrossedEdge* const x = in_.edges.data();
    CrossedEdge* const y = x + counts->along_x + 1;
    CrossedEdge* const z = y + counts->along_y + 1;
    CrossedEdge* x_end = x;
    CrossedEdge* y_end = y;
    CrossedEdge* z_end = z;
    // Straight to where they belong, but for the last ones, which would overwrite what follows.
    const bool in_place = counts->triangles + spare_triangles <= triangles_left_;
    if (!in_place) {
      grow(in_.triangles, counts->triangles + spare_triangles);
    }
    Index* const corners = in_place ? triangles_->data() : in_.triangles.data()->data();
    Index* corner = corners;
    RunningNumbers numbers = start(b, *counts, last ? LayerCounts{} : counts[1]);
    const Cases case_at(in_.a, b);
    const PackedCase* const cases = cases_.data();
    const bool open = grid_.is_open();
    for (const CrossedEdge& place : places) {
      std::size_t which = case_at(place);
      if (open && !grid_.is_cell(slice, place.row, place.column)) {
        which += no_cell;
      }
      const PackedCase& cube = cases[which];
      corner = numbers.write(cube, corner);
      // Written anyway, kept where crossed.
      *x_end = *y_end = *z_end = place;
      x_end += cube.crossed[0];
      y_end += cube.crossed[4];
      z_end += cube.crossed[6];
    }
    TUNICA_ASSERT(x_end - x == narrow<std::ptrdiff_t>(counts->along_x) &&
                  y_end - y == narrow<std::ptrdiff_t>(counts->along_y) &&
                  z_end - z == narrow<std::ptrdiff_t>(counts->along_z) &&
                  corner - corners == narrow<std::ptrdiff_t>(3 * counts->triangles));
    if (!in_place) {
      std::copy_n(in_.triangles.begin(), counts->triangles, triangles_);
    }
    in_.samples.move_to(slice, places.front().row, places.back().row + 1);
    write_vertices(x, counts->along_x, slice, 0, 0);
    write_vertices(y, counts->along_y, slice, 1, counts->along_x);
    write_vertices(z, counts->along_z, slice, 2, counts->along_x + counts->along_y);
  }

  template <typename T>
  static void grow(std::vector<T>& vector, std::size_t size) {
    if (vector.size() < size) {
      vector.resize(size + size / 2);
    }
  }

  std::span<const CrossedEdge> find_places(const Plane& b) {
    std::size_t found = 0;
    for (const ActiveWord& active : in_.active.find(in_.a, b, false)) {
      grow(in_.places, found + word_bits + spare_edges);
      CrossedEdge* const out = in_.places.data() + found;
      found += narrow<std::size_t>(append(out, active) - out);
    }
    return {in_.places.data(), found};
  }

  /// Numbers before the first place of the layer.
  [[nodiscard]] RunningNumbers start(const Plane& b, const LayerCounts& counts, const LayerCounts& counts_b) const {
    // Edges 1, 3 and 10 run along the second row: the first one's come before.
    Index x_a = 0;
    Index x_b = 0;
    Index z = 0;
    for (std::size_t w = 0; w < grid_.words(); ++w) {
      x_a += bits_of((in_.a.row(0)[w] ^ shifted(in_.a.row(0) + w)) & grid_.samples(w));
      x_b += bits_of((b.row(0)[w] ^ shifted(b.row(0) + w)) & grid_.samples(w));
      z += bits_of((in_.a.row(0)[w] ^ b.row(0)[w]) & grid_.samples(w));
    }
    const Index first_b = first_ + narrow<Index>(counts.vertices());
    const Index y_a = first_ + narrow<Index>(counts.along_x);
    const Index y_b = first_b + narrow<Index>(counts_b.along_x);
    const Index along_z = y_a + narrow<Index>(counts.along_y);
    return RunningNumbers({first_, first_ + x_a, first_b, first_b + x_b, y_a, y_b, along_z, along_z + z});
  }

  void write_vertices(const CrossedEdge* edges, std::size_t count, std::size_t slice, int axis, std::size_t offset) {
    const Vec3 along = grid_.affine().col(axis);
    Vec3* const out = vertices_ + offset;
    if (crossings_ == nullptr) {
      const Samples::Place half = Samples::padded(0.5 * along);
      for (std::size_t i = 0; i < count; ++i) {
        const std::array<std::size_t, 3> first{edges[i].column, edges[i].row, slice};
        const Samples::Place start = in_.samples(edges[i]);
        const Samples::Place place = grid_.starts_on_lid(first[axis], axis) ? start : start + half;
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
        place_vertex(first, axis, fractions[i], in_.samples(edge).head<3>(), along, out[begin + i],
                     first_ + offset + begin + i);
      }
    }
  }

  void place_vertex(const std::array<std::size_t, 3>& first, int axis, double t, const Vec3& start, const Vec3& along,
                    Vec3& vertex, std::size_t number) {
    std::array<std::size_t, 3> second = first;
    ++second[axis];
    if (grid_.starts_on_lid(first[axis], axis)) {
      vertex = start;
      return;
    }
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
    pinched_.push_back({narrow<Index>(number), grid_.number(low ? first : second),
                        start + (low ? beside_sample : 1 - beside_sample) * along});
  }

  static constexpr std::size_t spare_edges = 4;      // that append() may overwrite
  static constexpr std::size_t spare_triangles = 6;  // that RunningNumbers::write() may

  const PaddedGrid& grid_;
  const PackedCases& cases_;
  const Crossings* crossings_;
  std::vector<PinchedVertex>& pinched_;
  Vec3* vertices_;                   // of the slice
  std::array<Index, 3>* triangles_;  // of the layer above it
  std::size_t triangles_left_ = 0;   // room from there on
  Index first_;                      // number of the slice's first vertex
  Workspace& in_;
};

}  // namespace

struct Layers::Memory : Workspace {
  using Workspace::Workspace;
};

Layers::Layers(const PaddedGrid& grid) : grid_(grid), memory_(std::make_unique<Memory>(grid)) {}

Layers::~Layers() = default;

void Layers::count(std::size_t begin, std::size_t end, LayerCounts* counts) {
  Plane& a = memory_->a;
  Plane& b = memory_->b;
  a.load(grid_, begin);
  for (std::size_t slice = begin; slice < end; ++slice, ++counts) {
    const bool last = slice + 1 == grid_.size(2);
    if (!last) {
      b.load(grid_, slice + 1);
    }
    *counts = count_layer(grid_, a, last ? a : b, memory_->active, slice);
    std::swap(a, b);
  }
}

void Layers::write(std::size_t begin, std::size_t end, const LayerCounts* counts, const Output& out,
                   const Crossings* crossings, std::vector<PinchedVertex>& pinched) {
  LayerWriter(grid_, out, crossings, pinched, *memory_).write(begin, end, counts);
}

void count_triangles(std::span<LayerCounts> counts) {
  for (std::size_t slice = 0; slice + 1 < counts.size(); ++slice) {
    LayerCounts& layer = counts[slice];
    layer.triangles = layer.in_slice + counts[slice + 1].in_slice + layer.in_layer;
  }
}

}  // namespace tunica::cell_layers
