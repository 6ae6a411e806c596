#include "tunica/io/mesh/surface_doubts.hpp"

#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/seams.hpp"
#include "tunica/surface/repair/repair.hpp"

#include <fmt/format.h>

namespace tunica {
namespace {

std::string near(const Vec3& p) { return fmt::format("near ({:.4g}, {:.4g}, {:.4g})", p.x(), p.y(), p.z()); }

std::size_t seams_after_repair(const TriangleMesh& mesh) {
  try {
    return find_seams(repaired(mesh).mesh).edges;
  } catch (const InputError&) {  // nothing would be left
    return mesh.triangles.size();
  }
}

// What helps against seams: what was tried here.
std::string remedy_of_seams(const TriangleMesh& mesh, const Seams& seams, const std::filesystem::path& path) {
  const std::size_t left = seams_after_repair(mesh);
  if (left >= seams.edges) {
    return "these cannot be joined (three triangles would meet in an edge, or the surface would have one side only): "
           "mend them in the program that made the mesh, or leave them out of account";
  }
  return fmt::format("tunica-decimate {} OUT.ply --repair --triangles {} joins {} and keeps all else", path.string(),
                     2 * mesh.triangles.size(), left == 0 ? "them" : fmt::format("{} of them", seams.edges - left));
}

}  // namespace

std::vector<Warning> seam_warnings(const TriangleMesh& mesh, const MeshFacts& facts, const std::filesystem::path& path,
                                   Weight weight) {
  std::vector<Warning> warnings;
  if (facts.closed) {
    return warnings;
  }
  const Seams seams = find_seams(mesh);
  if (seams.edges == 0) {
    return warnings;
  }
  const std::string advice = remedy_of_seams(mesh, seams, path);
  if (seams.whole_edges > 0) {
    warnings.push_back(
        {weight, "open seam",
         fmt::format("{}: {} of its {} boundary edges lie on one another, the first {}: the surface looks whole there "
                     "but is open, and counts as cut along them; {}",
                     path.string(), seams.whole_edges, facts.boundary_edges, near(seams.place), advice)});
  }
  if (seams.t_junctions > 0) {
    warnings.push_back(
        {weight, "T-junctions",
         fmt::format("{}: {} long edges meet two or more shorter ones (T-junctions), the first {}: the surface is open "
                     "along them, and counts as cut there; {}",
                     path.string(), seams.t_junctions, near(seams.t_place), advice)});
  }
  return warnings;
}

std::optional<std::string> why_unfit_surface(const TriangleMesh& mesh, const MeshFacts& facts) {
  std::optional<std::string> why = why_unfit(facts);
  // At T-junctions the two sides share vertices and no edges: what is to be seen there is not that they touch.
  if (why && facts.non_finite_vertices + facts.non_manifold_edges + facts.duplicate_triangles == 0) {
    if (const Seams seams = find_seams(mesh); seams.t_junctions > 0) {
      why =
          fmt::format("{} long edges meet two or more shorter ones (T-junctions), the first {}: it is open along them",
                      seams.t_junctions, near(seams.t_place));
    }
  }
  return why;
}

std::string facing_phrase(const Facing& facing) {
  return facing.inward == facing.pieces
             ? "its normals point inward"
             : fmt::format("{} of its {} pieces have normals that point the wrong way, the largest {}", facing.inward,
                           facing.pieces, near(facing.place));
}

std::vector<Warning> pressed_side_warnings(const TriangleMesh& mesh, double pressure,
                                           const std::filesystem::path& path) {
  std::vector<Warning> warnings;
  const Facing facing = facing_of(mesh);
  if (facing.outermost_inward > 0) {
    warnings.push_back(
        {Weight::major, "faces inward",
         fmt::format("{}: {}: positive pressure pushes along the normals, so here into the organ, and the {} pressure "
                     "given pushes {}; to have positive pressure push outward fit the shells anew with tunica-relax, "
                     "which turns normals outward, or give the pressure the other sign",
                     path.string(), facing_phrase(facing), pressure < 0 ? "negative" : "positive",
                     pressure < 0 ? "outward" : "inward")});
  }
  if (facing.bulging > 0) {
    warnings.push_back(
        {Weight::minor, "faces inward",
         fmt::format("{}: is open and bulges away from its normals: positive pressure pushes along these, so here "
                     "against the bulge; if the pressure is meant to fill it, give it the other sign, or turn the "
                     "triangles around",
                     path.string())});
  }
  if (facing.hollows > 0) {
    warnings.push_back(
        {Weight::major, "nested surfaces",
         fmt::format(
             "{}: {} of its {} pieces lie within others and face the other way, as hollows do, the largest {}: "
             "positive pressure pushes them into the hollow; fill it (--fill-cavities of tunica-extract, "
             "FILL=1); of a wall that is open at its ends take one face (--face inner); or take each surface as "
             "a body of its own",
             path.string(), facing.hollows, facing.pieces, near(facing.hollow_place))});
  }
  return warnings;
}

}  // namespace tunica
