#pragma once

#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace tunica {

/// Walks through a text in memory line by line and, within a line, token by token. Numbers are read in full double
/// precision and independent of the locale. Blank lines are skipped; a `\r` before the line's end counts as blank.
class TextScanner {
public:
  explicit TextScanner(std::string_view text, std::size_t lines_before = 0)
      : next_(text.data()), end_(text.data() + text.size()), cursor_(next_), line_end_(next_), line_(lines_before) {}

  /// Goes to the next line that holds anything; @return false at the end of the text.
  bool next_line() {
    while (next_ != end_) {
      const auto* found = static_cast<const char*>(std::memchr(next_, '\n', end_ - next_));
      cursor_ = next_;
      line_end_ = found != nullptr ? found : end_;
      next_ = found != nullptr ? found + 1 : end_;
      ++line_;
      if (skip_blanks()) {
        return true;
      }
    }
    cursor_ = line_end_ = end_;
    return false;
  }

  /// Number of the current line, from 1.
  [[nodiscard]] std::size_t line() const { return line_; }

  /// Bytes after the current line.
  [[nodiscard]] std::size_t remaining() const { return end_ - next_; }

  [[nodiscard]] bool at_line_end() { return !skip_blanks(); }

  /// The next token of the line; empty at its end.
  std::string_view token() {
    if (!skip_blanks()) {
      return {};
    }
    const char* begin = cursor_;
    while (cursor_ != line_end_ && !is_blank(*cursor_)) {
      ++cursor_;
    }
    return {begin, cursor_};
  }

  /// The next token as a number, which may be infinite or not a number; none when it is not written as one.
  std::optional<double> number() { return scan<double>(); }

  /// The next token as a whole number; none when it is not one.
  std::optional<std::int64_t> integer() { return scan<std::int64_t>(); }

  /// What is left of the line.
  [[nodiscard]] std::string_view rest() {
    skip_blanks();
    return {cursor_, line_end_};
  }

private:
  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  bool skip_blanks() {
    while (cursor_ != line_end_ && is_blank(*cursor_)) {
      ++cursor_;
    }
    return cursor_ != line_end_;
  }

  template <typename Number>
  std::optional<Number> scan() {
    if (!skip_blanks()) {
      return {};
    }
    const char* begin = cursor_;
    if (*begin == '+' && begin + 1 != line_end_ && begin[1] != '-' && begin[1] != '+') {
      ++begin;
    }
    Number value{};
    auto [stop, error] = std::from_chars(begin, line_end_, value);
    if constexpr (std::is_floating_point_v<Number>) {
      if (error == std::errc::result_out_of_range) {  // says neither overflow nor underflow: strtod does
        value = std::strtod(std::string(begin, stop).c_str(), nullptr);
        error = {};
      }
    }
    if (error != std::errc() || (stop != line_end_ && !is_blank(*stop))) {
      return {};
    }
    cursor_ = stop;
    return value;
  }

  const char* next_;
  const char* end_;
  const char* cursor_;
  const char* line_end_;
  std::size_t line_;
};

}  // namespace tunica
