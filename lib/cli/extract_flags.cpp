#include "tunica/cli/extract_flags.hpp"

#include "tunica/cli/scene_flags.hpp"
#include "tunica/core/quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace tunica::cli {

Vec3 parse_spacing(const std::string& text) {
  std::vector<double> values;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    const auto number = parse_number(word);
    values.push_back(number ? *number : parse_quantity(word, dimension::length));
    begin = end + 1;
  }
  if (values.size() == 1) {
    values.resize(3, values.front());
  }
  if (values.size() != 3 || !(*std::min_element(values.begin(), values.end()) > 0)) {
    throw UsageError(
        fmt::format("--spacing: '{}' is not three lengths above 0: write --spacing X,Y,Z in mm, for example "
                    "--spacing 0.5,0.5,1.25",
                    text));
  }
  return {values[0], values[1], values[2]};
}

void take_smoothing(const std::string& text, chain::ExtractSettings& settings) {
  settings.staircase = text == "staircase";
  if (text == "none" || settings.staircase) {
    return;
  }
  try {
    settings.sigma = parse_quantity(text, dimension::length);
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--smooth: {}; or write none or staircase", error.what()));
  }
  if (!(*settings.sigma > 0)) {
    throw UsageError(fmt::format("--smooth: sigma has to be above 0, '{}' is not", text));
  }
}

HalfSpaceNodes parse_cut(const std::string& text) {
  const auto half = parse_half_space(text, "--cut");
  if (!half) {
    throw UsageError(fmt::format("--cut: '{}' is not understood: write 'above z=40mm' or 'below x=-2cm'", text));
  }
  return *half;
}

}  // namespace tunica::cli
