// cli: what every tool's command line shares.
#pragma once

#include "tunica/chain/extract.hpp"

#include <string>

/// What values of the flags of tunica-extract mean.
namespace tunica::cli {

/// "0.5,0.5,1.25": mm, or lengths with units, per column, row and slice; one for all three. Errors: UsageError.
Vec3 parse_spacing(const std::string& text);

/// "none", "staircase" or the sigma of a Gaussian, "1.5mm". Errors: UsageError.
void take_smoothing(const std::string& text, chain::ExtractSettings& settings);

/// "above z=40mm". Errors: UsageError.
HalfSpaceNodes parse_cut(const std::string& text);

}  // namespace tunica::cli
