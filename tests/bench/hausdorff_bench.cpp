// Certified Hausdorff distances beside CGAL's bounded error: interval, CPU time on one thread and wall time on two, in
// one run, taking turns. Both include building their search trees.
//
//   build/release/tests/bench/bench_hausdorff coarse.ply fine.ply [--width 1e-4] [--rounds 3]
#include "cgal_mesh.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/distance.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <functional>

using namespace tunica;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;

namespace {

struct Seconds {
  double cpu, wall;
};

Seconds time_of(const std::function<void()>& work) {
  const auto wall = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  work();
  return {static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC,
          std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count()};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void compare(const std::string& path_a, const std::string& path_b, double width, std::size_t rounds, bool with_peer) {
  const TriangleMesh a = read_mesh(path_a, 1.0, false).mesh;
  const TriangleMesh b = read_mesh(path_b, 1.0, false).mesh;
  const CgalMesh cgal_a = to_cgal<CgalMesh>(a);
  const CgalMesh cgal_b = to_cgal<CgalMesh>(b);
  const double diagonal_mm = diagonal(b);
  std::vector<double> own, own_without_mean, two, peer;
  HausdorffResult result;
  double cgal_distance = 0;
  for (std::size_t i = 0; i < rounds; ++i) {
    HausdorffOptions options;
    options.width = width * diagonal_mm;
    set_thread_count(1);
    own.push_back(time_of([&] { result = hausdorff(a, b, options); }).cpu);
    options.samples = 0;
    own_without_mean.push_back(time_of([&] { hausdorff(a, b, options); }).cpu);
    options.samples = HausdorffOptions().samples;
    set_thread_count(2);
    two.push_back(time_of([&] { hausdorff(a, b, options); }).wall);
    if (with_peer) {
      peer.push_back(
          time_of([&] {
            cgal_distance =
                CGAL::Polygon_mesh_processing::bounded_error_symmetric_Hausdorff_distance<CGAL::Sequential_tag>(
                    cgal_a, cgal_b, width * diagonal_mm);
          }).cpu);
    }
  }
  fmt::print("{} ({}) against {} ({}), width {:g} of the diagonal\n", path_a, a.triangles.size(), path_b,
             b.triangles.size(), width);
  fmt::print(
      "  tunica: {:.6f} to {:.6f} %, {:.3f} s CPU on one thread ({:.3f} s without mean and rms), {:.3f} s wall on "
      "two\n",
      100 * result.both.lower / diagonal_mm, 100 * result.both.upper / diagonal_mm, median(own),
      median(own_without_mean), median(two));
  if (with_peer) {
    fmt::print("  CGAL: {:.6f} %, {:.3f} s CPU: tunica is {:.1f} x as fast ({:.1f} x without mean and rms)\n",
               100 * cgal_distance / diagonal_mm, median(peer), median(peer) / median(own),
               median(peer) / median(own_without_mean));
  }
}

}  // namespace

int main(int argc, char** argv) {
  double width = 1e-4;
  std::size_t rounds = 3;
  bool with_peer = true;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--width" && i + 1 < argc) {
      width = std::strtod(argv[++i], nullptr);
    } else if (argument == "--rounds" && i + 1 < argc) {
      rounds = std::strtoul(argv[++i], nullptr, 10);
    } else if (argument == "--alone") {
      with_peer = false;
    } else {
      paths.push_back(argument);
    }
  }
  if (paths.size() != 2) {
    fmt::print(stderr, "bench_hausdorff A B [--width FRACTION] [--rounds N] [--alone]\n");
    return 2;
  }
  try {
    compare(paths[0], paths[1], width, rounds, with_peer);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_hausdorff: {}\n", error.what());
    return 3;
  }
}
