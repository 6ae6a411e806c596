#include "shell/fit_worst.hpp"

#include "shell/fit_edit.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr double uneven_error = 0.6;  // of the largest: patches so far off decide about the distance
constexpr double uneven_share = 0.1;  // of all patches: fewer than these are a few

}  // namespace

std::size_t split_worst(FitState& state, double limit, std::size_t most) {
  FitMesh& mesh = state.mesh;
  std::vector<std::pair<double, Index>> worst;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.is_alive(static_cast<Index>(t)) && state.patches[t].error > limit) {
      worst.emplace_back(-state.patches[t].error, static_cast<Index>(t));
    }
  }
  std::sort(worst.begin(), worst.end());
  std::vector<std::uint8_t> touched(mesh.positions.size(), 0);
  std::size_t splits = 0;
  for (const auto& [error, t] : worst) {
    if (splits >= most) {
      break;
    }
    const auto v = mesh.triangles[t];
    if (!mesh.is_alive(t) ||
        std::any_of(v.begin(), v.end(), [&](Index i) { return i >= touched.size() || touched[i] != 0; })) {
      continue;
    }
    std::size_t longest = 0;
    double length = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double l = (mesh.positions[v[(k + 1) % 3]] - mesh.positions[v[k]]).norm();
      if (l > length) {
        length = l;
        longest = k;
      }
    }
    if (split_edge(state, v[longest], v[(longest + 1) % 3], limit)) {
      ++splits;
      for (const Index i : v) {
        touched[i] = 1;
      }
    }
  }
  return splits;
}

std::size_t place_worst(FitState& state, double limit) {
  FitMesh& mesh = state.mesh;
  std::vector<std::pair<double, Index>> nodes;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    double error = 0;
    for (const Index t : mesh.around[v]) {
      error = std::max(error, state.patches[t].error);
    }
    if (error > limit) {
      nodes.emplace_back(-error, static_cast<Index>(v));
    }
  }
  std::sort(nodes.begin(), nodes.end());
  std::size_t better = 0;
  for (const auto& [negative, v] : nodes) {
    better += move_node(state, v, mesh.positions[v], 0, 0.99 * -negative) ? 1 : 0;
  }
  return better;
}

bool is_uneven(const FitState& state) {
  const double far = uneven_error * state.error();
  const auto far_patches = static_cast<double>(
      std::count_if(state.patches.begin(), state.patches.end(), [&](const auto& p) { return p.error > far; }));
  return far_patches < uneven_share * static_cast<double>(state.mesh.alive);
}

}  // namespace tunica
