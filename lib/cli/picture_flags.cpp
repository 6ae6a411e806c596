#include "tunica/cli/picture_flags.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <tuple>

namespace tunica::cli {
namespace {

// In the order of Colouring.
constexpr std::size_t most_moments = 24;
constexpr std::array<std::string_view, 4> colour_names{"membrane", "stress", "displacement", "strain"};

Colouring colouring_of(const std::string& word) {
  const auto found = std::ranges::find(colour_names, word);
  if (found == colour_names.end()) {
    throw UsageError(fmt::format("--colour: there is no '{}': {}", word, suggestion(word, colour_names)));
  }
  return static_cast<Colouring>(found - colour_names.begin());
}

double range_of(const std::string& text, Colouring colour) {
  double value = 0;
  try {
    value = colour == Colouring::displacement ? parse_quantity(text, dimension::length)
            : colour == Colouring::strain     ? parse_percent(text)
                                              : parse_quantity(text, dimension::pressure);
  } catch (const UsageError& error) {
    throw UsageError(
        fmt::format("the colours show {}: {}", colour_names.at(static_cast<std::size_t>(colour)), error.what()));
  }
  if (!(value > 0)) {
    throw UsageError(fmt::format("'{}' is not above zero", text));
  }
  return value;
}

/// "0 0.5 1" or "0ms, 5ms".
std::vector<double> moments_of(const std::string& text, const RunSettings& run) {
  std::vector<double> moments;
  std::istringstream stream(text);
  for (std::string word; stream >> word;) {
    if (word.ends_with(',')) {
      word.pop_back();
    }
    if (std::holds_alternative<DynamicRun>(run.kind)) {
      moments.push_back(parse_quantity(word, dimension::time));
    } else if (const auto number = parse_number(word)) {
      moments.push_back(*number);
    } else {
      throw UsageError(fmt::format("'{}' is not a number", word));
    }
  }
  if (moments.empty() || moments.size() > most_moments) {
    throw UsageError(fmt::format("one to {} moments are drawn, not {}", most_moments, moments.size()));
  }
  return moments;
}

/// "y", "-y" or "z=12mm": the axis to whose side all is left away, and from where on.
std::pair<Vec3, std::optional<double>> cut_of(std::string_view text) {
  std::string_view rest = text;
  const double sign = rest.starts_with('-') ? -1 : 1;
  rest.remove_prefix(sign < 0 ? 1 : 0);
  const std::size_t axis = rest.empty() ? std::string_view::npos : std::string_view("xyz").find(rest.front());
  if (axis == std::string_view::npos || (rest.size() > 1 && rest[1] != '=')) {
    throw UsageError(fmt::format("'{}' is no axis with a place, such as y, -y or z=12mm", text));
  }
  const Vec3 normal = sign * Vec3::Unit(narrow<Eigen::Index>(axis));
  rest.remove_prefix(1);
  return {normal, rest.empty() ? std::optional<double>()
                               : sign * parse_quantity(std::string(rest.substr(1)), dimension::length)};
}

/// What `parse` makes of a flag's text. Errors: UsageError, with the flag.
template <typename Parse>
auto parsed(const char* flag, const Parse& parse) {
  try {
    return parse();
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("{}: {}", flag, error.what()));
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
         "what its colours show: the von Mises stress as mean over the wall (membrane, the default) or at either face "
         "(stress), or another field")
      ->type_name("membrane|stress|displacement|strain");
  app.add_option("--magnify", magnify, "draw displacements N times as large (default 1)")->type_name("N");
  app.add_option("--picture-range", range,
                 "where its colours end, so that pictures can be compared, e.g. 200kPa, 3mm or, of strain, 5% "
                 "(default: the largest value)")
      ->type_name("VALUE");
  app.add_option("--picture-at", at,
                 "panels of these moments, each of the nearest state written: load factors, times of a motion, numbers "
                 "of modes, e.g. '0 0.5 1' (default: the last state, from two sides)")
      ->type_name("LIST");
  app.add_option("--picture-cut", cut,
                 "cut the bodies open across an axis: what lies to its side is left away, e.g. y, -y (the other side) "
                 "or z=12mm (default place: the middle)")
      ->type_name("AXIS[=PLACE]");
}

chain::ResultPictureOptions PictureFlags::options(const RunSettings& run) const {
  if (!out) {
    for (const auto& [name, given] : {std::pair("--colour", &colour),
                                      {"--magnify", &magnify},
                                      {"--picture-range", &range},
                                      {"--picture-at", &at},
                                      {"--picture-cut", &cut}}) {
      if (*given) {
        throw UsageError(fmt::format("{} belongs to --picture: give both", name));
      }
    }
  }
  const bool modes = std::holds_alternative<FrequencyRun>(run.kind) || std::holds_alternative<BucklingRun>(run.kind);
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
    options.range = parsed("--picture-range", [&] { return range_of(*range, options.colour); });
  }
  if (at) {
    options.moments = parsed("--picture-at", [&] { return moments_of(*at, run); });
  }
  if (cut) {
    std::tie(options.cut, options.cut_at) = parsed("--picture-cut", [&] { return cut_of(*cut); });
  }
  return options;
}

}  // namespace tunica::cli
