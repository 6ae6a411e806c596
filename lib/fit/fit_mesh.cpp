#include "tunica/fit/detail/fit_mesh.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
NormalsAcross FitPiece::normals_across(const FitPatch& p) const {
  NormalsAcross out;
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = {normals[p.across[k][0]], normals[p.across[k][1]]};
  }
  return out;
}

CubicPatch FitPiece::surface(const FitPatch& p) const {
  return kind == Patch::watertight ? watertight_patch(corners(p), corner_normals(p), normals_across(p))
                                   : comas_patch(corners(p), corner_normals(p));
}

Vec3 FitPiece::facing(const FitPatch& p) const {
  const auto c = corners(p);
  return (c[1] - c[0]).cross(c[2] - c[0]).stableNormalized();
}

double FitPiece::longest_edge(const FitPatch& p) const {
  const auto c = corners(p);
  return std::sqrt(std::max({(c[1] - c[0]).squaredNorm(), (c[2] - c[1]).squaredNorm(), (c[0] - c[2]).squaredNorm()}));
}

double shape_shortfall(const FitPiece& piece, const FitPatch& patch, const FacetLimits& limits) {
  const auto c = piece.corners(patch);
  const double angle = 1 - smallest_angle_degrees(c[0], c[1], c[2]) / limits.min_angle;
  const double agreement = normal_agreement(c, piece.corner_normals(patch));
  const double length = piece.longest_edge(patch) / limits.longest - 1;
  const auto squared = [](double shortfall) { return shortfall > 0 ? shortfall * shortfall : 0; };
  return squared(angle) + squared(1 - agreement / limits.agreement) + squared(length) +
         (agreement < fit_agreement ? no_shell : 0);
}

FitMesh::FitMesh(const ShellMesh& shell) {
  kind = shell.patch;
  positions = shell.vertices;
  free.assign(positions.size(), 1);
  around.resize(positions.size());
  std::vector<std::vector<Index>> of_node(positions.size());
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    std::array<Index, 3> slots{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Index node = shell.triangles[t][k];
      const Vec3& n = shell.normal(t, k);
      auto& known = of_node[node];
      const auto same = std::find_if(known.begin(), known.end(), [&](Index s) { return normals[s] == n; });
      if (same != known.end()) {
        slots[k] = *same;
        continue;
      }
      slots[k] = narrow<Index>(normals.size());
      known.push_back(slots[k]);
      normals.push_back(n);
      node_of_slot.push_back(node);
    }
    add_patch(shell.triangles[t], slots);
  }
  for (Index t = 0; t < patches.size(); ++t) {
    refresh(t);
  }
}

std::array<Index, 2> FitMesh::on_edge(Index u, Index v) const {
  std::array<Index, 2> found{no_index, no_index};
  std::size_t n = 0;
  for (const Index t : around[u]) {
    if (patches[t].has(v) && n < 2) {
      found[n++] = t;
    }
  }
  return found;
}

bool FitMesh::is_feature(Index u, Index v) const {
  const auto [s, t] = on_edge(u, v);
  if (t == no_index) {
    return true;
  }
  const FitPatch &p = patches[s], &q = patches[t];
  return p.slots[p.corner_of(u)] != q.slots[q.corner_of(u)] || p.slots[p.corner_of(v)] != q.slots[q.corner_of(v)];
}

int FitMesh::rank(Index node) const {
  int ends = 0;  // inner features are met from both sides
  for (const Index t : around[node]) {
    const FitPatch& p = patches[t];
    const std::size_t leaving = p.corner_of(node);
    for (const std::size_t k : {leaving, (leaving + 2) % 3}) {
      ends += (p.boundary >> k & 1) != 0 ? 2 : p.is_creased(k) ? 1 : 0;
    }
  }
  return ends == 0 ? 0 : ends == 4 ? 1 : 2;
}

std::vector<Index> FitMesh::ring(Index node) const {
  std::vector<Index> out;
  for (const Index t : around[node]) {
    for (const Index v : patches[t].nodes) {
      if (v != node) {
        out.push_back(v);
      }
    }
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::vector<std::array<Index, 2>> FitMesh::edges() const {
  std::vector<std::array<Index, 2>> out;
  for (const FitPatch& p : patches) {
    for (std::size_t k = 0; p.is_alive() && k < 3; ++k) {
      const Index u = p.nodes[k], v = p.nodes[(k + 1) % 3];
      if (u < v || (p.boundary >> k & 1) != 0) {
        out.push_back({std::min(u, v), std::max(u, v)});
      }
    }
  }
  return out;
}

double FitMesh::area() const {
  double area = 0;
  for (const FitPatch& p : patches) {
    if (p.is_alive()) {
      const auto c = corners(p);
      area += triangle_area(c[0], c[1], c[2]);
    }
  }
  return area;
}

double FitMesh::mean_edge() const {
  return std::sqrt(4 / std::sqrt(3.0) * area() / real(std::max<std::size_t>(alive, 1)));
}

Index FitMesh::add_patch(const std::array<Index, 3>& nodes, const std::array<Index, 3>& slots) {
  Index t = narrow<Index>(patches.size());
  if (places.empty()) {
    patches.emplace_back();
  } else {
    t = places.back();
    places.pop_back();
  }
  patches[t].nodes = nodes;
  patches[t].slots = slots;
  for (const Index v : nodes) {
    around[v].push_back(t);
  }
  ++alive;
  return t;
}

void FitMesh::remove_patch(Index t) {
  for (const Index v : patches[t].nodes) {
    auto& list = around[v];
    list.erase(std::find(list.begin(), list.end(), t));
  }
  patches[t] = {};
  places.push_back(t);
  --alive;
}

void FitMesh::refresh(Index t) {
  FitPatch& p = patches[t];
  p.boundary = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index from = p.nodes[k], to = p.nodes[(k + 1) % 3];
    const auto pair = on_edge(from, to);
    const Index other = pair[0] == t ? pair[1] : pair[0];
    p.across[k] = {p.slots[k], p.slots[(k + 1) % 3]};
    if (other == no_index) {
      p.boundary |= narrow<EdgeBits>(1U << k);
    } else {
      const FitPatch& q = patches[other];
      p.across[k] = {q.slots[q.corner_of(from)], q.slots[q.corner_of(to)]};
    }
  }
}

ShellMesh FitMesh::shell(std::vector<Index>* kept) const {
  ShellMesh out;
  out.patch = kind;
  std::vector<Index> number(positions.size(), no_index), first_slot(positions.size(), no_index);
  for (std::size_t node = 0; node < positions.size(); ++node) {
    if (!around[node].empty()) {
      number[node] = narrow<Index>(out.vertices.size());
      out.vertices.push_back(positions[node]);
    }
  }
  out.normals.assign(out.vertices.size(), Vec3::Zero());
  bool creased = false;
  for (Index t = 0; t < patches.size(); ++t) {
    const FitPatch& p = patches[t];
    if (!p.is_alive()) {
      continue;
    }
    std::array<Index, 3> v{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Index node = p.nodes[k];
      if (first_slot[node] == no_index) {
        first_slot[node] = p.slots[k];
      }
      creased = creased || first_slot[node] != p.slots[k];
      v[k] = number[node];
      out.normals[v[k]] += normals[p.slots[k]];
    }
    out.triangles.push_back(v);
    out.corner_normals.push_back(corner_normals(p));
    if (kept != nullptr) {
      kept->push_back(t);
    }
  }
  // Where sides of a crease meet, the node's own normal is their mean.
  for (std::size_t node = 0; node < positions.size(); ++node) {
    if (number[node] != no_index) {
      Vec3& n = out.normals[number[node]];
      n = creased ? n.stableNormalized() : normals[first_slot[node]];
      if (!(n.squaredNorm() > 0.5)) {
        n = normals[first_slot[node]];
      }
    }
  }
  if (!creased) {
    out.corner_normals.clear();
  }
  return out;
}

}  // namespace tunica
