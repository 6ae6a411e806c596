// Branch and bound: an upper bound of the distance over a piece is kept or the piece is cut; points give lower bounds.
#include "shell/curved_hausdorff.hpp"

#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "shell/fit_samples.hpp"
#include "shell/flat_pieces.hpp"
#include "surface/closest_point.hpp"
#include "surface/cover_bound.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t grain = 256;
constexpr std::size_t most_pieces = 2'000'000;
constexpr double bulge_share = 0.25;  // of the distance that settles a piece: what the first cut leaves to bulges
constexpr int most_level = 24;        // pieces per edge of the first cut
constexpr int most_rounds = 3;
constexpr double joined_share = 0.6;  // of the distance that settles a piece: wider gaps stay open
constexpr std::size_t mean_samples = 60'000;
constexpr std::size_t sharp_points = 200;           // whose distance to the shell is found exactly
constexpr int sharpest_level = 96;                  // pieces per edge there
constexpr std::size_t most_box_tests = 40'000'000;  // beyond that all patches are kept

double rounding_of(const ShellMesh& shell, const Target& target) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  const Box a = bounding_box(flat_facets(shell)), b = bounding_box(target.mesh());
  // Patches leave the box of their nodes by less than its diagonal.
  const double reach = 2 * (a.upper.cwiseMax(b.upper) - a.lower.cwiseMin(b.lower)).norm();
  const double coordinate =
      std::max(a.lower.cwiseAbs().cwiseMax(a.upper.cwiseAbs()).maxCoeff(), b.upper.cwiseAbs().maxCoeff());
  return target.tree().rounding(reach) + 256 * epsilon * (coordinate + reach);
}

/// What both directions share: when a piece is settled.
struct Aim {
  double width;                 // mm
  std::optional<double> limit;  // mm
  double uncertainty;           // mm

  [[nodiscard]] double enough(double lower) const {
    return limit ? std::max(lower + width, *limit - uncertainty) : lower + width;
  }
  [[nodiscard]] bool decided_above(double lower) const { return limit && lower - uncertainty > *limit; }
};

/// A triangle in space with what is closest to its corners.
struct Corners {
  std::array<Vec3, 3> point;
  std::array<double, 3> distance;
  std::array<Index, 3> nearest;
};

/// Largest distance of a flat triangle from a surface; infinite when nothing at most `enough` can be shown.
/// @param used  for a bound by cover: what was visited; empty for one by a single triangle
/// @param single  the triangle that bounds it alone
double flat_bound(const ClosestPoint& tree, const CoverBound& cover, const Corners& c, double enough,
                  CoverBound::Visited& visited, std::optional<Index>& single) {
  double best = infinity;
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (c.nearest[i] == c.nearest[0] || (i == 2 && c.nearest[2] == c.nearest[1]))) {
      continue;
    }
    const double bound = std::sqrt(tree.max_squared_distance_to(c.point, c.nearest[i]));
    if (bound < best) {
      best = bound;
      single = c.nearest[i];
    }
  }
  if (best <= enough) {
    return best;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (c.nearest[i] == c.nearest[0] || (i == 2 && c.nearest[2] == c.nearest[1]))) {
      continue;
    }
    const double bound = cover(c.point, c.nearest[i], enough, visited);
    if (bound <= enough) {
      single.reset();
      return bound;
    }
  }
  return best;
}

void look(const ClosestPoint& tree, Corners& c, std::size_t i, std::optional<Index> guess) {
  const auto hit = guess ? tree.closest(c.point[i], *guess) : tree.closest(c.point[i]);
  c.distance[i] = std::sqrt(hit.squared_distance);
  c.nearest[i] = hit.triangle;
}

/// From the curved surface to the target.
class FromShell {
public:
  FromShell(const std::vector<CubicPatch>& patches, const Target& target, const Aim& aim)
      : patches_(patches), tree_(target.tree()), cover_(target.tree()), aim_(aim) {}

  Interval run() {
    std::vector<Piece> live = first_pieces();
    std::size_t cuts = 0;
    while (!live.empty() && cuts + live.size() < most_pieces && !aim_.decided_above(lower_)) {
      check_interrupt();
      cuts += live.size();
      live = refined(live);
    }
    for (const Piece& piece : live) {
      settled_ = std::max(settled_, piece.upper);
    }
    return {std::max(0.0, lower_ - aim_.uncertainty), std::max(lower_, settled_) + aim_.uncertainty};
  }

private:
  struct Piece {
    Index patch;
    int cuts;  // halvings of the first cut
    int level;
    std::array<Vec2, 3> at;
    Corners corners;
    double upper;
  };
  struct Block {
    double lower = 0, settled = 0;
    std::vector<Piece> live;
    CoverBound::Visited visited;
  };

  /// Every patch cut so that its pieces bulge little against the distances that its corners and middles have.
  std::vector<Piece> first_pieces() {
    std::vector<double> lowest((patches_.size() + grain - 1) / grain, 0);
    parallel_for_blocks(patches_.size(), grain, [&](std::size_t begin, std::size_t end) {
      std::optional<Index> guess;
      for (std::size_t t = begin; t < end; ++t) {
        for (const Vec2& b : {Vec2(1.0 / 3, 1.0 / 3), Vec2(0.5, 0), Vec2(0, 0.5), Vec2(0.5, 0.5)}) {
          const Vec3 p = patches_[t].point(b);
          const auto hit = guess ? tree_.closest(p, *guess) : tree_.closest(p);
          guess = hit.triangle;
          lowest[begin / grain] = std::max(lowest[begin / grain], std::sqrt(hit.squared_distance));
        }
      }
    });
    lower_ = lowest.empty() ? 0 : *std::max_element(lowest.begin(), lowest.end());
    const double bulge = bulge_share * aim_.enough(lower_);
    std::vector<Block> blocks((patches_.size() + grain - 1) / grain);
    parallel_for_blocks(patches_.size(), grain, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      for (std::size_t t = begin; t < end; ++t) {
        cut_first(static_cast<Index>(t), bulge, blocks[begin / grain]);
      }
    });
    return collected(blocks);
  }

  void cut_first(Index t, double bulge, Block& block) const {
    const double wanted = std::ceil(std::sqrt(flatness(patches_[t], 1) / bulge));
    const int m = static_cast<int>(std::clamp(wanted, 2.0, static_cast<double>(most_level)));
    struct Point {
      Vec3 at;
      double distance;
      Index nearest;
    };
    std::vector<Point> points;
    std::optional<Index> guess;
    for (int r = 0; r <= m; ++r) {
      for (int c = 0; c <= m - r; ++c) {
        const Vec3 p = patches_[t].point(Vec2(static_cast<double>(c) / m, static_cast<double>(r) / m));
        const auto hit = guess ? tree_.closest(p, *guess) : tree_.closest(p);
        guess = hit.triangle;
        points.push_back({p, std::sqrt(hit.squared_distance), hit.triangle});
        block.lower = std::max(block.lower, points.back().distance);
      }
    }
    const auto add = [&](std::array<std::array<int, 2>, 3> corners) {
      Piece piece{t, 0, m, {}, {}, infinity};
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [c, r] = corners[i];
        const Point& p = points[static_cast<std::size_t>(r * (2 * m + 3 - r) / 2 + c)];
        piece.at[i] = Vec2(static_cast<double>(c) / m, static_cast<double>(r) / m);
        piece.corners.point[i] = p.at;
        piece.corners.distance[i] = p.distance;
        piece.corners.nearest[i] = p.nearest;
      }
      bound(piece, block);
    };
    for (int r = 0; r < m; ++r) {
      for (int c = 0; c < m - r; ++c) {
        add({{{c, r}, {c + 1, r}, {c, r + 1}}});
        if (c + 1 < m - r) {
          add({{{c + 1, r}, {c + 1, r + 1}, {c, r + 1}}});
        }
      }
    }
  }

  /// Settles the piece or keeps it.
  void bound(Piece& piece, Block& block) const {
    const double enough = aim_.enough(std::max(lower_, block.lower));
    const double bulge = flatness(patches_[piece.patch], piece.level) / std::pow(4.0, piece.cuts);
    std::optional<Index> single;
    const double flat = flat_bound(tree_, cover_, piece.corners, std::max(enough - bulge, 0.0), block.visited, single);
    piece.upper = std::min(piece.upper, flat + bulge);
    if (piece.upper <= enough) {
      block.settled = std::max(block.settled, piece.upper);
    } else {
      block.live.push_back(piece);
    }
  }

  std::vector<Piece> collected(const std::vector<Block>& blocks) {
    for (const Block& block : blocks) {
      lower_ = std::max(lower_, block.lower);
      settled_ = std::max(settled_, block.settled);
    }
    const double enough = aim_.enough(lower_);
    std::vector<Piece> live;
    for (const Block& block : blocks) {
      for (const Piece& piece : block.live) {
        if (piece.upper <= enough) {
          settled_ = std::max(settled_, piece.upper);
        } else {
          live.push_back(piece);
        }
      }
    }
    return live;
  }

  std::vector<Piece> refined(const std::vector<Piece>& pieces) {
    std::vector<Block> blocks((pieces.size() + grain - 1) / grain);
    parallel_for_blocks(pieces.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        cut(pieces[i], blocks[begin / grain]);
      }
    });
    return collected(blocks);
  }

  void cut(const Piece& piece, Block& block) const {
    Piece middle = piece;
    ++middle.cuts;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3;
      middle.at[i] = (piece.at[i] + piece.at[j]) / 2;
      middle.corners.point[i] = patches_[piece.patch].point(middle.at[i]);
      look(tree_, middle.corners, i, piece.corners.nearest[i]);
      block.lower = std::max(block.lower, middle.corners.distance[i]);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      Piece corner = piece;
      ++corner.cuts;
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      for (const auto& [to, from] :
           {std::pair(j, i), std::pair(k, k)}) {  // middle i is between i and j, k between k and i
        corner.at[to] = middle.at[from];
        corner.corners.point[to] = middle.corners.point[from];
        corner.corners.distance[to] = middle.corners.distance[from];
        corner.corners.nearest[to] = middle.corners.nearest[from];
      }
      bound(corner, block);
    }
    bound(middle, block);
  }

  const std::vector<CubicPatch>& patches_;
  const ClosestPoint& tree_;
  CoverBound cover_;
  Aim aim_;
  double lower_ = 0, settled_ = 0;
};

/// From the target to the curved surface.
class FromTarget {
public:
  FromTarget(const ShellMesh& shell, const std::vector<CubicPatch>& patches, const Target& target, const Aim& aim)
      : shell_(shell), patches_(patches), target_(target), aim_(aim) {
    const TriangleMesh flat = flat_facets(shell);
    across_ = neighbours(flat, incidence(flat));
    for (const CubicPatch& patch : patches) {
      Box& box = boxes_.emplace_back(Box{patch.control[0], patch.control[0]});
      for (const Vec3& p : patch.control) {
        box.lower = box.lower.cwiseMin(p);
        box.upper = box.upper.cwiseMax(p);
      }
      flatness_.push_back(flatness(patch, 1));
    }
  }

  /// @param expected  mm: roughly what the distance is
  Interval run(double expected) {
    std::vector<Index> chosen(patches_.size());
    for (std::size_t t = 0; t < chosen.size(); ++t) {
      chosen[t] = static_cast<Index>(t);
    }
    // Nine patches of ten are flat enough at the first level.
    std::vector<double> sorted = flatness_;
    const auto ninth = sorted.begin() + static_cast<std::ptrdiff_t>(9 * (sorted.size() - 1) / 10);
    std::nth_element(sorted.begin(), ninth, sorted.end());
    expected_ = expected;
    const double share = bulge_share * aim_.enough(expected);
    int level = static_cast<int>(std::clamp(std::ceil(std::sqrt(*ninth / share)), 1.0, 12.0));
    std::vector<Piece> live =
        first_round(flat_pieces(shell_, patches_, across_, chosen, level, joined_gap(), true), level);
    for (int round = 0; round < most_rounds && !live.empty() && !aim_.decided_above(lower_); ++round) {
      check_interrupt();
      chosen = near(live);
      // An eighth of what lies between the bound and what it has to be below.
      const double slack = aim_.enough(lower_) - lower_;
      const int finest =
          static_cast<int>(std::clamp(std::ceil(std::sqrt(8 * worst_flatness(chosen) / slack)), 1.0, 200.0));
      const bool last = 3 * level >= finest || round + 1 == most_rounds;
      level = last ? finest : 3 * level;
      while (level > 1 && static_cast<double>(level) * level * static_cast<double>(chosen.size()) > most_pieces) {
        --level;
      }
      live = next_round(flat_pieces(shell_, patches_, across_, chosen, level, joined_gap(), !last), live, last);
      if (last) {
        break;
      }
    }
    for (const Piece& piece : live) {
      settled_ = std::max(settled_, piece.upper);
    }
    return {std::max(0.0, lower_ - aim_.uncertainty), std::max(lower_, settled_) + aim_.uncertainty};
  }

  /// Where the distance is at least the lower bound, but for rounding.
  [[nodiscard]] const Vec3& farthest() const { return farthest_; }

private:
  struct Piece {
    Corners corners;
    double upper;
  };
  struct Block {
    double lower = 0, settled = 0;
    Vec3 farthest = Vec3::Zero();  // the point that `lower` is of
    std::vector<Piece> live;
    std::vector<std::pair<double, Vec3>> far;  // minus about a corner's distance, the corner
    CoverBound::Visited visited;
  };

  /// Distance of a point to a patch and those beside it, not below the true one of the whole surface.
  [[nodiscard]] double close_distance(const Vec3& p, Index patch) const {
    double squared = foot_on_patch(patches_[patch], p).squared_distance;
    for (const Index other : across_[patch]) {
      if (other != no_neighbour) {
        squared = std::min(squared, foot_on_patch(patches_[other], p).squared_distance);
      }
    }
    return std::sqrt(squared);
  }

  /// Distance of a point to the curved surface, certainly not above the true one.
  [[nodiscard]] double sharp_lower(const Vec3& p, double upper) const {
    double least = upper;
    for (std::size_t t = 0; t < patches_.size(); ++t) {
      const Vec3 outside = (boxes_[t].lower - p).cwiseMax(p - boxes_[t].upper).cwiseMax(0);
      if (outside.norm() >= least) {
        continue;
      }
      const int level = static_cast<int>(
          std::clamp(std::ceil(std::sqrt(16 * flatness_[t] / aim_.width)), 1.0, static_cast<double>(sharpest_level)));
      const double off = flatness(patches_[t], level);
      const auto point = [&](int c, int r) {
        return patches_[t].point(Vec2(static_cast<double>(c) / level, static_cast<double>(r) / level));
      };
      const auto consider = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
        least = std::min(least, (closest_point_on_triangle(p, a, b, c) - p).norm() - off);
      };
      for (int r = 0; r < level; ++r) {
        for (int c = 0; c < level - r; ++c) {
          const Vec3 right = point(c + 1, r), above = point(c, r + 1);
          consider(point(c, r), right, above);
          if (c + 1 < level - r) {
            consider(right, point(c + 1, r + 1), above);
          }
        }
      }
    }
    return least;
  }

  static double deviation_of(const FlatPieces& flat, const CoverBound::Visited& visited, std::optional<Index> single) {
    if (single) {
      return flat.deviation[*single];
    }
    double largest = 0;
    for (const Index t : visited.list()) {
      largest = std::max(largest, flat.deviation[t]);
    }
    return largest;
  }

  /// Settles the piece or keeps it.
  void bound(const FlatPieces& flat, const ClosestPoint& tree, const CoverBound& cover, Piece& piece,
             Block& block) const {
    const double enough = aim_.enough(lower_);
    std::optional<Index> single;
    const double height = flat_bound(tree, cover, piece.corners, enough, block.visited, single);
    piece.upper = std::min(piece.upper, height + deviation_of(flat, block.visited, single));
    if (piece.upper > enough && single && height <= enough) {
      // The one triangle that bounds it may be off by more than those that cover it.
      const double covered = cover(piece.corners.point, *single, enough, block.visited);
      piece.upper = std::min(piece.upper, covered + deviation_of(flat, block.visited, {}));
    }
    if (piece.upper <= enough) {
      block.settled = std::max(block.settled, piece.upper);
    } else {
      block.live.push_back(piece);
    }
  }

  void raise(double lower, const Vec3& at) {
    if (lower > lower_) {
      lower_ = lower;
      farthest_ = at;
    }
  }

  std::vector<Piece> collected(const std::vector<Block>& blocks) {
    for (const Block& block : blocks) {
      raise(block.lower, block.farthest);
      settled_ = std::max(settled_, block.settled);
    }
    const double enough = aim_.enough(lower_);
    std::vector<Piece> live;
    for (const Block& block : blocks) {
      for (const Piece& piece : block.live) {
        if (piece.upper <= enough) {
          settled_ = std::max(settled_, piece.upper);
        } else {
          live.push_back(piece);
        }
      }
    }
    return live;
  }

  std::vector<Piece> first_round(const FlatPieces& flat, int level) {
    const ClosestPoint tree(flat.mesh);
    const CoverBound cover(tree);
    const auto& order = target_.tree().spatial_order();
    std::vector<Block> blocks((order.size() + 2047) / 2048);
    // Corners first: they say how far is far.
    std::vector<Corners> all(order.size());
    parallel_for_blocks(order.size(), 2048, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      Block& block = blocks[begin / 2048];
      std::optional<Index> guess;
      for (std::size_t i = begin; i < end; ++i) {
        all[i].point = target_.tree().corners(order[i]);
        for (std::size_t k = 0; k < 3; ++k) {
          if (i > begin && reused(all[i - 1], all[i], k)) {
            continue;
          }
          look(tree, all[i], k, guess);
          guess = all[i].nearest[k];
          const auto patch =
              static_cast<Index>(*guess / (static_cast<std::size_t>(level) * static_cast<std::size_t>(level)));
          block.far.emplace_back(-close_distance(all[i].point[k], patch), all[i].point[k]);
        }
        if (block.far.size() > 8 * sharp_points) {
          keep_farthest(block.far);
        }
      }
      keep_farthest(block.far);
    });
    std::vector<std::pair<double, Vec3>> far;
    for (const Block& block : blocks) {
      far.insert(far.end(), block.far.begin(), block.far.end());
    }
    keep_farthest(far);
    for (const auto& [negative, p] : far) {
      if (-negative > lower_) {
        raise(sharp_lower(p, -negative), p);
      }
    }
    parallel_for_blocks(order.size(), 2048, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      for (std::size_t i = begin; i < end; ++i) {
        Piece piece{all[i], infinity};
        bound(flat, tree, cover, piece, blocks[begin / 2048]);
      }
    });
    worst_deviation_ = *std::max_element(flat.deviation.begin(), flat.deviation.end());
    return collected(blocks);
  }

  static bool reused(const Corners& last, Corners& now, std::size_t k) {
    for (std::size_t l = 0; l < 3; ++l) {
      if (last.point[l] == now.point[k]) {
        now.distance[k] = last.distance[l];
        now.nearest[k] = last.nearest[l];
        return true;
      }
    }
    return false;
  }

  static void keep_farthest(std::vector<std::pair<double, Vec3>>& far) {
    const auto by_distance = [](const auto& l, const auto& r) {
      return std::tie(l.first, l.second[0], l.second[1], l.second[2]) <
             std::tie(r.first, r.second[0], r.second[1], r.second[2]);
    };
    std::sort(far.begin(), far.end(), by_distance);
    far.erase(std::unique(far.begin(), far.end()), far.end());
    far.resize(std::min(far.size(), sharp_points));
  }

  /// Patches that may hold the closest points of what is left.
  [[nodiscard]] std::vector<Index> near(const std::vector<Piece>& live) const {
    std::vector<Index> out;
    const bool all = live.size() * patches_.size() > most_box_tests;
    std::vector<Box> boxes;
    for (const Piece& piece : live) {
      const auto& p = piece.corners.point;
      // The closest point of one corner, and so one of every point, is no farther than this.
      const double reach = std::min(piece.upper, piece.corners.distance[0] + longest_edge(p) + worst_deviation_);
      boxes.push_back({p[0].cwiseMin(p[1]).cwiseMin(p[2]) - Vec3::Constant(reach),
                       p[0].cwiseMax(p[1]).cwiseMax(p[2]) + Vec3::Constant(reach)});
    }
    for (std::size_t t = 0; t < patches_.size(); ++t) {
      const bool meets = all || std::any_of(boxes.begin(), boxes.end(), [&](const Box& b) {
                           return (b.lower.array() <= boxes_[t].upper.array()).all() &&
                                  (boxes_[t].lower.array() <= b.upper.array()).all();
                         });
      if (meets) {
        out.push_back(static_cast<Index>(t));
      }
    }
    return out;
  }

  static double longest_edge(const std::array<Vec3, 3>& p) {
    return std::max({(p[1] - p[0]).norm(), (p[2] - p[1]).norm(), (p[0] - p[2]).norm()});
  }

  [[nodiscard]] double joined_gap() const { return joined_share * aim_.enough(std::max(lower_, expected_)); }

  [[nodiscard]] double worst_flatness(const std::vector<Index>& chosen) const {
    double worst = 0;
    for (const Index t : chosen) {
      worst = std::max(worst, flatness_[t]);
    }
    return worst;
  }

  std::vector<Piece> next_round(const FlatPieces& flat, std::vector<Piece> live, bool last) {
    const ClosestPoint tree(flat.mesh);
    const CoverBound cover(tree);
    const double worst = *std::max_element(flat.deviation.begin(), flat.deviation.end());
    const auto in_blocks = [&](const auto& body) {
      std::vector<Block> blocks((live.size() + grain - 1) / grain);
      parallel_for_blocks(live.size(), grain, [&](std::size_t begin, std::size_t end) {
        check_interrupt();
        for (std::size_t i = begin; i < end; ++i) {
          body(live[i], blocks[begin / grain]);
        }
      });
      return collected(blocks);
    };
    const auto measure = [&](Piece& piece, std::size_t k, std::optional<Index> guess, Block& block) {
      look(tree, piece.corners, k, guess);
      // A patch that holds the closest point is among the chosen ones: the distance is true up to the deviation.
      if (piece.corners.distance[k] - worst > block.lower) {
        block.lower = piece.corners.distance[k] - worst;
        block.farthest = piece.corners.point[k];
      }
    };
    live = in_blocks([&](const Piece& given, Block& block) {
      Piece piece = given;
      std::optional<Index> guess;
      for (std::size_t k = 0; k < 3; ++k) {
        measure(piece, k, guess, block);
        guess = piece.corners.nearest[k];
      }
      bound(flat, tree, cover, piece, block);
    });
    std::size_t cuts = 0;
    const int most_cuts = last ? 200 : 4;
    for (int i = 0; i < most_cuts && !live.empty() && cuts + live.size() < most_pieces && !aim_.decided_above(lower_);
         ++i) {
      cuts += live.size();
      live = in_blocks([&](const Piece& piece, Block& block) {
        std::size_t k = 0;
        double longest = 0;
        for (std::size_t j = 0; j < 3; ++j) {
          const double l = (piece.corners.point[(j + 1) % 3] - piece.corners.point[j]).squaredNorm();
          if (l > longest) {
            longest = l;
            k = j;
          }
        }
        const std::size_t next = (k + 1) % 3;
        Piece one = piece;
        one.corners.point[next] = (piece.corners.point[k] + piece.corners.point[next]) / 2;
        measure(one, next, piece.corners.nearest[k], block);
        Piece two = piece;
        two.corners.point[k] = one.corners.point[next];
        two.corners.distance[k] = one.corners.distance[next];
        two.corners.nearest[k] = one.corners.nearest[next];
        bound(flat, tree, cover, one, block);
        bound(flat, tree, cover, two, block);
      });
    }
    worst_deviation_ = worst;
    return live;
  }

  const ShellMesh& shell_;
  const std::vector<CubicPatch>& patches_;
  const Target& target_;
  Aim aim_;
  std::vector<std::array<Index, 3>> across_;
  std::vector<Box> boxes_;
  std::vector<double> flatness_;
  double expected_ = 0;
  double worst_deviation_ = infinity;
  double lower_ = 0, settled_ = 0;
  Vec3 farthest_ = Vec3::Zero();
};

/// Mean and root mean square of the distance from the curved surface, by the midpoints of its pieces.
std::pair<double, double> means(const std::vector<CubicPatch>& patches, const Target& target) {
  struct Sum {
    double area = 0, distance = 0, squared = 0;
  };
  const double per_patch = static_cast<double>(mean_samples) / static_cast<double>(patches.size());
  const int level = std::clamp(static_cast<int>(std::sqrt(per_patch)), 2, 40);
  std::vector<Sum> sums((patches.size() + grain - 1) / grain);
  parallel_for_blocks(patches.size(), grain, [&](std::size_t begin, std::size_t end) {
    Sum& sum = sums[begin / grain];
    std::optional<Index> guess;
    for (std::size_t t = begin; t < end; ++t) {
      const auto add = [&](double c, double r) {
        const Vec2 at(c / level, r / level);
        const auto [u, v] = patches[t].tangents(at);
        const double area = u.cross(v).norm() / (2.0 * level * level);
        const Vec3 p = patches[t].point(at);
        const auto hit = guess ? target.tree().closest(p, *guess) : target.tree().closest(p);
        guess = hit.triangle;
        sum.area += area;
        sum.distance += area * std::sqrt(hit.squared_distance);
        sum.squared += area * hit.squared_distance;
      };
      for (int r = 0; r < level; ++r) {
        for (int c = 0; c < level - r; ++c) {
          add(c + 1.0 / 3, r + 1.0 / 3);
          if (c + 1 < level - r) {
            add(c + 2.0 / 3, r + 2.0 / 3);
          }
        }
      }
    }
  });
  Sum total;
  for (const Sum& sum : sums) {
    total.area += sum.area;
    total.distance += sum.distance;
    total.squared += sum.squared;
  }
  return {total.distance / total.area, std::sqrt(total.squared / total.area)};
}

}  // namespace

ShellDistance curved_hausdorff(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  std::vector<CubicPatch> patches(shell.triangles.size());
  parallel_for_blocks(patches.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      patches[t] = curved_patch(shell, t);
    }
  });
  const Aim aim{options.width, options.limit, rounding_of(shell, target)};
  ShellDistance out;
  out.shell_to_target = FromShell(patches, target, aim).run();
  tunica::advance(options.progress, 0.4);
  FromTarget from_target(shell, patches, target, aim);
  out.target_to_shell = from_target.run(out.shell_to_target.lower);
  out.farthest_of_target = from_target.farthest();
  out.both = {std::max(out.shell_to_target.lower, out.target_to_shell.lower),
              std::max(out.shell_to_target.upper, out.target_to_shell.upper)};
  out.mean = out.rms = std::numeric_limits<double>::quiet_NaN();
  if (options.with_mean) {
    std::tie(out.mean, out.rms) = means(patches, target);
  }
  tunica::advance(options.progress, 1);
  return out;
}

}  // namespace tunica
