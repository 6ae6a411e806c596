#include "tunica/report/detail/told_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <ranges>

namespace tunica::report {
namespace {

// The texts of a list in a stage's report; what is no text is left out, but keeps its place.
std::vector<std::string> texts(const PipelineCase& one, const char* stage, const char* key) {
  std::vector<std::string> found;
  const Json list = one.at(stage, key);
  for (const Json& text : list.is_array() ? list : Json::array()) {
    found.push_back(text.is_string() ? text.get<std::string>() : "");
  }
  return found;
}

std::string text_at(const std::vector<std::string>& list, std::size_t i) { return i < list.size() ? list[i] : ""; }

}  // namespace

std::vector<ToldWarning> told_warnings(const PipelineCase& one) {
  std::vector<ToldWarning> all;
  for (const char* stage : pipeline_stages) {
    const std::vector<std::string> warnings = texts(one, stage, "warnings");
    const std::vector<std::string> kinds = texts(one, stage, "warning_kinds");
    const std::vector<std::string> weights = texts(one, stage, "warning_weights");
    for (std::size_t i = 0; i < warnings.size(); ++i) {
      if (!warnings[i].empty()) {
        const Weight weight = text_at(weights, i) == "major" ? Weight::major : Weight::minor;
        all.push_back({stage, {weight, text_at(kinds, i), warnings[i]}});
      }
    }
  }
  std::ranges::stable_sort(all, std::greater<>(), [](const ToldWarning& told) { return told.warning.weight; });
  return all;
}

std::vector<std::string> told_notes(const PipelineCase& one) {
  std::vector<std::string> all;
  for (const char* stage : pipeline_stages) {
    for (const std::string& note : texts(one, stage, "notes")) {
      if (!note.empty()) {
        all.push_back(std::string(stage) + ": " + note);
      }
    }
  }
  return all;
}

std::string shown_kind(const std::string& kind) { return kind.empty() ? "of an older report" : kind; }

std::string kinds_in_one_line(const std::vector<ToldWarning>& warnings) {
  std::vector<std::pair<std::string, std::size_t>> counts;
  for (const ToldWarning& told : warnings) {
    const auto found = std::ranges::find(counts, told.warning.kind, &std::pair<std::string, std::size_t>::first);
    if (found == counts.end()) {
      counts.emplace_back(told.warning.kind, 1);
    } else {
      ++found->second;
    }
  }
  std::string line;
  for (const auto& [kind, count] : counts) {
    line += fmt::format("{}{} ({})", line.empty() ? "" : "; ", shown_kind(kind), count);
  }
  return line;
}

std::vector<WarningKind> kinds_of(const std::vector<std::vector<ToldWarning>>& warnings) {
  std::map<std::string, WarningKind> kinds;
  for (std::size_t i = 0; i < warnings.size(); ++i) {
    for (const ToldWarning& told : warnings[i]) {
      WarningKind& kind = kinds[told.warning.kind];
      if (kind.cases.empty()) {
        kind.example = told;
      }
      if (kind.cases.empty() || kind.cases.back() != i) {
        kind.cases.push_back(i);
      }
      kind.kind = told.warning.kind;
      kind.weight = std::max(kind.weight, told.warning.weight);
    }
  }
  std::vector<WarningKind> sorted;
  std::ranges::move(kinds | std::views::values, std::back_inserter(sorted));
  std::ranges::stable_sort(sorted, [](const WarningKind& a, const WarningKind& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.cases.size() > b.cases.size();
  });
  return sorted;
}

}  // namespace tunica::report
