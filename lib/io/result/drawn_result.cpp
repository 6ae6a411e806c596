#include "tunica/io/result/drawn_result.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/detail/hdf5_chunks.hpp"
#include "tunica/io/result/detail/hdf5_trial.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace tunica {
namespace {

constexpr std::size_t most_numbers = 200'000'000;  // in one reading: what a page cannot show, and damaged files claim
constexpr std::size_t most_text = std::size_t{16} << 20;

// What is read of a result.
constexpr std::array datasets{"VTKHDF/Connectivity",
                              "VTKHDF/PointData/displacement",
                              "VTKHDF/PointData/membrane_stress",
                              "VTKHDF/PointData/von_mises",
                              "VTKHDF/Points",
                              "VTKHDF/Types",
                              "tunica/elements/nodes",
                              "tunica/elements/normals",
                              "tunica/elements/patch",
                              "tunica/history/load_factor",
                              "tunica/history/time",
                              "tunica/nodes/displacement",
                              "tunica/nodes/membrane_stress",
                              "tunica/nodes/position",
                              "tunica/nodes/rotation",
                              "tunica/nodes/von_mises",
                              "tunica/scene"};

/// One file, of which every failure is an InputError that names it.
class Reader {
public:
  explicit Reader(const std::filesystem::path& path) : name_(path.string()) {
    (void)open_input(path);  // HDF5 would wait on a pipe
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    if (!hdf5::opens_without_fault(path, datasets)) {
      fail("is damaged: HDF5 fails on it");
    }
    file_ = hdf5::opened_for_reading(path);
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
    if (whole.empty() || first > whole[0] || count > whole[0] - first) {
      fail(dataset + " has no shape of a result");
    }
    std::vector<hdf5::Size> start(whole.size(), 0), extent(whole.begin(), whole.end());
    start[0] = first;
    extent[0] = count;
    std::size_t numbers = count;
    for (std::size_t k = 1; k < whole.size(); ++k) {
      if (whole[k] == 0 || numbers > most_numbers / whole[k]) {
        fail(dataset + " is too large to be drawn, or empty");
      }
      numbers *= whole[k];
    }
    if (numbers > most_numbers) {
      fail(dataset + " is too large to be drawn");
    }
    const hdf5::Handle data = open(dataset);
    const hdf5::Handle stored(H5Dget_type(data.get()));
    hdf5::Size bytes = 0;
    (void)H5Fget_filesize(file_.get(), &bytes);
    if (real(numbers) * real(H5Tget_size(stored.get())) > deflate_expansion * real(bytes)) {
      fail(dataset + " claims more than the file can hold");
    }
    if (numbers > 0 && !hdf5::chunks_are_whole(data, start, extent)) {
      fail(dataset + " has chunks of another size, or of other filters than tunica-simulate writes: write it again");
    }
    const hdf5::Handle space(H5Dget_space(data.get()));
    const hdf5::Handle memory(H5Screate_simple(narrow<int>(extent.size()), extent.data(), nullptr));
    std::vector<Number> values(numbers);
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
        !shape(dataset).empty() || !hdf5::chunks_are_whole(data, {}, {})) {
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
    TUNICA_ASSERT(std::ranges::find(datasets, dataset) != datasets.end());  // or its fault would be this process's
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

/// Corners of cells [first, first + count) of so many corners, which lie one after the other from `begin` on.
template <std::size_t Corners>
std::vector<std::array<Index, Corners>> read_cells(const Reader& reader, std::size_t begin, std::size_t count,
                                                   std::size_t points) {
  const auto corners = reader.rows<std::int64_t>("VTKHDF/Connectivity", begin, Corners * count);
  std::vector<std::array<Index, Corners>> cells(count);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (corners[i] < 0 || narrow<std::size_t>(corners[i]) >= points) {
      reader.fail("VTKHDF/Connectivity names a point that is not there");
    }
    cells[i / Corners][i % Corners] = narrow<Index>(corners[i]);
  }
  return cells;
}

/// The outer faces of the solids, with the points of the grid that they have.
struct OuterFaces {
  TriangleMesh mesh;
  std::vector<Index> points;  ///< #V
};

OuterFaces outer_faces(const TetMesh& solids) {
  OuterFaces outer;
  outer.mesh.triangles = boundary_triangles(solids);
  std::vector<Index> number(solids.vertices.size(), narrow<Index>(max_index));
  for (auto& triangle : outer.mesh.triangles) {
    for (Index& v : triangle) {
      if (number[v] == max_index) {
        number[v] = narrow<Index>(outer.points.size());
        outer.points.push_back(v);
        outer.mesh.vertices.push_back(solids.vertices[v]);
      }
      v = number[v];
    }
  }
  return outer;
}

// The triangles of the shells, which come before the solids' tetrahedra. @return of these the outer faces
OuterFaces read_geometry(const Reader& reader, DrawnResult& result) {
  result.reference.vertices = vectors_of(reader, reader.all<double>("VTKHDF/Points"));
  const std::size_t points = result.reference.vertices.size();
  const auto types = reader.all<std::int64_t>("VTKHDF/Types");
  const auto count =
      narrow<std::size_t>(std::ranges::find_if(types, [](auto type) { return type != 5; }) - types.begin());
  result.reference.triangles = read_cells<3>(reader, 0, count, points);
  const auto shells =
      reader.has("tunica/elements/nodes") ? reader.shape("tunica/elements/nodes") : std::vector<std::size_t>();
  result.shells = shells.empty() ? 0 : shells[0];
  if (points == 0 || result.reference.triangles.empty()) {
    reader.fail("has no shells to draw");
  }
  const TetMesh solids{result.reference.vertices, read_cells<4>(reader, 3 * count, types.size() - count, points)};
  OuterFaces outer = outer_faces(solids);
  result.solids = outer.mesh;
  return outer;
}

void take_solids(const std::vector<Vec3>& displacement, const OuterFaces& outer, DrawnResult::State& state) {
  for (const Index point : outer.points) {
    state.of_solids.push_back(displacement[point]);
  }
}

/// What the grid says of a state. @param row  of its rows, not of the states
DrawnResult::State read_state(const Reader& reader, std::size_t points, const OuterFaces& outer, std::size_t row) {
  DrawnResult::State state;
  state.displacement = vectors_of(reader, reader.rows<double>("VTKHDF/PointData/displacement", row * points, points));
  state.membrane = reader.rows<double>("VTKHDF/PointData/membrane_stress", row * points, points);
  state.von_mises = reader.rows<double>("VTKHDF/PointData/von_mises", row * points, points);
  if (state.displacement.size() != points || state.membrane.size() != points || state.von_mises.size() != points) {
    reader.fail("VTKHDF/PointData has not one value per point");
  }
  take_solids(state.displacement, outer, state);
  return state;
}

/// The states of a static run, of which the grid has the last alone, from what the nodes have.
class StatesOfNodes {
public:
  StatesOfNodes(const Reader& reader, const DrawnResult& drawn, const OuterFaces& outer)
      : reader_(reader), outer_(outer), points_(drawn.reference.vertices.size()) {
    ShellBody& body = model_.shells.emplace_back();
    ShellMesh& mesh = body.mesh;
    mesh.vertices = vectors_of(reader, reader.all<double>("tunica/nodes/position"));
    const auto corners = reader.all<std::int64_t>("tunica/elements/nodes");
    if (corners.size() != 3 * drawn.shells || points_ < mesh.vertices.size()) {
      reader.fail("its shells are not those that are drawn");
    }
    mesh.triangles.resize(drawn.shells);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      if (corners[i] < 0 || narrow<std::size_t>(corners[i]) >= mesh.vertices.size()) {
        reader.fail("tunica/elements/nodes names a node that is not there");
      }
      mesh.triangles[i / 3][i % 3] = narrow<Index>(corners[i]);
    }
    take_normals();
    find_points(drawn);
  }

  [[nodiscard]] DrawnResult::State operator()(std::size_t number, bool linear) const {
    State moved;
    moved.linear = linear;
    moved.displacement = vectors_of(reader_, reader_.rows<double>("tunica/nodes/displacement", number, 1));
    moved.rotation = vectors_of(reader_, reader_.rows<double>("tunica/nodes/rotation", number, 1));
    const std::size_t nodes = model_.node_count();
    if (moved.displacement.size() != nodes || moved.rotation.size() != nodes) {
      reader_.fail("tunica/nodes has not one value per node");
    }
    const std::vector<double> membrane = reader_.rows<double>("tunica/nodes/membrane_stress", number, 1);
    const std::vector<double> faces = reader_.rows<double>("tunica/nodes/von_mises", number, 1);
    if (membrane.size() != nodes || faces.size() != nodes) {
      reader_.fail("tunica/nodes has not one value per node");
    }
    DrawnResult::State state;
    state.displacement.assign(points_, Vec3::Zero());
    state.membrane.assign(points_, 0);
    state.von_mises.assign(points_, 0);
    const std::vector<Vec3> drawn = curved_displacement(model_, 0, moved, surface_);
    for (std::size_t v = 0; v < point_.size(); ++v) {
      state.displacement[point_[v]] = drawn[v];
      const auto& corners = model_.shells[0].mesh.triangles[surface_.vertex_shell[v]];
      const Vec2& b = surface_.barycentric[v];
      const auto at = [&](const std::vector<double>& of_nodes) {
        return (1 - b.x() - b.y()) * of_nodes[corners[0]] + b.x() * of_nodes[corners[1]] + b.y() * of_nodes[corners[2]];
      };
      state.membrane[point_[v]] = at(membrane);
      state.von_mises[point_[v]] = at(faces);
    }
    // The nodes of solids are the last, of the grid's points and of all nodes.
    for (const Index point : outer_.points) {
      if (point + nodes < points_) {
        reader_.fail("its solids are not those that are drawn");
      }
      state.of_solids.push_back(moved.displacement[point + nodes - points_]);
    }
    return state;
  }

private:
  void take_normals() {
    ShellMesh& mesh = model_.shells[0].mesh;
    const std::vector<Vec3> normals = vectors_of(reader_, reader_.all<double>("tunica/elements/normals"));
    const auto patches = reader_.all<std::int64_t>("tunica/elements/patch");
    if (normals.size() != 3 * mesh.triangles.size() || patches.size() != mesh.triangles.size()) {
      reader_.fail("tunica/elements has not one row per shell");
    }
    mesh.patch =
        !patches.empty() && patches[0] == static_cast<int>(Patch::watertight) ? Patch::watertight : Patch::comas;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      mesh.corner_normals.push_back({normals[3 * t], normals[3 * t + 1], normals[3 * t + 2]});
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (!(normal_agreement(mesh, t) >= least_normal_agreement)) {
        reader_.fail("tunica/elements/normals make no curved surface");
      }
    }
  }

  /// The grid's point at each vertex of the shells as they are cut.
  void find_points(const DrawnResult& drawn) {
    const ShellMesh& mesh = model_.shells[0].mesh;
    const std::size_t pieces = drawn.reference.triangles.size() / std::max<std::size_t>(drawn.shells, 1);
    const int level = truncated<int>(std::clamp(std::round(std::sqrt(real(pieces))), 1.0, 64.0));
    if (narrow<std::size_t>(level * level) * drawn.shells != drawn.reference.triangles.size()) {
      reader_.fail("its shells are not those that are drawn");
    }
    surface_ = tessellate_uniformly(mesh, level);
    point_.resize(surface_.mesh.vertices.size());
    for (std::size_t t = 0; t < surface_.mesh.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        point_[surface_.mesh.triangles[t][k]] = drawn.reference.triangles[t][k];
      }
    }
  }

  const Reader& reader_;
  const OuterFaces& outer_;
  std::size_t points_;
  Model model_;
  Tessellation surface_;
  std::vector<Index> point_;  // #V of the surface
};

/// Whether a line of a resolved scene begins so. No name of a body holds the end of a line.
bool says(const std::string& scene, const std::string& line) { return scene.find("\n" + line) != std::string::npos; }

DrawnResult::Kind kind_of(const std::string& scene, bool has_steps) {
  using enum DrawnResult::Kind;
  return !has_steps                                ? statics
         : says(scene, "kind = \"frequencies\"")   ? frequencies
         : says(scene, "kind = \"buckling\"")      ? buckling
         : says(scene, "control = \"arc-length\"") ? path
                                                   : motion;
}

}  // namespace

DrawnResult read_drawn_result(const std::filesystem::path& path, std::size_t most_states) {
  TUNICA_ASSERT(most_states >= 2);
  const Reader reader(path);
  DrawnResult result;
  result.scene = reader.text("tunica/scene");
  result.is_unloaded = says(result.scene, "unload = true");
  const OuterFaces outer = read_geometry(reader, result);
  const std::size_t points = result.reference.vertices.size();
  const auto displacements = reader.shape("VTKHDF/PointData/displacement");
  const std::size_t drawn = displacements.empty() ? 0 : displacements[0] / points;
  const auto times = reader.all<double>("tunica/history/time");
  const auto factors = reader.all<double>("tunica/history/load_factor");
  if (drawn == 0 || times.empty() || factors.size() != times.size()) {
    reader.fail("holds no state");
  }
  const bool has_steps = reader.has("VTKHDF/Steps");
  result.kind = kind_of(result.scene, has_steps);
  const std::size_t there = has_steps ? std::min(drawn, times.size()) : times.size();
  const std::size_t chosen = std::min(there, most_states);
  std::optional<StatesOfNodes> of_nodes;
  for (std::size_t i = 0; i < chosen; ++i) {
    const std::size_t number = chosen > 1 ? i * (there - 1) / (chosen - 1) : 0;
    if (has_steps || number + 1 == there) {
      result.states.push_back(read_state(reader, points, outer, has_steps ? number : 0));
    } else {
      if (!of_nodes) {
        of_nodes.emplace(reader, result, outer);
      }
      result.states.push_back((*of_nodes)(number, says(result.scene, "geometry = \"linear\"")));
    }
    result.states.back().number = number;
    result.states.back().time = times[number];
    result.states.back().load_factor = factors[number];
  }
  return result;
}

}  // namespace tunica
