#include "fuzz/target.hpp"

// PLY: ASCII and binary, shells with their normals.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::mesh("a.ply", tunica::fuzz::text_of(data, size));
  return 0;
}
