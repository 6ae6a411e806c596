#include "tunica/surface/decimation/degenerate.hpp"

#include "tunica/core/error.hpp"
#include "tunica/surface/decimation/detail/edit_mesh.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>

namespace tunica {
namespace {

constexpr double least_height = 1e-9;  // of the longest edge
constexpr double short_edge = 1e-6;    // likewise: what may collapse where no flip helps

class Cleaner {
public:
  Cleaner(const TriangleMesh& mesh, double longest_spike) : mesh_(mesh), longest_spike_(longest_spike) {}

  WithoutDegenerate run() {
    // Each closes loops or leaves fewer triangles: it ends.
    do {
      clean();
    } while (close_point_loops() || take_spikes());
    result_.mesh = mesh_.mesh();
    return std::move(result_);
  }

private:
  [[nodiscard]] const Vec3& at(Index v) const { return mesh_.positions[v]; }
  [[nodiscard]] double length(Index u, Index v) const { return (at(u) - at(v)).norm(); }
  [[nodiscard]] bool is_flat(Index t) const {
    const auto& c = mesh_.triangles[t];
    return is_degenerate(at(c[0]), at(c[1]), at(c[2]));
  }

  void clean() {
    // Each change leaves fewer degenerate triangles or shorter edges: it ends.
    std::vector<Index> waiting = alive();
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
  }

  [[nodiscard]] std::vector<Index> alive() const {
    std::vector<Index> found;
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      if (mesh_.is_alive(t)) {
        found.push_back(t);
      }
    }
    return found;
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
    result_.moved += apart;
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
    result_.moved += height;
    return true;
  }

  bool open(Index t, Index middle, double height) {
    if (mesh_.on_boundary[middle] != 0 || mesh_.alive == 1) {
      return false;
    }
    mesh_.remove_triangle(t);
    mesh_.on_boundary[middle] = 1;
    result_.moved += height;
    return true;
  }

  // A loop without extent gets a fan about one more vertex in its place: all of that are needles, and collapse.
  bool close_point_loops() {
    TriangleMesh now{mesh_.positions, {}};
    for (const Index t : alive()) {
      now.triangles.push_back(mesh_.triangles[t]);
    }
    const std::size_t closed_before = result_.closed_loops;
    for (const auto& loop : boundary_loops(now)) {
      double extent = 0, longest = 0;
      for (const Index v : loop) {
        extent = std::max(extent, length(loop[0], v));
        std::vector<Index> ring;
        mesh_.ring(v, ring);
        for (const Index w : ring) {
          longest = std::max(longest, length(v, w));
        }
      }
      // Of a piece that is a point nothing would be left.
      if (longest > 0 && extent <= least_height * longest) {
        close(loop);
        result_.moved += extent;
      }
    }
    return result_.closed_loops > closed_before;
  }

  void close(const std::vector<Index>& loop) {
    const Index centre = mesh_.add_vertex(Vec3(at(loop[0])), false);
    for (std::size_t i = 0; i < loop.size(); ++i) {
      mesh_.add_triangle({loop[(i + 1) % loop.size()], loop[i], centre});
      mesh_.on_boundary[loop[i]] = 0;
    }
    ++result_.closed_loops;
  }

  bool take_spikes() {
    const Spikes spikes = find_spikes();
    double moved = 0;
    result_.long_spikes = 0;
    std::vector<std::uint8_t> goes(mesh_.triangles.size(), 0);  // by the root
    for (const Index t : spikes.triangles) {
      if (spikes.root[t] != t) {
        continue;
      }
      const double reach = spikes.length[t];
      if (result_.moved + reach > longest_spike_) {
        ++result_.long_spikes;
        continue;
      }
      goes[t] = 1;
      moved = std::max(moved, reach);
      const auto& c = mesh_.triangles[t];
      const double longest = std::max({length(c[0], c[1]), length(c[1], c[2]), length(c[2], c[0])});
      // Otherwise it lies on the edge, but for rounding.
      if (reach > least_height * longest) {
        result_.longest_spike = std::max(result_.longest_spike, reach);
      }
    }
    bool any = false;
    for (const Index t : spikes.triangles) {
      if (spikes.root[t] != EditMesh::none && goes[spikes.root[t]] != 0) {
        mesh_.remove_triangle(t);
        any = true;
      }
    }
    // Spikes stand side by side: together they move the surface as far as the longest.
    result_.moved += moved;
    return any;
  }

  struct Spikes {
    std::vector<Index> triangles;  ///< outer ones first
    std::vector<Index> root;       ///< #T the triangle by which the spike hangs on the rest; none: of no spike
    std::vector<double> length;    ///< #T of roots, mm
  };

  // A flat triangle with one neighbour only is the end of a spike; without it its neighbour may be the next one.
  [[nodiscard]] Spikes find_spikes() const {
    Spikes found;
    const std::size_t count = mesh_.triangles.size();
    std::vector<Index> holder(count, EditMesh::none);  // the neighbour that a spike's triangle hangs on
    const auto neighbours_left = [&](Index t) {
      std::vector<Index> left;
      const auto& c = mesh_.triangles[t];
      for (std::size_t k = 0; k < 3; ++k) {
        const Index across = mesh_.on_edge(c[k], c[(k + 1) % 3])[1];
        if (across != EditMesh::none && holder[across] == EditMesh::none) {
          left.push_back(across);
        }
      }
      return left;
    };
    std::vector<Index> waiting = alive();
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      const Index t = waiting[i];
      if (holder[t] != EditMesh::none || !is_flat(t)) {
        continue;
      }
      const auto left = neighbours_left(t);
      if (left.size() == 1) {
        holder[t] = left[0];
        found.triangles.push_back(t);
        waiting.push_back(left[0]);
      }
    }
    found.root.assign(count, EditMesh::none);
    found.length.assign(count, 0);
    for (auto it = found.triangles.rbegin(); it != found.triangles.rend(); ++it) {
      const Index t = *it;
      const Index held_by = holder[t];
      if (holder[held_by] != EditMesh::none) {
        found.root[t] = found.root[held_by];
      } else if (!is_flat(held_by) || !neighbours_left(held_by).empty()) {
        found.root[t] = t;
      }  // else the whole piece is without area
      if (found.root[t] != EditMesh::none) {
        double& length = found.length[found.root[t]];
        length = std::max(length, reach(t, found.root[t], holder[found.root[t]]));
      }
    }
    return found;
  }

  // How far a triangle reaches from the edge that two others share.
  [[nodiscard]] double reach(Index t, Index root, Index holder) const {
    std::vector<Vec3> edge;
    for (const Index v : mesh_.triangles[root]) {
      if (mesh_.has(holder, v)) {
        edge.push_back(at(v));
      }
    }
    double farthest = 0;
    for (const Index v : mesh_.triangles[t]) {
      farthest = std::max(farthest, (at(v) - closest_point_on_triangle(at(v), edge[0], edge[1], edge[1])).norm());
    }
    return farthest;
  }

  EditMesh mesh_;
  double longest_spike_;
  WithoutDegenerate result_;
  std::vector<Index> touched_;
};

}  // namespace

bool is_degenerate(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() <= least_height * longest;
}

std::size_t count_degenerate(const TriangleMesh& mesh) {
  require_valid(mesh);
  return std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& c) {
    return is_degenerate(mesh.vertices[c[0]], mesh.vertices[c[1]], mesh.vertices[c[2]]);
  });
}

WithoutDegenerate without_degenerate_triangles(const TriangleMesh& mesh, double longest_spike) {
  require_valid(mesh);
  if (!(longest_spike >= 0)) {
    throw InputError(fmt::format("spikes of {} mm cannot be taken away: give a length, or infinity", longest_spike));
  }
  return Cleaner(mesh, longest_spike).run();
}

}  // namespace tunica
