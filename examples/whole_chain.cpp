// The whole chain in memory: the labels of a ball, their surface, a coarse mesh, curved shells, and the stress of these
// as a wall under pressure beside Laplace's law.
//
//   whole_chain
#include <tunica/chain/decimate.hpp>
#include <tunica/chain/extract.hpp>
#include <tunica/chain/relax.hpp>
#include <tunica/mechanics/runs/fields.hpp>
#include <tunica/volume/phantom/phantom.hpp>

#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>

int main() {
  using namespace tunica;
  constexpr double spacing = 1.5, wall = 0.5;  // mm
  constexpr double pressure = 0.001;           // MPa

  // Labels as they come from a segmentation: 0 outside, 1 inside.
  const Phantom ball = make_phantom({.shape = PhantomShape::sphere, .size = 32, .spacing = Vec3::Constant(spacing)});
  const Inside inside{Inside::Rule::label, 1};
  chain::SelectedVoxels voxels{inside, "label 1", "1", select(ball.volume, inside)};
  chain::ExtractSettings smooth;
  smooth.staircase = true;
  const chain::Extraction surface = chain::extract(std::move(voxels), smooth);

  chain::SurfaceToDecimate fine;
  fine.file.mesh = surface.mesh;
  chain::DecimateSettings coarser;
  coarser.triangles = 200;
  coarser.min_angle = 20;  // degrees
  const chain::Decimation coarse = chain::decimate(fine, coarser);

  chain::RelaxSurfaces surfaces;
  surfaces.coarse = coarse.made.mesh;
  surfaces.target = std::make_unique<Target>(surface.mesh);
  chain::RelaxSettings fit;
  fit.shells = 200;
  const chain::Relaxation fitted = chain::relax(surfaces, fit);

  ShellBody body;
  body.name = "ball";
  body.mesh = fitted.shell;
  body.thickness = {wall};
  body.material.young = 1;  // MPa
  body.material.poisson = 0.45;
  Model model;
  model.shells.push_back(std::move(body));
  model.rigid_motions.push_back({});  // a closed wall under its own pressure is in balance
  Load load;
  load.kind = PressureLoad{.value = pressure};
  model.loads.push_back(std::move(load));
  RunSettings settings;
  settings.kind = StaticRun{.linear = false, .load_factors = {1}};
  State last;
  const Summary summary = solve(model, settings, [&](const State& state) { last = state; });
  const Wall stress = element_fields(model, last).wall;

  const double radius = std::cbrt(0.75 / std::numbers::pi * *surface.numbers.volume);
  const double laplace = pressure * radius / (2 * wall);
  std::cout << surface.numbers.triangles << " triangles, " << fitted.shell.triangles.size()
            << " shells, certainly within " << fitted.distance.upper() << " mm; membrane stress "
            << stress.membrane_mean << " MPa, by Laplace's law " << laplace << " MPa\n";
  return summary.converged && std::abs(stress.membrane_mean / laplace - 1) < 0.1 ? 0 : 1;
}
