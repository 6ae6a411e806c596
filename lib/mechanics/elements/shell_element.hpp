#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/elements/element_stiffness.hpp"

#include <Eigen/Geometry>

/// One shell triangle: its reference, its energy, and the first and second derivatives of the energy.
///
/// The energy is y'Ky/2 in the element's state y, 15 numbers that no rigid motion changes:
///   0-2    mean membrane strain (xx, yy, 2 xy);
///   3-11   rotation vectors of the corners relative to the facet (bending and drilling);
///   12-14  skewness of the edges of a curved element: mean of the slopes at both ends less the same in the reference.
/// The frame in which they are taken follows the facet by the rotation of its in-plane deformation gradient, so that
/// nothing depends on the order of the corners. The membrane strain is that of the whole curved patch:
///   the chord strain of the facet,
///   + what the in-plane bow of the edges adds (element_stiffness.hpp),
///   + mean(grad w grad w') / 2 of the patch's deflection w over the facet,
///   + 1/A sum over edges of l mean(w) (m.v) v v': a bulging edge moves along m, and so in the planes of its triangles,
/// less the same in the reference. m is the surface's normal at the edge, v the facet's outward normal in its plane.
/// Bows and slopes are measured at the edges, against directions that the nodes carry: with e the edge's current
/// direction, c = m x e in the reference, R the rotation of an end,
///   rotation in the plane = -e.(R c),   slope of the surface against the edge = slope in the reference - e.(R m).
/// Both triangles at an edge see the same numbers, so that what a membrane force does to one is undone by the other.
/// (Measured against the facets, the moments of Felippa's basic stiffness turn the nodes of a thin shell in tension
/// with a force that grows with the load, until its bending stiffness loses: limit loads that are not there.) In the
/// linear regime the last two parts are the shell's curvature in its membrane strain: bending without extension of the
/// surface leaves the mean strain at zero to third order in the element's size, where flat facets are strained in the
/// second. Beyond, they keep the nodes' rotations stiff in tension and make the patch buckle in compression.
///
/// A mean strain does not see waves as short as the elements: w = W cos(K.x) with |K| = 4 pi / (3 h) sums to zero over
/// the corners of every triangle of a regular mesh, so that all mean strains vanish and only bending resists, which is
/// 28 / x^2 of what the membrane should do, x = h^2 b / t, b the shell's curvature. Where a shell is thin against the
/// square of its elements such waves are too soft. Their edges skew: a line that keeps a constant curvature has
/// opposite slopes at its ends. So the skewness of an edge has a stiffness, S E t A b^2 h^2 / 4 with b the curvature
/// ACROSS the edge, as a wave along it stretches the lines across; bending without extension of a cylinder stays free.
/// S = 4/9 gives the wave above the energy of its membrane strain, E t b^2 W^2 / 4 per area; of a smooth deformation
/// the skewness is of third order. With it the spectrum is right on coarse meshes (`Frequencies.VeryThinSphere*`);
/// under a point load that the mesh does not resolve it costs accuracy, so that only what needs it asks for it:
/// stiffen_short_waves().
///
/// A wall that is under stress in its reference (prestress.hpp) has the energy y'Ky/2 + y'K y0, with y0 the deformation
/// whose stresses K y0 it bears there.
///
/// Forces are the gradient of the energy to the last term, and the tangent the gradient of the forces.
/// Source: co-rotation: Nour-Omid, Rankin 1991; Felippa, Haugen 2005; Battini 2007. Strain of shallow shells: Marguerre
/// 1938. The measure at the edges is tunica's own.
namespace tunica {

using Vector18 = Eigen::Matrix<double, 18, 1>;
using Matrix18 = Eigen::Matrix<double, 18, 18>;
using Mat23 = Eigen::Matrix<double, 2, 3>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix36 = Eigen::Matrix<double, 3, 6>;
using ElementState = Eigen::Matrix<double, 15, 1>;

/// The reference surface around a triangle: its unit normals at the corners. Where it is `curved` their slopes count in
/// the membrane strain; else they only say about which axis the corners drill, and the facet is flat.
struct ShellSurface {
  std::array<Vec3, 3> normals;
  bool curved = false;
};

struct ShellElement {
  std::array<Index, 3> nodes{};  ///< global
  std::size_t body = 0;
  double thickness = 0;
  double area = 0;       ///< of the reference: of the patch where it is curved, else of the facet
  Mat3 axes;             ///< rows: the reference frame; x along the first edge, z along the facet's normal
  Mat3 from_centroid;    ///< columns: corners minus centroid, reference
  Mat23 plane;           ///< columns: the same in the reference frame
  Mat23 gradients;       ///< columns: gradients of the barycentric coordinates
  Mat3 edge_normals;     ///< columns: m of the edges, in the reference frame
  Mat3 edge_sides;       ///< columns: c of the edges, in the reference frame
  Vector6 slopes;        ///< of the reference: start and end of every edge
  Vector6 rest_normals;  ///< e.m and e.c there: what round-off leaves of zero, so that the reference is exactly at rest
  Vector6 rest_sides;
  Mat3 bow;  ///< columns: strain per difference of the in-plane rotations at the ends of an edge
  /// Of the edges: by how much their slopes follow the rotations of their ends; 0: an edge that is held keeps its
  /// shape.
  Vec3 bending_edges = Vec3::Ones();
  bool curved = false;  ///< the slopes count: in the strain by bulging, in the height of the patch
  /// Mean height of the patch over the facet: sum of weight x length of the edge x slope.
  Vector6 height_weights;
  /// Strain by bulging, less the same in the reference, for slopes a and bending rotations theta:
  ///   a'H_i a / 2 (component i) + sum over edges k of sideways_k (a_start - a_end) x tilt,
  ///   tilt = tilt_k + direction_k.(theta_start + theta_end) / 2.
  std::array<Matrix6, 3> bulging;   ///< H
  Mat3 sideways;                    ///< columns: of the edges
  Vec3 tilts;                       ///< of m against the facet's normal, outward, in the reference
  Mat23 edge_directions;            ///< columns, in the reference frame
  Mat3 membrane;                    ///< stiffness to the mean strain (N mm)
  Matrix9 rotational;               ///< stiffness to the rotation vectors (N mm): bending, higher-order membrane
  Vec3 skewing = Vec3::Zero();      ///< stiffness to the skewness of the edges (N mm); zero unless asked for
  Vec3 short_waves = Vec3::Zero();  ///< what it has to be for waves as short as the elements
  double thinness = 0;              ///< x: h^2 times the largest curvature, over the thickness
  Matrix39 curvature;               ///< mean, from the rotation vectors
  ElementState prestrain = ElementState::Zero();  ///< y0
};

/// What the three corners do: displacements (columns) and rotations from the reference.
struct CornerMotion {
  Mat3 displacement;
  std::array<Mat3, 3> rotation;
};

/// Geometry, stiffness and strain operators. `higher_order_scale` goes to membrane_opt().
ShellElement make_shell_element(const std::array<Vec3, 3>& corners, const ShellSurface& surface,
                                const Material& material, double thickness, Membrane membrane, Bending bending,
                                double higher_order_scale);

/// The state y. Zero, to the last bit, at the reference.
/// @return false when the triangle has collapsed or turned inside out: no frame exists.
bool deformation(const ShellElement& element, const CornerMotion& motion, ElementState& result);

/// The state by the linear theory, of displacements and rotation vectors (6 per corner, world axes).
ElementState linear_deformation(const ShellElement& element, const Vector18& motion);

/// The linear stiffness in world axes, at the reference.
Matrix18 linear_stiffness(const ShellElement& element);

struct ElementResponse {
  ElementState deformation;
  Vector18 force;  ///< world axes, conjugate to displacements and spins
  double energy = 0;
};

/// Stiffness-proportional damping in the element's own frame, so that rigid rotations are not damped: the state
/// y gets the viscous part `factor` (y - previous), with factor = beta / dt.
struct Viscous {
  double factor = 0;
  const ElementState* previous = nullptr;
};

/// Forces, and the tangent when asked for: d force / d (displacement, spin), not symmetric away from equilibrium.
/// @return false as deformation() does.
/// For one element, tests and states; runs take several at once: element_lanes.hpp.
bool corotational_response(const ShellElement& element, const CornerMotion& motion, const Viscous& viscous,
                           ElementResponse& response, Matrix18* tangent);

/// Strain energy of a deformation.
double strain_energy(const ShellElement& element, const ElementState& deformation);

}  // namespace tunica
