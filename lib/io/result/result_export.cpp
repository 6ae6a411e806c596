#include "tunica/io/result/result_export.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/result/detail/result_grid.hpp"
#include "tunica/io/result/detail/vtu_file.hpp"

#include <fmt/format.h>

#include <limits>

namespace tunica {
namespace fs = std::filesystem;
namespace {

fs::path beside(const fs::path& result, const std::string& ending) {
  fs::path path = result;
  path.replace_extension();
  return path += ending;
}

// Names go into XML.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string heavy(std::string_view number, std::size_t rows, std::size_t components, const std::string& place) {
  return fmt::format(R"(<DataItem Dimensions="{}{}" {} Format="HDF">{}</DataItem>)", rows,
                     components > 1 ? fmt::format(" {}", components) : "", number, place);
}

constexpr std::string_view float32 = R"(NumberType="Float" Precision="4")";
constexpr std::string_view float64 = R"(NumberType="Float" Precision="8")";
constexpr std::string_view int32 = R"(NumberType="Int" Precision="4")";
constexpr std::string_view int64 = R"(NumberType="Int" Precision="8")";

std::string attribute(const GridField& field, const std::string& data) {
  const char* type = field.components == 1 ? "Scalar" : field.components == 3 ? "Vector" : "Matrix";
  return fmt::format("<Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", field.name, type,
                     field.of_cells ? "Cell" : "Node", data);
}

}  // namespace

std::vector<fs::path> export_paths(const fs::path& result, const ExportOptions& options) {
  std::vector<fs::path> paths;
  if (options.pvd) {
    paths.push_back(beside(result, ".pvd"));
  }
  if (options.xmf) {
    paths.push_back(beside(result, ".xmf"));
  }
  return paths;
}

struct ResultExport::Implementation {
  Implementation(fs::path path, const Model& model, const ExportOptions& wanted)
      : result(std::move(path)), options(wanted), grid(model, wanted.tessellation) {
    for (const fs::path& file : export_paths(result, options)) {
      require_writable(file, options.overwrite);
    }
    if (options.pvd) {
      require_writable(vtu(0), options.overwrite);
    }
  }

  [[nodiscard]] fs::path vtu(std::size_t state) const { return beside(result, fmt::format("_{:04}.vtu", state)); }

  std::optional<fs::path> append(const State& state, const ElementFields& fields) {
    std::optional<fs::path> written;
    if (options.pvd) {
      write_state(state, fields);
      written = vtu(times.size());
    }
    times.push_back(state.time);
    return written;
  }

  void write_state(const State& state, const ElementFields& fields) const {
    VtuTriangles triangles{grid.coordinates(), grid.connectivity(), {}, {}, {}};
    const auto put = [&](const GridField& field, const std::vector<float>& values) {
      (field.of_cells ? triangles.of_cells : triangles.of_points)
          .push_back({field.name, field.components, std::span(values)});
    };
    const std::vector<std::vector<float>> values = grid.values(state, fields);
    for (std::size_t i = 0; i < values.size(); ++i) {
      put(ResultGrid::layout()[i], values[i]);
    }
    for (std::size_t i = 0; i < grid.fixed().size(); ++i) {
      put(ResultGrid::fixed_layout()[i], grid.fixed()[i]);
    }
    triangles.of_cells.push_back({"body", 1, std::span(grid.body_of_cell())});
    const std::array<std::pair<const char*, double>, 5> numbers{
        {{"TimeValue", state.time},
         {"load_factor", state.load_factor},
         {"volume", state.volume.value_or(std::numeric_limits<double>::quiet_NaN())},
         {"strain_energy", state.strain_energy},
         {"kinetic_energy", state.kinetic_energy}}};
    for (const auto& [name, value] : numbers) {
      triangles.of_grid.push_back({name, 1, std::span(&value, 1)});
    }
    // The first one was asked about; a later one is left from a longer run of the same name.
    write_vtu(vtu(times.size()), triangles, true);
  }

  [[nodiscard]] std::string pvd_text() const {
    std::string text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
        "<Collection>\n";
    for (std::size_t i = 0; i < times.size(); ++i) {
      text += fmt::format("<DataSet timestep=\"{}\" part=\"0\" file=\"{}\"/>\n", times[i],
                          escaped(vtu(i).filename().string()));
    }
    return text + "</Collection>\n</VTKFile>\n";
  }

  [[nodiscard]] std::string xmf_text(const fs::path& heavy_file) const {
    const std::string vtk = escaped(heavy_file.filename().string()) + ":/VTKHDF/";
    const std::string mesh =
        fmt::format("<Topology TopologyType=\"Triangle\" NumberOfElements=\"{}\">{}</Topology>\n", grid.cells(),
                    heavy(int64, 3 * grid.cells(), 1, vtk + "Connectivity")) +
        fmt::format("<Geometry GeometryType=\"XYZ\">{}</Geometry>\n", heavy(float64, grid.points(), 3, vtk + "Points"));
    const auto place = [&](const GridField& field) {
      return vtk + (field.of_cells ? "CellData/" : "PointData/") + field.name;
    };
    std::string fixed;
    for (const GridField& field : ResultGrid::fixed_layout()) {
      fixed += attribute(field, heavy(float32, grid.points(), field.components, place(field)));
    }
    fixed += attribute({"body", 1, true}, heavy(int32, grid.cells(), 1, vtk + "CellData/body"));
    std::string text =
        "<?xml version=\"1.0\"?>\n<Xdmf Version=\"2.0\">\n<Domain>\n"
        "<Grid Name=\"shells\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
    // Without a series the file holds the last state alone.
    for (std::size_t state = options.series || times.empty() ? 0 : times.size() - 1; state < times.size(); ++state) {
      text += fmt::format("<Grid Name=\"state {}\" GridType=\"Uniform\">\n<Time Value=\"{}\"/>\n", state, times[state]);
      text += mesh + fixed;
      for (const GridField& field : ResultGrid::layout()) {
        const std::size_t rows = field.of_cells ? grid.cells() : grid.points();
        const std::size_t stored = options.series ? times.size() : 1;
        std::string data = heavy(float32, stored * rows, field.components, place(field));
        if (options.series) {
          const bool vector = field.components > 1;
          data = fmt::format(
              "<DataItem ItemType=\"HyperSlab\" Dimensions=\"{}{}\"><DataItem Dimensions=\"3 {}\" "
              "Format=\"XML\">{}</DataItem>{}</DataItem>",
              rows, vector ? fmt::format(" {}", field.components) : "", vector ? 2 : 1,
              vector ? fmt::format("{} 0 1 1 {} {}", state * rows, rows, field.components)
                     : fmt::format("{} 1 {}", state * rows, rows),
              data);
        }
        text += attribute(field, data);
      }
      text += "</Grid>\n";
    }
    return text + "</Grid>\n</Domain>\n</Xdmf>\n";
  }

  void write(const std::string& ending, bool overwrite) {
    fs::path heavy_file = result;
    heavy_file += ending;
    if (options.pvd) {
      write_file(beside(result, ".pvd" + ending), pvd_text(), overwrite);
    }
    if (options.xmf) {
      write_file(beside(result, ".xmf" + ending), xmf_text(heavy_file), overwrite);
    }
  }

  fs::path result;
  ExportOptions options;
  ResultGrid grid;
  std::vector<double> times;
  bool done = false;
};

ResultExport::ResultExport(const fs::path& result, const Model& model, const ExportOptions& options)
    : implementation_(std::make_unique<Implementation>(result, model, options)) {}

ResultExport::~ResultExport() {
  if (implementation_->done || implementation_->times.empty()) {
    return;
  }
  try {
    implementation_->write(".part", true);
  } catch (const Error&) {
    return;  // the run has failed for a reason that has been said; a second one would hide it
  }
}

std::optional<fs::path> ResultExport::append(const State& state, const ElementFields& fields) {
  return implementation_->append(state, fields);
}

void ResultExport::commit() {
  implementation_->write("", implementation_->options.overwrite);
  for (const fs::path& file : export_paths(implementation_->result, implementation_->options)) {
    fs::path old = file;
    std::error_code ignored;
    fs::remove(old += ".part", ignored);  // of a run that was interrupted and went on
  }
  implementation_->done = true;
}

}  // namespace tunica
