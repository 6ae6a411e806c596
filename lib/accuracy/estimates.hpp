#pragma once

#include "tunica/accuracy/accuracy.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <functional>
#include <map>
#include <span>
#include <string>

/// How far the answers of a run may be off by its mesh.
namespace tunica {

/// The answers of a state by the keys that a report gives them, in the units of those keys: stresses, tension and
/// strain of the wall, the largest displacement, energy, volume. Always the same keys, but for a volume that is not
/// enclosed.
Answers answers_of(const State& state, const ElementFields& fields);

/// The relative error of the last of three or more values of a hierarchy in which every shell is split in four: with
/// D_k the change from k - 1 to k, max(|D_k|, |D_(k-1)| / 4), the two-grid convergence index and what second order
/// leaves of the step before; two levels may agree by chance. Where changes fall more slowly than by two, all that are
/// to come add up to more than the last. Source: Roache, "Perspective: a method for uniform reporting of grid
/// refinement studies", 1994. Of two values: the change. Errors: InputError: fewer than two.
double error_of_last(std::span<const double> values);

/// Of every answer of the last of some levels. @param besides  error of other origin, relative, by the answer's key;
/// `doubtful`: by which no estimate is credible
Estimates estimates_of(const std::vector<Answers>& levels, const std::function<double(const std::string&)>& besides,
                       bool doubtful);

/// By how much answers change from these to others of the same keys, relative to the others.
std::map<std::string, double> changes(const Answers& from, const Answers& to);
/// Which of them changes most.
const std::pair<const std::string, double>& largest(const std::map<std::string, double>& changes);

/// The error of a static run, relative to its answers, by one solution on shells split in four and fitted to the
/// targets: a change D leaves 4/3 D
/// by second order, 2 D, by the first, of stress and strain at the faces; of a 99th percentile it is the
/// largest change of what 2, 1 and .5 % of the area pass, for one alone may be small by chance. Credible below a
/// quarter, but for the largest stress and strain. None, and `reason`, where the finer mesh has no answer.
/// @param fields  of `state`
/// @param targets  one for each body; null: splits lie on the body's own patches
/// @param model_of  as in solve_within()
/// Errors: InputError as there. Cost: a refit and a solution of four times the shells, begun from the state at hand.
struct RefinedAnswers {
  Estimates estimates;
  std::string reason;
};
RefinedAnswers estimate_by_refinement(const Model& model, const State& state, const ElementFields& fields,
                                      const std::vector<const Target*>& targets, const RunSettings& settings,
                                      const ModelOf& model_of);

}  // namespace tunica
