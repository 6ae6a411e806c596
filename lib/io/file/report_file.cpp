#include "tunica/io/file/report_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/types.hpp"
#include "tunica/io/file/output_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <string_view>

namespace tunica {
namespace {

constexpr std::size_t largest_file = std::size_t{128} << 20;
constexpr std::size_t most_values = 20'000'000;
constexpr int deepest = 64;

Json parse_guarded(const std::filesystem::path& path, const std::string& bytes) {
  std::size_t values = 0;
  const Json::parser_callback_t guard = [&](int depth, Json::parse_event_t, Json&) {
    if (depth > deepest) {
      throw InputError(fmt::format("{}: is nested deeper than {}, no report is", path.string(), deepest));
    }
    if (++values > most_values) {
      throw InputError(fmt::format("{}: holds more than {} values, no report does", path.string(), most_values));
    }
    return true;
  };
  try {
    return Json::parse(bytes, guard);
  } catch (const Json::exception& error) {
    const std::string what = error.what();
    const std::size_t colon = what.find("] ");
    throw InputError(fmt::format("{}: is not a JSON report: {}", path.string(),
                                 colon == std::string::npos ? what : what.substr(colon + 2)));
  }
}

std::optional<long> whole_number(std::string_view text) {
  long number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

struct Search {
  ReportValues found;
  const Json* group = nullptr;  // the key ended at an object
  bool hit = false;             // some element of the lists on the way has the key
};

void follow(const Json& at, std::string_view rest, Search& search);

void follow_list(const Json& list, std::string_view rest, Search& search) {
  const std::size_t dot = std::min(rest.find('.'), rest.size());
  const std::string_view head = rest.substr(0, dot);
  const std::string_view tail = rest.substr(std::min(dot + 1, rest.size()));
  if (const auto number = whole_number(head)) {
    const long size = list.size();
    const long index = *number < 0 ? size + *number : *number;
    if (index >= 0 && index < size) {
      follow(list[index], tail, search);
    } else {
      search.found.values.emplace_back();
    }
    return;
  }
  search.found.list = true;
  for (const Json& element : list) {
    follow(element, head == "*" ? tail : rest, search);
  }
}

void follow(const Json& at, std::string_view rest, Search& search) {
  if (at.is_null()) {
    search.hit = true;
    search.found.values.emplace_back();
  } else if (at.is_array()) {
    follow_list(at, rest, search);
  } else if (rest.empty()) {
    if (at.is_object()) {
      search.group = &at;
    } else {
      search.hit = true;
      search.found.values.push_back(at);
    }
  } else if (at.is_object()) {
    // The longest name first: the name of a probe may hold dots.
    for (std::size_t end = rest.size(); end != std::string_view::npos && end > 0; end = rest.rfind('.', end - 1)) {
      const auto entry = at.find(std::string(rest.substr(0, end)));
      if (entry != at.end()) {
        follow(*entry, rest.substr(std::min(end + 1, rest.size())), search);
        return;
      }
    }
    search.found.values.emplace_back();
  } else {
    search.found.values.emplace_back();
  }
}

void collect_keys(const Json& at, const std::string& prefix, std::vector<std::string>& keys) {
  if (at.is_object()) {
    for (const auto& [name, value] : at.items()) {
      collect_keys(value, prefix.empty() ? name : prefix + "." + name, keys);
    }
  } else if (at.is_array()) {
    // The elements of a list are alike: the first stands for all.
    if (!at.empty()) {
      collect_keys(at.front(), prefix, keys);
    }
  } else if (at.is_number()) {
    keys.push_back(prefix);
  }
}

std::string listed_keys(const Report& report) {
  constexpr std::size_t most = 60;
  std::vector<std::string> keys = number_keys(report);
  const std::size_t count = keys.size();
  keys.resize(std::min(count, most));
  return fmt::format("{}{}", fmt::join(keys, ", "), count > most ? fmt::format(", and {} more", count - most) : "");
}

// ------------------------------------------------------------------------------------------------------------ probes

struct ProbeHistory {
  std::vector<double> times;  // empty, or strictly increasing
  std::vector<Vec3> displacements;

  [[nodiscard]] Vec3 at(double time) const {
    const auto next = std::ranges::upper_bound(times, time);
    if (next == times.begin()) {
      return displacements.front();
    }
    if (next == times.end()) {
      return displacements.back();
    }
    const std::size_t i = next - times.begin();
    const double part = (time - times[i - 1]) / (times[i] - times[i - 1]);
    return displacements[i - 1] + part * (displacements[i] - displacements[i - 1]);
  }
};

std::vector<double> increasing_numbers(const Json& list, std::size_t count) {
  std::vector<double> numbers;
  if (!list.is_array() || list.size() != count) {
    return {};
  }
  for (const Json& entry : list) {
    if (!entry.is_number() || (!numbers.empty() && entry.get<double>() <= numbers.back())) {
      return {};
    }
    numbers.push_back(entry.get<double>());
  }
  return numbers;
}

ProbeHistory read_probe(const Report& report, const std::string& name) {
  const Json& probe = report.json["result"]["probes"][name];
  const auto damaged = [&](const std::string& what) {
    return InputError(fmt::format("{}: probe '{}' {}; run the simulation again", report.path.string(), name, what));
  };
  ProbeHistory history;
  if (!probe.is_object() || !probe.contains("displacement_mm") || !probe["displacement_mm"].is_array()) {
    throw damaged("has no list displacement_mm");
  }
  for (const Json& entry : probe["displacement_mm"]) {
    if (!entry.is_array() || entry.size() != 3 ||
        !std::ranges::all_of(entry, [](const Json& number) { return number.is_number(); })) {
      throw damaged("has a displacement that is not three numbers");
    }
    history.displacements.emplace_back(entry[0].get<double>(), entry[1].get<double>(), entry[2].get<double>());
  }
  if (history.displacements.empty()) {
    throw damaged("has no displacements");
  }
  for (const char* key : {"time_s", "load_factor"}) {
    if (history.times.empty() && probe.contains(key)) {
      history.times = increasing_numbers(probe[key], history.displacements.size());
    }
  }
  return history;
}

// Largest distance over the times that both cover; at the end where there are no such times.
double largest_difference(const ProbeHistory& run, const ProbeHistory& reference) {
  double largest = 0;
  bool compared = false;
  if (!run.times.empty() && !reference.times.empty()) {
    const double slack = 1e-9 * std::abs(reference.times.back());
    for (std::size_t i = 0; i < run.times.size(); ++i) {
      const double time = run.times[i];
      if (time >= reference.times.front() - slack && time <= reference.times.back() + slack) {
        largest = std::max(largest, (run.displacements[i] - reference.at(time)).norm());
        compared = true;
      }
    }
  }
  return compared ? largest : (run.displacements.back() - reference.displacements.back()).norm();
}

std::vector<std::string> common_probes(const Report& run, const Report& reference) {
  std::vector<std::string> names;
  const Json& result = run.json["result"];
  const Json& other = reference.json["result"];
  if (result.contains("probes") && result["probes"].is_object() && other.contains("probes") &&
      other["probes"].is_object()) {
    for (const auto& [name, probe] : result["probes"].items()) {
      if (other["probes"].contains(name)) {
        names.push_back(name);
      }
    }
  }
  return names;
}

std::optional<double> percent_of(double difference, double scale) {
  if (difference == 0) {
    return 0;
  }
  return scale > 0 && std::isfinite(difference / scale) ? std::optional(100 * difference / scale) : std::nullopt;
}

}  // namespace

Report read_report(const std::filesystem::path& path) {
  Report report{path, path.stem().string(), parse_guarded(path, read_file(path, largest_file))};
  const Json& json = report.json;
  const auto refuse = [&](const std::string& what) {
    throw InputError(
        fmt::format("{}: is not a report of a tunica tool: {}; reports are what --report writes", path.string(), what));
  };
  if (!json.is_object()) {
    refuse("it is not a JSON object");
  }
  if (!json.contains("tool") || !json["tool"].is_string() || !report.tool().starts_with("tunica-")) {
    refuse("it has no key 'tool' with the name of a tool");
  }
  if (!json.contains("ok") || !json["ok"].is_boolean()) {
    refuse("it has no key 'ok' that is true or false");
  }
  for (const char* group : {"seconds", "result"}) {
    if (!json.contains(group) || !json[group].is_object()) {
      refuse(fmt::format("it has no group '{}'", group));
    }
  }
  return report;
}

void name_apart(std::vector<Report>& reports) {
  std::set<std::string> names;
  std::vector<std::vector<std::string>> parts;  // of the paths, without the ending
  for (const Report& report : reports) {
    names.insert(report.path.stem().string());
    const std::filesystem::path whole = std::filesystem::absolute(report.path).lexically_normal().replace_extension();
    std::vector<std::string>& list = parts.emplace_back();
    for (const std::filesystem::path& part : whole) {
      list.push_back(part.string());
    }
  }
  if (names.size() == reports.size()) {
    return;
  }
  const auto all_equal = [&](auto part_of) {
    return std::ranges::all_of(
        parts, [&](const auto& list) { return list.size() > 1 && part_of(list) == part_of(parts.front()); });
  };
  while (all_equal([](const auto& list) { return list.back(); })) {
    for (auto& list : parts) {
      list.pop_back();
    }
  }
  while (all_equal([](const auto& list) { return list.front(); })) {
    for (auto& list : parts) {
      list.erase(list.begin());
    }
  }
  for (std::size_t i = 0; i < reports.size(); ++i) {
    reports[i].name = fmt::format("{}", fmt::join(parts[i], "/"));
  }
}

ReportValues values_at(const Report& report, const std::string& key) {
  Search search;
  follow(report.json, key, search);
  if (search.hit && search.group == nullptr) {
    return search.found;
  }
  if (search.group != nullptr && !key.empty()) {
    std::vector<std::string> names;
    for (const auto& [name, value] : search.group->items()) {
      names.push_back(key + "." + name);
    }
    throw InputError(fmt::format("{}: '{}' is a group, not a value; name one of: {}", report.path.string(), key,
                                 fmt::join(names, ", ")));
  }
  throw InputError(fmt::format("{}: has no value under '{}'; the keys with numbers are: {}", report.path.string(), key,
                               listed_keys(report)));
}

std::vector<std::optional<double>> numbers_at(const Report& report, const std::string& key) {
  std::vector<std::optional<double>> numbers;
  for (const Json& value : values_at(report, key).values) {
    if (!value.is_null() && !value.is_number()) {
      throw InputError(fmt::format("{}: '{}' is {}, not a number; the keys with numbers are: {}", report.path.string(),
                                   key, value.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, 80),
                                   listed_keys(report)));
    }
    numbers.push_back(value.is_null() ? std::nullopt : std::optional(value.get<double>()));
  }
  return numbers;
}

bool has_number(const Report& report, const std::string& key) {
  Search search;
  follow(report.json, key, search);
  return search.group == nullptr &&
         std::ranges::any_of(search.found.values, [](const Json& value) { return value.is_number(); });
}

std::vector<std::string> number_keys(const Report& report) {
  std::vector<std::string> keys;
  collect_keys(report.json, {}, keys);
  // A name with dots in it may hide a number behind the same key.
  std::erase_if(keys, [&](const std::string& key) { return !has_number(report, key); });
  return keys;
}

ReferenceError error_against(const Report& run, const Report& reference) {
  const std::vector<std::string> probes = common_probes(run, reference);
  if (!probes.empty()) {
    double difference = 0;
    double scale = 0;
    for (const std::string& name : probes) {
      const ProbeHistory history = read_probe(run, name);
      const ProbeHistory truth = read_probe(reference, name);
      difference = std::max(difference, largest_difference(history, truth));
      for (const Vec3& displacement : truth.displacements) {
        scale = std::max(scale, displacement.norm());
      }
    }
    return {percent_of(difference, scale), "Error of the probes' displacement (%)"};
  }
  const auto number = [](const Report& report, const char* key) { return numbers_at(report, key).front(); };
  const char* const stress = "result.wall.membrane_p99_mpa";
  if (const char* key = "result.max_displacement_mm"; has_number(run, key) && has_number(reference, key)) {
    // At the pressure of the image nothing moves.
    if (*number(run, key) == 0 && *number(reference, key) == 0 && has_number(run, stress) &&
        has_number(reference, stress)) {
      const double truth = *number(reference, stress);
      return {percent_of(std::abs(*number(run, stress) - truth), std::abs(truth)), "Error of the membrane stress (%)"};
    }
    const double truth = *number(reference, key);
    return {percent_of(std::abs(*number(run, key) - truth), std::abs(truth)), "Error of the largest displacement (%)"};
  }
  if (const char* key = "result.hausdorff_percent.upper"; has_number(run, key) && has_number(reference, key)) {
    return {std::abs(*number(run, key) - *number(reference, key)), "Error of the distance (% of the diagonal)"};
  }
  throw InputError(
      fmt::format("{}: has neither probes nor a largest displacement nor a distance in common with the "
                  "reference {}; give --y a key that both have",
                  run.path.string(), reference.path.string()));
}

namespace {

Json value_at(const Json& object, const char* key) { return object.is_object() ? object.value(key, Json()) : Json(); }

// Tables of a scene without what belongs to a body's name or mesh: those of another resolution differ.
Json without_mesh(Json tables) {
  for (Json& table : tables) {
    if (table.is_object()) {
      table.erase("body");
      if (value_at(value_at(table, "where"), "nodes").is_array()) {
        table.erase("where");
      }
    }
  }
  return tables;
}

}  // namespace

std::vector<std::string> stated_otherwise(const Report& run, const Report& reference) {
  std::vector<std::string> found;
  const auto stated = [](const Report& report) { return report.json.value("stated", Json::object()); };
  const Json own = stated(run);
  const Json other = stated(reference);
  const auto compare = [&](const std::string& what, const Json& value, const Json& truth) {
    const auto shown = [](const Json& one) { return one.dump(-1, ' ', false, Json::error_handler_t::replace); };
    if (value != truth) {
      found.push_back(fmt::format("{} {}, {} in the reference", what, shown(value), shown(truth)));
    }
  };
  for (const char* key : {"young_mpa", "poisson", "thickness_mm", "density_kg_per_m3", "pressure_mpa", "imaged_at_mpa",
                          "law", "support", "fix"}) {
    if (own.is_object() && other.is_object() && own.contains(key) && other.contains(key)) {
      compare(key, own[key], other[key]);
    }
  }
  const Json tables = value_at(own, "scene");
  const Json other_tables = value_at(other, "scene");
  for (const char* section : {"fix", "support", "load"}) {
    if (found.empty() && tables.is_object() && other_tables.is_object()) {
      compare(fmt::format("[[{}]]", section), without_mesh(value_at(tables, section)),
              without_mesh(value_at(other_tables, section)));
    }
  }
  return found;
}

}  // namespace tunica
