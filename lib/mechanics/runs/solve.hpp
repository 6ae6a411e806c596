#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/mechanics/contact/contact_state.hpp"
#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/system.hpp"

#include <Eigen/Geometry>

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

namespace tunica {

/// One state of a run, as handed to the callback; everything is for all nodes of all bodies in global order.
struct State {
  /// s; the load factor in a static run, the number of the step on a path by arc length, the frequency (Hz) or the
  /// buckling factor of a mode.
  double time = 0;
  double load_factor = 0;              ///< static: of this step; dynamic: of the first load's ramp
  std::vector<Vec3> displacement;      ///< mm, #nodes
  std::vector<Vec3> rotation;          ///< rotation vectors, rad, #nodes
  std::vector<Vec3> velocity;          ///< mm/s, dynamic only
  std::vector<Vec3> angular_velocity;  ///< rad/s, dynamic only
  /// Of the nodes of solids, in units of their shear modulus, #nodes; empty without solids.
  std::vector<double> pressure;
  std::optional<double> volume;  ///< mm^3 of the closed bodies' curved surfaces together; none when one is open
  double strain_energy = 0;      ///< N mm = mJ
  double kinetic_energy = 0;     ///< mJ
  double residual = 0;           ///< relative, as compared with RunSettings::converge
  std::size_t newton_iterations = 0;
  std::size_t cg_iterations = 0;
  std::optional<double> algebraic_error;  ///< of this step, relative; see Summary
  bool algebraic_error_is_bound = false;
  bool converged = false;
  bool linear = false;                 ///< of the linear theory: rotations are not finite ones
  std::vector<ContactState> contacts;  ///< of the model's contacts, in order; empty where a state does not say
  std::vector<RigidState> rigids;      ///< of the model's rigid bodies, in order; the same
  double force_imbalance = 0;          ///< sum of all contact and tie forces over all bodies, relative to the largest
  double moment_imbalance = 0;         ///< the same of their moments about the origin
};

/// Where a static path broke off and the shell moved by itself to the next state of rest.
struct Snap {
  double load_factor = 0;
  double distance = 0;  ///< mm, the farthest that a node moved
};

/// Of a dynamic run: work = stored + damped + lost. All from the beginning, mJ unless said.
struct EnergyBalance {
  double work = 0;               ///< by loads and prescribed displacements, by trapezia over each step
  double damped = 0;             ///< by physical damping
  double lost = 0;               ///< to time integration; below zero: gained from it
  double most_lost = 0;          ///< so far
  double largest = 0;            ///< energy so far, stored or brought in, without that of a prestress's forces
  double gained = 0;             ///< the most that time integration has given back or added, relative to `largest`
  std::size_t gaining_step = 0;  ///< in which that passed a tenth; 0: in none
  double gaining_time = 0;       ///< s, the end of that step
};

struct Summary {
  std::size_t dof = 0;    ///< free degrees of freedom
  std::size_t steps = 0;  ///< steps done (not only handed over)
  std::size_t parts = 0;  ///< dynamic: parts of steps that were accepted; without `adaptive` as many as steps
  bool converged = false;
  double residual = 0;  ///< of the last step
  std::size_t newton_iterations = 0;
  std::size_t cg_iterations = 0;
  /// What the linear solver's error leaves of a step's change, relative, in the energy norm of the tangent; the largest
  /// of all steps with cg, of an early one and the last with the direct solver. None where no system was solved, or
  /// where the tangent was not positive definite.
  std::optional<double> algebraic_error;
  bool algebraic_error_is_bound = false;  ///< some step's solve ended before its tolerance: at least this
  std::optional<double> volume_before;    ///< mm^3; none when a body is open
  std::optional<double> volume_after;
  double strain_energy = 0;     ///< mJ
  double max_displacement = 0;  ///< mm, of the nodes in the last state
  /// Of a linear static run under its largest load: by how much a nonlinear one differs, about, relative to that.
  std::optional<double> linear_departure;
  std::vector<double> seconds_per_step;  ///< wall
  std::vector<double> frequencies;       ///< Hz, increasing
  std::vector<double> buckling_factors;  ///< increasing
  /// Load factor (static) or time (s) from which waves as short as the elements were made stiff, because the shell
  /// would have buckled in them (shell_element.hpp).
  std::optional<double> stiffened_from;
  std::optional<EnergyBalance> energy;  ///< of a dynamic run
  /// Of a second-order scheme, which shows no loss of energy: the largest second difference of the motion over its
  /// steps, and the largest motion; root mean squares over the nodes, mm, turns times the body's length.
  double largest_bend = 0;
  double largest_motion = 0;
  std::vector<Snap> snaps;                ///< under load control, in order
  std::vector<double> limit_factors;      ///< load factors at which a path by arc length turns, in its order
  std::vector<double> branch_factors;     ///< and at which other paths leave it
  std::optional<double> short_of_factor;  ///< where such a path ends whose steps ran out before its max_factor
  bool ends_unstable = false;             ///< the last state is one that a shell under its load alone would leave
  /// MPa, of the model's contacts, in order: the largest pressure of any accepted state, also of those within a step.
  std::vector<double> contact_pressures;
};

/// What a dynamic run remembers between its steps beyond the configuration; vectors of 6 per node.
struct MotionMemory {
  Eigen::VectorXd velocity;      ///< mm/s, rad/s
  Eigen::VectorXd acceleration;  ///< mm/s^2, rad/s^2
  Eigen::VectorXd auxiliary;     ///< of the integrator (time_scheme.hpp)
  Eigen::VectorXd acting;        ///< N, N mm: forces at the end of the last step, without contact
  Eigen::VectorXd touching;      ///< likewise, of contact; none where nothing may touch
  Eigen::VectorXd last_change;   ///< mm, rad; none before two steps
  double part = 0;               ///< s: the next part of a step
  bool at_rest = false;
  std::vector<double> viscous_rate;        ///< 1/s, 15 per shell, or none
  std::vector<double> deformation_before;  ///< likewise, at the start of the last step
  double length_before = 0;                ///< s, of that step
};

/// Everything a run needs to go on after a step as if nothing had happened: the numbers as they stand in memory, so
/// that a run that goes on from here repeats the uninterrupted one (to the bit with the direct solver; what a solver
/// keeps only to be faster, such as a factor of an earlier matrix, is not here, so with others to their tolerance).
struct Checkpoint {
  Summary summary;                           ///< of the steps done; `steps` says where the run goes on
  double position = 0;                       ///< s; static: the load factor
  std::vector<Vec3> displacement;            ///< mm, #nodes
  std::vector<Eigen::Quaterniond> rotation;  ///< #nodes
  std::vector<double> solid_pressure;        ///< #nodes, where there are solids
  std::vector<double> contact;               ///< ContactSystem::memory(), where there is contact
  double increment = 0;                      ///< of a static run: the load factor's next
  std::optional<MotionMemory> motion;        ///< of a dynamic run
};

/// How a run is made to outlive its process, and what it says on the way.
struct Resumption {
  std::optional<Checkpoint> from;  ///< goes on here; the reference state is then not handed over again
  /// Called after every step, when what `on_state` got is complete up to it; `make` builds the checkpoint, so that none
  /// is built that nobody wants.
  std::function<void(const std::function<Checkpoint()>& make)> on_step;
  /// Of a nonlinear static run: a configuration near that of the first load step, such as a coarser mesh's. Newton's
  /// method begins there; where it does not converge, at the reference.
  std::optional<Checkpoint> near{};
  /// Called once, with a sentence, where a step of a model with contact takes far more iterations than others: how far
  /// it has come, why its parts are short, where bodies are closest, and what to do.
  std::function<void(const std::string&)> on_slow_step{};

  void offer(const std::function<Checkpoint()>& make) const {
    if (on_step) {
      on_step(make);
    }
  }
};

/// What every function of a model relies on: shells and solids with meshes to compute with (as require_valid() of
/// these, all nodes at finite places), material and thickness; nodes and bodies that fixes, loads, contacts,
/// attachments and probes name; numbers that are finite, and tables whose times increase. check_model() begins with it.
/// Errors: InputError. Cost: linear.
void require_valid(const Model& model);
void require_valid(const ShellBody& body);

/// That a state has as many displacements and rotations as a model has nodes. Errors: InputError.
void require_valid(const Model& model, const State& state);

/// What makes a model unsolvable: as System. Errors: InputError.
void check_model(const Model& model, const RunSettings& settings);

/// Runs a model. Every `settings.every`-th state, the reference state (time 0) and the last one go to `on_state`. After
/// the reference, a run for frequencies or buckling hands over its modes: linear states, their largest displacement 1 %
/// of the model's longest side.
/// Errors: InputError as check_model, and where a checkpoint is not of so many nodes; RequirementError when a step does
/// not converge, has no equilibrium, or becomes unstable (the last good state has been handed over). With
/// `cg_fixed_count` a run ends normally, `converged` false. A run that goes on from a checkpoint must have the model
/// and the settings of the run that made it.
Summary solve(const System& system, const std::function<void(const State&)>& on_state, const Progress& progress = {},
              const Resumption& resumption = {});
/// Of a model from which nothing else is asked. Errors: InputError as System too.
Summary solve(const Model& model, const RunSettings& settings, const std::function<void(const State&)>& on_state,
              const Progress& progress = {}, const Resumption& resumption = {});

}  // namespace tunica
