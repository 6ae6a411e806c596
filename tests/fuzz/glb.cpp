#include "fuzz/target.hpp"

// GLB.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::mesh("a.glb", tunica::fuzz::text_of(data, size));
  return 0;
}
