// The two-sided Hausdorff distance of two meshes as an interval that certainly holds it.
//
//   certified_distance A.ply B.ply
#include <tunica/core/error.hpp>
#include <tunica/io/mesh/mesh_file.hpp>
#include <tunica/surface/distance/hausdorff.hpp>
#include <tunica/surface/mesh/measure.hpp>

#include <iostream>

int main(int argc, char** argv) {
  using namespace tunica;
  if (argc != 3) {
    std::cerr << "usage: certified_distance A.ply B.ply\n";
    return 2;
  }
  try {
    const TriangleMesh a = read_mesh(argv[1]).mesh;
    const TriangleMesh b = read_mesh(argv[2]).mesh;
    HausdorffOptions options;
    options.width = 1e-4 * diagonal(b);
    const HausdorffResult distance = hausdorff(a, b, options);
    std::cout << distance.both.lower << " to " << distance.both.upper << " mm, mean " << distance.mean << " mm\n";
    return 0;
  } catch (const Error& error) {
    std::cerr << error.what() << '\n';
    return static_cast<int>(error.code());
  }
}
