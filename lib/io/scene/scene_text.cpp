#include "tunica/io/scene/detail/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace tunica {

std::string scene_text(const Scene& scene, const std::filesystem::path& file) {
  const std::filesystem::path folder =
      file.empty() ? file : std::filesystem::absolute(file).lexically_normal().parent_path();
  const Writing to{&scene, folder};
  std::string text;
  const auto write = [&](const std::string& header, const auto& keys, const auto& item) {
    text += fmt::format("{}{}\n{}\n", text.empty() ? "" : "\n", header, fmt::join(written_keys(keys, item, to), "\n"));
  };
  write("[run]", scene_schema().run, scene);
  for_each_section(scene, [&](std::string_view section, const auto& keys, const auto& items) {
    for (const auto& item : items) {
      write(fmt::format("[[{}]]", section), keys, item);
    }
  });
  if (scene.accuracy) {
    write("[accuracy]", scene_schema().accuracy, *scene.accuracy);
  }
  return text;
}

}  // namespace tunica
