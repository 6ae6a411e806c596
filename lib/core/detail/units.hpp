#pragma once

#include "tunica/core/quantity.hpp"

#include <array>
#include <optional>
#include <string_view>

/// The units that quantities are written in.
namespace tunica {

struct Unit {
  std::string_view name;
  double value;  ///< in tonne, mm, s
  Dimension dimension;
};

/// Longer names first, so that a prefix match is the longest match ("mmHg" before "mm" before "m").
constexpr double standard_gravity_water_cm = 9.80665e-5;  // 1 cmH2O = 98.0665 Pa in MPa
constexpr double pound_per_square_inch = 6894.757293168e-6;
constexpr double torr = 101325.0 / 760 * 1e-6;
inline constexpr std::array units{
    Unit{"cmH2O", standard_gravity_water_cm, dimension::pressure},
    Unit{"mmHg", 133.322387415e-6, dimension::pressure},
    Unit{"Torr", torr, dimension::pressure},
    Unit{"mbar", 1e-4, dimension::pressure},
    Unit{"kPa", 1e-3, dimension::pressure},
    Unit{"hPa", 1e-4, dimension::pressure},
    Unit{"MPa", 1, dimension::pressure},
    Unit{"GPa", 1e3, dimension::pressure},
    Unit{"bar", 0.1, dimension::pressure},
    Unit{"psi", pound_per_square_inch, dimension::pressure},
    Unit{"dyn", 1e-5, dimension::force},
    Unit{"min", 60, dimension::time},
    Unit{"Pa", 1e-6, dimension::pressure},
    Unit{"uN", 1e-6, dimension::force},
    Unit{"mN", 1e-3, dimension::force},
    Unit{"kN", 1e3, dimension::force},
    Unit{"um", 1e-3, dimension::length},
    Unit{"mm", 1, dimension::length},
    Unit{"cm", 10, dimension::length},
    Unit{"us", 1e-6, dimension::time},
    Unit{"ms", 1e-3, dimension::time},
    Unit{"kg", 1e-3, {1, 0, 0}},
    Unit{"ml", 1e3, dimension::volume},
    Unit{"N", 1, dimension::force},
    Unit{"m", 1e3, dimension::length},
    Unit{"s", 1, dimension::time},
    Unit{"g", 1e-6, {1, 0, 0}},
    Unit{"t", 1, {1, 0, 0}},
    Unit{"l", 1e6, dimension::volume},
};

/// What a dimension is called, and the units that people write it in; the first is the one of examples.
struct Usage {
  Dimension dimension;
  std::string_view name;
  std::string_view units;  ///< with blanks between them
};
inline constexpr std::array usages{
    Usage{dimension::length, "a length", "mm um cm m"},
    Usage{dimension::volume, "a volume", "ml mm3 cm3 l"},
    Usage{dimension::time, "a time", "ms us s min"},
    Usage{dimension::rate, "a rate", "/s"},
    Usage{dimension::force, "a force", "N uN mN kN"},
    Usage{dimension::moment, "a moment", "N*mm N*m"},
    Usage{dimension::force_per_length, "a force per length", "N/mm N/m"},
    Usage{dimension::pressure, "a pressure", "kPa Pa hPa MPa GPa mmHg cmH2O Torr mbar bar psi dyn/cm2 N/mm2"},
    Usage{dimension::bedding, "a stiffness per area", "N/m3 kN/m3 N/mm3 Pa/m kPa/mm MPa/mm"},
    Usage{dimension::density, "a density", "kg/m3 g/cm3 g/mm3 t/mm3"},
    Usage{dimension::acceleration, "an acceleration", "m/s2 mm/s2"},
    Usage{dimension::number, "a plain number", ""},
};

/// Null where nobody writes it.
const Usage* usage_of(Dimension dimension);

struct ParsedUnit {
  double value = 1;
  Dimension dimension;
};

/// Base units joined by `/` and `*`, each with an optional integer power; none where the text is something else.
std::optional<ParsedUnit> parse_unit(std::string_view text);

/// Without blanks and tabs at its ends.
std::string_view trimmed_quantity(std::string_view text);

}  // namespace tunica
