#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <span>

/// What of a model and its states is drawn. Inside lib/io: the result file and its exports hold the same.
namespace tunica {

inline constexpr unsigned char vtk_triangle = 5;  ///< VTK's number of the cell type
using Floats = std::vector<float>;

/// A field of the grid: its name, numbers per point or cell, and to which it belongs.
struct GridField {
  const char* name;
  std::size_t components;
  bool of_cells;
};

/// The curved surfaces of all bodies as one grid of linear triangles: each patch cut into level^2; the patches of a
/// body share their points at nodes and edges, where each point is the mean of theirs (comas patches do not quite
/// meet). The nodes of a body come first, in their order. The model must outlive it.
class ResultGrid {
public:
  /// @param level  pieces per edge; 0: as drawing_level() says
  ResultGrid(const Model& model, int level);

  [[nodiscard]] std::size_t points() const { return coordinates_.size() / 3; }
  [[nodiscard]] std::size_t cells() const { return body_of_cell_.size(); }
  [[nodiscard]] std::size_t elements() const { return elements_; }
  /// 3 per point, mm, of the reference.
  [[nodiscard]] const std::vector<double>& coordinates() const { return coordinates_; }
  /// 3 points per cell.
  [[nodiscard]] const std::vector<std::int32_t>& connectivity() const { return connectivity_; }
  [[nodiscard]] const std::vector<std::int32_t>& body_of_cell() const { return body_of_cell_; }

  /// Fields that no state changes: normal, thickness.
  [[nodiscard]] static std::span<const GridField> fixed_layout();
  [[nodiscard]] const std::vector<std::vector<float>>& fixed() const { return fixed_; }

  /// Fields of a state; the values in the same order.
  [[nodiscard]] static std::span<const GridField> layout();
  [[nodiscard]] std::vector<std::vector<float>> values(const State& state, const ElementFields& fields) const;

private:
  struct Body {
    Tessellation surface;        ///< patch by patch
    std::vector<Index> point;    ///< #vertices of it: of the body
    std::vector<double> weight;  ///< #vertices of it: one over how many share the point
    std::size_t points = 0;
  };
  [[nodiscard]] static Body make_body(const ShellMesh& mesh, int level);
  /// Adds the means at the points of a body of what `of_vertex` gives for the vertices of its tessellation.
  template <typename OfVertex>
  static void add_means(const Body& body, const OfVertex& of_vertex, std::vector<float>& values);

  const Model& model_;
  std::vector<Body> bodies_;
  std::size_t elements_ = 0;
  std::vector<double> coordinates_;
  std::vector<std::int32_t> connectivity_;
  std::vector<std::int32_t> body_of_cell_;
  std::vector<std::size_t> element_of_cell_;
  std::vector<std::vector<float>> fixed_;
};

/// The element fields one after the other, each #elements x components; the order and the names of ResultGrid's fields
/// of cells.
std::vector<std::vector<float>> element_values(const ElementFields& fields);

/// Pieces per edge into which a result's curved triangles are cut for drawing: 4, and fewer for large models so that a
/// state stays below about 200,000 fine triangles.
int drawing_level(std::size_t shells);

}  // namespace tunica
