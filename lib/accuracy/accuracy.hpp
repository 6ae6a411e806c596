// accuracy: the mesh and the model that an accuracy takes.
#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/distance/target.hpp"

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// lib/accuracy: the cheapest model whose error in one quantity is credibly below what is asked.
namespace tunica {

enum class Quantity {
  displacement,  ///< the largest, of the curved surface
  energy,        ///< strain energy
  volume,        ///< change of the enclosed volume
  stress,        ///< von Mises stress that 1 % of the area passes (Wall::stress_p99)
};

/// "displacement" and so on, as flags and reports name them; mm, mJ, mm^3 or MPa.
std::string_view name_of(Quantity quantity);
std::string_view unit_of(Quantity quantity);

struct AccuracyRequest {
  double within = 0;  ///< of the quantity, relative
  Quantity of = Quantity::displacement;
  std::size_t max_shells = 50'000;
};

/// One mesh of the hierarchy and what it says.
struct AccuracyLevel {
  std::size_t shells = 0;
  double value = 0;                     ///< mm, mJ, mm^3 or MPa
  double seconds = 0;                   ///< of splits, fit and solve
  std::optional<double> mean_distance;  ///< mm, to the target
  std::size_t newton_iterations = 0;
};

/// A decision, the error it leaves (relative), and what was not chosen.
struct AccuracyChoice {
  std::string part, chosen;
  std::optional<double> error;  ///< none: not known
  std::string instead, would_cost;
};

/// What a run for an accuracy ended with.
struct Accuracy {
  AccuracyRequest request;
  std::optional<double> estimate;    ///< of the error, relative; none with fewer than three levels
  std::vector<std::string> reasons;  ///< why that is not credible, or not enough; empty: accepted
  std::vector<AccuracyLevel> levels;
  std::vector<AccuracyChoice> choices;
  std::vector<std::string> not_included;  ///< other errors of the answer
  RunSettings settings;  ///< of the last level
  Model model;           ///< its model
  Summary summary;
  std::vector<State> states;  ///< its reference and its answer
};

/// Resolves everything but the mesh: supports and loads on a body whose shells were split.
using ModelOf = std::function<Model(ShellBody)>;

/// Solves on a body's mesh, splits every shell in four and refits them to the target, solves again from the state at
/// hand, until the estimate is below the request and nothing makes it doubtful. With D_k the change of the quantity
/// from level k - 1 to k the error of level k is taken as max(|D_k|, |D_(k-1)| / 4): the two-grid convergence index,
/// and what second order leaves of the step before; two levels may agree by chance. The linear model is taken from the
/// third level on where it is off by less than a quarter of the request on the second; its error is added, as is that
/// of the solver. Newton's method ends where its residual is a hundredth of the request.
/// Doubtful are: a small change beside a large one of the displacement field; for stresses a bending layer at supports
/// and rims, sqrt(R t) / 1.24 wide, with less than two edges; short waves that had to be made stiff; snaps.
/// @param body    the coarsest level; the only one of the model
/// @param target  none: splits lie on the body's own patches, and the error of its geometry is not seen
/// @param settings  a static run in one load step
/// Errors: InputError: no volume is enclosed, the quantity is zero; RequirementError: no level could be solved.
/// Source: Roache, "Perspective: a method for uniform reporting of grid refinement studies", 1994 (convergence index
/// with a factor of 3 for two grids). Cost: the last level's, times about 1.4. Limits: no difference of levels sees
/// what no level resolves, beyond the doubts above.
Accuracy solve_within(ShellBody body, const Target* target, const AccuracyRequest& request, const RunSettings& settings,
                      const ModelOf& model_of, const std::function<void(const AccuracyLevel&)>& on_level = {});

}  // namespace tunica
