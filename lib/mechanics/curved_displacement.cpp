#include "mechanics/curved_displacement.hpp"

#include "core/threads.hpp"
#include "mechanics/rotation.hpp"

#include <Eigen/SVD>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t vertices_per_block = 4096;

// A shell between two states, as the co-rotational element sees it.
struct Motion {
  std::array<Vec3, 3> displacement;
  std::array<Vec3, 3> bending;  ///< rotation vectors of the corners relative to the facet, in its reference frame
  Mat3 frame;                   ///< rotation of the facet
  Vec3 normal;                  ///< of the reference facet
};

bool at_rest(const ShellMesh& mesh, std::size_t triangle, std::size_t first, const State& state) {
  return std::ranges::all_of(mesh.triangles[triangle], [&](Index node) {
    return state.displacement[first + node].isZero(0) && state.rotation[first + node].isZero(0);
  });
}

// nullopt when the triangle has collapsed: then it has no facet to turn with.
std::optional<Motion> motion_of(const ShellMesh& mesh, std::size_t triangle, std::size_t first, const State& state) {
  const auto& nodes = mesh.triangles[triangle];
  std::array<Vec3, 3> before, after;
  Motion motion;
  for (std::size_t k = 0; k < 3; ++k) {
    before[k] = mesh.vertices[nodes[k]];
    motion.displacement[k] = state.displacement[first + nodes[k]];
    after[k] = before[k] + motion.displacement[k];
  }
  const Vec3 area = (before[1] - before[0]).cross(before[2] - before[0]);
  const Vec3 area_after = (after[1] - after[0]).cross(after[2] - after[0]);
  motion.normal = area.normalized();
  if (!(area_after.norm() > 1e-12 * area.norm())) {
    return std::nullopt;
  }
  Mat3 gradient = area_after.normalized() * motion.normal.transpose();
  Vec3 slope = Vec3::Zero();  // of the normal displacement, linear over the facet
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 opposite = before[(k + 2) % 3] - before[(k + 1) % 3];
    const Vec3 barycentric = motion.normal.cross(opposite) / area.norm();
    gradient += after[k] * barycentric.transpose();
    slope += motion.normal.dot(motion.displacement[k]) * barycentric;
  }
  const Eigen::JacobiSVD<Mat3> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
  motion.frame = svd.matrixU() * svd.matrixV().transpose();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3& rotation = state.rotation[first + nodes[k]];
    motion.bending[k] = state.linear ? Vec3(rotation + motion.normal.cross(slope))
                                     : logarithm(Mat3(motion.frame.transpose() * exponential(rotation)));
  }
  return motion;
}

// The patch after the motion. Its slopes are those of the reference plus what the element's own rotations add, as in
// its bending energy; the tangent of a turned normal would overshoot where a coarse mesh bends far within one shell.
CubicPatch moved_patch(const ShellMesh& mesh, std::size_t triangle, const Motion& motion) {
  ShellMesh corner;
  corner.vertices.resize(3);
  corner.triangles = {{0, 1, 2}};
  corner.corner_normals.resize(1);
  corner.patch = mesh.patch;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 normal = mesh.normal(triangle, static_cast<int>(k));
    const Vec3 slope = motion.normal - normal / normal.dot(motion.normal) + motion.normal.cross(motion.bending[k]);
    corner.vertices[k] = mesh.vertices[mesh.triangles[triangle][k]] + motion.displacement[k];
    corner.corner_normals[0][k] = motion.frame * (motion.normal - slope).normalized();
  }
  return curved_patch(corner, 0);
}

}  // namespace

std::vector<Vec3> curved_displacement(const Model& model, std::size_t body, const State& state,
                                      const Tessellation& surface) {
  const ShellMesh& mesh = model.shells[body].mesh;
  const std::size_t first = model.first_node(body);
  std::vector<Vec3> result(surface.mesh.vertices.size());
  parallel_for_blocks(result.size(), vertices_per_block, [&](std::size_t begin, std::size_t end) {
    std::size_t triangle = mesh.triangles.size();
    CubicPatch reference;
    std::optional<CubicPatch> deformed;
    for (std::size_t v = begin; v < end; ++v) {
      if (surface.vertex_shell[v] != triangle) {
        triangle = surface.vertex_shell[v];
        reference = curved_patch(mesh, triangle);
        deformed.reset();
        if (at_rest(mesh, triangle, first, state)) {
          deformed = reference;  // zero to the last bit
        } else if (const auto motion = motion_of(mesh, triangle, first, state)) {
          deformed = moved_patch(mesh, triangle, *motion);
        }
      }
      const Vec2& b = surface.barycentric[v];
      if (deformed) {
        result[v] = deformed->point(b) - reference.point(b);
      } else {
        const auto& nodes = mesh.triangles[triangle];
        result[v] = (1 - b.x() - b.y()) * state.displacement[first + nodes[0]] +
                    b.x() * state.displacement[first + nodes[1]] + b.y() * state.displacement[first + nodes[2]];
      }
    }
  });
  return result;
}

std::size_t count_unresolved(const Model& model, const State& state, double angle) {
  std::size_t count = 0;
  for (std::size_t body = 0; body < model.shells.size() && !state.linear; ++body) {
    const ShellMesh& mesh = model.shells[body].mesh;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto motion = motion_of(mesh, t, model.first_node(body), state);
      const auto far = [&](const Vec3& bending) { return !(motion->normal.cross(bending).norm() <= angle); };
      count += !motion || std::ranges::any_of(motion->bending, far) ? 1 : 0;
    }
  }
  return count;
}

}  // namespace tunica
