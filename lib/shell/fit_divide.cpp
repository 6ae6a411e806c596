#include "shell/fit_divide.hpp"

#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "shell/fit_boundary_edges.hpp"
#include "shell/fit_region.hpp"
#include "shell/patch_search.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <memory>

namespace tunica {
namespace {

constexpr std::size_t grain = 2048;
constexpr double turned_by = 1;  // radians

/// Numbers 0 ... count - 1 of what lies side by side, of as many nodes each: cut at planes across the longest extent.
class Halving {
public:
  Halving(const FitMesh& mesh, std::size_t count, int turn)
      : part_(mesh.positions.size(), no_index), at_(mesh.positions.size()) {
    const Eigen::AngleAxisd rotation(turned_by * turn, Vec3(1, 2, 3).normalized());
    std::vector<Index> nodes;
    for (Index v = 0; v < mesh.positions.size(); ++v) {
      if (!mesh.around[v].empty()) {
        nodes.push_back(v);
        at_[v] = rotation * mesh.positions[v];
      }
    }
    halve(nodes, 0, nodes.size(), 0, count);
  }

  [[nodiscard]] Index of(Index node) const { return part_[node]; }

private:
  void halve(std::vector<Index>& nodes, std::size_t begin, std::size_t end, std::size_t first, std::size_t count) {
    if (count == 1) {
      for (std::size_t i = begin; i < end; ++i) {
        part_[nodes[i]] = static_cast<Index>(first);
      }
      return;
    }
    Vec3 lower = at_[nodes[begin]], upper = lower;
    for (std::size_t i = begin; i < end; ++i) {
      lower = lower.cwiseMin(at_[nodes[i]]);
      upper = upper.cwiseMax(at_[nodes[i]]);
    }
    Eigen::Index axis = 0;
    (upper - lower).maxCoeff(&axis);
    const std::size_t half = count / 2, middle = begin + (end - begin) * half / count;
    const auto place = [&](std::size_t i) { return nodes.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(place(begin), place(middle), place(end),
                     [&](Index a, Index b) { return std::pair(at_[a][axis], a) < std::pair(at_[b][axis], b); });
    halve(nodes, begin, middle, first, half);
    halve(nodes, middle, end, first + half, count - half);
  }

  std::vector<Index> part_;
  std::vector<Vec3> at_;
};

/// A piece, and the points that it is to heed.
struct Share {
  std::vector<Index> free;    ///< nodes of the whole that may move
  std::vector<Index> points;  ///< of the whole's samples
  std::vector<Vec3> further, further_boundary;
  std::optional<FitRegion> region;
  std::unique_ptr<FitSamples> samples;
};

/// For each of many points the triangle that is closest, nearly always.
std::vector<Index> closest_triangles(const FitMesh& mesh, const std::vector<Vec3>& points) {
  std::vector<Index> triangles, found(points.size());
  const ShellMesh shell = mesh.shell(&triangles);
  const std::vector<CubicPatch> patches = curved_patches(shell);
  const PatchSearch search(shell, patches);
  parallel_for_blocks(points.size(), grain, [&](std::size_t begin, std::size_t end) {
    std::optional<Index> guess;
    for (std::size_t i = begin; i < end; ++i) {
      found[i] = triangles[search.near(points[i], guess).patch];
    }
  });
  return found;
}

std::vector<Share> divided(const FitSamples& samples, const FitState& state, std::size_t count, int turn) {
  const FitMesh& mesh = state.mesh;
  const Halving halving(mesh, count, turn);
  std::vector<Share> shares(count);
  std::vector<Index> share_of(mesh.triangles.size(), no_index);
  std::vector<Index> ring;
  for (Index v = 0; v < mesh.positions.size(); ++v) {
    if (mesh.around[v].empty() || mesh.is_held(v)) {
      continue;
    }
    const Index own = halving.of(v);
    mesh.ring(v, ring);
    if (std::all_of(ring.begin(), ring.end(), [&](Index other) { return halving.of(other) == own; })) {
      shares[own].free.push_back(v);
      for (const Index t : mesh.around[v]) {
        share_of[t] = own;
      }
    }
  }
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.is_alive(t) && share_of[t] != no_index) {
      auto& points = shares[share_of[t]].points;
      points.insert(points.end(), state.patches[t].attached.begin(), state.patches[t].attached.end());
    }
  }
  const auto& further = samples.further_points();
  const std::vector<Index> closest = closest_triangles(mesh, further);
  for (std::size_t i = 0; i < further.size(); ++i) {
    if (share_of[closest[i]] != no_index) {
      shares[share_of[closest[i]]].further.push_back(further[i]);
    }
  }
  if (const BoundaryEdges edges(mesh); !edges.empty()) {
    for (const Vec3& p : samples.further_boundary_points()) {
      if (const Index share = share_of[edges.closest(p).triangle]; share != no_index) {
        shares[share].further_boundary.push_back(p);
      }
    }
  }
  std::erase_if(shares, [](const Share& share) { return share.free.empty(); });
  return shares;
}

}  // namespace

void change_pieces(FitSamples& samples, FitState& state, std::size_t shells, int turn,
                   const std::function<void(FitSamples&, FitState&)>& change) {
  // An even number: two threads wait for each other as little as one.
  const std::size_t count = std::max<std::size_t>(1, 2 * ((state.mesh.alive + shells) / (2 * shells)));
  std::vector<Share> shares = divided(samples, state, count, turn);
  parallel_for_blocks(shares.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Share& share = shares[i];
      std::sort(share.points.begin(), share.points.end());
      std::vector<SamplePoint> points;
      for (const Index p : share.points) {
        points.push_back(samples.points()[p]);
      }
      share.samples = std::make_unique<FitSamples>(
          samples.of_piece(std::move(points), std::move(share.further), std::move(share.further_boundary)));
      share.region = cut_out(state, share.free, 0, true);
      FitState& piece = share.region->state;
      piece = FitState(*share.samples, std::move(piece.mesh), state.limits);
      piece.attach_closely();
      piece.measure();
      change(*share.samples, piece);
    }
  });
  for (Share& share : shares) {
    const auto& points = share.samples->points();
    for (std::size_t i = share.points.size(); i < points.size(); ++i) {
      share.points.push_back(static_cast<Index>(samples.points().size()));
      samples.add(points[i]);
    }
    for (FitState::Patch& patch : share.region->state.patches) {
      for (Index& p : patch.attached) {
        p = share.points[p];
      }
    }
    put_back(*share.region, state);
  }
  // From patch to patch: attached to a tessellation's nearest triangle, some would be far off that are not.
  state.attach_again();
  state.measure();
}

}  // namespace tunica
