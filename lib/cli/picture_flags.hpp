#pragma once

#include "tunica/chain/result_picture.hpp"
#include "tunica/cli/tool.hpp"

#include <optional>
#include <string>

namespace tunica::cli {

/// The picture of a result: where it goes, and what it shows.
struct PictureFlags {
  std::optional<std::filesystem::path> out;
  std::optional<std::string> colour, magnify, range;

  void declare(Tool& tool);

  /// What they ask for. @param modes  the result is modes, which have a shape but no size: the default is then their
  /// displacement, and nothing else is allowed
  /// Errors: UsageError: flags without --picture, a colour that there is not, a factor or range that is none.
  [[nodiscard]] chain::ResultPictureOptions options(bool modes) const;
};

}  // namespace tunica::cli
