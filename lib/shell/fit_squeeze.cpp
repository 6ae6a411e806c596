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
#include <utility>

namespace tunica {
namespace {

constexpr double first_part = 0.05;             // of the shells: how many fewer are tried at once
constexpr double loosened = 1.5;                // limits: error of a merger that all nodes together may make good
constexpr std::size_t squeezed_shells = 2'500;  // of all tries: what they may cost
constexpr std::size_t least_squeezes = 1, most_squeezes = 12;
constexpr int regaining = 8;                 // steps of all nodes
constexpr std::size_t minimax_shells = 3000;  // of more, factorisations are what steps cost
constexpr int minimax_steps = 8;
constexpr int minimax_tries = 2;
constexpr double hopeful = 1.6;  // limits: errors that lessening the largest may bring within
constexpr double spare = 0.98;   // of the limit: room for what further points find
constexpr int few_splits = 3;
constexpr int most_lessening = 6, least_lessening = 2;  // steps of all nodes that lessen the largest error, between mergers
constexpr std::size_t lessened_shells = 2'000;          // of all these steps: what they may cost
constexpr double first_use = 0.6;    // of the room that less error gives: how much of it mergers use up
constexpr double more_use = 1.1, less_use = 0.6;
constexpr int condensing_patience = 3;  // mergers that nothing makes good
constexpr double headroom = 0.95;    // of the limit: closer than that certificates find too much
constexpr int looks = 12;  // for points that the samples missed

/// Turns edges, moves all nodes, and places the worst ones anew.
void turn_and_place(FitState& state, int power, double limit) {
  flip_edges(state, limit);
  state.solve(power, 1);
  place_worst(state, 0.9 * limit);
  state.attach_again();
  state.measure();
}

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

void condense(FitSamples& samples, FitState& state, double limit, int rounds, const Progress& progress) {
  const auto lessen = [&](FitState& trial) {
    add_missed(samples, trial, limit, true);
    trial.attach();
    trial.measure();
    if (trial.error() > limit) {
      turn_and_place(trial, 8, limit);
    }
    lessen_largest(trial, 0, std::clamp(static_cast<int>(lessened_shells / trial.mesh.alive), least_lessening, most_lessening));
  };
  lessen(state);
  FitState before = state;
  double use = first_use;
  for (int round = 0, failures = 0; round < rounds && failures < condensing_patience; ++round) {
    advance(progress, static_cast<double>(round) / rounds);
    // Errors go with the square of the area of a shell.
    const double room = std::max(0.0, 1 - std::sqrt(state.error() / limit));
    const auto fewer = static_cast<std::size_t>(use * room * static_cast<double>(state.mesh.alive));
    if (fewer < 2) {
      break;
    }
    FitState trial = state;
    collapse_edges(trial, loosened * limit, state.mesh.alive - fewer, {});
    trial.attach();
    trial.measure();
    turn_and_place(trial, 4, limit);
    lessen_largest(trial, spare * limit, minimax_steps, limit);
    mend_angles(trial, limit);
    bool better = trial.error() <= limit && price(trial) < price(state);
    if (better) {
      lessen(trial);
      better = trial.error() <= limit;
    }
    if (better) {
      before = std::exchange(state, std::move(trial));
      use = std::min(1.0, more_use * use);
      failures = 0;
    } else {
      use *= less_use;
      ++failures;
    }
  }
  lessen(state);
  if (state.error() > headroom * limit && price(before) > price(state)) {
    state = std::move(before);
    lessen(state);
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
