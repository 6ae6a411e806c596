#pragma once

#include "tunica/mechanics/runs/solve.hpp"

#include <array>
#include <memory>
#include <vector>

/// What the bodies bear in one state: forces, moments, strains, stresses, and what of them is large.
namespace tunica {

/// Numbers of an area of the wall: von Mises stress of either face, membrane stress (von Mises, mean over the
/// wall) and tension, largest principal strain of either face. Of recovered fields (fields.cpp). 1 % of the area has
/// more than p99.
struct WallNumbers {
  double stress_p99 = 0;  ///< MPa
  double stress_max = 0;
  Vec3 stress_max_at = Vec3::Zero();  ///< mm, in the reference, on the flat facets
  double membrane_p99 = 0;            ///< MPa
  double membrane_max = 0;
  double membrane_mean = 0;  ///< over the area: of a closed organ its volume and area all but decide it
  double tension_p99 = 0;    ///< N/mm, the largest principal membrane force, per current length
  double strain_p99 = 0;     ///< engineering strain of the co-rotated frame
  double strain_max = 0;
  /// Where the faces' stress passes its p99, the part of it that the membrane stress there is not.
  double bending_share = 0;
  /// What 2 and .5 % of the area exceed: where the 99th percentile of two meshes agrees by chance, these tell.
  struct Beside {
    std::array<double, 2> stress{}, membrane{}, tension{}, strain{};
  } beside;
};

/// Of the area farther than two bending lengths from what disturbs the wall (disturbed.hpp), and of all. Where nothing
/// is that far, all of it counts.
struct Wall : WallNumbers {
  double left_out = 0;          ///< part of the area
  bool is_all_near = false;     ///< so nothing was left out
  bool is_max_on_held = false;  ///< whole.stress_max_at is held
  WallNumbers whole;
};

/// Per-element results of one state (#elements of all shells in order; components in the element's own frame whose
/// x axis is the projection of the first edge). Forces, moments and stresses are those of the deformed wall (Cauchy):
/// per current length, over the current thickness T (l1 l2)^(-nu / (1 - nu)), with the stretches of the middle surface
/// l1, l2; a linear state takes the reference for the current wall.
struct ElementFields {
  std::vector<Vec3> membrane_force;        ///< N/mm: xx, yy, xy
  std::vector<Vec3> bending_moment;        ///< N: xx, yy, xy
  std::vector<double> von_mises_top;       ///< MPa, at the face the normal points to
  std::vector<double> von_mises_bottom;    ///< MPa
  std::vector<double> membrane_von_mises;  ///< MPa, of the mean over the wall
  std::vector<double> tension;             ///< N/mm, the largest principal membrane force
  /// At the faces, largest first; engineering strains of the co-rotated frame.
  std::vector<Vec2> principal_strain_top;
  std::vector<Vec2> principal_strain_bottom;
  std::vector<double> pressure;  ///< MPa, of this state
  /// MPa, #nodes: of shells the larger of both faces, recovered, a mean where shells disagree; of solids a mean by
  /// volume.
  std::vector<double> von_mises;
  std::vector<double> membrane_stress;  ///< MPa, #nodes: von Mises of the mean over the wall; of solids the same
  std::vector<double> strain;           ///< #nodes: the largest principal strain of both faces, likewise
  Wall wall;
  double largest_displacement = 0;      ///< mm, of the curved surfaces, also between the nodes
  double displacement_p99 = 0;          ///< mm, what 1 % of the area of the shells exceeds
  std::vector<double> solid_von_mises;  ///< MPa, #tetrahedra of all solids in order; of the true (Cauchy) stress
  double solid_strain_p99 = 0;          ///< Green's, what 1 % of the volume of solids of law corotational exceeds
  std::vector<double> solid_pressure;   ///< MPa, the same; minus the mean stress: positive in compression
  /// #solids: the energy of the jumps of stress between tetrahedra, over it and the energy of the stress: by that part
  /// a body is too stiff, and by up to twice of it where a few tetrahedra lie across what bends. Of the difference to
  /// the stress averaged at the nodes: Zienkiewicz, Zhu 1987, "A simple error estimator and adaptive procedure for
  /// practical engineering analysis".
  std::vector<double> solid_error;
  /// #shells: by what part layers that are welded upon each other give way too much, about. A shell stretches by one
  /// number per triangle where, off the middle of all layers, it should by a linear function: the jumps of the membrane
  /// forces, as above, over the part of their bending stiffness that the layers have of their own.
  std::vector<double> layer_error;
  /// #shells: the energy of the jumps of forces and moments, as above, over the strain energy of all bodies.
  std::vector<double> roughness;
};

/// Forces, moments and stresses of every triangle in one state, and what is largest. For many states of one model: the
/// elements are made ready once.
class ElementFieldEvaluator {
public:
  explicit ElementFieldEvaluator(const System& system);
  /// Of a model that is not solved here, and need not be held; it must outlive this. Errors: InputError as
  /// require_valid().
  explicit ElementFieldEvaluator(const Model& model);
  ~ElementFieldEvaluator();
  ElementFieldEvaluator(const ElementFieldEvaluator&) = delete;
  ElementFieldEvaluator& operator=(const ElementFieldEvaluator&) = delete;

  [[nodiscard]] ElementFields operator()(const State& state) const;

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The same for one state.
ElementFields element_fields(const Model& model, const State& state);

}  // namespace tunica
