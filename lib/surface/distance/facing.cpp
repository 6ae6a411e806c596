#include "tunica/surface/distance/facing.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/signed_distance.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/seams.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

namespace tunica {
namespace {

constexpr double has_inside = 1.0 / 3;  // mean winding number; 1/2 of a closed surface, 0 of a sheet
constexpr double bulges = 0.01;         // likewise: below it a sheet may well be meant
constexpr std::size_t fewest_points = 16, most_points = 64;  // where that is taken
constexpr std::size_t most_angles = 20'000'000;              // solid angles, about: half a second on two cores
constexpr double no_volume = 1e-9;                           // of the area to the power of 3/2: rounding
constexpr std::size_t judges = 16;                           // vertices that say whether a piece lies within another

/// The solid angle of a triangle, over 4 pi; positive where its normal points away from p.
/// Source: van Oosterom, Strackee 1983.
double winding(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = a - p, v = b - p, w = c - p;
  const double lu = u.norm(), lv = v.norm(), lw = w.norm();
  const double below = lu * lv * lw + u.dot(v) * lw + v.dot(w) * lu + w.dot(u) * lv;
  return std::atan2(u.dot(v.cross(w)), below) / (2 * std::numbers::pi);
}

struct Component {
  std::vector<Index> triangles;
  bool closed = true;
  double area = 0;
  Box box;
  int sign = 0;  // 1: faces outward, -1: inward, 0: has no inside
  bool bulges_back = false;
  std::size_t depth = 0;
};

class Components {
public:
  explicit Components(const TriangleMesh& mesh) : mesh_(mesh) {
    gather();
    for (Component& piece : all_) {
      measure(piece);
    }
    if (all_.size() > 1) {
      nest();
    }
  }

  [[nodiscard]] Facing facing() const {
    Facing found;
    found.pieces = all_.size();
    found.is_wrong.assign(mesh_.triangles.size(), false);
    double largest = 0, largest_hollow = 0;
    for (const Component& piece : all_) {
      const Vec3& at = corner(piece.triangles.front(), 0);
      found.bulging += piece.bulges_back ? 1 : 0;
      if (piece.depth > 0 && piece.sign < 0) {
        ++found.hollows;
        if (piece.area > largest_hollow) {
          largest_hollow = piece.area;
          found.hollow_place = at;
        }
      }
      if (piece.sign != (piece.depth % 2 == 0 ? -1 : 1)) {
        continue;
      }
      ++found.inward;
      found.outermost_inward += piece.depth == 0 ? 1 : 0;
      if (piece.area > largest) {
        largest = piece.area;
        found.place = at;
      }
      for (const Index t : piece.triangles) {
        found.is_wrong[t] = true;
      }
    }
    return found;
  }

private:
  [[nodiscard]] const Vec3& corner(Index triangle, std::size_t k) const {
    return mesh_.vertices[mesh_.triangles[triangle][k]];
  }

  void gather() {
    const auto across = neighbours(mesh_, incidence(mesh_));
    DisjointSets<> sets(mesh_.triangles.size());
    bool open = false;
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      for (const Index other : across[t]) {
        open = open || other == no_neighbour;
        if (other != no_neighbour) {
          sets.join(t, other);
        }
      }
    }
    if (open) {
      for (const auto& [one, other] : find_seams(mesh_).meeting) {
        sets.join(one, other);
      }
    }
    std::vector<Index> number(mesh_.triangles.size());
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      const Index root = sets.root(t);
      if (root == t) {
        number[t] = narrow<Index>(all_.size());
        all_.emplace_back();
      }
      Component& piece = all_[number[root]];
      piece.triangles.push_back(t);
      piece.area += triangle_area(corner(t, 0), corner(t, 1), corner(t, 2));
      piece.closed = piece.closed && std::ranges::find(across[t], no_neighbour) == across[t].end();
    }
  }

  void measure(Component& piece) const {
    piece.box = {corner(piece.triangles.front(), 0), corner(piece.triangles.front(), 0)};
    const Vec3 origin = piece.box.lower;
    double volume = 0;
    for (const Index t : piece.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        piece.box.lower = piece.box.lower.cwiseMin(corner(t, k));
        piece.box.upper = piece.box.upper.cwiseMax(corner(t, k));
      }
      volume += (corner(t, 0) - origin).dot((corner(t, 1) - origin).cross(corner(t, 2) - origin)) / 6;
    }
    if (piece.closed) {
      const bool none = !(std::abs(volume) > no_volume * std::pow(piece.area, 1.5));
      piece.sign = none ? 0 : volume > 0 ? 1 : -1;
    } else {
      const double mean = mean_winding(piece);
      piece.sign = mean >= has_inside ? 1 : mean <= -has_inside ? -1 : 0;
      piece.bulges_back = piece.sign == 0 && mean <= -bulges;
    }
  }

  /// At the centres of triangles that share the area evenly; a triangle says nothing of its own centre.
  [[nodiscard]] double mean_winding(const Component& piece) const {
    const std::size_t points = std::clamp(most_angles / piece.triangles.size(), fewest_points, most_points);
    std::vector<Index> chosen;
    double passed = 0;
    for (const Index t : piece.triangles) {
      passed += triangle_area(corner(t, 0), corner(t, 1), corner(t, 2));
      if (passed * real(points) >= (real(chosen.size()) + 0.5) * piece.area) {
        chosen.push_back(t);
      }
    }
    if (chosen.empty()) {
      return 0;
    }
    std::vector<double> seen(chosen.size(), 0);
    parallel_for_blocks(chosen.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        check_interrupt();
        const Vec3 p = (corner(chosen[i], 0) + corner(chosen[i], 1) + corner(chosen[i], 2)) / 3;
        for (const Index t : piece.triangles) {
          seen[i] += t == chosen[i] ? 0 : winding(p, corner(t, 0), corner(t, 1), corner(t, 2));
        }
      }
    });
    double sum = 0;
    for (const double w : seen) {
      sum += w;
    }
    return sum / real(chosen.size());
  }

  void nest() {
    std::vector<Component*> with_inside;
    std::vector<Vec3> lower, upper;
    for (Component& piece : all_) {
      if (piece.sign != 0) {
        with_inside.push_back(&piece);
        lower.push_back(piece.box.lower);
        upper.push_back(piece.box.upper);
      }
    }
    std::map<Index, SignedDistance> sides;
    for (const auto& pair : overlapping_boxes(lower, upper)) {
      for (const auto& [inner, outer] : {std::array{pair[0], pair[1]}, std::array{pair[1], pair[0]}}) {
        Component& one = *with_inside[inner];
        const Component& other = *with_inside[outer];
        const Vec3 centre = (one.box.lower + one.box.upper) / 2;
        if (one.box.diagonal() < other.box.diagonal() && (centre - other.box.lower).minCoeff() >= 0 &&
            (other.box.upper - centre).minCoeff() >= 0) {
          const auto& side = sides.try_emplace(outer, alone(other)).first->second;
          one.depth += lies_within(one, other, side) ? 1 : 0;
        }
      }
    }
  }

  [[nodiscard]] TriangleMesh alone(const Component& piece) const {
    TriangleMesh mesh{mesh_.vertices, {}};
    for (const Index t : piece.triangles) {
      mesh.triangles.push_back(mesh_.triangles[t]);
    }
    return without_unused(std::move(mesh));
  }

  [[nodiscard]] bool lies_within(const Component& one, const Component& other, const SignedDistance& side) const {
    const std::size_t stride = std::max<std::size_t>(1, one.triangles.size() / judges);
    long inside = 0;
    for (std::size_t i = 0; i < one.triangles.size(); i += stride) {
      inside += (side.at(corner(one.triangles[i], 0)).distance < 0) == (other.sign > 0) ? 1 : -1;
    }
    return inside > 0;
  }

  const TriangleMesh& mesh_;
  std::vector<Component> all_;
};

}  // namespace

Facing facing_of(const TriangleMesh& mesh) {
  require_valid(mesh);
  return Components(mesh).facing();
}

TriangleMesh turned_outward(TriangleMesh mesh, const Facing& facing) {
  if (facing.is_wrong.size() != mesh.triangles.size()) {
    throw InputError("the sides of the pieces belong to another mesh: the numbers of triangles differ");
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (facing.is_wrong[t]) {
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    }
  }
  return mesh;
}

}  // namespace tunica
