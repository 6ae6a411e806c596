#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <vector>

namespace tunica {

/// Where what a scene says over time (dynamic) or load factor (static) leaves a straight line: the tables of rigid
/// bodies, and the ramps of prescribed displacements and loads. A step that passes such a place sees only its ends, so
/// a body that goes there and back would not have touched anything: runs end a part of the step there. Motions do so
/// where bodies touch, and under error control: else uneven parts would make a second-order scheme ring.
class TableTurns {
public:
  /// @param touches  bodies do; else error control looks, which finds what is within a tenth of the largest value
  explicit TableTurns(const Model& model, bool touches = true);

  /// The end of the first part of a step in which every table is straight: its ramps of loads to a hundredth of their
  /// largest factor, what moves to round-off. Entries nearer than `shortest` to the ends of the part count as the ends.
  /// Cost: linear in the entries that lie in the step.
  [[nodiscard]] double next(double from, double to, double shortest) const;

private:
  struct Line {
    Table<Vec3> table;
    double tolerance = 0;  ///< in the table's units
  };
  void add(Table<Vec3> table, double tolerance);

  std::vector<Line> lines_;
};

}  // namespace tunica
