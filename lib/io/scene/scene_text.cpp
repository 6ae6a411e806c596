#include "tunica/io/scene/detail/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>

namespace tunica {

std::vector<std::string> lines_of(const WrittenKeys& written) {
  std::vector<std::string> lines;
  std::ranges::transform(written, std::back_inserter(lines),
                         [](const auto& key) { return fmt::format("{} = {}", key.first, key.second); });
  return lines;
}

std::string scene_text(const Scene& scene, const std::filesystem::path& file) {
  const std::filesystem::path folder =
      file.empty() ? file : std::filesystem::absolute(file).lexically_normal().parent_path();
  std::string text;
  for_each_written_table(scene, folder, [&](std::string_view section, bool repeated, const WrittenKeys& keys) {
    const std::string header = fmt::format("[{}]", section);
    text += fmt::format("{}{}\n{}\n", text.empty() ? "" : "\n", repeated ? "[" + header + "]" : header,
                        fmt::join(lines_of(keys), "\n"));
  });
  return text;
}

}  // namespace tunica
