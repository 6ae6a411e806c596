#include "tunica/io/result/detail/hdf5_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <new>
#include <numeric>

namespace tunica::hdf5 {
namespace {

static_assert(std::is_same_v<Id, hid_t> && std::is_same_v<Size, hsize_t>);

// Enough for a smooth field; more costs time and gains little.
constexpr unsigned gzip_level = 1;
constexpr Size most_chunk_bytes = Size{4} << 20;

// After a write that failed (a full disk), HDF5 1.10 crashes when it closes what it could not flush, also at exit. Then
// nothing more is asked of it: what was flushed before is whole, and the process is about to end with an error.
bool library_failed = false;

Size count_of(const std::vector<Size>& shape) {
  return std::accumulate(shape.begin(), shape.end(), Size{1}, std::multiplies<>());
}

}  // namespace

bool Handle::close() {
  const Id id = std::exchange(id_, -1);
  if (id < 0) {
    return true;
  }
  if (library_failed) {
    return false;
  }
  switch (H5Iget_type(id)) {
    case H5I_FILE:
      return H5Fclose(id) >= 0;
    case H5I_GROUP:
      return H5Gclose(id) >= 0;
    case H5I_DATATYPE:
      return H5Tclose(id) >= 0;
    case H5I_DATASPACE:
      return H5Sclose(id) >= 0;
    case H5I_DATASET:
      return H5Dclose(id) >= 0;
    case H5I_ATTR:
      return H5Aclose(id) >= 0;
    default:
      return H5Pclose(id) >= 0;
  }
}

Writer::Writer(const std::filesystem::path& path) : name_(path.string()) {
  // Errors become exceptions; the library's own account of them is not for users.
  (void)H5dont_atexit();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  errno = 0;
  const Handle access = own(H5Pcreate(H5P_FILE_ACCESS), "created");
  check(H5Pset_file_locking(access.get(), 0, 1), "created");
  check(H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG), "created");
  file_ = own(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), "created");
}

void Writer::check(int result, const std::string& doing) const {
  if (result < 0) {
    library_failed = true;
    if (errno == ENOMEM) {
      throw std::bad_alloc();
    }
    const std::string why = errno != 0 ? fmt::format(": {}", std::strerror(errno)) : std::string();
    throw OutputError(fmt::format("{}: cannot be {}{}", name_, doing, why));
  }
}

Handle Writer::own(Id id, const std::string& doing) const {
  check(id < 0 ? -1 : 0, doing);
  return Handle(id);
}

Handle Writer::group(Id parent, const std::string& name) const {
  errno = 0;
  const Handle link = own(H5Pcreate(H5P_LINK_CREATE), "written");
  check(H5Pset_char_encoding(link.get(), H5T_CSET_UTF8), "written");
  return own(H5Gcreate2(parent, name.c_str(), link.get(), H5P_DEFAULT, H5P_DEFAULT), "written");
}

void Writer::attribute(Id object, const char* name, Id type, const std::vector<Size>& shape, const void* values) const {
  const Handle space = shape.empty()
                           ? own(H5Screate(H5S_SCALAR), "written")
                           : own(H5Screate_simple(narrow<int>(shape.size()), shape.data(), nullptr), "written");
  const Handle attribute = own(H5Acreate2(object, name, type, space.get(), H5P_DEFAULT, H5P_DEFAULT), "written");
  check(H5Awrite(attribute.get(), type, values), "written");
}

void Writer::ascii_attribute(Id object, const char* name, const std::string& text) const {
  const Handle type = own(H5Tcopy(H5T_C_S1), "written");
  check(H5Tset_size(type.get(), text.size()), "written");
  check(H5Tset_strpad(type.get(), H5T_STR_NULLPAD), "written");
  attribute(object, name, type.get(), {}, text.data());
}

void Writer::describe(const std::string& path, const std::string& units, const std::string& description) const {
  const Handle dataset = own(H5Dopen2(root(), path.c_str(), H5P_DEFAULT), "written");
  ascii_attribute(dataset.get(), "units", units);
  ascii_attribute(dataset.get(), "description", description);
}

Handle Writer::dataset(Id parent, const std::string& name, Id type, const std::vector<Size>& shape, const void* values,
                       bool rewritten) const {
  errno = 0;
  const Handle space = shape.empty()
                           ? own(H5Screate(H5S_SCALAR), "written")
                           : own(H5Screate_simple(narrow<int>(shape.size()), shape.data(), nullptr), "written");
  const Handle creation = own(H5Pcreate(H5P_DATASET_CREATE), "written");
  check(H5Pset_obj_track_times(creation.get(), 0), "written");  // the same run makes the same bytes
  if (!rewritten && !shape.empty() && count_of(shape) >= 1024) {
    const Size row_bytes = H5Tget_size(type) * count_of({shape.begin() + 1, shape.end()});
    std::vector<Size> chunk = shape;
    chunk[0] = std::clamp<Size>(most_chunk_bytes / row_bytes, 1, shape[0]);
    check(H5Pset_chunk(creation.get(), narrow<int>(chunk.size()), chunk.data()), "written");
    check(H5Pset_shuffle(creation.get()), "written");
    check(H5Pset_deflate(creation.get(), gzip_level), "written");
  } else {
    check(H5Pset_alloc_time(creation.get(), H5D_ALLOC_TIME_EARLY), "written");
  }
  Handle dataset =
      own(H5Dcreate2(parent, name.c_str(), type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT), "written");
  if (values != nullptr) {
    check(H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), "written");
  }
  return dataset;
}

void Writer::text(Id parent, const std::string& name, const std::string& text) const {
  const Handle type = own(H5Tcopy(H5T_C_S1), "written");
  check(H5Tset_size(type.get(), std::max<std::size_t>(1, text.size())), "written");
  check(H5Tset_strpad(type.get(), H5T_STR_NULLPAD), "written");
  check(H5Tset_cset(type.get(), H5T_CSET_UTF8), "written");
  (void)dataset(parent, name, type.get(), {}, text.c_str());
}

void Writer::texts(Id parent, const std::string& name, const std::vector<std::string>& texts) const {
  std::size_t longest = 1;
  for (const std::string& text : texts) {
    longest = std::max(longest, text.size());
  }
  std::string bytes;
  for (const std::string& text : texts) {
    bytes += text + std::string(longest - text.size(), '\0');
  }
  const Handle type = own(H5Tcopy(H5T_C_S1), "written");
  check(H5Tset_size(type.get(), longest), "written");
  check(H5Tset_strpad(type.get(), H5T_STR_NULLPAD), "written");
  check(H5Tset_cset(type.get(), H5T_CSET_UTF8), "written");
  (void)dataset(parent, name, type.get(), {texts.size()}, texts.empty() ? nullptr : bytes.data());
}

void Writer::rewrite(const Handle& dataset, Id type, const void* values) const {
  errno = 0;
  check(H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), "written");
}

void Writer::flush() const {
  errno = 0;
  check(H5Fflush(file_.get(), H5F_SCOPE_GLOBAL), "written");
}

void Writer::close() {
  errno = 0;
  check(file_.close() ? 0 : -1, "written");
}

Series::Series(const Writer& writer, Id parent, const std::string& name, Id type, const std::vector<Size>& row_shape,
               Size rows_per_chunk, bool compressed)
    : type_(type), shape_{0} {
  shape_.insert(shape_.end(), row_shape.begin(), row_shape.end());
  std::vector<Size> most = shape_;
  most[0] = H5S_UNLIMITED;
  std::vector<Size> chunk = shape_;
  chunk[0] = std::max<Size>(1, rows_per_chunk);
  for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
    const Size bytes = count_of(chunk) * H5Tget_size(type);
    if (bytes > most_chunk_bytes) {
      const Size rest = bytes / chunk[axis];
      chunk[axis] = std::max<Size>(1, most_chunk_bytes / rest);
    }
  }
  const int rank = narrow<int>(shape_.size());
  const Handle space = writer.own(H5Screate_simple(rank, shape_.data(), most.data()), "written");
  const Handle creation = writer.own(H5Pcreate(H5P_DATASET_CREATE), "written");
  writer.check(H5Pset_obj_track_times(creation.get(), 0), "written");
  writer.check(H5Pset_chunk(creation.get(), rank, chunk.data()), "written");
  if (compressed) {
    writer.check(H5Pset_shuffle(creation.get()), "written");
    writer.check(H5Pset_deflate(creation.get(), gzip_level), "written");
  }
  dataset_ = writer.own(H5Dcreate2(parent, name.c_str(), type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
                        "written");
}

void Series::append(const Writer& writer, Size rows, const void* values) {
  errno = 0;
  std::vector<Size> start(shape_.size(), 0);
  start[0] = shape_[0];
  std::vector<Size> count = shape_;
  count[0] = rows;
  shape_[0] += rows;
  writer.check(H5Dset_extent(dataset_.get(), shape_.data()), "written");
  const Handle target = writer.own(H5Dget_space(dataset_.get()), "written");
  writer.check(H5Sselect_hyperslab(target.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
               "written");
  const Handle source = writer.own(H5Screate_simple(narrow<int>(count.size()), count.data(), nullptr), "written");
  writer.check(H5Dwrite(dataset_.get(), type_, source.get(), target.get(), H5P_DEFAULT, values), "written");
}

}  // namespace tunica::hdf5
