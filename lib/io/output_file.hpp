#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace tunica {

/// An output that is whole or not there: everything goes to `NAME.part`, which commit() flushes to the disk and
/// renames to NAME (or to the file behind it, when NAME is a symbolic link). Without commit() the destructor removes
/// the .part file, unless keep_partial() was called.
class OutputFile {
public:
  /// Errors: OutputError when NAME exists and `overwrite` is false, or when NAME.part cannot be created.
  OutputFile(std::filesystem::path path, bool overwrite);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Where a library that opens files by name must write (HDF5, OpenCV).
  [[nodiscard]] const std::filesystem::path& partial_path() const { return partial_; }

  /// Flushes what stands in partial_path() to the disk and renames it. Errors: OutputError.
  void commit();

  /// Leaves NAME.part behind: the best mesh or the last good state of a run that failed its requirement.
  void keep_partial() { keep_ = true; }

private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  bool done_ = false;
  bool keep_ = false;
};

/// Throws OutputError when `path` exists and `overwrite` is false, or is a folder, a device or a pipe (renaming onto
/// /dev/null would replace it), or when its folder cannot be written to. Tools call
/// it before the work, so that an hour of computing does not end at a file that was there all the time.
void require_writable(const std::filesystem::path& path, bool overwrite);

/// Writes `bytes` as a whole file through an OutputFile. Errors: OutputError.
void write_file(const std::filesystem::path& path, std::string_view bytes, bool overwrite);

/// Reads a whole regular file. Errors: InputError when it is missing, unreadable, not a regular file, or larger than
/// `limit` bytes.
std::string read_file(const std::filesystem::path& path, std::size_t limit = std::size_t{1} << 40);

/// SHA-256 of a file's bytes in lower-case hexadecimal. Errors: InputError.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace tunica
