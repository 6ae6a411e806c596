// Runs a harness without libFuzzer: on files, and on damaged copies of each, the same ones every time.
#include "support/mutate.hpp"

#include <sanitizer/common_interface_defs.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

namespace fs = std::filesystem;

constexpr unsigned most_seconds = 10;  // for one input, as in real fuzzing

// What is being read: told, and kept in a file, when that ends the process.
std::string running;
std::string input;

void tell() {
  std::fprintf(stderr, "while reading %s, kept as failed-input\n", running.c_str());
  std::ofstream("failed-input", std::ios::binary).write(input.data(), static_cast<std::streamsize>(input.size()));
}

extern "C" void end_on(int signal) {
  tell();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void run(std::string bytes, std::string name) {
  input = std::move(bytes);
  running = std::move(name);
  ::alarm(most_seconds);
  // A copy of exactly that size, so that a sanitizer sees what is read behind its end.
  const std::vector<std::uint8_t> exact(input.begin(), input.end());
  (void)LLVMFuzzerTestOneInput(exact.data(), exact.size());
  ::alarm(0);
}

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);
  return files;
}

}  // namespace

// As much memory as libFuzzer allows; a harness may say otherwise.
extern "C" __attribute__((weak)) const char* __asan_default_options() {
  return "max_allocation_size_mb=2048:hard_rss_limit_mb=2048";
}

// usage: fuzz_PARSER COPIES FOLDER...
int main(int count, char** arguments) {
  std::uint64_t copies = 0;
  const std::string_view number = count > 1 ? arguments[1] : "";
  if (count < 3 || std::from_chars(number.data(), number.data() + number.size(), copies).ec != std::errc()) {
    std::fprintf(stderr, "usage: %s COPIES FOLDER...: runs the files there and so many damaged copies of each\n",
                 arguments[0]);
    return 2;
  }
  for (const int signal : {SIGABRT, SIGALRM}) {
    std::signal(signal, end_on);
  }
  __sanitizer_set_death_callback(tell);
  std::size_t files = 0, runs = 0;
  for (int i = 2; i < count; ++i) {
    for (const fs::path& path : files_in(arguments[i])) {
      std::ostringstream text;
      text << std::ifstream(path, std::ios::binary).rdbuf();
      const std::string whole = text.str();
      run(whole, path.string());
      for (std::uint64_t seed = 0; seed < copies; ++seed) {
        run(tunica::test::mutate(whole, seed), path.string() + ", damaged copy " + std::to_string(seed));
      }
      ++files;
      runs += 1 + copies;
    }
  }
  std::printf("%zu files, %zu executions\n", files, runs);
  return files > 0 ? 0 : 1;  // without seeds nothing was tried
}
