// World axes as comments, headers and names of mesh files say them.
#include "tunica/core/error.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace tunica {
namespace {

constexpr std::string_view key = "space";
constexpr std::array<std::pair<std::string_view, const char*>, 4> spellings{
    {{"lps", "LPS"}, {"ras", "RAS"}, {"left-posterior-superior", "LPS"}, {"right-anterior-superior", "RAS"}}};

char lower(char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); }

bool is_of_word(char c) {
  return (lower(c) >= 'a' && lower(c) <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

/// What `text` says behind a key that ends at `at`: = or :, with blanks and, in JSON, quotes around it.
const char* value_at(std::string_view text, std::size_t at) {
  const auto skip = [&] { at = std::min(text.find_first_not_of(" \t\"'", at), text.size()); };
  skip();
  if (at == text.size() || (text[at] != '=' && text[at] != ':')) {
    return nullptr;
  }
  ++at;
  skip();
  const auto* const end = std::find_if_not(text.begin() + at, text.end(), is_of_word);
  const std::string_view value(text.begin() + at, end);
  const auto* const found = std::ranges::find_if(
      spellings, [&](const auto& spelling) { return std::ranges::equal(value, spelling.first, {}, lower); });
  return found == spellings.end() ? nullptr : found->second;
}

}  // namespace

std::optional<std::string> space_in(std::string_view text, const std::string& name) {
  std::optional<std::string> said;
  for (std::size_t at = 0; at + key.size() < text.size(); ++at) {
    if ((at > 0 && is_of_word(text[at - 1])) || !std::ranges::equal(text.substr(at, key.size()), key, {}, lower)) {
      continue;
    }
    if (const char* const value = value_at(text, at + key.size())) {
      if (said && *said != value) {
        throw InputError(fmt::format("{}: says both SPACE=LPS and SPACE=RAS: correct what it says of its axes", name));
      }
      said = value;
    }
  }
  return said;
}

void take_space(MeshFile& file, std::string_view text, const std::string& name) {
  const auto said = space_in(text, name);
  if (said && file.space && *file.space != *said) {
    throw InputError(
        fmt::format("{}: says both SPACE={} and SPACE={}: correct what it says of its axes", name, *file.space, *said));
  }
  file.space = said ? said : file.space;
}

}  // namespace tunica
