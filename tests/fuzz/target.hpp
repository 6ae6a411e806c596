// What the harnesses share. A harness gives a reader the bytes of a file, whatever they are; the reader may answer with
// what it read or with one of tunica's errors. Anything else ends the process: another exception, a broken promise of
// its header, a report of a sanitizer, a time-out, too much memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace tunica::fuzz {

/// The bytes that libFuzzer hands over.
inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// A folder of this process, for readers that read files; it is removed at the end.
const std::filesystem::path& folder();

/// Writes a file of that name into folder(). @return its path
std::filesystem::path file(const std::string& name, std::string_view bytes);

/// Ends the process with a reason.
[[noreturn]] void fail(const std::string& why);

/// What a reader promises of what it read.
inline void require(bool promise, const char* what) {
  if (!promise) {
    fail(what);
  }
}

/// Runs a reader. @return false when it refused with one of tunica's errors, which has to begin with `place`
bool accepted(const std::function<void()>& reader, const std::string& place = {});

/// All readers of volumes, on a file of that name: whole, slice by slice, and without voxels, which have to agree.
void volume(const std::string& name, std::string_view bytes);
/// The same for a file or folder that is there.
void volume_at(const std::filesystem::path& path, bool slices);

/// The reader of triangle meshes, which takes the format from the name where the bytes do not say it.
void mesh(const std::string& name, std::string_view bytes);

/// The reader of tetrahedra.
void tetrahedra(const std::string& name, std::string_view bytes);

}  // namespace tunica::fuzz
