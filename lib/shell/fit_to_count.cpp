#include "shell/fit_to_count.hpp"

#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_polish.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_worst.hpp"

#include <limits>

namespace tunica {
namespace {

constexpr double start_surplus = 1.5;  // triangles of the start per shell wanted
constexpr std::array<double, 2> other_surpluses{1.25, 2.0};
constexpr std::size_t few_shells = 400;   // wanted: several starts cost little
constexpr std::size_t affordable = 1300;  // of rough targets likewise
constexpr int default_rounds = 8;
constexpr int patience = 3;          // rounds that bring nothing
constexpr double worth_it = 0.985;   // a round that leaves more than this of the error brings nothing
constexpr double mistrusted = 1.15;  // times the samples' error: a certified one that they missed
constexpr int rough_certificates = 3;
constexpr double worth_mending = 0.97;  // of the certified distance, by what it missed
constexpr int most_settling = 20, some_settling = 4;

class CountSearch {
public:
  CountSearch(const FitTask& task, FitResult& result) : task_(task), result_(result) {}

  void run(std::size_t shells) {
    const bool all = shells >= task_.target.mesh().triangles.size();
    const auto start_for = [&](double triangles) {
      return task_.like_target ? start_of_fit(task_.target, static_cast<std::size_t>(triangles))
                               : start_as_given(task_.coarse, task_.target);
    };
    const auto wanted = static_cast<double>(shells);
    const FitStart start = start_for(all ? wanted : start_surplus * wanted);
    if (all && !start.own_topology) {
      result_.found.stopped = "the target has no more triangles than shells are allowed";
      result_.no_worse_than_flat({}, shells, start);
      return;
    }
    FitSamples samples(task_.target, FitTask::samples_for(wanted), task_.like_target);
    FitState best = settled(samples, start, shells);
    // A greedy search ends elsewhere from elsewhere, with few shells or on rough targets by much.
    const bool worth_exchanging = shells < few_shells || is_uneven(best);
    std::vector<double> surpluses;
    if (worth_exchanging && shells < affordable && !start.own_topology) {
      surpluses.assign(other_surpluses.begin(), other_surpluses.end());
    }
    const double part = 1.0 / static_cast<double>(1 + surpluses.size());
    const int rounds = task_.options.max_iterations.value_or(worth_exchanging ? default_rounds : 1);
    bool exhausted = exchange(best, shells, rounds, {0, part});
    for (std::size_t i = 0; i < surpluses.size(); ++i) {
      FitState state = settled(samples, start_for(surpluses[i] * wanted), shells);
      const double begin = part * static_cast<double>(i + 1);
      const bool its_exhausted = exchange(state, shells, rounds, {begin, begin + part});
      if (state.mesh.alive <= shells && (state.error() < best.error() || best.mesh.alive > shells)) {
        best = std::move(state);
        exhausted = its_exhausted;
      }
    }
    // What samples missed is worth a few more certificates and rounds where the target is rough.
    double known = std::numeric_limits<double>::infinity();
    for (int i = 0; i < rough_certificates; ++i) {
      part_crossings(best, best.error(), shells);
      result_.certify(best, std::nullopt);
      const double now = result_.found.distance.both.lower;
      if (now <= mistrusted * best.error() || now > worth_mending * known ||
          add_missed(samples, best, best.error(), true) == 0) {
        break;
      }
      known = now;
      best.attach();
      best.measure();
      polish(best, best.error(), 3);
      if (!task_.options.max_iterations) {
        exhausted = exchange(best, shells, default_rounds, {part, 1});
      }
    }
    result_.record(result_.found.shell, result_.found.distance.both);
    result_.found.stopped = exhausted ? "further rounds bring too little" : "the limit of rounds was reached";
    result_.no_worse_than_flat({}, shells, start);
  }

private:
  /// So many shells from one start, all nodes settled.
  FitState settled(FitSamples& samples, FitStart start, std::size_t shells) const {
    FitState state(samples, task_.prepared(start), task_.limits);
    // Few shells for a rough target: normals of their own would fit its ripples, and stay.
    smooth(state, 0.1 * start.flat_error, 0.5 * start.flat_error);
    constexpr double any = std::numeric_limits<double>::infinity();
    collapse_edges(state, any, shells, {});
    if (state.mesh.alive > shells && !start.own_topology) {
      // So near the smallest mesh there is only decimation knows the way.
      start = start_of_fit(task_.target, shells);
      state = FitState(samples, task_.prepared(start), task_.limits);
      smooth(state, 0.1 * start.flat_error, 0.5 * start.flat_error);
    }
    settle(state, settling(shells));
    mend_angles(state, 0.97 * state.error());
    return state;
  }

  /// Exchanges shells between where they are hardly needed and where the error is largest, more or fewer in turn, as
  /// long as that brings the closest of so many closer.
  /// @param done  of the whole fit, before and after
  /// @return whether the last rounds brought nothing
  bool exchange(FitState& best, std::size_t shells, int rounds, const std::array<double, 2>& done) {
    int fruitless = 0;
    bool noted = false;
    for (int round = 1; round < rounds && fruitless < patience; ++round) {
      if (!noted) {
        result_.note(best);
        noted = true;
      }
      advance(task_.options.progress, done[0] + (done[1] - done[0]) * static_cast<double>(round) / rounds);
      FitState state = best;
      const double error = state.error();
      const std::array<std::size_t, 3> amounts{shells / 40, 1, shells / 15};
      split_worst(state, 0.7 * error, std::max<std::size_t>(1, amounts[static_cast<std::size_t>(fruitless) % 3]));
      polish(state, error, 1);
      collapse_edges(state, std::numeric_limits<double>::infinity(), shells, {});
      settle(state, settling(shells));
      const bool better = state.mesh.alive <= shells && (state.error() < best.error() || best.mesh.alive > shells);
      fruitless = better && state.error() < worth_it * best.error() ? 0 : fruitless + 1;
      if (better) {
        best = std::move(state);
        noted = false;
      }
    }
    return fruitless >= patience;
  }

  static int settling(std::size_t shells) { return shells < few_shells ? most_settling : some_settling; }

  const FitTask& task_;
  FitResult& result_;
};

}  // namespace

void fit_to_count(const FitTask& task, std::size_t shells, FitResult& result) { CountSearch(task, result).run(shells); }

}  // namespace tunica
