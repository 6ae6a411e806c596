// mechanics/model: what a scene says, resolved: bodies, walls, loads, supports, contacts; where its nodes are.
#pragma once

#include "tunica/core/types.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tunica {

/// Displacements (not positions: those would lose the digits) and rotations of all nodes, from the reference.
struct Configuration {
  std::vector<Vec3> displacement;
  std::vector<Eigen::Quaterniond> rotation;
  /// Of the nodes of solids, in units of their shear modulus, positive in tension; empty where there are none.
  std::vector<double> pressure{};

  /// The reference, without pressures.
  static Configuration at_rest(std::size_t nodes) {
    return {std::vector<Vec3>(nodes, Vec3::Zero()),
            std::vector<Eigen::Quaterniond>(nodes, Eigen::Quaterniond::Identity())};
  }
};

}  // namespace tunica
