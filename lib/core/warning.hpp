#pragma once

#include <string>
#include <vector>

namespace tunica {

/// How far an answer may be off for what is warned of.
enum class Weight {
  note,   ///< not at all: something was done or assumed that nearly always is right, and may be of interest
  minor,  ///< somewhat: by tens of per cent, or in one place, or in one of the answers
  major,  ///< altogether: another organ, side, size or state than was meant
};

/// What a user has to know of a run that went on. It is printed, stands in the report, and is counted over a cohort.
struct Warning {
  Weight weight = Weight::minor;
  std::string kind;  ///< words that are the same in every run, such as "thick wall": cohorts count by them
  std::string text;  ///< a plain sentence: where, what may be off, by how much, and what to do
};

/// The sentences alone.
inline std::vector<std::string> texts_of(const std::vector<Warning>& warnings) {
  std::vector<std::string> texts;
  for (const Warning& warning : warnings) {
    texts.push_back(warning.text);
  }
  return texts;
}

}  // namespace tunica
