#pragma once

#include "tunica/core/names.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"
#include "tunica/surface/mesh/tet_mesh.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

/// What a scene says, resolved: selections are node lists, quantities are in mm, N, s (MPa, tonne). Nothing here
/// computes; mechanics/runs/solve.hpp does.
namespace tunica {

enum class Membrane {
  cst,    ///< constant-strain triangle, with a drilling stiffness small enough not to stiffen
  opt,    ///< Felippa's optimal ANDES triangle with drilling freedoms
  adapt,  ///< opt, its higher-order part reduced where the shell curves within an element
};
template <>
inline constexpr auto names_of<Membrane> =
    std::to_array<Named<Membrane>>({{"cst", Membrane::cst}, {"opt", Membrane::opt}, {"adapt", Membrane::adapt}});

enum class Bending {
  comas,             ///< the paper's 9-term cubic, faithful: depends on the first vertex, converges to a wrong limit
  comas_consistent,  ///< the same cubic, its mean curvature replaced by the boundary-integral one; isotropic
  dkt,               ///< discrete Kirchhoff triangle
  dkt_comas,         ///< four fifths dkt, one fifth comas_consistent
};
template <>
inline constexpr auto names_of<Bending> = std::to_array<Named<Bending>>({{"comas", Bending::comas, "the paper's"},
                                                                         {"comas-consistent",
                                                                          Bending::comas_consistent},
                                                                         {"dkt", Bending::dkt},
                                                                         {"dkt-comas", Bending::dkt_comas}});

enum class Rest {
  curved,  ///< the shell's own curvature is stress-free
  flat,    ///< the facets are stress-free and flat (classical benchmarks)
};
template <>
inline constexpr auto names_of<Rest> = std::to_array<Named<Rest>>({{"curved", Rest::curved}, {"flat", Rest::flat}});

/// Isotropic linear elasticity, in the co-rotated frame.
struct Material {
  double young = 0;               ///< MPa
  double poisson = 0;             ///< in (-1, 0.5)
  std::optional<double> density;  ///< tonne / mm^3; required by dynamics and gravity
  bool young_stated = true;       ///< false: `young` is any number, and the stress does not depend on it
};

struct ShellBody {
  std::string name;
  ShellMesh mesh;  ///< reference geometry, mm
  /// False where the file held no normals: the patches are then the flat facets themselves.
  bool curved = true;
  std::vector<double> thickness;  ///< mm: one value for the whole body, or one per vertex
  Material material;
  Membrane membrane = Membrane::adapt;
  Bending bending = Bending::dkt_comas;
  Rest rest = Rest::curved;
  std::optional<std::array<double, 2>> voxel{};  ///< mm, shortest and longest edge, of the image behind it
  std::string said_at{};                         ///< where the user said it, for messages; may be empty, here and below
};

enum class SolidLaw {
  corotational,  ///< the paper's: linear elasticity in the frame that follows each tetrahedron; for small strains
  neo_hookean,   ///< for what is crushed
};
template <>
inline constexpr auto names_of<SolidLaw> = std::to_array<Named<SolidLaw>>({{"corotational", SolidLaw::corotational},
                                                                           {"neo-hookean", SolidLaw::neo_hookean}});

/// A body of linear tetrahedra.
struct SolidBody {
  std::string name;
  TetMesh mesh;
  Material material;
  SolidLaw law = SolidLaw::corotational;
  std::string said_at{};
};

/// A piecewise linear table over time (dynamic) or load factor (static); constant beyond its ends.
template <typename Value>
struct Table {
  std::vector<std::pair<double, Value>> points;  ///< (time s, value), times increasing, at least one

  /// Errors: InputError: no point.
  [[nodiscard]] Value at(double time) const;
};

struct RigidSphere {
  static constexpr std::string_view name = "sphere";
  Table<Vec3> centre;    ///< mm
  Table<double> radius;  ///< mm
};
/// All points within `radius` of the line.
struct RigidCapsule {
  static constexpr std::string_view name = "capsule";
  Table<Vec3> from, to;  ///< mm
  Table<double> radius;
};
/// With flat ends at right angles to the line.
struct RigidCylinder {
  static constexpr std::string_view name = "cylinder";
  Table<Vec3> from, to;
  Table<double> radius;
};
/// The half-space below a plane.
struct RigidPlane {
  static constexpr std::string_view name = "plane";
  Table<Vec3> point;            ///< mm
  Vec3 normal = Vec3::UnitZ();  ///< unit; away from the body
};
/// A closed surface, its normals outward.
struct RigidMesh {
  TriangleMesh surface;
  /// Turned by this angle (rad) about an axis.
  struct Turn {
    Vec3 point, axis;  ///< mm; unit
    Table<double> angle;
  };
  std::optional<Turn> turn;
  /// Distances from an axis times this factor.
  struct Expansion {
    Vec3 point, axis;
    Table<double> factor;
  };
  std::optional<Expansion> expansion;
};

/// A body that does not deform and moves as prescribed.
struct RigidBody {
  std::string name;
  std::variant<RigidSphere, RigidCapsule, RigidCylinder, RigidPlane, RigidMesh> shape;
  std::optional<Table<Vec3>> motion;  ///< mm: added to what `shape` says
  std::string said_at{};
};

/// Nodes of a body that another body carries: they keep their place relative to its curved surface (a shell, half a
/// wall from its middle included in the offset that the reference geometry shows) or inside its tetrahedra (a solid).
struct Attachment {
  std::size_t body = 0;
  std::vector<Index> nodes;
  std::size_t to = 0;  ///< body
  enum class Side { inner, outer, middle };
  Side side = Side::middle;  ///< of a shell: the face of the wall on which the nodes lie
  std::string said_at{};
};
template <>
inline constexpr auto names_of<Attachment::Side> = std::to_array<Named<Attachment::Side>>(
    {{"inner", Attachment::Side::inner}, {"outer", Attachment::Side::outer}, {"middle", Attachment::Side::middle}});

/// A body that deforms, by its number, or a rigid one.
struct ContactParty {
  bool rigid = false;
  std::size_t index = 0;
};

struct Contact {
  std::string name;
  std::array<ContactParty, 2> between;  ///< at most one rigid; the same twice: self-contact
  double friction = 0;                  ///< Coulomb's coefficient
  /// The distance over which contact pressure builds up: this part of the thinner wall; between solids, of the mean
  /// edge of their surfaces.
  double resolution = 0.05;
  bool curved = true;  ///< false: shells touch with their flat facets
  /// False: the paper's rule for forces on a curved shell (barycentric forces, torques by the inverse of C), which
  /// loses moments. For comparison.
  bool consistent = true;
  std::string said_at{};

  /// Whether it is one of a body that deforms, by its number.
  [[nodiscard]] bool is_of(std::size_t body) const {
    return std::ranges::any_of(between, [&](const ContactParty& party) { return !party.rigid && party.index == body; });
  }
};

/// A piecewise linear table of factors over time (dynamic) or load factor (static); constant beyond its ends. Empty: 1.
struct Ramp {
  std::vector<std::pair<double, double>> points;  ///< (time s, factor), times increasing

  [[nodiscard]] double at(double time) const;
};

/// Held or prescribed components of some nodes, in world axes. Several on one node unite. With `across` the nodes stay
/// in the plane across it, and the wall as it stands to that plane, as in a plane of symmetry: the translation along it
/// and the rotations about the axes in the plane are held, and nothing else of the fix counts.
struct Fix {
  std::size_t body = 0;
  std::vector<Index> nodes;
  std::array<bool, 3> translation{true, true, true};
  std::array<bool, 3> rotation{true, true, true};
  Vec3 displacement = Vec3::Zero();  ///< mm; of the held translations; follows the load factor (static) or `ramp`
  Ramp ramp;
  std::string said_at{};
  std::optional<Vec3> across{};  ///< unit
};

/// Holds the rigid motions of every connected piece of a body that nothing else holds, without adding stress.
struct RigidMotionsFix {
  std::size_t body = 0;
};

/// An elastic bed of a shell: a force per area of -stiffness times the displacement from the reference.
struct Support {
  std::size_t body = 0;
  std::vector<double> shares;  ///< of each triangle, 0 to 1: the part of its area that lies in the bed; empty: all
  double stiffness = 0;        ///< MPa/mm
  bool normal_only = false;    ///< of the displacement only the part along the reference normal
  std::string said_at{};
};

/// A part of each of some triangles or edges: of one of them, and no number where all are meant.
inline double share_of(const std::vector<double>& shares, std::size_t i) { return shares.empty() ? 1 : shares[i]; }

/// Pressure along the outward normals (positive: along them).
struct PressureLoad {
  static constexpr std::string_view name = "pressure";
  double value = 0;                   ///< MPa
  bool follower = true;               ///< turns and grows with the surface
  std::optional<double> imaged_at{};  ///< MPa, under which the shells were imaged: the load begins there
  bool unload = false;                ///< the shape without that pressure is to be found, and the load begins at zero
  std::vector<double> shares{};       ///< of each triangle (face), 0 to 1: the part it presses; empty: all

  /// MPa, at a factor of the load: from what it begins with to `value`.
  [[nodiscard]] double at(double factor) const {
    const double begin = imaged_at.value_or(0);
    return begin + factor * (value - begin);
  }
};
struct ForceLoad {
  static constexpr std::string_view name = "force";
  std::vector<Index> nodes;
  Vec3 total = Vec3::Zero();  ///< N, shared equally by the nodes
};
/// About fixed world axes; it does work on the spin.
struct MomentLoad {
  static constexpr std::string_view name = "moment";
  std::vector<Index> nodes;
  Vec3 total = Vec3::Zero();  ///< N mm, shared equally by the nodes
};
struct EdgeLoad {
  static constexpr std::string_view name = "edge";
  std::vector<std::array<Index, 2>> edges;
  Vec3 per_length = Vec3::Zero();  ///< N / mm, integrated consistently
  std::vector<double> shares{};    ///< of each edge, 0 to 1: the part that it acts on; empty: all
};
struct AreaLoad {
  static constexpr std::string_view name = "area";
  Vec3 per_area = Vec3::Zero();  ///< MPa, fixed direction, on the whole body
};
struct GravityLoad {
  static constexpr std::string_view name = "gravity";
  Vec3 acceleration = Vec3::Zero();  ///< mm / s^2
};

struct Load {
  std::size_t body = 0;
  std::variant<PressureLoad, ForceLoad, MomentLoad, EdgeLoad, AreaLoad, GravityLoad> kind;
  Ramp ramp;
  std::string said_at{};
};

struct Probe {
  std::string name;
  std::size_t body = 0;
  Index node = 0;
};

/// Bodies that deform are numbered shells first, then solids; global node numbers: the bodies' vertices one after the
/// other in that order.
struct Model {
  std::vector<ShellBody> shells;
  std::vector<SolidBody> solids;
  std::vector<RigidBody> rigids;
  std::vector<Attachment> attachments;
  std::vector<Contact> contacts;
  std::vector<Fix> fixes;
  std::vector<RigidMotionsFix> rigid_motions;
  std::vector<Support> supports{};
  std::vector<Load> loads;
  std::vector<Probe> probes;

  /// Whether some pressure, other than zero, says that the bodies were imaged under it.
  [[nodiscard]] bool is_imaged_under_pressure() const;
  [[nodiscard]] std::size_t body_count() const { return shells.size() + solids.size(); }
  [[nodiscard]] bool is_solid(std::size_t body) const { return body >= shells.size(); }
  // Errors: InputError: there is no such body.
  [[nodiscard]] const std::string& name_of(std::size_t body) const;
  /// Reference positions of a body's nodes.
  [[nodiscard]] const std::vector<Vec3>& vertices_of(std::size_t body) const;
  [[nodiscard]] std::size_t node_count() const;
  /// Global number of the first node of a body.
  [[nodiscard]] std::size_t first_node(std::size_t body) const;
};

enum class Solver {
  cg,      ///< preconditioned conjugate gradients
  direct,  ///< sparse factorisation (ordering by CHOLMOD), symbolic analysis once
  automatic,
};
template <>
inline constexpr auto names_of<Solver> =
    std::to_array<Named<Solver>>({{"auto", Solver::automatic}, {"cg", Solver::cg}, {"direct", Solver::direct}});

enum class Integrator {
  backward_euler,     ///< the paper's: first order, strong numerical damping
  generalised_alpha,  ///< second order, damping of what is too fast for the step as chosen
};
template <>
inline constexpr auto names_of<Integrator> =
    std::to_array<Named<Integrator>>({{"backward-euler", Integrator::backward_euler, "the paper's"},
                                      {"generalised-alpha", Integrator::generalised_alpha}});

struct Damping {
  double mass = 0;       ///< 1 / s
  double stiffness = 0;  ///< s
};

struct StaticRun {
  static constexpr std::string_view name = "static";
  bool linear = false;               ///< one solve with the initial tangent
  std::vector<double> load_factors;  ///< increasing; the last is usually 1
};

/// The whole path of equilibria from the reference on, through limit points: the load factor is found, not given.
struct ArcLengthRun {
  static constexpr std::string_view name = StaticRun::name;
  std::size_t max_steps = 200;
  double first_factor = 0.1;         ///< change of the load factor in the first step; the others find their length
  std::optional<double> max_factor;  ///< the path ends where the load factor reaches this, up or down
  struct Until {
    std::size_t probe = 0;  ///< of the model's
    int axis = 0;
    double reaches = 0;  ///< mm, its displacement
  };
  std::optional<Until> until;  ///< the path ends there, and must get there
};

/// Natural frequencies about the reference, or, where there are loads or prescribed displacements, about the state of
/// rest under them.
struct FrequencyRun {
  static constexpr std::string_view name = "frequencies";
  std::size_t count = 10;
  StaticRun preload;  ///< how that state is found
};

/// Factors of the loads (and prescribed displacements) at which the stiffness about the linear solution under them,
/// growing in proportion, becomes singular.
struct BucklingRun {
  static constexpr std::string_view name = "buckling";
  std::size_t count = 10;
};

struct DynamicRun {
  static constexpr std::string_view name = "dynamic";
  double duration = 0;  ///< s
  double step = 0;      ///< s
  Damping damping;
  Integrator integrator = Integrator::backward_euler;
  double spectral_radius = 0.8;  ///< generalised_alpha, 0 ... 1: what a step keeps of what is too fast for it
  /// Steps are cut into parts that each add at most this much to the error: root mean square over the nodes,
  /// rotations times the mean edge; relative to the diagonal of the model's bounding box.
  std::optional<LengthTolerance> adaptive{};
};

struct RunSettings {
  std::variant<StaticRun, DynamicRun, FrequencyRun, BucklingRun, ArcLengthRun> kind;
  Solver solver = Solver::automatic;
  double cg_tolerance = 1e-10;               ///< relative residual at which a CG solve stops
  std::optional<std::size_t> cg_iterations;  ///< at most this many CG iterations in a solve
  bool cg_fixed_count = false;               ///< run exactly cg_iterations and ask for no tolerance (the paper's)
  double converge = 1e-8;                    ///< relative, scale-aware residual at which Newton's method stops
  /// Newton's method also ends with an increment that is this part of the whole displacement; 0: only by the residual.
  double settled = 0;
  std::size_t newton_max = 20;  ///< 1 is the paper's: one linearisation per step
  std::size_t every = 1;        ///< hand over every n-th state
};

}  // namespace tunica
