#include "shell/fit_condense.hpp"

#include "shell/fit_detach.hpp"
#include "shell/fit_divide.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_exchange.hpp"
#include "shell/fit_minimax.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_worst.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double loosened = 1.5;  // limits: error of a merger that steps of all nodes may make good
constexpr double spare = 0.98;    // of the limit: room for what further points find
constexpr int minimax_steps = 8;
constexpr int most_rings = 3;                           // of nodes around a patch that move with its own
constexpr int most_lessening = 6, least_lessening = 2;  // steps that lessen the largest error, between mergers
constexpr std::size_t lessened_shells = 2'000;          // of all these steps: what they may cost
constexpr double first_use = 0.6;                       // of the room that less error gives: what mergers use up
constexpr double more_use = 1.1, less_use = 0.6;
constexpr int patience = 3;             // mergers that nothing makes good
constexpr double headroom = 0.86;       // of the limit: closer than that certificates find too much
constexpr double nearly = 0.95;         // of the degrees that normals may part by
constexpr double often = 0.02;          // of the nodes
constexpr std::size_t piece = 300;      // shells: of more, all wait for the worst place
constexpr std::size_t undivided = 450;  // shells
constexpr int turns = 5, piece_rounds = 2;
constexpr int exchange_turns = 2;
constexpr std::size_t exchanges = 3;  // pieces fitted anew per shell and turn
constexpr int most_mends = 50;        // by certificates
constexpr int splitting = 4;          // tries to mend what only more shells do

/// Turns edges, moves all nodes, and places the worst ones anew.
void turn_and_place(FitState& state, int power, double limit) {
  flip_edges(state, limit);
  state.solve(power, 1);
  place_worst(state, 0.9 * limit);
  state.attach_again();
  state.measure();
}

}  // namespace

void condense(FitSamples& samples, FitState& state, const CondenseOptions& options) {
  const double limit = options.limit, enough = options.is_piece ? limit : headroom * limit;
  const auto attach = [&](FitState& trial) { options.is_piece ? trial.attach_closely() : trial.attach(); };
  const auto lessen = [&](FitState& trial) {
    add_missed(samples, trial, limit, true);
    attach(trial);
    trial.measure();
    if (trial.error() > limit) {
      turn_and_place(trial, 8, limit);
    }
    lessen_largest(trial, 0,
                   std::clamp(static_cast<int>(lessened_shells / trial.mesh.alive), least_lessening, most_lessening));
  };
  lessen(state);
  FitState roomy = state;
  double use = first_use;
  for (int round = 0, failures = 0; round < options.rounds && failures < patience; ++round) {
    advance(options.progress, static_cast<double>(round) / options.rounds);
    // Errors go with the square of the area of a shell.
    const double room = std::max(0.0, 1 - std::sqrt(state.error() / limit));
    const auto fewer = static_cast<std::size_t>(use * room * static_cast<double>(state.mesh.alive));
    if (fewer < 2) {
      break;
    }
    FitState trial = state;
    collapse_edges(trial, loosened * limit, state.mesh.alive - fewer, {});
    attach(trial);
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
      state = std::move(trial);
      if (state.error() <= enough) {
        roomy = state;
      }
      use = std::min(1.0, more_use * use);
      failures = 0;
    } else {
      use *= less_use;
      ++failures;
    }
  }
  if (state.error() > enough) {
    state = std::move(roomy);
  }
  lessen(state);
}

std::size_t mend_pieces(FitState& state, double limit) {
  std::size_t left = 0;
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    if (!state.mesh.is_alive(t) || state.patches[t].error <= limit) {
      continue;
    }
    const std::array<Index, 3> corners = state.mesh.triangles[t];
    bool mended = false;
    for (int rings = 0; rings < most_rings && !mended; ++rings) {
      FitRegion region = cut_out(state, {corners.begin(), corners.end()}, rings);
      lessen_largest(region.state, 0, most_lessening);
      if (region.state.error() <= limit) {
        FitState trial = state;
        if (put_back(region, trial) <= limit) {
          state = std::move(trial);
          mended = true;
        }
      }
    }
    left += mended ? 0 : 1;
  }
  return left;
}

bool many_part_by(const FitMesh& mesh, double kink) { return share_parted_by(mesh, nearly * kink) > often; }

namespace {

/// The whole, or piece by piece: there errors need no headroom, as what certificates find is mended in the end.
void condense_all(FitSamples& samples, FitState& state, const CondenseOptions& options) {
  if (state.mesh.alive < undivided) {
    condense(samples, state, options);
    return;
  }
  CondenseOptions of_piece = options;
  of_piece.rounds = std::min(options.rounds, piece_rounds);
  of_piece.is_piece = true;
  of_piece.progress = {};
  state.attach_closely();
  state.measure();
  for (int turn = 0; turn < std::min(options.rounds, turns); ++turn) {
    advance(options.progress, static_cast<double>(turn) / turns);
    change_pieces(samples, state, piece, turn,
                  [&](FitSamples& its_samples, FitState& its_state) { condense(its_samples, its_state, of_piece); });
  }
}

/// Mends pieces, with more shells where nothing else does.
void mend(FitState& state, double limit) {
  for (int i = 0; i < splitting && state.error() > limit; ++i) {
    if (const std::size_t left = mend_pieces(state, limit); left > 0) {
      split_worst(state, limit, left);
      state.attach_again();
      state.measure();
    }
  }
}

}  // namespace

void condense_parted(FitSamples& samples, FitState& state, const CondenseOptions& options) {
  if (options.kink == 0 || state.mesh.kind != Patch::comas) {
    condense_all(samples, state, options);
    return;
  }
  state.limits.kink = std::min(first_kink, options.kink);
  part_normals(state);
  condense_all(samples, state, options);
  if (options.kink > first_kink && many_part_by(state.mesh, first_kink)) {
    state.limits.kink = options.kink;
    condense_all(samples, state, options);
  }
}

bool condense_certainly(FitSamples& samples, FitState& state, FitResult& result, double tolerance,
                        const CondenseOptions& options) {
  condense_parted(samples, state, options);
  const int exchanging = options.exchanging > 0 ? std::min(options.rounds, exchange_turns) : 0;
  for (int turn = 0; turn < exchanging; ++turn) {
    advance(options.progress, static_cast<double>(turn) / exchange_turns);
    change_pieces(samples, state, piece, turns + turn, [&](FitSamples& its_samples, FitState& its_state) {
      const double usual = static_cast<double>(exchanges * its_state.mesh.alive);
      exchange_in_piece(its_samples, its_state, options.limit, static_cast<std::size_t>(options.exchanging * usual));
    });
  }
  // Steps of all nodes would leave something else behind each time.
  mend(state, options.limit);
  for (int i = 0; i < most_mends && state.error() <= options.limit; ++i) {
    if (result.certify(state, tolerance, true)) {
      return true;
    }
    for (const SamplePoint& point : result.farthest()) {
      samples.add(point);
    }
    for (const FarPlace& place : result.beyond_of_shell()) {
      state.patches[place.patch].places.push_back(place.at);
    }
    state.attach_closely();
    state.measure();
    add_missed(samples, state, options.limit, true);
    if (state.error() <= options.limit) {
      break;  // what is wrong is not seen
    }
    mend(state, options.limit);
  }
  return false;
}

}  // namespace tunica
