// Times the extraction of surfaces from a volume in memory to an indexed mesh in memory, one run per line of its input,
// so that tests/bench/extract_bench.py can run a peer in turn with it.
//
//   bench_extract VOLUME < requests       a request: label|above|below VALUE THREADS
//   each answer: wall ms, processor ms of all threads, triangles
#include "tunica/core/threads.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <map>
#include <string>

namespace {

double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace tunica;
  if (argc != 2) {
    fmt::print(stderr, "usage: bench_extract VOLUME < requests; a request: label|above|below VALUE THREADS\n");
    return 2;
  }
  const Volume volume = read_volume(argv[1]).volume;
  const std::map<std::string, Inside::Rule> rules{
      {"label", Inside::Rule::label}, {"above", Inside::Rule::above}, {"below", Inside::Rule::below}};
  std::string rule;
  double value = 0;
  std::size_t threads = 1;
  while (std::cin >> rule >> value >> threads) {
    set_thread_count(threads);
    const double processor = processor_ms();
    const auto wall = std::chrono::steady_clock::now();
    const TriangleMesh mesh = marching_cubes(volume, {rules.at(rule), value});
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - wall;
    fmt::print("{:.3f} {:.3f} {}\n", elapsed.count(), processor_ms() - processor, mesh.triangles.size());
    std::fflush(stdout);
  }
  return 0;
}
