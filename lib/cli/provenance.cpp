#include "tunica/cli/provenance.hpp"

#include "tunica/core/version.hpp"
#include "tunica/core/words.hpp"
#include "tunica/io/file/output_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace tunica::cli {
namespace fs = std::filesystem;
namespace {

/// The whole ending: .nii.gz, not .gz.
std::string whole_ending(const fs::path& path) {
  const std::string last = path.extension().string();
  const std::string before = path.stem().extension().string();
  return (last == ".gz" && before == ".nii") || (last == ".nrrd" && before == ".seg") || last == ".part" ? before + last
                                                                                                         : last;
}

/// Whether a word ends as a file's name does.
bool has_file_ending(const std::string& word) {
  static constexpr std::array<std::string_view, 38> endings{
      ".ply",  ".obj",   ".stl", ".off",  ".glb", ".3mf", ".hdf", ".h5",   ".hdf5", ".vtkhdf",
      ".json", ".toml",  ".nii", ".gz",   ".hdr", ".img", ".mha", ".mhd",  ".raw",  ".zraw",
      ".nrrd", ".nhdr",  ".tif", ".tiff", ".png", ".svg", ".csv", ".html", ".tsv",  ".ctbl",
      ".lut",  ".label", ".msh", ".vtk",  ".vtu", ".pvd", ".xmf", ".part"};
  return std::ranges::find(endings, fs::path(word).extension().string()) != endings.end();
}

/// Whether a word of the command line names a file, also one that the run does not get to.
bool is_file_word(const std::string& word) {
  std::error_code ignored;
  if (word.empty() || word.front() == '-') {
    return false;
  }
  const fs::path path(word);
  return has_file_ending(word) || fs::exists(path, ignored) ||
         (word.find('/') != std::string::npos && fs::is_directory(path.parent_path(), ignored));
}

/// Whether a word is what stands in the place of a name.
bool is_label(const std::string& word) {
  return word.starts_with("OUT.") || word.starts_with("FILE.") ||
         (word.starts_with("input") && word.size() > 5 && std::isdigit(static_cast<unsigned char>(word[5])) != 0);
}

/// Names of files that the run does not know of, such as those that a header names.
std::string without_other_names(const std::string& text) {
  constexpr const char* ends = " \t\n'\"(),;:=";
  std::string left;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of(ends, at), text.size());
    const std::string word = text.substr(at, end - at);
    left += has_file_ending(word) && !is_label(word) ? "FILE" + whole_ending(word) : word;
    if (end < text.size()) {
      left += text[end];
    }
    at = end + 1;
  }
  return left;
}

/// A flag and its value in one word.
std::pair<std::string, std::string> split_word(const std::string& word) {
  const std::size_t equals = word.starts_with("--") ? word.find('=') : std::string::npos;
  return equals == std::string::npos ? std::pair(std::string(), word)
                                     : std::pair(word.substr(0, equals + 1), word.substr(equals + 1));
}

bool continues_name(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'; }

/// Replaces whole words only: a file called a.ply is not within data.ply.
void replace_words(std::string& text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at)) {
    const std::size_t end = at + what.size();
    const bool whole = (at == 0 || !continues_name(text[at - 1])) &&
                       (what.back() == '/' || end == text.size() || !continues_name(text[end]));
    if (whole) {
      text.replace(at, what.size(), by);
      at += by.size();
    } else {
      ++at;
    }
  }
}

}  // namespace

void Provenance::hide_paths() {
  hides_ = true;
  for (std::size_t i = 1; i < words_.size(); ++i) {
    if (const std::string value = split_word(words_[i]).second; is_file_word(value)) {
      hide(value, "FILE" + whole_ending(value));
    }
  }
}

void Provenance::hide(const fs::path& path, const std::string& label) {
  std::error_code ignored;
  const auto add = [&](const std::string& what, const std::string& by) {
    const auto same = std::ranges::find(hidden_, what, &std::pair<std::string, std::string>::first);
    if (same != hidden_.end()) {
      same->second = by;  // an input or output is more than a FILE
    } else if (!what.empty() && what != "/" && what != "./") {
      hidden_.emplace_back(what, by);
    }
  };
  for (const fs::path& way :
       {path, fs::absolute(path, ignored).lexically_normal(), fs::weakly_canonical(path, ignored)}) {
    add(way.string(), label);
    if (way.has_parent_path()) {
      add(way.parent_path().string() + "/", "");
      if (way.parent_path().has_parent_path() && way.parent_path() != "/") {  // else it may be any word of a message
        add(way.parent_path().string(), "FOLDER");
      }
    }
  }
  add(path.filename().string(), label);
  if (path.extension() == ".part") {
    add(path.stem().string(), "FILE" + whole_ending(path.stem()));
  }
  std::ranges::stable_sort(hidden_, std::ranges::greater(), [](const auto& pair) { return pair.first.size(); });
}

void Provenance::add_input(const fs::path& path) {
  if (std::ranges::none_of(known_, [&](const Known& known) { return known.path == path; })) {
    known_.push_back({path, fmt::format("input{}{}", ++inputs_, whole_ending(path)), false});
    if (hides_) {
      hide(path, known_.back().label);
    }
  }
}

void Provenance::add_output(const fs::path& path) {
  known_.push_back({path, "OUT" + whole_ending(path), true});
  if (hides_) {
    hide(path, known_.back().label);
  }
}

std::string Provenance::label_of(const std::string& word) const {
  for (const Known& known : known_) {
    if (known.output && word == known.path.string()) {
      return known.label;
    }
    if (known.output && word == part_of(known.path).string()) {
      return known.label + ".part";
    }
  }
  return {};
}

std::string Provenance::command() const {
  std::string text;
  for (const std::string& word : words_) {
    text += (text.empty() ? "" : " ") + shell_quoted(redact(word));  // quoting may change a name
  }
  return text;
}

std::string Provenance::lasting_command() const {
  constexpr std::array<std::string_view, 4> flags{"--force", "--quiet", "--verbose", "--no-paths"};
  constexpr std::array<std::string_view, 4> with_value{"--threads", "--memory-limit", "--report", "--slab"};
  std::string text;
  for (std::size_t i = 0; i < words_.size(); ++i) {
    const auto& [flag, value] = split_word(words_[i]);
    if (std::ranges::find(with_value, words_[i]) != with_value.end()) {
      ++i;
      continue;
    }
    if (std::ranges::find(flags, words_[i]) != flags.end() ||
        std::ranges::any_of(with_value, [&](std::string_view name) { return flag == std::string(name) + "="; })) {
      continue;
    }
    const std::string label = i > 0 ? label_of(value) : "";
    text += (text.empty() ? "" : " ") + shell_quoted(label.empty() ? redact(words_[i]) : flag + label);
  }
  return text;
}

std::string Provenance::made_by() const { return fmt::format("tunica {}: {}", version, lasting_command()); }

std::string Provenance::name_of(const fs::path& path) const {
  for (const Known& known : known_) {
    if (hides_ && known.path == path) {
      return known.label;
    }
  }
  return redact(path.filename().string());
}

std::string Provenance::redact(std::string text) const {
  for (const auto& [what, by] : hidden_) {
    replace_words(text, what, by);
  }
  return hides_ ? without_other_names(text) : text;
}

}  // namespace tunica::cli
