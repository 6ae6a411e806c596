#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <cmath>
#include <map>

/// Meshes with known answers.
namespace tunica::testing {

/// An icosahedron on the unit sphere, each triangle cut 1:4 `times` times: 20 * 4^times triangles.
inline TriangleMesh sphere(int times, double radius = 1) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  TriangleMesh mesh{{{-1, g, 0},
                     {1, g, 0},
                     {-1, -g, 0},
                     {1, -g, 0},
                     {0, -1, g},
                     {0, 1, g},
                     {0, -1, -g},
                     {0, 1, -g},
                     {g, 0, -1},
                     {g, 0, 1},
                     {-g, 0, -1},
                     {-g, 0, 1}},
                    {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                     {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                     {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  for (; times > 0; --times) {
    std::map<std::pair<Index, Index>, Index> middle;
    const auto mid = [&](Index a, Index b) {
      const auto [at, is_new] = middle.try_emplace(std::minmax(a, b), static_cast<Index>(mesh.vertices.size()));
      if (is_new) {
        mesh.vertices.push_back((mesh.vertices[a] + mesh.vertices[b]) / 2);
      }
      return at->second;
    };
    std::vector<std::array<Index, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Index ab = mid(a, b), bc = mid(b, c), ca = mid(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.triangles = finer;
    for (Vec3& p : mesh.vertices) {
      p.normalize();
    }
  }
  for (Vec3& p : mesh.vertices) {
    p = radius * p.normalized();
  }
  return mesh;
}

/// The same with the sphere's own normals.
inline ShellMesh sphere_shell(int times, double radius = 1) {
  const TriangleMesh mesh = sphere(times, radius);
  ShellMesh shell{mesh.vertices, mesh.triangles, mesh.vertices, {}, Patch::comas};
  for (Vec3& n : shell.normals) {
    n.normalize();
  }
  return shell;
}

/// Shells that are flat facets: the normals at their corners are the facets'.
inline ShellMesh flat_shells(const TriangleMesh& mesh, Patch patch) {
  ShellMesh shell{mesh.vertices, mesh.triangles, vertex_normals(mesh), {}, patch};
  for (const Vec3& n : facet_normals(mesh)) {
    shell.corner_normals.push_back({n, n, n});
  }
  return shell;
}

/// An open cylinder around z: `around` x `along` quads cut into two triangles each, z in [0, length].
inline TriangleMesh cylinder(int around, int along, double radius, double length) {
  TriangleMesh mesh;
  for (int j = 0; j <= along; ++j) {
    for (int i = 0; i < around; ++i) {
      const double phi = 2 * M_PI * (i + 0.5 * (j % 2)) / around;
      mesh.vertices.emplace_back(radius * std::cos(phi), radius * std::sin(phi), length * j / along);
    }
  }
  const auto at = [&](int i, int j) { return static_cast<Index>(j * around + (i + around) % around); };
  for (int j = 0; j < along; ++j) {
    for (int i = 0; i < around; ++i) {
      if (j % 2 == 0) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      } else {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return mesh;
}

}  // namespace tunica::testing
