// Large neighbourhood search: Shaw, Using constraint programming and local search methods to solve vehicle routing
// problems, CP 1998, with mergers for removals and least squares for what is put back.
#include "shell/fit_exchange.hpp"

#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_worst.hpp"

#include <algorithm>
#include <random>

namespace tunica {
namespace {

constexpr std::size_t most_tries = 1'000, tries_per_shell = 4;
constexpr std::size_t most_fits = 200;  // of pieces anew: what costs
constexpr std::size_t most_shells = 400;
constexpr int rings = 1;          // of nodes around a merger that move with it
constexpr int regaining = 4;      // steps of all nodes of a piece
constexpr double loosened = 8;    // limits: error of a merger before its piece is fitted anew
constexpr double thin_angle = 5;  // degrees, for the time being
constexpr double slow = 0.97;     // of the error is left by a step that brings little

bool recovers(FitState& piece, double limit) {
  double before = std::numeric_limits<double>::infinity();
  for (int i = 0; i < regaining && piece.error() > limit && piece.error() < slow * before; ++i) {
    before = i == 0 ? before : piece.error();
    flip_edges(piece, limit);
    piece.solve(i == 0 ? 4 : 8, 1);
    place_worst(piece, 0.9 * limit);
    piece.attach_again();
    piece.measure();
  }
  return piece.error() <= limit;
}

/// Fits a piece in which two nodes were merged. @param shells, before  how many, and their price before that
/// @return whether it is no dearer now and within the limit
bool fits_again(FitState& piece, std::size_t shells, std::size_t before, double angle, double limit) {
  piece.attach_again();
  piece.measure();
  if (!recovers(piece, limit)) {
    if (split_worst(piece, limit, 1) == 0) {
      return false;
    }
    piece.attach_again();
    piece.measure();
    if (!recovers(piece, limit)) {
      return false;
    }
  }
  piece.limits.angle = angle;
  rid_of_thin(piece, limit, shells);
  return price(piece) <= before && piece.error() <= limit;
}

}  // namespace

void exchange_pieces(FitSamples& samples, FitState& state, double limit) {
  if (state.mesh.alive > most_shells) {
    return;
  }
  std::mt19937 random;
  const std::size_t tries = std::min(tries_per_shell * state.mesh.alive, most_tries);
  const std::size_t crossings = crossing_shells(state.mesh.shell()).size();
  const auto worse = [&](const FitState& trial) {
    return trial.error() > limit || price(trial) > price(state) ||
           crossing_shells(trial.mesh.shell()).size() > crossings;
  };
  std::size_t fits = 0;
  for (std::size_t i = 0; i < tries && fits < most_fits; ++i) {
    const auto edges = state.mesh.edges();
    const auto [u, v] = edges[random() % edges.size()];
    FitRegion region = cut_out(state, {u, v}, rings);
    const auto in_piece = [&nodes = region.nodes](Index node) {
      return static_cast<Index>(std::find(nodes.begin(), nodes.end(), node) - nodes.begin());
    };
    const std::size_t shells = region.state.mesh.alive, before = price(region.state);
    region.state.limits.angle = thin_angle;
    if (!merge_edge(region.state, in_piece(u), in_piece(v), loosened * limit)) {
      continue;
    }
    ++fits;
    if (!fits_again(region.state, shells, before, state.limits.angle, limit)) {
      continue;
    }
    FitState trial = state;
    if (put_back(region, trial) > limit || worse(trial)) {
      continue;
    }
    add_missed(samples, trial, limit);
    trial.attach();
    trial.measure();
    if (trial.error() <= limit || (regains(samples, trial, limit) && !worse(trial))) {
      state = std::move(trial);
    }
  }
}

}  // namespace tunica
