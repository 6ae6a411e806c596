#include "tunica/cli/tool.hpp"

#include "tunica/cli/detail/documentation.hpp"
#include "tunica/cli/detail/own_stack.hpp"
#include "tunica/cli/detail/stop_watch.hpp"
#include "tunica/cli/usage.hpp"
#include "tunica/core/instruction_set.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/core/version.hpp"
#include "tunica/core/words.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/report_file.hpp"
#include "tunica/io/result/run_journal.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <functional>
#include <memory>
#include <new>
#include <regex>
#include <string_view>
#include <utility>

namespace tunica::cli {
namespace {

constexpr const char* report_flag = "--report";
constexpr const char* resume_flag = "--resume";
constexpr const char* standard_output = "-";  // as its value
constexpr const char* no_memory = "out of memory: give it more, or a smaller input";

extern "C" void on_signal(int signal) {
  request_stop(signal);
  StopWatch::on_stop_signal(signal);
  // The second signal ends the program at once: somebody is waiting.
  std::signal(signal, SIG_DFL);
}

const std::terminate_handler print_and_abort = std::get_terminate();

/// How the tool that runs ends when its memory does. @return the exit code
std::function<int()> end_without_memory;

/// Memory may end before run() can catch it, while a tool's options are declared, or where nothing may be thrown:
/// values of nlohmann::json need memory to be destroyed.
[[noreturn]] void on_terminate() {
  try {
    if (std::current_exception()) {
      throw;
    }
  } catch (const std::bad_alloc&) {
    if (const auto end = std::exchange(end_without_memory, nullptr)) {
      try {
        std::_Exit(end());
      } catch (...) {  // there is not even enough for the report
      }
    }
    std::fprintf(stderr, "%s: %s\n", program_invocation_short_name, no_memory);
    std::_Exit(static_cast<int>(ExitCode::memory));
  } catch (...) {
    print_and_abort();
  }
  std::abort();
}

/// Of this program: ru_maxrss also counts the process that started it, as it was before exec().
double peak_mebibytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) {
      return std::strtod(line.c_str() + 6, nullptr) / 1024.0;
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return real(usage.ru_maxrss) / 1024.0;
}

// Where the words of a command line end that may be options.
std::vector<std::string>::const_iterator end_of_options(const std::vector<std::string>& words) {
  return std::ranges::find(words, "--");
}

bool is_given(const std::vector<std::string>& words, const char* flag) {
  return std::find(words.begin(), end_of_options(words), flag) != end_of_options(words);
}

// What was given, by flag or by the name of a place: its value, its values, or true where it takes none.
Json arguments_of(const CLI::App& app) {
  Json given = Json::object();
  for (const CLI::Option* option : app.get_options()) {
    const std::vector<std::string>& values = option->results();
    if (!values.empty()) {
      given[option->get_name()] = option->get_items_expected_max() == 0 ? Json(true)
                                  : values.size() == 1                  ? Json(values.front())
                                                                        : Json(values);
    }
  }
  return given;
}

// The report of a run whose command line could not be parsed: then no option has been stored yet.
std::filesystem::path report_argument(const std::vector<std::string>& all) {
  const std::vector<std::string> words(all.begin(), end_of_options(all));
  for (std::size_t i = 1; i < words.size(); ++i) {
    if (words[i - 1] == report_flag) {
      return words[i];
    }
    if (words[i].starts_with(report_flag + std::string("="))) {
      return words[i].substr(std::strlen(report_flag) + 1);
    }
  }
  return {};
}

std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n' || c == '\r') {
      c = ' ';
    }
  }
  return text;
}

// CLI11 calls the value of every string TEXT: a positional's own name says more, and a choice is a NAME. And it takes
// `--flag=anything` for a flag that is set.
void tidy_options(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    if (option->get_items_expected_max() == 0) {
      option->disable_flag_override();
    }
    if (option->get_type_name().starts_with("TEXT")) {
      option->type_name(option->get_positional() ? "" : "NAME");
    }
  }
}

// Links and dots resolved, also of a file that does not exist yet.
std::filesystem::path resolved(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error);
  const std::filesystem::path canonical = std::filesystem::weakly_canonical(whole, error);
  return error ? whole.lexically_normal() : canonical;
}

// Whether a file is NAME.part, or one whose name begins so: NAME.part.states.
bool is_kept_under(const std::filesystem::path& file, const std::filesystem::path& part) {
  const std::string& name = file.native();
  const std::string& start = part.native();
  return name.starts_with(start) && (name.size() == start.size() || name[start.size()] == '.');
}

// Every output of the run is held open, and an atlas has many labels.
void allow_many_files() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    limit.rlim_cur = limit.rlim_max;
    (void)::setrlimit(RLIMIT_NOFILE, &limit);
  }
}

// SHA-256 of a file; null where it cannot be read as one.
Json hash_if_readable(const std::filesystem::path& path) {
  try {
    return sha256_of_file(path);
  } catch (const InputError&) {
    return nullptr;
  }
}

// --force is meant for an older report: a slip of the pen must not turn a mesh or a patient's volume into JSON.
void require_no_other_file(const std::filesystem::path& report) {
  std::ifstream file(report, std::ios::binary);
  char first = 0;
  if (file && file >> first && first != '{') {
    throw OutputError(fmt::format("{}: exists and is not a report, name another file", report.string()));
  }
}

// The report is written last: where the process may open no file beside those it has, that is told before the work.
void require_descriptor(const std::filesystem::path& report) {
  const int spare = ::dup(STDERR_FILENO);
  if (spare < 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", report.string(), file_error()));
  }
  ::close(spare);
}

// Whether there is a report in which this tool says that it did not come to its end: a run that goes on replaces it.
bool tells_of_failure(const std::filesystem::path& report, const std::string& tool) {
  try {
    const Report before = read_report(report);
    return before.tool() == tool && !before.ok();
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

Tool::Tool(std::string verb, std::string summary, std::string example)
    : verb_(std::move(verb)), app_(std::move(summary), "tunica-" + verb_) {
  std::set_terminate(on_terminate);
  app_.footer("Example:\n  " + std::regex_replace(example, std::regex("\n *"), "\n  "));
  app_.set_help_flag();
  app_.formatter(help_layout());
}

Tool::~Tool() = default;

void Tool::declare_common() {
  const char* const common = "Options of every tool";
  group(common);
  app_.set_help_flag("-h,--help", "print this help and stop")->group(common);
  app_.set_version_flag("--version", fmt::format("tunica-{} {} ({})", verb_, version, instruction_set()),
                        "print name, version and instruction set, and stop")
      ->group(common);
  app_.add_option(report_flag, report_,
                  "write a JSON record of the run to FILE, also when the run fails; -: to standard output")
      ->type_name("FILE");
  app_.add_option("--threads", threads_,
                  "at most N threads (default: TUNICA_THREADS, else SLURM_CPUS_PER_TASK, else all cores)")
      ->type_name("N");
  app_.add_option("--memory-limit", memory_,
                  "take at most SIZE of memory, such as 4GB or 500MiB: what needs more ends with exit code 6")
      ->type_name("SIZE");
  app_.add_flag("--quiet", quiet_, "print nothing but errors");
  app_.add_flag("--verbose", verbose_, "print more detail");
  app_.add_flag("--force", force_, "overwrite an existing output");
  app_.add_flag("--no-paths", no_paths_,
                "keep folders and names of files, which may be patients', out of what is written, reports too");
}

void Tool::group(const std::string& name) { app_.option_defaults()->group(name); }

CLI::Option* Tool::quantity(const std::string& name, std::optional<double>& value, Dimension dimension,
                            const std::string& help) {
  auto text = std::make_shared<std::optional<std::string>>();
  after_parse_.emplace_back([text, &value, dimension, name] {
    if (*text) {
      try {
        value = parse_quantity(**text, dimension);
      } catch (const UsageError& error) {
        throw UsageError(fmt::format("{}: {}", name, error.what()));
      }
    }
  });
  return app_.add_option(name, *text, help)->type_name("QUANTITY");
}

CLI::Option* Tool::tolerance(const std::string& name, std::optional<LengthTolerance>& value, const std::string& help) {
  auto text = std::make_shared<std::optional<std::string>>();
  after_parse_.emplace_back([text, &value, name] {
    if (*text) {
      try {
        value = parse_length_tolerance(**text);
      } catch (const UsageError& error) {
        throw UsageError(fmt::format("{}: {}", name, error.what()));
      }
    }
  });
  return app_.add_option(name, *text, help)->type_name("TOLERANCE");
}

void Tool::mesh_unit(std::optional<double>& unit_mm) {
  auto text = std::make_shared<std::optional<std::string>>();
  after_parse_.emplace_back([text, &unit_mm] {
    if (*text) {
      unit_mm = parse_length_unit(**text);
    }
  });
  app_.add_option("--mesh-unit", *text, "unit of mesh files that do not state one: mm, cm, m or um")
      ->type_name("mm|cm|m|um");
}

void Tool::parse_common() {
  std::size_t count = 0;
  if (threads_) {
    const auto number = parse_number(*threads_);
    if (!number || *number < 1 || *number > 4096 || *number != std::trunc(*number)) {
      throw UsageError(fmt::format("--threads: '{}' is not a whole number from 1 to 4096", *threads_));
    }
    count = truncated<std::size_t>(*number);
  } else {
    count = default_thread_count();
  }
  set_thread_count(count);
  if (memory_) {
    try {
      memory_limit_.set(*memory_);
    } catch (const UsageError& error) {
      throw UsageError(fmt::format("--memory-limit: {}", error.what()));
    }
  }
  if (quiet_ && verbose_) {
    throw UsageError("--quiet and --verbose contradict each other: give one");
  }
  for (const auto& check : after_parse_) {
    check();
  }
}

std::optional<int> Tool::parse(int argc, char** argv) {
  try {
    // For the build alone, so not among the options: the manual page and the completions that are installed.
    if (argc == 3 && std::string_view(argv[1]) == "--documentation") {
      for (const auto& [kind, made] : {std::pair{"man", &man_page}, std::pair{"bash", &bash_completion},
                                       std::pair{"zsh", &zsh_completion}, std::pair{"fish", &fish_completion}}) {
        if (std::string_view(argv[2]) == kind) {
          print(made(app_));
          return 0;
        }
      }
    }
    const auto& options = app_.get_options();
    if (argc == 1 &&
        std::ranges::any_of(options, [](const CLI::Option* o) { return o->get_required() || o->get_positional(); })) {
      throw UsageError(short_usage(app_));
    }
    app_.parse(argc, argv);
    arguments_ = arguments_of(app_);
    parse_common();
    return std::nullopt;
  } catch (const CLI::Success&) {
    try {
      // The parser puts two empty lines between groups.
      print(app_.get_help_ptr()->count() > 0 ? std::regex_replace(app_.help(), std::regex("\n{3,}"), "\n\n")
                                             : app_.version() + "\n");
      return 0;
    } catch (const OutputError& error) {
      return finish(error.code(), error.what());
    }
  } catch (const CLI::ParseError& error) {
    report_ = report_argument(words_);
    force_ = is_given(words_, "--force");
    return finish(ExitCode::usage, fmt::format("{} (see tunica-{} --help)", usage_message(app_, error), verb_));
  } catch (const UsageError& error) {
    return finish(error.code(), fmt::format("{} (see tunica-{} --help)", error.what(), verb_));
  } catch (const OutputError& error) {
    return finish(error.code(), error.what());
  }
}

int Tool::run(int argc, char** argv, const std::function<void()>& body) {
  start_ = Clock::now();
  start_on_disk_ = std::filesystem::file_time_type::clock::now() - std::chrono::milliseconds(20);  // the disk's tick
  occupy_standard_descriptors();
  allow_many_files();
  words_.assign(argv, argv + argc);
  std::vector<std::string> said = words_;
  said.resize(std::max<std::size_t>(said.size(), 1));
  said[0] = "tunica-" + verb_;
  provenance_ = Provenance(std::move(said));
  no_paths_ = is_given(words_, "--no-paths");
  if (no_paths_) {
    provenance_.hide_paths();  // before anything fails: the report of that must not name them either
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // writing past a limit on file sizes is then an error like a full disk
  declare_common();
  tidy_options(app_);
  stop_watch_ = std::make_unique<StopWatch>([this](int signal) { end_unseen(signal); });
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) {
    std::signal(SIGHUP, SIG_IGN);  // as nohup has it
  }
  end_without_memory = [this] {
    memory_limit_.lift();  // else there may not even be memory for the message
    return finish(ExitCode::memory, out_of_memory(no_memory));
  };
  int code = 0;
  try {
    const auto ended = parse(argc, argv);
    if (ended) {
      code = *ended;
    } else {
      with_enough_stack([&] { code = perform(body); });
    }
  } catch (const std::bad_alloc&) {
    code = end_without_memory();
  }
  end_without_memory = nullptr;
  stop_watch_.reset();
  return code;
}

int Tool::perform(const std::function<void()>& body) {
  try {
    register_report();
    body();
    return finish(ExitCode::ok, {});
  } catch (const UsageError& error) {
    return finish(error.code(), fmt::format("{} (see tunica-{} --help)", error.what(), verb_));
  } catch (const MemoryError& error) {
    return finish(error.code(), out_of_memory(error.what()));
  } catch (const Error& error) {
    return finish(error.code(), error.what());
  } catch (const Interrupted& interrupted) {
    finish(ExitCode::ok, stopped_by(interrupted.signal()));
    return 128 + interrupted.signal();
  } catch (const std::bad_alloc&) {
    return finish(ExitCode::memory, out_of_memory(no_memory));
  } catch (const std::exception& error) {
    // TBB has no type for it.
    return std::string_view(error.what()).find("pthread_create") != std::string_view::npos
               ? finish(ExitCode::memory,
                        out_of_memory("no thread can be started: give it more memory, or --threads 1"))
               : finish(ExitCode::internal, error.what());
  }
}

// With the file and the stage at hand, and what limits it.
std::string Tool::out_of_memory(const std::string& why) {
  memory_limit_.lift();
  rlimit limit{};
  std::string limits;
  if (!memory_limit_.text().empty()) {
    limits = fmt::format("limit {} by --memory-limit, ", memory_limit_.text());
  }
  if (::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    limits += fmt::format("limit {} MiB by ulimit -v, ", limit.rlim_cur >> 20U);
  }
  return fmt::format("{}{} ({}{}at most {:.0f} MiB were in use, the program itself among them)",
                     at_hand_.empty() ? "" : at_hand_ + ": ", why, running_.empty() ? "" : "stage " + running_ + ", ",
                     limits, peak_mebibytes());
}

void Tool::register_report() {
  if (report_.empty() || report_ == standard_output) {
    return;
  }
  // A report that is refused is not to be written by finish() either.
  const std::filesystem::path report = std::exchange(report_, {});
  replaces_failed_ = goes_on() && tells_of_failure(report, "tunica-" + verb_);
  if (app_.get_option_no_throw(resume_flag) != nullptr && !force_) {
    std::ranges::for_each(words_, [&](const std::string& word) { require_none_to_go_on_with(word); });
  }
  require_writable(report, force_ || replaces_failed_);
  require_no_other_file(report);
  report_lock_ = PartLock::take(part_of(report));
  require_descriptor(report);
  require_writable(report, force_ || replaces_failed_);
  report_ = report;
  // However this run ends, an older report must not speak for it. Where the command line names that file once more, it
  // may be an input, which is yet to be refused.
  for (std::size_t i = 1; i < words_.size(); ++i) {
    if (words_[i - 1] != report_flag && resolved(words_[i]) == resolved(report)) {
      return;
    }
  }
  std::error_code ignored;
  std::filesystem::remove(report, ignored);
}

bool Tool::goes_on() const {
  const CLI::Option* const resume = app_.get_option_no_throw(resume_flag);
  return resume != nullptr && resume->count() > 0;
}

// What a run leaves that was stopped an hour after its start is not to be lost by a slip.
void Tool::require_none_to_go_on_with(const std::filesystem::path& path) const {
  if (!force_ && !goes_on() && RunJournal::can_go_on(part_of(path))) {
    throw OutputError(
        fmt::format("{0}: an interrupted run is kept in {1}: go on with it by {2} {1}, or pass --force to begin again",
                    path.string(), part_of(path).string(), resume_flag));
  }
}

std::string Tool::stopped_by(int signal) const {
  const auto kept = std::ranges::find_if(
      outputs_, [](const std::filesystem::path& path) { return RunJournal::can_go_on(part_of(path)); });
  return fmt::format("stopped by signal {}{}", signal,
                     kept == outputs_.end()
                         ? ""
                         : fmt::format(": go on by tunica-{} {} {}{}{}", verb_, resume_flag, part_of(*kept).string(),
                                       std::filesystem::exists(*kept) ? " --force" : "",
                                       report_.empty() ? "" : fmt::format(" {} {}", report_flag, report_.string())));
}

// In the thread that watches, while the work goes on: of what that changes only what is guarded is read, so the report
// has no result. Nothing but what can go on is left under the names of the outputs.
void Tool::end_unseen(int signal) {
  memory_limit_.lift();
  const std::unique_lock guard(recording_, std::try_to_lock);
  const std::string message = guard ? stopped_by(signal) : fmt::format("stopped by signal {}", signal);
  std::fprintf(stderr, "%stunica-%s: %s\n", bar_open_ ? "\n" : "", verb_.c_str(), one_line(message).c_str());
  if (!guard) {
    return;
  }
  const auto remove_parts = [&] {
    for (const std::filesystem::path& path : outputs_) {
      const std::filesystem::path part = part_of(path);
      std::error_code missing;
      const auto written = std::filesystem::last_write_time(part, missing);
      const auto bytes = std::filesystem::file_size(part, missing);
      if (!missing && (bytes == 0 || written >= start_on_disk_) && !RunJournal::can_go_on(part)) {
        std::filesystem::remove(part, missing);
      }
    }
  };
  remove_parts();
  if (!report_.empty()) {
    try {
      write_report(false, message, Json::object());
    } catch (const std::exception& failure) {
      std::fprintf(stderr, "tunica-%s: %s\n", verb_.c_str(), one_line(failure.what()).c_str());
    }
  }
  report_lock_.reset();
  remove_parts();  // the work went on meanwhile
}

int Tool::finish(ExitCode code, const std::string& error) {
  if (stop_watch_) {
    stop_watch_->stand_down();
  }
  memory_limit_.lift();
  locks_.clear();
  const std::string message = one_line(error);
  say_line(message.empty() ? "" : fmt::format("tunica-{}: {}\n", verb_, message));
  if (!report_.empty()) {
    try {
      const std::lock_guard guard(recording_);
      write_report(message.empty(), message, make_result_ ? make_result_() : result_);
    } catch (const std::exception& failure) {
      say_line(fmt::format("tunica-{}: {}\n", verb_, one_line(failure.what())));
      code = code == ExitCode::ok ? ExitCode::output : code;
    }
  }
  report_lock_.reset();
  return static_cast<int>(code);
}

Json Tool::redact(const Json& json) const {
  if (json.is_string() && provenance_.hides_paths()) {
    return provenance_.redact(json.get<std::string>());
  }
  Json copy = json;
  if (json.is_structured() && provenance_.hides_paths()) {
    for (Json& part : copy) {
      part = redact(part);
    }
  }
  return copy;
}

Json Tool::describe_outputs(bool ok) const {
  Json outputs = Json::array();
  for (const std::filesystem::path& path : outputs_) {
    for (const std::string& name : {path.string(), part_of(path).string()}) {
      std::error_code missing;  // an older file that --force would have replaced is not an output of a run that failed
      const auto written = std::filesystem::last_write_time(name, missing);
      if (!missing && (ok || written >= start_on_disk_)) {
        outputs.push_back({{"path", name}, {"sha256", hash_if_readable(name)}});
      }
    }
  }
  return outputs;
}

void Tool::write_report(bool ok, const std::string& error, const Json& result) {
  Json seconds{{"total", seconds_since(start_)}};  // without the hashes of the outputs
  seconds.update(seconds_);
  std::vector<Warning> warnings = warnings_;
  std::ranges::stable_sort(warnings, std::greater<>(), &Warning::weight);
  const auto first_note = std::ranges::find(warnings, Weight::note, &Warning::weight);
  const std::vector<Warning> notes(first_note, warnings.end());
  warnings.erase(first_note, warnings.end());
  std::vector<std::string> kinds;
  std::ranges::transform(warnings, std::back_inserter(kinds), &Warning::kind);
  std::vector<std::string> weights;
  std::ranges::transform(warnings, std::back_inserter(weights),
                         [](const Warning& warning) { return warning.weight == Weight::major ? "major" : "minor"; });
  Json report{
      {"tool", "tunica-" + verb_},
      {"version", version},
      {"instruction_set", instruction_set()},
      {"ok", ok},
      {"error", error.empty() ? Json() : Json(error)},
      {"warnings", texts_of(warnings)},
      {"warning_kinds", kinds},
      {"warning_weights", weights},
      {"notes", texts_of(notes)},
      {"command", provenance_.command()},
      {"arguments", arguments_},
      {"inputs", inputs_},
      {"outputs", describe_outputs(ok)},
      {"seconds", seconds},
      {"peak_mib", peak_mebibytes()},
      {"threads", thread_count()},
      {"result", result},
  };
  if (!stated_.is_null()) {
    report["stated"] = stated_;
  }
  // A file name need not be UTF-8; the report has to be.
  const std::string text = redact(report).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (report_ == standard_output) {
    tunica::print(text);
    return;
  }
  require_no_other_file(report_);
  write_file(report_, text, force_ || replaces_failed_);
}

void Tool::claim(const std::filesystem::path& path, bool written) {
  const std::filesystem::path place = resolved(path);
  const std::filesystem::path part = resolved(path.parent_path() / ".") / part_of(path.filename());
  if (!report_.empty() && report_ != standard_output &&
      (place == resolved(report_) || is_kept_under(place, part_of(resolved(report_))) ||
       (written && is_kept_under(resolved(report_), part)))) {
    report_.clear();
    throw UsageError(fmt::format("{}: --report names a file of the run itself, name another", path.string()));
  }
  for (const Claim& other : claimed_) {
    const bool same = other.place == place || (other.written && is_kept_under(place, other.part)) ||
                      (written && is_kept_under(other.place, part));
    if (same && (written || other.written)) {
      throw UsageError(written && other.written
                           ? fmt::format("{}: two outputs have the same name", path.string())
                           : fmt::format("{}: is an input and an output, name another output", path.string()));
    }
  }
  claimed_.push_back({place, part, written, path, state_of(path)});
}

const std::filesystem::path& Tool::input(const std::filesystem::path& path) {
  claim(path, false);
  at_hand_ = path.string();
  provenance_.add_input(path);
  // A missing input or a folder is for the reader to refuse; the report still has to be written.
  const Json hash = report_.empty() ? Json() : hash_if_readable(path);
  const std::lock_guard guard(recording_);
  inputs_.push_back({{"path", path.string()}, {"sha256", hash}});
  return path;
}

Tool::FileState Tool::state_of(const std::filesystem::path& path) {
  struct stat file {};
  if (::stat(path.c_str(), &file) != 0 || !S_ISREG(file.st_mode)) {  // an output in a folder of slices changes that
    return {};
  }
  return {narrow<std::int64_t>(file.st_dev), narrow<std::int64_t>(file.st_ino), file.st_size, file.st_mtim.tv_sec,
          file.st_mtim.tv_nsec};
}

void Tool::require_unchanged_inputs() const {
  for (const Claim& claim : claimed_) {
    if (!claim.written && state_of(claim.name) != claim.state) {
      throw InputError(fmt::format("{}: was changed or removed while it was read: run again when it stays as it is",
                                   claim.name.string()));
    }
  }
}

const std::filesystem::path& Tool::output(const std::filesystem::path& path, const std::vector<std::string>& endings) {
  const std::string name = path.string();
  if (!endings.empty() && std::ranges::none_of(endings, [&](const auto& ending) { return name.ends_with(ending); })) {
    throw UsageError(fmt::format("{}: what is written is {}, name the file so", name, fmt::join(endings, " or ")));
  }
  require_writable(path, force_);
  claim(path, true);
  at_hand_ = at_hand_.empty() ? name : at_hand_;
  locks_.push_back(PartLock::take(part_of(path)));
  require_writable(path, force_);  // another run may have finished it before the lock was ours
  require_none_to_go_on_with(path);
  wrote(path);
  return path;
}

void Tool::wrote(const std::filesystem::path& path) {
  const std::lock_guard guard(recording_);
  outputs_.push_back(path);
  provenance_.add_output(path);
}

Tool::Stage::Stage(Tool& tool, std::string name) : tool_(tool), name_(std::move(name)), start_(Clock::now()) {
  tool_.running_ = name_;
}

Tool::Stage::~Stage() {
  const std::lock_guard guard(tool_.recording_);
  Json& entry = tool_.seconds_[name_];
  entry = (entry.is_number() ? entry.get<double>() : 0.0) + seconds_since(start_);
}

void Tool::stages(const std::vector<std::string>& names) {
  for (const auto& name : names) {
    seconds_[name] = nullptr;
  }
}

Progress Tool::progress(const std::string& doing) {
  if (quiet_) {
    return {};
  }
  struct Shown {
    Clock::time_point last = Clock::now();
    Clock::time_point start = Clock::now();
    double most = 0;
  };
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  return [this, doing, terminal, shown = std::make_shared<Shown>()](double fraction) {
    // What turns out to be more work than it looked waits until it has caught up.
    shown->most = std::max(shown->most, std::min(fraction, 1.0));
    const auto now = Clock::now();
    const auto pause = terminal ? std::chrono::milliseconds(100) : std::chrono::milliseconds(10'000);
    if (now - shown->last < pause) {
      return;
    }
    shown->last = now;
    const double percent = 100 * shown->most;
    if (terminal) {
      constexpr int width = 30;
      const auto filled = truncated<std::size_t>(percent / 100 * width);
      say(fmt::format("\r{:<10} [{:<{}}] {:5.1f} %  {:.1f} s ", doing, std::string(filled, '#'), width, percent,
                      seconds_since(shown->start)));
      bar_open_ = true;
    } else {
      say_line(fmt::format("tunica-{}: {} {:.1f} %\n", verb_, doing, percent));
    }
  };
}

chain::Context Tool::context() {
  return {.progress = [this](const std::string& doing) { return progress(doing); },
          .stage = [this](const std::string& name) { return std::make_shared<Stage>(*this, name); },
          .note = [this](const std::string& text) { note(text); },
          .detail = [this](const std::string& text) { detail(text); },
          .warn = [this](const Warning& warning) { warn(warning); },
          .reads = [this](const std::filesystem::path& path) { input(path); },
          .has_read = [this] { require_unchanged_inputs(); },
          .writes = [this](const std::filesystem::path& path,
                           const std::vector<std::string>& endings) { output(path, endings); },
          .wrote = [this](const std::filesystem::path& path) { wrote(path); },
          .name_of = [this](const std::filesystem::path& path) { return provenance_.name_of(path); },
          .command = [this] { return provenance_.lasting_command(); },
          .redact = [this](const std::string& text) { return provenance_.redact(text); },
          .made_by = [this] { return made_by(); },
          .overwrite = force_};
}

void Tool::say_line(const std::string& text) const { say((std::exchange(bar_open_, false) ? "\n" : "") + text); }

void Tool::note(const std::string& text) const {
  if (!quiet_) {
    say_line(text + "\n");
  }
}

void Tool::detail(const std::string& text) const {
  if (verbose_) {
    say_line(text + "\n");
  }
}

void Tool::warn(Warning warning) const {
  warning.text = one_line(warning.text);
  if (!quiet_) {
    say_line(
        fmt::format("tunica-{}: {}: {}\n", verb_, warning.weight == Weight::note ? "note" : "warning", warning.text));
  }
  const std::lock_guard guard(recording_);
  warnings_.push_back(std::move(warning));
}

void Tool::print(const std::string& text) const {
  if (report_ == standard_output) {
    throw UsageError("--report - leaves standard output to the report: name a file, or leave it out");
  }
  say_line("");
  tunica::print(text);
}

}  // namespace tunica::cli
