#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <random>
#include <utility>

/// Meshes with known answers, for the tests of this room and of those above it.
namespace tunica::shapes {

inline TriangleMesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}}};
}

/// Splits each triangle into four by its edges' midpoints.
inline TriangleMesh split(const TriangleMesh& mesh) {
  TriangleMesh fine{mesh.vertices, {}};
  std::map<std::pair<Index, Index>, Index> middles;
  const auto middle = [&](Index i, Index j) {
    const auto [it, is_new] = middles.try_emplace(std::minmax(i, j), static_cast<Index>(fine.vertices.size()));
    if (is_new) {
      fine.vertices.push_back(0.5 * (mesh.vertices[i] + mesh.vertices[j]));
    }
    return it->second;
  };
  for (const auto& [i, j, k] : mesh.triangles) {
    const Index ij = middle(i, j);
    const Index jk = middle(j, k);
    const Index ki = middle(k, i);
    fine.triangles.insert(fine.triangles.end(), {{i, ij, ki}, {ij, j, jk}, {ki, jk, k}, {ij, jk, ki}});
  }
  return fine;
}

/// A sphere about the origin from an octahedron: 8 * 4^level triangles.
inline TriangleMesh sphere(int level, double radius = 1) {
  TriangleMesh mesh{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
                    {{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}}};
  for (int i = 0; i < level; ++i) {
    mesh = split(mesh);
    for (Vec3& v : mesh.vertices) {
      v.normalize();
    }
  }
  for (Vec3& v : mesh.vertices) {
    v *= radius;
  }
  return mesh;
}

/// A cone of n triangles around one vertex, the first or the last, open at its rim or closed by a second one below.
inline TriangleMesh fan(std::size_t n, bool closed, bool tip_first) {
  TriangleMesh mesh;
  const Index first = tip_first ? 1 : 0;
  const Index tip = tip_first ? 0 : static_cast<Index>(n);
  const Index bottom = static_cast<Index>(n + 1);
  mesh.vertices.resize(closed ? n + 2 : n + 1);
  mesh.vertices[tip] = {0, 0, 1};
  if (closed) {
    mesh.vertices[bottom] = {0, 0, -1};
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    const Index from = static_cast<Index>(first + i);
    const Index to = static_cast<Index>(first + (i + 1) % n);
    mesh.vertices[from] = {std::cos(angle), std::sin(angle), 0};
    mesh.triangles.push_back({from, to, tip});
    if (closed) {
      mesh.triangles.push_back({to, from, bottom});
    }
  }
  return mesh;
}

/// An n by m grid in the plane z = height over [0, width] x [0, depth].
inline TriangleMesh plane(std::size_t n, std::size_t m, double width = 1, double depth = 1, double height = 0) {
  TriangleMesh mesh;
  for (std::size_t j = 0; j <= m; ++j) {
    for (std::size_t i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(width * static_cast<double>(i) / static_cast<double>(n),
                                 depth * static_cast<double>(j) / static_cast<double>(m), height);
    }
  }
  const auto at = [&](std::size_t i, std::size_t j) { return static_cast<Index>(j * (n + 1) + i); };
  for (std::size_t j = 0; j < m; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// An open tube around the z axis: n segments around, m along.
inline TriangleMesh tube(std::size_t n, std::size_t m, double radius = 1, double length = 4) {
  TriangleMesh mesh;
  for (std::size_t j = 0; j <= m; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
      mesh.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle),
                                 length * static_cast<double>(j) / static_cast<double>(m));
    }
  }
  const auto at = [&](std::size_t i, std::size_t j) { return static_cast<Index>(j * n + i % n); };
  for (std::size_t j = 0; j < m; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// A closed torus around the z axis: genus 1.
inline TriangleMesh torus(std::size_t n, std::size_t m, double major = 3, double minor = 1) {
  TriangleMesh mesh;
  for (std::size_t j = 0; j < m; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      const double u = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
      const double v = 2 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(m);
      const double r = major + minor * std::cos(v);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), minor * std::sin(v));
    }
  }
  const auto at = [&](std::size_t i, std::size_t j) { return static_cast<Index>(j % m * n + i % n); };
  for (std::size_t j = 0; j < m; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// Both meshes in one.
inline TriangleMesh together(TriangleMesh one, const TriangleMesh& other) {
  const auto offset = static_cast<Index>(one.vertices.size());
  one.vertices.insert(one.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& [i, j, k] : other.triangles) {
    one.triangles.push_back({i + offset, j + offset, k + offset});
  }
  return one;
}

inline TriangleMesh moved(TriangleMesh mesh, const Vec3& by, double scale = 1) {
  for (Vec3& v : mesh.vertices) {
    v = scale * v + by;
  }
  return mesh;
}

/// Each vertex moved by up to `amplitude` along each axis.
inline TriangleMesh shaken(TriangleMesh mesh, double amplitude, std::uint32_t seed) {
  std::mt19937 random(seed);
  for (Vec3& v : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) {
      v[axis] += amplitude * (2 * static_cast<double>(random()) / 4294967295.0 - 1);
    }
  }
  return mesh;
}

/// Triangles thrown at random into the unit cube, some of them needles.
inline TriangleMesh soup(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967295.0; };
  TriangleMesh mesh;
  for (std::size_t t = 0; t < count; ++t) {
    const Vec3 centre(unit(), unit(), unit());
    const double size = 0.3 * unit();
    for (int corner = 0; corner < 3; ++corner) {
      const double thin = t % 5 == 0 ? 1e-9 : 1;
      mesh.vertices.push_back(centre + size * Vec3(unit() - 0.5, thin * (unit() - 0.5), thin * (unit() - 0.5)));
    }
    const auto first = static_cast<Index>(3 * t);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

}  // namespace tunica::shapes
