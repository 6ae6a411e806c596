#include "tunica/mechanics/algebra/lanczos.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/require.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <random>

namespace tunica {
namespace {

using MatrixX = Eigen::MatrixXd;

/// A vector shorter than this part of what it was before orthogonalisation is round-off.
constexpr double dependent = 1e-10;
/// Small eigenvalues are resolved to the tolerance times this part of the largest.
constexpr double resolved_range = 1e-3;

class BlockLanczos {
public:
  BlockLanczos(const SymmetricPencil& pencil, const std::vector<bool>& start, const std::vector<VectorX>& deflated,
               const LanczosOptions& options)
      : pencil_(pencil), start_(start), options_(options), size_(start.size()) {
    const Eigen::Index count = options.count;
    const Eigen::Index block = options.block;
    dimension_ = std::count(start.begin(), start.end(), true);
    // A small space is spanned whole, without restarts.
    most_ = std::min(std::max(2 * count + 4 * block, count + 8 * block), dimension_ + 1);
    const Eigen::Index columns = narrow<Eigen::Index>(deflated.size()) + most_ + block;
    basis_.resize(size_, columns);
    image_.resize(size_, columns);
    for (const VectorX& vector : deflated) {
      VectorX x = vector;
      VectorX ax;
      pencil_.multiply_b(x, ax);  // not A x, in which round-off of large terms that cancel may be all there is
      ax /= options.deflated_value;
      (void)append(x, ax, std::sqrt(x.dot(ax)), nullptr);
    }
    locked_ = used_;
    most_ += locked_;
  }

  EigenPairs run() {
    append_random();
    Eigen::Index first = locked_;  // of the block that has not been multiplied yet
    bool complete = false;         // the basis spans all that B reaches
    while (true) {
      check_interrupt();
      const Eigen::Index last = used_;
      const MatrixX coupling = expand(first, last);
      rayleigh_ritz(coupling, first, last);
      first = last;
      if (wanted_converged()) {
        break;
      }
      if (used_ == last) {  // an invariant subspace: go on outside of it
        append_random();
        complete = used_ == last;
      }
      if (complete || solves_ >= options_.most_solves) {
        break;
      }
      if (used_ >= most_) {
        first = restart(last);
      }
    }
    return result(complete);
  }

private:
  [[nodiscard]] Eigen::Index found() const { return values_.size(); }

  /// Makes x (with its image ax) orthonormal to the basis and appends it. `coefficients` gets its parts along the basis
  /// from `locked_` on, and its own length. @return false where nothing is left of it.
  bool append(VectorX& x, VectorX& ax, double before, VectorX* coefficients) {
    if (coefficients != nullptr) {
      coefficients->setZero(used_ + 1);
    }
    if (!(before > 0)) {
      return false;
    }
    for (int pass = 0; pass < 2; ++pass) {
      const VectorX parts = image_.leftCols(used_).transpose() * x;
      x.noalias() -= basis_.leftCols(used_) * parts;
      ax.noalias() -= image_.leftCols(used_) * parts;
      if (coefficients != nullptr) {
        coefficients->head(used_) += parts;
      }
    }
    const double squared = x.dot(ax);
    const double length = std::sqrt(std::max(0.0, squared));
    if (!(length > dependent * before) || used_ == std::min(dimension_, basis_.cols())) {
      return false;
    }
    basis_.col(used_) = x / length;
    image_.col(used_) = ax / length;
    if (coefficients != nullptr) {
      (*coefficients)[used_] = length;
    }
    ++used_;
    return true;
  }

  /// A block of random directions, once multiplied so that they lie where eigenvectors do.
  void append_random() {
    std::normal_distribution<double> normal;
    VectorX x, ax;
    for (std::size_t k = 0; k < options_.block && used_ < most_ + narrow<Eigen::Index>(options_.block); ++k) {
      VectorX random = VectorX::Zero(size_);
      for (Eigen::Index i = 0; i < size_; ++i) {
        random[i] = start_[i] ? normal(engine_) : 0;
      }
      pencil_.solve_a(random, x);
      pencil_.multiply_b(x, ax);
      pencil_.solve_a(ax, x);
      solves_ += 2;
      (void)append(x, ax, std::sqrt(std::max(0.0, x.dot(ax))), nullptr);
    }
  }

  /// Multiplies the columns first ... last of the basis, fills their part of the projected matrix, and appends what
  /// leaves the basis. @return coefficients of that on the new columns: what the residuals are made of.
  MatrixX expand(Eigen::Index first, Eigen::Index last) {
    const Eigen::Index columns = last - locked_;
    MatrixX grown = MatrixX::Zero(columns, columns);
    grown.topLeftCorner(projected_.rows(), projected_.cols()) = projected_;
    projected_ = std::move(grown);
    MatrixX coupling = MatrixX::Zero(options_.block, last - first);
    VectorX product, next, coefficients;
    for (Eigen::Index j = first; j < last; ++j) {
      pencil_.multiply_b(basis_.col(j), product);
      const VectorX parts = basis_.middleCols(locked_, columns).transpose() * product;
      projected_.col(j - locked_) = parts;
      projected_.row(j - locked_) = parts.transpose();
      pencil_.solve_a(product, next);
      ++solves_;
      const double before = std::sqrt(std::max(0.0, next.dot(product)));
      (void)append(next, product, before, &coefficients);
      const Eigen::Index fresh = std::min(coefficients.size(), used_) - last;
      if (fresh > 0) {
        coupling.col(j - first).head(fresh) = coefficients.segment(last, fresh);
      }
    }
    return coupling;
  }

  void rayleigh_ritz(const MatrixX& coupling, Eigen::Index first, Eigen::Index last) {
    const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(projected_);
    values_ = eigen.eigenvalues().reverse();
    coordinates_ = eigen.eigenvectors().rowwise().reverse();
    residuals_ = (coupling * coordinates_.bottomRows(last - first)).colwise().norm();
  }

  [[nodiscard]] double largest_magnitude() const { return values_.cwiseAbs().maxCoeff(); }

  [[nodiscard]] bool wanted_converged() const {
    const Eigen::Index wanted = options_.count;
    if (found() < wanted) {
      return false;
    }
    const double least = resolved_range * largest_magnitude();
    for (Eigen::Index i = 0; i < wanted; ++i) {
      if (!(residuals_[i] <= options_.tolerance * std::max(std::abs(values_[i]), least))) {
        return false;
      }
    }
    return true;
  }

  /// Keeps the best Ritz vectors and what leaves the basis (columns from `last` on). @return the first column of that.
  Eigen::Index restart(Eigen::Index last) {
    const Eigen::Index count = options_.count;
    const Eigen::Index fresh = used_ - last;
    const Eigen::Index room = most_ - locked_;
    const Eigen::Index kept =
        std::min({found(), count + (room - count) / 2, room - narrow<Eigen::Index>(options_.block)});
    const auto turn = [&](MatrixX& columns) {
      const MatrixX ritz = columns.middleCols(locked_, last - locked_) * coordinates_.leftCols(kept);
      const MatrixX rest = columns.middleCols(last, fresh);
      columns.middleCols(locked_, kept) = ritz;
      columns.middleCols(locked_ + kept, fresh) = rest;
    };
    turn(basis_);
    turn(image_);
    projected_ = values_.head(kept).asDiagonal();
    used_ = locked_ + kept + fresh;
    return locked_ + kept;
  }

  EigenPairs result(bool complete) {
    EigenPairs pairs;
    pairs.largest_magnitude = found() > 0 ? largest_magnitude() : 0;
    const Eigen::Index count = std::min(found(), narrow<Eigen::Index>(options_.count));
    pairs.converged = complete || wanted_converged();
    VectorX ax, bx, correction;
    for (Eigen::Index i = 0; i < count; ++i) {
      const VectorX x = basis_.middleCols(locked_, coordinates_.rows()) * coordinates_.col(i);
      // From the vector itself, not from recurrences: |B x - theta A x| in the norm of A^-1.
      pencil_.multiply_a(x, ax);
      pencil_.multiply_b(x, bx);
      const VectorX r = bx - values_[i] * ax;
      pencil_.solve_a(r, correction);
      ++solves_;
      pairs.residuals.push_back(std::sqrt(std::max(0.0, r.dot(correction))) / pairs.largest_magnitude);
      pairs.values.push_back(values_[i]);
      pairs.vectors.push_back(x);
      pairs.converged = pairs.converged && pairs.residuals.back() <= std::max(1e-6, options_.tolerance);
    }
    pairs.solves = solves_;
    return pairs;
  }

  const SymmetricPencil& pencil_;
  const std::vector<bool>& start_;
  const LanczosOptions& options_;
  Eigen::Index size_;
  Eigen::Index dimension_ = 0;
  Eigen::Index most_ = 0;    ///< columns after which the basis is cut back
  Eigen::Index locked_ = 0;  ///< deflated vectors in front of the basis
  Eigen::Index used_ = 0;
  MatrixX basis_;
  MatrixX image_;      ///< A times the basis
  MatrixX projected_;  ///< V'BV, without the deflated vectors
  VectorX values_;
  MatrixX coordinates_;
  VectorX residuals_;
  std::mt19937_64 engine_{20'231};
  std::size_t solves_ = 0;
};

}  // namespace

EigenPairs largest_eigenpairs(const SymmetricPencil& pencil, const std::vector<bool>& start,
                              const std::vector<VectorX>& deflated, const LanczosOptions& options) {
  const auto other_size = [&](const VectorX& x) { return narrow<std::size_t>(x.size()) != start.size(); };
  if (options.count == 0 || options.block == 0 || std::ranges::any_of(deflated, other_size)) {
    throw InputError("eigenpairs: ask for one at least, in blocks of one at least, and give known ones of that size");
  }
  require_positive(options.tolerance, "the tolerance of eigenvalues");
  if (!deflated.empty() && (options.deflated_value == 0 || !std::isfinite(options.deflated_value))) {
    throw InputError("the eigenvalue of the known eigenvectors must be finite, and not zero");
  }
  return BlockLanczos(pencil, start, deflated, options).run();
}

}  // namespace tunica
