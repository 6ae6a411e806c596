#include "tunica/surface/mesh/self_intersections.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Intersections_3/Segment_3_Triangle_3.h>
#include <CGAL/Intersections_3/Triangle_3_Triangle_3.h>
#include <CGAL/box_intersection_d.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <vector>

// Boxes that overlap: Zomorodian, Edelsbrunner, Fast software for box intersections (2002), as in CGAL.
namespace tunica {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using NumberedBox = CGAL::Box_intersection_d::Box_d<double, 3, CGAL::Box_intersection_d::ID_EXPLICIT>;

// A box that knows what it is around.
class TriangleBox : public NumberedBox {
public:
  TriangleBox(const CGAL::Bbox_3& bounds, Index triangle) : NumberedBox(bounds), triangle_(triangle) {}
  [[nodiscard]] Index triangle() const { return triangle_; }
  [[nodiscard]] std::size_t id() const { return triangle_; }

private:
  Index triangle_;
};

Kernel::Point_3 exact(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

Kernel::Triangle_3 exact(const std::array<Vec3, 3>& t) { return {exact(t[0]), exact(t[1]), exact(t[2])}; }

/// Whether the corners of `other` from `first` on lie certainly on one side of the plane of `one`. The determinants are
/// of differences no larger than `size`, each rounded once: their errors sum up to less than 5e-15 size^3.
bool is_clear_of_plane(const std::array<Vec3, 3>& one, const std::array<Vec3, 3>& other, std::size_t first) {
  const Vec3 u = one[1] - one[0];
  const Vec3 v = one[2] - one[0];
  const Vec3 normal = u.cross(v);
  double size = std::max(u.cwiseAbs().maxCoeff(), v.cwiseAbs().maxCoeff());
  double least = infinity;
  double most = -least;
  for (std::size_t k = first; k < 3; ++k) {
    const Vec3 w = other[k] - one[0];
    size = std::max(size, w.cwiseAbs().maxCoeff());
    least = std::min(least, normal.dot(w));
    most = std::max(most, normal.dot(w));
  }
  const double rounding = 1e-14 * size * size * size;
  return least > rounding || most < -rounding;
}

bool share_a_corner(const std::array<Index, 3>& one, const std::array<Index, 3>& other) {
  return std::find_first_of(one.begin(), one.end(), other.begin(), other.end()) != one.end();
}

/// Triangles, and the boxes of those that have an area.
struct Bodies {
  std::vector<Kernel::Triangle_3> triangles;
  std::vector<TriangleBox> boxes;

  explicit Bodies(const TriangleMesh& mesh) {
    triangles.reserve(mesh.triangles.size());
    boxes.reserve(mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [i, j, k] = mesh.triangles[t];
      triangles.push_back(exact({mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]}));
      if (!triangles.back().is_degenerate()) {
        boxes.emplace_back(triangles.back().bbox(), narrow<Index>(t));
      }
    }
  }

  [[nodiscard]] bool cross(Index one, Index other) const {
    return CGAL::do_intersect(triangles[one], triangles[other]);
  }
};

/// Tells of every pair of boxes that overlap.
template <typename Tell>
void overlapping(std::vector<TriangleBox>& boxes, const Tell& tell) {
  std::size_t looked_at = 0;
  CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), [&](const TriangleBox& one, const TriangleBox& other) {
    if (++looked_at % 4096 == 0) {
      check_interrupt();
    }
    tell(one.triangle(), other.triangle());
  });
}

std::vector<std::array<Index, 2>> crossing_patches(Bodies& bodies, const std::vector<Index>& patch,
                                                   const std::vector<std::array<Index, 3>>& patch_corners) {
  // Patches whose boxes overlap are few: only their triangles are looked at.
  std::vector<std::vector<TriangleBox>> boxes_of(patch_corners.size());
  std::vector<CGAL::Bbox_3> hull(patch_corners.size());
  for (const TriangleBox& box : bodies.boxes) {
    boxes_of[patch[box.triangle()]].push_back(box);
    hull[patch[box.triangle()]] += box.bbox();
  }
  std::vector<TriangleBox> hulls;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    if (!boxes_of[i].empty()) {
      hulls.emplace_back(hull[i], narrow<Index>(i));
    }
  }
  std::vector<std::array<Index, 2>> found;
  overlapping(hulls, [&](Index i, Index j) {
    if (share_a_corner(patch_corners[i], patch_corners[j])) {
      return;
    }
    const bool cross = std::any_of(boxes_of[i].begin(), boxes_of[i].end(), [&](const TriangleBox& one) {
      return CGAL::do_overlap(one.bbox(), hull[j]) &&
             std::any_of(boxes_of[j].begin(), boxes_of[j].end(), [&](const TriangleBox& other) {
               return CGAL::do_overlap(one.bbox(), other.bbox()) && bodies.cross(one.triangle(), other.triangle());
             });
    });
    if (cross) {
      found.push_back({std::min(i, j), std::max(i, j)});
    }
  });
  return found;
}

}  // namespace

bool triangles_cross(const std::array<Vec3, 3>& one, const std::array<Vec3, 3>& other) {
  if (is_clear_of_plane(one, other, 0) || is_clear_of_plane(other, one, 0)) {
    return false;
  }
  const Kernel::Triangle_3 a = exact(one);
  const Kernel::Triangle_3 b = exact(other);
  return !a.is_degenerate() && !b.is_degenerate() && CGAL::do_intersect(a, b);
}

bool triangles_cross_beside_corner(const std::array<Vec3, 3>& one, const std::array<Vec3, 3>& other) {
  if (is_clear_of_plane(one, other, 1) || is_clear_of_plane(other, one, 1)) {
    return false;
  }
  const Kernel::Triangle_3 a = exact(one);
  const Kernel::Triangle_3 b = exact(other);
  // What they share beside the corner reaches the opposite edge of one of them.
  return !a.is_degenerate() && !b.is_degenerate() &&
         (CGAL::do_intersect(Kernel::Segment_3(a[1], a[2]), b) || CGAL::do_intersect(Kernel::Segment_3(b[1], b[2]), a));
}

std::vector<std::array<Index, 2>> overlapping_boxes(const std::vector<Vec3>& lower, const std::vector<Vec3>& upper) {
  if (lower.size() != upper.size()) {
    throw InputError(fmt::format("{} lower and {} upper corners make no boxes", lower.size(), upper.size()));
  }
  std::vector<TriangleBox> boxes;
  boxes.reserve(lower.size());
  for (std::size_t i = 0; i < lower.size(); ++i) {
    const Vec3 &l = lower[i], &u = upper[i];
    if (!l.allFinite() || !u.allFinite()) {
      throw InputError(fmt::format("a corner of box {} is not finite", i));
    }
    boxes.emplace_back(CGAL::Bbox_3(l.x(), l.y(), l.z(), u.x(), u.y(), u.z()), narrow<Index>(i));
  }
  std::vector<std::array<Index, 2>> found;
  overlapping(boxes, [&](Index i, Index j) { found.push_back({std::min(i, j), std::max(i, j)}); });
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::array<Index, 2>> find_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch,
                                                          const std::vector<std::array<Index, 3>>& patch_corners) {
  require_valid(mesh);
  if (!patch.empty() && (patch.size() != mesh.triangles.size() ||
                         *std::max_element(patch.begin(), patch.end()) >= patch_corners.size())) {
    throw InputError("the patches are not those of the triangles: one for each is needed, with its corners");
  }
  Bodies bodies(mesh);
  std::vector<std::array<Index, 2>> found;
  if (!patch.empty()) {
    found = crossing_patches(bodies, patch, patch_corners);
  } else {
    overlapping(bodies.boxes, [&](Index i, Index j) {
      if (!share_a_corner(mesh.triangles[i], mesh.triangles[j]) && bodies.cross(i, j)) {
        found.push_back({std::min(i, j), std::max(i, j)});
      }
    });
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

std::size_t count_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch,
                                     const std::vector<std::array<Index, 3>>& patch_corners) {
  return find_self_intersections(mesh, patch, patch_corners).size();
}

}  // namespace tunica
