// Branch and bound over pieces of the target's triangles: an upper bound of their distance is kept or the piece is cut;
// corners give lower bounds. The difference between a flat piece and a part of a cubic patch is a cubic Bezier triangle
// in the piece's own parameters; it lies in the hull of its control points, which are blossoms of the patch (Ramshaw,
// "Blossoms are polar forms", CAGD 6(4), 1989).
#include "tunica/shell/distance/detail/certificate.hpp"

#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/patch_search.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double sharp_share = 0.75;      // of the width: corners so far below what is enough are close enough
constexpr double sharp_tolerance = 0.05;  // of the width

struct Corner {
  Vec3 at;
  SurfaceFoot foot;
};
using Corners = std::array<Corner, 3>;

using Weights = std::array<double, 3>;
Weights weights_of(const Vec2& b) { return {1 - b[0] - b[1], b[0], b[1]}; }

/// Control points 200, 020, 002, 110, 011, 101 of the quadratic that a cubic's blossom with one argument fixed is.
using Quadratic = std::array<Vec3, 6>;
Quadratic blossom(const CubicPatch& patch, const Weights& u) {
  const auto& c = patch.control;
  const auto mix = [&](std::size_t i, std::size_t j, std::size_t k) -> Vec3 {
    return u[0] * c[i] + u[1] * c[j] + u[2] * c[k];
  };
  return {mix(0, 3, 8), mix(4, 1, 5), mix(7, 6, 2), mix(3, 4, 9), mix(9, 5, 6), mix(8, 9, 7)};
}
std::array<Vec3, 3> blossom(const Quadratic& q, const Weights& v) {
  const auto mix = [&](std::size_t i, std::size_t j, std::size_t k) -> Vec3 {
    return v[0] * q[i] + v[1] * q[j] + v[2] * q[k];
  };
  return {mix(0, 3, 5), mix(3, 1, 4), mix(5, 4, 2)};
}
Vec3 blossom(const std::array<Vec3, 3>& r, const Weights& w) { return w[0] * r[0] + w[1] * r[1] + w[2] * r[2]; }

/// Largest distance at equal parameters between a flat triangle and the part of a patch with its corners at the feet,
/// which are all on this patch.
double difference(const CubicPatch& patch, const Corners& c) {
  const std::array<Weights, 3> b{weights_of(c[0].foot.at), weights_of(c[1].foot.at), weights_of(c[2].foot.at)};
  double squared = 0;
  std::array<Vec3, 3> twice_first;
  for (std::size_t i = 0; i < 3; ++i) {
    const Quadratic once = blossom(patch, b[i]);
    const auto twice = blossom(once, b[i]);
    if (i == 0) {
      twice_first = blossom(once, b[1]);
    }
    squared = std::max(squared, (c[i].at - blossom(twice, b[i])).squaredNorm());
    for (const std::size_t j : {(i + 1) % 3, (i + 2) % 3}) {
      squared = std::max(squared, ((2 * c[i].at + c[j].at) / 3 - blossom(twice, b[j])).squaredNorm());
    }
  }
  squared = std::max(squared, ((c[0].at + c[1].at + c[2].at) / 3 - blossom(twice_first, b[2])).squaredNorm());
  return std::sqrt(squared);
}

class FromTarget {
public:
  FromTarget(const ShellMesh& shell, const std::vector<CubicPatch>& patches, const SurfaceInOrder& target,
             const Aim& aim, double expected)
      : patches_(patches), target_(target), aim_(aim), expected_(expected), search_(shell, patches) {}

  OneSided run() {
    std::vector<Piece> live = first_round();
    std::size_t cuts = 0;
    while (!live.empty() && cuts + live.size() < most_certified_pieces && !aim_.decided_above(lower_)) {
      check_interrupt();
      cuts += live.size();
      std::vector<Block> blocks((live.size() + items_per_block - 1) / items_per_block);
      parallel_for_blocks(live.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
        Block& block = blocks[begin / items_per_block];
        block.lower = lower_;
        for (std::size_t i = begin; i < end; ++i) {
          cut(live[i], block);
        }
      });
      live = collected(blocks, aim_, lower_, settled_, farthest_, beyond_);
    }
    for (const Piece& piece : live) {
      settled_ = std::max(settled_, std::min(piece.upper, by_one_corner(piece.corners)));
    }
    return {{std::max(0.0, lower_ - aim_.uncertainty), std::max(lower_, settled_) + aim_.uncertainty},
            farthest_.at,
            farthest_.foot.point,
            beyond_.all()};
  }

private:
  struct Piece {
    Corners corners;
    double upper;
  };
  struct Block {
    double lower = 0, settled = 0;
    Corner farthest{Vec3::Zero(), {}};  // whose distance `lower` is
    std::vector<Piece> live;
    std::vector<FarPlace> beyond;
  };

  /// No point of a piece is farther from a surface than it is from the foot of a corner.
  static double by_one_corner(const Corners& c) {
    return c[0].foot.distance + std::max((c[1].at - c[0].at).norm(), (c[2].at - c[0].at).norm());
  }

  /// A corner so far away that it decides: either it is, for certain, or it gets a closer foot.
  void sharpen(Corner& corner, double& lower, Corner& farthest) const {
    if (corner.foot.distance <= aim_.stop_at(lower) - sharp_share * aim_.width) {
      return;
    }
    const double certain = search_.nearest(corner.at, sharp_tolerance * aim_.width, corner.foot);
    if (certain > lower) {
      lower = certain;
      farthest = corner;
    }
  }

  std::vector<Piece> first_round() {
    const std::vector<Vec3>& vertices = target_.vertices;
    const std::vector<std::array<Index, 3>>& triangles = target_.triangles;
    const std::vector<Index>& order = target_.order;
    // Every vertex once, neighbours in space one after the other.
    std::vector<Corner> corners(vertices.size());
    std::vector<Index> used;
    std::vector<std::uint8_t> met(corners.size(), 0);
    for (const Index t : order) {
      for (const Index v : triangles[t]) {
        if (met[v] == 0) {
          met[v] = 1;
          used.push_back(v);
        }
      }
    }
    parallel_for_blocks(used.size(), 8 * items_per_block, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      std::optional<Index> guess;
      SurfaceFoot last;
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3& p = vertices[used[i]];
        // Beside the last one's foot there mostly is one that is close enough.
        SurfaceFoot foot = search_.near(p, last.patch, last.at);
        if (foot.distance > expected_) {
          foot = search_.near(p, guess);
        }
        corners[used[i]] = {p, foot};
        last = foot;
      }
    });
    // The farthest first: they say how far is far.
    const auto farther = [&](Index a, Index b) {
      return corners[a].foot.distance != corners[b].foot.distance ? corners[a].foot.distance > corners[b].foot.distance
                                                                  : a < b;
    };
    const Index first = *std::min_element(used.begin(), used.end(), farther);
    sharpen(corners[first], lower_, farthest_);
    std::vector<Index> far;
    for (const Index v : used) {
      if (corners[v].foot.distance > aim_.stop_at(lower_) - sharp_share * aim_.width) {
        far.push_back(v);
      }
    }
    std::sort(far.begin(), far.end(), farther);
    for (std::size_t i = 0; i < far.size() && !aim_.decided_above(lower_); ++i) {
      sharpen(corners[far[i]], lower_, farthest_);
    }
    std::vector<Block> blocks((order.size() + 8 * items_per_block - 1) / (8 * items_per_block));
    parallel_for_blocks(order.size(), 8 * items_per_block, [&](std::size_t begin, std::size_t end) {
      check_interrupt();
      Block& block = blocks[begin / (8 * items_per_block)];
      block.lower = lower_;
      for (std::size_t i = begin; i < end; ++i) {
        const auto& v = triangles[order[i]];
        bound({{corners[v[0]], corners[v[1]], corners[v[2]]}, infinity}, block);
      }
    });
    return collected(blocks, aim_, lower_, settled_, farthest_, beyond_);
  }

  /// Settles the piece, keeps or lists it.
  void bound(Piece piece, Block& block) const {
    const double goal = aim_.stop_at(block.lower);
    const Corners& c = piece.corners;
    for (const Corner& corner : c) {
      SurfaceFoot foot = corner.foot;
      if (!aim_.is_listed(foot.distance)) {
        continue;
      }
      const double certain = search_.nearest(corner.at, sharp_tolerance * aim_.width, foot);
      if (aim_.is_listed(certain)) {
        block.beyond.push_back({corner.at, foot.patch, foot.at, foot.distance});
      }
      if (aim_.is_beyond(certain)) {
        block.settled = std::max(block.settled, std::min(piece.upper, by_one_corner(c)));
        return;
      }
    }
    // Against one patch: the one that most corners have their feet on.
    const std::size_t one = c[1].foot.patch == c[2].foot.patch ? 1 : 0;
    const Index patch = c[one].foot.patch;
    Corners here = c;
    double farthest = 0;
    for (std::size_t i = 0; i < 3 && farthest <= goal; ++i) {
      if (here[i].foot.patch != patch) {
        here[i].foot = search_.on_patch(here[i].at, patch, c[one].foot.at);
      }
      farthest = std::max(farthest, here[i].foot.distance);
    }
    if (const double bulged = farthest + search_.bulge(patch, here[0].foot.at, here[1].foot.at, here[2].foot.at);
        bulged <= goal) {
      piece.upper = std::min(piece.upper, bulged);
    } else if (farthest <= goal) {
      piece.upper = std::min(piece.upper, difference(patches_[patch], here));
    }
    if (piece.upper > goal) {
      // However small, a piece between folds may have feet far apart, and what is between these farther off than they.
      piece.upper = std::min(piece.upper, by_one_corner(c));
    }
    if (piece.upper <= goal) {
      block.settled = std::max(block.settled, piece.upper);
    } else {
      block.live.push_back(piece);
    }
  }

  void cut(const Piece& piece, Block& block) const {
    if (piece.upper <= aim_.stop_at(block.lower)) {
      block.settled = std::max(block.settled, piece.upper);
    } else if (!cut_along_edge(piece, block)) {
      halve(piece, block);
    }
  }

  void halve(const Piece& piece, Block& block) const {
    const Corners& c = piece.corners;
    std::size_t k = 0;
    double longest = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      const double l = (c[(j + 1) % 3].at - c[j].at).squaredNorm();
      if (l > longest) {
        longest = l;
        k = j;
      }
    }
    const std::size_t next = (k + 1) % 3;
    Corner middle{(c[k].at + c[next].at) / 2, {}};
    if (c[k].foot.patch == c[next].foot.patch) {
      middle.foot = search_.near(middle.at, c[k].foot.patch, (c[k].foot.at + c[next].foot.at) / 2);
    } else {
      middle.foot = search_.on_patch(middle.at, c[k].foot.patch, c[k].foot.at);
      const SurfaceFoot other = search_.on_patch(middle.at, c[next].foot.patch, c[next].foot.at);
      if (other.distance < middle.foot.distance) {
        middle.foot = other;
      }
    }
    sharpen(middle, block.lower, block.farthest);
    Piece one = piece, two = piece;
    one.corners[next] = middle;
    two.corners[k] = middle;
    bound(one, block);
    bound(two, block);
  }

  /// Where one corner's foot is on one patch and two on its neighbour, the piece is cut where the first patch ends.
  /// @return whether that was so
  bool cut_along_edge(const Piece& piece, Block& block) const {
    for (std::size_t i = 0; i < 3; ++i) {
      const Corner& lone = piece.corners[i];
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      const Index here = lone.foot.patch, there = piece.corners[j].foot.patch;
      if (there == here || piece.corners[k].foot.patch != there) {
        continue;
      }
      const std::size_t edge = search_.edge_towards(here, there);
      if (edge == 3) {
        return false;
      }
      // Behind the edge the weight of the corner opposite is negative.
      const std::size_t opposite = (edge + 2) % 3;
      const double inside = weights_of(lone.foot.at)[opposite];
      std::array<Corner, 2> end;  // on the way to corners j and k
      std::array<SurfaceFoot, 2> foot_there;
      for (std::size_t l = 0; l < 2; ++l) {
        const Corner& to = piece.corners[l == 0 ? j : k];
        const double outside = weights_of(beyond(patches_[here], to.at, lone.foot.at))[opposite];
        const double part = inside / (inside - outside);
        if (!(part > 1e-3 && part < 1 - 1e-3)) {
          return false;
        }
        end[l].at = lone.at + part * (to.at - lone.at);
        end[l].foot = search_.on_patch(end[l].at, here, lone.foot.at);
        foot_there[l] = search_.on_patch(end[l].at, there, to.foot.at);
        Corner closer{end[l].at, end[l].foot.distance < foot_there[l].distance ? end[l].foot : foot_there[l]};
        sharpen(closer, block.lower, block.farthest);
        if (std::max(end[l].foot.distance, foot_there[l].distance) > aim_.stop_at(block.lower)) {
          return false;
        }
      }
      bound({{lone, end[0], end[1]}, piece.upper}, block);
      end[0].foot = foot_there[0];
      end[1].foot = foot_there[1];
      bound({{end[0], piece.corners[j], piece.corners[k]}, piece.upper}, block);
      bound({{end[0], piece.corners[k], end[1]}, piece.upper}, block);
      return true;
    }
    return false;
  }

  /// Nearly where the foot of a point would be if the patch went on: a Gauss-Newton step from a point of the patch.
  static Vec2 beyond(const CubicPatch& patch, const Vec3& p, const Vec2& at) {
    const auto d = patch.tangents(at);
    const Vec3 r = p - patch.point(at);
    const double a = d[0].dot(d[0]), b = d[0].dot(d[1]), e = d[1].dot(d[1]), f = d[0].dot(r), g = d[1].dot(r);
    const double determinant = std::max(a * e - b * b, 1e-300);
    return at + Vec2((e * f - b * g) / determinant, (a * g - b * f) / determinant);
  }

  const std::vector<CubicPatch>& patches_;
  SurfaceInOrder target_;
  Aim aim_;
  double expected_;
  PatchSearch search_;
  double lower_ = 0, settled_ = 0;
  Corner farthest_{Vec3::Zero(), {}};
  FarPlaces beyond_;
};

}  // namespace

OneSided target_to_shell(const ShellMesh& shell, const std::vector<CubicPatch>& patches, const SurfaceInOrder& target,
                         const Aim& aim, double expected) {
  return FromTarget(shell, patches, target, aim, expected).run();
}

}  // namespace tunica
