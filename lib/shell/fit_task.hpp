#pragma once

#include "shell/fit_start.hpp"
#include "shell/fit_state.hpp"
#include "shell/relax.hpp"

#include <algorithm>

namespace tunica {

/// What every search of a fit knows of what is asked for. Keeps references.
struct FitTask {
  const TriangleMesh& coarse;
  const Target& target;
  const RelaxOptions& options;
  bool like_target;  ///< COARSE has the target's topology: then searches start from decimations of the target
  FitLimits limits;

  /// A start as a mesh under edit, of the patches asked for.
  [[nodiscard]] FitMesh prepared(const FitStart& start) const {
    FitMesh mesh = prepare_fit(start, target);
    mesh.kind = options.surface;
    return mesh;
  }

  /// The shells that samples are made for: a few need more points than their share.
  static std::size_t samples_for(double shells) { return static_cast<std::size_t>(std::max(8.0, shells)); }
};

}  // namespace tunica
