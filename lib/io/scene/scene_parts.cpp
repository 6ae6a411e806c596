#include "tunica/io/scene/detail/scene_parts.hpp"

#include "tunica/core/narrow.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace tunica {
namespace {

HalfSpaceNodes read_half_space(const SceneTable& where, std::string_view key) {
  constexpr std::array<std::string_view, 2> keys{"axis", "at"};
  const SceneTable inner(where.table(key, R"({axis = "z", at = "1mm"})"), where.file(), std::string(key), keys);
  HalfSpaceNodes half;
  half.below = key == "below";
  (void)inner.required("axis");
  inner.choice<int>("axis", half.axis, {{"x", 0}, {"y", 1}, {"z", 2}});
  half.at = inner.quantity("at", dimension::length);
  return half;
}

// Pairs of a time and a value, at least one, times increasing.
template <typename Value>
std::vector<std::pair<double, Value>> read_pairs(const SceneTable& item, std::string_view key,
                                                 std::string_view like_first, std::string_view like_last, bool dynamic,
                                                 Scene& scene, const ReadValue<Value>& read) {
  const std::string like = fmt::format(R"([[{0}, {2}], [{1}, {3}]])", dynamic ? R"("0s")" : "0.0",
                                       dynamic ? R"("1s")" : "1.0", like_first, like_last);
  std::vector<std::pair<double, Value>> pairs;
  for (const toml::node& node : item.array(key, like)) {
    const toml::array* pair = node.as_array();
    if (pair == nullptr || pair->size() != 2) {
      item.at(node.source()).fail(fmt::format("{} must be a list of pairs, for example {}", key, like));
    }
    const toml::node& when = (*pair)[0];
    const bool load_factor = !dynamic && (when.is_integer() || when.is_floating_point());
    const double time = load_factor ? item.number_of(when, key) : item.quantity_of(when, key, dimension::time);
    if (!dynamic && !load_factor && pairs.empty()) {
      scene.notes.push_back(
          fmt::format("{}: a static run has no time: the {} is read over the load factor, 1s as factor 1",
                      item.place(key).text, key));
    }
    if (!pairs.empty() && !(time > pairs.back().first)) {
      item.at(when.source()).fail(fmt::format("the times of {} must increase", key));
    }
    pairs.emplace_back(time, read((*pair)[1]));
  }
  if (pairs.empty()) {
    item.place(key).fail(fmt::format("{} is empty: write for example {}", key, like));
  }
  return pairs;
}

}  // namespace

Selection read_where(const SceneTable& item, bool carried) {
  constexpr std::array<std::string_view, 10> all_forms{"boundary", "rigid_motions", "all",   "box",     "below",
                                                       "above",    "sphere",        "nodes", "nearest", "touching"};
  const Keys forms = Keys(all_forms).first(carried ? all_forms.size() : all_forms.size() - 1);
  const toml::table& table = item.table("where", "{boundary = true}");
  const SceneTable where(table, item.file(), "where", forms);
  if (table.size() != 1) {
    item.place("where").fail(
        fmt::format("where must hold exactly one of {}, this one holds {}", fmt::join(forms, ", "), table.size()));
  }
  const std::string_view form = table.begin()->first.str();
  if (form == "boundary" || form == "rigid_motions" || form == "all") {
    if (!where.flag(form)) {
      where.place(form).fail(fmt::format("{} = false selects nothing: remove it", form));
    }
    if (form == "all") {
      return AllNodes{};
    }
    return form == "boundary" ? Selection(BoundaryNodes{}) : Selection(RigidMotions{});
  }
  if (form == "box") {
    constexpr std::string_view like = R"([["0mm", "0mm", "0mm"], ["1mm", "1mm", "1mm"]])";
    const toml::array& corners = where.array(form, like);
    if (corners.size() != 2) {
      where.place(form).fail(fmt::format("box must be its lower and its upper corner, for example {}", like));
    }
    const BoxNodes box{where.vector_of(corners[0], "box", dimension::length, like_point),
                       where.vector_of(corners[1], "box", dimension::length, like_point)};
    if (!(box.lower.array() <= box.upper.array()).all()) {
      where.place(form).fail("box has a lower corner above its upper one: swap the coordinates");
    }
    return box;
  }
  if (form == "below" || form == "above") {
    return read_half_space(where, form);
  }
  if (form == "sphere") {
    constexpr std::array<std::string_view, 2> keys{"centre", "radius"};
    constexpr std::string_view like = R"({centre = ["0mm", "0mm", "0mm"], radius = "2mm"})";
    const SceneTable inner(where.table(form, like), where.file(), "sphere", keys);
    const SphereNodes sphere{inner.vector("centre", dimension::length, like_point),
                             inner.quantity("radius", dimension::length)};
    if (!(sphere.radius >= 0)) {
      inner.place("radius").fail("radius must not be negative");
    }
    return sphere;
  }
  if (form == "nodes") {
    ListedNodes list;
    for (const toml::node& node : where.array(form, "[3, 4]")) {
      const auto index = node.value_exact<std::int64_t>();
      if (!index || *index < 0 || *index > narrow<std::int64_t>(max_index)) {
        where.at(node.source()).fail("nodes must be whole numbers from 0, in the order of the mesh file");
      }
      list.nodes.push_back(narrow<Index>(*index));
    }
    return list;
  }
  if (form == "touching") {
    const TouchingNodes touching{where.quantity(form, dimension::length)};
    where.place(form).require(touching.distance >= 0, "touching must not be negative");
    return touching;
  }
  return NearestNode{where.vector("nearest", dimension::length, like_point)};
}

Ramp read_ramp(const SceneTable& item, bool dynamic, Scene& scene) {
  constexpr std::string_view key = "ramp";
  if (!item.has(key)) {
    return {};
  }
  return {read_pairs<double>(item, key, "0.0", "1.0", dynamic, scene,
                             [&](const toml::node& node) { return item.number_of(node, key); })};
}

template <typename Value>
Table<Value> read_table(const SceneTable& item, std::string_view key, std::string_view like, bool dynamic, Scene& scene,
                        const ReadValue<Value>& read) {
  const toml::node& node = item.required(key);
  const toml::array* entries = node.as_array();
  if (entries == nullptr || (!entries->empty() && !entries->front().is_array())) {
    return {{{0, read(node)}}};
  }
  return {read_pairs<Value>(item, key, like, like, dynamic, scene, read)};
}

template Table<double> read_table(const SceneTable&, std::string_view, std::string_view, bool, Scene&,
                                  const ReadValue<double>&);
template Table<Vec3> read_table(const SceneTable&, std::string_view, std::string_view, bool, Scene&,
                                const ReadValue<Vec3>&);

}  // namespace tunica
