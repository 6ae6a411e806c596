#include "tunica/chain/error_map.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/shell/patch/patch_edges.hpp"
#include "tunica/shell/patch/tessellate_conforming.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/subdivide.hpp"

#include <algorithm>
#include <cmath>

namespace tunica::chain {

void MapFiles::announce(const Context& context) const {
  for (const auto& [path, endings] :
       {std::pair(map, std::vector<std::string>{".ply"}), {picture, {".png"}}, {curved, surface_endings()}}) {
    if (path) {
      context.writes(*path, endings);
    }
  }
}

ErrorMap map_of_shells(const ShellMesh& shell, const ClosestPoint& to, std::size_t most) {
  const double per_shell = real(most) / real(shell.triangles.size());
  const Tessellation fine = tessellate_uniformly(shell, std::clamp(truncated<int>(std::sqrt(per_shell)), 4, 24));
  ErrorMap map{fine.mesh, vertex_distances(fine.mesh, to), {}};
  for (const auto& [from, to_vertex] : patch_edges(fine)) {
    map.edges.push_back({fine.mesh.vertices[from], fine.mesh.vertices[to_vertex]});
  }
  return map;
}

ErrorMap map_of_facets(const TriangleMesh& mesh, const ClosestPoint& to, std::size_t most, double diagonal) {
  constexpr double longest_edge = 1.0 / 200;       // of the diagonal
  constexpr std::size_t most_with_edges = 20'000;  // else these hide the colours
  ErrorMap map;
  map.mesh = subdivided(mesh, longest_edge * diagonal, most);
  map.distances = vertex_distances(map.mesh, to);
  if (mesh.triangles.size() <= most_with_edges) {
    for (const auto& triangle : mesh.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        map.edges.push_back({mesh.vertices[triangle[k]], mesh.vertices[triangle[(k + 1) % 3]]});
      }
    }
  }
  return map;
}

void write_curved(const std::filesystem::path& path, const ShellMesh& shell, double diagonal, const PlyOptions& ply) {
  constexpr double deviation = 0.8e-5;  // of the diagonal; 1e-5, which is promised, may be taken of either surface
  write_surface(path,
                shell.patch == Patch::watertight ? tessellate_conforming(shell, deviation * diagonal)
                                                 : tessellate(shell, deviation * diagonal).mesh,
                ply);
}

FilesTogether::~FilesTogether() {
  for (const std::filesystem::path& path : written_) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
}

void write_map(const MapFiles& out, const ErrorMap& map, PictureOptions look, const PlyOptions& ply,
               const Context& context, FilesTogether& written) {
  if (out.map) {
    write_ply(*out.map, map.mesh, map.distances, ply);
    written.add(*out.map);
  }
  if (out.picture) {
    if (out.picture_range) {
      look.maximum = out.picture_range->millimetres(*look.diagonal);
    }
    look.lines = map.edges;
    look.axes = ply.space;
    write_file(*out.picture, png_made_by(surface_picture(map.mesh, map.distances, look), context.made_by()),
               context.overwrite);
  }
}

}  // namespace tunica::chain
