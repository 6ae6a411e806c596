#include "tunica/report/detail/redaction.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/report/detail/arguments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;

bool is_letter(char sign) {
  return std::isalnum(static_cast<unsigned char>(sign)) != 0 || static_cast<unsigned char>(sign) >= 0x80;
}

// Whether text[at] belongs to a flag: volumes are called label.nii.gz and mask.nii.gz, too.
bool is_of_a_flag(const std::string& text, std::size_t at) {
  constexpr const char* letters = "abcdefghijklmnopqrstuvwxyz-";
  const std::size_t begin = text.find_last_not_of(letters, at) + 1;  // npos + 1 is 0
  const std::size_t end = std::min(text.find_first_not_of(letters, begin), text.size());
  const auto blank = [&](std::size_t i) { return i == text.size() || text[i] == ' ' || text[i] == '='; };
  return text.compare(begin, 2, "--") == 0 && (begin == 0 || blank(begin - 1)) && blank(end);
}

// Whether [at, at + size) is a name of its own, not a part of a word.
bool stands_alone(const std::string& text, std::size_t at, std::size_t size) {
  const bool before = at == 0 || !is_letter(text[at - 1]) || !is_letter(text[at]);
  const std::size_t end = at + size;
  return before && !is_of_a_flag(text, at) &&
         (end == text.size() || !is_letter(text[end]) || !is_letter(text[end - 1]));
}

void replace_all(std::string& text, const std::string& name, const std::string& instead) {
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at)) {
    if (stands_alone(text, at, name.size())) {
      text.replace(at, name.size(), instead);
      at += instead.size();
    } else {
      ++at;
    }
  }
}

// Whether a word with a slash is a number with its unit.
bool is_quantity(const std::string& word) {
  constexpr std::array with_slash{dimension::density, dimension::acceleration, dimension::force_per_length,
                                  dimension::rate,    dimension::pressure,     dimension::bedding};
  return std::ranges::any_of(with_slash, [&](const Dimension& expected) {
    try {
      (void)parse_quantity(word, expected);
      return true;
    } catch (const UsageError&) {
      return false;
    }
  });
}

// What is left with a slash between two blanks or quotes.
std::string without_paths(const std::string& text) {
  constexpr const char* ends = " \t\n'\"(),;:=";
  std::string left;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of(ends, at), text.size());
    const std::string word = text.substr(at, end - at);
    const std::size_t slash = word.find('/');
    // A unit by itself ("kg/m3") has no path's look.
    const bool path = slash != std::string::npos &&
                      (slash == 0 || word.find('/', slash + 1) != std::string::npos ||
                       word.find('.') != std::string::npos || std::isdigit(static_cast<unsigned char>(word[0])) != 0);
    left += path && !is_quantity(word) ? "[path]" : word;
    if (end < text.size()) {
      left += text[end];
    }
    at = end + 1;
  }
  return left;
}

std::string stem_of_volume(const fs::path& path) {
  const std::string name = path.filename().string();
  for (const char* ending :
       {".seg.nrrd", ".nii.gz", ".nii", ".nrrd", ".nhdr", ".mha", ".mhd", ".tiff", ".tif", ".png"}) {
    if (name.ends_with(ending)) {
      return name.substr(0, name.size() - std::string(ending).size());
    }
  }
  return name;
}

}  // namespace

Redaction::Redaction(const PipelineCase& one, std::size_t number) : active_(true) {
  const std::string own = fmt::format("case {}", number);
  const std::string stem = fs::path(one.name).parent_path().string();
  forget(one.name, own);
  forget(stem, own);
  for (const auto& [stage, report] : one.reports) {
    for (const auto& [path, hash] : one.files(stage, "inputs")) {
      forget(path.string(), stage == "extract" ? "VOLUME" : path.filename().string());
      if (stage == "extract") {
        forget(path.filename().string(), "VOLUME");
        forget(stem_of_volume(path), own);
        forget(stem_of_volume(path.parent_path()), own);  // a folder of slices
      }
    }
    for (const auto& [path, hash] : one.files(stage, "outputs")) {
      forget(path.string(), path.filename().string());
    }
    const Json arguments = arguments_of(one, stage);
    for (const auto& [name, value] : arguments.items()) {
      for (const Json& part : value.is_array() ? value : Json::array({value})) {
        const std::string word = part.is_string() ? part.get<std::string>() : "";
        if (word.find('/') != std::string::npos && !is_quantity(word)) {
          forget(word, name == "VOLUME" ? name : fs::path(word).filename().string());
        }
      }
    }
  }
  if (!one.folder.empty()) {
    forget(one.folder.string(), own);
    forget(fs::absolute(one.folder).string(), own);
  }
  std::ranges::stable_sort(names_, [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
}

void Redaction::forget(const std::string& name, const std::string& instead) {
  // Cases that are counted have a number for a name: it names nobody, and would stand for every such number.
  const bool counted =
      name.size() <= 3 && std::ranges::all_of(name, [](unsigned char sign) { return std::isdigit(sign) != 0; });
  if (counted || name == "." || name == "/") {
    return;
  }
  names_.emplace_back(name, instead);
  std::string quoted = name;  // as a command has it
  for (std::size_t at = quoted.find('\''); at != std::string::npos; at = quoted.find('\'', at + 4)) {
    quoted.replace(at, 1, "'\\''");
  }
  if (quoted != name) {
    names_.emplace_back(quoted, instead);
  }
}

std::string Redaction::operator()(std::string text) const {
  if (!active_) {
    return text;
  }
  for (const auto& [name, instead] : names_) {
    replace_all(text, name, instead);
  }
  return without_paths(text);
}

}  // namespace tunica::report
