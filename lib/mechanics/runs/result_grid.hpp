#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <cstdint>
#include <utility>
#include <vector>

/// What of a model and its states is drawn: the result file, its exports and pictures show the same.
namespace tunica {

// VTK's numbers of the cell types.
inline constexpr std::uint8_t vtk_triangle = 5;
inline constexpr std::uint8_t vtk_tetrahedron = 10;
using Floats = std::vector<float>;

/// A field of the grid: its name, numbers per point or cell, and to which it belongs.
struct GridField {
  const char* name;
  std::size_t components;
  bool of_cells;
  bool of_tetrahedra = false;  ///< of the cells only the tetrahedra have it, else only the triangles
};

/// All bodies as one grid. First the curved surfaces of the shells as linear triangles: each patch cut into level^2;
/// the patches of a body share their points at nodes and edges, where each point is the mean of theirs (comas patches
/// do not quite meet). The nodes of a body come first, in their order. Then the solids' nodes and tetrahedra, as they
/// are. What a field does not say of a point or cell is NaN there. The model must outlive it.
class ResultGrid {
public:
  /// @param level  pieces per edge; 0: as drawing_level() says
  ResultGrid(const Model& model, int level);

  [[nodiscard]] std::size_t points() const { return coordinates_.size() / 3; }
  [[nodiscard]] std::size_t cells() const { return body_of_cell_.size(); }
  [[nodiscard]] std::size_t triangles() const { return element_of_cell_.size(); }
  [[nodiscard]] std::size_t tetrahedra() const { return cells() - triangles(); }
  /// Pieces per edge of a shell.
  [[nodiscard]] int level() const { return level_; }
  /// Shells, before they were cut.
  [[nodiscard]] std::size_t elements() const { return elements_; }
  /// Of the shells; the solids' follow.
  [[nodiscard]] std::size_t shell_points() const { return shell_points_; }
  /// 3 per point, mm, of the reference.
  [[nodiscard]] const std::vector<double>& coordinates() const { return coordinates_; }
  /// Points of the cells, one after the other: 3 per triangle, then 4 per tetrahedron.
  [[nodiscard]] const std::vector<std::int32_t>& connectivity() const { return connectivity_; }
  /// Where in it those of each cell end.
  [[nodiscard]] const std::vector<std::int32_t>& ends() const { return ends_; }
  /// VTK's number of each cell's type.
  [[nodiscard]] const std::vector<std::uint8_t>& types() const { return types_; }
  [[nodiscard]] const std::vector<std::int32_t>& body_of_cell() const { return body_of_cell_; }
  /// The triangles of the shells, then the outer faces of the solids: corners are points of the grid.
  [[nodiscard]] TriangleMesh surface() const;

  /// Fields of points that no state changes: normal, thickness, where there are shells.
  [[nodiscard]] const std::vector<GridField>& fixed_layout() const { return fixed_layout_; }
  [[nodiscard]] const std::vector<std::vector<float>>& fixed() const { return fixed_; }

  /// Fields of a state, first those of the points; the values in the same order.
  [[nodiscard]] const std::vector<GridField>& layout() const { return layout_; }
  [[nodiscard]] std::vector<std::vector<float>> values(const State& state, const ElementFields& fields) const;
  /// At the points, of what is known at the nodes of all bodies: linear within the shells.
  [[nodiscard]] Floats at_points(const std::vector<double>& of_nodes) const;
  /// The shells of a state, displaced, and their membrane stress, #V, MPa. @param values  as values() gives them
  [[nodiscard]] std::pair<TriangleMesh, std::vector<double>> moved_shells(const std::vector<Floats>& values) const;
  /// Points at both ends of the pieces into which the edges of the shells are cut, once or twice each.
  [[nodiscard]] std::vector<std::array<std::size_t, 2>> shell_edges() const;
  /// The fields of cells alone, each only of what has it: #elements() x components, #tetrahedra() of tetrahedra.
  [[nodiscard]] std::vector<std::vector<float>> element_values(const ElementFields& fields) const;

private:
  struct Body {
    Tessellation surface;        ///< patch by patch
    std::vector<Index> point;    ///< #vertices of it: of the body
    std::vector<double> weight;  ///< #vertices of it: one over how many share the point
    std::size_t points = 0;
  };
  [[nodiscard]] static Body make_body(const ShellMesh& mesh, int level);
  void add_shells();
  void add_solids();
  void add_solid_values(const State& state, const ElementFields& fields, std::vector<std::vector<float>>& values) const;
  /// Adds the means at the points of a body of what `of_vertex` gives for the vertices of its tessellation.
  template <typename OfVertex>
  static void add_means(const Body& body, const OfVertex& of_vertex, std::vector<float>& values);

  const Model& model_;
  std::vector<Body> bodies_;
  int level_ = 1;
  std::size_t elements_ = 0;
  std::size_t shell_points_ = 0;
  std::vector<double> coordinates_;
  std::vector<std::int32_t> connectivity_;
  std::vector<std::int32_t> ends_;
  std::vector<std::uint8_t> types_;
  std::vector<std::int32_t> body_of_cell_;
  std::vector<std::size_t> element_of_cell_;  ///< of triangles
  std::vector<GridField> fixed_layout_;
  std::vector<std::vector<float>> fixed_;
  std::vector<GridField> layout_;
};

/// Pieces per edge into which a result's curved triangles are cut for drawing: 4, and fewer for large models so that a
/// state stays below about 200,000 fine triangles.
int drawing_level(std::size_t shells);

}  // namespace tunica
