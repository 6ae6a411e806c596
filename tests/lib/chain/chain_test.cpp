#include "tunica/chain/decimate.hpp"
#include "tunica/chain/extract.hpp"
#include "tunica/chain/relax.hpp"
#include "tunica/chain/simulate.hpp"
#include "tunica/volume/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

namespace tunica {
namespace {

constexpr double wall = 0.5;        // mm
constexpr double pressure = 0.001;  // MPa

/// The labels of a ball, taken through the chain without a file.
struct Ball {
  chain::Extraction surface;
  std::unique_ptr<Target> target;
  chain::Relaxation fitted;

  Ball() {
    PhantomOptions round;
    round.shape = PhantomShape::sphere;
    round.size = 32;
    round.spacing = Vec3::Constant(1.5);
    const Phantom ball = make_phantom(round);
    const Inside inside{Inside::Rule::label, 1};
    chain::ExtractSettings smooth;
    smooth.staircase = true;
    surface = chain::extract({inside, "label 1", "1", select(ball.volume, inside)}, smooth);
    chain::SurfaceToDecimate fine;
    fine.file.mesh = surface.mesh;
    chain::DecimateSettings coarser;
    coarser.triangles = 200;
    coarser.min_angle = 20;
    chain::RelaxSurfaces surfaces;
    surfaces.coarse = chain::decimate(fine, coarser).made.mesh;
    surfaces.target = std::make_unique<Target>(surface.mesh);
    chain::RelaxSettings fit;
    fit.shells = 200;
    fitted = chain::relax(surfaces, fit);
    target = std::move(surfaces.target);
  }

  [[nodiscard]] double laplace() const {
    return pressure * std::cbrt(0.75 / std::numbers::pi * *surface.numbers.volume) / (2 * wall);
  }

  /// The ball as a wall under pressure.
  void put_into(chain::SimulateSettings& run, chain::LoadedRun& loaded) {
    Scene& scene = run.scene;
    scene.run.kind = StaticRun{.linear = false, .load_factors = {1}};
    scene.shells.emplace_back().name = "ball";
    SceneLoad& load = scene.loads.emplace_back();
    load.body = "ball";
    load.kind = PressureLoad{.value = pressure};
    SceneFix& fix = scene.fixes.emplace_back();
    fix.body = "ball";
    fix.where = RigidMotions{};
    ShellBody body;
    body.name = "ball";
    body.mesh = fitted.shell;
    body.thickness = {wall};
    body.material.young = 1;
    body.material.poisson = 0.45;
    loaded.model = resolve_scene(scene, std::vector{std::move(body)});
    loaded.targets.push_back(std::move(target));
  }
};

TEST(ChainInMemory, GoesFromLabelsToLaplacesLawAndItsErrorWithoutAFile) {
  Ball ball;
  chain::SimulateSettings run;
  chain::LoadedRun loaded;
  ball.put_into(run, loaded);
  RunRecord record;
  chain::simulate(run, std::move(loaded), record);
  ASSERT_TRUE(record.converged);
  const double error = record.estimates.at("membrane_mean_mpa").error;
  EXPECT_GT(error, 0);
  EXPECT_LT(error, 0.05);
  // The wall gives way to the pressure by some per cent of its radius, and Laplace's law is of the sphere before.
  EXPECT_NEAR(record.last->wall.membrane_mean / ball.laplace(), 1, 0.05);
}

TEST(ChainInMemory, ChoosesShellsForAnAccuracyWithoutAFile) {
  Ball ball;
  chain::SimulateSettings run;
  chain::LoadedRun loaded;
  ball.put_into(run, loaded);
  SceneAccuracy& asked = run.scene.accuracy.emplace();
  asked.of = Quantity::membrane;
  asked.within = 0.02;
  RunRecord record;
  chain::simulate(run, std::move(loaded), record);
  ASSERT_TRUE(record.accuracy);
  EXPECT_GE(record.accuracy->levels.size(), 2);
  EXPECT_LE(record.accuracy->estimate.value_or(1), 0.02);
}

TEST(ChainInMemory, OnlyChecksWhatIsToBeChecked) {
  Ball ball;
  chain::SimulateSettings run;
  chain::LoadedRun loaded;
  ball.put_into(run, loaded);
  run.check = true;
  RunRecord record;
  chain::simulate(run, std::move(loaded), record);
  EXPECT_FALSE(record.last.has_value());
}

}  // namespace
}  // namespace tunica
