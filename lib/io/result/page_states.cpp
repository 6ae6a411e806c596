#include "tunica/io/result/detail/page_states.hpp"

#include "tunica/core/narrow.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr std::size_t bytes_of_point = 8;

// Pieces per edge of a shell in a page, each a divisor of the one before: a cohort's page leaves points away.
int page_pieces(std::size_t shells) {
  int pieces = 4;
  while (pieces > 1 && shells * narrow<std::size_t>(pieces * pieces) > most_page_triangles) {
    pieces /= 2;
  }
  return pieces;
}

std::optional<ResultGrid> own_grid(const Model& model, const ResultGrid& result) {
  const int pieces = page_pieces(result.elements());
  return pieces == result.level() ? std::nullopt : std::make_optional<ResultGrid>(model, pieces);
}

Vec3 vector_at(const Floats& values, std::size_t point) {
  return {values[3 * point], values[3 * point + 1], values[3 * point + 2]};
}

}  // namespace

PageStates::PageStates(const Model& model, const ResultGrid& result)
    : own_(own_grid(model, result)), grid_(own_ ? *own_ : result) {
  TriangleMesh& shells = drawn_.reference = grid_.surface();
  TriangleMesh& solids = drawn_.solids;
  const auto first = shells.triangles.begin() + narrow<std::ptrdiff_t>(grid_.triangles());
  solids.triangles.assign(first, shells.triangles.end());
  shells.triangles.erase(first, shells.triangles.end());
  std::vector<Index> number(shells.vertices.size(), narrow<Index>(max_index));
  for (auto& triangle : solids.triangles) {
    for (Index& v : triangle) {
      if (number[v] == max_index) {
        number[v] = narrow<Index>(solid_points_.size());
        solid_points_.push_back(v);
        solids.vertices.push_back(shells.vertices[v]);
      }
      v = number[v];
    }
  }
  shells.vertices.resize(grid_.shell_points());
  drawn_.shells = grid_.elements();
  drawn_.pieces = narrow<std::size_t>(grid_.level());
  const std::size_t of_state = bytes_of_point * (shells.vertices.size() + solids.vertices.size());
  most_ = std::clamp<std::size_t>(most_page_bytes / std::max<std::size_t>(of_state, 1), 2, most_page_states);
}

void PageStates::append(const State& state, const ElementFields& fields, const std::vector<Floats>& values) {
  const std::vector<Floats> own = own_ ? own_->values(state, fields) : std::vector<Floats>();
  const std::vector<Floats>& of_points = own_ ? own : values;  // displacement, rotation, membrane, faces
  const std::size_t points = grid_.shell_points();
  std::vector<DrawnResult::State>& states = drawn_.states;
  if (!states.empty() && states.back().number % stride_ != 0) {
    states.pop_back();  // it is the last one no more
  }
  if (states.size() == 2 * most_) {
    stride_ *= 2;
    std::erase_if(states, [&](const DrawnResult::State& kept) { return kept.number % stride_ != 0; });
  }
  DrawnResult::State& now = states.emplace_back();
  now.number = count_++;
  now.time = state.time;
  now.load_factor = state.load_factor;
  for (std::size_t p = 0; p < points; ++p) {
    now.displacement.push_back(vector_at(of_points[0], p));
  }
  for (const auto& [list, from] : {std::pair(&now.membrane, &of_points[2]), {&now.von_mises, &of_points[3]}}) {
    list->assign(from->begin(), from->begin() + narrow<std::ptrdiff_t>(points));
  }
  for (const Index point : solid_points_) {
    now.of_solids.push_back(vector_at(of_points[0], point));
  }
}

DrawnResult PageStates::drawn() const {
  DrawnResult drawn = drawn_;
  drawn.states = evenly_chosen(std::move(drawn.states), most_);
  return drawn;
}

}  // namespace tunica
