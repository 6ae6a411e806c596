#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/cli/memory_limit.hpp"
#include "tunica/cli/provenance.hpp"
#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/core/warning.hpp"
#include "tunica/io/file/output_file.hpp"

#include <CLI/CLI.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// What every executable has in common: the flags of the contract, the report, progress, signals and exit codes.
///
///   int main(int argc, char** argv) {
///     cli::Tool tool("decimate", "Quadric edge collapse.", "tunica-decimate surface.ply coarse.ply --triangles 800");
///     std::filesystem::path in, out;
///     tool.arguments().add_option("IN", in, "surface mesh")->required();
///     tool.arguments().add_option("OUT.ply", out, "coarse mesh")->required();
///     return tool.run(argc, argv, [&] {
///       tool.output(out);                                   // fails early when it exists and --force is not given
///       { auto s = tool.stage("read"); mesh = read_mesh(tool.input(in)); }
///       { auto s = tool.stage("decimate"); ... decimate(mesh, options, tool.progress("decimate")); }
///       tool.result()["triangles"] = mesh.triangles.size();
///     });
///   }
namespace tunica::cli {

class StopWatch;

class Tool {
public:
  /// @param verb     the tool is `tunica-<verb>`
  /// @param summary  one or two sentences for --help
  /// @param example  command lines that work, one per line, for --help and the man page
  Tool(std::string verb, std::string summary, std::string example);
  ~Tool();
  Tool(const Tool&) = delete;
  Tool& operator=(const Tool&) = delete;

  /// Where the tool declares its own arguments, before run().
  [[nodiscard]] CLI::App& arguments() { return app_; }

  /// The heading in --help under which the options declared from here on stand.
  void group(const std::string& name);

  /// Declares an option that may be given at most once and that is a quantity with a unit; after parsing `value` holds
  /// it in tunica's units.
  CLI::Option* quantity(const std::string& name, std::optional<double>& value, Dimension dimension,
                        const std::string& help);

  /// Declares `name` as a length tolerance ("0.5%" or "0.2mm").
  CLI::Option* tolerance(const std::string& name, std::optional<LengthTolerance>& value, const std::string& help);

  /// Declares --mesh-unit; after parsing `unit_mm` holds the unit's size in mm.
  void mesh_unit(std::optional<double>& unit_mm);

  /// Parses, runs `body`, writes the report, prints one line on an error. @return the exit code for main().
  int run(int argc, char** argv, const std::function<void()>& body);

  /// Registers an input, with its hash, for the report and returns it. Errors: UsageError when it is also an output, or
  /// one of the names under which an output is kept until it is whole (NAME.part, NAME.part.states, ...).
  const std::filesystem::path& input(const std::filesystem::path& path);

  /// For when the inputs have been read. Errors: InputError naming one that has become another file since it was
  /// registered: what was read need not be what the hash is of.
  void require_unchanged_inputs() const;

  /// Registers an output for the report; OutputError when it exists and --force was not given, or cannot be written, or
  /// when an interrupted run under this name can go on (unless --force or --resume was given);
  /// UsageError when it is also an input, another output or the report, or ends with none of `endings`, where given.
  /// From here on to the end of the run no other one can write it: the PartLock is held.
  const std::filesystem::path& output(const std::filesystem::path& path, const std::vector<std::string>& endings = {});
  /// Names in the report a file whose name follows from an output's, once it is there.
  void wrote(const std::filesystem::path& path);

  /// Times a stage: the seconds until the returned object dies are added to report key `seconds.<name>`.
  class Stage {
  public:
    Stage(Tool& tool, std::string name);
    ~Stage();
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

  private:
    Tool& tool_;
    std::string name_;
    Clock::time_point start_;
  };
  [[nodiscard]] Stage stage(const std::string& name) { return {*this, name}; }

  /// Declares the names of the stages in order, so that the report has every key also when a stage was not reached.
  void stages(const std::vector<std::string>& names);

  /// A callback that draws a bar on a terminal, prints a line now and then elsewhere, and is silent with --quiet.
  [[nodiscard]] Progress progress(const std::string& doing);

  /// A line on stderr: always but with --quiet (`note`), only with --verbose (`detail`), a warning. Warnings stand in
  /// the report, also with --quiet, the heaviest first; those that are mere notes stand apart (`notes`).
  void note(const std::string& text) const;
  void detail(const std::string& text) const;
  void warn(Warning warning) const;

  /// What was asked for on standard output. Errors: OutputError when it is lost, UsageError when the report goes there.
  void print(const std::string& text) const;

  /// This tool as whom a stage of the chain tells how it goes. It lives as long as the tool.
  [[nodiscard]] chain::Context context();

  /// The `result` object of the report. A value that is undefined is set to null (`Json()`).
  [[nodiscard]] Json& result() { return result_; }

  /// Makes `result` in the end, however the run ends, of what outlives the run.
  void result_by(std::function<Json()> make) { make_result_ = std::move(make); }

  /// The `stated` object of the report: what the user said of the organ, as numbers. Null: nothing was stated.
  [[nodiscard]] Json& stated() { return stated_; }

  /// Whether standard output belongs to the report (`--report -`).
  [[nodiscard]] bool reports_to_standard_output() const { return report_ == "-"; }

  [[nodiscard]] bool force() const { return force_; }
  [[nodiscard]] bool quiet() const { return quiet_; }
  [[nodiscard]] bool verbose() const { return verbose_; }

  /// Version and command, for what is written; and how it calls files. See Provenance.
  [[nodiscard]] std::string made_by() const { return provenance_.made_by(); }
  [[nodiscard]] Provenance& provenance() { return provenance_; }
  [[nodiscard]] const Provenance& provenance() const { return provenance_; }

private:
  void declare_common();
  std::optional<int> parse(int argc, char** argv);
  int perform(const std::function<void()>& body);
  int finish(ExitCode code, const std::string& error);
  void end_unseen(int signal);
  [[nodiscard]] std::string stopped_by(int signal) const;
  [[nodiscard]] bool goes_on() const;
  void register_report();
  void require_none_to_go_on_with(const std::filesystem::path& path) const;
  [[nodiscard]] Json describe_outputs(bool ok) const;
  void write_report(bool ok, const std::string& error, const Json& result);
  void parse_common();
  [[nodiscard]] Json redact(const Json& json) const;
  void claim(const std::filesystem::path& path, bool written);
  [[nodiscard]] std::string out_of_memory(const std::string& why);
  void say_line(const std::string& text) const;

  std::string verb_;
  CLI::App app_;
  std::vector<std::string> words_;  ///< of the command line
  Provenance provenance_;
  std::filesystem::path report_;
  std::optional<std::string> threads_;
  std::optional<std::string> memory_;
  MemoryLimit memory_limit_;
  bool force_ = false;
  bool no_paths_ = false;
  bool quiet_ = false;
  bool verbose_ = false;
  mutable bool bar_open_ = false;
  using FileState = std::array<std::int64_t, 5>;  ///< place on the disk, size and time of change; zeros for no file
  [[nodiscard]] static FileState state_of(const std::filesystem::path& path);
  struct Claim {
    std::filesystem::path place;  ///< resolved
    std::filesystem::path part;   ///< under which it is kept until it is whole
    bool written = false;         ///< or read
    std::filesystem::path name;   ///< as the user has it
    FileState state;              ///< when it was registered
  };
  std::vector<Claim> claimed_;                    ///< files of the run
  std::vector<std::shared_ptr<PartLock>> locks_;  ///< of the outputs
  std::shared_ptr<PartLock> report_lock_;
  bool replaces_failed_ = false;  ///< an older one of this name
  /// Guards what the report tells but `result_`: a StopWatch may have to write it. Recursive, because memory may end
  /// where it is held, and the report is then written from there.
  mutable std::recursive_mutex recording_;
  std::unique_ptr<StopWatch> stop_watch_;
  std::string at_hand_;  ///< the input registered last
  std::string running_;  ///< the stage begun last
  Json inputs_ = Json::array();
  mutable std::vector<Warning> warnings_;  ///< warn() says, it does not change the tool
  std::vector<std::filesystem::path> outputs_;
  Json seconds_ = Json::object();
  Json result_ = Json::object();
  std::function<Json()> make_result_;  ///< in place of it
  Json stated_;
  Json arguments_ = Json::object();  ///< of the command line
  std::vector<std::function<void()>> after_parse_;
  std::filesystem::file_time_type start_on_disk_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace tunica::cli
