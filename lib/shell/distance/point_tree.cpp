// Source: Bentley, "Multidimensional binary search trees used for associative searching", CACM 18(9), 1975.
#include "tunica/shell/distance/point_tree.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

constexpr std::size_t leaf_size = 8;

struct Candidate {
  double squared_distance;
  Index index;
  bool operator<(const Candidate& other) const {
    return squared_distance != other.squared_distance ? squared_distance < other.squared_distance : index < other.index;
  }
};

}  // namespace

struct PointTree::Search {
  Vec3 p;
  std::size_t k;
  const std::function<bool(Index)>& accept;
  double squared_reach;
  std::vector<Candidate> found;  // a heap, worst in front, once it holds k

  [[nodiscard]] double squared_limit() const {
    return found.size() < k ? squared_reach : found.front().squared_distance;
  }

  void offer(const Item& item) {
    const Candidate candidate{(item.point - p).squaredNorm(), item.index};
    if (candidate.squared_distance > squared_limit() || (found.size() == k && !(candidate < found.front())) ||
        (accept && !accept(item.index))) {
      return;
    }
    if (found.size() == k) {
      std::pop_heap(found.begin(), found.end());
      found.pop_back();
    }
    found.push_back(candidate);
    std::push_heap(found.begin(), found.end());
  }
};

PointTree::PointTree(const std::vector<Vec3>& points) : items_(points.size()), axis_(points.size(), 0) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) {
      throw InputError(fmt::format("point {} is not finite", i));
    }
    items_[i] = {points[i], narrow<Index>(i)};
  }
  build(0, items_.size());
}

void PointTree::build(std::size_t begin, std::size_t end) {
  if (end - begin <= leaf_size) {
    return;
  }
  Vec3 lower = items_[begin].point, upper = lower;
  for (std::size_t i = begin; i < end; ++i) {
    lower = lower.cwiseMin(items_[i].point);
    upper = upper.cwiseMax(items_[i].point);
  }
  Eigen::Index axis = 0;
  (upper - lower).maxCoeff(&axis);
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return items_.begin() + i; };
  std::nth_element(at(begin), at(middle), at(end),
                   [axis](const Item& a, const Item& b) { return a.point[axis] < b.point[axis]; });
  axis_[middle] = narrow<std::uint8_t>(axis);
  build(begin, middle);
  build(middle + 1, end);
}

void PointTree::visit(std::size_t begin, std::size_t end, Search& search) const {
  if (end - begin <= leaf_size) {
    for (std::size_t i = begin; i < end; ++i) {
      search.offer(items_[i]);
    }
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const double side = search.p[axis_[middle]] - items_[middle].point[axis_[middle]];
  const auto lower = [&] { visit(begin, middle, search); };
  const auto upper = [&] { visit(middle + 1, end, search); };
  side < 0 ? lower() : upper();
  search.offer(items_[middle]);
  if (side * side <= search.squared_limit()) {
    side < 0 ? upper() : lower();
  }
}

std::vector<Index> PointTree::nearest(const Vec3& p, std::size_t k, const std::function<bool(Index)>& accept,
                                      double reach) const {
  std::vector<Index> indices;
  if (k == 0) {
    return indices;
  }
  Search search{p, k, accept, reach * reach, {}};
  search.found.reserve(k + 1);
  visit(0, items_.size(), search);
  std::sort_heap(search.found.begin(), search.found.end());
  for (const Candidate& candidate : search.found) {
    indices.push_back(candidate.index);
  }
  return indices;
}

}  // namespace tunica
