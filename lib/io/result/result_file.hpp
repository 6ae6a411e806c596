#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace tunica {

struct ResultOptions {
  /// Of a static run /VTKHDF holds one loaded state, the last one appended (Version {1,0}), which every ParaView from
  /// 5.10 on shows deformed; of all others every state, with times (Version {2,0}, Steps).
  RunSettings run;
  bool is_unloaded = false;  ///< the reference is not what was imaged, but the shape without the pressure of then
  std::string command;
  std::string scene;                                        ///< resolved, SI
  std::string accuracy;                                     ///< what is claimed, JSON; empty: nothing
  std::vector<std::pair<std::string, std::string>> inputs;  ///< path, sha256
  int tessellation = 0;  ///< pieces per edge into which a shell is cut for drawing; 0: drawing_level()
  bool overwrite = false;
};

/// A result in HDF5, for ParaView (VTKHDF UnstructuredGrid of the curved surface, as linear triangles, and of the
/// solids' tetrahedra) and for programs (/tunica: the degrees of freedom themselves, history, probes, contacts, scene).
/// docs/results.md has the layout.
///
/// Everything goes to NAME.part. A state is flushed when append() returns and counted last, so that NAME.part can be
/// read after a kill; it stays behind from the first state on, until commit() renames it. The file is not locked: it
/// can be read while it grows. With it goes NAME with the ending .page, what a page shows of the run (page_file.hpp),
/// of which nothing is there before commit().
class ResultFile {
public:
  /// Writes the reference geometry. `model` must outlive this. Errors: OutputError.
  ResultFile(const std::filesystem::path& path, const Model& model, ResultOptions options);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  /// Errors: OutputError, for example when the disk is full; what was appended before stays readable.
  void append(const State& state, const ElementFields& fields);

  /// Writes the page's data, closes the file and gives it its name. Errors: OutputError.
  void commit(bool converged);

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tunica
