#pragma once

#include "tunica/core/lane_count.hpp"
#include "tunica/mechanics/algebra/free_mask.hpp"
#include "tunica/mechanics/contact/carried.hpp"
#include "tunica/mechanics/contact/contact_system.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/elements/shell_element.hpp"
#include "tunica/mechanics/model/configuration.hpp"
#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/solids/solid_element.hpp"
#include "tunica/mechanics/terms/support.hpp"

#include <memory>
#include <optional>

/// A model made ready for solving: elements, loads, masses and supports by global node, and the sums over them.
namespace tunica {

/// A load that keeps its direction, times a number that goes from `begin` to `end` with the load factor. `director` of
/// a node is the sum over the triangles around it of n g', for normals n that turn with the node and vectors g fixed in
/// space: its energy is -trace(R n g').
struct DeadLoad {
  VectorX force;               ///< 6 per node: force, moment about fixed axes
  std::vector<Mat3> director;  ///< empty, or #nodes
  double begin = 0;
  double end = 1;
};

struct PrescribedFreedom {
  std::size_t freedom = 0;
  double value = 0;  ///< mm, for a factor of 1
  std::size_t fix = 0;
};

/// A connected part of a body.
struct Piece {
  std::size_t body = 0;
  std::vector<Index> nodes;  ///< global
  /// Held by its rigid motions; those that nothing else holds are the translations and the rotations onto which these
  /// project.
  bool balanced = false;
  Mat3 shifts = Mat3::Identity();
  Mat3 turns = Mat3::Identity();
};

/// Elements that are computed at once; those beyond `count` repeat another.
struct Batch {
  std::array<Index, lane_count> elements{};
  std::size_t count = 0;
};

struct ShellSystem {
  const Model* model = nullptr;  ///< what it is made of, and what must outlive it
  std::vector<Vec3> reference;   ///< #nodes
  std::vector<ShellElement> elements;
  /// Reference normals at the corners of each element: of the curved surface, or the facet's.
  std::vector<std::array<Vec3, 3>> normals;
  std::vector<PatchHeight> heights;                   ///< of the curved patches over the facets, for pressure
  std::vector<std::vector<Batch>> colours;            ///< elements of one colour share no node
  std::vector<std::array<std::size_t, 9>> placement;  ///< where each element's blocks go in the matrix
  BlockMatrix pattern;
  std::vector<std::size_t> first_element;  ///< per body, and the end
  std::vector<Piece> pieces;
  std::vector<char> used;  ///< #nodes: belongs to an element

  std::vector<SolidElement> solids;
  std::vector<std::vector<Index>> solid_colours;             ///< elements of one colour share no node
  std::vector<std::array<std::size_t, 16>> solid_placement;  ///< as `placement`
  std::size_t first_solid_node = 0;                          ///< those of solids are the last
  Surfaces surfaces;  ///< of all bodies; empty where there are only shells that touch and carry nothing
  std::vector<Carried> carried;
  std::shared_ptr<ContactSystem> contact;  ///< none where nothing touches

  std::vector<DeadLoad> dead;                      ///< per load; empty vectors for follower pressure
  std::shared_ptr<const SupportTerm> bed;          ///< none where nothing is supported
  std::vector<std::shared_ptr<const Term>> terms;  ///< all that acts, as make_terms() says

  VectorX area;                        ///< per node: a third of the triangles around it
  VectorX mass;                        ///< tonne per node
  VectorX inertia;                     ///< tonne mm^2 per node, about every axis: rho t^3 / 12 times the area
  FreeMask held;                       ///< 6 per node; what is not free
  std::vector<std::size_t> balancing;  ///< of those, what holds only rigid motions of bodies whose loads are in balance
  std::vector<PrescribedFreedom> prescribed;
  std::optional<double> prestress_residual;  ///< of the balance of the stress that the reference bears, relative
  double length = 0;                         ///< mean edge, mm: what makes moments comparable with forces
  /// Norms of the elements' stiffness, moments divided by `length`: forces by displacements (N/mm), by rotations (N).
  double translation_stiffness = 0;
  double rotation_stiffness = 0;

  [[nodiscard]] std::size_t node_count() const { return reference.size(); }
  /// What changes while a state is sought.
  [[nodiscard]] ChangingLaw& law() const;
};

/// Errors: InputError for what only shows when loads and supports are put on the nodes (a load on a node without
/// triangles, an edge load on an edge that is not there).
ShellSystem make_system(const Model& model);

/// Makes the pattern, with further pairs of nodes that may act on each other.
void make_pattern(ShellSystem& system, const std::vector<std::array<Index, 2>>& pairs);

/// Makes the edges' skewness stiff (shell_element.hpp): for frequencies and buckling, whose answers are the spectrum
/// itself, and for static and dynamic runs where the shell would buckle in waves as short as its elements.
void stiffen_short_waves(ShellSystem& system);

/// Whether somewhere bending alone does not hold such waves: h^2 > 3 R t.
bool has_soft_waves(const ShellSystem& system);

/// The configuration without displacements and rotations.
Configuration reference_configuration(const ShellSystem& system);

/// Adds spin and displacement increments (6 per node; of solids displacements and pressures), and puts carried nodes in
/// their places.
void advance_configuration(const ShellSystem& system, const VectorX& increment, Configuration& configuration);

/// Moves what acts on carried nodes to those that carry them (carried.hpp).
/// @param unbalanced  6 per node: external - internal
void condense(const ShellSystem& system, const Configuration& configuration, VectorX& unbalanced, BlockMatrix* tangent);

/// Displacements and pressures of an element's corners.
SolidMotion corner_motion(const SolidElement& element, const Configuration& configuration);

/// Factors of the loads, in their order.
std::vector<double> load_factors(const Model& model, bool is_static, double time);
double factor_of(const Ramp& ramp, bool is_static, double time);

/// What the linearised elements deform to by an increment (6 per node) from a configuration.
std::vector<ElementState> predicted_deformations(const ShellSystem& system, const Configuration& configuration,
                                                 const VectorX& increment);

/// The sum of all terms, as Term::add(), from zero on. `tangent`, where it is given, has the pattern system.pattern.
void evaluate(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent);

/// Stiffness of the linear theory at the reference, without any load.
void linear_stiffness(const ShellSystem& system, BlockMatrix& matrix);

/// That stiffness times displacements and rotation vectors (6 per node), summed over the elements' stresses: its error
/// is round-off of strains, not of stiffnesses, whose entries are larger by (h / t)^2 and more than what a thin shell
/// bends with.
void linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces);

/// Mass and rotary inertia of each freedom.
VectorX lumped_masses(const ShellSystem& system);

/// The longest side of the box around the model, mm.
double longest_side(const ShellSystem& system);

/// Largest rotation (rad) of any node of a shell in a vector of freedoms.
double largest_rotation(const ShellSystem& system, const VectorX& freedoms);

/// Root of the sum of squares of forces and moments / length.
double force_norm(const ShellSystem& system, const VectorX& force);

/// What round-off makes of the internal forces: below this a residual says nothing.
double round_off(const ShellSystem& system, const Configuration& configuration);

/// Deformed geometry of one body, with its normals at the corners.
ShellMesh deformed_mesh(const ShellSystem& system, const Configuration& configuration, std::size_t body);

/// Volume of the closed bodies together; none when a body is open.
std::optional<double> enclosed_volume(const ShellSystem& system, const Configuration& configuration);

}  // namespace tunica
