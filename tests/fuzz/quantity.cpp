#include "tunica/core/quantity.hpp"
#include "tunica/core/error.hpp"

#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace {

// A number, or an error of the command line.
template <typename Parse>
void run(const Parse& parse) {
  try {
    if (!std::isfinite(parse())) {
      std::abort();
    }
  } catch (const tunica::UsageError&) {
  }
}

}  // namespace

// What users write with units, in scenes and on command lines.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const Dimension expected : {dimension::pressure, dimension::rate}) {
    run([&] { return parse_quantity(text, expected); });
  }
  run([&] { return parse_length_unit(text); });
  run([&] { return parse_length_tolerance(text).millimetres(100); });
  run([&] { return parse_percent(text); });
  run([&] { return parse_number(text).value_or(0); });
  return 0;
}
