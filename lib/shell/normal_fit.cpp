// Normals by least squares (then least sixth powers) of the distances between the curved surface and the target.
#include "core/progress.hpp"
#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "shell/normals.hpp"
#include "surface/incidence.hpp"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int sample_level = 6;             // shell samples per facet: the grid of 28 points but the corners
constexpr int search_level = 4;             // pieces per edge of the surface on which target samples find their place
constexpr std::size_t target_samples = 32;  // per shell, at most
constexpr int square_steps = 4;
constexpr int power_steps = 8;
constexpr double power = 6;
constexpr double damping = 1e-3;      // of the diagonal
constexpr double largest_turn = 0.3;  // rad per step
constexpr double least_agreement = 0.25;
constexpr std::size_t facets_per_block = 16;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A sample: at `at` of its facet the surface should move by -distance along `direction`.
struct Sample {
  Vec2 at;
  Vec3 direction;
  double signed_distance;
  double distance;
  double area;
};

/// How the deflection of a facet follows its nodes' normals: rows 3..8 of the ordinates by (two turns) x 3 corners.
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
        facets_(facet_normals(flat_facets(shell))) {
    const std::size_t vertices = target.mesh().vertices.size();
    stride_ = std::max<std::size_t>(1, vertices / (target_samples * std::max<std::size_t>(1, shell.triangles.size())));
  }

  NormalFit run() {
    NormalFit out;
    std::vector<Vec3> best = shell_.normals;
    double best_largest = gather();
    out.largest_before = best_largest;
    for (int step = 0; step < square_steps + power_steps; ++step) {
      check_interrupt();
      turn(step < square_steps ? 2 : power, largest_);
      ++out.steps;
      if (const double largest = gather(); largest < best_largest) {
        best_largest = largest;
        best = shell_.normals;
      }
    }
    shell_.normals = best;
    out.largest_after = best_largest;
    return out;
  }

private:
  std::array<Vec3, 3> corners(std::size_t t) const {
    const auto& v = shell_.triangles[t];
    return {shell_.vertices[v[0]], shell_.vertices[v[1]], shell_.vertices[v[2]]};
  }
  std::array<Vec3, 3> normals(std::size_t t) const {
    return {shell_.normal(t, 0), shell_.normal(t, 1), shell_.normal(t, 2)};
  }

  /// Samples both surfaces as they are now. @return the largest distance
  double gather() {
    const std::size_t count = shell_.triangles.size();
    samples_.assign(count, {});
    parallel_for_blocks(count, facets_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        sample_shell(t);
      }
    });
    sample_target();
    largest_ = 0;
    for (const auto& of_facet : samples_) {
      for (const Sample& s : of_facet) {
        largest_ = std::max(largest_, s.distance);
      }
    }
    return largest_;
  }

  void sample_shell(std::size_t t) {
    const auto p = corners(t);
    const CubicPatch patch = comas_patch(p, normals(t));
    const double area = (p[1] - p[0]).cross(p[2] - p[0]).norm() / 2 / 25;
    for (int i = 0; i <= sample_level; ++i) {
      for (int j = 0; i + j <= sample_level; ++j) {
        if (std::max({i, j, sample_level - i - j}) == sample_level) {
          continue;
        }
        const Vec2 b(static_cast<double>(i) / sample_level, static_cast<double>(j) / sample_level);
        const Vec3 on = patch.point(b);
        const Vec3 n = patch.normal(b);
        const auto foot = target_.closest_facing(on, n, target_.diagonal());
        if (foot) {
          // Near the closest point the target is its tangent plane; off an edge or rim the way back itself counts.
          const Vec3 away = on - foot->point;
          const double along = away.dot(foot->facet_normal);
          const bool beside = std::abs(along) < 0.7 * foot->distance;
          const Vec3 direction = beside ? Vec3(away / foot->distance) : foot->facet_normal;
          samples_[t].push_back({b, direction, away.dot(direction), foot->distance, area});
        }
      }
    }
  }

  void sample_target() {
    const Tessellation fine = tessellate_uniformly(shell_, search_level);
    const ClosestPoint tree(fine.mesh);
    const auto& vertices = target_.mesh().vertices;
    const std::size_t count = (vertices.size() + stride_ - 1) / stride_;
    struct Place {
      Index facet;
      Sample sample;
    };
    double area = 0;
    for (std::size_t t = 0; t < shell_.triangles.size(); ++t) {
      const auto p = corners(t);
      area += (p[1] - p[0]).cross(p[2] - p[0]).norm() / 2;
    }
    std::vector<Place> places(count);
    parallel_for_blocks(count, 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3& q = vertices[i * stride_];
        const auto hit = tree.closest(q);
        const auto& v = fine.mesh.triangles[hit.triangle];
        const auto& [a, b, c] = v;
        const Vec3 &pa = fine.mesh.vertices[a], &pb = fine.mesh.vertices[b], &pc = fine.mesh.vertices[c];
        const Vec3 normal = (pb - pa).cross(pc - pa);
        const double twice = std::max(normal.norm(), 1e-300);
        const Vec3 n = normal / twice;
        const double lb = std::clamp((hit.point - pa).cross(pc - pa).dot(n) / twice, 0.0, 1.0);
        const double lc = std::clamp((pb - pa).cross(hit.point - pa).dot(n) / twice, 0.0, 1.0 - lb);
        const Vec2 at = (1 - lb - lc) * fine.barycentric[a] + lb * fine.barycentric[b] + lc * fine.barycentric[c];
        const Vec3 away = curved_patch(shell_, fine.shell[hit.triangle]).point(at) - q;
        const double distance = away.norm();
        const double along = away.dot(n);
        const bool beside = std::abs(along) < 0.7 * distance;
        const Vec3 direction = beside ? Vec3(away / distance) : n;
        places[i] = {fine.shell[hit.triangle],
                     {at, direction, away.dot(direction), distance, area / static_cast<double>(count)}};
      }
    });
    for (const Place& place : places) {
      samples_[place.facet].push_back(place.sample);
    }
  }

  /// One Gauss-Newton step on sum area |distance|^p, weights scaled by the largest distance.
  void turn(double p, double largest) {
    const std::size_t count = shell_.triangles.size();
    std::vector<Matrix6> matrices(count);
    std::vector<Vector6> sides(count);
    parallel_for_blocks(count, facets_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        const auto change = sensitivity(corners(t), normals(t));
        Matrix6 matrix = Matrix6::Zero();
        Vector6 side = Vector6::Zero();
        for (const Sample& s : samples_[t]) {
          const double weight = s.area * std::pow(std::max(s.distance / largest, 1e-3), p - 2);
          const Vector6 row = facets_[t].dot(s.direction) * change.at(s.at);
          matrix += weight * row * row.transpose();
          side -= weight * s.signed_distance * row;
        }
        matrices[t] = matrix;
        sides[t] = side;
      }
    });
    solve(matrices, sides);
  }

  void solve(const std::vector<Matrix6>& matrices, const std::vector<Vector6>& sides) {
    const auto unknowns = static_cast<Eigen::Index>(2 * shell_.vertices.size());
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(36 * matrices.size() + static_cast<std::size_t>(unknowns));
    Eigen::VectorXd side = Eigen::VectorXd::Zero(unknowns), diagonal = Eigen::VectorXd::Zero(unknowns);
    for (std::size_t t = 0; t < matrices.size(); ++t) {
      const auto at = [&](Eigen::Index i) {
        return static_cast<Eigen::Index>(2 * shell_.triangles[t][static_cast<std::size_t>(i / 2)]) + i % 2;
      };
      for (Eigen::Index i = 0; i < 6; ++i) {
        side[at(i)] += sides[t][i];
        diagonal[at(i)] += matrices[t](i, i);
        for (Eigen::Index j = 0; j < 6; ++j) {
          entries.emplace_back(at(i), at(j), matrices[t](i, j));
        }
      }
    }
    const double floor = 1e-9 * diagonal.maxCoeff() + 1e-300;
    for (Eigen::Index i = 0; i < unknowns; ++i) {
      entries.emplace_back(i, i, damping * diagonal[i] + floor);
    }
    Eigen::SparseMatrix<double> matrix(unknowns, unknowns);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    if (solver.info() != Eigen::Success) {
      return;
    }
    const Eigen::VectorXd step = solver.solve(side);
    if (!step.allFinite()) {
      return;
    }
    std::vector<Vec3> fan;
    for (std::size_t v = 0; v < shell_.vertices.size(); ++v) {
      fan.clear();
      for (const Index t : around_.of(static_cast<Index>(v))) {
        fan.push_back(facets_[t]);
      }
      if (fan.empty()) {
        continue;
      }
      Vec3& n = shell_.normals[v];
      const auto turn = turns(n);
      const auto i = static_cast<Eigen::Index>(2 * v);
      Vec3 change = step[i] * turn[0] + step[i + 1] * turn[1];
      if (const double size = change.norm(); size > largest_turn) {
        change *= largest_turn / size;
      }
      double now = 1;
      for (const Vec3& f : fan) {
        now = std::min(now, n.dot(f));
      }
      n = compatible_normal((n + change).normalized(), fan, std::min(least_agreement, now)).value_or(n);
    }
  }

  const Target& target_;
  ShellMesh& shell_;
  Incidence around_;
  std::vector<Vec3> facets_;
  std::size_t stride_ = 1;
  std::vector<std::vector<Sample>> samples_;
  double largest_ = 0;
};

}  // namespace

NormalFit fit_normals(const Target& target, ShellMesh& shell) { return Fit(target, shell).run(); }

}  // namespace tunica
