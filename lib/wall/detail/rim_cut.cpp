#include "tunica/wall/detail/rim_cut.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace tunica {
namespace {

constexpr double onto_rim = 0.25;  // of a cell: vertices so near the cut move onto it, which leaves no slivers
constexpr double about_rim = 3;    // times half of the wall: how far from it a flat rim's plane cuts
constexpr int rim_steps = 40;      // of a vertex onto level and cut, one after the other

/// Where a vertex is.
struct Beyond {
  double by = 0;          ///< mm, beyond the cut
  bool is_level = false;  ///< not where signs turn without a level
  bool is_flat = false;   ///< the rim
};

class RimCut {
public:
  RimCut(const TriangleMesh& mesh, const HalfWayLevel& level, double cell)
      : mesh_(mesh), level_(level), cell_(cell), at_(mesh.vertices.size()), out_(mesh) {}

  TriangleMesh operator()() {
    parallel_for_blocks(at_.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        at_[v] = beyond(mesh_.vertices[v]);
        if (at_[v].is_level && at_[v].is_flat && std::abs(at_[v].by) < onto_rim * cell_) {
          out_.vertices[v] = onto_cut(mesh_.vertices[v]);
          at_[v].by = 0;
        }
      }
    });
    out_.triangles.clear();
    for (const auto& triangle : mesh_.triangles) {
      if (std::ranges::all_of(triangle, [&](Index v) { return at_[v].is_level; })) {
        cut(triangle);
      }
    }
    return without_unused(std::move(out_));
  }

private:
  [[nodiscard]] Beyond beyond(const Vec3& p) const {
    const ContinuedFace::Hit hit = level_.face.at(p, 0);
    const ContinuedFace::AtRim rim = level_.face.nearest_rim(hit.on_strip ? hit.point : p);
    Beyond there{-cell_, !hit.at_end && std::abs(level_.value(hit)) < cell_, rim.rim->is_flat};
    if (!rim.rim->is_flat) {
      const double from_rim = level_.face.nearest_rim(hit.point).distance;
      there.by = hit.on_strip ? from_rim : -from_rim;
    } else if (hit.on_strip || rim.distance < about_rim * level_.half + cell_) {
      there.by = (p - rim.rim->middle).dot(rim.rim->away);
    }
    return there;
  }

  /// The place on the level that is near a point, and in the rim's plane where it has one: others may be jagged, and
  /// what is pulled onto them folds.
  [[nodiscard]] Vec3 onto_cut(Vec3 p) const {
    const ContinuedFace::Rim& rim = *level_.face.nearest_rim(p).rim;
    if (!rim.is_flat) {
      return level_.moved_onto(p);
    }
    for (int step = 0; step < rim_steps; ++step) {
      const Vec3 before = p;
      p = level_.foot_on(p, level_.face.at(p, 0));
      p -= (p - rim.middle).dot(rim.away) * rim.away;
      if ((p - before).norm() < 1e-7 * level_.half) {
        break;
      }
    }
    return p;
  }

  /// The vertex where an edge crosses the cut.
  Index crossing(Index inside, Index outside) {
    const auto [at, is_new] = crossings_.try_emplace(std::pair(inside, outside), narrow<Index>(out_.vertices.size()));
    if (is_new) {
      const double part = at_[inside].by / (at_[inside].by - at_[outside].by);
      const Vec3 &a = mesh_.vertices[inside], &b = mesh_.vertices[outside];
      out_.vertices.push_back(onto_cut(a + part * (b - a)));
    }
    return at->second;
  }

  void cut(const std::array<Index, 3>& triangle) {
    std::vector<Index> kept;
    bool any_inside = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index here = triangle[k], next = triangle[(k + 1) % 3];
      const double a = at_[here].by, b = at_[next].by;
      any_inside = any_inside || a < 0;
      if (a <= 0) {
        kept.push_back(here);
      }
      if (a < 0 && b > 0) {
        kept.push_back(crossing(here, next));
      } else if (a > 0 && b < 0) {
        kept.push_back(crossing(next, here));
      }
    }
    for (std::size_t i = 2; any_inside && i < kept.size(); ++i) {
      out_.triangles.push_back({kept[0], kept[i - 1], kept[i]});
    }
  }

  const TriangleMesh& mesh_;
  const HalfWayLevel& level_;
  double cell_;
  std::vector<Beyond> at_;
  TriangleMesh out_;
  std::map<std::pair<Index, Index>, Index> crossings_;
};

}  // namespace

TriangleMesh cut_at_rims(const TriangleMesh& mesh, const HalfWayLevel& level, double cell) {
  return RimCut(mesh, level, cell)();
}

}  // namespace tunica
