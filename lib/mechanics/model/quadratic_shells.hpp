#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <array>
#include <cstddef>
#include <vector>

/// The shells of a model as other finite-element programs take them.
namespace tunica {

/// What holds a node.
struct HeldNode {
  std::array<bool, 3> translation{};
  std::array<bool, 3> rotation{};
  Vec3 displacement = Vec3::Zero();  ///< mm; of the held translations
};

/// Of all nodes of the model: what its fixes, united, hold; displacements times `factor`.
std::vector<HeldNode> held_nodes(const Model& model, double factor);

/// Six-node triangles whose nodes lie on the curved surface: first the nodes of the model, body by body, then one in
/// the middle of each edge. Where the patches at an edge do not quite meet (comas) the middle is their mean.
struct QuadraticShells {
  struct Body {
    std::size_t first_element = 0, elements = 0;
    double thickness = 0;              ///< mm; of the whole body
    bool thickness_of_nodes = false;   ///< it varies: #thickness says
    double pressure = 0;               ///< MPa, positive along the normals: the sum of the body's
    std::vector<std::size_t> corners;  ///< nodes that the body's triangles use, but for those of edges
    std::vector<std::size_t> nodes;    ///< all of them
  };

  std::vector<Vec3> nodes;                           ///< mm, reference
  std::vector<Vec3> normals;                         ///< unit: mean of the patches' normals at the node
  std::vector<double> thickness;                     ///< mm, per node; of an edge's node the mean of the ends
  std::vector<std::array<std::size_t, 6>> elements;  ///< corners counter-clockwise, then the middles of 1-2, 2-3, 3-1
  std::vector<Body> bodies;
  std::vector<HeldNode> held;  ///< per node; an edge's node is held where both ends are
  std::vector<Vec3> forces;    ///< N, per node: of forces, edge loads and forces per area
};

/// The model as quadratic shells. Rigid motions are held at three nodes of each connected piece (three, two and one
/// component), which adds no stress where the loads balance. Loads are those at the end, times `factor`.
/// Limits: model of shells alone, as require_expressible() leaves it.
QuadraticShells quadratic_shells(const Model& model, double factor);

}  // namespace tunica
