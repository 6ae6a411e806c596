#include "tunica/wall/mid_surface.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int pieces_per_edge = 4;   // where distances are sampled
constexpr double least_stand = 0.2;  // of a normal on its facet: less is no shell

void require_unfolded(const ShellMesh& before, const ShellMesh& after) {
  for (std::size_t t = 0; t < after.triangles.size(); ++t) {
    const auto& v = after.triangles[t];
    const auto& x = after.vertices;
    const Vec3 facet = (x[v[1]] - x[v[0]]).cross(x[v[2]] - x[v[0]]).normalized();
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(facet.dot(after.normal(t, k)) >= least_stand)) {
        const Vec3& at = before.vertices[v[0]];
        throw RequirementError(
            fmt::format("the middle of the wall folds at ({:.4g}, {:.4g}, {:.4g}) mm: half of the wall is thicker than "
                        "the face's radius of curvature there; take a smaller thickness, fewer shells or a smoother "
                        "surface",
                        at.x(), at.y(), at.z()));
      }
    }
  }
}

}  // namespace

TriangleMesh moved_half_way(TriangleMesh coarse, const Target& face, WallFace which, double thickness,
                            const Target& half_way) {
  require_positive(thickness, "the thickness");
  require_valid(coarse);
  const double way = which == WallFace::inner ? thickness / 2 : -thickness / 2;
  for (Vec3& p : coarse.vertices) {
    const Target::Foot foot = face.closest(p);
    p = half_way.tree().closest(foot.point + way * foot.normal).point;
  }
  return coarse;
}

MidSurface mid_surface_between(const ShellMesh& face, WallFace which, const Target& other) {
  require_shells(face);
  if (face.normals.size() != face.vertices.size()) {
    throw InputError("the middle of a wall needs a normal at each vertex of its face");
  }
  MidSurface middle{face, {}};
  const std::vector<Vec3> its_normals = vertex_normals(other.mesh());
  const auto facets = facet_normals(other.mesh());
  double inwards = 0;
  for (std::size_t v = 0; v < face.vertices.size(); ++v) {
    const ClosestPoint::Hit hit = other.tree().closest(face.vertices[v]);
    const Vec3 way = hit.point - face.vertices[v];
    middle.thickness.push_back(way.norm());
    middle.shell.vertices[v] += way / 2;
    inwards -= way.dot(face.normals[v]);
    const auto& corners = other.mesh().triangles[hit.triangle];
    const Vec3 b = barycentric(hit.point, other.mesh().vertices[corners[0]], other.mesh().vertices[corners[1]],
                               other.mesh().vertices[corners[2]]);
    const Vec3 there = b[0] * its_normals[corners[0]] + b[1] * its_normals[corners[1]] + b[2] * its_normals[corners[2]];
    const Vec3 mean = face.normals[v] + (there.norm() > 0 ? Vec3(there.normalized()) : facets[hit.triangle]);
    if (mean.norm() > 0) {
      middle.shell.normals[v] = mean.normalized();
    }
  }
  if ((inwards > 0) != (which == WallFace::outer)) {
    throw InputError(fmt::format("the wall's other face lies {} the target, which is said to be its {} face",
                                 inwards > 0 ? "inside" : "outside", which == WallFace::outer ? "outer" : "inner"));
  }
  require_unfolded(face, middle.shell);
  return middle;
}

std::array<double, 2> half_wall_error(const ShellMesh& shell, const Target& face, double thickness) {
  require_shells(shell);
  require_positive(thickness, "the thickness");
  const Tessellation fine = tessellate_uniformly(shell, pieces_per_edge);
  const std::vector<Vec3>& x = fine.mesh.vertices;
  std::vector<double> off(x.size());
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    off[i] = std::abs(std::sqrt(face.tree().closest(x[i]).squared_distance) - thickness / 2);
    largest = std::max(largest, off[i]);
  }
  double sum = 0, whole = 0;
  for (const auto& v : fine.mesh.triangles) {
    const double area = triangle_area(x[v[0]], x[v[1]], x[v[2]]);
    whole += area;
    sum += area * (off[v[0]] + off[v[1]] + off[v[2]]) / 3;
  }
  return {whole > 0 ? sum / whole : 0, largest};
}

}  // namespace tunica
