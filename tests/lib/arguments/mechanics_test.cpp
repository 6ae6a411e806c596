// The public functions of lib/mechanics and lib/accuracy check what they are given.
#include "damaged.hpp"
#include "shell/families.hpp"
#include "tunica/accuracy/accuracy.hpp"
#include "tunica/mechanics/algebra/lanczos.hpp"
#include "tunica/mechanics/algebra/linear_solver.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/mechanics/runs/unloaded.hpp"

namespace tunica {
namespace {

using namespace arguments;

/// A ball under pressure.
Model model_of(const ShellMesh& mesh) {
  Model model;
  ShellBody body;
  body.name = "ball";
  body.mesh = mesh;
  body.thickness = {0.1};
  body.material = {1, 0.3, {}};
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  model.loads.push_back({0, PressureLoad{1e-4, true}, {}});
  return model;
}

Fix fix_of(std::size_t body, Index node) {
  Fix fix;
  fix.body = body;
  fix.nodes = {node};
  return fix;
}

RunSettings linear() {
  RunSettings settings;
  settings.kind = StaticRun{true, {1}};
  return settings;
}

void run(const Model& model, const RunSettings& settings = linear()) {
  solve(model, settings, [](const State&) {});
}

State rest_of(const Model& model) {
  State state;
  state.displacement.assign(model.node_count(), Vec3::Zero());
  state.rotation.assign(model.node_count(), Vec3::Zero());
  return state;
}

TEST(MechanicsArguments, MeshesAreChecked) {
  const std::vector<Call<ShellMesh>> calls{
      {"solve", [](const ShellMesh& s) { run(model_of(s)); }},
      {"check_model", [](const ShellMesh& s) { check_model(model_of(s), linear()); }},
      {"doubts", [](const ShellMesh& s) { doubts(model_of(s), linear()); }},
      {"element_fields",
       [](const ShellMesh& s) {
         const Model model = model_of(s);
         element_fields(model, rest_of(model));
       }},
      {"solve_within",
       [](const ShellMesh& s) {
         AccuracyRequest request;
         request.within = 0.5;
         RunSettings settings;
         settings.kind = StaticRun{false, {1}};
         solve_within({model_of(s).shells[0]}, {nullptr}, request, settings, [](std::vector<ShellBody> bodies) {
           Model model = model_of({});
           model.shells = std::move(bodies);
           return model;
         });
       }},
  };
  expect_checked(testing::sphere_shell(2), calls);
  for (const auto& call : calls) {
    expect_refused(call.name, [&] { call.of({}); });
  }
  expect_checked<ShellMesh>(
      testing::sphere_shell(1),
      {
          {"largest_displacement",
           [](const ShellMesh& s) {
             const Model model = model_of(s);
             largest_displacement(model, rest_of(model));
           }},
          {"share_without_inner_face", [](const ShellMesh& s) { share_without_inner_face(model_of(s).shells[0]); }},
          {"curvatures_of", [](const ShellMesh& s) { curvatures_of(s, true); }},
          {"curvatures_of flat", [](const ShellMesh& s) { curvatures_of(s, false); }},
      });
}

TEST(MechanicsArguments, WhatAModelNamesIsThere) {
  const Model good = model_of(testing::sphere_shell(2));
  EXPECT_NO_THROW(run(good));
  const std::vector<Call<Model*>> damages{
      {"fix of a body", [](Model* m) { m->fixes.push_back(fix_of(1, 0)); }},
      {"fix of a node", [](Model* m) { m->fixes.push_back(fix_of(0, 9999)); }},
      {"fix by a number",
       [](Model* m) {
         m->fixes.push_back(fix_of(0, 0));
         m->fixes.back().displacement.x() = nan;
       }},
      {"ramp",
       [](Model* m) {
         m->loads[0].ramp.points = {{0, nan}};
       }},
      {"ramp back in time",
       [](Model* m) {
         m->loads[0].ramp.points = {{1, 0}, {0, 1}};
       }},
      {"load of a body", [](Model* m) { m->loads[0].body = 7; }},
      {"load of a node",
       [](Model* m) {
         m->loads.push_back({0, ForceLoad{{9999}, Vec3::UnitX()}, {}});
       }},
      {"pressure",
       [](Model* m) {
         m->loads[0].kind = PressureLoad{nan, true};
       }},
      {"infinite pressure",
       [](Model* m) {
         m->loads[0].kind = PressureLoad{infinity, true};
       }},
      {"probe",
       [](Model* m) {
         m->probes.push_back({"p", 0, 9999});
       }},
      {"attachment",
       [](Model* m) {
         m->attachments.push_back({0, {0}, 3});
       }},
      {"attached node",
       [](Model* m) {
         m->attachments.push_back({0, {9999}, 0});
       }},
      {"contact",
       [](Model* m) {
         m->contacts.push_back({"c", {ContactParty{false, 0}, ContactParty{true, 0}}});
       }},
      {"friction",
       [](Model* m) {
         m->contacts.push_back({"c", {ContactParty{false, 0}, ContactParty{false, 0}}, nan});
       }},
      {"table without points",
       [](Model* m) {
         m->rigids.push_back({"r", RigidSphere{}, {}});
       }},
      {"table back in time",
       [](Model* m) {
         m->rigids.push_back({"r", RigidSphere{{{{1, Vec3::Zero()}, {0, Vec3::Zero()}}}, {{{0, 1.0}}}}, {}});
       }},
      {"direction",
       [](Model* m) {
         m->rigids.push_back({"r", RigidPlane{{{{0, Vec3::Zero()}}}, Vec3(0, 0, nan)}, {}});
       }},
      {"rigid mesh",
       [](Model* m) {
         m->rigids.push_back({"r", RigidMesh{{{}, {{{0, 1, 2}}}}, {}, {}}, {}});
       }},
      {"a node of no element",
       [](Model* m) {
         m->shells[0].mesh.vertices.emplace_back(nan, 0, 0);
         m->shells[0].mesh.normals.emplace_back(0, 0, 1);
       }},
      {"thickness", [](Model* m) { m->shells[0].thickness = {nan}; }},
      {"no thickness", [](Model* m) { m->shells[0].thickness.clear(); }},
      {"Young's modulus", [](Model* m) { m->shells[0].material.young = infinity; }},
      {"Poisson's ratio", [](Model* m) { m->shells[0].material.poisson = nan; }},
      {"tetrahedron",
       [](Model* m) {
         m->solids.push_back({"s", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{{0, 1, 2, 4}}}}, {1, 0.3, {}}});
       }},
      {"tetrahedron inside out",
       [](Model* m) {
         m->solids.push_back({"s", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{{0, 2, 1, 3}}}}, {1, 0.3, {}}});
       }},
  };
  for (const auto& damage : damages) {
    Model bad = good;
    damage.of(&bad);
    expect_refused("solve, " + damage.name, [&] { run(bad); });
    expect_refused("doubts, " + damage.name, [&] { doubts(bad, linear()); });
    expect_refused("element_fields, " + damage.name, [&] { ElementFieldEvaluator{bad}; });
    expect_refused("far_from_disturbances, " + damage.name, [&] { far_from_disturbances(bad); });
    expect_refused("find_unloaded, " + damage.name, [&] { find_unloaded(bad, linear()); });
  }
}

TEST(MechanicsArguments, SettingsAreChecked) {
  const Model good = model_of(testing::sphere_shell(2));
  Model heavy = good;
  heavy.shells[0].material.density = 1e-9;
  expect_numbers_checked({
      {"converge",
       [&](double x) {
         RunSettings settings = linear();
         settings.converge = x;
         run(good, settings);
       }},
      {"settled",
       [&](double x) {
         RunSettings settings = linear();
         settings.settled = x;
         run(good, settings);
       }},
      {"load factor",
       [&](double x) {
         RunSettings settings = linear();
         settings.kind = StaticRun{true, {x}};
         run(good, settings);
       }},
      {"first factor",
       [&](double x) {
         RunSettings settings = linear();
         ArcLengthRun path;
         path.first_factor = x;
         settings.kind = path;
         run(good, settings);
       }},
      {"step",
       [&](double x) {
         RunSettings settings;
         settings.kind = DynamicRun{.duration = 1, .step = x, .damping = {}};
         run(heavy, settings);
       }},
      {"error of a step",
       [&](double x) {
         RunSettings settings;
         settings.kind = DynamicRun{.duration = 1, .step = 0.1, .damping = {}, .adaptive = LengthTolerance{x, true}};
         run(heavy, settings);
       }},
      {"accuracy",
       [&](double x) {
         AccuracyRequest request;
         request.within = x;
         solve_within({good.shells[0]}, {nullptr}, request, linear(), [&](std::vector<ShellBody>) { return good; });
       }},
  });
  RunSettings settings;
  settings.kind = DynamicRun{.duration = 1e200, .step = 1e-200, .damping = {}};
  expect_refused("steps beyond counting", [&] { run(heavy, settings); });
  settings.kind = BucklingRun{};
  AccuracyRequest request;
  request.within = 0.1;
  expect_refused("accuracy of buckling", [&] {
    solve_within({good.shells[0]}, {nullptr}, request, settings, [&](std::vector<ShellBody>) { return good; });
  });
  expect_refused("accuracy without targets", [&] {
    solve_within({good.shells[0]}, {}, request, linear(), [&](std::vector<ShellBody>) { return good; });
  });
}

TEST(MechanicsArguments, StatesAndFieldsAreOfTheModel) {
  const Model model = model_of(testing::sphere_shell(1));
  State state = rest_of(model);
  state.displacement.pop_back();
  expect_refused("element_fields", [&] { element_fields(model, state); });
  expect_refused("largest_displacement", [&] { largest_displacement(model, state); });
  expect_refused("count_unresolved", [&] { count_unresolved(model, state, 1); });
  Tessellation other = tessellate_uniformly(testing::sphere_shell(2), 1);
  expect_refused("curved_displacement", [&] { curved_displacement(model, 0, rest_of(model), other); });
  expect_refused("curved_displacement of no body", [&] { curved_displacement(model, 1, rest_of(model), other); });
  expect_refused("disturbed_nodes of no body", [&] { disturbed_nodes(model, 1); });
  expect_refused("area_quantile", [&] { area_quantile(model, std::vector<double>(3), 0.01); });
  const std::vector<double> zero(model.node_count());
  expect_refused("area_quantile of no part", [&] { area_quantile(model, zero, nan); });
  expect_refused("vertices_of", [&] { (void)model.vertices_of(1); });
  expect_refused("first_node", [&] { (void)model.first_node(2); });
  expect_refused("Table", [&] { (void)Table<double>{}.at(0); });
  Resumption resumption;
  resumption.from.emplace();
  expect_refused("solve from a checkpoint", [&] {
    solve(
        model, RunSettings(), [](const State&) {}, {}, resumption);
  });
}

TEST(MechanicsArguments, CheckpointsAreOfTheModel) {
  Model model = model_of(testing::sphere_shell(1));
  model.shells[0].material.density = 1e-9;
  RunSettings settings;
  settings.kind = DynamicRun{.duration = 2e-3, .step = 1e-3, .damping = {}};
  std::optional<Checkpoint> first;
  Resumption keeping;
  keeping.on_step = [&](const std::function<Checkpoint()>& make) {
    if (!first) {
      first = make();
    }
  };
  const auto go_on = [&](const Resumption& resumption) {
    solve(
        model, settings, [](const State&) {}, {}, resumption);
  };
  go_on(keeping);
  ASSERT_TRUE(first);
  Resumption resumption;
  resumption.from = first;
  EXPECT_NO_THROW(go_on(resumption));
  for (Eigen::VectorXd MotionMemory::*list :
       {&MotionMemory::velocity, &MotionMemory::acceleration, &MotionMemory::auxiliary, &MotionMemory::acting,
        &MotionMemory::last_change}) {
    resumption.from = first;
    (*resumption.from->motion.*list).setZero(7);
    expect_refused("as many numbers of a motion", [&] { go_on(resumption); });
  }
  resumption.from = first;
  resumption.from->motion->viscous_rate = {1, 2};
  expect_refused("as many rates", [&] { go_on(resumption); });
  resumption.from = first;
  resumption.from->motion.reset();
  expect_refused("no motion", [&] { go_on(resumption); });
}

TEST(MechanicsArguments, MatricesAreChecked) {
  const std::vector<std::array<Index, 3>> triangles{{0, 1, 2}};
  expect_refused("make_block_matrix", [&] { make_block_matrix(2, triangles); });
  const std::vector<std::vector<Index>> one_way{{0, 1}, {1}}, beyond{{0, 5}};
  expect_refused("one way", [&] { make_block_matrix(one_way); });
  expect_refused("beyond", [&] { make_block_matrix(beyond); });
  BlockMatrix matrix = make_block_matrix(3, triangles);
  for (Index i = 0; i < 3; ++i) {
    matrix.block(matrix.find(i, i)).setIdentity();
  }
  expect_refused("marks", [&] { DirectSolver(matrix, FreeMask(5, true)); });
  DirectSolver solver(matrix, FreeMask(18, true));
  expect_refused("another matrix", [&] { solver.factor(make_block_matrix(2, {})); });
  solver.factor(matrix);
  VectorX x;
  expect_refused("a right side", [&] { solver.solve(VectorX::Zero(12), x); });
  const FreeMask free(18, true);
  const VectorX few = VectorX::Ones(12), right = VectorX::Ones(18);
  expect_refused("no block", [&] { (void)matrix.find(3, 0); });
  expect_refused("multiply", [&] { multiply(matrix, few, x); });
  expect_refused("dot", [&] { (void)dot(few, right); });
  expect_refused("conjugate_gradients", [&] { conjugate_gradients(matrix, free, few, {}, x); });
  expect_refused("marks of cg", [&] { conjugate_gradients(matrix, FreeMask(5, true), right, {}, x); });
  CgOptions options;
  options.tolerance = nan;
  expect_refused("tolerance", [&] { conjugate_gradients(matrix, free, right, options, x); });
  expect_refused("gmres", [&] { gmres(matrix, free, solver, few, x); });
  expect_refused("error_by_factor", [&] { error_by_factor(matrix, free, solver, few, right); });
  const SymmetricPencil::Product copy = [](const VectorX& from, VectorX& to) { to = from; };
  LanczosOptions none;
  none.count = 0;
  expect_refused("no eigenpair", [&] { largest_eigenpairs({copy, copy, copy}, free, {}, none); });
  expect_refused("known ones", [&] { largest_eigenpairs({copy, copy, copy}, free, {few}, {}); });
  EXPECT_NO_THROW(solver.solve(VectorX::Ones(18), x));
}

}  // namespace
}  // namespace tunica
