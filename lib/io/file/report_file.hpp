#pragma once

#include "tunica/core/json.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

/// The JSON record that a tool wrote about one run.
struct Report {
  std::filesystem::path path;
  std::string name;  ///< for marks and legends: the file's name without ending, see name_apart()
  Json json;         ///< an object with at least `tool` (string), `ok` (bool), `seconds` and `result` (objects)

  [[nodiscard]] std::string tool() const { return json.at("tool").get<std::string>(); }
  [[nodiscard]] bool ok() const { return json.at("ok").get<bool>(); }
};

/// Names the reports of one chart: by their files' names, or, where two are the same, by the folders in which their
/// paths differ ("aneurysm" for out/aneurysm/1/relax.json beside out/tube/1/relax.json).
void name_apart(std::vector<Report>& reports);

/// Reads a report. Errors: InputError naming the file: missing, over 128 MiB, not JSON (or with NaN), nested deeper
/// than 64, more than 20 million values, not a report of a tunica tool.
Report read_report(const std::filesystem::path& path);

/// What stands under a key.
struct ReportValues {
  std::vector<Json>
      values;         ///< numbers, strings, booleans or null; null also where one element of a list lacks the key
  bool list = false;  ///< the key led through a list: one value per element
};

/// Looks up a dotted key, e.g. `result.hausdorff_percent.upper`. A key through a list gives the values of all its
/// elements (`result.iterations.seconds`), a number picks one (`result.iterations.-1.seconds`: the last), `*` all.
/// Errors: InputError naming the file and the keys there are, when the key is missing or names a group.
ReportValues values_at(const Report& report, const std::string& key);

/// values_at() as numbers, none for null. Errors: InputError, also when a value is a text or a boolean.
std::vector<std::optional<double>> numbers_at(const Report& report, const std::string& key);

/// Whether the key leads to at least one number.
bool has_number(const Report& report, const std::string& key);

/// The dotted keys that lead to numbers, in the report's order.
std::vector<std::string> number_keys(const Report& report);

/// The error of `run` in percent, taken against a finer run, and what it is of.
struct ReferenceError {
  std::optional<double> percent;  ///< none where the reference is zero and the run is not
  std::string quantity;           ///< for the label of an axis
};

/// Compares two runs of one case: by the probes that both have (largest distance between their displacements over the
/// times that both cover, against the largest displacement of the reference's probes), else by the largest
/// displacement, where neither moves by the membrane stress of the wall, else by the upper bound of the distance (in
/// percent of the diagonal).
/// Errors: InputError when the reports have none of these in common, or damaged probes.
ReferenceError error_against(const Report& run, const Report& reference);

/// What two simulations state otherwise of wall, load and supports: their difference is then no error. Each as
/// "young_mpa 2.0, 3.0 in the reference". Empty where one of them states nothing, as other tools.
std::vector<std::string> stated_otherwise(const Report& run, const Report& reference);

}  // namespace tunica
