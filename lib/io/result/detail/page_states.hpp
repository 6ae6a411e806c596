#pragma once

#include "tunica/io/result/page_file.hpp"
#include "tunica/mechanics/runs/result_grid.hpp"

#include <optional>

namespace tunica {

/// Gathers what a page shows of a run, state by state, of which it keeps twice as many as a page has at the most.
/// Inside lib/io: the result file writes it.
class PageStates {
public:
  /// Cuts the shells as a page does. @param result  the grid of the result, which serves where it is cut alike; both
  /// must outlive this
  PageStates(const Model& model, const ResultGrid& result);

  /// @param values  of the result's grid
  void append(const State& state, const ElementFields& fields, const std::vector<Floats>& values);

  /// Geometry and states; kind, scene and whether it is unloaded are not known here.
  [[nodiscard]] DrawnResult drawn() const;

private:
  std::optional<ResultGrid> own_;
  const ResultGrid& grid_;
  DrawnResult drawn_;
  std::vector<Index> solid_points_;  ///< #V of the solids: points of the grid
  std::size_t most_ = 0;             ///< states of a page
  std::size_t count_ = 0;            ///< of states so far
  std::size_t stride_ = 1;           ///< of those that are kept, besides the last one
};

}  // namespace tunica
