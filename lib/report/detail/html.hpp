#pragma once

#include <concepts>
#include <string>
#include <string_view>
#include <vector>

/// HTML that no name of a file can break out of: what is put into it is text, unless it is Markup already. The HTML
/// itself stands in web/src/report.html.
namespace tunica::report {

/// HTML as it stands. Only part() and what joins its results make some.
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

/// What stands in a slot of a part: a text or a number, or Markup as it is.
struct Slot {
  Slot(std::string_view of, const Markup& markup) : name(of), shielded(markup.text) {}
  Slot(std::string_view of, std::string_view text) : name(of), shielded(escaped(text)) {}
  Slot(std::string_view of, const std::string& text) : Slot(of, std::string_view(text)) {}
  Slot(std::string_view of, const char* text) : Slot(of, std::string_view(text)) {}
  Slot(std::string_view of, std::integral auto number) : name(of), shielded(std::to_string(number)) {}

  std::string_view name;
  std::string shielded;
};

/// A part of web/src/report.html with its slots filled. Every slot has to be named, and no other.
Markup part(std::string_view name, const std::vector<Slot>& slots = {});

/// A heading of level 1 to 6.
Markup heading(int level, std::string_view text);

/// The address of bytes that stand in the page. @param kind  e.g. "image/png"
Markup data_address(std::string_view kind, std::string_view bytes);

/// A number for people: three digits, all digits before the point.
std::string figure(double value);

/// The same for what is certainly not passed: rounded up.
std::string figure_above(double value);

}  // namespace tunica::report
