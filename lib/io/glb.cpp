// GLB (binary glTF 2.0): the triangles of the scene shown. Materials, images, skins, animations, morphs and references
// to other files are passed over. Source: Khronos, glTF 2.0 specification.
#include "core/error.hpp"
#include "core/json.hpp"
#include "io/mesh_formats.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <cstring>
#include <numeric>

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

class SceneReader {
public:
  SceneReader(const Chunks& chunks, std::size_t file_bytes, const std::string& name)
      : binary_(chunks.binary), budget_(file_bytes), name_(name) {
    const auto keep = [](int depth, SortedJson::parse_event_t, const SortedJson&) { return depth <= max_nesting; };
    in_ = SortedJson::parse(chunks.json, keep, false);  // a hundred bytes of memory for each of a million `[` otherwise
    if (!in_.is_object()) {
      fail("its JSON is broken");
    }
  }

  TriangleMesh read() {
    require_no_extensions();
    for (const std::size_t root : root_nodes()) {
      add_node(root, Eigen::Matrix4d::Identity(), 0);
    }
    if (mesh_.triangles.empty()) {
      fail("has no triangles");
    }
    return std::move(mesh_);
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

  void add_node(std::size_t index, const Eigen::Matrix4d& parent, std::size_t depth) {
    const SortedJson& node = item("nodes", index);
    if (visited_[index] || depth > max_depth) {
      fail(fmt::format("its nodes are no tree (node {})", index));
    }
    visited_[index] = true;
    const Eigen::Matrix4d placement = parent * placement_of(node);
    if (node.contains("mesh")) {
      add_mesh(required(node, "mesh"), placement);
    }
    for (const SortedJson& child : member(node, "children", SortedJson::value_t::array)) {
      add_node(number_of(child), placement, depth + 1);
    }
  }

  [[nodiscard]] Eigen::Matrix4d placement_of(const SortedJson& node) const {
    if (node.contains("matrix")) {
      return Eigen::Matrix4d(numbers<16>(node, "matrix", {}).data());  // by columns
    }
    const auto move = numbers<3>(node, "translation", {0, 0, 0});
    const auto turn = numbers<4>(node, "rotation", {0, 0, 0, 1});
    const auto scale = numbers<3>(node, "scale", {1, 1, 1});
    const Eigen::Quaterniond rotation(turn[3], turn[0], turn[1], turn[2]);
    Eigen::Affine3d placement = Eigen::Translation3d(move[0], move[1], move[2]) * rotation.normalized();
    placement.scale(Vec3(scale[0], scale[1], scale[2]));
    return placement.matrix();
  }

  template <std::size_t length>
  [[nodiscard]] std::array<double, length> numbers(const SortedJson& node, const char* key,
                                                   std::array<double, length> values) const {
    const auto list = node.find(key);
    if (list == node.end()) {
      return values;
    }
    bool good = list->is_array() && list->size() == length;
    for (std::size_t i = 0; i < length && good; ++i) {
      good = (*list)[i].is_number() && std::abs((*list)[i].template get<double>()) <= 1e12;
      values[i] = good ? (*list)[i].template get<double>() : 0;
    }
    if (!good) {
      fail(fmt::format("\"{}\" of a node needs {} numbers", key, length));
    }
    return values;
  }

  void add_mesh(std::size_t index, const Eigen::Matrix4d& placement) {
    for (const SortedJson& primitive : member(item("meshes", index), "primitives", SortedJson::value_t::array)) {
      if (!primitive.is_object()) {
        fail("a primitive in its JSON is no object");
      }
      spend(1);
      const std::size_t mode = whole(primitive, "mode", 4);
      if (mode == 5 || mode == 6) {
        fail("triangle strips and fans are not understood: export plain triangles");
      }
      if (mode == 4) {  // else points or lines
        add_triangles(primitive, placement);
      }
    }
  }

  void add_triangles(const SortedJson& primitive, const Eigen::Matrix4d& placement) {
    const SortedJson& attributes = member(primitive, "attributes", SortedJson::value_t::object);
    const SortedJson& positions = item("accessors", required(attributes, "POSITION"));
    if (whole(positions, "componentType", 0) != 5126 || type_of(positions) != "VEC3") {
      fail("its positions are no vectors of floats");
    }
    const Items points = items_of(positions, 12);
    const std::size_t first = mesh_.vertices.size();
    if (first + points.count > max_index) {
      fail("has more vertices than are understood");
    }
    for (std::size_t i = 0; i < points.count; ++i) {
      std::array<float, 3> p;
      std::memcpy(p.data(), points.at(i), sizeof p);
      mesh_.vertices.emplace_back((placement * Eigen::Vector4d(p[0], p[1], p[2], 1)).head<3>());
    }
    std::vector<Index> corners(points.count);
    std::iota(corners.begin(), corners.end(), Index{0});
    if (primitive.contains("indices")) {
      corners = corners_of(item("accessors", required(primitive, "indices")), points.count);
    }
    if (corners.empty() || corners.size() % 3 != 0) {
      fail(fmt::format("{} corners are no number of triangles", corners.size()));
    }
    const bool mirrored = placement.topLeftCorner<3, 3>().determinant() < 0;
    for (std::size_t c = 0; c < corners.size(); c += 3) {
      const auto corner = [&](std::size_t k) { return static_cast<Index>(first + corners[c + k]); };
      mesh_.triangles.push_back({corner(0), corner(mirrored ? 2 : 1), corner(mirrored ? 1 : 2)});
    }
  }

  std::vector<Index> corners_of(const SortedJson& indices, std::size_t vertices) {
    const std::size_t component = whole(indices, "componentType", 0);
    const std::size_t size = component == 5121 ? 1 : component == 5123 ? 2 : component == 5125 ? 4 : 0;
    if (size == 0 || type_of(indices) != "SCALAR") {
      fail("its indices are no unsigned whole numbers");
    }
    const Items items = items_of(indices, size);
    std::vector<Index> corners(items.count, 0);
    for (std::size_t i = 0; i < items.count; ++i) {
      std::memcpy(&corners[i], items.at(i), size);
      if (corners[i] >= vertices) {
        fail(fmt::format("corner {} names vertex {}, but there are only {} (counted from 0)", i, corners[i], vertices));
      }
    }
    return corners;
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

  struct Items {
    const char* first = nullptr;
    std::size_t count = 0;
    std::size_t stride = 0;
    [[nodiscard]] const char* at(std::size_t i) const { return first + i * stride; }
  };

  /// What an accessor names, when every byte of it is there.
  Items items_of(const SortedJson& accessor, std::size_t item_bytes) {
    if (accessor.contains("sparse") || !accessor.contains("bufferView")) {
      fail("sparse accessors are not understood");
    }
    const std::size_t count = required(accessor, "count");
    spend(count);
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
  TriangleMesh mesh_;
  std::string_view binary_;
  std::size_t budget_;  ///< vertices and corners that may still be read
  std::vector<bool> visited_;
  const std::string& name_;
};

}  // namespace

MeshFile read_glb(std::string_view bytes, const std::string& name) {
  MeshFile file;
  file.units.emplace("m");
  file.mesh = SceneReader(split_chunks(bytes, name), bytes.size(), name).read();
  weld_exactly(file.mesh);
  return file;
}

}  // namespace tunica
