#include "tunica/report/detail/drawn_shells.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <type_traits>

namespace tunica::report {
namespace {

constexpr Index no_point = ~Index{0};

/// How a shell is cut into level² triangles: all of a result are cut alike.
struct Cut {
  std::vector<std::array<Index, 3>> triangles;  ///< of lattice points
  std::vector<std::array<int, 2>> places;       ///< of the lattice points, times level
};

Cut cut_into(int level) {
  ShellMesh one;
  one.vertices = {Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY()};
  one.triangles = {{0, 1, 2}};
  one.normals.assign(3, Vec3::UnitZ());
  const Tessellation fine = tessellate_uniformly(one, level);
  Cut cut{fine.mesh.triangles, {}};
  for (const Vec2& b : fine.barycentric) {
    cut.places.push_back({static_cast<int>(std::lround(b.x() * level)), static_cast<int>(std::lround(b.y() * level))});
  }
  return cut;
}

// For each lattice point of the coarser cut, the one of the finer cut at the same place.
std::vector<std::size_t> shared_points(const Cut& coarse, const Cut& fine, int ratio) {
  std::map<std::array<int, 2>, std::size_t> at;
  for (std::size_t i = 0; i < fine.places.size(); ++i) {
    at[fine.places[i]] = i;
  }
  std::vector<std::size_t> shared;
  for (const auto& [x, y] : coarse.places) {
    shared.push_back(at.at({x * ratio, y * ratio}));
  }
  return shared;
}

// Sides of a cut's triangles that only one of them has: the rim of the shell.
std::vector<std::array<Index, 2>> rim_of(const Cut& cut) {
  std::map<std::array<Index, 2>, int> count;
  for (const auto& triangle : cut.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = triangle[k];
      const Index b = triangle[(k + 1) % 3];
      ++count[{std::min(a, b), std::max(a, b)}];
    }
  }
  std::vector<std::array<Index, 2>> rim;
  for (const auto& [side, times] : count) {
    if (times == 1) {
      rim.push_back(side);
    }
  }
  return rim;
}

// Gives the mesh only the vertices its triangles use. @return for each of them, which it was
std::vector<Index> drop_unused(TriangleMesh& mesh, std::vector<std::array<Index, 2>>& edges) {
  std::vector<Index> now(mesh.vertices.size(), no_point);
  std::vector<Index> before;
  std::vector<Vec3> vertices;
  for (auto& triangle : mesh.triangles) {
    for (Index& v : triangle) {
      if (now[v] == no_point) {
        now[v] = narrow<Index>(before.size());
        before.push_back(v);
        vertices.push_back(mesh.vertices[v]);
      }
      v = now[v];
    }
  }
  for (auto& edge : edges) {
    edge = {now[edge[0]], now[edge[1]]};
  }
  mesh.vertices = std::move(vertices);
  return before;
}

// Cuts the shells into fewer pieces, by taking points away, and finds their edges.
void cut_into_pieces(DrawnShells& drawn, std::size_t pieces) {
  const Cut fine = cut_into(narrow<int>(drawn.pieces));
  const Cut coarse = cut_into(narrow<int>(pieces));
  const std::vector<std::size_t> shared = shared_points(coarse, fine, narrow<int>(drawn.pieces / pieces));
  const std::vector<std::array<Index, 2>> rim = rim_of(coarse);
  std::vector<std::array<Index, 3>> triangles;
  std::vector<Index> point(fine.places.size());
  for (std::size_t shell = 0; shell < drawn.shells; ++shell) {
    for (std::size_t i = 0; i < fine.triangles.size(); ++i) {
      const auto& corners = drawn.reference.triangles[shell * fine.triangles.size() + i];
      for (std::size_t k = 0; k < 3; ++k) {
        point[fine.triangles[i][k]] = corners[k];
      }
    }
    for (const auto& [a, b, c] : coarse.triangles) {
      triangles.push_back({point[shared[a]], point[shared[b]], point[shared[c]]});
    }
    for (const auto& [a, b] : rim) {
      const auto ends = std::minmax(point[shared[a]], point[shared[b]]);
      drawn.edges.push_back({ends.first, ends.second});
    }
  }
  drawn.reference.triangles = std::move(triangles);
  std::ranges::sort(drawn.edges);
  drawn.edges.erase(std::unique(drawn.edges.begin(), drawn.edges.end()), drawn.edges.end());
  const std::vector<Index> before = drop_unused(drawn.reference, drawn.edges);
  const auto keep = [&](auto& values) {
    std::remove_reference_t<decltype(values)> kept;
    for (const Index v : before) {
      kept.push_back(values[v]);
    }
    values = std::move(kept);
  };
  for (DrawnResult::State& state : drawn.states) {
    keep(state.displacement);
    keep(state.membrane);
    keep(state.von_mises);
  }
  drawn.pieces = pieces;
}

/// Where a coarser mesh of a surface has its vertices, and what the surface has there.
class Coarser {
public:
  Coarser(const TriangleMesh& fine, std::size_t triangles) : fine_(fine), mesh_(thinned(fine, triangles)) {
    const ClosestPoint tree(fine);
    for (const Vec3& p : mesh_.vertices) {
      const ClosestPoint::Hit hit = tree.closest(p);
      const auto places = tree.corners(hit.triangle);
      at_.push_back({hit.triangle, barycentric(hit.point, places[0], places[1], places[2])});
    }
  }

  [[nodiscard]] const TriangleMesh& mesh() const { return mesh_; }

  /// Linear between the corners of the fine triangles.
  template <typename Value>
  [[nodiscard]] std::vector<Value> values(const std::vector<Value>& of_fine) const {
    std::vector<Value> values;
    for (const auto& [triangle, weights] : at_) {
      const auto& v = fine_.triangles[triangle];
      values.push_back(weights[0] * of_fine[v[0]] + weights[1] * of_fine[v[1]] + weights[2] * of_fine[v[2]]);
    }
    return values;
  }

private:
  struct At {
    Index triangle;
    Vec3 weights;
  };
  const TriangleMesh& fine_;
  TriangleMesh mesh_;
  std::vector<At> at_;
};

void decimate_shells(DrawnShells& shells, std::size_t triangles) {
  const Coarser coarse(shells.reference, triangles);
  for (DrawnResult::State& state : shells.states) {
    state.displacement = coarse.values(state.displacement);
    state.membrane = coarse.values(state.membrane);
    state.von_mises = coarse.values(state.von_mises);
  }
  shells.edges.clear();
  shells.reference = coarse.mesh();
}

void decimate_solids(DrawnShells& shells, std::size_t triangles) {
  const Coarser coarse(shells.solids, triangles);
  for (DrawnResult::State& state : shells.states) {
    state.of_solids = coarse.values(state.of_solids);
  }
  shells.solids = coarse.mesh();
}

std::string label_of(const DrawnResult& result, const DrawnResult::State& state) {
  if (state.number == 0) {
    return result.is_unloaded ? "Without load" : "As imaged";
  }
  switch (result.kind) {
    case DrawnResult::Kind::motion:
      return fmt::format("At {:.4g} s", state.time);
    case DrawnResult::Kind::frequencies:
      return fmt::format("Mode {}, {:.4g} Hz", state.number, state.time);
    case DrawnResult::Kind::buckling:
      return fmt::format("Mode {}, load × {:.4g}", state.number, state.time);
    default:
      const bool is_whole = state.load_factor == 1 && &state == &result.states.back();
      return is_whole ? "Loaded" : fmt::format("Load × {:.4g}", state.load_factor);
  }
}

}  // namespace

std::vector<std::string> labels_of(const DrawnResult& result) {
  std::vector<std::string> labels;
  for (const DrawnResult::State& state : result.states) {
    labels.push_back(label_of(result, state));
  }
  return labels;
}

TriangleMesh thinned(const TriangleMesh& mesh, std::size_t triangles) {
  if (mesh.triangles.size() <= triangles) {
    return mesh;
  }
  DecimateOptions options;
  options.triangles = triangles;
  options.levelled = false;
  return decimate(mesh, options).mesh;
}

DrawnShells thinned(DrawnResult result, std::size_t triangles) {
  DrawnShells drawn{std::move(result), {}, {}};
  std::size_t pieces = drawn.pieces;
  while (pieces > 1 && (drawn.pieces % pieces != 0 || pieces * pieces * drawn.shells > triangles)) {
    --pieces;
  }
  cut_into_pieces(drawn, pieces);
  if (drawn.reference.triangles.size() > triangles) {
    decimate_shells(drawn, triangles);
  }
  if (drawn.solids.triangles.size() > triangles) {
    decimate_solids(drawn, triangles);
  }
  return drawn;
}

}  // namespace tunica::report
