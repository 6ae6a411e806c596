#include "tunica/cli/picture_flags.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace tunica::cli {
namespace {

// In the order of Colouring.
constexpr std::array<std::string_view, 4> colour_names{"membrane", "stress", "displacement", "strain"};

Colouring colouring_of(const std::string& word) {
  const auto found = std::ranges::find(colour_names, word);
  if (found == colour_names.end()) {
    throw UsageError(fmt::format("--colour: there is no '{}': {}", word, suggestion(word, colour_names)));
  }
  return static_cast<Colouring>(found - colour_names.begin());
}

double range_of(const std::string& text, Colouring colour) {
  try {
    const double value = colour == Colouring::displacement ? parse_quantity(text, dimension::length)
                         : colour == Colouring::strain     ? parse_percent(text)
                                                           : parse_quantity(text, dimension::pressure);
    if (!(value > 0)) {
      throw UsageError(fmt::format("'{}' is not above zero", text));
    }
    return value;
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("--picture-range: {}", error.what()));
  }
}

}  // namespace

void PictureFlags::declare(Tool& tool) {
  CLI::App& app = tool.arguments();
  tool.group("Output");
  app.add_option("--picture", out, "picture of the loaded bodies, PNG: the last state, or the first mode")
      ->type_name("OUT.png");
  app.add_option(
         "--colour", colour,
         "what its colours show: membrane (von Mises stress, mean over the wall; the default) | stress (at either "
         "face) | displacement | strain")
      ->type_name("NAME");
  app.add_option("--magnify", magnify, "draw displacements N times as large (default 1)")->type_name("N");
  app.add_option("--picture-range", range,
                 "where its colours end, so that pictures can be compared, e.g. 200kPa, 3mm or, of strain, 5% "
                 "(default: the largest value)")
      ->type_name("VALUE");
}

chain::ResultPictureOptions PictureFlags::options(bool modes) const {
  if (!out) {
    for (const auto& [name, given] :
         {std::pair("--colour", &colour), {"--magnify", &magnify}, {"--picture-range", &range}}) {
      if (*given) {
        throw UsageError(fmt::format("{} belongs to --picture: give both", name));
      }
    }
  }
  chain::ResultPictureOptions options;
  if (modes) {
    options.colour = Colouring::displacement;
  }
  if (colour) {
    options.colour = colouring_of(*colour);
  }
  if (modes && (options.colour != Colouring::displacement || range)) {
    throw UsageError("--picture: a mode has a shape and no size, so no stress, no strain and no range");
  }
  if (magnify) {
    const auto factor = parse_number(*magnify);
    if (!factor || !(*factor > 0)) {
      throw UsageError(fmt::format("--magnify: '{}' is not a number above zero", *magnify));
    }
    options.magnify = *factor;
  }
  if (range) {
    options.range = range_of(*range, options.colour);
  }
  return options;
}

}  // namespace tunica::cli
