#include "fuzz/target.hpp"

// VTK's legacy format.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunica::fuzz::tetrahedra("a.vtk", tunica::fuzz::text_of(data, size));
  return 0;
}
