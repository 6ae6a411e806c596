#include "tunica/mechanics/runs/detail/time_scheme.hpp"

#include <cmath>

namespace tunica {

TimeScheme::TimeScheme(const DynamicRun& run) : euler_(run.integrator == Integrator::backward_euler) {
  if (!euler_) {
    const double rho = run.spectral_radius;
    alpha_m_ = (2 * rho - 1) / (rho + 1);
    alpha_f_ = rho / (rho + 1);
    gamma_ = 0.5 + alpha_f_ - alpha_m_;
    beta_ = (gamma_ + 0.5) * (gamma_ + 0.5) / 4;
  }
}

double TimeScheme::velocity_factor(double length) const { return euler_ ? 1 / length : gamma_ / (beta_ * length); }

double TimeScheme::acceleration_factor(double length) const {
  return euler_ ? 1 / (length * length) : (1 - alpha_m_) / ((1 - alpha_f_) * beta_ * length * length);
}

void TimeScheme::end_rates(double length, const std::vector<bool>& held, const Rates& start, const VectorX& change,
                           Rates& end) const {
  if (euler_) {
    end.velocity = change / length;
    end.acceleration = (end.velocity - start.velocity) / length;
    end.auxiliary = end.acceleration;
    return;
  }
  const double h = length;
  end.auxiliary = (change - h * start.velocity) / (beta_ * h * h) - (0.5 - beta_) / beta_ * start.auxiliary;
  end.acceleration =
      ((1 - alpha_m_) * end.auxiliary + alpha_m_ * start.auxiliary - alpha_f_ * start.acceleration) / (1 - alpha_f_);
  end.velocity = start.velocity + h * ((1 - gamma_) * start.auxiliary + gamma_ * end.auxiliary);
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (held[i]) {
      const Eigen::Index k = i;
      end.velocity[k] = change[k] / h;
      end.acceleration[k] = end.auxiliary[k] = (end.velocity[k] - start.velocity[k]) / h;
    }
  }
}

VectorX TimeScheme::local_error(double length, const Rates& start, const Rates& end) const {
  if (euler_) {
    return length / 2 * (end.velocity - start.velocity);
  }
  return std::abs(beta_ - 1.0 / 6) * length * length * (end.auxiliary - start.auxiliary);
}

}  // namespace tunica
