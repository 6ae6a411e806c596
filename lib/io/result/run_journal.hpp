#pragma once

#include "tunica/mechanics/runs/solve.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace tunica {

/// What makes a run the same run: only that one goes on.
struct RunIdentity {
  std::string version;  ///< of tunica
  std::string scene;    ///< resolved, SI
  std::string command;
  std::vector<std::pair<std::string, std::string>> inputs;   ///< path, sha256: all that was read
  std::vector<std::pair<std::string, std::string>> meshes;   ///< path, sha256: of each mesh file
  std::vector<std::pair<std::string, std::string>> options;  ///< flags beside the scene that shape the outputs
};

/// What keeps `now` from being the run `before`, in a few words; empty when nothing does. Meshes are compared by their
/// bytes, not by where they are.
std::string difference(const RunIdentity& before, const RunIdentity& now);

/// What a run leaves beside its NAME.part so that it can go on after it was killed at any moment. Two files, because
/// HDF5 promises nothing of a file that was open for writing when its process died:
/// * NAME.part.states: the identity, then every state handed over, each record with its length and a checksum; it only
///   grows, so a kill can cost no more than the record being written.
/// * NAME.part.checkpoint: the last checkpoint and how much of NAME.part.states belongs to it; written whole, flushed
///   to the disk and renamed, so it is the last one or the one before.
/// A resumed run writes NAME.part anew from the states, up to the checkpoint, and goes on from there.
/// Whoever holds the PartLock of NAME.part, as a journal does, writes all three.
/// Cost: 96 bytes per node and state, 88 per contact; checkpoints are spaced so that they take at most a twentieth of
/// the time.
class RunJournal {
public:
  /// Starts the journal of a new run; what an earlier run left under this name is removed, NAME.part emptied.
  /// Errors: OutputError, also when another process is at work on it.
  static RunJournal create(const std::filesystem::path& part, RunIdentity identity);

  /// The journal of a run that was interrupted. Errors: InputError when it is missing, damaged or of another version;
  /// OutputError when another process is at work on it.
  static RunJournal open(const std::filesystem::path& part);

  /// Whether an interrupted run under this name has a checkpoint, from which open() would go on if it is whole. Looks
  /// at how the files begin, and locks nothing.
  static bool can_go_on(const std::filesystem::path& part);

  RunJournal(RunJournal&&) noexcept;
  RunJournal& operator=(RunJournal&&) = delete;
  RunJournal(const RunJournal&) = delete;
  RunJournal& operator=(const RunJournal&) = delete;
  /// Removes the files of a new run that leaves no NAME.part, or an empty one: it has no result to go on from, as when
  /// the disk is full.
  ~RunJournal();

  [[nodiscard]] const RunIdentity& identity() const;

  /// Hands over the states up to the checkpoint, and forgets the later ones. @return the checkpoint; none when the run
  /// was stopped before its first one: then it has to begin again, and no state is handed over.
  /// Errors: InputError when a record is damaged or is not of this model.
  std::optional<Checkpoint> replay(const Model& model, const std::function<void(const State&)>& on_state);

  /// Errors: OutputError.
  void append(const State& state);
  /// Saves a checkpoint when it is time for one. Errors: OutputError.
  void offer(const std::function<Checkpoint()>& make);

  /// The run is done, or has nothing to go on with.
  void remove();

private:
  struct Implementation;
  explicit RunJournal(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tunica
