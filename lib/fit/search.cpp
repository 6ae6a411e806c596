// The search: edges collapse in the order of their errors, flip, are mended and split.
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/fit/detail/edits.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <queue>
#include <unordered_map>

namespace tunica {
namespace {

constexpr std::size_t batch_size = 8;    // collapses, whatever the number of threads
constexpr double split_shortfall = 0.1;  // of shapes: as much as keeps a corner's normal fit for a shell

/// An edge that may go, and what that is known or guessed to cost.
struct Candidate {
  double error;
  Index u, v;
  unsigned version;  // of its surroundings when it was tried; 0: never
  bool operator<(const Candidate& o) const { return error != o.error ? error > o.error : u != o.u ? u > o.u : v > o.v; }
};

/// Edges in the order of their errors; tried when their turn comes, tried again when what surrounds them has changed.
class CollapseQueue {
public:
  CollapseQueue(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits)
      : mesh_(mesh), samples_(samples), limits_(limits), version_(mesh.positions.size(), 1) {
    for (const auto& [u, v] : mesh.edges()) {
      push_guess(u, v);
    }
  }

  /// @return whether an edge collapsed
  bool collapse_next() {
    while (!queue_.empty()) {
      if (!is_known(queue_.top())) {
        try_some();
        continue;
      }
      const Candidate best = queue_.top();
      queue_.pop();
      if (mesh_.around[best.u].empty() || mesh_.around[best.v].empty()) {
        continue;
      }
      auto trial = trials_.extract(key(best.u, best.v));
      const Index kept = trial.mapped().edit.node;
      apply(mesh_, std::move(trial.mapped()));
      const auto ring = mesh_.ring(kept);
      ++version_[kept];
      for (const Index w : ring) {
        ++version_[w];
      }
      for (const Index w : ring) {
        push_guess(kept, w);
      }
      return true;
    }
    return false;
  }

private:
  static std::uint64_t key(Index u, Index v) { return (std::uint64_t{u} << 32) | v; }
  [[nodiscard]] unsigned now(Index u, Index v) const { return version_[u] + version_[v]; }
  [[nodiscard]] bool is_known(const Candidate& c) const { return c.version == now(c.u, c.v); }

  [[nodiscard]] Trial attempt(const Candidate& c) const {
    auto edit = collapse(mesh_, samples_, c.u, c.v);
    if (!edit) {
      Trial none;
      none.error = infinity;
      return none;
    }
    return try_edit(mesh_, samples_, limits_, *std::move(edit));
  }

  /// Below the truth: the largest error around.
  void push_guess(Index u, Index v) {
    double error = 0;
    for (const Index node : {u, v}) {
      for (const Index t : mesh_.around[node]) {
        error = std::max(error, mesh_.patches[t].error);
      }
    }
    queue_.push({error, std::min(u, v), std::max(u, v), 0});
  }

  void try_some() {
    std::vector<Candidate> some;
    while (!queue_.empty() && some.size() < batch_size && !is_known(queue_.top())) {
      const Candidate c = queue_.top();
      queue_.pop();
      if (c.error <= limits_.error && !mesh_.around[c.u].empty() && !mesh_.around[c.v].empty()) {
        some.push_back(c);
      }
    }
    std::vector<Trial> trials(some.size());
    parallel_for_blocks(some.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        trials[i] = attempt(some[i]);
      }
    });
    for (std::size_t i = 0; i < some.size(); ++i) {
      if (const double error = trials[i].error; std::isfinite(error) && error <= limits_.error) {
        queue_.push({error, some[i].u, some[i].v, now(some[i].u, some[i].v)});
        trials_.insert_or_assign(key(some[i].u, some[i].v), std::move(trials[i]));
      }
    }
  }

  FitMesh& mesh_;
  const FitSamples& samples_;
  const FitLimits& limits_;
  std::vector<unsigned> version_;
  std::priority_queue<Candidate> queue_;
  std::unordered_map<std::uint64_t, Trial> trials_;  // of edges, the last ones
};

}  // namespace

void collapse_edges(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t shells,
                    const Progress& progress) {
  CollapseQueue queue(mesh, samples, limits);
  const std::size_t before = mesh.alive;
  while (mesh.alive > shells && queue.collapse_next()) {
    tunica::advance(progress, 1 - real(mesh.alive) / real(before));
  }
}

namespace {

double smallest_angle(const FitPiece& piece, const std::vector<Index>& patches) {
  double least = 180;
  for (const Index t : patches) {
    const auto c = piece.corners(piece.patches[t]);
    least = std::min(least, smallest_angle_degrees(c[0], c[1], c[2]));
  }
  return least;
}

}  // namespace

void flip_edges(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits) {
  for (const auto& [u, v] : mesh.edges()) {
    if (auto edit = flip(mesh, u, v)) {
      const double angle = smallest_angle(mesh, edit->removed);
      Trial trial = try_edit(mesh, samples, limits, *std::move(edit));
      if (trial.error < worth_it * trial.error_before ||
          (trial.error <= std::max(worth_it * limits.error, trial.error_before) &&
           smallest_angle(trial.piece, {0, 1}) > angle)) {
        apply(mesh, std::move(trial));
      }
    }
  }
}

namespace {

/// The edits that may mend a patch, the gentlest first.
std::vector<Edit> mendings(const FitMesh& mesh, const FitSamples& samples, Index t, bool may_split, bool may_collapse) {
  std::vector<Edit> out;
  const FitPatch& p = mesh.patches[t];
  const bool is_folded = normal_agreement(mesh.corners(p), mesh.corner_normals(p)) < fit_agreement;
  for (std::size_t k = 0; k < 3; ++k) {
    if (auto edit = flip(mesh, p.nodes[k], p.nodes[(k + 1) % 3])) {
      out.push_back(*std::move(edit));
    }
  }
  for (const Index v : p.nodes) {
    if (mesh.rank(v) == 0) {
      const auto ring = mesh.ring(v);
      Vec3 sum = Vec3::Zero();
      for (const Index w : ring) {
        sum += mesh.positions[w];
      }
      const Vec3 centre = sum / real(ring.size());
      const Vec3 middle = samples.foot(centre, mesh.facing(p)).point;
      out.push_back(move(mesh, v, middle));
      out.push_back(move(mesh, v, (middle + mesh.positions[v]) / 2));
      if (is_folded) {
        for (const double rest : {1.0, 0.5, 0.25, 0.125, 0.0625}) {  // of the height
          out.push_back(flatten(mesh, v, centre + rest * (mesh.positions[v] - centre)));
        }
      }
    }
  }
  std::size_t longest = 0;
  double length = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index u = p.nodes[k], v = p.nodes[(k + 1) % 3];
    if (auto edit = may_collapse ? collapse(mesh, samples, u, v) : std::nullopt) {
      out.push_back(*std::move(edit));
    }
    if (const double its = (mesh.positions[u] - mesh.positions[v]).norm(); its > length) {
      length = its;
      longest = k;
    }
  }
  if (may_split) {
    out.push_back(split(mesh, p.nodes[longest], p.nodes[(longest + 1) % 3]));
  }
  return out;
}

}  // namespace

void mend_shapes(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t most, double above,
                 bool may_collapse) {
  std::vector<std::pair<double, Index>> wanting;
  for (Index t = 0; t < mesh.patches.size(); ++t) {
    if (mesh.patches[t].is_alive()) {
      if (const double shortfall = shortfall_of(mesh, {t}, limits.shape); shortfall > above) {
        wanting.emplace_back(-shortfall, t);
      }
    }
  }
  std::sort(wanting.begin(), wanting.end());
  for (const auto& [shortfall, t] : wanting) {
    if (!mesh.patches[t].is_alive() || shortfall_of(mesh, {t}, limits.shape) <= above) {
      continue;
    }
    std::optional<Trial> best;
    // Folds first, with the least error; then shapes.
    const auto merit = [](const Trial& trial) {
      const double gain = trial.shortfall_before - trial.shortfall, unfolded = std::round(gain / no_shell);
      return std::pair(unfolded, unfolded > 0 ? -trial.error : gain);
    };
    const auto consider = [&](Edit edit) {
      Trial trial = try_edit(mesh, samples, limits, std::move(edit));
      if (trial.error <= std::max(limits.error, trial.error_before) &&
          trial.shortfall < worth_it * trial.shortfall_before && (!best || merit(trial) > merit(*best))) {
        best = std::move(trial);
      }
    };
    auto edits = mendings(mesh, samples, t, mesh.alive + 2 <= most, may_collapse);
    for (const Edit& edit : edits) {
      consider(edit);
    }
    for (std::size_t i = 0; i < edits.size() && !best; ++i) {
      consider(widened(mesh, std::move(edits[i])));
    }
    if (best) {
      apply(mesh, *std::move(best));
    }
  }
}

std::size_t split_worst(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t count) {
  std::vector<std::pair<double, Index>> worst;
  for (Index t = 0; t < mesh.patches.size(); ++t) {
    if (mesh.patches[t].is_alive() && mesh.patches[t].error > limits.error) {
      worst.emplace_back(-mesh.patches[t].error, t);
    }
  }
  std::sort(worst.begin(), worst.end());
  std::size_t done = 0;
  for (const auto& [error, t] : worst) {
    const FitPatch& p = mesh.patches[t];
    if (done >= count || !p.is_alive() || p.error != -error) {
      continue;
    }
    FitLimits anything = limits;  // an error outweighs shapes, which are mended afterwards
    anything.shape.min_angle = limits.shape.min_angle / 2;
    anything.may_miss = split_shortfall;
    Trial trial;
    trial.error = infinity;
    const auto consider = [&](Edit edit) {
      Trial other = try_edit(mesh, samples, anything, std::move(edit));
      if (other.error < trial.error) {
        trial = std::move(other);
      }
    };
    const std::array<Edit, 3> splits{split(mesh, p.nodes[0], p.nodes[1]), split(mesh, p.nodes[1], p.nodes[2]),
                                     split(mesh, p.nodes[2], p.nodes[0])};
    std::for_each(splits.begin(), splits.end(), consider);
    if (!std::isfinite(trial.error)) {  // where nothing keeps its shape the error alone counts
      anything.may_miss = no_shell / 2;
      std::for_each(splits.begin(), splits.end(), consider);
    }
    if (std::isfinite(trial.error) && trial.error > limits.error) {
      consider(widened(mesh, trial.edit));
    }
    for (std::size_t k = 0; k < 3 && !std::isfinite(trial.error); ++k) {
      consider(widened(mesh, splits[k]));
    }
    if (std::isfinite(trial.error)) {
      apply(mesh, std::move(trial));
      ++done;
    }
  }
  return done;
}

}  // namespace tunica
