#pragma once

#include "support/temporary_folder.hpp"
#include "tunica/core/error.hpp"
#include "tunica/io/mesh/mesh_file.hpp"

#include <cstring>
#include <functional>
#include <string>
#include <string_view>

namespace tunica::test {

/// The message of the error of kind E that `action` ends with.
template <typename E>
std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return "no such error";
}

/// The message with which read_mesh() refuses a file of these bytes.
inline std::string refusal(const TemporaryFolder& folder, std::string_view bytes, const std::string& name) {
  const auto path = folder.file(name, bytes);
  return message_of<InputError>([&] { read_mesh(path); });
}

/// `text` with the first `from` replaced.
inline std::string with(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

/// The bytes of a value as they stand in memory.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// A tetrahedron in every format.
inline const std::string tetrahedron_obj =
    "# made by hand\nmtllib none.mtl\no body\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nv 0 0 1.000123456789\n"
    "s off\nf 1//1 3//1 2//1\nf -4 -3 -1\nf 2/1/1 3/1/1 \\\n4/1/1 # the last but one\nf 1/1 4/1 3/1\nl 1 2\n";
inline const std::string tetrahedron_off =
    "OFF\n# made by hand\n4 4 0\n0 0 0\n1 0 0\n\n0 1 0 # y\n0 0 1.000123456789\n3 0 2 1 255 0 0\n3 0 1 3\n3 1 2 3\n"
    "3 0 3 2";

inline std::string ascii_stl(std::string_view top = "1.000123456789") {
  const std::string corners[4] = {"0 0 0", "1 0 0", "0 1 0", "-0.0 0 " + std::string(top)};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  std::string text = "solid a name with words\n";
  for (const auto& face : faces) {
    text += "  facet normal 0 0 0\n    outer loop\n";
    for (const int corner : face) {
      text += "      vertex " + corners[corner] + "\n";
    }
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid a name with words\n";
}

inline std::string binary_stl(std::string_view header = "solid, but binary") {
  const float corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0F, 0, 1}};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  std::string bytes(header);
  bytes.resize(80, ' ');
  bytes += raw<std::uint32_t>(4);
  for (const auto& face : faces) {
    bytes += raw(0.0F) + raw(0.0F) + raw(0.0F);
    for (const int corner : face) {
      bytes += raw(corners[corner][0]) + raw(corners[corner][1]) + raw(corners[corner][2]);
    }
    bytes += raw<std::uint16_t>(0);
  }
  return bytes;
}

/// A GLB of this JSON and binary chunk.
inline std::string glb(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  const auto word = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
  return "glTF" + word(2) + word(12 + 8 + json.size() + 8 + binary.size()) + word(json.size()) + "JSON" + json +
         word(binary.size()) + std::string("BIN\0", 4) + binary;
}

/// Four positions 16 bytes apart, then twelve 2-byte indices.
inline std::string tetrahedron_glb_data() {
  std::string data;
  for (const auto& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) {
    data += raw(static_cast<float>(p.x())) + raw(static_cast<float>(p.y())) + raw(static_cast<float>(p.z())) + "....";
  }
  for (const std::uint16_t corner : {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}) {
    data += raw(corner);
  }
  return data;
}

inline const std::string tetrahedron_glb_json = R"({"asset":{"version":"2.0"},"scene":0,
 "scenes":[{"nodes":[1]}],
 "nodes":[{"mesh":0,"scale":[-2,2,2]},{"children":[0],"translation":[0,0,5],"name":"parent"}],
 "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
 "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
 "textures":[{"source":0}],"images":[{"uri":"nowhere.png"}],
 "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
              {"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}],
 "bufferViews":[{"buffer":0,"byteLength":64,"byteStride":16},{"buffer":0,"byteOffset":64,"byteLength":24}],
 "buffers":[{"byteLength":88}]})";

inline std::string tetrahedron_glb() { return glb(tetrahedron_glb_json, tetrahedron_glb_data()); }

}  // namespace tunica::test
