#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/draw/detail/shading.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {

std::string magnification_text(double magnify) {
  return magnify == 1 ? "Displacements are drawn at their true size"
                      : fmt::format("Displacements are drawn {:g} times as large", magnify);
}

std::string moved_picture(const TriangleMesh& reference, const std::vector<Vec3>& displacement,
                          const std::vector<std::array<std::size_t, 2>>& edges, const std::vector<double>& values,
                          double magnify, PictureOptions look) {
  constexpr double seen = 0.003;  // of the diagonal: what moves less is not told from its outline
  require_positive(magnify, "magnification");
  require_drawable(reference, values);
  const std::size_t points = reference.vertices.size();
  const auto is_there = [&](const auto& edge) { return edge[0] < points && edge[1] < points; };
  if (displacement.size() != points || !std::ranges::all_of(edges, is_there)) {
    throw InputError("a picture needs one displacement per vertex, and edges between vertices");
  }
  TriangleMesh surface = reference;
  double moved = 0;
  for (std::size_t v = 0; v < displacement.size(); ++v) {
    surface.vertices[v] += magnify * displacement[v];
    moved = std::max(moved, magnify * displacement[v].norm());
  }
  look.outline = moved < seen * diagonal(reference) ? TriangleMesh() : reference;
  for (const auto& [from, to] : edges) {
    look.lines.push_back({surface.vertices[from], surface.vertices[to]});
  }
  look.caption += magnification_text(magnify);
  return surface_picture(surface, values, look);
}

}  // namespace tunica
