#include "shell/flat_pieces.hpp"

#include "surface/incidence.hpp"

#include <algorithm>

namespace tunica {

FlatPieces flat_pieces(const ShellMesh& shell, const std::vector<CubicPatch>& patches,
                       const std::vector<std::array<Index, 3>>& across, const std::vector<Index>& chosen, int level,
                       double gap, bool joined) {
  FlatPieces out;
  const auto m = static_cast<std::size_t>(level);
  constexpr Index none = 0xffffffff;
  std::vector<Index> place(patches.size(), none);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    place[chosen[i]] = static_cast<Index>(i);
  }
  std::vector<Index> node(shell.vertices.size(), none);
  // Numbers of the level + 1 vertices along each edge of each chosen patch, in the patch's direction.
  std::vector<std::array<std::vector<Index>, 3>> along(chosen.size());
  const std::array<Vec2, 3> corner{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Index t = chosen[i];
    const auto& v = shell.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      auto& edge = along[i][k];
      if (!edge.empty()) {
        continue;
      }
      std::size_t l = 3;
      const Index other = joined ? across[t][k] : no_neighbour;
      for (std::size_t j = 0; other != no_neighbour && place[other] != none && j < 3; ++j) {
        l = shell.triangles[other][j] == v[(k + 1) % 3] && shell.triangles[other][(j + 1) % 3] == v[k] ? j : l;
      }
      const auto across_at = [&](double part) -> Vec3 {
        return patches[other].point(part * corner[l] + (1 - part) * corner[(l + 1) % 3]);
      };
      // Curves over the same chord part most about where one of them has bent most.
      for (const double part : {0.25, 0.5, 0.75}) {
        if (l < 3 && (patches[t].point((1 - part) * corner[k] + part * corner[(k + 1) % 3]) - across_at(part)).norm() >
                         2 * gap) {
          l = 3;
        }
      }
      edge.resize(m + 1);
      for (std::size_t s = 0; s <= m; ++s) {
        const bool end = s == 0 || s == m;
        const Index n = v[s == 0 ? k : (k + 1) % 3];
        if (end && joined && node[n] != none) {
          edge[s] = node[n];
          continue;
        }
        const double part = static_cast<double>(s) / level;
        Vec3 p = end ? shell.vertices[n] : patches[t].point((1 - part) * corner[k] + part * corner[(k + 1) % 3]);
        if (!end && l < 3) {
          p = (p + across_at(part)) / 2;
        }
        edge[s] = static_cast<Index>(out.mesh.vertices.size());
        out.mesh.vertices.push_back(p);
        if (end && joined) {
          node[n] = edge[s];
        }
      }
      if (l < 3) {
        along[place[other]][l].assign(edge.rbegin(), edge.rend());
      }
    }
  }
  std::vector<Index> number((m + 1) * (m + 2) / 2);
  std::vector<double> off(number.size());
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const CubicPatch& patch = patches[chosen[i]];
    const auto at = [&](std::size_t c, std::size_t r) { return r * (2 * m + 3 - r) / 2 + c; };
    for (std::size_t r = 0; r <= m; ++r) {
      for (std::size_t c = 0; c + r <= m; ++c) {
        const Vec3 p = patch.point(Vec2(static_cast<double>(c) / level, static_cast<double>(r) / level));
        Index& n = number[at(c, r)];
        if (r == 0) {
          n = along[i][0][c];
        } else if (c + r == m) {
          n = along[i][1][r];
        } else if (c == 0) {
          n = along[i][2][m - r];
        } else {
          n = static_cast<Index>(out.mesh.vertices.size());
          out.mesh.vertices.push_back(p);
        }
        off[at(c, r)] = (out.mesh.vertices[n] - p).norm();
      }
    }
    const double flat = flatness(patch, level);
    const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
      out.mesh.triangles.push_back({number[a], number[b], number[c]});
      out.deviation.push_back(flat + std::max({off[a], off[b], off[c]}));
    };
    for (std::size_t r = 0; r < m; ++r) {
      for (std::size_t c = 0; c + r < m; ++c) {
        add(at(c, r), at(c + 1, r), at(c, r + 1));
        if (c + 1 + r < m) {
          add(at(c + 1, r), at(c + 1, r + 1), at(c, r + 1));
        }
      }
    }
  }
  return out;
}

}  // namespace tunica
