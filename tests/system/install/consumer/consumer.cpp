#include "tunica/core/instruction_set.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <cstdio>

int main() {
  const tunica::TriangleMesh mesh{{{0, 0, 0}, {3, 0, 0}, {0, 4, 0}}, {{0, 1, 2}}};
  const double pressure = tunica::parse_quantity("1bar", tunica::dimension::pressure);
  std::printf("%s %g MPa %g mm2\n", tunica::instruction_set(), pressure, area(mesh));
}
