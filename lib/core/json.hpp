#pragma once

#include <nlohmann/json.hpp>

namespace tunica {

/// Keys keep the order in which they were written: a report reads in the order of the work.
using Json = nlohmann::ordered_json;

}  // namespace tunica
