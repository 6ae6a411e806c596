#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <string_view>

namespace tunica::test {

/// A folder of its own for a test, removed at its end.
class TemporaryFolder {
public:
  TemporaryFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "tunica-test-XXXXXX").string();
    EXPECT_NE(::mkdtemp(pattern.data()), nullptr);
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  /// Writes a file of that name. @return its path.
  std::filesystem::path file(const std::string& name, std::string_view bytes) const {
    std::error_code ignored;
    std::filesystem::remove(path_ / name, ignored);  // ext4 flushes a file that is cut and written again: 5 ms each
    write(path_ / name, bytes);
    keep_as_seed(name, bytes);
    return path_ / name;
  }

private:
  static void write(const std::filesystem::path& path, std::string_view bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  // What readers' tests read is what fuzzing starts from: see tests/fuzz/fuzz.py.
  static void keep_as_seed(const std::string& name, std::string_view bytes) {
    const char* seeds = std::getenv("TUNICA_SEEDS");
    const std::string ending = std::filesystem::path(name).extension();
    if (seeds != nullptr && !ending.empty()) {
      const std::filesystem::path folder = std::filesystem::path(seeds) / ending.substr(1);
      std::filesystem::create_directories(folder);
      write(folder / std::to_string(std::hash<std::string_view>()(bytes)), bytes);
    }
  }

  std::filesystem::path path_;
};

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

}  // namespace tunica::test
