#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

/// Small handles around the C interface of HDF5, for the .cpp files of this room only.
namespace tunica::hdf5 {

// The library's hid_t and hsize_t, so that its header stays out of this one.
using Id = std::int64_t;
using Size = unsigned long long;

/// Owns an identifier; closes it with the function that fits its kind.
class Handle {
public:
  Handle() = default;
  explicit Handle(Id id) : id_(id) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~Handle() { (void)close(); }

  [[nodiscard]] Id get() const { return id_; }
  /// False when closing, which writes what is pending, failed.
  bool close();

private:
  Id id_ = -1;
};

/// Writes one file. Every failure is an OutputError that names the file, but for lack of memory: std::bad_alloc.
class Writer {
public:
  /// Creates `path` without locking it.
  explicit Writer(const std::filesystem::path& path);

  [[nodiscard]] Id root() const { return file_.get(); }
  [[nodiscard]] Handle group(Id parent, const std::string& name) const;

  void attribute(Id object, const char* name, Id type, const std::vector<Size>& shape, const void* values) const;
  /// Fixed-length ASCII: VTK reads no other string.
  void ascii_attribute(Id object, const char* name, const std::string& text) const;

  /// A whole data set. `rewritten`: contiguous, so that writing it again moves nothing else in the file.
  Handle dataset(Id parent, const std::string& name, Id type, const std::vector<Size>& shape, const void* values,
                 bool rewritten = false) const;
  /// Fixed-length UTF-8.
  void text(Id parent, const std::string& name, const std::string& text) const;
  void texts(Id parent, const std::string& name, const std::vector<std::string>& texts) const;

  /// What a data set holds: attributes `units` and `description`.
  void describe(const std::string& path, const std::string& units, const std::string& description) const;

  void rewrite(const Handle& dataset, Id type, const void* values) const;

  /// Hands everything to the operating system: it survives the end of this process.
  void flush() const;
  /// Closes the file and everything that is open in it; what is left of other handles is void.
  void close();

  /// Throws when `result` is negative.
  void check(int result, const std::string& doing) const;
  Handle own(Id id, const std::string& doing) const;

private:
  std::string name_;
  Handle file_;
};

/// A data set that grows along its first dimension.
class Series {
public:
  Series() = default;
  /// @param row_shape  shape of one row; `rows_per_chunk`: how much is stored together; `compressed`: shuffle and gzip
  Series(const Writer& writer, Id parent, const std::string& name, Id type, const std::vector<Size>& row_shape,
         Size rows_per_chunk, bool compressed);

  void append(const Writer& writer, Size rows, const void* values);
  [[nodiscard]] Size rows() const { return shape_.empty() ? 0 : shape_[0]; }

private:
  Handle dataset_;
  Id type_ = -1;
  std::vector<Size> shape_;
};

}  // namespace tunica::hdf5
