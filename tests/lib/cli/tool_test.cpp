#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"

#include "tunica/core/threads.hpp"
#include "tunica/core/words.hpp"
#include "tunica/io/file/output_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <thread>

namespace tunica::cli {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

class ToolTest : public testing::Test {
protected:
  struct Outcome {
    int code = -1;
    std::string error;
    Json report;
  };

  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "tunica-test-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    fs::remove_all(folder_);
    request_stop(0);
    std::signal(SIGHUP, SIG_DFL);
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
  }

  static int exit_code(std::vector<std::string> arguments, const std::function<void(Tool&)>& body) {
    Tool tool("test", "A tool.", "tunica-test a b");
    std::optional<double> pressure;
    tool.quantity("--pressure", pressure, dimension::pressure, "a pressure");
    std::vector<char*> argv;
    arguments.insert(arguments.begin(), "tunica-test");
    for (auto& argument : arguments) {
      argv.push_back(argument.data());
    }
    return tool.run(static_cast<int>(argv.size()), argv.data(), [&] {
      if (pressure) {
        tool.result()["pressure"] = *pressure;
      }
      body(tool);
    });
  }

  Outcome run(std::vector<std::string> arguments, const std::function<void(Tool&)>& body) {
    Outcome outcome;
    testing::internal::CaptureStderr();
    outcome.code = exit_code(std::move(arguments), body);
    outcome.error = testing::internal::GetCapturedStderr();
    if (fs::exists(report())) {
      outcome.report = Json::parse(read_file(report()));
    }
    return outcome;
  }
  Outcome run(std::vector<std::string> arguments) {
    return run(std::move(arguments), [](Tool&) {});
  }

  [[nodiscard]] fs::path report() const { return folder_ / "report.json"; }

  fs::path folder_;
};

TEST_F(ToolTest, AReportHoldsTheKeysOfTheContract) {
  write_file(folder_ / "in", "abc", false);
  const auto outcome = run({"--report", report(), "--threads", "1", "--pressure", "-90 MPa"}, [&](Tool& tool) {
    tool.input(folder_ / "in");
    tool.output(folder_ / "out");
    const auto stage = tool.stage("read");
  });
  EXPECT_EQ(outcome.code, 0) << outcome.error;
  for (const char* key : {"tool", "version", "instruction_set", "ok", "error", "warnings", "command", "inputs",
                          "outputs", "seconds", "peak_mib", "threads", "result"}) {
    EXPECT_TRUE(outcome.report.contains(key)) << key;
  }
  EXPECT_EQ(outcome.report["ok"], true);
  EXPECT_TRUE(outcome.report["error"].is_null());
  EXPECT_EQ(outcome.report["threads"], 1);
  EXPECT_EQ(outcome.report["result"]["pressure"], -90.0);
  EXPECT_EQ(outcome.report["inputs"][0]["sha256"].get<std::string>().size(), 64U);
  EXPECT_GE(outcome.report["seconds"]["total"].get<double>(), outcome.report["seconds"]["read"].get<double>());
}

TEST_F(ToolTest, WarningsStandInTheReportAlsoWhereNothingIsPrinted) {
  const auto doubting = [](Tool& tool) {
    tool.warn({Weight::minor, "first kind", "the first\nin two lines"});
    tool.warn({Weight::note, "further", "a note"});
    tool.warn({Weight::major, "second kind", "the second"});
  };
  const auto said = run({"--report", report()}, doubting);
  EXPECT_EQ(said.report["warnings"], Json::array({"the second", "the first in two lines"}));
  EXPECT_EQ(said.report["warning_kinds"], Json::array({"second kind", "first kind"}));
  EXPECT_EQ(said.report["notes"], Json::array({"a note"}));
  EXPECT_THAT(said.error, HasSubstr("warning: the second"));
  const auto quiet = run({"--report", report(), "--force", "--quiet"}, doubting);
  EXPECT_EQ(quiet.report["warnings"].size(), 2U);
  EXPECT_EQ(quiet.error, "");
  fs::remove(report());
  EXPECT_EQ(run({"--report", report()}).report["warnings"], Json::array());
}

TEST_F(ToolTest, ExitCodesAndReportsOfEveryKindOfError) {
  const auto code_of = [&](const std::function<void()>& failure) {
    fs::remove(report());
    const auto outcome = run({"--report", report()}, [&](Tool&) { failure(); });
    EXPECT_EQ(outcome.report["ok"], false);
    EXPECT_THAT(outcome.report["error"].get<std::string>(), HasSubstr("why"));
    EXPECT_THAT(outcome.error, HasSubstr("tunica-test: "));
    EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 1) << outcome.error;
    return outcome.code;
  };
  EXPECT_EQ(code_of([] { throw UsageError("why"); }), 2);
  EXPECT_EQ(code_of([] { throw InputError("why\nin two lines"); }), 3);
  EXPECT_EQ(code_of([] { throw RequirementError("why"); }), 4);
  EXPECT_EQ(code_of([] { throw OutputError("why"); }), 5);
  EXPECT_EQ(code_of([] { throw MemoryError("why"); }), 6);
  EXPECT_EQ(code_of([] { throw std::runtime_error("why"); }), 1);
}

TEST_F(ToolTest, OutOfMemorySaysWhereAndWhatToDo) {
  write_file(folder_ / "in", "abc", false);
  const auto outcome = run({"--report", report()}, [&](Tool& tool) {
    tool.output(folder_ / "out");
    tool.input(folder_ / "in");
    const auto stage = tool.stage("solve");
    throw std::bad_alloc();
  });
  EXPECT_EQ(outcome.code, 6);
  EXPECT_THAT(outcome.error, HasSubstr((folder_ / "in").string() + ": out of memory: give it more, or"));
  EXPECT_THAT(outcome.error, HasSubstr("stage solve"));
  EXPECT_EQ(outcome.report["ok"], false);
  const auto threadless = run({}, [](Tool&) { throw std::runtime_error("pthread_create has failed: try again"); });
  EXPECT_EQ(threadless.code, 6);
  EXPECT_THAT(threadless.error, HasSubstr("--threads 1"));
}

TEST_F(ToolTest, UsageErrors) {
  EXPECT_EQ(run({"--nonsense"}).code, 2);
  EXPECT_THAT(run({"--pressure", "13"}).error, HasSubstr("13kPa"));
  EXPECT_EQ(run({"--pressure", "13"}).code, 2);
  EXPECT_EQ(run({"--pressure", "13mm"}).code, 2);
  EXPECT_EQ(run({"--quiet", "--verbose"}).code, 2);
  for (const char* threads : {"0", "-1", "1.5", "x", "1e9"}) {
    EXPECT_EQ(run({"--threads", threads}).code, 2) << threads;
  }
}

TEST_F(ToolTest, AUsageErrorStillWritesTheReport) {
  const auto outcome = run({"--nonsense", "--report", report()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.report["ok"], false);
}

TEST_F(ToolTest, ExistingOutputsNeedForce) {
  write_file(folder_ / "out", "old", false);
  const auto body = [&](Tool& tool) { tool.output(folder_ / "out"); };
  EXPECT_EQ(run({}, body).code, 5);
  EXPECT_EQ(run({"--force"}, body).code, 0);
}

TEST_F(ToolTest, AFileHasOneUse) {
  write_file(folder_ / "in", "abc", false);
  fs::create_symlink(folder_ / "in", folder_ / "link");
  const auto code_of = [&](const fs::path& in, const fs::path& out, const fs::path& reported) {
    fs::remove(report());
    return run({"--force", "--report", reported},
               [&](Tool& tool) {
                 tool.input(in);
                 tool.output(out);
               })
        .code;
  };
  const fs::path in = folder_ / "in";
  EXPECT_EQ(code_of(in, folder_ / "out", report()), 0);
  EXPECT_EQ(code_of(in, in, report()), 2);
  EXPECT_EQ(code_of(in, folder_ / "." / "link", report()), 2);
  EXPECT_EQ(code_of(in, folder_ / "out", folder_ / "." / "out"), 2);
  EXPECT_EQ(run({"--force"},
                [&](Tool& tool) {
                  tool.output(folder_ / "out");
                  tool.output(folder_ / "." / "out");
                })
                .code,
            2);
  EXPECT_EQ(read_file(in), "abc");
}

TEST_F(ToolTest, WhereAnOutputIsKeptUntilItIsWholeNoInputIs) {
  for (const char* name : {"out.part", "out.part.states", "report.json.part"}) {
    write_file(folder_ / name, "abc", false);
    for (const bool input_first : {false, true}) {
      fs::remove(report());
      const auto body = [&](Tool& tool) {
        if (input_first) {
          tool.input(folder_ / "." / name);
        }
        tool.output(folder_ / "out");
        if (!input_first) {
          tool.input(folder_ / "." / name);
        }
      };
      EXPECT_EQ(run({"--report", report()}, body).code, 2) << name;
      EXPECT_EQ(read_file(folder_ / name), "abc") << name;
    }
    fs::remove(folder_ / name);
  }
  const auto both = [&](Tool& tool) {
    tool.output(folder_ / "out");
    tool.output(folder_ / "out.part");
  };
  EXPECT_EQ(run({"--force"}, both).code, 2);
  EXPECT_FALSE(fs::exists(folder_ / "out.part"));
}

TEST_F(ToolTest, ASecondRunOnAnOutputOrAReportIsRefusedAtOnce) {
  for (const char* name : {"out", "report.json"}) {
    fs::remove(report());
    const int other = ::open(part_of(folder_ / name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    struct flock whole {};
    whole.l_type = F_WRLCK;
    ASSERT_EQ(::fcntl(other, F_OFD_SETLK, &whole), 0);
    bool worked = false;
    const auto outcome = run({"--force", "--report", report()}, [&](Tool& tool) {
      tool.output(folder_ / "out");
      worked = true;
    });
    EXPECT_EQ(outcome.code, 5) << name;
    EXPECT_THAT(outcome.error, HasSubstr("another run is writing it")) << name;
    EXPECT_FALSE(worked) << name;
    EXPECT_TRUE(fs::exists(part_of(folder_ / name))) << "it is the other run's";
    ::close(other);
    fs::remove(part_of(folder_ / name));
  }
}

TEST_F(ToolTest, TheLockOfAnOutputHoldsToTheEndOfTheRunAndLeavesNothing) {
  run({}, [&](Tool& tool) {
    tool.output(folder_ / "out");
    const int other = ::open((folder_ / "out.part").c_str(), O_RDWR | O_CLOEXEC);
    struct flock whole {};
    whole.l_type = F_WRLCK;
    EXPECT_NE(::fcntl(other, F_OFD_SETLK, &whole), 0);
    ::close(other);
    throw InputError("why");
  });
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(ToolTest, AReportReplacesNothingButAReport) {
  write_file(folder_ / "scan.nii", "not JSON", false);
  EXPECT_EQ(run({"--force", "--report", folder_ / "scan.nii"}).code, 5);
  EXPECT_EQ(run({"--force", "--report", folder_ / "scan.nii", "--nonsense"}).code, 2);
  EXPECT_EQ(read_file(folder_ / "scan.nii"), "not JSON");
}

TEST_F(ToolTest, TheHashOfAnInputIsOfWhatWasRead) {
  write_file(folder_ / "in", "abc", false);
  const auto outcome = run({"--report", report()}, [&](Tool& tool) {
    tool.input(folder_ / "in");
    write_file(folder_ / "in", "changed while the tool ran", true);
  });
  EXPECT_EQ(outcome.report["inputs"][0]["sha256"], "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST_F(ToolTest, UsageErrorsSayWhatToDo) {
  EXPECT_THAT(run({"--nonsense", "7"}).error, HasSubstr("'--nonsense' is not an option of tunica-test"));
  EXPECT_THAT(run({"surplus"}).error, HasSubstr("'surplus' is one argument too many"));
  EXPECT_THAT(run({"--threads"}).error, HasSubstr("--threads needs a value"));
  EXPECT_THAT(run({"--threads", "1", "--threads", "2"}).error, HasSubstr("--threads is given more than once"));
  EXPECT_EQ(run({"--quiet=no"}).code, 2);
}

TEST(WholeNumber, SaysWhichNumbersAreMeant) {
  const CLI::Validator from_one = whole_number(1, 99);
  for (std::string good : {"1", "50", "99"}) {
    EXPECT_EQ(from_one(good), "") << good;
  }
  for (std::string bad : {"0", "100", "-1", "1.5", "x", "", "1e1"}) {
    EXPECT_THAT(from_one(bad), HasSubstr("is not a whole number from 1 to 99")) << bad;
  }
}

TEST_F(ToolTest, AReportThatCannotBeWrittenIsFailure) {
  EXPECT_EQ(run({"--report", folder_ / "no" / "report.json"}).code, 5);
  write_file(report(), "{}", false);
  EXPECT_EQ(run({"--report", report()}).code, 5);
  EXPECT_EQ(run({"--report", report(), "--force"}).code, 0);
}

TEST_F(ToolTest, AnOlderReportNeverSpeaksForARun) {
  const std::string fine = R"({"ok": true})";
  write_file(report(), fine, false);
  EXPECT_EXIT(exit_code({"--report", report(), "--force"}, [](Tool&) { std::_Exit(7); }), testing::ExitedWithCode(7),
              "");
  EXPECT_FALSE(fs::exists(report())) << "as after kill -9";
  write_file(report(), fine, true);
  EXPECT_EQ(run({"--report", report(), "--force", "--nonsense"}).report["ok"], false);
  write_file(report(), fine, true);
  EXPECT_EQ(run({"--report", report(), "--force", "--quiet", "--verbose"}).report["ok"], false);
}

TEST_F(ToolTest, AReportThatIsAnInputTooIsKept) {
  write_file(report(), R"({"ok": true})", false);
  Tool tool("test", "A tool.", "tunica-test a");
  fs::path in;
  tool.arguments().add_option("IN", in, "a report");
  std::vector<std::string> words{"tunica-test", report(), "--force", "--report", folder_ / "." / "report.json"};
  std::vector<char*> argv;
  for (std::string& word : words) {
    argv.push_back(word.data());
  }
  EXPECT_EQ(tool.run(static_cast<int>(argv.size()), argv.data(), [&] { tool.input(in); }), 2);
  EXPECT_EQ(read_file(report()), R"({"ok": true})");
}

// What becomes of standard output or error.
enum class Lost { full, closed, without_reader };

void lose(int descriptor, Lost how) {
  std::array<int, 2> pipe{};
  if (how == Lost::closed) {
    ::close(descriptor);
  } else if (how == Lost::full) {
    ::dup2(::open("/dev/full", O_WRONLY | O_CLOEXEC), descriptor);
  } else if (::pipe(pipe.data()) == 0) {
    ::dup2(pipe[1], descriptor);
    ::close(pipe[0]);
    ::close(pipe[1]);
  }
}

TEST_F(ToolTest, WordsThatCannotBeSaidCostNeitherWorkNorExitCode) {
  for (const Lost how : {Lost::full, Lost::closed, Lost::without_reader}) {
    for (const int code : {0, 3}) {
      fs::remove(report());
      const auto body = [&](Tool& tool) {
        lose(STDERR_FILENO, how);
        occupy_standard_descriptors();
        tool.warn({Weight::minor, "kind", "a warning"});
        tool.note("a note");
        tool.progress("work")(0.5);
        write_file(folder_ / "out", "the work", true);
        if (code != 0) {
          throw InputError("why");
        }
      };
      EXPECT_EXIT(std::_Exit(exit_code({"--report", report()}, body)), testing::ExitedWithCode(code), "");
      EXPECT_EQ(Json::parse(read_file(report()))["ok"], code == 0);
      EXPECT_EQ(read_file(folder_ / "out"), "the work");
    }
  }
}

TEST_F(ToolTest, AnAnswerThatIsLostIsAnOutputError) {
  for (const Lost how : {Lost::full, Lost::closed, Lost::without_reader}) {
    const auto ask = [&](const std::vector<std::string>& arguments) {
      lose(STDOUT_FILENO, how);
      std::_Exit(exit_code(arguments, [](Tool& tool) { tool.print("the answer"); }));
    };
    fs::remove(report());
    EXPECT_EXIT(ask({"--report", report()}), testing::ExitedWithCode(5), "");
    EXPECT_EQ(Json::parse(read_file(report()))["ok"], false);
    EXPECT_EXIT(ask({"--help"}), testing::ExitedWithCode(5), "");
    EXPECT_EXIT(ask({"--version"}), testing::ExitedWithCode(5), "");
    EXPECT_EXIT(ask({"--documentation", "man"}), testing::ExitedWithCode(5), "");
  }
}

TEST_F(ToolTest, NoFileOfTheRunGetsTheWords) {
  for (int closed = 1; closed < 8; ++closed) {
    const auto body = [&](Tool& tool) {
      OutputFile file(tool.output(folder_ / "out"), true);
      const int descriptor = ::open(file.partial_path().c_str(), O_WRONLY | O_CLOEXEC);
      TUNICA_ASSERT(descriptor > STDERR_FILENO);
      tool.warn({Weight::minor, "kind", "a warning"});
      TUNICA_ASSERT(::write(descriptor, "abc", 3) == 3);
      tool.note("a note");
      file.commit();
    };
    const auto attempt = [&] {
      for (int descriptor = 0; descriptor < 3; ++descriptor) {
        if ((closed >> descriptor & 1) != 0) {
          ::close(descriptor);
        }
      }
      std::_Exit(exit_code({"--force"}, body));
    };
    EXPECT_EXIT(attempt(), testing::ExitedWithCode(0), "") << closed;
    EXPECT_EQ(read_file(folder_ / "out"), "abc") << closed;
  }
}

TEST_F(ToolTest, ProgressNeverRunsBackwards) {
  int terminal = -1, ours = -1;
  ASSERT_EQ(::openpty(&ours, &terminal, nullptr, nullptr, nullptr), 0);
  const int standard_error = ::dup(STDERR_FILENO);
  Tool tool("test", "A tool.", "tunica-test");
  ::dup2(terminal, STDERR_FILENO);
  const Progress progress = tool.progress("work");
  for (const double fraction : {0.5, 0.2, std::nan(""), 0.6}) {
    std::this_thread::sleep_for(std::chrono::milliseconds(101));  // nothing is drawn more often
    progress(fraction);
  }
  ::dup2(standard_error, STDERR_FILENO);
  ::close(standard_error);
  std::string shown;
  for (pollfd ready{ours, POLLIN, 0}; std::ranges::count(shown, ']') < 4 && ::poll(&ready, 1, 10'000) == 1;) {
    std::array<char, 4096> bytes{};
    shown.append(bytes.data(), static_cast<std::size_t>(::read(ours, bytes.data(), bytes.size())));
  }
  ::close(ours);
  ::close(terminal);
  std::vector<double> percent;
  for (std::size_t at = shown.find(']'); at != std::string::npos; at = shown.find(']', at + 1)) {
    percent.push_back(std::strtod(shown.c_str() + at + 1, nullptr));
  }
  EXPECT_THAT(percent, testing::ElementsAre(50, 50, 50, 60)) << shown;
}

TEST_F(ToolTest, ASignalStopsAtTheNextCheckAndSaysSo) {
  const auto outcome = run({"--report", report()}, [](Tool& tool) {
    std::raise(SIGTERM);
    advance(tool.progress("work"), 0.5);
    FAIL() << "not reached";
  });
  EXPECT_EQ(outcome.code, 143);
  EXPECT_EQ(outcome.report["ok"], false);
}

TEST_F(ToolTest, AHangUpStopsUnlessItIsIgnored) {
  const auto hung_up = [](Tool& tool) {
    std::raise(SIGHUP);
    advance(tool.progress("work"), 0.5);
  };
  EXPECT_EQ(run({}, hung_up).code, 129);
  request_stop(0);
  std::signal(SIGHUP, SIG_IGN);  // as nohup does
  EXPECT_EQ(run({}, hung_up).code, 0);
}

TEST_F(ToolTest, ThreadsFromTheEnvironment) {
  ::unsetenv("TUNICA_THREADS");
  ::setenv("SLURM_CPUS_PER_TASK", "3", 1);
  EXPECT_EQ(default_thread_count(), 3U);
  ::setenv("TUNICA_THREADS", "2", 1);
  EXPECT_EQ(default_thread_count(), 2U);
  ::setenv("TUNICA_THREADS", "many", 1);
  EXPECT_EQ(run({}).code, 2);
  ::unsetenv("TUNICA_THREADS");
  ::unsetenv("SLURM_CPUS_PER_TASK");
}

}  // namespace
}  // namespace tunica::cli
