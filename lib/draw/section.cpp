#include "tunica/core/narrow.hpp"
#include "tunica/draw/picture.hpp"

#include <algorithm>

namespace tunica {

void add_section(const PictureCut& cut, const std::vector<std::array<std::size_t, 4>>& tetrahedra,
                 PictureMoment& moment) {
  constexpr double inward = 1e-6;  // of an edge: the plane itself is not cut away
  TriangleMesh& surface = moment.surface;
  const auto height = [&](std::size_t v) { return cut.beyond(surface.vertices[v]); };
  for (const auto& corners : tetrahedra) {
    std::vector<std::size_t> beyond;
    std::vector<std::size_t> within;
    for (const std::size_t c : corners) {
      (height(c) > 0 ? beyond : within).push_back(c);
    }
    std::vector<Index> polygon;
    for (std::size_t i = 0; i < beyond.size(); ++i) {
      for (std::size_t k = 0; k < within.size(); ++k) {
        // Around the polygon of four: (0, 0), (0, 1), (1, 1), (1, 0).
        const std::size_t a = beyond[i];
        const std::size_t b = within[i % 2 == 0 ? k : within.size() - 1 - k];
        const double part = std::min(1.0, height(a) / (height(a) - height(b)) + inward);
        polygon.push_back(narrow<Index>(surface.vertices.size()));
        surface.vertices.emplace_back((1 - part) * surface.vertices[a] + part * surface.vertices[b]);
        moment.values.push_back((1 - part) * moment.values[a] + part * moment.values[b]);
      }
    }
    for (std::size_t i = 2; i < polygon.size(); ++i) {
      std::array<Index, 3> face{polygon[0], polygon[i - 1], polygon[i]};
      const Vec3& at = surface.vertices[face[0]];
      if ((surface.vertices[face[1]] - at).cross(surface.vertices[face[2]] - at).dot(cut.normal) < 0) {
        std::swap(face[1], face[2]);
      }
      surface.triangles.push_back(face);
    }
  }
}

}  // namespace tunica
