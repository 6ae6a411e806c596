#include "tunica/volume/cubes/openings.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

namespace tunica {
namespace {

constexpr std::size_t no_opening = ~std::size_t{0};
/// sin^2 over cos^2 at 55 degrees.
constexpr double steepest_end = 2;
/// Of all squares: a wall that turns less about the normal of the plane is a sheet.
constexpr double least_turn = 0.01;

/// One face of the image: its voxels by two axes, and the opening that each belongs to.
class ImageFace {
public:
  ImageFace(const Mask& mask, int axis, bool upper)
      : mask_(mask),
        axis_(axis),
        upper_(upper),
        across_(axis == 0 ? 1 : 0, axis == 2 ? 1 : 2),
        size_(mask.dims()[across_.first], mask.dims()[across_.second]),
        opening_(size_.first * size_.second, no_opening) {}

  /// Finds the openings: voxels of the selection that share an edge within the face.
  void find(std::vector<Opening>& openings) {
    const Mat3 axes = mask_.affine().leftCols<3>();
    const double voxel_area = axes.col(across_.first).cross(axes.col(across_.second)).norm();
    for (std::size_t start = 0; start < opening_.size(); ++start) {
      if (!selected(start) || opening_[start] != no_opening) {
        continue;
      }
      check_interrupt();
      Vec3 sum = Vec3::Zero();
      std::size_t voxels = 0;
      std::vector<std::size_t> front{start};
      opening_[start] = openings.size();
      while (!front.empty()) {
        const std::size_t at = front.back();
        front.pop_back();
        ++voxels;
        sum += index_of(at);
        const auto visit = [&](std::size_t next) {
          if (selected(next) && opening_[next] == no_opening) {
            opening_[next] = openings.size();
            front.push_back(next);
          }
        };
        const std::size_t a = at % size_.first;
        if (a > 0) {
          visit(at - 1);
        }
        if (a + 1 < size_.first) {
          visit(at + 1);
        }
        if (at >= size_.first) {
          visit(at - size_.first);
        }
        if (at + size_.first < opening_.size()) {
          visit(at + size_.first);
        }
      }
      openings.push_back({axis_, upper_, voxels, real(voxels) * voxel_area,
                          axes * (sum / real(voxels)) + mask_.affine().col(3), false});
    }
  }

  /// The opening whose rim has a vertex of the surface, in voxel coordinates; none if it is not on this face.
  [[nodiscard]] std::size_t opening_at(const Vec3& index) const {
    if (std::abs(index[axis_] - place()) > on_grid) {
      return no_opening;
    }
    const auto near = [](double x, std::size_t size) {
      const auto voxel = [&](double at) { return truncated<std::size_t>(std::clamp(at, 0.0, real(size - 1))); };
      return std::array{voxel(std::floor(x)), voxel(std::ceil(x))};
    };
    for (const std::size_t a : near(index[across_.first], size_.first)) {
      for (const std::size_t b : near(index[across_.second], size_.second)) {
        if (opening_[a + size_.first * b] != no_opening) {
          return opening_[a + size_.first * b];
        }
      }
    }
    return no_opening;
  }

  [[nodiscard]] std::vector<bool> closed(const std::vector<Opening>& openings) const {
    std::vector<bool> lids(opening_.size());
    bool any = false;
    for (std::size_t i = 0; i < lids.size(); ++i) {
      lids[i] = opening_[i] != no_opening && !openings[opening_[i]].is_end;
      any |= lids[i];
    }
    return any ? lids : std::vector<bool>{};
  }

private:
  [[nodiscard]] double place() const { return upper_ ? real(mask_.dims()[axis_]) - 0.5 : -0.5; }
  [[nodiscard]] std::array<std::size_t, 3> voxel_of(std::size_t at) const {
    std::array<std::size_t, 3> voxel{};
    voxel[axis_] = upper_ ? mask_.dims()[axis_] - 1 : 0;
    voxel[across_.first] = at % size_.first;
    voxel[across_.second] = at / size_.first;
    return voxel;
  }
  [[nodiscard]] bool selected(std::size_t at) const {
    const auto voxel = voxel_of(at);
    return mask_(voxel[0], voxel[1], voxel[2]);
  }
  [[nodiscard]] Vec3 index_of(std::size_t at) const {
    const auto voxel = voxel_of(at);
    Vec3 index(real(voxel[0]), real(voxel[1]), real(voxel[2]));
    index[axis_] = place();
    return index;
  }

  const Mask& mask_;
  int axis_;
  bool upper_;
  std::pair<int, int> across_;
  std::pair<std::size_t, std::size_t> size_;
  std::vector<std::size_t> opening_;
};

/// The surface around rims: its normals without the staircase, and who is whose neighbour.
class RimSurface {
public:
  /// @param on_border  vertices; triangles at them stand upright on the border, whatever the wall does, and do not
  /// count
  RimSurface(const TriangleMesh& mesh, const std::vector<bool>& on_border)
      : mesh_(mesh), first_(mesh.vertices.size() + 1, 0) {
    const auto for_each_edge = [&](const auto& visit) {
      for (const auto& t : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
          visit(t[i], t[(i + 1) % 3]);
          visit(t[(i + 1) % 3], t[i]);
        }
      }
    };
    for_each_edge([&](Index a, Index) { ++first_[a + 1]; });
    for (std::size_t v = 0; v + 1 < first_.size(); ++v) {
      first_[v + 1] += first_[v];
    }
    neighbours_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for_each_edge([&](Index a, Index b) { neighbours_[next[a]++] = b; });
    normals_.assign(mesh.vertices.size(), Vec3::Zero());
    for (const auto& t : mesh.triangles) {
      if (on_border[t[0]] || on_border[t[1]] || on_border[t[2]]) {
        continue;
      }
      const Vec3 normal =
          (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]) / 6;
      for (const Index v : t) {
        normals_[v] += normal;
      }
    }
    // Twice the mean with the neighbours: steps of the staircase that are a few voxels long still show.
    for (int pass = 0; pass < 2; ++pass) {
      check_interrupt();
      std::vector<Vec3> mean = normals_;
      for (std::size_t v = 0; v < mean.size(); ++v) {
        for (std::size_t n = first_[v]; n < first_[v + 1]; ++n) {
          mean[v] += normals_[neighbours_[n]];
        }
        mean[v] /= real(first_[v + 1] - first_[v] + 1);
      }
      normals_.swap(mean);
    }
  }

  /// Mean of the squares of the unit normals, weighted by area, over what can be reached along the surface from some
  /// vertices and lies within `reach` of one of them. Zero where there are none.
  [[nodiscard]] Mat3 turn(const std::vector<Index>& rim, double reach) {
    std::vector<std::pair<Index, Index>> front;  // vertex, and the one of the rim that it is reached from
    ++round_;
    seen_.resize(mesh_.vertices.size(), 0);
    for (const Index v : rim) {
      seen_[v] = round_;
      front.emplace_back(v, v);
    }
    Mat3 squares = Mat3::Zero();
    double whole = 0;
    for (std::size_t at = 0; at < front.size(); ++at) {
      if (at % 65536 == 0) {
        check_interrupt();
      }
      const auto [v, from] = front[at];
      if (const double area = normals_[v].norm(); area > 0) {
        squares += normals_[v] * normals_[v].transpose() / area;
        whole += area;
      }
      for (std::size_t n = first_[v]; n < first_[v + 1]; ++n) {
        const Index next = neighbours_[n];
        if (seen_[next] != round_ && (mesh_.vertices[next] - mesh_.vertices[from]).norm() <= reach) {
          seen_[next] = round_;
          front.emplace_back(next, from);
        }
      }
    }
    return whole > 0 ? Mat3(squares / whole) : squares;
  }

private:
  const TriangleMesh& mesh_;
  std::vector<std::size_t> first_;
  std::vector<Index> neighbours_;
  std::vector<Vec3> normals_;  ///< area vectors
  std::vector<std::uint32_t> seen_;
  std::uint32_t round_ = 0;
};

bool turns_about(const Mat3& squares, const Vec3& normal) {
  const Vec3 u = normal.unitOrthogonal();
  const Vec3 w = normal.cross(u);
  const double uu = u.dot(squares * u), ww = w.dot(squares * w), uw = u.dot(squares * w);
  const double least = 0.5 * (uu + ww) - std::hypot(0.5 * (uu - ww), uw);
  return least > least_turn && normal.dot(squares * normal) <= steepest_end * least;
}

}  // namespace

Openings find_openings(const Mask& mask, const TriangleMesh& surface) {
  require_valid(surface);
  Openings found;
  std::vector<ImageFace> faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool upper : {false, true}) {
      faces.emplace_back(mask, axis, upper);
      faces.back().find(found.openings);
    }
  }
  if (found.openings.empty()) {
    return found;
  }
  const Mat3 axes = mask.affine().leftCols<3>();
  const Mat3 to_index = axes.inverse();
  std::vector<std::vector<Index>> rims(found.openings.size());
  std::vector<bool> on_border(surface.vertices.size(), false);
  for (Index v = 0; v < surface.vertices.size(); ++v) {
    const Vec3 index = to_index * (surface.vertices[v] - mask.affine().col(3));
    for (const ImageFace& face : faces) {
      if (const std::size_t opening = face.opening_at(index); opening != no_opening) {
        rims[opening].push_back(v);
        on_border[v] = true;
      }
    }
  }
  RimSurface rim_surface(surface, on_border);
  const double two_voxels = 2 * axes.colwise().norm().maxCoeff();
  for (std::size_t i = 0; i < rims.size(); ++i) {
    Opening& opening = found.openings[i];
    const Vec3 normal = axes.col((opening.axis + 1) % 3).cross(axes.col((opening.axis + 2) % 3)).normalized();
    const Mat3 turn = rim_surface.turn(rims[i], two_voxels);
    // Of an image of two slices nothing is known but the rims.
    opening.is_end = !rims[i].empty() && (turn.isZero() || turns_about(turn, normal));
  }
  for (std::size_t face = 0; face < faces.size(); ++face) {
    found.lids.closed[face / 2][face % 2] = faces[face].closed(found.openings);
  }
  std::ranges::sort(found.openings, [](const Opening& a, const Opening& b) { return a.area > b.area; });
  return found;
}

std::size_t count_border_cuts(const Mask& mask) {
  std::vector<Opening> openings;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool upper : {false, true}) {
      ImageFace(mask, axis, upper).find(openings);
    }
  }
  return openings.size();
}

TriangleMesh without_border(const TriangleMesh& surface, const Mask& mask) {
  require_valid(surface);
  const Mat3 to_index = mask.affine().leftCols<3>().inverse();
  std::vector<unsigned> faces(surface.vertices.size(), 0);  // a bit for each face of the image that a vertex is near
  for (std::size_t v = 0; v < faces.size(); ++v) {
    const Vec3 index = to_index * (surface.vertices[v] - mask.affine().col(3));
    for (int axis = 0; axis < 3; ++axis) {
      faces[v] |= index[axis] < 0 ? 1U << (2 * axis) : 0U;
      faces[v] |= index[axis] > real(mask.dims()[axis] - 1) ? 2U << (2 * axis) : 0U;
    }
  }
  TriangleMesh rest{surface.vertices, {}};
  std::ranges::copy_if(surface.triangles, std::back_inserter(rest.triangles),
                       [&](const auto& t) { return (faces[t[0]] & faces[t[1]] & faces[t[2]]) == 0; });
  return rest.triangles.empty() ? surface : rest;
}

}  // namespace tunica
