#pragma once

#include <stdexcept>
#include <string>

/// Two kinds of error, and only two. What a user's data or command line causes is an `Error` below: it carries one
/// sentence that says what is wrong and what to do, and the exit code of the tools' contract. What only a defect of
/// tunica can cause is a failed `TUNICA_ASSERT`: exit code 1.
namespace tunica {

enum class ExitCode : int {
  ok = 0,
  internal = 1,
  usage = 2,
  input = 3,
  requirement = 4,
  output = 5,
  memory = 6,
};

class Error : public std::runtime_error {
public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const noexcept { return code_; }

private:
  ExitCode code_;
};

/// The command line is wrong: unknown or missing flag, bare number, contradiction.
class UsageError : public Error {
public:
  explicit UsageError(const std::string& message) : Error(ExitCode::usage, message) {}
};

/// The data is wrong: missing, truncated, hostile, or not fit for the work. The message starts with the file's name.
class InputError : public Error {
public:
  explicit InputError(const std::string& message) : Error(ExitCode::input, message) {}
};

/// A stated requirement was not met: tolerance, count, convergence, equilibrium.
class RequirementError : public Error {
public:
  explicit RequirementError(const std::string& message) : Error(ExitCode::requirement, message) {}
};

/// An output could not be written, or exists already.
class OutputError : public Error {
public:
  explicit OutputError(const std::string& message) : Error(ExitCode::output, message) {}
};

/// There is not enough memory for the work; the message says for which, and what takes less. std::bad_alloc is the same
/// where nothing more is known.
class MemoryError : public Error {
public:
  explicit MemoryError(const std::string& message) : Error(ExitCode::memory, message) {}
};

/// Runs work that does not know the file its input came from: the message of its InputError or RequirementError starts
/// with that file's name. @return what the work returns
template <typename Work>
auto naming(const std::string& file, const Work& work) {
  const auto named = [&](const Error& error) {
    const std::string what = error.what();
    return what.starts_with(file + ":") ? what : file + ": " + what;
  };
  try {
    return work();
  } catch (const InputError& error) {
    throw InputError(named(error));
  } catch (const RequirementError& error) {
    throw RequirementError(named(error));
  }
}

/// SIGHUP, SIGINT or SIGTERM arrived; thrown by check_interrupt() at a place where the state is consistent.
class Interrupted : public std::exception {
public:
  explicit Interrupted(int signal) : signal_(signal) {}
  [[nodiscard]] int signal() const noexcept { return signal_; }
  [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }

private:
  int signal_;
};

/// A defect of tunica itself, with the place that noticed it.
class InternalError : public std::logic_error {
public:
  using std::logic_error::logic_error;
};

/// What a failed TUNICA_ASSERT calls. Errors: InternalError with the condition and its place.
[[noreturn]] void assertion_failed(const char* condition, const char* file, int line);

}  // namespace tunica

/// Checked in every build type: a wrong result with exit code 0 costs more than the test.
#define TUNICA_ASSERT(condition) ((condition) ? void(0) : ::tunica::assertion_failed(#condition, __FILE__, __LINE__))
