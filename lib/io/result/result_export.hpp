#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

struct ExportOptions {
  bool pvd = false;  ///< STEM.pvd and one STEM_0000.vtu per state
  bool xmf = false;  ///< STEM.xmf, which refers to the result file
  bool inp = false;  ///< STEM.inp: the model for CalculiX and Abaqus, see shell_deck.hpp
  bool feb = false;  ///< STEM.feb: the model for FEBio
  /// The last state's shells, coloured by stress, for each ending of write_surface() here: STEM.glb
  std::vector<std::string> surfaces = {};
  RunSettings run = {};      ///< inp and feb hold it, too
  std::string made_by = {};  ///< provenance
  int tessellation = 0;      ///< as ResultOptions
  bool overwrite = false;
  std::string space = "LPS";  ///< world axes of the shells, which surfaces say
};

/// A result for readers that know no VTKHDF with time, beside the result file: OUT.hdf gives OUT.pvd, OUT_0000.vtu …,
/// OUT.xmf. A .vtu is whole when append() returns. What refers to them comes with commit(); a run that does not get
/// there leaves OUT.pvd.part (and OUT.xmf.part, which refers to OUT.hdf.part) with the states so far.
/// Limits: .xmf (XDMF 2) shows what /VTKHDF holds: of a static run the last state. Shells and solids are grids of their
/// own in it, over the same points. The models (.inp, .feb) and the
/// surfaces of the last state are written by commit() alone.
class ResultExport {
public:
  /// `model` must outlive this. Errors: OutputError, also when a .vtu is there already and `overwrite` is false;
  /// UsageError where a model cannot be expressed, or has no shells to draw.
  ResultExport(const std::filesystem::path& result, const Model& model, const ExportOptions& options);
  ~ResultExport();
  ResultExport(const ResultExport&) = delete;
  ResultExport& operator=(const ResultExport&) = delete;

  /// @return the .vtu that now holds the state, if any. Errors: OutputError.
  std::optional<std::filesystem::path> append(const State& state, const ElementFields& fields);
  /// Just before the result file gets its name. Errors: OutputError.
  void commit();

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The files that an export names at its end: for checking them before the work.
std::vector<std::filesystem::path> export_paths(const std::filesystem::path& result, const ExportOptions& options);

}  // namespace tunica
