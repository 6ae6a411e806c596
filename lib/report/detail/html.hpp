#pragma once

#include <concepts>
#include <string>
#include <string_view>
#include <vector>

/// HTML that no name of a file can break out of: what is put into it is text, unless it is Markup already.
namespace tunica::report {

/// HTML as it stands. Only html() and what joins its results make some.
struct Markup {
  std::string text = {};

  Markup& operator+=(const Markup& other) {
    text += other.text;
    return *this;
  }
};

/// A text as UTF-8: what is none, no character of HTML or turns the direction of reading becomes U+FFFD.
std::string legible(std::string_view text);

/// The same in one line, for a field of a table: each tab, end of line or other control character of ASCII is a blank.
std::string in_one_line(std::string text);

/// A legible text for elements and for attributes in quotes: the signs of HTML escaped.
std::string escaped(std::string_view text);

/// What stands for an argument of html().
inline std::string shielded(const Markup& markup) { return markup.text; }
inline std::string shielded(std::string_view text) { return escaped(text); }
inline std::string shielded(std::integral auto number) { return std::to_string(number); }

/// HTML from a format, whose literal parts are HTML, and texts that are HTML already.
Markup filled(std::string_view format, const std::vector<std::string>& shielded_texts);

/// HTML from a format as fmt::format() takes it, whose literal parts are HTML. Arguments are escaped unless they are
/// Markup.
template <typename... Arguments>
Markup html(std::string_view format, const Arguments&... arguments) {
  return filled(format, {shielded(arguments)...});
}

/// A heading of level 1 to 6.
Markup heading(int level, std::string_view text);

/// The address of bytes that stand in the page. @param kind  e.g. "image/png"
Markup data_address(std::string_view kind, std::string_view bytes);

/// A number for people: three digits, all digits before the point.
std::string figure(double value);

/// The same for what is certainly not passed: rounded up.
std::string figure_above(double value);

}  // namespace tunica::report
