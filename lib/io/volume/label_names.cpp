#include "tunica/io/volume/label_names.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/volume/detail/label_table.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace tunica {
namespace fs = std::filesystem;
namespace {

using volume_format::label_error;
using volume_format::lower_case;
using volume_format::shown;
using volume_format::trimmed;

constexpr std::size_t most_bytes = std::size_t{16} << 20;

std::string read_text(const fs::path& path) {
  volume_format::ByteStream stream(path, 0, volume_format::Coding::plain);
  std::string text;
  std::size_t got = 0;
  do {
    const std::size_t size = text.size();
    text.resize(size + 65536);
    got = stream.read(text.data() + size, 65536);
    text.resize(size + got);
  } while (got > 0 && text.size() <= most_bytes);
  if (text.size() > most_bytes) {
    throw InputError(fmt::format("{}: is larger than 16 MiB: no table of labels is", path.string()));
  }
  if (text.find('\0') != std::string::npos) {
    throw InputError(fmt::format("{}: holds binary data: no table of labels does", path.string()));
  }
  return text.starts_with("\xef\xbb\xbf") ? text.substr(3) : text;
}

[[noreturn]] void throw_line(const fs::path& path, std::size_t line, const std::string& what) {
  throw InputError(fmt::format("{}:{}: {}", path.string(), line, what));
}

void add(LabelNames& names, const fs::path& path, std::size_t line, std::int64_t index, std::string_view name) {
  if (const auto why = label_error(names, name)) {
    throw_line(path, line, *why);
  }
  if (!name.empty() && lower_case(name) != "n/a") {
    names.emplace_back(static_cast<double>(index), name);
  }
}

// The text of a cell in quotes, where a separator may stand and "" is a quote (RFC 4180), and what follows it; none
// where the quotes do not close.
std::optional<std::pair<std::string, std::string_view>> quoted_cell(std::string_view rest) {
  std::string text;
  for (std::size_t at = 1; at < rest.size(); ++at) {
    if (rest[at] == '"' && !rest.substr(at + 1).starts_with('"')) {
      return std::pair(text, rest.substr(at + 1));
    }
    at += rest[at] == '"' ? 1 : 0;
    text += rest[at];
  }
  return {};
}

std::vector<std::string> cells(std::string_view line, char separator) {
  std::vector<std::string> found;
  for (bool more = true; more;) {
    std::string_view rest = line.substr(std::min(line.find_first_not_of(' '), line.size()));
    const auto quoted = rest.starts_with('"') ? quoted_cell(rest) : std::nullopt;
    rest = quoted ? quoted->second : rest;
    const std::size_t end = std::min(rest.find(separator), rest.size());
    found.push_back(quoted ? quoted->first : std::string(trimmed(rest.substr(0, end))));
    more = end < rest.size();
    line = rest.substr(std::min(end + 1, rest.size()));
  }
  return found;
}

// The column whose heading is one of these.
std::optional<std::size_t> column(const std::vector<std::string>& heads,
                                  std::initializer_list<std::string_view> known) {
  for (const std::string_view name : known) {
    const auto at = std::ranges::find_if(heads, [&](std::string_view head) { return lower_case(head) == name; });
    if (at != heads.end()) {
      return at - heads.begin();
    }
  }
  return {};
}

// A table with a heading, or none where the first line is no heading.
std::optional<LabelNames> parse_columns(const fs::path& path, std::string_view text) {
  TextScanner scanner(text);
  if (!scanner.next_line()) {
    return {};
  }
  const std::string_view first = scanner.rest();
  const char separator = first.find('\t') != std::string_view::npos ? '\t' : ',';
  const auto heads = cells(first, separator);
  const auto index_at = column(heads, {"index", "labelvalue", "voxel_value", "value", "id"});
  const auto name_at = column(heads, {"name", "labelname", "label"});
  if (!index_at || !name_at || index_at == name_at) {
    return {};
  }
  LabelNames names;
  while (scanner.next_line()) {
    const auto row = cells(scanner.rest(), separator);
    if (row.size() <= std::max(*index_at, *name_at)) {
      throw_line(path, scanner.line(), "the row is shorter than the table's heading");
    }
    TextScanner cell(row[*index_at]);
    const bool filled = cell.next_line();
    const auto index = filled ? cell.integer() : std::nullopt;
    if (!index || !cell.at_line_end()) {
      throw_line(path, scanner.line(), fmt::format("'{}' is no label value, a whole number", shown(row[*index_at])));
    }
    add(names, path, scanner.line(), *index, row[*name_at]);
  }
  return names;
}

bool is_number(std::string_view word) { return parse_number(word).has_value(); }

// The name in what follows the index on a line: in quotes, or what stands before the numbers of the colour.
std::optional<std::string_view> name_in(std::string_view rest) {
  if (const std::size_t open = rest.find('"'); open != std::string_view::npos) {
    const std::size_t close = rest.rfind('"');
    if (close == open) {
      return {};
    }
    return rest.substr(open + 1, close - open - 1);
  }
  const auto words = volume_format::words(rest);
  std::size_t numbers = 0;
  while (numbers < words.size() && numbers < 4 && is_number(words[words.size() - 1 - numbers])) {
    ++numbers;
  }
  const std::size_t count = words.size() - (numbers >= 3 ? numbers : 0);
  if (count == 0) {
    return {};
  }
  const std::string_view last = words[count - 1];
  return std::string_view(words[0].data(), last.data() + last.size() - words[0].data());
}

LabelNames parse_lines(const fs::path& path, std::string_view text) {
  LabelNames names;
  TextScanner scanner(text);
  while (scanner.next_line()) {
    if (scanner.rest().starts_with('#')) {
      continue;
    }
    const auto index = scanner.integer();
    const auto name = index ? name_in(scanner.rest()) : std::nullopt;
    if (!name) {
      throw_line(path, scanner.line(),
                 "is no line of a table of labels, 'index name' with or without a colour, or one of ITK-SNAP's");
    }
    add(names, path, scanner.line(), *index, trimmed(*name));
  }
  return names;
}

// The name of a volume's file without what says its format.
std::string stem_of(const fs::path& volume) {
  std::string name = (volume.has_filename() ? volume : volume.parent_path()).filename().string();
  for (const std::string_view ending : {".seg.nrrd", ".nii.gz", ".nii", ".nrrd", ".nhdr", ".mha", ".mhd", ".tiff",
                                        ".tif", ".hdr", ".img", ".img.gz", ".hdr.gz"}) {
    if (name.size() > ending.size() && name.ends_with(ending)) {
      return name.substr(0, name.size() - ending.size());
    }
  }
  return name;
}

}  // namespace

std::optional<std::string> volume_format::label_error(const LabelNames& names, std::string_view name) {
  constexpr std::size_t most_labels = 65536;
  constexpr std::size_t longest = 200;
  if (names.size() >= most_labels) {
    return fmt::format("names more than {} labels", most_labels);
  }
  if (name.size() > longest) {
    return fmt::format("a label's name has {} bytes, {} are possible", name.size(), longest);
  }
  if (std::ranges::any_of(name, [](unsigned char c) { return c < 0x20 || c == 0x7f; })) {
    return fmt::format("the label's name '{}' has a control character", shown(name));
  }
  return {};
}

LabelNames read_label_names(const fs::path& path) {
  const std::string text = read_text(path);
  auto names = parse_columns(path, text);
  if (!names) {
    names = parse_lines(path, text);
  }
  if (names->empty()) {
    throw InputError(fmt::format("{}: names no label", path.string()));
  }
  return std::move(*names);
}

std::vector<fs::path> label_tables_beside(const fs::path& volume) {
  const fs::path folder = (volume.has_filename() ? volume : volume.parent_path()).parent_path();
  std::vector<fs::path> found;
  for (const char* ending : {".tsv", ".ctbl", ".label", ".lut", ".txt", ".csv"}) {
    const fs::path path = folder / (stem_of(volume) + ending);
    std::error_code error;
    if (fs::is_regular_file(path, error)) {
      found.push_back(path);
    }
  }
  return found;
}

std::optional<double> find_label(const LabelNames& names, const std::string& text) {
  if (const auto value = parse_number(text)) {
    return value;
  }
  std::optional<double> found;
  for (const auto& [value, name] : names) {
    if (name != text) {
      continue;
    }
    if (found && *found != value) {
      throw InputError(
          fmt::format("'{}' is the name of two labels, {} and {}: pass the value", shown(text), *found, value));
    }
    found = value;
  }
  return found;
}

std::string nearest_label(const LabelNames& names, std::string_view text) {
  std::vector<std::string_view> near;
  for (const auto& [value, name] : names) {
    const std::size_t slack = 1 + name.size() / 4;
    if (!name.empty() && name.size() <= text.size() + slack && text.size() <= name.size() + slack) {
      near.push_back(name);
    }
  }
  return nearest(text, near);
}

}  // namespace tunica
