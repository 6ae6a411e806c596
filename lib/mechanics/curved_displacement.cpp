#include "mechanics/curved_displacement.hpp"

#include "core/threads.hpp"
#include "mechanics/rotation.hpp"

namespace tunica {
namespace {

constexpr std::size_t vertices_per_block = 4096;

// In the linear theory a rotation is not a finite one: the normal moves by rotation x normal.
Vec3 turned(const Vec3& normal, const Vec3& rotation, bool linear) {
  return linear ? Vec3((normal + rotation.cross(normal)).normalized()) : Vec3(exponential(rotation) * normal);
}

}  // namespace

std::vector<Vec3> curved_displacement(const Model& model, std::size_t body, const State& state,
                                      const Tessellation& surface) {
  const ShellMesh& mesh = model.shells[body].mesh;
  const std::size_t first = model.first_node(body);
  std::vector<Vec3> result(surface.mesh.vertices.size());
  parallel_for_blocks(result.size(), vertices_per_block, [&](std::size_t begin, std::size_t end) {
    std::size_t triangle = mesh.triangles.size();
    std::array<Vec3, 3> moves;
    CubicPatch reference;
    std::optional<CubicPatch> deformed;
    ShellMesh corner;
    corner.vertices.resize(3);
    corner.triangles = {{0, 1, 2}};
    corner.corner_normals.resize(1);
    corner.patch = mesh.patch;
    for (std::size_t v = begin; v < end; ++v) {
      if (surface.vertex_shell[v] != triangle) {
        triangle = surface.vertex_shell[v];
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t node = mesh.triangles[triangle][k];
          moves[k] = state.displacement[first + node];
          corner.vertices[k] = mesh.vertices[node] + moves[k];
          corner.corner_normals[0][k] =
              turned(mesh.normal(triangle, static_cast<int>(k)), state.rotation[first + node], state.linear);
        }
        reference = curved_patch(mesh, triangle);
        deformed.reset();
        if (normal_agreement(corner, 0) >= least_normal_agreement) {
          deformed = curved_patch(corner, 0);
        }
      }
      const Vec2& b = surface.barycentric[v];
      result[v] = deformed ? Vec3(deformed->point(b) - reference.point(b))
                           : Vec3((1 - b.x() - b.y()) * moves[0] + b.x() * moves[1] + b.y() * moves[2]);
    }
  });
  return result;
}

}  // namespace tunica
