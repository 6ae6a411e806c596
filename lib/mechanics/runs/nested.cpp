#include "tunica/mechanics/runs/detail/nested.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/distance/signed_distance.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tunica {
namespace {

struct ClosedPiece {
  std::vector<std::array<Index, 3>> triangles;
  double volume = 0;  ///< mm^3; below zero where it faces inward
};

/// The closed pieces, connected through edges.
std::vector<ClosedPiece> closed_pieces(const TriangleMesh& surface) {
  const auto across = neighbours(surface, incidence(surface));
  std::vector<ClosedPiece> pieces;
  std::vector<char> seen(surface.triangles.size(), 0);
  for (std::size_t first = 0; first < seen.size(); ++first) {
    if (seen[first] != 0) {
      continue;
    }
    seen[first] = 1;
    std::vector<Index> waiting{narrow<Index>(first)};
    ClosedPiece piece;
    bool closed = true;
    while (!waiting.empty()) {
      const Index t = waiting.back();
      waiting.pop_back();
      const auto& v = surface.triangles[t];
      piece.triangles.push_back(v);
      piece.volume += surface.vertices[v[0]].dot(surface.vertices[v[1]].cross(surface.vertices[v[2]])) / 6;
      for (const Index other : across[t]) {
        closed = closed && other != no_neighbour;
        if (other != no_neighbour && seen[other] == 0) {
          seen[other] = 1;
          waiting.push_back(other);
        }
      }
    }
    if (closed) {
      pieces.push_back(std::move(piece));
    }
  }
  return pieces;
}

}  // namespace

std::size_t triangles_of_cavities(const TriangleMesh& surface) {
  const std::vector<ClosedPiece> pieces = closed_pieces(surface);
  std::size_t count = 0;
  std::vector<char> counted(pieces.size(), 0);
  for (const ClosedPiece& around : pieces) {
    const auto may_hold = [&](const ClosedPiece& inner) {
      return inner.volume * around.volume < 0 && std::abs(inner.volume) < std::abs(around.volume);
    };
    if (std::ranges::none_of(pieces, may_hold)) {
      continue;
    }
    const SignedDistance distance(without_unused({surface.vertices, around.triangles}));
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (counted[i] != 0 || !may_hold(pieces[i])) {
        continue;
      }
      const double off = distance.at(surface.vertices[pieces[i].triangles.front().front()]).distance;
      if ((around.volume > 0 ? off : -off) < 0) {
        counted[i] = 1;
        count += pieces[i].triangles.size();
      }
    }
  }
  return count;
}

}  // namespace tunica
