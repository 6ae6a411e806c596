#pragma once

#include "tunica/mechanics/elements/rotation.hpp"

#include <random>

namespace tunica {

/// Numbers, vectors and rotations drawn evenly, the same ones in each run.
class Random {
public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double operator()(double most) { return most * uniform_(engine_); }
  Vec3 vector(double most) { return {(*this)(most), (*this)(most), (*this)(most)}; }
  Eigen::Quaterniond rotation(double most) { return exponential(vector(most)); }

private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

}  // namespace tunica
