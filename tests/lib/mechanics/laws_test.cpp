// Laws that hold for every mesh: zero modes, rigid motions, units, orientation, order of vertices, proportionality.

#include "benchmarks.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

namespace tunica {
namespace {

using namespace benchmarks;

struct Choice {
  Membrane membrane;
  Bending bending;
};
constexpr std::array choices{Choice{Membrane::cst, Bending::comas}, Choice{Membrane::opt, Bending::comas_consistent},
                             Choice{Membrane::adapt, Bending::dkt}, Choice{Membrane::adapt, Bending::dkt_comas}};

/// An open, bumpy, irregular shell, moderately thin.
ShellMesh bumpy() {
  Grid grid = make_grid(
      6, 6, [](double u, double v) { return Vec3(10 * u, 10 * v, 2 * std::sin(3 * u) * std::cos(2 * v)); },
      Diagonals::random);
  grid.mesh.normals.resize(grid.mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : grid.mesh.triangles) {
    const auto& x = grid.mesh.vertices;
    const Vec3 n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    for (const Index i : t) {
      grid.mesh.normals[i] += n;
    }
  }
  for (Vec3& n : grid.mesh.normals) {
    n.normalize();
  }
  return grid.mesh;
}

Model model_of(ShellMesh mesh, const Choice& choice) {
  Model model;
  ShellBody body = flat_body(std::move(mesh), 1000, 0.3, 0.5);
  body.membrane = choice.membrane;
  body.bending = choice.bending;
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  return model;
}

std::size_t zero_modes(const Eigen::MatrixXd& stiffness) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(stiffness, Eigen::EigenvaluesOnly);
  return static_cast<std::size_t>((eigen.eigenvalues().array() < 1e-10 * eigen.eigenvalues().maxCoeff()).count());
}

TEST(Laws, ExactlySixZeroModes) {
  for (const Choice& choice : choices) {
    for (const double scale : {1.0, 1e-4}) {
      const std::array<Vec3, 3> corners{Vec3(0.1, 0.2, 0.3), Vec3(1.3, 0.1, 0.5), Vec3(0.4, 1.1, -0.2)};
      const Vec3 n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
      const ShellSurface surface{{n, (n + Vec3(0.1, -0.2, 0.1)).normalized(), n}, true};
      const ShellElement element =
          make_shell_element(corners, surface, {1000, 0.3, {}}, 0.1, choice.membrane, choice.bending, scale);
      EXPECT_EQ(zero_modes(linear_stiffness(element)), 6U);
    }
    for (const ShellMesh& mesh : {bumpy(), make_sphere(10, 1)}) {
      const ShellSystem system = make_system(model_of(mesh, choice));
      BlockMatrix blocks = system.pattern;
      linear_stiffness(system, blocks);
      Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(system.node_count()),
                                                    6 * static_cast<Eigen::Index>(system.node_count()));
      for (std::size_t i = 0; i < system.node_count(); ++i) {
        for (std::size_t k = blocks.row_start[i]; k < blocks.row_start[i + 1]; ++k) {
          dense.block<6, 6>(6 * static_cast<Eigen::Index>(i), 6 * static_cast<Eigen::Index>(blocks.column[k])) =
              blocks.block(k);
        }
      }
      EXPECT_EQ(zero_modes(dense), 6U);
    }
  }
}

TEST(Laws, RigidMotionOfAShellGivesNoForces) {
  for (const Choice& choice : choices) {
    const Model model = model_of(bumpy(), choice);
    const ShellSystem system = make_system(model);
    const Mat3 turn = exponential(Vec3(1.9, -1.4, 0.8)).toRotationMatrix();
    Configuration configuration = reference_configuration(system);
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      configuration.displacement[i] = turn * system.reference[i] - system.reference[i] + Vec3(3, -2, 5);
      configuration.rotation[i] = Eigen::Quaterniond(turn);
    }
    Forces forces;
    evaluate(system, {configuration, {}}, forces, nullptr);
    ASSERT_TRUE(forces.valid);
    // Against the forces of displacements as large that are not rigid.
    EXPECT_LT(force_norm(system, forces.internal), 1e-12 * system.translation_stiffness * 20);
  }
}

/// Clamped along one side, loaded at the opposite corner and by its pressure.
Model loaded(Model model) {
  const ShellMesh& mesh = model.shells[0].mesh;
  Fix fix;
  fix.nodes = {0, 1, 2, 3, 4, 5, 6};
  model.fixes.push_back(fix);
  model.loads.push_back({0, ForceLoad{{static_cast<Index>(mesh.vertices.size() - 1)}, Vec3(0.01, 0.02, -0.03)}, {}});
  model.loads.push_back({0, PressureLoad{1e-4, true}, {}});
  return model;
}

double difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, (a[i] - b[i]).norm());
    largest = std::max(largest, a[i].norm());
  }
  return most / largest;
}

class EveryRun : public testing::TestWithParam<bool> {
protected:
  static RunSettings settings() {
    RunSettings run = GetParam() ? linear_run() : nonlinear_run({1});
    run.converge = 1e-12;
    return run;
  }
};

TEST_P(EveryRun, DoesNotDependOnTheUnitOfLength) {
  for (const Choice& choice : choices) {
    const Model model = loaded(model_of(bumpy(), choice));
    const std::vector<Vec3> one = last_state(model, settings()).displacement;
    for (const double unit : {1e-3, 1e3}) {  // the same body in m and in um
      Model scaled = model;
      for (Vec3& x : scaled.shells[0].mesh.vertices) {
        x *= unit;
      }
      scaled.shells[0].thickness[0] *= unit;
      scaled.shells[0].material.young /= unit * unit;
      std::get<PressureLoad>(scaled.loads[1].kind).value /= unit * unit;
      std::vector<Vec3> other = last_state(scaled, settings()).displacement;
      for (Vec3& u : other) {
        u /= unit;
      }
      EXPECT_LT(difference(one, other), 1e-10) << unit;
    }
  }
}

TEST_P(EveryRun, DoesNotDependOnOrientation) {
  const Eigen::Quaterniond turn = exponential(Vec3(0.7, -1.9, 1.2));
  for (const Choice& choice : choices) {
    const Model model = loaded(model_of(bumpy(), choice));
    const std::vector<Vec3> one = last_state(model, settings()).displacement;
    Model turned = model;
    for (Vec3& x : turned.shells[0].mesh.vertices) {
      x = turn * x;
    }
    for (Vec3& n : turned.shells[0].mesh.normals) {
      n = turn * n;
    }
    auto& force = std::get<ForceLoad>(turned.loads[0].kind);
    force.total = turn * force.total;
    std::vector<Vec3> other = last_state(turned, settings()).displacement;
    for (Vec3& u : other) {
      u = turn.conjugate() * u;
    }
    EXPECT_LT(difference(one, other), 1e-10);
  }
}

TEST_P(EveryRun, DoesNotDependOnWhichVertexComesFirst) {
  for (const Choice& choice : choices) {
    const Model model = loaded(model_of(bumpy(), choice));
    const std::vector<Vec3> one = last_state(model, settings()).displacement;
    Model renamed = model;
    std::mt19937 engine(5);
    for (auto& t : renamed.shells[0].mesh.triangles) {
      std::rotate(t.begin(), t.begin() + engine() % 3, t.end());
    }
    const double change = difference(one, last_state(renamed, settings()).displacement);
    if (choice.bending == Bending::comas) {
      EXPECT_GT(change, 1e-3);  // the paper's element does
    } else {
      EXPECT_LT(change, 1e-10);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, EveryRun, testing::Bool(),
                         [](const auto& p) { return p.param ? "linear" : "nonlinear"; });

TEST(Laws, LoadsTimesAMillionthGiveDisplacementsTimesAMillionth) {
  for (const Choice& choice : choices) {
    const Model model = loaded(model_of(bumpy(), choice));
    Model small = model;
    std::get<ForceLoad>(small.loads[0].kind).total *= 1e-6;
    std::get<PressureLoad>(small.loads[1].kind).value *= 1e-6;
    std::vector<Vec3> other = last_state(small, linear_run()).displacement;
    for (Vec3& u : other) {
      u *= 1e6;
    }
    EXPECT_LT(difference(last_state(model, linear_run()).displacement, other), 1e-12);
    // The nonlinear theory tends to the linear one.
    std::vector<Vec3> nonlinear = last_state(small, nonlinear_run({1})).displacement;
    for (Vec3& u : nonlinear) {
      u *= 1e6;
    }
    EXPECT_LT(difference(other, nonlinear), 1e-5);
  }
}

TEST(Laws, ManyLoadStepsOfALinearRunAreProportional) {
  const Model model = loaded(model_of(bumpy(), choices[2]));
  RunSettings settings = linear_run();
  settings.kind = StaticRun{true, {0.25, 1}};
  std::vector<std::vector<Vec3>> states;
  solve(model, settings, [&](const State& state) { states.push_back(state.displacement); });
  ASSERT_EQ(states.size(), 3U);
  for (Vec3& u : states[1]) {
    u *= 4;
  }
  EXPECT_LT(difference(states[2], states[1]), 1e-12);
}

/// An irregular flat patch, 10 x 6, its inner nodes moved and its vertices renamed.
Model flat_patch(const Choice& choice, Grid& grid) {
  grid = make_grid(
      5, 3, [](double u, double v) { return Vec3(10 * u, 6 * v, 0); }, Diagonals::random);
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, 0.5));
  model.shells[0].membrane = choice.membrane;
  model.shells[0].bending = choice.bending;
  return model;
}

bool on_boundary(const Vec3& x) { return std::min({x.x(), 10 - x.x(), x.y(), 6 - x.y()}) < 1e-9; }

TEST(Laws, AssembledPatchOfConstantMembraneStrain) {
  const auto exact = [](const Vec3& x) {
    return Vec3(1e-3 * (2 * x.x() + 0.5 * x.y()), 1e-3 * (0.5 * x.x() - x.y()), 0);
  };
  for (const Choice& choice : choices) {
    Grid grid;
    Model model = flat_patch(choice, grid);
    for (std::size_t i = 0; i < grid.mesh.vertices.size(); ++i) {
      if (on_boundary(grid.mesh.vertices[i])) {
        model.fixes.push_back(
            {0, {static_cast<Index>(i)}, {true, true, true}, {true, true, true}, exact(grid.mesh.vertices[i]), {}});
      }
    }
    const State state = last_state(model, linear_run());
    for (std::size_t i = 0; i < grid.mesh.vertices.size(); ++i) {
      EXPECT_LT((state.displacement[i] - exact(grid.mesh.vertices[i])).norm(), 1e-10 * 0.02) << i;
      EXPECT_LT(state.rotation[i].norm(), 1e-10 * 2e-3) << i;
    }
    const ElementFields fields = element_fields(model, state);
    for (std::size_t t = 0; t < grid.mesh.triangles.size(); ++t) {
      // The trace of the force is the same in every element's axes: E t / (1 - nu) (e_xx + e_yy).
      EXPECT_NEAR(fields.membrane_force[t][0] + fields.membrane_force[t][1], 1000 * 0.5 / 0.7 * 1e-3, 1e-10);
    }
  }
}

TEST(Laws, AssembledPatchOfConstantCurvature) {
  // Moments m along two opposite edges of a plate with nu = 0 bend it to w = m x^2 / (2 D).
  for (const Choice& choice : choices) {
    Grid grid;
    Model model = flat_patch(choice, grid);
    model.shells[0].material.poisson = 0;
    hold(
        model, [](const Vec3& x) { return x.x() < 1e-9; }, "xz", "yz");
    model.fixes.push_back({0, {grid.node(0, 0)}, {false, true, false}, {false, false, false}, Vec3::Zero(), {}});
    hold(
        model, [](const Vec3&) { return true; }, "", "z");
    const double m = 1e-3;
    for (std::size_t j = 0; j < 3; ++j) {
      for (const std::size_t end : {j, j + 1}) {
        model.loads.push_back({0, MomentLoad{{grid.node(5, end)}, Vec3(0, -m * 2 / 2, 0)}, {}});
      }
    }
    const State state = last_state(model, linear_run());
    const double rigidity = 1000 * 0.125 / 12;
    double worst = 0;
    for (std::size_t i = 0; i < grid.mesh.vertices.size(); ++i) {
      const double x = grid.mesh.vertices[i].x();
      worst = std::max(worst, std::abs(state.displacement[i].z() - m * x * x / (2 * rigidity)));
    }
    const double largest = m * 100 / (2 * rigidity);
    if (choice.bending == Bending::comas) {
      EXPECT_GT(worst, 0.01 * largest);  // the paper's element
    } else {
      EXPECT_LT(worst, 1e-10 * largest);
    }
  }
}

}  // namespace
}  // namespace tunica
