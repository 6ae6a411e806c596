#pragma once

#include "tunica/core/types.hpp"

namespace tunica {

/// Whether a vector is of unit length, but for what rounding and a file's digits leave; no NaN is.
bool is_unit(const Vec3& vector);

/// The smallest number of so many significant digits that is not below a positive value: a bound in few digits
/// stays one. Round-off of the value itself (a part of 1e-12) does not count. Other values stay as they are.
double rounded_upwards(double value, int digits);

}  // namespace tunica
