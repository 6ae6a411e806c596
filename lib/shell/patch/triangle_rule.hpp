#pragma once

#include "tunica/core/types.hpp"

#include <array>

namespace tunica {

/// A point of a rule over a triangle: weights of its corners, and its part of the area.
struct RulePoint {
  Vec3 corners;
  double weight;
};

/// 6 points, exact to degree 4. Source: Dunavant, Int. J. Numer. Meth. Eng. 21 (1985).
inline std::array<RulePoint, 6> triangle_rule() {
  constexpr double a = 0.445948490915965;
  constexpr double b = 0.091576213509771;
  constexpr double of_a = 0.223381589678011;
  constexpr double of_b = 0.109951743655322;
  return {{{{a, a, 1 - 2 * a}, of_a},
           {{a, 1 - 2 * a, a}, of_a},
           {{1 - 2 * a, a, a}, of_a},
           {{b, b, 1 - 2 * b}, of_b},
           {{b, 1 - 2 * b, b}, of_b},
           {{1 - 2 * b, b, b}, of_b}}};
}

}  // namespace tunica
