#pragma once

#include "shell/families.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_start.hpp"
#include "shell/fit_state.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace tunica::testing {

/// A sphere with waves.
inline TriangleMesh wavy(int times) {
  TriangleMesh mesh = sphere(times);
  for (Vec3& p : mesh.vertices) {
    p *= 10 * (1 + 0.12 * std::sin(3 * p.x() + 1) * std::cos(2 * p.y()) + 0.05 * std::sin(5 * p.z() + 2 * p.x()));
  }
  return mesh;
}

inline FitState state_of(const FitSamples& samples, const TriangleMesh& mesh) {
  FitStart start;
  start.mesh = mesh;
  FitState state(samples, prepare_fit(start, samples.target()), {});
  state.attach();
  state.measure();
  return state;
}

/// As few shells as single mergers leave within `limit` (mm).
inline void collapse_to(FitState& state, double limit) {
  for (int i = 0; i < 6; ++i) {
    state.solve(i < 3 ? 2 : 8, 1);
    state.attach();
    state.measure();
  }
  collapse_edges(state, limit, 4, {});
}

/// Degrees.
inline double angle_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

/// Degrees: by which normals of one node and sector part, at most.
inline double largest_kink(const FitMesh& mesh) {
  double largest = 0;
  std::vector<Index> slots;
  for (Index v = 0; v < mesh.positions.size(); ++v) {
    mesh.slots_of(v, slots);
    for (const Index a : slots) {
      for (const Index b : slots) {
        if (mesh.sectors[a] == mesh.sectors[b]) {
          largest = std::max(largest, angle_between(mesh.normals[a], mesh.normals[b]));
        }
      }
    }
  }
  return largest;
}

}  // namespace tunica::testing
