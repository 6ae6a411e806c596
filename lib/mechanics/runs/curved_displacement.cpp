#include "tunica/mechanics/runs/curved_displacement.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr std::size_t vertices_per_block = 4096;

// A shell between two states, as the co-rotational element sees it.
struct PatchMotion {
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
std::optional<PatchMotion> motion_of(const ShellMesh& mesh, std::size_t triangle, std::size_t first,
                                     const State& state) {
  const auto& nodes = mesh.triangles[triangle];
  std::array<Vec3, 3> before, after;
  PatchMotion motion;
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

// The surface after the motion. Its slopes are those of the reference plus what the element's own rotations add, as in
// its bending energy; the tangent of a turned normal would overshoot where a coarse mesh bends far within one shell.
// Every triangle has its own normals at its corners then; where they differ the patch knows how to meet its neighbour.
ShellMesh moved_mesh(const ShellMesh& mesh, std::size_t first, const State& state,
                     std::vector<std::uint8_t>& collapsed) {
  ShellMesh moved{mesh.vertices, mesh.triangles, {}, {}, mesh.patch};
  for (std::size_t v = 0; v < moved.vertices.size(); ++v) {
    moved.vertices[v] += state.displacement[first + v];
  }
  moved.corner_normals.resize(mesh.triangles.size());
  collapsed.assign(mesh.triangles.size(), 0);
  parallel_for_blocks(mesh.triangles.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const bool moves = !at_rest(mesh, t, first, state);
      const auto motion = moves ? motion_of(mesh, t, first, state) : std::nullopt;
      collapsed[t] = moves && !motion ? 1 : 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& normal = mesh.normal(t, k);
        if (motion) {
          const Vec3 slope =
              motion->normal - normal / normal.dot(motion->normal) + motion->normal.cross(motion->bending[k]);
          moved.corner_normals[t][k] = motion->frame * (motion->normal - slope).normalized();
        } else {
          moved.corner_normals[t][k] = normal;
        }
      }
    }
  });
  return moved;
}

/// A mesh without normals with those of its facets; nothing where it has its own.
std::optional<ShellMesh> faceted(const ShellMesh& mesh) {
  if (!mesh.normals.empty() || !mesh.corner_normals.empty()) {
    return std::nullopt;
  }
  ShellMesh result = mesh;
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vec3& origin = mesh.vertices[i];
    const Vec3 normal = (mesh.vertices[j] - origin).cross(mesh.vertices[k] - origin).normalized();
    result.corner_normals.push_back({normal, normal, normal});
  }
  return result;
}

/// The mesh of a body whose corners, and their motion, exist.
const ShellMesh& checked(const Model& model, std::size_t body, const State& state) {
  if (body >= model.shells.size()) {
    throw InputError(fmt::format("there is no shell {}: the model has {}", body, model.shells.size()));
  }
  require_valid(model, state);
  const ShellMesh& mesh = model.shells[body].mesh;
  require_corners(mesh.vertices.size(), mesh.triangles);  // curved_patches() asks for the rest
  return mesh;
}

/// The patches of a body in the reference and in a state.
class MovedPatches {
public:
  MovedPatches(const Model& model, std::size_t body, const State& state)
      : faceted_(faceted(checked(model, body, state))),
        mesh_(faceted_ ? *faceted_ : model.shells[body].mesh),
        displacement_(state.displacement.data() + model.first_node(body)),
        before_(curved_patches(mesh_)),
        after_(curved_patches(moved_mesh(mesh_, model.first_node(body), state, collapsed_))) {}

  [[nodiscard]] Vec3 displacement(std::size_t triangle, const Vec2& b) const {
    if (collapsed_[triangle] == 0) {
      return after_[triangle].point(b) - before_[triangle].point(b);
    }
    const auto& nodes = mesh_.triangles[triangle];
    return (1 - b.x() - b.y()) * displacement_[nodes[0]] + b.x() * displacement_[nodes[1]] +
           b.y() * displacement_[nodes[2]];
  }

private:
  std::optional<ShellMesh> faceted_;
  const ShellMesh& mesh_;
  const Vec3* displacement_;
  std::vector<std::uint8_t> collapsed_;
  std::vector<CubicPatch> before_;
  std::vector<CubicPatch> after_;
};

/// A place in a patch, and how far it moves.
struct Sample {
  double length = 0;
  std::size_t triangle = 0;
  Vec2 b = Vec2::Zero();
};

/// The largest of a regular grid over a patch.
Sample best_of_grid(const MovedPatches& patches, std::size_t triangle) {
  constexpr int pieces = 3;
  Sample best{-1, triangle};
  for (int i = 0; i <= pieces; ++i) {
    for (int j = 0; i + j <= pieces; ++j) {
      const Vec2 b = Vec2(i, j) / pieces;
      const double length = patches.displacement(triangle, b).norm();
      if (length > best.length) {
        best = {length, triangle, b};
      }
    }
  }
  return best;
}

/// Uphill within the patch, in ever smaller steps.
double climb(const MovedPatches& patches, Sample at) {
  constexpr double first_step = 1.0 / 6;
  constexpr double last_step = 1e-4;
  const std::array<Vec2, 6> ways{Vec2(1, 0), Vec2(-1, 0), Vec2(0, 1), Vec2(0, -1), Vec2(1, -1), Vec2(-1, 1)};
  for (double step = first_step; step > last_step;) {
    Sample best = at;
    for (const Vec2& way : ways) {
      const Vec2 b = at.b + step * way;
      if (b.minCoeff() < 0 || b.sum() > 1) {
        continue;
      }
      const double length = patches.displacement(at.triangle, b).norm();
      if (length > best.length) {
        best = {length, at.triangle, b};
      }
    }
    if (best.length == at.length) {
      step /= 2;
    }
    at = best;
  }
  return at.length;
}

}  // namespace

std::vector<Vec3> curved_displacement(const Model& model, std::size_t body, const State& state,
                                      const Tessellation& surface) {
  const MovedPatches patches(model, body, state);  // a body that exists
  const std::size_t count = model.shells[body].mesh.triangles.size();
  if (surface.vertex_shell.size() != surface.mesh.vertices.size() ||
      surface.barycentric.size() != surface.mesh.vertices.size() ||
      std::ranges::any_of(surface.vertex_shell, [&](Index patch) { return patch >= count; })) {
    throw InputError(model.name_of(body) + ": the tessellation is not of its shells");
  }
  std::vector<Vec3> result(surface.mesh.vertices.size());
  parallel_for_blocks(result.size(), vertices_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      result[v] = patches.displacement(surface.vertex_shell[v], surface.barycentric[v]);
    }
  });
  return result;
}

double largest_displacement(const Model& model, const State& state) {
  constexpr std::size_t candidate_count = 16;  // patches around the largest may hold it
  require_valid(model, state);
  double largest = 0;
  for (std::size_t i = model.first_node(model.shells.size()); i < state.displacement.size(); ++i) {
    largest = std::max(largest, state.displacement[i].norm());
  }
  for (std::size_t body = 0; body < model.shells.size(); ++body) {
    const MovedPatches patches(model, body, state);
    std::vector<Sample> samples(model.shells[body].mesh.triangles.size());
    parallel_for_blocks(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        samples[t] = best_of_grid(patches, t);
      }
    });
    const auto kept = samples.begin() + std::min(candidate_count, samples.size());
    std::partial_sort(samples.begin(), kept, samples.end(),
                      [](const Sample& a, const Sample& b) { return a.length > b.length; });
    for (auto sample = samples.begin(); sample != kept; ++sample) {
      largest = std::max(largest, climb(patches, *sample));
    }
  }
  return largest;
}

std::size_t count_unresolved(const Model& model, const State& state, double angle) {
  std::size_t count = 0;
  for (std::size_t body = 0; body < model.shells.size() && !state.linear; ++body) {
    const ShellMesh& mesh = checked(model, body, state);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto motion = motion_of(mesh, t, model.first_node(body), state);
      const auto far = [&](const Vec3& bending) { return !(motion->normal.cross(bending).norm() <= angle); };
      count += !motion || std::ranges::any_of(motion->bending, far) ? 1 : 0;
    }
  }
  return count;
}

}  // namespace tunica
