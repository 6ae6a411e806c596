#include "shell/fit_edit.hpp"

#include "core/threads.hpp"
#include "shell/fit_trial.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

namespace tunica {
namespace {

constexpr double least_split_angle = 3;       // degrees, where nothing better can be had
constexpr double good_enough = 0.5;           // of the limit: edges of closer patches stay
constexpr std::size_t evaluated_at_once = 8;  // mergers, whatever the number of threads
constexpr double far_behind = 1.5;            // times the least error known: mergers that need not be placed well yet

class Collapser {
public:
  Collapser(FitState& state, double limit) : state_(state), mesh_(state.mesh), limit_(limit) {}

  /// @param far  mm: of an error above this it need not be known how small it can become
  /// @return the error after the collapse; infinite when it is not possible
  double evaluate(Index u, Index v, double far = std::numeric_limits<double>::infinity()) {
    Trial& trial = trial_;
    if (!prepare(u, v)) {
      return std::numeric_limits<double>::infinity();
    }
    start_soundly(u, v);
    place_node(state_.samples(), trial.patches, trial.points, trial.limits, limit_, placing_steps, trial.node, far);
    return trial.node.error;
  }

  /// The same from where an earlier evaluation found the merged node best: what surrounds it may have moved since.
  double evaluate_at(Index u, Index v, const PlacedNode& node) {
    if (!prepare(u, v)) {
      return std::numeric_limits<double>::infinity();
    }
    trial_.node = node;
    place_node(state_.samples(), trial_.patches, trial_.points, trial_.limits, limit_, 1, trial_.node);
    return trial_.node.error;
  }

  /// Where the last evaluation found the merged node best.
  [[nodiscard]] const PlacedNode& placed_node() const { return trial_.node; }

  /// Does what was evaluated last.
  void commit(Index u, Index v) {
    Trial& trial = trial_;
    const auto shared = mesh_.on_edge(u, v);
    for (std::size_t i = 0; i < shared.count(); ++i) {
      state_.patches[shared.triangle[i]] = {};
      mesh_.remove_triangle(shared.triangle[i]);
    }
    mesh_.positions[u] = trial.node.position;
    std::vector<Index> slot_of;
    for (std::size_t s = 0; s < trial.node.normals.size(); ++s) {
      slot_of.push_back(classes_[s]);
      mesh_.normals[classes_[s]] = trial.node.normals[s];
      mesh_.sectors[classes_[s]] = trial.node.sectors[s];
    }
    for (const Index t : mesh_.around[v]) {
      mesh_.triangles[t][mesh_.corner_of(t, v)] = u;
      mesh_.around[u].push_back(t);
    }
    mesh_.around[v].clear();
    mesh_.on_boundary[u] |= mesh_.on_boundary[v];
    for (std::size_t i = 0; i < trial.triangles.size(); ++i) {
      const Index t = trial.triangles[i];
      PlacedPatch& p = trial.patches[i];
      mesh_.slots[t][p.corner] = slot_of[p.slot];
      state_.patches[t] = {std::move(p.guesses), std::move(p.attached), std::move(p.residuals), p.error};
    }
  }

private:
  bool keeps_topology(Index u, Index v) {
    const std::size_t on_edge = mesh_.on_edge(u, v).count();
    if (mesh_.is_held(u) || mesh_.is_held(v) || on_edge == 0 ||
        (on_edge == 2 && mesh_.on_boundary[u] != 0 && mesh_.on_boundary[v] != 0) || mesh_.alive <= 4) {
      return false;
    }
    mesh_.ring(u, ring_u_);
    mesh_.ring(v, ring_v_);
    common_.clear();
    std::set_intersection(ring_u_.begin(), ring_u_.end(), ring_v_.begin(), ring_v_.end(), std::back_inserter(common_));
    if (common_.size() != on_edge) {
      return false;
    }
    for (const Index w : common_) {
      // A node keeps at least three neighbours, at a boundary two triangles' worth less one.
      if (mesh_.around[w].size() <= (mesh_.on_boundary[w] != 0 ? 1U : 3U)) {
        return false;
      }
    }
    return ring_u_.size() + ring_v_.size() >= on_edge + 2 + 3;
  }

  /// Which sector of the merged node one of u's or v's becomes: those that meet across the edge are one.
  auto merged_sectors(Index u, Index v, const FitMesh::Pair& shared) {
    const Index beyond = mesh_.fresh_sector(u);
    std::vector<Index> merged(beyond + mesh_.fresh_sector(v));
    std::iota(merged.begin(), merged.end(), 0);
    for (std::size_t i = 0; i < shared.count(); ++i) {
      const Index t = shared.triangle[i];
      const Index a = merged[mesh_.sectors[mesh_.slots[t][mesh_.corner_of(t, u)]]];
      const Index b = merged[beyond + mesh_.sectors[mesh_.slots[t][mesh_.corner_of(t, v)]]];
      std::replace(merged.begin(), merged.end(), b, a);
    }
    return [this, beyond, merged = std::move(merged)](Index slot, bool of_v) {
      return merged[mesh_.sectors[slot] + (of_v ? beyond : 0)];
    };
  }

  /// The slots of the merged node: those of u and v, the ones that meet across the edge being one. A crease
  /// may end so: the error decides.
  void merge_slots(Index u, Index v, const FitMesh::Pair& shared) {
    std::vector<Index> of_u, of_v;
    mesh_.slots_of(u, of_u);
    mesh_.slots_of(v, of_v);
    std::vector<std::pair<Index, Index>> parent;  // slot, its representative
    for (const Index s : of_u) {
      parent.emplace_back(s, s);
    }
    for (const Index s : of_v) {
      parent.emplace_back(s, s);
    }
    const auto find = [&](Index s) {
      return std::find_if(parent.begin(), parent.end(), [&](const auto& p) { return p.first == s; });
    };
    for (std::size_t i = 0; i < shared.count(); ++i) {
      const Index t = shared.triangle[i];
      const Index a = find(mesh_.slots[t][mesh_.corner_of(t, u)])->second;
      const Index b = find(mesh_.slots[t][mesh_.corner_of(t, v)])->second;
      for (auto& p : parent) {
        if (p.second == b) {
          p.second = a;
        }
      }
    }
    classes_.clear();
    sectors_.clear();
    const auto sector = merged_sectors(u, v, shared);
    for (const auto& p : parent) {
      if (std::find(classes_.begin(), classes_.end(), p.second) == classes_.end()) {
        classes_.push_back(p.second);
        sectors_.push_back(sector(p.second, std::find(of_u.begin(), of_u.end(), p.second) == of_u.end()));
      }
    }
    class_of_ = parent;
  }

  bool prepare(Index u, Index v) {
    if (!keeps_topology(u, v)) {
      return false;
    }
    const auto shared = mesh_.on_edge(u, v);
    merge_slots(u, v, shared);
    Trial& trial = trial_;
    trial.patches.clear();
    trial.triangles.clear();
    trial.points.clear();
    trial.limits = state_.limits;
    for (std::size_t i = 0; i < shared.count(); ++i) {
      gather(state_, shared.triangle[i], trial);
      ease_limits(state_, shared.triangle[i], trial.limits);
    }
    nodes_.clear();
    replaced_.assign(shared.triangle.begin(), shared.triangle.end());
    std::vector<Vec3> sums(classes_.size(), Vec3::Zero());
    for (const Index node : {u, v}) {
      for (const Index t : mesh_.around[node]) {
        if (t == shared.triangle[0] || t == shared.triangle[1]) {
          continue;
        }
        gather(state_, t, trial);
        ease_limits(state_, t, trial.limits);
        PlacedPatch patch = placed(state_, t);
        patch.corner = mesh_.corner_of(t, node);
        const Index slot = mesh_.slots[t][patch.corner];
        const auto found =
            std::find_if(class_of_.begin(), class_of_.end(), [&](const auto& p) { return p.first == slot; });
        patch.slot =
            static_cast<std::size_t>(std::find(classes_.begin(), classes_.end(), found->second) - classes_.begin());
        sums[patch.slot] += mesh_.normals[slot];
        trial.patches.push_back(std::move(patch));
        trial.triangles.push_back(t);
        nodes_.push_back(mesh_.triangles[t]);
        nodes_.back()[trial.patches.back().corner] = u;
        replaced_.push_back(t);
      }
    }
    link(state_, nodes_, replaced_, trial);
    // Start: what is special about one end decides, else the middle.
    trial.node = {};
    trial.node.sectors = sectors_;
    const int rank_u = special(u), rank_v = special(v);
    for (const Vec3& sum : sums) {
      trial.node.normals.push_back(sum.norm() > 1e-3 ? Vec3(sum.normalized()) : mesh_.normals[classes_[0]]);
    }
    if (rank_u != rank_v) {
      trial.node.position = mesh_.positions[rank_u > rank_v ? u : v];
    } else {
      const Vec3 middle = (mesh_.positions[u] + mesh_.positions[v]) / 2;
      trial.node.position = state_.samples().foot(middle, trial.node.normals[0]).point;
    }
    return true;
  }

  /// From where facets fold or angles are small no way is looked for: then the merged node starts elsewhere.
  void start_soundly(Index u, Index v) {
    const PlacedNode first = trial_.node;
    make_compatible(trial_);
    std::vector<Vec3> starts;
    const bool smooth = std::all_of(sectors_.begin(), sectors_.end(), [&](Index s) { return s == sectors_[0]; });
    if (mesh_.on_boundary[u] + mesh_.on_boundary[v] == 0 && smooth) {
      starts = {mesh_.positions[u], mesh_.positions[v], middle_of_rings(u, v, first.normals[0])};
    } else if (special(u) == special(v)) {
      starts = {mesh_.positions[u], mesh_.positions[v]};
    }
    for (std::size_t i = 0; i < starts.size() && !stands_soundly(); ++i) {
      trial_.node = first;
      trial_.node.position = starts[i];
      make_compatible(trial_);
    }
  }

  /// On the target.
  Vec3 middle_of_rings(Index u, Index v, const Vec3& normal) {
    common_.clear();
    std::set_union(ring_u_.begin(), ring_u_.end(), ring_v_.begin(), ring_v_.end(), std::back_inserter(common_));
    Vec3 middle = Vec3::Zero();
    for (const Index w : common_) {
      middle += w == u || w == v ? Vec3::Zero() : Vec3(mesh_.positions[w] / static_cast<double>(common_.size() - 2));
    }
    return state_.samples().foot(middle, normal).point;
  }

  bool stands_soundly() {
    return std::all_of(trial_.patches.begin(), trial_.patches.end(), [&](const PlacedPatch& p) {
      PatchShape shape = p.shape;
      shape.corners[p.corner] = trial_.node.position;
      shape.normals[p.corner] = trial_.node.normals[p.slot];
      return is_sound(shape, trial_.limits.agreement, trial_.limits.angle);
    });
  }

  /// Boundaries first, then creases.
  [[nodiscard]] int special(Index node) const {
    std::vector<Index> sides;
    mesh_.slots_of(node, sides);
    for (Index& s : sides) {
      s = mesh_.sectors[s];
    }
    std::sort(sides.begin(), sides.end());
    sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
    return mesh_.on_boundary[node] * 4 + static_cast<int>(sides.size());
  }

  FitState& state_;
  FitMesh& mesh_;
  double limit_;
  Trial trial_;
  std::vector<Index> ring_u_, ring_v_, common_;
  std::vector<std::array<Index, 3>> nodes_;
  std::vector<Index> replaced_;
  std::vector<Index> sectors_;                     // of each class
  std::vector<Index> classes_;                     // slot that stands for each class
  std::vector<std::pair<Index, Index>> class_of_;  // slot, the one that stands for its class
};

}  // namespace

std::size_t collapse_edges(FitState& state, double limit, std::size_t shells, const Progress& progress) {
  struct Candidate {
    double error;
    Index u, v;
    unsigned version;
    std::size_t evaluated;  // which of the evaluations, when of this version
    bool operator<(const Candidate& o) const {
      return error != o.error ? error > o.error : u != o.u ? u > o.u : v > o.v;
    }
  };
  FitMesh& mesh = state.mesh;
  std::vector<Collapser> collapsers(evaluated_at_once, Collapser(state, limit));
  std::vector<unsigned> version(mesh.positions.size(), 1);
  std::priority_queue<Candidate> queue;
  std::vector<PlacedNode> evaluations;
  const auto current = [&](Index u, Index v) { return version[u] + version[v]; };
  for (const auto& [u, v] : mesh.edges()) {
    // A first guess, below the truth: the largest error around.
    double guess = 0;
    for (const Index node : {u, v}) {
      for (const Index t : mesh.around[node]) {
        guess = std::max(guess, state.patches[t].error);
      }
    }
    queue.push({guess, u, v, 0, 0});
  }
  const std::size_t before = mesh.alive;
  std::size_t gone = 0;
  const auto is_known = [&](const Candidate& c) { return c.version == current(c.u, c.v); };
  std::vector<Candidate> some;
  while (!queue.empty() && mesh.alive > shells) {
    // The cheapest that are only guessed are evaluated several at a time, in parallel.
    some.clear();
    while (!queue.empty() && some.size() < evaluated_at_once && queue.top().error <= limit && !is_known(queue.top())) {
      const Candidate& c = queue.top();
      if (!mesh.around[c.u].empty() && !mesh.around[c.v].empty()) {
        some.push_back(c);
      }
      queue.pop();
    }
    if (!some.empty()) {
      const double next = queue.empty() ? limit : queue.top().error;
      parallel_for_blocks(some.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          Candidate& c = some[i];
          c.error = collapsers[i].evaluate(c.u, c.v, far_behind * std::max(c.error, next));
        }
      });
      for (std::size_t i = 0; i < some.size(); ++i) {
        Candidate& c = some[i];
        if (c.error <= limit && std::isfinite(c.error)) {
          c.version = current(c.u, c.v);
          c.evaluated = evaluations.size();
          evaluations.push_back(collapsers[i].placed_node());
          queue.push(c);
        }
      }
      continue;
    }
    if (queue.empty()) {
      break;
    }
    Candidate c = queue.top();
    queue.pop();
    if (mesh.around[c.u].empty() || mesh.around[c.v].empty() || c.error > limit) {
      continue;
    }
    Collapser& collapser = collapsers[0];
    c.error = collapser.evaluate_at(c.u, c.v, evaluations[c.evaluated]);
    if (!(c.error <= limit) || !std::isfinite(c.error)) {
      continue;
    }
    collapser.commit(c.u, c.v);
    ++gone;
    std::vector<Index> ring;
    mesh.ring(c.u, ring);
    ++version[c.u];
    for (const Index w : ring) {
      ++version[w];
    }
    for (const Index w : ring) {
      queue.push({c.error, std::min(c.u, w), std::max(c.u, w), 0, 0});
    }
    if (gone % 32 == 0) {
      advance(progress, static_cast<double>(before - mesh.alive) / static_cast<double>(before));
    }
  }
  return gone;
}

bool merge_edge(FitState& state, Index u, Index v, double limit) {
  Collapser collapser(state, limit);
  if (!(collapser.evaluate(u, v) <= limit)) {
    return false;
  }
  collapser.commit(u, v);
  return true;
}

std::size_t flip_edges(FitState& state, double limit) {
  FitMesh& mesh = state.mesh;
  std::size_t flips = 0;
  for (const auto& [u, v] : mesh.edges()) {
    const auto pair = mesh.on_edge(u, v);
    if (pair.count() != 2) {
      continue;
    }
    // First triangle a b c, second b a d: a, b the edge's ends.
    const Index t1 = pair.triangle[0], t2 = pair.triangle[1];
    const std::size_t cu = mesh.corner_of(t1, u);
    const bool forward = mesh.triangles[t1][(cu + 1) % 3] == v;
    const Index a = forward ? u : v, b = forward ? v : u;
    const std::size_t a1 = mesh.corner_of(t1, a), b1 = mesh.corner_of(t1, b), c1 = 3 - a1 - b1;
    const std::size_t a2 = mesh.corner_of(t2, a), b2 = mesh.corner_of(t2, b), d2 = 3 - a2 - b2;
    const Index c = mesh.triangles[t1][c1], d = mesh.triangles[t2][d2];
    const auto &s1 = mesh.slots[t1], &s2 = mesh.slots[t2];
    if (c == d || (mesh.is_held(c) && mesh.is_held(d)) || s1[a1] != s2[a2] || s1[b1] != s2[b2] ||
        mesh.on_edge(c, d).count() > 0 || mesh.around[a].size() <= (mesh.on_boundary[a] != 0 ? 1U : 3U) ||
        mesh.around[b].size() <= (mesh.on_boundary[b] != 0 ? 1U : 3U)) {
      continue;
    }
    const double old_angle = std::min(smallest_angle(state, t1), smallest_angle(state, t2));
    const double old_error = std::max(state.patches[t1].error, state.patches[t2].error);
    if (old_error < good_enough * limit && old_angle >= state.limits.angle) {
      continue;
    }
    Trial trial;
    trial.limits = state.limits;
    trial.limits.angle = 0;
    gather(state, t1, trial);
    gather(state, t2, trial);
    const std::array<std::array<Index, 3>, 2> nodes{{{a, d, c}, {d, b, c}}};
    const std::array<std::array<Index, 3>, 2> slots{{{s1[a1], s2[d2], s1[c1]}, {s2[d2], s1[b1], s1[c1]}}};
    for (std::size_t i = 0; i < 2; ++i) {
      PlacedPatch patch;
      for (std::size_t k = 0; k < 3; ++k) {
        patch.shape.corners[k] = mesh.positions[nodes[i][k]];
        patch.shape.normals[k] = mesh.normals[slots[i][k]];
      }
      patch.shape.kind = mesh.kind;
      patch.guesses = state.patches[i == 0 ? t1 : t2].guesses;
      trial.patches.push_back(std::move(patch));
    }
    link(state, {nodes[0], nodes[1]}, {t1, t2}, trial);
    const auto angle_of = [](const PlacedPatch& p) {
      return smallest_angle_degrees(p.shape.corners[0], p.shape.corners[1], p.shape.corners[2]);
    };
    const double new_angle = std::min(angle_of(trial.patches[0]), angle_of(trial.patches[1]));
    const bool mends = old_angle < state.limits.angle && new_angle > old_angle;
    if (!mends && new_angle < std::min(old_angle, state.limits.angle)) {
      continue;
    }
    // No pair of facets that folds.
    if (facing_of(trial.patches[0].shape.corners).dot(facing_of(trial.patches[1].shape.corners)) <
        std::min(0.3, facing_of(mesh.corners(t1)).dot(facing_of(mesh.corners(t2))))) {
      continue;
    }
    place_node(state.samples(), trial.patches, trial.points, trial.limits, limit, 0, trial.node);
    if (!std::isfinite(trial.node.error) ||
        !(trial.node.error < 0.97 * old_error || (mends && trial.node.error <= std::max(limit, old_error)))) {
      continue;
    }
    mesh.remove_triangle(t1);
    mesh.remove_triangle(t2);
    for (std::size_t i = 0; i < 2; ++i) {
      const Index t = mesh.add_triangle(nodes[i], slots[i]);
      PlacedPatch& p = trial.patches[i];
      state.patches[t] = {std::move(p.guesses), std::move(p.attached), std::move(p.residuals), p.error};
    }
    ++flips;
  }
  return flips;
}

bool split_edge(FitState& state, Index u, Index v, double limit) {
  FitMesh& mesh = state.mesh;
  const auto pair = mesh.on_edge(u, v);
  if (pair.count() < 2 && mesh.is_held(u) && mesh.is_held(v)) {
    return false;
  }
  Trial trial;
  trial.limits = state.limits;
  std::vector<std::array<Index, 3>> nodes, slots;
  std::vector<Index> old_slots;  // a slot at the edge's end for each slot of the new node
  const auto fresh_node = static_cast<Index>(mesh.positions.size());
  const Vec3 middle = (mesh.positions[u] + mesh.positions[v]) / 2;
  std::vector<Vec3> on_curves;
  std::vector<std::array<Index, 2>> sides;
  for (std::size_t i = 0; i < pair.count(); ++i) {
    const Index t = pair.triangle[i];
    gather(state, t, trial);
    ease_limits(state, t, trial.limits);
    const std::size_t cu = mesh.corner_of(t, u), cv = mesh.corner_of(t, v);
    std::array<Vec2, 3> at{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
    const CubicPatch patch = mesh.patch(t);
    const Vec2 mid = (at[cu] + at[cv]) / 2;
    on_curves.push_back(patch.point(mid));
    const std::array<Index, 2> side{mesh.slots[t][cu], mesh.slots[t][cv]};
    std::size_t slot = 0;
    const auto same = std::find(sides.begin(), sides.end(), side);
    if (same == sides.end()) {
      slot = sides.size();
      const bool smooth = slot == 0 || (mesh.sectors[side[0]] == mesh.sectors[sides[0][0]] &&
                                        mesh.sectors[side[1]] == mesh.sectors[sides[0][1]]);
      sides.push_back(side);
      trial.node.normals.push_back(patch.normal(mid));
      trial.node.sectors.push_back(smooth ? 0 : 1);
    } else {
      slot = static_cast<std::size_t>(same - sides.begin());
      trial.node.normals[slot] = (trial.node.normals[slot] + patch.normal(mid)).normalized();
    }
    for (const std::size_t replaced : {cu, cv}) {
      PlacedPatch p = placed(state, t);
      p.corner = replaced;
      p.slot = slot;
      nodes.push_back(mesh.triangles[t]);
      nodes.back()[replaced] = fresh_node;
      slots.push_back(mesh.slots[t]);
      slots.back()[replaced] = static_cast<Index>(mesh.normals.size() + slot);
      trial.patches.push_back(std::move(p));
    }
  }
  link(state, nodes, {pair.triangle[0], pair.triangle[1]}, trial);
  trial.node.position = middle;
  for (const Vec3& p : on_curves) {
    trial.node.position += (p - middle) / static_cast<double>(on_curves.size());
  }
  trial.limits.angle = std::min(trial.limits.angle, 0.5 * state.limits.angle);
  make_compatible(trial);
  place_node(state.samples(), trial.patches, trial.points, trial.limits, limit, placing_steps, trial.node);
  if (!std::isfinite(trial.node.error)) {
    // In the facets themselves the parts are as sound as the whole was.
    trial.node.position = middle;
    for (std::size_t i = 0; i < trial.patches.size(); ++i) {
      trial.node.normals[trial.patches[i].slot] = facing_of(mesh.corners(pair.triangle[i / 2]));
    }
    trial.limits.angle = std::min(trial.limits.angle, least_split_angle);
    place_node(state.samples(), trial.patches, trial.points, trial.limits, limit, placing_steps, trial.node);
  }
  if (!std::isfinite(trial.node.error)) {
    return false;
  }
  for (std::size_t i = 0; i < pair.count(); ++i) {
    state.patches[pair.triangle[i]] = {};
  }
  const std::size_t count = pair.count();
  for (std::size_t i = 0; i < count; ++i) {
    mesh.remove_triangle(pair.triangle[i]);
  }
  mesh.positions.push_back(trial.node.position);
  mesh.on_boundary.push_back(count == 1 ? 1 : 0);
  mesh.around.emplace_back();
  for (std::size_t s = 0; s < trial.node.normals.size(); ++s) {
    mesh.add_slot(trial.node.normals[s], trial.node.sectors[s]);
  }
  for (std::size_t i = 0; i < trial.patches.size(); ++i) {
    const Index t = mesh.add_triangle(nodes[i], slots[i]);
    state.patches.resize(mesh.triangles.size());
    PlacedPatch& p = trial.patches[i];
    state.patches[t] = {std::move(p.guesses), std::move(p.attached), std::move(p.residuals), p.error};
  }
  return true;
}

namespace {

/// Places a node whose slots become fewer. @param merged  for each of its slots, ascending, which new one it becomes
bool place_with_slots(FitState& state, Index v, const Vec3& start, const std::vector<Index>& own,
                      const std::vector<std::size_t>& merged, double angle, double limit) {
  FitMesh& mesh = state.mesh;
  Trial trial;
  trial.limits = state.limits;
  trial.node.position = start;
  trial.node.normals.assign(*std::max_element(merged.begin(), merged.end()) + 1, Vec3::Zero());
  trial.node.sectors.resize(trial.node.normals.size());
  for (std::size_t s = own.size(); s-- > 0;) {
    trial.node.sectors[merged[s]] = mesh.sectors[own[s]];
    trial.node.normals[merged[s]] += mesh.normals[own[s]];
  }
  for (Vec3& n : trial.node.normals) {
    if (!(n.norm() > 1e-3)) {
      return false;
    }
    n.normalize();
  }
  const auto slot_of = [&](Index slot) {
    return merged[static_cast<std::size_t>(std::find(own.begin(), own.end(), slot) - own.begin())];
  };
  std::vector<std::array<Index, 3>> nodes_around;
  for (const Index t : mesh.around[v]) {
    gather(state, t, trial);
    ease_limits(state, t, trial.limits);
    PlacedPatch p = placed(state, t);
    p.corner = mesh.corner_of(t, v);
    p.slot = slot_of(mesh.slots[t][p.corner]);
    trial.patches.push_back(std::move(p));
    trial.triangles.push_back(t);
    nodes_around.push_back(mesh.triangles[t]);
  }
  trial.limits.angle = std::max(trial.limits.angle, angle);
  link(state, nodes_around, trial.triangles, trial);
  if (trial.node.normals.size() < own.size()) {
    make_compatible(trial);
  }
  place_node(state.samples(), trial.patches, trial.points, trial.limits, limit, placing_steps + 1, trial.node);
  if (!(trial.node.error < limit)) {
    return false;
  }
  mesh.positions[v] = trial.node.position;
  for (std::size_t s = 0; s < trial.node.normals.size(); ++s) {
    mesh.normals[own[s]] = trial.node.normals[s];
    mesh.sectors[own[s]] = trial.node.sectors[s];
  }
  for (std::size_t i = 0; i < trial.triangles.size(); ++i) {
    PlacedPatch& p = trial.patches[i];
    mesh.slots[trial.triangles[i]][p.corner] = own[p.slot];
    state.patches[trial.triangles[i]] = {std::move(p.guesses), std::move(p.attached), std::move(p.residuals), p.error};
  }
  return true;
}

/// All ways to make one of two slots of a node, the most alike first.
std::vector<std::vector<std::size_t>> pairs_merged(const FitMesh& mesh, const std::vector<Index>& own) {
  std::vector<std::pair<double, std::vector<std::size_t>>> ways;
  for (std::size_t i = 0; i < own.size(); ++i) {
    for (std::size_t j = i + 1; j < own.size(); ++j) {
      std::vector<std::size_t> merged(own.size());
      for (std::size_t s = 0; s < own.size(); ++s) {
        merged[s] = s == j ? i : s > j ? s - 1 : s;
      }
      ways.emplace_back(mesh.normals[own[i]].dot(mesh.normals[own[j]]), std::move(merged));
    }
  }
  std::stable_sort(ways.begin(), ways.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::vector<std::size_t>> out;
  for (auto& way : ways) {
    out.push_back(std::move(way.second));
  }
  return out;
}

}  // namespace

bool move_node(FitState& state, Index v, const Vec3& start, double angle, double limit) {
  if (state.mesh.is_held(v)) {
    return false;
  }
  std::vector<Index> own;
  state.mesh.slots_of(v, own);
  std::vector<std::size_t> same(own.size());
  std::iota(same.begin(), same.end(), 0);
  return place_with_slots(state, v, start, own, same, angle, limit);
}

std::size_t join_normals(FitState& state, double limit) {
  const FitMesh& mesh = state.mesh;
  std::size_t gone = 0;
  std::vector<Index> own;
  for (Index v = 0; v < mesh.positions.size(); ++v) {
    mesh.slots_of(v, own);
    if (own.size() < 2) {
      continue;
    }
    const Vec3 start = mesh.positions[v];
    if (place_with_slots(state, v, start, own, std::vector<std::size_t>(own.size(), 0), 0, limit)) {
      gone += own.size() - 1;
      continue;
    }
    bool better = own.size() > 2;
    while (better && own.size() > 1) {
      better = false;
      for (const auto& merged : pairs_merged(mesh, own)) {
        if (place_with_slots(state, v, mesh.positions[v], own, merged, 0, limit)) {
          ++gone;
          mesh.slots_of(v, own);
          better = true;
          break;
        }
      }
    }
  }
  return gone;
}

}  // namespace tunica
