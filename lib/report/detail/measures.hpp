#pragma once

#include "tunica/report/detail/case_report.hpp"

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tunica::report {

/// A number of a case: a column of the table.
struct Measure {
  std::string key;          ///< in the TSV, the unit last
  std::string title;        ///< in the page
  std::string unit;         ///< empty: none
  std::string description;  ///< one sentence
  std::string source;       ///< where it comes from: stage and key
  bool compared = false;    ///< shown as a strip, and searched for outliers
  std::function<std::optional<double>(const PipelineCase&)> value;
  bool is_bound = false;  ///< certainly not passed: rounded up

  /// A value for people: whole where it has no unit, else three digits.
  [[nodiscard]] std::string text(double of) const;
};

/// Cases of a label, for outliers to be told.
constexpr std::size_t fewest_compared = 5;

/// All, in the order of the columns.
const std::vector<Measure>& measures();

/// By its key. Errors: TUNICA_ASSERT where there is none.
const Measure& measure(const std::string& key);

/// Whether an accuracy that was asked for put other shells in the place of those that relax left.
bool is_refitted(const PipelineCase& one);

/// A value among those of a cohort that does not belong to them.
struct Outlier {
  std::size_t index = 0;  ///< of the value
  double z = 0;           ///< robust, signed
};

/// Values whose robust z, 0.6745 (x - median) / MAD, is beyond 3.5 either way. Undefined values take no part. The MAD
/// counts as 1 % of the median at least: values of one target, such as least angles, differ by less for no reason.
/// @return none for fewer than five values, or where more than half of them are 0 (MAD = 0)
/// Source: Iglewicz, Hoaglin, How to detect and handle outliers, 1993.
std::vector<Outlier> outliers(std::span<const std::optional<double>> values);

/// The middle value, or the mean of the two in the middle. @param values  at least one
double median(std::vector<double> values);

}  // namespace tunica::report
