#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/contact/barrier.hpp"
#include "tunica/mechanics/contact/carried.hpp"
#include "tunica/mechanics/contact/contact_state.hpp"
#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "tunica/mechanics/contact/surface_faces.hpp"
#include "tunica/mechanics/terms/changing_law.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// Contact of curved surfaces with each other and with rigid bodies, inside the implicit step.
///
/// Points are sampled on the surfaces, each with its part of the area in the reference. A point presses with
///   p(g) = stiffness (1 - g / d)^2 d / g   for gaps 0 < g < d, else 0,
/// d the resolution, g the distance less half of each wall and less what the surfaces may bend between the points (a
/// twentieth of d at most: the number of points follows). The stiffness is such that the largest pressure of the
/// contact, found on the way, takes a gap of a twentieth of d: so d alone says how exact the answer is. The pressure
/// counts as an unknown of its own (a primal-dual interior point method, eliminated at each point): the forces follow
/// p(g), the tangent takes the pressure that the last one expects. Below a twentieth of d the law goes on as a straight
/// line, so that surfaces may overlap on the way to a state, and the first touch cuts no step short; a state of rest in
/// which they do is refused, and the barrier hardened. In a motion what is about to touch is stopped by a barrier that
/// holds its energy, for hardening one that presses already brings energy in (brace()).
///
/// Friction by Coulomb's law with elastic slip: the traction is (friction) p u / e along the slip u since the contact
/// began, e a thousandth of the wall, and u is cut to e: it also holds at rest, and depends on the path.
/// Forces reach the nodes by the transpose of the map (patch_map.hpp).
///
/// Source: Li et al. 2020, "Incremental potential contact" (the barrier); Li et al. 2023, "Convergent incremental
/// potential contact" (areas); Forsgren, Gill, Wright 2002, "Interior methods for nonlinear optimization"; Simo,
/// Laursen 1992, "An augmented Lagrangian treatment of contact problems involving friction" (return mapping).
///
/// A rigid mesh also touches with its own corners, and with points along its sharp edges.
namespace tunica {

class BoxTree;
class FaceMaps;

class ContactSystem : public ChangingLaw {
public:
  /// Errors: InputError: bodies overlap in the reference; names the pair and the depth.
  /// @param carried  nodes do not touch the body that carries them
  ContactSystem(const Model& model, Surfaces surfaces, std::vector<Vec3> reference,
                const std::vector<Carried>& carried);

  /// A step of the rigid bodies between two times (load factors in statics). They stand at the first. What comes near
  /// is sampled as finely as its curvature asks in this configuration.
  void set_step(double from, double to, const Configuration& configuration);

  /// Before a step of a motion: where nothing presses yet, the barrier becomes as hard as it takes to stop what comes.
  /// @param speeds  mm/s, per body that deforms the largest of its nodes; length  s, of the step
  void brace(const std::vector<double>& speeds, double length);

  /// Makes the barrier harder where surfaces overlap.
  /// @return whether that changed anything
  bool harden() override;
  /// Where Newton's method has come to rest: also makes the barrier softer where it is more than the pressures found
  /// ask for.
  /// @return whether that changed anything, so that Newton's method has to go on
  bool sharpen() override;
  /// Of the rigid bodies' motion in the step, what is still to come.
  [[nodiscard]] double left() const override { return left_; }
  void set_left(double left) override;

  /// Which nodes may come to act on each other, beyond those of one element.
  /// @return whether they are others than at the last call
  bool find_pairs(const Configuration& configuration);
  [[nodiscard]] const std::vector<std::array<Index, 2>>& pairs() const { return pairs_; }

  [[nodiscard]] bool may_change() const override { return true; }

  /// Whether points may touch a body that deforms: its normals jump from one face to the next.
  [[nodiscard]] bool has_kinks() const override {
    return !pairs_.empty() ||
           std::any_of(groups_.begin(), groups_.end(), [](const Group& group) { return group.point.has_value(); });
  }

  /// mm: the smallest over which pressure builds up.
  [[nodiscard]] double resolution() const override { return resolution_; }

  /// Whether friction has given way somewhere, by the last forces: the tangent then is not symmetric, and its pivots
  /// say nothing about stability.
  [[nodiscard]] bool slides() const override { return slides_; }

  /// Adds forces; with a tangent their derivative, and to the forces what the rest of the rigid bodies' motion adds to
  /// first order.
  /// @return false where surfaces overlap by more than can be mended
  bool add(const Configuration& configuration, VectorX& external, BlockMatrix* tangent);

  /// The increment (6 per node) that was followed from where the last tangent was made: the next one takes the
  /// pressures that it expected.
  void predict(const VectorX& increment) override;

  /// A state of rest, or the end of a time step: slip is kept, and where every point is.
  void accept(const Configuration& configuration);

  /// Whether it is certain that on straight lines from the last accepted state to this one nothing passed through
  /// anything: a plane, or the way that there is, keeps every part of a surface from what it might meet.
  [[nodiscard]] bool is_certain(const Configuration& configuration);

  /// Back to the last accepted state, after attempts that came to nothing.
  void go_back();

  /// Where bodies were closest at the last forces: "; in contact NAME they are closest at (x, y, z) mm, where BODY
  /// meets OTHER". Empty where nothing came near.
  [[nodiscard]] std::string closest_place() const;

  /// What acts in a configuration, per contact of the model; gaps as intervals.
  [[nodiscard]] std::vector<ContactState> results(const Configuration& configuration);
  /// Of the last results(), per rigid body of the model.
  [[nodiscard]] const std::vector<RigidState>& on_rigids() const { return on_rigids_; }
  /// Of the last results(): the sum over all bodies of forces and moments, relative to the sum of their magnitudes.
  [[nodiscard]] std::array<double, 2> imbalance() const { return imbalance_; }

  /// Per contact the largest pressure of any accepted state so far, also of those within a step, MPa.
  [[nodiscard]] std::vector<double> pressed() const;

  /// mJ, of the barrier at the last forces.
  [[nodiscard]] double potential() const;
  [[nodiscard]] double accepted_potential() const;  ///< at those of the last accepted state
  /// mJ, that changes of the barrier's stiffness have brought in since this was asked for last: they act on what was
  /// pressing before.
  double take_hardening() { return std::exchange(hardening_, 0); }
  /// Whether rigid bodies may do work: whether any moves in the step.
  [[nodiscard]] bool is_driven() const { return is_driven_; }

  struct Pressing {
    double pressure = 0;  ///< MPa
    double area = 0;      ///< mm^2
  };

  /// What is kept between steps, so that a run that goes on repeats the uninterrupted one: of the last accepted state
  /// how stiff the barrier is and has to be, its energy, what has pressed so far, who may meet, how finely what is near
  /// is sampled, and with friction how far each sample has slipped. Cost: two numbers per face, with friction five per
  /// sample.
  [[nodiscard]] std::vector<double> memory() const;
  /// Puts the contact back to an accepted state.
  /// @param memory  of the same model; configuration, time  of that state
  void recall(const std::vector<double>& memory, const Configuration& configuration, double time);

private:
  /// Two surfaces of one body are as far apart as they were in the reference: this part of it counts as no contact.
  static constexpr double own_distance = 0.9;

  struct Sample {
    Vec2 at;
    PatchWeights weights;
    double share = 0;            ///< of twice the area of the parameters' triangle
    double area = 0;             ///< mm^2
    double pressure = -1;        ///< MPa, that the next tangent takes; below zero: that of the gap
    Vec3 slip = Vec3::Zero();    ///< mm, elastic
    double slipped = 0;          ///< mm, beyond that, since it touches
    Vec3 before = Vec3::Zero();  ///< where it was in the last accepted state
    bool followed = false;       ///< `before` is known
    // As the last tangent left it:
    bool active = false;
    double law = 0, slope = 0;
    Vec3 normal;
    std::size_t other = SIZE_MAX;
    PatchWeights other_weights;
  };
  /// The faces of one body towards the other party of a contact; or a rigid mesh's points.
  struct Side {
    std::size_t contact = 0;
    std::size_t body = 0;  ///< number of the rigid one where `points` is set
    ContactParty other;
    bool points = false;
    double weight = 1;        ///< one half where both sides are sampled
    double wall = 0;          ///< mm, mean
    double curvature = 0;     ///< 1/mm, largest of a rigid other body at the last refine()
    double largest_bend = 0;  ///< mm, of all its faces then
  };
  /// One face towards one other party of a contact; or one point of a rigid mesh, whose corners and edges may lie
  /// between the samples of what it meets. Towards a body that deforms there is one for each face, which holds samples
  /// only while something is near; towards a rigid one there are those only that were near in the step.
  struct Group {
    std::size_t side = 0;
    std::size_t face = 0;
    std::optional<Vec3> point;  ///< of the rigid mesh, as it is given
    std::size_t rigid = 0;      ///< whose point that is
    std::size_t contact = 0;
    ContactParty other;
    double weight = 1;      ///< one half where both sides are sampled
    double wall = 0;        ///< mm; of a solid the length of its edges
    double resolution = 0;  ///< mm, over which pressure builds up
    double elastic_slip = 0;
    int level = 0;
    double sag = 0;               ///< mm: what the surfaces bend between samples
    bool close = false;           ///< something was near at the last forces
    std::vector<Sample> samples;  ///< none before something comes near
  };
  struct Touch {
    double gap = infinity;
    Vec3 normal = Vec3::Zero();
    Mat3 curvature = Mat3::Zero();
    std::size_t face = SIZE_MAX;  ///< of the other body, where it deforms
    Vec2 at = Vec2::Zero();       ///< parameters there
    bool on_face = false;         ///< straight above it, not beside its edge
    PatchWeights weights = PatchWeights::Zero();
  };
  /// From the middle of both walls to where they rub: friction turns them.
  struct Levers {
    Vec3 own = Vec3::Zero(), other = Vec3::Zero();
  };

  [[nodiscard]] std::shared_ptr<const FaceMaps> maps_at(const Configuration& configuration);

  void make_sides(const Model& model);
  /// A group of a side where its wall is so thick, mm, of no face yet.
  [[nodiscard]] Group group_of(std::size_t side, double wall) const;
  [[nodiscard]] Group group_of_face(std::size_t side, std::size_t face) const;
  void add_points(std::size_t side);
  /// Adds groups that are not there yet. They stand by their sides and faces.
  void add_groups(std::vector<Group> more);
  /// Adds groups for the faces that rigid bodies are near.
  void gather(const FaceMaps& maps);
  [[nodiscard]] Vec3 place(const Group& group, const Sample& sample, const FaceMaps& maps) const;
  /// Whether a group may touch what it looks at.
  [[nodiscard]] bool is_close(const Group& group, const std::vector<std::size_t>& near, const FaceMaps& maps) const;
  /// Errors: InputError: bodies overlap in the reference.
  void require_apart(const Model& model);
  /// Errors: InputError: a body that touches itself passes through itself at points that its parts share, or lies in
  /// itself.
  void require_no_own_crossing(const Model& model) const;
  /// Where, if anywhere, faces of one piece of a body that touches itself are nearer than contact can hold them apart,
  /// though it is far from one to the other along the surface. Of solids none is looked for.
  [[nodiscard]] std::optional<Vec3> first_fold(const Model& model, std::size_t contact) const;
  /// Makes the samples of a group.
  void sample(Group& group, int level) const;
  /// Makes samples where there are none.
  void wake(Group& group) const;
  /// Takes the samples of a group away that nothing is near, nor was in the last accepted state.
  static void let_sleep(Group& group);
  [[nodiscard]] Sample sample_at(const Group& group, const PatchMap& map, int i, int j) const;
  void keep_slip(const Configuration& configuration);
  /// Levels and sags for a configuration, also of groups that come later.
  void refine(const FaceMaps& maps);
  void refine(Group& group) const;
  [[nodiscard]] double offset(const Group& group, std::size_t other) const;
  /// How far surfaces may overlap on the way to a state, mm.
  [[nodiscard]] double deepest(const Group& group, std::size_t other) const;
  [[nodiscard]] bool excluded(const Group& group, std::size_t other) const;
  [[nodiscard]] bool is_carried(const SurfaceFace& face, std::size_t body) const;
  /// Gathers what is near, and finds for every group towards a body that deforms the faces that come within its reach
  /// and `more` (mm).
  [[nodiscard]] std::vector<std::vector<std::size_t>> near_faces(const FaceMaps& maps, double more);
  [[nodiscard]] bool is_near(const Group& group, const FaceMaps& maps) const;
  [[nodiscard]] Touch touch(const Group& group, const Vec3& x, const std::vector<std::size_t>& near,
                            const FaceMaps& maps) const;
  /// The samples of a group that press, by their number.
  using Touches = std::vector<std::pair<std::size_t, Touch>>;
  /// Of every group; wakes those that something is near. In parallel.
  [[nodiscard]] std::vector<Touches> all_touches(const FaceMaps& maps,
                                                 const std::vector<std::vector<std::size_t>>& near);
  /// What a sample does: traction on its surface (MPa), and the derivative of minus the traction by its place.
  struct Press {
    double law = 0, slope = 0;
    Vec3 traction, slip = Vec3::Zero();
    Mat3 derivative;
  };
  struct Acting;
  [[nodiscard]] Press press(const Group& group, const Sample& sample, const Touch& touch, const Vec3& x,
                            const FaceMaps& maps) const;
  [[nodiscard]] Vec3 rest_of_motion(const Group& group, const Press& press, const Touch& touch, const Vec3& x) const;
  struct Recorded {
    std::vector<ContactState> states;
    std::vector<std::vector<Pressing>> pressing;
  };
  void record(const Group& group, const Sample& sample, const FaceMaps& maps, const Touch& touch, const Press& press);
  void add_sample(const Group& group, const Sample& sample, const Touch& touch, const Press& press, const Vec3& rest,
                  bool with_derivative, const FaceMaps& maps, Acting& acting) const;
  /// Friction's moments about the middle of the walls.
  void add_turning(const Group& group, const Sample& sample, const Touch& touch, double area, const Press& press,
                   const Vec3& rest, bool with_derivative, const FaceMaps& maps, Acting& acting) const;
  void scatter(const Group& group, const Acting& acting, const FaceMaps& maps, VectorX& external,
               BlockMatrix* tangent) const;
  [[nodiscard]] Levers levers(const Group& group, const Touch& touch) const;
  [[nodiscard]] Vec3 relative_motion(const Group& group, const Sample& sample, const Touch& touch, const Vec3& x,
                                     const FaceMaps& maps) const;
  /// Where a lever of a face was in the last accepted state, relative to its point of the middle.
  [[nodiscard]] Vec3 lever_before(const SurfaceFace& face, const Vec2& at, const Vec3& lever,
                                  const FaceMaps& maps) const;
  [[nodiscard]] bool passes_rigid(const Group& group, const PatchMap& before, const PatchMap& now) const;
  [[nodiscard]] double lower_gap(const Group& group, const std::vector<std::size_t>& near, const FaceMaps& maps,
                                 double upper) const;

  Surfaces surfaces_;
  const std::vector<Vec3> reference_;
  const std::vector<Contact> contacts_;
  std::vector<std::string> meetings_;      ///< per contact: "BODY meets OTHER"
  std::map<Index, std::size_t> carrier_;   ///< body, of carried nodes
  std::vector<RigidShape> shapes_;         ///< now
  std::vector<RigidShape> shapes_before_;  ///< in the last accepted state
  std::vector<RigidShape> shapes_end_;     ///< at the end of the step
  std::vector<RigidShape> shapes_at_tangent_;
  double begin_ = 0, end_ = 0, left_ = 0;
  bool slides_ = false;
  std::vector<Side> sides_;
  std::vector<Group> groups_;                              ///< by side and face
  std::map<std::size_t, std::shared_ptr<BoxTree>> trees_;  ///< of the bodies that deform, with the boxes last asked for
  std::map<std::size_t, double> thickest_;                 ///< mm, half walls, of these
  std::vector<std::array<double, 2>> bends_;  ///< mm, per face at the last refine(): its bend, its longest side
  double resolution_ = infinity;              ///< mm, the smallest
  std::vector<Barrier> barriers_;             ///< of the contacts
  double hardening_ = 0;                      ///< mJ
  bool is_driven_ = false;
  struct Closest {
    double gap = infinity;
    std::size_t contact = 0;
    Vec3 at = Vec3::Zero();
  };
  Closest closest_;  ///< at the last forces
  std::vector<std::array<Index, 2>> pairs_;
  bool pairs_are_new_ = false;  ///< nobody has asked yet
  const Configuration rest_;
  std::shared_ptr<const FaceMaps> accepted_;    ///< of the last accepted state
  std::shared_ptr<const FaceMaps> at_tangent_;  ///< where the last tangent was made
  std::shared_ptr<const FaceMaps> last_;        ///< that were asked for
  std::vector<RigidState> on_rigids_;
  std::array<double, 2> imbalance_{0, 0};
  Recorded* recorded_ = nullptr;  ///< add() writes here what acts
};

}  // namespace tunica
