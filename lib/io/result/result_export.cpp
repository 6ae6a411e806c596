#include "tunica/io/result/result_export.hpp"

#include "tunica/core/error.hpp"
#include "tunica/draw/shaded_surface.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/io/result/detail/vtu_file.hpp"
#include "tunica/io/result/shell_deck.hpp"
#include "tunica/mechanics/runs/result_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace tunica {
namespace fs = std::filesystem;
namespace {

fs::path beside(const fs::path& result, const std::string& ending) {
  fs::path path = result;
  path.replace_extension();
  return path += ending;
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
  for (const auto& [wanted, ending] : {std::pair(options.pvd, ".pvd"), std::pair(options.xmf, ".xmf"),
                                       std::pair(options.inp, ".inp"), std::pair(options.feb, ".feb")}) {
    if (wanted) {
      paths.push_back(beside(result, ending));
    }
  }
  for (const std::string& ending : options.surfaces) {
    paths.push_back(beside(result, ending));
  }
  return paths;
}

struct ResultExport::Implementation {
  Implementation(fs::path path, const Model& of, const ExportOptions& wanted)
      : model(of), result(std::move(path)), options(wanted), grid(of, wanted.tessellation) {
    for (const Deck deck : decks()) {
      require_expressible(model, options.run, deck);
    }
    if (!options.surfaces.empty() && model.shells.empty()) {
      throw UsageError(fmt::format("--export {}: the scene has no shells to draw; leave it out",
                                   options.surfaces.front().substr(1)));
    }
    const std::string name = result.filename().string();
    const bool in_xml =
        name == as_utf8(name) && std::ranges::none_of(name, [](char c) { return static_cast<unsigned char>(c) < ' '; });
    if ((options.pvd || options.xmf) && !in_xml) {
      throw UsageError(
          fmt::format("--export {}: would name '{}', which has signs that no XML can hold: name it otherwise",
                      options.pvd ? "pvd" : "xmf", name));
    }
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
    if (!options.surfaces.empty()) {
      last = grid.values(state, fields);
    }
    times.push_back(state.time);
    return written;
  }

  void write_state(const State& state, const ElementFields& fields) const {
    VtuGrid drawn{grid.coordinates(), grid.connectivity(), grid.ends(), grid.types(), {}, {}, {}};
    const auto put = [&](const GridField& field, const std::vector<float>& values) {
      (field.of_cells ? drawn.of_cells : drawn.of_points).push_back({field.name, field.components, std::span(values)});
    };
    const std::vector<std::vector<float>> values = grid.values(state, fields);
    for (std::size_t i = 0; i < values.size(); ++i) {
      put(grid.layout()[i], values[i]);
    }
    for (std::size_t i = 0; i < grid.fixed().size(); ++i) {
      put(grid.fixed_layout()[i], grid.fixed()[i]);
    }
    drawn.of_cells.push_back({"body", 1, std::span(grid.body_of_cell())});
    const std::array<std::pair<const char*, double>, 5> numbers{
        {{"TimeValue", state.time},
         {"load_factor", state.load_factor},
         {"volume", state.volume.value_or(std::numeric_limits<double>::quiet_NaN())},
         {"strain_energy", state.strain_energy},
         {"kinetic_energy", state.kinetic_energy}}};
    for (const auto& [name, value] : numbers) {
      drawn.of_grid.push_back({name, 1, std::span(&value, 1)});
    }
    // The first one was asked about; a later one is left from a longer run of the same name.
    write_vtu(vtu(times.size()), drawn, options.made_by, true);
  }

  [[nodiscard]] std::string pvd_text() const {
    std::string text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
        "<Collection>\n";
    for (std::size_t i = 0; i < times.size(); ++i) {
      text += fmt::format("<DataSet timestep=\"{}\" part=\"0\" file=\"{}\"/>\n", times[i],
                          xml_escaped(vtu(i).filename().string()));
    }
    return text + "</Collection>\n</VTKFile>\n" + xml_made_by(options.made_by);
  }

  /// Cells of one type, which follow each other.
  struct XmfPart {
    const char* name;
    const char* topology;
    std::size_t corners;
    std::size_t first_cell, cells;
  };

  /// A grid of its own for each type: XDMF takes a mixed one only from a list that says the type before each cell.
  [[nodiscard]] std::vector<XmfPart> xmf_parts() const {
    std::vector<XmfPart> parts;
    if (grid.triangles() > 0) {
      parts.push_back({"shells", "Triangle", 3, 0, grid.triangles()});
    }
    if (grid.tetrahedra() > 0) {
      parts.push_back({"solids", "Tetrahedron", 4, grid.triangles(), grid.tetrahedra()});
    }
    return parts;
  }

  /// Rows of a data set of the result file.
  static std::string rows_of(std::string_view number, std::size_t stored, std::size_t components, std::size_t first,
                             std::size_t rows, const std::string& place) {
    const std::string data = heavy(number, stored, components, place);
    const bool vector = components > 1;
    return fmt::format(
        "<DataItem ItemType=\"HyperSlab\" Dimensions=\"{}{}\"><DataItem Dimensions=\"3 {}\" "
        "Format=\"XML\">{}</DataItem>{}</DataItem>",
        rows, vector ? fmt::format(" {}", components) : "", vector ? 2 : 1,
        vector ? fmt::format("{} 0 1 1 {} {}", first, rows, components) : fmt::format("{} 1 {}", first, rows), data);
  }

  /// The same, or all of it without a selection.
  static std::string part_of(std::string_view number, std::size_t stored, std::size_t components, std::size_t first,
                             std::size_t rows, const std::string& place) {
    return rows == stored ? heavy(number, stored, components, place)
                          : rows_of(number, stored, components, first, rows, place);
  }

  /// What stays the same from state to state. Parts share the points.
  [[nodiscard]] std::string xmf_mesh(const XmfPart& part, const std::string& vtk) const {
    const std::size_t first_corner = 3 * part.first_cell;  // only triangles come before
    std::string text =
        fmt::format("<Topology TopologyType=\"{}\" NumberOfElements=\"{}\">{}</Topology>\n", part.topology, part.cells,
                    part_of(int64, grid.connectivity().size(), 1, first_corner, part.corners * part.cells,
                            vtk + "Connectivity")) +
        fmt::format("<Geometry GeometryType=\"XYZ\">{}</Geometry>\n", heavy(float64, grid.points(), 3, vtk + "Points"));
    for (const GridField& field : grid.fixed_layout()) {
      text += attribute(field, heavy(float32, grid.points(), field.components, vtk + "PointData/" + field.name));
    }
    return text + attribute({"body", 1, true},
                            part_of(int32, grid.cells(), 1, part.first_cell, part.cells, vtk + "CellData/body"));
  }

  [[nodiscard]] std::string xmf_state(const XmfPart& part, const std::string& vtk, std::size_t state) const {
    std::string text;
    for (const GridField& field : grid.layout()) {
      if (field.of_cells && field.of_tetrahedra != (part.corners == 4)) {
        continue;  // it says nothing here
      }
      const std::string place = vtk + (field.of_cells ? "CellData/" : "PointData/") + field.name;
      const std::size_t all = field.of_cells ? grid.cells() : grid.points();
      const std::size_t first = field.of_cells ? part.first_cell : 0;
      const std::size_t rows = field.of_cells ? part.cells : all;
      text += attribute(
          field, series ? rows_of(float32, times.size() * all, field.components, state * all + first, rows, place)
                        : part_of(float32, all, field.components, first, rows, place));
    }
    return text;
  }

  [[nodiscard]] std::string xmf_text(const fs::path& heavy_file) const {
    const std::string vtk = xml_escaped(heavy_file.filename().string()) + ":/VTKHDF/";
    const std::vector<XmfPart> parts = xmf_parts();
    std::vector<std::string> meshes;
    for (const XmfPart& part : parts) {
      meshes.push_back(xmf_mesh(part, vtk));
    }
    const bool only = parts.size() == 1;
    std::string text = fmt::format(
        "<?xml version=\"1.0\"?>\n<Xdmf Version=\"2.0\">\n<Domain>\n"
        "<Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
        only ? parts.front().name : "bodies");
    // Without a series the file holds the last state alone.
    for (std::size_t state = series || times.empty() ? 0 : times.size() - 1; state < times.size(); ++state) {
      const std::string time = fmt::format("<Time Value=\"{}\"/>\n", times[state]);
      if (!only) {
        text +=
            fmt::format("<Grid Name=\"state {}\" GridType=\"Collection\" CollectionType=\"Spatial\">\n{}", state, time);
      }
      for (std::size_t i = 0; i < parts.size(); ++i) {
        text += only ? fmt::format("<Grid Name=\"state {}\" GridType=\"Uniform\">\n{}", state, time)
                     : fmt::format("<Grid Name=\"{}\" GridType=\"Uniform\">\n", parts[i].name);
        text += meshes[i] + xmf_state(parts[i], vtk, state) + "</Grid>\n";
      }
      text += only ? "" : "</Grid>\n";
    }
    return text + "</Grid>\n</Domain>\n</Xdmf>\n" + xml_made_by(options.made_by);
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

  [[nodiscard]] std::vector<Deck> decks() const {
    std::vector<Deck> wanted;
    if (options.inp) {
      wanted.push_back(Deck::inp);
    }
    if (options.feb) {
      wanted.push_back(Deck::feb);
    }
    return wanted;
  }

  void write_surfaces() const {
    if (options.surfaces.empty()) {
      return;
    }
    const auto [mesh, stress] = grid.moved_shells(last);
    const ShadedSurface shaded = shaded_surface(mesh, stress);
    PlyOptions ply;
    ply.comments = {"made by " + options.made_by,
                    fmt::format("colours: membrane stress (von Mises) from 0 to {:.4g} MPa", shaded.largest)};
    ply.space = options.space;
    ply.overwrite = options.overwrite;
    for (const std::string& ending : options.surfaces) {
      write_surface(beside(result, ending), mesh, ply, {shaded.normals, shaded.colours});
    }
  }

  void write_models_and_surfaces() const {
    write_surfaces();
    for (const Deck deck : decks()) {
      write_file(beside(result, deck == Deck::inp ? ".inp" : ".feb"),
                 deck_text(model, options.run, deck, options.made_by), options.overwrite);
    }
  }

  const Model& model;
  fs::path result;
  ExportOptions options;
  bool series = !std::holds_alternative<StaticRun>(options.run.kind);  // as ResultFile
  ResultGrid grid;
  std::vector<double> times;
  std::vector<std::vector<float>> last;  ///< fields of the last state, for surfaces
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
  implementation_->write_models_and_surfaces();
  for (const fs::path& file : export_paths(implementation_->result, implementation_->options)) {
    fs::path old = file;
    std::error_code ignored;
    fs::remove(old += ".part", ignored);  // of a run that was interrupted and went on
  }
  implementation_->done = true;
}

}  // namespace tunica
