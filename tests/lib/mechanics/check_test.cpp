// Models that cannot be solved are found and named before anything is solved.

#include "tets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <regex>

namespace tunica {
namespace {

using namespace benchmarks;

Model plate() {
  const Grid grid = make_grid(3, 3, [](double u, double v) { return Vec3(u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, 0.05));
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
  return model;
}

void expect_refused(const Model& model, const std::string& part, const RunSettings& settings = linear_run()) {
  try {
    check_model(model, settings);
    FAIL() << "accepted, expected: " << part;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(part));
  }
}

TEST(CheckModel, AcceptsAGoodOne) { EXPECT_NO_THROW(check_model(plate(), linear_run())); }

TEST(CheckModel, NamesADegenerateElement) {
  Model model = plate();
  model.shells[0].mesh.vertices[5] = model.shells[0].mesh.vertices[6];
  expect_refused(model, "degenerate");
}

TEST(CheckModel, NamesAFlippedElement) {
  Model model = plate();
  std::swap(model.shells[0].mesh.triangles[7][0], model.shells[0].mesh.triangles[7][1]);
  expect_refused(model, "inconsistent orientation");
}

TEST(CheckModel, NamesAnEdgeOfThreeElementsAsThatWhateverTheirOrder) {
  Model model = plate();
  ShellMesh& mesh = model.shells[0].mesh;
  const auto runs = [](const std::array<Index, 3>& t, Index from, Index to) {
    return (t[0] == from && t[1] == to) || (t[1] == from && t[2] == to) || (t[2] == from && t[0] == to);
  };
  const auto inner = std::find_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& t) {
    return std::any_of(mesh.triangles.begin(), mesh.triangles.end(),
                       [&](const auto& s) { return runs(s, t[1], t[0]); });
  });
  ASSERT_NE(inner, mesh.triangles.end());
  mesh.vertices.emplace_back(0.5, 0.5, 1.0);
  mesh.triangles.insert(mesh.triangles.begin(),
                        {(*inner)[0], (*inner)[1], static_cast<Index>(mesh.vertices.size() - 1)});
  expect_refused(model, "non-manifold");
}

TEST(CheckModel, NamesADoubleElement) {
  Model model = plate();
  model.shells[0].mesh.triangles.push_back(model.shells[0].mesh.triangles[4]);
  expect_refused(model, "there twice");
}

TEST(CheckModel, NamesANonManifoldEdge) {
  Model model = plate();
  ShellMesh& mesh = model.shells[0].mesh;
  mesh.vertices.emplace_back(0.5, 0.5, 1.0);
  const auto t = mesh.triangles[6];
  mesh.triangles.push_back({t[0], t[1], static_cast<Index>(mesh.vertices.size() - 1)});
  expect_refused(model, "n");
}

TEST(CheckModel, NamesAPieceThatCanMove) {
  Model model = plate();
  model.fixes.clear();
  expect_refused(model, "6 of its 6 rigid motions");
  // Along x and y held, the rest free.
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xy", "z");
  expect_refused(model, "3 of its 6 rigid motions");
  // A line of held nodes is a hinge.
  model.fixes.clear();
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "");
  expect_refused(model, "1 of its 6 rigid motions");
}

TEST(CheckModel, AFreePieceIsAllowedInADynamicRun) {
  Model model = plate();
  model.fixes.clear();
  model.shells[0].material.density = 1e-9;
  RunSettings settings;
  settings.kind = DynamicRun{1, 0.1, {}, Integrator::backward_euler};
  EXPECT_NO_THROW(check_model(model, settings));
}

TEST(CheckModel, NamesAThicknessThatCannotBe) {
  Model model = plate();
  model.shells[0].thickness.assign(16, 0.1);
  model.shells[0].thickness[3] = 0;
  expect_refused(model, "thickness at node 3");
  model.shells[0].thickness[3] = 1e-300;
  expect_refused(model, "lost in round-off");
}

TEST(CheckModel, NamesANormalInItsFacetsPlane) {
  Model model = plate();
  model.shells[0].mesh.normals.assign(16, Vec3::UnitZ());
  model.shells[0].mesh.normals[5] = Vec3::UnitX();
  model.shells[0].curved = true;
  model.shells[0].rest = Rest::curved;
  expect_refused(model, "shell");
}

TEST(CheckModel, DynamicsNeedsADensity) {
  RunSettings settings;
  settings.kind = DynamicRun{1, 0.1, {}, Integrator::backward_euler};
  expect_refused(plate(), "density", settings);
}

TEST(CheckModel, RigidMotionsAreHeldOnlyUnderBalancedLoads) {
  Model model;
  ShellBody body = flat_body(make_sphere(10, 1), 1000, 0.3, 0.1);
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  model.loads.push_back({0, PressureLoad{1e-4, true}, {}});
  EXPECT_NO_THROW(check_model(model, linear_run()));
  model.loads.push_back({0, ForceLoad{{0}, Vec3(0, 0, 1)}, {}});
  expect_refused(model, "net force or moment");
}

TEST(CheckModel, NamesFixesThatContradictEachOtherAndWhereTheyWereSaid) {
  Model model = plate();
  model.fixes[0].said_at = "scene:7:1";
  Fix fix = model.fixes[0];
  fix.displacement = Vec3(0, 0, 1);
  fix.said_at = "scene:9:1";
  model.fixes.push_back(fix);
  expect_refused(model, "scene:9:1: shell: two fixes prescribe different displacements 0 mm (scene:7:1) and 1 mm");
}

TEST(CheckModel, NamesWhereABodyWasSaid) {
  Model model = plate();
  model.fixes.clear();
  model.shells[0].said_at = "scene:3:1";
  expect_refused(model, "scene:3:1: shell: the piece with node 0");
}

TEST(CheckModel, BucklingAndPathsNeedALoadThatIsNotZero) {
  Model model = plate();
  model.loads[0] = {0, PressureLoad{0, true}, {}, "scene:8:1"};
  RunSettings settings = linear_run();
  settings.kind = BucklingRun{};
  expect_refused(model, "scene:8:1: buckling needs a load", settings);
  settings.kind = ArcLengthRun{};
  expect_refused(model, "scene:8:1: arc length needs a load", settings);
}

TEST(CheckModel, RefusesAWallThickerThanTheWholeBody) {
  Model model = plate();
  model.shells[0].thickness = {100};  // 1 m for 1 cm, say
  expect_refused(model, "is its unit right?");
}

std::vector<std::string> doubts_of(const Model& model, const RunSettings& settings = linear_run()) {
  EXPECT_NO_THROW(check_model(model, settings));
  return texts_of(doubts(model, settings));
}

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(Doubts, OfAGoodModelThereAreNone) {
  EXPECT_THAT(doubts_of(plate()), IsEmpty());
  Model ball;
  ball.shells.push_back(flat_body(make_sphere(10, 2), 1000, 0.3, 1));
  ball.rigid_motions.push_back({0});
  ball.loads.push_back({0, PressureLoad{1e-4, true}, {}});
  EXPECT_THAT(doubts_of(ball), IsEmpty());
}

TEST(Doubts, AWallThickerThanATwentiethOfTheBody) {
  Model model = plate();
  model.shells[0].thickness = {0.15};
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("more than a twentieth")));
}

TEST(Doubts, AWallThickerThanTheRadiusOfCurvatureOfMostOfTheBodyButNotOfACrease) {
  // A quarter of a tube of radius 0.5, 20 long: its diagonal is no measure of how thick a wall may be.
  const auto tube = [](double thickness, double radius) {
    Model model;
    const Grid grid = make_grid(8, 80, [&](double u, double v) {
      const double angle = u * 2;
      return Vec3(radius * std::cos(angle), radius * std::sin(angle), 20 * v);
    });
    model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, thickness));
    hold(
        model, [](const Vec3& p) { return p.z() < 1e-9; }, "xyz", "xyz");
    model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
    return model;
  };
  EXPECT_THAT(doubts_of(tube(0.7, 0.5)), ElementsAre(HasSubstr("radius of curvature")));
  EXPECT_THAT(doubts_of(tube(0.3, 0.5)), ElementsAre(HasSubstr("a quarter of a vessel's radius")));
  EXPECT_THAT(doubts_of(tube(0.1, 0.5)), IsEmpty());
  // Long shells on so thin a wall bend too little: h^2 = 4 R t at a thickness of .031.
  EXPECT_THAT(doubts_of(tube(0.02, 0.5)), ElementsAre(HasSubstr("coarse for so thin a curved wall")));
  // Two flat walls that meet in an edge: there the radius is small, elsewhere there is none.
  Model angle;
  const Grid grid = make_grid(
      20, 10, [](double u, double v) { return Vec3(10 * std::abs(u - 0.5), 10 * std::max(0.0, u - 0.5), 10 * v); });
  angle.shells.push_back(flat_body(grid.mesh, 1000, 0.3, 0.5));
  hold(
      angle, [](const Vec3& p) { return p.z() < 1e-9; }, "xyz", "xyz");
  angle.loads.push_back({0, PressureLoad{1e-6, true}, {}});
  EXPECT_THAT(doubts_of(angle), IsEmpty());
}

TEST(Doubts, WallsThatAreNearerToEachOtherThanTheyAreThick) {
  const auto sheets = [](double thickness) {  // two, 1 mm apart, one mesh
    const Grid grid = make_grid(10, 10, [](double u, double v) { return Vec3(40 * u, 40 * v, 0); });
    ShellMesh mesh = grid.mesh;
    for (const Vec3& p : grid.mesh.vertices) {
      mesh.vertices.emplace_back(p.x(), p.y(), 1);
    }
    const auto first = static_cast<Index>(grid.mesh.vertices.size());
    for (const auto& [a, b, c] : grid.mesh.triangles) {
      mesh.triangles.push_back({a + first, b + first, c + first});
    }
    Model model;
    model.shells.push_back(flat_body(mesh, 1000, 0.3, thickness));
    hold(
        model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
    model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
    return model;
  };
  EXPECT_THAT(doubts_of(sheets(2)), ElementsAre(HasSubstr("overlap, so that no lumen is left")));
  EXPECT_THAT(doubts_of(sheets(0.8)), IsEmpty());
  Model box;
  box.shells.push_back(flat_body(make_box(12, 20), 1000, 0.3, 1.5));  // beside its edges the walls only meet
  box.loads.push_back({0, PressureLoad{1e-6, true}, {}});
  box.rigid_motions.push_back({0});
  EXPECT_THAT(doubts_of(box), IsEmpty());
}

TEST(Doubts, TheCurvatureOfSphereAndCylinderIsTheirOwn) {
  const ShellMesh sphere = make_sphere(10, 3);
  for (const auto& [curvature, sum] : curvatures_of(sphere, true)) {
    EXPECT_NEAR(curvature, 0.1, 0.002);
  }
  for (const auto& [curvature, sum] : curvatures_of(sphere, false)) {
    EXPECT_NEAR(curvature, 0.1, 0.02);
  }
}

TEST(Doubts, BodiesThatCannotMoveAndLoadsThatMoveNothing) {
  Model model = plate();
  model.loads.push_back({0, ForceLoad{{0}, Vec3(0, 0, 1)}, {}, "scene:9:1"});
  EXPECT_THAT(doubts_of(model),
              ElementsAre("scene:9:1: shell: this force acts on held nodes only, so it moves nothing"));
  std::get<ForceLoad>(model.loads.back().kind).nodes = {0, 15};  // one of them is free
  EXPECT_THAT(doubts_of(model), IsEmpty());
  model = plate();
  hold(
      model, [](const Vec3&) { return true; }, "xyz", "");
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("all its nodes are held")));
  model.fixes.back().displacement = Vec3(0, 0, 0.1);
  model.fixes.erase(model.fixes.begin());
  EXPECT_THAT(doubts_of(model), IsEmpty());
}

TEST(Doubts, ImagedUnderAPressureOfTheOtherSign) {
  Model model = plate();
  model.loads.push_back({0, PressureLoad{1e-3, true, 2e-3}, {}, "scene:9:1"});
  EXPECT_THAT(doubts_of(model), IsEmpty());
  std::get<PressureLoad>(model.loads.back().kind).imaged_at = -2e-3;
  EXPECT_THAT(
      doubts_of(model),
      ElementsAre("scene:9:1: shell: imaged_at presses on the other face of the wall than the load: is its sign "
                  "right?"));
  std::get<PressureLoad>(model.loads.back().kind).value = 0;  // the unloaded shape alone
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("imaged_at is a suction")));
}

TEST(Doubts, NormalsThatDoNotFitTheNodes) {
  const auto ball = [](int level, double lean, double thickness = 0.05) {
    Model model = pressurised_sphere(level, thickness, 1e-3);
    ShellMesh& mesh = model.shells[0].mesh;
    for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
      const double angle = 2.4 * static_cast<double>(v);
      const Vec3 across = mesh.normals[v].unitOrthogonal();
      mesh.normals[v] =
          (mesh.normals[v] + lean * (std::cos(angle) * across + std::sin(angle) * mesh.normals[v].cross(across)))
              .normalized();
    }
    return model;
  };
  EXPECT_THAT(doubts_of(ball(4, 0)), IsEmpty());
  EXPECT_THAT(doubts_of(ball(4, 0.003)), IsEmpty());
  EXPECT_THAT(doubts_of(ball(4, 0.03)), ElementsAre(HasSubstr("coarse for so thin a curved wall")));
  RunSettings ringing;
  ringing.kind = FrequencyRun{};
  EXPECT_THAT(texts_of(doubts(ball(4, 0.03), ringing, false)), ElementsAre(HasSubstr("frequencies may be off by")));
  // Shells nearly too long bear less of it.
  EXPECT_THAT(doubts_of(ball(4, 0.015, 0.125)), IsEmpty());
  EXPECT_THAT(doubts_of(ball(3, 0, 0.125)), IsEmpty());
  EXPECT_THAT(doubts_of(ball(3, 0.015, 0.125)), ElementsAre(HasSubstr("coarse for so thin a curved wall")));
}

/// By how much displacements may be off by the shells of a model, as its warning says.
double said_of_displacements(const Model& model) {
  double said = 0.25;  // from here on it is said
  for (const std::string& text : doubts_of(model)) {
    std::smatch found;
    if (std::regex_search(text, found, std::regex("displacements may be off by up to ([0-9]+) %"))) {
      said = std::stod(found[1]) / 100;
    } else if (text.find("displacements may be off by more than 100 %") != std::string::npos) {
      said = std::numeric_limits<double>::infinity();
    }
  }
  return said;
}

TEST(Doubts, HowFarABallOfFewShellsMayBeOffIsNoLess) {
  constexpr double radius = 10, pressure = 1e-5;
  for (const int level : {1, 2, 3}) {
    for (const double ratio : {250, 100, 40, 20, 8}) {
      const Model model = pressurised_sphere(level, radius / ratio, pressure);
      const Material& wall = model.shells[0].material;
      const double exact = pressure * radius * ratio * (1 - wall.poisson) / (2 * wall.young);
      const double off = std::abs(largest_displacement(model, last_state(model, linear_run())) / exact - 1);
      EXPECT_LE(off, said_of_displacements(model)) << level << ", R / t = " << ratio;
    }
  }
}

TEST(Doubts, RampsThatJumpWithinAStep) {
  Model model = plate();
  model.shells[0].material.density = 1e-9;
  model.loads[0].ramp.points = {{0, 0}, {0.3, 1}, {2, 1}};
  RunSettings settings = linear_run();
  settings.kind = DynamicRun{4, 1, {}, Integrator::backward_euler};
  EXPECT_THAT(doubts_of(model, settings), ElementsAre(HasSubstr("within less than a step")));
  settings.kind = DynamicRun{4, 0.3, {}, Integrator::backward_euler};
  EXPECT_THAT(doubts_of(model, settings), IsEmpty());
}

TEST(Doubts, LoadsThatAreZeroAndNoneAtAll) {
  Model model = plate();
  model.loads[0].ramp.points = {{0, 0}, {2, 0}, {3, 1}};  // over the load factor, which ends at 1
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("ramp of this load is zero")));
  Model moved = plate();
  moved.fixes.back().displacement = Vec3(0, 0, 0.1);
  moved.fixes.back().ramp.points = {{0, 0}, {0.5, 1}, {1, 0}};
  EXPECT_THAT(doubts_of(moved), ElementsAre(HasSubstr("zero at every load step: it acts between them alone")));
  model.loads[0].ramp.points = {{0, 0}, {1, 1}};
  EXPECT_THAT(doubts_of(model), IsEmpty());
  model.loads.clear();
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("nothing loads the model")));
  model.loads.push_back({0, PressureLoad{0, true}, {}});
  EXPECT_THAT(doubts_of(model), ElementsAre(HasSubstr("this load is zero"), HasSubstr("nothing loads the model")));
}

}  // namespace
}  // namespace tunica
