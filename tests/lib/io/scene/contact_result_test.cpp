#include "hdf5_values.hpp"
#include "scene_fixture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/result_export.hpp"
#include "tunica/io/result/result_file.hpp"
#include "tunica/io/result/run_journal.hpp"
#include "tunica/io/result/run_report.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tunica::test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

/// A ball of 8 shells, a block of two tetrahedra of which the second is twice as large, a rigid ball that touches both.
class ContactResult : public ::testing::Test {
protected:
  ContactResult() {
    ShellBody ball;
    ball.name = "ball";
    ball.mesh = octahedron(10);
    ball.thickness = {0.5};
    model_.shells.push_back(ball);
    SolidBody block;
    block.name = "block";
    block.mesh.vertices = {{20, 0, 0}, {21, 0, 0}, {20, 1, 0}, {20, 0, 1}, {20, 0, -2}};
    block.mesh.tetrahedra = {{0, 1, 2, 3}, {0, 2, 1, 4}};
    model_.solids.push_back(block);
    model_.rigids.push_back({"tool", RigidSphere{{{{0, Vec3::Zero()}}}, {{{0, 1}}}}, {}, ""});
    model_.contacts.push_back({"grip", {ContactParty{false, 0}, ContactParty{true, 0}}});
    model_.contacts.push_back({"push", {ContactParty{false, 1}, ContactParty{true, 0}}});
  }

  /// Bodies moved by `shift`; contacts with numbers that grow with `time`.
  [[nodiscard]] State state(double time, const Vec3& shift) const {
    State state;
    state.time = state.load_factor = time;
    state.displacement.assign(model_.node_count(), shift);
    state.rotation.assign(model_.node_count(), Vec3::Zero());
    if (time > 0) {
      for (const double of : {1.0, 2.0}) {
        state.contacts.push_back({Vec3(of, time, 0), Vec3(0, of, time), of * time, -0.1 * of, 0.1 * time,
                                  static_cast<std::size_t>(of), 0.01 * of});
      }
      state.contacts.resize(model_.contacts.size());
      state.rigids.assign(model_.rigids.size(), {Vec3(time, 0, 0), Vec3(0, time, 0), Vec3(0, 0, time)});
      state.force_imbalance = 1e-9 / time;
      state.moment_imbalance = 1e-9 * time;
    }
    return state;
  }

  [[nodiscard]] ElementFields fields(double value) const {
    const std::size_t shells = model_.shells.empty() ? 0 : 8;
    ElementFields result;
    result.membrane_force.assign(shells, Vec3::Constant(value));
    result.bending_moment.assign(shells, Vec3::Constant(2 * value));
    for (auto* list : {&result.von_mises_top, &result.von_mises_bottom, &result.membrane_von_mises, &result.tension,
                       &result.pressure}) {
      list->assign(shells, value);
    }
    result.von_mises.assign(model_.node_count(), value);
    result.membrane_stress.assign(model_.node_count(), value);
    result.principal_strain_top.assign(shells, Vec2(value, -value));
    result.principal_strain_bottom.assign(shells, Vec2(value, -value));
    if (!model_.solids.empty()) {
      result.solid_von_mises = {3 * value, 6 * value};
      result.solid_pressure = {value, -value};
      // The node that only the first has, and the one that only the second has; the others by volume, 1 to 2.
      const std::array<double, 5> at_nodes{5, 5, 5, 3, 6};
      std::ranges::transform(at_nodes, result.von_mises.end() - 5, [&](double stress) { return stress * value; });
    }
    return result;
  }

  /// Writes the reference and two states.
  void write(bool series) {
    ResultOptions options;
    options.series = series;
    options.overwrite = true;
    ResultFile file(out(), model_, options);
    for (const double time : {0.0, 0.5, 1.0}) {
      file.append(state(time, Vec3(time, 0, 0)), fields(time));
    }
    file.commit(true);
  }

  [[nodiscard]] Json report(bool dynamic) const {
    Json result;
    prepare_result(result, model_);
    for (const double time : {0.0, 0.5, 1.0}) {
      report_state(result, model_, state(time, Vec3(time, 0, 0)), fields(time), dynamic);
    }
    return result;
  }

  [[nodiscard]] fs::path out() const { return folder_ / "out.hdf"; }
  [[nodiscard]] std::vector<double> read(const char* name) const { return values(out(), name); }

  TemporaryFolder folder_;
  Model model_;
};

constexpr std::size_t drawn_points = 6 + 12 * 3 + 8 * 3;  // 4 pieces per edge: nodes, edges, inside
constexpr std::size_t drawn_triangles = 8 * 16;

std::vector<double> last(const std::vector<double>& list, std::size_t count) {
  return {list.end() - static_cast<std::ptrdiff_t>(count), list.end()};
}

TEST_F(ContactResult, tetrahedraFollowTheShells) {
  for (const bool series : {false, true}) {
    write(series);
    const std::size_t states = series ? 3 : 1;
    EXPECT_THAT(read("/VTKHDF/NumberOfPoints"), ElementsAre(drawn_points + 5));
    EXPECT_THAT(read("/VTKHDF/NumberOfCells"), ElementsAre(drawn_triangles + 2));
    const double corners = 3 * drawn_triangles;
    EXPECT_THAT(read("/VTKHDF/NumberOfConnectivityIds"), ElementsAre(corners + 8));
    EXPECT_THAT(last(read("/VTKHDF/Offsets"), 4), ElementsAre(corners - 3, corners, corners + 4, corners + 8));
    EXPECT_THAT(last(read("/VTKHDF/Types"), 3), ElementsAre(5, 10, 10));
    const double first = drawn_points;
    EXPECT_THAT(last(read("/VTKHDF/Connectivity"), 8),
                ElementsAre(first, first + 1, first + 2, first + 3, first, first + 2, first + 1, first + 4));
    EXPECT_THAT(last(read("/VTKHDF/Points"), 3), ElementsAre(20, 0, -2));
    EXPECT_THAT(last(read("/VTKHDF/CellData/body"), 3), ElementsAre(0, 1, 1));
    EXPECT_EQ(read("/VTKHDF/PointData/displacement").size(), states * 3 * (drawn_points + 5));
    EXPECT_THAT(last(read("/VTKHDF/PointData/displacement"), 3), ElementsAre(1, 0, 0));
    EXPECT_THAT(last(read("/VTKHDF/PointData/von_mises"), 6), ElementsAre(1, 5, 5, 5, 3, 6));

    const std::vector<double> stress = read("/VTKHDF/CellData/solid_von_mises");
    ASSERT_EQ(stress.size(), states * (drawn_triangles + 2));
    EXPECT_THAT(last(stress, 2), ElementsAre(3, 6));
    EXPECT_TRUE(std::isnan(stress[stress.size() - 3]));
    EXPECT_THAT(last(read("/VTKHDF/CellData/solid_pressure"), 2), ElementsAre(1, -1));
    const std::vector<double> force = last(read("/VTKHDF/CellData/membrane_force"), 9);
    EXPECT_EQ(force[2], 1);
    EXPECT_TRUE(std::isnan(force[3]));
    EXPECT_TRUE(std::isnan(force[8]));
    EXPECT_TRUE(std::isnan(read("/VTKHDF/PointData/thickness").back()));

    EXPECT_THAT(read("/tunica/tetrahedra/nodes"), ElementsAre(6, 7, 8, 9, 6, 8, 7, 10));
    EXPECT_THAT(read("/tunica/tetrahedra/body"), ElementsAre(1, 1));
    EXPECT_THAT(read("/tunica/tetrahedra/solid_von_mises"), ElementsAre(0, 0, 1.5, 3, 3, 6));
    EXPECT_EQ(read("/tunica/elements/pressure").size(), 3U * 8);
    EXPECT_THAT(last(read("/tunica/nodes/position"), 3), ElementsAre(20, 0, -2));
    EXPECT_EQ(read("/tunica/nodes/displacement").size(), 3U * 3 * 11);
  }
}

TEST_F(ContactResult, solidsNeedNoShells) {
  model_.shells.clear();
  model_.contacts.clear();
  model_.rigids.clear();
  for (const bool series : {false, true}) {
    write(series);
    EXPECT_THAT(read("/VTKHDF/Types"), ElementsAre(10, 10));
    EXPECT_THAT(read("/VTKHDF/Offsets"), ElementsAre(0, 4, 8));
    EXPECT_THAT(read("/VTKHDF/CellData/body"), ElementsAre(0, 0));
    EXPECT_THAT(last(read("/VTKHDF/PointData/von_mises"), 5), ElementsAre(5, 5, 5, 3, 6));
    EXPECT_FALSE(holds(out(), "/VTKHDF/CellData", "membrane_force"));
    EXPECT_FALSE(holds(out(), "/VTKHDF/PointData", "thickness"));
    EXPECT_FALSE(holds(out(), "/tunica", "elements"));
  }
  const Json result = report(false);
  EXPECT_EQ(result["shells"], 0);
  EXPECT_EQ(result["tetrahedra"], 2);
  EXPECT_TRUE(result["wall"].is_null());
}

TEST_F(ContactResult, contactsAreWrittenStateByState) {
  write(false);
  EXPECT_THAT(last(read("/tunica/contacts/grip/force"), 6), ElementsAre(1, 0.5, 0, 1, 1, 0));
  EXPECT_THAT(last(read("/tunica/contacts/push/moment"), 6), ElementsAre(0, 2, 0.5, 0, 2, 1));
  EXPECT_THAT(last(read("/tunica/contacts/push/area"), 2), ElementsAre(1, 2));
  EXPECT_THAT(last(read("/tunica/contacts/push/smallest_gap"), 4), ElementsAre(-0.2, 0.05, -0.2, 0.1));
  EXPECT_THAT(read("/tunica/contacts/push/points"), ElementsAre(0, 2, 2));
  EXPECT_THAT(last(read("/tunica/contacts/grip/slip"), 2), ElementsAre(0.01, 0.01));
  EXPECT_THAT(last(read("/tunica/rigid/tool/position"), 3), ElementsAre(0, 0, 1));
  EXPECT_THAT(last(read("/tunica/rigid/tool/force"), 3), ElementsAre(1, 0, 0));
  EXPECT_THAT(last(read("/tunica/rigid/tool/moment"), 3), ElementsAre(0, 1, 0));
  EXPECT_THAT(read("/tunica/history/force_imbalance"), ElementsAre(0, 2e-9, 1e-9));
  EXPECT_THAT(read("/tunica/history/moment_imbalance"), ElementsAre(0, 0.5e-9, 1e-9));
  // Rows stand beside those of the history; the reference does not say.
  EXPECT_EQ(read("/tunica/contacts/grip/force").size(), 3 * read("/tunica/history/time").size());
  EXPECT_TRUE(std::isnan(read("/tunica/contacts/grip/force").front()));
  EXPECT_TRUE(std::isnan(read("/tunica/rigid/tool/position").front()));
}

TEST_F(ContactResult, contactsAreReported) {
  const Json result = report(false);
  EXPECT_EQ(result["shells"], 8);
  EXPECT_EQ(result["tetrahedra"], 2);
  EXPECT_EQ(result["nodes"], 11);
  const Json& push = result["contacts"]["push"];
  EXPECT_EQ(push["load_factor"].dump(), "[0.5,1.0]");  // without the reference
  EXPECT_EQ(push["time_s"].dump(), "[null,null]");
  EXPECT_EQ(push["force_n"].dump(), "[[2.0,0.5,0.0],[2.0,1.0,0.0]]");
  EXPECT_EQ(push["moment_n_mm"].dump(), "[[0.0,2.0,0.5],[0.0,2.0,1.0]]");
  EXPECT_EQ(push["area_mm2"].dump(), "[1.0,2.0]");
  EXPECT_EQ(push["smallest_gap_mm"].dump(), R"([{"lower":-0.2,"upper":0.05},{"lower":-0.2,"upper":0.1}])");
  EXPECT_EQ(push["points"].dump(), "[2,2]");
  EXPECT_EQ(push["slip_mm"].dump(), "[0.02,0.02]");
  const Json& tool = result["rigid"]["tool"];
  EXPECT_EQ(tool["load_factor"].dump(), "[0.5,1.0]");
  EXPECT_EQ(tool["force_n"].dump(), "[[0.5,0.0,0.0],[1.0,0.0,0.0]]");
  EXPECT_EQ(tool["moment_n_mm"].dump(), "[[0.0,0.5,0.0],[0.0,1.0,0.0]]");
  EXPECT_EQ(tool["position_mm"].dump(), "[[0.0,0.0,0.5],[0.0,0.0,1.0]]");
  EXPECT_EQ(result["balance"]["force"], 2e-9);  // the largest, not the last
  EXPECT_EQ(result["balance"]["moment"], 1e-9);
  EXPECT_EQ(report(true)["contacts"]["grip"]["time_s"].dump(), "[0.5,1.0]");
}

TEST_F(ContactResult, whatAStateDoesNotSayHasNoValue) {
  Json result;
  prepare_result(result, model_);
  State silent = state(1, Vec3::Zero());
  silent.contacts.clear();
  silent.rigids.clear();
  report_state(result, model_, silent, fields(1), true);
  EXPECT_EQ(result["contacts"]["grip"]["force_n"].dump(), "[[null,null,null]]");
  EXPECT_EQ(result["contacts"]["grip"]["smallest_gap_mm"].dump(), R"([{"lower":null,"upper":null}])");
  EXPECT_EQ(result["rigid"]["tool"]["position_mm"].dump(), "[[null,null,null]]");
  EXPECT_TRUE(result["balance"]["force"].is_null());
}

TEST_F(ContactResult, shellsAloneShowNothingOfIt) {
  model_.solids.clear();
  model_.rigids.clear();
  model_.contacts.clear();
  write(true);
  EXPECT_THAT(read("/VTKHDF/NumberOfCells"), ElementsAre(drawn_triangles));
  EXPECT_THAT(read("/VTKHDF/Types"), ::testing::Each(5));
  EXPECT_THAT(read("/VTKHDF/CellData/von_mises_top"), ::testing::Each(::testing::Ge(0)));
  EXPECT_FALSE(holds(out(), "/VTKHDF/CellData", "solid_von_mises"));
  for (const char* name : {"tetrahedra", "contacts", "rigid"}) {
    EXPECT_FALSE(holds(out(), "/tunica", name)) << name;
  }
  EXPECT_FALSE(holds(out(), "/tunica/history", "force_imbalance"));
  const Json result = report(true);
  EXPECT_EQ(result["tetrahedra"], 0);
  for (const char* key : {"contacts", "rigid", "balance"}) {
    EXPECT_FALSE(result.contains(key)) << key;
  }
}

TEST_F(ContactResult, stressesBeyondSinglePrecisionAreRefused) {
  ResultFile file(out(), model_, {});
  ElementFields huge = fields(1);
  huge.solid_pressure[1] = 1e39;
  EXPECT_THROW(file.append(state(1, Vec3::Zero()), huge), RequirementError);
}

TEST_F(ContactResult, exportsHoldBoth) {
  for (const bool series : {false, true}) {
    ResultExport files(out(), model_, {.pvd = true, .xmf = true, .series = series, .overwrite = true});
    for (const double time : {0.0, 1.0}) {
      EXPECT_TRUE(files.append(state(time, Vec3(time, 0, 0)), fields(time)));
    }
    files.commit();
    const std::string grid = bytes_of(folder_ / "out_0001.vtu");
    EXPECT_THAT(grid, ::testing::HasSubstr("NumberOfPoints=\"71\" NumberOfCells=\"130\""));
    EXPECT_THAT(grid, ::testing::HasSubstr("Name=\"solid_von_mises\""));
    const std::string index = bytes_of(folder_ / "out.xmf");
    EXPECT_THAT(index, ::testing::HasSubstr("TopologyType=\"Triangle\" NumberOfElements=\"128\""));
    EXPECT_THAT(index, ::testing::HasSubstr("TopologyType=\"Tetrahedron\" NumberOfElements=\"2\""));
    EXPECT_THAT(index, ::testing::HasSubstr(">384 1 8<"));  // the tetrahedra's points in Connectivity
    EXPECT_THAT(index, ::testing::HasSubstr(series ? ">258 1 2<" : ">128 1 2<"));  // their cells, of the last state
  }
}

TEST_F(ContactResult, aResumedRunKnowsItsContacts) {
  const fs::path part = part_of(out());
  {
    RunJournal journal = RunJournal::create(part, {});
    (void)folder_.file("out.hdf.part", "begun");
    for (const double time : {0.0, 0.5, 1.0}) {
      journal.append(state(time, Vec3(time, 0, 0)));
    }
    journal.offer([&] {
      Checkpoint checkpoint;
      checkpoint.displacement.assign(model_.node_count(), Vec3::Zero());
      checkpoint.rotation.assign(model_.node_count(), Eigen::Quaterniond::Identity());
      return checkpoint;
    });
    journal.append(state(2, Vec3::Zero()));  // after the checkpoint: forgotten
  }
  Json result;
  prepare_result(result, model_);
  const auto report_it = [&](const State& state) { report_state(result, model_, state, fields(state.time), false); };
  EXPECT_TRUE(RunJournal::open(part).replay(model_, report_it));
  EXPECT_EQ(result, report(false));
  model_.contacts.pop_back();
  EXPECT_THROW((void)RunJournal::open(part).replay(model_, [](const State&) {}), InputError);
}

}  // namespace
}  // namespace tunica::test
