#include "tunica/report/report.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/report/detail/arguments.hpp"
#include "tunica/report/detail/drawn_shells.hpp"
#include "tunica/report/detail/html.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/redaction.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace tunica::report {
namespace {

using testing::ElementsAre;

TEST(Html, TextStaysText) {
  EXPECT_EQ(escaped("<a href=\"x\">'&`"), "&lt;a href=&quot;x&quot;&gt;&#39;&amp;&#96;");
  EXPECT_EQ(part("item", {{"text", std::string("<b>")}}).text, "<li>&lt;b&gt;</li>\n");
  EXPECT_EQ(part("item", {{"text", part("name", {{"name", "{text}"}})}}).text, "<li><bdi>{text}</bdi></li>\n");
}

TEST(Html, WhatIsNoUtf8OrTurnsTheTextIsReplaced) {
  const std::string replaced = "\xef\xbf\xbd";
  EXPECT_EQ(escaped("Gef\xc3\xa4\xc3\x9f \xf0\x9f\xab\x80"), "Gef\xc3\xa4\xc3\x9f \xf0\x9f\xab\x80");
  EXPECT_EQ(escaped("\xff"), replaced);
  EXPECT_EQ(escaped("\xc0\xbc"), replaced + replaced) << "an overlong '<'";
  EXPECT_EQ(escaped("\xed\xa0\x80"), replaced + replaced + replaced) << "a surrogate";
  EXPECT_EQ(escaped("\xe2\x82"), replaced + replaced) << "cut off";
  EXPECT_EQ(escaped("\xe2\x80\xae"
                    "a"),
            replaced + "a")
      << "right to left";
  EXPECT_EQ(legible("\xff<b>"), replaced + "<b>");
}

TEST(Html, FieldsOfATableAreOneLine) {
  EXPECT_EQ(in_one_line("a\tb\r\n c\x7f"), "a b   c ");
  EXPECT_EQ(in_one_line("\xc2\x9b"
                        "2J\xff"),
            "\xef\xbf\xbd"
            "2J\xef\xbf\xbd")
      << "a terminal's command";
}

TEST(Html, FiguresHaveThreeDigits) {
  EXPECT_EQ(figure(0.0123456), "0.0123");
  EXPECT_EQ(figure(9.8765), "9.88");
  EXPECT_EQ(figure(98.765), "98.8");
  EXPECT_EQ(figure(987.65), "988");
  EXPECT_EQ(figure(98765.4), "98765");
  EXPECT_EQ(figure(1.5), "1.5");
  EXPECT_EQ(figure(10), "10");
  EXPECT_EQ(figure(5.38e-11), "5.38e-11");
  EXPECT_EQ(figure(-0.5), "-0.5");
}

TEST(Html, BoundsAreRoundedUp) {
  EXPECT_EQ(figure_above(0.18606), "0.187");
  EXPECT_EQ(figure_above(1.1001), "1.11");
  EXPECT_EQ(figure_above(0.0123401), "0.0124");
  EXPECT_EQ(figure_above(99.91), "100");
  EXPECT_EQ(figure_above(1234.1), "1235");
  EXPECT_EQ(figure_above(1.5), "1.5");
  EXPECT_EQ(figure_above(0.3), "0.3");
  EXPECT_EQ(figure_above(0.07), "0.07");
  EXPECT_EQ(figure_above(10), "10");
  EXPECT_EQ(figure_above(0), "0");
  EXPECT_EQ(figure_above(-1), "-1");
  EXPECT_EQ(figure_above(std::numeric_limits<double>::infinity()), figure(std::numeric_limits<double>::infinity()));
  for (double value = 1e-9; value < 1e5; value *= 1.37) {
    EXPECT_GE(std::stod(figure_above(value)), value * (1 - 1e-12));
    EXPECT_LE(std::stod(figure_above(value)), value * 1.0101 + 1e-12);
  }
}

TEST(Summary, RoundsBoundsUp) {
  PipelineCase one{"a/1", "out/a/1", "relax", "0", "done", {}, {}};
  one.reports["relax"] = {{"result", {{"shells", 8}, {"hausdorff_percent", {{"lower", 0.11}, {"upper", 0.114634}}}}}};
  EXPECT_THAT(summary_tsv({one}), testing::HasSubstr("\t0.1147\t"));
}

TEST(Measures, AnAccuracyWithoutAnEstimateOfItsOwnShowsThatOfAllAnswers) {
  PipelineCase one{"a/1", "out/a/1", "simulate", "0", "done", {}, {}};
  one.reports["simulate"] = {
      {"ok", true},
      {"result",
       {{"accuracy", {{"of", "membrane"}, {"value", 0.1}, {"estimate_percent", {}}, {"requested_percent", 5}}},
        {"estimates", {{"membrane_p99_mpa", {{"percent", 3}, {"credible", false}}}}}}}};
  EXPECT_EQ(shown(one, "membrane_error_percent"), "3%");
}

TEST(Measures, InputsAreShownAsTheyWereStated) {
  PipelineCase one{"a/1", "out/a/1", "simulate", "0", "done", {}, {}};
  const auto pressure = [&](double megapascals, const char* typed) {
    one.reports["simulate"] = {{"stated", {{"pressure_mpa", megapascals}, {"typed", {{"pressure", typed}}}}}};
    return shown(one, "pressure_kpa");
  };
  EXPECT_EQ(pressure(0.0159986865, "120mmHg"), "120 mmHg (16.0 kPa)");
  EXPECT_EQ(pressure(0.016, "16 kPa"), "16 kPa");
  EXPECT_EQ(pressure(0.016, "1.6e4Pa"), "1.6e4 Pa (16 kPa)");
  EXPECT_EQ(pressure(0.016, "<b>"), "16 kPa") << "no quantity";
  one.reports["simulate"] = {{"command", "tunica-simulate s.ply r.hdf --pressure 120mmHg"}};
  EXPECT_EQ(shown(one, "pressure_kpa"), "") << "no command is read";
  EXPECT_EQ(shown(one, "imaged_at_kpa"), "");
  one.reports["simulate"] = {{"stated",
                              {{"pressure_mpa", 0.0159986865},
                               {"imaged_at_mpa", 0.0159986865},
                               {"typed", {{"pressure", {}}, {"imaged_at", "120mmHg"}}}}}};
  EXPECT_EQ(shown(one, "pressure_kpa"), "120 mmHg (16.0 kPa)") << "left out: that of the image";
}

TEST(Arguments, AreReadByNameAndWrittenForTheShell) {
  PipelineCase one{"a/1", "out/a/1", "extract", "3", "", {}, {}};
  const Json given{{"VOLUME", "my scan.nii"},
                   {"OUT.ply", "-s.ply"},
                   {"--label", "it's"},
                   {"--isovalue", "-0.5"},
                   {"--cut", {"above z=1mm", "below x=2mm"}},
                   {"--largest", true}};
  one.reports["extract"] = {{"arguments", given}};
  EXPECT_EQ(argument(one, "extract", "--label"), "it's");
  EXPECT_EQ(argument(one, "extract", "--cut"), "below x=2mm") << "the last counts";
  EXPECT_EQ(argument(one, "extract", "--largest"), std::nullopt);
  EXPECT_EQ(argument(one, "relax", "--shells"), std::nullopt);
  EXPECT_EQ(command_of("tunica-extract", given),
            "tunica-extract 'my scan.nii' ./-s.ply --label 'it'\\''s' --isovalue=-0.5 --cut 'above z=1mm' --cut 'below "
            "x=2mm' --largest");
  for (const Json& damaged : {Json(), Json(3), Json::array({1, Json()}), Json{{"--label", {{"a", 1}}}}}) {
    one.reports["extract"]["arguments"] = damaged;
    EXPECT_EQ(argument(one, "extract", "--label"), std::nullopt);
  }
}

TEST(Outliers, AreFarFromTheMedianOfFiveAtLeast) {
  const std::vector<std::optional<double>> values{1.0, 1.1, std::nullopt, 0.9, 1.05, 0.95, 9.0};
  const auto found = outliers(values);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].index, 6U);
  EXPECT_NEAR(found[0].z, 0.6745 * (9.0 - 1.025) / 0.075, 1e-9);
  EXPECT_TRUE(outliers(std::vector<std::optional<double>>{1.0, 1.1, 0.9, 9.0}).empty());
  using Values = std::vector<std::optional<double>>;
  EXPECT_TRUE(outliers(Values{20.0, 20.0, 20.001, 20.0, 20.0, 21.0}).empty()) << "5 % beside a spread of 1 %";
  EXPECT_EQ(outliers(Values{1.0, 1.0, 1.0, 1.0, 1.0, 9.0}).size(), 1U);
  EXPECT_TRUE(outliers(Values{0.0, 0.0, 0.0, 0.0, 0.0, 9.0}).empty()) << "no spread";
}

TEST(RedactionTest, KnowsNamesAsWordsAlone) {
  PipelineCase one{"Meyer A/1", "out/Meyer A/1", "extract", "3", "", {}, {}};
  one.reports["extract"] = {{"inputs", {{{"path", "/data/Meyer A.nii.gz"}}}},
                            {"arguments",
                             {{"VOLUME", "/data/Meyer A.nii.gz"},
                              {"OUT.ply", "out/Meyer A/1/surface.ply"},
                              {"--report", "Meyer A_Anna_1950/res/1/extract.json"},
                              {"--names", "1950_Anna/t.tsv"}}}};
  const Redaction redacted(one, 7);
  EXPECT_EQ(redacted("/data/Meyer A.nii.gz: has no label 1"), "VOLUME: has no label 1");
  EXPECT_EQ(redacted("Meyer A: 1.1 g/cm3, kg/m3, 1e5N/m3"), "case 7: 1.1 g/cm3, kg/m3, 1e5N/m3");
  EXPECT_EQ(redacted("see /pool/other.txt, 1950/x and 1100kg/m3"), "see [path], [path] and 1100kg/m3");
  for (const char* name : {"Meyer", "Anna", "1950"}) {
    EXPECT_EQ(redacted(command_of("tunica-extract", arguments_of(one, "extract"))).find(name), std::string::npos)
        << name;
  }
  EXPECT_EQ(Redaction()("/data/Meyer A.nii.gz"), "/data/Meyer A.nii.gz");
}

TEST(RedactionTest, LeavesNumbersAndFlags) {
  for (const std::string name : {"1", "300", "smooth", "label"}) {
    PipelineCase one{name + "/1", "out/" + name + "/1", "extract", "3", "", {}, {}};
    const std::string command = "tunica-extract out/" + name + "/v.nii.gz --label 1 --smooth 1.5mm --shells=300";
    one.reports["extract"] = {{"inputs", {{{"path", "out/" + name + "/v.nii.gz"}}}}, {"command", command}};
    const Redaction redacted(one, 7);
    EXPECT_EQ(redacted(command), "tunica-extract VOLUME --label 1 --smooth 1.5mm --shells=300") << name;
    EXPECT_EQ(redacted("1.1 % of 300 shells"), "1.1 % of 300 shells");
    EXPECT_EQ(redacted("out/" + name + "/1/surface.ply: open").find(name + "/1"), std::string::npos) << name;
  }
  PipelineCase meyer{"Meyer/1", "out/Meyer/1", "extract", "3", "", {}, {}};
  EXPECT_EQ(Redaction(meyer, 7)("--names=Meyer.tsv tunica-Meyer"), "--names=case 7.tsv tunica-case 7");
  EXPECT_EQ(Redaction(meyer, 7)("--Meyer.nii.gz: cannot be opened").find("Meyer"), std::string::npos);
}

/// The shells of a sphere of radius 10 as a result draws them: an octahedron split twice, four pieces per edge.
DrawnResult sphere() {
  ShellMesh shell;
  shell.vertices = {{10, 0, 0}, {-10, 0, 0}, {0, 10, 0}, {0, -10, 0}, {0, 0, 10}, {0, 0, -10}};
  shell.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int split = 0; split < 2; ++split) {
    std::map<std::array<Index, 2>, Index> middle;
    const auto between = [&](Index a, Index b) {
      const auto [entry, added] =
          middle.try_emplace({std::min(a, b), std::max(a, b)}, narrow<Index>(shell.vertices.size()));
      if (added) {
        shell.vertices.emplace_back(10 * (shell.vertices[a] + shell.vertices[b]).normalized());
      }
      return entry->second;
    };
    std::vector<std::array<Index, 3>> finer;
    for (const auto& [a, b, c] : shell.triangles) {
      const Index ab = between(a, b);
      const Index bc = between(b, c);
      const Index ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    shell.triangles = finer;
  }
  for (const Vec3& p : shell.vertices) {
    shell.normals.push_back(p.normalized());
  }
  shell.patch = Patch::watertight;
  const Tessellation fine = tessellate_uniformly(shell, 4);
  DrawnResult result;
  result.shells = shell.triangles.size();
  result.pieces = 4;
  // Patches share their points, as in a result file.
  std::map<std::array<long, 3>, Index> at;
  std::vector<Index> shared;
  for (const Vec3& p : fine.mesh.vertices) {
    const std::array<long, 3> key{std::lround(1e6 * p.x()), std::lround(1e6 * p.y()), std::lround(1e6 * p.z())};
    const auto [entry, added] = at.try_emplace(key, narrow<Index>(result.reference.vertices.size()));
    if (added) {
      result.reference.vertices.push_back(p);
    }
    shared.push_back(entry->second);
  }
  for (const auto& [a, b, c] : fine.mesh.triangles) {
    result.reference.triangles.push_back({shared[a], shared[b], shared[c]});
  }
  result.states.resize(2);
  result.states[1].number = 1;
  result.states[1].load_factor = 1;
  for (const Vec3& p : result.reference.vertices) {
    result.states[0].displacement.emplace_back(Vec3::Zero());
    result.states[0].membrane.push_back(0);
    result.states[0].von_mises.push_back(0);
    result.states[1].displacement.emplace_back(0.1 * p);
    result.states[1].membrane.push_back(2 + p.z());
    result.states[1].von_mises.push_back(1 + p.z());
  }
  return result;
}

void expect_the_same_field(const DrawnShells& drawn, double tolerance) {
  ASSERT_EQ(drawn.states.size(), 2U);
  ASSERT_EQ(drawn.states[1].displacement.size(), drawn.reference.vertices.size());
  for (std::size_t v = 0; v < drawn.reference.vertices.size(); ++v) {
    const Vec3& p = drawn.reference.vertices[v];
    EXPECT_LT((drawn.states[1].displacement[v] - 0.1 * p).norm(), tolerance);
    EXPECT_NEAR(drawn.states[1].membrane[v], 2 + p.z(), 10 * tolerance);
    EXPECT_NEAR(drawn.states[1].von_mises[v], 1 + p.z(), 10 * tolerance);
  }
}

TEST(DrawnShellsTest, AreCutIntoFewerPiecesFirst) {
  const std::size_t shells = sphere().shells;  // 128
  for (const auto& [most, pieces] : {std::pair{100'000, 4U}, {1'000, 2U}, {200, 1U}}) {
    const DrawnShells drawn = thinned(sphere(), narrow<std::size_t>(most));
    EXPECT_EQ(drawn.reference.triangles.size(), shells * pieces * pieces);
    EXPECT_EQ(drawn.edges.size(), shells * 3 / 2 * pieces) << "every edge once";
    // Euler's number of a closed surface: no point is there twice, none is missing.
    EXPECT_EQ(drawn.reference.vertices.size(), drawn.reference.triangles.size() / 2 + 2);
    expect_the_same_field(drawn, 1e-12);
  }
}

TEST(DrawnShellsTest, AreDecimatedWhereTheShellsAloneAreTooMany) {
  const DrawnShells drawn = thinned(sphere(), 60);
  EXPECT_LE(drawn.reference.triangles.size(), 60U);
  EXPECT_TRUE(drawn.edges.empty());
  expect_the_same_field(drawn, 0.2);
}

TEST(DrawnShellsTest, StatesAreCalledByTheirLoads) {
  DrawnResult result = sphere();
  EXPECT_THAT(labels_of(result), ElementsAre("As imaged", "Loaded"));
  result.is_unloaded = true;
  result.states[1].load_factor = 0.5;
  EXPECT_THAT(labels_of(result), ElementsAre("Without load", "Load × 0.5"));
}

}  // namespace
}  // namespace tunica::report
