#include "surface/self_intersections.hpp"

#include "core/error.hpp"
#include "core/progress.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Intersections_3/Triangle_3_Triangle_3.h>
#include <CGAL/box_intersection_d.h>

#include <algorithm>
#include <unordered_set>

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

}  // namespace

std::vector<std::array<Index, 2>> find_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch,
                                                          const std::vector<std::array<Index, 3>>& patch_corners) {
  TUNICA_ASSERT(patch.empty() || patch.size() == mesh.triangles.size());
  std::vector<Kernel::Triangle_3> triangles;
  std::vector<TriangleBox> boxes;
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
  std::unordered_set<std::uint64_t> pairs;
  std::size_t looked_at = 0;
  const auto look_at = [&](const TriangleBox& one, const TriangleBox& other) {
    if (++looked_at % 4096 == 0) {
      check_interrupt();
    }
    Index i = one.triangle();
    Index j = other.triangle();
    if (!patch.empty()) {
      i = patch[i];
      j = patch[j];
      if (i == j || share_a_corner(patch_corners[i], patch_corners[j])) {
        return;
      }
    } else if (share_a_corner(mesh.triangles[i], mesh.triangles[j])) {
      return;
    }
    const std::uint64_t pair = std::uint64_t{std::min(i, j)} << 32 | std::max(i, j);
    if (!pairs.contains(pair) && CGAL::do_intersect(triangles[one.triangle()], triangles[other.triangle()])) {
      pairs.insert(pair);
    }
  };
  CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), look_at);
  std::vector<std::array<Index, 2>> found;
  for (const std::uint64_t pair : pairs) {
    found.push_back({static_cast<Index>(pair >> 32), static_cast<Index>(pair & max_index)});
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::size_t count_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch,
                                     const std::vector<std::array<Index, 3>>& patch_corners) {
  return find_self_intersections(mesh, patch, patch_corners).size();
}

}  // namespace tunica
