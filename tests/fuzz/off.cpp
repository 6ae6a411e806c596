#include "fuzz/target.hpp"

// OFF.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::mesh("a.off", tunica::fuzz::text_of(data, size));
  return 0;
}
