#include "fuzz/target.hpp"

// MetaImage with its data inside or beside it (.mhd: data.raw).
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica::fuzz;
  static const std::filesystem::path beside = file("data.raw", std::string(256, '\1'));
  volume("a.mhd", text_of(data, size));
  return 0;
}
