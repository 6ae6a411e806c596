#pragma once

#include "tunica/accuracy/accuracy.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/unloaded.hpp"

#include <memory>
#include <optional>
#include <string>
#include <vector>

/// What a report says of a simulation, key by key as the contract names them (mm, MPa, mJ, s).
namespace tunica {

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
  double solid_strain_p99 = 0;      ///< as in ElementFields
  /// As in ElementFields, of the state with the most strain energy.
  std::vector<double> solid_error, layer_error, roughness;
  double most_strain_energy = 0;  ///< mJ, of that state
  std::size_t unresolved = 0;     ///< count_unresolved()
  std::optional<Peak> peak{};     ///< of a motion, so far
};

/// Something of a model from state to state.
template <typename Value>
struct Track {
  std::string name;
  std::vector<Value> values;
};

/// Shells that leave a run for an accuracy.
struct ShellCertificate {
  double angle = 0;                  ///< degrees, smallest
  std::optional<Interval> distance;  ///< mm, two-sided, to the target where there is one
  double diagonal = 0;               ///< mm, of the target
};

/// What is known of a run, from its start on and also where it fails.
struct RunRecord {
  struct When {
    double time = 0;  ///< s, of a motion
    double load_factor = 0;
  };
  struct ProbeValue {
    Vec3 displacement, rotation;  ///< mm; radians
  };

  bool begun = false;
  std::size_t shells = 0, tetrahedra = 0, nodes = 0;
  bool is_motion = false, is_modes = false;
  std::vector<When> when;                 ///< of all states
  std::vector<Track<ProbeValue>> probes;  ///< in these
  std::vector<When> moved;                ///< of all but the reference
  std::vector<Track<ContactState>> contacts;
  std::vector<Track<RigidState>> rigids;
  std::optional<double> force_imbalance, moment_imbalance;  ///< the largest, relative
  std::optional<LastState> last;
  double node_displacement = 0;  ///< mm, the largest
  std::optional<double> volume_before, volume_after;
  double strain_energy = 0, residual = 0;  ///< of the last state
  std::optional<Summary> summary;          ///< of a run that has ended
  bool converged = false;
  std::optional<double> duration;               ///< s, that was simulated
  std::shared_ptr<const Accuracy> accuracy;     ///< what is claimed
  std::optional<ShellCertificate> certificate;  ///< of the shells it ended with
  std::optional<double> imaging_pressure;       ///< MPa, of a prestressed wall, where it is one
  std::optional<double> prestress_residual;     ///< of that wall
  std::optional<bool> rests_as_imaged;          ///< System::rests_as_imaged()
  std::shared_ptr<const Unloaded> unloaded;     ///< the shape without the pressure of the image
  Estimates estimates;                          ///< how far the answers may be off

  RunRecord() = default;
  explicit RunRecord(const Model& model, const RunSettings& run);

  /// Takes up a state. The records of contacts and rigid bodies do not have the reference.
  void take(const Model& model, const State& state, const ElementFields& fields);
};

/// All keys of a report, undefined where the run has not got there; `contacts`, `rigid` and `balance` only where the
/// model has them, `accuracy`, `prestress`, `unloaded` where the run has. Of modes, which have shapes but no size,
/// nothing of a deformed state is claimed.
Json run_report(const RunRecord& record);

/// What a run for an accuracy claims, and how it got there. @param times  with what levels took and would take
Json accuracy_report(const Accuracy& accuracy, bool times = true);

/// Where a wall cannot rest in the shape of its image.
std::vector<Warning> prestress_warnings(const RunRecord& record);

/// Where it is hardly that of a living wall.
std::vector<Warning> unloaded_warnings(const Unloaded& unloaded);

/// The answers that are off by more than is notable, but for the one that an accuracy was `asked` of.
std::vector<Warning> estimate_warnings(const Estimates& estimates, const std::optional<Quantity>& asked);

/// A level on a line.
std::string level_note(const AccuracyLevel& level, const AccuracyRequest& request);

/// What a run came to whose accuracy was not reached, and why: "accuracy not reached: stress 159 kPa with 3200
/// shells, estimated error 12 %, 5 % asked: …".
std::string missed_accuracy(const Accuracy& accuracy);

/// Claim and choices as lines for a terminal.
std::vector<std::string> accuracy_notes(const Accuracy& accuracy);

/// A line on the modes found.
std::string modes_note(const Summary& summary, std::size_t asked);

/// That the body left its path, if it did.
std::optional<Warning> snap_warning(const Summary& summary);

/// What a user should know of a run that has ended well.
std::vector<Warning> run_warnings(const RunSettings& run, const Summary& summary, const LastState& last);

/// Contacts in which nothing ever touches; a note of those in which something does within steps only.
/// @param record  of a run that has ended
std::vector<Warning> contact_warnings(const RunRecord& record);

}  // namespace tunica
