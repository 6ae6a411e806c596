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
    circles += html("<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}><title>{}: {} {}</title></circle>", place(marks[i].value),
                    height, marks[i].outlier ? 4 : 3, marks[i].outlier ? Markup{" class=\"out\""} : Markup{},
                    marks[i].name, what.text(marks[i].value), what.unit);
  }
  return html(
      "<figure class=\"strip\"><figcaption>{0}{1}</figcaption><svg viewBox=\"0 0 320 58\" role=\"img\" "
      "aria-label=\"{0}: {2} cases from {3} to {4} {5}, median {6}\"><line class=\"axis\" x1=\"8\" x2=\"312\" "
      "y1=\"40\" "
      "y2=\"40\"/><line class=\"median\" x1=\"{7}\" x2=\"{7}\" y1=\"6\" y2=\"40\"/>{8}<text x=\"8\" y=\"54\">{3}</text>"
      "<text x=\"312\" y=\"54\" text-anchor=\"end\">{4}</text></svg></figure>\n",
      what.title, what.unit.empty() ? "" : ", " + what.unit, marks.size(), what.text(least), what.text(most), what.unit,
      what.text(middle), place(middle), circles);
}

}  // namespace tunica::report
