#include "fuzz/target.hpp"

// STL: ASCII and binary.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::mesh("a.stl", tunica::fuzz::text_of(data, size));
  return 0;
}
