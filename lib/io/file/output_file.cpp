#include "tunica/io/file/output_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

namespace tunica {
namespace fs = std::filesystem;

std::string file_error() {
  const int why = errno;
  const char* const remedy = why == EMFILE ? ": allow more (ulimit -n)" : why == ENFILE ? ": close other programs" : "";
  return std::strerror(why) + std::string(remedy);
}

namespace {

// Where a name that is a symbolic link leads: renaming onto the link would replace the link, not the file it stands
// for.
fs::path behind_links(fs::path path) {
  std::error_code error;
  for (int link = 0; link < 40 && fs::is_symlink(fs::symlink_status(path, error)); ++link) {
    path = path.parent_path() / fs::read_symlink(path, error);
  }
  return path;
}

fs::path folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : fs::path("."); }

void flush_to_disk(const fs::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", path.string(), file_error()));
  }
  const bool failed = ::fsync(fd) != 0 && errno != EINVAL && errno != EROFS;
  const std::string why = failed ? file_error() : std::string();
  ::close(fd);
  if (failed) {
    throw OutputError(fmt::format("{}: cannot be flushed to the disk: {}", path.string(), why));
  }
}

}  // namespace

void require_writable(const fs::path& path, bool overwrite) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) {
    throw OutputError(fmt::format("{}: is a folder, name a file", path.string()));
  }
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw OutputError(fmt::format("{}: is a device or a pipe, name a file", path.string()));
  }
  if (fs::exists(status) && !overwrite) {
    throw OutputError(fmt::format("{}: exists already, remove it or pass --force to overwrite it", path.string()));
  }
  const fs::path folder = folder_of(path);
  const fs::path target = folder_of(behind_links(path));
  struct stat here {};
  struct stat there {};
  for (const auto& [place, facts] : {std::pair(folder, &here), std::pair(target, &there)}) {
    if (!fs::is_directory(place, error) || ::stat(place.c_str(), facts) != 0) {
      throw OutputError(fmt::format("{}: the folder that it is to be in does not exist", path.string()));
    }
    if (::access(place.c_str(), W_OK) != 0) {
      throw OutputError(
          fmt::format("{}: the folder {} cannot be written to: {}", path.string(), place.string(), file_error()));
    }
  }
  if (here.st_dev != there.st_dev) {
    throw OutputError(
        fmt::format("{}: is a link to {} on another file system, to which nothing can be renamed: name "
                    "that file itself",
                    path.string(), behind_links(path).string()));
  }
}

int open_own_file(const fs::path& path, int flags) {
  const auto refuse = [&](const char* what) {
    throw OutputError(fmt::format("{}: is {}, and is to be written: remove it", path.string(), what));
  };
  const auto require_regular = [&](const struct stat& file) {
    if (S_ISLNK(file.st_mode)) {
      refuse("a symbolic link");
    }
    if (!S_ISREG(file.st_mode)) {
      refuse(S_ISDIR(file.st_mode) ? "a folder" : "a device or a pipe");
    }
    if (file.st_nlink > 1) {
      refuse("one of several names of a file");
    }
  };
  struct stat file {};
  if (::lstat(path.c_str(), &file) == 0) {  // to open a device may be enough to set it going
    require_regular(file);
  }
  const int descriptor = ::open(path.c_str(), flags | O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    if (errno == ENOENT && (flags & O_CREAT) == 0) {
      return -1;
    }
    throw OutputError(fmt::format("{}: cannot be created: {}", path.string(), file_error()));
  }
  try {
    if (::fstat(descriptor, &file) != 0) {
      throw OutputError(fmt::format("{}: cannot be read: {}", path.string(), file_error()));
    }
    require_regular(file);
  } catch (const OutputError&) {
    ::close(descriptor);
    throw;
  }
  return descriptor;
}

std::shared_ptr<PartLock> PartLock::take(const fs::path& part) {
  static std::mutex one_at_a_time;
  static std::vector<std::weak_ptr<PartLock>> held;
  const std::lock_guard guard(one_at_a_time);
  std::erase_if(held, [](const std::weak_ptr<PartLock>& lock) { return lock.expired(); });
  for (const std::weak_ptr<PartLock>& other : held) {
    if (auto lock = other.lock(); lock && lock->is_at(part)) {
      return lock;
    }
  }
  while (true) {
    const std::shared_ptr<PartLock> lock(new PartLock(part, open_own_file(part, O_CREAT)));
    // Of the open file, not of the process: another thing that opens and closes the file here does not end it, and
    // HDF5, which asks for another kind of lock when it reads, is not kept from looking at a run under way.
    struct flock whole {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    if (::fcntl(lock->descriptor_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
      lock->foreign_ = true;
      throw OutputError(
          fmt::format("{}: another run is writing it: wait for it, stop it, or name another output", part.string()));
    }
    // Whoever held it may have renamed or removed it meanwhile.
    if (lock->is_at(part)) {
      held.push_back(lock);
      return lock;
    }
  }
}

PartLock::~PartLock() {
  struct stat file {};
  if (!foreign_ && ::fstat(descriptor_, &file) == 0 && file.st_size == 0 && is_at(part_)) {
    ::unlink(part_.c_str());
  }
  ::close(descriptor_);
}

bool PartLock::is_at(const fs::path& path) const {
  struct stat mine {};
  struct stat there {};
  return ::fstat(descriptor_, &mine) == 0 && ::lstat(path.c_str(), &there) == 0 && mine.st_dev == there.st_dev &&
         mine.st_ino == there.st_ino;
}

void PartLock::empty() const {
  if (::ftruncate(descriptor_, 0) != 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", part_.string(), file_error()));
  }
}

fs::path part_of(fs::path path) { return path += ".part"; }

OutputFile::OutputFile(fs::path path, bool overwrite) : path_(std::move(path)), partial_(part_of(path_)) {
  require_writable(path_, overwrite);
  lock_ = PartLock::take(partial_);
  require_writable(path_, overwrite);  // another run may have finished it before the lock was ours
  lock_->empty();
}

OutputFile::~OutputFile() {
  if (!done_ && !keep_) {
    std::error_code ignored;
    fs::remove(partial_, ignored);
  }
}

void OutputFile::commit() {
  TUNICA_ASSERT(!done_);
  flush_to_disk(partial_);
  if (std::rename(partial_.c_str(), behind_links(path_).c_str()) != 0) {
    keep_ = true;  // it is whole: the work is not lost with its name
    throw OutputError(fmt::format("{}: cannot be written: {}; the whole of it is in {}, rename that", path_.string(),
                                  file_error(), partial_.string()));
  }
  done_ = true;
}

void write_file(const fs::path& path, std::string_view bytes, bool overwrite) {
  OutputFile output(path, overwrite);
  OpenFile file(std::fopen(output.partial_path().c_str(), "wb"), &std::fclose);
  const bool written =
      file && std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size() && std::fflush(file.get()) == 0;
  if (!written) {
    throw OutputError(fmt::format("{}: cannot be written: {}", path.string(), file_error()));
  }
  file.reset();
  output.commit();
}

OpenFile open_input(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    throw InputError(fmt::format("{}: no such file", path.string()));
  }
  if (!fs::is_regular_file(status)) {
    throw InputError(fmt::format("{}: is not a regular file", path.string()));
  }
  OpenFile file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) {
    if (errno == EMFILE || errno == ENFILE) {
      // A limit of the machine, no fault of the file.
      throw Error(ExitCode::memory, fmt::format("{}: cannot be read: {}", path.string(), file_error()));
    }
    throw InputError(fmt::format("{}: cannot be read: {}", path.string(), file_error()));
  }
  return file;
}

std::string read_file(const fs::path& path, std::size_t limit) {
  const OpenFile file = open_input(path);
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error || size > limit) {
    throw InputError(fmt::format("{}: is too large ({} bytes, at most {})", path.string(), size, limit));
  }
  std::string bytes(narrow<std::size_t>(size), '\0');
  const std::size_t got = std::fread(bytes.data(), 1, bytes.size(), file.get());
  if (std::ferror(file.get()) != 0) {
    throw InputError(fmt::format("{}: cannot be read to its end: {}", path.string(), file_error()));
  }
  if (got != bytes.size()) {
    throw InputError(fmt::format("{}: became shorter while it was read: get the whole file again", path.string()));
  }
  return bytes;
}

std::string sha256_of_file(const fs::path& path) {
  const OpenFile file = open_input(path);
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  // OpenSSL fails at SHA-256 only where memory ends.
  bool has_memory = context && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1;
  std::vector<unsigned char> block(1 << 20);
  while (const std::size_t got = std::fread(block.data(), 1, block.size(), file.get())) {
    has_memory = has_memory && EVP_DigestUpdate(context.get(), block.data(), got) == 1;
  }
  if (std::ferror(file.get()) != 0) {
    throw InputError(fmt::format("{}: cannot be read: {}", path.string(), file_error()));
  }
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  if (!has_memory || EVP_DigestFinal_ex(context.get(), digest.data(), &length) != 1) {
    throw std::bad_alloc();
  }
  std::string text;
  for (unsigned i = 0; i < length; ++i) {
    text += fmt::format("{:02x}", digest[i]);
  }
  return text;
}

}  // namespace tunica
