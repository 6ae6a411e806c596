// The whole chain in memory: the labels of a ball, their surface, a coarse mesh, curved shells, and the stress of these
// as a wall under pressure beside Laplace's law.
//
//   whole_chain
#include <tunica/chain/decimate.hpp>
#include <tunica/chain/extract.hpp>
#include <tunica/chain/relax.hpp>
#include <tunica/chain/simulate.hpp>
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

  // The wall under pressure: what a scene file would say, and the body that it would name.
  chain::SimulateSettings run;
  Scene& scene = run.scene;
  scene.run.kind = StaticRun{.linear = false, .load_factors = {1}};
  scene.shells.emplace_back().name = "ball";
  SceneLoad& load = scene.loads.emplace_back();
  load.body = "ball";
  load.kind = PressureLoad{.value = pressure};
  SceneFix& fix = scene.fixes.emplace_back();
  fix.body = "ball";
  fix.where = RigidMotions{};  // closed, under its own pressure: in balance
  ShellBody body;
  body.name = "ball";
  body.mesh = fitted.shell;
  body.thickness = {wall};
  body.material.young = 1;  // MPa
  body.material.poisson = 0.45;
  chain::LoadedRun loaded;
  loaded.model = resolve_scene(scene, std::vector{std::move(body)});
  loaded.targets.push_back(std::move(surfaces.target));  // one refinement is solved besides: the error of the mesh
  RunRecord record;
  chain::simulate(run, std::move(loaded), record);
  const double stress = record.last->wall.membrane_mean;
  const double error = record.estimates.at("membrane_mean_mpa").error;

  const double radius = std::cbrt(0.75 / std::numbers::pi * *surface.numbers.volume);
  const double laplace = pressure * radius / (2 * wall);
  std::cout << surface.numbers.triangles << " triangles, " << fitted.shell.triangles.size()
            << " shells, certainly within " << fitted.distance.upper() << " mm; membrane stress " << stress
            << " MPa (mesh: +- " << 100 * error << " %), by Laplace's law " << laplace << " MPa\n";
  return record.converged && std::abs(stress / laplace - 1) < 0.1 ? 0 : 1;
}
