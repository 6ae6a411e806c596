#include "shell/fit_polish.hpp"

#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_worst.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr int patience = 3;         // steps that bring nothing
constexpr double worth_it = 0.985;  // of the error: what is left by a step that brings something
constexpr int most_repairs = 12;

}  // namespace

void smooth(FitState& state, double limit, double creased) {
  state.attach();
  state.measure();
  for (int i = 0; i < 3; ++i) {
    flip_edges(state, limit);
    state.solve(2, 3);
    place_worst(state, std::max(limit, 0.3 * state.error()));
    if (i > 0) {
      detach_worst(state, creased);
    }
    state.attach_again();
    state.measure();
  }
}

void polish(FitState& state, double limit, int steps) {
  for (int i = 0; i < steps; ++i) {
    if (i > 0) {
      state.attach_again();
      state.measure();
    }
    flip_edges(state, limit);
    state.solve(i == 0 && steps > 1 ? 4 : 8, 1);
  }
  place_worst(state, 0.9 * limit);
  detach_worst(state, limit);
  state.attach_again();
  state.measure();
}

void settle(FitState& state, int most) {
  state.attach();
  state.measure();
  int fruitless = 0;
  FitState best = state;
  for (int i = 0; i < most && fruitless < patience; ++i) {
    polish(state, 0.95 * state.error(), 1);
    fruitless = state.error() < 0.98 * best.error() ? 0 : fruitless + 1;
    if (state.error() < best.error()) {
      best = state;
    }
  }
  state = std::move(best);
}

void repair(FitState& state, double limit, std::size_t most) {
  double best = state.error();
  int fruitless = 0;
  for (int i = 0; i < most_repairs && fruitless < patience && state.error() > limit && state.mesh.alive + 2 <= most;
       ++i) {
    const std::size_t some = std::max<std::size_t>(1, std::min(state.mesh.alive / 20, (most - state.mesh.alive) / 2));
    if (split_worst(state, limit, i < 2 ? std::max<std::size_t>(some, state.mesh.alive / 4) : some) == 0) {
      break;
    }
    state.attach();
    state.measure();
    polish(state, limit, 2);
    fruitless = state.error() < worth_it * best ? 0 : fruitless + 1;
    best = std::min(best, state.error());
  }
}

}  // namespace tunica
