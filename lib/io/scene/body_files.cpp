#include "tunica/io/scene/detail/body_files.hpp"

#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/mesh/mesh_pair.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/io/mesh/tet_file.hpp"
#include "tunica/io/scene/detail/scene_names.hpp"
#include "tunica/surface/filling/fill.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <iterator>

namespace tunica {
namespace {

// More would neither be made nor solved on the machines of today.
constexpr double most_tetrahedra = 2e7;

// The facets as they are: every corner carries its facet's normal, so the patches are flat. Node normals are the
// area-weighted means.
void make_flat(ShellMesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Vec3::Zero());
  mesh.corner_normals.clear();
  mesh.corner_normals.reserve(mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    const Vec3 area = (mesh.vertices[triangle[1]] - mesh.vertices[triangle[0]])
                          .cross(mesh.vertices[triangle[2]] - mesh.vertices[triangle[0]]);
    const Vec3 normal = area.stableNormalized();
    mesh.corner_normals.push_back({normal, normal, normal});
    for (const Index v : triangle) {
      mesh.normals[v] += area;
    }
  }
  for (Vec3& normal : mesh.normals) {
    normal = normal.squaredNorm() > 0 ? Vec3(normal.stableNormalized()) : Vec3::UnitZ();
  }
}

// What `read` returns; its errors begin with the place of the file's name. On the command line the file's name is
// place enough.
template <typename Read>
auto read_at(const Places& places, std::string_view key, const std::filesystem::path& mesh, const Read& read) {
  if (places.item.flag) {
    return read();
  }
  try {
    return read();
  } catch (const UsageError&) {
    throw InputError(fmt::format("{}: {} says no unit of length: add unit = \"mm\" beside {}", places.of(key).text,
                                 mesh.string(), key));
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", places.of(key).text, error.what()));
  } catch (const RequirementError& error) {
    throw RequirementError(fmt::format("{}: {}: {}", places.of(key).text, mesh.string(), error.what()));
  }
}

struct BodyMesh {
  MeshFile file;
  bool curved = false;
  ShellMesh shell;
};

// Meshes in different spaces are in different places.
void join_space(const MeshFile& file, const std::filesystem::path& path, BodyFindings& found) {
  common_space(file.space, path, found.space, found.space_of);
  if (file.space && !found.space) {
    found.space = file.space;
    found.space_of = path;
  }
}

BodyMesh read_body_mesh(const SceneShell& shell, BodyFindings& found) {
  return read_at(shell.places, "mesh", shell.mesh, [&] {
    BodyMesh mesh{read_mesh(shell.mesh, shell.unit_mm, true), false, {}};
    const MeshFile& file = mesh.file;
    join_space(file, shell.mesh, found);
    require_no_other_unit(file, shell.unit_mm, shell.mesh);
    if (const auto note = unit_note(file, shell.mesh, shell.unit_mm)) {
      found.warnings.push_back(*note);
    }
    mesh.curved = shell.rest == Rest::curved && !(file.normals.empty() && file.corner_normals.empty());
    mesh.shell = mesh.curved
                     ? shell_of(file, shell.mesh)
                     : ShellMesh{file.mesh.vertices, file.mesh.triangles, {}, {}, file.patch.value_or(Patch::comas)};
    return mesh;
  });
}

// One value per vertex, in the order of the file.
std::vector<double> thickness_of(const SceneShell& shell, const MeshFile& file) {
  if (!shell.thickness_from) {
    return {shell.thickness};
  }
  const Place& place = shell.places.of("thickness_from");
  std::vector<std::string> names;
  for (const auto& [name, values] : file.vertex_properties) {
    if (name == *shell.thickness_from) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        place.require(is_positive(values[i]),
                      fmt::format("{}: '{}' is {} mm at vertex {}: a thickness must be greater than zero",
                                  shell.mesh.string(), name, values[i], i));
      }
      return values;
    }
    names.push_back(name);
  }
  place.fail(fmt::format("{}: has no number '{}' at each vertex (a PLY property): {}{}", shell.mesh.string(),
                         *shell.thickness_from, names.empty() ? "it has none" : "it has ", fmt::join(names, ", ")));
}

// A surface that encloses something, in mm.
TriangleMesh read_closed_surface(const std::filesystem::path& path, std::optional<double> unit_mm, double scale,
                                 BodyFindings& found) {
  MeshFile file = read_mesh(path, unit_mm, true);
  join_space(file, path, found);
  require_no_other_unit(file, unit_mm, path);
  if (const auto note = unit_note(file, path, unit_mm)) {
    found.warnings.push_back(*note);
  }
  const MeshFacts facts = require_surface(file, path);
  if (const auto why = why_unfit(facts, Boundary::forbidden)) {
    throw InputError(fmt::format("{}: {}; it must be closed, to have an inside", path.string(), *why));
  }
  for (Vec3& vertex : file.mesh.vertices) {
    vertex *= scale;
  }
  return std::move(file.mesh);
}

TetMesh fill_surface(const SceneSolid& solid, BodyFindings& found) {
  TriangleMesh surface = read_at(solid.places, "fill", solid.mesh,
                                 [&] { return read_closed_surface(solid.mesh, solid.unit_mm, solid.scale, found); });
  surface = turned_outward(surface, facing_of(surface));
  const double size = *solid.fill_size;
  // A regular tetrahedron has the volume edge^3 / (6 sqrt 2).
  const double expected = 6 * std::sqrt(2.0) * signed_volume(surface) / (size * size * size);
  solid.places.of("size").require(
      expected <= most_tetrahedra,
      fmt::format("would make about {:.2g} tetrahedra (at most {:.0e}): choose a larger size", expected,
                  most_tetrahedra));
  TetMesh mesh = read_at(solid.places, "fill", solid.mesh, [&] { return fill(surface, size); });
  double filled = 0;
  for (const auto& [a, b, c, d] : mesh.tetrahedra) {
    filled += tet_volume(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c], mesh.vertices[d]);
  }
  constexpr double notable = 0.02;
  if (const double whole = std::abs(signed_volume(surface)); std::abs(filled / whole - 1) > notable) {
    found.warnings.push_back(
        {Weight::minor, "volume of a filling",
         fmt::format("{}: its tetrahedra fill {:.4g} of the {:.4g} mm3 that the surface encloses, {:.1f} %: mass and "
                     "stiffness are as much too small: take a smaller size",
                     solid.mesh.string(), filled, whole, 100 * filled / whole)});
  }
  return mesh;
}

RigidMesh load_shape(const SceneRigidMesh& mesh, const SceneRigid& rigid, BodyFindings& found) {
  RigidMesh shape{read_at(rigid.places, "mesh", mesh.mesh,
                          [&] { return read_closed_surface(mesh.mesh, mesh.unit_mm, mesh.scale, found); }),
                  mesh.turn, mesh.expansion};
  if (const Facing facing = facing_of(shape.surface); facing.inward > 0) {
    shape.surface = turned_outward(std::move(shape.surface), facing);
    found.warnings.push_back({Weight::minor, "faces inward",
                              fmt::format("{}: {}: they are turned around, so that the inside is the rigid body",
                                          mesh.mesh.string(), facing_phrase(facing))});
  }
  return shape;
}

}  // namespace

ShellBody load_shell(const SceneShell& shell, BodyFindings& found) {
  BodyMesh read = read_body_mesh(shell, found);
  const TriangleMesh& flat = read.file.mesh;
  const MeshFacts facts = examine(flat);
  std::ranges::copy(seam_warnings(flat, facts, shell.mesh, Weight::major), std::back_inserter(found.warnings));
  if (facts.non_manifold_vertices > 0) {
    found.warnings.push_back(
        {Weight::major, "parts meet in a point",
         fmt::format("{}: {} of its vertices {} parts that touch nowhere else, the first {}: all "
                     "force and moment between them passes there, and the stress around it grows "
                     "with finer shells: separate the parts, or join them along edges",
                     shell.mesh.string(), facts.non_manifold_vertices,
                     facts.non_manifold_vertices == 1 ? "joins" : "join", facts.first_non_manifold_vertex)});
  }
  ShellBody body;
  body.name = shell.name;
  body.said_at = shell.places.item.flag ? shell.mesh.string() : shell.places.item.text;
  body.curved = read.curved;
  body.mesh = std::move(read.shell);
  for (Vec3& vertex : body.mesh.vertices) {
    vertex *= shell.scale;
  }
  if (!body.curved) {
    make_flat(body.mesh);
    if (shell.rest == Rest::curved) {
      found.warnings.push_back({Weight::note, "flat facets",
                                fmt::format("{}: has no normals, so its flat facets are the shell (as rest = "
                                            "\"flat\"); tunica-relax makes curved shells",
                                            shell.mesh.string())});
    }
  }
  body.thickness = thickness_of(shell, read.file);
  if (read.file.voxel) {
    body.voxel = {shell.scale * *read.file.shortest_voxel, shell.scale * *read.file.voxel};
  }
  body.material = shell.material;
  body.membrane = shell.membrane;
  body.bending = shell.bending;
  body.rest = body.curved ? Rest::curved : Rest::flat;
  return body;
}

SolidBody load_solid(const SceneSolid& solid, BodyFindings& found) {
  SolidBody body{solid.name, {}, solid.material, solid.law, solid.places.item.text};
  if (solid.fill_size) {
    body.mesh = fill_surface(solid, found);
  } else {
    TetFile file = read_at(solid.places, "mesh", solid.mesh, [&] {
      TetFile read = read_tetrahedra(solid.mesh, solid.unit_mm, solid.scale);
      (void)boundary_triangles(read.mesh);  // what has no surface is refused with its place
      return read;
    });
    body.mesh = std::move(file.mesh);
    for (const std::string& note : file.notes) {
      found.warnings.push_back({Weight::note, "tetrahedra mended", note});
    }
  }
  return body;
}

RigidBody load_rigid(const SceneRigid& rigid, BodyFindings& found) {
  RigidBody body{rigid.name, RigidSphere{}, rigid.motion, rigid.places.item.text};
  std::visit(
      [&]<typename Shape>(const Shape& shape) {
        if constexpr (std::is_same_v<Shape, SceneRigidMesh>) {
          body.shape = load_shape(shape, rigid, found);
        } else {
          body.shape = shape;
        }
      },
      rigid.shape);
  return body;
}

}  // namespace tunica
