// The sections of bodies beside shells, and of what is between bodies.
#include "scene_fixture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <numbers>

namespace tunica::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

// Lines 1 to 8: a run and the plate, 10 x 10 x 0.1 mm, its middle at z = 0.
constexpr const char* quasi_static = "[run]\nkind = \"static\"\n";

// Six lines.
std::string solid(const std::string& name = "cube", const std::string& mesh = "cube.msh") {
  return fmt::format("[[solid]]\nname = \"{}\"\nmesh = \"{}\"\nunit = \"mm\"\nyoung = \"60kPa\"\npoisson = 0.3\n", name,
                     mesh);
}

// Three lines and `keys`.
std::string rigid(const std::string& shape, const std::string& keys, const std::string& name = "stone") {
  return fmt::format("[[rigid]]\nname = \"{}\"\nshape = \"{}\"\n{}\n", name, shape, keys);
}

// Five lines.
std::string sphere(const std::string& name = "stone") {
  return rigid("sphere", "centre = [\"5mm\", \"5mm\", \"20mm\"]\nradius = \"1mm\"", name);
}

// Two lines and `keys`.
std::string contact(const std::string& a, const std::string& b, const std::string& keys = {}) {
  return fmt::format("[[contact]]\nbetween = [\"{}\", \"{}\"]\n{}", a, b, keys);
}

// Four lines and `keys`.
std::string attach(const std::string& body, const std::string& where, const std::string& to,
                   const std::string& keys = {}) {
  return fmt::format("[[attach]]\nbody = \"{}\"\nwhere = {}\nto = \"{}\"\n{}", body, where, to, keys);
}

// Four lines and `keys`.
std::string fix(const std::string& body, const std::string& where, const std::string& keys = {}) {
  return fmt::format("[[fix]]\nbody = \"{}\"\nwhere = {}\ntranslation = \"xyz\"\n{}", body, where, keys);
}

std::string with_plate(const std::string& more) { return std::string(quasi_static) + plate + more; }
std::string with_solid(const std::string& more) { return with_plate(solid() + more); }  // `more` begins in line 15

/// With cube.msh (10 mm, from the origin, in six tetrahedra around its diagonal), lifted.msh (the same, half a wall of
/// the plate higher), inward.ply (a ball whose triangles face inward).
class BodiesTest : public SceneTest {
protected:
  BodiesTest() {
    (void)folder_.file("cube.msh", cube(0));
    (void)folder_.file("lifted.msh", cube(0.05));
    TriangleMesh inward = flat_facets(octahedron(10));
    for (auto& triangle : inward.triangles) {
      std::swap(triangle[0], triangle[1]);
    }
    write_ply(folder_ / "inward.ply", inward, {});
  }

  static std::string cube(double z) {
    std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n";
    for (int i = 0; i < 8; ++i) {
      text += fmt::format("{} {} {} {}\n", i + 1, 10 * (i & 1), 10 * (i >> 1 & 1), z + 10 * (i >> 2 & 1));
    }
    text += "$EndNodes\n$Elements\n6\n";
    constexpr std::array<std::array<int, 2>, 6> ways{
        {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}}};  // round the diagonal from corner 0 to corner 7
    for (std::size_t i = 0; i < ways.size(); ++i) {
      text += fmt::format("{} 4 2 0 1 1 {} {} 8\n", i + 1, ways[i][0] + 1, ways[i][1] + 1);
    }
    return text + "$EndElements\n";
  }

  /// What the resolved text says, having been read again: it must be the same.
  Scene again(const Scene& scene) {
    const std::string text = scene_text(scene);
    Scene second = read(text);
    EXPECT_EQ(scene_text(second), text);
    return second;
  }
};

TEST_F(BodiesTest, SolidsAreNumberedAfterTheShells) {
  const LoadedScene loaded = load(quasi_static + solid() + plate + solid("second") +
                                  "density = \"1g/cm3\"\nlaw = \"neo-hookean\"\nscale = 2\n");
  const Model& model = loaded.model;
  ASSERT_EQ(model.solids.size(), 2U);
  ASSERT_EQ(model.body_count(), 3U);
  EXPECT_EQ(model.name_of(0), "plate");
  EXPECT_EQ(model.name_of(1), "cube");
  EXPECT_EQ(model.solids[0].law, SolidLaw::corotational);
  EXPECT_DOUBLE_EQ(model.solids[0].material.young, 0.06);
  EXPECT_EQ(model.solids[0].mesh.vertices.size(), 8U);
  EXPECT_EQ(model.solids[0].mesh.tetrahedra.size(), 6U);
  EXPECT_EQ(model.solids[0].said_at, path().string() + ":3:1");
  EXPECT_EQ(model.solids[1].law, SolidLaw::neo_hookean);
  EXPECT_DOUBLE_EQ(model.solids[1].material.density.value(), 1e-9);
  EXPECT_DOUBLE_EQ(model.solids[1].mesh.vertices[7].x(), 20);
}

TEST_F(BodiesTest, ASceneMayHaveNoShell) { EXPECT_EQ(load(quasi_static + solid()).model.body_count(), 1U); }

TEST_F(BodiesTest, ASurfaceIsFilled) {
  const std::string text =
      "[[solid]]\nname = \"stuffed\"\nfill = \"ball.ply\"\nsize = \"5mm\"\nyoung = \"60kPa\"\npoisson = 0.4999\n";
  const Scene scene = read(with_plate(text));
  EXPECT_DOUBLE_EQ(scene.solids.at(0).fill_size.value(), 5);
  EXPECT_EQ(again(scene).solids.at(0).fill_size, scene.solids.at(0).fill_size);
  EXPECT_FALSE(load_scene(scene).model.solids.at(0).mesh.tetrahedra.empty());
}

TEST_F(BodiesTest, SelectionsLoadsAndProbesKnowSolids) {
  const LoadedScene loaded = load(with_solid(
      "density = \"1g/cm3\"\n" + fix("cube", "{below = {axis = \"z\", at = \"0mm\"}}") +
      fix("cube", "{nodes = [7]}", "rotation = \"\"\ndisplacement = [\"0mm\", \"0mm\", \"1mm\"]\n") +
      "[[load]]\nbody = \"cube\"\nkind = \"pressure\"\nvalue = \"1kPa\"\n"
      "[[load]]\nbody = \"cube\"\nkind = \"force\"\nwhere = {boundary = true}\nvalue = [\"1N\", \"0N\", \"0N\"]\n"
      "[[load]]\nbody = \"cube\"\nkind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"-9.81m/s2\"]\n"
      "[[load]]\nbody = \"cube\"\nkind = \"area\"\nvalue = [\"0Pa\", \"1Pa\", \"0Pa\"]\n"
      "[[probe]]\nname = \"top\"\nbody = \"cube\"\nnearest = [\"9mm\", \"9mm\", \"12mm\"]\n"));
  const Model& model = loaded.model;
  ASSERT_EQ(model.fixes.size(), 2U);
  EXPECT_EQ(model.fixes[0].body, 1U);
  EXPECT_THAT(model.fixes[0].nodes, ElementsAre(0U, 1U, 2U, 3U));
  EXPECT_THAT(model.fixes[0].rotation, ElementsAre(false, false, false));
  EXPECT_EQ(model.fixes[1].displacement.z(), 1);
  ASSERT_EQ(model.loads.size(), 4U);
  EXPECT_EQ(model.loads[0].body, 1U);
  EXPECT_EQ(std::get<ForceLoad>(model.loads[1].kind).nodes.size(), 8U);
  EXPECT_EQ(model.probes.at(0).node, 7U);
}

TEST_F(BodiesTest, EveryShapeOfARigidBodyArrives) {
  const std::string moving =
      "[run]\nkind = \"dynamic\"\nduration = \"1s\"\nstep = \"10ms\"\n" + std::string(plate) + "density = \"1g/cm3\"\n";
  const std::string turning =
      "[[rigid]]\nname = \"stent\"\nmesh = \"ball.ply\"\nscale = 0.5\n"
      "turn = {point = [\"1mm\", \"0mm\", \"0mm\"], axis = [1, 1, 1], angle = [[\"0s\", 0], [\"1s\", 33.3]]}\n"
      "expand = {point = [\"0mm\", \"1mm\", \"0mm\"], axis = [0.0, 0.0, 2.0], factor = [[\"0.1s\", 1.0], [\"1s\", "
      "1.7]]}\n"
      "motion = [[\"0s\", [\"0mm\", \"0mm\", \"0mm\"]], [\"1s\", [\"5mm\", \"0mm\", \"0mm\"]]]\n";
  const std::string text =
      moving + rigid("sphere", "centre = [\"1mm\", \"2mm\", \"3cm\"]\nradius = \"2mm\"", "a") +
      rigid("capsule",
            "from = [\"-8mm\", \"0mm\", \"9mm\"]\n"
            "to = [[\"0s\", [\"8mm\", \"0mm\", \"9mm\"]], [\"500ms\", [\"9mm\", \"0mm\", \"9mm\"]]]\n"
            "radius = [[\"0s\", \"1mm\"], [\"1s\", \"3mm\"]]",
            "b") +
      rigid("cylinder",
            "from = [\"0mm\", \"0mm\", \"9mm\"]\nto = [\"0mm\", \"0mm\", \"19mm\"]\nradius = [[\"0.5s\", \"1.1mm\"]]",
            "c") +
      rigid("plane", "point = [\"0mm\", \"0mm\", \"-3mm\"]\nnormal = [0, 3, 4]", "d") + turning +
      contact("plate", "a") + contact("b", "plate") + contact("plate", "c") + contact("plate", "d") +
      contact("plate", "stent");
  const Scene scene = read(text);
  EXPECT_THAT(texts_of(scene.warnings), IsEmpty());
  for (const Scene& one : {scene, again(scene)}) {
    ASSERT_EQ(one.rigids.size(), 5U);
    const auto& ball = std::get<RigidSphere>(one.rigids[0].shape);
    EXPECT_EQ(ball.centre.at(0.3), Vec3(1, 2, 30));
    EXPECT_EQ(ball.radius.at(0.3), 2);
    EXPECT_FALSE(one.rigids[0].motion);
    const auto& capsule = std::get<RigidCapsule>(one.rigids[1].shape);
    EXPECT_EQ(capsule.from.at(0), Vec3(-8, 0, 9));
    EXPECT_EQ(capsule.to.at(0.25), Vec3(8.5, 0, 9));
    EXPECT_EQ(capsule.radius.at(0.5), 2);
    const auto& cylinder = std::get<RigidCylinder>(one.rigids[2].shape);
    EXPECT_EQ(cylinder.radius.points, (std::vector<std::pair<double, double>>{{0.5, 1.1}}));
    const auto& plane = std::get<RigidPlane>(one.rigids[3].shape);
    EXPECT_LT((plane.normal - Vec3(0, 0.6, 0.8)).norm(), 1e-15);
    const auto& stent = std::get<SceneRigidMesh>(one.rigids[4].shape);
    EXPECT_EQ(stent.scale, 0.5);
    EXPECT_NEAR(stent.turn.value().angle.at(1), 33.3 * std::numbers::pi / 180, 1e-15);
    EXPECT_NEAR(stent.turn.value().axis.x(), 1 / std::sqrt(3.0), 1e-15);
    EXPECT_EQ(stent.expansion.value().axis, Vec3(0, 0, 1));
    EXPECT_NEAR(stent.expansion.value().factor.at(0.55), 1.35, 1e-12);
    EXPECT_EQ(one.rigids[4].motion.value().at(0.5), Vec3(2.5, 0, 0));
  }
  EXPECT_EQ(std::get<SceneRigidMesh>(again(scene).rigids[4].shape).turn->axis,
            std::get<SceneRigidMesh>(scene.rigids[4].shape).turn->axis);
  const Model model = load_scene(scene).model;
  ASSERT_EQ(model.rigids.size(), 5U);
  EXPECT_TRUE(std::holds_alternative<RigidPlane>(model.rigids[3].shape));
  const auto& mesh = std::get<RigidMesh>(model.rigids[4].shape);
  EXPECT_EQ(mesh.surface.vertices.at(0), Vec3(5, 0, 0));
  EXPECT_TRUE(mesh.turn && mesh.expansion);
  EXPECT_EQ(model.rigids[4].name, "stent");
}

TEST_F(BodiesTest, InAStaticRunTablesAreOverTheLoadFactor) {
  const Scene scene = read(with_plate(rigid("sphere",
                                            "centre = [[0.0, [\"0mm\", \"0mm\", \"9mm\"]], [1.0, [\"0mm\", \"0mm\", "
                                            "\"8mm\"]]]\nradius = [[\"0s\", \"1mm\"], [\"1s\", \"3mm\"]]") +
                                      contact("stone", "plate")));
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_THAT(scene.warnings[0].text, StartsWith(path().string() + ":13:10: "));
  EXPECT_THAT(scene.warnings[0].text, HasSubstr("radius is read over the load factor"));
  EXPECT_EQ(std::get<RigidSphere>(scene.rigids.at(0).shape).centre.at(0.5), Vec3(0, 0, 8.5));
  EXPECT_TRUE(again(scene).warnings.empty());
}

TEST_F(BodiesTest, RigidMeshesAreTurnedOutwardAndIdleBodiesDoubted) {
  const LoadedScene loaded =
      load(with_plate("[[rigid]]\nname = \"in\"\nmesh = \"inward.ply\"\n" + sphere("idle") + contact("in", "plate")));
  const auto& surface = std::get<RigidMesh>(loaded.model.rigids.at(0).shape).surface;
  EXPECT_GT(signed_volume(surface), 0);
  EXPECT_THAT(texts_of(loaded.warnings),
              UnorderedElementsAre(HasSubstr("no [[contact]] names \"idle\""), HasSubstr("has no normals"),
                                   HasSubstr("its normals point inward")));
}

TEST_F(BodiesTest, ContactsAreResolvedToParties) {
  const Scene scene = read(
      with_solid(sphere() + contact("stone", "cube", "friction = 0.2\nresolution = \"2.5%\"\nsurface = \"facets\"\n") +
                 contact("plate", "plate", "name = \"folds\"\ntransfer = \"paper\"\n") + contact("plate", "cube")));
  ASSERT_EQ(scene.contacts.size(), 3U);
  EXPECT_THAT(texts_of(scene.warnings), ElementsAre(HasSubstr("not in balance")));
  for (const Scene& one : {scene, again(scene)}) {
    const Model model = load_scene(one).model;
    ASSERT_EQ(model.contacts.size(), 3U);
    const Contact& first = model.contacts[0];
    EXPECT_EQ(first.name, "stone-cube");
    EXPECT_TRUE(first.between[0].rigid);
    EXPECT_EQ(first.between[0].index, 0U);
    EXPECT_FALSE(first.between[1].rigid);
    EXPECT_EQ(first.between[1].index, 1U);
    EXPECT_EQ(first.friction, 0.2);
    EXPECT_EQ(first.resolution, 0.025);
    EXPECT_FALSE(first.curved);
    EXPECT_TRUE(first.consistent);
    EXPECT_EQ(model.contacts[1].name, "folds");
    EXPECT_EQ(model.contacts[1].between[1].index, 0U);
    EXPECT_FALSE(model.contacts[1].consistent);
    EXPECT_EQ(model.contacts[2].friction, 0);
    EXPECT_EQ(model.contacts[2].resolution, 0.05);
    EXPECT_TRUE(model.contacts[2].curved);
  }
}

TEST_F(BodiesTest, TouchingNodesLieOnTheChosenFace) {
  const auto attached = [&](const std::string& mesh, const std::string& distance, const std::string& side) {
    try {
      const Scene scene =
          read(with_plate(solid("cube", mesh) + attach("cube", "{touching = \"" + distance + "\"}", "plate", side)));
      const Model model = load_scene(again(scene)).model;
      EXPECT_EQ(model.attachments.at(0).body, 1U);
      EXPECT_EQ(model.attachments.at(0).to, 0U);
      return model.attachments.at(0).nodes.size();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("selects no node: the closest lies"));
      return std::size_t{0};
    }
  };
  EXPECT_EQ(attached("cube.msh", "0mm", ""), 4U);
  EXPECT_EQ(attached("cube.msh", "0.049mm", "side = \"outer\"\n"), 0U);
  EXPECT_EQ(attached("cube.msh", "0.051mm", "side = \"inner\"\n"), 4U);
  EXPECT_EQ(attached("lifted.msh", "1um", "side = \"outer\"\n"), 4U);
  EXPECT_EQ(attached("lifted.msh", "0.049mm", "side = \"middle\"\n"), 0U);
  EXPECT_EQ(attached("lifted.msh", "0.051mm", "side = \"middle\"\n"), 4U);
  EXPECT_EQ(attached("lifted.msh", "0.099mm", "side = \"inner\"\n"), 0U);
  EXPECT_EQ(attached("lifted.msh", "0.101mm", "side = \"inner\"\n"), 4U);
}

TEST_F(BodiesTest, ShellsAreCarriedBySolidsAndChainsByEachOther) {
  const LoadedScene loaded =
      load(with_solid(attach("plate", "{touching = \"1um\"}", "cube") + solid("top", "lifted.msh") +
                      attach("cube", "{above = {axis = \"z\", at = \"10mm\"}}", "top")));
  const std::vector<Attachment>& attachments = loaded.model.attachments;
  ASSERT_EQ(attachments.size(), 2U);
  EXPECT_EQ(attachments[0].nodes.size(), 25U);
  EXPECT_EQ(attachments[0].to, 1U);
  EXPECT_EQ(attachments[0].said_at, path().string() + ":15:1");
  EXPECT_THAT(attachments[1].nodes, ElementsAre(4U, 5U, 6U, 7U));
}

TEST_F(BodiesTest, TouchingFollowsTheCurvedSurface) {
  // A corner of the cube on the sphere, half way between three corners of the octahedron: 4 mm from the facet.
  const double along = 10 / std::sqrt(3.0);
  std::string mesh = cube(0);
  const std::string corner = "8 10 10 10\n";
  ASSERT_NE(mesh.find(corner), std::string::npos);
  mesh.replace(mesh.find(corner), corner.size(), fmt::format("8 {0} {0} {0}\n", along));
  (void)folder_.file("blunt.msh", mesh);
  const std::string ball =
      "[[shell]]\nname = \"ball\"\nmesh = \"ball.ply\"\nthickness = \"1mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n";
  const auto nodes = [&](const std::string& rest) {
    const LoadedScene loaded =
        load(quasi_static + ball + rest + solid("cube", "blunt.msh") + attach("cube", "{touching = \"3mm\"}", "ball"));
    return loaded.model.attachments.at(0).nodes;
  };
  EXPECT_THAT(nodes(""), ElementsAre(1U, 2U, 4U, 7U));
  EXPECT_THAT(nodes("rest = \"flat\"\n"), ElementsAre(1U, 2U, 4U));
}

TEST_F(BodiesTest, FilesOfMeshesAreListedOnce) {
  const Scene scene = read(with_solid("[[rigid]]\nname = \"in\"\nmesh = \"inward.ply\"\n" + solid("again")));
  EXPECT_THAT(mesh_files(scene), ElementsAre(folder_ / "plate.ply", folder_ / "cube.msh", folder_ / "inward.ply"));
}

class WrongBodies : public BodiesTest, public ::testing::WithParamInterface<Wrong> {
protected:
  void expect(ExitCode code) {
    const Wrong& wrong = GetParam();
    try {
      (void)load(wrong.text);
      FAIL() << "accepted:\n" << wrong.text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      EXPECT_THAT(error.what(), StartsWith(path().string() + wrong.place));
      EXPECT_THAT(error.what(), HasSubstr(wrong.says));
    }
  }
};

TEST_P(WrongBodies, IsAnErrorWithItsPlace) { expect(ExitCode::input); }

std::string solid_with(const std::string& lines) {
  return with_plate("[[solid]]\nname = \"cube\"\n" + lines + "\n");  // `lines` begin in line 11
}
// `keys` begin in line 12.
std::string rigid_with(const std::string& shape, const std::string& keys) { return with_plate(rigid(shape, keys)); }
std::string stent_with(const std::string& line) {
  return with_plate("[[rigid]]\nname = \"stent\"\nmesh = \"ball.ply\"\n" + line + "\n");  // `line` is line 12
}
// `keys` begin in line 16.
std::string contact_with(const std::string& keys) { return with_plate(sphere() + contact("stone", "plate", keys)); }

constexpr const char* soft = "\nyoung = \"1kPa\"\npoisson = 0.3";

const std::vector<Wrong> wrong_bodies{
    {"noBodyAtAll", quasi_static + sphere(), ":1:1: ", "no [[shell]] and no [[solid]]"},
    {"solidMeshMissing", solid_with(std::string("unit = \"mm\"") + soft), ":9:1: ", "no 'mesh' (nor fill)"},
    {"solidMeshAndFill", solid_with(std::string("mesh = \"a.msh\"\nfill = \"b.ply\"\nsize = \"1mm\"") + soft),
     ":12:8: ", "contradict"},
    {"solidSizeMissing", solid_with(std::string("fill = \"ball.ply\"") + soft), ":9:1: ", "no 'size'"},
    {"solidSizeZero", solid_with(std::string("fill = \"ball.ply\"\nsize = \"0mm\"") + soft),
     ":12:8: ", "greater than zero"},
    {"solidSizeTiny", solid_with(std::string("fill = \"ball.ply\"\nsize = \"1um\"") + soft),
     ":12:8: ", "choose a larger size"},
    {"solidSizeOfMesh", solid_with(std::string("mesh = \"cube.msh\"\nsize = \"1mm\"") + soft), ":12:8: ", "belongs to"},
    {"solidFillOpen", solid_with(std::string("fill = \"plate.ply\"\nsize = \"1mm\"") + soft), ":11:8: ", "closed"},
    {"solidFileMissing", solid_with(std::string("mesh = \"no.msh\"\nunit = \"mm\"") + soft), ":11:8: ", "no such file"},
    {"solidUnitMissing", solid_with(std::string("mesh = \"cube.msh\"") + soft), ":11:8: ", "add unit = \"mm\""},
    {"solidYoungMissing", solid_with("mesh = \"cube.msh\"\npoisson = 0.3"), ":9:1: ", "no 'young'"},
    {"solidPoissonHalf", solid_with("mesh = \"cube.msh\"\nyoung = \"1kPa\"\npoisson = 0.5"), ":13:11: ", "outside"},
    {"solidPoissonNearlyHalf", solid_with("mesh = \"cube.msh\"\nyoung = \"1kPa\"\npoisson = 0.49995"),
     ":13:11: ", "0.4999"},
    {"solidLaw", solid_with(std::string("mesh = \"cube.msh\"") + soft + "\nlaw = \"neohookean\""),
     ":14:7: ", "did you mean 'neo-hookean'?"},
    {"solidKey", solid_with(std::string("mesh = \"cube.msh\"") + soft + "\nthickness = \"1mm\""),
     ":14:1: ", "unknown key"},
    {"solidName", with_plate(solid("a/b")), ":10:8: ", "cannot name a solid"},
    {"solidWithoutDensity", "[run]\nkind = \"dynamic\"\nduration = \"1s\"\nstep = \"1s\"\n" + solid(),
     ":5:1: ", "has no density"},
    {"solidGravityWithoutDensity",
     with_solid("[[load]]\nbody = \"cube\"\nkind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"1m/s2\"]\n"),
     ":9:1: ", "its gravity load"},
    {"solidNamedAsShell", with_plate(solid("plate")), ":10:8: ", "two bodies"},
    {"rigidNamedAsSolid", with_solid(sphere("cube")), ":16:8: ", "two bodies"},
    {"contactNamedAsBody", contact_with("name = \"plate\"\n"), ":16:8: ", "bodies or contacts named \"plate\""},
    {"contactsOfOneName", contact_with("name = \"x\"\n" + contact("plate", "plate", "name = \"x\"\n")),
     ":19:8: ", "bodies or contacts named \"x\""},
    {"fixOnSolidHoldsRotation", with_solid(fix("cube", "{all = true}", "rotation = \"z\"\n")),
     ":19:12: ", "have no rotation"},
    {"fixOnShellNeedsRotation", with_plate(fix("plate", "{all = true}")), ":9:1: ", "no 'rotation'"},
    {"fixOnRigid", with_plate(sphere() + fix("stone", "{all = true}", "rotation = \"\"\n")), ":15:8: ", "is rigid"},
    {"fixTouching", with_plate(fix("plate", "{touching = \"1mm\"}", "rotation = \"\"\n")), ":11:10: ", "unknown key"},
    {"momentOnSolid",
     with_solid("[[load]]\nbody = \"cube\"\nkind = \"moment\"\nwhere = {all = true}\n"
                "value = [\"1N*mm\", \"0N*mm\", \"0N*mm\"]\n"),
     ":17:8: ", "no rotation"},
    {"edgeOnSolid",
     with_solid("[[load]]\nbody = \"cube\"\nkind = \"edge\"\nwhere = {all = true}\n"
                "value = [\"1N/mm\", \"0N/mm\", \"0N/mm\"]\n"),
     ":17:8: ", "no edges"},
    {"solidHasNoSuchNode", with_solid(fix("cube", "{nodes = [8]}")), ":17:9: ", "no node 8"},
    {"solidNothingBelow", with_solid(fix("cube", "{below = {axis = \"z\", at = \"-1mm\"}}")),
     ":17:9: ", "to (10, 10, 10) mm"},
    {"shapeMissing", with_plate("[[rigid]]\nname = \"stone\"\n"), ":9:1: ", "no 'shape' (nor mesh)"},
    {"shapeUnknown", rigid_with("spere", ""), ":11:9: ", "did you mean 'sphere'?"},
    {"shapeAndMesh", rigid_with("sphere", "mesh = \"ball.ply\""), ":11:9: ", "contradict"},
    {"centreMissing", rigid_with("sphere", "radius = \"1mm\""), ":9:1: ", "no 'centre'"},
    {"keyOfAnotherShape", rigid_with("sphere", "from = [\"0mm\", \"0mm\", \"0mm\"]"), ":12:8: ", "capsule, cylinder"},
    {"unitOfSphere", rigid_with("sphere", "unit = \"mm\""), ":12:8: ", "belongs to a rigid body of the shape mesh"},
    {"radiusNegative", rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = \"-1mm\""),
     ":13:10: ", "negative"},
    {"radiusNegativeInTable",
     rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = [[\"0s\", \"1mm\"], [\"1s\", \"-1mm\"]]"),
     ":13:33: ", "negative"},
    {"radiusTimesFall",
     rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = [[\"1s\", \"1mm\"], [\"1s\", \"2mm\"]]"),
     ":13:27: ", "times of radius must increase"},
    {"radiusEmpty", rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = []"), ":13:10: ", "empty"},
    {"radiusBare", rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = 1"), ":13:10: ", "no unit"},
    {"radiusPairs", rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = [[\"1s\"]]"),
     ":13:11: ", "list of pairs"},
    {"radiusOneInAList", rigid_with("sphere", "centre = [\"0mm\", \"0mm\", \"0mm\"]\nradius = [\"1mm\"]"),
     ":13:10: ", "a text with a number and a unit"},
    {"centreShort", rigid_with("sphere", "centre = [\"0mm\", \"0mm\"]\nradius = \"1mm\""), ":12:10: ", "three"},
    {"motionTimesFall",
     with_plate(sphere() + "motion = [[1, [\"0mm\", \"0mm\", \"0mm\"]], [0.5, [\"0mm\", \"0mm\", \"0mm\"]]]\n"),
     ":14:40: ", "times of motion must increase"},
    {"normalZero", rigid_with("plane", "point = [\"0mm\", \"0mm\", \"0mm\"]\nnormal = [0, 0, 0]"), ":13:10: ", "zero"},
    {"normalWithUnits",
     rigid_with("plane", "point = [\"0mm\", \"0mm\", \"0mm\"]\nnormal = [\"0mm\", \"0mm\", \"1mm\"]"),
     ":13:11: ", "number"},
    {"normalShort", rigid_with("plane", "point = [\"0mm\", \"0mm\", \"0mm\"]\nnormal = [0, 1]"),
     ":13:10: ", "three numbers"},
    {"cylinderWithoutAxis",
     rigid_with("cylinder", "radius = \"1mm\"\nfrom = [\"0mm\", \"0mm\", \"1mm\"]\nto = [\"0mm\", \"0mm\", \"1mm\"]"),
     ":14:6: ", "needs an axis"},
    {"cylinderTurnsOver",
     rigid_with("cylinder",
                "radius = \"1mm\"\nfrom = [\"0mm\", \"0mm\", \"0mm\"]\nto = [[0, [\"0mm\", \"0mm\", "
                "\"1mm\"]], [1, [\"0mm\", \"0mm\", \"-1mm\"]]]"),
     ":14:6: ", "turns over"},
    {"stentOpen", with_plate("[[rigid]]\nname = \"stent\"\nmesh = \"plate.ply\"\n"), ":11:8: ", "closed"},
    {"stentMissing", with_plate("[[rigid]]\nname = \"stent\"\nmesh = \"no.ply\"\n"), ":11:8: ", "no such file"},
    {"stentWithoutUnit", with_plate("[[rigid]]\nname = \"stent\"\nmesh = \"plate.off\"\n"), ":11:8: ", "unit = \"mm\""},
    {"stentScale", stent_with("scale = 0"), ":12:9: ", "greater than zero"},
    {"turnAxis", stent_with("turn = {point = [\"0mm\", \"0mm\", \"0mm\"], axis = [0, 0, 0], angle = 1.0}"),
     ":12:47: ", "zero"},
    {"turnAngle", stent_with("turn = {point = [\"0mm\", \"0mm\", \"0mm\"], axis = [0, 0, 1], angle = \"90\"}"),
     ":12:66: ", "number"},
    {"turnAngleMissing", stent_with("turn = {point = [\"0mm\", \"0mm\", \"0mm\"], axis = [0, 0, 1]}"),
     ":12:8: ", "no 'angle'"},
    {"expandFactor",
     stent_with("expand = {point = [\"0mm\", \"0mm\", \"0mm\"], axis = [0, 0, 1], factor = [[0, 1.0], [1, 0.0]]}"),
     ":12:84: ", "greater than zero"},
    {"turnOfSphere", with_plate(sphere() + "turn = {}\n"), ":14:8: ", "belongs to a rigid body of the shape mesh"},
    {"attachUnknownBody", with_solid(attach("cub", "{all = true}", "plate")), ":16:8: ", "no body \"cub\""},
    {"attachUnknownCarrier", with_solid(attach("cube", "{all = true}", "plat")), ":18:6: ", "no body \"plat\""},
    {"attachToRigid", with_plate(sphere() + attach("plate", "{all = true}", "stone")), ":17:6: ", "is rigid"},
    {"attachRigid", with_plate(sphere() + attach("stone", "{all = true}", "plate")), ":15:8: ", "is rigid"},
    {"attachToItself", with_solid(attach("cube", "{all = true}", "cube")), ":18:6: ", "itself"},
    {"attachWhereMissing", with_solid("[[attach]]\nbody = \"cube\"\nto = \"plate\"\n"), ":15:1: ", "no 'where'"},
    {"attachSide", with_solid(attach("cube", "{all = true}", "plate", "side = \"top\"\n")),
     ":19:8: ", "known are inner"},
    {"attachSideOfSolid", with_solid(attach("plate", "{all = true}", "cube", "side = \"middle\"\n")),
     ":19:8: ", "has no side"},
    {"attachRigidMotions", with_solid(attach("cube", "{rigid_motions = true}", "plate")), ":17:9: ", "select nodes"},
    {"attachTouchingNegative", with_solid(attach("cube", "{touching = \"-1mm\"}", "plate")), ":17:21: ", "negative"},
    {"attachTouchingNothing",
     with_plate(solid("cube", "lifted.msh") + attach("cube", "{touching = \"0.01mm\"}", "plate")),
     ":17:9: ", "the closest lies 0.05 mm"},
    {"attachNothing", with_solid(attach("cube", "{above = {axis = \"x\", at = \"11mm\"}}", "plate")),
     ":17:9: ", "selects no node"},
    {"attachTwice",
     with_solid(attach("cube", "{nodes = [0, 1]}", "plate") + attach("cube", "{nodes = [1, 2]}", "plate")),
     ":21:9: ", "node 1 of \"cube\" is carried by \"plate\" already"},
    {"attachFixed", with_solid(fix("cube", "{nodes = [3]}") + attach("cube", "{nodes = [3]}", "plate")),
     ":21:9: ", "is held by the [[fix]]"},
    {"attachRound", with_solid(attach("cube", "{nodes = [0]}", "plate") + attach("plate", "{nodes = [24]}", "cube")),
     ":22:6: ", "in a circle"},
    {"attachRoundThree",
     with_solid(solid("top") + attach("cube", "{nodes = [0]}", "plate") + attach("plate", "{nodes = [24]}", "top") +
                attach("top", "{nodes = [0]}", "cube")),
     ":32:6: ", "in a circle"},
    {"attachHeldByRigidMotions",
     with_solid("[[fix]]\nbody = \"plate\"\nwhere = {rigid_motions = true}\n" +
                attach("plate", "{nodes = [0]}", "cube")),
     ":17:9: ", "held already"},
    {"contactUnknown", with_plate(contact("plate", "balloon")), ":10:11: ", "no body \"balloon\""},
    {"contactOfThree", with_plate("[[contact]]\nbetween = [\"a\", \"b\", \"c\"]\n"), ":10:11: ", "names of two bodies"},
    {"contactOfNumbers", with_plate("[[contact]]\nbetween = [1, 2]\n"), ":10:12: ", "text"},
    {"contactBetweenMissing", with_plate("[[contact]]\nfriction = 0.1\n"), ":9:1: ", "no 'between'"},
    {"contactBothRigid", with_plate(sphere() + sphere("other") + contact("stone", "other")), ":20:11: ", "both rigid"},
    {"contactRigidItself", with_plate(sphere() + contact("stone", "stone")), ":15:11: ", "cannot touch itself"},
    {"contactTwice", contact_with(contact("plate", "stone", "name = \"x\"\n")), ":17:11: ", "two contacts"},
    {"contactSelfTwice", with_plate(contact("plate", "plate") + contact("plate", "plate", "name = \"x\"\n")),
     ":12:11: ", "two contacts"},
    {"frictionNegative", contact_with("friction = -0.1\n"), ":16:12: ", "negative"},
    {"frictionText", contact_with("friction = \"0.1\"\n"), ":16:12: ", "number"},
    {"resolutionZero", contact_with("resolution = \"0%\"\n"), ":16:14: ", "at most 50%"},
    {"resolutionLarge", contact_with("resolution = \"51%\"\n"), ":16:14: ", "at most 50%"},
    {"resolutionLength", contact_with("resolution = \"1mm\"\n"), ":16:14: ", "percent"},
    {"surfaceUnknown", contact_with("surface = \"flat\"\n"), ":16:11: ", "known are curved, facets"},
    {"transferUnknown", contact_with("transfer = \"pape\"\n"), ":16:12: ", "did you mean 'paper'?"},
    {"contactName", contact_with("name = \"a.b\"\n"), ":16:8: ", "cannot name a contact"},
};

INSTANTIATE_TEST_SUITE_P(all, WrongBodies, ::testing::ValuesIn(wrong_bodies),
                         [](const auto& test) { return std::string(test.param.name); });

class LaterBodies : public WrongBodies {};

TEST_P(LaterBodies, SaysNotAvailableYet) { expect(ExitCode::usage); }

std::string modes(const std::string& kind, const std::string& more) {
  return "[run]\nkind = \"" + kind + "\"\n" + plate + "density = \"1g/cm3\"\n" + more;  // `more` begins in line 10
}
std::string arc_length_with(const std::string& more) {
  return "[run]\nkind = \"static\"\ncontrol = \"arc-length\"\n" + std::string(plate) + more;  // in line 10
}
std::string accurate(const std::string& more) { return with_plate("[accuracy]\nwithin = \"2%\"\n" + more); }

constexpr const char* later = "not available yet";
const std::vector<Wrong> laters{
    {"solidInFrequencies", modes("frequencies", solid()), ":10:1: ", later},
    {"solidInBuckling", modes("buckling", solid()), ":10:1: ", later},
    {"solidByArcLength", arc_length_with(solid()), ":10:1: ", later},
    {"contactInFrequencies", modes("frequencies", contact("plate", "plate")), ":10:1: ", later},
    {"contactInBuckling", modes("buckling", contact("plate", "plate")), ":10:1: ", later},
    {"contactByArcLength", arc_length_with(contact("plate", "plate")), ":10:1: ", later},
    {"attachInFrequencies", modes("frequencies", attach("plate", "{all = true}", "plate")), ":10:1: ", later},
    {"attachInBuckling", modes("buckling", attach("plate", "{all = true}", "plate")), ":10:1: ", later},
    {"attachByArcLength", arc_length_with(attach("plate", "{all = true}", "plate")), ":10:1: ", later},
    {"contactLinear",
     "[run]\nkind = \"static\"\ngeometry = \"linear\"\n" + std::string(plate) + contact("plate", "plate"),
     ":10:1: ", later},
    {"accuracyOfSolid", accurate(solid()), ":9:1: ", later},
    {"accuracyOfContact", accurate(contact("plate", "plate")), ":9:1: ", later},
    {"accuracyOfAttach", accurate(attach("plate", "{all = true}", "plate")), ":9:1: ", later},
    {"accuracyOfRigid", accurate(sphere()), ":9:1: ", later},
    {"rigidMotionsOfSolid", with_solid("[[fix]]\nbody = \"cube\"\nwhere = {rigid_motions = true}\n"), ":17:9: ", later},
};

INSTANTIATE_TEST_SUITE_P(all, LaterBodies, ::testing::ValuesIn(laters),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(BodiesTest, DamagedTextNeverCrashes) {
  const std::string text =
      scene_text(read(with_solid(rigid("capsule",
                                       "from = [\"0mm\", \"0mm\", \"20mm\"]\nto = [[0, [\"0mm\", \"0mm\", \"30mm\"]]]\n"
                                       "radius = [[0, \"1mm\"], [1, \"2mm\"]]") +
                                 "[[rigid]]\nname = \"stent\"\nmesh = \"ball.ply\"\n"
                                 "turn = {point = [\"0mm\", \"0mm\", \"0mm\"], axis = [0, 0, 1], angle = 1.0}\n" +
                                 attach("cube", "{touching = \"1mm\"}", "plate") + contact("stone", "plate"))));
  load_damaged(text, {'"', ']', '{', '9'});
}

}  // namespace
}  // namespace tunica::test
