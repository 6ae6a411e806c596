// Large neighbourhood search: Shaw, Using constraint programming and local search methods to solve vehicle routing
// problems, CP 1998, with mergers for removals and least squares for what is put back.
#include "shell/fit_exchange.hpp"

#include "core/threads.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_polish.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_remove.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_worst.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <random>

namespace tunica {
namespace {

constexpr std::size_t at_once = 8;  // changes, whatever the number of threads
constexpr std::size_t fits_per_shell = 6, fewest_fits = 600, most_fits = 6'000;  // of pieces anew: what costs
constexpr std::size_t most_before_parting = 150;  // of these more, where normals are to part
constexpr std::size_t most_shells = 600, most_on_coarse_targets = 1300;
constexpr std::size_t coarse_target = 250;       // triangles per shell: walks on denser ones are what a piece costs
constexpr int fewest_rings = 1, most_rings = 3;  // of nodes around a merger that move with it
constexpr int regaining = 4;                     // steps of all nodes of a piece
constexpr double loosened = 4;                   // limits: error of a merger before its piece is fitted anew
constexpr double thin_angle = 5;                 // degrees, for the time being
constexpr double promising = 1.3, promising_soon = 1.1;  // limits: after one step, and later: more hardly ever recovers
constexpr double slow = 0.97;                            // of the error is left by a step that brings little
constexpr std::array<double, 3> joining{1, 0.95, 0.9};   // of the limit
constexpr int easing = 8;                                // steps of all nodes
constexpr std::size_t least_kick = 2, shells_per_split = 10;
constexpr int patience = 2;      // times that bring nothing
constexpr int certificates = 3;  // per change

bool recovers(FitState& piece, double limit) {
  double before = std::numeric_limits<double>::infinity();
  for (int i = 0; i < regaining && piece.error() > limit && piece.error() < slow * before; ++i) {
    before = i == 0 ? before : piece.error();
    flip_edges(piece, limit);
    piece.solve(i == 0 ? 4 : 8, 1);
    place_worst(piece, 0.9 * limit);
    piece.attach_again();
    piece.measure();
    if (piece.error() > (i == 0 ? promising : promising_soon) * limit) {
      break;
    }
  }
  return piece.error() <= limit;
}

/// Fits a piece in which two nodes were merged, or one was taken out. @param shells, before  how many, and their price
/// before that
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

void widen(Box& box, const FitState& state, Index t) {
  for (const Vec3& p : state.mesh.patch(t).control) {
    box.lower = box.lower.cwiseMin(p);
    box.upper = box.upper.cwiseMax(p);
  }
}

class Exchange {
public:
  Exchange(FitSamples& samples, FitState& state, double limit, double tolerance)
      : samples_(samples),
        state_(state),
        limit_(limit),
        tolerance_(tolerance),
        crossings_(crossing_shells(state.mesh.shell()).size()),
        changed_(state.mesh.positions.size(), 1) {}

  /// @param most  pieces fitted anew; @return how many were
  std::size_t run(std::size_t most, std::mt19937& random) {
    for (int rings = fewest_rings; rings <= most_rings;) {
      const std::size_t before = fits_;
      auto edges = state_.mesh.edges();
      for (std::size_t i = edges.size(); i > 1; --i) {
        std::swap(edges[i - 1], edges[random() % i]);
      }
      for (std::size_t i = 0; i < edges.size(); i += at_once) {
        const std::size_t count = std::min(at_once, edges.size() - i);
        std::vector<Attempt> attempts(count);
        parallel_for_blocks(count, 1, [&](std::size_t begin, std::size_t end) {
          for (std::size_t k = begin; k < end; ++k) {
            attempts[k] = attempt(edges[i + k], rings);
          }
        });
        const std::size_t start = now_;
        for (Attempt& done : attempts) {
          if (fits_ >= most) {
            return fits_;
          }
          conclude(done, start);
        }
      }
      rings += fits_ == before ? 1 : 0;
    }
    return fits_;
  }

private:
  /// Two nodes to be merged, or one (twice) to be taken out, and the rings around that move with them.
  using Change = std::array<Index, 3>;

  struct Attempt {
    std::vector<Change> looked_at;
    std::optional<FitRegion> region;  ///< where one of them was possible
    bool fits = false;                ///< again, for the price before
    std::size_t price_before = 0;
  };

  /// Merges the nodes of an edge, or takes one of them out where they cannot be merged, and fits the piece around.
  /// Changes nothing, so that several are tried at once.
  [[nodiscard]] Attempt attempt(const std::array<Index, 2>& edge, int rings) const {
    Attempt out;
    const auto [u, v] = edge;
    for (const auto& [a, b] : {std::pair{u, v}, std::pair{u, u}, std::pair{v, v}}) {
      const bool exists = a == b ? !state_.mesh.around[a].empty() : state_.mesh.on_edge(a, b).count() > 0;
      if (!exists) {
        continue;
      }
      const Change change{a, b, static_cast<Index>(rings)};
      FitRegion region = cut_out(state_, {a, b}, rings);
      // What failed fails again until something around has changed.
      const auto tried = tried_.find(change);
      const std::size_t last = tried == tried_.end() ? 0 : tried->second;
      if (std::none_of(region.nodes.begin(), region.nodes.end(), [&](Index node) { return changed_[node] > last; })) {
        continue;
      }
      out.looked_at.push_back(change);
      const std::size_t shells = region.state.mesh.alive;
      out.price_before = price(region.state);
      if (!make(region, a, b)) {
        continue;
      }
      out.fits = fits_again(region.state, shells, out.price_before, state_.limits.angle, limit_);
      out.region = std::move(region);
      break;
    }
    return out;
  }

  /// One change of a piece, whatever that does to errors and angles for the time being.
  [[nodiscard]] bool make(FitRegion& region, Index a, Index b) const {
    FitState& piece = region.state;
    const auto in_piece = [&](Index node) {
      return static_cast<Index>(std::find(region.nodes.begin(), region.nodes.end(), node) - region.nodes.begin());
    };
    const bool parted = state_.limits.kink > 0;
    if (parted) {
      part_normals(piece);
    }
    piece.limits.angle = std::min(thin_angle, state_.limits.angle / 2);
    if (a != b) {
      return merge_edge(piece, in_piece(a), in_piece(b), loosened * limit_);
    }
    if (!remove_node(piece, in_piece(a), loosened * limit_)) {
      return false;
    }
    if (parted) {
      part_normals(piece);
    }
    return true;
  }

  /// @param start  of the attempts made at once: after one that came off, another is made anew some time
  void conclude(Attempt& done, std::size_t start) {
    if (now_ > start && done.fits) {
      return;
    }
    for (const Change& change : done.looked_at) {
      tried_[change] = start;
    }
    fits_ += done.region ? 1 : 0;
    if (!done.fits) {
      return;
    }
    const std::size_t points = samples_.points().size();
    if (auto trial = sound(*done.region, done.price_before)) {
      accept(std::move(*trial), done.region->nodes);
    } else {
      samples_.keep(points);  // what only a piece that failed had to heed costs every other
    }
  }

  /// The whole with a changed piece, where no point is too far off that the samples missed, if need be after further
  /// steps of the piece.
  std::optional<FitState> sound(FitRegion& region, std::size_t price_before) {
    for (int i = 0; i < certificates; ++i) {
      FitState trial = state_;
      if (put_back(region, trial) > limit_ || worse(trial)) {
        return {};
      }
      const Box box = around(region);
      std::vector<SamplePoint> missed = missed_within(trial, box, limit_);
      if (missed.empty() && holds_within(trial, box, tolerance_, missed)) {
        // The samples must see that as well, or steps of all nodes would start above the limit. From patch to patch:
        // attached to a tessellation's nearest triangle, some would be far off that are not.
        trial.attach_again();
        trial.measure();
        return trial.error() <= limit_ ? std::optional(std::move(trial)) : std::nullopt;
      }
      attach_to_closest(missed, region.state);
      region.state.measure();
      if (region.state.error() <= limit_) {
        return {};  // what is wrong is not seen
      }
      if (!recovers(region.state, limit_)) {
        return {};
      }
      mend_angles(region.state, limit_);
      if (region.state.error() > limit_ || price(region.state) > price_before) {
        return {};
      }
    }
    return {};
  }

  /// Adds points to the samples, and to those of a piece.
  void attach_to_closest(const std::vector<SamplePoint>& points, FitState& piece) {
    for (const SamplePoint& p : points) {
      double least = everywhere;
      Index closest = no_index;
      for (Index t = 0; t < piece.mesh.triangles.size(); ++t) {
        if (!piece.mesh.is_alive(t) || (p.of_boundary && piece.mesh.boundary_edges(t) == 0)) {
          continue;
        }
        if (const double d = foot_on_patch(piece.mesh.patch(t), p.point).squared_distance; d < least) {
          least = d;
          closest = t;
        }
      }
      if (closest == no_index) {
        continue;  // the piece has no part in the boundary
      }
      piece.patches[closest].attached.push_back(static_cast<Index>(samples_.points().size()));
      samples_.add(p);
    }
  }

  [[nodiscard]] bool worse(const FitState& trial) const {
    return trial.error() > limit_ || price(trial) > price(state_) ||
           crossing_shells(trial.mesh.shell()).size() > crossings_;
  }

  /// What a changed piece may be close to, before and after.
  [[nodiscard]] Box around(const FitRegion& region) const {
    const FitState& piece = region.state;
    Box box{piece.mesh.positions[0], piece.mesh.positions[0]};
    for (const Index t : region.triangles) {
      widen(box, state_, t);
    }
    for (Index t = 0; t < piece.mesh.triangles.size(); ++t) {
      if (piece.mesh.is_alive(t)) {
        widen(box, piece, t);
      }
    }
    box.lower.array() -= limit_;
    box.upper.array() += limit_;
    return box;
  }

  void accept(FitState trial, const std::vector<Index>& nodes) {
    ++now_;
    const std::size_t before = changed_.size();
    changed_.resize(trial.mesh.positions.size(), now_);
    for (std::size_t i = 0; i < before; ++i) {
      changed_[i] = trial.mesh.positions[i] == state_.mesh.positions[i] ? changed_[i] : now_;
    }
    for (const Index node : nodes) {
      changed_[node] = now_;
    }
    state_ = std::move(trial);
    crossings_ = std::min(crossings_, crossing_shells(state_.mesh.shell()).size());
  }

  static constexpr double everywhere = std::numeric_limits<double>::infinity();

  FitSamples& samples_;
  FitState& state_;
  double limit_, tolerance_;
  std::size_t crossings_;
  std::size_t fits_ = 0, now_ = 1;    // changes so far
  std::vector<std::size_t> changed_;  // when each node was last
  std::map<Change, std::size_t> tried_;
};

bool is_certain(const FitState& state, double tolerance) {
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  std::vector<SamplePoint> farthest;
  return holds_within(state, {Vec3::Constant(-everywhere), Vec3::Constant(everywhere)}, tolerance, farthest);
}

/// Takes a changed state when steps of all nodes bring it within the limit, it is no dearer, crosses no more, and is
/// certainly within the tolerance, if what it was made from is.
bool take_if_sound(FitSamples& samples, FitState trial, FitState& state, double limit, double tolerance) {
  if (!regains(samples, trial, limit) || price(trial) > price(state) ||
      crossing_shells(trial.mesh.shell()).size() > crossing_shells(state.mesh.shell()).size() ||
      (!is_certain(trial, tolerance) && is_certain(state, tolerance))) {
    return false;
  }
  state = std::move(trial);
  return true;
}

/// Exchanges until nothing comes of it any more, with the room that less error everywhere gives in between.
/// @param left  pieces that may be fitted anew; @return how many of these are left
std::size_t dig(FitSamples& samples, FitState& state, double limit, double tolerance, std::size_t left,
                std::mt19937& random) {
  for (int fruitless = 0; fruitless < patience && left > 0;) {
    const std::size_t before = price(state);
    FitState squeezed = state;
    squeeze(samples, squeezed, limit);
    if (price(squeezed) < before) {
      take_if_sound(samples, std::move(squeezed), state, limit, tolerance);
    }
    left -= Exchange(samples, state, limit, tolerance).run(left, random);
    FitState eased = state;
    settle(eased, easing);
    take_if_sound(samples, std::move(eased), state, limit, tolerance);
    fruitless = price(state) < before ? 0 : fruitless + 1;
  }
  return left;
}

/// Joins normals as long as the error allows. One after the other they may ask too much of those that follow: then
/// with a margin.
void join_again(FitSamples& samples, FitState& state, double limit, double tolerance) {
  for (const double part : joining) {
    FitState joined = state;
    join_normals(joined, part * limit);
    joined.attach();
    joined.measure();
    if (take_if_sound(samples, std::move(joined), state, limit, tolerance)) {
      return;
    }
  }
}

/// A mesh of shells from which a search may end elsewhere: some edges at random are split.
std::optional<FitState> kicked(FitSamples& samples, const FitState& from, double limit, double tolerance,
                               std::mt19937& random) {
  FitState state = from;
  const auto edges = state.mesh.edges();
  const std::size_t splits = std::max(least_kick, from.mesh.alive / shells_per_split);
  for (std::size_t i = 0; i < splits; ++i) {
    const auto& [u, v] = edges[random() % edges.size()];
    if (state.mesh.on_edge(u, v).count() > 0) {
      split_edge(state, u, v, limit);
    }
  }
  rid_of_thin(state, limit, 2 * from.mesh.alive + 2 * splits);
  state.attach();
  state.measure();
  if (!regains(samples, state, limit) || crossing_shells(state.mesh.shell()).size() > 0 ||
      !is_certain(state, tolerance)) {
    return {};
  }
  return state;
}

}  // namespace

void exchange_pieces(FitSamples& samples, FitState& state, const ExchangeOptions& options) {
  const auto& [limit, tolerance, kink, tries, on_better, progress] = options;
  const bool coarse = samples.target().mesh().triangles.size() < coarse_target * state.mesh.alive;
  if (state.mesh.alive > (coarse ? most_on_coarse_targets : most_shells)) {
    return;
  }
  const bool parting = kink > 0 && state.mesh.kind == Patch::comas;
  std::mt19937 random;
  const std::size_t all = std::clamp(fits_per_shell * state.mesh.alive, fewest_fits, most_fits);
  std::size_t left = all;
  if (parting) {
    Exchange(samples, state, limit, tolerance).run(most_before_parting, random);
  }
  FitState best = state;
  const std::vector<SamplePoint> points = samples.points();
  std::vector<SamplePoint> points_of_best = points;
  for (int i = 0; i < tries && left > 0; ++i) {
    advance(progress, 1 - static_cast<double>(left) / static_cast<double>(all));
    samples.take_points(points_of_best);
    std::optional<FitState> trial = i == 0 ? best : kicked(samples, best, limit, tolerance, random);
    if (!trial) {
      samples.take_points(points);
      trial = state;
    }
    if (parting) {
      trial->limits.kink = kink;
      part_normals(*trial);
    }
    left = dig(samples, *trial, limit, tolerance, left, random);
    if (price(*trial) < price(best) && trial->error() <= limit) {
      best = std::move(*trial);
      points_of_best = samples.points();
      if (on_better) {
        on_better(best);
      }
    }
  }
  samples.take_points(std::move(points_of_best));
  if (price(best) < price(state)) {
    if (parting) {
      join_again(samples, best, limit, tolerance);
    }
    state = std::move(best);
  }
}

}  // namespace tunica
