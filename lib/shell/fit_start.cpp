#include "shell/fit_start.hpp"

#include "shell/fit_place.hpp"
#include "shell/normals.hpp"
#include "surface/checks.hpp"
#include "surface/decimate.hpp"
#include "surface/hausdorff.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr std::size_t ladder_top = 60'000;    // triangles: the first decimation, where the search for the count starts
constexpr double surplus = 1.5;               // of triangles, there
constexpr std::size_t most_samples = 20'000;  // vertices, and triangles: for the sampled error of flat facets
constexpr std::size_t part_that_stands_in = 4, fewest_that_stand_in = 20'000;  // triangles
constexpr double start_agreement = 0.35;                                       // of a corner's normal with its facet
constexpr double crease_cosine = 0.8;  // of the angle between two facets: sharper edges may be creases
constexpr double crease_share = 0.6;   // of that angle is there already close to the edge
constexpr double close_by = 0.08;      // of the height of the triangle

/// Largest sampled distance between flat facets and target, both ways.
double sampled_error(const TriangleMesh& mesh, const Target& target) {
  const ClosestPoint tree(mesh);
  TriangleMesh some;
  const auto& vertices = target.mesh().vertices;
  const std::size_t stride = std::max<std::size_t>(1, vertices.size() / most_samples);
  for (std::size_t v = 0; v < vertices.size(); v += stride) {
    some.vertices.push_back(vertices[v]);
  }
  double largest = 0;
  for (const double d : vertex_distances(some, tree)) {
    largest = std::max(largest, d);
  }
  some.vertices = mesh.vertices;
  const std::size_t skip = std::max<std::size_t>(1, mesh.triangles.size() / most_samples);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += skip) {
    const auto& [a, b, c] = mesh.triangles[t];
    some.vertices.emplace_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
    some.vertices.emplace_back((mesh.vertices[a] + mesh.vertices[b]) / 2);
    some.vertices.emplace_back((mesh.vertices[b] + mesh.vertices[c]) / 2);
    some.vertices.emplace_back((mesh.vertices[c] + mesh.vertices[a]) / 2);
  }
  for (const double d : vertex_distances(some, target.tree())) {
    largest = std::max(largest, d);
  }
  return largest;
}

TriangleMesh decimated(const TriangleMesh& mesh, std::size_t triangles, bool levelled = true) {
  DecimateOptions options;
  options.triangles = triangles;
  options.levelled = levelled;
  return decimate(mesh, options).mesh;
}

constexpr double needle = 10;  // degrees

}  // namespace

bool is_of_needles(const TriangleMesh& mesh) {
  double of_needles = 0, area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
    const double its_area = (q - p).cross(r - p).norm();
    area += its_area;
    of_needles += smallest_angle_degrees(p, q, r) < needle ? its_area : 0;
  }
  return of_needles > area / 2;
}

bool same_topology(const TriangleMesh& mesh, const Target& target) {
  if (mesh.triangles == target.mesh().triangles) {
    return true;
  }
  const MeshFacts x = examine(mesh), y = examine(target.mesh());
  const std::size_t points = target.point_loops();
  const auto agree = [&](std::size_t closed) {
    return x.boundary_loops + closed == y.boundary_loops && x.euler == y.euler + static_cast<long>(closed);
  };
  return x.components == y.components && (agree(0) || agree(points));
}

FitStart start_as_given(const TriangleMesh& coarse, const Target& target) {
  return {coarse, sampled_error(coarse, target), true};
}

FitStart start_of_fit(const Target& target, std::size_t triangles) {
  FitStart start;
  start.mesh = decimated(target.mesh(), triangles);
  start.flat_error = sampled_error(start.mesh, target);
  return start;
}

FitStart start_of_fit(const Target& target, double flat_error, std::size_t few, double finer_error) {
  FitStart start;
  std::optional<FitStart> finer;
  if (target.mesh().triangles.size() > ladder_top) {
    start.mesh = decimated(target.mesh(), ladder_top, false);
    start.flat_error = sampled_error(start.mesh, target);
    // Errors go with 1 / count: most of the ladder is left out.
    const double wanted = finer_error > 0 ? finer_error : flat_error;
    const double count = surplus * start.flat_error / wanted * static_cast<double>(ladder_top);
    if (count < 0.7 * static_cast<double>(ladder_top)) {
      FitStart lower;
      lower.mesh = decimated(start.mesh, static_cast<std::size_t>(std::max(count, 4.0)));
      lower.flat_error = sampled_error(lower.mesh, target);
      if (lower.flat_error <= wanted) {
        start = std::move(lower);
      }
    }
  } else {
    start.mesh = target.mesh();
  }
  const auto chosen = [&] { return start.mesh.triangles.size() < few && finer ? std::move(*finer) : std::move(start); };
  while (true) {
    const std::size_t next = start.mesh.triangles.size() * 7 / 10;
    TriangleMesh coarser = decimated(start.mesh, next);
    if (coarser.triangles.size() >= start.mesh.triangles.size()) {
      return chosen();
    }
    const double error = sampled_error(coarser, target);
    if (!finer && error > finer_error) {
      finer = start;
    }
    if (error > flat_error) {
      return chosen();
    }
    start.mesh = std::move(coarser);
    start.flat_error = error;
  }
}

std::optional<FitStart> stand_in_for(const Target& target, double flat_error) {
  const std::size_t all = target.mesh().triangles.size(), first = all / part_that_stands_in;
  if (first < fewest_that_stand_in) {
    return {};
  }
  const auto with = [&](const TriangleMesh& finer, std::size_t triangles) {
    FitStart out;
    out.mesh = decimated(finer, triangles, false);
    out.flat_error = sampled_error(out.mesh, target);
    return out;
  };
  FitStart found = with(target.mesh(), first);
  if (found.flat_error > flat_error) {
    return {};
  }
  const auto enough = static_cast<std::size_t>(surplus * static_cast<double>(first) * found.flat_error / flat_error);
  if (const std::size_t fewer = std::max(enough, fewest_that_stand_in); fewer < first / 2) {
    if (FitStart coarser = with(found.mesh, fewer); coarser.flat_error <= flat_error) {
      found = std::move(coarser);
    }
  }
  return found;
}

FitMesh prepare_fit(const FitStart& start, const Target& target) {
  const TriangleMesh& mesh = start.mesh;
  ShellMesh shell;
  shell.vertices = mesh.vertices;
  shell.triangles = mesh.triangles;
  take_normals_from(target, shell);
  FitMesh out(mesh, shell.normals);
  const auto facets = facet_normals(mesh);
  const auto across = neighbours(mesh, incidence(mesh));
  std::vector<std::array<bool, 3>> crease(mesh.triangles.size(), {false, false, false});
  std::vector<std::uint8_t> creases_at(mesh.vertices.size(), 0);
  const auto normal_near = [&](std::size_t t, std::size_t k) {
    const auto& v = mesh.triangles[t];
    const Vec3 middle = (mesh.vertices[v[k]] + mesh.vertices[v[(k + 1) % 3]]) / 2;
    const Vec3 at = middle + close_by * (mesh.vertices[v[(k + 2) % 3]] - middle);
    const auto foot = target.closest_facing(at, facets[t], target.diagonal());
    return foot ? foot->facet_normal : facets[t];
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = across[t][k];
      if (other == no_neighbour || other < t || facets[t].dot(facets[other]) > crease_cosine) {
        continue;
      }
      std::size_t l = 0;
      while (mesh.triangles[other][l] != mesh.triangles[t][(k + 1) % 3]) {
        ++l;
      }
      const double turn = std::acos(std::clamp(facets[t].dot(facets[other]), -1.0, 1.0));
      const double near = std::acos(std::clamp(normal_near(t, k).dot(normal_near(other, l)), -1.0, 1.0));
      if (near > crease_share * turn) {
        crease[t][k] = crease[other][l] = true;
        ++creases_at[mesh.triangles[t][k]];
        ++creases_at[mesh.triangles[t][(k + 1) % 3]];
      }
    }
  }
  // Around each node with creases the triangles between two of them share a normal: the mean of their facets'.
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto node = static_cast<Index>(v);
    if (creases_at[v] < (out.on_boundary[v] != 0 ? 1 : 2)) {
      continue;
    }
    std::vector<Index> open = out.around[v];
    Index sector_number = 0;
    while (!open.empty()) {
      std::vector<Index> sector{open.back()};
      open.pop_back();
      for (std::size_t i = 0; i < sector.size(); ++i) {
        const Index t = sector[i];
        for (std::size_t k = 0; k < 3; ++k) {
          const bool at_node = mesh.triangles[t][k] == node || mesh.triangles[t][(k + 1) % 3] == node;
          const auto found = at_node && !crease[t][k] ? std::find(open.begin(), open.end(), across[t][k]) : open.end();
          if (found != open.end()) {
            sector.push_back(*found);
            open.erase(found);
          }
        }
      }
      Vec3 normal = Vec3::Zero();
      for (const Index t : sector) {
        const std::size_t c = out.corner_of(t, node);
        const Vec3 a = mesh.vertices[mesh.triangles[t][(c + 1) % 3]] - mesh.vertices[v];
        const Vec3 b = mesh.vertices[mesh.triangles[t][(c + 2) % 3]] - mesh.vertices[v];
        normal += std::atan2(a.cross(b).norm(), a.dot(b)) * facets[t];
      }
      if (sector_number == 0) {
        out.normals[v] = normal.normalized();
        ++sector_number;
        continue;
      }
      const Index slot = out.add_slot(normal.normalized(), sector_number++);
      for (const Index t : sector) {
        out.slots[t][out.corner_of(t, node)] = slot;
      }
    }
  }
  // Where facets fold so that no normal suits them, they stay flat there for the time being.
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (out.normals[out.slots[t][k]].dot(facets[t]) < start_agreement && facets[t].squaredNorm() > 0.5) {
        out.slots[t][k] = out.add_slot(facets[t], out.fresh_sector(mesh.triangles[t][k]));
      }
    }
  }
  return out;
}

}  // namespace tunica
