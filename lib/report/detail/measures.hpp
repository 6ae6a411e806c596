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
  bool is_bound = false;   ///< certainly not passed: rounded up
  std::string input = {};  ///< in the report's `stated.typed`, as the user wrote it; empty: it is none

  /// A value for people: whole where it has no unit, else three digits.
  [[nodiscard]] std::string text(double of) const;
};

/// Cases of a label, among which outliers are marked.
constexpr std::size_t fewest_compared = 5;

/// All, in the order of the columns.
const std::vector<Measure>& measures();

/// By its key. Errors: TUNICA_ASSERT where there is none.
const Measure& measure(const std::string& key);

/// The value of a measure with its unit, empty where it is not known: an input in the unit in which it was stated, with
/// its value in the measure's unit in parentheses, where that is another: "120 mmHg (16.0 kPa)".
std::string shown(const PipelineCase& one, const std::string& key);

/// What a run for an accuracy came to.
struct Reached {
  std::string of;                 ///< "stress"; of a probe "displacement of NAME along x"
  std::string value;              ///< with its unit
  std::optional<double> percent;  ///< the estimated error; none: no estimate
  double asked = 0;               ///< percent

  /// "stress 159 kPa, estimated error 12 %, 5 % asked".
  [[nodiscard]] std::string text() const;
};

/// None where no accuracy was asked for, or no level was solved.
std::optional<Reached> accuracy_reached(const PipelineCase& one);

/// Whether a run answers under its whole load, and only the accuracy that was asked for was not reached.
bool is_inaccurate(const PipelineCase& one);

/// Whether there is an answer: a run that came to its end, or an inaccurate one.
bool is_answered(const PipelineCase& one);

/// Whether an accuracy that was asked for put other shells in the place of those that relax left.
bool is_refitted(const PipelineCase& one);

/// Whether these are there under their own name: an inaccurate run leaves a partial file.
bool has_refined_shells(const PipelineCase& one);

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

/// Whether the wall rests under the pressure of the image where that shows it: that nothing moves is no finding.
bool rests_as_imaged(const PipelineCase& one);

}  // namespace tunica::report
