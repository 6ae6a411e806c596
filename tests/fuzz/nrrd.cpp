#include "fuzz/target.hpp"

// NRRD with its data inside or beside it (.nhdr: data.raw), segments and layers.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica::fuzz;
  static const std::filesystem::path beside = file("data.raw", std::string(256, '\1'));
  volume("a.nhdr", text_of(data, size));
  return 0;
}
