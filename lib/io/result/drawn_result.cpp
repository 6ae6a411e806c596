#include "tunica/io/result/drawn_result.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/result/detail/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tunica {
namespace {

constexpr std::size_t most_numbers = 200'000'000;  // in one reading: what a page cannot show, and damaged files claim
constexpr std::size_t most_text = std::size_t{16} << 20;

/// One file, of which every failure is an InputError that names it.
class Reader {
public:
  explicit Reader(const std::filesystem::path& path) : name_(path.string()) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    const hdf5::Handle access(H5Pcreate(H5P_FILE_ACCESS));
    (void)H5Pset_file_locking(access.get(), 0, 1);
    file_ = hdf5::Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()));
    if (file_.get() < 0) {
      fail("cannot be read as HDF5");
    }
  }

  [[noreturn]] void fail(const std::string& why) const { throw InputError(name_ + ": " + why); }

  [[nodiscard]] bool has(const std::string& dataset) const {
    // Every group on the way has to be there before the last name may be asked for.
    for (std::size_t slash = dataset.find('/');; slash = dataset.find('/', slash + 1)) {
      if (H5Lexists(file_.get(), dataset.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) {
        return false;
      }
      if (slash == std::string::npos) {
        return true;
      }
    }
  }

  [[nodiscard]] std::vector<std::size_t> shape(const std::string& dataset) const {
    const hdf5::Handle data = open(dataset);
    const hdf5::Handle space(H5Dget_space(data.get()));
    const int rank = H5Sget_simple_extent_ndims(space.get());
    if (rank < 0 || rank > 4) {
      fail(dataset + " has no shape of a result");
    }
    std::vector<hsize_t> extents(narrow<std::size_t>(rank));
    (void)H5Sget_simple_extent_dims(space.get(), extents.data(), nullptr);
    return {extents.begin(), extents.end()};
  }

  /// Rows [first, first + count) of a data set of numbers.
  template <typename Number>
  [[nodiscard]] std::vector<Number> rows(const std::string& dataset, std::size_t first, std::size_t count) const {
    const std::vector<std::size_t> whole = shape(dataset);
    const std::size_t width = whole.size() == 2 ? whole[1] : 1;
    if (whole.empty() || whole.size() > 2 || first > whole[0] || count > whole[0] - first || width == 0 || width > 9) {
      fail(dataset + " has no shape of a result");
    }
    if (count > most_numbers / width) {
      fail(dataset + " is too large to be drawn");
    }
    const hdf5::Handle data = open(dataset);
    const hdf5::Handle space(H5Dget_space(data.get()));
    const std::array<hsize_t, 2> start{first, 0};
    const std::array<hsize_t, 2> extent{count, width};
    const hdf5::Handle memory(H5Screate_simple(narrow<int>(whole.size()), extent.data(), nullptr));
    std::vector<Number> values(count * width);
    const hid_t type = std::is_floating_point_v<Number> ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT64;
    if (H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr) < 0 ||
        H5Dread(data.get(), type, memory.get(), space.get(), H5P_DEFAULT, values.data()) < 0) {
      fail(dataset + " cannot be read: the file is damaged");
    }
    return values;
  }

  template <typename Number>
  [[nodiscard]] std::vector<Number> all(const std::string& dataset) const {
    const std::vector<std::size_t> whole = shape(dataset);
    return rows<Number>(dataset, 0, whole.empty() ? 0 : whole[0]);
  }

  /// Of a fixed-length text; empty where it is none.
  [[nodiscard]] std::string text(const std::string& dataset) const {
    if (!has(dataset)) {
      return {};
    }
    const hdf5::Handle data = open(dataset);
    const hdf5::Handle type(H5Dget_type(data.get()));
    const std::size_t size = H5Tget_size(type.get());
    if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) != 0 || size > most_text ||
        !shape(dataset).empty()) {
      return {};
    }
    std::string value(size, '\0');
    if (H5Dread(data.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()) < 0) {
      return {};
    }
    return value.substr(0, value.find('\0'));
  }

private:
  [[nodiscard]] hdf5::Handle open(const std::string& dataset) const {
    hdf5::Handle data(has(dataset) ? H5Dopen2(file_.get(), dataset.c_str(), H5P_DEFAULT) : -1);
    if (data.get() < 0) {
      fail("has no " + dataset + ": it is not a result of tunica-simulate");
    }
    return data;
  }

  std::string name_;
  hdf5::Handle file_;
};

std::vector<Vec3> vectors_of(const Reader& reader, const std::vector<double>& numbers) {
  std::vector<Vec3> vectors(numbers.size() / 3);
  for (std::size_t i = 0; i < 3 * vectors.size(); ++i) {
    if (!std::isfinite(numbers[i]) || std::abs(numbers[i]) > 1e12) {
      reader.fail("holds coordinates that are no finite numbers");
    }
    vectors[i / 3][narrow<Eigen::Index>(i % 3)] = numbers[i];
  }
  return vectors;
}

// The triangles of the shells, which come before the solids' tetrahedra.
void read_triangles(const Reader& reader, DrawnResult& result) {
  const auto types = reader.all<std::int64_t>("VTKHDF/Types");
  const auto count =
      narrow<std::size_t>(std::ranges::find_if(types, [](auto type) { return type != 5; }) - types.begin());
  const auto corners = reader.rows<std::int64_t>("VTKHDF/Connectivity", 0, 3 * count);
  const std::size_t points = result.reference.vertices.size();
  result.reference.triangles.resize(count);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (corners[i] < 0 || narrow<std::size_t>(corners[i]) >= points) {
      reader.fail("VTKHDF/Connectivity names a point that is not there");
    }
    result.reference.triangles[i / 3][i % 3] = narrow<Index>(corners[i]);
  }
}

DrawnResult::State read_state(const Reader& reader, std::size_t points, std::size_t row) {
  DrawnResult::State state;
  state.displacement = vectors_of(reader, reader.rows<double>("VTKHDF/PointData/displacement", row * points, points));
  state.von_mises = reader.rows<double>("VTKHDF/PointData/von_mises", row * points, points);
  if (state.displacement.size() != points || state.von_mises.size() != points) {
    reader.fail("VTKHDF/PointData has not one value per point");
  }
  return state;
}

}  // namespace

DrawnResult read_drawn_result(const std::filesystem::path& path, std::size_t most_states) {
  TUNICA_ASSERT(most_states >= 2);
  const Reader reader(path);
  DrawnResult result;
  result.scene = reader.text("tunica/scene");
  result.reference.vertices = vectors_of(reader, reader.all<double>("VTKHDF/Points"));
  const std::size_t points = result.reference.vertices.size();
  read_triangles(reader, result);
  const auto shells = reader.shape("tunica/elements/nodes");
  result.shells = shells.empty() ? 0 : shells[0];
  if (points == 0 || result.reference.triangles.empty()) {
    reader.fail("has no shells to draw");
  }
  const auto displacements = reader.shape("VTKHDF/PointData/displacement");
  const std::size_t written = displacements.empty() ? 0 : displacements[0] / points;
  const auto times = reader.all<double>("tunica/history/time");
  if (written == 0 || times.empty()) {
    reader.fail("holds no state");
  }
  result.timed = reader.has("VTKHDF/Steps");
  if (!result.timed) {
    result.states = {{0, std::vector<Vec3>(points, Vec3::Zero()), std::vector<double>(points, 0)},
                     read_state(reader, points, 0)};
    result.states.back().time = times.back();
    return result;
  }
  const std::size_t there = std::min(written, times.size());
  const std::size_t chosen = std::min(there, most_states);
  for (std::size_t i = 0; i < chosen; ++i) {
    const std::size_t row = chosen > 1 ? i * (there - 1) / (chosen - 1) : 0;
    result.states.push_back(read_state(reader, points, row));
    result.states.back().time = times[row];
  }
  return result;
}

}  // namespace tunica
