#include "tunica/mechanics/contact/barrier.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double first_stiffness = 1e-5;  // of Young's modulus, while no pressure is known
constexpr double least_stiffness = 1e-8;  // of Young's modulus: where a contact opens
/// Stiffness over the largest pressure that takes just that part of the resolution below which the law is straight.
constexpr double stiffness_of_pressure =
    Barrier::straight_below / ((1 - Barrier::straight_below) * (1 - Barrier::straight_below));
constexpr double blunt = 2;               // of what is wanted: above, the barrier is made softer
constexpr double largest_hardening = 10;  // at a time: pressures of iterates may be far too large
constexpr double barely_pressed = 0.6;    // of the resolution: a gap there holds a hundredth of what stops a wall

/// The integral of (1 - s)^2 / s from a part of the resolution to 1.
double energy_from(double s) { return -std::log(s) - 1.5 + 2 * s - s * s / 2; }

/// The gap where the law is looked at, as a part of the resolution, and what the straight line goes on by.
struct Squeeze {
  double at, below;

  Squeeze(double gap, double resolution)
      : at(std::max(gap / resolution, Barrier::straight_below)), below(at - gap / resolution) {}
  [[nodiscard]] double law() const { return (1 - at) * (1 - at) / at; }
  [[nodiscard]] double straight() const { return 1 / (at * at) - 1; }  ///< minus the derivative of the law
};

}  // namespace

Barrier::Barrier(double young, double mass, double resolution)
    : young_(young),
      braking_(mass / (2 * energy_from(straight_below) * resolution)),
      stiffness_(first_stiffness * young),
      accepted_{stiffness_} {}

double Barrier::pressure(double gap, double resolution) const {
  const Squeeze part(gap, resolution);
  return stiffness_ * (1 - part.at) * (1 - part.at) / part.at + part.below * (stiffness_ * part.straight());
}

double Barrier::slope(double gap, double resolution, double expected) const {
  const Squeeze part(gap, resolution);
  return part.below > 0 ? stiffness_ * part.straight() / resolution : (expected + 2 * stiffness_ * (1 - part.at)) / gap;
}

double Barrier::energy(double gap, double resolution) const {
  const Squeeze part(gap, resolution);
  return stiffness_ * resolution *
         (energy_from(part.at) + part.below * (part.law() + part.below / 2 * part.straight()));
}

void Barrier::begin() {
  smallest_part_ = 1;
  largest_pressure_ = potential_ = 0;
}

void Barrier::press(double gap, double resolution, double pressure, double area) {
  smallest_part_ = std::min(smallest_part_, gap / resolution);
  largest_pressure_ = std::max(largest_pressure_, pressure);
  potential_ += area * energy(gap, resolution);
}

bool Barrier::harden() {
  if (!overlaps()) {
    return false;
  }
  stiffness_ = std::min(stiffness_of_pressure * largest_pressure_, largest_hardening * stiffness_);
  return true;
}

bool Barrier::sharpen() {
  const bool hardened = harden();
  const double wanted = std::max({stiffness_of_pressure * largest_pressure_, least_stiffness * young_, least_});
  if (!(largest_pressure_ > 0 && stiffness_ > blunt * wanted)) {
    return hardened;
  }
  stiffness_ = wanted;
  return true;
}

void Barrier::brace(double speed) {
  if (accepted_.part > barely_pressed) {
    least_ = std::max(accepted_.potential > 0 ? least_ : 0, braking_ * speed * speed);
    stiffness_ = std::max(stiffness_, least_);
  }
}

double Barrier::accept() {
  const double brought = accepted_.potential * (stiffness_ / accepted_.stiffness - 1);
  accepted_ = {stiffness_, least_, potential_, std::max(accepted_.pressed, largest_pressure_), smallest_part_};
  return brought;
}

void Barrier::recall(const Memory& memory) {
  accepted_ = memory;
  stiffness_ = memory.stiffness;
  least_ = memory.least;
}

}  // namespace tunica
