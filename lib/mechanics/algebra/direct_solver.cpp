#include "tunica/mechanics/algebra/direct_solver.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/fresh_memory.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"

#include <cholmod.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <new>

namespace tunica {
namespace {

using Eigen::MatrixXd;
using Panel = Eigen::Map<MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;
using ConstantPanel = Eigen::Map<const MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;

/// Columns or rows of a large front that one thread takes at a time.
constexpr Eigen::Index slice = 96;
/// Into how many subtrees of about equal work the tree is cut at least, for the threads.
constexpr double least_subtrees = 8;

/// Rows of a front's update matrix that stand one after the other in its parent too.
struct Run {
  std::int32_t child = 0;
  std::int32_t parent = 0;
  std::int32_t length = 0;
};

/// Where a block of the matrix and its transpose go: into rows and columns of a front, from there on.
struct Entry {
  std::uint32_t block = 0;  ///< (row_node, column_node)
  std::uint32_t transposed = 0;
  std::int32_t row = 0;
  std::int32_t column = 0;
  Index row_node = 0;
  Index column_node = 0;
};

/// A supernode: `columns` freedoms are eliminated in a dense matrix of `rows` freedoms, the eliminated ones first.
struct Front {
  Eigen::Index columns = 0;
  Eigen::Index rows = 0;
  std::size_t first = 0;  ///< first freedom in the order of elimination
  std::size_t panel = 0;  ///< where its columns of L begin
  std::size_t below = 0;  ///< where the freedoms of its other rows begin
  std::int32_t parent = -1;
  std::size_t first_descendant = 0;
  std::array<std::size_t, 2> entries{};
  std::array<std::size_t, 2> runs{};
  std::size_t arena = 0;
  std::size_t update = 0;   ///< where in its arena the update matrix is made
  std::size_t settled = 0;  ///< and where it is then moved to, over those of its children
  double work = 0;

  [[nodiscard]] Eigen::Index left() const { return rows - columns; }
};

/// Has the system map memory now, not in the first factorisation, whose step then takes longer than the others.
void map_now(double* memory, std::size_t size) {
  prefer_large_pages(memory, size * sizeof(double));
  touch_pages(memory, size * sizeof(double));
}

/// Fronts that are eliminated one after the other, and memory for the update matrices between them.
struct Arena {
  std::vector<std::size_t> fronts;
  std::size_t size = 0;
  std::unique_ptr<double[]> memory;  // NOLINT: not set to zero, unlike a vector
};

/// F = L S L' for a small F, its lower triangle; L overwrites it. @return the number of negative signs, or -1 where a
/// pivot vanishes.
int signed_cholesky(Eigen::Ref<MatrixXd> f, Eigen::Ref<Eigen::VectorXd> signs) {
  int negative = 0;
  for (Eigen::Index k = 0; k < f.rows(); ++k) {
    const double pivot = f(k, k);
    if (!std::isfinite(pivot) || pivot == 0) {
      return -1;
    }
    signs[k] = pivot < 0 ? -1 : 1;
    negative += pivot < 0 ? 1 : 0;
    const double root = std::sqrt(std::abs(pivot));
    f(k, k) = root;
    const Eigen::Index rest = f.rows() - k - 1;
    f.col(k).tail(rest) *= signs[k] / root;
    for (Eigen::Index j = k + 1; j < f.rows(); ++j) {
      f.col(j).tail(f.rows() - j) -= signs[k] * f(j, k) * f.col(k).tail(f.rows() - j);
    }
  }
  return negative;
}

/// Nodes in the order of elimination, and CHOLMOD's supernodes of them.
struct Elimination {
  Elimination(const cholmod_factor& symbolic, const std::vector<Index>& nodes, std::size_t node_count)
      : super(static_cast<const int*>(symbolic.super)),
        row_starts(static_cast<const int*>(symbolic.pi)),
        rows(static_cast<const int*>(symbolic.s)),
        node(nodes.size()),
        first_row(nodes.size() + 1, 0),
        place(node_count, -1),
        front_of(nodes.size()),
        row_in_front(nodes.size(), 0) {
    const auto* const order = static_cast<const int*>(symbolic.Perm);
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      node[k] = nodes[order[k]];
      place[node[k]] = narrow<std::int32_t>(k);
    }
    for (std::size_t s = 0; s < symbolic.nsuper; ++s) {
      std::fill(front_of.begin() + super[s], front_of.begin() + super[s + 1], narrow<std::int32_t>(s));
    }
  }

  [[nodiscard]] std::int32_t size_of(std::size_t k) const { return first_row[k + 1] - first_row[k]; }

  /// The first of a front's rows that it does not eliminate.
  [[nodiscard]] int first_below(std::size_t s) const { return row_starts[s] + super[s + 1] - super[s]; }

  /// Fills row_in_front for the rows of one front. @return how many there are
  std::int32_t number_rows(std::size_t s) {
    std::int32_t row = 0;
    for (int r = row_starts[s]; r < row_starts[s + 1]; ++r) {
      row_in_front[rows[r]] = row;
      row += size_of(narrow<std::size_t>(rows[r]));
    }
    return row;
  }

  const int* super;       ///< first node of each front
  const int* row_starts;  ///< of each front in `rows`
  const int* rows;
  std::vector<Index> node;
  std::vector<std::int32_t> first_row, place, front_of, row_in_front;
};

}  // namespace

struct DirectSolver::Implementation {
  std::vector<Front> fronts;                       ///< children before their parents
  std::vector<std::vector<std::size_t>> children;  ///< per front
  std::vector<Entry> entries;
  std::vector<Run> runs;
  std::vector<std::int32_t> below;           ///< freedoms, in the order of elimination
  std::vector<Eigen::Index> freedoms;        ///< in the order of elimination
  std::vector<std::vector<int>> components;  ///< the free ones of each node
  std::vector<Arena> arenas;                 ///< independent subtrees; the last is what is above them
  std::unique_ptr<double[]> factor;          // NOLINT: as in Arena
  Eigen::VectorXd signs;
  std::vector<int> negative;  ///< per front: negative pivots, or -1
  double factor_work = 0;
  double solve_work = 0;
  std::size_t values = 0;  ///< of the matrix
  FreeMask free;

  Panel panel(const Front& f) { return {factor.get() + f.panel, f.rows, f.columns, Eigen::OuterStride<>(f.rows)}; }
  [[nodiscard]] ConstantPanel panel(const Front& f) const {
    return {factor.get() + f.panel, f.rows, f.columns, Eigen::OuterStride<>(f.rows)};
  }
  Panel update(const Front& f, std::size_t place) {
    return {arenas[f.arena].memory.get() + place, f.left(), f.left(), Eigen::OuterStride<>(f.left())};
  }

  void analyse(const BlockMatrix& pattern, const FreeMask& free);
  void make_fronts(const cholmod_factor& symbolic, const std::vector<Index>& nodes, const BlockMatrix& pattern);
  void make_front(std::size_t s, Elimination& order, const BlockMatrix& pattern);
  void find_runs(std::size_t s, const Elimination& order);
  void make_arenas();
  void add_children(const Front& front, std::size_t index, Panel& columns, Panel& rest);
  int eliminate(std::size_t index, const BlockMatrix& matrix, bool in_slices);
};

void DirectSolver::Implementation::analyse(const BlockMatrix& pattern, const FreeMask& free) {
  values = pattern.values.size();
  components.resize(pattern.node_count());
  std::vector<Index> nodes;
  std::vector<int> number(pattern.node_count(), -1);
  for (std::size_t i = 0; i < pattern.node_count(); ++i) {
    for (std::size_t c = 0; c < 6; ++c) {
      if (free[6 * i + c]) {
        components[i].push_back(narrow<int>(c));
      }
    }
    if (!components[i].empty()) {
      number[i] = narrow<int>(nodes.size());
      nodes.push_back(narrow<Index>(i));
    }
  }
  if (nodes.empty()) {
    return;
  }
  cholmod_common common{};
  cholmod_start(&common);
  common.print = 0;
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 2;
  common.method[0].ordering = CHOLMOD_AMD;
  common.method[1].ordering = CHOLMOD_METIS;
  // CHOLMOD's own limits count columns, of which a node has six.
  common.nrelax[0] = 2;
  common.nrelax[1] = 6;
  common.nrelax[2] = 16;
  std::vector<int> starts{0};
  std::vector<int> rows;
  for (const Index j : nodes) {
    for (std::size_t k = pattern.row_start[j]; k < pattern.row_start[j + 1] && pattern.column[k] <= j; ++k) {
      if (number[pattern.column[k]] >= 0) {
        rows.push_back(number[pattern.column[k]]);
      }
    }
    starts.push_back(narrow<int>(rows.size()));
  }
  cholmod_sparse* graph =
      cholmod_allocate_sparse(nodes.size(), nodes.size(), rows.size(), 1, 1, 1, CHOLMOD_PATTERN, &common);
  cholmod_factor* symbolic = nullptr;
  if (graph != nullptr) {
    std::copy(starts.begin(), starts.end(), static_cast<int*>(graph->p));
    std::copy(rows.begin(), rows.end(), static_cast<int*>(graph->i));
    symbolic = cholmod_analyze(graph, &common);
  }
  const bool done = symbolic != nullptr && symbolic->is_super != 0;
  if (done) {
    make_fronts(*symbolic, nodes, pattern);
  }
  cholmod_free_factor(&symbolic, &common);
  cholmod_free_sparse(&graph, &common);
  cholmod_finish(&common);
  if (!done) {
    throw std::bad_alloc();
  }
  make_arenas();
}

void DirectSolver::Implementation::make_fronts(const cholmod_factor& symbolic, const std::vector<Index>& nodes,
                                               const BlockMatrix& pattern) {
  Elimination order(symbolic, nodes, pattern.node_count());
  for (std::size_t k = 0; k < order.node.size(); ++k) {
    for (const int c : components[order.node[k]]) {
      freedoms.push_back(first_freedom(order.node[k]) + c);
    }
    order.first_row[k + 1] = narrow<std::int32_t>(freedoms.size());
  }
  fronts.resize(symbolic.nsuper);
  children.resize(symbolic.nsuper);
  std::size_t storage = 0;
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    fronts[s].panel = storage;
    make_front(s, order, pattern);
    storage += narrow<std::size_t>(fronts[s].rows * fronts[s].columns);
  }
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    order.number_rows(s);
    for (const std::size_t c : children[s]) {
      find_runs(c, order);
    }
  }
  factor.reset(new double[storage]);
  map_now(factor.get(), storage);
  signs = Eigen::VectorXd::Ones(freedoms.size());
  negative.resize(fronts.size());
}

/// Rows, columns and entries of one front, and its place in the tree.
void DirectSolver::Implementation::make_front(std::size_t s, Elimination& order, const BlockMatrix& pattern) {
  Front& f = fronts[s];
  f.rows = order.number_rows(s);
  f.first = narrow<std::size_t>(order.first_row[order.super[s]]);
  f.columns = order.first_row[order.super[s + 1]] - narrow<std::int32_t>(f.first);
  f.below = below.size();
  const int first_below = order.first_below(s);
  for (int r = first_below; r < order.row_starts[s + 1]; ++r) {
    const std::size_t k = order.rows[r];
    for (std::int32_t d = order.first_row[k]; d < order.first_row[k + 1]; ++d) {
      below.push_back(d);
    }
  }
  if (first_below < order.row_starts[s + 1]) {
    f.parent = order.front_of[order.rows[first_below]];
    children[f.parent].push_back(s);
  }
  f.first_descendant = children[s].empty() ? s : fronts[children[s].front()].first_descendant;
  f.entries[0] = entries.size();
  for (int k = order.super[s]; k < order.super[s + 1]; ++k) {
    const Index j = order.node[k];
    for (std::size_t b = pattern.row_start[j]; b < pattern.row_start[j + 1]; ++b) {
      const std::int32_t other = order.place[pattern.column[b]];
      if (other >= k) {
        entries.push_back({narrow<std::uint32_t>(pattern.transposed[b]), narrow<std::uint32_t>(b),
                           order.row_in_front[other], order.row_in_front[k], pattern.column[b], j});
      }
    }
  }
  f.entries[1] = entries.size();
  const auto n = real(f.columns);
  const auto m = real(f.left());
  f.work = n * n * n / 6 + n * n * m / 2 + n * m * m / 2;
  factor_work += f.work;
  solve_work += 2 * real(f.rows * f.columns);
}

/// Where the rows that a front leaves lie in its parent, whose rows are numbered.
void DirectSolver::Implementation::find_runs(std::size_t s, const Elimination& order) {
  Front& child = fronts[s];
  child.runs[0] = runs.size();
  std::int32_t row = 0;
  for (int r = order.first_below(s); r < order.row_starts[s + 1]; ++r) {
    const std::size_t k = order.rows[r];
    if (runs.size() > child.runs[0] && runs.back().parent + runs.back().length == order.row_in_front[k]) {
      runs.back().length += order.size_of(k);
    } else {
      runs.push_back({row, order.row_in_front[k], order.size_of(k)});
    }
    row += order.size_of(k);
  }
  child.runs[1] = runs.size();
}

/// Subtrees of which none is more than an eighth of the work, and what is above them. The update matrices of an arena
/// form a stack.
void DirectSolver::Implementation::make_arenas() {
  std::vector<double> below_work(fronts.size());
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    below_work[s] += fronts[s].work;
    if (fronts[s].parent >= 0) {
      below_work[fronts[s].parent] += below_work[s];
    }
  }
  std::vector<std::size_t> above;
  std::vector<Arena> subtrees;
  for (std::size_t end = fronts.size(); end > 0;) {
    const std::size_t s = end - 1;
    if (below_work[s] * least_subtrees > factor_work) {
      above.push_back(s);
      --end;
      continue;
    }
    Arena arena;
    for (std::size_t k = fronts[s].first_descendant; k <= s; ++k) {
      arena.fronts.push_back(k);
    }
    subtrees.push_back(std::move(arena));
    end = fronts[s].first_descendant;
  }
  arenas = std::move(subtrees);
  std::reverse(above.begin(), above.end());
  arenas.emplace_back();
  arenas.back().fronts = above;
  for (std::size_t a = 0; a < arenas.size(); ++a) {
    std::size_t top = 0;
    for (const std::size_t s : arenas[a].fronts) {
      Front& f = fronts[s];
      f.arena = a;
      const std::size_t size = f.left() * f.left();
      f.update = top;
      arenas[a].size = std::max(arenas[a].size, top + size);
      // Children in this arena are the last on its stack.
      for (const std::size_t c : children[s]) {
        if (fronts[c].arena == a && fronts[c].left() > 0) {
          top = std::min(top, fronts[c].settled);
        }
      }
      f.settled = top;
      top += size;
    }
    arenas[a].memory.reset(new double[arenas[a].size]);
    map_now(arenas[a].memory.get(), arenas[a].size);
  }
}

void DirectSolver::Implementation::add_children(const Front& front, std::size_t index, Panel& columns, Panel& rest) {
  for (const std::size_t c : children[index]) {
    const Front& child = fronts[c];
    const Panel from = update(child, child.settled);
    for (std::size_t a = child.runs[0]; a < child.runs[1]; ++a) {
      for (std::int32_t k = 0; k < runs[a].length; ++k) {
        const Eigen::Index column = runs[a].parent + k;
        const Eigen::Index source = runs[a].child + k;
        const bool own = column < front.columns;
        double* const target = own ? &columns(0, column) : &rest(0, column - front.columns) - front.columns;
        const double* const values = &from(0, source);
        for (std::int32_t i = k; i < runs[a].length; ++i) {
          target[runs[a].parent + i] += values[runs[a].child + i];
        }
        for (std::size_t b = a + 1; b < child.runs[1]; ++b) {
          const Run& run = runs[b];
          for (std::int32_t i = 0; i < run.length; ++i) {
            target[run.parent + i] += values[run.child + i];
          }
        }
      }
    }
  }
}

int DirectSolver::Implementation::eliminate(std::size_t index, const BlockMatrix& matrix, bool in_slices) {
  const Front& f = fronts[index];
  const Eigen::Index n = f.columns;
  const Eigen::Index m = f.left();
  Panel l = panel(f);
  Panel u = update(f, f.update);
  l.setZero();
  u.setZero();
  for (std::size_t e = f.entries[0]; e < f.entries[1]; ++e) {
    const Entry& entry = entries[e];
    const auto block = matrix.block(entry.block);
    const auto transposed = matrix.block(entry.transposed);
    const std::vector<int>& r = components[entry.row_node];
    const std::vector<int>& c = components[entry.column_node];
    for (std::size_t j = 0; j < c.size(); ++j) {
      for (std::size_t i = 0; i < r.size(); ++i) {
        l(entry.row + i, entry.column + j) = 0.5 * (block(r[i], c[j]) + transposed(c[j], r[i]));
      }
    }
  }
  add_children(f, index, l, u);

  auto own = l.topRows(n);
  auto other = l.bottomRows(m);
  auto sign = signs.segment(f.first, n);
  sign.setOnes();
  int negative_pivots = 0;
  const MatrixXd kept = own;
  Eigen::Ref<MatrixXd, 0, Eigen::OuterStride<>> in_place(own);
  const Eigen::LLT<Eigen::Ref<MatrixXd, 0, Eigen::OuterStride<>>> cholesky(in_place);
  if (cholesky.info() != Eigen::Success || !own.diagonal().allFinite()) {
    MatrixXd again = kept;
    negative_pivots = signed_cholesky(again, sign);
    own = again;
    if (negative_pivots < 0) {
      return negative_pivots;
    }
  }
  const auto in_rows = [&](const auto& work) {
    if (in_slices) {
      parallel_for_blocks(narrow<std::size_t>(m), slice,
                          [&](std::size_t begin, std::size_t end) { work(begin, end - begin); });
    } else if (m > 0) {
      work(0, m);
    }
  };
  in_rows([&](Eigen::Index begin, Eigen::Index size) {
    auto rows = other.middleRows(begin, size);
    own.template triangularView<Eigen::Lower>().transpose().template solveInPlace<Eigen::OnTheRight>(rows);
    if (negative_pivots > 0) {
      rows = rows * sign.asDiagonal();
    }
  });
  if (negative_pivots > 0) {
    const MatrixXd turned = other * sign.asDiagonal();
    in_rows([&](Eigen::Index begin, Eigen::Index size) {
      u.middleCols(begin, size).bottomRows(m - begin).noalias() -=
          turned.bottomRows(m - begin) * other.middleRows(begin, size).transpose();
    });
  } else if (in_slices) {
    in_rows([&](Eigen::Index begin, Eigen::Index size) {
      u.middleCols(begin, size).bottomRows(m - begin).noalias() -=
          other.bottomRows(m - begin) * other.middleRows(begin, size).transpose();
    });
  } else if (m > 0) {
    u.selfadjointView<Eigen::Lower>().rankUpdate(other, -1);
  }
  if (f.settled != f.update) {
    double* const memory = arenas[f.arena].memory.get();
    std::copy_n(memory + f.update, narrow<std::size_t>(m * m), memory + f.settled);
  }
  return negative_pivots;
}

DirectSolver::DirectSolver(const BlockMatrix& pattern, const FreeMask& free)
    : implementation_(std::make_unique<Implementation>()) {
  require_freedoms(free.size(), pattern.node_count());
  TUNICA_ASSERT(pattern.column.size() < UINT32_MAX);  // its values alone would be a terabyte
  try {
    implementation_->free = free;
    implementation_->analyse(pattern, free);
  } catch (const std::bad_alloc&) {
    throw MemoryError("the direct solver needs more memory than there is: use the cg solver or fewer shells");
  }
}

DirectSolver::~DirectSolver() = default;
DirectSolver::DirectSolver(DirectSolver&&) noexcept = default;

DirectSolver::Factored DirectSolver::factor(const BlockMatrix& matrix) {
  Implementation& s = *implementation_;
  if (matrix.values.size() != s.values || matrix.node_count() != s.components.size()) {
    throw InputError("a matrix of another pattern cannot be factored");
  }
  if (s.fronts.empty()) {
    return {};
  }
  BlockMatrix turned;
  if (!s.free.own_axes.empty()) {
    turned = matrix;
    to_own_axes(s.free, turned);
  }
  const BlockMatrix& values = s.free.own_axes.empty() ? matrix : turned;
  std::atomic<bool> regular{true};
  const auto eliminate = [&](const Arena& arena, bool in_slices) {
    for (const std::size_t front : arena.fronts) {
      if (!regular) {
        return;
      }
      check_interrupt();
      s.negative[front] = s.eliminate(front, values, in_slices);
      regular = regular && s.negative[front] >= 0;
    }
  };
  parallel_for_blocks(s.arenas.size() - 1, 1, [&](std::size_t a, std::size_t) { eliminate(s.arenas[a], false); });
  eliminate(s.arenas.back(), true);
  Factored result;
  result.regular = regular;
  for (std::size_t front = 0; regular && front < s.fronts.size(); ++front) {
    result.negative_pivots += narrow<std::size_t>(s.negative[front]);
  }
  return result;
}

void DirectSolver::solve(const VectorX& b, VectorX& x) const {
  const Implementation& s = *implementation_;
  require_freedoms(narrow<std::size_t>(b.size()), s.components.size());
  VectorX right = b;
  to_own_axes(s.free, right);
  Eigen::VectorXd y(s.freedoms.size());
  for (std::size_t k = 0; k < s.freedoms.size(); ++k) {
    y[k] = right[s.freedoms[k]];
  }
  Eigen::VectorXd others;
  for (const Front& f : s.fronts) {
    const ConstantPanel l = s.panel(f);
    auto own = y.segment(f.first, f.columns);
    l.topRows(f.columns).template triangularView<Eigen::Lower>().solveInPlace(own);
    others.noalias() = l.bottomRows(f.left()) * own;
    for (Eigen::Index i = 0; i < f.left(); ++i) {
      y[s.below[f.below + narrow<std::size_t>(i)]] -= others[i];
    }
  }
  y.array() *= s.signs.array();
  for (auto f = s.fronts.rbegin(); f != s.fronts.rend(); ++f) {
    const ConstantPanel l = s.panel(*f);
    others.resize(f->left());
    for (Eigen::Index i = 0; i < f->left(); ++i) {
      others[i] = y[s.below[f->below + narrow<std::size_t>(i)]];
    }
    auto own = y.segment(f->first, f->columns);
    own.noalias() -= l.bottomRows(f->left()).transpose() * others;
    l.topRows(f->columns).template triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  x.setZero(b.size());
  for (std::size_t k = 0; k < s.freedoms.size(); ++k) {
    x[s.freedoms[k]] = y[k];
  }
  to_world_axes(s.free, x);
}

double DirectSolver::factor_work() const { return implementation_->factor_work; }
double DirectSolver::solve_work() const { return implementation_->solve_work; }

}  // namespace tunica
