#pragma once

#include "tunica/core/types.hpp"

#include <functional>

namespace tunica {

/// A k-d tree over points: the k nearest without sorting them all. Queries are thread-safe.
/// Cost: build n log n, 32 bytes per point; query about log n for small k.
class PointTree {
public:
  /// Errors: InputError where a point is not finite.
  explicit PointTree(const std::vector<Vec3>& points);

  /// @param accept  points it refuses do not count; empty: all count
  /// @param reach   only points at most this far away, mm
  /// @return indices of at most k points, nearest first; of two at the same distance the one with the smaller index
  [[nodiscard]] std::vector<Index> nearest(const Vec3& p, std::size_t k, const std::function<bool(Index)>& accept = {},
                                           double reach = infinity) const;

  /// @param reach  mm
  /// @return indices of the points at most this far from the line between two points, ascending. Cost: the cells that
  /// the line runs through
  [[nodiscard]] std::vector<Index> beside(const Vec3& from, const Vec3& to, double reach) const;

private:
  struct Item {
    Vec3 point;
    Index index;
  };
  struct Search;
  struct Line;

  void build(std::size_t begin, std::size_t end);
  void visit(std::size_t begin, std::size_t end, Search& search) const;
  void visit(std::size_t begin, std::size_t end, double first, double last, Line& line) const;

  // A range of items is split at its middle item, along the axis kept there.
  std::vector<Item> items_;
  std::vector<std::uint8_t> axis_;
};

}  // namespace tunica
