#pragma once

#include "tunica/mechanics/contact/detail/contact_parts.hpp"

#include <vector>

namespace tunica {

/// Answers which faces have a box near another box: halves by the median along the longest side.
/// Cost: build n log n; a query the logarithm of n and what it finds.
class BoxTree {
public:
  BoxTree() = default;
  /// @param faces  numbers; boxes  by number, copied
  BoxTree(std::vector<std::size_t> faces, const std::vector<Bounds>& boxes);

  /// Adds the faces whose boxes come within `reach` (mm, along each axis) of `box`, in increasing order.
  void find(const Bounds& box, double reach, std::vector<std::size_t>& found) const;

private:
  struct Node {
    Bounds box;
    std::size_t begin = 0, end = 0;  ///< of the faces
    std::size_t second = 0;          ///< child; the first is the next node; 0: a leaf
  };
  void build(std::size_t begin, std::size_t end);

  std::vector<std::size_t> faces_;
  std::vector<Bounds> boxes_;  ///< of the faces, in their order
  std::vector<Node> nodes_;
};

}  // namespace tunica
