// mechanics/contact: what touches, and what carries what, through the map from nodes to the curved surface.
#pragma once

#include "tunica/core/types.hpp"

namespace tunica {

/// The pressure of one contact by the gap (contact_system.hpp), p(g) = stiffness (1 - g / d)^2 d / g, and how stiff it
/// has to be. Gaps g and resolutions d are in mm.
class Barrier {
public:
  /// Part of the resolution below which the law goes on as a straight line, also where surfaces overlap on the way.
  static constexpr double straight_below = 0.05;

  /// @param young  MPa, of the softer body; mass  tonne/mm^2, of the heavier wall, 0: not known
  Barrier(double young, double mass, double resolution);

  [[nodiscard]] double pressure(double gap, double resolution) const;  ///< MPa
  /// Minus its derivative (MPa/mm): on the straight part that of the law, else that of p g = const (1 - g / d)^2 at the
  /// pressure that is expected, MPa.
  [[nodiscard]] double slope(double gap, double resolution, double expected) const;

  /// Forces are about to be found anew, by press() for each point.
  void begin();
  /// @param area  mm^2
  void press(double gap, double resolution, double pressure, double area);
  [[nodiscard]] bool overlaps() const { return smallest_part_ <= 0; }
  [[nodiscard]] double potential() const { return potential_; }  ///< mJ, of the last forces

  /// Harder where the last forces overlap. @return whether that changed anything
  bool harden();
  /// Also softer, where it is more than the last pressures ask for. @return whether that changed anything
  bool sharpen();
  /// Where nothing presses yet, or too lightly for the change to bring in energy: as hard as it takes to stop the
  /// heavier wall at this speed, mm/s.
  void brace(double speed);
  /// A state of rest, or the end of a time step. @return mJ that the change of stiffness has brought in since the last
  double accept();
  /// Back to the last accepted state.
  void go_back() { stiffness_ = accepted_.stiffness; }

  /// Of accepted states.
  struct Memory {
    double stiffness = 0;  ///< MPa
    double least = 0;      ///< MPa, of the stiffness while it presses
    double potential = 0;  ///< mJ
    double pressed = 0;    ///< MPa, the largest of all
    double part = 1;       ///< the smallest gap over the resolution, at most 1
  };
  [[nodiscard]] const Memory& accepted() const { return accepted_; }
  void recall(const Memory& memory);

private:
  /// mJ/mm^2: the pressure's integral from this gap on.
  [[nodiscard]] double energy(double gap, double resolution) const;

  double young_;    ///< MPa
  double braking_;  ///< MPa s^2/mm^2: the stiffness that stops the heavier wall, by the square of its speed
  double stiffness_;
  double least_ = 0;
  double smallest_part_ = 1;
  double largest_pressure_ = 0;
  double potential_ = 0;
  Memory accepted_;
};

}  // namespace tunica
