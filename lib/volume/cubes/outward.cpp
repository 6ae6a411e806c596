#include "tunica/volume/cubes/outward.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

// Beyond the image everything is outside, or, with an open border, as it is on the border.
bool inside(const Mask& mask, bool open_border, const Vec3& index) {
  std::array<std::size_t, 3> voxel{};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const auto last = real(mask.dims()[axis] - 1);
    if (!open_border && !(index[axis] >= 0 && index[axis] <= last)) {
      return false;
    }
    voxel[axis] = truncated<std::size_t>(std::clamp(index[axis], 0.0, last));
  }
  return mask(voxel[0], voxel[1], voxel[2]);
}

// The step from inside to outside at a point on the grid's edges: along each axis, from the voxel below to that above.
Vec3 outward_step(const Mask& mask, bool open_border, const Vec3& point) {
  const Vec3 nearest = point.array().round();
  Vec3 step = Vec3::Zero();
  const bool centre = ((point - nearest).cwiseAbs().array() < on_grid).all();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (!centre && std::abs(point[axis] - nearest[axis]) < on_grid) {
      continue;
    }
    Vec3 below = nearest;
    Vec3 above = nearest;
    below[axis] = centre ? nearest[axis] - 1 : std::floor(point[axis]);
    above[axis] = centre ? nearest[axis] + 1 : std::floor(point[axis]) + 1;
    step[axis] = int{inside(mask, open_border, below)} - int{inside(mask, open_border, above)};
  }
  return step;
}

}  // namespace

bool faces_outward(const TriangleMesh& mesh, const Mask& mask, bool open_border) {
  require_valid(mesh);
  const Mat3 axes = mask.affine().leftCols<3>();
  const Mat3 to_index = axes.inverse();
  const double side = axes.determinant() < 0 ? -1 : 1;  // a mirroring affine turns normals round
  std::vector<Vec3> points(mesh.vertices.size());
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  DisjointSets pieces(mesh.vertices.size());
  for (std::size_t vertex = 0; vertex < points.size(); ++vertex) {
    points[vertex] = to_index * (mesh.vertices[vertex] - mask.affine().col(3));
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 normal = side * (points[b] - points[a]).cross(points[c] - points[a]);
    for (const Index corner : {a, b, c}) {
      normals[corner] += normal;
    }
    pieces.join(a, b);
    pieces.join(b, c);
  }
  std::vector<double> votes(points.size(), 0.0);
  for (Index vertex = 0; vertex < points.size(); ++vertex) {
    if (normals[vertex].isZero(0)) {
      continue;  // of no triangle: it may be anywhere
    }
    votes[pieces.root(vertex)] += normals[vertex].dot(outward_step(mask, open_border, points[vertex]));
  }
  return std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                     [&](const auto& triangle) { return votes[pieces.root(triangle[0])] > 0; });
}

}  // namespace tunica
