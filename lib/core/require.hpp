#pragma once

#include <string_view>

/// What functions ask of the numbers that a caller gives them.
namespace tunica {

/// Errors: InputError, unless the value is finite and above zero.
/// @param what  the number's name in the message: "the tolerance"
void require_positive(double value, std::string_view what);

/// Errors: InputError, unless the value is finite and not below zero.
void require_not_negative(double value, std::string_view what);

}  // namespace tunica
