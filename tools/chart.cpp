#include "tunica/cli/tool.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/report/report_chart.hpp"

#include <charconv>
#include <cmath>

namespace {

using namespace tunica;

const std::vector<std::string> scales{"auto", "linear", "log"};

Scale scale_of(const std::string& name) {
  return name == "log" ? Scale::logarithmic : name == "linear" ? Scale::linear : Scale::automatic;
}

struct Runs {
  std::vector<Report> good;
  std::vector<Report> failed;  ///< those to draw
};

// What a report says of files goes too: they are those of other runs.
void hide_paths(const cli::Tool& tool, Report& report) {
  report.path = tool.provenance().name_of(report.path);
  report.name = report.path.stem().string();
  for (const char* key : {"command", "inputs", "outputs", "error", "warnings"}) {
    report.json.erase(key);
  }
}

Runs read_reports(cli::Tool& tool, const std::vector<std::filesystem::path>& paths, bool draws_failed, Json& skipped) {
  Runs runs;
  for (const auto& path : paths) {
    Report report = read_report(tool.input(path));
    if (report.ok()) {
      runs.good.push_back(std::move(report));
    } else if (draws_failed) {
      runs.failed.push_back(std::move(report));
    } else {
      tool.warn({Weight::minor, "left out", path.string() + ": the run failed, its report is skipped"});
      skipped.push_back(path.string());
    }
  }
  if (runs.good.empty()) {
    throw InputError(paths.front().string() + ": nothing to draw: every run failed; see the reports' key 'error'");
  }
  name_apart(runs.good);
  if (tool.provenance().hides_paths()) {
    for (std::vector<Report>* list : {&runs.good, &runs.failed}) {
      std::ranges::for_each(*list, [&](Report& report) { hide_paths(tool, report); });
    }
  }
  return runs;
}

ChartGuide guide_of(const std::string& line, const std::string& label) {
  if (line == "diagonal") {
    return {{}, label.empty() ? "y = x" : label};
  }
  double level = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), level);
  if (error != std::errc() || end != line.data() + line.size() || !std::isfinite(level)) {
    throw UsageError("--guide " + line + ": 'diagonal' or a value of y");
  }
  return {level, label.empty() ? "y = " + line : label};
}

struct Arguments {
  std::vector<std::filesystem::path> paths;
  std::filesystem::path out;
  std::filesystem::path csv;
  std::filesystem::path reference;
  ReportChartOptions options;
  std::string guide;
  std::string guide_label;
  std::string x_scale = "auto";
  std::string y_scale = "auto";
};

void declare(cli::Tool& tool, Arguments& given) {
  CLI::App& arguments = tool.arguments();
  arguments.add_option("REPORT", given.paths, "reports of runs, written by --report")->required()->type_name("FILE");
  arguments.add_option("-o,--output", given.out, "the chart")->required()->type_name("OUT.svg");
  tool.group("What is drawn");
  arguments.add_option("--x", given.options.x, "dotted key of the x axis, e.g. seconds.total (default: time)")
      ->type_name("KEY");
  arguments
      .add_option("--y", given.options.y,
                  "dotted key of the y axis, e.g. result.hausdorff_percent.upper (default: error)")
      ->type_name("KEY");
  arguments.add_option("--series", given.options.series, "colour, marker and legend by the value of KEY, or by 'file'")
      ->type_name("KEY");
  arguments.add_option("--label", given.options.label, "write the value of KEY, or 'file', beside each mark")
      ->type_name("KEY");
  arguments
      .add_option("--reference", given.reference,
                  "a finer run: errors are taken against its probes, largest displacement or distance")
      ->type_name("REPORT");
  arguments
      .add_option("--failed", given.options.failed,
                  "draw failed runs on the rim, too, the value of KEY (e.g. an exit code) beside them")
      ->type_name("KEY");
  arguments.add_option("--guide", given.guide, "a line to read marks by: 'diagonal' (y = x) or a value of y")
      ->type_name("LINE");
  arguments.add_option("--guide-label", given.guide_label, "what that line is, for the legend")->type_name("TEXT");
  tool.group("Output");
  arguments.add_option("--csv", given.csv, "write the numbers behind the picture")->type_name("OUT.csv");
  tool.group("Look");
  arguments.add_option("--title", given.options.title, "text above the chart")->type_name("TEXT");
  arguments.add_option("--x-label", given.options.x_label, "text of the x axis (default: from the key)")
      ->type_name("TEXT");
  arguments.add_option("--y-label", given.options.y_label, "text of the y axis (default: from the key)")
      ->type_name("TEXT");
  arguments.add_option("--x-scale", given.x_scale, "scale of the x axis (default auto: log where that helps)")
      ->check(CLI::IsMember(scales))
      ->type_name("SCALE");
  arguments.add_option("--y-scale", given.y_scale, "scale of the y axis (default auto: log where that helps)")
      ->check(CLI::IsMember(scales))
      ->type_name("SCALE");
  arguments.add_flag("--lines", given.options.joined, "join the marks of a series by a line, in the order of x");
}

void run(cli::Tool& tool, Arguments& given) {
  tool.output(given.out, {".svg"});
  if (!given.csv.empty()) {
    tool.output(given.csv, {".csv"});
  }
  Json skipped = Json::array();
  Runs runs;
  if (!given.guide.empty()) {
    given.options.guide = guide_of(given.guide, given.guide_label);
  }
  {
    const auto stage = tool.stage("read");
    runs = read_reports(tool, given.paths, given.options.failed.has_value(), skipped);
    if (!given.reference.empty()) {
      given.options.reference = read_report(tool.input(given.reference));
      if (!given.options.reference->ok()) {
        throw InputError(given.reference.string() + ": the reference run failed; give one that succeeded");
      }
    }
  }
  ReportChart made;
  std::string svg;
  {
    const auto stage = tool.stage("draw");
    given.options.made_by = tool.made_by();
    given.options.x_scale = scale_of(given.x_scale);
    given.options.y_scale = scale_of(given.y_scale);
    made = chart_of_reports(runs.good, runs.failed, given.options);
    svg = chart_svg(made.chart);
  }
  for (const Warning& warning : made.warnings) {
    tool.warn(warning);
  }
  {
    const auto stage = tool.stage("write");
    write_file(given.out, svg + xml_made_by(tool.made_by()), tool.force());
    if (!given.csv.empty()) {
      write_file(given.csv, made.csv, tool.force());
    }
  }
  tool.result() = {{"x", made.x_key},           {"y", made.y_key},           {"marks", made.marks},
                   {"failures", made.failures}, {"on_front", made.on_front}, {"skipped", skipped}};
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("chart", "Draws speed against accuracy, or any two numbers, from the tools' own reports as SVG.",
                 "tunica-chart relax.json -o chart.svg\n"
                 "  tunica-chart relax.json -o rounds.svg --x result.iterations.seconds --y "
                 "result.iterations.hausdorff_percent.upper --lines --csv rounds.csv");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "draw", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
