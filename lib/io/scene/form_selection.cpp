#include "tunica/io/scene/detail/scene_key.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace tunica::form {
namespace {

using Way = SceneKey<Selection>;

/// One way to say where: its only key.
template <typename Nodes>
Way way(std::string_view name, const Form<Nodes>& form) {
  return key<Selection>(name, std::identity{},
                        made_of(
                            form, [](const Nodes& nodes) { return Selection(nodes); },
                            [](const Selection& where) { return std::get<Nodes>(where); }))
      .written_if([](const Selection& where) { return std::holds_alternative<Nodes>(where); });
}

/// `name = true`
template <typename Nodes>
Way way(std::string_view name) {
  const auto is_true = [](bool value, const Place& place, std::string_view key) {
    place.require(value, fmt::format("{} = false selects nothing: remove it", key));
  };
  return way(name, made_of(
                       flag().checked(is_true), [](bool) { return Nodes{}; }, [](const Nodes&) { return true; }));
}

Way half_space(std::string_view name, bool below, const Form<double>& length) {
  const SceneKeys<HalfSpaceNodes> keys{key("axis", &HalfSpaceNodes::axis, axis()).needed(),
                                       key("at", &HalfSpaceNodes::at, length).needed()};
  const auto with_side = [below](HalfSpaceNodes half) {
    half.below = below;
    return half;
  };
  return way(name, made_of(inner(keys, R"({axis = "z", at = "1mm"})"), with_side, std::identity{}))
      .written_if([below](const Selection& where) {
        const auto* half = std::get_if<HalfSpaceNodes>(&where);
        return half != nullptr && half->below == below;
      });
}

Form<BoxNodes> box(const Form<Vec3>& point) {
  const auto is_upright = [](const std::vector<Vec3>& corners, const Place& place, std::string_view) {
    place.require((corners[0].array() <= corners[1].array()).all(),
                  "box has a lower corner above its upper one: swap the coordinates");
  };
  return made_of(
      list_of(point, 2, "its lower and its upper corner", R"([["0mm", "0mm", "0mm"], ["1mm", "1mm", "1mm"]])")
          .checked(is_upright),
      [](const std::vector<Vec3>& corners) {
        return BoxNodes{corners[0], corners[1]};
      },
      [](const BoxNodes& box) {
        return std::vector{box.lower, box.upper};
      });
}

Form<Index> node() {
  return {"3",
          [](const SceneTable& table, const toml::node& node, std::string_view) {
            const auto index = node.value_exact<std::int64_t>();
            table.at(node).require(index && *index >= 0 && *index <= narrow<std::int64_t>(max_index),
                                   "nodes must be whole numbers from 0, in the order of the mesh file");
            return narrow<Index>(*index);
          },
          [](Index index, const Writing&) { return std::to_string(index); }};
}

/// All ways; the last is for what another body carries.
std::vector<Way> all_ways() {
  const Form<Vec3> point = vector(dimension::length, "m", R"(["0mm", "0mm", "10mm"])");
  const Form<double> length = quantity(dimension::length, "m", "\"1mm\"");
  const SceneKeys<SphereNodes> sphere{key("centre", &SphereNodes::centre, point).needed(),
                                      key("radius", &SphereNodes::radius, length.in(not_negative)).needed()};
  return {way<BoundaryNodes>("boundary"),
          way<RigidMotions>("rigid_motions"),
          way<AllNodes>("all"),
          way("box", box(point)),
          half_space("below", true, length),
          half_space("above", false, length),
          way("sphere", inner(sphere, R"({centre = ["0mm", "0mm", "0mm"], radius = "2mm"})")),
          way("nodes", made_of(
                           list_of(node(), 0, "a list", "[3, 4]"),
                           [](const std::vector<Index>& nodes) { return ListedNodes{nodes}; },
                           [](const ListedNodes& list) { return list.nodes; })),
          way("nearest", made_of(
                             point, [](const Vec3& at) { return NearestNode{at}; },
                             [](const NearestNode& nearest) { return nearest.point; })),
          way("touching", made_of(
                              length.in(not_negative), [](double within) { return TouchingNodes{within}; },
                              [](const TouchingNodes& touching) { return touching.distance; }))};
}

}  // namespace

Form<Selection> selection(bool carried) {
  std::vector<Way> ways = all_ways();
  ways.resize(carried ? ways.size() : ways.size() - 1, {});
  Form<Selection> form = inner(ways, "{boundary = true}");
  form.read = [ways](const SceneTable& item, const toml::node& node, std::string_view key) {
    const std::vector<std::string_view> names = names_of_keys(ways);
    const toml::table& table = table_of(item, node, key, "{boundary = true}");
    const SceneTable where(table, item.source(), std::string(key), names);
    item.at(node).require(table.size() == 1, fmt::format("where must hold exactly one of {}, this one holds {}",
                                                         fmt::join(names, ", "), table.size()));
    Selection selection;
    read_keys(where, ways, selection);
    return selection;
  };
  return form;
}

}  // namespace tunica::form
