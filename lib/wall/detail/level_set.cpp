#include "tunica/wall/detail/level_set.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double snap_share = 0.2;    // of a cell: crossings so near a sample are on it, which leaves no slivers
constexpr double margin = 2.5;        // cells around
constexpr std::size_t block = 8;      // samples along an edge, a power of two
constexpr int most_steps = 30;        // of a vertex onto the level
constexpr double near_enough = 1e-7;  // of half the wall

struct Grid {
  Vec3 origin;
  std::array<std::size_t, 3> dims;
};

Grid grid_around(const HalfWayLevel& level, double cell) {
  const Box box = bounding_box(level.face.mesh());
  const double around = (level.side > 0 ? level.half : 0) + margin * cell;
  Grid grid{box.lower - Vec3::Constant(around), {}};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = narrow<Eigen::Index>(k);
    const double length = box.upper[axis] - box.lower[axis] + 2 * around;
    grid.dims[k] = truncated<std::size_t>(std::ceil(length / cell)) + 1;
  }
  return grid;
}

using Place = std::array<std::size_t, 3>;

/// Samples the distance where it is near the level; elsewhere only its sign is right.
class Sampling {
public:
  Sampling(const HalfWayLevel& level, double cell, const Grid& grid, std::vector<float>& values)
      : level_(level), cell_(cell), grid_(grid), values_(values) {}

  /// A box of samples, [from, from + size) as far as the grid goes.
  void fill(const Place& from, std::size_t size) {
    Place to;
    for (std::size_t k = 0; k < 3; ++k) {
      to[k] = std::min(from[k] + size, grid_.dims[k]);
      if (from[k] >= to[k]) {
        return;
      }
    }
    const Vec3 first = point(from), last = point({to[0] - 1, to[1] - 1, to[2] - 1});
    const ContinuedFace::Hit hit = level_.face.at((first + last) / 2, guess_);
    guess_ = hit.triangle;
    const double value = level_.value(hit);
    if (size == 1) {
      store(from, std::abs(value) < snap_share * cell_ ? 0 : value);
      return;
    }
    // Where the face has rims, the sign may turn anywhere beyond them, the distance does not.
    const double off = level_.face.is_closed() ? std::abs(value) : std::abs(std::abs(hit.distance) - level_.half);
    if (off > (last - first).norm() / 2 + 1.01 * cell_) {
      fill_with(from, to, value);
      return;
    }
    const std::size_t half = size / 2;
    for (std::size_t part = 0; part < 8; ++part) {
      fill({from[0] + half * (part & 1), from[1] + half * (part >> 1 & 1), from[2] + half * (part >> 2)}, half);
    }
  }

private:
  [[nodiscard]] Vec3 point(const Place& at) const {
    return grid_.origin + cell_ * Vec3(real(at[0]), real(at[1]), real(at[2]));
  }
  void store(const Place& at, double value) {
    values_[at[0] + grid_.dims[0] * (at[1] + grid_.dims[1] * at[2])] = static_cast<float>(value);
  }
  void fill_with(const Place& from, const Place& to, double value) {
    for (std::size_t k = from[2]; k < to[2]; ++k) {
      for (std::size_t j = from[1]; j < to[1]; ++j) {
        for (std::size_t i = from[0]; i < to[0]; ++i) {
          store({i, j, k}, value);
        }
      }
    }
  }

  const HalfWayLevel& level_;
  double cell_;
  const Grid& grid_;
  std::vector<float>& values_;
  Index guess_ = 0;
};

}  // namespace

Vec3 HalfWayLevel::foot_on(const Vec3& p, const ContinuedFace::Hit& hit) const {
  const Vec3 way = p - hit.point;
  const bool told = std::abs(hit.distance) > 1e-3 * half;
  const Vec3 outward = told ? Vec3(way / hit.distance) : hit.pseudo_normal.stableNormalized();
  return hit.point + side * half * outward;
}

Vec3 HalfWayLevel::moved_onto(Vec3 p) const {
  Index guess = 0;
  for (int step = 0; step < most_steps; ++step) {
    const ContinuedFace::Hit hit = face.at(p, guess);
    if (std::abs(value(hit)) <= near_enough * half) {
      break;
    }
    guess = hit.triangle;
    p = foot_on(p, hit);
  }
  return p;
}

double grid_points(const HalfWayLevel& level, double cell) {
  const Box box = bounding_box(level.face.mesh());
  const double around = 2 * (level.side > 0 ? level.half : 0) + 2 * margin * cell;
  double points = 1;
  for (Eigen::Index k = 0; k < 3; ++k) {
    points *= (box.upper[k] - box.lower[k] + around) / cell + 2;
  }
  return points;
}

TriangleMesh marched_level(const HalfWayLevel& level, double cell, const Progress& progress) {
  const Grid grid = grid_around(level, cell);
  Volume volume;
  volume.dims = grid.dims;
  volume.affine.leftCols<3>() = cell * Mat3::Identity();
  volume.affine.col(3) = grid.origin;
  std::vector<float> values(volume.voxels());
  Place blocks;
  for (std::size_t k = 0; k < 3; ++k) {
    blocks[k] = (grid.dims[k] + block - 1) / block;
  }
  const std::size_t count = blocks[0] * blocks[1] * blocks[2];
  parallel_for_blocks(count, 64, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    Sampling sampling(level, cell, grid, values);
    for (std::size_t b = begin; b < end; ++b) {
      sampling.fill({block * (b % blocks[0]), block * (b / blocks[0] % blocks[1]), block * (b / blocks[0] / blocks[1])},
                    block);
    }
  });
  tunica::advance(progress, 0.5);
  volume.data = std::move(values);
  return marching_cubes(volume, {Inside::Rule::below, 0});
}

}  // namespace tunica
