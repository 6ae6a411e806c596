// Fewer and better shells by steps that make the fit worse for the time being.
#include "shell/fit_squeeze.hpp"

#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_minimax.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_worst.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double first_part = 0.05;             // of the shells: how many fewer are tried at once
constexpr double loosened = 1.5;                // limits: error of a merger that all nodes together may make good
constexpr std::size_t squeezed_shells = 2'500;  // of all tries: what they may cost
constexpr std::size_t least_squeezes = 1, most_squeezes = 12;
constexpr int regaining = 8;                 // steps of all nodes
constexpr std::size_t minimax_shells = 600;  // of more, factorisations are what steps cost
constexpr int minimax_steps = 8;
constexpr int minimax_tries = 2;
constexpr double hopeful = 1.6;  // limits: errors that lessening the largest may bring within
constexpr double spare = 0.98;   // of the limit: room for what further points find
constexpr int few_splits = 3;
constexpr int looks = 12;  // for points that the samples missed

}  // namespace

std::size_t price(const FitState& state) {
  return state.mesh.alive + state.limits.price_of_a_thin_one * count_thin(state);
}

bool regains(FitSamples& samples, FitState& state, double limit) {
  for (int look = 0; look < looks; ++look) {
    for (int i = 0, minimax = 0; i < regaining && minimax < minimax_tries && state.error() > limit; ++i) {
      flip_edges(state, limit);
      state.solve(i == 0 ? 4 : 8, 1);
      place_worst(state, 0.9 * limit);
      state.attach();
      state.measure();
      if (i > 0 && state.mesh.alive <= minimax_shells && state.error() < hopeful * limit) {
        lessen_largest(state, spare * limit, minimax_steps, limit);
        ++minimax;
      }
    }
    if (state.error() > limit) {
      return false;
    }
    mend_angles(state, limit);
    if (add_missed(samples, state, limit) == 0) {
      return true;
    }
    state.attach();
    state.measure();
  }
  return false;
}

bool regains_with_few(FitSamples& samples, FitState& state, double limit, std::size_t most) {
  FitState trial = state;
  trial.attach();
  trial.measure();
  if (trial.error() <= limit) {
    return false;  // nothing new is known
  }
  for (int splits = 0; splits <= few_splits; ++splits) {
    if (splits > 0) {
      if (trial.mesh.alive + 2 > most || split_worst(trial, limit, 1) == 0) {
        return false;
      }
      trial.attach();
      trial.measure();
    }
    if (regains(samples, trial, limit)) {
      state = std::move(trial);
      return true;
    }
  }
  return false;
}

void squeeze(FitSamples& samples, FitState& state, double limit) {
  double part = first_part;
  const std::size_t crossings = crossing_shells(state.mesh.shell()).size();
  const std::size_t tries = std::clamp(squeezed_shells / state.mesh.alive, least_squeezes, most_squeezes);
  for (std::size_t i = 0; i < tries; ++i) {
    const auto fewer = static_cast<std::size_t>(std::max(2.0, part * static_cast<double>(state.mesh.alive)));
    FitState trial = state;
    collapse_edges(trial, loosened * limit, state.mesh.alive - std::min(fewer, state.mesh.alive - 4), {});
    trial.attach();
    trial.measure();
    if (trial.mesh.alive < state.mesh.alive && regains(samples, trial, limit) && price(trial) < price(state) &&
        part_crossings(trial, limit, state.mesh.alive) <= crossings && price(trial) < price(state)) {
      state = std::move(trial);
    } else if (fewer <= 2) {
      break;
    } else {
      part /= 2;
    }
  }
}

void shape_up(FitSamples& samples, FitState& state, double limit, std::size_t most) {
  for (const double by_way_of : {1.0, 1.3, 2.0}) {
    const std::size_t thin = count_thin(state);
    if (thin == 0) {
      return;
    }
    FitState trial = state;
    rid_of_thin(trial, by_way_of * limit, most);
    if (count_thin(trial) < thin) {
      trial.attach();
      trial.measure();
      if (regains(samples, trial, limit) && price(trial) < price(state)) {
        state = std::move(trial);
      }
    }
  }
}

}  // namespace tunica
