#pragma once

#include "tunica/core/types.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace tunica {

/// Elements 0 to size - 1 in sets that grow together. Source: union-find with path halving (Tarjan, van Leeuwen 1984);
/// the smallest element stands for its set, whatever the order of the joins. Cost: log n per call, less in the mean.
template <typename Element = Index>
class DisjointSets {
public:
  explicit DisjointSets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), Element{0}); }

  /// The smallest element of its set.
  Element root(Element i) {
    while (parent_[i] != i) {
      i = parent_[i] = parent_[parent_[i]];
    }
    return i;
  }

  /// @return whether the two were apart before
  bool join(Element i, Element j) {
    i = root(i);
    j = root(j);
    parent_[std::max(i, j)] = std::min(i, j);
    return i != j;
  }

private:
  std::vector<Element> parent_;
};

}  // namespace tunica
