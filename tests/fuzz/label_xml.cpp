#include "fuzz/target.hpp"

#include "tunica/io/volume/detail/label_table.hpp"

// The XML of label names in an extension of a NIfTI file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  std::optional<std::string> why;
  for (const auto& [value, name] : volume_format::parse_label_table_xml(fuzz::text_of(data, size), why)) {
    fuzz::require(name.size() <= 200, "a name is not long");
  }
  return 0;
}
