#include "tunica/chain/case_memory.hpp"

#include "tunica/core/narrow.hpp"

namespace tunica::chain {

CaseMemory estimate_memory(std::size_t vertices, std::size_t shells, std::size_t voxels, std::size_t voxel_bytes) {
  constexpr double mib = 1 << 20;
  constexpr double slab = 64;  // read at a time, SlabSize
  const double triangles = 2 * real(vertices);
  const double count = real(shells);
  CaseMemory memory;
  memory.extract =
      26 + std::min(slab, real(voxels) * real(voxel_bytes) / mib) + real(voxels) / 8 / mib + 2.1e-4 * triangles;
  memory.decimate = 27 + 4.6e-4 * triangles;
  memory.relax = 115 + 4.5e-4 * triangles + 0.012 * count;
  memory.simulate = 32 + 0.02 * count;
  return memory;
}

}  // namespace tunica::chain
