// GLB (binary glTF 2.0) through assimp.
//
// assimp trusts what it reads, so it never sees the file itself: the scene is checked here, and what was checked (the
// node tree, the triangles, their positions and indices) is written anew as a small GLB in memory. Materials, images,
// skins, animations, morphs and references to other files do not reach it.
// Source: Khronos, glTF 2.0 specification.
#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <Eigen/LU>

#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <map>

namespace tunica {
namespace {

constexpr std::uint32_t json_chunk = 0x4e4f534a;
constexpr std::uint32_t binary_chunk = 0x004e4942;
constexpr std::size_t max_json = std::size_t{16} << 20;
constexpr int max_nesting = 32;
constexpr std::size_t max_depth = 256;
constexpr std::size_t max_stride = 252;

using SortedJson = nlohmann::json;  // finds a key among a million hostile ones in no time, unlike Json

std::uint32_t word_at(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

void append_word(std::string& bytes, std::size_t value) {
  const auto word = narrow<std::uint32_t>(value);
  std::array<char, sizeof word> raw;
  std::memcpy(raw.data(), &word, sizeof word);
  bytes.append(raw.data(), raw.size());
}

struct Chunks {
  std::string_view json;
  std::string_view binary;
};

Chunks split_chunks(std::string_view bytes, const std::string& name) {
  if (bytes.size() < 12 || !bytes.starts_with("glTF")) {
    throw InputError(fmt::format("{}: is not a GLB file, or truncated within its header", name));
  }
  if (word_at(bytes, 4) != 2) {
    throw InputError(fmt::format("{}: is glTF version {}, only 2 is understood", name, word_at(bytes, 4)));
  }
  const std::size_t length = word_at(bytes, 8);
  if (length > bytes.size()) {
    throw InputError(fmt::format("{}: is truncated: {} bytes are missing", name, length - bytes.size()));
  }
  if (length < bytes.size()) {
    throw InputError(fmt::format("{}: {} bytes follow its end", name, bytes.size() - length));
  }
  Chunks chunks;
  for (std::size_t at = 12; at < bytes.size();) {
    if (bytes.size() - at < 8 || bytes.size() - at - 8 < word_at(bytes, at)) {
      throw InputError(fmt::format("{}: a chunk reaches beyond the file's end", name));
    }
    const std::string_view chunk = bytes.substr(at + 8, word_at(bytes, at));
    const std::uint32_t type = word_at(bytes, at + 4);
    if (type == json_chunk && at == 12) {
      chunks.json = chunk;
    } else if (type == binary_chunk && chunks.binary.empty()) {
      chunks.binary = chunk;
    }
    at += 8 + chunk.size();
  }
  if (chunks.json.empty() || chunks.json.size() > max_json) {
    throw InputError(fmt::format("{}: its first chunk is no JSON of at most {} bytes", name, max_json));
  }
  return chunks;
}

/// The JSON with nothing in lists and objects that lie `deepest` within each other: each of a million `[` would take a
/// hundred bytes. A callback of the parser could drop them, too, but has it look at all elements of a list after each.
std::string shallow(std::string_view json, int deepest) {
  std::string kept;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size();) {
    const std::size_t length = in_string && json[i] == '\\' ? 2 : 1;
    const bool opens = !in_string && (json[i] == '[' || json[i] == '{');
    const bool closes = !in_string && (json[i] == ']' || json[i] == '}');
    depth += opens ? 1 : 0;
    if (depth < deepest || (depth == deepest && (opens || closes))) {
      kept.append(json.substr(i, length));
    }
    depth -= closes ? 1 : 0;
    in_string = in_string != (json[i] == '"');
    i += length;
  }
  return kept;
}

/// Checks a scene and writes it anew, reduced to triangles.
class SceneFilter {
public:
  SceneFilter(const Chunks& chunks, std::size_t file_bytes, const std::string& name)
      : binary_(chunks.binary), budget_(file_bytes), name_(name) {
    in_ = SortedJson::parse(shallow(chunks.json, max_nesting), nullptr, false);
    if (!in_.is_object()) {
      fail("its JSON is broken");
    }
  }

  /// A GLB of what was checked.
  std::string filtered() {
    require_no_extensions();
    out_ = SortedJson{{"asset", {{"version", "2.0"}}}, {"scene", 0}};
    SortedJson roots = SortedJson::array();
    for (const std::size_t root : root_nodes()) {
      roots.push_back(add_node(root, 0));
    }
    if (out_["meshes"].empty()) {
      fail("has no triangles");
    }
    out_["scenes"] = SortedJson::array({{{"nodes", roots}}});
    // assimp wants the last item of an interleaved view to be as long as the others: zeros follow the data.
    const std::size_t padded = (binary_.size() + max_stride + 3) / 4 * 4;
    out_["buffers"] = SortedJson::array({{{"byteLength", padded}}});
    std::string json = out_.dump();
    json.resize((json.size() + 3) / 4 * 4, ' ');
    std::string bytes = "glTF";
    append_word(bytes, 2);
    const std::size_t length = 12 + 8 + json.size() + 8 + padded;
    if (length > 0xffffffff) {
      fail("is too large for a GLB file");
    }
    append_word(bytes, length);
    append_word(bytes, json.size());
    append_word(bytes, json_chunk);
    bytes += json;
    append_word(bytes, padded);
    append_word(bytes, binary_chunk);
    bytes += binary_;
    bytes.append(padded - binary_.size(), '\0');
    return bytes;
  }

private:
  [[noreturn]] void fail(const std::string& what) const { throw InputError(fmt::format("{}: {}", name_, what)); }

  /// Extensions that change where the surface is cannot be passed over.
  void require_no_extensions() const {
    for (const SortedJson& extension : member(in_, "extensionsRequired", SortedJson::value_t::array)) {
      const std::string text = extension.is_string() ? extension.get<std::string>() : "?";
      if (!text.starts_with("KHR_materials_") && !text.starts_with("KHR_texture_")) {
        fail(fmt::format("needs the glTF extension {}, which is not understood: export it without compression",
                         text.substr(0, 60)));
      }
    }
  }

  /// The member `key`, empty when it is absent. Errors: InputError when it has another type.
  const SortedJson& member(const SortedJson& object, const char* key, SortedJson::value_t type) const {
    static const SortedJson empty_array(SortedJson::value_t::array);
    static const SortedJson empty_object(SortedJson::value_t::object);
    const auto found = object.find(key);
    if (found == object.end()) {
      return type == SortedJson::value_t::array ? empty_array : empty_object;
    }
    if (found->type() != type) {
      fail(fmt::format("\"{}\" in its JSON has the wrong type", key));
    }
    return *found;
  }

  [[nodiscard]] std::size_t whole(const SortedJson& object, const char* key, std::size_t otherwise) const {
    const auto found = object.find(key);
    if (found == object.end()) {
      return otherwise;
    }
    if (!found->is_number_unsigned() || found->get<std::uint64_t>() > 0xffffffff) {
      fail(fmt::format("\"{}\" in its JSON is no whole number", key));
    }
    return found->get<std::size_t>();
  }

  [[nodiscard]] std::size_t required(const SortedJson& object, const char* key) const {
    if (!object.contains(key)) {
      fail(fmt::format("\"{}\" is missing in its JSON", key));
    }
    return whole(object, key, 0);
  }

  /// Object number `index` of the list `key`, e.g. "nodes".
  [[nodiscard]] const SortedJson& item(const char* key, std::size_t index) const {
    const auto list = in_.find(key);
    if (list == in_.end() || !list->is_array() || index >= list->size() || !(*list)[index].is_object()) {
      fail(fmt::format("its JSON names {} {}, which is not there", key, index));
    }
    return (*list)[index];
  }

  [[nodiscard]] std::size_t number_of(const SortedJson& value) const {
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > 0xffffffff) {
      fail("a node in its JSON is no whole number");
    }
    return value.get<std::size_t>();
  }

  /// The nodes of the scene shown; without scenes, every node that is no other's child.
  std::vector<std::size_t> root_nodes() {
    const std::size_t nodes = member(in_, "nodes", SortedJson::value_t::array).size();
    visited_.assign(nodes, false);
    std::vector<std::size_t> roots;
    if (in_.contains("scenes")) {
      for (const SortedJson& node :
           member(item("scenes", whole(in_, "scene", 0)), "nodes", SortedJson::value_t::array)) {
        roots.push_back(number_of(node));
      }
      return roots;
    }
    std::vector<bool> is_child(nodes, false);
    for (std::size_t n = 0; n < nodes; ++n) {
      for (const SortedJson& child : member(item("nodes", n), "children", SortedJson::value_t::array)) {
        if (number_of(child) < nodes) {
          is_child[number_of(child)] = true;
        }
      }
    }
    for (std::size_t n = 0; n < nodes; ++n) {
      if (!is_child[n]) {
        roots.push_back(n);
      }
    }
    return roots;
  }

  std::size_t add_node(std::size_t index, std::size_t depth) {
    const SortedJson& node = item("nodes", index);
    if (visited_[index] || depth > max_depth) {
      fail(fmt::format("its nodes are no tree (node {})", index));
    }
    visited_[index] = true;
    SortedJson copy = SortedJson::object();
    for (const auto& [key, length] : {std::pair{"matrix", 16}, {"translation", 3}, {"rotation", 4}, {"scale", 3}}) {
      const auto found = node.find(key);
      if (found != node.end()) {
        copy[key] = checked_numbers(*found, key, narrow<std::size_t>(length));
      }
    }
    if (node.contains("mesh")) {
      const std::optional<std::size_t> mesh = add_mesh(required(node, "mesh"));
      if (mesh) {
        copy["mesh"] = *mesh;
      }
    }
    SortedJson children = SortedJson::array();
    for (const SortedJson& child : member(node, "children", SortedJson::value_t::array)) {
      children.push_back(add_node(number_of(child), depth + 1));
    }
    if (!children.empty()) {
      copy["children"] = children;
    }
    out_["nodes"].push_back(copy);
    return out_["nodes"].size() - 1;
  }

  SortedJson checked_numbers(const SortedJson& list, const char* key, std::size_t length) const {
    if (!list.is_array() || list.size() != length) {
      fail(fmt::format("\"{}\" of a node needs {} numbers", key, length));
    }
    for (const SortedJson& value : list) {
      if (!value.is_number() || !(std::abs(value.get<double>()) <= 1e12)) {
        fail(fmt::format("\"{}\" of a node needs {} numbers", key, length));
      }
    }
    return list;
  }

  /// The number of the mesh in the output; none when it has no triangles (points, lines). Written once, paid for by
  /// every node that shows it.
  std::optional<std::size_t> add_mesh(std::size_t index) {
    const auto known = meshes_.find(index);
    if (known != meshes_.end()) {
      spend(known->second.cost);
      return known->second.number;
    }
    const std::size_t before = budget_;
    SortedJson primitives = SortedJson::array();
    for (const SortedJson& primitive : member(item("meshes", index), "primitives", SortedJson::value_t::array)) {
      if (!primitive.is_object()) {
        fail("a primitive in its JSON is no object");
      }
      spend(1);
      const std::size_t mode = whole(primitive, "mode", 4);
      if (mode == 5 || mode == 6) {
        fail("triangle strips and fans are not understood: export plain triangles");
      }
      if (mode == 4) {
        primitives.push_back(checked_primitive(primitive));
      }
    }
    std::optional<std::size_t> number;
    if (!primitives.empty()) {
      out_["meshes"].push_back({{"primitives", primitives}});
      number = out_["meshes"].size() - 1;
    }
    meshes_[index] = {number, before - budget_};
    return number;
  }

  SortedJson checked_primitive(const SortedJson& primitive) {
    const SortedJson& attributes = member(primitive, "attributes", SortedJson::value_t::object);
    const SortedJson& positions = item("accessors", required(attributes, "POSITION"));
    if (whole(positions, "componentType", 0) != 5126 || type_of(positions) != "VEC3") {
      fail("its positions are no vectors of floats");
    }
    const std::size_t vertices = required(positions, "count");
    spend(vertices);
    const std::size_t position_accessor = add_accessor(positions, vertices, 12);
    std::size_t corners = vertices;
    SortedJson copy = {{"attributes", {{"POSITION", position_accessor}}}, {"mode", 4}};
    if (primitive.contains("indices")) {
      const SortedJson& indices = item("accessors", required(primitive, "indices"));
      const std::size_t component = whole(indices, "componentType", 0);
      const std::size_t size = component == 5121 ? 1 : component == 5123 ? 2 : component == 5125 ? 4 : 0;
      if (size == 0 || type_of(indices) != "SCALAR") {
        fail("its indices are no unsigned whole numbers");
      }
      corners = required(indices, "count");
      spend(corners);
      copy["indices"] = add_accessor(indices, corners, size);
      check_indices(out_["accessors"].back(), corners, size, vertices);
    }
    if (corners == 0 || corners % 3 != 0) {
      fail(fmt::format("{} corners are no number of triangles", corners));
    }
    return copy;
  }

  [[nodiscard]] static std::string type_of(const SortedJson& accessor) {
    const auto found = accessor.find("type");
    return found != accessor.end() && found->is_string() ? found->get<std::string>() : std::string();
  }

  /// Every vertex and corner that is read counts, also where the file names the same bytes again and again.
  void spend(std::size_t amount) {
    if (amount > budget_) {
      fail("repeats its parts so often that it would need more memory than its size justifies");
    }
    budget_ -= amount;
  }

  /// Copies an accessor and its view when every byte it names is there.
  std::size_t add_accessor(const SortedJson& accessor, std::size_t count, std::size_t item_bytes) {
    if (accessor.contains("sparse") || !accessor.contains("bufferView")) {
      fail("sparse accessors are not understood");
    }
    const SortedJson& view = item("bufferViews", required(accessor, "bufferView"));
    if (whole(view, "buffer", 0) != 0 || item("buffers", 0).contains("uri")) {
      fail("refers to another file: embed the buffers");
    }
    const std::size_t view_offset = whole(view, "byteOffset", 0);
    const std::size_t view_length = required(view, "byteLength");
    const std::size_t stride = std::max(whole(view, "byteStride", item_bytes), std::size_t{1});
    const std::size_t offset = whole(accessor, "byteOffset", 0);
    const std::size_t needed = count == 0 ? 0 : (count - 1) * stride + item_bytes;
    if (stride < item_bytes || stride > max_stride || offset > view_length || needed > view_length - offset ||
        view_offset > binary_.size() || view_length > binary_.size() - view_offset) {
      fail(fmt::format("is truncated or broken: an accessor of {} items reaches beyond its {} bytes of data", count,
                       binary_.size()));
    }
    SortedJson view_copy = {{"buffer", 0}, {"byteOffset", view_offset + offset}, {"byteLength", count * stride}};
    if (stride != item_bytes) {
      view_copy["byteStride"] = stride;
    }
    out_["bufferViews"].push_back(view_copy);
    out_["accessors"].push_back({{"bufferView", out_["bufferViews"].size() - 1},
                                 {"componentType", accessor["componentType"]},
                                 {"count", count},
                                 {"type", accessor["type"]}});
    return out_["accessors"].size() - 1;
  }

  /// assimp drops triangles with a wrong index without a word.
  void check_indices(const SortedJson& accessor, std::size_t count, std::size_t size, std::size_t vertices) const {
    const SortedJson& view = out_["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const std::size_t stride = view.value("byteStride", size);
    const char* at = binary_.data() + view["byteOffset"].get<std::size_t>();
    for (std::size_t i = 0; i < count; ++i) {
      std::uint32_t value = 0;
      std::memcpy(&value, at + i * stride, size);
      if (value >= vertices) {
        fail(fmt::format("corner {} names vertex {}, but there are only {} (counted from 0)", i, value, vertices));
      }
    }
  }

  SortedJson in_;
  SortedJson out_;
  std::string_view binary_;
  std::size_t budget_;  ///< vertices and corners that may still be read
  std::vector<bool> visited_;
  struct Written {
    std::optional<std::size_t> number;
    std::size_t cost;
  };
  std::map<std::size_t, Written> meshes_;  ///< by their number in the file
  const std::string& name_;
};

Eigen::Matrix4d matrix_of(const aiMatrix4x4& m) {
  Eigen::Matrix4d result;
  result << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
  return result;
}

void append_mesh(const aiMesh& mesh, const Eigen::Matrix4d& placement, TriangleMesh& result, const std::string& name) {
  const auto first = result.vertices.size();
  if (first + mesh.mNumVertices > max_index) {
    throw InputError(fmt::format("{}: has more vertices than are understood", name));
  }
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D& p = mesh.mVertices[v];
    result.vertices.emplace_back((placement * Eigen::Vector4d(p.x, p.y, p.z, 1)).head<3>());
  }
  const bool mirrored = placement.topLeftCorner<3, 3>().determinant() < 0;
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) {
      throw InputError(fmt::format("{}: face {} has {} corners, 3 are expected", name, f, face.mNumIndices));
    }
    std::array<Index, 3> triangle;
    for (unsigned corner = 0; corner < 3; ++corner) {
      if (face.mIndices[corner] >= mesh.mNumVertices) {
        throw InputError(fmt::format("{}: face {} names vertex {}, but there are only {}", name, f,
                                     face.mIndices[corner], mesh.mNumVertices));
      }
      triangle[corner] = narrow<Index>(first + face.mIndices[corner]);
    }
    if (mirrored) {
      std::swap(triangle[1], triangle[2]);
    }
    result.triangles.push_back(triangle);
  }
}

void append_node(const aiScene& scene, const aiNode& node, const Eigen::Matrix4d& parent, TriangleMesh& result,
                 const std::string& name) {
  const Eigen::Matrix4d placement = parent * matrix_of(node.mTransformation);
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    append_mesh(*scene.mMeshes[node.mMeshes[m]], placement, result, name);
  }
  for (unsigned c = 0; c < node.mNumChildren; ++c) {
    append_node(scene, *node.mChildren[c], placement, result, name);
  }
}

}  // namespace

MeshFile read_glb(std::string_view bytes, const std::string& name) {
  const std::string checked = SceneFilter(split_chunks(bytes, name), bytes.size(), name).filtered();
  MeshFile file;
  file.units.emplace("m");
  Assimp::Importer importer;
  const aiScene* scene = nullptr;
  try {
    scene = importer.ReadFileFromMemory(checked.data(), checked.size(), 0, "glb");
  } catch (const std::exception& error) {
    throw InputError(fmt::format("{}: cannot be read as GLB: {}", name, error.what()));
  }
  if (scene == nullptr || scene->mRootNode == nullptr) {
    throw InputError(fmt::format("{}: cannot be read as GLB: {}", name, importer.GetErrorString()));
  }
  append_node(*scene, *scene->mRootNode, Eigen::Matrix4d::Identity(), file.mesh, name);
  weld_exactly(file.mesh);
  return file;
}

}  // namespace tunica
