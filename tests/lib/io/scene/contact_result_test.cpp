#include "hdf5_values.hpp"
#include "scene_fixture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/page_file.hpp"
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

  /// A run of which the file holds the last state, or all.
  static RunSettings run_of(bool series) {
    RunSettings run;
    if (series) {
      run.kind = DynamicRun();
    }
    return run;
  }

  /// Writes the reference and two states.
  void write(bool series) {
    ResultOptions options;
    options.run = run_of(series);
    options.overwrite = true;
    ResultFile file(out(), model_, options);
    for (const double time : {0.0, 0.5, 1.0}) {
      file.append(state(time, Vec3(time, 0, 0)), fields(time));
    }
    file.commit(true);
  }

  [[nodiscard]] RunRecord begun(bool dynamic) const {
    RunSettings run;
    if (dynamic) {
      run.kind = DynamicRun();
    }
    return RunRecord(model_, run);
  }

  [[nodiscard]] Json report(bool dynamic) const {
    RunRecord record = begun(dynamic);
    for (const double time : {0.0, 0.5, 1.0}) {
      record.take(model_, state(time, Vec3(time, 0, 0)), fields(time));
    }
    return run_report(record);
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

TEST_F(ContactResult, APageHasEveryStateOfShellsAndOuterFaces) {
  for (const bool series : {false, true}) {
    write(series);
    const DrawnResult drawn = read_page_file(page_path(out()));
    EXPECT_EQ(drawn.kind, series ? DrawnResult::Kind::motion : DrawnResult::Kind::statics);
    EXPECT_FALSE(drawn.is_unloaded);
    EXPECT_THAT(
        (std::array{drawn.shells, drawn.pieces, drawn.reference.vertices.size(), drawn.reference.triangles.size(),
                    drawn.solids.vertices.size(), drawn.solids.triangles.size(), drawn.states.size()}),
        ElementsAre(8, 4, drawn_points, drawn_triangles, 5, 6, 3));
    for (std::size_t i = 0; i < drawn.states.size(); ++i) {
      const DrawnResult::State& state = drawn.states[i];
      const double time = 0.5 * real(i);
      EXPECT_THAT((std::array{real(state.number), state.time, state.load_factor}), ElementsAre(real(i), time, time));
      EXPECT_LT((state.displacement.back() - Vec3(time, 0, 0)).norm(), 1e-6);
      EXPECT_EQ(state.of_solids.back(), Vec3(time, 0, 0));
      EXPECT_THAT((std::array{state.membrane.back(), state.von_mises.back()}), ElementsAre(time, time));
    }
  }
}

TEST_F(ContactResult, APageHasTheFirstAndTheLastOfManyStates) {
  ResultOptions options;
  options.run = run_of(true);
  options.is_unloaded = true;
  options.command = "tunica-simulate \xff.ply";
  options.tessellation = 1;
  options.overwrite = true;
  ResultFile file(out(), model_, options);
  constexpr std::size_t count = 200;
  for (std::size_t i = 0; i < count; ++i) {
    file.append(state(real(i), Vec3::Zero()), fields(1));
  }
  EXPECT_FALSE(fs::exists(page_path(out())));
  file.commit(true);
  const DrawnResult drawn = read_page_file(page_path(out()));
  EXPECT_TRUE(drawn.is_unloaded);
  EXPECT_EQ(drawn.pieces, 4) << "whatever the result is cut into";
  ASSERT_EQ(drawn.states.size(), most_page_states);
  EXPECT_EQ(drawn.states.front().number, 0);
  EXPECT_EQ(drawn.states.back().number, count - 1);
  for (std::size_t i = 1; i < drawn.states.size(); ++i) {
    const std::size_t step = drawn.states[i].number - drawn.states[i - 1].number;
    EXPECT_TRUE(step >= 3 && step <= 8) << step;
  }
}

TEST_F(ContactResult, TetrahedraFollowTheShells) {
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

TEST_F(ContactResult, SolidsNeedNoShells) {
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

TEST_F(ContactResult, ContactsAreWrittenStateByState) {
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

TEST_F(ContactResult, ContactsAreReported) {
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

TEST_F(ContactResult, WhatAStateDoesNotSayHasNoValue) {
  RunRecord record = begun(true);
  State silent = state(1, Vec3::Zero());
  silent.contacts.clear();
  silent.rigids.clear();
  record.take(model_, silent, fields(1));
  const Json result = run_report(record);
  EXPECT_EQ(result["contacts"]["grip"]["force_n"].dump(), "[[null,null,null]]");
  EXPECT_EQ(result["contacts"]["grip"]["smallest_gap_mm"].dump(), R"([{"lower":null,"upper":null}])");
  EXPECT_EQ(result["rigid"]["tool"]["position_mm"].dump(), "[[null,null,null]]");
  EXPECT_TRUE(result["balance"]["force"].is_null());
}

TEST_F(ContactResult, ShellsAloneShowNothingOfIt) {
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

TEST_F(ContactResult, StressesBeyondSinglePrecisionAreRefused) {
  ResultFile file(out(), model_, {});
  ElementFields huge = fields(1);
  huge.solid_pressure[1] = 1e39;
  EXPECT_THROW(file.append(state(1, Vec3::Zero()), huge), RequirementError);
}

TEST_F(ContactResult, ExportsHoldBoth) {
  for (const bool series : {false, true}) {
    ResultExport files(out(), model_, {.pvd = true, .xmf = true, .run = run_of(series), .overwrite = true});
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

TEST_F(ContactResult, AResumedRunKnowsItsContacts) {
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
  RunRecord record = begun(false);
  const auto report_it = [&](const State& state) { record.take(model_, state, fields(state.time)); };
  EXPECT_TRUE(RunJournal::open(part).replay(model_, report_it));
  EXPECT_EQ(run_report(record), report(false));
  model_.contacts.pop_back();
  EXPECT_THROW((void)RunJournal::open(part).replay(model_, [](const State&) {}), InputError);
}

}  // namespace
}  // namespace tunica::test
