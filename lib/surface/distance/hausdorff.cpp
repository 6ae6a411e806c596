#include "tunica/surface/distance/hausdorff.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/cover_bound.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

struct Farthest {
  double distance = 0;
  Vec3 from = Vec3::Zero();
  Vec3 to = Vec3::Zero();
};

// A part of a triangle of A that is not settled yet.
struct Piece {
  std::array<Vec3, 3> corner;
  std::array<double, 3> distance;  // of each corner to B
  std::array<Index, 3> nearest;    // triangle of B that is closest to each corner
  int cuts = 0;
  double upper = 0;  // no point of the piece is farther from B
};

// Where on the segment p-q the triangles s (closest to p) and t (closest to q) of B are equally far; none when an end
// is a tie already.
std::optional<double> tie(const ClosestPoint& b, const Vec3& p, const Vec3& q, Index s, Index t, double precision) {
  const auto difference = [&](double along) {
    const Vec3 x = p + along * (q - p);
    return std::sqrt(b.squared_distance_to(x, s)) - std::sqrt(b.squared_distance_to(x, t));
  };
  double left = 0;
  double right = 1;
  double at_left = difference(left);
  double at_right = difference(right);
  const double noise = std::max(precision, 1e-12 * (q - p).norm());
  if (!(at_left < -noise) || !(at_right > noise)) {
    return std::nullopt;
  }
  // Illinois variant of the secant rule: the bracket stays.
  double middle = 0.5;
  int side = 0;
  for (int i = 0; i < 24 && right - left > 1e-12; ++i) {
    middle = (left * at_right - right * at_left) / (at_right - at_left);
    const double value = difference(middle);
    if (std::abs(value) <= noise) {
      break;
    }
    if (value > 0) {
      right = middle;
      at_right = value;
      at_left *= side == 1 ? 0.5 : 1;
      side = 1;
    } else {
      left = middle;
      at_left = value;
      at_right *= side == -1 ? 0.5 : 1;
      side = -1;
    }
  }
  return middle > 1e-6 && middle < 1 - 1e-6 ? std::optional(middle) : std::nullopt;
}

// The largest distance from a point of A to B.
class OneSided {
public:
  OneSided(const ClosestPoint& a, const ClosestPoint& b, const HausdorffOptions& options)
      : a_(a), b_(b), options_(options), cover_(b) {
    // With the largest reach, so that it can be added to every bound: a thousandth of the width at most in practice.
    double reach = 0;
    const Box box_a = bounding_box({a.vertices(), a.triangles()});
    const Box box_b = bounding_box({b.vertices(), b.triangles()});
    reach = (box_a.upper.cwiseMax(box_b.upper) - box_a.lower.cwiseMin(box_b.lower)).norm();
    const double coordinate = box_a.lower.cwiseAbs().cwiseMax(box_a.upper.cwiseAbs()).maxCoeff();
    rounding_ = b.rounding(reach) + 64 * epsilon * coordinate;
  }

  // Mean and root mean square from systematic samples over the area; they also raise the lower bound.
  std::pair<double, double> sample(std::size_t count) {
    const auto& order = a_.spatial_order();
    std::vector<double> cumulative(order.size() + 1, 0);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto [p, q, r] = a_.corners(order[i]);
      cumulative[i + 1] = cumulative[i] + triangle_area(p, q, r);
    }
    const double step = cumulative.back() / real(count);
    if (!(step > 0)) {
      constexpr double undefined = std::numeric_limits<double>::quiet_NaN();
      return {undefined, undefined};
    }
    struct Sum {
      double distance = 0, squared_distance = 0;
      Farthest farthest;
    };
    std::vector<Sum> sums((count + grain - 1) / grain);
    parallel_for_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      Sum& sum = sums[begin / grain];
      std::optional<Index> guess;
      auto it = cumulative.begin() + 1;
      for (std::size_t k = begin; k < end; ++k) {
        const double at = (real(k) + 0.5) * step;
        it = k == begin ? std::upper_bound(it, cumulative.end(), at)
                        : std::find_if(it, cumulative.end(), [&](double c) { return c > at; });
        const auto i = narrow<std::size_t>(std::min(it, cumulative.end() - 1) - cumulative.begin()) - 1;
        const Vec3 x = point_in(order[i], k);
        const auto hit = guess ? b_.closest(x, *guess) : b_.closest(x);
        guess = hit.triangle;
        const double distance = std::sqrt(hit.squared_distance);
        sum.distance += distance;
        sum.squared_distance += hit.squared_distance;
        if (distance > sum.farthest.distance) {
          sum.farthest = {distance, x, hit.point};
        }
      }
    });
    Sum total;
    for (const Sum& sum : sums) {
      total.distance += sum.distance;
      total.squared_distance += sum.squared_distance;
      raise(sum.farthest);
    }
    const auto n = real(count);
    return {total.distance / n, std::sqrt(total.squared_distance / n)};
  }

  Interval run(const Progress& progress) {
    seed();
    std::vector<Piece> live = first_round();
    advance(progress, 0.5);
    std::size_t splits = 0;
    while (!live.empty() && splits < options_.max_splits && !decided_above()) {
      const std::vector<Piece> chosen = take_worst(live);
      refine(chosen, live, splits);
      check_interrupt();
    }
    for (const Piece& piece : live) {
      settled_ = std::max(settled_, piece.upper);
    }
    advance(progress, 1.0);
    return {std::max(0.0, farthest_.distance - uncertainty()), std::max(settled_, farthest_.distance) + uncertainty()};
  }

  [[nodiscard]] const Farthest& farthest() const { return farthest_; }

private:
  static constexpr std::size_t grain = 2048;

  struct Block {
    Farthest farthest;
    double settled = 0;
    std::size_t splits = 0;
    std::vector<Piece> live;
    CoverBound::Visited visited;
  };

  void raise(const Farthest& found) {
    if (found.distance > farthest_.distance) {
      farthest_ = found;
    }
  }

  [[nodiscard]] bool decided_above() const {
    return options_.limit && farthest_.distance - uncertainty() > *options_.limit;
  }

  // Pieces whose upper bound is at most this need no further work.
  [[nodiscard]] double stop_at(double lower) const {
    const double wanted = lower + options_.width;
    return options_.limit ? std::max(wanted, *options_.limit - uncertainty()) : wanted;
  }

  [[nodiscard]] double uncertainty() const { return rounding_ + options_.deviation_a + options_.deviation_b; }

  // A point of the triangle, from the k-th element of the R2 sequence (Roberts 2018) folded into the triangle.
  [[nodiscard]] Vec3 point_in(Index triangle, std::size_t k) const {
    const auto index = real(k);
    double u = std::fmod(0.5 + index * 0.7548776662466927, 1.0);
    double v = std::fmod(0.5 + index * 0.5698402909980532, 1.0);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const auto [p, q, r] = a_.corners(triangle);
    return p + u * (q - p) + v * (r - p);
  }

  // A first lower bound from a few triangles all over A.
  void seed() {
    const auto& order = a_.spatial_order();
    const std::size_t stride = order.size() / 2048 + 1;
    for (std::size_t i = 0; i < order.size(); i += stride) {
      const Vec3 x = a_.corners(order[i])[0];
      const auto hit = b_.closest(x);
      raise({std::sqrt(hit.squared_distance), x, hit.point});
    }
  }

  // Looks at the corner i of a piece.
  void query(Piece& piece, std::size_t i, std::optional<Index> guess, Block& block) const {
    const auto hit = guess ? b_.closest(piece.corner[i], *guess) : b_.closest(piece.corner[i]);
    piece.distance[i] = std::sqrt(hit.squared_distance);
    piece.nearest[i] = hit.triangle;
    if (piece.distance[i] > block.farthest.distance) {
      block.farthest = {piece.distance[i], piece.corner[i], hit.point};
    }
  }

  void bound(Piece& piece, Block& block) const {
    double squared = infinity;
    for (std::size_t i = 0; i < 3; ++i) {
      if (std::find(piece.nearest.begin(), piece.nearest.begin() + i, piece.nearest[i]) == piece.nearest.begin() + i) {
        squared = std::min(squared, b_.max_squared_distance_to(piece.corner, piece.nearest[i]));
      }
    }
    piece.upper = std::min(piece.upper, std::sqrt(squared));
    const double wanted = stop_at(block.farthest.distance);
    for (std::size_t i = 0; i < 3 && piece.upper > wanted; ++i) {
      if (i == 0 || (piece.nearest[i] != piece.nearest[i - 1] && piece.nearest[i] != piece.nearest[0])) {
        piece.upper = std::min(piece.upper, cover_(piece.corner, piece.nearest[i], wanted, block.visited));
      }
    }
  }

  // Keeps a piece, or settles it.
  void file(const Piece& piece, Block& block) const {
    if (piece.upper <= stop_at(block.farthest.distance)) {
      block.settled = std::max(block.settled, piece.upper);
    } else {
      block.live.push_back(piece);
    }
  }

  std::vector<Piece> first_round() {
    const auto& order = a_.spatial_order();
    std::vector<Block> blocks((order.size() + grain - 1) / grain);
    parallel_for_blocks(order.size(), grain, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      Block& block = blocks[begin / grain];
      block.farthest = farthest_;
      std::optional<Index> guess;
      for (std::size_t i = begin; i < end; ++i) {
        Piece piece;
        piece.corner = a_.corners(order[i]);
        piece.upper = infinity;
        if (guess) {
          // The triangle of B that was closest to the neighbour often settles this one too.
          const double upper = std::sqrt(b_.max_squared_distance_to(piece.corner, *guess));
          if (upper <= stop_at(block.farthest.distance)) {
            block.settled = std::max(block.settled, upper);
            continue;
          }
        }
        for (std::size_t corner = 0; corner < 3; ++corner) {
          query(piece, corner, guess, block);
          guess = piece.nearest[corner];
        }
        bound(piece, block);
        file(piece, block);
      }
    });
    std::vector<Piece> live;
    collect(blocks, live);
    return live;
  }

  void collect(const std::vector<Block>& blocks, std::vector<Piece>& live) {
    for (const Block& block : blocks) {
      raise(block.farthest);
      settled_ = std::max(settled_, block.settled);
    }
    for (const Block& block : blocks) {
      for (const Piece& piece : block.live) {
        if (piece.upper <= stop_at(farthest_.distance)) {
          settled_ = std::max(settled_, piece.upper);
        } else {
          live.push_back(piece);
        }
      }
    }
  }

  // Takes the pieces with the largest upper bounds out of `live`: a quarter of them, at least two thousand.
  [[nodiscard]] std::vector<Piece> take_worst(std::vector<Piece>& live) const {
    const std::size_t count = std::min(live.size(), std::max<std::size_t>(grain, live.size() / 4));
    std::nth_element(live.begin(), live.end() - count, live.end(),
                     [](const Piece& l, const Piece& r) { return l.upper < r.upper; });
    std::vector<Piece> chosen(live.end() - count, live.end());
    live.resize(live.size() - count);
    return chosen;
  }

  void refine(const std::vector<Piece>& chosen, std::vector<Piece>& live, std::size_t& splits) {
    constexpr std::size_t chosen_grain = 256;
    std::vector<Block> blocks((chosen.size() + chosen_grain - 1) / chosen_grain);
    parallel_for_blocks(chosen.size(), chosen_grain, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      Block& block = blocks[begin / chosen_grain];
      block.farthest = farthest_;
      for (std::size_t i = begin; i < end; ++i) {
        split(chosen[i], 3, block);
      }
    });
    for (const Block& block : blocks) {
      splits += block.splits;
    }
    collect(blocks, live);
  }

  void split(const Piece& piece, int levels, Block& block) const {
    if (levels == 0 || piece.upper <= stop_at(block.farthest.distance)) {
      file(piece, block);
      return;
    }
    const auto [edge, along] = choose_cut(piece);
    const std::size_t i = edge;
    const std::size_t j = (edge + 1) % 3;
    ++block.splits;
    Piece one = piece;
    one.cuts = piece.cuts + 1;
    one.corner[j] = piece.corner[i] + along * (piece.corner[j] - piece.corner[i]);
    query(one, j, along < 0.5 ? piece.nearest[i] : piece.nearest[j], block);
    Piece other = piece;
    other.cuts = one.cuts;
    other.corner[i] = one.corner[j];
    other.distance[i] = one.distance[j];
    other.nearest[i] = one.nearest[j];
    bound(one, block);
    bound(other, block);
    split(one, levels - 1, block);
    split(other, levels - 1, block);
  }

  // The edge to cut and where. At a tie of neighbouring triangles of B, so that each side then has one closest triangle
  // and is settled: coincident surfaces with other triangles take few cuts. Across a bend of B first, for on either
  // side of it many nearly flat triangles are settled together; and where the two do not touch, in half, for a tie
  // within what is flat would leave slivers that all reach over the bend. Every fourth time the longest edge in half,
  // so that pieces always shrink.
  [[nodiscard]] std::pair<std::size_t, double> choose_cut(const Piece& piece) const {
    std::array<double, 3> squared_length;
    for (std::size_t k = 0; k < 3; ++k) {
      squared_length[k] = (piece.corner[(k + 1) % 3] - piece.corner[k]).squaredNorm();
    }
    std::array<std::size_t, 3> order{0, 1, 2};
    std::sort(order.begin(), order.end(),
              [&](std::size_t l, std::size_t r) { return squared_length[l] > squared_length[r]; });
    if (piece.cuts % 4 == 3 || (piece.nearest[0] == piece.nearest[1] && piece.nearest[1] == piece.nearest[2])) {
      return {order[0], 0.5};
    }
    const std::size_t longest = order[0];
    const std::array<double, 3> bend = bends(piece);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t l, std::size_t r) { return bend[l] > bend[r]; });
    for (const std::size_t k : order) {
      const Index s = piece.nearest[k];
      const Index t = piece.nearest[(k + 1) % 3];
      if (s != t && touch(s, t)) {
        if (const auto along = tie(b_, piece.corner[k], piece.corner[(k + 1) % 3], s, t, 0.05 * options_.width)) {
          return {k, *along};
        }
      }
      if (bend[k] > 0) {
        return {k, 0.5};
      }
    }
    return {longest, 0.5};
  }

  // How much the triangles closest to the ends of each edge are turned from each other: one less the cosine, zero where
  // that is little.
  [[nodiscard]] std::array<double, 3> bends(const Piece& piece) const {
    constexpr double little = 0.1;
    std::array<Vec3, 3> normal;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [p, q, r] = b_.corners(piece.nearest[k]);
      normal[k] = (q - p).cross(r - p).normalized();
    }
    std::array<double, 3> bend;
    for (std::size_t k = 0; k < 3; ++k) {
      const double turned = 1 - normal[k].dot(normal[(k + 1) % 3]);
      bend[k] = turned > little ? turned : 0;
    }
    return bend;
  }

  [[nodiscard]] bool touch(Index s, Index t) const {
    const auto& one = b_.triangles()[s];
    const auto& other = b_.triangles()[t];
    return std::any_of(one.begin(), one.end(),
                       [&](Index v) { return std::find(other.begin(), other.end(), v) != other.end(); });
  }

  const ClosestPoint& a_;
  const ClosestPoint& b_;
  const HausdorffOptions& options_;
  CoverBound cover_;
  double rounding_ = 0;
  Farthest farthest_;
  double settled_ = 0;  // upper bound of all pieces that are settled
};

}  // namespace

HausdorffResult hausdorff(const ClosestPoint& a, const ClosestPoint& b, const HausdorffOptions& options) {
  require_not_negative(options.width, "the width of the interval");
  require_not_negative(options.deviation_a, "the deviation of the first surface");
  require_not_negative(options.deviation_b, "the deviation of the second surface");
  if (options.limit) {
    require_not_negative(*options.limit, "the limit of the distance");
  }
  HausdorffResult result;
  const auto half = [&](double offset) -> Progress {
    if (!options.progress) {
      return {};
    }
    return [&, offset](double fraction) { options.progress(offset + 0.5 * fraction); };
  };
  OneSided a_to_b(a, b, options);
  result.mean = result.rms = std::numeric_limits<double>::quiet_NaN();
  if (options.samples > 0) {
    std::tie(result.mean, result.rms) = a_to_b.sample(options.samples);
  }
  result.a_to_b = a_to_b.run(half(0));
  OneSided b_to_a(b, a, options);
  result.b_to_a = b_to_a.run(half(0.5));
  result.both = {std::max(result.a_to_b.lower, result.b_to_a.lower),
                 std::max(result.a_to_b.upper, result.b_to_a.upper)};
  const bool a_is_farther = a_to_b.farthest().distance >= b_to_a.farthest().distance;
  result.worst_a = a_is_farther ? a_to_b.farthest().from : b_to_a.farthest().to;
  result.worst_b = a_is_farther ? a_to_b.farthest().to : b_to_a.farthest().from;
  return result;
}

HausdorffResult hausdorff(const TriangleMesh& a, const TriangleMesh& b, const HausdorffOptions& options) {
  std::optional<ClosestPoint> tree_a, tree_b;
  parallel_for_blocks(
      2, 1, [&](std::size_t which, std::size_t) { (which == 0 ? tree_a : tree_b).emplace(which == 0 ? a : b); });
  return hausdorff(*tree_a, *tree_b, options);
}

std::vector<double> vertex_distances(const TriangleMesh& mesh, const ClosestPoint& surface) {
  std::vector<double> distances(mesh.vertices.size());
  parallel_for_blocks(mesh.vertices.size(), 1024, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    std::optional<Index> guess;
    for (std::size_t v = begin; v < end; ++v) {
      const auto hit = guess ? surface.closest(mesh.vertices[v], *guess) : surface.closest(mesh.vertices[v]);
      guess = hit.triangle;
      distances[v] = std::sqrt(hit.squared_distance);
    }
  });
  return distances;
}

}  // namespace tunica
