#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tunica {

/// Exponents of (tonne, mm, s). Force is tonne mm / s^2 = N, pressure N / mm^2 = MPa.
struct Dimension {
  int mass = 0;
  int length = 0;
  int time = 0;
  friend constexpr bool operator==(const Dimension&, const Dimension&) = default;
};

namespace dimension {
inline constexpr Dimension number{0, 0, 0};
inline constexpr Dimension length{0, 1, 0};
inline constexpr Dimension volume{0, 3, 0};
inline constexpr Dimension time{0, 0, 1};
inline constexpr Dimension rate{0, 0, -1};
inline constexpr Dimension force{1, 1, -2};
inline constexpr Dimension moment{1, 2, -2};
inline constexpr Dimension force_per_length{1, 0, -2};
inline constexpr Dimension pressure{1, -1, -2};
inline constexpr Dimension bedding{1, -2, -2};  ///< pressure per length
inline constexpr Dimension density{1, -3, 0};
inline constexpr Dimension acceleration{0, 1, -2};
}  // namespace dimension

/// Reads a number with its unit, e.g. "100mmHg", "-90 MPa", "2.5e-07N", "1.1g/cm3".
/// Grammar: number (C notation, decimal), optional spaces, unit = base units joined by `/` and `*`, each with an
/// optional integer power; a leading `/` is allowed ("0.1/s").
/// @return the value in tunica's units (tonne, mm, s).
/// Errors: UsageError names the text, says what is expected and shows the nearest right spelling (spelling.hpp): a bare
/// number, another case, a decimal comma are such errors, never read as another unit.
double parse_quantity(std::string_view text, Dimension expected);

/// Reads a bare unit of length, "um", "mm", "cm" or "m"; @return its size in mm. Errors: UsageError.
double parse_length_unit(std::string_view text);

/// A tolerance on a length: "0.5%" (of the target's own, unpadded bounding-box diagonal) or "0.2mm".
struct LengthTolerance {
  double value = 0;
  bool relative = false;  ///< value is a fraction of the diagonal (0.005 for "0.5%"), else mm

  [[nodiscard]] double millimetres(double diagonal) const { return relative ? value * diagonal : value; }
};

/// Errors: UsageError, also for a tolerance that is not positive.
LengthTolerance parse_length_tolerance(std::string_view text);

/// Reads a fraction written as percent, "5%" gives 0.05. Errors: UsageError.
double parse_percent(std::string_view text);

/// A part with two digits as percent, above 100 % with all of them: .0123 gives "1.2 %", 12.3 "1230 %".
std::string percent_text(double part);

/// Reads a plain decimal number (C notation, finite) that must fill the whole text.
std::optional<double> parse_number(std::string_view text);

}  // namespace tunica
