#include "fuzz/target.hpp"

#include "tunica/draw/chart.hpp"
#include "tunica/io/file/report_file.hpp"
#include "tunica/report/report_chart.hpp"

#include <algorithm>

// Reports of stages, and charts of them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  const std::filesystem::path path = fuzz::file("a.json", fuzz::text_of(data, size));
  fuzz::accepted(
      [&] {
        Report report = read_report(path);
        const std::vector<std::string> keys = number_keys(report);
        for (std::size_t i = 0; i < std::min<std::size_t>(keys.size(), 30); ++i) {
          fuzz::require(has_number(report, keys[i]), "a key with numbers has one");
          fuzz::accepted([&] { (void)numbers_at(report, keys[i]); }, path.string());
          (void)describe_key(keys[i]);
        }
        fuzz::accepted([&] { (void)error_against(report, report); }, path.string());
        Report other = report;
        other.path = path.parent_path() / "b" / "a.json";
        std::vector<Report> both{report, other};
        name_apart(both);
        ReportChartOptions options;
        fuzz::accepted([&] { (void)chart_svg(chart_of_reports(both, {}, options).chart); },
                       path.parent_path().string());
        options.reference = report;
        options.failed = "error";
        fuzz::accepted([&] { (void)chart_svg(chart_of_reports(both, {other}, options).chart); },
                       path.parent_path().string());
      },
      path.string());
  return 0;
}
