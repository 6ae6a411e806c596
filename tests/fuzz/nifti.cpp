#include "fuzz/target.hpp"

// NIfTI-1 and -2, plain and compressed, with the label names in extensions; a header of a pair has its image beside it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica::fuzz;
  static const std::filesystem::path image = file("a.img", std::string(256, '\1'));
  volume("a.hdr", text_of(data, size));
  return 0;
}
