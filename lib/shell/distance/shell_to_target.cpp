// Branch and bound over parts of patches: an upper bound of the distance over a part is kept or the part is cut; points
// give lower bounds.
#include "tunica/shell/distance/detail/certificate.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/distance/cover_bound.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double bulge_share = 0.25;  // of the distance that settles a piece: what the first cut leaves to bulges
constexpr int most_level = 24;        // pieces per edge of the first cut

/// A triangle in space with what is closest to its corners.
struct CornerFeet {
  std::array<Vec3, 3> point;
  std::array<double, 3> distance;
  std::array<Index, 3> nearest;
};

/// Largest distance of a flat triangle from a surface; infinite when nothing at most `goal` can be shown.
double flat_bound(const ClosestPoint& tree, const CoverBound& cover, const CornerFeet& c, double goal,
                  CoverBound::Visited& visited) {
  double best = infinity;
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (c.nearest[i] == c.nearest[0] || (i == 2 && c.nearest[2] == c.nearest[1]))) {
      continue;
    }
    best = std::min(best, std::sqrt(tree.max_squared_distance_to(c.point, c.nearest[i])));
  }
  if (best <= goal) {
    return best;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (c.nearest[i] == c.nearest[0] || (i == 2 && c.nearest[2] == c.nearest[1]))) {
      continue;
    }
    const double bound = cover(c.point, c.nearest[i], goal, visited);
    if (bound <= goal) {
      return bound;
    }
  }
  return best;
}

void look(const ClosestPoint& tree, CornerFeet& c, std::size_t i, std::optional<Index> guess) {
  const auto hit = guess ? tree.closest(c.point[i], *guess) : tree.closest(c.point[i]);
  c.distance[i] = std::sqrt(hit.squared_distance);
  c.nearest[i] = hit.triangle;
}

/// From the curved surface to the target.
class FromShell {
public:
  FromShell(const std::vector<CubicPatch>& patches, const Target& target, const Aim& aim)
      : patches_(patches), tree_(target.tree()), cover_(target.cover()), aim_(aim) {}

  OneSided run() {
    std::vector<Piece> live = first_pieces();
    std::size_t cuts = 0;
    while (!live.empty() && cuts + live.size() < most_certified_pieces && !aim_.decided_above(lower_)) {
      check_interrupt();
      cuts += live.size();
      live = refined(live);
    }
    for (const Piece& piece : live) {
      settled_ = std::max(settled_, piece.upper);
    }
    return {{std::max(0.0, lower_ - aim_.uncertainty), std::max(lower_, settled_) + aim_.uncertainty},
            farthest_,
            tree_.closest(farthest_).point,
            beyond_.all()};
  }

private:
  struct Piece {
    Index patch;
    int cuts;  // halvings of the first cut
    int level;
    std::array<Vec2, 3> at;
    CornerFeet corners;
    double upper;
  };
  struct Block {
    double lower = 0, settled = 0;
    Vec3 farthest = Vec3::Zero();  // whose distance `lower` is
    std::vector<Piece> live;
    std::vector<FarPlace> beyond;
    CoverBound::Visited visited;
  };

  static void raise(Block& block, double distance, const Vec3& at) {
    if (distance > block.lower) {
      block.lower = distance;
      block.farthest = at;
    }
  }

  /// Every patch cut so that its pieces bulge little against the distances that its corners and middles have.
  std::vector<Piece> first_pieces() {
    std::vector<Block> middles((patches_.size() + items_per_block - 1) / items_per_block);
    parallel_for_blocks(patches_.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
      std::optional<Index> guess;
      for (std::size_t t = begin; t < end; ++t) {
        for (const Vec2& b : {Vec2(1.0 / 3, 1.0 / 3), Vec2(0.5, 0), Vec2(0, 0.5), Vec2(0.5, 0.5)}) {
          const Vec3 p = patches_[t].point(b);
          const auto hit = guess ? tree_.closest(p, *guess) : tree_.closest(p);
          guess = hit.triangle;
          raise(middles[begin / items_per_block], std::sqrt(hit.squared_distance), p);
        }
      }
    });
    collected(middles, aim_, lower_, settled_, farthest_, beyond_);
    const double bulge = bulge_share * aim_.stop_at(lower_);
    std::vector<Block> blocks((patches_.size() + items_per_block - 1) / items_per_block);
    parallel_for_blocks(patches_.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      for (std::size_t t = begin; t < end; ++t) {
        cut_first(narrow<Index>(t), bulge, blocks[begin / items_per_block]);
      }
    });
    return collected(blocks, aim_, lower_, settled_, farthest_, beyond_);
  }

  void cut_first(Index t, double bulge, Block& block) const {
    const double wanted = std::ceil(std::sqrt(flatness(patches_[t], 1) / bulge));
    const int m = truncated<int>(std::clamp(wanted, 2.0, real(most_level)));
    struct Point {
      Vec3 at;
      double distance;
      Index nearest;
    };
    std::vector<Point> points;
    std::optional<Index> guess;
    for (int r = 0; r <= m; ++r) {
      for (int c = 0; c <= m - r; ++c) {
        const Vec3 p = patches_[t].point(Vec2(real(c) / m, real(r) / m));
        const auto hit = guess ? tree_.closest(p, *guess) : tree_.closest(p);
        guess = hit.triangle;
        points.push_back({p, std::sqrt(hit.squared_distance), hit.triangle});
        raise(block, points.back().distance, p);
      }
    }
    const auto add = [&](std::array<std::array<int, 2>, 3> corners) {
      Piece piece{t, 0, m, {}, {}, infinity};
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [c, r] = corners[i];
        const Point& p = points[r * (2 * m + 3 - r) / 2 + c];
        piece.at[i] = Vec2(real(c) / m, real(r) / m);
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

  /// Settles the piece, keeps or lists it.
  void bound(Piece& piece, Block& block) const {
    const CornerFeet& c = piece.corners;
    const auto far = narrow<std::size_t>(std::max_element(c.distance.begin(), c.distance.end()) - c.distance.begin());
    if (aim_.is_listed(c.distance[far])) {
      block.beyond.push_back({c.point[far], piece.patch, piece.at[far], c.distance[far]});
    }
    if (aim_.is_beyond(c.distance[far])) {
      const double reach = std::max((c.point[1] - c.point[0]).norm(), (c.point[2] - c.point[0]).norm());
      block.settled = std::max(block.settled, std::min(piece.upper, c.distance[0] + reach + bulge_of(piece)));
      return;
    }
    const double goal = aim_.stop_at(std::max(lower_, block.lower));
    const double bulge = bulge_of(piece);
    const double flat = flat_bound(tree_, cover_, piece.corners, std::max(goal - bulge, 0.0), block.visited);
    piece.upper = std::min(piece.upper, flat + bulge);
    if (piece.upper <= goal) {
      block.settled = std::max(block.settled, piece.upper);
    } else {
      block.live.push_back(piece);
    }
  }

  [[nodiscard]] double bulge_of(const Piece& piece) const {
    return flatness(patches_[piece.patch], piece.level) / std::pow(4.0, piece.cuts);
  }

  std::vector<Piece> refined(const std::vector<Piece>& pieces) {
    std::vector<Block> blocks((pieces.size() + items_per_block - 1) / items_per_block);
    parallel_for_blocks(pieces.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        cut(pieces[i], blocks[begin / items_per_block]);
      }
    });
    return collected(blocks, aim_, lower_, settled_, farthest_, beyond_);
  }

  void cut(const Piece& piece, Block& block) const {
    Piece middle = piece;
    ++middle.cuts;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3;
      middle.at[i] = (piece.at[i] + piece.at[j]) / 2;
      middle.corners.point[i] = patches_[piece.patch].point(middle.at[i]);
      look(tree_, middle.corners, i, piece.corners.nearest[i]);
      raise(block, middle.corners.distance[i], middle.corners.point[i]);
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
  const CoverBound& cover_;
  Aim aim_;
  double lower_ = 0, settled_ = 0;
  Vec3 farthest_ = Vec3::Zero();
  FarPlaces beyond_;
};

}  // namespace

OneSided shell_to_target(const std::vector<CubicPatch>& patches, const Target& target, const Aim& aim) {
  return FromShell(patches, target, aim).run();
}

}  // namespace tunica
