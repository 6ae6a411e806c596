#pragma once

#include "tunica/core/quantity.hpp"

#include <string>
#include <string_view>
#include <vector>

/// What somebody may have meant who wrote a quantity as people do and tunica does not: "120mmhg", "1,5mm", "1.1 g/cm³".
namespace tunica {

/// The nearest spellings that parse_quantity() takes: another case, signs that are not ASCII, units as words, decimal
/// commas, blanks, one letter that is wrong. More than one where the text has more than one meaning ("3mpa" is 3MPa or
/// 0.003Pa, "1,000mm" is a thousand or one), each then with its meaning in parentheses; none where nothing is near.
std::vector<std::string> right_spellings(std::string_view text, Dimension dimension);

/// The same of a number without a unit.
std::vector<std::string> right_numbers(std::string_view text);

/// "write 3MPa or 0.003Pa"; empty where there is none.
std::string advice(const std::vector<std::string>& spellings);

}  // namespace tunica
