#pragma once

#include <nlohmann/json.hpp>

#include <optional>

namespace tunica {

/// Keys keep the order in which they were written: a report reads in the order of the work.
using Json = nlohmann::ordered_json;

/// A value that may be undefined: then null.
template <typename Value>
Json or_null(const std::optional<Value>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace tunica
