#include "tunica/io/result/result_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/detail/contact_record.hpp"
#include "tunica/io/result/detail/hdf5_file.hpp"
#include "tunica/io/result/detail/page_states.hpp"
#include "tunica/mechanics/runs/result_grid.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/triangle_rule.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

namespace tunica {
namespace {

using hdf5::Handle;
using hdf5::Series;
using hdf5::Size;
using hdf5::Writer;

constexpr Size history_chunk = 256;
constexpr Size nodes_chunk_rows = 1;

// Before anything of a state is written.
void require_range(std::span<const Floats> fields) {
  for (const Floats& values : fields) {
    if (!std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); })) {
      throw RequirementError(
          "stresses or displacements pass 3e38, the range of single precision, in which results are kept: check the "
          "units of loads and materials");
    }
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

// Of the values of a field, in so many rows.
std::vector<Size> shape_of(Size rows, Size components) {
  return components == 1 ? std::vector<Size>{rows} : std::vector<Size>{rows, components};
}

// A field of the grid: in a series it grows and its offset is noted per state, else the one state is written again.
class Field {
public:
  Field() = default;
  Field(const Writer& writer, hid_t group, hid_t offsets, const std::string& name, Size rows, Size components,
        bool series)
      : rows_(rows) {
    const std::vector<Size> shape = shape_of(rows, components);
    if (series) {
      values_ = Series(writer, group, name, H5T_NATIVE_FLOAT, {shape.begin() + 1, shape.end()}, rows, true);
      offsets_ = Series(writer, offsets, name, H5T_NATIVE_INT64, {}, history_chunk, false);
    } else {
      only_ = writer.dataset(group, name, H5T_NATIVE_FLOAT, shape, nullptr, true);
    }
  }

  void put(const Writer& writer, const Floats& values) {
    if (!values_) {
      writer.rewrite(only_, H5T_NATIVE_FLOAT, values.data());
      return;
    }
    const std::int64_t offset = values_->rows();
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

// What a data set is, by its path; every one has a line.
struct About {
  const char* path;
  const char* units;
  const char* description;
  const char* with_solids = nullptr;  ///< the line where the model has tetrahedra, if it is another one
  bool of_shells = false;             ///< is there only where the model has shells
};

constexpr std::array about{
    About{"VTKHDF/NumberOfPoints", "1", "points of the drawn surface",
          "points of the drawn surfaces and of the solids"},
    About{"VTKHDF/NumberOfCells", "1", "triangles of the drawn surface",
          "triangles of the drawn surfaces, and tetrahedra"},
    About{"VTKHDF/NumberOfConnectivityIds", "1", "three times the triangles",
          "three times the triangles and four times the tetrahedra"},
    About{"VTKHDF/Points", "mm", "reference surface; the nodes of a body come first, in file order",
          "reference; shells first, the nodes of each before what is drawn between them; then the solids' nodes"},
    About{"VTKHDF/Connectivity", "1", "points of each triangle, from 0",
          "points of each triangle, then of each tetrahedron, from 0"},
    About{"VTKHDF/Offsets", "1", "where each triangle begins in Connectivity",
          "where each cell begins in Connectivity"},
    About{"VTKHDF/Types", "1", "VTK cell type, 5: triangle", "VTK cell type, 5: triangle, 10: tetrahedron"},
    About{"VTKHDF/PointData/normal", "1", "unit normal of the reference surface",
          "unit normal of the reference surface; NaN in solids", true},
    About{"VTKHDF/PointData/thickness", "mm", "thickness of the wall in the reference",
          "thickness of the wall in the reference; NaN in solids", true},
    About{"VTKHDF/PointData/displacement", "mm", "deformed curved surface minus reference",
          "deformed curved surface minus reference; solids: of the nodes"},
    About{"VTKHDF/PointData/rotation", "rad", "rotation vectors, linear between the nodes",
          "rotation vectors, linear between the nodes; those of solids mean nothing"},
    About{"VTKHDF/PointData/membrane_stress", "MPa",
          "von Mises stress of the mean over the wall, recovered at the nodes, linear between them",
          "von Mises stress of the mean over the wall, recovered at the nodes, linear between them; solids: mean by "
          "volume of the stress at the nodes"},
    About{"VTKHDF/PointData/von_mises", "MPa",
          "von Mises stress, the larger of both faces, recovered at the nodes, linear between them",
          "von Mises stress, the larger of both faces, recovered at the nodes, linear between them; solids: mean by "
          "volume at the nodes"},
    About{"VTKHDF/CellData/body", "1", "number of the body, from 0"},
    About{"tunica/scene", "1", "the resolved scene, TOML in SI units"},
    About{"tunica/command", "1", "the command of the run"},
    About{"tunica/version", "1", "version of tunica"},
    About{"tunica/inputs/path", "1", "files that were read"},
    About{"tunica/inputs/sha256", "1", "and their SHA-256"},
    About{"tunica/converged", "1", "1: every step converged and the file is complete"},
    About{"tunica/nodes/position", "mm", "nodes of all bodies one after the other, in file order; reference"},
    About{"tunica/nodes/displacement", "mm", "by state and node, world axes"},
    About{"tunica/nodes/rotation", "rad", "rotation vectors by state and node, world axes"},
    About{"tunica/nodes/membrane_stress", "MPa",
          "von Mises stress of the mean over the wall, recovered; by state and node",
          "von Mises stress of the mean over the wall, recovered; solids: mean by volume of the stress; by state and "
          "node"},
    About{"tunica/nodes/von_mises", "MPa", "von Mises stress, the larger of both faces, recovered; by state and node",
          "von Mises stress, the larger of both faces, recovered; solids: mean by volume; by state and node"},
    About{"tunica/elements/nodes", "1", "the three nodes of each shell, rows of tunica/nodes, from 0", nullptr, true},
    About{"tunica/elements/body", "1", "the body of each shell, from 0", nullptr, true},
    About{"tunica/elements/area", "mm2", "of each shell's curved patch, reference", nullptr, true},
    About{"tunica/elements/normals", "1", "unit normals at the corners of each shell, one after the other; reference",
          nullptr, true},
    About{"tunica/elements/patch", "1", "which patch nodes and normals stand for, 0: comas, 1: watertight", nullptr,
          true},
    About{"tunica/history/load_factor", "1", "factor of the loads; dynamic: of the first load's ramp"},
    About{"tunica/history/volume", "mm3", "enclosed by the closed bodies' curved surfaces; NaN where one is open"},
    About{"tunica/history/strain_energy", "mJ", "elastic energy"},
    About{"tunica/history/kinetic_energy", "mJ", "kinetic energy"},
    About{"tunica/history/residual", "1", "unbalanced forces over those that balance"},
    About{"tunica/history/newton_iterations", "1", "linear systems of the step"},
    About{"tunica/history/cg_iterations", "1", "iterations of conjugate gradients in the step"},
    About{"tunica/history/max_displacement", "mm", "largest of the curved surfaces"},
    About{"tunica/history/displacement_p99", "mm", "exceeded on 1 % of the shells' area"},
    About{"tunica/history/membrane_p99", "MPa",
          "von Mises stress of the mean over the wall, exceeded on 1 % of the area"},
    About{"tunica/history/membrane_max", "MPa", "largest von Mises stress of the mean over the wall"},
    About{"tunica/history/membrane_mean", "MPa", "von Mises stress of the mean over the wall, mean over the area"},
    About{"tunica/history/tension_p99", "N/mm", "largest principal membrane force, exceeded on 1 % of the area"},
    About{"tunica/history/stress_p99", "MPa", "von Mises stress of either face, exceeded on 1 % of the area"},
    About{"tunica/history/stress_max", "MPa", "largest von Mises stress of either face"},
    About{"tunica/history/stress_max_at", "mm", "where it is, reference"},
    About{"tunica/history/strain_p99", "%", "largest principal strain of either face, exceeded on 1 % of the area"},
    About{"tunica/history/strain_max", "%", "largest principal strain of either face"}};

// Of the shells' fields, in CellData and in tunica/elements.
constexpr std::array about_shell_fields{
    About{"pressure", "MPa", "pressure on the shell"},
    About{"von_mises_top", "MPa", "von Mises stress at the face the normal points to, constant in each shell"},
    About{"von_mises_bottom", "MPa", "von Mises stress at the other face, constant in each shell"},
    About{"membrane_von_mises", "MPa", "von Mises stress of the mean over the wall, constant in each shell"},
    About{"tension", "N/mm", "largest principal membrane force, per current length, constant in each shell"},
    About{"membrane_force", "N/mm", "xx, yy, xy in the shell's own frame, x along its first edge"},
    About{"bending_moment", "N", "moment per length: xx, yy, xy in the same frame"},
    About{"principal_strain_top", "1", "largest and smallest strain at the face the normal points to"},
    About{"principal_strain_bottom", "1", "largest and smallest strain at the other face"}};

// Of the tetrahedra's, in CellData and in tunica/tetrahedra.
constexpr std::array about_solid_fields{
    About{"solid_von_mises", "MPa", "von Mises stress, constant in each tetrahedron"},
    About{"solid_pressure", "MPa", "minus the mean stress, positive in compression, constant in each tetrahedron"}};

// By state: each below tunica/contacts/NAME and tunica/rigid/NAME, whose rows stand beside those of tunica/history.
constexpr std::array about_contact{
    About{"force", "N", "on the first body, by state; NaN where a state does not say, as in the reference"},
    About{"moment", "N*mm", "on the first body, about the origin, by state"},
    About{"area", "mm2", "that presses, by state"},
    About{"smallest_gap", "mm", "between which two values it lies, by state; below zero: overlap"},
    About{"slip", "mm", "the largest of what presses, by state"},
    About{"points", "1", "samples that press, by state"}};
constexpr std::array about_rigid{
    About{"position", "mm", "of its centre, or the midpoint of its axis, by state; NaN where a state does not say"},
    About{"force", "N", "on it, by state"}, About{"moment", "N*mm", "on it, about the origin, by state"}};
constexpr std::array about_balance{
    About{"force_imbalance", "1", "sum of contact and tie forces over all bodies, relative to the largest"},
    About{"moment_imbalance", "1", "sum of their moments about the origin, relative to the largest"}};

constexpr std::array about_steps{About{"PartOffsets", "1", "first part of each state"},
                                 About{"PointOffsets", "1", "first point of each state"},
                                 About{"CellOffsets", "1", "first triangle of each state", "first cell of each state"},
                                 About{"ConnectivityIdOffsets", "1", "first entry of Connectivity of each state"},
                                 About{"NumberOfParts", "1", "parts of each state"}};

std::vector<double> patch_areas(const Model& model) {
  std::vector<double> areas;
  for (const ShellBody& body : model.shells) {
    for (const CubicPatch& patch : curved_patches(body.mesh)) {
      double& area = areas.emplace_back(0);
      for (const auto& [corners, weight] : triangle_rule()) {
        const auto along = patch.tangents({corners[1], corners[2]});
        area += weight * along[0].cross(along[1]).norm() / 2;
      }
    }
  }
  return areas;
}

/// What an attribute of ASCII can hold.
std::string ascii_of(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) > '~'; }, '?');
  return text;
}

// In the order of make_history().
std::array<double, 16> history_of(const State& state, const ElementFields& of_elements) {
  const Wall& wall = of_elements.wall;
  return {state.time,
          state.load_factor,
          state.volume.value_or(std::numeric_limits<double>::quiet_NaN()),
          state.strain_energy,
          state.kinetic_energy,
          state.residual,
          of_elements.largest_displacement,
          of_elements.displacement_p99,
          wall.membrane_p99,
          wall.membrane_max,
          wall.membrane_mean,
          wall.tension_p99,
          wall.stress_p99,
          wall.stress_max,
          1e2 * wall.strain_p99,
          1e2 * wall.strain_max};
}

struct ProbeSeries {
  std::size_t node = 0;
  Series displacement;
  Series rotation;
};

// Of one contact or rigid body.
struct Record {
  std::vector<Series> numbers;  ///< in the order of their descriptions
  std::optional<Series> points;
};

}  // namespace

struct ResultFile::Implementation {
  Implementation(const std::filesystem::path& path, const Model& the_model, const ResultOptions& options)
      : model(the_model),
        name(path),
        about_run(options),
        series(!std::holds_alternative<StaticRun>(options.run.kind)),
        output(path, options.overwrite),
        grid(the_model, options.tessellation),
        page(the_model, grid),
        writer(output.partial_path()) {
    write_about(options);
    write_grid();
    make_fields();
    make_history();
    describe_all(std::holds_alternative<DynamicRun>(options.run.kind)     ? "s"
                 : std::holds_alternative<FrequencyRun>(options.run.kind) ? "Hz"
                                                                          : "1");
    writer.flush();
  }

  void write_about(const ResultOptions& options) {
    tunica_group = writer.group(writer.root(), "tunica");
    writer.text(tunica_group.get(), "scene", options.scene);
    if (!options.accuracy.empty()) {
      writer.text(tunica_group.get(), "accuracy", options.accuracy);
      writer.describe("tunica/accuracy", "1", "JSON: what --accuracy claims, as in the report");
    }
    writer.text(tunica_group.get(), "command", options.command);
    writer.text(tunica_group.get(), "version", version);
    writer.ascii_attribute(writer.root(), "made_by",
                           ascii_of(fmt::format("tunica {}: {:.10000}", version, options.command)));
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

    const std::vector<std::int64_t> connectivity(grid.connectivity().begin(), grid.connectivity().end());
    std::vector<std::int64_t> offsets{0};
    offsets.insert(offsets.end(), grid.ends().begin(), grid.ends().end());
    const std::vector<std::uint8_t>& types = grid.types();
    const auto count = [&](const char* name, std::size_t value) {
      const std::int64_t number = value;
      (void)writer.dataset(vtk.get(), name, H5T_NATIVE_INT64, {1}, &number);
    };
    count("NumberOfPoints", grid.points());
    count("NumberOfCells", grid.cells());
    count("NumberOfConnectivityIds", connectivity.size());
    (void)writer.dataset(vtk.get(), "Points", H5T_NATIVE_DOUBLE, {grid.points(), 3}, grid.coordinates().data());
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
    const std::vector<GridField>& fixed_layout = grid.fixed_layout();
    for (std::size_t i = 0; i < fixed_layout.size(); ++i) {
      fixed.emplace_back(writer, point_data.get(), point_offsets.get(), fixed_layout[i].name, H5T_NATIVE_FLOAT,
                         shape_of(grid.points(), fixed_layout[i].components), grid.fixed()[i].data(), series);
    }
    fixed.emplace_back(writer, cell_data.get(), cell_offsets.get(), "body", H5T_NATIVE_INT32,
                       std::vector<Size>{grid.cells()}, grid.body_of_cell().data(), series);
    Handle element_group;
    Handle tetrahedron_group;
    if (!model.shells.empty()) {
      element_group = writer.group(tunica_group.get(), "elements");
      write_elements(element_group.get());
    }
    if (!model.solids.empty()) {
      tetrahedron_group = writer.group(tunica_group.get(), "tetrahedra");
      write_tetrahedra(tetrahedron_group.get());
    }
    for (const GridField& field : grid.layout()) {
      fields.emplace_back(writer, (field.of_cells ? cell_data : point_data).get(),
                          (field.of_cells ? cell_offsets : point_offsets).get(), field.name,
                          field.of_cells ? grid.cells() : grid.points(), field.components, series);
      if (field.of_cells) {
        elements.emplace_back(
            writer, (field.of_tetrahedra ? tetrahedron_group : element_group).get(), field.name, H5T_NATIVE_FLOAT,
            shape_of(field.of_tetrahedra ? grid.tetrahedra() : grid.elements(), field.components), 1, true);
      }
    }
  }

  void write_elements(hid_t group) {
    std::vector<std::int64_t> nodes;
    std::vector<std::int32_t> bodies, patches;
    std::vector<double> normals;
    for (std::size_t b = 0; b < model.shells.size(); ++b) {
      const ShellMesh& mesh = model.shells[b].mesh;
      const bool curved = !mesh.normals.empty() || !mesh.corner_normals.empty();
      const std::vector<Vec3> facets = facet_normals(flat_facets(mesh));
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
          nodes.push_back(narrow<std::int64_t>(model.first_node(b) + mesh.triangles[t][k]));
          const Vec3& normal = curved ? mesh.normal(t, k) : facets[t];
          normals.insert(normals.end(), normal.begin(), normal.end());
        }
        bodies.push_back(narrow<std::int32_t>(b));
        patches.push_back(static_cast<std::int32_t>(mesh.patch));
      }
    }
    (void)writer.dataset(group, "nodes", H5T_NATIVE_INT64, {grid.elements(), 3}, nodes.data());
    (void)writer.dataset(group, "body", H5T_NATIVE_INT32, {grid.elements()}, bodies.data());
    (void)writer.dataset(group, "patch", H5T_NATIVE_INT32, {grid.elements()}, patches.data());
    (void)writer.dataset(group, "normals", H5T_NATIVE_DOUBLE, {grid.elements(), 9}, normals.data());
    (void)writer.dataset(group, "area", H5T_NATIVE_DOUBLE, {grid.elements()}, patch_areas(model).data());
  }

  void write_tetrahedra(hid_t group) {
    std::vector<std::int64_t> nodes;
    for (std::size_t s = 0; s < model.solids.size(); ++s) {
      for (const auto& tetrahedron : model.solids[s].mesh.tetrahedra) {
        for (const Index node : tetrahedron) {
          nodes.push_back(narrow<std::int64_t>(model.first_node(model.shells.size() + s) + node));
        }
      }
    }
    (void)writer.dataset(group, "nodes", H5T_NATIVE_INT64, {grid.tetrahedra(), 4}, nodes.data());
    (void)writer.dataset(group, "body", H5T_NATIVE_INT32, {grid.tetrahedra()},
                         grid.body_of_cell().data() + grid.triangles());
  }

  void make_history() {
    const Size nodes = model.node_count();
    const Handle group = writer.group(tunica_group.get(), "nodes");
    std::vector<double> positions;
    for (std::size_t b = 0; b < model.body_count(); ++b) {
      const std::vector<double> of_body = flattened(model.vertices_of(b));
      positions.insert(positions.end(), of_body.begin(), of_body.end());
    }
    (void)writer.dataset(group.get(), "position", H5T_NATIVE_DOUBLE, {nodes, 3}, positions.data());
    node_displacement =
        Series(writer, group.get(), "displacement", H5T_NATIVE_DOUBLE, {nodes, 3}, nodes_chunk_rows, true);
    node_rotation = Series(writer, group.get(), "rotation", H5T_NATIVE_DOUBLE, {nodes, 3}, nodes_chunk_rows, true);
    node_membrane = Series(writer, group.get(), "membrane_stress", H5T_NATIVE_DOUBLE, {nodes}, nodes_chunk_rows, true);
    node_stress = Series(writer, group.get(), "von_mises", H5T_NATIVE_DOUBLE, {nodes}, nodes_chunk_rows, true);

    const Handle history = writer.group(tunica_group.get(), "history");
    for (const char* name : {"time", "load_factor", "volume", "strain_energy", "kinetic_energy", "residual",
                             "max_displacement", "displacement_p99", "membrane_p99", "membrane_max", "membrane_mean",
                             "tension_p99", "stress_p99", "stress_max", "strain_p99", "strain_max"}) {
      numbers.emplace_back(writer, history.get(), name, H5T_NATIVE_DOUBLE, std::vector<Size>{}, history_chunk, false);
    }
    for (const char* name : {"newton_iterations", "cg_iterations"}) {
      counts.emplace_back(writer, history.get(), name, H5T_NATIVE_INT64, std::vector<Size>{}, history_chunk, false);
    }

    stress_max_at = Series(writer, history.get(), "stress_max_at", H5T_NATIVE_DOUBLE, {3}, history_chunk, false);

    const Handle all_probes = writer.group(tunica_group.get(), "probes");
    for (const Probe& probe : model.probes) {
      const Handle one = writer.group(all_probes.get(), probe.name);
      probes.push_back({model.first_node(probe.body) + probe.node,
                        Series(writer, one.get(), "displacement", H5T_NATIVE_DOUBLE, {3}, history_chunk, false),
                        Series(writer, one.get(), "rotation", H5T_NATIVE_DOUBLE, {3}, history_chunk, false)});
    }
    make_contacts(history.get());
  }

  void make_contacts(hid_t history) {
    const auto series_of = [&](hid_t group, const char* name, std::vector<Size> shape) {
      return Series(writer, group, name, H5T_NATIVE_DOUBLE, shape, history_chunk, false);
    };
    Handle all;
    if (!model.contacts.empty()) {
      all = writer.group(tunica_group.get(), "contacts");
      for (const About& one : about_balance) {
        balance.push_back(series_of(history, one.path, {}));
      }
    }
    for (const Contact& contact : model.contacts) {
      const Handle one = writer.group(all.get(), contact.name);
      Record& record = contacts.emplace_back();
      record.numbers.push_back(series_of(one.get(), "force", {3}));
      record.numbers.push_back(series_of(one.get(), "moment", {3}));
      record.numbers.push_back(series_of(one.get(), "area", {}));
      record.numbers.push_back(series_of(one.get(), "smallest_gap", {2}));
      record.numbers.push_back(series_of(one.get(), "slip", {}));
      record.points = Series(writer, one.get(), "points", H5T_NATIVE_INT64, {}, history_chunk, false);
    }
    if (!model.rigids.empty()) {
      all = writer.group(tunica_group.get(), "rigid");
    }
    for (const RigidBody& rigid : model.rigids) {
      const Handle one = writer.group(all.get(), rigid.name);
      Record& record = rigids.emplace_back();
      for (const About& about_one : about_rigid) {
        record.numbers.push_back(series_of(one.get(), about_one.path, {3}));
      }
    }
  }

  void describe_all(const std::string& time_units) {
    const bool has_shells = !model.shells.empty();
    const bool has_solids = !model.solids.empty();
    const auto under = [&](const std::string& group, const About& one, const char* more = "") {
      if (has_shells || !one.of_shells) {
        writer.describe(
            group + one.path, one.units,
            std::string(has_solids && one.with_solids != nullptr ? one.with_solids : one.description) + more);
      }
    };
    for (const About& one : about) {
      under("", one);
    }
    for (std::size_t i = 0; has_shells && i < about_shell_fields.size(); ++i) {
      under("VTKHDF/CellData/", about_shell_fields[i], has_solids ? "; NaN in tetrahedra" : "");
      under("tunica/elements/", about_shell_fields[i]);
    }
    for (std::size_t i = 0; has_solids && i < about_solid_fields.size(); ++i) {
      under("VTKHDF/CellData/", about_solid_fields[i], has_shells ? "; NaN in shells" : "");
      under("tunica/tetrahedra/", about_solid_fields[i]);
    }
    if (has_solids) {
      writer.describe("tunica/tetrahedra/nodes", "1",
                      "the four nodes of each tetrahedron, rows of tunica/nodes, from 0");
      writer.describe("tunica/tetrahedra/body", "1", "the body of each tetrahedron, from 0, after the shells'");
    }
    for (const Contact& contact : model.contacts) {
      for (const About& one : about_contact) {
        under("tunica/contacts/" + contact.name + "/", one);
      }
    }
    for (const RigidBody& rigid : model.rigids) {
      for (const About& one : about_rigid) {
        under("tunica/rigid/" + rigid.name + "/", one);
      }
    }
    for (std::size_t i = 0; i < balance.size(); ++i) {
      under("tunica/history/", about_balance[i]);
    }
    writer.describe("tunica/history/time", time_units,
                    "dynamic: time; static: load factor; arc length: number of the step; modes: frequency or factor");
    for (const Probe& probe : model.probes) {
      const std::string group = "tunica/probes/" + probe.name;
      writer.describe(group + "/displacement", "mm", "of the probe's node, by state");
      writer.describe(group + "/rotation", "rad", "rotation vector of the probe's node, by state");
    }
    if (!series) {
      return;
    }
    for (const About& one : about_steps) {
      under("VTKHDF/Steps/", one);
    }
    writer.describe("VTKHDF/Steps/Values", time_units, "time of each state, as tunica/history/time");
    for (const auto* list : {&grid.layout(), &grid.fixed_layout()}) {
      for (const GridField& field : *list) {
        writer.describe(fmt::format("VTKHDF/Steps/{}DataOffsets/{}", field.of_cells ? "Cell" : "Point", field.name),
                        "1", "first row of each state");
      }
    }
    writer.describe("VTKHDF/Steps/CellDataOffsets/body", "1", "first row of each state");
  }

  void append(const State& state, const ElementFields& of_elements) {
    TUNICA_ASSERT(state.displacement.size() == model.node_count() && state.rotation.size() == model.node_count());
    put_fields(state, of_elements);
    node_displacement.append(writer, 1, flattened(state.displacement).data());
    node_rotation.append(writer, 1, flattened(state.rotation).data());
    node_membrane.append(writer, 1, of_elements.membrane_stress.data());
    node_stress.append(writer, 1, of_elements.von_mises.data());
    const auto history = history_of(state, of_elements);
    stress_max_at.append(writer, 1, of_elements.wall.stress_max_at.data());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      numbers[i].append(writer, 1, &history[i]);
    }
    const std::array<std::int64_t, 2> iterations{narrow<std::int64_t>(state.newton_iterations),
                                                 narrow<std::int64_t>(state.cg_iterations)};
    for (std::size_t i = 0; i < counts.size(); ++i) {
      counts[i].append(writer, 1, &iterations[i]);
    }
    for (ProbeSeries& probe : probes) {
      probe.displacement.append(writer, 1, state.displacement[probe.node].data());
      probe.rotation.append(writer, 1, state.rotation[probe.node].data());
    }
    append_contacts(state);
    writer.flush();
    if (series) {
      // Last, so that what NSteps counts is there.
      const std::int64_t count = values.rows();
      writer.check(H5Awrite(step_count.get(), H5T_NATIVE_INT64, &count), "written");
      writer.flush();
    }
    output.keep_partial();
  }

  void append_contacts(const State& state) {
    const auto append_all = [&](Record& record, const auto&... rows) {
      std::size_t next = 0;
      (record.numbers[next++].append(writer, 1, rows.data()), ...);
    };
    using One = std::array<double, 1>;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const ContactState now = contact_of(state, i);
      append_all(contacts[i], now.force, now.moment, One{now.area}, std::array{now.gap_lower, now.gap_upper},
                 One{now.slip});
      const auto pressing = narrow<std::int64_t>(now.points);
      contacts[i].points->append(writer, 1, &pressing);
    }
    for (std::size_t i = 0; i < rigids.size(); ++i) {
      const RigidState now = rigid_of(state, i);
      append_all(rigids[i], now.position, now.force, now.moment);
    }
    const std::array imbalances{state.force_imbalance, state.moment_imbalance};
    for (std::size_t i = 0; i < balance.size(); ++i) {
      balance[i].append(writer, 1, &imbalances[i]);
    }
  }

  void put_fields(const State& state, const ElementFields& of_elements) {
    const std::vector<Floats> on_grid = grid.values(state, of_elements);
    const std::vector<Floats> by_element = grid.element_values(of_elements);
    // Those of cells are the elements' with NaN where a cell has none.
    const auto first_of_cells = std::ranges::find_if(grid.layout(), &GridField::of_cells);
    require_range(std::span(on_grid).first(narrow<std::size_t>(first_of_cells - grid.layout().begin())));
    require_range(by_element);
    for (std::size_t i = 0; i < fields.size(); ++i) {
      fields[i].put(writer, on_grid[i]);
    }
    for (std::size_t i = 0; i < elements.size(); ++i) {
      elements[i].append(writer, 1, by_element[i].data());
    }
    page.append(state, of_elements, on_grid);
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
  const std::filesystem::path name;
  const ResultOptions about_run;
  const bool series;
  OutputFile output;
  ResultGrid grid;
  PageStates page;
  Writer writer;
  Handle tunica_group;
  Handle vtk;
  Handle steps;
  Handle step_count;
  Handle converged;
  std::vector<FixedField> fixed;
  std::vector<Field> fields;
  std::vector<Series> elements;
  std::vector<Series> zeros;
  Series parts;
  Series values;
  Series node_displacement;
  Series node_rotation;
  Series node_membrane;
  Series node_stress;
  std::vector<Series> numbers;
  Series stress_max_at;
  std::vector<Series> counts;
  std::vector<ProbeSeries> probes;
  std::vector<Record> contacts;
  std::vector<Record> rigids;
  std::vector<Series> balance;
};

ResultFile::ResultFile(const std::filesystem::path& path, const Model& model, ResultOptions options)
    : implementation_(std::make_unique<Implementation>(path, model, options)) {}

ResultFile::~ResultFile() = default;

void ResultFile::append(const State& state, const ElementFields& fields) { implementation_->append(state, fields); }

void ResultFile::commit(bool converged) {
  const unsigned char value = converged ? 1 : 0;
  implementation_->writer.rewrite(implementation_->converged, H5T_NATIVE_UINT8, &value);
  implementation_->writer.close();
  DrawnResult drawn = implementation_->page.drawn();
  const ResultOptions& about = implementation_->about_run;
  drawn.kind = static_cast<DrawnResult::Kind>(about.run.kind.index());
  drawn.is_unloaded = about.is_unloaded;
  drawn.made_by = fmt::format("tunica {}: {}", version, about.command);
  write_page_file(page_path(implementation_->name), drawn, about.overwrite);
  implementation_->output.commit();
}

}  // namespace tunica
