// Which reader takes a file of tetrahedra, and what holds for the mesh whatever its format.
#include "tunica/io/mesh/tet_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/detail/tet_formats.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace tets {
namespace {

constexpr double farthest = 1e12;  // mm; squares and volumes of larger coordinates would lose all meaning

using Reader = void (*)(std::string_view bytes, const std::string& name, Collector& into);

/// By content where the format begins with a mark, else by the file's extension.
Reader reader_of(std::string_view bytes, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  const std::string_view head = bytes.substr(0, 1024);
  if (head.starts_with("$MeshFormat") || extension == ".msh") {
    return read_msh;
  }
  if (head.starts_with("# vtk DataFile") || extension == ".vtk") {
    return read_vtk;
  }
  if (head.find("<VTKFile") != std::string_view::npos || extension == ".vtu") {
    return read_vtu;
  }
  throw InputError(fmt::format(
      "{}: is no file of tetrahedra of a known format: Gmsh .msh, VTK .vtk and .vtu are understood", path.string()));
}

void scale_to_mm(TetMesh& mesh, double unit_mm, double scale, const std::string& name) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    Vec3& p = mesh.vertices[v];
    p *= unit_mm;
    p *= scale;
    if (!p.allFinite() || !(p.cwiseAbs().maxCoeff() <= farthest)) {
      throw InputError(fmt::format("{}: vertex {} lies at ({}, {}, {}): coordinates must be finite and within {} mm",
                                   name, v, p.x(), p.y(), p.z(), farthest));
    }
  }
}

/// @return how many vertices were left out
std::size_t drop_unused(TetMesh& mesh) {
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const auto& tet : mesh.tetrahedra) {
    for (const Index v : tet) {
      used[v] = true;
    }
  }
  std::vector<Index> number(mesh.vertices.size());
  Index count = 0;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    number[v] = count;
    if (used[v]) {
      mesh.vertices[count++] = mesh.vertices[v];
    }
  }
  const std::size_t dropped = mesh.vertices.size() - count;
  mesh.vertices.resize(count);
  for (auto& tet : mesh.tetrahedra) {
    for (Index& v : tet) {
      v = number[v];
    }
  }
  return dropped;
}

}  // namespace
}  // namespace tets

TetFile read_tetrahedra(const std::filesystem::path& path, std::optional<double> unit_mm, double scale) {
  const std::string name = path.string();
  const std::string bytes = read_file(path);
  const tets::Reader read = tets::reader_of(bytes, path);
  if (!unit_mm) {
    throw InputError(
        fmt::format("{}: is in a format that carries no unit of length: add unit = \"mm\" beside mesh", name));
  }
  if (bytes.empty()) {
    throw InputError(fmt::format("{}: is empty", name));
  }
  tets::Collector collector(name);
  read(bytes, name, collector);
  TetFile file{{std::move(collector.vertices), std::move(collector.tetrahedra)}, collector.notes()};
  tets::scale_to_mm(file.mesh, *unit_mm, scale, name);
  if (const std::size_t turned = require_sound(file.mesh, name); turned > 0) {
    file.notes.push_back(fmt::format("{}: {} of {} tetrahedra were inside out and are turned", name, turned,
                                     file.mesh.tetrahedra.size()));
  }
  if (const std::size_t unused = tets::drop_unused(file.mesh); unused > 0) {
    file.notes.push_back(fmt::format("{}: {} that no tetrahedron uses {} left out", name,
                                     unused == 1 ? "one vertex" : fmt::format("{} vertices", unused),
                                     unused == 1 ? "is" : "are"));
  }
  return file;
}

}  // namespace tunica
