#include "tunica/shell/distance/normals.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double comfortable_agreement = 0.5;  // slopes below tan 60
constexpr double safety = 1e-6;                // written normals must pass the check after rounding
constexpr std::size_t most_normals_at_once = 24;

double agreement(const Vec3& n, std::span<const Vec3> facet_normals) {
  double least = 1;
  for (const Vec3& f : facet_normals) {
    least = std::min(least, n.dot(f));
  }
  return least;
}

/// Nearest point to the origin of the affine hull of up to three points; nothing when they are dependent.
std::optional<Vec3> nearest_of_hull(const Vec3& a, const Vec3& b) {
  const Vec3 u = b - a;
  if (u.squaredNorm() < 1e-24) {
    return {};
  }
  return a - u * (a.dot(u) / u.squaredNorm());
}

std::optional<Vec3> nearest_of_hull(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  if (n.squaredNorm() < 1e-24) {
    return {};
  }
  return n * (n.dot(a) / n.squaredNorm());
}

/// By trying every subset of at most three: the nearest point of a convex hull lies on a vertex, edge or triangle.
CompatibleNormal by_subsets(std::span<const Vec3> normals) {
  CompatibleNormal best{normals[0], agreement(normals[0], normals)};
  const auto consider = [&](const std::optional<Vec3>& p) {
    if (p && p->squaredNorm() > 1e-24) {
      const Vec3 n = p->normalized();
      if (const double a = agreement(n, normals); a > best.agreement) {
        best = {n, a};
      }
    }
  };
  for (std::size_t i = 0; i < normals.size(); ++i) {
    consider(normals[i]);
    for (std::size_t j = 0; j < i; ++j) {
      consider(nearest_of_hull(normals[i], normals[j]));
      for (std::size_t k = 0; k < j; ++k) {
        consider(nearest_of_hull(normals[i], normals[j], normals[k]));
      }
    }
  }
  return best;
}

}  // namespace

CompatibleNormal most_compatible_normal(std::span<const Vec3> facet_normals) {
  if (facet_normals.empty()) {
    return {Vec3::UnitZ(), 1};
  }
  if (facet_normals.size() <= most_normals_at_once) {
    return by_subsets(facet_normals);
  }
  // The normal that disagrees most joins the set until none disagrees more than those already in it.
  std::vector<Vec3> active{facet_normals[0]};
  CompatibleNormal best = by_subsets(active);
  while (active.size() < 2 * most_normals_at_once) {
    const auto worst = std::min_element(facet_normals.begin(), facet_normals.end(), [&](const Vec3& a, const Vec3& b) {
      return a.dot(best.normal) < b.dot(best.normal);
    });
    if (worst->dot(best.normal) >= best.agreement - 1e-9) {
      break;
    }
    active.push_back(*worst);
    best = by_subsets(active);
  }
  return {best.normal, agreement(best.normal, facet_normals)};
}

std::optional<Vec3> compatible_normal(const Vec3& wanted, std::span<const Vec3> facet_normals, double least) {
  if (agreement(wanted, facet_normals) >= least) {
    return wanted;
  }
  const CompatibleNormal best = most_compatible_normal(facet_normals);
  if (best.agreement < least) {
    return {};
  }
  // The compatible vectors are a convex cone: along the way from a vector inside to one outside there is one border.
  double inside = 0, outside = 1;
  const auto on_the_way = [&](double s) -> Vec3 { return ((1 - s) * best.normal + s * wanted).normalized(); };
  for (int i = 0; i < 40; ++i) {
    const double middle = (inside + outside) / 2;
    (agreement(on_the_way(middle), facet_normals) >= least ? inside : outside) = middle;
  }
  return on_the_way(inside);
}

std::vector<Index> take_normals_from(const Target& target, ShellMesh& shell) {
  const TriangleMesh mesh = flat_facets(shell);
  const auto facets = facet_normals(mesh);
  const auto means = vertex_normals(mesh);
  const Incidence around = incidence(mesh);
  std::vector<std::uint8_t> folded(mesh.vertices.size(), 0);
  shell.normals.assign(mesh.vertices.size(), Vec3::UnitZ());
  parallel_for_blocks(mesh.vertices.size(), 64, [&](std::size_t begin, std::size_t end) {
    std::vector<Vec3> fan;
    for (std::size_t v = begin; v < end; ++v) {
      fan.clear();
      for (const Index t : around.of(narrow<Index>(v))) {
        fan.push_back(facets[t]);
      }
      if (fan.empty()) {
        continue;
      }
      const Vec3 side = means[v].squaredNorm() > 0.5 ? means[v] : fan[0];
      const auto foot = target.closest_facing(mesh.vertices[v], side, target.diagonal());
      const Vec3 wanted = foot ? foot->normal : side;
      auto normal = compatible_normal(wanted, fan, comfortable_agreement);
      if (!normal) {
        // Between the two limits take what the facets themselves allow, a little inside.
        const double possible = most_compatible_normal(fan).agreement;
        const double least = std::max(least_normal_agreement + safety, 0.9 * possible);
        normal = compatible_normal(wanted, fan, least);
      }
      folded[v] = !normal;
      shell.normals[v] = normal.value_or(most_compatible_normal(fan).normal);
    }
  });
  std::vector<Index> out;
  for (std::size_t v = 0; v < folded.size(); ++v) {
    if (folded[v] != 0) {
      out.push_back(narrow<Index>(v));
    }
  }
  return out;
}

}  // namespace tunica
