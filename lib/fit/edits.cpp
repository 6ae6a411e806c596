// Every edit is a trial: patches in place of others, one node placed by least squares, all beside the mesh.
#include "tunica/fit/detail/edits.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/fit/detail/least_squares.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <queue>
#include <unordered_map>

namespace tunica {
namespace {

constexpr int placing_steps = 3;  // of least squares, then largest errors, twice

Vec2 middle_of_edge(std::size_t k) {
  const std::array<Vec2, 3> middles{Vec2(0.5, 0), Vec2(0.5, 0.5), Vec2(0, 0.5)};
  return middles[k];
}

/// The edge of a patch between two of its nodes.
std::size_t edge_of(const FitPatch& p, Index u, Index v) {
  const std::size_t a = p.corner_of(u), b = p.corner_of(v);
  return b == (a + 1) % 3 ? a : b;
}

double size_shortfall(double longest, double neighbours, double ratio) {
  const double excess = neighbours > 0 ? std::max(longest / neighbours, neighbours / longest) / ratio - 1 : 0;
  return excess > 0 ? excess * excess : 0;
}

/// Builds the piece of an edit and says what its patches' shapes lack.
class PieceBuilder {
public:
  PieceBuilder(const FitMesh& mesh, const FacetLimits& limits, Trial& trial)
      : mesh_(mesh), limits_(limits), trial_(trial), piece_(trial.piece) {}

  void build() {
    const Edit& edit = trial_.edit;
    piece_.kind = mesh_.kind;
    for (const Edit::Added& added : edit.added) {
      FitPatch p;
      for (std::size_t k = 0; k < 3; ++k) {
        p.nodes[k] = local_node(added.nodes[k]);
        p.slots[k] = local_slot(added.slots[k], p.nodes[k]);
      }
      p.guesses = mesh_.patches[added.like].guesses;
      piece_.patches.push_back(std::move(p));
    }
    outside_.assign(edit.added.size(), {0, 0, 0});
    inside_.assign(edit.added.size(), {no_index, no_index, no_index});
    joins_.assign(edit.added.size(), 0);
    for (std::size_t i = 0; i < edit.added.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        look_across(i, k);
      }
    }
    for (const Index t : edit.removed) {
      const auto& attached = mesh_.patches[t].attached;
      piece_.points.insert(piece_.points.end(), attached.begin(), attached.end());
    }
    std::sort(piece_.points.begin(), piece_.points.end());
  }

  [[nodiscard]] double shortfall() const {
    double sum = 0;
    for (std::size_t i = 0; i < piece_.patches.size(); ++i) {
      const FitPatch& p = piece_.patches[i];
      sum += shape_shortfall(piece_, p, limits_) + joins_[i];
      for (std::size_t k = 0; k < 3; ++k) {
        const double neighbours =
            inside_[i][k] != no_index ? piece_.longest_edge(piece_.patches[inside_[i][k]]) : outside_[i][k];
        sum += size_shortfall(piece_.longest_edge(p), neighbours, limits_.size_ratio);
      }
    }
    return sum;
  }

private:
  Index local_node(Index node) {
    auto& known = trial_.nodes;
    const auto at = std::find(known.begin(), known.end(), node);
    if (at != known.end()) {
      return narrow<Index>(at - known.begin());
    }
    known.push_back(node);
    const auto& others = trial_.edit.others;
    const bool moves = node == trial_.edit.node;
    piece_.positions.push_back(moves ? trial_.edit.starts[0] : mesh_.positions[node]);
    piece_.free.push_back(moves || std::find(others.begin(), others.end(), node) != others.end() ? 1 : 0);
    return narrow<Index>(known.size() - 1);
  }

  Index local_slot(Index slot, Index node) {
    auto& known = trial_.slots;
    const auto at = std::find(known.begin(), known.end(), slot);
    if (at != known.end()) {
      return narrow<Index>(at - known.begin());
    }
    known.push_back(slot);
    const auto& starts = trial_.edit.normals;
    const auto start = std::find_if(starts.begin(), starts.end(), [&](const auto& s) { return s.first == slot; });
    piece_.normals.push_back(start != starts.end() ? start->second : mesh_.normals[slot]);
    piece_.node_of_slot.push_back(node);
    return narrow<Index>(known.size() - 1);
  }

  void look_across(std::size_t i, std::size_t k) {
    const Edit& edit = trial_.edit;
    const Index u = edit.added[i].nodes[k], v = edit.added[i].nodes[(k + 1) % 3];
    FitPatch& p = piece_.patches[i];
    p.across[k] = {p.slots[k], p.slots[(k + 1) % 3]};
    for (std::size_t j = 0; j < edit.added.size(); ++j) {
      const FitPatch& q = piece_.patches[j];
      const std::size_t a = q.corner_of(p.nodes[k]);
      if (j != i && q.has(p.nodes[k]) && q.nodes[(a + 2) % 3] == p.nodes[(k + 1) % 3]) {
        inside_[i][k] = narrow<Index>(j);
        p.across[k] = {q.slots[a], q.slots[(a + 2) % 3]};
      }
    }
    Index other = no_index;
    if (inside_[i][k] == no_index && u < mesh_.around.size() && v < mesh_.around.size()) {
      for (const Index t : mesh_.on_edge(u, v)) {
        if (t != no_index && std::find(edit.removed.begin(), edit.removed.end(), t) == edit.removed.end()) {
          other = t;
        }
      }
    }
    if (other != no_index) {
      const FitPatch& q = mesh_.patches[other];
      p.across[k] = {local_slot(q.slots[q.corner_of(u)], p.nodes[k]),
                     local_slot(q.slots[q.corner_of(v)], p.nodes[(k + 1) % 3])};
      outside_[i][k] = mesh_.longest_edge(q);
    } else if (inside_[i][k] == no_index) {
      p.boundary |= narrow<EdgeBits>(1U << k);
    }
    const auto is_on_feature = [&](Index node) { return (node == edit.node ? edit.rank : mesh_.rank(node)) > 0; };
    if ((p.boundary >> k & 1) == 0 && !p.is_creased(k) && is_on_feature(u) && is_on_feature(v)) {
      joins_[i] += 1;
    }
  }

  const FitMesh& mesh_;
  const FacetLimits& limits_;
  Trial& trial_;
  FitPiece& piece_;
  std::vector<std::array<double, 3>> outside_;  // longest edges of neighbours
  std::vector<std::array<Index, 3>> inside_;    // neighbours within the piece
  std::vector<double> joins_;
};

double largest_error(const FitPiece& piece) {
  double largest = 0;
  for (const FitPatch& p : piece.patches) {
    largest = std::max(largest, p.error);
  }
  return largest;
}

}  // namespace

double shortfall_of(const FitMesh& mesh, const std::vector<Index>& patches, const FacetLimits& limits) {
  double sum = 0;
  for (const Index t : patches) {
    const FitPatch& p = mesh.patches[t];
    sum += shape_shortfall(mesh, p, limits);
    for (std::size_t k = 0; k < 3; ++k) {
      const Index u = p.nodes[k], v = p.nodes[(k + 1) % 3];
      const auto pair = mesh.on_edge(u, v);
      const Index other = pair[0] == t ? pair[1] : pair[0];
      if (other == no_index) {
        continue;
      }
      sum += size_shortfall(mesh.longest_edge(p), mesh.longest_edge(mesh.patches[other]), limits.size_ratio);
      if (!p.is_creased(k) && mesh.rank(u) > 0 && mesh.rank(v) > 0) {
        sum += 1;
      }
    }
  }
  return sum;
}

Trial try_edit(const FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, Edit edit) {
  Trial trial;
  trial.edit = std::move(edit);
  for (const Index t : trial.edit.removed) {
    trial.error_before = std::max(trial.error_before, mesh.patches[t].error);
  }
  trial.shortfall_before = shortfall_of(mesh, trial.edit.removed, limits.shape);
  trial.error = infinity;
  FitPiece& piece = trial.piece;
  PieceBuilder builder(mesh, limits.shape, trial);
  builder.build();
  const auto keeps_shape = [&] {
    trial.shortfall = builder.shortfall();
    return trial.shortfall <= trial.shortfall_before + limits.may_miss;
  };
  bool sound = keeps_shape();
  for (std::size_t i = 1; i < trial.edit.starts.size() && !sound; ++i) {
    const auto moved = std::find(trial.nodes.begin(), trial.nodes.end(), trial.edit.node) - trial.nodes.begin();
    piece.positions[moved] = trial.edit.starts[i];
    sound = keeps_shape();
  }
  const bool wide = !trial.edit.others.empty();
  if (!sound && !wide) {
    return trial;
  }
  samples.attach(piece);
  for (FitPatch& p : piece.patches) {
    samples.measure(piece, p, limits.error);
  }
  SquaresOptions squares;
  squares.shape = limits.shape;
  squares.search_beyond = limits.error;
  const int steps = trial.edit.node == no_index ? 0 : placing_steps;
  for (int step = 0; step < steps; ++step) {
    squares.smooth = wide && step < steps - 1;
    squares.largest = step > 0 && !squares.smooth;
    if (least_squares_step(piece, samples, squares) >= 1 || largest_error(piece) > out_of_reach * limits.error) {
      break;
    }
  }
  if (keeps_shape()) {
    trial.error = largest_error(piece);
  }
  for (FitPatch& p : piece.patches) {
    p.residuals = {};  // measured anew before they are needed again
  }
  return trial;
}

void apply(FitMesh& mesh, Trial&& trial) {
  const Edit& edit = trial.edit;
  for (const Index t : edit.removed) {
    mesh.remove_patch(t);
  }
  if (edit.node != no_index && edit.node >= mesh.positions.size()) {
    mesh.positions.emplace_back();
    mesh.free.push_back(1);
    mesh.around.emplace_back();
  }
  for (const auto& [slot, normal] : edit.normals) {
    if (slot >= mesh.normals.size()) {
      mesh.normals.push_back(normal);
      mesh.node_of_slot.push_back(edit.node);
    }
  }
  for (std::size_t v = 0; v < trial.nodes.size(); ++v) {
    if (trial.piece.free[v] != 0) {
      mesh.positions[trial.nodes[v]] = trial.piece.positions[v];
    }
  }
  for (std::size_t s = 0; s < trial.slots.size(); ++s) {
    mesh.normals[trial.slots[s]] = trial.piece.normals[s];
  }
  std::vector<Index> changed;
  for (std::size_t i = 0; i < edit.added.size(); ++i) {
    const Index t = mesh.add_patch(edit.added[i].nodes, edit.added[i].slots);
    FitPatch &to = mesh.patches[t], &from = trial.piece.patches[i];
    to.attached = std::move(from.attached);
    to.guesses = std::move(from.guesses);
    to.error = from.error;
    changed.push_back(t);
  }
  for (std::size_t i = 0, count = changed.size(); i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const FitPatch& p = mesh.patches[changed[i]];
      for (const Index t : mesh.on_edge(p.nodes[k], p.nodes[(k + 1) % 3])) {
        if (t != no_index) {
          changed.push_back(t);
        }
      }
    }
  }
  for (const Index t : changed) {
    mesh.refresh(t);
  }
}

std::optional<Edit> collapse(const FitMesh& mesh, const FitSamples& samples, Index u, Index v) {
  const auto pair = mesh.on_edge(u, v);
  const std::size_t on_edge = pair[1] != no_index ? 2 : 1;
  const auto ring_u = mesh.ring(u), ring_v = mesh.ring(v);
  std::vector<Index> common;
  std::set_intersection(ring_u.begin(), ring_u.end(), ring_v.begin(), ring_v.end(), std::back_inserter(common));
  if (common.size() != on_edge || mesh.alive <= 4 || ring_u.size() + ring_v.size() < on_edge + 5) {
    return {};
  }
  for (const Index w : common) {
    const bool at_boundary = mesh.ring(w).size() > mesh.around[w].size();
    if (mesh.around[w].size() <= (at_boundary ? 1U : 3U)) {
      return {};
    }
  }
  // The end that is more than the other stays; it takes the other's place in all patches.
  const int rank_u = mesh.rank(u), rank_v = mesh.rank(v), along = mesh.is_feature(u, v) ? 1 : 0;
  const Index kept = rank_u >= rank_v ? u : v, gone = rank_u >= rank_v ? v : u;
  if (std::min(rank_u, rank_v) != along) {
    return {};
  }
  Edit edit;
  edit.node = kept;
  edit.rank = std::max(rank_u, rank_v);
  const auto slot_at = [&](Index t, Index node) { return mesh.patches[t].slots[mesh.patches[t].corner_of(node)]; };
  std::vector<std::pair<Index, Index>> becomes;  // slots of the node that goes: those it becomes
  for (std::size_t i = 0; i < on_edge; ++i) {
    becomes.emplace_back(slot_at(pair[i], gone), slot_at(pair[i], kept));
  }
  edit.removed.assign(pair.begin(), pair.begin() + on_edge);
  for (const Index node : {kept, gone}) {
    for (const Index t : mesh.around[node]) {
      if (t == pair[0] || t == pair[1]) {
        continue;
      }
      edit.removed.push_back(t);
      Edit::Added added{mesh.patches[t].nodes, mesh.patches[t].slots, t};
      if (node == gone) {
        const std::size_t k = mesh.patches[t].corner_of(gone);
        const auto to =
            std::find_if(becomes.begin(), becomes.end(), [&](const auto& b) { return b.first == added.slots[k]; });
        if (to == becomes.end()) {
          return {};
        }
        added.nodes[k] = kept;
        added.slots[k] = to->second;
      }
      edit.added.push_back(added);
    }
  }
  const bool equal = rank_u == rank_v;
  for (const auto& [of_gone, of_kept] : becomes) {
    const Vec3 mean = mesh.normals[of_gone] + mesh.normals[of_kept];
    edit.normals.emplace_back(of_kept, equal && mean.norm() > 1 ? Vec3(mean.normalized()) : mesh.normals[of_kept]);
  }
  if (!equal) {
    edit.starts = {mesh.positions[kept]};
    return edit;
  }
  const Vec3 middle = (mesh.positions[u] + mesh.positions[v]) / 2;
  const Vec3& normal = edit.normals[0].second;
  edit.starts = {along != 0 ? middle : samples.foot(middle, normal).point, mesh.positions[u], mesh.positions[v]};
  if (along == 0) {
    Vec3 sum = Vec3::Zero();
    double count = 0;
    for (const auto* ring : {&ring_u, &ring_v}) {
      for (const Index w : *ring) {
        sum += w == u || w == v ? Vec3(Vec3::Zero()) : mesh.positions[w];
        count += w == u || w == v ? 0 : 1;
      }
    }
    edit.starts.push_back(samples.foot(sum / count, normal).point);
  }
  return edit;
}

std::optional<Edit> flip(const FitMesh& mesh, Index u, Index v) {
  const auto [s, t] = mesh.on_edge(u, v);
  if (t == no_index || mesh.is_feature(u, v)) {
    return {};
  }
  const FitPatch &p = mesh.patches[s], &q = mesh.patches[t];
  // p: a b c; q: b a d.
  const std::size_t k = edge_of(p, u, v), l = edge_of(q, u, v);
  const Index a = p.nodes[k], b = p.nodes[(k + 1) % 3], c = p.nodes[(k + 2) % 3], d = q.nodes[(l + 2) % 3];
  const auto fewest = [&](Index node) { return mesh.ring(node).size() > mesh.around[node].size() ? 1U : 3U; };
  if (c == d || mesh.on_edge(c, d)[0] != no_index || mesh.around[a].size() <= fewest(a) ||
      mesh.around[b].size() <= fewest(b)) {
    return {};
  }
  const Index slot_a = p.slots[k], slot_b = p.slots[(k + 1) % 3], slot_c = p.slots[(k + 2) % 3],
              slot_d = q.slots[(l + 2) % 3];
  Edit edit;
  edit.removed = {s, t};
  edit.added = {{{a, d, c}, {slot_a, slot_d, slot_c}, s}, {{d, b, c}, {slot_d, slot_b, slot_c}, t}};
  return edit;
}

Edit split(const FitMesh& mesh, Index u, Index v) {
  Edit edit;
  edit.node = narrow<Index>(mesh.positions.size());
  edit.rank = mesh.is_feature(u, v) ? 1 : 0;
  Vec3 place = Vec3::Zero();
  double sides = 0;
  for (const Index t : mesh.on_edge(u, v)) {
    if (t == no_index) {
      continue;
    }
    const FitPatch& p = mesh.patches[t];
    const std::size_t k = edge_of(p, u, v);
    const CubicPatch surface = mesh.surface(p);
    const Vec3 normal = surface.normal(middle_of_edge(k));
    place += surface.point(middle_of_edge(k));
    if (edit.normals.empty() || edit.rank > 0) {
      edit.normals.emplace_back(narrow<Index>(mesh.normals.size() + edit.normals.size()), normal);
    } else {
      edit.normals[0].second = (edit.normals[0].second + normal).normalized();
    }
    sides += 1;
    edit.removed.push_back(t);
    for (const std::size_t end : {k, (k + 1) % 3}) {
      Edit::Added half{p.nodes, p.slots, t};
      half.nodes[end] = edit.node;
      half.slots[end] = edit.normals.back().first;
      edit.added.push_back(half);
    }
  }
  edit.starts = {place / sides, (mesh.positions[u] + mesh.positions[v]) / 2};
  return edit;
}

Edit widened(const FitMesh& mesh, Edit edit) {
  for (const Edit::Added& added : edit.added) {
    for (const Index v : added.nodes) {
      if (v != edit.node && std::find(edit.others.begin(), edit.others.end(), v) == edit.others.end()) {
        edit.others.push_back(v);
      }
    }
  }
  std::vector<Index> beyond;
  for (const Index v : edit.others) {
    for (const Index t : mesh.around[v]) {
      if (std::find(edit.removed.begin(), edit.removed.end(), t) == edit.removed.end()) {
        beyond.push_back(t);
      }
    }
  }
  std::sort(beyond.begin(), beyond.end());
  beyond.erase(std::unique(beyond.begin(), beyond.end()), beyond.end());
  for (const Index t : beyond) {
    edit.removed.push_back(t);
    edit.added.push_back({mesh.patches[t].nodes, mesh.patches[t].slots, t});
  }
  return edit;
}

Edit move(const FitMesh& mesh, Index node, const Vec3& start) {
  Edit edit;
  edit.node = node;
  edit.rank = mesh.rank(node);
  edit.starts = {start};
  edit.removed = mesh.around[node];
  for (const Index t : edit.removed) {
    const FitPatch& p = mesh.patches[t];
    edit.added.push_back({p.nodes, p.slots, t});
  }
  return edit;
}

Edit flatten(const FitMesh& mesh, Index node, const Vec3& start) {
  Edit edit = move(mesh, node, start);
  std::vector<Vec3> fan;
  for (const Index t : mesh.around[node]) {
    const FitPatch& p = mesh.patches[t];
    auto c = mesh.corners(p);
    c[p.corner_of(node)] = start;
    fan.emplace_back((c[1] - c[0]).cross(c[2] - c[0]).stableNormalized());
  }
  const FitPatch& first = mesh.patches[mesh.around[node][0]];
  edit.normals.emplace_back(first.slots[first.corner_of(node)], most_compatible_normal(fan).normal);
  return edit;
}

}  // namespace tunica
