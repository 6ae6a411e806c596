#include "tunica/io/volume/label_names.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/volume/detail/label_table.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

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
  return volume_format::to_utf8(path, std::move(text));
}

[[noreturn]] void throw_line(const fs::path& path, std::size_t line, const std::string& what) {
  throw InputError(fmt::format("{}:{}: {}", path.string(), line, what));
}

void add(LabelNames& names, const fs::path& path, std::size_t line, double label, std::string_view name) {
  if (const auto why = label_error(names, name)) {
    throw_line(path, line, *why);
  }
  if (!name.empty() && lower_case(name) != "n/a") {
    names.emplace_back(label, name);
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

struct Cell {
  std::string text;
  std::size_t begin = 0;  // in the line
  std::size_t end = 0;
};

std::vector<Cell> cells(std::string_view line, char separator) {
  std::vector<Cell> found;
  std::size_t begin = 0;
  for (bool more = true; more;) {
    std::string_view rest = line.substr(std::min(line.find_first_not_of(' ', begin), line.size()));
    const auto quoted = rest.starts_with('"') ? quoted_cell(rest) : std::nullopt;
    rest = quoted ? quoted->second : rest;
    const std::size_t length = std::min(rest.find(separator), rest.size());
    const std::size_t end = line.size() - rest.size() + length;
    found.push_back({quoted ? quoted->first : std::string(trimmed(rest.substr(0, length))), begin, end});
    more = end < line.size();
    begin = end + 1;
  }
  return found;
}

// A number or a colour as #rrggbb: no part of a name.
bool is_data(std::string_view text) {
  return text.empty() || text.starts_with('#') || parse_number(text).has_value() || lower_case(text) == "n/a";
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

struct Columns {
  char separator = ',';
  std::size_t count = 0;
  std::size_t index = 0;
  std::size_t name = 0;
  std::optional<std::size_t> other;  // a column beside "index" that may hold the labels' values as well
};

// The columns of a table's heading; none where the line is no heading.
std::optional<Columns> columns_of(std::string_view heading) {
  for (const char separator : {'\t', ';', ','}) {
    std::vector<std::string> heads;
    for (Cell& cell : cells(heading, separator)) {
      heads.push_back(std::move(cell.text));
    }
    const auto name =
        column(heads, {"name", "labelname", "label_name", "structure", "structure_name", "region", "organ", "label"});
    const auto index = column(heads, {"index", "labelvalue", "label_value", "voxel_value", "value", "id", "labelid",
                                      "label_id", "label id", "label"});
    if (index && name && index != name) {
      const auto other = lower_case(heads[*index]) == "index"
                             ? column(heads, {"labelvalue", "label_value", "voxel_value", "value", "label"})
                             : std::nullopt;
      return Columns{separator, heads.size(), *index, *name, other == name ? std::nullopt : other};
    }
  }
  return {};
}

std::optional<double> whole_number(std::string_view text) {
  const auto number = parse_number(text);
  return number && *number == std::floor(*number) && std::abs(*number) < 0x1p53 ? number : std::nullopt;
}

// What a row says under the two columns. Cells too many are of a name with the separator in it, where the row leaves no
// doubt: what stands behind the name is numbers and colours.
std::pair<std::string, std::string> index_and_name(const fs::path& path, std::size_t number, std::string_view line,
                                                   const Columns& columns) {
  std::vector<Cell> row = cells(line, columns.separator);
  while (row.size() > columns.count && row.back().text.empty()) {
    row.pop_back();
  }
  if (row.size() <= std::max(columns.index, columns.name)) {
    throw_line(path, number, "the row is shorter than the table's heading");
  }
  const std::size_t surplus = row.size() - std::min(row.size(), columns.count);
  const Cell& last = row[columns.name + surplus];
  const bool clear = std::all_of(row.begin() + static_cast<std::ptrdiff_t>(columns.name + surplus + 1), row.end(),
                                 [](const Cell& cell) { return is_data(cell.text); });
  if (surplus > 0 && (!clear || columns.separator == '\t')) {
    throw_line(path, number,
               fmt::format("the row has {} cells between '{}', the heading {}: put a name with '{}' in it in quotes",
                           row.size(), columns.separator == '\t' ? "tab" : std::string(1, columns.separator),
                           columns.count, columns.separator == '\t' ? "tab" : std::string(1, columns.separator)));
  }
  const std::size_t begin = row[columns.name].begin;
  return {row[columns.index + (columns.index > columns.name ? surplus : 0)].text,
          surplus > 0 ? std::string(trimmed(line.substr(begin, last.end - begin))) : row[columns.name].text};
}

// A column "index" may count the rows, as spreadsheets and data frames do.
void require_agreement(const fs::path& path, std::size_t number, const std::vector<Cell>& row, const Columns& columns) {
  if (!columns.other || row.size() <= std::max(columns.index, *columns.other)) {
    return;
  }
  const auto index = whole_number(row[columns.index].text);
  const auto other = whole_number(row[*columns.other].text);
  if (index && other && *index != *other) {
    throw_line(path, number,
               fmt::format("the column \"index\" says {}, another one {}: leave one column with the labels' values",
                           *index, *other));
  }
}

// A table with a heading, or none where the first line is no heading.
std::optional<LabelNames> parse_columns(const fs::path& path, std::string_view text) {
  TextScanner scanner(text);
  const auto columns = scanner.next_line() ? columns_of(scanner.rest()) : std::nullopt;
  if (!columns) {
    return {};
  }
  LabelNames names;
  while (scanner.next_line()) {
    const auto [index, name] = index_and_name(path, scanner.line(), scanner.rest(), *columns);
    const auto label = whole_number(index);
    if (!label) {
      throw_line(path, scanner.line(), fmt::format("'{}' is no label value, a whole number", shown(index)));
    }
    require_agreement(path, scanner.line(), cells(scanner.rest(), columns->separator), *columns);
    add(names, path, scanner.line(), *label, name);
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

// "1;aorta" or "1,aorta,255,0,0" of a table without a heading.
std::optional<std::pair<double, std::string>> separated(std::string_view line) {
  const std::size_t at = line.find_first_of(",;");
  const auto index = at == std::string_view::npos ? std::nullopt : whole_number(trimmed(line.substr(0, at)));
  if (!index) {
    return {};
  }
  const std::string_view rest = line.substr(at + 1);
  std::vector<Cell> row = cells(rest, line[at]);
  while (row.size() > 1 && is_data(row.back().text)) {
    row.pop_back();
  }
  const std::string name = row.size() == 1 ? row[0].text : std::string(trimmed(rest.substr(0, row.back().end)));
  return is_data(name) ? std::nullopt : std::optional(std::pair(*index, name));
}

LabelNames parse_lines(const fs::path& path, std::string_view text) {
  LabelNames names;
  TextScanner scanner(text);
  while (scanner.next_line()) {
    const std::string_view line = scanner.rest();
    if (line.starts_with('#')) {
      continue;
    }
    if (const auto row = separated(line)) {
      add(names, path, scanner.line(), row->first, row->second);
      continue;
    }
    const auto index = scanner.integer();
    const auto name = index ? name_in(scanner.rest()) : std::nullopt;
    if (!name) {
      throw_line(path, scanner.line(),
                 "is no line of a table of labels, 'index name' with or without a colour, or one of ITK-SNAP's; with "
                 "tabs, commas or semicolons between its columns a table begins with their names, index and name");
    }
    add(names, path, scanner.line(), real(*index), trimmed(*name));
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

LabelNames read_label_names(const fs::path& path, LabelUnions* unions) {
  const std::string text = read_text(path);
  const std::string_view content = trimmed(text);
  std::optional<LabelNames> names;
  if (content.starts_with('{') || content.starts_with('[')) {
    names = volume_format::parse_label_json(path, text, unions);
  } else {
    names = parse_columns(path, text);
  }
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
    const std::size_t digits = text.find_first_not_of("+-0");
    const bool whole = digits != std::string::npos && text.find_first_not_of("0123456789", digits) == std::string::npos;
    if (!std::isfinite(*value) || (whole && fmt::format("{:.0f}", std::abs(*value)) != text.substr(digits))) {
      throw InputError(
          fmt::format("the label {} and its neighbours become the same number, as most above 2^53 do: give the labels "
                      "smaller numbers",
                      shown(text)));
    }
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

std::optional<Warning> several_names(const fs::path& path, const LabelNames& names) {
  std::map<double, std::set<std::string>> names_of;
  for (const auto& [value, name] : names) {
    names_of[value].insert(name);
  }
  for (const auto& [value, name] : names) {
    if (const auto number = parse_number(name); number && *number != value && names_of.contains(*number)) {
      return Warning{Weight::minor, "several names",
                     fmt::format("{}: the label {} is called '{}', which is another label's number: that one is taken "
                                 "where it is asked for; give the label a name in letters",
                                 path.string(), value, shown(name))};
    }
  }
  constexpr std::size_t most = 3;
  std::string labels;
  std::size_t count = 0;
  for (const auto& [value, all] : names_of) {
    if (all.size() > 1 && ++count <= most) {
      labels += fmt::format("{}{} is called '{}' and '{}'", labels.empty() ? "" : ", ", value, shown(*all.begin()),
                            shown(*std::next(all.begin())));
    }
  }
  if (count == 0) {
    return {};
  }
  return Warning{Weight::minor, "several names",
                 fmt::format("{}: the label {}{}: either name takes the same voxels, so a surface may be of another "
                             "organ than its name says; give each label one name",
                             path.string(), labels, count > most ? fmt::format(" (and {} more)", count - most) : "")};
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
