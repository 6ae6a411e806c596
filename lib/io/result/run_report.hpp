#pragma once

#include "tunica/accuracy/accuracy.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/unloaded.hpp"

/// What a report says of a simulation, key by key as the contract names them (mm, MPa, mJ, s).
namespace tunica {

/// All keys, undefined until the run fills them; `contacts`, `rigid` and `balance` only where the model has them.
void prepare_result(Json& result, const Model& model);

/// What is known of a run that may still fail. The records of probes, contacts and rigid bodies grow, the latter two
/// not by the reference state.
void report_state(Json& result, const Model& model, const State& state, const ElementFields& fields, bool dynamic);

/// Of a run that has ended.
/// @param duration  s, that was simulated
void report_summary(Json& result, const Summary& summary, bool converged, std::optional<double> duration);

/// Of a run for modes, after report_summary(): they have shapes, but no size, so nothing of a deformed state is
/// claimed.
void report_modes(Json& result, const Summary& summary);

/// What a run for an accuracy claims, and how it got there.
Json accuracy_report(const Accuracy& accuracy);

/// The shape without the pressure under which the organ was imaged.
Json unloaded_report(const Unloaded& unloaded);

/// Where it is hardly that of a living wall.
std::vector<Warning> unloaded_warnings(const Unloaded& unloaded);

/// How far the answers may be off, by their keys in the report.
Json estimates_report(const Estimates& estimates);

/// What a user should know of those that no accuracy was asked for: the answers that are off by more than is notable.
std::vector<Warning> estimate_warnings(const Estimates& estimates);

/// What the wall bears where the image shows it.
Json prestress_report(const Model& model, double residual);

/// A level on a line.
std::string level_note(const AccuracyLevel& level, const AccuracyRequest& request);

/// What a run came to whose accuracy was not reached, and why: "accuracy not reached: stress 159 kPa with 3200
/// shells, estimated error 12 %, 5 % asked: …".
std::string missed_accuracy(const Accuracy& accuracy);

/// Claim and choices as lines for a terminal.
std::vector<std::string> accuracy_notes(const Accuracy& accuracy);

/// A line on the modes found.
std::string modes_note(const Summary& summary, std::size_t asked);

/// The largest displacement of a motion.
struct Peak {
  double displacement = 0;  ///< mm
  double time = 0;          ///< s
};

/// The answer, and what tells how far it may be trusted.
struct LastState {
  Wall wall;
  double largest_displacement = 0;  ///< mm
  double displacement_p99 = 0;      ///< mm, as in ElementFields
  std::size_t unresolved = 0;       ///< count_unresolved()
  std::optional<Peak> peak{};       ///< of a motion, so far
};

/// The key `peak` of a motion's report.
Json peak_report(const Peak& peak);

/// What a user should know of a run that has ended well.
std::vector<Warning> run_warnings(const RunSettings& run, const Summary& summary, const LastState& last);

/// Contacts in which nothing ever touches; a note of those in which something does within steps only.
/// @param result  of a run that has ended
std::vector<Warning> contact_warnings(const Model& model, const Summary& summary, const Json& result);

}  // namespace tunica
