// D. Levin: The approximation power of moving least squares. Math. Comput. 67 (1998). M. Alexa et al.: Computing and
// rendering point set surfaces. IEEE TVCG 9 (2003). D. Belomestny, V. Spokoiny: Spatial aggregation of local likelihood
// estimates with applications to classification. Ann. Stat. 35 (2007).
#include "tunica/volume/smoothing/detail/local_quadrics.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "tunica/core/simd.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numeric>
#include <utility>

namespace tunica {
namespace {

/// Crossings within this distance of another, in voxels, share what is gathered around it.
constexpr double reach_of_group = 2.6;
/// … if their normals differ by no more than the angle with this cosine.
constexpr double least_cosine_of_group = 0.8;
/// Radii of the surroundings, in voxels.
constexpr std::array<double, 4> radii{4, 5.7, 8, 11.3};
/// Beyond this many voxels every other crossing counts, for two.
constexpr double thinned_beyond = 7;
/// Weighted mean of the squares by which a quadric misses the edges, in variances of their middles: up to this a radius
/// counts in full, and at twice this not at all.
constexpr double least_tolerance = 0.5;
/// Where the smallest radius misses more, by noise: up to this many times that.
constexpr double tolerance_factor = 1.3;
/// Crossings whose normal turns away by more than the angle with this cosine are of another sheet.
constexpr double least_cosine = 0.2;
/// Least uncertainty of a middle, in voxels: that of what is taken as known about the surroundings.
constexpr double least_deviation = 0.02;

using Quadric = Eigen::Matrix<double, 6, 1>;

/// Several numbers at a time, of single precision: what is gathered around a crossing lies within a dozen voxels and is
/// known to a tenth.
constexpr std::size_t several = 8;
using Several = simd::Vector<float, several>;
using SeveralPoints = std::array<Several, 3>;

Several dot(const SeveralPoints& a, const SeveralPoints& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

SeveralPoints all(const Vec3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

double total(const Several& values) { return simd::reduce(values); }

/// A crossing as it is needed around another, in units of a voxel.
struct Site {
  Vec3 place;
  Vec3 normal;
  Vec3 middle;
  double half;    ///< of the edge, along the normal
  double weight;  ///< of the middle: one over the variance of its height
};

/// Columns of numbers that are gone through several at a time.
template <std::size_t columns>
class Table {
public:
  void clear() { size_ = 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// For rows that are written in place. The column `zero` is made 0 up to whole lanes.
  void resize(std::size_t size, std::size_t zero) {
    size_ = size;
    const std::size_t whole = (size + several - 1) / several * several;
    for (auto& column : columns_) {
      column.resize(std::max(whole, column.size()));
    }
    std::fill(columns_[zero].begin() + size, columns_[zero].begin() + whole, 0.0F);
  }
  [[nodiscard]] Several get(std::size_t column, std::size_t row) const {
    return {columns_[column].data() + row, simd::element_aligned};
  }
  [[nodiscard]] SeveralPoints get_point(std::size_t column, std::size_t row) const {
    return {get(column, row), get(column + 1, row), get(column + 2, row)};
  }
  void set(std::size_t column, std::size_t row, double value) { columns_[column][row] = static_cast<float>(value); }
  void set_point(std::size_t column, std::size_t row, const Vec3& p) {
    for (std::size_t i = 0; i < 3; ++i) {
      set(column + i, row, p[i]);
    }
  }
  void set(std::size_t column, std::size_t row, const Several& value) {
    value.copy_to(columns_[column].data() + row, simd::element_aligned);
  }

private:
  std::size_t size_ = 0;
  std::array<std::vector<float>, columns> columns_;
};

/// Groups of crossings that lie close together, each led by its first.
struct Groups {
  std::vector<Index> members;
  std::vector<std::size_t> first{0};  ///< of each group, and one more
};

Groups make_groups(const std::vector<Site>& sites, const VertexNeighbours& neighbours) {
  constexpr double squared_reach = reach_of_group * reach_of_group;
  std::vector<bool> taken(sites.size(), false);
  Groups groups;
  groups.members.reserve(sites.size());
  for (Index leader = 0; leader < sites.size(); ++leader) {
    if (taken[leader]) {
      continue;
    }
    taken[leader] = true;
    groups.members.push_back(leader);
    for (std::size_t at = groups.first.back(); at < groups.members.size(); ++at) {
      for (const Index other : neighbours.of(groups.members[at])) {
        if (!taken[other] && (sites[other].place - sites[leader].place).squaredNorm() < squared_reach &&
            sites[other].normal.dot(sites[leader].normal) > least_cosine_of_group) {
          taken[other] = true;
          groups.members.push_back(other);
        }
      }
    }
    groups.first.push_back(groups.members.size());
  }
  return groups;
}

/// Fits quadrics around the crossings of a group, in memory that is kept for the next one.
class Fitter {
public:
  Fitter(const std::vector<Site>& sites, const VertexNeighbours& neighbours)
      : sites_(sites), neighbours_(neighbours), seen_(sites.size(), none) {}

  /// Gathers what is around a group, by its leader.
  void gather(Index leader) {
    const Site& middle = sites_[leader];
    found_.assign(1, {leader, 0});
    seen_[leader] = leader;
    for (std::size_t at = 0; at < found_.size(); ++at) {
      for (const Index other : neighbours_.of(found_[at].crossing)) {
        if (seen_[other] == leader) {
          continue;
        }
        seen_[other] = leader;
        const Site& site = sites_[other];
        const std::size_t shell = shell_of((site.place - middle.place).norm());
        if (shell < shells && site.normal.dot(middle.normal) > 0) {
          found_.push_back({other, shell});
        }
      }
    }
    const std::size_t first_thinned = shell_of(thinned_beyond);
    std::erase_if(found_,
                  [&](const Found& found) { return found.shell >= first_thinned && every_other(found.crossing); });
    shell_end_.fill(0);
    for (const Found& found : found_) {
      ++shell_end_[found.shell];
    }
    std::exclusive_scan(shell_end_.begin(), shell_end_.end(), shell_end_.begin(), std::size_t{0});
    around_.resize(found_.size(), weight);
    for (const Found& found : found_) {
      const Site& site = sites_[found.crossing];
      const std::size_t row = shell_end_[found.shell]++;
      around_.set_point(place, row, site.place - middle.place);
      around_.set_point(normal, row, site.normal);
      around_.set_point(between, row, site.middle - middle.place);
      around_.set(half, row, site.half);
      around_.set(weight, row, found.shell >= first_thinned ? 2 * site.weight : site.weight);
    }
  }

  /// Height of the surface at a crossing of the group that was gathered last.
  double offset(Index crossing, Index leader) {
    const Site& site = sites_[crossing];
    const Vec3 off_leader = site.place - sites_[leader].place;
    std::size_t placed = 0;
    double height = 0;
    double tolerated = 0;
    for (const double radius : radii) {
      placed = place_around(site, off_leader, placed,
                            shell_end_[std::min(shell_of(radius + off_leader.norm()), shells - 1)]);
      const Quadric quadric = fit(placed, radius);
      if (weights_ <= 0) {
        break;  // a corner of the mask with no direction of its own
      }
      const double misses = missed(quadric, placed, radius);
      double share = 1;
      if (radius == radii.front()) {
        tolerated = std::max(least_tolerance, tolerance_factor * misses);
      } else {
        share = std::clamp(2 - misses / tolerated, 0.0, 1.0);
      }
      height += share * (quadric[0] - height);
      if (share == 0) {
        break;
      }
    }
    return height;
  }

private:
  static constexpr Index none = ~Index{0};
  static constexpr std::size_t shells = 64;

  /// A crossing near the leader, and in which shell around it.
  struct Found {
    Index crossing;
    std::size_t shell;
  };

  // Columns of what is around a group, in space,
  static constexpr std::size_t place = 0;
  static constexpr std::size_t normal = 3;
  static constexpr std::size_t between = 6;
  static constexpr std::size_t half = 9;
  static constexpr std::size_t weight = 10;
  // and around one of its crossings, over the plane across the normal.
  static constexpr std::size_t along_u = 0;
  static constexpr std::size_t along_w = 1;
  static constexpr std::size_t up = 2;
  static constexpr std::size_t squared_distance = 3;
  static constexpr std::size_t worth = 4;

  /// Half of all, without regard to how they follow each other along the slices.
  static bool every_other(Index crossing) { return (crossing * 0x9e3779b9U) >> 31 != 0; }

  /// Shells up to where something is near some crossing of the group.
  static std::size_t shell_of(double distance) {
    return truncated<std::size_t>(distance / (radii.back() + reach_of_group) * shells);
  }

  /// Takes the rows [begin, end) of what is around the group to the plane at a crossing, and what belongs to the last
  /// lanes with them. @return one past the last one
  std::size_t place_around(const Site& site, const Vec3& off_leader, std::size_t begin, std::size_t end) {
    const Vec3 along = site.normal.unitOrthogonal();
    const SeveralPoints u = all(along);
    const SeveralPoints w = all(site.normal.cross(along));
    const SeveralPoints n = all(site.normal);
    const SeveralPoints origin = all(off_leader);
    flat_.resize(around_.size(), worth);
    std::size_t row = begin;
    for (; row < end; row += several) {
      SeveralPoints off = around_.get_point(place, row);
      SeveralPoints middle = around_.get_point(between, row);
      for (std::size_t i = 0; i < 3; ++i) {
        off[i] -= origin[i];
        middle[i] -= origin[i];
      }
      const Several cosine = dot(around_.get_point(normal, row), n);
      Several value = around_.get(weight, row) * cosine;
      where(cosine < static_cast<float>(least_cosine), value) = 0;
      flat_.set(along_u, row, dot(middle, u));
      flat_.set(along_w, row, dot(middle, w));
      flat_.set(up, row, dot(middle, n));
      flat_.set(squared_distance, row, dot(off, off));
      flat_.set(worth, row, value);
    }
    return row;
  }

  [[nodiscard]] Several kernel(std::size_t row, double radius) const {
    const Several near =
        simd::max(1 - flat_.get(squared_distance, row) * static_cast<float>(1 / (radius * radius)), Several(0.0F));
    return near * near * near * flat_.get(worth, row);
  }

  /// The quadric 1, u, w, u^2, u w, w^2, in units of the radius, through the first rows.
  Quadric fit(std::size_t rows, double radius) {
    const auto scale = static_cast<float>(1 / radius);
    std::array<Several, 15> moment{};
    std::array<Several, 6> right{};
    for (std::size_t row = 0; row < rows; row += several) {
      const Several u = scale * flat_.get(along_u, row);
      const Several w = scale * flat_.get(along_w, row);
      const Several k = kernel(row, radius);
      const Several h = k * flat_.get(up, row);
      const std::array<Several, 3> square{u * u, u * w, w * w};
      const std::array<Several, 6> low{k, k * u, k * w, k * square[0], k * square[1], k * square[2]};
      for (std::size_t m = 0; m < 6; ++m) {
        moment[m] += low[m];
      }
      moment[6] += low[3] * u;
      moment[7] += low[3] * w;
      moment[8] += low[5] * u;
      moment[9] += low[5] * w;
      for (std::size_t m = 0; m < 3; ++m) {
        moment[10 + m] += low[3] * square[m];
      }
      moment[13] += low[5] * square[1];
      moment[14] += low[5] * square[2];
      right[0] += h;
      right[1] += h * u;
      right[2] += h * w;
      for (std::size_t m = 0; m < 3; ++m) {
        right[3 + m] += h * square[m];
      }
    }
    std::array<double, 15> s{};
    std::ranges::transform(moment, s.begin(), total);
    Eigen::Matrix<double, 6, 6> matrix;
    matrix << s[0], s[1], s[2], s[3], s[4], s[5],  //
        s[1], s[3], s[4], s[6], s[7], s[8],        //
        s[2], s[4], s[5], s[7], s[8], s[9],        //
        s[3], s[6], s[7], s[10], s[11], s[12],     //
        s[4], s[7], s[8], s[11], s[12], s[13],     //
        s[5], s[8], s[9], s[12], s[13], s[14];
    // Where few crossings are around, or all in a line, the quadric is the flattest.
    matrix.diagonal().segment<2>(1).array() += 1e-6 * s[0];
    matrix.diagonal().tail<3>().array() += 1e-4 * s[0];
    Quadric sums;
    std::ranges::transform(right, sums.data(), total);
    weights_ = s[0];
    return matrix.llt().solve(sums);
  }

  /// By how much the quadric that was fitted last misses the edges: weighted mean square, in variances of their
  /// middles.
  [[nodiscard]] double missed(const Quadric& quadric, std::size_t rows, double radius) const {
    const auto scale = static_cast<float>(1 / radius);
    const Eigen::Matrix<float, 6, 1> q = quadric.cast<float>();
    Several sum = 0;
    for (std::size_t row = 0; row < rows; row += several) {
      const Several u = scale * flat_.get(along_u, row);
      const Several w = scale * flat_.get(along_w, row);
      const Several surface = q[0] + u * (q[1] + q[3] * u + q[4] * w) + w * (q[2] + q[5] * w);
      const Several away = simd::abs(flat_.get(up, row) - surface) - around_.get(half, row);
      const Several beyond = simd::max(away, Several(0.0F));
      sum += kernel(row, radius) * around_.get(weight, row) * beyond * beyond;
    }
    return total(sum) / weights_;
  }

  const std::vector<Site>& sites_;
  const VertexNeighbours& neighbours_;
  std::vector<Index> seen_;  ///< for each crossing, around which leader it was come to last
  std::vector<Found> found_;
  std::array<std::size_t, shells> shell_end_{};  ///< rows before the end of each shell
  Table<11> around_;                             ///< what was found, shell by shell
  Table<5> flat_;
  double weights_ = 0;
};

std::vector<Site> make_sites(const std::vector<EdgeCrossing>& crossings, double voxel) {
  constexpr double least_variance = least_deviation * least_deviation;
  std::vector<Site> sites(crossings.size());
  std::ranges::transform(crossings, sites.begin(), [&](const EdgeCrossing& crossing) {
    const double half = std::abs(crossing.half.dot(crossing.normal)) / voxel;
    return Site{crossing.place / voxel, crossing.normal, crossing.middle / voxel, half,
                1 / (half * half / 3 + least_variance)};
  });
  return sites;
}

}  // namespace

std::vector<double> local_quadric_offsets(const std::vector<EdgeCrossing>& crossings,
                                          const VertexNeighbours& neighbours, const std::vector<bool>& skip,
                                          double voxel) {
  constexpr std::size_t grain = 64;
  const std::vector<Site> sites = make_sites(crossings, voxel);
  const Groups groups = make_groups(sites, neighbours);
  const std::size_t size = groups.first.size() - 1;
  std::vector<double> offsets(sites.size(), 0.0);
  const std::size_t blocks = (size + grain - 1) / grain;
  std::atomic<std::size_t> next = 0;
  parallel_for_blocks(std::min(blocks, thread_count()), 1, [&](std::size_t, std::size_t) {
    Fitter fitter(sites, neighbours);
    for (std::size_t block = next++; block < blocks; block = next++) {
      check_interrupt();
      for (std::size_t group = block * grain; group < std::min(size, (block + 1) * grain); ++group) {
        const Index leader = groups.members[groups.first[group]];
        fitter.gather(leader);
        for (std::size_t at = groups.first[group]; at < groups.first[group + 1]; ++at) {
          const Index crossing = groups.members[at];
          offsets[crossing] = skip[crossing] ? 0 : voxel * fitter.offset(crossing, leader);
        }
      }
    }
  });
  return offsets;
}

}  // namespace tunica
