#include "shell/fit_remove.hpp"

#include "shell/fit_trial.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace tunica {
namespace {

constexpr std::size_t largest_ring = 12;
constexpr double clear_agreement = 0.05;  // above the limit: room to move
constexpr double never = std::numeric_limits<double>::infinity();

/// The nodes around one that is to go, in order; the last and the first meet beyond it, or will along the boundary.
struct Hole {
  std::vector<Index> nodes;
  std::vector<Index> after, before;  ///< their slots in the triangles that follow and precede them around the hole
  std::vector<Index> triangles;      ///< that go, triangle i between nodes i and i + 1
};

/// Nothing where the node has other than one fan of triangles, or lies on a crease.
std::optional<Hole> hole_around(const FitMesh& mesh, Index node) {
  const auto& around = mesh.around[node];
  const bool open = mesh.on_boundary[node] != 0;
  const std::size_t count = around.size();
  if (count + (open ? 1 : 0) < 3 || count > largest_ring) {
    return {};
  }
  const auto corner = [&](std::size_t i, std::size_t k) { return (mesh.corner_of(around[i], node) + k) % 3; };
  const auto end = [&](std::size_t i, std::size_t k) { return mesh.triangles[around[i]][corner(i, k)]; };
  const auto slot = [&](std::size_t i, std::size_t k) { return mesh.slots[around[i]][corner(i, k)]; };
  const auto find = [&](std::size_t k, Index at) {
    std::size_t i = 0;
    while (i < count && end(i, k) != at) {
      ++i;
    }
    return i;
  };
  std::size_t first = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (mesh.sectors[slot(i, 0)] != mesh.sectors[slot(0, 0)]) {
      return {};
    }
    first = find(2, end(i, 1)) == count ? i : first;
  }
  Hole hole;
  Index last = end(first, 1);
  for (std::size_t i = first; i < count && (hole.nodes.empty() || last != hole.nodes[0]); i = find(1, last)) {
    hole.triangles.push_back(around[i]);
    hole.nodes.push_back(last);
    hole.after.push_back(slot(i, 1));
    hole.before.push_back(slot(i, 2));
    last = end(i, 2);
  }
  if (hole.triangles.size() < count || (last == hole.nodes[0]) == open) {
    return {};
  }
  if (open) {
    hole.nodes.push_back(last);
    hole.after.push_back(hole.before.back());
    hole.before.insert(hole.before.begin(), hole.after[0]);
  } else {
    std::rotate(hole.before.begin(), hole.before.end() - 1, hole.before.end());
  }
  return hole;
}

/// The triangulation of a hole whose worst patch is closest to the target, by dynamic programming.
class Cover {
public:
  Cover(const FitState& state, const Hole& hole, const FitLimits& limits, double limit)
      : state_(state), hole_(hole), limits_(limits), limit_(limit), size_(hole.nodes.size()), best_(size_ * size_) {
    for (const Index t : hole.triangles) {
      const auto& guesses = state.patches[t].guesses;
      guess_ = guess_.empty() ? guesses : guess_;
    }
  }

  /// @return corners, as numbers around the hole; none where no triangulation will do
  std::vector<std::array<std::size_t, 3>> run() {
    for (std::size_t span = 2; span < size_; ++span) {
      for (std::size_t i = 0; i + span < size_; ++i) {
        find_best(i, i + span);
      }
    }
    std::vector<std::array<std::size_t, 3>> out;
    if (best_[size_ - 1].error < never) {
      collect(0, size_ - 1, out);
    }
    return out;
  }

  [[nodiscard]] std::array<Index, 3> slots_of(const std::array<std::size_t, 3>& corners) const {
    std::array<Index, 3> out;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool follows = corners[(k + 1) % 3] == (corners[k] + 1) % size_;
      out[k] = follows ? hole_.after[corners[k]] : hole_.before[corners[k]];
    }
    return out;
  }

  /// Where normals may part, those that do not agree with the facet are turned towards it.
  [[nodiscard]] PatchShape shape_of(const std::array<std::size_t, 3>& corners) const {
    const FitMesh& mesh = state_.mesh;
    const auto slots = slots_of(corners);
    PatchShape shape;
    shape.kind = mesh.kind;
    for (std::size_t k = 0; k < 3; ++k) {
      shape.corners[k] = mesh.positions[hole_.nodes[corners[k]]];
      shape.normals[k] = mesh.normals[slots[k]];
    }
    const Vec3 facing = facing_of(shape.corners);
    for (std::size_t k = 0; limits_.kink > 0 && k < 3; ++k) {
      if (shape.normals[k].dot(facing) < limits_.agreement + clear_agreement) {
        shape.normals[k] = turned_towards(facing, hole_.nodes[corners[k]], mesh.sectors[slots[k]], shape.normals[k]);
      }
    }
    return shape;
  }

private:
  /// The direction closest to `wanted` that a further normal of a node's sector may have; `otherwise` where these
  /// have no mean.
  [[nodiscard]] Vec3 turned_towards(const Vec3& wanted, Index node, Index sector, const Vec3& otherwise) const {
    std::vector<Index> slots;
    state_.mesh.slots_of(node, slots);
    Vec3 mean = Vec3::Zero();
    for (const Index s : slots) {
      mean += state_.mesh.sectors[s] == sector ? state_.mesh.normals[s] : Vec3::Zero();
    }
    if (!(mean.norm() > 1e-3)) {
      return otherwise;
    }
    mean.normalize();
    const double along = wanted.dot(mean);
    const Vec3 beside = wanted - along * mean;
    const double half = limits_.kink * std::numbers::pi / 360;
    const double angle = std::min(half, std::atan2(beside.norm(), along));
    return std::cos(angle) * mean + std::sin(angle) * beside.stableNormalized();
  }

  struct Best {
    double error = never;
    std::size_t between = 0;
  };

  /// The part of the hole between nodes i and j, on the side of the nodes in between.
  void find_best(std::size_t i, std::size_t j) {
    // Where the hole is closed, its last and first node have an edge.
    const bool whole = i == 0 && j + 1 == size_ && hole_.triangles.size() == size_;
    if (!whole && !may_meet(hole_.nodes[i], hole_.nodes[j])) {
      return;
    }
    Best& best = best_[i * size_ + j];
    for (std::size_t k = i + 1; k < j; ++k) {
      const double parts = std::max(error_between(i, k), error_between(k, j));
      if (!(parts < best.error) || (j == i + 2 && !may_lose(k)) || (whole && k == 1 && !may_lose(0)) ||
          (whole && k + 1 == j && !may_lose(j))) {
        continue;
      }
      const double error = std::max(parts, error_of({i, k, j}));
      if (error < best.error) {
        best = {error, k};
      }
    }
  }

  [[nodiscard]] double error_between(std::size_t i, std::size_t j) const {
    return j == i + 1 ? 0 : best_[i * size_ + j].error;
  }

  [[nodiscard]] bool may_meet(Index a, Index b) const {
    return state_.mesh.on_edge(a, b).count() == 0 && !(state_.mesh.is_held(a) && state_.mesh.is_held(b));
  }

  /// Whether a node of the ring has enough triangles left when one takes the place of two.
  [[nodiscard]] bool may_lose(std::size_t k) const {
    const Index v = hole_.nodes[k];
    if (state_.mesh.is_held(v)) {
      return true;  // there are others beyond the piece
    }
    return state_.mesh.around[v].size() > (state_.mesh.on_boundary[v] != 0 ? 1U : 3U);
  }

  [[nodiscard]] double error_of(const std::array<std::size_t, 3>& corners) {
    const PatchShape shape = shape_of(corners);
    if (!is_sound(shape, limits_.agreement, limits_.angle)) {
      return never;
    }
    residuals_.clear();
    auto guesses = guess_;
    state_.samples().from_patch(PatchPowers(shape.patch()), facing_of(shape.corners), limit_, guesses, residuals_);
    double error = 0;
    for (const Residual& r : residuals_) {
      error = std::max(error, std::abs(r.distance));
    }
    return error;
  }

  void collect(std::size_t i, std::size_t j, std::vector<std::array<std::size_t, 3>>& out) const {
    if (j == i + 1) {
      return;
    }
    const std::size_t k = best_[i * size_ + j].between;
    out.push_back({i, k, j});
    collect(i, k, out);
    collect(k, j, out);
  }

  const FitState& state_;
  const Hole& hole_;
  const FitLimits& limits_;
  double limit_;
  std::size_t size_;
  std::vector<Best> best_;  // by first and last node
  std::vector<Index> guess_;
  std::vector<Residual> residuals_;
};

}  // namespace

bool remove_node(FitState& state, Index node, double limit) {
  FitMesh& mesh = state.mesh;
  if (mesh.is_held(node)) {
    return false;
  }
  const auto hole = hole_around(mesh, node);
  if (!hole) {
    return false;
  }
  Trial trial;
  trial.limits = state.limits;
  for (const Index t : hole->triangles) {
    gather(state, t, trial);
    ease_limits(state, t, trial.limits);
  }
  Cover cover(state, *hole, trial.limits, limit);
  std::vector<std::array<Index, 3>> nodes, slots;
  for (const auto& corners : cover.run()) {
    slots.push_back(cover.slots_of(corners));
    PlacedPatch patch;
    patch.shape = cover.shape_of(corners);
    nodes.push_back({hole->nodes[corners[0]], hole->nodes[corners[1]], hole->nodes[corners[2]]});
    patch.guesses = state.patches[hole->triangles[0]].guesses;
    trial.patches.push_back(std::move(patch));
  }
  if (nodes.empty()) {
    return false;
  }
  link(state, nodes, hole->triangles, trial);
  place_node(state.samples(), trial.patches, trial.points, trial.limits, limit, 0, trial.node);
  if (!(trial.node.error <= limit)) {
    return false;
  }
  for (const Index t : hole->triangles) {
    state.patches[t] = {};
    mesh.remove_triangle(t);
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (mesh.normals[slots[i][k]] != trial.patches[i].shape.normals[k]) {
        slots[i][k] = mesh.add_slot(trial.patches[i].shape.normals[k], mesh.sectors[slots[i][k]]);
      }
    }
    const Index t = mesh.add_triangle(nodes[i], slots[i]);
    PlacedPatch& p = trial.patches[i];
    state.patches[t] = {std::move(p.guesses), std::move(p.attached), std::move(p.residuals), p.error};
  }
  return true;
}

}  // namespace tunica
