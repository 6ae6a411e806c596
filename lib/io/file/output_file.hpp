// io/file: outputs that are whole or absent; what the readers share.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace tunica {

/// The right to write the file NAME.part: a lock on the file itself, which other programs that ask for it respect. It
/// ends with the last holder of the pointer, or of the process, however that ends. A file that is then still empty is
/// removed.
class PartLock {
public:
  /// Creates the file where it is not there; keeps its bytes where it is. Whoever asks in the process that holds it
  /// gets the same lock. Errors: OutputError when another process holds it, or when the file cannot be opened for
  /// writing or is anything but a regular file with this one name: links are not followed, and a pipe is not waited
  /// for.
  static std::shared_ptr<PartLock> take(const std::filesystem::path& part);

  ~PartLock();
  PartLock(const PartLock&) = delete;
  PartLock& operator=(const PartLock&) = delete;

  /// Drops the bytes of an earlier run. Errors: OutputError.
  void empty() const;

private:
  PartLock(std::filesystem::path part, int descriptor) : part_(std::move(part)), descriptor_(descriptor) {}
  [[nodiscard]] bool is_at(const std::filesystem::path& path) const;

  std::filesystem::path part_;
  int descriptor_;
  bool foreign_ = false;  ///< another process holds it
};

/// Opens a file for writing that must be no link, pipe or device. @param flags  of open(2), beside those for that.
/// @return the descriptor. Errors: OutputError; with O_CREAT missing, a missing file is -1.
int open_own_file(const std::filesystem::path& path, int flags);

/// What errno says of a file that cannot be opened, read or written, and what helps where the machine's limits forbid
/// it.
std::string file_error();

/// An output that is whole or not there: everything goes to `NAME.part`, which commit() flushes to the disk and
/// renames to NAME (or to the file behind it, when NAME is a symbolic link). Without commit() the destructor removes
/// the .part file, unless keep_partial() was called or the renaming failed. It holds the PartLock.
class OutputFile {
public:
  /// Errors: OutputError when NAME exists and `overwrite` is false, or as PartLock::take().
  OutputFile(std::filesystem::path path, bool overwrite);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Where a library that opens files by name must write (HDF5).
  [[nodiscard]] const std::filesystem::path& partial_path() const { return partial_; }

  /// Flushes what stands in partial_path() to the disk and renames it. Errors: OutputError.
  void commit();

  /// Leaves NAME.part behind: the best mesh or the last good state of a run that failed its requirement.
  void keep_partial() { keep_ = true; }

private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::shared_ptr<PartLock> lock_;
  bool done_ = false;
  bool keep_ = false;
};

/// NAME.part, in which NAME is written.
std::filesystem::path part_of(std::filesystem::path path);

/// Throws OutputError when `path` exists and `overwrite` is false, or is a folder, a device or a pipe (renaming onto
/// /dev/null would replace it), or when its folder, or the one a link leads to, cannot be written to or is of another
/// file system. Tools call it before the work, so that an hour of computing does not end at a file that was there all
/// the time.
void require_writable(const std::filesystem::path& path, bool overwrite);

/// Writes `bytes` as a whole file through an OutputFile. Errors: OutputError.
void write_file(const std::filesystem::path& path, std::string_view bytes, bool overwrite);

using OpenFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// Opens a regular file to be read: a pipe would wait for ever, a device never end. Errors: InputError when it is
/// missing, unreadable or not a regular file.
OpenFile open_input(const std::filesystem::path& path);

/// Reads a whole regular file. Errors: InputError when it is missing, unreadable, not a regular file, or larger than
/// `limit` bytes.
std::string read_file(const std::filesystem::path& path, std::size_t limit = std::size_t{1} << 40);

/// SHA-256 of a file's bytes in lower-case hexadecimal. Errors: InputError.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace tunica
