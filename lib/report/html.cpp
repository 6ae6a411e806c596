#include "tunica/report/detail/html.hpp"

#include "tunica/core/quantity.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/file/encoding.hpp"

#include <fmt/args.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace tunica::report {
namespace {

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  ///< 0: not UTF-8
};

// The character at the start of a text that is not empty.
Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
  const std::uint32_t head = byte(0);
  const std::size_t count = head < 0x80 ? 1 : head >= 0xf0 ? 4 : head >= 0xe0 ? 3 : 2;
  if (head >= 0xf8 || (head >= 0x80 && head < 0xc0) || count > text.size()) {
    return {};
  }
  std::uint32_t code = count == 1 ? head : head & (0xffU >> (count + 1));
  for (std::size_t i = 1; i < count; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) {
      return {};
    }
    code = (code << 6U) | (byte(i) & 0x3fU);
  }
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  const bool valid = code >= least[count] && code <= 0x10ffff && (code < 0xd800 || code > 0xdfff);
  return valid ? Character{code, count} : Character{};
}

// Control characters, and those that turn or hide what stands beside them.
bool unwanted(std::uint32_t code) {
  return (code < 0x20 && code != '\t' && code != '\n') || (code >= 0x7f && code < 0xa0) || code == 0x061c ||
         (code >= 0x200b && code <= 0x200f) || (code >= 0x2028 && code <= 0x202e) ||
         (code >= 0x2066 && code <= 0x2069) || code == 0xfeff || (code & 0xfffeU) == 0xfffe;
}

}  // namespace

std::string legible(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const Character character = first_character(text);
    const std::size_t bytes = std::max<std::size_t>(character.bytes, 1);
    shown += character.bytes == 0 || unwanted(character.code) ? "\xef\xbf\xbd" : text.substr(0, bytes);
    text.remove_prefix(bytes);
  }
  return shown;
}

std::string in_one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char sign) { return static_cast<unsigned char>(sign) < 0x20 || sign == 0x7f; }, ' ');
  return legible(text);
}

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char sign : legible(text)) {
    switch (sign) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      case '`':
        safe += "&#96;";
        break;
      default:
        safe += sign;
    }
  }
  return safe;
}

Markup filled(std::string_view format, const std::vector<std::string>& shielded_texts) {
  fmt::dynamic_format_arg_store<fmt::format_context> store;
  for (const std::string& text : shielded_texts) {
    store.push_back(text);
  }
  return {fmt::vformat(format, store)};
}

Markup heading(int level, std::string_view text) { return html("<h{0}>{1}</h{0}>\n", level, text); }

Markup data_address(std::string_view kind, std::string_view bytes) {
  return html("data:{};base64,{}", kind, base64(bytes));
}

std::string figure(double value) {
  if (!std::isfinite(value)) {
    return "–";
  }
  if (value == 0) {
    return "0";
  }
  const int before = static_cast<int>(std::floor(std::log10(std::abs(value)))) + 1;  // digits before the point
  if (before < -3) {
    return fmt::format("{:.2e}", value);
  }
  std::string text = fmt::format("{:.{}f}", value, std::max(0, 3 - before));
  // What was stated is told as it was: 1.5, not 1.50.
  if (text.find('.') != std::string::npos && parse_number(text) == value) {
    text.erase(text.find_last_not_of('0') + 1);
    text.erase(text.find_last_not_of('.') + 1);
  }
  return text;
}

std::string figure_above(double value) {
  const int before = value >= 1 && std::isfinite(value) ? static_cast<int>(std::floor(std::log10(value))) + 1
                                                        : 1;  // digits before the point
  return figure(rounded_upwards(value, std::max(3, before)));
}

}  // namespace tunica::report
