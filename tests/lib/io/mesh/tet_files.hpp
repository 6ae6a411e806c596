#pragma once

#include "io/mesh/helpers.hpp"
#include "tunica/io/mesh/tet_file.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <utility>

/// A cube in every format of tetrahedra.
namespace tunica::test {

/// The cube over [0, 2] x [0, 1] x [0, 1.000123456789] in six tetrahedra around its diagonal.
inline TetMesh tet_cube() {
  TetMesh mesh;
  for (int v = 0; v < 8; ++v) {
    mesh.vertices.emplace_back(2.0 * (v & 1), v >> 1 & 1, 1.000123456789 * (v >> 2));
  }
  mesh.tetrahedra = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  return mesh;
}

/// What the files hold beside the tetrahedra: a point, a line and two triangles.
inline const std::vector<std::vector<int>> flat_elements = {{0}, {0, 1}, {0, 1, 3}, {0, 3, 2}};

inline std::string reversed(std::string bytes) {
  std::reverse(bytes.begin(), bytes.end());
  return bytes;
}
template <typename T>
std::string raw_big(auto value) {
  return reversed(raw(static_cast<T>(value)));
}

/// Gmsh numbers: point 15, line 1, triangle 2, tetrahedron 4.
inline int gmsh_type(std::size_t corners) { return std::array{0, 15, 1, 2, 4}[corners]; }
/// VTK numbers: 1, 3, 5, 10.
inline int vtk_type(std::size_t corners) { return std::array{0, 1, 3, 5, 10}[corners]; }

inline std::vector<std::vector<int>> all_elements(const TetMesh& mesh) {
  auto elements = flat_elements;
  for (const auto& tet : mesh.tetrahedra) {
    elements.emplace_back(tet.begin(), tet.end());
  }
  return elements;
}

/// The tag of a vertex in the .msh files: neither in order nor without gaps.
inline int tag_of(int vertex) { return 100 - 7 * vertex; }

inline std::string msh2(bool binary) {
  const TetMesh mesh = tet_cube();
  const auto elements = all_elements(mesh);
  std::string text = fmt::format("$MeshFormat\n2.2 {} 8\n", binary ? 1 : 0);
  text += binary ? raw(1) + "\n" : "";
  text += "$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"organ\"\n$EndPhysicalNames\n$Nodes\n8\n";
  for (int v = 0; v < 8; ++v) {
    const Vec3& p = mesh.vertices[static_cast<std::size_t>(v)];
    text += binary ? raw(tag_of(v)) + raw(p.x()) + raw(p.y()) + raw(p.z())
                   : fmt::format("{} {} {} {}\n", tag_of(v), p.x(), p.y(), p.z());
  }
  text += fmt::format("{}$EndNodes\n$Elements\n{}\n", binary ? "\n" : "", elements.size());
  for (std::size_t e = 0; e < elements.size(); ++e) {
    const int type = gmsh_type(elements[e].size());
    const int number = static_cast<int>(e) + 1;
    text +=
        binary ? raw(type) + raw(1) + raw(2) + raw(number) + raw(1) + raw(1) : fmt::format("{} {} 2 1 1", number, type);
    for (const int corner : elements[e]) {
      text += binary ? raw(tag_of(corner)) : fmt::format(" {}", tag_of(corner));
    }
    text += binary ? "" : "\n";
  }
  return text + (binary ? "\n" : "") + "$EndElements\n";
}

inline std::string msh4(bool binary, int size = 8) {
  const TetMesh mesh = tet_cube();
  const auto elements = all_elements(mesh);
  const auto word = [&](auto value) {
    return !binary     ? fmt::format("{} ", value)
           : size == 8 ? raw(static_cast<std::uint64_t>(value))
                       : raw(static_cast<std::uint32_t>(value));
  };
  const auto number = [&](auto value) { return binary ? raw(value) : fmt::format("{} ", value); };
  const std::string end = binary ? "" : "\n";
  std::string text = fmt::format("$MeshFormat\n4.1 {} {}\n", binary ? 1 : 0, size);
  text += binary ? raw(1) + "\n" : "";
  text += "$EndMeshFormat\n$Nodes\n" + word(2) + word(8) + word(51) + word(100) + end;
  for (const int from : {0, 3}) {
    const int to = from == 0 ? 3 : 8;
    const bool parametric = from == 0;  // the first three lie on a surface
    text += number(parametric ? 2 : 3) + number(1) + number(parametric ? 1 : 0) + word(to - from) + end;
    for (int v = from; v < to; ++v) {
      text += word(tag_of(v)) + end;
    }
    for (int v = from; v < to; ++v) {
      const Vec3& p = mesh.vertices[static_cast<std::size_t>(v)];
      text += number(p.x()) + number(p.y()) + number(p.z()) + (parametric ? number(0.5) + number(0.25) : "") + end;
    }
  }
  text += (binary ? "\n" : "") + std::string("$EndNodes\n$Elements\n") + word(4) + word(elements.size()) + word(1) +
          word(elements.size()) + end;
  int tag = 0;
  for (std::size_t corners = 1; corners <= 4; ++corners) {
    const auto fits = [&](const auto& element) { return element.size() == corners; };
    text += number(static_cast<int>(corners) - 1) + number(1) + number(gmsh_type(corners)) +
            word(std::count_if(elements.begin(), elements.end(), fits)) + end;
    for (const auto& element : elements) {
      if (fits(element)) {
        text += word(++tag);
        for (const int corner : element) {
          text += word(tag_of(corner));
        }
        text += end;
      }
    }
  }
  return text + (binary ? "\n" : "") + "$EndElements\n";
}

/// @param five  the layout of VTK 5: offsets and connectivity
inline std::string vtk(bool binary, bool five) {
  const TetMesh mesh = tet_cube();
  const auto elements = all_elements(mesh);
  const auto number = [&]<typename T>(T value) { return binary ? raw_big<T>(value) : fmt::format("{} ", value); };
  std::string text = fmt::format("# vtk DataFile Version {}\n\n{}\nDATASET UNSTRUCTURED_GRID\n", five ? "5.1" : "3.0",
                                 binary ? "BINARY" : "ASCII");
  text += "FIELD FieldData 1\nTIME 1 1 double\n" + number(0.5) + "\nPOINTS 8 double\n";
  for (const Vec3& p : mesh.vertices) {
    text += number(p.x()) + number(p.y()) + number(p.z());
  }
  text += "\nMETADATA\nINFORMATION 0\n\n";
  std::size_t size = 0;
  for (const auto& element : elements) {
    size += element.size();
  }
  if (five) {
    text += fmt::format("CELLS {} {}\nOFFSETS vtktypeint64\n", elements.size() + 1, size) + number(std::int64_t{0});
    std::size_t end = 0;
    for (const auto& element : elements) {
      text += number(static_cast<std::int64_t>(end += element.size()));
    }
    text += "\nCONNECTIVITY vtktypeint64\n";
  } else {
    text += fmt::format("CELLS {} {}\n", elements.size(), size + elements.size());
  }
  for (const auto& element : elements) {
    text += five ? "" : number(static_cast<std::int32_t>(element.size()));
    for (const int corner : element) {
      text += five ? number(std::int64_t{corner}) : number(std::int32_t{corner});
    }
  }
  text += fmt::format("\nCELL_TYPES {}\n", elements.size());
  for (const auto& element : elements) {
    text += number(std::int32_t{vtk_type(element.size())});
  }
  return text + "\nCELL_DATA 1\nanything\n";
}

inline std::string base64_of(std::string_view bytes) {
  static constexpr std::string_view signs = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto at = [&](std::size_t k) -> unsigned {
      return i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U;
    };
    const unsigned word = at(0) << 16 | at(1) << 8 | at(2);
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : signs[word >> (18 - 6 * k) & 63];
    }
  }
  return text;
}

enum class VtuKind { ascii, base64, raw, appended, zlib, big };

/// In two pieces, to see that both are read; VtuKind::big is base64 in big-endian order.
inline std::string vtu(VtuKind kind) {
  const bool big = kind == VtuKind::big;
  const auto number = [&]<typename T>(T value) {
    return kind == VtuKind::ascii ? fmt::format("{} ", value) : (big ? raw_big<T>(value) : raw(value));
  };
  std::string data;
  const auto array = [&](const std::string& attributes, const std::string& values) {
    const std::string head = fmt::format("<DataArray {} format=", attributes);
    const std::string size =
        big ? raw_big<std::uint32_t>(values.size()) : raw(static_cast<std::uint32_t>(values.size()));
    if (kind == VtuKind::ascii) {
      return head + "\"ascii\">\n" + values + "\n<InformationKey name=\"x\">1</InformationKey></DataArray>\n";
    }
    if (kind == VtuKind::base64 || big) {
      return head + "\"binary\">\n " + base64_of(size + values) + "\n</DataArray>\n";
    }
    const std::string place = fmt::format("'appended' offset=\"{}\" />\n", data.size());
    if (kind == VtuKind::raw) {
      data += size + values;
    } else if (kind == VtuKind::appended) {
      data += base64_of(size + values);
    } else {
      // A short array is one block, smaller than the size that is named; else two, the second smaller than the first.
      const bool is_short = values.size() < 100;
      const std::size_t half = is_short ? values.size() : values.size() / 2 + 1;
      std::vector<std::string> parts = {values.substr(0, half)};
      if (!is_short) {
        parts.push_back(values.substr(half));
      }
      const auto word = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
      std::string blocks;
      std::string header = word(parts.size()) + word(is_short ? 1 << 20 : half) + word(parts.back().size());
      for (const std::string& block : parts) {
        uLongf packed_size = ::compressBound(block.size());
        std::string packed(packed_size, '\0');
        ::compress(reinterpret_cast<Bytef*>(packed.data()), &packed_size, reinterpret_cast<const Bytef*>(block.data()),
                   block.size());
        blocks += packed.substr(0, packed_size);
        header += word(packed_size);
      }
      data += base64_of(header) + base64_of(blocks);
    }
    return head + place;
  };
  const TetMesh mesh = tet_cube();
  const auto elements = all_elements(mesh);
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<!-- by hand -->\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" "
      "byte_order=\"{}\"{}>\n"
      "<UnstructuredGrid>\n",
      big ? "BigEndian" : "LittleEndian", kind == VtuKind::zlib ? " compressor=\"vtkZLibDataCompressor\"" : "");
  for (const std::size_t from : {std::size_t{0}, std::size_t{6}}) {
    const std::size_t to = from == 0 ? 6 : elements.size();
    std::string points, corners, ends, types;
    for (const Vec3& p : mesh.vertices) {
      points += number(p.x()) + number(p.y()) + number(p.z());
    }
    std::int64_t end = 0;
    for (std::size_t e = from; e < to; ++e) {
      for (const int corner : elements[e]) {
        corners += number(std::int64_t{corner});
      }
      ends += number(end += static_cast<std::int64_t>(elements[e].size()));
      types += kind == VtuKind::ascii ? fmt::format("{} ", vtk_type(elements[e].size()))
                                      : std::string(1, static_cast<char>(vtk_type(elements[e].size())));
    }
    text += fmt::format("<Piece NumberOfPoints=\"8\" NumberOfCells=\"{}\">\n<PointData>\n", to - from);
    text += "</PointData>\n<Points>\n" + array(R"(type="Float64" NumberOfComponents="3")", points);
    text += "</Points>\n<Cells>\n" + array(R"(type="Int64" Name="connectivity")", corners);
    text += array(R"(type="Int64" Name="offsets")", ends) + array(R"(type="UInt8" Name="types")", types);
    text += "</Cells>\n</Piece>\n";
  }
  text += "</UnstructuredGrid>\n";
  if (!data.empty()) {
    text += fmt::format("<AppendedData encoding=\"{}\">\n _", kind == VtuKind::raw ? "raw" : "base64") + data +
            "\n</AppendedData>\n";
  }
  return text + "</VTKFile>\n";
}

struct TetSample {
  const char* name;
  std::function<std::string()> bytes;
};
inline void PrintTo(const TetSample& sample, std::ostream* out) { *out << sample.name; }

inline const std::vector<TetSample> tet_samples = {{"two.msh", [] { return msh2(false); }},
                                                   {"two_binary.msh", [] { return msh2(true); }},
                                                   {"four.msh", [] { return msh4(false); }},
                                                   {"four_binary.msh", [] { return msh4(true); }},
                                                   {"four_small.msh", [] { return msh4(true, 4); }},
                                                   {"three.vtk", [] { return vtk(false, false); }},
                                                   {"three_binary.vtk", [] { return vtk(true, false); }},
                                                   {"five.vtk", [] { return vtk(false, true); }},
                                                   {"five_binary.vtk", [] { return vtk(true, true); }},
                                                   {"ascii.vtu", [] { return vtu(VtuKind::ascii); }},
                                                   {"base64.vtu", [] { return vtu(VtuKind::base64); }},
                                                   {"big.vtu", [] { return vtu(VtuKind::big); }},
                                                   {"raw.vtu", [] { return vtu(VtuKind::raw); }},
                                                   {"appended.vtu", [] { return vtu(VtuKind::appended); }},
                                                   {"zlib.vtu", [] { return vtu(VtuKind::zlib); }}};

}  // namespace tunica::test
