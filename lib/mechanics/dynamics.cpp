#include "core/error.hpp"
#include "mechanics/rotation.hpp"
#include "mechanics/run.hpp"
#include "mechanics/settle.hpp"
#include "mechanics/supports.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <chrono>
#include <cmath>

namespace tunica {
namespace {

using Clock = std::chrono::steady_clock;

/// With one linearisation per step nothing brings the residual down: above this part of the forces the step means
/// nothing.
constexpr double largest_unchecked_residual = 0.5;
/// Smallest part of a step's change that is tried on its own.
constexpr double smallest_part = 1.0 / 256;

Eigen::Index at(std::size_t node) { return 6 * static_cast<Eigen::Index>(node); }

struct Motion {
  Configuration configuration;
  VectorX velocity;  ///< 6 per node: velocity, angular velocity in world axes
};

/// Backward Euler: M (v1 - v0) / h + C v1 + f_int(x1) = f_ext(x1, t1) with v1 = (x1 - x0) / h, rotations by the vector
/// of the rotation from 0 to 1. Masses are lumped; rotary inertia is rho t^3 / 12 per area about every axis (that of a
/// plate about the axes in its plane), so it needs no gyroscopic term. Damping is alpha M and, in each element's own
/// frame, beta K: a rigid motion is not damped by beta.
class BackwardEuler {
public:
  BackwardEuler(const ShellSystem& system, const Model& model, const RunSettings& settings, const DynamicRun& run)
      : system_(system),
        model_(model),
        settings_(settings),
        run_(run),
        solver_(system, settings),
        matrix_(system.pattern),
        mass_(VectorX::Zero(at(system.node_count()))) {
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      mass_.segment<3>(at(i)).setConstant(system.mass[static_cast<Eigen::Index>(i)]);
      mass_.segment<3>(at(i) + 3).setConstant(system.inertia[static_cast<Eigen::Index>(i)]);
    }
  }

  struct StepResult {
    NewtonResult newton;
    double reached = 1;  ///< part of the step's change of load up to which solutions were found
    bool ran_away = false;
  };

  /// One step. Where Newton's method does not lead from the state before to the end of the step at once, the step's
  /// change (of loads, prescribed displacements, and what inertia leaves unbalanced at the start) is put on in parts;
  /// where that path loses its stability the shell is let go, and creeps to where the step's forces are in balance.
  StepResult step(double time, double step, Motion& motion) {
    Step s{motion.configuration, motion.velocity, step, {}, load_factors(model_, false, time + step), {}, {}, {}};
    // A load that is there from time 0 on comes onto a shell at rest without load.
    s.factors_before = time > 0 ? load_factors(model_, false, time) : std::vector<double>(model_.loads.size(), 0.0);
    if (deformation_.empty()) {
      evaluate(system_, model_, s.start, s.factors_before, {}, forces_, nullptr);
      deformation_ = forces_.deformation;
    }
    s.held = VectorX::Zero(motion.velocity.size());
    for (const PrescribedFreedom& p : system_.prescribed) {
      const Ramp& ramp = model_.fixes[p.fix].ramp;
      s.held[static_cast<Eigen::Index>(p.freedom)] =
          p.value * ramp.at(time + step) -
          s.start.displacement[p.freedom / 6][static_cast<Eigen::Index>(p.freedom % 6)];
    }
    StepResult result;
    result.newton = run(s, 0, 1, motion.configuration);
    if (settings_.newton_max > 1 && !settings_.cg_fixed_count && !acceptable(result.newton)) {
      follow(s, result, motion.configuration);
    }
    velocity_between(s.start, motion.configuration, step, motion.velocity);
    for (const Piece& piece : system_.pieces) {
      if (held_by_rigid_motions(model_, piece.body)) {
        stop_rigid_motion(piece, step, motion);
      }
    }
    deformation_ = forces_.deformation;
    return result;
  }

  [[nodiscard]] double kinetic_energy(const VectorX& velocity) const {
    return 0.5 * velocity.dot(mass_.cwiseProduct(velocity));
  }
  [[nodiscard]] std::size_t freedom_count() const { return solver_.freedom_count(); }
  void tell_direct_error(bool tell) { solver_.tell_direct_error(tell); }
  [[nodiscard]] bool at_rest() const { return at_rest_; }
  void go_on(bool at_rest) { at_rest_ = at_rest; }

private:
  struct Step {
    Configuration start;
    VectorX velocity_before;
    double length = 0;  ///< s
    std::vector<double> factors_before;
    std::vector<double> factors;
    VectorX held;           ///< prescribed displacements of the whole step
    VectorX left_at_start;  ///< unbalanced forces of the start, for a path that begins there
    VectorX velocity;
  };

  static bool acceptable(const NewtonResult& result) { return result.converged && result.valid && result.stable; }

  /// Balance of the step with a part of its change; 1: the equation of the step itself.
  Balance balance(Step& s, double part, const Configuration& c, BlockMatrix* tangent) {
    const ViscousState viscous{run_.damping.stiffness / s.length, &deformation_};
    std::vector<double> factors = s.factors;
    for (std::size_t l = 0; part < 1 && l < factors.size(); ++l) {
      factors[l] = s.factors_before[l] + part * (s.factors[l] - s.factors_before[l]);
    }
    evaluate(system_, model_, c, factors, viscous, forces_, tangent);
    velocity_between(s.start, c, s.length, s.velocity);
    const VectorX inertia =
        mass_.cwiseProduct((s.velocity - s.velocity_before) / s.length + run_.damping.mass * s.velocity);
    if (tangent != nullptr) {
      add_inertia(s.start, c, s.length, *tangent);
    }
    Balance result;
    result.valid = forces_.valid;
    result.unbalanced = forces_.external - forces_.internal - inertia;
    if (part < 1 && s.left_at_start.size() > 0) {
      result.unbalanced -= (1 - part) * s.left_at_start;
    }
    VectorX reactions = forces_.internal + inertia;
    for (std::size_t i = 0; i < system_.held.size(); ++i) {
      if (!system_.held[i]) {
        reactions[static_cast<Eigen::Index>(i)] = 0;
      }
    }
    result.scale =
        std::max({force_norm(system_, forces_.external), force_norm(system_, inertia), force_norm(system_, reactions)});
    result.floor = round_off(system_, c);
    return result;
  }

  NewtonResult run(Step& s, double from, double to, Configuration& configuration) {
    const auto function = [&](const Configuration& c, BlockMatrix* tangent) { return balance(s, to, c, tangent); };
    const NewtonResult result =
        newton(system_, settings_, solver_, function, (to - from) * s.held, matrix_, configuration, at_rest_);
    at_rest_ = result.iterations == 0;
    return result;
  }

  void follow(Step& s, StepResult& result, Configuration& configuration) {
    configuration = s.start;
    s.left_at_start = balance(s, 0, configuration, nullptr).unbalanced;
    double done = 0;
    double part = 0.5;
    NewtonResult attempted;
    const auto count = [&] {
      result.newton.iterations += attempted.iterations;
      result.newton.cg_iterations += attempted.cg_iterations;
    };
    while (done < 1 && part >= smallest_part) {
      const double next = std::min(1.0, done + part);
      Configuration attempt = configuration;
      attempted = run(s, done, next, attempt);
      count();
      if (acceptable(attempted)) {
        configuration = std::move(attempt);
        done = next;
        part = std::min(2 * part, 0.5);
      } else {
        part /= 2;
      }
    }
    result.reached = done;
    if (done == 1) {
      const auto [iterations, cg_iterations] = std::pair(result.newton.iterations, result.newton.cg_iterations);
      result.newton = attempted;
      result.newton.iterations = iterations;
      result.newton.cg_iterations = cg_iterations;
      return;
    }
    if (s.held.squaredNorm() > 0) {
      return;
    }
    const auto whole = [&](const Configuration& c, BlockMatrix* tangent) { return balance(s, 1, c, tangent); };
    const SettleResult settled = settle(system_, settings_, solver_, whole, matrix_, configuration);
    result.ran_away = settled.ran_away;
    result.newton.converged = settled.settled;
    result.newton.stable = settled.settled;
    result.newton.valid = settled.settled;
    result.newton.linear_converged = settled.settled;
    result.newton.residual = settled.residual;
    result.newton.iterations += settled.iterations;
    result.newton.cg_iterations += settled.cg_iterations;
  }

  static void velocity_between(const Configuration& start, const Configuration& end, double step, VectorX& velocity) {
    velocity.resize(at(start.displacement.size()));
    for (std::size_t i = 0; i < start.displacement.size(); ++i) {
      velocity.segment<3>(at(i)) = (end.displacement[i] - start.displacement[i]) / step;
      velocity.segment<3>(at(i) + 3) = logarithm(end.rotation[i] * start.rotation[i].conjugate()) / step;
    }
  }

  void add_inertia(const Configuration& start, const Configuration& end, double step, BlockMatrix& tangent) const {
    const double factor = 1 / (step * step) + run_.damping.mass / step;
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      auto block = tangent.block(tangent.find(static_cast<Index>(i), static_cast<Index>(i)));
      block.diagonal().head<3>() += factor * mass_.segment<3>(at(i));
      const Vec3 turned = logarithm(end.rotation[i] * start.rotation[i].conjugate());
      block.block<3, 3>(3, 3) += factor * mass_[at(i) + 3] * spin_to_rate(turned);
    }
  }

  /// Takes linear and angular momentum out of a piece. The loads are in balance, so there is only what the solver's
  /// tolerance left.
  void stop_rigid_motion(const Piece& piece, double step, Motion& motion) const {
    double mass = 0;
    Vec3 centre = Vec3::Zero();
    Vec3 momentum = Vec3::Zero();
    const auto position = [&](Index i) -> Vec3 { return system_.reference[i] + motion.configuration.displacement[i]; };
    for (const Index i : piece.nodes) {
      mass += system_.mass[i];
      centre += system_.mass[i] * position(i);
      momentum += system_.mass[i] * motion.velocity.segment<3>(at(i));
    }
    centre /= mass;
    Vec3 spin = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (const Index i : piece.nodes) {
      const Vec3 arm = position(i) - centre;
      spin += system_.mass[i] * arm.cross(motion.velocity.segment<3>(at(i))) +
              system_.inertia[i] * motion.velocity.segment<3>(at(i) + 3);
      inertia += system_.mass[i] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose()) +
                 system_.inertia[i] * Mat3::Identity();
    }
    const Vec3 velocity = momentum / mass;
    const Vec3 turn = inertia.ldlt().solve(spin);
    for (const Index i : piece.nodes) {
      const Vec3 change = velocity + turn.cross(position(i) - centre);
      motion.velocity.segment<3>(at(i)) -= change;
      motion.velocity.segment<3>(at(i) + 3) -= turn;
      motion.configuration.displacement[i] -= step * change;
      motion.configuration.rotation[i] = (exponential(-step * turn) * motion.configuration.rotation[i]).normalized();
    }
  }

  const ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  const DynamicRun& run_;
  TangentSolver solver_;
  BlockMatrix matrix_;
  VectorX mass_;
  Forces forces_;
  bool at_rest_ = false;                   ///< the last step changed nothing
  std::vector<ElementState> deformation_;  ///< at the start of the step
};

double first_load_factor(const Model& model, double time) {
  return model.loads.empty() ? 0 : model.loads.front().ramp.at(time);
}

}  // namespace

Summary run_dynamic(ShellSystem& system, const Model& model, const RunSettings& settings, const DynamicRun& run,
                    const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  release_rigid_motion_supports(system, model);
  Summary summary;
  BackwardEuler integrator(system, model, settings, run);
  Motion motion{reference_configuration(system), VectorX::Zero(at(system.node_count()))};
  const auto hand_over = [&](State& state) {
    state.load_factor = first_load_factor(model, state.time);
    state.kinetic_energy = integrator.kinetic_energy(motion.velocity);
    state.velocity.resize(system.node_count());
    state.angular_velocity.resize(system.node_count());
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      state.velocity[i] = motion.velocity.segment<3>(at(i));
      state.angular_velocity[i] = motion.velocity.segment<3>(at(i) + 3);
    }
    on_state(state);
  };
  State state;
  double time = 0;
  if (resumption.from) {
    summary = resumption.from->summary;
    time = resumption.from->position;
    motion.configuration = {resumption.from->displacement, resumption.from->rotation};
    const std::vector<double>& velocity = resumption.from->memory.at("velocity");
    TUNICA_ASSERT(velocity.size() == static_cast<std::size_t>(motion.velocity.size()));
    std::copy(velocity.begin(), velocity.end(), motion.velocity.begin());
    integrator.go_on(resumption.from->memory.at("at_rest").at(0) != 0);
  } else {
    summary.dof = integrator.freedom_count();
    state = make_state(system, model, motion.configuration, 0);
    state.converged = true;
    hand_over(state);
    summary.volume_before = state.volume;
    summary.volume_after = state.volume;
  }

  // The last step may be shorter: the run ends at its duration.
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil(run.duration / run.step - 1e-9)));
  for (std::size_t s = summary.steps; s < steps; ++s) {
    const auto start = Clock::now();
    const bool last = s + 1 == steps;
    const double end = last ? run.duration : static_cast<double>(s + 1) * run.step;
    integrator.tell_direct_error(s == 0 || last);
    const auto [result, reached, ran_away] = integrator.step(time, end - time, motion);
    const bool one_linearisation = settings.newton_max == 1;
    const bool accepted = one_linearisation
                              ? (result.linear_converged || settings.cg_fixed_count) &&
                                    (result.residual <= largest_unchecked_residual || settings.cg_fixed_count)
                              : (result.converged && result.stable) || settings.cg_fixed_count;
    if (!result.valid || !accepted) {
      const std::vector<double> wanted_factors = load_factors(model, false, end);
      std::vector<double> carried =
          time > 0 ? load_factors(model, false, time) : std::vector<double>(wanted_factors.size(), 0.0);
      for (std::size_t l = 0; l < carried.size(); ++l) {
        carried[l] += reached * (wanted_factors[l] - carried[l]);
      }
      throw RequirementError(
          reached < 1
              ? fmt::format(
                    "no equilibrium in the step from {:.6g} s to {:.6g} s: the limit load is reached at "
                    "{:.3g} of its change of load ({}); beyond it {}; the last good state is at {:.6g} s",
                    time, end, reached, describe_loads(model, carried, wanted_factors),
                    ran_away ? "the shell yields without bound" : "no state was found that the shell could rest in",
                    time)
              : fmt::format("the step from {:.6g} s to {:.6g} s {} (relative residual {:.3g} after {} "
                            "iterations): take a smaller step, a ramp or damping; the last good state is at {:.6g} s",
                            time, end, result.valid ? "did not converge" : "made elements collapse or fold",
                            result.residual, result.iterations, time));
    }
    time = end;
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    const bool wanted = (s + 1) % settings.every == 0 || last;
    state = wanted ? make_state(system, model, motion.configuration, time) : State();
    state.residual = result.residual;
    state.newton_iterations = result.iterations;
    state.cg_iterations = result.cg_iterations;
    set_algebraic_error(result.algebraic_error, state);
    state.converged = one_linearisation ? result.linear_converged : result.converged;
    if (wanted) {
      hand_over(state);
    }
    record_step(state, seconds, summary);
    resumption.offer([&] {
      return Checkpoint{summary,
                        time,
                        motion.configuration.displacement,
                        motion.configuration.rotation,
                        {{"velocity", {motion.velocity.begin(), motion.velocity.end()}},
                         {"at_rest", {integrator.at_rest() ? 1.0 : 0.0}}}};
    });
    advance(progress, static_cast<double>(s + 1) / static_cast<double>(steps));
  }
  return summary;
}

}  // namespace tunica
