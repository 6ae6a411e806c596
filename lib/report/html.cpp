#include "tunica/report/detail/html.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/report/detail/embedded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

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

// The parts of the page by their names: what stands behind "<!-- part: NAME -->" and the end of its line, without the
// last end of a line.
std::map<std::string_view, std::string_view> find_parts(std::string_view text) {
  constexpr std::string_view mark = "<!-- part: ";
  constexpr std::string_view end_of_mark = " -->\n";
  std::map<std::string_view, std::string_view> parts;
  for (std::size_t at = text.find(mark); at != std::string_view::npos;) {
    const std::size_t end = text.find(end_of_mark, at);
    const std::size_t begin = end + end_of_mark.size();
    const std::size_t next = text.find(mark, begin);
    const std::string_view name = text.substr(at + mark.size(), end - at - mark.size());
    parts[name] = text.substr(begin, std::min(next, text.size()) - begin - 1);
    at = next;
  }
  return parts;
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

Markup part(std::string_view name, const std::vector<Slot>& slots) {
  static const std::map<std::string_view, std::string_view> parts = find_parts(embedded::report_html());
  std::string_view rest = parts.at(name);
  Markup made;
  std::size_t filled = 0;
  for (std::size_t open = rest.find('{'); open != std::string_view::npos; open = rest.find('{')) {
    const std::size_t close = rest.find('}', open);
    const auto slot = std::ranges::find(slots, rest.substr(open + 1, close - open - 1), &Slot::name);
    TUNICA_ASSERT(slot != slots.end());
    filled |= std::size_t{1} << (slot - slots.begin());
    made.text += rest.substr(0, open);
    made.text += slot->shielded;
    rest = rest.substr(close + 1);
  }
  TUNICA_ASSERT(filled + 1 == std::size_t{1} << slots.size());
  made.text += rest;
  return made;
}

Markup heading(int level, std::string_view text) { return part("heading", {{"level", level}, {"text", text}}); }

Markup data_address(std::string_view kind, std::string_view bytes) {
  return part("picture_data", {{"kind", kind}, {"bytes", base64(bytes)}});
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
