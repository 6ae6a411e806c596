#include "tunica/draw/chart.hpp"

#include "tunica/draw/detail/ticks.hpp"
#include "tunica/report/report_chart.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

namespace tunica {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double largest = std::numeric_limits<double>::max();
constexpr double smallest = std::numeric_limits<double>::denorm_min();

Chart chart_of(const std::vector<std::pair<double, double>>& points) {
  Chart chart;
  chart.series.push_back({"", {}, false});
  for (const auto& [x, y] : points) {
    chart.series.front().marks.push_back({x, y, "run", ""});
  }
  return chart;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) {
    ++found;
  }
  return found;
}

TEST(Ticks, AreRoundAndCoverTheRange) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> exponent(-12, 12);
  std::uniform_real_distribution<double> part(-1, 1);
  for (int i = 0; i < 2000; ++i) {
    const double scale = std::pow(10, exponent(random));
    double low = part(random) * scale;
    double high = part(random) * scale;
    if (low > high) {
      std::swap(low, high);
    }
    if (high - low < 1e-6 * scale) {
      continue;
    }
    const double step = round_step(low, high, 7);
    const double mantissa = step / std::pow(10, std::floor(std::log10(step) + 1e-9));
    EXPECT_TRUE(std::abs(mantissa - 1) < 1e-9 || std::abs(mantissa - 2) < 1e-9 || std::abs(mantissa - 2.5) < 1e-9 ||
                std::abs(mantissa - 5) < 1e-9)
        << step;
    const auto ticks = round_ticks(low, high, 7);
    ASSERT_GE(ticks.size(), 2u) << low << " … " << high;
    EXPECT_LE(ticks.size(), 8u);
    EXPECT_GE(ticks.front(), low - 1e-5 * step);
    EXPECT_LE(ticks.back(), high + 1e-5 * step);
    EXPECT_LE(ticks.front() - low, step * (1 + 1e-9));
    EXPECT_LE(high - ticks.back(), step * (1 + 1e-9));
  }
}

TEST(Ticks, TextsHaveTheDecimalsOfTheStep) {
  EXPECT_EQ(tick_text(0.1, 0.05), "0.10");
  EXPECT_EQ(tick_text(0.25, 0.25), "0.25");
  EXPECT_EQ(tick_text(20, 5), "20");
  EXPECT_EQ(tick_text(2e-7, 1e-7), "2e-07");
  EXPECT_EQ(tick_text(2.5e-6, 2.5e-6), "2.5e-06");
  EXPECT_EQ(tick_text(1.25e-5, 2.5e-6), "1.25e-05");
  EXPECT_EQ(tick_text(0.01205, 1e-5), "0.01205");
  EXPECT_EQ(tick_text(1.00000001, 1e-8), "1.00000001");
  EXPECT_EQ(tick_text(2500000, 500000), "2.5e+06");
  EXPECT_EQ(short_number(0.4213), "0.421");
  EXPECT_EQ(short_number(12345.6), "12346");
  EXPECT_EQ(short_number(0), "0");
}

TEST(Ticks, RangeWithoutWidthOrBeyondDoubleEnds) {
  EXPECT_EQ(round_ticks(3, 3, 7), std::vector<double>{3});
  EXPECT_EQ(round_ticks(3, 2, 7), std::vector<double>{3});
  EXPECT_LE(round_ticks(-largest, largest, 7).size(), 8u);
  EXPECT_LE(round_ticks(0, smallest, 7).size(), 8u);
}

TEST(Scale, IsLogarithmicBeyondOneDecadeWithoutNegativeValues) {
  EXPECT_EQ(resolved_scale(Scale::automatic, {1, 9.9}), Scale::linear);
  EXPECT_EQ(resolved_scale(Scale::automatic, {1, 10.1}), Scale::logarithmic);
  EXPECT_EQ(resolved_scale(Scale::automatic, {-1, 1, 100}), Scale::linear);
  EXPECT_EQ(resolved_scale(Scale::automatic, {0, 1, 100}), Scale::logarithmic);
  EXPECT_EQ(resolved_scale(Scale::automatic, {0, 0}), Scale::linear);
  EXPECT_EQ(resolved_scale(Scale::automatic, {}), Scale::linear);
  EXPECT_EQ(resolved_scale(Scale::linear, {1, 1e9}), Scale::linear);
}

// The definition, by comparing all pairs.
bool dominated(const ChartMark& mark, const Chart& chart) {
  const auto better = [](double a, double b, bool more) { return more ? a > b : a < b; };
  for (const ChartSeries& series : chart.series) {
    for (const ChartMark& other : series.marks) {
      const bool x = better(other.x, mark.x, chart.x.more_is_better);
      const bool y = better(other.y, mark.y, chart.y.more_is_better);
      if ((x && (y || other.y == mark.y)) || (y && other.x == mark.x)) {
        return true;
      }
    }
  }
  return false;
}

TEST(ParetoFront, AgreesWithItsDefinition) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    Chart chart;
    chart.x.more_is_better = round % 2 == 1;
    chart.y.more_is_better = round % 4 >= 2;
    chart.series.resize(3);
    for (int i = 0; i < 30; ++i) {
      // Few values, so that ties are many.
      chart.series[random() % 3].marks.push_back({double(random() % 9), double(random() % 9), "", ""});
    }
    const auto front = pareto_front(chart);
    for (std::size_t s = 0; s < 3; ++s) {
      for (std::size_t m = 0; m < chart.series[s].marks.size(); ++m) {
        EXPECT_EQ(front[s][m], !dominated(chart.series[s].marks[m], chart));
      }
    }
  }
}

TEST(ChartSvg, HasAFrontOnlyWhereBothAxesAreRanked) {
  Chart chart = chart_of({{1, 2}, {3, 1}});
  EXPECT_EQ(count(chart_svg(chart), "class=\"front\""), 1u);
  EXPECT_EQ(count(chart_svg(chart), "Pareto front"), 1u);
  chart.x.is_ranked = false;
  EXPECT_EQ(pareto_front(chart), std::vector(1, std::vector(2, false)));
  EXPECT_EQ(count(chart_svg(chart), "class=\"front\""), 0u);
  EXPECT_EQ(count(chart_svg(chart), "Pareto front"), 0u);
}

TEST(ChartSvg, HasAMarkPerPoint) {
  EXPECT_EQ(count(chart_svg(chart_of({{1, 2}, {3, 4}, {5, 1}})), "class=\"mark\""), 3u);
  EXPECT_EQ(count(chart_svg(chart_of({})), "class=\"mark\""), 0u);
}

TEST(ChartSvg, SurvivesEveryRangeOfNumbers) {
  const std::vector<std::vector<std::pair<double, double>>> cases{
      {{1, 1}},
      {{0, 0}},
      {{-3, -3}, {-3, -3}},
      {{largest, -largest}, {-largest, largest}},
      {{largest, smallest}, {smallest, largest}},
      {{largest, largest}},
      {{smallest, smallest}},
      {{0, 1e-300}, {1, 1e300}},
      {{1e15, 1e15 + 1}, {1e15 + 2, 1e15 + 1}},
      {{1, 1}, {1 + 1e-15, 1 + 1e-15}},
  };
  for (const auto& points : cases) {
    for (const Scale scale : {Scale::automatic, Scale::linear, Scale::logarithmic}) {
      Chart chart = chart_of(points);
      chart.x.scale = chart.y.scale = scale;
      const std::string svg = chart_svg(chart);
      EXPECT_THAT(svg, Not(HasSubstr("nan")));
      EXPECT_THAT(svg, Not(HasSubstr("inf")));
      EXPECT_LT(svg.size(), 60'000u);
      const bool all_shown = scale != Scale::logarithmic || points.front().first >= 0;
      if (all_shown && points.front().second >= 0) {
        EXPECT_EQ(count(svg, "class=\"mark\""), points.size());
      }
    }
  }
}

TEST(ChartSvg, TicksOfANarrowRangeDiffer) {
  for (const double base : {1e15, 1e6, 3e4, 1.0, 1e-2, 1e-7, -4e8}) {
    for (const double width : {1e-1, 1e-4, 1e-7}) {
      const std::string svg = chart_svg(chart_of({{base, 1}, {base * (1 + width), 2}}));
      std::set<std::string> texts;
      std::size_t ticks = 0;
      const std::string tick = "\"middle\" fill=\"#333333\"";
      for (std::size_t at = svg.find(tick); at != std::string::npos; at = svg.find(tick, at + 1)) {
        texts.insert(svg.substr(at, svg.find("</text>", at) - at));
        ++ticks;
      }
      EXPECT_GE(ticks, 3u) << base << " " << width;
      EXPECT_EQ(texts.size(), ticks) << base << " " << width;
    }
  }
}

TEST(ChartSvg, ZerosHaveALaneOnALogarithmicAxis) {
  const std::string svg = chart_svg(chart_of({{1, 0}, {2, 0.1}, {3, 100}}));
  EXPECT_EQ(count(svg, "class=\"mark\""), 3u);
  EXPECT_THAT(svg, HasSubstr(">0<"));
  EXPECT_THAT(svg, HasSubstr(">100<"));
}

// Texts of the ticks of the x axis, raised exponents after ^.
std::vector<std::string> x_ticks(const std::string& svg) {
  std::vector<std::string> texts;
  const std::string tick = "\"middle\" fill=\"#333333\"";
  for (std::size_t at = svg.find(tick); at != std::string::npos; at = svg.find(tick, at + 1)) {
    std::string text;
    bool inside = false;
    for (std::size_t i = svg.find('>', at); i < svg.find("</text>", at); ++i) {
      if (svg[i] == '<' && svg[i + 1] == 't') {
        text += '^';
      }
      inside = svg[i] == '>' || (inside && svg[i] != '<');
      if (inside && svg[i] != '>') {
        text += svg[i];
      }
    }
    texts.push_back(text);
  }
  return texts;
}

TEST(ChartSvg, TicksOfAnAxisAreWrittenInOneWay) {
  EXPECT_EQ(x_ticks(chart_svg(chart_of({{1, 1}, {100'000, 2}}))),
            (std::vector<std::string>{"1", "10", "100", "1,000", "10,000", "100,000"}));
  EXPECT_EQ(x_ticks(chart_svg(chart_of({{1e3, 1}, {5e7, 2}}))),
            (std::vector<std::string>{"10^3", "10^4", "10^5", "10^6", "10^7"}));
  EXPECT_EQ(x_ticks(chart_svg(chart_of({{0, 1}, {40'000, 2}}))),
            (std::vector<std::string>{"0", "10,000", "20,000", "30,000", "40,000"}));
}

TEST(ChartSvg, LongNamesAndLabelsAreBrokenNotCut) {
  Chart chart = chart_of({{1, 2}, {3, 4}});
  const std::string words =
      "one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen";
  chart.x.label = chart.y.label = chart.series.front().name = chart.title = words;
  const std::string svg = chart_svg(chart);
  EXPECT_THAT(svg, Not(HasSubstr("…")));
  EXPECT_EQ(count(svg, "sixteen<"), 5u);  // one is the <title> of the picture
}

TEST(ChartSvg, HasColoursForTheDark) {
  const std::string svg = chart_svg(chart_of({{1, 2}}));
  EXPECT_THAT(svg, HasSubstr("@media (prefers-color-scheme:dark)"));
  // Every colour can change: none stands alone.
  EXPECT_EQ(count(svg, " fill=\"#"), count(svg, "fill:var("));
  EXPECT_EQ(count(svg, " stroke=\"#"), count(svg, "stroke:var("));
}

TEST(ChartSvg, TextIsEscapedAndUtf8) {
  Chart chart = chart_of({{1, 2}});
  chart.title = "a<b>&\"c\" \x01\xff\xc3 \xed\xa0\x80 é";
  chart.series.front().name = "</svg><script>";
  const std::string svg = chart_svg(chart);
  EXPECT_THAT(svg, HasSubstr("a&lt;b&gt;&amp;&quot;c&quot;"));
  EXPECT_THAT(svg, Not(HasSubstr("<script>")));
  EXPECT_THAT(svg, Not(HasSubstr("\xff")));
  EXPECT_THAT(svg, Not(HasSubstr("\x01")));
  EXPECT_THAT(svg, HasSubstr("é"));
}

TEST(ChartSvg, LegendEndsWhereThePictureDoes) {
  Chart chart;
  for (int i = 0; i < 200; ++i) {
    chart.series.push_back({"series " + std::to_string(i), {{double(i), double(i % 7), "run", ""}}, false});
  }
  const std::string svg = chart_svg(chart);
  EXPECT_THAT(svg, HasSubstr("… and 161 more"));
  EXPECT_THAT(svg, HasSubstr(">series 38<"));
  EXPECT_THAT(svg, Not(HasSubstr(">series 39<")));
  EXPECT_EQ(count(svg, "class=\"mark\""), 200u);
}

TEST(ChartSvg, SeriesDifferInColourAndShape) {
  Chart chart;
  for (int i = 0; i < 56; ++i) {
    chart.series.push_back({std::to_string(i), {{1, 1, "", ""}}, false});
  }
  const std::string svg = chart_svg(chart);
  std::set<std::string> looks;
  std::size_t marks = 0;
  for (std::size_t at = svg.find("class=\"mark\""); at != std::string::npos; at = svg.find("class=\"mark\"", at + 1)) {
    const std::size_t start = svg.rfind('<', at);
    looks.insert(svg.substr(start, svg.find('>', start) - start));
    ++marks;
  }
  EXPECT_EQ(marks, 56u);
  EXPECT_EQ(looks.size(), 56u);
}

TEST(DescribeKey, GivesWordsAndUnits) {
  EXPECT_EQ(describe_key("result.hausdorff_percent.upper"), "Hausdorff distance, upper bound (% of the diagonal)");
  EXPECT_EQ(describe_key("result.iterations.hausdorff_percent.upper"),
            "Hausdorff distance, upper bound (% of the diagonal)");
  EXPECT_EQ(describe_key("seconds.total"), "Total time (s)");
  EXPECT_EQ(describe_key("seconds.relax"), "Time to relax (s)");
  EXPECT_EQ(describe_key("result.iterations.seconds"), "Time (s)");
  EXPECT_EQ(describe_key("result.shells"), "Shells");
  EXPECT_EQ(describe_key("result.ms_per_step.median"), "Time per step, median (ms)");
  EXPECT_EQ(describe_key("result.max_displacement_mm"), "Max displacement (mm)");
  EXPECT_EQ(describe_key("result.volume_mm3"), "Volume (mm³)");
  EXPECT_EQ(describe_key("peak_mib"), "Peak memory (MiB)");
  EXPECT_EQ(describe_key("result.frequencies_hz.0"), "Frequencies (Hz)");
  EXPECT_EQ(describe_key("study.setting"), "Setting");
  EXPECT_EQ(describe_key(""), "");
}

}  // namespace
}  // namespace tunica
