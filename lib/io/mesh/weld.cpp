#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <bit>

namespace tunica {
namespace {

constexpr Index none = 0xffffffff;

/// Equal for equal coordinates: -0 becomes 0.
std::array<std::uint64_t, 3> key_of(const Vec3& vertex) {
  return {std::bit_cast<std::uint64_t>(vertex.x() + 0.0), std::bit_cast<std::uint64_t>(vertex.y() + 0.0),
          std::bit_cast<std::uint64_t>(vertex.z() + 0.0)};
}

std::uint64_t mix(std::uint64_t value) {  // the finaliser of splitmix64
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

std::uint64_t hash_of(const std::array<std::uint64_t, 3>& key) {
  return mix(mix(mix(key[0] + 0x9e3779b97f4a7c15ULL) ^ key[1]) ^ key[2]);
}

}  // namespace

void weld_exactly(TriangleMesh& mesh) {
  const std::vector<Vec3>& vertices = mesh.vertices;
  const std::size_t slots = std::bit_ceil(2 * vertices.size() + 1);
  std::vector<Index> table(slots, none);
  std::vector<Index> first_equal(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const auto key = key_of(vertices[v]);
    std::size_t slot = hash_of(key) & (slots - 1);
    while (table[slot] != none && key_of(vertices[table[slot]]) != key) {
      slot = (slot + 1) & (slots - 1);
    }
    if (table[slot] == none) {
      table[slot] = narrow<Index>(v);
    }
    first_equal[v] = table[slot];
  }

  std::vector<Index> renumbered(vertices.size(), none);
  for (auto& triangle : mesh.triangles) {
    for (Index& corner : triangle) {
      corner = first_equal[corner];
      renumbered[corner] = 0;
    }
  }
  std::vector<Vec3> kept;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (renumbered[v] != none) {
      renumbered[v] = narrow<Index>(kept.size());
      kept.push_back(vertices[v]);
    }
  }
  for (auto& triangle : mesh.triangles) {
    for (Index& corner : triangle) {
      corner = renumbered[corner];
    }
  }
  mesh.vertices = std::move(kept);
}

}  // namespace tunica
