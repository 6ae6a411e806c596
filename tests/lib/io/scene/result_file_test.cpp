#include "hdf5_values.hpp"
#include "scene_fixture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/result/result_file.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/result_grid.hpp"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <numbers>

namespace tunica::test {
namespace {

namespace fs = std::filesystem;

class ResultTest : public SceneTest {
protected:
  ResultTest() {
    model_ = load(R"(
[run]
kind = "static"
[[shell]]
name = "ball"
mesh = "ball.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
[[shell]]
name = "plate"
mesh = "plate.ply"
thickness = "0.1mm"
young = "1MPa"
poisson = 0.3
[[probe]]
name = "last"
body = "plate"
nearest = ["10mm", "10mm", "0mm"]
)")
                 .model;
    options_.scene = "[run]\n";
    options_.command = "tunica-simulate";
    options_.inputs = {{"ball.ply", "00"}, {"a longer name.ply", "11"}};
  }

  /// The whole model turned by `rotation` about `centre` and moved by `shift`.
  [[nodiscard]] State moved(const Vec3& rotation, const Vec3& centre, const Vec3& shift) const {
    const Mat3 turn = Eigen::AngleAxisd(rotation.norm(), rotation.stableNormalized()).toRotationMatrix();
    State state;
    state.time = state.load_factor = 0.5;
    for (const ShellBody& body : model_.shells) {
      for (const Vec3& x : body.mesh.vertices) {
        state.displacement.emplace_back(turn * (x - centre) + centre + shift - x);
        state.rotation.push_back(rotation);
      }
    }
    return state;
  }

  [[nodiscard]] ElementFields fields(double value) const {
    std::size_t count = 0;
    for (const ShellBody& body : model_.shells) {
      count += body.mesh.triangles.size();
    }
    ElementFields result;
    result.membrane_force.assign(count, Vec3::Constant(value));
    result.bending_moment.assign(count, Vec3::Constant(2 * value));
    result.von_mises_top.assign(count, value);
    result.von_mises_bottom.assign(count, value);
    result.von_mises.assign(model_.node_count(), value);
    result.membrane_stress.assign(model_.node_count(), value);
    result.membrane_von_mises.assign(count, value);
    result.tension.assign(count, value);
    result.strain.assign(model_.node_count(), value / 100);
    result.wall.stress_p99 = value;
    result.wall.stress_max = 3 * value;
    result.wall.stress_max_at = Vec3::Constant(value);
    result.wall.strain_p99 = value / 100;
    result.wall.strain_max = value / 50;
    result.largest_displacement = value;
    result.principal_strain_top.assign(count, Vec2(value, -value));
    result.principal_strain_bottom.assign(count, Vec2(value, -value));
    for (std::size_t i = 0; i < count; ++i) {
      result.pressure.push_back(static_cast<double>(i));
    }
    return result;
  }

  [[nodiscard]] fs::path out() const { return folder_ / "out.hdf"; }
  [[nodiscard]] fs::path part() const { return folder_ / "out.hdf.part"; }

  Model model_;
  ResultOptions options_;
};

TEST_F(ResultTest, RigidMotionMovesTheCurvedSurfaceRigidly) {
  const Vec3 rotation = 2.5 * Vec3(1, -2, 0.5).normalized();
  const Vec3 centre(3, 1, -7);
  const Vec3 shift(100, 0, 4);
  const State state = moved(rotation, centre, shift);
  const Mat3 turn = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
  for (std::size_t body = 0; body < model_.shells.size(); ++body) {
    const Tessellation surface = tessellate_uniformly(model_.shells[body].mesh, 3);
    const std::vector<Vec3> u = curved_displacement(model_, body, state, surface);
    ASSERT_EQ(u.size(), surface.mesh.vertices.size());
    for (std::size_t v = 0; v < u.size(); ++v) {
      const Vec3& x = surface.mesh.vertices[v];
      EXPECT_LT((u[v] - (turn * (x - centre) + centre + shift - x)).norm(), 1e-11);
    }
  }
}

TEST_F(ResultTest, ANormalTurnedIntoItsFacetStillGivesADisplacement) {
  State state = moved(Vec3::Zero(), Vec3::Zero(), Vec3(0, 0, 1));
  state.rotation[0] = Vec3(0, std::numbers::pi / 2, 0);
  const Tessellation surface = tessellate_uniformly(model_.shells[0].mesh, 2);
  for (const Vec3& u : curved_displacement(model_, 0, state, surface)) {
    EXPECT_TRUE(u.allFinite());
    EXPECT_LT(u.norm(), 20);
  }
}

TEST_F(ResultTest, InflationScalesTheCurvedSurface) {
  const double stretch = 1.4;
  State state = moved(Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
  for (std::size_t body = 0; body < model_.shells.size(); ++body) {
    const ShellMesh& mesh = model_.shells[body].mesh;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      state.displacement[model_.first_node(body) + v] = (stretch - 1) * mesh.vertices[v];
    }
    const Tessellation surface = tessellate_uniformly(mesh, 3);
    const std::vector<Vec3> u = curved_displacement(model_, body, state, surface);
    for (std::size_t v = 0; v < u.size(); ++v) {
      EXPECT_LT((u[v] - (stretch - 1) * surface.mesh.vertices[v]).norm(), 1e-11);
    }
  }
}

TEST_F(ResultTest, WatertightShellsStayWatertightWhateverTheyDo) {
  model_.shells[0].mesh.patch = Patch::watertight;
  const ShellMesh& mesh = model_.shells[0].mesh;
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
  const State rigid = moved(Vec3(0.7 * Vec3(1, -2, 0.5).normalized()), Vec3(3, 1, -7), Vec3(0, 0, 4));
  const int level = 6;
  const Tessellation surface = tessellate_uniformly(mesh, level);
  const std::vector<Vec3> u = curved_displacement(model_, 0, rigid, surface);
  for (std::size_t v = 0; v < u.size(); ++v) {
    const Vec3& x = surface.mesh.vertices[v];
    EXPECT_LT((u[v] - (turn * (x - Vec3(3, 1, -7)) + Vec3(3, 1, -3) - x)).norm(), 1e-11);
  }
  State state = moved(Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const double k = static_cast<double>(i);
    state.displacement[i] = 0.3 * Vec3(std::sin(k), std::cos(3 * k), std::sin(5 * k));
    state.rotation[i] = 0.4 * Vec3(std::cos(2 * k), std::sin(k), std::sin(3 * k));
  }
  // On a closed surface every point of an edge, corners left out, belongs to two patches.
  for (const State& now : {rigid, state}) {
    const std::vector<Vec3> moves = curved_displacement(model_, 0, now, surface);
    std::vector<Vec3> on_edges;
    for (std::size_t v = 0; v < moves.size(); ++v) {
      const Vec2& b = surface.barycentric[v];
      const double largest = std::max({b[0], b[1], 1 - b[0] - b[1]});
      if (std::min({b[0], b[1], 1 - b[0] - b[1]}) < 1e-9 && largest < 1 - 1e-9) {
        on_edges.push_back(surface.mesh.vertices[v] + moves[v]);
      }
    }
    ASSERT_EQ(on_edges.size(), 3 * (level - 1) * mesh.triangles.size());
    for (std::size_t i = 0; i < on_edges.size(); ++i) {
      double nearest = 1e9;
      for (std::size_t j = 0; j < on_edges.size(); ++j) {
        nearest = i == j ? nearest : std::min(nearest, (on_edges[i] - on_edges[j]).norm());
      }
      EXPECT_LT(nearest, 1e-13 * mesh.vertices[0].norm() + 1e-13);
    }
  }
}

TEST_F(ResultTest, ASmallRotationOfOneNodeMovesLinearAndFiniteSurfacesAlike) {
  const double angle = 1e-5;
  State finite = moved(Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
  finite.rotation[0] = angle * Vec3(1, 0.5, -0.2);
  finite.displacement[1] = 1e-5 * Vec3(0.3, 1, -2);
  State linear = finite;
  linear.linear = true;
  const Tessellation surface = tessellate_uniformly(model_.shells[0].mesh, 3);
  const std::vector<Vec3> a = curved_displacement(model_, 0, finite, surface);
  const std::vector<Vec3> b = curved_displacement(model_, 0, linear, surface);
  double largest = 0;
  for (std::size_t v = 0; v < a.size(); ++v) {
    largest = std::max(largest, a[v].norm());
    EXPECT_LT((a[v] - b[v]).norm(), 100 * angle * angle);
  }
  EXPECT_GT(largest, angle / 10);
}

// A cubic whose end slopes differ by s over a length L rises by 4/27 s L at most, and both ends of an edge may turn.
TEST_F(ResultTest, AFarTurnedNodeMakesNoSpike) {
  State state = moved(Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
  const ShellMesh& mesh = model_.shells[0].mesh;
  const double angle = 1.4;
  double longest = 0;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      longest = std::max(longest, (mesh.vertices[triangle[k]] - mesh.vertices[triangle[(k + 1) % 3]]).norm());
    }
  }
  state.rotation[0] = angle * mesh.normals[0].unitOrthogonal();
  EXPECT_GT(count_unresolved(model_, state, 0.5), 0U);
  EXPECT_EQ(count_unresolved(model_, state, 2), 0U);
  for (const Vec3& u : curved_displacement(model_, 0, state, tessellate_uniformly(mesh, 8))) {
    EXPECT_LT(u.norm(), 0.2 * angle * longest);
  }
}

TEST_F(ResultTest, ASeriesGrowsAndASingleStateIsReplaced) {
  for (const bool series : {false, true}) {
    options_.run.kind = series ? decltype(RunSettings::kind)(DynamicRun()) : StaticRun();
    options_.overwrite = true;
    ResultFile file(out(), model_, options_);
    file.append(moved(Vec3::Zero(), Vec3::Zero(), Vec3::Zero()), fields(0));
    file.append(moved(Vec3::Zero(), Vec3::Zero(), Vec3(1, 2, 3)), fields(7));
    file.commit(true);
    const double points = values(out(), "/VTKHDF/NumberOfPoints").at(0);
    const double cells = values(out(), "/VTKHDF/NumberOfCells").at(0);
    EXPECT_EQ(points, 31 + 3 * (12 + 56) + 3 * 40);  // 8 + 32 shells, 4 pieces per edge; shared nodes and edges
    EXPECT_EQ(cells, 40 * 16);
    const double states = series ? 2 : 1;
    const std::vector<double> u = values(out(), "/VTKHDF/PointData/displacement");
    ASSERT_EQ(static_cast<double>(u.size()), 3 * points * states);
    EXPECT_NEAR(u[u.size() - 1], 3, 1e-6);
    const std::vector<double> pressure = values(out(), "/VTKHDF/CellData/pressure");
    ASSERT_EQ(static_cast<double>(pressure.size()), cells * states);
    EXPECT_EQ(pressure[0], 0);
    EXPECT_EQ(pressure[16], 1);
    EXPECT_EQ(pressure.back(), 39);
    EXPECT_EQ(values(out(), "/VTKHDF/CellData/bending_moment").back(), 14);
    const std::vector<double> body = values(out(), "/VTKHDF/CellData/body");
    EXPECT_EQ(body.front(), 0);
    EXPECT_EQ(body.back(), 1);
    EXPECT_NEAR(values(out(), "/VTKHDF/PointData/thickness").front(), 0.5, 1e-7);
    EXPECT_NEAR(values(out(), "/VTKHDF/PointData/thickness").back(), 0.1, 1e-7);
    EXPECT_EQ(values(out(), "/tunica/nodes/displacement").size(), 2U * 31 * 3);
    EXPECT_THAT(values(out(), "/tunica/probes/last/displacement"), ::testing::ElementsAre(0, 0, 0, 1, 2, 3));
    EXPECT_TRUE(std::isnan(values(out(), "/tunica/history/volume").at(0)));
    EXPECT_THAT(values(out(), "/tunica/converged"), ::testing::ElementsAre(1));
    EXPECT_FALSE(fs::exists(part()));
  }
}

TEST_F(ResultTest, ThePartStaysFromTheFirstStateOn) {
  { const ResultFile file(out(), model_, options_); }
  EXPECT_FALSE(fs::exists(part()));
  {
    ResultFile file(out(), model_, options_);
    file.append(moved(Vec3::Zero(), Vec3::Zero(), Vec3(1, 2, 3)), fields(7));
  }
  EXPECT_EQ(values(part(), "/tunica/nodes/displacement").back(), 3);
  EXPECT_THAT(values(part(), "/tunica/converged"), ::testing::ElementsAre(0));
  EXPECT_FALSE(fs::exists(out()));
}

TEST_F(ResultTest, AnExistingResultIsKept) {
  (void)folder_.file("out.hdf", "precious");
  EXPECT_THROW(ResultFile(out(), model_, options_), OutputError);
  EXPECT_EQ(bytes_of(out()), "precious");
}

TEST_F(ResultTest, LargeModelsAreDrawnCoarser) {
  EXPECT_EQ(drawing_level(1), 4);
  EXPECT_EQ(drawing_level(12'500), 4);
  EXPECT_EQ(drawing_level(12'501), 3);
  EXPECT_EQ(drawing_level(50'000), 2);
  EXPECT_EQ(drawing_level(1'000'000), 1);
}

}  // namespace
}  // namespace tunica::test
