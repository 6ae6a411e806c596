// Source: Bentley, "Multidimensional binary search trees used for associative searching", CACM 18(9), 1975.
#include "tunica/surface/mesh/point_tree.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

constexpr std::size_t most_in_leaf = 8;

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

struct PointTree::Line {
  Vec3 from, way;
  double reach;
  std::vector<Index> found;

  void offer(const Item& item) {
    const Vec3 there = item.point - from;
    const double squared_length = way.squaredNorm();
    const double at = squared_length > 0 ? std::clamp(there.dot(way) / squared_length, 0.0, 1.0) : 0;
    if ((there - at * way).squaredNorm() <= reach * reach) {
      found.push_back(item.index);
    }
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
  if (end - begin <= most_in_leaf) {
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
  if (end - begin <= most_in_leaf) {
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

/// @param first, last  the part of the line, as fractions of it, that may reach these items
void PointTree::visit(std::size_t begin, std::size_t end, double first, double last, Line& line) const {
  if (first > last) {
    return;
  }
  if (end - begin <= most_in_leaf) {
    for (std::size_t i = begin; i < end; ++i) {
      line.offer(items_[i]);
    }
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const Eigen::Index axis = axis_[middle];
  const double split = items_[middle].point[axis];
  const double from = line.from[axis], way = line.way[axis];
  line.offer(items_[middle]);
  // Where from + t way <= split + reach, and where it is >= split - reach.
  double lower_first = first, lower_last = last, upper_first = first, upper_last = last;
  const double to_lower = (split + line.reach - from) / way, to_upper = (split - line.reach - from) / way;
  if (way > 0) {
    lower_last = std::min(last, to_lower);
    upper_first = std::max(first, to_upper);
  } else if (way < 0) {
    lower_first = std::max(first, to_lower);
    upper_last = std::min(last, to_upper);
  } else {
    lower_last = from <= split + line.reach ? last : -infinity;
    upper_last = from >= split - line.reach ? last : -infinity;
  }
  visit(begin, middle, lower_first, lower_last, line);
  visit(middle + 1, end, upper_first, upper_last, line);
}

std::vector<Index> PointTree::beside(const Vec3& from, const Vec3& to, double reach) const {
  Line line{from, to - from, reach, {}};
  visit(0, items_.size(), 0, 1, line);
  std::sort(line.found.begin(), line.found.end());
  return line.found;
}

}  // namespace tunica
