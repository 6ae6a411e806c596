#pragma once

#include "shell/fit_mesh.hpp"

#include <optional>
#include <vector>

namespace tunica {

/// What a node does in a step of all nodes.
struct NodeStep {
  Vec3 move;                  ///< mm
  std::vector<Vec2> tilts;    ///< rad, about tilt_axes(), of each of its slots
  double edge = 0;            ///< mm: mean length of its edges
  std::optional<Vec3> along;  ///< it may move along this direction only
};

/// Takes a node by its step from where it was, at most 0.3 of its edges, and turns its normals, at most by 0.3 rad;
/// normals of one sector part by `kink` degrees at most.
/// @param mesh     changed; with the connectivity of before
/// @param slots    of the node
/// @param positions, normals  of the mesh before the step
void take_step(FitMesh& mesh, Index node, const std::vector<Index>& slots, const NodeStep& step,
               const std::vector<Vec3>& positions, const std::vector<Vec3>& normals, double kink);

/// Puts it back.
void take_back(FitMesh& mesh, Index node, const std::vector<Index>& slots, const std::vector<Vec3>& positions,
               const std::vector<Vec3>& normals);

}  // namespace tunica
