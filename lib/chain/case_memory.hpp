// chain: the stages from a volume to a result, as functions from settings to what came of them.
#pragma once

#include <algorithm>
#include <cstddef>

namespace tunica::chain {

/// The most memory that each tool of the chain takes for a case, in MiB.
struct CaseMemory {
  double extract = 0;
  double decimate = 0;
  double relax = 0;
  double simulate = 0;

  [[nodiscard]] double chain() const { return std::max({extract, decimate, relax, simulate}); }
};

/// Estimates it before anything is extracted.
/// @param vertices     of the label's surface: LabelIndex::surface_vertices()
/// @param shells       of the mesh that is loaded
/// @param voxels       of the volume
/// @param voxel_bytes  of one voxel as it is stored
/// Source: lines fitted to `peak_mib` of the reports of phantoms of 16 to 400 voxels and of 200 to 12,800 shells;
/// tests/tools/extract/memory_test.py holds them to a factor of 1.5.
/// Limits: extract of a label, without `--smooth SIGMA`; simulate of statics, without accuracy, contact or solids.
CaseMemory estimate_memory(std::size_t vertices, std::size_t shells, std::size_t voxels, std::size_t voxel_bytes);

}  // namespace tunica::chain
