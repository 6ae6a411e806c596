#include "shell/start_grid.hpp"

#include "surface/measure.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double edges_per_cell = 2;
constexpr unsigned axis_bits = 21;
constexpr double most_cells = (1U << axis_bits) - 1;  // along an axis
constexpr std::uint64_t nothing = ~std::uint64_t{0};
constexpr std::uint64_t golden = 0x9e3779b97f4a7c15;  // spreads keys (Knuth's multiplicative hashing)

double mean_edge(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& v : mesh.triangles) {
    sum += (mesh.vertices[v[1]] - mesh.vertices[v[0]]).norm();
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, mesh.triangles.size()));
}

}  // namespace

StartGrid::StartGrid(const TriangleMesh& mesh) : table_(64, {nothing, 0}) {
  const Box box = bounding_box(mesh);
  origin_ = box.lower;
  cell_ = std::max({edges_per_cell * mean_edge(mesh), (box.upper - box.lower).maxCoeff() / most_cells,
                    std::numeric_limits<double>::min()});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const auto key = key_of((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
    if (!key) {
      continue;
    }
    Slot& slot = table_[place_of(*key)];
    if (slot.key == *key) {
      continue;
    }
    slot = {*key, static_cast<Index>(t)};
    if (++cells_ * 2 > table_.size()) {
      std::vector<Slot> old(2 * table_.size(), {nothing, 0});
      old.swap(table_);
      for (const Slot& s : old) {
        if (s.key != nothing) {
          table_[place_of(s.key)] = s;
        }
      }
    }
  }
}

std::optional<Index> StartGrid::near(const Vec3& p) const {
  const auto key = key_of(p);
  if (!key) {
    return {};
  }
  const Slot& slot = table_[place_of(*key)];
  return slot.key == *key ? std::optional(slot.triangle) : std::nullopt;
}

std::optional<std::uint64_t> StartGrid::key_of(const Vec3& p) const {
  std::uint64_t key = 0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double cell = std::floor((p[i] - origin_[i]) / cell_);
    if (!(cell >= 0 && cell <= most_cells)) {
      return {};
    }
    key = key << axis_bits | static_cast<std::uint64_t>(cell);
  }
  return key;
}

std::size_t StartGrid::place_of(std::uint64_t key) const {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = static_cast<std::size_t>(key * golden >> 20U) & mask;
  while (table_[i].key != nothing && table_[i].key != key) {
    i = (i + 1) & mask;
  }
  return i;
}

}  // namespace tunica
