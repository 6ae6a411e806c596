#pragma once

#include "tunica/mechanics/contact/detail/contact_parts.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tunica {

/// Answers which faces have a box near another box: halves by the median along the longest side.
/// Cost: build n log n; a query the logarithm of n and what it finds.
class BoxTree {
public:
  BoxTree() = default;
  /// @param faces  numbers; boxes  by number, copied
  BoxTree(std::vector<std::size_t> faces, const std::vector<Bounds>& boxes);

  /// Takes the boxes anew, where faces have moved; the halves stay. Cost: linear.
  void refit(const std::vector<Bounds>& boxes);

  /// Adds the faces for whose boxes `is_near` holds, in increasing order. Where it holds for a box it holds for all
  /// that contain it.
  template <typename IsNear>
  void find_if(IsNear&& is_near, std::vector<std::size_t>& found) const {
    const auto before = static_cast<std::ptrdiff_t>(found.size());
    std::vector<std::size_t> open;
    if (!nodes_.empty()) {
      open.push_back(0);
    }
    while (!open.empty()) {
      const std::size_t number = open.back();
      open.pop_back();
      const Node& node = nodes_[number];
      if (!is_near(node.box)) {
        continue;
      }
      if (node.second != 0) {
        open.push_back(node.second);
        open.push_back(number + 1);
        continue;
      }
      for (std::size_t i = node.begin; i < node.end; ++i) {
        if (is_near(boxes_[i])) {
          found.push_back(faces_[i]);
        }
      }
    }
    std::sort(found.begin() + before, found.end());
  }

  /// The same of the faces whose boxes come within `reach` (mm, along each axis) of `box`.
  void find(const Bounds& box, double reach, std::vector<std::size_t>& found) const {
    find_if([&](const Bounds& other) { return box.meets(other, reach); }, found);
  }

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
