#pragma once

#include "tunica/chain/result_picture.hpp"
#include "tunica/cli/tool.hpp"

#include <optional>
#include <string>

namespace tunica::cli {

/// The picture of a result: where it goes, and what it shows.
struct PictureFlags {
  std::optional<std::filesystem::path> out;
  std::optional<std::string> colour, magnify, range, at, cut;

  void declare(Tool& tool);

  /// What they ask for of a run. Modes have a shape but no size: the default is their displacement, and nothing else is
  /// allowed. Errors: UsageError: flags without --picture, a colour that there is not, a factor, range, moment or cut
  /// that is none.
  [[nodiscard]] chain::ResultPictureOptions options(const RunSettings& run) const;
};

}  // namespace tunica::cli
