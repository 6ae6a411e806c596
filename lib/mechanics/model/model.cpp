#include "tunica/mechanics/model/model.hpp"

#include "tunica/core/error.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

void require_body(const Model& model, std::size_t body) {
  if (body >= model.body_count()) {
    throw InputError(fmt::format("there is no body {}: the model has {}", body, model.body_count()));
  }
}

}  // namespace

template <typename Value>
Value Table<Value>::at(double time) const {
  if (points.empty()) {
    throw InputError("a table without points has no value");
  }
  const auto next = std::upper_bound(points.begin(), points.end(), time,
                                     [](double t, const std::pair<double, Value>& point) { return t < point.first; });
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

template struct Table<double>;
template struct Table<Vec3>;

double Ramp::at(double time) const { return points.empty() ? 1 : Table<double>{points}.at(time); }

bool Model::is_imaged_under_pressure() const {
  return std::any_of(loads.begin(), loads.end(), [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure != nullptr && pressure->imaged_at.value_or(0) != 0;
  });
}

const std::string& Model::name_of(std::size_t body) const {
  require_body(*this, body);
  return is_solid(body) ? solids[body - shells.size()].name : shells[body].name;
}

const std::vector<Vec3>& Model::vertices_of(std::size_t body) const {
  require_body(*this, body);
  return is_solid(body) ? solids[body - shells.size()].mesh.vertices : shells[body].mesh.vertices;
}

std::size_t Model::node_count() const { return first_node(body_count()); }

std::size_t Model::first_node(std::size_t body) const {
  std::size_t count = 0;
  for (std::size_t b = 0; b < body; ++b) {
    count += vertices_of(b).size();
  }
  return count;
}

}  // namespace tunica
