// Normals by coordinate descent: node by node the turn that lessens a power of the distances between the curved surface
// and the target, accepted only when it truly does.
#include "core/progress.hpp"
#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "shell/normals.hpp"
#include "surface/incidence.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int sample_level = 4;  // shell samples per facet: the grid of 15 points but the corners
constexpr std::size_t shell_samples = 12;
constexpr int search_level = 4;             // pieces per edge of the surface on which target samples find their place
constexpr std::size_t target_samples = 24;  // per shell, at most
constexpr std::array<double, 2> powers{4, 8};  // of the distances, one round each: the largest is what counts
constexpr int sweeps = 4;                      // per round
constexpr std::array<double, 3> step_lengths{1, 0.4, 0.1};
constexpr double damping = 1e-3;      // of the diagonal
constexpr double largest_turn = 0.4;  // rad
constexpr double least_agreement = 0.25;
constexpr double settled = 1e-3;  // a sweep that lessens the cost by less than this part ends the round

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A sample: at `at` of its facet the surface should move by -distance along `direction`.
struct Sample {
  Vec2 at;
  Vec3 direction;
  double signed_distance;
  double distance;
  double area;
};

/// How the deflection of a facet, nearly the same for both patches, follows its nodes' normals: rows 3..8 of the
/// ordinates by (two turns) x 3 corners.
struct Sensitivity {
  std::array<Vector6, 6> edge_ordinates;
  Vector6 centre;

  [[nodiscard]] Vector6 at(const Vec2& b) const {
    const double l1 = 1 - b[0] - b[1], l2 = b[0], l3 = b[1];
    return 3 * (l1 * l1 * l2 * edge_ordinates[0] + l1 * l2 * l2 * edge_ordinates[1] + l2 * l2 * l3 * edge_ordinates[2] +
                l2 * l3 * l3 * edge_ordinates[3] + l3 * l3 * l1 * edge_ordinates[4] +
                l3 * l1 * l1 * edge_ordinates[5]) +
           6 * l1 * l2 * l3 * centre;
  }
};

/// The two directions in which a unit normal can turn.
std::array<Vec3, 2> turns(const Vec3& n) {
  const Vec3 first = n.unitOrthogonal();
  return {first, n.cross(first)};
}

Sensitivity sensitivity(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  const std::array<Vec3, 3> edges{corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};
  const Vec3 n = edges[0].cross(-edges[2]).normalized();
  Sensitivity out;
  out.edge_ordinates.fill(Vector6::Zero());
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t previous = (i + 2) % 3;
    const double along_n = normals[i].dot(n);
    const auto turn = turns(normals[i]);
    for (std::size_t k = 0; k < 2; ++k) {
      const auto column = static_cast<Eigen::Index>(2 * i + k);
      const auto slope_change = [&](const Vec3& e) {  // of -(N·e)/(N·n)
        return -(e - n * (normals[i].dot(e) / along_n)).dot(turn[k]) / along_n;
      };
      out.edge_ordinates[2 * i][column] = slope_change(edges[i]) / 3;
      out.edge_ordinates[1 + 2 * previous][column] = -slope_change(edges[previous]) / 3;
    }
  }
  for (Eigen::Index column = 0; column < 6; ++column) {
    std::array<double, 10> ordinates{};
    for (std::size_t i = 0; i < 6; ++i) {
      ordinates[3 + i] = out.edge_ordinates[i][column];
    }
    out.centre[column] = averaged_centre(edges, ordinates);
  }
  return out;
}

class Fit {
public:
  Fit(const Target& target, ShellMesh& shell)
      : target_(target),
        shell_(shell),
        around_(incidence(flat_facets(shell))),
        normals_(facet_normals(flat_facets(shell))),
        facets_(shell.triangles.size()) {
    for (std::size_t t = 0; t < facets_.size(); ++t) {
      const auto p = corners(t);
      facets_[t].area = (p[1] - p[0]).cross(p[2] - p[0]).norm() / 2;
    }
    colour();
  }

  NormalFit run() {
    NormalFit out;
    bool first = true;
    for (const double power : powers) {
      power_ = power;
      sample_target();
      scale_ = largest_distance();
      if (first) {
        out.largest_before = scale_;
      }
      if (!(scale_ > 1e-12 * target_.diagonal())) {
        break;
      }
      double cost = evaluate_all();
      for (int sweep = 0; sweep < sweeps; ++sweep) {
        for (const auto& nodes : colours_) {
          check_interrupt();
          parallel_for_blocks(nodes.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
              improve(nodes[i], first && sweep == 0);
            }
          });
        }
        ++out.sweeps;
        double now = 0;
        for (const Facet& facet : facets_) {
          now += facet.state.cost;
        }
        const bool done = now > (1 - settled) * cost;
        cost = now;
        if (done) {
          break;
        }
      }
      first = false;
    }
    out.largest_after = largest_distance();
    return out;
  }

private:
  using Normals = std::array<Vec3, 3>;

  /// What a facet's patch costs with some normals, and its samples.
  struct State {
    double cost = 0;
    std::vector<Sample> samples;
  };
  /// A point of the target whose closest point lies on the facet's patch.
  struct Attached {
    Vec3 point;
    Vec2 at;
    Vec3 direction;  // the patch's normal there; beside the patch the way to it
    double area;
  };
  struct Facet {
    double area = 0;
    std::vector<Attached> attached;
    State state;
  };

  std::array<Vec3, 3> corners(std::size_t t) const {
    const auto& v = shell_.triangles[t];
    return {shell_.vertices[v[0]], shell_.vertices[v[1]], shell_.vertices[v[2]]};
  }
  Normals normals(std::size_t t) const { return {shell_.normal(t, 0), shell_.normal(t, 1), shell_.normal(t, 2)}; }

  /// Nodes of one colour share no triangle: they can be turned at the same time.
  void colour() {
    std::vector<int> colour_of(shell_.vertices.size(), -1);
    for (std::size_t v = 0; v < shell_.vertices.size(); ++v) {
      std::vector<std::uint8_t> used(colours_.size() + 1, 0);
      for (const Index t : around_.of(static_cast<Index>(v))) {
        for (const Index w : shell_.triangles[t]) {
          if (colour_of[w] >= 0) {
            used[static_cast<std::size_t>(colour_of[w])] = 1;
          }
        }
      }
      const auto free = static_cast<std::size_t>(std::find(used.begin(), used.end(), 0) - used.begin());
      if (free == colours_.size()) {
        colours_.emplace_back();
      }
      colours_[free].push_back(static_cast<Index>(v));
      colour_of[v] = static_cast<int>(free);
    }
  }

  /// Finds for points of the target the patch they are closest to.
  void sample_target() {
    const Tessellation fine = tessellate_uniformly(shell_, search_level);
    const ClosestPoint tree(fine.mesh);
    const auto& vertices = target_.mesh().vertices;
    const std::size_t stride = std::max<std::size_t>(1, vertices.size() / (target_samples * facets_.size()));
    const std::size_t count = (vertices.size() + stride - 1) / stride;
    double area = 0;
    for (const Facet& facet : facets_) {
      area += facet.area;
    }
    std::vector<std::pair<Index, Attached>> found(count);
    parallel_for_blocks(count, 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3& q = vertices[i * stride];
        const auto hit = tree.closest(q);
        const auto& [a, b, c] = fine.mesh.triangles[hit.triangle];
        const Vec3 &pa = fine.mesh.vertices[a], &pb = fine.mesh.vertices[b], &pc = fine.mesh.vertices[c];
        const Vec3 normal = (pb - pa).cross(pc - pa);
        const double twice = std::max(normal.norm(), 1e-300);
        const Vec3 n = normal / twice;
        const double lb = std::clamp((hit.point - pa).cross(pc - pa).dot(n) / twice, 0.0, 1.0);
        const double lc = std::clamp((pb - pa).cross(hit.point - pa).dot(n) / twice, 0.0, 1.0 - lb);
        const Vec2 at = (1 - lb - lc) * fine.barycentric[a] + lb * fine.barycentric[b] + lc * fine.barycentric[c];
        const Vec3 away = hit.point - q;
        const double distance = away.norm();
        const bool beside = std::abs(away.dot(n)) < 0.7 * distance;
        found[i] = {fine.shell[hit.triangle],
                    {q, at, beside ? Vec3(away / distance) : n, area / static_cast<double>(count)}};
      }
    });
    for (Facet& facet : facets_) {
      facet.attached.clear();
    }
    for (const auto& [t, attached] : found) {
      facets_[t].attached.push_back(attached);
    }
  }

  State evaluate(std::size_t t, const Normals& with) const {
    const CubicPatch patch = smooth_patch(shell_.patch, corners(t), with);
    State state;
    state.samples.reserve(shell_samples + facets_[t].attached.size());
    for (int i = 0; i <= sample_level; ++i) {
      for (int j = 0; i + j <= sample_level; ++j) {
        if (std::max({i, j, sample_level - i - j}) == sample_level) {
          continue;
        }
        const Vec2 b(static_cast<double>(i) / sample_level, static_cast<double>(j) / sample_level);
        const Vec3 on = patch.point(b);
        if (const auto foot = target_.closest_facing(on, normals_[t], target_.diagonal())) {
          // Near the closest point the target is its tangent plane; off an edge or rim the way back itself counts.
          const Vec3 away = on - foot->point;
          const bool beside = std::abs(away.dot(foot->facet_normal)) < 0.7 * foot->distance;
          const Vec3 direction = beside ? Vec3(away / foot->distance) : foot->facet_normal;
          state.samples.push_back({b, direction, away.dot(direction), foot->distance, facets_[t].area / shell_samples});
        }
      }
    }
    for (const Attached& q : facets_[t].attached) {
      const double signed_distance = (patch.point(q.at) - q.point).dot(q.direction);
      state.samples.push_back({q.at, q.direction, signed_distance, std::abs(signed_distance), q.area});
    }
    for (const Sample& s : state.samples) {
      state.cost += s.area * std::pow(s.distance / scale_, power_);
    }
    return state;
  }

  double evaluate_all() {
    parallel_for_blocks(facets_.size(), 16, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        facets_[t].state = evaluate(t, normals(t));
      }
    });
    double cost = 0;
    for (const Facet& facet : facets_) {
      cost += facet.state.cost;
    }
    return cost;
  }

  double largest_distance() {
    scale_ = 1;
    evaluate_all();
    double largest = 0;
    for (const Facet& facet : facets_) {
      for (const Sample& s : facet.state.samples) {
        largest = std::max(largest, s.distance);
      }
    }
    return largest;
  }

  /// Turns one node's normal when that lessens what the facets around it cost.
  void improve(Index v, bool also_elsewhere) {
    const auto fan = around_.of(v);
    if (fan.empty()) {
      return;
    }
    std::vector<Vec3> fan_normals;
    double cost = 0, largest = 0;
    for (const Index t : fan) {
      fan_normals.push_back(normals_[t]);
      cost += facets_[t].state.cost;
      for (const Sample& s : facets_[t].state.samples) {
        largest = std::max(largest, s.distance);
      }
    }
    if (also_elsewhere && largest > 0.25 * scale_) {
      for (const Vec3& n : fan_normals) {
        try_normal(v, n, fan_normals, cost);
      }
      try_normal(v, most_compatible_normal(fan_normals).normal, fan_normals, cost);
    }
    const Vec3 here = shell_.normals[v];
    const Vec2 step = newton_step(v);
    const auto turn = turns(here);
    for (const double length : step_lengths) {
      Vec3 change = length * (step[0] * turn[0] + step[1] * turn[1]);
      if (const double size = change.norm(); size > largest_turn) {
        change *= largest_turn / size;
      }
      if (try_normal(v, (here + change).normalized(), fan_normals, cost)) {
        break;
      }
    }
  }

  /// Takes the normal nearest to `wanted` that is compatible when the facets around cost less with it than `cost`.
  bool try_normal(Index v, const Vec3& wanted, const std::vector<Vec3>& fan_normals, double& cost) {
    const Vec3 old = shell_.normals[v];
    double now = 1;
    for (const Vec3& f : fan_normals) {
      now = std::min(now, old.dot(f));
    }
    const auto normal = compatible_normal(wanted, fan_normals, std::min(least_agreement, now));
    if (!normal) {
      return false;
    }
    const auto fan = around_.of(v);
    std::vector<State> states;
    double sum = 0;
    for (const Index t : fan) {
      Normals with = normals(t);
      for (std::size_t i = 0; i < 3; ++i) {
        if (shell_.triangles[t][i] == v) {
          with[i] = *normal;
        }
      }
      states.push_back(evaluate(t, with));
      sum += states.back().cost;
      if (sum >= cost) {
        return false;
      }
    }
    for (std::size_t i = 0; i < fan.size(); ++i) {
      facets_[fan[i]].state = std::move(states[i]);
    }
    shell_.normals[v] = *normal;
    cost = sum;
    return true;
  }

  /// Gauss-Newton step of the two turns of one node for the cost of the facets around it.
  Vec2 newton_step(Index v) const {
    Eigen::Matrix2d matrix = Eigen::Matrix2d::Zero();
    Vec2 side = Vec2::Zero();
    for (const Index t : around_.of(v)) {
      const auto change = sensitivity(corners(t), normals(t));
      const auto corner =
          std::find(shell_.triangles[t].begin(), shell_.triangles[t].end(), v) - shell_.triangles[t].begin();
      for (const Sample& s : facets_[t].state.samples) {
        const double weight = s.area * std::pow(s.distance / scale_, power_ - 2);
        const Vec2 row = normals_[t].dot(s.direction) * change.at(s.at).segment<2>(2 * corner);
        matrix += weight * row * row.transpose();
        side -= weight * s.signed_distance * row;
      }
    }
    matrix.diagonal() *= 1 + damping;
    matrix.diagonal().array() += 1e-300;
    const Vec2 step = matrix.inverse() * side;
    return step.allFinite() ? step : Vec2::Zero();
  }

  const Target& target_;
  ShellMesh& shell_;
  Incidence around_;
  std::vector<Vec3> normals_;
  std::vector<Facet> facets_;
  std::vector<std::vector<Index>> colours_;
  double power_ = 2;
  double scale_ = 1;
};

}  // namespace

NormalFit fit_normals(const Target& target, ShellMesh& shell) { return Fit(target, shell).run(); }

}  // namespace tunica
