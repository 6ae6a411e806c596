// accuracy: the mesh and the model that an accuracy takes.
#pragma once

#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/distance/target.hpp"

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// lib/accuracy: the cheapest model whose error in one quantity is, by an estimate that holds (see Accuracy::reasons),
/// below what is asked.
namespace tunica {

/// Of the state of rest; of a motion the largest that it comes to.
enum class Quantity {
  displacement,  ///< the largest, of the curved surfaces
  energy,        ///< strain energy
  volume,        ///< change of the enclosed volume
  stress,        ///< von Mises stress of the faces that 1 % of the area passes (Wall::stress_p99)
  membrane,      ///< the same of the mean over the wall (Wall::membrane_p99)
  tension,       ///< of the largest principal membrane force (Wall::tension_p99)
  probe,         ///< displacement of a node along an axis
};
template <>
inline constexpr auto names_of<Quantity> = std::to_array<Named<Quantity>>({{"displacement", Quantity::displacement},
                                                                           {"energy", Quantity::energy},
                                                                           {"volume", Quantity::volume},
                                                                           {"stress", Quantity::stress},
                                                                           {"membrane", Quantity::membrane},
                                                                           {"tension", Quantity::tension},
                                                                           {"probe", Quantity::probe}});

/// Whether it is one of what the wall bears.
inline bool is_stress(Quantity quantity) {
  return quantity == Quantity::stress || quantity == Quantity::membrane || quantity == Quantity::tension;
}

/// mm, mJ, mm^3, MPa or N/mm.
std::string_view unit_of(Quantity quantity);

struct AccuracyRequest {
  double within = 0;  ///< of the quantity, relative
  Quantity of = Quantity::displacement;
  std::size_t max_shells = 50'000;
  std::string probe{};            ///< the name of a probe of the model
  int axis = 0;                   ///< of its displacement
  std::optional<double> voxel{};  ///< mm, longest edge, of the image that the targets come from
  /// s, of all levels together: no level is begun that would pass it. The accuracy then is an aim: where finer shells
  /// have no answer, the run ends with the level before, and the reason.
  std::optional<double> max_seconds{};
};

/// Answers of a run by the keys of its report (estimates.hpp).
using Answers = std::vector<std::pair<std::string, double>>;

/// How far an answer may be off by the mesh.
struct Estimate {
  double error = 0;  ///< relative
  bool credible = false;
  std::string from;  ///< the solutions it was taken from
};
using Estimates = std::map<std::string, Estimate>;

/// One mesh of the hierarchy and what it says.
struct AccuracyLevel {
  std::size_t shells = 0;
  double value = 0;                     ///< mm, mJ, mm^3, MPa or N/mm
  double seconds = 0;                   ///< of splits, fit and solve
  std::optional<double> mean_distance;  ///< mm, to the targets, the largest of all bodies
  std::size_t newton_iterations = 0;
  std::string failure{};  ///< of the coarsest, which on_level gets: why it has no value
  Answers answers{};      ///< all that the level says
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
  Estimates estimates;  ///< of all answers
  std::vector<AccuracyChoice> choices;
  std::vector<std::string> not_included;  ///< other errors of the answer
  /// mm, by which the surface itself is uncertain, where the image's voxels are known.
  std::optional<double> surface_error;
  RunSettings settings;          ///< of the last level
  std::optional<System> system;  ///< its model, as it was solved
  Summary summary;
  std::vector<State> states;  ///< as solve() hands them over
};

/// Resolves everything but the meshes: supports, loads and probes on bodies whose shells were split.
using ModelOf = std::function<Model(std::vector<ShellBody>)>;

/// Solves on the bodies' meshes, splits every shell in four and refits them to the targets, solves again from the state
/// at hand, until the estimate is below the request and nothing makes it doubtful. With D_k the change of the quantity
/// from level k - 1 to k the error of level k is taken as max(|D_k|, |D_(k-1)| / 4): the two-grid convergence index,
/// and what second order leaves of the step before; two levels may agree by chance.
///
/// A cheaper model is taken where a coarse level shows that it is off by less than a quarter of the request, and its
/// error is added: linear instead of nonlinear statics (second level; no other answer may be off by more than the
/// request); rest under the final loads instead of a motion, else the longest step, of those that halve the one given
/// (first level). The solver's error is added too; Newton's
/// method ends with an increment of a tenth of the request.
///
/// Doubtful are: a small change beside a large one of the displacement field; for stresses, where all of the wall is
/// near, a bending layer at supports, rims, point and edge loads and thickness jumps, sqrt(R t) / 1.24 wide, with less
/// than two edges; shells that bend by more than 30 degrees; short waves that had to be made stiff. Every state
/// is one of a positive definite tangent: others are not equilibria that solve() accepts.
/// @param bodies   the coarsest level; all of the model
/// @param targets  one for each body; null: splits lie on the body's own patches, and its geometry's error is not seen
/// @param settings  a static run in one load step, or a dynamic run without error control
/// Errors: InputError: a body as require_valid(), not a target for each, another kind of run, an accuracy or voxel that
/// is not finite and above zero, no volume is enclosed, the quantity is zero; RequirementError: a level has no answer,
/// unless the coarsest alone. Source: Roache, "Perspective: a method for uniform reporting of grid refinement studies",
/// 1994 (convergence index with a factor of 3 for two grids). Cost: the last level's, times about 1.4. Limits: no
/// difference of levels sees what no level resolves, beyond the doubts above. All states of a motion are kept in
/// memory.
Accuracy solve_within(std::vector<ShellBody> bodies, const std::vector<const Target*>& targets,
                      const AccuracyRequest& request, const RunSettings& settings, const ModelOf& model_of,
                      const std::function<void(const AccuracyLevel&)>& on_level = {});

}  // namespace tunica
