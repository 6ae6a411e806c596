// Nodes that another body carries.

#include "random.hpp"
#include "tets.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

namespace tunica {
namespace {

using namespace benchmarks;

TetMesh box(std::size_t nx, std::size_t ny, std::size_t nz, const Vec3& low, const Vec3& high) {
  return make_block(nx, ny, nz, [&](const Vec3& u) { return Vec3(low + u.cwiseProduct(high - low)); });
}

/// A part of a cylinder of radius 5 about the y axis, its crown at z = 0, with its normals.
ShellBody panel(std::size_t n) {
  ShellBody body = flat_body({}, 10, 0.3, 0.2);
  const Grid grid = make_grid(n, n, [](double u, double v) {
    const double angle = 0.8 * (u - 0.5);
    return Vec3(5 * std::sin(angle), 4 * v - 2, 5 * std::cos(angle) - 5);
  });
  body.mesh = grid.mesh;
  body.curved = true;
  body.rest = Rest::curved;
  for (const Vec3& x : body.mesh.vertices) {
    body.mesh.normals.push_back(Vec3(x.x(), 0, x.z() + 5).normalized());
  }
  return body;
}

/// A solid of 2 mm on the panel, its lower nodes 0.1 mm above it, carried.
Model solid_on_shell() {
  Model model;
  model.shells.push_back(panel(4));
  const double radius = 5.1;
  model.solids.push_back({"solid",
                          make_block(3, 3, 2,
                                     [&](const Vec3& u) {
                                       const double angle = 0.6 * (u.x() - 0.5), r = radius + 2 * u.z();
                                       return Vec3(r * std::sin(angle), 3 * u.y() - 1.5, r * std::cos(angle) - 5);
                                     }),
                          {1, 0.4, std::nullopt},
                          SolidLaw::neo_hookean});
  Attachment attachment;
  attachment.body = 1;
  attachment.to = 0;
  attachment.nodes = nodes_of(model, 1, [&](const Vec3& x) { return std::hypot(x.x(), x.z() + 5) < radius + eps; });
  model.attachments.push_back(attachment);
  return model;
}

Attachment all_nodes_of(const Model& model, std::size_t body, std::size_t to) {
  Attachment attachment;
  attachment.body = body;
  attachment.to = to;
  for (Index i = 0; i < model.shells[body].mesh.vertices.size(); ++i) {
    attachment.nodes.push_back(i);
  }
  return attachment;
}

/// A curved shell over another, welded to it; flat facets where not `curved`.
Model shell_on_shell(bool curved) {
  Model model;
  model.shells = {panel(4), panel(5)};
  for (ShellBody& body : model.shells) {
    body.curved = curved;
    body.rest = curved ? Rest::curved : Rest::flat;
  }
  for (Vec3& x : model.shells[1].mesh.vertices) {
    x = Vec3(0.8 * x.x(), 0.8 * x.y(), x.z() + 0.15);
  }
  model.attachments.push_back(all_nodes_of(model, 1, 0));
  return model;
}

/// A flat shell on the upper face of a block, or over it, its nodes not the block's.
Model shell_on_solid(double height = 0) {
  Model model;
  const Grid grid = make_grid(5, 4, [&](double u, double v) { return Vec3(4 * u - 2, 4 * v - 2, 1 + height); });
  model.shells.push_back(flat_body(grid.mesh, 100, 0.3, 0.1));
  model.solids.push_back(
      {"solid", box(3, 3, 2, Vec3(-2, -2, -1), Vec3(2, 2, 1)), {1, 0.4, std::nullopt}, SolidLaw::neo_hookean});
  model.attachments.push_back(all_nodes_of(model, 0, 1));
  return model;
}

/// Every kind of what carries what.
std::vector<Model> all_kinds() {
  return {shell_on_solid(), shell_on_solid(0.3), solid_on_shell(), shell_on_shell(true), shell_on_shell(false)};
}

/// Moves some nodes of the carrier rigidly; how far all others are from following.
double rigid_error(Model model, std::size_t body, const std::function<bool(const Vec3&)>& moved, double angle) {
  const Eigen::Quaterniond turn = exponential(angle * Vec3(1, 2, -1).normalized());
  const auto motion = [&](const Vec3& x) { return Vec3(turn * x - x + Vec3(0.5, -1, 0.2)); };
  move_nodes(model, body, moved, motion);
  RunSettings settings = nonlinear_run({0.25, 0.5, 0.75, 1});
  settings.converge = 1e-11;
  settings.newton_max = 60;
  const State state = last_state(model, settings);
  double error = 0;
  std::size_t node = 0;
  for (std::size_t b = 0; b < model.body_count(); ++b) {
    for (const Vec3& x : model.vertices_of(b)) {
      error = std::max(error, (state.displacement[node++] - motion(x)).norm());
    }
  }
  EXPECT_LT(state.strain_energy, 1e-14);
  return error;
}

/// Attachments hold nothing to the ground: what is joined moves freely as one.
TEST(Carried, WhatNothingHoldsIsRefusedWithAllThatIsAttached) {
  Model model = solid_on_shell();
  model.loads.push_back({0, PressureLoad{1e-3, true}, {}});
  const auto hold_node = [&](Index node, std::array<bool, 3> translation) {
    Fix fix;
    fix.nodes = {node};
    fix.translation = translation;
    fix.rotation = {false, false, false};
    model.fixes.push_back(fix);
  };
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("(6 of its 6"));
  hold_node(0, {false, true, false});
  EXPECT_THAT(error_of(model, linear_run()),
              testing::HasSubstr("can move freely, with all that is attached to it (5 of"));
  hold_node(4, {true, true, true});
  hold_node(24, {false, true, true});
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("(1 of its 6"));
  hold_node(20, {false, false, true});
  EXPECT_EQ(error_of(model, linear_run()), "");
}

TEST(Carried, AShellOnASolidFollowsItsRigidMotion) {
  for (const double height : {0.0, 0.3}) {
    EXPECT_LT(rigid_error(
                  shell_on_solid(height), 1, [](const Vec3& x) { return x.z() < -1 + eps; }, 0.6),
              1e-8);
  }
}

/// A column of 2 mm, E = 1 MPa, under 1 kPa on the shell over it gives way by 2 um, however far the shell is off.
TEST(Carried, TheDistanceOfAShellFromASolidGivesWayByNothing) {
  for (const double height : {0.0, 0.05, 0.3}) {
    Model model = shell_on_solid(height);
    model.shells[0].material.poisson = model.solids[0].material.poisson = 0;
    move_nodes(
        model, 1, [](const Vec3& x) { return x.z() < -1 + eps; }, [](const Vec3&) { return Vec3(0, 0, 0); });
    model.loads.push_back({0, PressureLoad{-1e-3, false}, {}});
    for (const RunSettings& settings : {linear_run(), nonlinear_run({1})}) {
      const State state = last_state(model, settings);
      double mean = 0;
      const std::size_t count = model.shells[0].mesh.vertices.size();
      for (std::size_t i = 0; i < count; ++i) {
        mean += state.displacement[i].z() / static_cast<double>(count);
      }
      EXPECT_NEAR(mean, -2e-3, 6e-5) << height;  // its nodes dent the block
    }
  }
}

TEST(Carried, ASolidOnAShellFollowsItsRigidMotion) {
  EXPECT_LT(rigid_error(
                solid_on_shell(), 0, [](const Vec3&) { return true; }, 0.6),
            1e-8);
}

/// A strip of 40 by 8 mm, E = 1 MPa, of two layers of 1 mm, or of one of 2 mm (`upper` = 0), clamped at one end.
/// @return how a node of the other end of the lower one moves under a moment there
Vec3 moved_strip(std::size_t lower, std::size_t upper, const Vec3& moment, const Vec3& at, bool linear = true) {
  Model model;
  const auto strip = [&](std::size_t n, double z, double thickness) {
    return flat_body(make_grid(n, n / 5, [&](double u, double v) { return Vec3(40 * u, 8 * v, z); }).mesh, 1, 0,
                     thickness);
  };
  model.shells = {strip(lower, 0, upper > 0 ? 1 : 2)};
  if (upper > 0) {
    model.shells.push_back(strip(upper, 1, 1));
    model.attachments.push_back(all_nodes_of(model, 1, 0));
  }
  hold(
      model, [](const Vec3& x) { return x.x() < eps; }, "xyz", "xyz");
  MomentLoad load;
  load.nodes = nodes_of(model, 0, [&](const Vec3& x) { return x.x() > 40 - eps; });
  load.total = moment;
  model.loads.push_back({0, load, {}});
  const State state = last_state(model, linear ? linear_run() : nonlinear_run({1}));
  return state.displacement[nearest(model.shells[0].mesh, at)];
}

/// Whatever the meshes: what is carried bends between the nodes of what carries it as that does.
TEST(Carried, LayersThatAreWeldedBendAsOne) {
  const auto deflection = [](std::size_t lower, std::size_t upper, bool linear) {
    constexpr double exact = 4e-3 * 40 * 40 / 2 / (8 * 8 / 12.0);
    return moved_strip(lower, upper, Vec3(0, -4e-3, 0), Vec3(40, 4, 0), linear).z() / exact;
  };
  for (const auto& [lower, upper] :
       {std::pair<std::size_t, std::size_t>{10, 10}, {10, 20}, {10, 40}, {20, 30}, {20, 33}, {40, 20}}) {
    EXPECT_NEAR(deflection(lower, upper, true), 1, 2e-3) << lower << " " << upper;
  }
  EXPECT_NEAR(deflection(20, 40, false), 1, 2e-3);
}

/// What a skin's shear puts on a free edge turns the edge's nodes, in a band as wide as its shells.
TEST(Carried, ATwistedStripOfLayersGivesWayByItsFreeEdges) {
  const auto too_much = [](std::size_t n) {
    const Vec3 moment(4e-3, 0, 0), corner(40, 8, 0);
    return moved_strip(n, n, moment, corner).z() / moved_strip(n, 0, moment, corner).z() - 1;
  };
  const double coarse = too_much(20), middle = too_much(40), fine = too_much(80);
  EXPECT_LT(coarse, 0.1);
  EXPECT_GT(coarse / middle, 1.7);
  EXPECT_GT(middle / fine, 1.6);
}

/// A tube of 20 mm, E = 1 MPa, pinched along two lines: its deflection in two layers of 0.5 mm, and by how much that is
/// said to be too much; in that of one shell of 1 mm on the same mesh.
std::pair<double, double> layered_tube(std::size_t around, std::size_t of_outer) {
  const auto layer = [](std::size_t n, double radius, double thickness) {
    ShellBody body = flat_body(tube_mesh(radius, radius, 20, n, n / 2), 1, 0, thickness);
    body.curved = true;
    body.rest = Rest::curved;
    return body;
  };
  const auto pinched = [](Model model) {
    const double radius = model.shells[0].mesh.vertices[0].head<2>().norm();
    model.rigid_motions.push_back({0});
    ForceLoad load;
    for (const double side : {-1.0, 1.0}) {
      load.nodes = nodes_of(model, 0, [&](const Vec3& x) { return side * x.x() > radius - eps; });
      load.total = Vec3(side * 1e-3, 0, 0);
      model.loads.push_back({0, load, {}});
    }
    const State state = last_state(model, linear_run());
    const std::vector<double> said = element_fields(model, state).layer_error;
    return std::pair(state.displacement[load.nodes[load.nodes.size() / 2]].x(), *std::ranges::max_element(said));
  };
  Model layers, one;
  layers.shells = {layer(around, 10, 0.5), layer(of_outer, 10.5, 0.5)};
  layers.attachments.push_back(all_nodes_of(layers, 1, 0));
  one.shells = {layer(around, 10.25, 1)};
  const auto [moved, said] = pinched(layers);
  const auto [right, none] = pinched(one);
  EXPECT_EQ(none, 0);
  return {moved / right - 1, said};
}

/// What layers give way too much, and what is said of it, falls with the square of the mesh.
TEST(Carried, LayersOfATubeConvergeAndSayHowFarTheyAre) {
  const auto [coarse, said_coarse] = layered_tube(16, 16);
  const auto [middle, said_middle] = layered_tube(32, 32);
  const auto [fine, said_fine] = layered_tube(64, 64);
  EXPECT_GT(coarse / middle, 3.2);
  EXPECT_GT(middle / fine, 3.2);
  EXPECT_LT(fine, 0.012);
  for (const double share : {said_coarse / coarse, said_middle / middle, said_fine / fine}) {
    EXPECT_GT(share, 0.9);
    EXPECT_LT(share, 2.2);
  }
  EXPECT_LT(layered_tube(32, 64).first, middle / 3);
  const Model model = shell_on_shell(true);
  EXPECT_THAT(doubts_of_layers(model, {0.01, 0.04}), testing::IsEmpty());
  const std::vector<Warning> found = doubts_of_layers(model, {0.01, said_coarse});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].kind, "coarse layers");
}

/// A strip in two pieces that meet along a line, end to end or as an angle: as one strip.
TEST(Carried, AJointAlongALineBearsBending) {
  for (const bool upright : {false, true}) {
    for (const std::size_t across : {4, 5}) {
      Model model;
      const auto piece = [](std::size_t n, double from) {
        return flat_body(make_grid(10, n, [&](double u, double v) { return Vec3(from + 20 * u, 8 * v, 0); }).mesh, 1, 0,
                         1);
      };
      model.shells = {piece(4, 0), piece(across, 20)};
      if (upright) {
        for (Vec3& x : model.shells[1].mesh.vertices) {
          x = Vec3(20, x.y(), x.x() - 20);
        }
      }
      const auto end = [&](const Vec3& x) { return (upright ? x.z() : x.x() - 20) > 20 - eps; };
      Attachment joint;
      joint.body = 1;
      joint.to = 0;
      joint.nodes = nodes_of(model, 1, [&](const Vec3& x) { return x.x() < 20 + eps && x.z() < eps; });
      model.attachments.push_back(joint);
      hold(
          model, [](const Vec3& x) { return x.x() < eps; }, "xyz", "xyz");
      MomentLoad load;
      load.nodes = nodes_of(model, 1, end);
      load.total = Vec3(0, -1e-3, 0);
      model.loads.push_back({1, load, {}});
      const State state = last_state(model, linear_run());
      const double curvature = 1e-3 / (8 / 12.0);
      const Vec3 moved = state.displacement[model.first_node(1) + load.nodes[0]];
      const Vec3 exact = upright ? Vec3(-600 * curvature, 0, 200 * curvature) : Vec3(0, 0, 800 * curvature);
      EXPECT_LT((moved - exact).norm(), 2e-3 * exact.norm()) << upright << " " << across;
    }
  }
}

/// An upright strip on the middle of one of 80 mm, clamped at both ends, whose shells it divides: under a moment M the
/// joint turns by M L / (16 E I), but for what bends within the shell, some 1.5 h / L of that.
TEST(Carried, AJointWithinAShellMissesItsOwnBending) {
  for (const std::size_t n : {15, 31}) {
    Model model;
    const Grid base = make_grid(n, 4, [](double u, double v) { return Vec3(80 * u, 8 * v, 0); });
    const Grid upright = make_grid(4, 4, [](double u, double v) { return Vec3(40, 8 * u, 10 * v); });
    model.shells = {flat_body(base.mesh, 1, 0, 0.5), flat_body(upright.mesh, 1, 0, 0.5)};
    Attachment joint;
    joint.body = 1;
    joint.to = 0;
    joint.nodes = nodes_of(model, 1, [](const Vec3& x) { return x.z() < eps; });
    model.attachments.push_back(joint);
    hold(
        model, [](const Vec3& x) { return x.x() < eps || x.x() > 80 - eps; }, "xyz", "xyz");
    MomentLoad load;
    load.nodes = nodes_of(model, 1, [](const Vec3& x) { return x.z() > 10 - eps; });
    load.total = Vec3(0, 2e-5, 0);
    model.loads.push_back({1, load, {}});
    const State state = last_state(model, linear_run());
    const double turned = state.rotation[model.first_node(1) + joint.nodes[2]].y();
    const double missing = 1 - turned / (2e-5 * 80 / (16 * 8 * 0.125 / 12));
    EXPECT_GT(missing, 0);
    EXPECT_LT(missing, 1.8 / static_cast<double>(n));
  }
}

/// A ring of a soft core between two stiff skins, pinched: it gives way by 0.1488 P R^3 / (E I), and about what is
/// said.
TEST(Carried, ASandwichSaysHowFarItIs) {
  Model model;
  double stiffness = 0;
  for (const auto& [radius, thickness, young] : {std::array<double, 3>{9.6, 0.2, 5}, {10, 0.6, 0.2}, {10.4, 0.2, 5}}) {
    ShellBody body = flat_body(tube_mesh(radius, radius, 2, 40, 2), young, 0, thickness);
    body.curved = true;
    body.rest = Rest::curved;
    model.shells.push_back(body);
    const double off = radius - 10;
    stiffness += 2 * young * thickness * (thickness * thickness / 12 + off * off);
  }
  model.attachments = {all_nodes_of(model, 1, 0), all_nodes_of(model, 2, 1)};
  model.rigid_motions.push_back({0});
  ForceLoad load;
  for (const double side : {-1.0, 1.0}) {
    load.nodes = nodes_of(model, 0, [&](const Vec3& x) { return side * x.x() > 9.6 - eps; });
    load.total = Vec3(side * 1e-3, 0, 0);
    model.loads.push_back({0, load, {}});
  }
  const State state = last_state(model, linear_run());
  const double off = 2 * state.displacement[load.nodes[0]].x() / (0.1488 * 1e-3 * 1000 / stiffness) - 1;
  EXPECT_GT(off, 0.15);
  for (const double said : element_fields(model, state).layer_error) {
    EXPECT_GT(said, 0.6 * off);
    EXPECT_LT(said, 2 * off);
  }
}

/// A rotated configuration, put there by hand: carried nodes are exactly in their places, and nothing pulls.
TEST(Carried, RigidMotionsGiveNoForce) {
  for (const Model& model : all_kinds()) {
    const ShellSystem system = make_system(model);
    const Eigen::Quaterniond turn = exponential(Vec3(0.7, -1.1, 0.4));
    Configuration moved = reference_configuration(system);
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      moved.displacement[i] = turn * system.reference[i] - system.reference[i] + Vec3(3, -2, 1);
      if (i < system.first_solid_node) {
        moved.rotation[i] = turn;
      }
    }
    const Configuration exact = moved;
    for (const Carried& c : system.carried) {
      moved.displacement[c.node] = Vec3(7, 7, 7);
    }
    place_carried(system.carried, system.surfaces, system.reference, moved);
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      ASSERT_LT((moved.displacement[i] - exact.displacement[i]).norm(), 1e-13) << i;
    }
    Forces forces;
    evaluate(system, {moved, load_factors(model, true, 1)}, forces, nullptr);
    VectorX unbalanced = forces.external - forces.internal;
    condense(system, moved, unbalanced, nullptr);
    EXPECT_LT(force_norm(system, unbalanced), 1e-11);
  }
}

/// A body that all but floats is pulled at both ends: tension turns it, not its bed, and what ties bear turns with
/// them. Linear runs are off by about as much as is said of them.
TEST(Carried, ABodyThatFloatsIsAsFarBeyondALinearRunAsIsSaid) {
  for (const double stiffness : {1e-2, 1e-4, 1e-6}) {
    Model model = solid_on_shell();
    model.supports.push_back({0, {}, stiffness, false, {}});
    for (const double side : {-1.0, 1.0}) {
      const auto nodes = nodes_of(model, 0, [&](const Vec3& x) { return side * x.y() > 2 - eps; });
      model.loads.push_back({0, ForceLoad{nodes, Vec3(0, 0.05 * side, 0)}, {}});
    }
    State linear;
    const double said = *solve(model, linear_run(), [&](const State& state) { linear = state; }).linear_departure;
    const State right = last_state(model, nonlinear_run({0.25, 0.5, 0.75, 1}));
    double off = 0, most = 0;
    for (std::size_t i = 0; i < right.displacement.size(); ++i) {
      off = std::max(off, (right.displacement[i] - linear.displacement[i]).norm());
      most = std::max(most, linear.displacement[i].norm());
    }
    EXPECT_LT(said, 2 * off / most) << stiffness;
    EXPECT_GT(said, off / most / 2) << stiffness;
  }
}

/// What acts on the nodes that are left does the same work, and has the same sum and moment, as before.
TEST(Carried, CondensedForcesKeepTheirSumAndMoment) {
  for (const Model& model : all_kinds()) {
    const ShellSystem system = make_system(model);
    Random random(13);
    Configuration moved = reference_configuration(system);
    VectorX step = VectorX::NullaryExpr(first_freedom(system.node_count()), [&](Eigen::Index) { return random(0.02); });
    advance_configuration(system, step, moved);
    VectorX forces = VectorX::Zero(step.size());
    for (const Carried& c : system.carried) {
      forces.segment<3>(first_freedom(c.node)) = random.vector(1);
      if (c.turns) {
        forces.segment<3>(first_freedom(c.node) + 3) = random.vector(1);
      }
    }
    const auto sums = [&](const VectorX& all) {
      Vector6 sum = Vector6::Zero();
      for (std::size_t i = 0; i < system.node_count(); ++i) {
        const Vec3 f = all.segment<3>(first_freedom(i));
        sum.head<3>() += f;
        sum.tail<3>() += (system.reference[i] + moved.displacement[i]).cross(f);
        if (i < system.first_solid_node) {
          sum.tail<3>() += all.segment<3>(first_freedom(i) + 3);
        }
      }
      return sum;
    };
    VectorX condensed = forces;
    condense(system, moved, condensed, nullptr);
    for (const Carried& c : system.carried) {
      EXPECT_EQ(condensed.segment<6>(first_freedom(c.node)).norm(), 0);
    }
    EXPECT_LT((sums(condensed) - sums(forces)).norm(), 1e-12 * forces.norm() * 10);
    // And by virtual work.
    expand_carried(system.carried, system.surfaces, system.reference, moved, step);
    EXPECT_NEAR(condensed.dot(step), forces.dot(step), 1e-12 * forces.norm());
  }
}

/// The tangent of what is left, with the curvature of the map under the carried forces.
TEST(Carried, TheCondensedTangentIsTheDerivativeOfTheCondensedForces) {
  for (const Model& model : all_kinds()) {
    const ShellSystem system = make_system(model);
    Random random(13);
    const Eigen::Index size = first_freedom(system.node_count());
    Configuration at = reference_configuration(system);
    VectorX away = VectorX::NullaryExpr(size, [&](Eigen::Index i) { return random(i % 6 < 3 ? 0.02 : 0.2); });
    for (std::size_t i = system.first_solid_node; i < system.node_count(); ++i) {
      away.segment<2>(first_freedom(i) + 4).setZero();
    }
    advance_configuration(system, away, at);
    std::vector<std::size_t> first_unknown(system.node_count(), 0);
    for (const Carried& c : system.carried) {
      first_unknown[c.node] = c.turns ? 6 : 3;
    }
    const auto left = [&](const Configuration& where, BlockMatrix* tangent) {
      Forces forces;
      evaluate(system, {where, load_factors(model, true, 1)}, forces, tangent);
      EXPECT_TRUE(forces.valid);
      VectorX unbalanced = forces.external - forces.internal;
      condense(system, where, unbalanced, tangent);
      return VectorX(-unbalanced);
    };
    BlockMatrix tangent = system.pattern;
    left(at, &tangent);
    constexpr double step = 1e-6;
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      for (std::size_t c = first_unknown[i]; c < (i < system.first_solid_node ? 6 : 4); ++c) {
        VectorX one = VectorX::Zero(size), column;
        one[first_freedom(i) + static_cast<Eigen::Index>(c)] = 1;
        multiply(tangent, one, column);
        Configuration after = at, before = at;
        advance_configuration(system, step * one, after);
        advance_configuration(system, -step * one, before);
        const VectorX difference = (left(after, nullptr) - left(before, nullptr)) / (2 * step);
        ASSERT_LT((difference - column).norm(), 2e-7 * column.norm() + 1e-9) << "node " << i << ", component " << c;
      }
    }
  }
}

/// What is carried swings with what carries it, and time integration takes and gives no energy.
TEST(Carried, EnergyIsKeptInMotion) {
  for (Model model : all_kinds()) {
    const std::size_t carrier = model.attachments[0].to;
    const bool is_solid = model.is_solid(carrier);
    hold_nodes(
        model, carrier, [&](const Vec3& x) { return is_solid ? x.z() < -1 + eps : x.y() < -2 + eps; }, "xyz");
    for (ShellBody& body : model.shells) {
      body.material.density = 1e-9;
    }
    for (SolidBody& body : model.solids) {
      body.material.density = 1e-9;
    }
    for (std::size_t b = 0; b < model.body_count(); ++b) {
      model.loads.push_back({b, GravityLoad{Vec3(0, 300, 300)}, {}});
    }
    RunSettings settings;
    DynamicRun run;
    run.step = 1e-4;
    run.duration = 1e-2;
    run.integrator = Integrator::generalised_alpha;
    run.spectral_radius = 1;
    settings.kind = run;
    const EnergyBalance energy = *solve(model, settings, [](const State&) {}).energy;
    EXPECT_GT(energy.largest, 0);
    EXPECT_LT(energy.gained, 0.01);
    EXPECT_LT(std::abs(energy.lost), 0.01 * energy.largest);
  }
}

/// A block on another; the faces between them meet, their nodes do not. `fine` cells of the upper against `coarse` of
/// the lower; the outside moves linearly. How far the nodes are from it.
double stacked_error(std::size_t coarse, std::size_t fine, SolidLaw law, bool linear) {
  Model model;
  model.solids.push_back({"lower", box(coarse, coarse, 2, Vec3(0, 0, 0), Vec3(2, 2, 1)), {1, 0.3, std::nullopt}, law});
  model.solids.push_back({"upper", box(fine, fine, 2, Vec3(0, 0, 1), Vec3(2, 2, 2)), {1, 0.3, std::nullopt}, law});
  Random random(13);
  for (SolidBody& body : model.solids) {  // distorted inside
    for (Vec3& x : body.mesh.vertices) {
      const bool inside = x.x() > eps && x.x() < 2 - eps && x.y() > eps && x.y() < 2 - eps && x.z() > eps &&
                          x.z() < 2 - eps && std::abs(x.z() - 1) > eps;
      x += inside ? random.vector(0.08) : Vec3(Vec3::Zero());
    }
  }
  Attachment attachment;
  attachment.body = 1;
  attachment.to = 0;
  attachment.nodes = nodes_of(model, 1, [](const Vec3& x) { return std::abs(x.z() - 1) < eps; });
  model.attachments.push_back(attachment);
  Mat3 gradient;
  gradient << random.vector(0.01), random.vector(0.01), random.vector(0.01);
  const auto exact = [&](const Vec3& x) { return Vec3(gradient * x + Vec3(0.1, 0, -0.1)); };
  const auto outside = [](const Vec3& x) { return (x - Vec3(1, 1, 1)).cwiseAbs().maxCoeff() > 1 - eps; };
  move_nodes(model, 0, outside, exact);
  move_nodes(
      model, 1, [&](const Vec3& x) { return outside(x) && x.z() > 1 + eps; }, exact);
  RunSettings settings = linear ? linear_run() : nonlinear_run({1});
  settings.converge = 1e-12;
  const State state = last_state(model, settings);
  double error = 0;
  std::size_t node = 0;
  for (const SolidBody& body : model.solids) {
    for (const Vec3& x : body.mesh.vertices) {
      error = std::max(error, (state.displacement[node++] - exact(x)).norm());
    }
  }
  return error;
}

TEST(Carried, AFinerFaceOnACoarserOnePassesThePatchTest) {
  for (const SolidLaw law : {SolidLaw::corotational, SolidLaw::neo_hookean}) {
    EXPECT_LT(stacked_error(2, 4, law, false), 1e-10);
    EXPECT_LT(stacked_error(3, 3, law, false), 1e-10);
  }
}

TEST(Carried, LinearRunsKnowAttachments) { EXPECT_LT(stacked_error(2, 4, SolidLaw::corotational, true), 1e-10); }

/// Where the carried triangles cross the edges of those that carry them, forces are shared as by a rule of quadrature,
/// and a tenth of the strain is lost about the face; where they are coarser than those, nodes between them lie free.
TEST(Carried, OfFacesThatCrossTheFinerOneShouldBeCarried) {
  for (const auto& [coarse, fine] : {std::pair<std::size_t, std::size_t>{2, 3}, {3, 4}, {3, 5}}) {
    EXPECT_LT(stacked_error(coarse, fine, SolidLaw::corotational, false), 1e-3);
    EXPECT_GT(stacked_error(fine, coarse, SolidLaw::corotational, false),
              3 * stacked_error(coarse, fine, SolidLaw::corotational, false));
  }
}

TEST(Carried, ASkinThatIsCoarserThanItsSolidIsDoubted) {
  Model model = shell_on_solid();
  EXPECT_THAT(doubts_of_solids(model, {0}, {0}), testing::IsEmpty());
  model.solids[0].mesh = box(9, 9, 4, Vec3(-2, -2, -1), Vec3(2, 2, 1));
  const std::vector<Warning> found = doubts_of_solids(model, {0.1}, {0});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].kind, "coarse skin");
}

/// A skin of 1 mm and 10 MPa on a core of 0.1 MPa, as a cantilever: carried by the core it is too stiff where it is the
/// finer one, which is said; carrying the core it is right whatever the meshes.
TEST(Carried, ASkinThatIsFinerThanItsSolidIsDoubtedAndServesTheOtherWayRound) {
  const auto deflection = [](std::size_t n, bool skin_carries, std::vector<Warning>& found) {
    Model model;
    const Grid grid = make_grid(n, n / 5, [](double u, double v) { return Vec3(40 * u, 8 * v, 4.5); });
    model.shells.push_back(flat_body(grid.mesh, 10, 0, 1));
    model.solids.push_back(
        {"core", box(40, 8, 4, Vec3(0, 0, 0), Vec3(40, 8, 4)), {0.1, 0, {}}, SolidLaw::corotational});
    Attachment joint = all_nodes_of(model, 0, 1);
    if (skin_carries) {
      joint.body = 1;
      joint.to = 0;
      joint.nodes = nodes_of(model, 1, [](const Vec3& x) { return x.z() > 4 - eps; });
      hold(
          model, [](const Vec3& x) { return x.x() < 6 + eps; }, "xyz", "xyz");
    }
    model.attachments.push_back(joint);
    hold_nodes(
        model, 1, [&](const Vec3& x) { return x.x() < 6 + eps && (!skin_carries || x.z() < 4 - eps); }, "xyz");
    ForceLoad load;
    load.nodes = nodes_of(model, 1, [&](const Vec3& x) { return x.x() > 40 - eps && x.z() < eps; });
    load.total = Vec3(0, 0, -2e-5);
    model.loads.push_back({1, load, {}});
    const State state = last_state(model, linear_run());
    const ElementFields fields = element_fields(model, state);
    found = doubts_of_solids(model, fields.solid_error, fields.roughness);
    return state.displacement[model.first_node(1) + load.nodes[0]].z();
  };
  std::vector<Warning> found;
  const double right = deflection(40, true, found);
  EXPECT_NEAR(deflection(80, true, found) / right, 1, 0.02);
  EXPECT_NEAR(deflection(40, false, found) / right, 1, 0.05);
  const double lost = 1 - deflection(80, false, found) / right;
  EXPECT_GT(lost, 0.3);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].kind, "fine skin");
  std::smatch said;
  ASSERT_TRUE(std::regex_search(found[0].text, said, std::regex("by (\\d+) to (\\d+) % too little")));
  EXPECT_LT(std::stod(said[1]) / 100, lost);
  EXPECT_GT(std::stod(said[2]) / 100, lost);
}

TEST(Carried, ANodeCarriedTwiceIsNamed) {
  Model model = shell_on_solid();
  model.attachments.push_back(model.attachments.front());
  EXPECT_THAT(error_of(model, nonlinear_run({1})), testing::HasSubstr("node 0 is carried twice"));
}

TEST(Carried, ACircleIsRefused) {
  Model model = shell_on_solid();
  Attachment back;
  back.body = 1;
  back.to = 0;
  back.nodes = nodes_of(model, 1, [](const Vec3& x) { return x.z() > 1 - eps; });
  model.attachments.push_back(back);
  EXPECT_THAT(error_of(model, nonlinear_run({1})), testing::HasSubstr("carry each other in a circle"));
}

/// A solid on a shell on a solid: forces go all the way down.
TEST(Carried, WhatIsCarriedMayCarry) {
  Model model = shell_on_solid();
  model.solids.push_back(
      {"top", box(2, 2, 1, Vec3(-1, -1, 1.05), Vec3(1, 1, 2)), {1, 0.4, std::nullopt}, SolidLaw::neo_hookean});
  Attachment attachment;
  attachment.body = 2;
  attachment.to = 0;
  attachment.nodes = nodes_of(model, 2, [](const Vec3& x) { return x.z() < 1.05 + eps; });
  model.attachments.push_back(attachment);
  EXPECT_LT(rigid_error(
                model, 1, [](const Vec3& x) { return x.z() < -1 + eps; }, 0.4),
            1e-8);
}

}  // namespace
}  // namespace tunica
