#include "tunica/mechanics/model/model.hpp"

#include "tunica/core/error.hpp"

#include <algorithm>

namespace tunica {

double Ramp::at(double time) const {
  if (points.empty()) {
    return 1;
  }
  const auto next = std::upper_bound(points.begin(), points.end(), time,
                                     [](double t, const std::pair<double, double>& point) { return t < point.first; });
  if (next == points.begin()) {
    return points.front().second;
  }
  if (next == points.end()) {
    return points.back().second;
  }
  const auto previous = std::prev(next);
  const double fraction = (time - previous->first) / (next->first - previous->first);
  return previous->second + fraction * (next->second - previous->second);
}

std::size_t Model::node_count() const { return first_node(shells.size()); }

std::size_t Model::first_node(std::size_t body) const {
  TUNICA_ASSERT(body <= shells.size());
  std::size_t count = 0;
  for (std::size_t b = 0; b < body; ++b) {
    count += shells[b].mesh.vertices.size();
  }
  return count;
}

}  // namespace tunica
