// S. F. F. Gibson: Constrained elastic surface nets: generating smooth surfaces from binary segmented data. MICCAI
// 1998. B. O'Donoghue, E. Candes: Adaptive restart for accelerated gradient schemes. Found. Comput. Math. 15 (2015).
#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/volume/cubes/cell_crossings.hpp"
#include "tunica/volume/smoothing/detail/local_quadrics.hpp"
#include "tunica/volume/smoothing/detail/vertex_neighbours.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace tunica {
namespace {

constexpr std::size_t vertices_per_block = 4096;
/// Vertices move by at most this many voxels along each axis: a little less than half, so that two walls one voxel
/// apart cannot meet.
constexpr double reach = 0.49;
/// A component of 100 voxels or more keeps its volume to this fraction.
constexpr double most_volume_change = 1e-3;
/// A triangle is spoilt when its normal turns by more than the angle with this cosine, or its shape falls below this
/// ratio of twice its area to its longest edge squared.
constexpr double least_turned_cosine = 0.1;
constexpr double least_shape = 0.02;

/// Sum over [0, size) of term(i), in blocks: the same whatever the number of threads.
template <typename Term>
double sum_blocks(std::size_t size, const Term& term) {
  std::vector<double> parts((size + vertices_per_block - 1) / vertices_per_block, 0.0);
  parallel_for_blocks(size, vertices_per_block, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      sum += term(i);
    }
    parts[begin / vertices_per_block] = sum;
  });
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

template <typename Body>
void for_all(std::size_t size, const Body& body) {
  parallel_for_blocks(size, vertices_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      body(i);
    }
  });
}

/// Number of the connected component of each vertex, and how many there are.
std::pair<std::vector<Index>, std::size_t> label_components(const TriangleMesh& mesh) {
  DisjointSets pieces(mesh.vertices.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    pieces.join(a, b);
    pieces.join(a, c);
  }
  std::vector<Index> number(mesh.vertices.size());
  std::size_t count = 0;
  for (Index v = 0; v < number.size(); ++v) {
    number[v] = pieces.root(v) == v ? narrow<Index>(count++) : number[pieces.root(v)];
  }
  return {number, count};
}

class Smoother {
public:
  /// Works in voxel coordinates, in which the limits are cubes.
  Smoother(const TriangleMesh& mesh, const Mask& grid, bool open_border)
      : mesh_(mesh),
        to_world_(grid.affine().leftCols<3>()),
        origin_(grid.affine().col(3)),
        start_(mesh.vertices.size()),
        boundary_(mesh.vertices.size(), false),
        low_(mesh.vertices.size()),
        high_(mesh.vertices.size()) {
    const Mat3 to_voxel = to_world_.inverse();
    mirrored_ = to_world_.determinant() < 0;
    for (std::size_t v = 0; v < start_.size(); ++v) {
      start_[v] = to_voxel * (mesh.vertices[v] - origin_);
      low_[v] = start_[v].array() - reach;
      high_[v] = start_[v].array() + reach;
      for (int axis = 0; open_border && axis < 3; ++axis) {
        const double last = real(grid.dims()[axis]) - 0.5;
        const double plane = start_[v][axis] < 0.5 * last ? -0.5 : last;
        if (std::abs(start_[v][axis] - plane) < 1e-6) {
          boundary_[v] = true;
          low_[v][axis] = high_[v][axis] = start_[v][axis];
        }
      }
    }
    now_ = start_;
  }

  StaircaseResult run(const Progress& progress) {
    VertexNeighbours neighbours(mesh_, boundary_);
    if (free_lids(neighbours)) {
      neighbours = VertexNeighbours(mesh_, boundary_);
    }
    std::tie(component_, components_) = label_components(mesh_);
    // The boundary first, as curves in their planes; then the rest, with the boundary given.
    relax(neighbours, boundary_, most_iterations, {});
    std::vector<bool> inner(boundary_);
    inner.flip();
    relax(neighbours, inner, most_iterations, [&](double fraction) { advance(progress, 0.3 * fraction); });
    remove_local_drift(neighbours);
    move_to_quadrics(neighbours);
    // Neighbours may have fitted over different radii.
    relax(neighbours, inner, most_last_iterations, {});
    advance(progress, 0.9);
    StaircaseResult result;
    // Holding vertices back changes the volume, and offsetting for the volume may spoil a triangle: until neither. In
    // the end moves are only taken back, and the surface as it was has no fault.
    const CellCrossings crossings(mesh_.triangles, start_);
    std::size_t held = 1;
    for (int round = 0; round < most_corrections && held > 0; ++round) {
      correct_volume();
      held = hold_back_spoilt() + hold_back_crossing(crossings);
      result.held_back += held;
    }
    while (held > 0 || hold_back_volume()) {
      held = hold_back_spoilt() + hold_back_crossing(crossings);
    }
    for (std::size_t v = 0; v < start_.size(); ++v) {
      result.largest_move = std::max(result.largest_move, (now_[v] - start_[v]).cwiseAbs().maxCoeff());
    }
    const std::vector<double> changes = volume_changes();
    result.volume_change = changes.empty() ? 0 : *std::ranges::max_element(changes);
    TUNICA_ASSERT(result.largest_move < 0.5 && result.volume_change <= most_volume_change);
    advance(progress, 1.0);
    return result;
  }

  /// The vertices where they are now, in world mm.
  [[nodiscard]] std::vector<Vec3> places() const {
    std::vector<Vec3> result = mesh_.vertices;
    for_all(now_.size(), [&](std::size_t v) {
      if (now_[v] != start_[v]) {
        result[v] = to_world_ * now_[v] + origin_;
      }
    });
    return result;
  }

private:
  /// The vertices of lids lie on the image's border, but have no edge of the boundary. @return whether there are any
  bool free_lids(const VertexNeighbours& neighbours) {
    bool any = false;
    for (std::size_t v = 0; v < boundary_.size(); ++v) {
      if (boundary_[v] && neighbours.alone(v)) {
        boundary_[v] = false;
        any = true;
      }
    }
    return any;
  }

  static constexpr int most_iterations = 240;
  static constexpr int most_last_iterations = 3;
  static constexpr int most_corrections = 8;

  [[nodiscard]] Vec3 confine(std::size_t v, const Vec3& p) const { return p.cwiseMax(low_[v]).cwiseMin(high_[v]); }

  /// Minimises the sum over `active` vertices of degree * |laplacian|^2. With the degrees as metric the gradient is the
  /// laplacian of the laplacian, whose eigenvalues are at most 4, and the limits stay separate for each coordinate.
  void relax(const VertexNeighbours& neighbours, const std::vector<bool>& active, int iterations,
             const Progress& progress) {
    constexpr double step = 0.25;
    constexpr double tolerance = 1e-4;
    const std::size_t size = now_.size();
    const auto moving = std::ranges::count(active, true);
    if (moving == 0) {
      return;
    }
    std::vector<Vec3> ahead = now_;
    std::vector<Vec3> bend(size, Vec3::Zero());
    std::vector<Vec3> next = now_;
    double momentum = 1;
    for (int iteration = 0; iteration < iterations; ++iteration) {
      advance(progress, real(iteration) / iterations);
      for_all(size, [&](std::size_t v) {
        if (active[v] && !neighbours.alone(v)) {
          bend[v] = neighbours.laplacian(ahead, v);
        }
      });
      for_all(size, [&](std::size_t v) {
        if (active[v] && !neighbours.alone(v)) {
          next[v] = confine(v, ahead[v] - step * neighbours.laplacian(bend, v));
        }
      });
      const double uphill =
          sum_blocks(size, [&](std::size_t v) { return (ahead[v] - next[v]).dot(next[v] - now_[v]); });
      const double moved =
          std::sqrt(sum_blocks(size, [&](std::size_t v) { return (next[v] - now_[v]).squaredNorm(); }) / real(moving));
      const double faster = uphill > 0 ? 1 : 0.5 * (1 + std::sqrt(1 + 4 * momentum * momentum));
      const double carry = uphill > 0 ? 0 : (momentum - 1) / faster;
      for_all(size, [&](std::size_t v) {
        ahead[v] = next[v] + carry * (next[v] - now_[v]);
        now_[v] = next[v];
      });
      momentum = faster;
      if (moved < tolerance) {
        break;
      }
    }
  }

  /// Area vectors of the triangles summed at the vertices, in voxel coordinates, outward, not normalised.
  [[nodiscard]] std::vector<Vec3> normals(const std::vector<Vec3>& at) const {
    std::vector<Vec3> result(at.size(), Vec3::Zero());
    for (const auto& [a, b, c] : mesh_.triangles) {
      const Vec3 n = (mirrored_ ? -0.5 : 0.5) * (at[b] - at[a]).cross(at[c] - at[a]);
      result[a] += n;
      result[b] += n;
      result[c] += n;
    }
    return result;
  }

  /// Moves each value `steps` times towards the mean of its neighbours, by half of share(vertex).
  template <typename Share>
  static void spread(const VertexNeighbours& neighbours, std::vector<double>& values, int steps, const Share& share) {
    std::vector<double> next = values;
    for (int i = 0; i < steps; ++i) {
      for_all(values.size(), [&](std::size_t v) {
        if (!neighbours.alone(v)) {
          next[v] = values[v] - 0.5 * share(v) * neighbours.laplacian(values, v);
        }
      });
      values.swap(next);
    }
  }

  /// Radius by which the surface is bent at each vertex, in voxels: one over the mean curvature.
  [[nodiscard]] std::vector<double> radii(const VertexNeighbours& neighbours, const std::vector<Vec3>& normal) const {
    constexpr int steps = 4;  // a few triangles say little
    std::vector<double> bend(now_.size(), 0.0);
    std::vector<double> squared_edge(now_.size(), 0.0);
    for_all(now_.size(), [&](std::size_t v) {
      if (!neighbours.alone(v)) {
        bend[v] = neighbours.laplacian(now_, v).dot(normal[v].normalized());
        squared_edge[v] = neighbours.squared_edge(now_, v);
      }
    });
    const auto all = [](std::size_t) { return 1.0; };
    spread(neighbours, bend, steps, all);
    spread(neighbours, squared_edge, steps, all);
    std::vector<double> result(now_.size());
    for_all(now_.size(), [&](std::size_t v) { result[v] = squared_edge[v] / (2 * std::abs(bend[v]) + 1e-9); });
    return result;
  }

  /// A thin part bends less when it is thinner, and would shrink up to the limits. The staircase itself moves as much
  /// outward as inward over a few steps, so the mean move along the normal over some neighbours is taken back. The
  /// steps are as long as the root of the radius: the mean is taken over a square of a width in proportion, and so does
  /// not mix a small part with what it joins.
  void remove_local_drift(const VertexNeighbours& neighbours) {
    constexpr int steps = 240;
    constexpr double radius_of_all_steps = 200;
    constexpr double least_share = 0.01;
    const std::vector<Vec3> normal = normals(now_);
    const std::vector<double> radius = radii(neighbours, normal);
    std::vector<double> drift(now_.size(), 0.0);
    for_all(now_.size(), [&](std::size_t v) { drift[v] = (now_[v] - start_[v]).dot(normal[v].normalized()); });
    spread(neighbours, drift, steps,
           [&](std::size_t v) { return std::clamp(radius[v] / radius_of_all_steps, least_share, 1.0); });
    for_all(now_.size(), [&](std::size_t v) { now_[v] = confine(v, now_[v] - drift[v] * normal[v].normalized()); });
  }

  /// Moves each vertex along the normal to the quadric that fits the edges around it best. The surface so far says
  /// where that is to be looked for, and what the edges' middles are worth.
  void move_to_quadrics(const VertexNeighbours& neighbours) {
    std::vector<Vec3> world(now_.size());
    for_all(now_.size(), [&](std::size_t v) { world[v] = to_world_ * now_[v]; });
    const std::vector<Vec3> normal = normals(world);
    std::vector<EdgeCrossing> crossings(now_.size());
    for_all(now_.size(), [&](std::size_t v) {
      crossings[v] = {world[v], normal[v].normalized(), to_world_ * start_[v], 0.5 * to_world_.col(edge_axis(v))};
    });
    const double voxel = std::cbrt(std::abs(to_world_.determinant()));
    const std::vector<double> offset = local_quadric_offsets(crossings, neighbours, boundary_, voxel);
    const Mat3 to_voxel = to_world_.inverse();
    for_all(now_.size(),
            [&](std::size_t v) { now_[v] = confine(v, now_[v] + offset[v] * (to_voxel * crossings[v].normal)); });
  }

  /// The axis of the voxels' edge on whose middle a vertex was: along it, it is between two samples.
  [[nodiscard]] int edge_axis(std::size_t v) const {
    int axis = 0;
    double most = -1;
    for (int i = 0; i < 3; ++i) {
      const double off = low_[v][i] < high_[v][i] ? std::abs(start_[v][i] - std::round(start_[v][i])) : 0.0;
      if (off > most) {
        most = off;
        axis = i;
      }
    }
    return axis;
  }

  /// Volume swept by each component from its start, in voxels, outward positive; exact for straight moves of corners.
  [[nodiscard]] std::vector<double> swept() const {
    std::vector<double> volume(components_, 0.0);
    for (const auto& [a, b, c] : mesh_.triangles) {
      const Vec3 move = ((now_[a] - start_[a]) + (now_[b] - start_[b]) + (now_[c] - start_[c])) / 3;
      const auto area = [&](double t) -> Vec3 {
        const Vec3 p = start_[a] + t * (now_[a] - start_[a]);
        const Vec3 q = start_[b] + t * (now_[b] - start_[b]);
        const Vec3 r = start_[c] + t * (now_[c] - start_[c]);
        return 0.5 * (q - p).cross(r - p);
      };
      const Vec3 mean = (area(0) + 4 * area(0.5) + area(1)) / 6;
      volume[component_[a]] += (mirrored_ ? -1 : 1) * mean.dot(move);
    }
    return volume;
  }

  void correct_volume() {
    constexpr int most_steps = 40;
    for (int iteration = 0; iteration < most_steps; ++iteration) {
      const std::vector<double> excess = swept();
      const std::vector<Vec3> normal = normals(now_);
      // How much volume a unit of offset gains where the limits leave room for it.
      std::vector<double> gain(components_, 0.0);
      std::vector<double> size(components_, 0.0);
      for (std::size_t v = 0; v < now_.size(); ++v) {
        const Vec3 direction = normal[v].normalized();
        const double sign = excess[component_[v]] > 0 ? -1 : 1;
        const Vec3 moved = confine(v, now_[v] + sign * 1e-3 * direction) - now_[v];
        gain[component_[v]] += sign * 1e3 * moved.dot(normal[v]) / 3;
        size[component_[v]] += normal[v].norm() / 3;
      }
      bool done = true;
      std::vector<double> offset(components_, 0.0);
      for (std::size_t c = 0; c < components_; ++c) {
        if (std::abs(excess[c]) > 1e-5 * size[c] && gain[c] > 1e-3 * size[c]) {
          offset[c] = -excess[c] / gain[c];
          done = false;
        }
      }
      if (done) {
        return;
      }
      for_all(now_.size(),
              [&](std::size_t v) { now_[v] = confine(v, now_[v] + offset[component_[v]] * normal[v].normalized()); });
    }
  }

  /// Where triangles turned over or got too flat, takes half of their corners' moves back, for good.
  std::size_t hold_back_spoilt() {
    std::vector<bool> spoilt(now_.size(), false);
    for (const auto& t : mesh_.triangles) {
      if (is_spoilt(t)) {
        spoilt[t[0]] = spoilt[t[1]] = spoilt[t[2]] = true;
      }
    }
    return hold_back(spoilt);
  }

  /// The same where triangles met.
  std::size_t hold_back_crossing(const CellCrossings& crossings) {
    std::vector<bool> crossing(now_.size(), false);
    for (const auto& pair : crossings.find(places())) {
      for (const Index t : pair) {
        for (const Index v : mesh_.triangles[t]) {
          crossing[v] = now_[v] != start_[v];
        }
      }
    }
    return hold_back(crossing);
  }

  std::size_t hold_back(const std::vector<bool>& vertices) {
    std::size_t count = 0;
    for (std::size_t v = 0; v < now_.size(); ++v) {
      if (vertices[v]) {
        const Vec3 half = 0.5 * (now_[v] - start_[v]);
        now_[v] = half.norm() > 1e-3 ? Vec3(start_[v] + half) : start_[v];
        low_[v] = high_[v] = now_[v];
        ++count;
      }
    }
    return count;
  }

  [[nodiscard]] bool is_spoilt(const std::array<Index, 3>& t) const {
    if (now_[t[0]] == start_[t[0]] && now_[t[1]] == start_[t[1]] && now_[t[2]] == start_[t[2]]) {
      return false;
    }
    const auto edges = [&](const std::vector<Vec3>& at) {
      return std::pair<Vec3, Vec3>(to_world_ * (at[t[1]] - at[t[0]]), to_world_ * (at[t[2]] - at[t[0]]));
    };
    const auto [p, q] = edges(start_);
    const auto [u, v] = edges(now_);
    const Vec3 before = p.cross(q);
    const Vec3 after = u.cross(v);
    const auto shape = [](const Vec3& a, const Vec3& b, const Vec3& n) {
      return n.norm() / std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
    };
    return before.dot(after) < least_turned_cosine * before.norm() * after.norm() ||
           shape(u, v, after) < std::min(least_shape, 0.5 * shape(p, q, before));
  }

  /// Where offsets within the limits could not keep a component's volume, takes half of its moves back: in the end it
  /// is as it was. @return whether there was any such component
  bool hold_back_volume() {
    const std::vector<double> changes = volume_changes();
    if (std::ranges::none_of(changes, [](double change) { return change > most_volume_change; })) {
      return false;
    }
    for (std::size_t v = 0; v < now_.size(); ++v) {
      if (changes[component_[v]] > most_volume_change) {
        const Vec3 half = 0.5 * (now_[v] - start_[v]);
        now_[v] = half.norm() > 1e-6 ? Vec3(start_[v] + half) : start_[v];
      }
    }
    return true;
  }

  /// Of each component, as a fraction of its volume; 0 of those below 100 voxels.
  [[nodiscard]] std::vector<double> volume_changes() const {
    std::vector<double> volume(components_, 0.0);
    for (const auto& [a, b, c] : mesh_.triangles) {
      volume[component_[a]] += start_[a].dot(start_[b].cross(start_[c])) / 6;
    }
    std::vector<double> change = swept();
    for (std::size_t c = 0; c < components_; ++c) {
      change[c] = std::abs(volume[c]) >= 100 ? std::abs(change[c] / volume[c]) : 0;
    }
    return change;
  }

  const TriangleMesh& mesh_;
  Mat3 to_world_;
  Vec3 origin_;
  bool mirrored_ = false;
  std::vector<Vec3> start_;     ///< voxel coordinates of the input
  std::vector<Vec3> now_;       ///< and of the surface as it is
  std::vector<bool> boundary_;  ///< vertices where the surface ends, on the image's border, with open_border
  std::vector<Vec3> low_;       ///< limits of each vertex
  std::vector<Vec3> high_;
  std::vector<Index> component_;
  std::size_t components_ = 0;
};

}  // namespace

StaircaseResult smooth_staircase(TriangleMesh& mesh, const Mask& grid, const StaircaseOptions& options) {
  require_valid(mesh);
  Smoother smoother(mesh, grid, options.open_border);
  const StaircaseResult result = smoother.run(options.progress);
  mesh.vertices = smoother.places();
  return result;
}

}  // namespace tunica
