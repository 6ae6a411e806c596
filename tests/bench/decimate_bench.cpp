// Decimation beside CGAL's Garland-Heckbert planes (with its bound on the change of normals, as its manual has it) and,
// where it was found, beside meshoptimizer: error, shape and CPU time at the same counts, in one run, one thread,
// taking turns.
//
//   build/release/tests/bench/bench_decimate aneurysm_tube.ply:772,1200 bumpy.ply:100000 [--angle 20] [--rounds 3]
//   [--alone]
//
// Prints a line per mesh and count: two-sided certified distance in % of the diagonal, smallest angle, mean quality,
// triangles facing away from both neighbours' side, median CPU milliseconds, and the ratios.
#include "cgal_decimate.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#ifdef TUNICA_HAS_MESHOPTIMIZER
#include "meshoptimizer_decimate.hpp"
#endif

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <functional>

using namespace tunica;

namespace {

double cpu_milliseconds(const std::function<void()>& work) {
  const std::clock_t start = std::clock();
  work();
  return 1000.0 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Measured {
  TriangleMesh mesh;
  std::vector<double> milliseconds;
  double percent = 0;
};

void finish(Measured& m, const ClosestPoint& target, double diagonal_mm) {
  HausdorffOptions options;
  options.width = 1e-5 * diagonal_mm;
  options.samples = 0;
  m.percent = 100 * hausdorff(ClosestPoint(m.mesh), target, options).both.upper / diagonal_mm;
}

void print(const char* who, const Measured& m) {
  const MeshFacts facts = examine(m.mesh);
  fmt::print("  {:8} {:8} triangles {:9.5f} % {:6.2f} deg {:5.3f} quality {:10.1f} ms{}\n", who,
             m.mesh.triangles.size(), m.percent, min_angle_degrees(m.mesh), mean_quality(m.mesh),
             median(m.milliseconds), facts.manifold && facts.oriented ? "" : " NOT MANIFOLD");
}

void compare(const std::string& path, std::size_t count, std::size_t rounds, const std::optional<double>& angle,
             bool with_peer) {
  const TriangleMesh mesh = read_mesh(path, 1.0, false).mesh;
  const SimpleCgalMesh given = to_cgal<SimpleCgalMesh>(mesh);
  Measured own, shaped, peer;
#ifdef TUNICA_HAS_MESHOPTIMIZER
  const MeshoptimizerMesh single(mesh);
  Measured other;
  std::vector<unsigned int> left;
#endif
  DecimateOptions options;
  options.triangles = count;
  for (std::size_t i = 0; i < rounds; ++i) {
    own.milliseconds.push_back(cpu_milliseconds([&] { own.mesh = decimate(mesh, options).mesh; }));
    if (with_peer) {
      peer.milliseconds.push_back(cpu_milliseconds([&] { peer.mesh = garland_heckbert(given, count); }));
#ifdef TUNICA_HAS_MESHOPTIMIZER
      other.milliseconds.push_back(cpu_milliseconds([&] { left = meshoptimizer_simplified(single, count); }));
#endif
    }
  }
  const ClosestPoint target(mesh);
  const double diagonal_mm = diagonal(mesh);
  finish(own, target, diagonal_mm);
  fmt::print("{}: {} triangles to {}\n", path, mesh.triangles.size(), count);
  print("tunica", own);
  if (with_peer) {
    finish(peer, target, diagonal_mm);
    print("CGAL", peer);
    fmt::print("  error {:.3f} x CGAL's, speed {:.1f} x CGAL's\n", own.percent / peer.percent,
               median(peer.milliseconds) / median(own.milliseconds));
#ifdef TUNICA_HAS_MESHOPTIMIZER
    other.mesh = from_meshoptimizer(single, left);
    finish(other, target, diagonal_mm);
    print("meshopt", other);
    fmt::print("  error {:.3f} x meshoptimizer's, speed {:.2f} x meshoptimizer's\n", own.percent / other.percent,
               median(other.milliseconds) / median(own.milliseconds));
#endif
  }
  if (angle) {
    options.min_angle = angle;
    shaped.milliseconds.push_back(cpu_milliseconds([&] { shaped.mesh = decimate(mesh, options).mesh; }));
    finish(shaped, target, diagonal_mm);
    print("shaped", shaped);
    fmt::print("  error of the well-shaped mesh {:.3f} x the plain one's\n", shaped.percent / own.percent);
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  set_thread_count(1);
  std::size_t rounds = 3;
  std::optional<double> angle;
  bool with_peer = true;
  std::vector<std::pair<std::string, std::size_t>> cases;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--rounds" && i + 1 < argc) {
      rounds = std::strtoul(argv[++i], nullptr, 10);
    } else if (argument == "--angle" && i + 1 < argc) {
      angle = std::strtod(argv[++i], nullptr);
    } else if (argument == "--alone") {
      with_peer = false;
    } else if (const auto colon = argument.rfind(':'); colon != std::string::npos) {
      std::string counts = argument.substr(colon + 1);
      while (!counts.empty()) {
        const auto comma = counts.find(',');
        cases.emplace_back(argument.substr(0, colon), std::strtoul(counts.c_str(), nullptr, 10));
        counts = comma == std::string::npos ? "" : counts.substr(comma + 1);
      }
    }
  }
  if (cases.empty()) {
    fmt::print(stderr, "bench_decimate MESH:COUNT[,COUNT...]... [--angle DEGREES] [--rounds N] [--alone]\n");
    return 2;
  }
  try {
    for (const auto& [path, count] : cases) {
      compare(path, count, rounds, angle, with_peer);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_decimate: {}\n", error.what());
    return 3;
  }
}
