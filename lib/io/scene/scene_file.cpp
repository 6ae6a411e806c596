#include "tunica/io/scene/scene_file.hpp"

#include "tunica/io/file/output_file.hpp"
#include "tunica/io/scene/detail/schema.hpp"
#include "tunica/io/scene/detail/toml_depth.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t most_bytes = std::size_t{64} << 20;

// What the silence of a table means, where the keys do not say it.
template <typename Item>
void settle(const SceneTable&, Item&) {}

void settle(const SceneTable& table, Scene& scene) {
  scene.run_places = table.places();
  auto* statics = std::get_if<StaticRun>(&scene.run.kind);
  auto* frequencies = std::get_if<FrequencyRun>(&scene.run.kind);
  auto* path = std::get_if<ArcLengthRun>(&scene.run.kind);
  StaticRun* loaded = frequencies != nullptr ? &frequencies->preload : statics;
  if (loaded != nullptr && loaded->load_factors.empty()) {
    loaded->load_factors = equal_load_factors(1);
  }
  if (path != nullptr && !scene.until && !path->max_factor && !table.has("max_steps")) {
    path->max_factor = 1;
  }
}

void settle(const SceneTable& table, SceneShell& shell) {
  shell.material.young_stated = table.has("young");
  shell.material.young = shell.material.young_stated ? shell.material.young : any_young;
}

void settle(const SceneTable& table, SceneFix& fix) {
  if (fix.slide || std::holds_alternative<RigidMotions>(fix.where) || table.has("rotation")) {
    return;
  }
  const std::vector<SceneSolid>& solids = table.source().scene.solids;
  if (std::ranges::count(solids, fix.body, &SceneSolid::name) == 0) {
    (void)table.required("rotation", axes_are_said);
  }
  fix.rotation = {false, false, false};  // the nodes of a solid have none
}

void settle(const SceneTable& table, SceneContact& contact) {
  if (!table.has("name")) {
    contact.name = fmt::format("{}-{}", contact.between[0], contact.between[1]);
  }
  if (!contact.consistent) {
    table.source().scene.warnings.push_back(
        {Weight::minor, "unbalanced contact",
         fmt::format("{}: transfer = \"paper\" loses moments: forces between \"{}\" and \"{}\" are not in balance",
                     table.place("transfer").text, contact.between[0], contact.between[1])});
  }
}

/// @param header  as messages name it: "[[shell]]"
template <typename Item>
SceneTable read_item(const toml::table& node, SceneSource& source, const std::string& header,
                     const SceneKeys<Item>& keys, Item& item) {
  const SceneTable table(node, source, header, names_of_keys(keys));
  read_keys(table, keys, item);
  settle(table, item);
  return table;
}

/// Says of each rigid body that no contact names that all goes through it.
void doubt_idle_rigids(Scene& scene) {
  for (const SceneRigid& rigid : scene.rigids) {
    const bool touches = std::any_of(scene.contacts.begin(), scene.contacts.end(), [&](const SceneContact& contact) {
      return contact.between[0] == rigid.name || contact.between[1] == rigid.name;
    });
    if (!touches) {
      scene.warnings.push_back(
          {Weight::major, "no contact",
           fmt::format("{}: no [[contact]] names \"{}\", so all goes through it: add one, or take it out",
                       rigid.places.item.text, rigid.name)});
    }
  }
}

toml::table parse_toml(const std::string& bytes, const std::string& file) {
  constexpr std::size_t deepest = 64;
  if (longest_dotted_key(bytes) > deepest) {
    throw InputError(fmt::format("{}: it has a key of more than {} dotted parts, which no scene needs", file, deepest));
  }
  try {
    return toml::parse(bytes, std::string_view(file));
  } catch (const toml::parse_error& error) {
    const auto& begin = error.source().begin;
    throw InputError(fmt::format("{}:{}:{}: {}, correct the TOML there", file, begin.line, begin.column,
                                 std::string(error.description())));
  }
}

// The tables of [[name]]; an empty list where there are none.
std::vector<const toml::table*> tables_of(const toml::table& root, std::string_view name, const SceneTable& top) {
  std::vector<const toml::table*> tables;
  const toml::node* node = root.get(name);
  if (node == nullptr) {
    return tables;
  }
  const toml::array* items = node->as_array();
  if (items == nullptr) {
    top.place(name).fail(fmt::format("{0} must be written as [[{0}]], once per item", name));
  }
  for (const toml::node& item : *items) {
    if (!item.is_table()) {
      top.at(item).fail(fmt::format("{0} must be written as [[{0}]], once per item", name));
    }
    tables.push_back(item.as_table());
  }
  return tables;
}

/// The table of [name]. Errors: it is none.
const toml::table& table_named(std::string_view name, const SceneTable& top) {
  const toml::table* table = top.required(name).as_table();
  if (table == nullptr) {
    top.place(name).fail(fmt::format("{0} must be written as [{0}], once", name));
  }
  return *table;
}

}  // namespace

Scene read_scene(const fs::path& path) { return parse_scene(read_file(path, most_bytes), path); }

Scene parse_scene(const std::string& text, const fs::path& name) {
  Scene scene;
  SceneSource source{name.string(), name.parent_path(), scene};
  const toml::table root = parse_toml(text, source.file);
  std::vector<std::string_view> sections{"run"};
  for_each_section(scene, [&](std::string_view section, const auto&, const auto&) { sections.push_back(section); });
  sections.push_back("accuracy");
  const SceneTable top(root, source, "the scene", sections);

  (void)read_item(table_named("run", top), source, "[run]", scene_schema().run, scene);
  for_each_section(scene, [&](std::string_view section, const auto& keys, auto& items) {
    for (const toml::table* table : tables_of(root, section, top)) {
      typename std::decay_t<decltype(items)>::value_type item{};
      item.places = read_item(*table, source, fmt::format("[[{}]]", section), keys, item).places();
      items.push_back(std::move(item));
    }
  });
  if (top.has("accuracy")) {
    SceneAccuracy asked;
    asked.places =
        read_item(table_named("accuracy", top), source, "[accuracy]", scene_schema().accuracy, asked).places();
    scene.accuracy = std::move(asked);
  }
  settle_until(scene);
  settle_solver(scene);
  check_scene(scene);
  doubt_idle_rigids(scene);
  return scene;
}

}  // namespace tunica
