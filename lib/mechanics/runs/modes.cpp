#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/algebra/lanczos.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/linear_statics.hpp"
#include "tunica/mechanics/runs/detail/prestress.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace tunica {
namespace {

/// Largest displacement of a mode that is handed over, as part of the model's longest side.
constexpr double shown_amplitude = 0.01;
/// Work of a rigid motion below this part of the terms it is summed from is zero.
constexpr double no_work = 1e-10;
/// Likewise below this part of what the loads would do that do not turn with a body. What their balance lacks, the
/// tolerance of Newton's method, is less by orders of magnitude.
constexpr double no_work_of_loads = 1e-4;
/// Beyond this strain or rotation (rad) a linear solution means nothing, nor does a factor of it.
constexpr double largest_linear_strain = 0.2, largest_linear_rotation = 1;
/// The shift of a free body, of its lowest eigenvalue.
constexpr double near_part = 0.2;

void require_modes(std::size_t wanted, std::size_t there) {
  if (wanted > there) {
    throw InputError(fmt::format("count = {}, but the model has only {} modes: ask for fewer", wanted, there));
  }
}

/// The linear displacements and rotations (6 per node) under the loads and prescribed displacements at full value.
VectorX linear_solution(ShellSystem& system, const RunSettings& settings) {
  const Model& model = *system.model;
  return LinearSolver(system, settings).solve(load_factors(model, true, 1), prescribed_positions(system, 1)).moved;
}

/// Largest stretch of an edge in a linear solution.
double largest_strain(const ShellSystem& system, const VectorX& solution) {
  double largest = 0;
  for (const ShellElement& element : system.elements) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = element.nodes[k];
      const Index b = element.nodes[(k + 1) % 3];
      const Vec3 edge = system.reference[b] - system.reference[a];
      const Vec3 change = solution.segment<3>(first_freedom(b)) - solution.segment<3>(first_freedom(a));
      largest = std::max(largest, std::abs(edge.dot(change)) / edge.squaredNorm());
    }
  }
  return largest;
}

/// How the tangent changes per unit of the factor: by the stress of a linear solution, and by the loads that follow the
/// surface. That the solution moves the shell is left out, as in all linear buckling: to first order it is no
/// stiffness, and where a flat plate is pressed aside it would make up modes that its stretching forbids.
BlockMatrix tangent_change(ShellSystem& system, const VectorX& solution) {
  const Model& model = *system.model;
  Forces forces;
  BlockMatrix before = system.pattern;
  evaluate(system, {reference_configuration(system), std::vector<double>(model.loads.size(), 0.0)}, forces, &before);
  BlockMatrix change = stressed_tangent(system, solution, load_factors(model, true, 1));
  for (std::size_t k = 0; k < change.values.size(); ++k) {
    change.values[k] -= before.values[k];
  }
  symmetrise(change);
  return change;
}

/// The tangent at the reference, before the loads act: with what the wall bears there already.
void reference_tangent(const ShellSystem& system, BlockMatrix& tangent) {
  const Model& model = *system.model;
  if (!system.prestress_residual) {
    linear_stiffness(system, tangent);
    return;
  }
  Forces forces;
  evaluate(system, {reference_configuration(system), std::vector<double>(model.loads.size(), 0.0)}, forces, &tangent);
  symmetrise(tangent);
}

void add(BlockMatrix& matrix, double factor, const VectorX& diagonal) {
  for (std::size_t i = 0; i < matrix.node_count(); ++i) {
    auto block = matrix.block(matrix.find(narrow<Index>(i), narrow<Index>(i)));
    block.diagonal() += factor * diagonal.segment<6>(first_freedom(i));
  }
}

State reference_state(const ShellSystem& system, Summary& summary) {
  State state = make_state(system, reference_configuration(system), 0);
  state.converged = true;
  state.linear = true;
  summary.volume_before = state.volume;
  if (has_soft_waves(system)) {
    summary.stiffened_from = 0;
  }
  return state;
}

/// Hands the modes over, the first `values.size()` of `pairs`; each starts at a time after the one before.
void hand_over(const ShellSystem& system, const RunSettings& settings, const std::vector<double>& values,
               const EigenPairs& pairs, double load_factor, bool take_out_rigid, Summary& summary,
               const StateCallback& on_state) {
  const double amplitude = shown_amplitude * longest_side(system);
  double before = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    VectorX mode = pairs.vectors[k];
    if (take_out_rigid) {
      take_out_linear_rigid_motion(system, mode);
    }
    Eigen::Index top = 0;
    double largest = 0;
    for (Eigen::Index i = 0; i < mode.size(); i += 6) {
      if (mode.segment<3>(i).norm() > largest) {
        largest = mode.segment<3>(i).norm();
        top = i;
      }
    }
    Eigen::Index axis = 0;
    mode.segment<3>(top).cwiseAbs().maxCoeff(&axis);
    const double sign = mode[top + axis] < 0 ? -1 : 1;
    mode *= sign * amplitude / std::max(largest, std::numeric_limits<double>::min());
    State state;
    state.time = values[k] > before ? values[k] : std::nextafter(before, infinity);
    before = state.time;
    state.load_factor = load_factor < 0 ? values[k] : load_factor;
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      state.displacement.emplace_back(mode.segment<3>(first_freedom(i)));
      state.rotation.emplace_back(mode.segment<3>(first_freedom(i) + 3));
    }
    state.linear = true;
    state.residual = pairs.residuals[k];
    state.converged = pairs.converged;
    ++summary.steps;
    summary.residual = std::max(summary.residual, state.residual);
    if ((k + 1) % settings.every == 0 || k + 1 == values.size()) {
      on_state(state);
    }
  }
}

/// K x = -value C x for the modes nearest above a shift, by Lanczos' method on -C x = theta (K + shift C) x: with C =
/// -M vibration, with C = K1 buckling.
class ShiftedPencil {
public:
  /// `combine(matrix, shift)` adds what changes with the shift.
  using AddShift = std::function<void(BlockMatrix& matrix, double change)>;

  ShiftedPencil(const ShellSystem& system, const FreeMask& free, BlockMatrix stiffness, AddShift add_shift,
                SymmetricPencil::Product multiply_b)
      : system_(system),
        free_(free),
        matrix_(std::move(stiffness)),
        solver_(system.pattern, free),
        add_shift_(std::move(add_shift)),
        multiply_b_(std::move(multiply_b)) {}

  /// Moves the shift. @return how many values lie below it.
  DirectSolver::Factored move_to(double shift) {
    add_shift_(matrix_, shift - shift_);
    shift_ = shift;
    return solver_.factor(matrix_);
  }
  [[nodiscard]] double shift() const { return shift_; }
  [[nodiscard]] double value(double theta) const { return shift_ + 1 / theta; }

  [[nodiscard]] EigenPairs nearest(const std::vector<VectorX>& deflated, const LanczosOptions& options) const {
    const SymmetricPencil pencil{[&](const VectorX& x, VectorX& y) { solver_.solve(x, y); },
                                 [&](const VectorX& x, VectorX& y) {
                                   multiply(matrix_, x, y);
                                   mask(free_, y);
                                 },
                                 [&](const VectorX& x, VectorX& y) {
                                   multiply_b_(x, y);
                                   mask(free_, y);
                                 }};
    return largest_eigenpairs(pencil, along_world(free_), deflated, options);
  }

  /// The values found, checked by Sturm's count: none below the last that is less than `most` is missing.
  EigenPairs all_nearest(const std::vector<VectorX>& deflated, LanczosOptions options, double most) {
    // Equal bodies have equal modes, two of each where they are round.
    const std::size_t most_block = 96;
    const double near = shift_;
    for (options.block = std::clamp<std::size_t>(2 * system_.pieces.size(), 6, most_block);; options.block *= 2) {
      EigenPairs pairs = nearest(deflated, options);
      std::vector<double> values;
      for (const double theta : pairs.values) {
        if (theta > 0 && value(theta) < most) {
          values.push_back(value(theta));
        }
      }
      if (pairs.converged && values.empty()) {
        return pairs;
      }
      if (pairs.converged) {
        const double below_last = values.back() - 1e-5 * std::abs(values.back() - near);
        const std::size_t found = std::count_if(values.begin(), values.end(), [&](double v) { return v < below_last; });
        const std::size_t there = move_to(below_last).negative_pivots;
        (void)move_to(near);
        if (there <= found + deflated.size()) {
          return pairs;
        }
      }
      if (options.block >= most_block) {
        throw RequirementError(fmt::format(
            "the eigenvalues did not converge in {} solves (largest relative residual {:.3g}): ask for fewer, or mend "
            "slivers in the mesh",
            pairs.solves,
            pairs.residuals.empty() ? 1.0 : *std::max_element(pairs.residuals.begin(), pairs.residuals.end())));
      }
    }
  }

private:
  const ShellSystem& system_;
  const FreeMask& free_;
  BlockMatrix matrix_;
  DirectSolver solver_;
  AddShift add_shift_;
  SymmetricPencil::Product multiply_b_;
  double shift_ = 0;
};

/// Enough to place a shift by.
LanczosOptions rough_options() {
  LanczosOptions options;
  options.tolerance = 0.01;
  options.most_solves = 300;
  return options;
}

/// The square of a circular frequency that is low against the flexible ones, yet far above round-off: (t / L)^2 times
/// that of a membrane wave along the model.
double small_shift(const ShellSystem& system) {
  const Model& model = *system.model;
  const double size = longest_side(system);
  double shift = infinity;
  for (const ShellBody& body : model.shells) {
    const double t = *std::min_element(body.thickness.begin(), body.thickness.end());
    shift = std::min(shift, body.material.young / *body.material.density * t * t / std::pow(size, 4));
  }
  return shift;
}

/// About which a model vibrates.
struct RestingState {
  Configuration configuration;
  BlockMatrix stiffness;
  VectorX external;           ///< forces of the loads; of size zero: none act
  std::vector<Snap> snaps{};  ///< on the way there
};

/// Rigid motions against which nothing works: they have no frequency.
std::vector<VectorX> idle_rigid_modes(const ShellSystem& system, const RestingState& rest) {
  const BlockMatrix& stiffness = rest.stiffness;
  const double size = longest_side(system);
  std::vector<VectorX> idle;
  for (const Piece& piece : system.pieces) {
    const std::vector<VectorX> modes = free_rigid_modes(system, piece, rest.configuration);
    if (modes.empty()) {
      continue;
    }
    const Eigen::Index count = modes.size();
    Eigen::MatrixXd work(count, count);
    Eigen::MatrixXd terms(count, count);
    VectorX diagonal(first_freedom(system.node_count()));
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      diagonal.segment<6>(first_freedom(i)) =
          no_work * stiffness.block(stiffness.find(narrow<Index>(i), narrow<Index>(i))).diagonal().cwiseAbs();
    }
    for (const Index i : rest.external.size() > 0 ? piece.nodes : std::vector<Index>()) {
      const double force = rest.external.segment<3>(first_freedom(i)).norm();
      diagonal.segment<3>(first_freedom(i)).array() += no_work_of_loads * force / size;
    }
    VectorX product;
    for (Eigen::Index a = 0; a < count; ++a) {
      multiply(stiffness, modes[a], product);
      for (Eigen::Index b = 0; b < count; ++b) {
        work(b, a) = modes[b].dot(product);
        terms(b, a) = modes[b].dot(diagonal.cwiseProduct(modes[a]));
      }
    }
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (work + work.transpose()), terms);
    for (Eigen::Index k = 0; k < count; ++k) {
      if (std::abs(eigen.eigenvalues()[k]) < 1) {
        VectorX mode = VectorX::Zero(first_freedom(system.node_count()));
        for (Eigen::Index a = 0; a < count; ++a) {
          mode += eigen.eigenvectors()(a, k) * modes[a];
        }
        idle.push_back(mode);
      }
    }
  }
  return idle;
}

RestingState rest_of(ShellSystem& system, const RunSettings& settings, const FrequencyRun& run) {
  const Model& model = *system.model;
  RestingState rest{reference_configuration(system), system.pattern, {}};
  auto& [configuration, stiffness, external, snaps] = rest;
  if (model.loads.empty() && system.prescribed.empty()) {
    linear_stiffness(system, stiffness);
    return rest;
  }
  Forces forces;
  if (run.preload.linear) {
    evaluate(system, {configuration, load_factors(model, true, 1)}, forces, nullptr);
    external = forces.external;
    reference_tangent(system, stiffness);
    const VectorX solution = linear_solution(system, settings);
    if (solution.squaredNorm() > 0) {
      const BlockMatrix change = tangent_change(system, solution);
      for (std::size_t k = 0; k < stiffness.values.size(); ++k) {
        stiffness.values[k] += change.values[k];
      }
    }
    return rest;
  }
  // What is left out of balance works on a body that is free to turn: its rotations are to be eigenvectors to more
  // digits than the modes.
  RunSettings exact = settings;
  if (std::ranges::any_of(system.pieces, &Piece::balanced)) {
    exact.converge = std::min(settings.converge, 1e-12);
  }
  State last;
  snaps = run_static(system, exact, run.preload, [&](const State& state) { last = state; }, {}, {}).snaps;
  configuration.displacement = last.displacement;
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    configuration.rotation[i] = exponential(last.rotation[i]);
  }
  evaluate(system, {configuration, load_factors(model, true, last.load_factor)}, forces, &stiffness);
  external = forces.external;
  symmetrise(stiffness);
  return rest;
}

}  // namespace

Summary run_frequencies(ShellSystem& system, const RunSettings& settings, const FrequencyRun& run,
                        const StateCallback& on_state, const Progress& progress) {
  const Model& model = *system.model;
  const auto start = Clock::now();
  Summary summary;
  on_state(reference_state(system, summary));
  RestingState rest = rest_of(system, settings, run);
  summary.snaps = rest.snaps;
  advance(progress, 0.3);
  release_rigid_motion_supports(system);
  const FreeMask free = free_freedoms(system);
  summary.dof = narrow<std::size_t>(std::count(free.begin(), free.end(), true));

  const std::vector<VectorX> rigid = idle_rigid_modes(system, rest);
  require_modes(run.count, summary.dof - rigid.size());
  const VectorX mass = lumped_masses(system);
  // Where a body is free the first shift is only known to be small against the lowest value; one that is near it keeps
  // the rigid motions, which the inverse enlarges, from drowning the modes in round-off.
  ShiftedPencil pencil(
      system, free, std::move(rest.stiffness), [&](BlockMatrix& matrix, double change) { add(matrix, -change, mass); },
      [&](const VectorX& x, VectorX& y) { y = mass.cwiseProduct(x); });
  const auto move_to = [&](double shift) {
    const DirectSolver::Factored factored = pencil.move_to(shift);
    if (!factored.regular || factored.negative_pivots > 0) {
      throw RequirementError(
          "the stiffness under the loads is not positive: the state is unstable and has no frequencies; lower the "
          "loads");
    }
  };
  move_to(rigid.empty() ? 0 : -small_shift(system));
  advance(progress, 0.4);
  LanczosOptions options;
  options.count = run.count;
  if (!rigid.empty()) {
    LanczosOptions rough = rough_options();
    rough.deflated_value = -1 / pencil.shift();
    const EigenPairs first = pencil.nearest(rigid, rough);
    move_to(std::min(pencil.shift(), -near_part * pencil.value(first.values.front())));
    options.deflated_value = -1 / pencil.shift();
  }
  const EigenPairs pairs = pencil.all_nearest(rigid, options, infinity);
  for (const double theta : pairs.values) {
    summary.frequencies.push_back(std::sqrt(std::max(0.0, pencil.value(theta))) / (2 * std::numbers::pi));
  }
  const bool loaded = !model.loads.empty() || !system.prescribed.empty();
  hand_over(system, settings, summary.frequencies, pairs, loaded ? 1 : 0, false, summary, on_state);
  summary.converged = true;
  summary.seconds_per_step.push_back(seconds_since(start));
  advance(progress, 1.0);
  return summary;
}

Summary run_buckling(ShellSystem& system, const RunSettings& settings, const BucklingRun& run,
                     const StateCallback& on_state, const Progress& progress) {
  const auto start = Clock::now();
  Summary summary;
  on_state(reference_state(system, summary));
  const FreeMask free = free_freedoms(system);
  summary.dof = narrow<std::size_t>(std::count(free.begin(), free.end(), true));
  require_modes(run.count, summary.dof);

  const VectorX solution = linear_solution(system, settings);
  const double strain = largest_strain(system, solution);
  const double rotation = largest_rotation(system, solution);
  const double largest_factor = std::min(strain > 0 ? largest_linear_strain / strain : infinity,
                                         rotation > 0 ? largest_linear_rotation / rotation : infinity);
  if (!(std::max(strain, rotation) > 0)) {
    throw InputError("the loads do not deform anything: buckling needs a load that does");
  }
  const BlockMatrix change = tangent_change(system, solution);
  advance(progress, 0.3);
  BlockMatrix stiffness = system.pattern;
  reference_tangent(system, stiffness);
  ShiftedPencil pencil(
      system, free, std::move(stiffness),
      [&](BlockMatrix& matrix, double by) {
        for (std::size_t k = 0; k < matrix.values.size(); ++k) {
          matrix.values[k] += by * change.values[k];
        }
      },
      [&](const VectorX& x, VectorX& y) {
        multiply(change, x, y);
        y = -y;
      });
  const auto positive_at = [&](double shift) {
    const DirectSolver::Factored factored = pencil.move_to(shift);
    return factored.regular && factored.negative_pivots == 0;
  };
  if (!positive_at(0)) {
    throw RequirementError(
        "the linear stiffness is not positive definite: the elements are too distorted for double "
        "precision");
  }
  advance(progress, 0.4);
  // A shift just below the first factor: without it the factors of a thin shell, which are many and close to each
  // other, are hard to tell apart.
  const EigenPairs first = pencil.nearest({}, rough_options());
  const double lowest = first.values.empty() || !(first.values.front() > 0) ? 0 : pencil.value(first.values.front());
  if (lowest > 0 && lowest < largest_factor) {
    for (const double part : {0.98, 0.9, 0.5, 0.0}) {
      if (positive_at(part * lowest)) {
        break;
      }
    }
  }
  LanczosOptions options;
  options.count = run.count;
  const EigenPairs pairs = pencil.all_nearest({}, options, largest_factor);
  for (const double theta : pairs.values) {
    if (theta > no_work * pairs.largest_magnitude && pencil.value(theta) < largest_factor) {
      summary.buckling_factors.push_back(pencil.value(theta));
    }
  }
  if (summary.buckling_factors.empty()) {
    throw RequirementError(fmt::format(
        "the loads buckle nothing: no factor up to {:.4g}, where they strain the shell by {:.0f} % or turn it "
        "by a radian",
        largest_factor, 100 * largest_linear_strain));
  }
  hand_over(system, settings, summary.buckling_factors, pairs, -1, true, summary, on_state);
  summary.converged = true;
  summary.seconds_per_step.push_back(seconds_since(start));
  advance(progress, 1.0);
  return summary;
}

}  // namespace tunica
