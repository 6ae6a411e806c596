#include "shell/fit_parts.hpp"

#include "shell/target.hpp"
#include "surface/decimate.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr double most_across = 16;           // tolerances: the diagonal of a crumb's bounding box
constexpr std::size_t most_of_a_crumb = 24;  // flat triangles
constexpr std::size_t price_of_angles = 2;   // times as many for good ones
constexpr Index unused = 0xffffffff;

}  // namespace

std::vector<TriangleMesh> parts_of(const TriangleMesh& mesh, std::span<const std::array<Index, 3>> across) {
  std::vector<std::uint8_t> seen(mesh.triangles.size(), 0);
  std::vector<Index> number(mesh.vertices.size(), unused);
  std::vector<TriangleMesh> parts;
  for (std::size_t first = 0; first < mesh.triangles.size(); ++first) {
    if (seen[first] != 0) {
      continue;
    }
    seen[first] = 1;
    std::vector<Index> piece{static_cast<Index>(first)};
    for (std::size_t i = 0; i < piece.size(); ++i) {
      for (const Index t : across[piece[i]]) {
        if (t != no_neighbour && seen[t] == 0) {
          seen[t] = 1;
          piece.push_back(t);
        }
      }
    }
    std::sort(piece.begin(), piece.end());
    TriangleMesh& part = parts.emplace_back();
    for (const Index t : piece) {
      auto corners = mesh.triangles[t];
      for (Index& v : corners) {
        if (number[v] == unused) {
          number[v] = static_cast<Index>(part.vertices.size());
          part.vertices.push_back(mesh.vertices[v]);
        }
        v = number[v];
      }
      part.triangles.push_back(corners);
    }
    for (const Index t : piece) {
      for (const Index v : mesh.triangles[t]) {
        number[v] = unused;
      }
    }
  }
  return parts;
}

TriangleMesh joined(std::span<const TriangleMesh> parts) {
  TriangleMesh out;
  for (const TriangleMesh& part : parts) {
    const auto first = static_cast<Index>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const auto& [a, b, c] : part.triangles) {
      out.triangles.push_back({first + a, first + b, first + c});
    }
  }
  return out;
}

ShellMesh joined(std::span<const ShellMesh> parts) {
  std::vector<TriangleMesh> facets;
  for (const ShellMesh& part : parts) {
    facets.push_back(flat_facets(part));
  }
  TriangleMesh mesh = joined(facets);
  ShellMesh out;
  out.vertices = std::move(mesh.vertices);
  out.triangles = std::move(mesh.triangles);
  const bool corners =
      std::any_of(parts.begin(), parts.end(), [](const ShellMesh& part) { return !part.corner_normals.empty(); });
  for (const ShellMesh& part : parts) {
    out.patch = part.patch;
    out.normals.insert(out.normals.end(), part.normals.begin(), part.normals.end());
    for (std::size_t t = 0; corners && t < part.triangles.size(); ++t) {
      out.corner_normals.push_back({part.normal(t, 0), part.normal(t, 1), part.normal(t, 2)});
    }
  }
  return out;
}

ShellMesh flat_shells(const TriangleMesh& mesh, Patch patch) {
  ShellMesh shell{mesh.vertices, mesh.triangles, vertex_normals(mesh), {}, patch};
  for (const Vec3& n : facet_normals(mesh)) {
    shell.corner_normals.push_back({n, n, n});
  }
  return shell;
}

std::optional<TriangleMesh> crumb_within(const TriangleMesh& part, double tolerance, double angle) {
  if (diagonal(part) > most_across * tolerance) {
    return {};
  }
  DecimateOptions options;
  options.max_error = tolerance;
  DecimateResult plain = decimate(part, options);
  if (!plain.error_kept || plain.mesh.triangles.size() > most_of_a_crumb) {
    return {};
  }
  options.min_angle = angle;
  DecimateResult shaped = decimate(part, options);
  const bool good = shaped.error_kept && shaped.angle_held &&
                    shaped.mesh.triangles.size() <= price_of_angles * plain.mesh.triangles.size();
  return std::move((good ? shaped : plain).mesh);
}

}  // namespace tunica
