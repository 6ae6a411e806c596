#pragma once

#include "shell/families.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_start.hpp"
#include "shell/fit_state.hpp"

#include <cmath>

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

}  // namespace tunica::testing
