// What hints that an organ is not held as it is in the body.

#include "tunica/mechanics/runs/hold_doubts.hpp"
#include "tunica/mechanics/runs/meeting_walls.hpp"

#include "tets.hpp"
#include "tunica/mechanics/model/selection.hpp"
#include "tunica/mechanics/runs/doubts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica::hold_doubts {
namespace {

using namespace benchmarks;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A tube along z, rings 0 to `along`, with free rims.
Model tube(double radius, double length, double thickness, double pressure) {
  constexpr std::size_t around = 24, along = 16;
  ShellMesh mesh = tube_mesh(radius, radius, length, around, along);
  Model model;
  ShellBody body = flat_body(std::move(mesh), 2, 0.45, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  model.loads.push_back({0, PressureLoad{pressure, true}, {}});
  return model;
}

State at_rest(const Model& model) {
  State state;
  state.displacement.assign(model.node_count(), Vec3::Zero());
  state.rotation.assign(model.node_count(), Vec3::Zero());
  return state;
}

std::vector<std::string> kinds(const std::vector<Warning>& warnings) {
  std::vector<std::string> found;
  for (const Warning& warning : warnings) {
    found.push_back(warning.kind);
  }
  return found;
}

TEST(HoldDoubts, FreeEndsLackTheirThrust) {
  Model model = tube(10, 40, 1, 0.01);
  std::vector<Warning> found = doubts_of_ends(model);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].text, HasSubstr("2 open ends are free"));
  EXPECT_THAT(found[0].text, HasSubstr("3.11 N"));  // the polygon's area
  EXPECT_THAT(found[0].text, HasSubstr("rims:slide"));
  hold(
      model, [](const Vec3& p) { return p.z() < eps; }, "xyz", "xyz");
  found = doubts_of_ends(model);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].text, HasSubstr("an open end is free, at"));
  Fix slide;
  slide.nodes = nodes_where(model.shells[0].mesh, [](const Vec3& p) { return p.z() > 40 - eps; });
  slide.across = Vec3::UnitZ();
  model.fixes.push_back(slide);
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
  model.fixes.clear();
  model.loads.clear();
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
}

TEST(HoldDoubts, AnEndWhereNoPressureActsLacksNothing) {
  Model model = tube(10, 40, 1, 0.01);
  auto& pressure = std::get<PressureLoad>(model.loads[0].kind);
  const SelectableBody body(model.shells[0]);
  pressure.shares = shares_of(body, BoxNodes{Vec3(-20, -20, 10), Vec3(20, 20, 30)}, "here");
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
  // In two parts it is the same pressure.
  pressure.shares = shares_of(body, HalfSpaceNodes{2, 17, true}, "here");
  Load other = model.loads[0];
  std::get<PressureLoad>(other.kind).shares = shares_of(body, HalfSpaceNodes{2, 17, false}, "here");
  model.loads.push_back(other);
  const std::vector<Warning> found = doubts_of_ends(model);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].text, HasSubstr("3.11 N"));
}

TEST(HoldDoubts, ASecondLayerHoldsNoEnd) {
  Model model = tube(10, 40, 1, 0.01);
  model.shells.push_back(tube(11, 40, 1, 0.01).shells[0]);
  Attachment layer;
  layer.body = 1;
  for (Index i = 0; i < model.shells[1].mesh.vertices.size(); ++i) {
    layer.nodes.push_back(i);
  }
  model.attachments.push_back(layer);
  EXPECT_THAT(kinds(doubts_of_ends(model)), ElementsAre("free end"));
}

/// Two halves of a vessel, one tied to the rim of the other, whose shells lie half of one farther around.
TEST(HoldDoubts, AHalfThatCarriesTheOtherIsNoFreeEndAndItsSeamNoCrossing) {
  Model model = tube(10, 20, 1, 0.01);
  model.shells.push_back(model.shells[0]);
  model.shells[1].name = "other";
  ShellMesh& other = model.shells[1].mesh;
  const Mat3 turn = Eigen::AngleAxisd(pi / 24, Vec3::UnitZ()).toRotationMatrix();
  for (std::size_t v = 0; v < other.vertices.size(); ++v) {
    other.vertices[v] = turn * other.vertices[v] + Vec3(0, 0, 20);
    other.normals[v] = turn * other.normals[v];
  }
  model.loads.push_back({1, PressureLoad{0.01, true}, {}});
  for (const std::size_t b : {0, 1}) {
    Fix fix;
    fix.body = b;
    fix.nodes = nodes_where(model.shells[b].mesh, [&](const Vec3& p) { return std::abs(p.z() - 40.0 * b) < eps; });
    fix.translation = fix.rotation = {true, true, true};
    model.fixes.push_back(fix);
  }
  EXPECT_THAT(kinds(doubts_of_ends(model)), ElementsAre("walls through each other", "free end", "free end"));
  Attachment seam;
  seam.body = 1;
  seam.nodes = nodes_where(other, [](const Vec3& p) { return p.z() < 20 + eps; });
  seam.to = 0;
  model.attachments.push_back(seam);
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
  CrossingWatch watch(model);
  solve(model, nonlinear_run({1}), [&](const State& state) { watch.see(state); });
  EXPECT_FALSE(watch.found().has_value());
}

TEST(HoldDoubts, ASheetHasNoLumen) {
  const Grid grid = make_grid(12, 4, [](double u, double v) { return Vec3(40 * u, 10 * v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, 1));
  model.loads.push_back({0, PressureLoad{1e-3, true}, {}});
  model.supports = {{0, {}, 0.01}};
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
  State bent = at_rest(model);  // a strip that is clamped at one end
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    bent.displacement[i] = Vec3(0, 0, 4 * std::pow(grid.mesh.vertices[i].x() / 40, 2));
  }
  EXPECT_THAT(swings_of(model, bent), IsEmpty());
}

TEST(HoldDoubts, EdgesThatRunBesideEachOtherAreSaid) {
  for (const double gap : {0.05, 0.4, 0.7}) {
    Model model = tube(10, 20, 1, 0.01);
    ShellMesh& mesh = model.shells[0].mesh;
    const ShellMesh other = mesh;
    for (std::size_t i = 0; i < other.vertices.size(); ++i) {  // continues it behind a gap, its nodes elsewhere
      mesh.vertices.push_back(Eigen::AngleAxisd(0.1, Vec3::UnitZ()) * (other.vertices[i] + Vec3(0, 0, 20 + gap)));
      mesh.normals.push_back(Eigen::AngleAxisd(0.1, Vec3::UnitZ()) * other.normals[i]);
    }
    for (const auto& [a, b, c] : other.triangles) {
      const auto first = static_cast<Index>(other.vertices.size());
      mesh.triangles.push_back({first + a, first + b, first + c});
    }
    hold(
        model, [](const Vec3&) { return true; }, "xyz", "xyz");
    const std::vector<Warning> found = doubts_of_ends(model);
    EXPECT_EQ(kinds(found), gap < 0.5 ? std::vector<std::string>{"open seam"} : std::vector<std::string>{});
  }
}

TEST(HoldDoubts, SwingsAreSaidAndWideningIsNot) {
  const Model model = tube(10, 40, 1, 0.01);
  State state = at_rest(model);
  const ShellMesh& mesh = model.shells[0].mesh;
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    state.displacement[i] = 3 * mesh.normals[i];
  }
  EXPECT_THAT(swings_of(model, state), IsEmpty());
  const Eigen::AngleAxisd turn(0.2, Vec3::UnitX());
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    state.displacement[i] = turn * (mesh.vertices[i] + mesh.normals[i]) - mesh.vertices[i];
    state.rotation[i] = Vec3(0.2, 0, 0);
  }
  const std::vector<Warning> found = swings_of(model, state);
  ASSERT_THAT(kinds(found), testing::ElementsAre("swing"));
  Model sliding = model;  // rims that slide go along
  Fix slide;
  slide.nodes = nodes_where(mesh, [](const Vec3& p) { return p.z() < eps || p.z() > 40 - eps; });
  slide.across = Vec3::UnitZ();
  sliding.fixes.push_back(slide);
  EXPECT_THAT(kinds(swings_of(sliding, state)), testing::ElementsAre("swing"));
  EXPECT_THAT(found[0].text, HasSubstr("by 11 degrees"));
  for (Vec3& u : state.displacement) {
    u *= 0.02;  // less than half a wall
  }
  for (Vec3& r : state.rotation) {
    r *= 0.02;
  }
  EXPECT_THAT(swings_of(model, state), IsEmpty());
}

TEST(HoldDoubts, WhatIsHeldAllAroundDoesNotSwing) {
  const Grid grid = make_grid(12, 12, [](double u, double v) { return Vec3(20 * u, 20 * v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 2, 0.45, 0.5));
  const auto inside = [](const Vec3& p) { return std::min({p.x(), p.y(), 20 - p.x(), 20 - p.y()}) > eps; };
  hold(
      model, [&](const Vec3& p) { return !inside(p); }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{1e-3, true}, {}});
  State pressed_flat = at_rest(model);
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    pressed_flat.displacement[i] = inside(grid.mesh.vertices[i]) ? Vec3(0, 0, 1) : Vec3(0, 0, 0);
  }
  EXPECT_THAT(swings_of(model, pressed_flat), IsEmpty());
}

TEST(HoldDoubts, ABodyThatCrossesItselfIsSaid) {
  Model model = tube(10, 40, 1, 0.01);
  model.loads.clear();
  EXPECT_THAT(doubts_of_ends(model), IsEmpty());
  for (Vec3& v : model.shells[0].mesh.vertices) {  // one side through the other
    v.y() -= v.y() > 0 ? 25 * std::exp(-std::pow((v.z() - 20) / 6, 2)) : 0;
  }
  const std::vector<Warning> found = doubts_of_ends(model);
  ASSERT_THAT(kinds(found), testing::Contains("surface crosses itself"));
}

TEST(HoldDoubts, WallsThroughEachOtherAreSaidWithThePlace) {
  const Model model = tube(10, 40, 1, 0.01);
  const ShellMesh& mesh = model.shells[0].mesh;
  State state = at_rest(model);
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    const double middle = std::exp(-std::pow((mesh.vertices[i].z() - 20) / 6, 2));
    state.displacement[i] = Vec3(0, -1.2 * middle * mesh.vertices[i].y(), 0);
  }
  state.load_factor = 0.5;
  CrossingWatch watch(model);
  watch.see(at_rest(model));
  EXPECT_FALSE(watch.found());
  watch.see(state);
  ASSERT_TRUE(watch.found());
  EXPECT_EQ(watch.found()->kind, "walls through each other");
  EXPECT_THAT(watch.found()->text, HasSubstr("at load factor 0.5"));
  EXPECT_THAT(watch.found()->text, HasSubstr("pairs of faces, the first at ("));
  EXPECT_THAT(watch.found()->text, HasSubstr("[[contact]]"));
  watch.see(at_rest(model));
  EXPECT_TRUE(watch.found());
}

/// A tube of radius 10 about one of 8.5, and a state in which the outer one is scaled and shifted along the axis and
/// all is turned about x.
struct NestedTubes {
  Model model = tube(10, 40, 0.5, 0.01);
  NestedTubes() {
    const Model inner = tube(8.5, 40, 0.5, 0.01);
    model.shells.push_back(inner.shells[0]);
  }
  [[nodiscard]] State moved(double scale, double shift, double turn = 0) const {
    State state = at_rest(model);
    const Mat3 rotation = Eigen::AngleAxisd(turn, Vec3::UnitX()).toRotationMatrix();
    for (std::size_t i = 0; i < model.node_count(); ++i) {
      const std::size_t body = model.first_node(1) <= i ? 1 : 0;
      const Vec3 x = model.shells[body].mesh.vertices[i - model.first_node(body)];
      const Vec3 y = body == 0 ? Vec3(scale * x.x(), scale * x.y(), x.z() + shift) : x;
      state.displacement[i] = rotation * y - x;
      state.rotation[i] = turn * Vec3::UnitX();
    }
    return state;
  }
};

TEST(HoldDoubts, WallsThatHaveWhollyPassedEachOtherBetweenTwoStatesAreSaid) {
  const NestedTubes tubes;
  CrossingWatch watch(tubes.model);
  watch.see(tubes.moved(1, 0));
  EXPECT_FALSE(watch.found());
  watch.see(tubes.moved(0.7, 0));  // the outer one lies 1.5 mm within the inner one
  ASSERT_TRUE(watch.found());
  EXPECT_EQ(watch.found()->kind, "walls through each other");
  EXPECT_THAT(watch.found()->text, HasSubstr("has passed through itself or another at "));
}

TEST(HoldDoubts, WallsThatOverlapByMoreThanHalfAreSaid) {
  const NestedTubes tubes;
  for (const auto& [radius, said] : {std::pair(8.7, true), {8.9, false}}) {  // walls of 0.5 mm about 8.5 and this
    CrossingWatch watch(tubes.model);
    watch.see(tubes.moved(radius / 10, 0));
    ASSERT_EQ(watch.found().has_value(), said) << radius;
    if (said) {
      EXPECT_EQ(watch.found()->kind, "walls overlap");
      EXPECT_THAT(watch.found()->text, HasSubstr("by more than half of it"));
    }
  }
}

/// Nodes within half a wall of an edge are near the wall around it from the beginning.
/// A block between two planes, held at one node, in friction or not.
TEST(HoldDoubts, WhatContactAloneHoldsIsSaid) {
  Model model = one_solid(make_block(2, 2, 2, [](const Vec3& p) { return Vec3(10 * p); }), 1, 0.3);
  Fix fix;
  fix.nodes = nodes_of(model, 0, [](const Vec3& p) { return p.norm() < eps; });
  fix.translation = {true, true, true};
  model.fixes.push_back(fix);
  model.rigids.push_back({"table", RigidPlane{{{{0, Vec3(0, 0, -1)}}}, Vec3::UnitZ()}, {}, {}});
  EXPECT_THAT(doubts_of_loose_bodies(model, nonlinear_run({1})), IsEmpty());
  Contact contact;
  contact.between = {ContactParty{false, 0}, ContactParty{true, 0}};
  model.contacts.push_back(contact);
  const std::vector<Warning> found = doubts_of_loose_bodies(model, nonlinear_run({1}));
  ASSERT_THAT(kinds(found), ElementsAre("held by contact"));
  EXPECT_THAT(found[0].text, HasSubstr("3 of its 6 rigid motions"));
  model.contacts[0].friction = 0.3;
  EXPECT_THAT(doubts_of_loose_bodies(model, nonlinear_run({1})), IsEmpty());
}

TEST(HoldDoubts, WallsThatMeetAtACreaseDoNotOverlap) {
  Model model;
  model.shells.push_back(flat_body(make_box(25, 20), 1, 0.3, 2));
  model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
  model.rigid_motions.push_back({0});
  CrossingWatch watch(model);
  State state = at_rest(model);
  watch.see(state);
  for (std::size_t i = 0; i < model.node_count(); ++i) {
    state.displacement[i] = 1e-6 * Vec3(std::sin(3.0 * i), std::sin(5.0 * i), std::sin(7.0 * i));
  }
  watch.see(state);
  EXPECT_FALSE(watch.found());
}

TEST(HoldDoubts, WallsThatSlideAndTurnTogetherMeetNothing) {
  const NestedTubes tubes;
  CrossingWatch watch(tubes.model);
  watch.see(tubes.moved(1, 15));
  watch.see(tubes.moved(1.1, -15, 2.5));
  watch.see(tubes.moved(1, 0, -0.5));
  EXPECT_FALSE(watch.found());
}

/// A bar along x beside a tube, and a second one beside the first.
TEST(HoldDoubts, SolidsThatPassThroughOthersAreSaid) {
  const auto bar_at = [](double y) {
    return make_block(6, 2, 2, [y](const Vec3& p) { return Vec3(40 * p.x() - 20, y + 3 * p.y(), 19 + 3 * p.z()); });
  };
  Model model = tube(10, 40, 1, 0.01);
  model.solids.push_back({"bar", bar_at(12), {1, 0.3, std::nullopt}, SolidLaw::corotational});
  model.solids.push_back({"other bar", bar_at(16), {1, 0.3, std::nullopt}, SolidLaw::corotational});
  EXPECT_THAT(kinds(doubts_of_meeting_walls(model)), IsEmpty());
  const auto moved = [&](std::size_t body, double by) {
    State state = at_rest(model);
    for (std::size_t i = model.first_node(body); i < model.first_node(body + 1); ++i) {
      state.displacement[i] = Vec3(0, by, 0.5);
    }
    return state;
  };
  for (const auto& [body, by, by_name] : {std::tuple(1, -3.5, "shell"), {2, -2.0, "bar"}, {2, -40.0, ""}}) {
    CrossingWatch watch(model);
    watch.see(at_rest(model));
    EXPECT_FALSE(watch.found());
    watch.see(moved(static_cast<std::size_t>(body), by));
    ASSERT_TRUE(watch.found()) << by;
    EXPECT_EQ(watch.found()->kind, "walls through each other");
    EXPECT_THAT(watch.found()->text, testing::StartsWith(by_name));
  }
  model.solids[1].mesh = bar_at(14.5);
  const std::vector<Warning> found = doubts_of_meeting_walls(model);
  ASSERT_THAT(kinds(found), ElementsAre("walls through each other"));
  EXPECT_THAT(found[0].text, HasSubstr("bar and other bar"));
  model.shells.clear();
  model.loads.clear();
  EXPECT_THAT(kinds(doubts_of_meeting_walls(model)), ElementsAre("walls through each other"));
}

TEST(HoldDoubts, WhatCrossesInTheImageIsNotTheRunsDoing) {
  Model model = tube(10, 40, 1, 0.01);
  model.shells.push_back(model.shells[0]);
  for (Vec3& v : model.shells[1].mesh.vertices) {
    v = Vec3(v.z() - 20, v.y(), v.x() + 20);
  }
  for (Vec3& n : model.shells[1].mesh.normals) {
    n = Vec3(n.z(), n.y(), n.x());
  }
  CrossingWatch watch(model);
  watch.see(at_rest(model));
  EXPECT_FALSE(watch.found());
  model.loads.clear();
  const std::vector<Warning> found = doubts_of_ends(model);
  ASSERT_THAT(kinds(found), testing::ElementsAre("walls through each other"));
  EXPECT_THAT(found[0].text, HasSubstr("nothing holds them apart"));
}

TEST(HoldDoubts, BedsAndPressuresInTheImageAreQuestioned) {
  Model model = pressurised_sphere(2, 0.2, 0.016);
  const auto said = [&] {
    std::string all;
    for (const Warning& warning : doubts(model, nonlinear_run({1}), true)) {
      all += warning.text;
    }
    return all;
  };
  for (const auto& [stiffness, what] :
       {std::pair(1e-4, ""), {1e5, "stiffer than that of any tissue"}, {1e-9, "softer than that of any tissue"}}) {
    model.supports = {{0, {}, stiffness}};
    EXPECT_THAT(said(), HasSubstr(what));
    EXPECT_EQ(said().find("any tissue around") != std::string::npos, *what != 0);
  }
  auto& pressure = std::get<PressureLoad>(model.loads[0].kind);
  for (const double imaged : {0.016, -0.016}) {
    pressure.value = pressure.imaged_at.emplace(imaged);
    EXPECT_EQ(said().find("is a suction") != std::string::npos, imaged < 0);
  }
  std::get<PressureLoad>(model.loads[0].kind).value = 0.12;
  std::get<PressureLoad>(model.loads[0].kind).imaged_at = 0.12;
  EXPECT_THAT(said(), HasSubstr("900 mmHg: was 120 mmHg meant?"));
}

/// A sphere at .95 of 2 E t^2 / (R^2 sqrt(3 (1 - nu^2))).
TEST(HoldDoubts, SuctionNearBucklingIsSaid) {
  const double critical = 2 * 1000 * 0.2 * 0.2 / (100 * std::sqrt(3 * (1 - 0.09)));
  const Model near = pressurised_sphere(3, 0.2, -0.95 * critical);
  const std::vector<Warning> found = doubts_of_suction(near, nonlinear_run({1}), {});
  ASSERT_THAT(kinds(found), testing::ElementsAre("near buckling"));
  EXPECT_THAT(found[0].text, HasSubstr(" % of the load at which the perfect shell buckles"));
  EXPECT_THAT(doubts_of_suction(near, nonlinear_run({1}), {{0.5, 1}})[0].text, HasSubstr("is 200 % of"));
  EXPECT_THAT(doubts_of_suction(pressurised_sphere(3, 0.2, -0.1 * critical), nonlinear_run({1}), {}), IsEmpty());
  RunSettings by_cg = nonlinear_run({1});
  by_cg.solver = Solver::cg;
  EXPECT_THAT(kinds(doubts_of_suction(near, by_cg, {})), testing::ElementsAre("near buckling"));
  EXPECT_THAT(doubts_of_suction(pressurised_sphere(3, 0.2, critical), nonlinear_run({1}), {}), IsEmpty());
  // The load grows from the pressure of the image on; what buckles the wall is the suction itself.
  const auto percent = [&](double imaged, double suction) {
    Model model = pressurised_sphere(3, 0.2, -suction * critical);
    std::get<PressureLoad>(model.loads[0].kind).imaged_at = imaged * critical;
    const std::vector<Warning> said = doubts_of_suction(model, nonlinear_run({1}), {});
    return said.empty() ? 0 : std::stod(said[0].text.substr(said[0].text.find(" is ") + 4));
  };
  EXPECT_EQ(percent(5, 0.05), 0);
  const double whole = percent(0, 0.5);
  for (const auto& [imaged, suction] : {std::pair(5.0, 0.5), std::pair(-0.3, 0.5), std::pair(-0.49, 0.5)}) {
    EXPECT_NEAR(percent(imaged, suction), whole, 2) << imaged;
  }
}

}  // namespace
}  // namespace tunica::hold_doubts
