#include "tunica/mechanics/runs/detail/table_turns.hpp"

#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "tunica/mechanics/runs/doubts.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr double of_a_place = 1e-9;  // of the largest value
constexpr double of_a_load = 0.01;   // of the largest factor: loads bring about no more than themselves
constexpr double of_a_pulse = 0.1;   // of the largest value: what lies within it error control finds

Table<Vec3> table_of(const Ramp& ramp) {
  Table<Vec3> table;
  for (const auto& [time, factor] : ramp.points) {
    table.points.emplace_back(time, Vec3(factor, 0, 0));
  }
  return table;
}

/// The entry within the limits that lies farthest off the line between the table's values at two times, if it lies
/// farther than a tolerance; else the second time.
double farthest_entry(const Table<Vec3>& table, double tolerance, double from, double to, double shortest) {
  const Vec3 begin = table.at(from);
  const Vec3 end = table.at(to);
  const auto first = std::ranges::upper_bound(table.points, from + shortest, {}, &std::pair<double, Vec3>::first);
  double at = to;
  for (auto entry = first; entry != table.points.end() && entry->first < to - shortest; ++entry) {
    const Vec3 on_line = begin + (entry->first - from) / (to - from) * (end - begin);
    if (const double off = (entry->second - on_line).norm(); off > tolerance) {
      tolerance = off;
      at = entry->first;
    }
  }
  return at;
}

}  // namespace

TableTurns::TableTurns(const Model& model, bool touches) {
  for (const RigidBody& body : model.rigids) {
    for (Table<Vec3>& table : tables_of(body)) {
      add(std::move(table), of_a_place);
    }
  }
  for (const Fix& fix : model.fixes) {
    if (prescribes(fix)) {
      add(table_of(fix.ramp), touches ? of_a_place : of_a_pulse);
    }
  }
  for (const Load& load : model.loads) {
    add(table_of(load.ramp), touches ? of_a_load : of_a_pulse);
  }
}

void TableTurns::add(Table<Vec3> table, double tolerance) {
  if (table.points.size() < 2) {
    return;
  }
  double largest = 0;
  for (const auto& [time, value] : table.points) {
    largest = std::max(largest, value.norm());
  }
  lines_.push_back({std::move(table), tolerance * largest});
}

double TableTurns::next(double from, double to, double shortest) const {
  for (const Line& line : lines_) {
    for (double turn = to; (turn = farthest_entry(line.table, line.tolerance, from, to, shortest)) < to;) {
      to = turn;
    }
  }
  return to;
}

}  // namespace tunica
