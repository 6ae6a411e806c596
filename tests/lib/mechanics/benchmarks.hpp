#pragma once

#include "tunica/core/error.hpp"
#include "tunica/mechanics/runs/solve.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <random>

/// Meshes and models of the published problems that the tests share. Numbers are unit-free: read mm, N, MPa.
namespace tunica::benchmarks {

inline constexpr double pi = std::numbers::pi;
inline constexpr double eps = 1e-9;  ///< how far from a plane a node may lie that lies in it

enum class Diagonals { one, alternating, random, other };

struct Grid {
  std::vector<Vec2> parameters;  ///< in the unit square
  ShellMesh mesh;
  std::size_t columns = 0;  ///< nodes in v per u

  [[nodiscard]] Index node(std::size_t i, std::size_t j) const { return static_cast<Index>(i * columns + j); }
};

/// nx x ny cells over the unit square, mapped. `one` cuts every cell from its first corner on, `other` across that;
/// `random` moves the inner nodes by up to 0.15 of a cell, and draws
/// diagonals and first vertices.
inline Grid make_grid(std::size_t nx, std::size_t ny, const std::function<Vec3(double u, double v)>& map,
                      Diagonals diagonals = Diagonals::one) {
  Grid grid;
  grid.columns = ny + 1;
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(-0.15, 0.15);
  for (std::size_t i = 0; i <= nx; ++i) {
    for (std::size_t j = 0; j <= ny; ++j) {
      Vec2 p(static_cast<double>(i) / static_cast<double>(nx), static_cast<double>(j) / static_cast<double>(ny));
      if (diagonals == Diagonals::random && i > 0 && i < nx && j > 0 && j < ny && !(2 * i == nx && 2 * j == ny)) {
        p += Vec2(uniform(engine) / static_cast<double>(nx), uniform(engine) / static_cast<double>(ny));
      }
      grid.parameters.push_back(p);
      grid.mesh.vertices.push_back(map(p.x(), p.y()));
    }
  }
  for (std::size_t i = 0; i < nx; ++i) {
    for (std::size_t j = 0; j < ny; ++j) {
      const Index a = grid.node(i, j), b = grid.node(i + 1, j), c = grid.node(i + 1, j + 1), d = grid.node(i, j + 1);
      const bool first = diagonals == Diagonals::one || (diagonals == Diagonals::alternating && (i + j) % 2 == 0) ||
                         (diagonals == Diagonals::random && engine() % 2 == 0);
      std::array<std::array<Index, 3>, 2> cell{{{a, b, c}, {a, c, d}}};
      if (!first) {
        cell = {{{a, b, d}, {b, c, d}}};
      }
      for (auto t : cell) {
        if (diagonals == Diagonals::random) {
          std::rotate(t.begin(), t.begin() + engine() % 3, t.end());
        }
        grid.mesh.triangles.push_back(t);
      }
    }
  }
  return grid;
}

/// Icosahedron, every face cut into frequency^2 triangles, on the sphere: 20 x frequency^2, with the sphere's normals.
inline ShellMesh make_geodesic(double radius, std::size_t frequency) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  const std::vector<Vec3> corners{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                                  {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  const std::vector<std::array<Index, 3>> faces{{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                                {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                                {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                                {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  ShellMesh mesh;
  // A node by what its corners weigh: shared edges give the same key.
  std::map<std::map<Index, std::size_t>, Index> nodes;
  for (const auto& [a, b, c] : faces) {
    const auto node = [&, a = a, b = b, c = c](std::size_t i, std::size_t j) {
      std::map<Index, std::size_t> key{{a, frequency - i - j}, {b, i}, {c, j}};
      std::erase_if(key, [](const auto& entry) { return entry.second == 0; });
      const auto [place, is_new] = nodes.emplace(key, static_cast<Index>(mesh.vertices.size()));
      if (is_new) {
        Vec3 point = Vec3::Zero();
        for (const auto& [corner, weight] : key) {
          point += static_cast<double>(weight) * corners[corner];
        }
        mesh.normals.push_back(point.normalized());
        mesh.vertices.emplace_back(radius * point.normalized());
      }
      return place->second;
    };
    for (std::size_t i = 0; i < frequency; ++i) {
      for (std::size_t j = 0; i + j < frequency; ++j) {
        mesh.triangles.push_back({node(i, j), node(i + 1, j), node(i, j + 1)});
        if (i + j + 1 < frequency) {
          mesh.triangles.push_back({node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)});
        }
      }
    }
  }
  return mesh;
}

/// Mean over an ellipse's length of the square of the distance from its centre.
inline double mean_square_of_ellipse(double a, double b) {
  constexpr int steps = 10000;
  double whole = 0, sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double u = 2 * pi * (i + 0.5) / steps;
    const double ds = std::hypot(a * std::sin(u), b * std::cos(u));
    whole += ds;
    sum += ds * (std::pow(a * std::cos(u), 2) + std::pow(b * std::sin(u), 2));
  }
  return sum / whole;
}

/// Icosahedron split `levels` times onto the sphere: 20 x 4^levels triangles, with the sphere's normals.
inline ShellMesh make_sphere(double radius, int levels) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  ShellMesh mesh;
  mesh.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                   {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<Index, Index>, Index> middles;
    const auto middle = [&](Index a, Index b) {
      const auto [place, is_new] = middles.emplace(std::minmax(a, b), static_cast<Index>(mesh.vertices.size()));
      if (is_new) {
        const Vec3 point = mesh.vertices[a].normalized() + mesh.vertices[b].normalized();
        mesh.vertices.push_back(point);
      }
      return place->second;
    };
    std::vector<std::array<Index, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.triangles = finer;
  }
  for (Vec3& v : mesh.vertices) {
    mesh.normals.push_back(v.normalized());
    v = radius * v.normalized();
  }
  return mesh;
}

/// Triangles of a tube: along + 1 rings of `around` vertices, every other ring turned by half a spacing.
inline void add_tube_triangles(std::size_t around, std::size_t along, ShellMesh& mesh) {
  for (std::size_t j = 0; j < along; ++j) {
    for (std::size_t i = 0; i < around; ++i) {
      const auto a = static_cast<Index>(j * around + i);
      const auto b = static_cast<Index>(j * around + (i + 1) % around);
      const auto c = static_cast<Index>(a + around);
      const auto d = static_cast<Index>(b + around);
      if (j % 2 == 0) {
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {b, d, c}});
      } else {
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, d}, {a, d, c}});
      }
    }
  }
}

/// A tube along z from 0, with semi-axes a and b of its section along x and y: along + 1 rings of `around` vertices.
inline ShellMesh tube_mesh(double a, double b, double length, std::size_t around, std::size_t along) {
  ShellMesh mesh;
  for (std::size_t j = 0; j <= along; ++j) {
    for (std::size_t i = 0; i < around; ++i) {
      const double u = 2 * pi * (static_cast<double>(i) + (j % 2 == 1 ? 0.5 : 0)) / static_cast<double>(around);
      const double z = length * static_cast<double>(j) / static_cast<double>(along);
      mesh.vertices.emplace_back(a * std::cos(u), b * std::sin(u), z);
      mesh.normals.push_back(Vec3(std::cos(u) / a, std::sin(u) / b, 0).normalized());
    }
  }
  add_tube_triangles(around, along, mesh);
  return mesh;
}

/// An open vessel with an aneurysm: radius 10 + 10 exp(-((z - 30) / 10)^2) ((1 + cos angle) / 2)^2 mm, z in [0, 60] mm,
/// odd rows shifted by half a cell; 2 x around x along triangles, the surface's normals.
inline ShellMesh make_vessel(std::size_t around, std::size_t along) {
  const auto point = [](double angle, double z) {
    const double c = (1 + std::cos(angle)) / 2;
    const double r = 10 + 10 * std::exp(-(z - 30) * (z - 30) / 100) * c * c;
    return Vec3(r * std::cos(angle), r * std::sin(angle), z);
  };
  ShellMesh mesh;
  for (std::size_t j = 0; j <= along; ++j) {
    for (std::size_t i = 0; i < around; ++i) {
      const double angle = 2 * pi * (static_cast<double>(i) + (j % 2 == 1 ? 0.5 : 0)) / static_cast<double>(around);
      const double z = 60 * static_cast<double>(j) / static_cast<double>(along);
      constexpr double d = 1e-5;
      mesh.vertices.push_back(point(angle, z));
      const Vec3 around_tangent = point(angle + d, z) - point(angle - d, z);
      const Vec3 along_tangent = point(angle, z + d) - point(angle, z - d);
      mesh.normals.push_back(around_tangent.cross(along_tangent).normalized());
    }
  }
  add_tube_triangles(around, along, mesh);
  return mesh;
}

inline ShellBody flat_body(ShellMesh mesh, double young, double poisson, double thickness) {
  ShellBody body;
  body.name = "shell";
  body.mesh = std::move(mesh);
  body.curved = false;
  body.rest = Rest::flat;
  body.thickness = {thickness};
  body.material = {young, poisson, std::nullopt};
  return body;
}

/// A sphere of radius 10 mm, 1 GPa, under pressure, held by its rigid motions.
inline Model pressurised_sphere(int level, double thickness, double pressure) {
  Model model;
  ShellBody body = flat_body(make_sphere(10, level), 1000, 0.3, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  Load load;
  load.kind = PressureLoad{pressure, true};
  model.loads.push_back(load);
  return model;
}

/// What a run that must fail says, behind the kind of its error; empty where it does not fail.
inline std::string error_of(const Model& model, const RunSettings& settings) {
  try {
    solve(model, settings, [](const State&) {});
  } catch (const InputError& error) {
    return std::string("input: ") + error.what();
  } catch (const RequirementError& error) {
    return std::string("requirement: ") + error.what();
  }
  return {};
}

inline std::vector<Index> nodes_where(const ShellMesh& mesh, const std::function<bool(const Vec3&)>& condition) {
  std::vector<Index> nodes;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (condition(mesh.vertices[i])) {
      nodes.push_back(static_cast<Index>(i));
    }
  }
  return nodes;
}

inline Index nearest(const ShellMesh& mesh, const Vec3& point) {
  const auto closer = [&](const Vec3& a, const Vec3& b) {
    return (a - point).squaredNorm() < (b - point).squaredNorm();
  };
  return static_cast<Index>(std::min_element(mesh.vertices.begin(), mesh.vertices.end(), closer) -
                            mesh.vertices.begin());
}

/// Holds the components of `translation` and `rotation` ("xyz") of the nodes where the condition holds.
inline void hold(Model& model, const std::function<bool(const Vec3&)>& condition, const std::string& translation,
                 const std::string& rotation) {
  Fix fix;
  fix.nodes = nodes_where(model.shells[0].mesh, condition);
  for (std::size_t c = 0; c < 3; ++c) {
    fix.translation[c] = translation.find("xyz"[c]) != std::string::npos;
    fix.rotation[c] = rotation.find("xyz"[c]) != std::string::npos;
  }
  model.fixes.push_back(fix);
}

inline RunSettings linear_run() {
  RunSettings settings;
  settings.kind = StaticRun{true, {1}};
  return settings;
}

inline RunSettings nonlinear_run(std::vector<double> factors) {
  RunSettings settings;
  settings.kind = StaticRun{false, std::move(factors)};
  return settings;
}

inline State last_state(const Model& model, const RunSettings& settings) {
  State last;
  solve(model, settings, [&](const State& state) { last = state; });
  return last;
}

}  // namespace tunica::benchmarks
