#include "tunica/accuracy/accuracy.hpp"

#include "tunica/accuracy/detail/answer.hpp"
#include "tunica/accuracy/detail/levels.hpp"
#include "tunica/accuracy/estimates.hpp"
#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/core/require.hpp"
#include "tunica/mechanics/model/selection.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/distance/shell_quality.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr std::size_t fewest_levels = 3;               // two changes: one may be small by chance
constexpr double model_share = 0.25;                   // of the request: what a cheaper model may be off by
constexpr std::size_t most_from_near = 5;              // iterations; more, and the start was none
constexpr double largest_distance = 0.5;               // of the wall, of any place: the middle lies in the wall
constexpr double cost_of_next = 5;                     // a level's time, of the one before
constexpr double settled_share = 0.1;                  // of the request: the last increment of Newton's method
constexpr double residual_share = 0.01;                // of the request: where a looser one was asked for
constexpr double fewest_edges_per_layer = 2;           // below, stresses in it are a tenth off and more
constexpr double largest_field_change = 4;             // estimates: the field's error is the scalar's, within that
constexpr double largest_bend = std::numbers::pi / 6;  // of a shell: strains within it are small below
/// Mean distance of an extracted surface to the true one, in voxels (docs/tables/staircase.md).
constexpr double voxels_off = 0.1;

/// What a load presses or a fix holds. It ends where triangles do, on every level within its border: what its part of
/// the area changed by is left, to first order, and costs an answer about as much.
struct Region {
  double part = 0;    ///< of the body's area
  double acting = 0;  ///< of the area, what acts: of a load that part, of a fix the rest
};

/// Those of pressures, beds and fixes, in their order.
std::vector<Region> regions_of(const Model& model) {
  std::vector<Region> regions;
  const auto look = [&](std::size_t body, const std::vector<double>& shares, bool is_load) {
    const ShellMesh& mesh = model.shells[body].mesh;
    double inside = 0, whole = 0;
    for (std::size_t t = 0; t < shares.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const double area = triangle_area(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
      whole += area;
      inside += shares[t] * area;
    }
    regions.push_back({inside / whole, is_load ? inside / whole : 1 - inside / whole});
  };
  for (const Load& load : model.loads) {
    const auto* const pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure != nullptr && !pressure->shares.empty() && load.body < model.shells.size()) {
      look(load.body, pressure->shares, true);
    }
  }
  for (const Support& support : model.supports) {
    if (!support.shares.empty()) {
      look(support.body, support.shares, true);
    }
  }
  for (const Fix& fix : model.fixes) {
    if (fix.body < model.shells.size()) {
      look(fix.body, whole_triangles(model.shells[fix.body].mesh.triangles, fix.nodes), false);
    }
  }
  return regions;
}

class Ladder {
public:
  Ladder(std::vector<ShellBody> bodies, const std::vector<const Target*>& targets, const AccuracyRequest& request,
         const RunSettings& settings, const ModelOf& model_of,
         const std::function<void(const AccuracyLevel&)>& on_level)
      : level_{std::move(bodies), {}},
        targets_(targets),
        request_(request),
        settings_(settings),
        model_of_(model_of),
        on_level_(on_level) {
    model_ = model_of_(level_.bodies);
    settings_.converge = std::min(settings_.converge, residual_share * request.within);
    out_.request = request;
    out_.not_included = {"segmentation", "material", "thickness"};
    if (std::find(targets.begin(), targets.end(), nullptr) != targets.end()) {
      out_.not_included.insert(out_.not_included.begin(), "geometry");
    }
    if (request.voxel) {
      out_.surface_error = voxels_off * *request.voxel;
    }
  }

  Accuracy run() {
    const auto begin = Clock::now();
    auto start = begin;
    for (;;) {
      std::optional<Answer> answer = try_level();
      if (answer) {
        take(*std::move(answer), seconds_since(start));
        if (judge() || model_error_ >= request_.within) {
          break;
        }
      } else if (last_) {
        break;
      }
      if (const std::string bound = passes_a_bound(seconds_since(begin)); !bound.empty()) {
        give_up(bound);
        break;
      }
      start = Clock::now();
      try {
        refine();
      } catch (const InputError& error) {  // shells that fold
        if (!ends_with_what_there_is(4 * level_.shell_count(), error.what())) {
          throw;
        }
        break;
      }
    }
    tell_choices();
    std::vector<Answers> answers;
    for (const AccuracyLevel& level : out_.levels) {
      answers.push_back(level.answers);
    }
    out_.estimates = estimates_of(
        answers,
        [&](const std::string& name) {
          const auto found = model_errors_.find(name);
          return error_besides(found == model_errors_.end() ? 0 : found->second);
        },
        is_doubtful_);
    out_.settings = settings_;
    out_.system = last_->system;
    out_.summary = std::move(last_->summary);
    out_.states = std::move(last_->states);
    return std::move(out_);
  }

private:
  void refine() {
    Level fine = finer_level(level_.bodies, targets_);
    near_.reset();
    if (last_ && near_serves_) {
      near_ = interpolated(last_->at, level_.bodies, fine);
    }
    Model model = model_of_(fine.bodies);
    carry_selections(model_, fine, model);
    level_ = std::move(fine);
    model_ = std::move(model);
    is_finer_ = true;
  }

  [[nodiscard]] const StaticRun* statics() const { return std::get_if<StaticRun>(&settings_.kind); }

  [[nodiscard]] Answer solved(const RunSettings& settings) const {
    Model model = model_;
    const bool is_static = std::holds_alternative<StaticRun>(settings.kind);
    if (is_static && motion_) {
      model = *at_its_end(model, motion_->duration);
    }
    RunSettings run = settings;
    run.settled = is_static ? settled_share * request_.within : 0;
    return answer_of(std::move(model), run, request_, is_static ? near_ : std::nullopt);
  }

  /// One of which a part can be asked for. Errors: InputError: it is zero.
  [[nodiscard]] Answer solve_for_answer(const RunSettings& settings) const {
    Answer answer = solved(settings);
    if (!(std::abs(answer.value) > 0)) {
      throw InputError(
          fmt::format("{}: the answer is zero here, so that its error in percent means nothing: ask for the accuracy "
                      "of another one (--of)",
                      model_.shells.front().name));
    }
    return answer;
  }

  /// The coarsest mesh may be too coarse for any state; of a finer one the model is to blame.
  std::optional<Answer> try_level() {
    try {
      if (std::holds_alternative<DynamicRun>(settings_.kind) && !motion_) {
        choose_run();
      }
      return solve_for_answer(settings_);
    } catch (const InputError& error) {  // shells that make no elements
      if (!ends_with_what_there_is(level_.shell_count(), error.what())) {
        throw;
      }
      return std::nullopt;
    } catch (const RequirementError& error) {
      if (ends_with_what_there_is(level_.shell_count(), error.what())) {
        return std::nullopt;
      }
      if (is_finer_ || 4 * level_.shell_count() > request_.max_shells) {
        throw;
      }
      if (on_level_) {
        AccuracyLevel level;
        level.shells = level_.shell_count();
        level.failure = error.what();
        on_level_(level);
      }
      return std::nullopt;
    }
  }

  /// Whether a level that has no answer ends the run with that of the level before: where the accuracy is an aim within
  /// a bound of time.
  bool ends_with_what_there_is(std::size_t shells, const std::string& why) {
    if (!last_ || !request_.max_seconds) {
      return false;
    }
    give_up(fmt::format("on {} shells there is no answer: {}", shells, why));
    return true;
  }

  void choose_run() {
    motion_ = std::get<DynamicRun>(settings_.kind);
    try {
      MotionChoice choice = choose_motion(settings_, model_share * request_.within, request_.within,
                                          at_its_end(model_, motion_->duration).has_value(),
                                          [&](const RunSettings& settings) { return solve_for_answer(settings); });
      settings_ = choice.settings;
      model_error_ = choice.error;
      model_errors_ = std::move(choice.errors);
      choices_ = std::move(choice.choices);
    } catch (...) {
      motion_.reset();
      throw;
    }
  }

  void take(Answer&& answer, double seconds) {
    AccuracyLevel level{level_.shell_count(), answer.value, seconds, {}, answer.summary.newton_iterations};
    level.answers = answer.all;
    for (std::size_t b = 0; b < level_.bodies.size(); ++b) {
      if (targets_[b] != nullptr) {
        level.mean_distance =
            std::max(level.mean_distance.value_or(0), mean_distance(level_.bodies[b].mesh, *targets_[b]).first);
      }
    }
    out_.levels.push_back(level);
    measure_borders();
    near_serves_ = near_serves_ && (!near_ || answer.summary.newton_iterations <= most_from_near);
    if (near_ && last_ && answer.summary.snaps.empty()) {  // it began beyond what the level before passed
      answer.summary.snaps = last_->summary.snaps;
    }
    field_change_ = last_ ? field_change(last_->at, answer.at, level_) : infinity;
    last_ = std::move(answer);
    if (statics() != nullptr && !statics()->linear && out_.levels.size() == fewest_levels - 1) {
      look_for_other_states();
      compare_linear();
    }
    if (on_level_) {
      on_level_(out_.levels.back());
    }
  }

  void measure_borders() {
    std::vector<Region> regions = regions_of(model_);
    border_error_ = 0;
    for (std::size_t i = 0; i < std::min(regions.size(), regions_.size()); ++i) {
      const double change = std::abs(regions[i].part - regions_[i].part);
      border_error_ = std::max(border_error_, regions[i].acting > 0 ? change / regions[i].acting : 0.0);
    }
    regions_ = std::move(regions);
  }

  /// Whether the whole load, put on this mesh at once, leads where the coarser level led.
  void look_for_other_states() {
    if (!near_serves_) {
      return;  // the answer at hand comes from zero load
    }
    near_.reset();
    try {
      Answer anew = solved(settings_);
      other_state_ = std::abs(anew.value / last_->value - 1);
      replace_last(std::move(anew));
    } catch (const RequirementError&) {  // found only from a state near it
    }
  }

  /// By the same mesh.
  void replace_last(Answer&& answer) {
    out_.levels.back().value = answer.value;
    out_.levels.back().answers = answer.all;
    last_ = std::move(answer);
  }

  void compare_linear() {
    RunSettings linear = settings_;
    std::get<StaticRun>(linear.kind).linear = true;
    std::string reason = "no answer";
    try {
      Answer other = solved(linear);
      const double error = std::abs(other.value / last_->value - 1);
      const std::map<std::string, double> errors = changes(last_->all, other.all);
      const auto& [name, most] = largest(errors);
      if (error < model_share * request_.within && most < request_.within) {
        choices_.push_back({"model", "linear", error, "nonlinear",
                            fmt::format("{:.2g} times the time", last_->seconds / other.seconds)});
        settings_ = linear;
        model_error_ += error;
        for (const auto& [key, of_answer] : errors) {
          model_errors_[key] += of_answer;
        }
        replace_last(std::move(other));
        return;
      }
      reason = errors_text(error, name, most);
    } catch (const RequirementError&) {  // no linear answer
    }
    choices_.push_back({"model", "nonlinear", 0, "linear", reason});
  }

  /// Whether the last level is accepted.
  bool judge() {
    const std::size_t n = out_.levels.size();
    if (model_error_ >= request_.within) {
      out_.reasons = {fmt::format("the shortest time step tried, {:.4g} ms, still changes the answer by {}",
                                  1e3 * std::get<DynamicRun>(settings_.kind).step, percent_text(model_error_))};
      return false;
    }
    if (n < fewest_levels) {
      return false;
    }
    std::vector<double> values;
    for (const AccuracyLevel& level : out_.levels) {
      values.push_back(level.value);
    }
    out_.estimate = error_of_last(values) + error_besides(model_error_);
    doubt();
    return *out_.estimate < request_.within && out_.reasons.empty();
  }

  /// Of the model, the solver, and the borders of what is pressed and held.
  [[nodiscard]] double error_besides(double of_model) const {
    return of_model + last_->summary.algebraic_error.value_or(0) + border_error_;
  }

  void doubt() {
    out_.reasons.clear();
    const double allowed = largest_field_change * std::max(*out_.estimate, request_.within);
    if ((request_.of == Quantity::displacement || request_.of == Quantity::probe) && field_change_ > allowed) {
      out_.reasons.push_back(fmt::format("the {} changed little, but displacements elsewhere by {}",
                                         request_.of == Quantity::probe ? "probe" : "largest displacement",
                                         percent_text(field_change_)));
    }
    // Stresses are those away from such layers, where there is any place away from them.
    if (is_stress(request_.of) && far_from_disturbances(last_->system.model()).empty()) {
      const double edges = edges_per_layer(last_->system.model());
      if (edges < fewest_edges_per_layer) {
        out_.reasons.push_back(
            fmt::format("the bending layer at supports, rims and loads, sqrt(R t) / 1.24 wide, is {:.2g} "
                        "edges wide at its coarsest place, {:g} are needed",
                        edges, fewest_edges_per_layer));
      }
    }
    if (border_error_ >= request_.within) {
      out_.reasons.push_back(fmt::format(
          "the region of a load, hold or bed ends within triangles, and its area still changes by {:.2g} % from "
          "level to level: let its border lie on edges of the mesh",
          100 * border_error_));
    }
    const double thinnest = least_thickness(last_->system.model());
    doubt_distance(out_.levels.back().mean_distance.value_or(0), thinnest);
    if (out_.reasons.empty() && *out_.estimate < request_.within) {
      doubt_parts_left_out(thinnest);
    }
    if (other_state_ >= model_share * request_.within) {
      out_.reasons.push_back(
          fmt::format("there are several states of rest, {} apart: which one the shell comes to "
                      "depends on how the load got there",
                      percent_text(other_state_)));
    }
    if (const std::size_t bent = count_unresolved(last_->system.model(), last_->at, largest_bend); bent > 0) {
      out_.reasons.push_back(fmt::format("{} shell(s) bend by more than 30 degrees", bent));
    }
    if (last_->summary.stiffened_from) {
      out_.reasons.emplace_back(
          "the shells are coarse for so thin a wall: where they would have buckled edge by edge they were stiffened");
    }
    is_doubtful_ = !out_.reasons.empty();
  }

  /// @param mean  of the distances from shells to surface, or of those back, mm
  void doubt_distance(double mean, double thinnest) {
    if (mean >= request_.within * thinnest) {  // the error of an answer is one to three times that
      out_.reasons.push_back(fmt::format(
          "the shells are {:.2g} % of the wall from the surface in the mean, which costs as much of the answer",
          100 * mean / thinnest));
    }
  }

  /// Parts of the surface that no level comes close to show in no difference of levels. They cost an answer as much as
  /// they raise the mean distance; the stress at the faces, which follows the curvature, wherever there is one.
  void doubt_parts_left_out(double thinnest) {
    for (std::size_t b = 0; b < level_.bodies.size(); ++b) {
      if (targets_[b] == nullptr) {
        continue;
      }
      doubt_distance(mean_distance_from_target(level_.bodies[b].mesh, *targets_[b]), thinnest);
      if (request_.of != Quantity::stress) {
        continue;
      }
      ShellDistanceOptions measuring;
      measuring.width = 0.1 * largest_distance * thinnest;
      measuring.limit = largest_distance * thinnest;
      const double farthest = shell_distance(level_.bodies[b].mesh, *targets_[b], measuring).both.lower;
      if (farthest > largest_distance * thinnest) {
        out_.reasons.push_back(
            fmt::format("a place of the surface lies {:.2g} mm from the shells, {:.2g} of the wall: "
                        "start from more shells, or a better fit of few",
                        farthest, farthest / thinnest));
      }
    }
  }

  /// Why there is no next level; empty: there may be one.
  [[nodiscard]] std::string passes_a_bound(double spent) const {
    const std::size_t next = 4 * level_.shell_count();
    if (next > request_.max_shells) {
      return fmt::format("the next level would have {} shells, more than {}", next, request_.max_shells);
    }
    const double will_take = out_.levels.empty() ? 0 : cost_of_next * out_.levels.back().seconds;
    if (request_.max_seconds && spent + will_take > *request_.max_seconds) {
      return fmt::format("the next level, of {} shells, would take about {:.2g} s, past the {:.4g} s allowed", next,
                         will_take, *request_.max_seconds);
    }
    return {};
  }

  void give_up(const std::string& bound) {
    out_.reasons.push_back(out_.estimate ? bound
                                         : fmt::format("an estimate takes {} levels, and {}", fewest_levels, bound));
  }

  void tell_choices() {
    const std::size_t n = out_.levels.size();
    const AccuracyLevel& last = out_.levels.back();
    const std::string chosen = std::to_string(last.shells);
    out_.choices.push_back({"shells", chosen, out_.estimate, fmt::format("{} shells", 4 * last.shells),
                            fmt::format("about {:.2g} s more", 4 * last.seconds)});
    if (n > 1) {
      const AccuracyLevel& before = out_.levels[n - 2];
      out_.choices.push_back({"shells", chosen, out_.estimate, fmt::format("{} shells", before.shells),
                              fmt::format("an answer {} away", percent_text(std::abs(before.value / last.value - 1)))});
    }
    out_.choices.insert(out_.choices.end(), choices_.begin(), choices_.end());
  }

  Level level_;
  const std::vector<const Target*>& targets_;
  const AccuracyRequest& request_;
  RunSettings settings_;
  const ModelOf& model_of_;
  const std::function<void(const AccuracyLevel&)>& on_level_;
  Model model_;  // of the level
  Accuracy out_;
  std::optional<DynamicRun> motion_;  // that was asked for, once it was decided how it is followed
  std::vector<AccuracyChoice> choices_;
  double model_error_ = 0;                      // of the cheaper models that were chosen
  std::map<std::string, double> model_errors_;  // of all answers
  std::optional<Checkpoint> near_;
  bool is_finer_ = false;    // the level, than the coarsest
  bool near_serves_ = true;  // as a start of Newton's method
  std::optional<Answer> last_;
  double field_change_ = infinity;
  bool is_doubtful_ = false;  // the last level, for other reasons than its cost
  double other_state_ = 0;    // relative distance of another answer of the second level
  std::vector<Region> regions_;
  double border_error_ = 0;  // by which these changed from the level before, relative
};

}  // namespace

std::string_view unit_of(Quantity quantity) {
  constexpr std::array<std::string_view, 7> units{"mm", "mJ", "mm^3", "MPa", "MPa", "N/mm", "mm"};
  return units.at(static_cast<std::size_t>(quantity));
}

Accuracy solve_within(std::vector<ShellBody> bodies, const std::vector<const Target*>& targets,
                      const AccuracyRequest& request, const RunSettings& settings, const ModelOf& model_of,
                      const std::function<void(const AccuracyLevel&)>& on_level) {
  if (bodies.empty() || targets.size() != bodies.size()) {
    throw InputError(fmt::format("{} targets for {} bodies: one for each is needed", targets.size(), bodies.size()));
  }
  for (const ShellBody& body : bodies) {
    require_valid(body);
  }
  if (!std::holds_alternative<StaticRun>(settings.kind) && !std::holds_alternative<DynamicRun>(settings.kind)) {
    throw InputError("an accuracy is for statics and dynamics: leave it out, or change the kind of the run");
  }
  require_positive(request.within, "the accuracy");
  if (request.voxel) {
    require_positive(*request.voxel, "the edge of a voxel");
  }
  if (request.axis < 0 || request.axis > 2) {
    throw InputError(fmt::format("there is no axis {}: choose 0 to 2", request.axis));
  }
  return Ladder(std::move(bodies), targets, request, settings, model_of, on_level).run();
}

}  // namespace tunica
