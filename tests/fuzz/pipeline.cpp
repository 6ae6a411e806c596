#include "fuzz/target.hpp"

#include "tunica/report/report.hpp"

#include <algorithm>
#include <array>

namespace tunica::fuzz {
namespace {

constexpr std::array<std::string_view, 10> known{"case/extract.json",
                                                 "case/decimate.json",
                                                 "case/relax.json",
                                                 "case/simulate.json",
                                                 "case/simulate.log",
                                                 "case/surface.ply",
                                                 "case/shell.ply",
                                                 "case/result.page",
                                                 ".cases",
                                                 "scan.nii"};

// The files of a folder in one text: each behind a line "=== NAME". Names are those of the pipeline.
void write_folder(std::string_view bytes) {
  constexpr std::string_view mark = "=== ";
  std::error_code ignored;
  std::filesystem::remove_all(folder() / "out", ignored);
  std::filesystem::create_directories(folder() / "out" / "case");
  std::size_t at = bytes.starts_with(mark) ? 0 : bytes.find("\n=== ") + 1;
  while (at < bytes.size() && bytes.substr(at).starts_with(mark)) {
    const std::size_t line = std::min(bytes.find('\n', at), bytes.size() - 1);
    const std::string_view name = bytes.substr(at + mark.size(), line - std::min(line, at + mark.size()));
    const std::size_t next = std::min(bytes.find("\n=== ", line), bytes.size());
    if (std::ranges::find(known, name) != known.end()) {
      file("out/" + std::string(name), bytes.substr(line + 1, next - std::min(next, line + 1)));
    }
    at = next + 1;
  }
}

}  // namespace
}  // namespace tunica::fuzz

// A folder of the pipeline, of which a page is made: reports, the record of cases, a log, and the files reports name.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  fuzz::write_folder(fuzz::text_of(data, size));
  fuzz::accepted(
      [&] {
        const std::vector<PipelineCase> cases = read_pipeline_folder(fuzz::folder() / "out");
        (void)report::summary_text(cases);
        (void)report::summary_tsv(cases);
        (void)report::summary_chart(cases);
        report::PageOptions options;
        options.with_names = size % 2 == 0;
        options.verify = size % 3 == 0;
        const report::Page page = report::make_page(cases, options);
        fuzz::require(page.failed <= cases.size(), "no more cases fail than there are");
      },
      fuzz::folder().string());
  return 0;
}
