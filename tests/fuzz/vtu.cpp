#include "fuzz/target.hpp"

// VTK's XML format.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::tetrahedra("a.vtu", tunica::fuzz::text_of(data, size));
  return 0;
}
