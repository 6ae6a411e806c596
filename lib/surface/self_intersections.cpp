#include "surface/self_intersections.hpp"

#include "core/error.hpp"
#include "core/progress.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Intersections_3/Triangle_3_Triangle_3.h>
#include <CGAL/box_intersection_d.h>

#include <algorithm>
#include <vector>

// Boxes that overlap: Zomorodian, Edelsbrunner, Fast software for box intersections (2002), as in CGAL.
namespace tunica {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Box = CGAL::Box_intersection_d::Box_d<double, 3, CGAL::Box_intersection_d::ID_EXPLICIT>;

// A box that knows its triangle.
class TriangleBox : public Box {
public:
  TriangleBox(const CGAL::Bbox_3& bounds, Index triangle) : Box(bounds), triangle_(triangle) {}
  [[nodiscard]] Index triangle() const { return triangle_; }
  [[nodiscard]] std::size_t id() const { return triangle_; }

private:
  Index triangle_;
};

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
    const auto point = [&](Index v) {
      return Kernel::Point_3(mesh.vertices[v].x(), mesh.vertices[v].y(), mesh.vertices[v].z());
    };
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [i, j, k] = mesh.triangles[t];
      triangles.emplace_back(point(i), point(j), point(k));
      if (!triangles.back().is_degenerate()) {
        boxes.emplace_back(triangles.back().bbox(), static_cast<Index>(t));
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
      hulls.emplace_back(hull[i], static_cast<Index>(i));
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

std::vector<std::array<Index, 2>> find_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch,
                                                          const std::vector<std::array<Index, 3>>& patch_corners) {
  TUNICA_ASSERT(patch.empty() || patch.size() == mesh.triangles.size());
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
