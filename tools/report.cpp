#include "tunica/report/report.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/io/file/output_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

namespace {

using namespace tunica;

struct Arguments {
  std::filesystem::path folder;
  std::filesystem::path out;
  std::filesystem::path tsv;
  std::filesystem::path summary;
  std::filesystem::path chart;
  bool verify = false;
};

void declare(cli::Tool& tool, Arguments& given) {
  CLI::App& arguments = tool.arguments();
  arguments.add_option("OUT_DIR", given.folder, "folder of the pipeline's results, or of one case in it")
      ->required()
      ->type_name("FOLDER");
  arguments.add_option("-o,--output", given.out, "the page")->required()->type_name("REPORT.html");
  tool.group("What the page says");
  arguments.add_flag("--verify", given.verify,
                     "compare the SHA-256 of the outputs with the reports; exit code 4 names what differs");
  tool.group("Tables");
  arguments.add_option("--tsv", given.tsv, "write the table, and COHORT.json, which says what each column means")
      ->type_name("COHORT.tsv");
  arguments.add_option("--summary", given.summary, "write how each case ended")->type_name("SUMMARY.tsv");
  arguments.add_option("--chart", given.chart, "draw time against distance, where shells were made")
      ->type_name("CHART.svg");
}

// The table is worth saying also where nobody listens: the files are written all the same.
std::optional<OutputError> say_table(const cli::Tool& tool, const std::string& text) {
  if (tool.quiet() || tool.reports_to_standard_output()) {
    return std::nullopt;
  }
  try {
    tool.print(text);
  } catch (const OutputError& lost) {
    return lost;
  }
  return std::nullopt;
}

void write_tables(cli::Tool& tool, const Arguments& given, const std::vector<PipelineCase>& cases,
                  const report::Page& page) {
  if (!given.tsv.empty()) {
    write_file(given.tsv, page.tsv, tool.force());
    write_file(std::filesystem::path(given.tsv).replace_extension(".json"), page.columns, tool.force());
  }
  if (!given.summary.empty()) {
    write_file(given.summary, report::summary_tsv(cases), tool.force());
  }
}

void require_verified(const std::vector<std::string>& different) {
  constexpr std::size_t most = 5;
  if (!different.empty()) {
    const std::size_t told = std::min(different.size(), most);
    throw RequirementError(fmt::format(
        "{}{}", fmt::join(different.begin(), different.begin() + told, "; "),
        different.size() > told ? fmt::format("; and {} more, see the page", different.size() - told) : ""));
  }
}

void run(cli::Tool& tool, const Arguments& given) {
  if (tool.provenance().hides_paths() && !(given.summary.empty() && given.chart.empty())) {
    throw UsageError("--summary and --chart name the cases: leave them out with --no-paths");
  }
  std::vector<PipelineCase> cases;
  {
    const auto stage = tool.stage("read");
    cases = read_pipeline_folder(given.folder);
    for (const PipelineCase& one : cases) {
      for (const auto& [name, content] : one.reports) {
        tool.input(one.folder / (name + ".json"));
      }
    }
  }
  const auto chart = given.chart.empty() ? std::nullopt : report::summary_chart(cases);
  std::string table = report::summary_text(cases);
  table += chart ? fmt::format("chart: {}\n", given.chart.string()) : "";
  const auto lost = say_table(tool, table);
  tool.output(given.out, {".html", ".htm"});
  if (!given.tsv.empty()) {
    tool.output(given.tsv, {".tsv"});
    tool.output(std::filesystem::path(given.tsv).replace_extension(".json"));
  }
  if (!given.summary.empty()) {
    tool.output(given.summary, {".tsv"});
  }
  if (chart) {
    tool.output(given.chart, {".svg"});
    write_file(given.chart, *chart, tool.force());
  }
  report::Page page;
  {
    const auto stage = tool.stage("draw");
    page = report::make_page(
        cases, {!tool.provenance().hides_paths(), given.verify, tool.provenance().command(), tool.progress("draw")});
  }
  {
    const auto stage = tool.stage("write");
    write_tables(tool, given, cases, page);
    write_file(given.out, page.html, tool.force());
  }
  tool.result() = {{"cases", cases.size()},
                   {"failed", page.failed},
                   {"warned", page.warned},
                   {"bytes", page.html.size()},
                   {"different", page.different}};
  if (lost) {
    throw OutputError(*lost);
  }
  std::string places = given.summary.empty() ? "" : fmt::format("summary: {}   ", given.summary.string());
  places += fmt::format("report: {}", given.out.string());
  if (page.warned > 0) {
    places += fmt::format("   read its warnings first: {} of {} cases done have some", page.warned,
                          cases.size() - page.failed);
  }
  places += given.verify && page.different.empty() ? "   verified: every file is what its report says" : "";
  say_table(tool, places + "\n");
  require_verified(page.different);
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("report", "One page, to read in a browser without a network, of what Makefile.pipeline made.",
                 "tunica-report out -o report.html\n"
                 "  tunica-report out -o cohort.html --tsv cohort.tsv --verify\n"
                 "  tunica-report out -o to-share.html --no-paths");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "draw", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
