// Which reader takes a file, and what holds for a mesh whatever its format.
//
// Every format has a reader of its own: assimp 5.2 keeps coordinates as floats, hangs or crashes on cut PLY files and
// drops their further properties, takes OBJ apart into single triangles, and trusts what GLB files say of themselves,
// as tinygltf does.
#include "tunica/io/mesh/mesh_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace tunica {
namespace {

constexpr double max_coordinate = 1e12;         // mm; squares and volumes of larger ones would lose all meaning
constexpr double unit_length_tolerance = 1e-3;  // normals of float files are not unit to the last bit

enum class Format { ply, obj, stl, off, glb };

/// By content where the format begins with a mark, else by the file's extension.
Format format_of(std::string_view bytes, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r") || extension == ".ply") {
    return Format::ply;
  }
  if (bytes.starts_with("glTF") || extension == ".glb") {
    return Format::glb;
  }
  if (extension == ".off") {
    return Format::off;
  }
  if (extension == ".obj") {
    return Format::obj;
  }
  if (extension == ".stl") {
    return Format::stl;
  }
  throw InputError(
      fmt::format("{}: is no mesh of a known format: PLY, OBJ, STL, OFF and GLB are understood", path.string()));
}

MeshFile read_as(Format format, std::string_view bytes, const std::string& name) {
  if (bytes.empty()) {
    throw InputError(fmt::format("{}: is empty", name));
  }
  switch (format) {
    case Format::ply:
      return read_ply(bytes, name);
    case Format::obj:
      return read_obj(bytes, name);
    case Format::stl:
      return read_stl(bytes, name);
    case Format::off:
      return read_off(bytes, name);
    case Format::glb:
      return read_glb(bytes, name);
  }
  TUNICA_ASSERT(false);
}

double size_of_unit(const std::string& unit, const std::string& name) {
  try {
    return parse_length_unit(unit);
  } catch (const UsageError&) {
    throw InputError(
        fmt::format("{}: says that its unit is {}, which is not understood: um, mm, cm and m are", name, unit));
  }
}

void scale(MeshFile& file, double unit_mm) {
  if (unit_mm != 1) {
    for (Vec3& vertex : file.mesh.vertices) {
      vertex *= unit_mm;
    }
  }
}

void require_valid(const MeshFile& file, const std::string& name) {
  if (file.mesh.triangles.empty()) {
    throw InputError(fmt::format("{}: has no triangles", name));
  }
  if (file.mesh.vertices.size() > max_index || file.mesh.triangles.size() > max_index) {
    throw InputError(fmt::format("{}: has {} vertices and {} triangles, at most {} of each are understood", name,
                                 file.mesh.vertices.size(), file.mesh.triangles.size(), max_index));
  }
  for (std::size_t v = 0; v < file.mesh.vertices.size(); ++v) {
    const Vec3& p = file.mesh.vertices[v];
    if (!(p.cwiseAbs().maxCoeff() <= max_coordinate) || !p.allFinite()) {
      throw InputError(fmt::format("{}: vertex {} lies at ({}, {}, {}): coordinates must be finite and within {} mm",
                                   name, v, p.x(), p.y(), p.z(), max_coordinate));
    }
  }
}

void require_unit_normal(Vec3& normal, const std::string& name, const std::string& place) {
  if (!normal.allFinite()) {
    throw InputError(fmt::format("{}: the normal of {} has components that are no numbers", name, place));
  }
  const double length = normal.norm();
  if (!(std::abs(length - 1) <= unit_length_tolerance)) {
    throw InputError(fmt::format("{}: the normal of {} has the length {}, 1 is expected", name, place, length));
  }
  if (std::abs(normal.squaredNorm() - 1) > 4e-15) {
    normal /= length;
  }
}

}  // namespace

MeshFile read_mesh(const std::filesystem::path& path, std::optional<double> unit_mm, bool require_unit) {
  const std::string name = path.string();
  const std::string bytes = read_file(path);
  const Format format = format_of(bytes, path);
  MeshFile file = read_as(format, bytes, name);
  if (format == Format::glb && unit_mm) {
    scale(file, *unit_mm);
    file.units.reset();
  } else if (file.units) {
    scale(file, size_of_unit(*file.units, name));
  } else if (unit_mm) {
    scale(file, *unit_mm);
  } else if (require_unit && format != Format::ply && format != Format::glb) {
    throw UsageError(fmt::format("{}: says no unit of length, pass --mesh-unit mm|cm|m|um", name));
  } else {
    file.unit_unknown = format != Format::ply && format != Format::glb;
    file.unit_assumed = format == Format::ply;
  }
  require_valid(file, name);
  return file;
}

void require_no_other_unit(const MeshFile& file, std::optional<double> unit_mm, const std::filesystem::path& path) {
  if (unit_mm && file.units && size_of_unit(*file.units, path.string()) != *unit_mm) {
    throw InputError(fmt::format("{}: the file itself says that its unit is {}: do not state another one",
                                 path.string(), *file.units));
  }
}

std::optional<Warning> unit_note(const MeshFile& file, const std::filesystem::path& path,
                                 std::optional<double> unit_mm) {
  if (unit_mm && file.units && size_of_unit(*file.units, path.string()) != *unit_mm) {
    return Warning{Weight::note, "unit of length",
                   fmt::format("{}: says that its unit is {}, and is taken in that: the unit stated (--mesh-unit, or "
                               "unit in a scene) is for files that say none",
                               path.string(), *file.units)};
  }
  if (!file.unit_assumed) {
    return std::nullopt;
  }
  return Warning{Weight::note, "unit of length",
                 fmt::format("{}: has no comment \"units mm\": its numbers are taken for mm; where they are not, state "
                             "their unit (--mesh-unit, or unit in a scene)",
                             path.string())};
}

ShellMesh shell_of(const MeshFile& file, const std::filesystem::path& path) {
  const std::string name = path.string();
  if (file.normals.empty()) {
    throw InputError(
        fmt::format("{}: has no vertex normals nx ny nz, so it is no shell mesh: make one with tunica-relax", name));
  }
  ShellMesh shell{file.mesh.vertices, file.mesh.triangles, file.normals, file.corner_normals,
                  file.patch.value_or(Patch::comas)};
  for (std::size_t v = 0; v < shell.normals.size(); ++v) {
    require_unit_normal(shell.normals[v], name, fmt::format("vertex {}", v));
  }
  for (std::size_t t = 0; t < shell.corner_normals.size(); ++t) {
    for (Vec3& normal : shell.corner_normals[t]) {
      require_unit_normal(normal, name, fmt::format("a corner of triangle {}", t));
    }
  }
  return shell;
}

std::string common_space(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                         const std::filesystem::path& path_b) {
  return common_space(a.space, path_a, b.space, path_b);
}

std::string common_space(const std::optional<std::string>& a, const std::filesystem::path& path_a,
                         const std::optional<std::string>& b, const std::filesystem::path& path_b) {
  const auto upper_case = [](std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return text;
  };
  if (a && b && upper_case(*a) != upper_case(*b)) {
    const auto known = [&](const std::string& space) {
      return upper_case(space) == "LPS" || upper_case(space) == "RAS";
    };
    const char* const mended = known(*a) && known(*b)
                                   ? "make both in the same space (tunica-extract --space, or what exported the mesh), "
                                     "or change the sign of x and y in one of them and what it says of its space"
                                   : "only LPS and RAS are known here: export both meshes again in one of these";
    throw InputError(
        fmt::format("{}: its axes are SPACE={}, those of {} are SPACE={}: they would lie in different places; {}",
                    path_a.string(), *a, path_b.string(), *b, mended));
  }
  return a.value_or(b.value_or("LPS"));
}

}  // namespace tunica
