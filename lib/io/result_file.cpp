#include "io/result_file.hpp"

#include "core/error.hpp"
#include "core/version.hpp"
#include "io/hdf5_file.hpp"
#include "io/output_file.hpp"
#include "mechanics/curved_displacement.hpp"
#include "shell/curved_surface.hpp"

#include <hdf5.h>

#include <algorithm>
#include <limits>
#include <optional>

namespace tunica {
namespace {

using hdf5::Handle;
using hdf5::Series;
using hdf5::Size;
using hdf5::Writer;

constexpr unsigned char vtk_triangle = 5;
constexpr std::size_t most_fine_triangles = 200'000;
constexpr int finest_level = 4;
constexpr Size history_chunk = 256;
constexpr Size nodes_chunk_rows = 1;

using Floats = std::vector<float>;

void add(Floats& values, const Vec3& v) {
  for (int axis = 0; axis < 3; ++axis) {
    values.push_back(static_cast<float>(v[axis]));
  }
}

std::vector<double> flattened(const std::vector<Vec3>& vectors) {
  std::vector<double> values;
  values.reserve(3 * vectors.size());
  for (const Vec3& v : vectors) {
    values.insert(values.end(), v.data(), v.data() + 3);
  }
  return values;
}

// The curved surfaces of all bodies, as one grid.
struct Grid {
  std::vector<Tessellation> bodies;
  std::size_t points = 0;
  std::size_t cells = 0;

  explicit Grid(const Model& model) {
    std::size_t shells = 0;
    for (const ShellBody& body : model.shells) {
      shells += body.mesh.triangles.size();
    }
    const int level = drawing_level(shells);
    for (const ShellBody& body : model.shells) {
      bodies.push_back(tessellate_uniformly(body.mesh, level));
      points += bodies.back().mesh.vertices.size();
      cells += bodies.back().mesh.triangles.size();
    }
  }
};

double thickness_at(const ShellBody& body, Index triangle, const Vec2& b) {
  if (body.thickness.size() == 1) {
    return body.thickness.front();
  }
  const auto& corners = body.mesh.triangles[triangle];
  return (1 - b.x() - b.y()) * body.thickness[corners[0]] + b.x() * body.thickness[corners[1]] +
         b.y() * body.thickness[corners[2]];
}

// A field of the grid: in a series it grows and its offset is noted per state, else the one state is written again.
class Field {
public:
  Field() = default;
  Field(const Writer& writer, hid_t group, hid_t offsets, const std::string& name, Size rows, Size components,
        bool series)
      : rows_(rows) {
    const std::vector<Size> row = components == 1 ? std::vector<Size>{} : std::vector<Size>{components};
    if (series) {
      values_ = Series(writer, group, name, H5T_NATIVE_FLOAT, row, rows, true);
      offsets_ = Series(writer, offsets, name, H5T_NATIVE_INT64, {}, history_chunk, false);
    } else {
      std::vector<Size> shape{rows};
      shape.insert(shape.end(), row.begin(), row.end());
      only_ = writer.dataset(group, name, H5T_NATIVE_FLOAT, shape, nullptr, true);
    }
  }

  void put(const Writer& writer, const Floats& values) {
    if (!values_) {
      writer.rewrite(only_, H5T_NATIVE_FLOAT, values.data());
      return;
    }
    const auto offset = static_cast<std::int64_t>(values_->rows());
    values_->append(writer, rows_, values.data());
    offsets_->append(writer, 1, &offset);
  }

private:
  Size rows_ = 0;
  std::optional<Series> values_;
  std::optional<Series> offsets_;
  Handle only_;
};

// A field that no state changes: written once, the offset of every state is 0.
class FixedField {
public:
  FixedField(const Writer& writer, hid_t group, hid_t offsets, const std::string& name, hid_t type,
             const std::vector<Size>& shape, const void* values, bool series) {
    (void)writer.dataset(group, name, type, shape, values);
    if (series) {
      offsets_ = Series(writer, offsets, name, H5T_NATIVE_INT64, {}, history_chunk, false);
    }
  }

  void put(const Writer& writer) {
    if (offsets_) {
      constexpr std::int64_t zero = 0;
      offsets_->append(writer, 1, &zero);
    }
  }

private:
  std::optional<Series> offsets_;
};

struct ProbeSeries {
  std::size_t node = 0;
  Series displacement;
  Series rotation;
};

}  // namespace

int drawing_level(std::size_t shells) {
  int level = finest_level;
  while (level > 1 && shells * static_cast<std::size_t>(level * level) > most_fine_triangles) {
    --level;
  }
  return level;
}

struct ResultFile::Implementation {
  Implementation(const std::filesystem::path& path, const Model& the_model, const ResultOptions& options)
      : model(the_model),
        series(options.series),
        output(path, options.overwrite),
        grid(the_model),
        writer(output.partial_path()) {
    write_about(options);
    write_grid();
    make_fields();
    make_history();
    writer.flush();
  }

  void write_about(const ResultOptions& options) {
    tunica_group = writer.group(writer.root(), "tunica");
    writer.text(tunica_group.get(), "scene", options.scene);
    writer.text(tunica_group.get(), "command", options.command);
    writer.text(tunica_group.get(), "version", version);
    const Handle inputs = writer.group(tunica_group.get(), "inputs");
    std::vector<std::string> paths;
    std::vector<std::string> hashes;
    for (const auto& [path, hash] : options.inputs) {
      paths.push_back(path);
      hashes.push_back(hash);
    }
    writer.texts(inputs.get(), "path", paths);
    writer.texts(inputs.get(), "sha256", hashes);
    constexpr unsigned char no = 0;
    converged = writer.dataset(tunica_group.get(), "converged", H5T_NATIVE_UINT8, {}, &no, true);
  }

  void write_grid() {
    vtk = writer.group(writer.root(), "VTKHDF");
    const std::array<std::int64_t, 2> vtk_version{series ? 2 : 1, 0};
    writer.attribute(vtk.get(), "Version", H5T_NATIVE_INT64, {2}, vtk_version.data());
    writer.ascii_attribute(vtk.get(), "Type", "UnstructuredGrid");

    std::vector<double> points;
    std::vector<std::int64_t> connectivity;
    points.reserve(3 * grid.points);
    connectivity.reserve(3 * grid.cells);
    for (const Tessellation& surface : grid.bodies) {
      const std::size_t first = points.size() / 3;
      for (const Vec3& p : surface.mesh.vertices) {
        points.insert(points.end(), p.data(), p.data() + 3);
      }
      for (const auto& triangle : surface.mesh.triangles) {
        for (const Index v : triangle) {
          connectivity.push_back(static_cast<std::int64_t>(first + v));
        }
      }
    }
    std::vector<std::int64_t> offsets(grid.cells + 1);
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      offsets[i] = static_cast<std::int64_t>(3 * i);
    }
    const std::vector<unsigned char> types(grid.cells, vtk_triangle);
    const auto count = [&](const char* name, std::size_t value) {
      const auto number = static_cast<std::int64_t>(value);
      (void)writer.dataset(vtk.get(), name, H5T_NATIVE_INT64, {1}, &number);
    };
    count("NumberOfPoints", grid.points);
    count("NumberOfCells", grid.cells);
    count("NumberOfConnectivityIds", connectivity.size());
    (void)writer.dataset(vtk.get(), "Points", H5T_NATIVE_DOUBLE, {grid.points, 3}, points.data());
    (void)writer.dataset(vtk.get(), "Connectivity", H5T_NATIVE_INT64, {connectivity.size()}, connectivity.data());
    (void)writer.dataset(vtk.get(), "Offsets", H5T_NATIVE_INT64, {offsets.size()}, offsets.data());
    (void)writer.dataset(vtk.get(), "Types", H5T_NATIVE_UINT8, {types.size()}, types.data());
  }

  void make_fields() {
    const Handle point_data = writer.group(vtk.get(), "PointData");
    const Handle cell_data = writer.group(vtk.get(), "CellData");
    Handle point_offsets;
    Handle cell_offsets;
    if (series) {
      steps = writer.group(vtk.get(), "Steps");
      point_offsets = writer.group(steps.get(), "PointDataOffsets");
      cell_offsets = writer.group(steps.get(), "CellDataOffsets");
      for (const char* name : {"PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"}) {
        zeros.emplace_back(writer, steps.get(), name, H5T_NATIVE_INT64, std::vector<Size>{}, history_chunk, false);
      }
      parts = Series(writer, steps.get(), "NumberOfParts", H5T_NATIVE_INT64, {}, history_chunk, false);
      values = Series(writer, steps.get(), "Values", H5T_NATIVE_DOUBLE, {}, history_chunk, false);
      constexpr std::int64_t none = 0;
      writer.attribute(steps.get(), "NSteps", H5T_NATIVE_INT64, {}, &none);
      step_count = writer.own(H5Aopen(steps.get(), "NSteps", H5P_DEFAULT), "written");
    }
    Floats normals;
    Floats thicknesses;
    std::vector<std::int32_t> body_of_cell;
    for (std::size_t body = 0; body < grid.bodies.size(); ++body) {
      const Tessellation& surface = grid.bodies[body];
      const ShellBody& shell = model.shells[body];
      for (std::size_t v = 0; v < surface.mesh.vertices.size(); ++v) {
        const Index triangle = surface.vertex_shell[v];
        add(normals, curved_patch(shell.mesh, triangle).normal(surface.barycentric[v]));
        thicknesses.push_back(static_cast<float>(thickness_at(shell, triangle, surface.barycentric[v])));
      }
      body_of_cell.insert(body_of_cell.end(), surface.mesh.triangles.size(), static_cast<std::int32_t>(body));
    }
    fixed.emplace_back(writer, point_data.get(), point_offsets.get(), "normal", H5T_NATIVE_FLOAT,
                       std::vector<Size>{grid.points, 3}, normals.data(), series);
    fixed.emplace_back(writer, point_data.get(), point_offsets.get(), "thickness", H5T_NATIVE_FLOAT,
                       std::vector<Size>{grid.points}, thicknesses.data(), series);
    fixed.emplace_back(writer, cell_data.get(), cell_offsets.get(), "body", H5T_NATIVE_INT32,
                       std::vector<Size>{grid.cells}, body_of_cell.data(), series);
    displacement = Field(writer, point_data.get(), point_offsets.get(), "displacement", grid.points, 3, series);
    const auto cell_field = [&](const char* name, Size components) {
      return Field(writer, cell_data.get(), cell_offsets.get(), name, grid.cells, components, series);
    };
    pressure = cell_field("pressure", 1);
    von_mises_top = cell_field("von_mises_top", 1);
    von_mises_bottom = cell_field("von_mises_bottom", 1);
    membrane_force = cell_field("membrane_force", 3);
    bending_moment = cell_field("bending_moment", 3);
  }

  void make_history() {
    const Size nodes = model.node_count();
    const Handle group = writer.group(tunica_group.get(), "nodes");
    node_displacement =
        Series(writer, group.get(), "displacement", H5T_NATIVE_DOUBLE, {nodes, 3}, nodes_chunk_rows, true);
    node_rotation = Series(writer, group.get(), "rotation", H5T_NATIVE_DOUBLE, {nodes, 3}, nodes_chunk_rows, true);

    const Handle history = writer.group(tunica_group.get(), "history");
    for (const char* name : {"time", "load_factor", "volume", "strain_energy", "kinetic_energy", "residual"}) {
      numbers.emplace_back(writer, history.get(), name, H5T_NATIVE_DOUBLE, std::vector<Size>{}, history_chunk, false);
    }
    for (const char* name : {"newton_iterations", "cg_iterations"}) {
      counts.emplace_back(writer, history.get(), name, H5T_NATIVE_INT64, std::vector<Size>{}, history_chunk, false);
    }

    const Handle all_probes = writer.group(tunica_group.get(), "probes");
    for (const Probe& probe : model.probes) {
      const Handle one = writer.group(all_probes.get(), probe.name);
      probes.push_back({model.first_node(probe.body) + probe.node,
                        Series(writer, one.get(), "displacement", H5T_NATIVE_DOUBLE, {3}, history_chunk, false),
                        Series(writer, one.get(), "rotation", H5T_NATIVE_DOUBLE, {3}, history_chunk, false)});
    }
  }

  void append(const State& state, const ElementFields& fields) {
    TUNICA_ASSERT(state.displacement.size() == model.node_count() && state.rotation.size() == model.node_count());
    put_grid(state, fields);
    node_displacement.append(writer, 1, flattened(state.displacement).data());
    node_rotation.append(writer, 1, flattened(state.rotation).data());
    const std::array<double, 6> history{
        state.time,          state.load_factor,    state.volume.value_or(std::numeric_limits<double>::quiet_NaN()),
        state.strain_energy, state.kinetic_energy, state.residual};
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      numbers[i].append(writer, 1, &history[i]);
    }
    const std::array<std::int64_t, 2> iterations{static_cast<std::int64_t>(state.newton_iterations),
                                                 static_cast<std::int64_t>(state.cg_iterations)};
    for (std::size_t i = 0; i < counts.size(); ++i) {
      counts[i].append(writer, 1, &iterations[i]);
    }
    for (ProbeSeries& probe : probes) {
      probe.displacement.append(writer, 1, state.displacement[probe.node].data());
      probe.rotation.append(writer, 1, state.rotation[probe.node].data());
    }
    writer.flush();
    if (series) {
      // Last, so that what NSteps counts is there.
      const auto count = static_cast<std::int64_t>(values.rows());
      writer.check(H5Awrite(step_count.get(), H5T_NATIVE_INT64, &count), "written");
      writer.flush();
    }
    output.keep_partial();
  }

  void put_grid(const State& state, const ElementFields& fields) {
    Floats moved;
    moved.reserve(3 * grid.points);
    std::vector<std::size_t> element_of_cell;
    element_of_cell.reserve(grid.cells);
    std::size_t first_element = 0;
    for (std::size_t body = 0; body < grid.bodies.size(); ++body) {
      for (const Vec3& u : curved_displacement(model, body, state, grid.bodies[body])) {
        add(moved, u);
      }
      for (const Index shell : grid.bodies[body].shell) {
        element_of_cell.push_back(first_element + shell);
      }
      first_element += model.shells[body].mesh.triangles.size();
    }
    displacement.put(writer, moved);
    const auto put_scalar = [&](Field& field, const std::vector<double>& of_elements) {
      TUNICA_ASSERT(of_elements.size() == first_element);
      Floats of_cells;
      of_cells.reserve(grid.cells);
      for (const std::size_t element : element_of_cell) {
        of_cells.push_back(static_cast<float>(of_elements[element]));
      }
      field.put(writer, of_cells);
    };
    const auto put_vector = [&](Field& field, const std::vector<Vec3>& of_elements) {
      TUNICA_ASSERT(of_elements.size() == first_element);
      Floats of_cells;
      of_cells.reserve(3 * grid.cells);
      for (const std::size_t element : element_of_cell) {
        add(of_cells, of_elements[element]);
      }
      field.put(writer, of_cells);
    };
    put_scalar(pressure, fields.pressure);
    put_scalar(von_mises_top, fields.von_mises_top);
    put_scalar(von_mises_bottom, fields.von_mises_bottom);
    put_vector(membrane_force, fields.membrane_force);
    put_vector(bending_moment, fields.bending_moment);
    for (FixedField& field : fixed) {
      field.put(writer);
    }
    if (series) {
      constexpr std::int64_t zero = 0;
      constexpr std::int64_t one = 1;
      for (Series& offsets : zeros) {
        offsets.append(writer, 1, &zero);
      }
      parts.append(writer, 1, &one);
      values.append(writer, 1, &state.time);
    }
  }

  // Handles close in reverse order, the file last.
  const Model& model;
  const bool series;
  OutputFile output;
  Grid grid;
  Writer writer;
  Handle tunica_group;
  Handle vtk;
  Handle steps;
  Handle step_count;
  Handle converged;
  std::vector<FixedField> fixed;
  Field displacement;
  Field pressure;
  Field von_mises_top;
  Field von_mises_bottom;
  Field membrane_force;
  Field bending_moment;
  std::vector<Series> zeros;
  Series parts;
  Series values;
  Series node_displacement;
  Series node_rotation;
  std::vector<Series> numbers;
  std::vector<Series> counts;
  std::vector<ProbeSeries> probes;
};

ResultFile::ResultFile(const std::filesystem::path& path, const Model& model, ResultOptions options)
    : implementation_(std::make_unique<Implementation>(path, model, options)) {}

ResultFile::~ResultFile() = default;

void ResultFile::append(const State& state, const ElementFields& fields) { implementation_->append(state, fields); }

void ResultFile::commit(bool converged) {
  const unsigned char value = converged ? 1 : 0;
  implementation_->writer.rewrite(implementation_->converged, H5T_NATIVE_UINT8, &value);
  implementation_->writer.close();
  implementation_->output.commit();
}

}  // namespace tunica
