#include "core/error.hpp"
#include "mechanics/rotation.hpp"
#include "mechanics/run.hpp"
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

  NewtonResult step(double time, double step, Motion& motion) {
    const Configuration start = motion.configuration;
    const VectorX before = motion.velocity;
    if (deformation_.empty()) {
      evaluate(system_, model_, start, load_factors(model_, false, time), {}, forces_, nullptr);
      deformation_ = forces_.deformation;
    }
    const ViscousState viscous{run_.damping.stiffness / step, &deformation_};
    const std::vector<double> factors = load_factors(model_, false, time + step);
    VectorX velocity;
    const auto balance = [&](const Configuration& c, BlockMatrix* tangent) {
      evaluate(system_, model_, c, factors, viscous, forces_, tangent);
      velocity_between(start, c, step, velocity);
      const VectorX inertia = mass_.cwiseProduct((velocity - before) / step + run_.damping.mass * velocity);
      if (tangent != nullptr) {
        add_inertia(start, c, step, *tangent);
      }
      Balance result;
      result.valid = forces_.valid;
      result.unbalanced = forces_.external - forces_.internal - inertia;
      VectorX reactions = forces_.internal + inertia;
      for (std::size_t i = 0; i < system_.held.size(); ++i) {
        if (!system_.held[i]) {
          reactions[static_cast<Eigen::Index>(i)] = 0;
        }
      }
      result.scale = std::max(
          {force_norm(system_, forces_.external), force_norm(system_, inertia), force_norm(system_, reactions)});
      result.floor = round_off(system_, c);
      return result;
    };
    VectorX held = VectorX::Zero(before.size());
    for (const PrescribedFreedom& p : system_.prescribed) {
      const Ramp& ramp = model_.fixes[p.fix].ramp;
      held[static_cast<Eigen::Index>(p.freedom)] =
          p.value * ramp.at(time + step) - start.displacement[p.freedom / 6][static_cast<Eigen::Index>(p.freedom % 6)];
    }
    const NewtonResult result = newton(system_, settings_, solver_, balance, held, matrix_, motion.configuration);
    velocity_between(start, motion.configuration, step, motion.velocity);
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

private:
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
  std::vector<Vector18> deformation_;  ///< at the start of the step
};

double first_load_factor(const Model& model, double time) {
  return model.loads.empty() ? 0 : model.loads.front().ramp.at(time);
}

}  // namespace

Summary run_dynamic(ShellSystem& system, const Model& model, const RunSettings& settings, const DynamicRun& run,
                    const StateCallback& on_state, const Progress& progress) {
  release_rigid_motion_supports(system, model);
  Summary summary;
  BackwardEuler integrator(system, model, settings, run);
  summary.dof = integrator.freedom_count();
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
  State state = make_state(system, model, motion.configuration, 0);
  state.converged = true;
  hand_over(state);
  summary.volume_before = state.volume;
  summary.volume_after = state.volume;

  // The last step may be shorter: the run ends at its duration.
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil(run.duration / run.step - 1e-9)));
  double time = 0;
  for (std::size_t s = 0; s < steps; ++s) {
    const auto start = Clock::now();
    const bool last = s + 1 == steps;
    const double end = last ? run.duration : static_cast<double>(s + 1) * run.step;
    const NewtonResult result = integrator.step(time, end - time, motion);
    const bool one_linearisation = settings.newton_max == 1;
    const bool accepted = one_linearisation
                              ? (result.linear_converged || settings.cg_fixed_count) &&
                                    (result.residual <= largest_unchecked_residual || settings.cg_fixed_count)
                              : result.converged || settings.cg_fixed_count;
    if (!result.valid || !accepted) {
      throw RequirementError(
          fmt::format("the step from {:.6g} s to {:.6g} s {} (relative residual {:.3g} after {} iterations): take a "
                      "smaller step, a "
                      "ramp or damping; the last good state is at {:.6g} s",
                      time, end, result.valid ? "did not converge" : "made elements collapse or fold", result.residual,
                      result.iterations, time));
    }
    time = end;
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    const bool wanted = (s + 1) % settings.every == 0 || last;
    state = make_state(system, model, motion.configuration, time);
    state.residual = result.residual;
    state.newton_iterations = result.iterations;
    state.cg_iterations = result.cg_iterations;
    state.converged = one_linearisation ? result.linear_converged : result.converged;
    if (wanted) {
      hand_over(state);
    }
    record_step(state, seconds, summary);
    advance(progress, static_cast<double>(s + 1) / static_cast<double>(steps));
  }
  return summary;
}

}  // namespace tunica
