#include "shell/fit_step.hpp"

#include "shell/fit_place.hpp"

namespace tunica {
namespace {

constexpr double largest_tilt = 0.3;  // rad
constexpr double largest_move = 0.3;  // of the mean edge at the node

}  // namespace

void take_step(FitMesh& mesh, Index node, const std::vector<Index>& slots, const NodeStep& step,
               const std::vector<Vec3>& positions, const std::vector<Vec3>& normals, double kink) {
  Vec3 move = step.move;
  if (const double far = move.norm(); far > largest_move * step.edge) {
    move *= largest_move * step.edge / far;
  }
  if (step.along) {
    move = *step.along * step.along->dot(move);
  }
  mesh.positions[node] = positions[node] + move;
  std::vector<Vec3> tilted;
  std::vector<Index> sectors;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const Vec3& n = normals[slots[i]];
    Vec2 tilt = step.tilts[i];
    if (const double far = tilt.norm(); far > largest_tilt) {
      tilt *= largest_tilt / far;
    }
    const auto axes = tilt_axes(n);
    tilted.push_back((n + tilt[0] * axes[0] + tilt[1] * axes[1]).normalized());
    sectors.push_back(mesh.sectors[slots[i]]);
  }
  if (slots.size() > 1) {
    hold_together(tilted, sectors, kink);
  }
  for (std::size_t i = 0; i < slots.size(); ++i) {
    mesh.normals[slots[i]] = tilted[i];
  }
}

void take_back(FitMesh& mesh, Index node, const std::vector<Index>& slots, const std::vector<Vec3>& positions,
               const std::vector<Vec3>& normals) {
  mesh.positions[node] = positions[node];
  for (const Index s : slots) {
    mesh.normals[s] = normals[s];
  }
}

}  // namespace tunica
