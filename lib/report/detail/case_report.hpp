#pragma once

#include "tunica/io/result/pipeline_folder.hpp"
#include "tunica/report/detail/redaction.hpp"
#include "tunica/report/detail/told_warnings.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace tunica::report {

/// A surface as it is drawn: the loaded organ, or what there is of it.
struct SeenSurface {
  TriangleMesh mesh;           ///< mm; without triangles where nothing can be drawn
  std::vector<double> stress;  ///< #V, MPa, membrane; empty: not loaded
  std::array<Vec3, 3> axes;    ///< as of picture_axes()
};

/// What a page says of one case, besides the stages' reports.
struct CaseReport {
  PipelineCase source;
  std::size_t number = 0;              ///< from 1
  std::string name;                    ///< as shown
  std::string organ_kind;              ///< cases of the same are compared: label, and file where that names the organ
  std::string organ_name;              ///< that, as shown
  Redaction redacted;                  ///< for all texts of the reports
  std::vector<ToldWarning> warnings;   ///< of all stages, the heaviest first, redacted
  std::vector<std::string> notes;      ///< of all stages, redacted
  std::vector<std::string> missing;    ///< what could not be drawn, and why, redacted
  SeenSurface seen;                    ///< what the picture shows
  std::string picture;                 ///< PNG of the loaded organ; empty: none
  double picture_top = 0;              ///< MPa, of its last colour; 0: the picture is plain
  double magnification = 1;            ///< of the displacement in it
  std::string slices;                  ///< PNG; empty: none
  std::string organ;                   ///< packed for the page's script, base64; empty: none
  std::vector<std::string> different;  ///< outputs that are not what the reports say, redacted

  [[nodiscard]] std::string id() const { return "case-" + std::to_string(number); }
};

/// How a case stands: "done", "warned" (done, with warnings; notes are none), or "failed".
std::string status_of(const CaseReport& one);

}  // namespace tunica::report
