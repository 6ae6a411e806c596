#include "fuzz/target.hpp"

// Gmsh's tetrahedra, versions 2 and 4.1, ASCII and binary.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::tetrahedra("a.msh", tunica::fuzz::text_of(data, size));
  return 0;
}
