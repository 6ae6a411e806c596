#include "scene_fixture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/scene/detail/toml_depth.hpp"
#include "tunica/io/scene/scene_manual.hpp"
#include "tunica/io/scene/stated.hpp"

#include <gmock/gmock.h>

namespace tunica::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* run = "[run]\nkind = \"static\"\n";  // lines 1 and 2
constexpr const char* ball =
    "[[shell]]\nname = \"ball\"\nmesh = \"ball.ply\"\nthickness = \"0.1mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n";
constexpr const char* clamped =
    "[[fix]]\nbody = \"plate\"\nwhere = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"xyz\"\n";

std::string basic(const std::string& more = {}) { return std::string(run) + plate + more; }

std::string fix_where(const std::string& where) {
  return basic("[[fix]]\nbody = \"plate\"\nwhere = " + where + "\ntranslation = \"xyz\"\nrotation = \"\"\n");
}

TEST_F(SceneTest, DefaultsAreThoseOfTheContract) {
  const Scene scene = read(basic());
  const auto& statics = std::get<StaticRun>(scene.run.kind);
  EXPECT_FALSE(statics.linear);
  ASSERT_EQ(statics.load_factors.size(), 1U);
  EXPECT_EQ(statics.load_factors.back(), 1.0);
  EXPECT_EQ(scene.run.solver, Solver::automatic);
  EXPECT_EQ(scene.run.converge, 1e-8);
  EXPECT_EQ(scene.run.every, 1U);
  EXPECT_EQ(scene.run.newton_max, 20U);
  EXPECT_FALSE(scene.run.cg_iterations);
  EXPECT_FALSE(scene.run.cg_fixed_count);
  ASSERT_EQ(scene.shells.size(), 1U);
  EXPECT_EQ(scene.shells[0].scale, 1.0);
  EXPECT_EQ(scene.shells[0].membrane, Membrane::adapt);
  EXPECT_EQ(scene.shells[0].bending, Bending::dkt_comas);
  EXPECT_EQ(scene.shells[0].rest, Rest::curved);
  EXPECT_FALSE(scene.shells[0].material.density);
}

TEST_F(SceneTest, ALineSaysLoadsAndWallAsTheyWereWrittenWhereAllBodiesAgree) {
  const std::string pressed =
      "[[load]]\nbody = \"ball\"\nkind = \"pressure\"\nvalue = \"120 mmHg\"\nimaged_at = \"80mmHg\"\n";
  const std::string pulled = "[[load]]\nbody = \"ball\"\nkind = \"area\"\nvalue = [\"0kPa\", \"0kPa\", \"1kPa\"]\n";
  EXPECT_EQ(stated_line(read(std::string(run) + ball + pressed)),
            "Pressure 120 mmHg, imaged at 80mmHg, wall 0.1mm, E 1MPa, Poisson's ratio 0.3");
  const std::string other =
      "[[shell]]\nname = \"other\"\nmesh = \"ball.ply\"\nthickness = \"0.2mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n";
  EXPECT_EQ(stated_line(read(std::string(run) + ball + other + pulled)), "Area, E 1MPa, Poisson's ratio 0.3");
  EXPECT_EQ(stated_line(Scene()), "");
}

TEST_F(SceneTest, EveryKeyOfADynamicRunArrives) {
  const Scene scene = read(
      "[run]\nkind = \"dynamic\"\ngeometry = \"nonlinear\"\nduration = \"2s\"\nstep = \"40ms\"\n"
      "damping = {mass = \"0.1/s\", stiffness = \"2ms\"}\nintegrator = \"backward-euler\"\nsolver = \"cg\"\n"
      "cg_tolerance = \"5%\"\ncg_iterations = 100\nconverge = 1e-6\nnewton_max = 1\nevery = 3\n"
      "[[shell]]\nname = \"a\"\nmesh = \"plate.ply\"\nscale = 2\nthickness = \"1mm\"\nyoung = \"2kPa\"\n"
      "poisson = 0\ndensity = \"1100kg/m3\"\nmembrane = \"cst\"\nbending = \"comas-consistent\"\nrest = \"flat\"\n"
      "[[load]]\nbody = \"a\"\nkind = \"pressure\"\nvalue = \"100mmHg\"\nfollower = false\n"
      "ramp = [[\"0s\", 0], [\"500ms\", 0.5], [\"1s\", 1.0]]\n");
  const auto& dynamic = std::get<DynamicRun>(scene.run.kind);
  EXPECT_DOUBLE_EQ(dynamic.duration, 2);
  EXPECT_DOUBLE_EQ(dynamic.step, 0.04);
  EXPECT_DOUBLE_EQ(dynamic.damping.mass, 0.1);
  EXPECT_DOUBLE_EQ(dynamic.damping.stiffness, 0.002);
  EXPECT_EQ(scene.run.solver, Solver::cg);
  EXPECT_DOUBLE_EQ(scene.run.cg_tolerance, 0.05);
  EXPECT_EQ(scene.run.cg_iterations, 100U);
  EXPECT_FALSE(scene.run.cg_fixed_count);
  EXPECT_EQ(scene.run.converge, 1e-6);
  EXPECT_EQ(scene.run.newton_max, 1U);
  EXPECT_EQ(scene.run.every, 3U);
  const SceneShell& shell = scene.shells.at(0);
  EXPECT_EQ(shell.scale, 2);
  EXPECT_DOUBLE_EQ(shell.material.young, 0.002);
  EXPECT_DOUBLE_EQ(*shell.material.density, 1.1e-9);
  EXPECT_EQ(shell.membrane, Membrane::cst);
  EXPECT_EQ(shell.bending, Bending::comas_consistent);
  EXPECT_EQ(shell.rest, Rest::flat);
  const SceneLoad& load = scene.loads.at(0);
  EXPECT_FALSE(std::get<PressureLoad>(load.kind).follower);
  EXPECT_NEAR(std::get<PressureLoad>(load.kind).value, 0.0133322387415, 1e-15);
  ASSERT_EQ(load.ramp.points.size(), 3U);
  EXPECT_DOUBLE_EQ(load.ramp.at(0.75), 0.75);
}

TEST_F(SceneTest, ACountOfIterationsAloneIsAFixedCount) {
  const Scene alone = read("[run]\nkind = \"static\"\ncg_iterations = 100\n" + std::string(plate));
  EXPECT_TRUE(alone.run.cg_fixed_count);
  EXPECT_EQ(alone.run.newton_max, 1U);  // one linearisation per step
  EXPECT_EQ(alone.run.solver, Solver::cg);
  const Scene both = read("[run]\nkind = \"static\"\ncg_iterations = 100\ncg_tolerance = 1e-6\n" + std::string(plate));
  EXPECT_FALSE(both.run.cg_fixed_count);
  EXPECT_EQ(both.run.cg_tolerance, 1e-6);
}

TEST_F(SceneTest, LoadFactorsAndLinearGeometry) {
  const Scene factors = read("[run]\nkind = \"static\"\nload_factors = [0.1, 0.5, 2]\n" + std::string(plate));
  EXPECT_THAT(std::get<StaticRun>(factors.run.kind).load_factors, ElementsAre(0.1, 0.5, 2.0));
  const Scene linear = read("[run]\nkind = \"static\"\ngeometry = \"linear\"\n" + std::string(plate));
  EXPECT_TRUE(std::get<StaticRun>(linear.run.kind).linear);
  EXPECT_THAT(std::get<StaticRun>(linear.run.kind).load_factors, ElementsAre(1.0));
}

TEST_F(SceneTest, EveryKindOfLoadArrives) {
  const LoadedScene loaded = load(
      "[run]\nkind = \"static\"\n[[shell]]\nname = \"p\"\nmesh = \"plate.ply\"\nthickness = \"1mm\"\nyoung = \"1MPa\"\n"
      "poisson = 0.3\ndensity = \"1g/cm3\"\n"
      "[[load]]\nbody = \"p\"\nkind = \"force\"\nwhere = {nodes = [0, 4]}\nvalue = [\"0N\", \"0N\", \"-1kN\"]\n"
      "[[load]]\nbody = \"p\"\nkind = \"moment\"\nwhere = {nearest = [\"9mm\", \"9mm\", \"5mm\"]}\n"
      "value = [\"1N*m\", \"0N*mm\", \"0N*mm\"]\n"
      "[[load]]\nbody = \"p\"\nkind = \"edge\"\nwhere = {above = {axis = \"x\", at = \"1cm\"}}\n"
      "value = [\"0N/m\", \"0N/m\", \"2N/m\"]\n"
      "[[load]]\nbody = \"p\"\nkind = \"area\"\nvalue = [\"0Pa\", \"1kPa\", \"0kPa\"]\n"
      "[[load]]\nbody = \"p\"\nkind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"-9.81m/s2\"]\n"
      "ramp = [[0.0, 1.0], [1.0, 1.0]]\n");
  const std::vector<Load>& loads = loaded.model.loads;
  ASSERT_EQ(loads.size(), 5U);
  const auto& force = std::get<ForceLoad>(loads[0].kind);
  EXPECT_THAT(force.nodes, ElementsAre(0U, 4U));
  EXPECT_DOUBLE_EQ(force.total.z(), -1000);
  const auto& moment = std::get<MomentLoad>(loads[1].kind);
  EXPECT_THAT(moment.nodes, ElementsAre(24U));
  EXPECT_DOUBLE_EQ(moment.total.x(), 1000);
  const auto& edge = std::get<EdgeLoad>(loads[2].kind);
  EXPECT_EQ(edge.edges.size(), 4U);
  EXPECT_THAT(edge.shares, ElementsAre(1, 1, 1, 1));
  EXPECT_DOUBLE_EQ(edge.per_length.z(), 0.002);
  EXPECT_DOUBLE_EQ(std::get<AreaLoad>(loads[3].kind).per_area.y(), 0.001);
  EXPECT_DOUBLE_EQ(std::get<GravityLoad>(loads[4].kind).acceleration.z(), -9810);
  EXPECT_EQ(loads[4].ramp.points.size(), 2U);
}

TEST_F(SceneTest, RegionsIncludeTheirBorder) {
  const auto count = [&](const std::string& where) { return load(fix_where(where)).model.fixes.at(0).nodes.size(); };
  EXPECT_EQ(count("{all = true}"), 25U);
  EXPECT_EQ(count("{boundary = true}"), 16U);
  EXPECT_EQ(count(R"({box = [["0mm", "0mm", "0mm"], ["5mm", "5mm", "0mm"]]})"), 9U);
  EXPECT_EQ(count(R"({below = {axis = "y", at = "2.5mm"}})"), 10U);
  EXPECT_EQ(count(R"({above = {axis = "x", at = "0.01m"}})"), 5U);
  EXPECT_EQ(count(R"({sphere = {centre = ["5mm", "5mm", "0mm"], radius = "2.5mm"}})"), 5U);
  EXPECT_EQ(count("{nodes = [3, 4]}"), 2U);
  EXPECT_EQ(count(R"({nearest = ["5mm", "5.1mm", "2mm"]})"), 1U);
  // Seven digits, as a float file or a printed table has them.
  EXPECT_EQ(count(R"({above = {axis = "x", at = "7.500001mm"}})"), 10U);
  EXPECT_EQ(count(R"({above = {axis = "x", at = "7.501mm"}})"), 5U);
}

TEST_F(SceneTest, FixesHoldWhatTheySay) {
  const LoadedScene loaded = load(basic("[[fix]]\nbody = \"plate\"\nwhere = {nodes = [7]}\ntranslation = \"zx\"\n"
                                        "rotation = \"y\"\ndisplacement = [\"1mm\", \"0mm\", \"-2mm\"]\n"
                                        "ramp = [[0, 0], [1, 2]]\n") +
                                  ball + "[[fix]]\nbody = \"ball\"\nwhere = {rigid_motions = true}\n");
  ASSERT_EQ(loaded.model.fixes.size(), 1U);
  const Fix& fix = loaded.model.fixes[0];
  EXPECT_THAT(fix.translation, ElementsAre(true, false, true));
  EXPECT_THAT(fix.rotation, ElementsAre(false, true, false));
  EXPECT_EQ(fix.displacement, Vec3(1, 0, -2));
  EXPECT_EQ(fix.ramp.at(0.5), 1);
  ASSERT_EQ(loaded.model.rigid_motions.size(), 1U);
  EXPECT_EQ(loaded.model.rigid_motions[0].body, 1U);
}

TEST_F(SceneTest, BedsAndSlidesHoldAndLeaveTheRestToRigidMotions) {
  const Scene scene =
      read(basic("[[fix]]\nbody = \"plate\"\nwhere = {boundary = true}\nslide = true\n"
                 "[[support]]\nbody = \"plate\"\nstiffness = \"2e5N/m3\"\n"
                 "[[support]]\nbody = \"plate\"\nwhere = {above = {axis = \"x\", at = \"5mm\"}}\n"
                 "stiffness = \"1kPa/mm\"\ndirection = \"normal\"\n"
                 "[[load]]\nbody = \"plate\"\nkind = \"pressure\"\nvalue = \"1kPa\"\n"
                 "where = {above = {axis = \"x\", at = \"5mm\"}}\n"));
  for (const Scene& said : {scene, parse_scene(scene_text(scene), folder_ / "again.toml")}) {
    const Model model = load_scene(said).model;
    ASSERT_EQ(model.fixes.size(), 1U);
    EXPECT_EQ(model.fixes[0].nodes.size(), 16U);
    EXPECT_NEAR(std::abs(model.fixes[0].across->z()), 1, 1e-12);
    EXPECT_EQ(model.rigid_motions.size(), 1U);
    ASSERT_EQ(model.supports.size(), 2U);
    EXPECT_DOUBLE_EQ(model.supports[0].stiffness, 2e-4);
    EXPECT_FALSE(model.supports[0].normal_only);
    EXPECT_TRUE(model.supports[0].shares.empty());
    EXPECT_DOUBLE_EQ(model.supports[1].stiffness, 1e-3);
    EXPECT_TRUE(model.supports[1].normal_only);
    EXPECT_EQ(std::ranges::count(model.supports[1].shares, 1.0), 16);
    EXPECT_EQ(std::get<PressureLoad>(model.loads[0].kind).shares, model.supports[1].shares);
  }
}

TEST_F(SceneTest, AMeshWithoutNormalsIsFlatFacetsAndANoteSaysSo) {
  const LoadedScene loaded = load(basic());
  const ShellBody& body = loaded.model.shells.at(0);
  EXPECT_FALSE(body.curved);
  EXPECT_EQ(body.rest, Rest::flat);
  EXPECT_EQ(body.mesh.corner_normals.size(), body.mesh.triangles.size());
  EXPECT_EQ(body.mesh.normals.at(12), Vec3(0, 0, 1));
  EXPECT_THAT(texts_of(loaded.warnings), ElementsAre(HasSubstr("has no normals")));
  EXPECT_TRUE(load(std::string(run) + plate + "rest = \"flat\"\n").warnings.empty());
  EXPECT_TRUE(load(std::string(run) + ball).model.shells.at(0).curved);
  EXPECT_FALSE(load(std::string(run) + ball + "rest = \"flat\"\n").model.shells.at(0).curved);
}

TEST_F(SceneTest, ScaleAndUnitGiveMillimetres) {
  const std::string off =
      "[run]\nkind = \"static\"\n[[shell]]\nname = \"t\"\nmesh = \"plate.off\"\nthickness = \"1mm\"\n"
      "young = \"1MPa\"\npoisson = 0.3\n";
  EXPECT_EQ(load(off + "unit = \"cm\"\nscale = 3\n").model.shells.at(0).mesh.vertices[1].x(), 30);
  try {
    (void)load(off);
    FAIL() << "no unit, and no error";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), StartsWith(path().string() + ":5:8: "));
    EXPECT_THAT(error.what(), HasSubstr("unit = \"mm\""));
  }
}

TEST_F(SceneTest, ProbesTakeTheNearestNode) {
  const LoadedScene loaded =
      load(basic("[[probe]]\nname = \"tip\"\nbody = \"plate\"\nnearest = [\"10mm\", \"9mm\", \"3mm\"]\n"));
  ASSERT_EQ(loaded.model.probes.size(), 1U);
  EXPECT_EQ(loaded.model.probes[0].node, 24U);
  EXPECT_EQ(loaded.model.probes[0].name, "tip");
}

TEST_F(SceneTest, TheResolvedTextReadsAsTheSameScene) {
  const std::string text =
      "[run]\nkind = \"dynamic\"\nduration = \"0.3s\"\nstep = \"7ms\"\ndamping = {stiffness = \"3us\"}\n"
      "integrator = \"generalised-alpha\"\nspectral_radius = 0.3\nadaptive = \"0.07%\"\ncg_iterations = 70\n" +
      std::string(plate) + "density = \"1.06g/cm3\"\n" + ball + "density = \"3t/mm3\"\n" + clamped +
      "[[fix]]\nbody = \"ball\"\nwhere = {sphere = {centre = [\"0.1mm\", \"10mm\", \"0.7mm\"], radius = \"3mm\"}}\n"
      "translation = \"x\"\nrotation = \"\"\ndisplacement = [\"0.123456789mm\", \"0mm\", \"0mm\"]\n"
      "[[fix]]\nbody = \"ball\"\nwhere = {nearest = [\"0mm\", \"0mm\", \"1um\"]}\ntranslation = \"y\"\nrotation = "
      "\"z\"\n"
      "[[load]]\nbody = \"plate\"\nkind = \"pressure\"\nvalue = \"13.3mmHg\"\nramp = [[\"0.1s\", 0], [\"0.7s\", 1.5]]\n"
      "[[load]]\nbody = \"plate\"\nkind = \"moment\"\nwhere = {nodes = [1, 3]}\nvalue = "
      "[\"0.3N*mm\",\"0N*m\",\"0N*m\"]\n"
      "[[probe]]\nname = \"a\"\nbody = \"ball\"\nnearest = [\"0.3mm\", \"0mm\", \"1e-7mm\"]\n";
  const Scene first = read(text);
  const std::string resolved = scene_text(first);
  const Scene second = read(resolved);
  EXPECT_EQ(scene_text(second), resolved);
  EXPECT_TRUE(second.run.cg_fixed_count);
  EXPECT_EQ(second.shells[0].thickness, first.shells[0].thickness);
  EXPECT_EQ(second.shells[0].material.density, first.shells[0].material.density);
  EXPECT_EQ(second.shells[0].material.young, first.shells[0].material.young);
  EXPECT_EQ(std::get<DynamicRun>(second.run.kind).step, std::get<DynamicRun>(first.run.kind).step);
  EXPECT_EQ(std::get<DynamicRun>(second.run.kind).integrator, Integrator::generalised_alpha);
  EXPECT_EQ(std::get<DynamicRun>(second.run.kind).spectral_radius, 0.3);
  EXPECT_NEAR(std::get<DynamicRun>(second.run.kind).adaptive.value().value, 7e-4, 1e-18);
  EXPECT_NEAR(std::get<PressureLoad>(second.loads[0].kind).value, std::get<PressureLoad>(first.loads[0].kind).value,
              1e-18);
  EXPECT_THAT(resolved, HasSubstr("young = \"1e+06Pa\""));
  EXPECT_THAT(resolved, HasSubstr("thickness = \"0.0001m\""));
  EXPECT_THAT(resolved, HasSubstr("mesh = \"" + (folder_ / "plate.ply").string()));
}

TEST_F(SceneTest, PathsAreReadAndWrittenAgain) {
  const std::string more = std::string(plate) +
                           "[[probe]]\nname = \"a\"\nbody = \"plate\"\nnearest = [\"0mm\", \"0mm\", \"0mm\"]\n" +
                           "[[probe]]\nname = \"tip\"\nbody = \"plate\"\nnearest = [\"9mm\", \"9mm\", \"0mm\"]\n";
  const auto run_of = [&](const std::string& lines) {
    const Scene scene = read("[run]\nkind = \"static\"\ncontrol = \"arc-length\"\n" + lines + "\n" + more);
    EXPECT_EQ(scene_text(read(scene_text(scene))), scene_text(scene));
    return std::get<ArcLengthRun>(scene.run.kind);
  };
  const ArcLengthRun whole = run_of(
      "load_steps = 40\nmax_steps = 70\nmax_factor = 1.5\nuntil = {probe = \"tip\", axis = "
      "\"y\", reaches = \"-30um\"}");
  EXPECT_EQ(whole.first_factor, 1.0 / 40);
  EXPECT_EQ(whole.max_steps, 70U);
  EXPECT_EQ(whole.max_factor, 1.5);
  ASSERT_TRUE(whole.until);
  EXPECT_EQ(whole.until->probe, 1U);
  EXPECT_EQ(whole.until->axis, 1);
  EXPECT_DOUBLE_EQ(whole.until->reaches, -0.03);
  EXPECT_EQ(run_of("").max_factor, 1.0);
  EXPECT_FALSE(run_of("max_steps = 5").max_factor);
  EXPECT_FALSE(run_of("max_steps = 5").until);
}

TEST_F(SceneTest, ModesAreReadAndWrittenAgain) {
  const std::string dense = std::string(plate) + "density = \"1g/cm3\"\n";
  const auto run_of = [&](const std::string& lines) {
    const Scene scene = read("[run]\n" + lines + "\n" + dense);
    EXPECT_EQ(scene_text(read(scene_text(scene))), scene_text(scene));
    return scene.run.kind;
  };
  const auto frequencies = std::get<FrequencyRun>(run_of("kind = \"frequencies\"\ncount = 7\nload_factors = [0.5, 2]"));
  EXPECT_EQ(frequencies.count, 7U);
  EXPECT_EQ(frequencies.preload.load_factors, (std::vector<double>{0.5, 2}));
  const auto linear = std::get<FrequencyRun>(run_of("kind = \"frequencies\"\ngeometry = \"linear\""));
  EXPECT_EQ(linear.count, 10U);
  EXPECT_TRUE(linear.preload.linear);
  EXPECT_EQ(std::get<BucklingRun>(run_of("kind = \"buckling\"\ncount = 3")).count, 3U);
}

TEST(TomlDepth, CountsTheLongestDottedKeyOutsideStringsAndComments) {
  EXPECT_EQ(longest_dotted_key(""), 1U);
  EXPECT_EQ(longest_dotted_key("a.b.c = 1.5\n[d.e]\n"), 3U);
  EXPECT_EQ(longest_dotted_key("x = [1.5, 2.5, 3.5, 4.5]\n# a.b.c.d\n"), 2U);
  EXPECT_EQ(longest_dotted_key("x = \"a.b.c\\\".d\"\ny = 'e.f.g'\n"), 1U);
  EXPECT_EQ(longest_dotted_key("\"a,b\".'=.'.\"c\" = 1\n"), 3U);
  EXPECT_EQ(longest_dotted_key("x = {a = \"\"\" \" \n a \"\"\", b.c.d.e = 1}\n"), 4U);
  EXPECT_EQ(longest_dotted_key("x = \"open a.b.c\ny.z = 1"), 2U);
}

TEST_F(SceneTest, AKeyOfVeryManyPartsIsRefusedNotACrash) {
  std::string key = "a";
  for (int i = 0; i < 200000; ++i) {
    key += ".a";
  }
  for (const std::string& text : {key + " = 1\n", "[" + key + "]\n", "[[" + key + "]]\n", "x = {" + key + " = 1}\n"}) {
    try {
      (void)load(text);
      FAIL() << "accepted";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("dotted parts"));
    }
  }
}

class WrongScene : public SceneTest, public ::testing::WithParamInterface<Wrong> {};

TEST_P(WrongScene, IsAnErrorWithItsPlace) {
  const Wrong& wrong = GetParam();
  try {
    (void)load(wrong.text);
    FAIL() << "accepted:\n" << wrong.text;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::input) << error.what();
    EXPECT_THAT(error.what(), StartsWith(path().string() + wrong.place));
    EXPECT_THAT(error.what(), HasSubstr(wrong.says));
  }
}

std::string shell_with(const std::string& line) {
  return std::string(run) + "[[shell]]\nname = \"plate\"\nmesh = \"plate.ply\"\n" + line;  // `line` is line 6
}
std::string run_with(const std::string& line) {
  return "[run]\nkind = \"static\"\n" + line + "\n" + plate;  // `line` is line 3
}
std::string dynamic_with(const std::string& lines) { return "[run]\nkind = \"dynamic\"\n" + lines + "\n" + plate; }
std::string load_with(const std::string& lines) { return basic("[[load]]\nbody = \"plate\"\n" + lines + "\n"); }

std::string modes_with(const std::string& kind, const std::string& lines) {
  return "[run]\nkind = \"" + kind + "\"\n" + lines + "\n" + plate;  // `lines` begin in line 3
}

std::string path_with(const std::string& line) {
  return run_with("control = \"arc-length\"\n" + line);  // `line` is line 4
}

const std::vector<Wrong> wrong_scenes{
    {"maxStepsUnderLoadControl", run_with("max_steps = 3"), ":3:13: ", "arc-length"},
    {"maxFactorOfBuckling", modes_with("buckling", "max_factor = 3"), ":3:14: ", "arc-length"},
    {"linearPath", path_with("geometry = \"linear\""), ":4:12: ", "no path"},
    {"loadFactorsOfPath", path_with("load_factors = [1]"), ":4:16: ", "finds the load factors"},
    {"maxFactorZero", path_with("max_factor = 0"), ":4:14: ", "greater than 0"},
    {"maxStepsZero", path_with("max_steps = 0"), ":4:13: ", "from 1"},
    {"untilNumber", path_with("until = 3"), ":4:9: ", "table"},
    {"untilOfNoProbe", path_with("until = {probe = \"tip\", axis = \"z\", reaches = \"3mm\"}"),
     ":4:9: ", "no [[probe]] \"tip\""},
    {"untilWithoutAxis", path_with("until = {probe = \"tip\", reaches = \"3mm\"}"), ":4:9: ", "no 'axis'"},
    {"untilOfAngle", path_with("until = {probe = \"tip\", axis = \"a\", reaches = \"3mm\"}"), ":4:32: ", "not known"},
    {"untilZero",
     path_with("until = {probe = \"tip\", axis = \"z\", reaches = \"0mm\"}") +
         "[[probe]]\nname = \"tip\"\nbody = \"plate\"\nnearest = [\"0mm\", \"0mm\", \"0mm\"]\n",
     ":4:9: ", "begins there"},
    {"pathByCg", path_with("solver = \"cg\""), ":4:10: ", "direct solver"},
    {"rampOnPath",
     path_with("every = 1") +
         "[[load]]\nbody = \"plate\"\nkind = \"pressure\"\nvalue = \"1kPa\"\nramp = [[0, 0], [1, 1]]\n",
     ":15:8: ", "finds the load factor"},
    {"countInStatic", run_with("count = 3"), ":3:9: ", "frequencies or buckling"},
    {"countZero", modes_with("buckling", "count = 0"), ":3:9: ", "from 1"},
    {"durationOfFrequencies", modes_with("frequencies", "duration = \"1s\""), ":3:12: ", "dynamic"},
    {"controlOfFrequencies", modes_with("frequencies", "control = \"load\""), ":3:11: ", "static"},
    {"stepsOfLinearFrequencies", modes_with("frequencies", "geometry = \"linear\"\nload_steps = 3"),
     ":4:14: ", "nonlinear"},
    {"geometryOfBuckling", modes_with("buckling", "geometry = \"linear\""), ":3:12: ", "static"},
    {"bucklingByCg", modes_with("buckling", "cg_iterations = 100"), ":3:17: ", "direct solver"},
    {"frequenciesWithoutDensity", modes_with("frequencies", "count = 3"), ":4:1: ", "density"},
    {"syntax", "[run]\nkind = = 1\n", ":2:8: ", "TOML"},
    {"twice", "[run]\nkind = \"static\"\nkind = \"static\"\n", ":3:", "redefine"},
    {"tooLarge", shell_with("thickness = \"1e70m\""), ":6:", "too large"},
    {"noRun", std::string(plate), ":1:1: ", "no 'run'"},
    {"runTwice", "[[run]]\nkind = \"static\"\n", ":1:1: ", "[run]"},
    {"noShell", run, ":1:1: ", "no [[shell]]"},
    {"unknownSection", basic("[[prob]]\nname = \"x\"\n"), ":9:3: ", "did you mean 'probe'?"},
    {"unknownKey", basic("thicknes = \"1mm\"\n"), ":9:1: ", "did you mean 'thickness'?"},
    {"unknownKeyFarFromAny", basic("colour = 3\n"), ":9:1: ", "known are name"},
    {"sectionOnce", std::string(run) + "[shell]\nname = \"a\"\n", ":3:1: ", "[[shell]]"},
    {"kindMissing", "[run]\nevery = 1\n" + std::string(plate), ":1:1: ", "no 'kind'"},
    {"kindUnknown", "[run]\nkind = \"statik\"\n" + std::string(plate), ":2:8: ", "did you mean 'static'?"},
    {"loadStepsZero", run_with("load_steps = 0"), ":3:14: ", "from 1"},
    {"loadStepsHuge", run_with("load_steps = 9000000000000000000"), ":3:14: ", "from 1 to"},
    {"loadStepsText", run_with("load_steps = \"3\""), ":3:14: ", "whole number"},
    {"loadStepsAndFactors", run_with("load_steps = 3\nload_factors = [1]"), ":4:16: ", "contradict"},
    {"loadFactorsFall", run_with("load_factors = [0.5, 0.5]"), ":3:22: ", "increase"},
    {"loadFactorsEmpty", run_with("load_factors = []"), ":3:16: ", "empty"},
    {"loadFactorsNan", run_with("load_factors = [nan]"), ":3:17: ", "finite"},
    {"durationInStatic", run_with("duration = \"1s\""), ":3:12: ", "dynamic"},
    {"stepsInDynamic", dynamic_with("load_steps = 3"), ":3:14: ", "static"},
    {"durationMissing", dynamic_with("step = \"1s\""), ":1:1: ", "no 'duration'"},
    {"stepMissing", dynamic_with("duration = \"1s\""), ":1:1: ", "no 'step'"},
    {"stepZero", dynamic_with("duration = \"1s\"\nstep = \"0s\""), ":4:8: ", "greater than zero"},
    {"stepLong", dynamic_with("duration = \"1s\"\nstep = \"2s\""), ":4:8: ", "longer"},
    {"stepTiny", dynamic_with("duration = \"1s\"\nstep = \"1e-12s\""), ":4:8: ", "too many"},
    {"dampingNegative", dynamic_with("duration = \"1s\"\nstep = \"1s\"\ndamping = {mass = \"-1/s\"}"),
     ":5:19: ", "negative"},
    {"dampingUnit", dynamic_with("duration = \"1s\"\nstep = \"1s\"\ndamping = {mass = \"1s\"}"), ":5:19: ", "a rate"},
    {"densityMissing", dynamic_with("duration = \"1s\"\nstep = \"1s\""), ":5:1: ", "density"},
    {"integrator", dynamic_with("duration = \"1s\"\nstep = \"1s\"\nintegrator = \"euler\""),
     ":5:14: ", "backward-euler"},
    {"spectralRadiusLarge",
     dynamic_with("duration = \"1s\"\nstep = \"1s\"\nintegrator = \"generalised-alpha\"\nspectral_radius = 1.5"),
     ":6:19: ", "[0, 1]"},
    {"spectralRadiusOfEuler", dynamic_with("duration = \"1s\"\nstep = \"1s\"\nspectral_radius = 0.5"),
     ":5:", "generalised-alpha"},
    {"adaptiveBare", dynamic_with("duration = \"1s\"\nstep = \"1s\"\nadaptive = \"0.1\""), ":5:12: ", "adaptive"},
    {"adaptiveInAStaticRun", run_with("adaptive = \"1%\""), ":3:12: ", "dynamic"},
    {"convergeZero", run_with("converge = 0"), ":3:12: ", "greater than 0"},
    {"convergeNan", run_with("converge = nan"), ":3:12: ", "finite"},
    {"cgToleranceBare", run_with("cg_tolerance = \"0.05\""), ":3:16: ", "percent"},
    {"cgToleranceLarge", run_with("cg_tolerance = 5"), ":3:16: ", "less than 1"},
    {"cgWithDirect", run_with("solver = \"direct\"\ncg_iterations = 5"), ":4:17: ", "direct"},
    {"everyZero", run_with("every = 0"), ":3:9: ", "from 1"},
    {"newtonReal", run_with("newton_max = 1.5"), ":3:14: ", "whole number"},
    {"thicknessMissing", shell_with("young = \"1MPa\"\npoisson = 0.3\n"), ":3:1: ", "no 'thickness'"},
    {"thicknessNegative", shell_with("thickness = \"-1mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n"),
     ":6:13: ", "greater than zero"},
    {"thicknessBare", shell_with("thickness = 1\nyoung = \"1MPa\"\npoisson = 0.3\n"), ":6:13: ", "no unit"},
    {"thicknessBareText", shell_with("thickness = \"1\"\nyoung = \"1MPa\"\npoisson = 0.3\n"), ":6:13: ", "no unit"},
    {"thicknessUnit", shell_with("thickness = \"1MPa\"\nyoung = \"1MPa\"\npoisson = 0.3\n"), ":6:13: ", "a length"},
    {"thicknessNan", shell_with("thickness = \"nanmm\"\nyoung = \"1MPa\"\npoisson = 0.3\n"), ":6:13: ", "a length"},
    {"thicknessList", shell_with("thickness = [\"1mm\"]\nyoung = \"1MPa\"\npoisson = 0.3\n"), ":6:13: ", "text"},
    {"youngZero", shell_with("thickness = \"1mm\"\nyoung = \"0MPa\"\npoisson = 0.3\n"), ":7:9: ", "greater than zero"},
    {"poissonHalf", shell_with("thickness = \"1mm\"\nyoung = \"1MPa\"\npoisson = 0.5\n"), ":8:11: ", "outside"},
    {"poissonLow", shell_with("thickness = \"1mm\"\nyoung = \"1MPa\"\npoisson = -1\n"), ":8:11: ", "outside"},
    {"poissonText", shell_with("thickness = \"1mm\"\nyoung = \"1MPa\"\npoisson = \"0.3\"\n"), ":8:11: ", "number"},
    {"scaleZero", basic("scale = 0\n"), ":9:9: ", "greater than zero"},
    {"unitUnknown", basic("unit = \"inch\"\n"), ":9:8: ", "unit of length"},
    {"bendingUnknown", basic("bending = \"dtk\"\n"), ":9:11: ", "did you mean 'dkt'?"},
    {"densityZero", basic("density = \"0kg/m3\"\n"), ":9:11: ", "greater than zero"},
    {"meshMissing",
     std::string(run) +
         "[[shell]]\nname = \"a\"\nmesh = \"b.ply\"\nthickness = \"1mm\"\nyoung = \"1MPa\"\npoisson = 0\n",
     ":5:8: ", "no such file"},
    {"shellsOfOneName", std::string(run) + plate + plate, ":10:8: ", "two bodies"},
    {"fixBody", basic("[[fix]]\nbody = \"plat\"\nwhere = {all = true}\ntranslation = \"x\"\nrotation = \"\"\n"),
     ":10:8: ", "no body \"plat\""},
    {"fixWhereMissing", basic("[[fix]]\nbody = \"plate\"\n"), ":9:1: ", "no 'where'"},
    {"fixTranslationMissing", basic("[[fix]]\nbody = \"plate\"\nwhere = {all = true}\nrotation = \"\"\n"),
     ":9:1: ", "no 'translation'"},
    {"fixHoldsNothing", basic("[[fix]]\nbody = \"plate\"\nwhere = {all = true}\ntranslation = \"\"\nrotation = \"\"\n"),
     ":12:15: ", "holds nothing"},
    {"fixComponent", basic("[[fix]]\nbody = \"plate\"\nwhere = {all = true}\ntranslation = \"xw\"\nrotation = \"\"\n"),
     ":12:15: ", "each held axis once"},
    {"fixComponentTwice",
     basic("[[fix]]\nbody = \"plate\"\nwhere = {all = true}\ntranslation = \"xx\"\nrotation = \"\"\n"),
     ":12:15: ", "each held axis once"},
    {"fixDisplacementNotHeld",
     basic("[[fix]]\nbody = \"plate\"\nwhere = {all = true}\ntranslation = \"x\"\nrotation = \"\"\n"
           "displacement = [\"0mm\", \"1mm\", \"0mm\"]\n"),
     ":14:16: ", "add y to translation"},
    {"fixRigidMotionsWithRotation",
     basic("[[fix]]\nbody = \"plate\"\nwhere = {rigid_motions = true}\nrotation = \"x\"\n"),
     ":12:12: ", "rigid_motions"},
    {"whereEmpty", fix_where("{}"), ":11:9: ", "exactly one"},
    {"whereTwo", fix_where("{all = true, boundary = true}"), ":11:9: ", "exactly one"},
    {"whereFalse", fix_where("{all = false}"), ":11:16: ", "selects nothing"},
    {"whereUnknown", fix_where("{boundry = true}"), ":11:10: ", "did you mean 'boundary'?"},
    {"whereText", fix_where("\"boundary\""), ":11:9: ", "table"},
    {"whereNoSuchNode", fix_where("{nodes = [25]}"), ":11:9: ", "no node 25"},
    {"whereNodeNegative", fix_where("{nodes = [-1]}"), ":11:19: ", "whole numbers"},
    {"whereNodeTwice", fix_where("{nodes = [2, 2]}"), ":11:9: ", "twice"},
    {"whereNoNodes", fix_where("{nodes = []}"), ":11:9: ", "selects no node"},
    {"whereNothingBelow", fix_where("{below = {axis = \"z\", at = \"-1mm\"}}"), ":11:9: ", "reaches from (0, 0, 0)"},
    {"whereAxis", fix_where("{below = {axis = \"w\", at = \"-1mm\"}}"), ":11:26: ", "known are x, y, z"},
    {"whereAtMissing", fix_where("{below = {axis = \"z\"}}"), ":11:18: ", "no 'at'"},
    {"whereBoxUpsideDown", fix_where(R"({box = [["1mm", "0mm", "0mm"], ["0mm", "1mm", "1mm"]]})"), ":11:16: ", "swap"},
    {"whereBoxShort", fix_where(R"({box = [["1mm", "0mm", "0mm"]]})"), ":11:16: ", "upper corner"},
    {"whereBoxBare", fix_where(R"({box = [[0, "0mm", "0mm"], ["1mm", "1mm", "1mm"]]})"), ":11:18: ", "no unit"},
    {"sphereRadius", fix_where(R"({sphere = {centre = ["1mm", "0mm", "0mm"], radius = "-1mm"}})"),
     ":11:61: ", "negative"},
    {"boundaryOfAClosedBody",
     std::string(run) + ball +
         "[[fix]]\nbody = \"ball\"\nwhere = {boundary = true}\ntranslation = \"x\"\nrotation = \"\"\n",
     ":11:9: ", "closed"},
    {"loadKindMissing", load_with("value = \"1kPa\""), ":9:1: ", "no 'kind'"},
    {"loadKind", load_with("kind = \"presure\"\nvalue = \"1kPa\""), ":11:8: ", "did you mean 'pressure'?"},
    {"loadValueMissing", load_with("kind = \"pressure\""), ":9:1: ", "no 'value'"},
    {"loadValueUnit", load_with("kind = \"pressure\"\nvalue = \"1N\""), ":12:9: ", "a pressure"},
    {"loadValueShort", load_with("kind = \"force\"\nwhere = {all = true}\nvalue = [\"1N\", \"1N\"]"),
     ":13:9: ", "three"},
    {"loadWhereMissing", load_with("kind = \"force\"\nvalue = [\"1N\", \"1N\", \"1N\"]"), ":9:1: ", "no 'where'"},
    {"loadWhereOfArea", load_with("kind = \"area\"\nwhere = {all = true}\nvalue = [\"1Pa\", \"1Pa\", \"1Pa\"]"),
     ":12:9: ", "whole body"},
    {"pressureOnNoTriangle", load_with("kind = \"pressure\"\nwhere = {nodes = [3]}\nvalue = \"1kPa\""),
     ":12:9: ", "no triangle has all its nodes"},
    {"slideWithTranslation",
     basic("[[fix]]\nbody = \"plate\"\nwhere = {boundary = true}\nslide = true\ntranslation = \"x\"\n"),
     ":13:15: ", "beside slide"},
    {"slideOfNoRim", basic("[[fix]]\nbody = \"plate\"\nwhere = {nodes = [0, 1]}\nslide = true\n"),
     ":11:9: ", "no rim has all its nodes"},
    {"slideOfRigidMotions", basic("[[fix]]\nbody = \"plate\"\nwhere = {rigid_motions = true}\nslide = true\n"),
     ":12:9: ", "rigid_motions"},
    {"rigidMotionsAndMore", basic("[[fix]]\nbody = \"plate\"\nwhere = {rigid_motions = true}\n") + clamped,
     ":11:9: ", "keep one of them"},
    {"supportUnit", basic("[[support]]\nbody = \"plate\"\nstiffness = \"1kPa\"\n"), ":11:13: ", "1kPa/mm"},
    {"supportNone", basic("[[support]]\nbody = \"plate\"\nstiffness = \"0N/m3\"\n"), ":11:13: ", "greater than zero"},
    {"supportDirection", basic("[[support]]\nbody = \"plate\"\nstiffness = \"1N/m3\"\ndirection = \"normals\"\n"),
     ":12:13: ", "did you mean 'normal'?"},
    {"loadWhereRigid", load_with("kind = \"force\"\nwhere = {rigid_motions = true}\nvalue = [\"1N\", \"1N\", \"1N\"]"),
     ":12:9: ", "select nodes"},
    {"loadFollowerOfForce",
     load_with("kind = \"force\"\nfollower = true\nwhere = {all = true}\nvalue = [\"1N\", \"1N\", \"1N\"]"),
     ":12:12: ", "follower"},
    {"loadFollowerText", load_with("kind = \"pressure\"\nfollower = \"yes\"\nvalue = \"1kPa\""),
     ":12:12: ", "true or false"},
    {"edgeWithoutEdges",
     load_with("kind = \"edge\"\nwhere = {nodes = [0, 12]}\nvalue = [\"0N/mm\", \"0N/mm\", \"1N/mm\"]"),
     ":12:9: ", "no boundary edge"},
    {"gravityWithoutDensity", load_with("kind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"1m/s2\"]"),
     ":3:1: ", "density"},
    {"rampFalls", load_with("kind = \"pressure\"\nvalue = \"1kPa\"\nramp = [[0.0, 0], [0.0, 1]]"),
     ":13:20: ", "increase"},
    {"rampEmpty", load_with("kind = \"pressure\"\nvalue = \"1kPa\"\nramp = []"), ":13:8: ", "empty"},
    {"rampPair", load_with("kind = \"pressure\"\nvalue = \"1kPa\"\nramp = [1, 2]"), ":13:9: ", "pairs"},
    {"rampFactor", load_with("kind = \"pressure\"\nvalue = \"1kPa\"\nramp = [[0.0, \"1\"]]"), ":13:15: ", "number"},
    {"probeName", basic("[[probe]]\nname = \"a/b\"\nbody = \"plate\"\nnearest = [\"0mm\", \"0mm\", \"0mm\"]\n"),
     ":10:8: ", "letters"},
    {"probeNearest", basic("[[probe]]\nname = \"a\"\nbody = \"plate\"\n"), ":9:1: ", "no 'nearest'"},
    {"probesOfOneName",
     basic("[[probe]]\nname = \"a\"\nbody = \"plate\"\nnearest = [\"0mm\", \"0mm\", \"0mm\"]\n"
           "[[probe]]\nname = \"a\"\nbody = \"plate\"\nnearest = [\"0mm\", \"0mm\", \"0mm\"]\n"),
     ":14:8: ", "two probes"},
};

TEST(SceneManual, standsInTheManualsPage) {
  const std::filesystem::path page = std::filesystem::path(__FILE__).parent_path() / "../../../../docs/scene.md";
  const std::string text = read_file(page, std::size_t{1} << 20);
  EXPECT_TRUE(text.ends_with(scene_manual())) << "docs/scene.md must end with the keys as they are:\n"
                                              << scene_manual();
}

constexpr const char* without_thickness =
    "[[shell]]\nname = \"plate\"\nmesh = \"plate.ply\"\nyoung = \"1MPa\"\npoisson = 0.3\n";

TEST_F(SceneTest, ThicknessOfEveryVertexComesFromTheMesh) {
  TriangleMesh mesh = square(4);
  std::vector<double> quality;  // any property will do
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    quality.push_back(0.1 + 0.01 * static_cast<double>(i));
  }
  write_ply(folder_ / "plate.ply", mesh, quality, {.overwrite = true});
  const std::string text = std::string(run) + without_thickness + "thickness_from = \"quality\"\n";
  EXPECT_EQ(load(text).model.shells[0].thickness, quality);
  EXPECT_EQ(load(scene_text(read(text))).model.shells[0].thickness, quality);
  const auto refused = [&](const std::string& scene, const std::string& says) {
    try {
      (void)load(scene);
      FAIL() << scene;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), StartsWith(path().string() + ":"));
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  };
  refused(std::string(run) + without_thickness, "no 'thickness' (nor thickness_from)");
  refused(basic("thickness_from = \"quality\"\n"), "contradict");
  refused(std::string(run) + without_thickness + "thickness_from = \"wall\"\n", "has no number 'wall'");
  for (const double wrong : {0.0, -1.0}) {
    quality[7] = wrong;
    write_ply(folder_ / "plate.ply", mesh, quality, {.overwrite = true});
    refused(text, "at vertex 7");
  }
  for (const double wrong : {std::nan(""), HUGE_VAL}) {
    quality[7] = wrong;
    write_ply(folder_ / "plate.ply", mesh, quality, {.overwrite = true});
    refused(text, "plate.ply");
  }
}

INSTANTIATE_TEST_SUITE_P(all, WrongScene, ::testing::ValuesIn(wrong_scenes),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(SceneTest, DamagedTextNeverCrashes) {
  const std::string text = scene_text(read(basic(clamped)));
  load_damaged(text, {'\0', '"', ']', '{', '\xff', '9'});
}

}  // namespace
}  // namespace tunica::test
