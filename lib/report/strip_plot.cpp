#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica::report {

Markup strip_plot(const Measure& what, const std::vector<StripMark>& marks) {
  if (marks.empty()) {
    return {};
  }
  constexpr double left = 8;
  constexpr double width = 304;
  std::vector<double> values;
  for (const StripMark& mark : marks) {
    values.push_back(mark.value);
  }
  const auto [least, most] = std::ranges::minmax(values);
  const double middle = median(values);
  const auto place = [&](double value) {
    return fmt::format("{:.1f}", left + width * (most > least ? (value - least) / (most - least) : 0.5));
  };
  Markup circles;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    // Marks of equal values stay apart: seven lanes, taken in turn.
    const auto height = static_cast<int>(12 + 3 * ((i * 3) % 7));
    circles += part("mark", {{"x", place(marks[i].value)},
                             {"y", height},
                             {"radius", marks[i].outlier ? 4 : 3},
                             {"class", Markup{marks[i].outlier ? " class=\"out\"" : ""}},
                             {"name", marks[i].name},
                             {"value", what.text(marks[i].value)},
                             {"unit", what.unit}});
  }
  return part("strip", {{"title", what.title},
                        {"comma_unit", what.unit.empty() ? "" : ", " + what.unit},
                        {"cases", marks.size()},
                        {"least", what.text(least)},
                        {"most", what.text(most)},
                        {"unit", what.unit},
                        {"median", what.text(middle)},
                        {"x", place(middle)},
                        {"marks", circles}});
}

}  // namespace tunica::report
