#include "mechanics/linear_solver.hpp"

#include "core/error.hpp"
#include "core/progress.hpp"
#include "core/threads.hpp"

#include <cholmod.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>

#include <cmath>

// Only OpenBLAS has the first, and only OpenMP's own library the others; what is not there keeps its own setting.
extern "C" {
void openblas_set_num_threads(int) __attribute__((weak));
void omp_set_max_active_levels(int) __attribute__((weak));
int omp_get_max_active_levels() __attribute__((weak));
}

namespace tunica {

void mask(const FreeMask& free, VectorX& v) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) {
      v[static_cast<Eigen::Index>(i)] = 0;
    }
  }
}

namespace {

/// How many threads CHOLMOD and the BLAS under it take while this lives. CHOLMOD opens parallel regions of four threads
/// whatever the machine has: with a small factor, or when fewer were asked for, they only wait for each other.
class FactorThreads {
public:
  explicit FactorThreads(std::size_t freedoms) {
    constexpr std::size_t worth_sharing = 30'000;
    const std::size_t count = freedoms < worth_sharing ? 1 : thread_count();
    if (openblas_set_num_threads != nullptr) {
      openblas_set_num_threads(static_cast<int>(count));
    }
    if (omp_set_max_active_levels != nullptr && omp_get_max_active_levels != nullptr) {
      levels_ = omp_get_max_active_levels();
      omp_set_max_active_levels(count == 1 ? 0 : *levels_);
    }
  }
  ~FactorThreads() {
    if (levels_) {
      omp_set_max_active_levels(*levels_);
    }
  }
  FactorThreads(const FactorThreads&) = delete;
  FactorThreads& operator=(const FactorThreads&) = delete;

private:
  std::optional<int> levels_;
};

}  // namespace

struct DirectSolver::Implementation {
  cholmod_common common{};
  cholmod_sparse* matrix = nullptr;
  cholmod_factor* cholesky = nullptr;
  cholmod_factor* ldl = nullptr;
  bool use_ldl = false;
  cholmod_dense* right = nullptr;
  cholmod_dense* solution = nullptr;
  cholmod_dense* work_y = nullptr;
  cholmod_dense* work_e = nullptr;
  std::vector<Eigen::Index> freedoms;                ///< of the free ones in order
  std::vector<std::array<std::uint32_t, 2>> source;  ///< per stored entry: two places in BlockMatrix::values

  Implementation() {
    cholmod_start(&common);
    common.print = 0;
    common.quick_return_if_not_posdef = 1;
  }
  ~Implementation() {
    cholmod_free_dense(&right, &common);
    cholmod_free_dense(&solution, &common);
    cholmod_free_dense(&work_y, &common);
    cholmod_free_dense(&work_e, &common);
    cholmod_free_factor(&ldl, &common);
    cholmod_free_factor(&cholesky, &common);
    cholmod_free_sparse(&matrix, &common);
    cholmod_finish(&common);
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  void require_memory() const {
    if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE) {
      throw RequirementError("the direct solver needs more memory than there is: use the cg solver or fewer shells");
    }
  }
};

DirectSolver::DirectSolver(const BlockMatrix& pattern, const FreeMask& free)
    : implementation_(std::make_unique<Implementation>()) {
  Implementation& s = *implementation_;
  TUNICA_ASSERT(pattern.values.size() < UINT32_MAX);
  std::vector<int> number(free.size(), -1);
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (free[i]) {
      number[i] = static_cast<int>(s.freedoms.size());
      s.freedoms.push_back(static_cast<Eigen::Index>(i));
    }
  }
  // The upper triangle by columns: rows of block column j are the columns of block row j, transposed.
  std::vector<int> starts{0};
  std::vector<int> rows;
  for (std::size_t j = 0; j < pattern.node_count(); ++j) {
    for (std::size_t c = 0; c < 6; ++c) {
      const int column = number[6 * j + c];
      if (column < 0) {
        continue;
      }
      for (std::size_t k = pattern.row_start[j]; k < pattern.row_start[j + 1]; ++k) {
        const std::size_t i = pattern.column[k];
        for (std::size_t r = 0; r < 6; ++r) {
          const int row = number[6 * i + r];
          if (row < 0 || row > column) {
            continue;
          }
          rows.push_back(row);
          s.source.push_back({static_cast<std::uint32_t>(36 * pattern.transposed[k] + 6 * c + r),
                              static_cast<std::uint32_t>(36 * k + 6 * r + c)});
        }
      }
      starts.push_back(static_cast<int>(rows.size()));
    }
  }
  const std::size_t n = s.freedoms.size();
  s.matrix = cholmod_allocate_sparse(n, n, rows.size(), 1, 1, 1, CHOLMOD_REAL, &s.common);
  s.right = cholmod_allocate_dense(n, 1, n, CHOLMOD_REAL, &s.common);
  s.require_memory();
  std::copy(starts.begin(), starts.end(), static_cast<int*>(s.matrix->p));
  std::copy(rows.begin(), rows.end(), static_cast<int*>(s.matrix->i));
  s.common.supernodal = CHOLMOD_SUPERNODAL;
  s.cholesky = cholmod_analyze(s.matrix, &s.common);
  s.require_memory();
  TUNICA_ASSERT(s.cholesky != nullptr);
}

DirectSolver::~DirectSolver() = default;
DirectSolver::DirectSolver(DirectSolver&&) noexcept = default;

DirectSolver::Factored DirectSolver::factor(const BlockMatrix& matrix) {
  Implementation& s = *implementation_;
  const FactorThreads threads(s.freedoms.size());
  auto* const values = static_cast<double*>(s.matrix->x);
  const double* const blocks = matrix.values.data();
  parallel_for_blocks(s.source.size(), 65536, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      values[k] = 0.5 * (blocks[s.source[k][0]] + blocks[s.source[k][1]]);
    }
  });
  s.use_ldl = false;
  s.common.supernodal = CHOLMOD_SUPERNODAL;
  s.common.final_ll = 1;
  cholmod_factorize(s.matrix, s.cholesky, &s.common);
  s.require_memory();
  if (s.common.status == CHOLMOD_OK && s.cholesky->minor == s.cholesky->n) {
    return {};
  }
  // Indefinite: LDL' without pivoting counts the negative pivots, and is stable enough where none is tiny.
  s.common.supernodal = CHOLMOD_SIMPLICIAL;
  s.common.final_ll = 0;
  if (s.ldl == nullptr) {
    s.common.nmethods = 1;
    s.common.method[0].ordering = CHOLMOD_GIVEN;
    s.common.postorder = 0;
    s.ldl = cholmod_analyze_p(s.matrix, static_cast<int*>(s.cholesky->Perm), nullptr, 0, &s.common);
    s.require_memory();
  }
  cholmod_factorize(s.matrix, s.ldl, &s.common);
  s.require_memory();
  s.use_ldl = true;
  Factored result;
  result.regular = s.common.status == CHOLMOD_OK && s.ldl->minor == s.ldl->n;
  const auto* const starts = static_cast<const int*>(s.ldl->p);
  const auto* const entries = static_cast<const double*>(s.ldl->x);
  for (std::size_t j = 0; j < s.ldl->minor; ++j) {
    const double pivot = entries[starts[j]];
    result.negative_pivots += pivot < 0 ? 1 : 0;
    result.regular = result.regular && std::isfinite(pivot);
  }
  return result;
}

void DirectSolver::solve(const VectorX& b, VectorX& x) {
  Implementation& s = *implementation_;
  const FactorThreads threads(s.freedoms.size());
  auto* const right = static_cast<double*>(s.right->x);
  for (std::size_t k = 0; k < s.freedoms.size(); ++k) {
    right[k] = b[s.freedoms[k]];
  }
  cholmod_solve2(CHOLMOD_A, s.use_ldl ? s.ldl : s.cholesky, s.right, nullptr, &s.solution, nullptr, &s.work_y,
                 &s.work_e, &s.common);
  s.require_memory();
  const auto* const solution = static_cast<const double*>(s.solution->x);
  x.setZero(b.size());
  for (std::size_t k = 0; k < s.freedoms.size(); ++k) {
    x[s.freedoms[k]] = solution[k];
  }
}

CgResult conjugate_gradients(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b,
                             const CgOptions& options, VectorX& x) {
  const std::size_t nodes = matrix.node_count();
  // Held rows and columns are left out of the diagonal blocks; a unit keeps them regular.
  std::vector<Matrix6, Eigen::aligned_allocator<Matrix6>> inverse(nodes);
  std::vector<char> positive(nodes, 1);
  parallel_for_blocks(nodes, 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Matrix6 block = matrix.block(matrix.find(static_cast<Index>(i), static_cast<Index>(i)));
      for (int c = 0; c < 6; ++c) {
        if (!free[6 * i + static_cast<std::size_t>(c)]) {
          block.row(c).setZero();
          block.col(c).setZero();
          block(c, c) = 1;
        }
      }
      const Eigen::LLT<Matrix6> factor(block);
      positive[i] = factor.info() == Eigen::Success ? 1 : 0;
      inverse[i] = positive[i] != 0 ? Matrix6(factor.solve(Matrix6::Identity())) : Matrix6::Identity();
    }
  });
  CgResult result;
  result.negative_curvature = std::find(positive.begin(), positive.end(), 0) != positive.end();

  VectorX r = b;
  mask(free, r);
  x.setZero(b.size());
  const double norm = std::sqrt(dot(r, r));
  if (norm == 0) {
    result.converged = true;
    return result;
  }
  const auto precondition = [&](const VectorX& v, VectorX& z) {
    z.resize(v.size());
    for (std::size_t i = 0; i < nodes; ++i) {
      z.segment<6>(6 * static_cast<Eigen::Index>(i)).noalias() =
          inverse[i] * v.segment<6>(6 * static_cast<Eigen::Index>(i));
    }
  };
  VectorX z, p, q;
  precondition(r, z);
  p = z;
  double rho = dot(r, z);
  const std::size_t most = options.most.value_or(20 * free.size());
  result.residual = 1;
  while (result.iterations < most) {
    if (result.iterations % 64 == 0) {
      check_interrupt();
    }
    multiply(matrix, p, q);
    mask(free, q);
    const double curvature = dot(p, q);
    if (!(curvature > 0)) {
      result.negative_curvature = result.negative_curvature || curvature < 0;
      if (result.iterations == 0) {
        x = p;  // a direction of descent is better than none
      }
      break;
    }
    const double step = rho / curvature;
    x += step * p;
    r -= step * q;
    ++result.iterations;
    result.residual = std::sqrt(dot(r, r)) / norm;
    if (result.residual <= (options.fixed_count ? 1e-15 : options.tolerance)) {
      break;
    }
    precondition(r, z);
    const double next = dot(r, z);
    p = z + next / rho * p;
    rho = next;
  }
  result.converged = !options.fixed_count && result.residual <= options.tolerance;
  return result;
}

double gmres(const BlockMatrix& matrix, const FreeMask& free, DirectSolver& solver, const VectorX& b, double tolerance,
             std::size_t most, VectorX& x) {
  const double norm = std::sqrt(dot(b, b));
  VectorX product;
  const auto residual = [&] {
    multiply(matrix, x, product);
    mask(free, product);
    return VectorX(b - product);
  };
  VectorX r = residual();
  double beta = std::sqrt(dot(r, r));
  if (norm == 0 || beta <= tolerance * norm) {
    return norm == 0 ? 0 : beta / norm;
  }
  // Right preconditioning: the residual that is made small is the true one.
  std::vector<VectorX> basis{r / beta};
  std::vector<VectorX> directions;
  Eigen::MatrixXd hessenberg =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(most) + 1, static_cast<Eigen::Index>(most));
  Eigen::VectorXd coefficients;
  for (std::size_t j = 0; j < most; ++j) {
    VectorX direction;
    solver.solve(basis[j], direction);
    multiply(matrix, direction, product);
    mask(free, product);
    directions.push_back(direction);
    const auto column = static_cast<Eigen::Index>(j);
    for (std::size_t i = 0; i <= j; ++i) {
      const double h = dot(basis[i], product);
      hessenberg(static_cast<Eigen::Index>(i), column) = h;
      product -= h * basis[i];
    }
    const double length = std::sqrt(dot(product, product));
    hessenberg(column + 1, column) = length;
    const auto reduced = hessenberg.topLeftCorner(column + 2, column + 1);
    const Eigen::VectorXd right = beta * Eigen::VectorXd::Unit(column + 2, 0);
    coefficients = reduced.colPivHouseholderQr().solve(right);
    if ((reduced * coefficients - right).norm() <= tolerance * norm || length <= 1e-14 * beta) {
      break;
    }
    basis.push_back(product / length);
  }
  for (Eigen::Index j = 0; j < coefficients.size(); ++j) {
    x += coefficients[j] * directions[static_cast<std::size_t>(j)];
  }
  r = residual();
  return std::sqrt(dot(r, r)) / norm;
}

}  // namespace tunica
