#include "shell/fit_minimax.hpp"

#include "core/progress.hpp"
#include "core/threads.hpp"
#include "shell/fit_step.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tunica {
namespace {

constexpr std::size_t patches_per_block = 16;
constexpr int most_interior_steps = 20;
constexpr double gap = 0.01;         // of the bound: what is enough
constexpr double to_the_wall = 0.9;  // of the way that keeps all slacks positive
constexpr double headroom = 1.1;     // times the largest residual: the first bound
constexpr double first_damping = 1, least_damping = 1e-3, more_damping = 6, somewhat_more_damping = 2,
                 less_damping = 0.3;
constexpr double as_foretold = 0.6;  // of the gain: then the next step is damped less
constexpr int damped_tries = 3;
constexpr double least_facing = 0.3;  // cosine: a facet turns no farther
constexpr int mends = 5;              // of moves that break facets
constexpr double shortened = 0.35;
// Limits: where more is foretold of the i-th step the error hardly ever comes below the limit.
constexpr std::array<double, 8> promising{1.12, 1.06, 1.04, 1.03, 1.02, 1.02, 1.02, 1.02};
constexpr double little = 1e-3;  // of the error: what a step must bring to be followed by another

/// Numbers what may move: x, y, z of nodes, and two tilts of each of their normals.
class Unknowns {
public:
  explicit Unknowns(const FitMesh& mesh) : of_node_(mesh.positions.size(), none), of_slot_(mesh.normals.size(), none) {
    std::vector<Index> slots;
    for (Index v = 0; v < mesh.positions.size(); ++v) {
      if (mesh.around[v].empty() || mesh.is_held(v)) {
        continue;
      }
      of_node_[v] = size_;
      size_ += 3;
      mesh.slots_of(v, slots);
      for (const Index s : slots) {
        of_slot_[s] = size_;
        size_ += 2;
      }
    }
  }

  static constexpr int none = -1;
  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] int of_node(Index v) const { return of_node_[v]; }
  [[nodiscard]] int of_slot(Index s) const { return of_slot_[s]; }

private:
  std::vector<int> of_node_, of_slot_;
  int size_ = 0;
};

double mean_edge(const FitMesh& mesh, Index v) {
  double sum = 0;
  for (const Index t : mesh.around[v]) {
    sum += (mesh.positions[mesh.triangles[t][(mesh.corner_of(t, v) + 1) % 3]] - mesh.positions[v]).norm();
  }
  return sum / static_cast<double>(mesh.around[v].size());
}

/// The residuals of a patch as linear functions of what may move.
struct Rows {
  std::vector<int> unknowns;  ///< columns
  Eigen::MatrixXd follow;     ///< #residuals x #columns
  Eigen::VectorXd now;        ///< mm / scale
};

Rows rows_of(const FitState& state, const Unknowns& unknowns, Index t, double scale) {
  const FitMesh& mesh = state.mesh;
  const PatchShape shape = state.shape(t);
  std::vector<int> of_column;
  const auto add = [&](int first, int count) {
    for (int i = 0; i < count; ++i) {
      of_column.push_back(first == Unknowns::none ? Unknowns::none : first + i);
    }
  };
  for (const Index v : mesh.triangles[t]) {
    add(unknowns.of_node(v), 3);
  }
  for (const Index s : mesh.slots[t]) {
    add(unknowns.of_slot(s), 2);
  }
  if (shape.across) {
    for (const auto& ends : mesh.slots_across(t)) {
      for (const Index s : ends) {
        add(unknowns.of_slot(s), 2);
      }
    }
  }
  Eigen::MatrixXd jacobian(30, static_cast<Eigen::Index>(of_column.size()));
  jacobian.leftCols<15>() = patch_jacobian(shape);
  if (shape.across) {
    jacobian.rightCols<12>() = across_jacobian(shape);
  }
  Rows out;
  for (std::size_t c = 0; c < of_column.size(); ++c) {
    if (of_column[c] != Unknowns::none) {
      jacobian.col(static_cast<Eigen::Index>(out.unknowns.size())) = jacobian.col(static_cast<Eigen::Index>(c));
      out.unknowns.push_back(of_column[c]);
    }
  }
  jacobian.conservativeResize(Eigen::NoChange, static_cast<Eigen::Index>(out.unknowns.size()));
  const auto& residuals = state.patches[t].residuals;
  const auto count = static_cast<Eigen::Index>(residuals.size());
  Eigen::MatrixXd moved(30, count);
  out.now.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Residual& r = residuals[static_cast<std::size_t>(i)];
    const double l2 = r.at[0], l3 = r.at[1], l1 = 1 - l2 - l3;
    const std::array<double, 10> basis{l1 * l1 * l1,     l2 * l2 * l2,     l3 * l3 * l3,     3 * l1 * l1 * l2,
                                       3 * l1 * l2 * l2, 3 * l2 * l2 * l3, 3 * l2 * l3 * l3, 3 * l3 * l3 * l1,
                                       3 * l3 * l1 * l1, 6 * l1 * l2 * l3};
    for (std::size_t j = 0; j < 10; ++j) {
      moved.block<3, 1>(static_cast<Eigen::Index>(3 * j), i) = basis[j] / scale * r.direction;
    }
    out.now[i] = r.distance / scale;
  }
  out.follow.noalias() = moved.transpose() * jacobian;
  return out;
}

/// The linearised residuals of a whole state, and steps that lessen the largest of them: the linear programme "least s
/// with |r + A x| <= s", damped, by a primal-dual interior point method with Mehrotra's corrector.
class LinearModel {
public:
  LinearModel(const FitState& state, const Unknowns& unknowns)
      : size_(unknowns.size()), own_weight_(Eigen::VectorXd::Zero(size_)) {
    const double scale = state.error();
    const FitMesh& mesh = state.mesh;
    std::vector<Rows> rows(mesh.triangles.size());
    parallel_for_blocks(rows.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        if (mesh.is_alive(static_cast<Index>(t))) {
          rows[t] = rows_of(state, unknowns, static_cast<Index>(t), scale);
        }
      }
    });
    std::erase_if(rows, [](const Rows& r) { return r.unknowns.empty() || r.now.size() == 0; });
    for (Rows& r : rows) {
      rows_.push_back({std::move(r), {}, {}, {}, {}, {}, {}});
      count_ += static_cast<std::size_t>(rows_.back().rows.now.size());
    }
    // What a step weighs by itself: how far residuals follow it, in the mean, and how far the mesh is bent.
    for (const Block& b : rows_) {
      const Eigen::VectorXd squares = b.rows.follow.colwise().squaredNorm().transpose();
      for (std::size_t a = 0; a < b.rows.unknowns.size(); ++a) {
        own_weight_[b.rows.unknowns[a]] += squares[static_cast<Eigen::Index>(a)] / static_cast<double>(count_);
      }
    }
    std::vector<Index> slots;
    for (Index v = 0; v < mesh.positions.size(); ++v) {
      if (unknowns.of_node(v) == Unknowns::none) {
        continue;
      }
      const double edge = mean_edge(mesh, v);
      own_weight_.segment<3>(unknowns.of_node(v)).array() += 1 / (edge * edge);
      mesh.slots_of(v, slots);
      for (const Index s : slots) {
        own_weight_.segment<2>(unknowns.of_slot(s)).array() += 1;
      }
    }
  }

  struct Step {
    Eigen::VectorXd x;
    double largest = 1;  ///< residual that is foretold, of the one before
  };

  /// @param damping  of what each unknown weighs by itself
  Step step(double damping) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(size_);
    double bound = headroom;
    const double pairs = 2 * static_cast<double>(count_);
    for (Block& b : rows_) {
      b.left = b.rows.now;
      b.dual[0].setConstant(b.left.size(), 1 / pairs);
      b.dual[1] = b.dual[0];
    }
    Step best{x, 1};
    for (int i = 0; i < most_interior_steps; ++i) {
      // Slacks are bound -+ residual: primally feasible always.
      double mu = 0;
      Eigen::VectorXd dual_residual = damping * own_weight_.cwiseProduct(x);
      double sum = 1;
      for (Block& b : rows_) {
        b.slack[0] = bound - b.left.array();
        b.slack[1] = bound + b.left.array();
        mu += (b.slack[0] * b.dual[0] + b.slack[1] * b.dual[1]).sum();
        sum -= b.dual[0].sum() + b.dual[1].sum();
        add_local(b.rows, b.rows.follow.transpose() * (b.dual[0] - b.dual[1]).matrix(), dual_residual);
      }
      mu /= pairs;
      if (mu * pairs < gap * bound && std::abs(sum) < gap) {
        break;
      }
      if (!factorise(damping)) {
        break;
      }
      direction(dual_residual, sum, 0, false);  // Mehrotra's predictor
      const auto [primal, dual] = farthest(1);
      double mu_affine = 0;
      for (const Block& b : rows_) {
        for (std::size_t k = 0; k < 2; ++k) {
          mu_affine += ((b.slack[k] + primal * b.slack_change[k]) * (b.dual[k] + dual * b.dual_change[k])).sum();
        }
      }
      mu_affine /= pairs;
      const auto [change, bound_change] = direction(dual_residual, sum, mu * std::pow(mu_affine / mu, 3), true);
      const auto [far, dual_far] = farthest(to_the_wall);
      if (!change.allFinite() || !std::isfinite(bound_change)) {
        break;
      }
      x += far * change;
      bound += far * bound_change;
      double largest = 0;
      for (Block& b : rows_) {
        b.left += far * b.left_change;
        largest = std::max(largest, b.left.lpNorm<Eigen::Infinity>());
        for (std::size_t k = 0; k < 2; ++k) {
          b.dual[k] += dual_far * b.dual_change[k];
        }
      }
      if (largest < best.largest) {
        best = {x, largest};
      }
    }
    return best;
  }

private:
  struct Block {
    Rows rows;
    Eigen::VectorXd left, left_change;                                     ///< of the residuals, on the way
    std::array<Eigen::ArrayXd, 2> slack, slack_change, dual, dual_change;  ///< of r <= s and -r <= s
  };

  static void add_local(const Rows& rows, const Eigen::VectorXd& local, Eigen::VectorXd& sum) {
    for (std::size_t a = 0; a < rows.unknowns.size(); ++a) {
      sum[rows.unknowns[a]] += local[static_cast<Eigen::Index>(a)];
    }
  }

  /// The matrix of the unknowns with slacks and duals eliminated.
  bool factorise(double damping) {
    std::vector<Eigen::MatrixXd> blocks(rows_.size());
    parallel_for_blocks(rows_.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Block& b = rows_[i];
        const Eigen::VectorXd weight = (b.dual[0] / b.slack[0] + b.dual[1] / b.slack[1]).matrix();
        const Eigen::MatrixXd weighted = weight.asDiagonal() * b.rows.follow;
        blocks[i].noalias() = b.rows.follow.transpose() * weighted;
      }
    });
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const auto& unknowns = rows_[i].rows.unknowns;
      for (std::size_t a = 0; a < unknowns.size(); ++a) {
        for (std::size_t c = 0; c < unknowns.size(); ++c) {
          if (unknowns[c] <= unknowns[a]) {
            entries.emplace_back(unknowns[a], unknowns[c],
                                 blocks[i](static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(c)));
          }
        }
      }
    }
    for (int i = 0; i < size_; ++i) {
      entries.emplace_back(i, i, damping * own_weight_[i]);
    }
    Eigen::SparseMatrix<double> matrix(size_, size_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    if (!analysed_) {
      solver_.analyzePattern(matrix);
      analysed_ = true;
    }
    solver_.factorize(matrix);
    if (solver_.info() != Eigen::Success) {
      return false;
    }
    // How everything follows the bound.
    Eigen::VectorXd lean = Eigen::VectorXd::Zero(size_);
    total_weight_ = 0;
    for (const Block& b : rows_) {
      const Eigen::ArrayXd up = b.dual[0] / b.slack[0], down = b.dual[1] / b.slack[1];
      total_weight_ += (up + down).sum();
      add_local(b.rows, b.rows.follow.transpose() * (up - down).matrix(), lean);
    }
    lean_ = std::move(lean);
    by_bound_ = solver_.solve(lean_);
    return true;
  }

  /// Newton's direction towards slack * dual = mu; with Mehrotra's second-order correction from the direction before.
  /// @return of the unknowns, and of the bound
  std::pair<Eigen::VectorXd, double> direction(const Eigen::VectorXd& dual_residual, double sum, double mu,
                                               bool corrected) {
    // With target_k = what slack * dual is to become less what it is: dual_change = (target - dual slack_change) /
    // slack.
    Eigen::VectorXd side = -dual_residual;
    double bound_side = -sum;
    std::vector<std::array<Eigen::ArrayXd, 2>> targets(rows_.size());
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      Block& b = rows_[i];
      for (std::size_t k = 0; k < 2; ++k) {
        targets[i][k] = mu - b.slack[k] * b.dual[k];
        if (corrected) {
          targets[i][k] -= b.slack_change[k] * b.dual_change[k];
        }
      }
      const Eigen::ArrayXd up = targets[i][0] / b.slack[0], down = targets[i][1] / b.slack[1];
      add_local(b.rows, b.rows.follow.transpose() * (down - up).matrix(), side);
      bound_side += (up + down).sum();
    }
    // M dx - lean ds = side; -lean' dx + total ds = bound_side.
    const Eigen::VectorXd alone = solver_.solve(side);
    const double bound_change = (bound_side + lean_.dot(alone)) / (total_weight_ - lean_.dot(by_bound_));
    Eigen::VectorXd change = alone + bound_change * by_bound_;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      Block& b = rows_[i];
      Eigen::VectorXd local(static_cast<Eigen::Index>(b.rows.unknowns.size()));
      for (std::size_t a = 0; a < b.rows.unknowns.size(); ++a) {
        local[static_cast<Eigen::Index>(a)] = change[b.rows.unknowns[a]];
      }
      b.left_change = b.rows.follow * local;
      b.slack_change[0] = bound_change - b.left_change.array();
      b.slack_change[1] = bound_change + b.left_change.array();
      for (std::size_t k = 0; k < 2; ++k) {
        b.dual_change[k] = (targets[i][k] - b.dual[k] * b.slack_change[k]) / b.slack[k];
      }
    }
    return {std::move(change), bound_change};
  }

  /// How much of the direction keeps slacks, and duals, positive. @param part  of the way to the wall
  [[nodiscard]] std::pair<double, double> farthest(double part) const {
    double primal = 1, dual = 1;
    const auto limit = [&](const Eigen::ArrayXd& at, const Eigen::ArrayXd& change, double& most) {
      for (Eigen::Index i = 0; i < at.size(); ++i) {
        if (change[i] < 0) {
          most = std::min(most, -part * at[i] / change[i]);
        }
      }
    };
    for (const Block& b : rows_) {
      for (std::size_t k = 0; k < 2; ++k) {
        limit(b.slack[k], b.slack_change[k], primal);
        limit(b.dual[k], b.dual_change[k], dual);
      }
    }
    return {primal, dual};
  }

  int size_;
  std::size_t count_ = 0;
  Eigen::VectorXd own_weight_, lean_, by_bound_;
  double total_weight_ = 0;
  std::vector<Block> rows_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
  bool analysed_ = false;
};

/// Moves nodes and turns normals; around facets that would break, nodes move along their normals only, then less, then
/// not at all.
void apply(FitState& state, const Unknowns& unknowns, const Eigen::VectorXd& x) {
  FitMesh& mesh = state.mesh;
  const FitMesh old = mesh;
  const std::size_t nodes = mesh.positions.size();
  std::vector<double> length(nodes, 1);
  std::vector<std::uint8_t> upright(nodes, 0), moves(nodes, 1);
  std::vector<Index> slots;
  NodeStep step;
  for (int mend = 0; mend <= mends; ++mend) {
    for (Index v = 0; v < nodes; ++v) {
      if (unknowns.of_node(v) == Unknowns::none || moves[v] == 0) {
        continue;
      }
      mesh.slots_of(v, slots);
      if (length[v] == 0) {
        take_back(mesh, v, slots, old.positions, old.normals);
        continue;
      }
      step.move = length[v] * x.segment<3>(unknowns.of_node(v));
      step.edge = mean_edge(old, v);
      step.along = upright[v] != 0 ? std::optional(old.normals[slots[0]]) : std::nullopt;
      step.tilts.clear();
      for (const Index s : slots) {
        step.tilts.emplace_back(length[v] * x.segment<2>(unknowns.of_slot(s)));
      }
      take_step(mesh, v, slots, step, old.positions, old.normals, state.limits.kink);
    }
    std::fill(moves.begin(), moves.end(), 0);
    bool broken = false;
    for (Index t = 0; t < mesh.triangles.size(); ++t) {
      if (!mesh.is_alive(t)) {
        continue;
      }
      const auto was = old.corners(t);
      const double agreement = normal_agreement(was, old.corner_normals(t));
      const double angle = smallest_angle_degrees(was[0], was[1], was[2]);
      if (!state.is_sound(t, std::min(state.limits.agreement, agreement), least_angle(state.limits.angle, angle)) ||
          facing_of(mesh.corners(t)).dot(facing_of(was)) < least_facing) {
        broken = true;
        for (const Index v : mesh.triangles[t]) {
          moves[v] = 1;
        }
      }
    }
    if (!broken) {
      return;
    }
    for (std::size_t v = 0; v < nodes; ++v) {
      if (moves[v] != 0) {
        length[v] = upright[v] == 0 ? length[v] : mend + 2 < mends ? shortened * length[v] : 0;
        upright[v] = 1;
      }
    }
  }
  mesh = old;
}

}  // namespace

double lessen_largest(FitState& state, double enough, int steps, std::optional<double> limit) {
  const double nothing = 1e-12 * state.samples().target().diagonal();
  double damping = first_damping;
  for (int i = 0; i < steps && state.error() > std::max(enough, nothing); ++i) {
    check_interrupt();
    const Unknowns unknowns(state.mesh);
    if (unknowns.size() == 0) {
      break;
    }
    LinearModel model(state, unknowns);
    const double before = state.error();
    for (int k = 0; k < damped_tries && !(state.error() < before); ++k) {
      const LinearModel::Step step = model.step(damping);
      if (limit && static_cast<std::size_t>(i) < promising.size() &&
          step.largest * before > promising[static_cast<std::size_t>(i)] * *limit) {
        return before;
      }
      FitState trial = state;
      apply(trial, unknowns, step.x);
      trial.attach_again();
      trial.measure();
      if (trial.error() < before) {
        state = std::move(trial);
        const bool foretold = before - state.error() > as_foretold * (1 - step.largest) * before;
        damping = foretold ? std::max(less_damping * damping, least_damping) : somewhat_more_damping * damping;
      } else {
        damping *= more_damping;
      }
    }
    if (!(state.error() < (1 - little) * before)) {
      break;
    }
  }
  return state.error();
}

}  // namespace tunica
