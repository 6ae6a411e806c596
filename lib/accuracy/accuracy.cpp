#include "tunica/accuracy/accuracy.hpp"

#include "tunica/accuracy/detail/levels.hpp"
#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/shell/distance/shell_distance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t fewest_levels = 3;       // two changes: one may be small by chance
constexpr double left_by_second_order = 0.25;  // of the change before
constexpr double linear_share = 0.25;          // of the request: what the linear model may be off by
constexpr double solver_share = 0.01;          // of the request: where a looser solver ends
constexpr double fewest_edges_per_layer = 2;   // below, stresses in it are a tenth off and more
constexpr double largest_field_change = 4;     // estimates: the field's error is the scalar's, within that

constexpr std::array<std::pair<std::string_view, std::string_view>, 4> names{
    {{"displacement", "mm"}, {"energy", "mJ"}, {"volume", "mm^3"}, {"stress", "MPa"}}};

double value_of(const Model& model, const State& state, const Summary& summary, Quantity of) {
  switch (of) {
    case Quantity::displacement:
      return largest_displacement(model, state);
    case Quantity::energy:
      return state.strain_energy;
    case Quantity::volume:
      if (!state.volume || !summary.volume_before) {
        throw InputError(
            fmt::format("{}: is open and encloses no volume: ask for another quantity", model.shells.front().name));
      }
      return *state.volume - *summary.volume_before;
    case Quantity::stress:
      return element_fields(model, state).wall.stress_p99;
  }
  throw InternalError("a quantity without a rule");
}

/// The answer of one mesh by one model.
struct Answer {
  Model model;
  Summary summary;
  std::vector<State> states;
  double value = 0;
  double seconds = 0;  // of the solve
};

class Ladder {
public:
  Ladder(ShellBody body, const Target* target, const AccuracyRequest& request, const RunSettings& settings,
         const ModelOf& model_of, const std::function<void(const AccuracyLevel&)>& on_level)
      : body_(std::move(body)),
        target_(target),
        request_(request),
        settings_(settings),
        model_of_(model_of),
        on_level_(on_level),
        may_be_linear_(!std::get<StaticRun>(settings.kind).linear) {
    settings_.converge = std::min(settings_.converge, solver_share * request.within);
    out_.request = request;
    out_.not_included = {"segmentation", "material", "thickness"};
    if (target == nullptr) {
      out_.not_included.insert(out_.not_included.begin(), "geometry");
    }
  }

  Accuracy run() {
    auto start = Clock::now();
    for (;;) {
      std::optional<Answer> answer = tried();
      if (answer) {
        take(*std::move(answer), seconds_since(start));
        if (judged()) {
          break;
        }
      }
      if (4 * body_.mesh.triangles.size() > request_.max_shells) {
        give_up();
        break;
      }
      start = Clock::now();
      ShellBody fine = finer_level(body_, target_, parents_);
      if (last_) {
        near_ = interpolated(last_->states.back(), body_, fine, parents_);
      }
      body_ = std::move(fine);
    }
    tell_choices();
    out_.settings = settings_;
    out_.model = std::move(last_->model);
    out_.summary = std::move(last_->summary);
    out_.states = std::move(last_->states);
    return std::move(out_);
  }

private:
  Answer solved(const RunSettings& settings) const {
    Answer answer;
    answer.model = model_of_(body_);
    const auto start = Clock::now();
    Resumption resumption;
    resumption.near = near_;
    answer.summary = solve(
        answer.model, settings, [&](const State& state) { answer.states.push_back(state); }, {}, resumption);
    answer.seconds = seconds_since(start);
    answer.value = value_of(answer.model, answer.states.back(), answer.summary, request_.of);
    if (!(std::abs(answer.value) > 0)) {
      throw InputError(fmt::format("{}: the quantity asked for is zero: no part of it can be kept within",
                                   answer.model.shells.front().name));
    }
    return answer;
  }

  /// A mesh may be too coarse for any state; the next finer one begins anew.
  std::optional<Answer> tried() {
    try {
      return solved(settings_);
    } catch (const RequirementError&) {
      if (4 * body_.mesh.triangles.size() > request_.max_shells) {
        throw;
      }
      out_.levels.clear();
      out_.estimate.reset();
      last_.reset();
      near_.reset();
      return std::nullopt;
    }
  }

  void take(Answer&& answer, double seconds) {
    AccuracyLevel level{body_.mesh.triangles.size(), answer.value, seconds, {}, answer.summary.newton_iterations};
    if (target_ != nullptr) {
      level.mean_distance = mean_distance(body_.mesh, *target_).first;
    }
    out_.levels.push_back(level);
    field_change_ = last_ ? field_change(last_->states.back(), answer.states.back()) : infinity;
    last_ = std::move(answer);
    if (may_be_linear_ && out_.levels.size() == fewest_levels - 1) {
      compare_linear();
    }
    if (on_level_) {
      on_level_(out_.levels.back());
    }
  }

  void compare_linear() {
    RunSettings linear = settings_;
    std::get<StaticRun>(linear.kind).linear = true;
    try {
      Answer other = solved(linear);
      linear_error_ = std::abs(other.value / last_->value - 1);
      seconds_linear_ = other.seconds;
      seconds_nonlinear_ = last_->seconds;
      if (linear_error_ < linear_share * request_.within) {
        settings_ = linear;
        out_.levels.back().value = other.value;
        last_ = std::move(other);
      }
    } catch (const RequirementError&) {
      linear_error_ = infinity;
    }
  }

  [[nodiscard]] bool is_linear() const { return std::get<StaticRun>(settings_.kind).linear; }

  /// Whether the last level is accepted.
  bool judged() {
    const std::size_t n = out_.levels.size();
    if (n < fewest_levels) {
      return false;
    }
    const auto change = [&](std::size_t level) {
      return std::abs(out_.levels[level].value - out_.levels[level - 1].value) / std::abs(out_.levels[n - 1].value);
    };
    out_.estimate = std::max(change(n - 1), left_by_second_order * change(n - 2)) +
                    (may_be_linear_ && is_linear() ? linear_error_ : 0) + last_->summary.algebraic_error.value_or(0);
    doubt();
    return *out_.estimate < request_.within && out_.reasons.empty();
  }

  void doubt() {
    out_.reasons.clear();
    const double allowed = largest_field_change * std::max(*out_.estimate, request_.within);
    if (request_.of == Quantity::displacement && field_change_ > allowed) {
      out_.reasons.push_back(fmt::format(
          "the largest displacement changed little, but displacements elsewhere by {:.2g} %", 100 * field_change_));
    }
    if (request_.of == Quantity::stress) {
      const double edges = edges_per_layer(last_->model);
      if (edges < fewest_edges_per_layer) {
        out_.reasons.push_back(
            fmt::format("the bending layer at supports and rims, sqrt(R t) / 1.24 wide, is {:.2g} "
                        "edges wide at its coarsest place, {:g} are needed",
                        edges, fewest_edges_per_layer));
      }
    }
    if (last_->summary.stiffened_from) {
      out_.reasons.emplace_back("waves as short as the shells were made stiff: the mesh is coarse for so thin a wall");
    }
    if (!last_->summary.snaps.empty()) {
      out_.reasons.emplace_back("the shell snaps through on its way: where it rests then may depend on the mesh");
    }
  }

  void give_up() {
    const std::size_t shells = body_.mesh.triangles.size();
    out_.reasons.push_back(
        out_.estimate ? fmt::format("the error is estimated at {:.2g} % with {} shells, and the next level would have "
                                    "{}, more than {}",
                                    100 * *out_.estimate, shells, 4 * shells, request_.max_shells)
                      : fmt::format("an estimate takes {} levels, and {} shells are followed by {}, more than {}",
                                    fewest_levels, shells, 4 * shells, request_.max_shells));
  }

  void tell_choices() {
    const std::size_t n = out_.levels.size();
    const AccuracyLevel& last = out_.levels.back();
    const std::optional<double>& estimate = out_.estimate;
    out_.choices.push_back({"shells", std::to_string(last.shells), estimate, fmt::format("{} shells", 4 * last.shells),
                            fmt::format("about {:.2g} s more", 4 * last.seconds)});
    if (n > 1) {
      out_.choices.push_back(
          {"shells", std::to_string(last.shells), estimate, fmt::format("{} shells", out_.levels[n - 2].shells),
           fmt::format("an error of {:.2g} %", 100 * std::abs(out_.levels[n - 2].value / last.value - 1))});
    }
    if (may_be_linear_ && seconds_nonlinear_ > 0) {
      out_.choices.push_back(
          is_linear() ? AccuracyChoice{"model", "linear", linear_error_, "nonlinear",
                                       fmt::format("{:.2g} times the time", seconds_nonlinear_ / seconds_linear_)}
                      : AccuracyChoice{"model", "nonlinear", 0, "linear",
                                       fmt::format("an error of {:.2g} %", 100 * linear_error_)});
    }
  }

  ShellBody body_;
  const Target* target_;
  const AccuracyRequest& request_;
  RunSettings settings_;
  const ModelOf& model_of_;
  const std::function<void(const AccuracyLevel&)>& on_level_;
  const bool may_be_linear_;  // the scene leaves the choice
  Accuracy out_;
  std::vector<std::array<Index, 2>> parents_;
  std::optional<Checkpoint> near_;
  std::optional<Answer> last_;
  double field_change_ = infinity;
  double linear_error_ = infinity, seconds_linear_ = 0, seconds_nonlinear_ = 0;
};

}  // namespace

std::string_view name_of(Quantity quantity) { return names.at(static_cast<std::size_t>(quantity)).first; }
std::string_view unit_of(Quantity quantity) { return names.at(static_cast<std::size_t>(quantity)).second; }

Accuracy solve_within(ShellBody body, const Target* target, const AccuracyRequest& request, const RunSettings& settings,
                      const ModelOf& model_of, const std::function<void(const AccuracyLevel&)>& on_level) {
  return Ladder(std::move(body), target, request, settings, model_of, on_level).run();
}

}  // namespace tunica
