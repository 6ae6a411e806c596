#include "tunica/shell/distance/mean_bound.hpp"

#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int most_cuts = 6;                      // of a triangle, each into four
constexpr std::size_t triangles_per_block = 256;  // of the parallel loop
constexpr double deviation_share = 0.25;          // of the slack, for drawing the curved surface as triangles

struct Corner {
  Vec3 at;
  Index triangle;   // of the other surface, closest
  double distance;  // mm
};

/// One way.
class MeanOneWay {
public:
  MeanOneWay(const ClosestPoint& other, const CoverBound& cover, double slack)
      : other_(other), cover_(cover), slack_(slack) {}

  [[nodiscard]] double mean(const TriangleMesh& from) const {
    std::vector<double> integrals(from.triangles.size()), areas(from.triangles.size());
    parallel_for_blocks(from.triangles.size(), triangles_per_block, [&](std::size_t begin, std::size_t end) {
      CoverBound::Visited visited;
      for (std::size_t t = begin; t < end; ++t) {
        const auto& v = from.triangles[t];
        areas[t] = triangle_area(from.vertices[v[0]], from.vertices[v[1]], from.vertices[v[2]]);
        integrals[t] =
            areas[t] *
            bound({corner(from.vertices[v[0]]), corner(from.vertices[v[1]]), corner(from.vertices[v[2]])}, 0, visited);
      }
    });
    double integral = 0, area = 0;
    for (std::size_t t = 0; t < areas.size(); ++t) {
      integral += integrals[t];
      area += areas[t];
    }
    return integral / area;
  }

private:
  [[nodiscard]] Corner corner(const Vec3& at) const {
    const ClosestPoint::Hit hit = other_.closest(at);
    return {at, hit.triangle, std::sqrt(hit.squared_distance)};
  }

  /// Of the mean over a triangle.
  [[nodiscard]] double bound(const std::array<Corner, 3>& corners, int cuts, CoverBound::Visited& visited) const {
    const double own = (corners[0].distance + corners[1].distance + corners[2].distance) / 3;
    double least = infinity;
    for (std::size_t i = 0; i < 3 && least - own > slack_; ++i) {
      const Index with = corners[i].triangle;
      double sum = 0;
      for (const Corner& c : corners) {
        sum += c.triangle == with ? c.distance : std::sqrt(other_.squared_distance_to(c.at, with));
      }
      least = std::min(least, sum / 3);
    }
    if (least - own > slack_) {
      const std::array<Vec3, 3> points{corners[0].at, corners[1].at, corners[2].at};
      least = std::min(least, cover_(points, corners[0].triangle, own + slack_, visited));
    }
    if (least - own <= slack_ || cuts == most_cuts) {
      return least;
    }
    std::array<Corner, 3> middles;
    for (std::size_t k = 0; k < 3; ++k) {
      middles[k] = corner((corners[k].at + corners[(k + 1) % 3].at) / 2);
    }
    return (bound({corners[0], middles[0], middles[2]}, cuts + 1, visited) +
            bound({middles[0], corners[1], middles[1]}, cuts + 1, visited) +
            bound({middles[2], middles[1], corners[2]}, cuts + 1, visited) + bound(middles, cuts + 1, visited)) /
           4;
  }

  const ClosestPoint& other_;
  const CoverBound& cover_;
  double slack_;
};

}  // namespace

double mean_distance_bound(const ShellMesh& shell, const Target& target, double slack) {
  require_shells(shell);
  require_positive(slack, "how far the bound may lie above the mean");
  const double deviation = deviation_share * slack;
  const TriangleMesh drawn = tessellate(shell, deviation).mesh;
  const ClosestPoint tree(drawn);
  const CoverBound cover(tree);
  const double part = (1 - deviation_share) * slack;
  return deviation + std::max(MeanOneWay(target.tree(), target.cover(), part).mean(drawn),
                              MeanOneWay(tree, cover, part).mean(target.mesh()));
}

}  // namespace tunica
