#include "tunica/shell/distance/shell_crossings.hpp"

#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/detail/certificate.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <numeric>

namespace tunica {
namespace {

constexpr double flat_enough = 1e-4;    // of the patch's longest edge: an eye sees no less in a drawing of it
constexpr double edge_strip = 0.125;    // of the height over a shared edge
constexpr int most_pair_cuts = 20'000;  // of a pair: some ten milliseconds

/// A triangle of a patch's parameters, each corner as weights of the patch's corners.
using Domain = std::array<Vec3, 3>;
const Domain whole{Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};

/// The value of the patch's polar form: at three equal arguments it is the point.
Vec3 polar(const std::array<Vec3, 10>& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const std::array<Vec3, 6> q{a[0] * p[0] + a[1] * p[3] + a[2] * p[8], a[0] * p[4] + a[1] * p[1] + a[2] * p[5],
                              a[0] * p[7] + a[1] * p[6] + a[2] * p[2], a[0] * p[3] + a[1] * p[4] + a[2] * p[9],
                              a[0] * p[9] + a[1] * p[5] + a[2] * p[6], a[0] * p[8] + a[1] * p[9] + a[2] * p[7]};
  const std::array<Vec3, 3> r{b[0] * q[0] + b[1] * q[3] + b[2] * q[5], b[0] * q[3] + b[1] * q[1] + b[2] * q[4],
                              b[0] * q[5] + b[1] * q[4] + b[2] * q[2]};
  return c[0] * r[0] + c[1] * r[1] + c[2] * r[2];
}

/// The part of a patch over a triangle of its parameters, which is a cubic Bezier triangle itself. A corner that is a
/// corner of the patch keeps its place to the bit.
CubicPatch part_of(const CubicPatch& patch, const Domain& d) {
  const auto at = [&](std::size_t i, std::size_t j, std::size_t k) { return polar(patch.control, d[i], d[j], d[k]); };
  return {{at(0, 0, 0), at(1, 1, 1), at(2, 2, 2), at(0, 0, 1), at(0, 1, 1), at(1, 1, 2), at(1, 2, 2), at(2, 2, 0),
           at(2, 0, 0), at(0, 1, 2)}};
}

/// The four parts by the middles of the edges; part k has corner k in its place.
std::array<CubicPatch, 4> quarters(const CubicPatch& patch) {
  const Vec3 m01(0.5, 0.5, 0), m12(0, 0.5, 0.5), m20(0.5, 0, 0.5);
  return {part_of(patch, {whole[0], m01, m20}), part_of(patch, {m01, whole[1], m12}),
          part_of(patch, {m20, m12, whole[2]}), part_of(patch, {m12, m20, m01})};
}

/// A part of a patch in the search, with the corner at which the node lies that both patches share, if it has it.
struct Piece {
  static constexpr std::size_t no_corner = 3;
  CubicPatch patch;
  double allowed = 0;  // mm: flatter than this it is as good as its triangle
  std::size_t node = no_corner;

  [[nodiscard]] bool has_node() const { return node != no_corner; }
  [[nodiscard]] const Vec3& corner(std::size_t k) const { return patch.control[k % 3]; }
  [[nodiscard]] Vec3 facing() const { return (corner(1) - corner(0)).cross(corner(2) - corner(0)); }
  [[nodiscard]] Vec3 middle() const { return (corner(0) + corner(1) + corner(2)) / 3; }
  [[nodiscard]] std::array<Vec3, 3> triangle(std::size_t first) const {
    return {corner(first), corner(first + 1), corner(first + 2)};
  }
};

/// Whether a plane at right angles to `axis` keeps the pieces apart, but for the node that both have. A patch lies in
/// the convex hull of its control points.
bool parts(const Piece& one, const Piece& other, const Vec3& axis) {
  double most = -infinity;
  double least = -most;
  const bool beside_node = one.has_node() && other.has_node();
  if (beside_node) {
    most = least = axis.dot(one.corner(one.node));
  }
  bool apart = true;
  for (std::size_t i = 0; i < 10; ++i) {
    const double here = axis.dot(one.patch.control[i]);
    const double there = axis.dot(other.patch.control[i]);
    if (beside_node) {
      apart = apart && (i == one.node || here < most) && (i == other.node || there > least);
    } else {
      most = std::max(most, here);
      least = std::min(least, there);
    }
  }
  return beside_node ? apart : most < least;
}

bool certainly_apart(const Piece& one, const Piece& other) {
  Vec3 towards = other.middle() - one.middle();
  if (one.has_node() && other.has_node()) {
    const Vec3& node = one.corner(one.node);
    towards = (other.middle() - node).normalized() - (one.middle() - node).normalized();
  }
  if (parts(one, other, towards)) {
    return true;
  }
  const std::array<Vec3, 2> facings{one.facing(), other.facing()};
  return std::any_of(facings.begin(), facings.end(), [&](const Vec3& facing) {
    // Also with what the direction has along the facet taken away or kept alone.
    const Vec3 within = towards - towards.dot(facing) / std::max(facing.squaredNorm(), 1e-300) * facing;
    return parts(one, other, facing) || parts(one, other, -facing) || parts(one, other, within);
  });
}

/// @param left  cuts that are still allowed; patches so bent that these do not do count as meeting
bool meet(const Piece& one, const Piece& other, int& left) {
  if (certainly_apart(one, other)) {
    return false;
  }
  const double bend = flatness(one.patch, 1) / one.allowed;
  const double other_bend = flatness(other.patch, 1) / other.allowed;
  if (bend <= 1 && other_bend <= 1) {
    return one.has_node() && other.has_node()
               ? triangles_cross_beside_corner(one.triangle(one.node), other.triangle(other.node))
               : triangles_cross(one.triangle(0), other.triangle(0));
  }
  if (--left < 0) {
    return true;
  }
  const bool cut_one = bend >= other_bend;
  const Piece& cut = cut_one ? one : other;
  const auto quarter = quarters(cut.patch);
  for (std::size_t k = 0; k < 4; ++k) {
    const Piece piece{quarter[k], cut.allowed, k < 3 && k == cut.node ? k : Piece::no_corner};
    if (cut_one ? meet(piece, other, left) : meet(one, piece, left)) {
      return true;
    }
  }
  return false;
}

bool meet(const Piece& one, const Piece& other) {
  int left = most_pair_cuts;
  return meet(one, other, left);
}

class Crossings {
public:
  explicit Crossings(const ShellMesh& shell) : shell_(shell), patches_(curved_patches(shell)) {}

  [[nodiscard]] bool cross(Index one, Index other) const {
    const auto& c = shell_.triangles[one];
    const auto& d = shell_.triangles[other];
    std::array<std::size_t, 3> mine{}, theirs{};  // the corners in common
    std::size_t shared = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        if (c[i] == d[j]) {
          mine[shared] = i;
          theirs[shared++] = j;
        }
      }
    }
    switch (shared) {
      case 0:
        return meet(piece(one), piece(other));
      case 1:
        return meet(piece(one, mine[0]), piece(other, theirs[0]));
      case 2:
        return meet(beside_edge(one, 3 - mine[0] - mine[1]), beside_edge(other, 3 - theirs[0] - theirs[1]));
      default:
        return false;
    }
  }

  /// The pairs whose boxes overlap.
  [[nodiscard]] std::vector<std::array<Index, 2>> candidates() const {
    std::vector<Vec3> lower(patches_.size()), upper(patches_.size());
    for (std::size_t t = 0; t < patches_.size(); ++t) {
      lower[t] = upper[t] = patches_[t].control[0];
      for (const Vec3& p : patches_[t].control) {
        lower[t] = lower[t].cwiseMin(p);
        upper[t] = upper[t].cwiseMax(p);
      }
    }
    return overlapping_boxes(lower, upper);
  }

private:
  [[nodiscard]] double allowed(Index t) const {
    const auto& p = patches_[t].control;
    return flat_enough *
           std::sqrt(std::max({(p[1] - p[0]).squaredNorm(), (p[2] - p[1]).squaredNorm(), (p[0] - p[2]).squaredNorm()}));
  }
  [[nodiscard]] Piece piece(Index t, std::size_t node = Piece::no_corner) const {
    return {patches_[t], allowed(t), node};
  }
  /// A patch without the strip along the edge opposite its corner `apex`.
  [[nodiscard]] Piece beside_edge(Index t, std::size_t apex) const {
    Domain part = whole;
    for (std::size_t k = 0; k < 3; ++k) {
      part[k] = (1 - edge_strip) * whole[k] + edge_strip * whole[apex];
    }
    return {part_of(patches_[t], part), allowed(t), Piece::no_corner};
  }

  const ShellMesh& shell_;
  std::vector<CubicPatch> patches_;
};

}  // namespace

bool share_a_node(const ShellMesh& shell, const std::array<Index, 2>& pair) {
  const auto& other = shell.triangles[pair[1]];
  return std::ranges::any_of(shell.triangles[pair[0]],
                             [&](Index node) { return std::ranges::find(other, node) != other.end(); });
}

std::vector<std::array<Index, 2>> crossing_patches(const ShellMesh& shell, bool neighbours) {
  const Crossings crossings(shell);
  auto candidates = crossings.candidates();
  if (!neighbours) {
    std::erase_if(candidates, [&](const auto& pair) { return share_a_node(shell, pair); });
  }
  std::vector<std::uint8_t> cross(candidates.size(), 0);
  parallel_for_blocks(candidates.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t i = begin; i < end; ++i) {
      cross[i] = crossings.cross(candidates[i][0], candidates[i][1]) ? 1 : 0;
    }
  });
  std::vector<std::array<Index, 2>> found;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (cross[i] != 0) {
      found.push_back(candidates[i]);
    }
  }
  return found;
}

}  // namespace tunica
