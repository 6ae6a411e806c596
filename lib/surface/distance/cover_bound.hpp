#pragma once

#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"

namespace tunica {

/// Bounds the distance from every point of a triangle s to a surface B at once, however many triangles of B lie under
/// s. Starting at one triangle of B, it floods over every edge that crosses s in the projection along s's normal. If no
/// border of B crosses s and all visited triangles face the same way, their projection covers s: each is on the right
/// side of its edges, so the covered part of s is open as well as closed. The largest height of B over s then bounds
/// the distance; it is at a corner of a visited triangle clipped to s.
class CoverBound {
public:
  /// Keeps a reference to `surface`. Cost: linear, about 0.1 s for a million triangles.
  explicit CoverBound(const ClosestPoint& surface);
  CoverBound(const ClosestPoint& surface, const Incidence& around);

  /// By edge of each triangle (corner k to k + 1): the one other triangle there, if it runs through it the other way.
  [[nodiscard]] const std::vector<std::array<Index, 3>>& across() const { return across_; }

  /// The visited triangles of one flood; one per thread, reused.
  class Visited {
  public:
    Visited();
    void clear();
    /// @return whether the triangle is new and there is room for it
    bool insert(Index triangle);
    [[nodiscard]] bool full() const { return list_.size() >= limit; }
    [[nodiscard]] const std::vector<Index>& list() const { return list_; }
    static constexpr std::size_t limit = 512;

  private:
    static constexpr std::size_t slots = 4 * limit;
    std::vector<Index> table_;
    std::vector<Index> list_;
  };

  /// @param corners  of s
  /// @param start    a triangle of B that lies under s, if any does (the closest to a corner of s)
  /// @param give_up  mm: a bound above this is of no use
  /// @return mm: no point of s is farther from B; infinity when nothing below give_up could be shown
  [[nodiscard]] double operator()(const std::array<Vec3, 3>& corners, Index start, double give_up,
                                  Visited& visited) const;

private:
  const ClosestPoint& surface_;
  std::vector<std::array<Index, 3>> across_;
};

}  // namespace tunica
