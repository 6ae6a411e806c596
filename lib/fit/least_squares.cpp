// Residuals follow the control points of their patch, these its nodes and normals: a sparse system of at most 27
// unknowns per patch (three nodes, their normals, and across creases the neighbours' normals).
#include "tunica/fit/detail/least_squares.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double largest_step = 0.3;       // rad of a normal, part of the mean edge at a node: the model is linear
constexpr double least_weight = 0.1;       // residuals below this part of the largest count alike
constexpr double sliding = 0.3;            // damping and smoothing, of the diagonal, where errors are as large as edges
constexpr double damping = 1e-4;           // of the diagonal: regular whatever the residuals see
constexpr int trials = 5;                  // halvings; the last without the nodes that still have no better place
constexpr double may_grow = 1.05;          // the sum around a node: what its neighbours' steps gain or cost it
constexpr Eigen::Index few_unknowns = 80;  // solved as a dense system
constexpr double difference = 1e-6;        // of an edge, rad: derivatives by differences
constexpr int most_columns = 27;           // of a patch: its nodes, their normals, three across creases

using Jacobian = Eigen::Matrix<double, 30, Eigen::Dynamic, Eigen::ColMajor, 30, most_columns>;

std::array<Vec3, 2> tilt_axes(const Vec3& normal) {
  const Vec3 first = normal.unitOrthogonal();
  return {first, normal.cross(first)};
}

/// The part of the normal equations that one patch contributes.
struct Equations {
  std::vector<Eigen::Index> unknowns;
  Eigen::MatrixXd matrix;
  Eigen::VectorXd side;
};

/// The first of the three unknowns of each node, of the two of each slot; -1: it stays.
struct Unknowns {
  std::vector<Eigen::Index> node, slot;
  Eigen::Index size = 0;
};

/// How the control points follow the unknowns, by differences.
Jacobian jacobian(const FitPiece& piece, const FitPatch& p, const Unknowns& of, std::vector<Eigen::Index>& unknowns) {
  struct Shape {
    std::array<Vec3, 3> corners, normals;
    NormalsAcross across;
  };
  const Shape shape{piece.corners(p), piece.corner_normals(p), piece.normals_across(p)};
  const auto control = [&](const Shape& s) {
    const CubicPatch patch = piece.kind == Patch::watertight ? watertight_patch(s.corners, s.normals, s.across)
                                                             : comas_patch(s.corners, s.normals);
    return Eigen::Matrix<double, 30, 1>(Eigen::Map<const Eigen::Matrix<double, 30, 1>>(patch.control[0].data()));
  };
  const Eigen::Matrix<double, 30, 1> base = control(shape);
  const double step = difference * std::sqrt((shape.corners[1] - shape.corners[0]).squaredNorm() +
                                             (shape.corners[2] - shape.corners[0]).squaredNorm());
  Jacobian out(30, most_columns);
  Shape changed = shape;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Index first = of.node[p.nodes[k]];
    for (Eigen::Index axis = 0; first >= 0 && axis < 3; ++axis) {
      changed.corners[k][axis] += step;
      out.col(unknowns.size()) = (control(changed) - base) / step;
      unknowns.push_back(first + axis);
      changed.corners[k] = shape.corners[k];
    }
  }
  std::vector<Index> slots(p.slots.begin(), p.slots.end());
  for (const auto& ends : p.across) {
    for (const Index s : ends) {
      if (piece.kind == Patch::watertight && std::find(slots.begin(), slots.end(), s) == slots.end()) {
        slots.push_back(s);
      }
    }
  }
  for (const Index s : slots) {
    const auto axes = tilt_axes(piece.normals[s]);
    for (Eigen::Index axis = 0; of.slot[s] >= 0 && axis < 2; ++axis) {
      const Vec3 tilted = piece.normals[s] + difference * axes[axis];
      for (std::size_t k = 0; k < 3; ++k) {
        changed.normals[k] = p.slots[k] == s ? tilted : shape.normals[k];
        for (std::size_t end = 0; end < 2; ++end) {
          changed.across[k][end] = p.across[k][end] == s ? tilted : shape.across[k][end];
        }
      }
      out.col(unknowns.size()) = (control(changed) - base) / difference;
      unknowns.push_back(of.slot[s] + axis);
    }
  }
  out.conservativeResize(30, unknowns.size());
  return out;
}

Eigen::VectorXd solve(const std::vector<Eigen::Triplet<double>>& entries, const Eigen::VectorXd& side) {
  const Eigen::Index size = side.size();
  if (size <= few_unknowns) {
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
    for (const auto& e : entries) {
      dense(e.row(), e.col()) += e.value();
    }
    return dense.ldlt().solve(side);
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
  solver.setTolerance(1e-3);
  solver.setMaxIterations(100);
  return solver.compute(matrix).solve(side);
}

class Step {
public:
  Step(FitPiece& piece, const FitSamples& samples, const SquaresOptions& options)
      : piece_(piece), samples_(samples), options_(options) {}

  double run() {
    for (const FitPatch& p : piece_.patches) {
      scale_ = std::max(scale_, p.error);
    }
    number_unknowns();
    if (of_.size == 0 || !(scale_ > 1e-12 * samples_.target().diagonal())) {
      return 1;
    }
    assemble();
    look_around();
    const Eigen::VectorXd x = solved();
    return x.allFinite() ? walked(x) : 1;
  }

private:
  struct Node {
    std::vector<Index> slots;
    double edge = 0;   // mm, mean
    double error = 0;  // mm, largest around
    double cost = 0;   // around
    int patches = 0;
    Vec3 sum = Vec3::Zero();         // of its neighbours
    std::vector<Index> on_features;  // neighbours along boundaries and creases
  };

  void number_unknowns() {
    nodes_.resize(piece_.positions.size());
    of_.node.assign(piece_.positions.size(), -1);
    of_.slot.assign(piece_.normals.size(), -1);
    for (const FitPatch& p : piece_.patches) {
      for (std::size_t k = 0; p.is_alive() && k < 3; ++k) {
        ++nodes_[p.nodes[k]].patches;
      }
    }
    for (std::size_t v = 0; v < nodes_.size(); ++v) {
      if (options_.positions && piece_.free[v] != 0 && nodes_[v].patches > 0) {
        of_.node[v] = of_.size;
        of_.size += 3;
      }
    }
    for (std::size_t s = 0; s < of_.slot.size(); ++s) {
      const Index v = piece_.node_of_slot[s];
      if (piece_.free[v] != 0 && nodes_[v].patches > 0) {
        nodes_[v].slots.push_back(narrow<Index>(s));
        of_.slot[s] = of_.size;
        of_.size += 2;
      }
    }
  }

  [[nodiscard]] double weight(const Residual& r) const {
    const double part = std::max(std::abs(r.distance) / scale_, least_weight);
    return options_.largest ? part * part : 1;
  }

  [[nodiscard]] double cost_of(const FitPatch& p) const {
    double cost = 0;
    for (const Residual& r : p.residuals) {
      cost += weight(r) * r.distance * r.distance;
    }
    return cost;
  }

  Equations equations(const FitPatch& p) const {
    Equations out;
    const Jacobian control = jacobian(piece_, p, of_, out.unknowns);
    const Eigen::Index n = out.unknowns.size();
    out.matrix = Eigen::MatrixXd::Zero(n, n);
    out.side = Eigen::VectorXd::Zero(n);
    Eigen::VectorXd row(n);
    Eigen::Matrix<double, 30, 1> reach;
    // One after the other: in a product of all rows Eigen's order depends on the processor's caches.
    for (const Residual& r : p.residuals) {
      const auto basis = bernstein(r.at);
      for (std::size_t j = 0; j < 10; ++j) {
        reach.segment<3>(3 * j) = basis[j] * r.direction;
      }
      const double root = std::sqrt(weight(r));
      row.noalias() = root * (control.transpose() * reach);
      out.matrix.noalias() += row * row.transpose();
      out.side -= root * r.distance * row;
    }
    return out;
  }

  void assemble() {
    equations_.resize(piece_.patches.size());
    costs_.assign(piece_.patches.size(), 0);
    parallel_for_blocks(piece_.patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        if (piece_.patches[t].is_alive()) {
          equations_[t] = equations(piece_.patches[t]);
          costs_[t] = cost_of(piece_.patches[t]);
        }
      }
    });
  }

  /// Gathers what nodes know of their surroundings.
  void look_around() {
    for (std::size_t t = 0; t < piece_.patches.size(); ++t) {
      const FitPatch& p = piece_.patches[t];
      for (std::size_t k = 0; p.is_alive() && k < 3; ++k) {
        const Index here = p.nodes[k], there = p.nodes[(k + 1) % 3];
        Node &a = nodes_[here], &b = nodes_[there];
        const Vec3 way = piece_.positions[there] - piece_.positions[here];
        a.edge += way.norm() / a.patches;
        a.error = std::max(a.error, p.error);
        a.cost += costs_[t];
        a.sum += way;
        b.sum -= way;
        if ((p.boundary >> k & 1) != 0 || p.is_creased(k)) {
          for (const auto& [node, other] : {std::pair(&a, there), {&b, here}}) {
            if (std::find(node->on_features.begin(), node->on_features.end(), other) == node->on_features.end()) {
              node->on_features.push_back(other);
            }
          }
        }
      }
    }
  }

  /// The pull of a node towards the middle of its neighbours: along its surface or feature; at corners none.
  [[nodiscard]] std::pair<Mat3, Vec3> pull(std::size_t v) const {
    const Node& node = nodes_[v];
    if (node.on_features.empty()) {
      const Vec3& n = piece_.normals[node.slots[0]];
      const Mat3 within = Mat3::Identity() - n * n.transpose();
      return {within, within * node.sum / (2 * node.patches)};
    }
    if (node.on_features.size() != 2) {
      return {Mat3::Zero(), Vec3::Zero()};
    }
    const Vec3 &a = piece_.positions[node.on_features[0]], &b = piece_.positions[node.on_features[1]];
    const Vec3 along = (b - a).stableNormalized();
    return {along * along.transpose(), along * along.dot((a + b) / 2 - piece_.positions[v])};
  }

  [[nodiscard]] Eigen::VectorXd solved() const {
    Eigen::VectorXd side = Eigen::VectorXd::Zero(of_.size), diagonal = Eigen::VectorXd::Zero(of_.size);
    std::vector<Eigen::Triplet<double>> entries;
    for (const Equations& e : equations_) {
      for (std::size_t a = 0; a < e.unknowns.size(); ++a) {
        const Eigen::Index i = a;
        side[e.unknowns[a]] += e.side[i];
        diagonal[e.unknowns[a]] += e.matrix(i, i);
        for (std::size_t b = 0; b < e.unknowns.size(); ++b) {
          entries.emplace_back(e.unknowns[a], e.unknowns[b], e.matrix(i, b));
        }
      }
    }
    for (std::size_t v = 0; v < nodes_.size(); ++v) {
      const Node& node = nodes_[v];
      double stiffness = 0;
      if (of_.node[v] >= 0) {
        stiffness = diagonal.segment<3>(of_.node[v]).sum();
        const double slide = sliding * stiffness * std::min(1.0, std::pow(node.error / node.edge, 2));
        const double pulling = options_.smooth ? std::max(slide, damping * stiffness) : 0;
        const auto [within, way] = pull(v);
        const Mat3 held = (damping * stiffness + slide) * Mat3::Identity() + pulling * within;
        side.segment<3>(of_.node[v]) += pulling * way;
        for (Eigen::Index i = 0; i < 3; ++i) {
          for (Eigen::Index j = 0; j < 3; ++j) {
            entries.emplace_back(of_.node[v] + i, of_.node[v] + j, held(i, j));
          }
        }
      }
      for (const Index s : node.slots) {
        const double held =
            damping * (diagonal.segment<2>(of_.slot[s]).sum() + stiffness * node.edge * node.edge) + 1e-300;
        entries.emplace_back(of_.slot[s], of_.slot[s], held);
        entries.emplace_back(of_.slot[s] + 1, of_.slot[s] + 1, held);
      }
    }
    return solve(entries, side);
  }

  void put(std::size_t v, double length, const Eigen::VectorXd& x) {
    const Node& node = nodes_[v];
    if (of_.node[v] >= 0) {
      Vec3 move = length * x.segment<3>(of_.node[v]);
      if (const double far = move.norm(); far > largest_step * node.edge) {
        move *= largest_step * node.edge / far;
      }
      piece_.positions[v] = positions_[v] + move;
    }
    for (const Index s : node.slots) {
      Vec2 tilt = length * x.segment<2>(of_.slot[s]);
      if (const double far = tilt.norm(); far > largest_step) {
        tilt *= largest_step / far;
      }
      const auto axes = tilt_axes(normals_[s]);
      piece_.normals[s] = (normals_[s] + tilt[0] * axes[0] + tilt[1] * axes[1]).normalized();
    }
  }

  /// Measures the patches that changed. @return which of them have lost their shape
  std::vector<std::uint8_t> measured(const std::vector<std::uint8_t>& moved, std::vector<double>& costs) {
    if (!piece_.points.empty()) {
      samples_.attach(piece_);
    }
    std::vector<std::uint8_t> broken(piece_.patches.size(), 0);
    parallel_for_blocks(piece_.patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        FitPatch& p = piece_.patches[t];
        if (!p.is_alive() || (moved[p.nodes[0]] | moved[p.nodes[1]] | moved[p.nodes[2]]) == 0) {
          continue;
        }
        broken[t] = shape_shortfall(piece_, p, options_.shape) > shortfall_[t] + negligible_shortfall ||
                    piece_.facing(p).dot(facing_[t]) < options_.shape.agreement;
        if (broken[t] == 0) {
          samples_.measure(piece_, p, options_.search_beyond);
          costs[t] = cost_of(p);
        }
      }
    });
    return broken;
  }

  /// Goes the step, node by node as far as it helps.
  double walked(const Eigen::VectorXd& x) {
    const std::size_t count = piece_.patches.size();
    positions_ = piece_.positions;
    normals_ = piece_.normals;
    const std::vector<FitPatch> patches = piece_.patches;
    shortfall_.assign(count, 0);
    facing_.resize(count);
    double before = 0;
    for (std::size_t t = 0; t < count; ++t) {
      if (piece_.patches[t].is_alive()) {
        shortfall_[t] = shape_shortfall(piece_, piece_.patches[t], options_.shape);
        facing_[t] = piece_.facing(piece_.patches[t]);
        before += costs_[t];
      }
    }
    std::vector<double> length(nodes_.size(), 1), costs = costs_;
    std::vector<std::uint8_t> moved(nodes_.size(), 1);
    for (int trial = 0; trial <= trials; ++trial) {
      for (std::size_t v = 0; v < nodes_.size(); ++v) {
        if (moved[v] != 0) {
          put(v, length[v], x);
        }
      }
      const auto broken = measured(moved, costs);
      std::vector<std::uint8_t> bad(nodes_.size(), 0);
      std::vector<double> around(nodes_.size(), 0);
      double after = 0;
      for (std::size_t t = 0; t < count; ++t) {
        after += costs[t];
        for (std::size_t k = 0; piece_.patches[t].is_alive() && k < 3; ++k) {
          around[piece_.patches[t].nodes[k]] += costs[t];
          bad[piece_.patches[t].nodes[k]] |= broken[t];
        }
      }
      bool any = false;
      for (std::size_t v = 0; v < nodes_.size(); ++v) {
        bad[v] = length[v] > 0 && (of_.node[v] >= 0 || !nodes_[v].slots.empty()) &&
                 (bad[v] != 0 || around[v] > may_grow * nodes_[v].cost + 1e-6 * before);
        any = any || bad[v] != 0;
      }
      const bool sound = std::find(broken.begin(), broken.end(), 1) == broken.end();
      if (sound && after <= before && (!any || trial >= trials - 1)) {
        return after / before;
      }
      moved = bad;
      for (std::size_t v = 0; v < nodes_.size(); ++v) {
        length[v] *= bad[v] == 0 ? 1 : trial < trials - 2 ? 0.5 : 0;
      }
    }
    piece_.positions = positions_;
    piece_.normals = normals_;
    piece_.patches = patches;
    return 1;
  }

  FitPiece& piece_;
  const FitSamples& samples_;
  const SquaresOptions& options_;
  double scale_ = 0;
  Unknowns of_;
  std::vector<Node> nodes_;
  std::vector<Equations> equations_;
  std::vector<double> costs_, shortfall_;
  std::vector<Vec3> facing_, positions_, normals_;
};

}  // namespace

double least_squares_step(FitPiece& piece, const FitSamples& samples, const SquaresOptions& options) {
  check_interrupt();
  return Step(piece, samples, options).run();
}

}  // namespace tunica
