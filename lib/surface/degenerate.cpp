#include "surface/degenerate.hpp"

#include "surface/edit_mesh.hpp"

#include <Eigen/Geometry>

#include <algorithm>

namespace tunica {
namespace {

constexpr double least_height = 1e-9;  // of the longest edge
constexpr double short_edge = 1e-6;    // likewise: what may collapse where no flip helps

class Cleaner {
public:
  explicit Cleaner(const TriangleMesh& mesh) : mesh_(mesh) {}

  WithoutDegenerate run() {
    // Each change leaves fewer degenerate triangles or shorter edges: it ends.
    std::vector<Index> waiting;
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      waiting.push_back(t);
    }
    for (bool changed = true; changed;) {
      changed = false;
      std::vector<Index> left;
      for (const Index t : waiting) {
        if (!mesh_.is_alive(t) || !is_flat(t)) {
          continue;
        }
        const bool gone = take_out(t);
        changed = changed || gone;
        left.push_back(t);
        left.insert(left.end(), touched_.begin(), touched_.end());
        touched_.clear();
      }
      std::sort(left.begin(), left.end());
      left.erase(std::unique(left.begin(), left.end()), left.end());
      waiting = std::move(left);
    }
    return {mesh_.mesh(), moved_};
  }

private:
  [[nodiscard]] const Vec3& at(Index v) const { return mesh_.positions[v]; }
  [[nodiscard]] double length(Index u, Index v) const { return (at(u) - at(v)).norm(); }
  [[nodiscard]] bool is_flat(Index t) const {
    const auto& c = mesh_.triangles[t];
    return is_degenerate(at(c[0]), at(c[1]), at(c[2]));
  }

  bool take_out(Index t) {
    const auto c = mesh_.triangles[t];
    std::array<std::pair<double, std::size_t>, 3> edges{};  // mm; k: from corner k to k + 1
    for (std::size_t k = 0; k < 3; ++k) {
      edges[k] = {length(c[k], c[(k + 1) % 3]), k};
    }
    std::sort(edges.begin(), edges.end());
    const auto [longest, side] = edges[2];
    const auto collapses = [&](double most) {
      return std::any_of(edges.begin(), edges.end(), [&](const auto& edge) {
        return edge.first <= most * longest && collapse(c[edge.second], c[(edge.second + 1) % 3], edge.first);
      });
    };
    if (edges[0].first <= least_height * longest) {
      return collapses(least_height);
    }
    const Index u = c[side], v = c[(side + 1) % 3], middle = c[(side + 2) % 3];
    const double height = (at(v) - at(u)).cross(at(middle) - at(u)).norm() / longest;
    const bool gone =
        mesh_.on_edge(v, u)[0] == EditMesh::none ? open(t, middle, height) : flip(t, u, v, middle, height);
    return gone || collapses(short_edge);
  }

  /// Of vertices that coincide the one on the boundary stays.
  bool collapse(Index u, Index v, double apart) {
    if (mesh_.on_boundary[v] != 0) {
      std::swap(u, v);
    }
    if (!mesh_.may_collapse(u, v)) {
      return false;
    }
    for (const Index t : std::vector<Index>(mesh_.around[v])) {
      auto corners = mesh_.triangles[t];
      const bool both = mesh_.has(t, u);
      mesh_.remove_triangle(t);
      if (!both) {
        std::replace(corners.begin(), corners.end(), v, u);
        touched_.push_back(mesh_.add_triangle(corners));
      }
    }
    moved_ += apart;
    return true;
  }

  bool flip(Index t, Index u, Index v, Index middle, double height) {
    if (!mesh_.may_flip(u, v)) {
      return false;
    }
    const Index other = mesh_.on_edge(v, u)[0];
    const Index apex = mesh_.apex(other, u, v);
    const std::array<std::array<Index, 3>, 2> fresh{{{u, apex, middle}, {apex, v, middle}}};
    const auto still_flat = std::count_if(fresh.begin(), fresh.end(),
                                          [&](const auto& c) { return is_degenerate(at(c[0]), at(c[1]), at(c[2])); });
    const int flat_before = is_flat(other) ? 2 : 1;
    if (still_flat > flat_before || (still_flat == flat_before && length(apex, middle) >= length(u, v))) {
      return false;
    }
    mesh_.remove_triangle(t);
    mesh_.remove_triangle(other);
    for (const auto& corners : fresh) {
      touched_.push_back(mesh_.add_triangle(corners));
    }
    moved_ += height;
    return true;
  }

  bool open(Index t, Index middle, double height) {
    if (mesh_.on_boundary[middle] != 0 || mesh_.alive == 1) {
      return false;
    }
    mesh_.remove_triangle(t);
    mesh_.on_boundary[middle] = 1;
    moved_ += height;
    return true;
  }

  EditMesh mesh_;
  double moved_ = 0;
  std::vector<Index> touched_;
};

}  // namespace

bool is_degenerate(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() <= least_height * longest;
}

std::size_t count_degenerate(const TriangleMesh& mesh) {
  return static_cast<std::size_t>(std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& c) {
    return is_degenerate(mesh.vertices[c[0]], mesh.vertices[c[1]], mesh.vertices[c[2]]);
  }));
}

WithoutDegenerate without_degenerate_triangles(const TriangleMesh& mesh) { return Cleaner(mesh).run(); }

}  // namespace tunica
