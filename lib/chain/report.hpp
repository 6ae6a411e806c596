#pragma once

#include "tunica/chain/compare.hpp"
#include "tunica/chain/decimate.hpp"
#include "tunica/chain/extract.hpp"
#include "tunica/chain/relax.hpp"
#include "tunica/core/json.hpp"

#include <optional>

/// What reports say of each stage, key by key (docs/report-keys.md).
namespace tunica::chain {

/// @param surface  none: every key, without a value
Json report(const std::optional<SurfaceNumbers>& surface);
Json report(const Comparison& found);
Json report(const Decimation& found);
Json report(const Relaxation& found);

}  // namespace tunica::chain
