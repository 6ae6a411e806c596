#pragma once

#include <string>
#include <string_view>

/// All that a program says goes through here. The descriptors are written to directly: a stream would throw, or keep
/// what it could not write for the end of the program.
namespace tunica {

/// Gives the standard descriptors that are closed something that can be neither read nor written, so that no file of
/// the run gets their number and the words with it. Call it before any file is opened.
void occupy_standard_descriptors() noexcept;

/// Standard error. Words that cannot be said are lost: they must not cost the work or the exit code.
void say(std::string_view text) noexcept;

/// A word as a shell needs it typed.
std::string shell_quoted(const std::string& word);

/// Standard output, which is a result. Errors: OutputError when it cannot be written to the end.
void print(std::string_view text);

}  // namespace tunica
