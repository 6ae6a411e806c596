#pragma once

#include "tunica/accuracy/accuracy.hpp"

namespace tunica {

/// What one mesh says by one model.
struct Answer {
  System system;  ///< of the model and the settings
  Summary summary;
  std::vector<State> states;  ///< as solve() hands them over
  State at;                   ///< where the quantity is largest: the last state of a static run
  Answers all{};              ///< there
  double value = 0;
  double seconds = 0;
};

/// Errors: as solve(); InputError: no volume is enclosed.
Answer answer_of(Model model, const RunSettings& settings, const AccuracyRequest& request,
                 const std::optional<Checkpoint>& near = {});

/// The model whose loads and prescribed displacements stay as a motion's end has them, for a static run. None where one
/// of them is larger on the way.
std::optional<Model> at_its_end(const Model& model, double duration);

/// How a motion is followed; a static run: by the state of rest under the final loads.
struct MotionChoice {
  RunSettings settings;
  double error = 0;                      ///< relative, that this leaves
  std::map<std::string, double> errors;  ///< of all answers, by their keys
  std::vector<AccuracyChoice> choices;
};

/// What a cheaper model is off by: the answer asked for, and the one that changes most, by its key.
std::string errors_text(double asked, const std::string& name, double most);

/// By runs on one mesh: the step is halved until max(|D_k|, |D_(k-1)| / 2^order) is below `share`; then the longest one
/// serves whose answer differs from the shortest one's by no more, or rest, if no answer differs by more than `within`.
/// @param solve_for_answer  solves with these settings, an answer that is not zero; a static run on at_its_end()
/// @param may_rest  at_its_end() exists
MotionChoice choose_motion(const RunSettings& settings, double share, double within, bool may_rest,
                           const std::function<Answer(const RunSettings&)>& solve_for_answer);

}  // namespace tunica
