#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/volume/detail/label_table.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <cmath>
#include <initializer_list>
#include <set>
#include <utility>
#include <vector>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

constexpr const char* shapes =
    "its label names are wanted as {\"1\": \"aorta\"}, {\"aorta\": 1} or [{\"value\": 1, \"name\": \"aorta\"}], by "
    "themselves or under \"labels\"";

[[noreturn]] void refuse(const fs::path& path, const std::string& what) {
  throw InputError(fmt::format("{}: {}: {}", path.string(), what, shapes));
}

// A key that stands twice would be read once: which of its values was meant, nobody knows.
Json parse(const fs::path& path, std::string_view text) {
  constexpr int deepest = 16;
  std::vector<std::set<std::string>> keys;
  const Json::parser_callback_t guard = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (depth > deepest) {
      throw InputError(fmt::format("{}: is nested deeper than {}, no list of labels is", path.string(), deepest));
    }
    if (event == Json::parse_event_t::object_start) {
      keys.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      keys.pop_back();
    } else if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second) {
      throw InputError(
          fmt::format("{}: has the key '{}' twice: keep one", path.string(), shown(parsed.get<std::string>())));
    }
    return true;
  };
  try {
    return Json::parse(text, guard);
  } catch (const Json::exception& error) {
    const std::string_view what = error.what();
    const std::size_t colon = what.find("] ");
    throw InputError(fmt::format("{}: is not JSON: {}", path.string(),
                                 shown(colon == std::string_view::npos ? what : what.substr(colon + 2))));
  }
}

// The label a value means: a whole number, as such or as text.
std::optional<double> label_in(const Json& value) {
  const auto number = value.is_number()   ? std::optional(value.get<double>())
                      : value.is_string() ? parse_number(value.get<std::string>())
                                          : std::nullopt;
  return number && *number == std::floor(*number) && std::abs(*number) < 0x1p53 ? number : std::nullopt;
}

// The first of these keys that an object has.
const Json* first_of(const Json& object, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (const auto at = object.find(key); at != object.end()) {
      return &*at;
    }
  }
  return nullptr;
}

const Json* name_in(const Json& object) {
  return first_of(object, {"name", "Name", "SegmentLabel", "label_name", "labelName"});
}

class Reading {
public:
  explicit Reading(const fs::path& path) : path_(path) {}

  // A list of objects with value and name; dcmqi has a list of such lists.
  void list(const Json& labels, int depth = 0) {
    for (const Json& entry : labels) {
      if (entry.is_array() && depth < 2) {
        list(entry, depth + 1);
        continue;
      }
      const Json* value =
          entry.is_object() ? first_of(entry, {"value", "label", "id", "index", "labelID", "LabelValue", "labelValue"})
                            : nullptr;
      const Json* name = entry.is_object() ? name_in(entry) : nullptr;
      if (value == nullptr || name == nullptr) {
        refuse(path_,
               fmt::format("an entry of its list, {}, has no value or no name", shown(entry.dump().substr(0, 80))));
      }
      add(*value, *name);
    }
  }

  // Value and name, or name and value, or name and values: nnU-Net's regions.
  void object(const Json& labels) {
    for (const auto& [key, entry] : labels.items()) {
      const Json* name = entry.is_object() ? name_in(entry) : &entry;
      if (name != nullptr && name->is_string() && !label_in(*name)) {
        add(Json(key), *name);
      } else if (entry.is_array() && entry.size() == 1 && label_in(entry[0])) {
        add(entry[0], Json(key));
      } else if (entry.is_array()) {
        add_union(key, entry);
      } else if (label_in(entry)) {
        add(entry, Json(key));
      } else {
        refuse(path_, fmt::format("its entry '{}' is neither a name nor a label", shown(key)));
      }
    }
  }

  LabelNames names;
  LabelUnions unions;

private:
  void add_union(const std::string& name, const Json& values) {
    std::string text;
    for (const Json& value : values) {
      const auto label = label_in(value);
      if (!label) {
        refuse(path_, fmt::format("its entry '{}' lists {}, which is no label", shown(name),
                                  shown(value.dump().substr(0, 80))));
      }
      text += fmt::format("{}{:.0f}", text.empty() ? "" : "+", *label);
    }
    if (const auto why = label_error(names, name)) {
      throw InputError(fmt::format("{}: {}", path_.string(), *why));
    }
    if (!text.empty()) {
      unions[name] = text;
    }
  }

  void add(const Json& value, const Json& name) {
    const auto label = label_in(value);
    if (!label || !name.is_string()) {
      refuse(path_, fmt::format("{} and {} are no label and its name", shown(value.dump().substr(0, 80)),
                                shown(name.dump().substr(0, 80))));
    }
    const std::string text(trimmed(name.get<std::string>()));
    if (const auto why = label_error(names, text)) {
      throw InputError(fmt::format("{}: {}", path_.string(), *why));
    }
    if (!text.empty()) {
      names.emplace_back(*label, text);
    }
  }

  const fs::path& path_;
};

}  // namespace

LabelNames parse_label_json(const fs::path& path, std::string_view text, LabelUnions* unions) {
  const Json whole = parse(path, text);
  const Json* labels = &whole;
  if (whole.is_object()) {
    const Json* inner = first_of(whole, {"labels", "segmentAttributes"});
    labels = inner != nullptr && inner->is_structured() ? inner : labels;
  }
  Reading reading(path);
  if (labels->is_array()) {
    reading.list(*labels);
  } else if (labels->is_object()) {
    reading.object(*labels);
  } else {
    refuse(path, "is no list of labels");
  }
  if (unions != nullptr) {
    *unions = std::move(reading.unions);
  }
  return std::move(reading.names);
}

}  // namespace tunica::volume_format
