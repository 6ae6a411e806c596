#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/contact_steps.hpp"
#include "tunica/mechanics/runs/detail/settle.hpp"
#include "tunica/mechanics/runs/detail/stepped_run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/detail/table_turns.hpp"
#include "tunica/mechanics/runs/detail/time_scheme.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <cmath>
#include <limits>

namespace tunica {
namespace {

/// Smallest part of a step's change that is tried on its own.
constexpr double smallest_part = 1.0 / 256;
/// Smallest part of a step's time that error control or a turn of a table may ask for.
constexpr double shortest_part = 1.0 / 4096;

/// Whether a step's result may stand.
bool is_solved(const RunSettings& settings, const NewtonResult& result) {
  if (!result.valid || !result.apart) {
    return false;
  }
  if (settings.cg_fixed_count) {
    return true;
  }
  return settings.newton_max == 1 ? result.linear_converged && result.residual <= largest_unchecked_residual
                                  : result.converged && result.stable;
}

/// A gain of energy by time integration that passes this part of the largest energy is told. What trapezia leave of the
/// work of loads that follow a coarse step stays below.
constexpr double tolerated_gain = 0.1;

struct Motion {
  Configuration configuration;
  Rates rates;
};

/// The rigid motion with the linear and angular momentum of a piece whose nodes have these velocities.
struct RigidMotion {
  Vec3 velocity, turn, centre;

  [[nodiscard]] Vec3 at(const Vec3& position) const { return velocity + turn.cross(position - centre); }
};

RigidMotion rigid_motion(const ShellSystem& system, const Piece& piece, const Configuration& c,
                         const VectorX& velocities) {
  double mass = 0;
  Vec3 centre = Vec3::Zero();
  Vec3 momentum = Vec3::Zero();
  for (const Index i : piece.nodes) {
    mass += system.mass[i];
    centre += system.mass[i] * (system.reference[i] + c.displacement[i]);
    momentum += system.mass[i] * velocities.segment<3>(first_freedom(i));
  }
  centre /= mass;
  Vec3 spin = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();
  for (const Index i : piece.nodes) {
    const Vec3 arm = system.reference[i] + c.displacement[i] - centre;
    spin += system.mass[i] * arm.cross(velocities.segment<3>(first_freedom(i))) +
            system.inertia[i] * velocities.segment<3>(first_freedom(i) + 3);
    inertia += system.mass[i] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose()) +
               system.inertia[i] * Mat3::Identity();
  }
  const Vec3 turn =
      (piece.turns * inertia * piece.turns + Mat3::Identity() - piece.turns).ldlt().solve(piece.turns * spin);
  return {piece.shifts * momentum / mass, turn, centre};
}

/// Takes linear and angular momentum out of a piece. The loads are in balance, so there is only what the solver's
/// tolerance left.
void stop_rigid_motion(const ShellSystem& system, const Piece& piece, double length, Motion& motion) {
  Configuration& c = motion.configuration;
  const Configuration moved = c;
  for (VectorX* rates : {&motion.rates.velocity, &motion.rates.acceleration, &motion.rates.auxiliary}) {
    const RigidMotion rigid = rigid_motion(system, piece, moved, *rates);
    const bool velocity = rates == &motion.rates.velocity;
    for (const Index i : piece.nodes) {
      const Vec3 change = rigid.at(system.reference[i] + moved.displacement[i]);
      rates->segment<3>(first_freedom(i)) -= change;
      rates->segment<3>(first_freedom(i) + 3) -= rigid.turn;
      if (velocity) {
        c.displacement[i] -= length * change;
        c.rotation[i] = (exponential(-length * rigid.turn) * c.rotation[i]).normalized();
      }
    }
  }
}

void find_change(const Configuration& start, const Configuration& end, VectorX& change) {
  change.resize(first_freedom(start.displacement.size()));
  for (std::size_t i = 0; i < start.displacement.size(); ++i) {
    change.segment<3>(first_freedom(i)) = end.displacement[i] - start.displacement[i];
    change.segment<3>(first_freedom(i) + 3) = logarithm(end.rotation[i] * start.rotation[i].conjugate());  // 0: solids
  }
}

bool acceptable(const NewtonResult& result) { return result.converged && result.valid && result.stable; }

/// Damping by beta K: forces beta K times the rate of deformation, in each element's own frame. The rate at the end of
/// a step is viscosity (deformation - zero): the backward difference, or that of second order through the step before.
class StiffnessDamping {
public:
  StiffnessDamping(const ShellSystem& system, double beta, bool second_order)
      : system_(system), beta_(beta), second_order_(second_order) {}

  /// @param start deformation at the start of the step; @param length s, of the step.
  void begin(const std::vector<ElementState>& start, double length) {
    if (beta_ == 0) {
      return;
    }
    if (!second_order_ || before_.empty()) {
      zero_ = start;
      viscosity_ = beta_ / length;
      return;
    }
    const double r = length / length_before_;
    const double leading = (1 + 2 * r) / (1 + r);
    zero_.resize(start.size());
    for (std::size_t e = 0; e < start.size(); ++e) {
      zero_[e] = ((1 + r) * start[e] - r * r / (1 + r) * before_[e]) / leading;
    }
    viscosity_ = beta_ * leading / length;
  }

  [[nodiscard]] ViscousState state() const { return {viscosity_, viscosity_ > 0 ? &zero_ : nullptr}; }

  /// @return the work of these forces over the step, mJ: by the mean of those at both of its ends.
  double accept(const std::vector<ElementState>& start, const std::vector<ElementState>& end, double length) {
    if (beta_ == 0) {
      return 0;
    }
    double work = 0;
    rate_.resize(system_.elements.size(), ElementState::Zero());
    for (std::size_t e = 0; e < system_.elements.size(); ++e) {
      const ShellElement& element = system_.elements[e];
      const ElementState rate = viscosity_ * (end[e] - zero_[e]);
      const ElementState mean = 0.5 * (rate_[e] + rate);
      const ElementState change = end[e] - start[e];
      // The energy is a quadratic form: of what belongs to it, the product of both.
      work += strain_energy(element, mean + change) - strain_energy(element, mean) - strain_energy(element, change);
      rate_[e] = rate;
    }
    if (second_order_) {
      before_ = start;
      length_before_ = length;
    }
    return work;
  }

  void remember(MotionMemory& memory) const {
    memory.viscous_rate = numbers_of(rate_);
    memory.deformation_before = numbers_of(before_);
    memory.length_before = length_before_;
  }

  void recall(const MotionMemory& memory) {
    rate_ = of_elements(memory.viscous_rate, "the viscous rate");
    before_ = of_elements(memory.deformation_before, "the deformation before");
    length_before_ = memory.length_before;
  }

private:
  static std::vector<double> numbers_of(const std::vector<ElementState>& of_elements) {
    std::vector<double> numbers;
    for (const ElementState& d : of_elements) {
      numbers.insert(numbers.end(), d.begin(), d.end());
    }
    return numbers;
  }

  /// Of the elements, or of none.
  [[nodiscard]] std::vector<ElementState> of_elements(const std::vector<double>& numbers, std::string_view name) const {
    constexpr std::size_t size = ElementState::SizeAtCompileTime;
    if (!numbers.empty()) {
      require_count(numbers.size(), size * system_.elements.size(), name);
    }
    std::vector<ElementState> result(numbers.size() / size);
    for (std::size_t e = 0; e < result.size(); ++e) {
      result[e] = Eigen::Map<const ElementState>(numbers.data() + size * e);
    }
    return result;
  }

  const ShellSystem& system_;
  double beta_;  ///< s
  bool second_order_;
  double viscosity_ = 0;              ///< beta / s: of the rate by the deformation
  std::vector<ElementState> zero_;    ///< the deformation at which these forces vanish
  std::vector<ElementState> before_;  ///< at the start of the step before
  std::vector<ElementState> rate_;    ///< beta times the rate of deformation, at the start of the step
  double length_before_ = 0;          ///< s
};

/// Free, or carried.
FreeMask moving_freedoms(const ShellSystem& system) {
  FreeMask moves = free_freedoms(system);
  for (const Carried& c : system.carried) {
    std::fill_n(moves.begin() + first_freedom(c.node), c.freedoms(), true);
  }
  return moves;
}

std::vector<bool> held_along_world(FreeMask moves) {
  moves.flip();
  return along_world(moves);
}

/// M a1 + alpha M v1 + f_int(x1) = f_ext(x1, t1), with velocity and acceleration at the end of a step as the scheme
/// says. Damping is alpha M and, in each element's own frame, beta K times the rate of its deformation: a rigid motion
/// is not damped by beta.
class TimeStepper {
public:
  TimeStepper(ShellSystem& system, const RunSettings& settings, const DynamicRun& run)
      : system_(system),
        model_(*system.model),
        settings_(settings),
        run_(run),
        scheme_(run),
        damping_(system, run.damping.stiffness, scheme_.second_order()),
        matrix_(system.pattern),
        mass_(lumped_masses(system)),
        moves_(moving_freedoms(system)),
        held_(held_along_world(moves_)),
        contact_work_(system),
        part_(run.step) {
    solver_.emplace(system, settings);
    if (system.prestress_residual) {
      evaluate(system, {reference_configuration(system), load_factors(model_, false, 0)}, forces_, nullptr);
      borne_ = forces_.internal;
      mask(solver_->free(), borne_);
    }
    if (run.adaptive) {
      Vec3 low = system.reference.front();
      Vec3 high = low;
      for (const Vec3& x : system.reference) {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
      }
      tolerance_ = run.adaptive->millimetres((high - low).norm());
    }
  }

  struct StepResult {
    NewtonResult newton;
    double reached = 1;  ///< part of the step's change of load up to which solutions were found
    bool ran_away = false;
    std::size_t parts = 1;
    bool precise = true;  ///< false: no part is short enough for the tolerance
  };

  /// The forces that act at time 0, and the accelerations with which a second-order scheme begins.
  void start(Motion& motion) {
    evaluate(system_, {motion.configuration, load_factors(model_, false, 0)}, forces_, nullptr);
    keep_acting(motion);
    braking_ = VectorX::Zero(mass_.size());
    if (!scheme_.second_order()) {
      return;
    }
    motion.rates.acceleration = accelerations(motion.configuration);
    motion.rates.auxiliary = motion.rates.acceleration;
  }

  /// One step, with error control in as many parts as it takes.
  StepResult advance(double time, double length, Motion& motion) {
    if (tolerance_ == 0) {
      StepResult result = step(time, length, true, motion);
      if (is_solved(settings_, result.newton)) {
        accept(length, motion);
      }
      return result;
    }
    StepResult total;
    total.parts = 0;
    std::size_t iterations = 0;
    std::size_t cg_iterations = 0;
    for (double done = 0; done < length * (1 - 1e-12);) {
      const std::vector<double> contact = remembered_contact();
      const double left = length - done;
      // No tiny rest: what is between one and two parts is halved.
      const double h = part_ >= left * (1 - 1e-9) ? left : part_ > left / 2 ? left / 2 : part_;
      const bool shortest = h <= length * shortest_part;
      Motion attempt = motion;
      StepResult result = step(time + done, h, shortest, attempt);
      iterations += result.newton.iterations;
      cg_iterations += result.newton.cg_iterations;
      const bool solved = is_solved(settings_, result.newton);
      const double error = increment_size(system_, scheme_.local_error(h, motion.rates, attempt.rates)) / tolerance_;
      const double wanted = h * std::clamp(0.9 * std::pow(error, -1 / scheme_.local_order()), 0.2, 2.0);
      if (solved && error <= 1) {
        motion = std::move(attempt);
        accept(h, motion);
        done = h == left ? length : done + h;
        part_ = std::min(h < part_ && wanted >= h ? std::max(wanted, part_) : wanted, run_.step);
        ++total.parts;
      } else if (shortest) {
        motion = std::move(attempt);
        total.reached = (done + result.reached * h) / length;
        total.ran_away = result.ran_away;
        total.precise = !solved;
        total.newton = result.newton;
        break;
      } else {
        recall_contact(contact, motion, time + done);
        part_ = std::max(solved && std::isfinite(wanted) ? std::min(wanted, h / 2) : h / 4, length * shortest_part);
        continue;
      }
      total.newton = result.newton;
    }
    total.newton.iterations = iterations;
    total.newton.cg_iterations = cg_iterations;
    return total;
  }

  /// What a run must keep between its steps to go on as if nothing had happened, beyond the configuration.
  [[nodiscard]] MotionMemory memory(const Motion& motion) const {
    MotionMemory result;
    result.velocity = motion.rates.velocity;
    result.acceleration = motion.rates.acceleration;
    result.auxiliary = motion.rates.auxiliary;
    result.acting = acting_;
    result.touching = contact_work_.touching();
    result.part = part_;
    result.at_rest = at_rest_;
    damping_.remember(result);
    return result;
  }

  void recall(const MotionMemory& memory, Motion& motion) {
    const auto take = [&](const VectorX& from, const char* name, VectorX& to) {
      require_count(narrow<std::size_t>(from.size()), narrow<std::size_t>(mass_.size()), name);
      to = from;
    };
    take(memory.velocity, "the velocity", motion.rates.velocity);
    take(memory.acceleration, "the acceleration", motion.rates.acceleration);
    take(memory.auxiliary, "the integrator", motion.rates.auxiliary);
    take(memory.acting, "the acting forces", acting_);
    VectorX touching;
    if (system_.contact) {
      take(memory.touching, "the forces of contact", touching);
    }
    contact_work_.recall(touching);
    deformation_.clear();
    work_ = damped_ = 0;
    part_ = memory.part;
    at_rest_ = memory.at_rest;
    damping_.recall(memory);
    braking_ = run_.damping.mass * mass_.cwiseProduct(motion.rates.velocity);
  }

  [[nodiscard]] double kinetic_energy(const VectorX& velocity) const {
    return 0.5 * velocity.dot(mass_.cwiseProduct(velocity));
  }

  /// Closes the balance of energy after a step.
  void balance_energy(std::size_t step, double time, const Motion& motion, EnergyBalance& energy) {
    const double stored = forces_.energy + kinetic_energy(motion.rates.velocity) + contact_work_.stored();
    energy.work += std::exchange(work_, 0);
    energy.damped += std::exchange(damped_, 0);
    energy.lost = energy.work - energy.damped - stored;
    energy.most_lost = std::max(energy.most_lost, energy.lost);
    // Of a wall that was imaged under pressure, the pressure's work on what the wall bears already swings nothing.
    double borne = 0;
    if (borne_.size() > 0) {
      VectorX moved;
      find_change(reference_configuration(system_), motion.configuration, moved);
      borne = borne_.dot(moved);
    }
    energy.largest = std::max({energy.largest, stored - borne, std::abs(energy.work - borne)});
    if (energy.largest > 0) {
      energy.gained = std::max(energy.gained, (energy.most_lost - energy.lost) / energy.largest);
    }
    if (energy.gained > tolerated_gain && energy.gaining_step == 0) {
      energy.gaining_step = step;
      energy.gaining_time = time;
    }
  }

  [[nodiscard]] std::size_t freedom_count() const { return solver_->freedom_count(); }
  void tell_direct_error(bool tell) { solver_->tell_direct_error(tell); }
  [[nodiscard]] double tolerance() const { return tolerance_; }

private:
  struct Step {
    Configuration start;
    Rates rates_before;
    double time = 0, length = 0;  ///< s: of its start, and its own
    std::vector<double> factors_before;
    std::vector<double> factors;
    VectorX held;           ///< prescribed displacements of the whole step
    VectorX left_at_start;  ///< unbalanced forces of the start, for a path that begins there
    VectorX change;
    Rates rates;
  };

  /// Of what is at rest, under the forces at hand.
  VectorX accelerations(const Configuration& at) {
    VectorX unbalanced = forces_.external - forces_.internal;
    if (system_.carried.empty()) {
      for (Eigen::Index i = 0; i < mass_.size(); ++i) {
        unbalanced[i] = mass_[i] > 0 ? unbalanced[i] / mass_[i] : 0;
      }
      mask(solver_->free(), unbalanced);
      return unbalanced;
    }
    BlockMatrix inertia = system_.pattern;  // what is carried weighs on several nodes
    std::ranges::fill(inertia.values, 0.0);
    for (Index i = 0; i < system_.node_count(); ++i) {
      const Vector6 mass = mass_.segment<6>(first_freedom(i));
      inertia.block(inertia.find(i, i)).diagonal() = (mass.array() > 0).select(mass, 1.0);
    }
    VectorX none = VectorX::Zero(mass_.size()), result;
    condense(system_, at, none, &inertia);
    condense(system_, at, unbalanced, nullptr);
    mask(solver_->free(), unbalanced);
    solver_->solve(inertia, unbalanced, result);
    expand_carried(system_.carried, system_.surfaces, system_.reference, at, result);
    return result;
  }

  /// One step or part of one. Where Newton's method does not lead from the state before to the end at once, and it
  /// may_follow, the change (of loads, prescribed displacements, and what inertia leaves unbalanced at the start) is
  /// put on in parts; where that path loses its stability the shell is let go, and creeps to where the step's forces
  /// are in balance.
  StepResult step(double time, double length, bool may_follow, Motion& motion) {
    Step s;
    s.start = motion.configuration;
    s.rates_before = motion.rates;
    s.time = time;
    s.length = length;
    s.factors = load_factors(model_, false, time + length);
    // A load that is there from time 0 on comes onto a shell at rest without load.
    s.factors_before = time > 0 ? load_factors(model_, false, time) : std::vector<double>(model_.loads.size(), 0.0);
    if (deformation_.empty()) {
      evaluate(system_, {s.start, s.factors_before}, forces_, nullptr);
      deformation_ = forces_.deformation;
    }
    damping_.begin(deformation_, length);
    s.held = VectorX::Zero(motion.rates.velocity.size());
    for (const PrescribedFreedom& p : system_.prescribed) {
      const Ramp& ramp = model_.fixes[p.fix].ramp;
      s.held[p.freedom] = p.value * ramp.at(time + length) - s.start.displacement[p.freedom / 6][p.freedom % 6];
    }
    StepResult result;
    result.newton = run(s, 0, 1, motion.configuration);
    if (may_follow && settings_.newton_max > 1 && !settings_.cg_fixed_count && !acceptable(result.newton)) {
      follow(s, result, motion.configuration);
    }
    find_change(s.start, motion.configuration, change_);
    scheme_.end_rates(length, held_, s.rates_before, change_, motion.rates);
    for (const Piece& piece : system_.pieces) {
      if (piece.balanced) {
        stop_rigid_motion(system_, piece, length, motion);
      }
    }
    return result;
  }

  /// The step is done: its end is where the next one starts. What acts does work by the mean of both ends, forces of
  /// damping as all others: else one of them gains what another loses.
  void accept(double length, const Motion& motion) {
    const VectorX acted = std::move(acting_);
    keep_acting(motion);
    accept_contact(system_, motion.configuration);
    work_ += 0.5 * (acted + acting_).dot(change_);
    const auto [brought, damped] = contact_work_.over(change_);
    work_ += brought;
    damped_ += damped;
    const VectorX braked = std::move(braking_);
    braking_ = run_.damping.mass * mass_.cwiseProduct(motion.rates.velocity);
    damped_ += 0.5 * (braked + braking_).dot(change_);
    damped_ += damping_.accept(deformation_, forces_.deformation, length);
    deformation_ = forces_.deformation;
  }

  /// Loads, and on held freedoms what moves them; apart from these, contact.
  void keep_acting(const Motion& motion) {
    acting_ = forces_.external;
    VectorX contact = forces_.contact;
    if (contact.size() > 0) {
      mask(moves_, contact);
      acting_ -= contact;
    }
    contact_work_.keep(std::move(contact));
    VectorX reaction = forces_.internal - forces_.external +
                       mass_.cwiseProduct(motion.rates.acceleration + run_.damping.mass * motion.rates.velocity);
    condense(system_, motion.configuration, reaction, nullptr);
    mask(system_.held, reaction);
    acting_ += reaction;
  }

  /// Balance of the step with a part of its change; 1: the equation of the step itself.
  Balance balance(Step& s, double part, const Configuration& c, BlockMatrix* tangent,
                  const std::vector<ElementState>& predicted) {
    std::vector<double> factors = s.factors;
    for (std::size_t l = 0; part < 1 && l < factors.size(); ++l) {
      factors[l] = s.factors_before[l] + part * (s.factors[l] - s.factors_before[l]);
    }
    find_change(s.start, c, s.change);
    scheme_.end_rates(s.length, held_, s.rates_before, s.change, s.rates);
    const Movement movement{s.change,
                            s.rates.velocity,
                            s.rates.acceleration,
                            scheme_.velocity_factor(s.length),
                            scheme_.acceleration_factor(s.length),
                            run_.damping.mass,
                            damping_.state()};
    Balance result = balance_at(system_, {c, factors, &predicted, &movement}, forces_, tangent);
    if (part < 1 && s.left_at_start.size() > 0) {
      result.unbalanced -= (1 - part) * s.left_at_start;
    }
    return result;
  }

  NewtonResult run(Step& s, double from, double to, Configuration& configuration) {
    const auto function = [&](const Configuration& c, BlockMatrix* tangent,
                              const std::vector<ElementState>& predicted) {
      return balance(s, to, c, tangent, predicted);
    };
    begin_contact(system_, settings_, s.time + from * s.length, s.time + to * s.length, configuration, solver_,
                  matrix_);
    brace_contact(system_, s.rates_before.velocity, s.length);
    NewtonResult result =
        newton(system_, settings_, *solver_, function, (to - from) * s.held, matrix_, configuration, at_rest_);
    at_rest_ = result.iterations == 0;
    if (system_.contact && is_solved(settings_, result) && !system_.contact->is_certain(configuration)) {
      result.converged = result.apart = false;
    }
    return result;
  }

  [[nodiscard]] std::vector<double> remembered_contact() const {
    return system_.contact ? system_.contact->memory() : std::vector<double>();
  }

  /// Attempts that came to nothing may have been followed in parts.
  void recall_contact(const std::vector<double>& memory, const Motion& motion, double time) {
    if (system_.contact) {
      system_.contact->recall(memory, motion.configuration, time);
    }
  }

  void follow(Step& s, StepResult& result, Configuration& configuration) {
    configuration = s.start;
    s.left_at_start = balance(s, 0, configuration, nullptr, {}).unbalanced;
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
        accept_contact(system_, configuration);
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
    const auto whole = [&](const Configuration& c, BlockMatrix* tangent, const std::vector<ElementState>& predicted) {
      return balance(s, 1, c, tangent, predicted);
    };
    begin_contact(system_, settings_, s.time + s.length, s.time + s.length, configuration, solver_, matrix_);
    SettleResult settled;
    try {
      settled = settle(system_, settings_, *solver_, whole, matrix_, configuration);
    } catch (const MemoryError&) {  // with the cg solver the step fails as without it
    }
    result.ran_away = settled.ran_away;
    result.newton.apart = !system_.contact || !settled.settled || system_.contact->is_certain(configuration);
    const bool rests = settled.settled && result.newton.apart;
    result.newton.converged = result.newton.stable = result.newton.valid = result.newton.linear_converged = rests;
    result.newton.residual = settled.residual;
    result.newton.iterations += settled.iterations;
    result.newton.cg_iterations += settled.cg_iterations;
  }

  ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  const DynamicRun& run_;
  const TimeScheme scheme_;
  StiffnessDamping damping_;
  std::optional<TangentSolver> solver_;
  BlockMatrix matrix_;
  VectorX mass_;
  const FreeMask moves_;          ///< what is free or follows what is
  const std::vector<bool> held_;  ///< the rest, along world axes
  Forces forces_;
  std::vector<ElementState> deformation_;  ///< at the start of the step
  VectorX change_;                         ///< displacements and rotations of the last part of a step
  VectorX acting_;                         ///< at the start of the step, without contact
  ContactWork contact_work_;
  VectorX borne_;    ///< forces of the reference's prestress; empty: it has none
  VectorX braking_;  ///< forces of damping by mass, likewise
  double work_ = 0;  ///< mJ, since energies were last balanced
  double damped_ = 0;
  double tolerance_ = 0;  ///< mm, of error control; 0: none
  double part_ = 0;       ///< s: length of the next part under error control
  bool at_rest_ = false;  ///< the last step changed nothing
};

double first_load_factor(const Model& model, double time) {
  return model.loads.empty() ? 0 : model.loads.front().ramp.at(time);
}

/// The steps of a run, what they hand over, and why one fails.
class TimeLoop final : public SteppedRun {
public:
  TimeLoop(ShellSystem& system, const RunSettings& settings, const DynamicRun& run, const StateCallback& on_state)
      : SteppedRun(system, settings, on_state, step_count(run)),
        run_(run),
        stepper_(system, settings, run),
        turns_(model_, system.contact != nullptr),
        motion_{reference_configuration(system), Rates::zero(first_freedom(system.node_count()))} {}

private:
  static std::size_t step_count(const DynamicRun& run) {
    return truncated<std::size_t>(std::max(1.0, std::ceil(run.duration / run.step - 1e-9)));
  }

  State begin() override {
    summary_.dof = stepper_.freedom_count();
    summary_.energy.emplace();
    stepper_.start(motion_);
    return state_now();
  }

  void resume(const Checkpoint& from) override {
    time_ = from.position;
    motion_.configuration = recall(from);
    require_count(from.motion ? 1 : 0, 1, "a motion");
    stepper_.recall(*from.motion, motion_);
    last_change_ = from.motion->last_change;
    if (last_change_.size() > 0) {
      require_count(narrow<std::size_t>(last_change_.size()), 6 * system_.node_count(), "the last change");
    }
  }

  [[nodiscard]] Checkpoint checkpoint() const override {
    Checkpoint now = keep(time_, motion_.configuration);
    now.motion = stepper_.memory(motion_);
    now.motion->last_change = last_change_;
    return now;
  }

  State take_step() override {
    // Not of the first step, which is the longest without.
    stepper_.tell_direct_error(summary_.steps == 1 || is_last());
    // The last step may be shorter: the run ends at its duration.
    const double end = is_last() ? run_.duration : real(summary_.steps + 1) * run_.step;
    const Configuration before = motion_.configuration;
    NewtonResult result;
    std::size_t iterations = 0;
    std::size_t cg_iterations = 0;
    while (time_ != end) {
      const bool is_uneven = system_.contact || run_.adaptive;
      result = take_part(is_uneven ? turns_.next(time_, end, shortest_part * run_.step) : end);
      iterations += result.iterations;
      cg_iterations += result.cg_iterations;
      tell_slow_step(iterations, fmt::format("{:.6g} s of {:.6g} s", time_, run_.duration),
                     "it is taken in short parts" + (system_.contact ? system_.contact->closest_place() : ""));
    }
    stepper_.balance_energy(summary_.steps + 1, end, motion_, *summary_.energy);
    look_for_swing(before);
    State state = wants_state() ? state_now() : State();
    state.residual = result.residual;
    state.newton_iterations = iterations;
    state.cg_iterations = cg_iterations;
    set_algebraic_error(result.algebraic_error, state);
    state.converged = settings_.newton_max == 1 ? result.linear_converged : result.converged;
    return state;
  }

  /// A part of a step in which no table turns. Errors: RequirementError.
  NewtonResult take_part(double end) {
    const Checkpoint start = checkpoint();
    const TimeStepper::StepResult part = advance_stiffening(start, end);
    if (!part.precise) {
      throw RequirementError(fmt::format(
          "the step from {:.6g} s to {:.6g} s adds more than the tolerance of {:.3g} mm to the error however "
          "short its parts are: allow a larger one (adaptive), or put the load on by a ramp",
          time_, end, stepper_.tolerance()));
    }
    if (!is_solved(settings_, part.newton)) {
      fail(part, start, end);
    }
    time_ = end;
    summary_.parts += part.parts;
    return part.newton;
  }

  /// How far a step of a second-order scheme bends the motion, where no error control looks: a mode of which it is x
  /// radians turns by 4 sin^2(x / 2) of its amplitude, however small its share in the motion is.
  void look_for_swing(const Configuration& before) {
    if (run_.integrator == Integrator::backward_euler || run_.adaptive) {
      return;
    }
    VectorX moved;
    find_change(reference_configuration(system_), motion_.configuration, moved);
    summary_.largest_motion = std::max(summary_.largest_motion, increment_size(system_, moved));
    find_change(before, motion_.configuration, moved);
    const VectorX bend = last_change_.size() > 0 ? VectorX(moved - last_change_) : moved;
    summary_.largest_bend = std::max(summary_.largest_bend, increment_size(system_, bend));
    last_change_ = std::move(moved);
  }

  /// A part that fails is taken again with its short waves made stiff, where the mesh is coarse for the thickness.
  TimeStepper::StepResult advance_stiffening(const Checkpoint& start, double end) {
    const TimeStepper::StepResult part = stepper_.advance(time_, end - time_, motion_);
    if (summary_.stiffened_from || !soft_waves_ || (part.precise && is_solved(settings_, part.newton))) {
      return part;
    }
    stiffen_short_waves(system_);
    summary_.stiffened_from = time_;
    resume(start);
    return stepper_.advance(time_, end - time_, motion_);
  }

  [[noreturn]] void fail(const TimeStepper::StepResult& step, const Checkpoint& start, double end) {
    const std::string place = system_.contact ? system_.contact->closest_place() : "";
    if (time_ != real(shown_) * run_.step) {  // the last good state, also within a step or between those asked for
      resume(start);
      hand_over(state_now());
    }
    const NewtonResult& result = step.newton;
    const std::vector<double> wanted = load_factors(model_, false, end);
    std::vector<double> carried =
        time_ > 0 ? load_factors(model_, false, time_) : std::vector<double>(wanted.size(), 0.0);
    for (std::size_t l = 0; l < carried.size(); ++l) {
      carried[l] += step.reached * (wanted[l] - carried[l]);
    }
    if (!step.newton.apart) {
      throw RequirementError(fmt::format(
          "no state found in the step from {:.6g} s to {:.6g} s that bodies can reach without passing through each "
          "other{}: take a smaller step; the last good state is at {:.6g} s",
          time_, end, place, time_));
    }
    if (step.reached < 1 && carried != wanted) {
      throw RequirementError(fmt::format(
          "no equilibrium in the step from {:.6g} s to {:.6g} s: the limit load is reached at "
          "{:.3g} of its change of load ({}); beyond it {}{}; the last good state is at {:.6g} s{}",
          time_, end, step.reached, describe_loads(model_, carried, wanted),
          step.ran_away ? "the shell yields without bound" : "no state was found that the shell could rest in", place,
          time_, remedy_of_failure(model_, carried)));
    }
    throw RequirementError(
        fmt::format("the step from {:.6g} s to {:.6g} s {} ({}after {} "
                    "iterations){}: take a smaller step, a ramp or damping; the last good state is at {:.6g} s",
                    time_, end,
                    !result.valid                        ? "made elements collapse or fold"
                    : result.converged && !result.stable ? "leads to a state that is not stable"
                                                         : "did not converge",
                    result.valid ? fmt::format("relative residual {:.3g} ", result.residual) : "", result.iterations,
                    place, time_));
  }

  [[nodiscard]] State state_now() const {
    State state = make_state(system_, motion_.configuration, time_);
    state.converged = true;
    state.load_factor = first_load_factor(model_, state.time);
    state.kinetic_energy = stepper_.kinetic_energy(motion_.rates.velocity);
    state.velocity.resize(system_.node_count());
    state.angular_velocity.resize(system_.node_count());
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      state.velocity[i] = motion_.rates.velocity.segment<3>(first_freedom(i));
      state.angular_velocity[i] = motion_.rates.velocity.segment<3>(first_freedom(i) + 3);
    }
    return state;
  }

  const DynamicRun& run_;
  TimeStepper stepper_;
  const TableTurns turns_;
  Motion motion_;
  VectorX last_change_;  ///< of the step before, where look_for_swing() looks
  const bool soft_waves_ = has_soft_waves(system_);
  double time_ = 0;
};

}  // namespace

Summary run_dynamic(ShellSystem& system, const RunSettings& settings, const DynamicRun& run,
                    const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  release_rigid_motion_supports(system);
  return TimeLoop(system, settings, run, on_state).follow(progress, resumption);
}

}  // namespace tunica
