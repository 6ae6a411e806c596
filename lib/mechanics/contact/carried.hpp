#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/contact/surface_faces.hpp"

#include <optional>

namespace tunica {

/// A node that another body carries, and that is no unknown of its own:
///   x = surface(b) + R(b) d            on a face of a shell, d the offset in the reference (half a wall, and what the
///                                      meshes leave), R how the surface is turned there: its normal, and about that
///                                      the mean of the rotations of its nodes;
///   x = sum of w_k x_k                 in a tetrahedron;
///   x = sum of w_k x_k + h n           over a face of a solid, n its normal: the strain of the solid ends at its face.
/// Rigid motions of what carries it are followed exactly. A shell's node on a shell turns with R, as what is welded; on
/// a solid, whose nodes have no rotation, it is free to turn.
struct Carried {
  Index node = 0;
  bool turns = false;                  ///< with R
  std::vector<Index> carriers;         ///< global: three of a face, four of a tetrahedron
  std::size_t face = 0;                ///< of the surfaces; used where there are three carriers
  PatchWeights weights;                ///< of the points of a shell's face
  Eigen::Vector4d shares;              ///< barycentric coordinates, of three or four
  Vec3 offset = Vec3::Zero();          ///< mm, of a shell's face
  std::array<PatchWeights, 2> slopes;  ///< of the tangents there
  Mat3 frame = Mat3::Identity();       ///< columns: a tangent, another one, the normal, in the reference
  Vec3 foot = Vec3::Zero();            ///< mm, on the face, from its first node, in the reference
  std::optional<double> height{};      ///< mm, over a face of a solid

  [[nodiscard]] int freedoms() const { return turns ? 6 : 3; }  ///< that are no unknowns
};

/// The nodes of the model's attachments, each after all that it carries itself.
/// Errors: InputError: a node is carried twice, or carries itself by way of others.
std::vector<Carried> carried_nodes(const Model& model, const Surfaces& surfaces, const std::vector<Vec3>& reference);

/// Puts the carried nodes where they are carried to.
void place_carried(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
                   Configuration& configuration);

/// Pairs of nodes that elimination couples, to be added to the pattern of `pairs` (sorted, unique, both ways).
void add_carried_pairs(const std::vector<Carried>& carried, std::vector<std::vector<Index>>& neighbours);

/// The increment (6 per node) with what the carried nodes do to first order.
void expand_carried(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
                    const Configuration& configuration, VectorX& increment);

/// Moves forces, and stiffness where there is one, from the carried nodes to what carries them: by the transpose of the
/// map's derivative, its own curvature under the forces included.
/// @param internal  6 per node: minus what drives the nodes
void condense(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
              const Configuration& configuration, VectorX& internal, BlockMatrix* tangent);

}  // namespace tunica
