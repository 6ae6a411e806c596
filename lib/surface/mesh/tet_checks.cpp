#include "tunica/surface/mesh/tet_checks.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

namespace tunica {
namespace {

// The face opposite to each corner, counter-clockwise seen from outside.
constexpr std::array<std::array<std::size_t, 3>, 4> faces_of_tet = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

// A face of tetrahedron `tet` with its corners in ascending order, so that it can be found from both sides.
struct SortedFace {
  std::array<Index, 3> corners;
  Index tet;
  std::uint8_t opposite;
};

std::string place_of_tet(const TetMesh& mesh, const std::array<Index, 4>& corners) {
  const Vec3& p = mesh.vertices[corners[0]];
  return fmt::format("near ({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z());
}

bool corner_twice(std::array<Index, 4> corners) {
  std::sort(corners.begin(), corners.end());
  return std::adjacent_find(corners.begin(), corners.end()) != corners.end();
}

std::array<Index, 3> corners_of(const TetMesh& mesh, std::size_t t, std::size_t opposite) {
  const auto& [a, b, c] = faces_of_tet[opposite];
  const std::array<Index, 4>& tet = mesh.tetrahedra[t];
  return {tet[a], tet[b], tet[c]};
}

// What the rounding of the coordinates, and of the products of the sides, makes of no volume.
double rounding_of_volume(const std::array<Vec3, 4>& p) {
  double coordinate = 0;
  double side = 0;
  double area = 0;  // twice the largest face's
  for (std::size_t i = 0; i < 4; ++i) {
    coordinate = std::max(coordinate, p[i].cwiseAbs().maxCoeff());
    side = std::max(side, (p[(i + 1) % 4] - p[i]).norm());
    const auto& [a, b, c] = faces_of_tet[i];
    area = std::max(area, (p[b] - p[a]).cross(p[c] - p[a]).norm());
  }
  // A height below the spacing of the coordinates is none. A face's area has an error of side^2 eps of its own.
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  return 4 * epsilon * (coordinate + side) * std::max(area, 4 * epsilon * side * side) / 6;
}

// All faces, those of the same corners beside each other.
std::vector<SortedFace> sorted_faces(const TetMesh& mesh) {
  std::vector<SortedFace> faces;
  faces.reserve(4 * mesh.tetrahedra.size());
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::uint8_t opposite = 0; opposite < 4; ++opposite) {
      std::array<Index, 3> corners = corners_of(mesh, t, opposite);
      std::sort(corners.begin(), corners.end());
      faces.push_back({corners, narrow<Index>(t), opposite});
    }
  }
  const auto key = [](const SortedFace& face) { return std::tuple(face.corners, face.tet, face.opposite); };
  std::sort(faces.begin(), faces.end(), [&](const SortedFace& l, const SortedFace& r) { return key(l) < key(r); });
  return faces;
}

// Where neighbours lie on the same side of the face that they share, one of them is folded over.
void require_unfolded(const TetMesh& mesh, const std::string& name) {
  const std::vector<SortedFace> faces = sorted_faces(mesh);
  for (std::size_t i = 1; i < faces.size(); ++i) {
    const SortedFace &one = faces[i - 1], &other = faces[i];
    if (one.corners != other.corners) {
      continue;
    }
    const auto& [a, b, c] = one.corners;
    const auto side = [&](const SortedFace& of) {
      return tet_volume(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c],
                        mesh.vertices[mesh.tetrahedra[of.tet][of.opposite]]) > 0;
    };
    if (side(one) == side(other)) {
      throw InputError(
          fmt::format("{}: tetrahedra {} and {} {} lie on the same side of the face that they share: one of "
                      "them is folded over",
                      name, one.tet, other.tet, place_of_tet(mesh, mesh.tetrahedra[one.tet])));
    }
  }
}

}  // namespace

double tet_volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).dot((c - a).cross(d - a)) / 6;
}

std::size_t require_sound(TetMesh& mesh, const std::string& name) {
  if (mesh.tetrahedra.empty()) {
    throw InputError(fmt::format("{}: has no tetrahedra", name));
  }
  if (mesh.vertices.size() > max_index || mesh.tetrahedra.size() > max_index) {
    throw InputError(fmt::format("{}: has {} vertices and {} tetrahedra, at most {} of each are understood", name,
                                 mesh.vertices.size(), mesh.tetrahedra.size(), max_index));
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (const Vec3& p = mesh.vertices[v]; !p.allFinite()) {
      throw InputError(
          fmt::format("{}: vertex {} lies at ({}, {}, {}): coordinates must be finite", name, v, p.x(), p.y(), p.z()));
    }
  }
  std::size_t turned = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    std::array<Index, 4>& corners = mesh.tetrahedra[t];
    std::array<Vec3, 4> p;
    for (std::size_t k = 0; k < 4; ++k) {
      if (corners[k] >= mesh.vertices.size()) {
        throw InputError(fmt::format("{}: tetrahedron {} names vertex {}, but there are only {}", name, t, corners[k],
                                     mesh.vertices.size()));
      }
      p[k] = mesh.vertices[corners[k]];
    }
    const double volume = corner_twice(corners) ? 0 : tet_volume(p[0], p[1], p[2], p[3]);
    if (!(std::abs(volume) > rounding_of_volume(p))) {
      throw InputError(fmt::format("{}: tetrahedron {} {} has no volume", name, t, place_of_tet(mesh, corners)));
    }
    if (volume < 0) {
      std::swap(corners[2], corners[3]);
      ++turned;
    }
  }
  require_unfolded(mesh, name);
  return turned;
}

void require_valid(const TetMesh& mesh) {
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const Index v : mesh.tetrahedra[t]) {
      if (v >= mesh.vertices.size()) {
        throw InputError(fmt::format("tetrahedron {} names vertex {}, but there are {}", t, v, mesh.vertices.size()));
      }
      if (!std::isfinite(mesh.vertices[v].squaredNorm())) {
        throw InputError(fmt::format("vertex {} of tetrahedron {} is not finite, or too far out to reckon with", v, t));
      }
    }
  }
}

std::vector<std::array<Index, 3>> boundary_triangles(const TetMesh& mesh) {
  require_valid(mesh);
  const std::vector<SortedFace> faces = sorted_faces(mesh);
  std::vector<SortedFace> outer;
  for (auto begin = faces.begin(); begin != faces.end();) {
    const auto end = std::find_if(begin, faces.end(), [&](const auto& face) { return face.corners != begin->corners; });
    if (end - begin > 2) {
      throw InputError(
          fmt::format("{} tetrahedra share one face, the first are {}, {} and {}: its corners are {}, {} "
                      "and {}, {}",
                      end - begin, begin->tet, begin[1].tet, begin[2].tet, begin->corners[0], begin->corners[1],
                      begin->corners[2], place_of_tet(mesh, mesh.tetrahedra[begin->tet])));
    }
    if (end - begin == 1) {
      outer.push_back(*begin);
    }
    begin = end;
  }
  std::sort(outer.begin(), outer.end(), [](const SortedFace& l, const SortedFace& r) {
    return std::pair(l.tet, l.opposite) < std::pair(r.tet, r.opposite);
  });
  std::vector<std::array<Index, 3>> triangles;
  triangles.reserve(outer.size());
  for (const SortedFace& face : outer) {
    triangles.push_back(corners_of(mesh, face.tet, face.opposite));
  }
  return triangles;
}

double smallest_dihedral(const TetMesh& mesh) {
  require_valid(mesh);
  double smallest = std::numbers::pi;
  for (const std::array<Index, 4>& tet : mesh.tetrahedra) {
    std::array<Vec3, 4> normals;  // outward, as long as twice the areas
    for (std::size_t k = 0; k < 4; ++k) {
      const auto& [a, b, c] = faces_of_tet[k];
      const Vec3& p = mesh.vertices[tet[a]];
      normals[k] = (mesh.vertices[tet[b]] - p).cross(mesh.vertices[tet[c]] - p);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        // Between the faces, not their normals. By sine and cosine: acos would lose half the digits of a small angle.
        smallest = std::min(smallest, std::atan2(normals[i].cross(normals[j]).norm(), -normals[i].dot(normals[j])));
      }
    }
  }
  return smallest * 180 / std::numbers::pi;
}

}  // namespace tunica
