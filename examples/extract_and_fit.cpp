// From labels in memory to curved shells: extract a label's surface, decimate it, fit shells to it.
//
//   extract_and_fit
#include <tunica/fit/fit.hpp>
#include <tunica/surface/decimation/decimate.hpp>
#include <tunica/volume/cubes/marching_cubes.hpp>
#include <tunica/volume/smoothing/smoothing.hpp>

#include <cstdint>
#include <iostream>

int main() {
  using namespace tunica;

  // Labels as they come from a segmentation: 0 outside, 7 a ball of 20 voxels radius; voxels of 1.5 mm.
  constexpr std::size_t side = 48;
  std::vector<std::uint8_t> labels;
  for (std::size_t k = 0; k < side; ++k) {
    for (std::size_t j = 0; j < side; ++j) {
      for (std::size_t i = 0; i < side; ++i) {
        const Vec3 from_centre = Vec3(double(i), double(j), double(k)) - Vec3::Constant(0.5 * (side - 1));
        labels.push_back(from_centre.norm() <= 20 ? 7 : 0);
      }
    }
  }
  Volume volume;
  volume.dims = {side, side, side};
  volume.data = std::move(labels);
  volume.affine.leftCols<3>() *= 1.5;  // voxel index to world millimetres

  const Mask mask = select(volume, {Inside::Rule::label, 7});
  TriangleMesh surface = marching_cubes(mask);
  smooth_staircase(surface, mask);

  DecimateOptions coarser;
  coarser.triangles = 200;
  coarser.min_angle = 20;
  const TriangleMesh coarse = decimate(surface, coarser).mesh;

  const Target target(std::move(surface));
  FitOptions options;
  options.tolerance = 0.01 * target.diagonal();
  options.refine = true;  // coarse's own triangles, split where it takes more
  const RelaxResult fitted = fit(coarse, target, options);

  std::cout << fitted.shell.triangles.size() << " shells, certainly within " << fitted.distance.upper() << " mm of "
            << target.mesh().triangles.size() << " triangles\n";
  return fitted.reached.value_or(false) ? 0 : 1;
}
