#pragma once

#include <cstddef>
#include <string_view>

namespace tunica {

/// The longest dotted key in a TOML text, in parts: `a.b.c = 1` and `[a.b.c]` have three. Each part nests a table, and
/// toml++ builds and destroys nested tables recursively without a limit of its own, so that a line of 100 kB could
/// exhaust the stack. Text that is not TOML is counted up to where it stops being so at the least.
/// Cost: one pass.
std::size_t longest_dotted_key(std::string_view toml);

}  // namespace tunica
