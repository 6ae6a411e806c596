#include "tunica/mechanics/algebra/algebraic_error.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tunica {

AlgebraicError error_of_iterate(const std::vector<double>& terms, std::size_t iterate) {
  const auto middle = terms.begin() + iterate;
  const double after = std::accumulate(middle, terms.end(), 0.0);
  return {std::sqrt(after), std::sqrt(std::accumulate(terms.begin(), middle, 0.0) + after), false};
}

bool estimate_is_settled(const std::vector<double>& terms, std::size_t iterate) {
  constexpr double part_left = 0.25;
  constexpr double recent = 1e-4;  // of the error's square at the start of what counts as recent
  if (terms.size() < iterate + 2) {
    return false;
  }
  const double sum = std::accumulate(terms.begin() + iterate, terms.end() - 1, 0.0);
  if (!(sum > 0)) {
    return true;  // nothing is left of the error
  }
  // How much larger than its first term what is left of the sum was at most.
  double slowest = 1;
  double tail = sum + terms.back();
  const double end = tail / recent;
  for (std::size_t i = iterate; i-- > 0 && tail < end;) {
    tail += terms[i];
    slowest = std::max(slowest, tail / terms[i]);
  }
  return slowest * terms.back() <= part_left * sum;
}

}  // namespace tunica
