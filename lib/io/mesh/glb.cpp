// GLB (binary glTF 2.0): the triangles of the scene shown, where its nodes put them. Materials, images, skins,
// animations, morphs and references to other files are passed over.
// Source: Khronos, glTF 2.0 specification.
#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstring>

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

/// Whole numbers or floats that lie in the file, checked: `count` items, one every `stride` bytes.
struct Items {
  const char* begin = nullptr;
  std::size_t count = 0;
  std::size_t stride = 0;
};

/// Checks a scene while it reads it.
class SceneReader {
public:
  SceneReader(const Chunks& chunks, std::size_t file_bytes, const std::string& name)
      : binary_(chunks.binary), budget_(file_bytes), name_(name) {
    in_ = SortedJson::parse(shallow(chunks.json, max_nesting), nullptr, false);
    if (!in_.is_object()) {
      fail("its JSON is broken");
    }
  }

  /// All triangles, in the file's unit.
  TriangleMesh read() {
    require_no_extensions();
    for (const std::size_t root : root_nodes()) {
      add_node(root, Eigen::Affine3d::Identity(), 0);
    }
    if (mesh_.triangles.empty()) {
      fail("has no triangles");
    }
    return std::move(mesh_);
  }

  /// The world axes, where the file, its asset, scenes, nodes or meshes say them: in names, in `extras`, in what made
  /// it.
  void say_space(MeshFile& file) const {
    const auto say = [&](const SortedJson& object) {
      for (const char* key : {"name", "generator", "copyright", "extras"}) {
        if (const auto found = object.find(key); found != object.end()) {
          constexpr auto replace = SortedJson::error_handler_t::replace;
          take_space(file, found->is_string() ? found->get<std::string>() : found->dump(-1, ' ', false, replace),
                     name_);
        }
      }
    };
    say(in_);
    if (const auto asset = in_.find("asset"); asset != in_.end() && asset->is_object()) {
      say(*asset);
    }
    for (const char* list : {"scenes", "nodes", "meshes"}) {
      for (const SortedJson& object : member(in_, list, SortedJson::value_t::array)) {
        if (object.is_object()) {
          say(object);
        }
      }
    }
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

  void add_node(std::size_t index, const Eigen::Affine3d& parent, std::size_t depth) {
    const SortedJson& node = item("nodes", index);
    if (visited_[index] || depth > max_depth) {
      fail(fmt::format("its nodes are no tree (node {})", index));
    }
    visited_[index] = true;
    const Eigen::Affine3d placement = parent * placement_of(node);
    if (node.contains("mesh")) {
      add_mesh(required(node, "mesh"), placement);
    }
    for (const SortedJson& child : member(node, "children", SortedJson::value_t::array)) {
      add_node(number_of(child), placement, depth + 1);
    }
  }

  [[nodiscard]] Eigen::Affine3d placement_of(const SortedJson& node) const {
    Eigen::Affine3d placement = Eigen::Affine3d::Identity();
    if (const auto m = numbers(node, "matrix", 16)) {  // column by column
      for (int i = 0; i < 12; ++i) {
        placement(i % 3, i / 3) = (*m)[narrow<std::size_t>(i / 3 * 4 + i % 3)];
      }
      return placement;
    }
    if (const auto t = numbers(node, "translation", 3)) {
      placement.translate(Vec3((*t)[0], (*t)[1], (*t)[2]));
    }
    if (const auto q = numbers(node, "rotation", 4)) {
      const Eigen::Quaterniond rotation((*q)[3], (*q)[0], (*q)[1], (*q)[2]);
      if (!(rotation.norm() > 0)) {
        fail("the \"rotation\" of a node is zero");
      }
      placement.rotate(rotation.normalized());
    }
    if (const auto s = numbers(node, "scale", 3)) {
      placement.scale(Vec3((*s)[0], (*s)[1], (*s)[2]));
    }
    return placement;
  }

  [[nodiscard]] std::optional<std::vector<double>> numbers(const SortedJson& node, const char* key,
                                                           std::size_t length) const {
    const auto found = node.find(key);
    if (found == node.end()) {
      return {};
    }
    std::vector<double> values;
    for (const SortedJson& value : found->is_array() && found->size() == length ? *found : SortedJson::array()) {
      values.push_back(value.is_number() ? value.get<double>() : infinity);
    }
    if (values.size() != length || !std::ranges::all_of(values, [](double v) { return std::abs(v) <= 1e12; })) {
      fail(fmt::format("\"{}\" of a node needs {} numbers", key, length));
    }
    return values;
  }

  /// What is no triangles (points, lines) is passed over.
  void add_mesh(std::size_t index, const Eigen::Affine3d& placement) {
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
        add_triangles(primitive, placement);
      }
    }
  }

  void add_triangles(const SortedJson& primitive, const Eigen::Affine3d& placement) {
    const SortedJson& attributes = member(primitive, "attributes", SortedJson::value_t::object);
    const SortedJson& accessor = item("accessors", required(attributes, "POSITION"));
    if (whole(accessor, "componentType", 0) != 5126 || type_of(accessor) != "VEC3") {
      fail("its positions are no vectors of floats");
    }
    const Items positions = items_of(accessor, 3 * sizeof(float));
    Items indices{nullptr, positions.count, 0};
    std::size_t size = 0;
    if (primitive.contains("indices")) {
      const SortedJson& list = item("accessors", required(primitive, "indices"));
      const std::size_t component = whole(list, "componentType", 0);
      size = component == 5121 ? 1 : component == 5123 ? 2 : component == 5125 ? 4 : 0;
      if (size == 0 || type_of(list) != "SCALAR") {
        fail("its indices are no unsigned whole numbers");
      }
      indices = items_of(list, size);
    }
    if (indices.count == 0 || indices.count % 3 != 0) {
      fail(fmt::format("{} corners are no number of triangles", indices.count));
    }
    const std::size_t first = mesh_.vertices.size();
    if (first + positions.count > max_index) {
      fail("has more vertices than are understood");
    }
    for (std::size_t v = 0; v < positions.count; ++v) {
      std::array<float, 3> p;
      std::memcpy(p.data(), positions.begin + v * positions.stride, sizeof p);
      mesh_.vertices.emplace_back(placement * Vec3(p[0], p[1], p[2]));
    }
    const bool mirrored = placement.linear().determinant() < 0;
    for (std::size_t c = 0; c < indices.count; c += 3) {
      std::array<Index, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        triangle[k] = narrow<Index>(first + vertex_at(indices, c + k, size, positions.count));
      }
      if (mirrored) {
        std::swap(triangle[1], triangle[2]);
      }
      mesh_.triangles.push_back(triangle);
    }
  }

  /// @param size  bytes of an index; 0: there are none, the corners are the vertices in their order
  [[nodiscard]] std::size_t vertex_at(const Items& indices, std::size_t corner, std::size_t size,
                                      std::size_t vertices) const {
    if (size == 0) {
      return corner;
    }
    std::uint32_t value = 0;
    std::memcpy(&value, indices.begin + corner * indices.stride, size);
    if (value >= vertices) {
      fail(fmt::format("corner {} names vertex {}, but there are only {} (counted from 0)", corner, value, vertices));
    }
    return value;
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

  /// The items of an accessor, when every byte that it names is there.
  Items items_of(const SortedJson& accessor, std::size_t item_bytes) {
    const std::size_t count = required(accessor, "count");
    spend(count);
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
    return {binary_.data() + view_offset + offset, count, stride};
  }

  SortedJson in_;
  std::string_view binary_;
  std::size_t budget_;  ///< vertices and corners that may still be read
  std::vector<bool> visited_;
  TriangleMesh mesh_;
  const std::string& name_;
};

}  // namespace

MeshFile read_glb(std::string_view bytes, const std::string& name) {
  MeshFile file;
  file.units.emplace("m");
  SceneReader reader(split_chunks(bytes, name), bytes.size(), name);
  reader.say_space(file);
  file.mesh = reader.read();
  weld_exactly(file.mesh);
  return file;
}

}  // namespace tunica
