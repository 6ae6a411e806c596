#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"
#include "tunica/mechanics/runs/solve.hpp"

/// The kinds of run behind solve(): each takes a system and hands its states over.
namespace tunica {

/// With one linearisation per step nothing brings the residual down: above this part of the forces the step means
/// nothing.
inline constexpr double largest_unchecked_residual = 0.5;

using StateCallback = std::function<void(const State&)>;

/// check_model(), and what it needs made ready anyway. Errors: InputError.
ShellSystem make_checked_system(const Model& model, const RunSettings& settings);

/// Everything of a state that follows from the configuration.
State make_state(const ShellSystem& system, const Configuration& configuration, double time);

/// What the loads amount to, for a message: the pressures reached of those wanted with the thinnest wall they act on,
/// or the factor of the loads where there is none.
std::string describe_loads(const Model& model, const std::vector<double>& reached, const std::vector<double>& wanted);

/// For the message of a run that found no equilibrium: where that is at a small part of a pressure, that Young's
/// modulus may have another unit; where ends slide and nothing beds the wall, that a bed helps; else nothing.
/// @param reached  factors of the loads
std::string remedy_of_failure(const Model& model, const std::vector<double>& reached);

/// Tells a state the error of its linear solve.
void set_algebraic_error(const std::optional<AlgebraicError>& error, State& state);

/// Errors: InputError: a checkpoint has not as many numbers of what is named.
void require_count(std::size_t found, std::size_t count, std::string_view name);

/// Collects what solve() returns from the steps of a run; a state without displacements (not handed over, and not the
/// last) adds its counts only.
void record_step(const State& state, double seconds, Summary& summary);

/// Prescribed displacements at a load factor (6 per node).
VectorX prescribed_positions(const ShellSystem& system, double factor);

/// What keeps a configuration from static equilibrium at a load factor.
Balance static_balance(const ShellSystem& system, const Configuration& configuration, double factor, Forces& forces,
                       BlockMatrix* tangent, const std::vector<ElementState>& predicted = {});

/// Load steps, each with Newton's method until it converges. Errors: RequirementError.
Summary run_static(ShellSystem& system, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption);

/// One linear solve about the reference configuration. Errors: RequirementError.
Summary run_linear(ShellSystem& system, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption);

/// The path of equilibria by arc length: a tangent predictor and Newton's method in the plane across it, on the factor
/// of the tangent stiffness (follower pressure included) bordered by the constraint. Steps are cut and stretched so
/// that straight lines between the states follow the path. Limit points are where the load factor turns (from the cubic
/// through the states around); other changes of the number of negative pivots are branches, which are not followed.
/// Source: Riks 1979, "An incremental approach to the solution of snapping and buckling problems"; Keller 1977.
/// Errors: RequirementError: the path does not go on, or ends before what it should reach.
/// Cost: three to six factorisations per step.
Summary run_arc_length(ShellSystem& system, const RunSettings& settings, const ArcLengthRun& run,
                       const StateCallback& on_state, const Progress& progress);

/// Natural frequencies and modes. Masses are lumped as in a dynamic run; bodies held by their rigid motions are free,
/// and free rigid motions are left out. Errors: RequirementError: no stable state under the loads; the eigenvalues do
/// not converge.
Summary run_frequencies(ShellSystem& system, const RunSettings& settings, const FrequencyRun& run,
                        const StateCallback& on_state, const Progress& progress);

/// The smallest positive factors of the loads at which K0 + factor K1 is singular: K0 the linear stiffness, K1 the
/// derivative of the whole tangent (stress, change of shape, follower pressure) along the linear solution. Its
/// unsymmetric part (applied moments, pressure at free edges) is left out.
/// Errors: RequirementError: the loads buckle nothing before they strain it by 20 %; the eigenvalues do not converge.
Summary run_buckling(ShellSystem& system, const RunSettings& settings, const BucklingRun& run,
                     const StateCallback& on_state, const Progress& progress);

/// Time steps. Errors: RequirementError.
Summary run_dynamic(ShellSystem& system, const RunSettings& settings, const DynamicRun& run,
                    const StateCallback& on_state, const Progress& progress, const Resumption& resumption);

}  // namespace tunica
