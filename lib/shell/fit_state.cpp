// Global least squares of shells to a target: element by element, solved by preconditioned conjugate gradients.
#include "shell/fit_state.hpp"

#include "core/progress.hpp"
#include "core/threads.hpp"
#include "shell/fit_boundary_edges.hpp"
#include "shell/fit_step.hpp"
#include "shell/normal_equations.hpp"
#include "surface/closest_point.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <memory>

namespace tunica {
namespace {

constexpr std::size_t patches_per_block = 16;
constexpr int search_level = 3;   // pieces per edge of the surface on which points of the target find their patch
constexpr int most_steps = 4;     // from patch to patch
constexpr double on_edge = 1e-9;  // of a patch's parameters
constexpr int most_cg_steps = 60;
constexpr double cg_tolerance = 1e-3;
constexpr double least_weight = 0.1;  // residuals below this part of the largest count alike
constexpr double none_doubted = std::numeric_limits<double>::infinity();
constexpr int trials = 6;
constexpr double doubted = 0.7;  // of the largest error: from there on it is looked at again

using Vector15 = Eigen::Matrix<double, 15, 1>;
using Matrix15 = Eigen::Matrix<double, 15, 15>;

/// The equations of a watertight patch with creases: its edges also follow normals across.
struct Creased {
  Index triangle;
  std::array<Index, 9> slots;  // of its corners, then of edges 1-2, 2-3, 3-1 across: start, end
  Eigen::Matrix<double, 27, 27> matrix = Eigen::Matrix<double, 27, 27>::Zero();
  Eigen::Matrix<double, 27, 1> side = Eigen::Matrix<double, 27, 1>::Zero();
};

template <typename Weight>
std::unique_ptr<Creased> creased_equations(const PatchShape& shape, const std::vector<Residual>& residuals,
                                           const Weight& weight) {
  auto out = std::make_unique<Creased>();
  Eigen::Matrix<double, 30, 27> jacobian;
  jacobian << patch_jacobian(shape), across_jacobian(shape);
  add_normal_equations<27>(jacobian, residuals, weight, out->matrix, out->side);
  return out;
}

/// x^n, n even
template <typename T>
T powered(const T& x, int n) {
  const T squared = x * x;
  T result(1.0);
  for (int i = 0; i < n; i += 2) {
    result *= squared;
  }
  return result;
}

double weight_of(double distance, int power, double scale) {
  return powered(std::max(std::abs(distance) / scale, least_weight), power - 2);
}

}  // namespace

FitState::FitState(const FitSamples& samples, FitMesh m, const FitLimits& l)
    : mesh(std::move(m)), limits(l), patches(mesh.triangles.size()), samples_(&samples) {}

void FitState::attach() {
  std::vector<Index> triangle;
  const ShellMesh shell = mesh.shell(&triangle);
  const Tessellation fine = tessellate_uniformly(shell, search_level);
  const ClosestPoint tree(fine.mesh);
  const auto& points = samples_->points();
  std::vector<Index> found(points.size());
  const BoundaryEdges boundary(mesh);
  parallel_for_blocks(points.size(), 512, [&](std::size_t begin, std::size_t end) {
    std::optional<Index> guess;
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [point, of_boundary] = points[i];
      if (of_boundary && !boundary.empty()) {
        found[i] = boundary.closest(point).triangle;
        continue;
      }
      const auto hit = guess ? tree.closest(point, *guess) : tree.closest(point);
      guess = hit.triangle;
      found[i] = triangle[fine.shell[hit.triangle]];
    }
  });
  for (Patch& p : patches) {
    p.attached.clear();
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    patches[found[i]].attached.push_back(static_cast<Index>(i));
  }
}

void FitState::attach_again() {
  const auto& points = samples_->points();
  std::vector<Index> home(points.size(), no_index);
  const BoundaryEdges boundary(mesh);
  const auto closer_patch = [&](Index q, Index here, PatchFoot foot) {
    for (int step = 0; step < most_steps; ++step) {
      const std::array<double, 3> weight{1 - foot.at[0] - foot.at[1], foot.at[0], foot.at[1]};
      Index next = no_index;
      PatchFoot best = foot;
      for (std::size_t k = 0; k < 3; ++k) {
        if (weight[(k + 2) % 3] > on_edge) {
          continue;
        }
        const auto pair = mesh.on_edge(mesh.triangles[here][k], mesh.triangles[here][(k + 1) % 3]);
        const Index other = pair.triangle[0] == here ? pair.triangle[1] : pair.triangle[0];
        if (other == no_index) {
          continue;
        }
        if (const PatchFoot there = foot_on_patch(mesh.patch(other), points[q].point);
            there.squared_distance < best.squared_distance) {
          best = there;
          next = other;
        }
      }
      if (next == no_index) {
        break;
      }
      here = next;
      foot = best;
    }
    return here;
  };
  parallel_for_blocks(patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto& attached = patches[t].attached;
      if (!mesh.is_alive(static_cast<Index>(t)) || attached.empty()) {
        continue;
      }
      const PatchPowers patch(mesh.patch(static_cast<Index>(t)));
      for (std::size_t i = 0; i < attached.size(); i += lane_count) {
        const LaneVec3 q = lane_points(
            [&](std::size_t k) -> const Vec3& { return points[attached[std::min(i + k, attached.size() - 1)]].point; });
        const LaneFeet feet = feet_on_patch(patch, q);
        for (std::size_t k = 0; k < std::min(lane_count, attached.size() - i); ++k) {
          const PatchFoot foot{
              {feet.x[k], feet.y[k]}, {feet.point[0][k], feet.point[1][k], feet.point[2][k]}, feet.squared_distance[k]};
          const Index point = attached[i + k];
          home[point] = points[point].of_boundary && !boundary.empty()
                            ? boundary.closest(points[point].point).triangle
                            : closer_patch(point, static_cast<Index>(t), foot);
        }
      }
    }
  });
  for (Patch& p : patches) {
    p.attached.clear();
  }
  for (std::size_t i = 0; i < home.size(); ++i) {
    if (home[i] != no_index) {
      patches[home[i]].attached.push_back(static_cast<Index>(i));
    }
  }
}

void FitState::measure(Index t, double doubted) {
  Patch& p = patches[t];
  p.residuals.clear();
  p.error = 0;
  if (!mesh.is_alive(t)) {
    return;
  }
  const CubicPatch patch = mesh.patch(t);
  const Vec3 facing = facing_of(mesh.corners(t));
  const PatchPowers powers(patch);
  samples_->from_patch(powers, facing, doubted, p.guesses, p.residuals);
  samples_->from_places(patch, facing, p.places, p.residuals);
  const EdgeBits boundary = mesh.boundary_edges(t);
  samples_->from_target(patch, powers, facing, boundary, p.attached, p.residuals);
  samples_->from_boundary(patch, facing, boundary, p.residuals);
  for (std::size_t k = 0; k < 3 && mesh.kind == tunica::Patch::comas; ++k) {  // watertight ones meet
    const Index from = mesh.triangles[t][k], to = mesh.triangles[t][(k + 1) % 3];
    const auto pair = mesh.on_edge(from, to);
    if (pair.count() == 2) {
      const Index other = pair.triangle[0] == t ? pair.triangle[1] : pair.triangle[0];
      FitSamples::from_gap(patch, k, (k + 1) % 3,
                           edge_points(mesh.patch(other), mesh.corner_of(other, from), mesh.corner_of(other, to)),
                           p.residuals);
    } else if (const auto beyond = mesh.points_beyond(from, to)) {
      FitSamples::from_gap(patch, k, (k + 1) % 3, *beyond, p.residuals);
    }
  }
  for (const Residual& r : p.residuals) {
    p.error = std::max(p.error, std::abs(r.distance));
  }
}

void FitState::measure() {
  patches.resize(mesh.triangles.size());
  parallel_for_blocks(patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      measure(static_cast<Index>(t), none_doubted);
    }
  });
  // Downhill from a wrong start a point may seem far that is not.
  const double far = doubted * error();
  parallel_for_blocks(patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      if (patches[t].error > far) {
        measure(static_cast<Index>(t), far);
      }
    }
  });
}

double FitState::error() const {
  double largest = 0;
  for (const Patch& p : patches) {
    largest = std::max(largest, p.error);
  }
  return largest;
}

double FitState::cost_of(const Patch& patch, int power, double scale) const {
  double cost = 0;
  for (const Residual& r : patch.residuals) {
    cost += weight_of(r.distance, power, scale) * r.distance * r.distance / (scale * scale);
  }
  return cost;
}

Vec3 FitState::middle_of_ring(Index node) const {
  Vec3 sum = Vec3::Zero();
  double weight = 0;
  std::vector<Index> ring;
  mesh.ring(node, ring);
  for (const Index v : ring) {
    const auto pair = mesh.on_edge(node, v);
    // On a boundary or crease a node slides along it only.
    const bool border = pair.count() == 1;
    if (mesh.on_boundary[node] != 0 && !border) {
      continue;
    }
    sum += mesh.positions[v];
    weight += 1;
  }
  return weight > 0 ? Vec3(sum / weight) : mesh.positions[node];
}

void FitState::changed_patches(const std::vector<std::uint8_t>& moved, std::vector<std::uint8_t>& changed) const {
  std::fill(changed.begin(), changed.end(), 0);
  for (std::size_t t = 0; t < changed.size(); ++t) {
    const auto& v = mesh.triangles[t];
    if (!mesh.is_alive(static_cast<Index>(t)) || (moved[v[0]] | moved[v[1]] | moved[v[2]]) == 0) {
      continue;
    }
    changed[t] = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      for (const Index other : mesh.on_edge(v[k], v[(k + 1) % 3]).triangle) {
        if (other != no_index) {
          changed[other] = 1;
        }
      }
    }
  }
}

double FitState::solve(int power, double smoothing) {
  check_interrupt();
  const std::size_t nodes = mesh.positions.size(), slots = mesh.normals.size(), count = mesh.triangles.size();
  const double scale = error();
  if (!(scale > 1e-12 * samples_->target().diagonal())) {
    return 1;
  }
  // Patch by patch: matrix, right side.
  std::vector<Matrix15> matrices(count);
  std::vector<Vector15> sides(count);
  std::vector<double> costs(count, 0);
  std::vector<std::unique_ptr<Creased>> creased(count);
  const auto weight = [&](const Lanes& distance) {
    return powered(std::experimental::max(distance / scale, Lanes(least_weight)), power - 2);
  };
  parallel_for_blocks(count, patches_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      matrices[t].setZero();
      sides[t].setZero();
      if (!mesh.is_alive(static_cast<Index>(t))) {
        continue;
      }
      costs[t] = cost_of(patches[t], power, scale);
      const PatchShape form = shape(static_cast<Index>(t));
      if (form.across) {
        creased[t] = creased_equations(form, patches[t].residuals, weight);
        creased[t]->triangle = static_cast<Index>(t);
        const auto across = mesh.slots_across(static_cast<Index>(t));
        for (std::size_t i = 0; i < 9; ++i) {
          creased[t]->slots[i] = i < 3 ? mesh.slots[t][i] : across[(i - 3) / 2][(i - 3) % 2];
        }
        matrices[t] = creased[t]->matrix.topLeftCorner<15, 15>();
        sides[t] = creased[t]->side.head<15>();
        continue;
      }
      add_normal_equations<15>(patch_jacobian(form), patches[t].residuals, weight, matrices[t], sides[t]);
    }
  });
  std::erase(creased, nullptr);
  // Node by node: diagonal blocks with damping, pull to the middle.
  const std::size_t tilts = 3 * nodes, size = tilts + 2 * slots;
  Eigen::VectorXd side = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size));
  std::vector<Mat3> position_block(nodes, Mat3::Zero()), position_damping(nodes, Mat3::Zero()), position_inverse(nodes);
  std::vector<Eigen::Matrix2d> tilt_block(slots, Eigen::Matrix2d::Zero()), tilt_inverse(slots);
  std::vector<double> tilt_damping(slots, 0), edge(nodes, 0);
  for (std::size_t t = 0; t < count; ++t) {
    if (!mesh.is_alive(static_cast<Index>(t))) {
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = mesh.triangles[t][k], s = mesh.slots[t][k];
      const auto i = static_cast<Eigen::Index>(k);
      position_block[v] += matrices[t].block<3, 3>(3 * i, 3 * i);
      tilt_block[s] += matrices[t].block<2, 2>(9 + 2 * i, 9 + 2 * i);
      side.segment<3>(3 * static_cast<Eigen::Index>(v)) += sides[t].segment<3>(3 * i);
      side.segment<2>(static_cast<Eigen::Index>(tilts + 2 * s)) += sides[t].segment<2>(9 + 2 * i);
      edge[v] += (mesh.positions[mesh.triangles[t][(k + 1) % 3]] - mesh.positions[v]).norm();
    }
  }
  for (const auto& patch : creased) {
    for (std::size_t i = 3; i < 9; ++i) {
      const auto at = static_cast<Eigen::Index>(9 + 2 * i);
      tilt_block[patch->slots[i]] += patch->matrix.block<2, 2>(at, at);
      side.segment<2>(static_cast<Eigen::Index>(tilts + 2 * patch->slots[i])) += patch->side.segment<2>(at);
    }
  }
  std::vector<Index> of_node;
  for (std::size_t v = 0; v < nodes; ++v) {
    if (mesh.around[v].empty() || mesh.is_held(static_cast<Index>(v))) {
      position_inverse[v].setZero();
      continue;
    }
    edge[v] /= static_cast<double>(mesh.around[v].size());
    double largest = 0;
    for (const Index t : mesh.around[v]) {
      largest = std::max(largest, patches[t].error);
    }
    mesh.slots_of(static_cast<Index>(v), of_node);
    const double stiffness = position_block[v].trace();
    const double slide = stiffness * std::min(1.0, std::pow(largest / edge[v], 2));
    Mat3 damping = (1e-6 * stiffness + 0.3 * slide) * Mat3::Identity();
    if (of_node.size() == 1) {
      const Vec3& n = mesh.normals[of_node[0]];
      const Mat3 tangential = Mat3::Identity() - n * n.transpose();
      damping += smoothing * slide * tangential;
      side.segment<3>(3 * static_cast<Eigen::Index>(v)) +=
          smoothing * slide * (tangential * (middle_of_ring(static_cast<Index>(v)) - mesh.positions[v]));
    }
    position_damping[v] = damping;
    position_block[v] += damping;
    position_inverse[v] = position_block[v].inverse();
    for (const Index s : of_node) {
      tilt_damping[s] = 1e-4 * tilt_block[s].trace() + 1e-6 * stiffness * edge[v] * edge[v] + 1e-300;
      tilt_block[s].diagonal().array() += tilt_damping[s];
      tilt_inverse[s] = tilt_block[s].inverse();
    }
  }
  // Conjugate gradients.
  const auto gather = [&](const Eigen::VectorXd& x, std::size_t t) {
    Vector15 local;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      local.segment<3>(3 * i) = x.segment<3>(3 * static_cast<Eigen::Index>(mesh.triangles[t][k]));
      local.segment<2>(9 + 2 * i) = x.segment<2>(static_cast<Eigen::Index>(tilts + 2 * mesh.slots[t][k]));
    }
    return local;
  };
  const auto scatter = [&](const Vector15& local, std::size_t t, Eigen::VectorXd& y) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      y.segment<3>(3 * static_cast<Eigen::Index>(mesh.triangles[t][k])) += local.segment<3>(3 * i);
      y.segment<2>(static_cast<Eigen::Index>(tilts + 2 * mesh.slots[t][k])) += local.segment<2>(9 + 2 * i);
    }
  };
  const auto apply = [&](const Eigen::VectorXd& x) {
    Eigen::VectorXd y = Eigen::VectorXd::Zero(x.size());
    for (std::size_t t = 0; t < count; ++t) {
      if (!mesh.is_alive(static_cast<Index>(t))) {
        continue;
      }
      scatter(matrices[t] * gather(x, t), t, y);
    }
    for (const auto& patch : creased) {
      Eigen::Matrix<double, 27, 1> all;
      all.head<15>() = gather(x, patch->triangle);
      for (std::size_t i = 3; i < 9; ++i) {
        all.segment<2>(static_cast<Eigen::Index>(9 + 2 * i)) =
            x.segment<2>(static_cast<Eigen::Index>(tilts + 2 * patch->slots[i]));
      }
      const Vector15 own = patch->matrix.topRightCorner<15, 12>() * all.tail<12>();
      const Eigen::Matrix<double, 12, 1> across = patch->matrix.bottomRows<12>() * all;
      scatter(own, patch->triangle, y);
      for (std::size_t i = 3; i < 9; ++i) {
        y.segment<2>(static_cast<Eigen::Index>(tilts + 2 * patch->slots[i])) +=
            across.segment<2>(static_cast<Eigen::Index>(2 * i - 6));
      }
    }
    for (std::size_t v = 0; v < nodes; ++v) {
      const auto i = 3 * static_cast<Eigen::Index>(v);
      y.segment<3>(i) += position_damping[v] * x.segment<3>(i);
    }
    for (std::size_t s = 0; s < slots; ++s) {
      const auto i = static_cast<Eigen::Index>(tilts + 2 * s);
      y.segment<2>(i) += tilt_damping[s] * x.segment<2>(i);
    }
    return y;
  };
  const auto precondition = [&](const Eigen::VectorXd& r) {
    Eigen::VectorXd z = Eigen::VectorXd::Zero(r.size());
    for (std::size_t v = 0; v < nodes; ++v) {
      const auto i = 3 * static_cast<Eigen::Index>(v);
      z.segment<3>(i) = position_inverse[v] * r.segment<3>(i);
    }
    for (std::size_t s = 0; s < slots; ++s) {
      const auto i = static_cast<Eigen::Index>(tilts + 2 * s);
      if (tilt_damping[s] > 0) {
        z.segment<2>(i) = tilt_inverse[s] * r.segment<2>(i);
      }
    }
    return z;
  };
  Eigen::VectorXd x = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size));
  Eigen::VectorXd r = side, z = precondition(r), d = z;
  double rz = r.dot(z);
  const double enough = rz * cg_tolerance * cg_tolerance;
  for (int i = 0; i < most_cg_steps && rz > enough; ++i) {
    const Eigen::VectorXd ad = apply(d);
    const double alpha = rz / d.dot(ad);
    x += alpha * d;
    r -= alpha * ad;
    z = precondition(r);
    const double next = r.dot(z);
    d = z + (next / rz) * d;
    rz = next;
  }
  if (!x.allFinite()) {
    return 1;
  }
  // The step, node by node as long as it betters what is around.
  const auto old_positions = mesh.positions;
  const auto old_normals = mesh.normals;
  std::vector<double> old_agreement(count, 0), old_angle(count, 0);
  std::vector<Vec3> old_facing(count);
  for (std::size_t t = 0; t < count; ++t) {
    if (mesh.is_alive(static_cast<Index>(t))) {
      const auto c = mesh.corners(static_cast<Index>(t));
      old_facing[t] = facing_of(c);
      old_agreement[t] = normal_agreement(c, mesh.corner_normals(static_cast<Index>(t)));
      old_angle[t] = smallest_angle_degrees(c[0], c[1], c[2]);
    }
  }
  std::vector<std::uint8_t> upright(nodes, 0);
  std::vector<double> length(nodes, 1), fan_cost(nodes, 0);
  for (std::size_t t = 0; t < count; ++t) {
    for (std::size_t k = 0; mesh.is_alive(static_cast<Index>(t)) && k < 3; ++k) {
      fan_cost[mesh.triangles[t][k]] += costs[t];
    }
  }
  double before = 0;
  for (const double c : costs) {
    before += c;
  }
  const std::vector<Patch> old_patches = patches;
  std::vector<double> new_costs(count, 0);
  std::vector<std::uint8_t> broken(count, 0), moved(nodes, 1), changed(count, 1);
  for (std::size_t v = 0; v < nodes; ++v) {
    if (mesh.is_held(static_cast<Index>(v))) {
      moved[v] = 0;
      length[v] = 0;
    }
  }
  NodeStep step;
  for (int trial = 0; trial <= trials; ++trial) {
    for (std::size_t v = 0; v < nodes; ++v) {
      if (mesh.around[v].empty() || moved[v] == 0) {
        continue;
      }
      mesh.slots_of(static_cast<Index>(v), of_node);
      if (length[v] == 0) {
        take_back(mesh, static_cast<Index>(v), of_node, old_positions, old_normals);
        continue;
      }
      step.move = length[v] * x.segment<3>(3 * static_cast<Eigen::Index>(v));
      step.edge = edge[v];
      step.along.reset();
      if (upright[v] != 0) {
        const Index first = mesh.around[v][0];
        step.along = old_normals[mesh.slots[first][mesh.corner_of(first, static_cast<Index>(v))]];
      }
      step.tilts.clear();
      for (const Index s : of_node) {
        step.tilts.emplace_back(length[v] * x.segment<2>(static_cast<Eigen::Index>(tilts + 2 * s)));
      }
      take_step(mesh, static_cast<Index>(v), of_node, step, old_positions, old_normals, limits.kink);
    }
    std::vector<std::uint8_t> bad(nodes, 0);
    changed_patches(moved, changed);
    parallel_for_blocks(count, patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        const auto i = static_cast<Index>(t);
        if (!mesh.is_alive(i) || changed[t] == 0) {
          continue;
        }
        broken[t] =
            !is_sound(i, std::min(limits.agreement, old_agreement[t]), least_angle(limits.angle, old_angle[t])) ||
            facing_of(mesh.corners(i)).dot(old_facing[t]) < 0.3;
        if (broken[t] == 0) {
          measure(i, none_doubted);
          new_costs[t] = cost_of(patches[t], power, scale);
        } else {
          new_costs[t] = 0;
        }
      }
    });
    std::vector<double> now(nodes, 0);
    double after = 0;
    bool any = false;
    for (std::size_t t = 0; t < count; ++t) {
      after += new_costs[t];
      for (std::size_t k = 0; mesh.is_alive(static_cast<Index>(t)) && k < 3; ++k) {
        now[mesh.triangles[t][k]] += new_costs[t];
        bad[mesh.triangles[t][k]] |= broken[t];
      }
    }
    for (std::size_t v = 0; v < nodes; ++v) {
      bad[v] = bad[v] != 0 || now[v] > 1.05 * fan_cost[v] + 1e-6 * before;
      any = any || (bad[v] != 0 && length[v] > 0);
    }
    const bool some_broken = std::find(broken.begin(), broken.end(), 1) != broken.end();
    if (!some_broken && (!any || trial >= trials - 1) && after <= before) {
      return after / before;
    }
    if (trial == trials) {
      break;
    }
    moved = bad;
    for (std::size_t v = 0; v < nodes; ++v) {
      if (bad[v] != 0) {
        // First without sliding, which is what spoils angles; then shorter; then not at all.
        length[v] = trial == 0 ? length[v] : trial < trials - 2 ? 0.35 * length[v] : 0;
        upright[v] = 1;
      }
    }
  }
  mesh.positions = old_positions;
  mesh.normals = old_normals;
  patches = old_patches;
  return 1;
}

}  // namespace tunica
