#include "tunica/chain/label_choice.hpp"

#include "tunica/chain/volume_contents.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace tunica::chain {
namespace {

std::string without_blanks(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' ');
  return first == std::string_view::npos ? "" : std::string(text.substr(first, text.find_last_not_of(' ') - first + 1));
}

bool is_label(const LabelNames& names, const std::string& text) {
  const auto value = find_label(names, text);
  return value && *value != 0;
}

/// A text cut at those '+' between which labels stand; without cuts where that cannot be.
std::vector<std::string> parts_of(const LabelNames& names, const std::string& text) {
  std::vector<std::size_t> cuts;  // where parts may begin and, one before, end
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (at == 0 || text[at - 1] == '+') {
      cuts.push_back(at);
    }
  }
  cuts.push_back(text.size() + 1);
  const std::size_t last = cuts.size() - 1;
  const auto part = [&](std::size_t from, std::size_t to) {
    return without_blanks(std::string_view(text).substr(cuts[from], cuts[to] - 1 - cuts[from]));
  };
  // From the end: the first cut after each one, so that labels stand from there on.
  std::vector<std::size_t> next(cuts.size(), 0);
  for (std::size_t from = last; from-- > 0;) {
    for (std::size_t to = from + 1; to <= last && next[from] == 0; ++to) {
      if ((to == last || next[to] != 0) && is_label(names, part(from, to))) {
        next[from] = to;
      }
    }
  }
  std::vector<std::string> parts;
  for (std::size_t at = 0; at < last && next[0] != 0; at = next[at]) {
    parts.push_back(part(at, next[at]));
  }
  return parts;
}

/// The first part between two '+' that is no label.
std::string no_label_in(const LabelNames& names, const std::string& text) {
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('+', begin), text.size());
    const std::string part = without_blanks(std::string_view(text).substr(begin, end - begin));
    if (part.empty()) {
      throw UsageError(fmt::format(
          "--label: '{}' has nothing beside a '+': write a label's value or name on either side", printable(text)));
    }
    if (!is_label(names, part)) {
      return part;
    }
    begin = end + 1;
  }
  return text;
}

}  // namespace

void LabelTables::read(const std::filesystem::path& volume, const std::optional<std::filesystem::path>& named,
                       const Context& context) {
  if (named) {
    context.reads(*named);
    given_ = read_label_names(*named, &unions_);
    if (const auto several = several_names(*named, given_)) {
      context.warn(*several);
    }
    return;
  }
  for (const std::filesystem::path& table : label_tables_beside(volume)) {
    try {
      context.reads(table);
      beside_ = read_label_names(table);
      if (const auto several = several_names(table, beside_)) {
        context.warn(*several);
      }
      return;
    } catch (const InputError& error) {
      context.warn({Weight::minor, "label table",
                    fmt::format("{}; left out, the volume's labels have no names of it", error.what())});
    }
  }
}

std::pair<std::optional<LabelChoice>, std::string> choose_labels(const LabelNames& names, const std::string& text) {
  std::vector<std::string> parts;
  if (is_label(names, text)) {
    parts.push_back(text);
  } else if (text.find('+') != std::string::npos) {
    parts = parts_of(names, text);
    if (parts.empty()) {
      return {std::nullopt, no_label_in(names, text)};
    }
  } else {
    return {std::nullopt, text};
  }
  LabelChoice choice;
  std::string listed;
  for (const std::string& part : parts) {
    const double value = find_label(names, part).value();
    if (std::ranges::find(choice.values, value) != choice.values.end()) {
      continue;
    }
    const auto at = std::ranges::find(names, value, [](const auto& label) { return label.first; });
    const std::string name = !parse_number(part) ? part : at == names.end() ? "" : at->second;
    listed += (choice.values.empty() ? "" : " + ") + named({value, 0, 0, name});
    choice.in_file_name += fmt::format("{}{}", choice.values.empty() ? "" : "+", value);
    choice.values.push_back(value);
    choice.texts.push_back(part);
  }
  choice.name = (choice.values.size() > 1 ? "labels " : "label ") + listed;
  return {std::move(choice), ""};
}

LabelSelection::LabelSelection(LabelChoice choice, const Volume& header)
    : choice_(std::move(choice)), mask_(header.dims, header.affine), voxels_(choice_.values.size()) {}

void LabelSelection::add(const Volume& slab, std::size_t first_slice) {
  if (choice_.values.size() == 1) {
    select(slab, first_slice, {Inside::Rule::label, choice_.values[0]}, mask_);
    return;
  }
  for (std::size_t i = 0; i < choice_.values.size(); ++i) {
    const Mask one = select(slab, {Inside::Rule::label, choice_.values[i]});
    voxels_[i] += count_voxels(one);
    const std::size_t words = one.words_per_row() * one.dims()[1] * one.dims()[2];
    std::uint64_t* const to = mask_.row(0, first_slice);
    std::transform(to, to + words, one.row(0, 0), to, [](std::uint64_t a, std::uint64_t b) { return a | b; });
  }
}

std::string LabelSelection::absent() const {
  for (std::size_t i = 0; i < voxels_.size() && voxels_.size() > 1; ++i) {
    if (voxels_[i] == 0) {
      return choice_.texts[i];
    }
  }
  return "";
}

}  // namespace tunica::chain
