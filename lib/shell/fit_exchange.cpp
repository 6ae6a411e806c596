// Large neighbourhood search: Shaw, Using constraint programming and local search methods to solve vehicle routing
// problems, CP 1998, with mergers for removals and least squares for what is put back.
#include "shell/fit_exchange.hpp"

#include "core/threads.hpp"
#include "shell/fit_condense.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_minimax.hpp"
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
// Of pieces anew: what costs.
constexpr std::size_t fits_per_shell = 8, fewest_fits = 600, most_fits = 6'000, most_fits_per_shell = 20;
constexpr std::size_t most_before_parting = 150;  // of these more, where normals are to part
constexpr int fewest_rings = 1, most_rings = 3;   // of nodes around a merger that move with it
constexpr int regaining = 6;                      // steps that lessen the largest error of a piece
constexpr double loosened = 4;                    // limits: error of a merger before its piece is fitted anew
constexpr double thin_angle = 5;                  // degrees, for the time being
constexpr std::size_t tries_at_thin_ones = 2;     // that fail: the rest hardly ever gets rid of them all
constexpr std::size_t few_thin_ones = 3;          // worth a second time
constexpr double promising_at_first = 2;          // limits: after a step of least squares; more hardly ever recovers
constexpr double spare = 0.97;                    // of the limit: room for what a certificate finds
constexpr std::array<double, 3> joining{1, 0.95, 0.9};  // of the limit
constexpr int easing = 8;                               // steps of all nodes
constexpr int rings_of_a_kick = 2;                      // of nodes around a place
constexpr std::size_t splits_of_a_kick = 2, fits_after_a_kick = 60;
constexpr int patience = 1, patience_with_few = 2;  // times that bring nothing
constexpr std::size_t few = 40;                     // shells: a kick shakes most of them, and costs as much
// Of the tolerance. Certificates end with intervals that wide, below it or not: what one finds just below may be above
// in the next, which looks at more.
constexpr double certainly = 1 - width_of_certificates;
constexpr std::size_t changes_between_attaching = 64;  // shells per change that all points are attached after
constexpr int certificates = 8;                        // per change: each tells of points that the samples missed

bool recovers(FitState& piece, double limit) {
  if (piece.error() <= limit) {
    return true;
  }
  flip_edges(piece, limit);
  piece.solve(4, 1);
  piece.attach_again();
  piece.measure();
  if (piece.error() > promising_at_first * limit) {
    return false;
  }
  return lessen_largest(piece, spare * limit, regaining, limit) <= limit;
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
  rid_of_thin(piece, limit, shells, tries_at_thin_ones);
  if (const std::size_t thin = count_thin(piece); thin > 0 && thin <= few_thin_ones) {
    // With less error everywhere nodes have room to slide.
    lessen_largest(piece, 0, regaining);
    rid_of_thin(piece, limit, shells, tries_at_thin_ones);
  }
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
  /// @param tolerance  mm; none: nothing is certified
  Exchange(FitSamples& samples, FitState& state, double limit, std::optional<double> tolerance)
      : samples_(samples),
        state_(state),
        limit_(limit),
        tolerance_(tolerance ? std::optional(certainly * *tolerance) : std::nullopt),
        crossings_(crossing_shells(state.mesh.shell()).size()),
        changed_(state.mesh.positions.size(), 1) {}

  /// Changes anywhere until there is none left to try.
  /// @param most  pieces fitted anew, since the beginning; @return how many were
  std::size_t run(std::size_t most, std::mt19937& random) {
    for (int rings = fewest_rings; rings <= most_rings;) {
      const std::size_t before = price(state_);
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
        if (now_ >= attached_ + 1 + state_.mesh.alive / changes_between_attaching) {
          attach_all_again();
        }
      }
      rings += price(state_) < before ? 0 : 1;
    }
    return fits_;
  }

  /// Splits a few edges somewhere and exchanges what is around: what then takes more shells than before is undone.
  /// @param most  as of run(); @return likewise
  std::size_t kick(std::size_t most, std::mt19937& random) {
    const FitState before = state_;
    const auto changed = changed_;
    const auto tried = tried_;
    const std::vector<SamplePoint> points = samples_.points();
    const std::size_t crossings = crossings_;
    if (!split_somewhere(random)) {
      samples_.keep(points.size());
      return ++fits_;
    }
    run(std::min(most, fits_ + fits_after_a_kick), random);
    if (price(state_) > price(before)) {
      state_ = before;
      changed_ = changed;
      tried_ = tried;
      crossings_ = crossings;
      samples_.take_points(points);
    }
    return fits_;
  }

private:
  /// @return whether that came off
  bool split_somewhere(std::mt19937& random) {
    Index node = 0;
    do {
      node = static_cast<Index>(random() % state_.mesh.around.size());
    } while (state_.mesh.around[node].empty());
    FitRegion region = cut_out(state_, {node}, rings_of_a_kick);
    FitState& piece = region.state;
    for (std::size_t i = 0; i < splits_of_a_kick; ++i) {
      const auto edges = piece.mesh.edges();
      const auto& [u, v] = edges[random() % edges.size()];
      if (!piece.mesh.is_cut(u, v)) {
        split_edge(piece, u, v, loosened * limit_);
      }
    }
    piece.attach_again();
    piece.measure();
    if (piece.mesh.alive == region.triangles.size() || !recovers(piece, limit_)) {
      return false;
    }
    mend_angles(piece, limit_);
    const std::size_t dearer = price(state_) + 2 * splits_of_a_kick;
    if (auto trial = sound(region, price(piece), dearer)) {
      accept(std::move(*trial), region);
      return true;
    }
    return false;
  }

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

  /// @param start  of the attempts made at once: what another of them has changed since is tried anew some time
  void conclude(Attempt& done, std::size_t start) {
    if (done.fits && std::any_of(done.region->nodes.begin(), done.region->nodes.end(),
                                 [&](Index node) { return changed_[node] > start; })) {
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
    if (auto trial = sound(*done.region, done.price_before, price(state_))) {
      accept(std::move(*trial), *done.region);
    } else {
      samples_.keep(points);  // what only a piece that failed had to heed costs every other
    }
  }

  /// The whole with a changed piece, where no point is too far off that the samples missed, if need be after further
  /// steps of the piece. @param price_before, most  of the piece, and of the whole: no more afterwards
  std::optional<FitState> sound(FitRegion& region, std::size_t price_before, std::size_t most) {
    for (int i = 0; i < certificates; ++i) {
      FitState trial = state_;
      if (put_back(region, trial) > limit_ || trial.error() > limit_ || price(trial) > most) {
        return {};
      }
      const Box box = around(region);
      if (crossings_with(trial, box) > crossings_) {
        return {};
      }
      std::vector<SamplePoint> missed = missed_within(trial, box, limit_);
      const bool all_met = missed.empty() && (!tolerance_ || holds_within(trial, box, *tolerance_, missed));
      const bool close = tolerance_ || add_places_beyond(region.state, limit_);
      if (all_met && close) {
        return trial;
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

  /// How many pairs cross in a trial that differs from the state only within a box.
  [[nodiscard]] std::size_t crossings_with(const FitState& trial, const Box& box) const {
    const auto near = [&](const FitState& state) {
      return crossing_shells(shells_near(state.mesh.shell(), box, 0)).size();
    };
    const std::size_t now = near(trial);
    return crossings_ == 0 ? now : crossings_ + now - near(state_);
  }

  /// Points of the target may be closer to a patch beyond what has changed. From patch to patch: attached to a
  /// tessellation's nearest triangle, some would be far off that are not.
  void attach_all_again() {
    attached_ = now_;
    FitState again = state_;
    again.attach_again();
    again.measure();
    if (again.error() <= limit_) {
      state_ = std::move(again);
    }
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

  void accept(FitState trial, const FitRegion& region) {
    ++now_;
    crossings_ = crossings_with(trial, around(region));
    const std::size_t before = changed_.size();
    changed_.resize(trial.mesh.positions.size(), now_);
    for (std::size_t i = 0; i < before; ++i) {
      changed_[i] = trial.mesh.positions[i] == state_.mesh.positions[i] ? changed_[i] : now_;
    }
    for (const Index node : region.nodes) {
      changed_[node] = now_;
    }
    state_ = std::move(trial);
  }

  static constexpr double everywhere = std::numeric_limits<double>::infinity();

  FitSamples& samples_;
  FitState& state_;
  double limit_;
  std::optional<double> tolerance_;
  std::size_t crossings_;
  std::size_t fits_ = 0, now_ = 1;    // changes so far
  std::size_t attached_ = 1;          // when all points were, last
  std::vector<std::size_t> changed_;  // when each node was last
  std::map<Change, std::size_t> tried_;
};

/// Whether a state is certainly within the tolerance, after steps of all nodes that meet what certificates find.
bool becomes_certain(FitSamples& samples, FitState& state, double limit, double tolerance) {
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  const Box all{Vec3::Constant(-everywhere), Vec3::Constant(everywhere)};
  for (int i = 0; i < certificates && regains(samples, state, limit); ++i) {
    std::vector<SamplePoint> farthest;
    if (holds_within(state, all, certainly * tolerance, farthest)) {
      return true;
    }
    add_missed(samples, state, limit, true);
    for (const SamplePoint& point : farthest) {
      samples.add(point);
    }
    state.attach();
    state.measure();
    if (state.error() <= limit) {
      return false;  // what is wrong is not seen
    }
    lessen_largest(state, spare * limit, regaining, limit);
  }
  return false;
}

/// Takes a changed state when steps of all nodes bring it within the limit, it is no dearer, crosses no more, and is
/// certainly within the tolerance.
bool take_if_sound(FitSamples& samples, FitState trial, FitState& state, double limit, double tolerance) {
  const std::size_t points = samples.points().size();
  if (becomes_certain(samples, trial, limit, tolerance) && price(trial) <= price(state) &&
      crossing_shells(trial.mesh.shell()).size() <= crossing_shells(state.mesh.shell()).size()) {
    state = std::move(trial);
    return true;
  }
  samples.keep(points);
  return false;
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

/// The search of exchange_pieces(), with what is left of its budget.
class Search {
public:
  Search(FitSamples& samples, FitState& state, const ExchangeOptions& options)
      : samples_(samples),
        state_(state),
        options_(options),
        all_(
            fits(options.effort, std::clamp(fits_per_shell * state.mesh.alive,
                                            std::min(fewest_fits, most_fits_per_shell * state.mesh.alive), most_fits))),
        left_(all_),
        rounds_(options.rounds),
        least_(price(state)) {}

  void before_parting() {
    Exchange(samples_, state_, options_.limit, options_.tolerance)
        .run(fits(options_.effort, most_before_parting), random_);
    least_ = price(state_);
  }

  /// Exchanges until nothing comes of it any more; then after kicks. @param parting  normals may part
  void run(bool parting) {
    if (parting) {
      // More than smooth targets ask for only where that shows: there it makes the search end early.
      state_.limits.kink = std::max(state_.limits.kink, std::min(first_kink, options_.kink));
      exchange(left_ - left_ / 4);
      if (many_part_by(state_.mesh, state_.limits.kink)) {
        state_.limits.kink = options_.kink;
      }
    }
    exchange(0);
    Exchange kicked(samples_, state_, options_.limit, options_.tolerance);
    for (const std::size_t most = left_; goes_on(0);) {
      left_ = most - kicked.kick(most, random_);
      tell();
    }
  }

private:
  static std::size_t fits(double effort, std::size_t usual) {
    return static_cast<std::size_t>(effort * static_cast<double>(usual));
  }

  bool goes_on(std::size_t reserve) { return left_ > reserve && rounds_-- > 0; }

  /// Exchanges, with the room that less error everywhere gives in between. @param reserve  of pieces, to be left
  void exchange(std::size_t reserve) {
    const double limit = options_.limit, tolerance = options_.tolerance;
    const int enough = state_.mesh.alive < few ? patience_with_few : patience;
    for (int fruitless = 0; fruitless < enough && goes_on(reserve);) {
      const std::size_t before = price(state_);
      FitState condensed = state_;
      condense(samples_, condensed, {limit});
      if (price(condensed) == before) {
        settle(condensed, easing);
        lessen_largest(condensed, 0, easing);
      }
      take_if_sound(samples_, std::move(condensed), state_, limit, tolerance);
      left_ -= Exchange(samples_, state_, limit, tolerance).run(left_ - reserve, random_);
      fruitless = price(state_) < before ? 0 : fruitless + 1;
      tell();
    }
  }

  void tell() {
    advance(options_.progress, 1 - static_cast<double>(left_) / static_cast<double>(all_));
    if (price(state_) < least_ && options_.on_better) {
      options_.on_better(state_);
    }
    least_ = std::min(least_, price(state_));
  }

  FitSamples& samples_;
  FitState& state_;
  const ExchangeOptions& options_;
  std::mt19937 random_;
  std::size_t all_, left_;  // pieces that may be fitted anew
  int rounds_;
  std::size_t least_;  // price that was told of
};

}  // namespace

void exchange_in_piece(FitSamples& samples, FitState& state, double limit, std::size_t most) {
  std::mt19937 random;
  Exchange(samples, state, limit, {}).run(most, random);
}

void exchange_pieces(FitSamples& samples, FitState& state, const ExchangeOptions& options) {
  if (options.effort == 0) {
    return;
  }
  const bool parting = options.kink > 0 && state.mesh.kind == Patch::comas;
  FitState best = state;
  std::vector<SamplePoint> points = samples.points();
  Search search(samples, best, options);
  if (parting && state.limits.kink == 0) {
    search.before_parting();
    state = best;
    points = samples.points();
    part_normals(best);
  }
  search.run(parting);
  if (!(price(best) < price(state)) || best.error() > options.limit) {
    samples.take_points(std::move(points));
    return;
  }
  if (parting) {
    join_again(samples, best, options.limit, options.tolerance);
  }
  state = std::move(best);
}

}  // namespace tunica
