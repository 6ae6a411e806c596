// World axes and units of length as comments, headers and names of mesh files say them.
#include "tunica/core/error.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

namespace tunica {
namespace {

using Spelling = std::pair<std::string_view, std::string_view>;

constexpr std::array<Spelling, 4> axes{
    {{"lps", "LPS"}, {"ras", "RAS"}, {"left-posterior-superior", "LPS"}, {"right-anterior-superior", "RAS"}}};

// Without their plural s. Those that are read no further than this are refused.
constexpr std::array<Spelling, 22> unit_names{
    {{"um", "um"},         {"µm", "um"},         {"micron", "um"},     {"micrometer", "um"}, {"micrometre", "um"},
     {"mm", "mm"},         {"millimeter", "mm"}, {"millimetre", "mm"}, {"cm", "cm"},         {"centimeter", "cm"},
     {"centimetre", "cm"}, {"m", "m"},           {"meter", "m"},       {"metre", "m"},       {"in", "inches"},
     {"inch", "inches"},   {"inches", "inches"}, {"foot", "feet"},     {"feet", "feet"},     {"ft", "feet"},
     {"dm", "dm"},         {"nm", "nm"}}};

char lower(char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); }

bool is_of_word(char c) {
  return (lower(c) >= 'a' && lower(c) <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || (c & 0x80) != 0;
}

std::string_view without_blanks(std::string_view text, std::string_view blanks) {
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  return text;
}

/// The word that a text begins with, and takes it off.
std::string_view take_word(std::string_view& text) {
  const std::string_view word = text.substr(0, std::ranges::find_if_not(text, is_of_word) - text.begin());
  text.remove_prefix(word.size());
  return word;
}

std::optional<std::string_view> named_by(std::string_view word, std::span<const Spelling> spellings) {
  const auto found = std::ranges::find_if(
      spellings, [&](const Spelling& spelling) { return std::ranges::equal(word, spelling.first, {}, lower); });
  return found == spellings.end() ? std::nullopt : std::optional(found->second);
}

/// What a text says behind a key: = or :, with blanks and, in JSON, quotes around it.
std::optional<std::string_view> assigned_word(std::string_view behind) {
  constexpr std::string_view around = " \t\"'";
  behind = without_blanks(behind, around);
  if (!behind.starts_with('=') && !behind.starts_with(':')) {
    return {};
  }
  behind = without_blanks(behind.substr(1), around);
  return take_word(behind);
}

/// What is made of the texts before and behind a key.
using Meaning = std::function<std::optional<std::string_view>(std::string_view, std::string_view)>;

/// What `meaning` makes of a text that has a key, which is no part of another word. Errors: InputError: two things.
std::optional<std::string> said_of(std::string_view text, std::string_view key, const Meaning& meaning,
                                   const std::function<std::string(std::string_view, std::string_view)>& both) {
  std::optional<std::string> said;
  for (std::size_t at = 0; at + key.size() < text.size(); ++at) {
    if ((at > 0 && is_of_word(text[at - 1])) || !std::ranges::equal(text.substr(at, key.size()), key, {}, lower)) {
      continue;
    }
    if (const auto value = meaning(text.substr(0, at), text.substr(at + key.size()))) {
      if (said && *said != *value) {
        throw InputError(both(*said, *value));
      }
      said = *value;
    }
  }
  return said;
}

std::optional<std::string_view> unit_named(std::string_view word) {
  if (const auto unit = named_by(word, unit_names)) {
    return unit;
  }
  return word.ends_with('s') || word.ends_with('S') ? named_by(word.substr(0, word.size() - 1), unit_names)
                                                    : std::nullopt;
}

/// Whether a unit that follows is one of length: "File units", "SPACE=LPS units", but not "time unit".
bool may_be_of_length(std::string_view before) {
  constexpr std::array<std::string_view, 9> of_length{"file",   "mesh",   "model",      "all",        "the",
                                                      "length", "linear", "coordinate", "coordinates"};
  while (before.ends_with(' ') || before.ends_with('\t')) {
    before.remove_suffix(1);
  }
  const std::string_view word =
      before.substr(std::ranges::find_if_not(before.rbegin(), before.rend(), is_of_word).base() - before.begin());
  const bool is_value = word.size() < before.size() &&
                        std::string_view("=:").find(before[before.size() - word.size() - 1]) != std::string_view::npos;
  return word.empty() || is_value ||
         std::ranges::any_of(of_length, [&](std::string_view one) { return std::ranges::equal(word, one, {}, lower); });
}

/// Whether a unit ends here: not "m/s", "mm Hg" or "m. Miller", but "mm; made by hand" and "mm SPACE=LPS".
bool ends_unit(std::string_view word, std::string_view behind) {
  behind = without_blanks(behind, "\"')]}");
  const std::string_view rest = without_blanks(behind, std::string_view(" \t\r\0", 4));
  if (rest.empty() || rest.starts_with(';') || rest.starts_with(',')) {
    return true;
  }
  if (rest.starts_with('.')) {
    return word.size() > 1 || std::ranges::none_of(rest, is_of_word);
  }
  std::string_view next = rest;
  return rest.size() < behind.size() && !take_word(next).empty() && (next.starts_with('=') || next.starts_with(':'));
}

/// "units mm", "unit = cm", "Units in millimetres.", but no unit of something else.
std::optional<std::string_view> unit_said(std::string_view before, std::string_view behind) {
  constexpr std::string_view around = " \t\"'";
  if (!may_be_of_length(before)) {
    return {};
  }
  if (behind.starts_with('s') || behind.starts_with('S')) {
    behind.remove_prefix(1);
  }
  std::string_view rest = without_blanks(behind, around);
  const bool is_assigned = rest.starts_with('=') || rest.starts_with(':');
  if (!is_assigned && rest.size() == behind.size()) {
    return {};
  }
  rest = without_blanks(rest.substr(is_assigned ? 1 : 0), around);
  std::string_view word = take_word(rest);
  for (const std::string_view link : {"in", "are", "is"}) {
    if (!is_assigned && std::ranges::equal(word, link, {}, lower) && rest.starts_with(' ')) {
      rest = without_blanks(rest, around);
      word = take_word(rest);
      break;
    }
  }
  return ends_unit(word, rest) ? unit_named(word) : std::nullopt;
}

std::optional<std::string_view> axes_said(std::string_view /*before*/, std::string_view behind) {
  const auto word = assigned_word(behind);
  return word ? named_by(*word, axes) : std::nullopt;
}

/// Takes what is said besides what was said before.
void take(std::optional<std::string>& before, std::optional<std::string> said,
          const std::function<std::string(std::string_view, std::string_view)>& both) {
  if (said && before && *before != *said) {
    throw InputError(both(*before, *said));
  }
  if (said) {
    before = std::move(said);
  }
}

}  // namespace

void take_space(MeshFile& file, std::string_view text, const std::string& name) {
  const auto both = [&](std::string_view one, std::string_view other) {
    return fmt::format("{}: says both SPACE={} and SPACE={}: correct what it says of its axes", name, one, other);
  };
  take(file.space, said_of(text, "space", axes_said, both), both);
}

void take_frame(MeshFile& file, std::string_view text, const std::string& name) {
  take_space(file, text, name);
  const auto both = [&](std::string_view one, std::string_view other) {
    return fmt::format("{}: says both \"units {}\" and \"units {}\": these contradict each other, keep one", name, one,
                       other);
  };
  take(file.units, said_of(text, "unit", unit_said, both), both);
}

}  // namespace tunica
