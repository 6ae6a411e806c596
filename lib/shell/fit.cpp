#include "shell/fit.hpp"

#include "shell/curved_surface.hpp"
#include "shell/fit_condense.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_exchange.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_parts.hpp"
#include "shell/fit_polish.hpp"
#include "shell/fit_result.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_start.hpp"
#include "shell/fit_task.hpp"
#include "shell/fit_to_count.hpp"
#include "shell/fit_worst.hpp"
#include "surface/decimate.hpp"
#include "surface/measure.hpp"
#include "surface/self_intersections.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double default_width = 1e-4;  // of the diagonal
constexpr int default_rounds = 8;
constexpr double start_error = 3;  // tolerances: flat error of the mesh that the search starts from
constexpr std::size_t few = 600;   // triangles: from so few slivers hardly any good ones come, and more cost little
constexpr std::size_t affordable = 1300;  // triangles of a start: further searches cost little
constexpr int search_patience = 2;        // rounds that leave as many shells
constexpr double finer_start_error = 1.5;
constexpr double stand_in_error = 0.04;    // tolerances: of what stands in for a dense target
constexpr double limited_by_target = 0.6;  // of its triangles: a start with more follows its facets, not its shape
constexpr double expected_gain = 3;        // shells of the start per shell of the result
constexpr std::size_t dense = 100;         // triangles of the target per shell: certificates cost as much as a round
constexpr double margin = 0.97;            // of the tolerance: what samples miss
constexpr double worth_it = 0.985;         // a round that leaves more than this of the count or error is the last
constexpr double worth_much = 0.96;        // the same where rounds are slow
constexpr int patience = 3;                // rounds that bring nothing
constexpr int certificates = 10;
constexpr double hopeless = 2;          // times the limit: more shells will not mend it
constexpr double worth_a_search = 1.5;  // tolerances: error of as many shells as are allowed
constexpr int local_mending = 3;        // certificates, before less error is asked for everywhere
constexpr double most_tightening = 0.95, least_tightening = 0.985;  // of the limit, where certificates find more
constexpr std::array<double, 6> parts_of_tolerance{0.95, 0.9, 0.8, 0.65, 0.5, 0.25};  // to part sheets that cross
constexpr double good_enough_angle = 0.9;                                             // of the limit
constexpr std::array<double, 2> narrow_angles{10, 5};                                 // degrees: of shells there
constexpr std::size_t price_of_an_angle_asked_for = 1000;                             // shells
constexpr double most_by_exchanges = 2;                                               // times fewer shells
constexpr std::size_t many = 600;               // shells: exchanging pieces of more takes long
constexpr std::size_t too_many = 6000;          // shells: of more no condensed mesh was tried
constexpr std::size_t coarse_target = 500;      // triangles per shell
constexpr double expected_by_condensing = 0.7;  // of the shells
constexpr double much_effort = 1;               // above: it is done all the same
constexpr double worth_narrow = 0.75;           // of the shells with better angles

class Fitting {
public:
  Fitting(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options)
      : Fitting(coarse, target, options, width_for(target, options)) {}

  RelaxResult run() {
    const std::optional<std::size_t> most = options_.shells ? options_.shells : options_.max_shells;
    if (!options_.tolerance) {
      fit_to_count(task(), most.value_or((options_.refine ? 4 : 1) * coarse_.triangles.size()), result_);
      return std::move(result_.found);
    }
    if (options_.refine && coarse_refined(*options_.tolerance, most.value_or(max_index))) {
      result_.found.reached = true;
      result_.found.stopped = "the tolerance holds";
      return std::move(result_.found);
    }
    if (most) {
      fit_to_count(task(), *most, result_);
      if (result_.found.distance.upper() <= worth_a_search * *options_.tolerance) {
        take_fewest(*most);
      }
    } else {
      to_tolerance(*options_.tolerance);
      part_sheets(max_index);
    }
    result_.found.reached = result_.found.distance.upper() <= *options_.tolerance;
    result_.found.stopped = *result_.found.reached ? "the tolerance holds" : "closer shells were not found";
    return std::move(result_.found);
  }

private:
  /// @param angle  degrees, instead of 20 or what was asked for; @param real  see FitResult
  Fitting(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options, double width,
          std::optional<double> angle = {}, const Target* real = nullptr)
      : coarse_(coarse),
        target_(target),
        real_(real != nullptr ? *real : target),
        options_(options),
        angle_(angle.value_or(options.min_angle.value_or(FitLimits{}.angle))),
        like_target_(same_topology(coarse, target)),
        result_(target, options, width, like_target_, real) {}

  static double width_for(const Target& target, const RelaxOptions& options) {
    const double width = options.width.value_or(default_width * target.diagonal());
    return options.tolerance ? std::min(width, *options.tolerance / 20) : width;
  }

  /// The result of a search without regard to how many shells there may be, where these are so few.
  void take_fewest(std::size_t most) {
    Fitting fewest(coarse_, target_, options_);
    fewest.to_tolerance(*options_.tolerance);
    fewest.part_sheets(most);
    RelaxResult& found = fewest.result_.found;
    result_.add_iterations(found.iterations);
    const bool held = result_.holds(*options_.tolerance);
    const std::size_t enough = held ? result_.found.shell.triangles.size() - 1 : most;
    if (found.distance.upper() <= *options_.tolerance && found.shell.triangles.size() <= enough) {
      result_.take(std::move(found.shell), found.distance);
    }
  }

  /// Where sheets of the target are closer to each other than the tolerance, patches may cross that nothing parts any
  /// more. A somewhat smaller error is another search, a much smaller one parts them where they have room.
  void part_sheets(std::size_t most) {
    std::size_t crossings = crossing_shells(result_.found.shell).size();
    if (crossings == 0 || count_self_intersections(target_.mesh()) > 0) {
      return;
    }
    double angle = min_angle_degrees(flat_facets(result_.found.shell));
    for (const double part : parts_of_tolerance) {
      Fitting closer(coarse_, target_, options_);
      closer.to_tolerance(part * *options_.tolerance);
      const std::size_t left = crossing_shells(closer.result_.found.shell).size();
      const double its_angle = std::min(min_angle_degrees(flat_facets(closer.result_.found.shell)), angle_);
      const bool better = left < crossings || (left == 0 && its_angle > angle);
      if (better && closer.result_.found.shell.triangles.size() <= most &&
          closer.result_.found.distance.upper() <= *options_.tolerance) {
        result_.take(std::move(closer.result_.found.shell), closer.result_.found.distance);
        crossings = left;
        angle = its_angle;
      }
      if (crossings == 0 && angle >= good_enough_angle * angle_) {
        return;
      }
    }
  }

  /// Pieces are fitted together, and one by one where all together get no further than flat facets. Crumbs stay flat.
  void to_tolerance(double tolerance) {
    std::vector<TriangleMesh> parts;
    if (like_target_) {
      parts = parts_of(target_.mesh(), target_.across());
    }
    if (parts.size() <= 1) {
      whole_to_tolerance(tolerance);
      return;
    }
    std::vector<Fitted> done;
    std::vector<TriangleMesh> rest;
    for (TriangleMesh& part : parts) {
      if (auto crumb = flat_crumb(part, tolerance)) {
        done.push_back(std::move(*crumb));
      } else {
        rest.push_back(std::move(part));
      }
    }
    const std::size_t crumbs = done.size();
    if (!rest.empty() && !fit_part(crumbs == 0 ? target_.mesh() : joined(rest), tolerance, done) && rest.size() > 1) {
      done.resize(crumbs);
      for (const TriangleMesh& part : rest) {
        fit_part(part, tolerance, done);
      }
    }
    join(done, tolerance);
  }

  struct Fitted {
    ShellMesh shell;
    ShellDistance distance;  ///< to its part of the target
  };

  /// A part that is so small that flat facets serve it, boundaries included.
  [[nodiscard]] std::optional<Fitted> flat_crumb(const TriangleMesh& part, double tolerance) const {
    const auto crumb = crumb_within(part, tolerance, angle_);
    if (!crumb) {
      return {};
    }
    const Target target(part);
    ShellMesh shell = flat_shells(*crumb, options_.surface);
    const ShellDistance distance = FitResult(target, options_, result_.width(), true).distance_of(shell);
    return distance.upper() <= tolerance ? std::optional(Fitted{std::move(shell), distance}) : std::nullopt;
  }

  /// @return whether it became curved
  bool fit_part(const TriangleMesh& part, double tolerance, std::vector<Fitted>& done) {
    const Target target(part);
    RelaxOptions one_patch = options_;
    one_patch.either_surface = false;
    Fitting fitting(part, target, one_patch, result_.width());
    fitting.whole_to_tolerance(tolerance);
    RelaxResult& fitted = fitting.result_.found;
    result_.add_iterations(fitted.iterations);
    done.push_back({std::move(fitted.shell), fitted.distance});
    return !fitting.result_.is_flat();
  }

  /// Takes all parts as the result when that is better. What is certain of each part is so of all together.
  void join(const std::vector<Fitted>& parts, double tolerance) {
    std::vector<ShellMesh> shells;
    ShellDistance most;
    const auto raise = [](double& upper, double by) { upper = std::max(upper, by); };
    for (const Fitted& part : parts) {
      shells.push_back(part.shell);
      raise(most.both.upper, part.distance.both.upper);
      raise(most.shell_to_target.upper, part.distance.shell_to_target.upper);
      raise(most.target_to_shell.upper, part.distance.target_to_shell.upper);
    }
    ShellMesh shell = joined(shells);
    ShellDistance distance = result_.distance_of(shell);
    lower_uppers(distance, most.both, most.shell_to_target, most.target_to_shell);
    const bool held = result_.holds(tolerance);
    const bool better =
        held ? distance.upper() <= tolerance && shell.triangles.size() < result_.found.shell.triangles.size()
             : result_.is_empty() || distance.upper() < result_.found.distance.upper();
    if (better) {
      result_.take(std::move(shell), distance);
    }
  }

  void whole_to_tolerance(double tolerance) {
    const auto stand_in = like_target_ ? stand_in_for(target_, stand_in_error * tolerance) : std::nullopt;
    const FitStart start = stand_in ? by_stand_in(*stand_in, tolerance) : fewest_to_tolerance(tolerance);
    result_.no_worse_than_flat(tolerance, max_index, start);
  }

  /// Fits what stands in for the target, closer by what is between the two, and mends what is too far from the target
  /// itself. @return the start of the search
  FitStart by_stand_in(const FitStart& stand_in, double tolerance) {
    const Target target(stand_in.mesh);
    Fitting fitting(target.mesh(), target, options_, result_.width(), angle_, &target_);
    FitStart start = fitting.fewest_to_tolerance(tolerance - stand_in.flat_error);
    result_.add_iterations(fitting.result_.found.iterations);
    const ShellMesh& shell = fitting.result_.found.shell;
    if (shell.triangles.empty()) {
      return fewest_to_tolerance(tolerance);
    }
    const ShellDistance distance = result_.distance_of(shell, tolerance);
    if (distance.upper() <= tolerance) {
      result_.take(shell, distance);
      return start;
    }
    if (!fitting.result_.mesh()) {
      return fewest_to_tolerance(tolerance);
    }
    FitSamples samples(target_, guess(static_cast<double>(shell.triangles.size())), like_target_);
    FitState state(samples, *fitting.result_.mesh(), limits());
    state.attach();
    state.measure();
    regains(samples, state, margin * tolerance);
    make_certain(samples, state, tolerance, most_for(start, tolerance));
    return start;
  }

  /// Flat errors fall as 1 / count. Where curved shells need as many, flat facets are the answer.
  [[nodiscard]] std::size_t most_for(const FitStart& start, double tolerance) const {
    const double flat_count = static_cast<double>(start.mesh.triangles.size()) * start.flat_error / tolerance;
    return options_.min_angle ? max_index : static_cast<std::size_t>(std::clamp(flat_count, 64.0, 1e9));
  }

  /// @return the start of the search; none is made where that has nearly as many triangles as the target
  FitStart fewest_to_tolerance(double tolerance) {
    FitStart start = like_target_ ? start_of_fit(target_, start_error * tolerance, few, finer_start_error * tolerance)
                                  : start_as_given(coarse_, target_);
    if (!start.own_topology && static_cast<double>(start.mesh.triangles.size()) >
                                   limited_by_target * static_cast<double>(target_.mesh().triangles.size())) {
      return start;
    }
    if (const std::size_t most = most_for(start, tolerance); !options_.min_angle && is_of_needles(start.mesh)) {
      long_shells(start, tolerance, most);
    } else {
      search_from(start, tolerance, most);
    }
    return start;
  }

  /// Shells as long as decimation's needles where that saves many; watertight ones where either patch will do.
  void long_shells(const FitStart& start, double tolerance, std::size_t most) {
    RelaxOptions watertight = options_;
    watertight.surface = Patch::watertight;
    std::vector<const RelaxOptions*> patches{&options_};
    if (options_.either_surface) {
      patches.push_back(&watertight);
    }
    std::vector<RelaxResult> narrow;
    std::size_t fewest = max_index;
    for (const RelaxOptions* options : patches) {
      for (const double angle : narrow_angles) {
        Fitting fitting(coarse_, target_, *options, result_.width(), angle);
        fitting.search_from(start, tolerance, most);
        result_.add_iterations(fitting.result_.found.iterations);
        if (fitting.result_.holds(tolerance)) {
          fewest = std::min(fewest, fitting.result_.found.shell.triangles.size());
          narrow.push_back(std::move(fitting.result_.found));
        }
      }
    }
    search_from(start, tolerance, most, static_cast<double>(fewest) / worth_narrow);
    for (RelaxResult& found : narrow) {
      if (!result_.holds(tolerance) || is_worth_its_angles(found.shell, result_.found.shell)) {
        result_.take(std::move(found.shell), found.distance);
      }
    }
  }

  /// Narrow shells save a quarter, or where there are narrow ones already any by which another patch needs fewer.
  [[nodiscard]] bool is_worth_its_angles(const ShellMesh& narrow, const ShellMesh& now) const {
    const bool is_narrow = min_angle_degrees(flat_facets(now)) < good_enough_angle * angle_;
    if (is_narrow && narrow.patch != now.patch) {
      return narrow.triangles.size() < now.triangles.size();
    }
    return static_cast<double>(narrow.triangles.size()) <= worth_narrow * static_cast<double>(now.triangles.size());
  }

  /// The fewest shells found within the tolerance, from one decimation of the target or several.
  /// @param wanted  shells: of many more none are exchanged
  void search_from(const FitStart& start, double tolerance, std::size_t most, double wanted = max_index) {
    FitSamples samples(target_, guess(start.mesh.triangles.size() / expected_gain), like_target_);
    const double limit = margin * tolerance;
    const bool several = !start.own_topology && start.mesh.triangles.size() < affordable;
    std::vector<FitState> found{search(samples, start, tolerance, most, several ? search_patience : 1)};
    if (several) {
      // A greedy search ends elsewhere from elsewhere: from few and from well-shaped triangles.
      const FitStart fewer = start_of_fit(target_, start_error * tolerance, 0, 0);
      for (const FitStart& other : {fewer, well_shaped(fewer, tolerance), well_shaped(start, tolerance)}) {
        found.push_back(search(samples, other, tolerance, most, search_patience));
      }
    }
    const auto worse = [&](const FitState& a, const FitState& b) {
      const bool fits_a = a.error() <= limit, fits_b = b.error() <= limit;
      return fits_a != fits_b ? fits_b : price(a) > price(b);
    };
    std::stable_sort(found.begin(), found.end(), [&](const FitState& a, const FitState& b) { return worse(b, a); });
    for (FitState& state : found) {
      state.attach();
      state.measure();
      if (state.error() > limit && result_.holds(tolerance)) {
        break;
      }
      if (state.error() > hopeless * limit) {
        result_.certify(state, tolerance);
        continue;
      }
      if (join_normals(state, limit) > 0) {
        state.attach();
        state.measure();
      }
      bool holds = regains(samples, state, limit);
      for (int i = 0; i < local_mending && !holds; ++i) {
        // Shells that are in the way may be exchanged later, what does not hold may not.
        split_worst(state, worth_it * limit, 1);
        repair(state, limit, most);
        mend_angles(state, limit);
        holds = regains(samples, state, limit);
      }
      const bool condensing = holds && options_.effort > 0 && state.mesh.alive > many && state.mesh.alive <= too_many;
      const bool condensed = condensing && becomes_condensed(samples, state, tolerance, most);
      if (holds && !condensed) {
        part_crossings(state, limit, most);
        squeeze(samples, state, limit);
      }
      const std::size_t thin = options_.min_angle ? 0 : count_thin(state);
      bool certain = condensed || shape_and_certify(samples, state, tolerance, most);
      if (holds && static_cast<double>(state.mesh.alive) < most_by_exchanges * wanted &&
          worth_exchanging(state.mesh.alive, condensed)) {
        // What is exchanged is certified where it changes: all is certain if it was so before.
        exchange_pieces(samples, state, exchanging(limit, tolerance));
        result_.note(state);
        certain = shape_and_certify(samples, state, tolerance, most) || certain;
      }
      // What the certificate asked for may have made triangles thin: then the next best is looked at as well.
      if (certain && count_thin(state) <= thin) {
        break;
      }
    }
  }

  /// In the whole: condensed meshes of many shells were exchanged within pieces.
  [[nodiscard]] bool worth_exchanging(std::size_t shells, bool condensed) const {
    return shells <= many || (!condensed && shells <= affordable && is_affordable_for(shells));
  }

  /// Exchanges: looking at the target costs little for so many shells, or may cost more.
  [[nodiscard]] bool is_affordable_for(std::size_t shells) const {
    return real_.mesh().triangles.size() < coarse_target * shells || options_.effort > much_effort;
  }

  /// @return whether the tolerance holds for what it became; else it is as it was
  bool becomes_condensed(FitSamples& samples, FitState& state, double tolerance, std::size_t most) {
    const std::vector<SamplePoint> points = samples.points();
    const int rounds = static_cast<int>(std::ceil(options_.effort * usual_condensing));
    FitState trial = state;
    CondenseOptions condensing{margin * tolerance, options_.kink,
                               std::min(rounds, options_.max_iterations.value_or(rounds))};
    const auto expected = static_cast<std::size_t>(expected_by_condensing * static_cast<double>(state.mesh.alive));
    condensing.exchanging = expected > many && is_affordable_for(expected) ? options_.effort : 0;
    condensing.progress = options_.progress;
    const auto is_sound = [&] { return count_thin(trial) == 0 && crossing_shells(trial.mesh.shell()).empty(); };
    if (condense_certainly(samples, trial, result_, tolerance, condensing) &&
        (is_sound() || shape_and_certify(samples, trial, tolerance, most))) {
      state = std::move(trial);
      return true;
    }
    samples.take_points(points);
    state.attach();
    state.measure();
    return false;
  }

  ExchangeOptions exchanging(double limit, double tolerance) {
    ExchangeOptions out{limit, tolerance, options_.kink};
    out.effort = options_.effort;
    out.rounds = options_.max_iterations.value_or(out.rounds);
    out.on_better = [&](const FitState& state) { result_.note(state); };
    out.progress = options_.progress;
    return out;
  }

  /// As many triangles of the target with better angles; where angles were asked for, as many as these take.
  [[nodiscard]] FitStart well_shaped(const FitStart& start, double tolerance) const {
    DecimateOptions decimating;
    if (options_.min_angle) {
      decimating.max_error = std::max(start.flat_error, tolerance);
    } else {
      decimating.triangles = start.mesh.triangles.size();
    }
    decimating.min_angle = angle_;
    return {decimate(target_.mesh(), decimating).mesh, start.flat_error, false};
  }

  /// The fewest shells found from one start, by collapses, steps of all nodes and splits in turn.
  /// @param patience_left  rounds that leave as many shells
  FitState search(FitSamples& samples, const FitStart& start, double tolerance, std::size_t most, int patience_left) {
    FitState state(samples, prepared(start), limits());
    smooth(state, tolerance, tolerance);
    // Condensing many shells does more than further rounds.
    const bool once = options_.effort > 0 && state.mesh.alive > affordable && state.mesh.alive <= 3 * too_many / 2;
    const int rounds = options_.max_iterations.value_or(once ? 1 : default_rounds);
    const double limit = margin * tolerance;
    repair(state, limit, most);
    mend_angles(state, limit);
    FitState best = state;
    int fruitless = 0;
    for (int round = 0; round < rounds && fruitless < patience_left; ++round) {
      advance(options_.progress, static_cast<double>(round) / rounds);
      const std::size_t before = state.mesh.alive;
      collapse_edges(state, limit, 4, {});
      if (add_missed(samples, state, limit) > 0) {
        best.attach();  // which may have looked good to fewer samples
        best.measure();
      }
      state.attach();
      state.measure();
      polish(state, limit, 3);
      repair(state, limit, most);
      mend_angles(state, limit);
      if (round == 0 || target_.mesh().triangles.size() < dense * state.mesh.alive) {
        result_.note(state);
      }
      const bool fits = state.error() <= limit;
      const double worth = state.mesh.alive > affordable ? worth_much : worth_it;
      fruitless = static_cast<double>(state.mesh.alive) > worth * static_cast<double>(before) ? fruitless + 1 : 0;
      const bool best_fits = best.error() <= limit;
      if (fits ? !best_fits || price(state) < price(best) : !best_fits && state.error() < best.error()) {
        best = state;
      }
    }
    return best;
  }

  /// COARSE's triangles, placed anew, and split where they are too far off. @return whether the tolerance holds
  bool coarse_refined(double tolerance, std::size_t most) {
    const FitStart start{coarse_, 0, true};
    FitSamples samples(target_, guess(static_cast<double>(coarse_.triangles.size())), like_target_);
    FitState state(samples, prepared(start), limits());
    smooth(state, tolerance, tolerance);
    const double limit = margin * tolerance;
    polish(state, limit, 3);
    if (add_missed(samples, state, limit) > 0) {
      state.attach();
      state.measure();
    }
    repair(state, limit, most);
    mend_angles(state, limit);
    result_.note(state);
    return make_certain(samples, state, tolerance, most);
  }

  bool shape_and_certify(FitSamples& samples, FitState& state, double tolerance, std::size_t most) {
    shape_up(samples, state, margin * tolerance, most);
    return make_certain(samples, state, tolerance, most);
  }

  /// What the samples miss is found, added to them, and mended. @return whether the tolerance holds
  bool make_certain(FitSamples& samples, FitState& state, double tolerance, std::size_t most) {
    double limit = margin * tolerance;
    int stuck = 0;
    bool held = false;
    for (int i = 0; i < certificates; ++i) {
      part_crossings(state, limit, most);
      if (result_.certify(state, tolerance)) {
        // Better angles are another mesh to be made certain; the result is kept meanwhile.
        held = true;
        if (count_thin(state) == 0) {
          return true;
        }
        FitState shaped = state;
        shape_up(samples, shaped, limit, most);
        if (price(shaped) >= price(state)) {
          return true;
        }
        state = std::move(shaped);
        if (result_.certify(state, tolerance)) {
          return true;
        }
      }
      const double before = state.error();
      // What more samples alone do not mend gets more shells.
      const std::size_t added = add_missed(samples, state, limit, true);
      for (const SamplePoint& point : result_.farthest()) {
        samples.add(point);
      }
      if (regains_with_few(samples, state, limit, most)) {
        continue;
      }
      if (i >= local_mending) {
        // Of what is not seen only less error helps.
        limit *= std::clamp(tolerance / result_.least_distance(), most_tightening, least_tightening);
      }
      if (i > 0 || added == 0) {
        split_worst(state, 0.985 * tolerance, state.mesh.alive);
      }
      state.attach();
      state.measure();
      polish(state, limit, 2);
      repair(state, limit, most);
      mend_angles(state, limit);
      for (int look = 0; look < patience && add_missed(samples, state, limit) > 0; ++look) {
        state.attach();
        state.measure();
        polish(state, limit, 1);
        repair(state, limit, most);
        mend_angles(state, limit);
      }
      stuck = state.error() > 0.999 * before && state.error() > limit ? stuck + 1 : 0;
      if (state.error() > hopeless * limit || stuck == patience) {
        return result_.certify(state, tolerance) || held;  // a place that more shells do not mend
      }
    }
    return held;
  }

  [[nodiscard]] FitTask task() const { return {coarse_, target_, options_, like_target_, limits()}; }

  [[nodiscard]] FitLimits limits() const {
    FitLimits out;
    out.angle = angle_;
    out.price_of_a_thin_one = options_.min_angle ? price_of_an_angle_asked_for : out.price_of_a_thin_one;
    return out;
  }

  [[nodiscard]] FitMesh prepared(const FitStart& start) const { return task().prepared(start); }

  static std::size_t guess(double shells) { return FitTask::samples_for(shells); }

  const TriangleMesh& coarse_;
  const Target& target_;
  const Target& real_;  // what it stands for
  const RelaxOptions& options_;
  double angle_;      // degrees
  bool like_target_;  // COARSE has the target's topology
  FitResult result_;
};

}  // namespace

RelaxResult fit(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options) {
  return Fitting(coarse, target, options).run();
}

}  // namespace tunica
