#include "tunica/io/scene/stated.hpp"

#include "tunica/io/scene/detail/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>
#include <set>
#include <sstream>
#include <string>

namespace tunica {
namespace {

// What all items have in common; null where they differ, or where there is none.
template <typename Items, typename Value>
Json common(const Items& items, const Value& value_of) {
  Json value;
  for (const auto& item : items) {
    const Json own = value_of(item);
    if (&item != &items.front() && own != value) {
      return {};
    }
    value = own;
  }
  return value;
}

Json known_or_null(const std::optional<double>& value, double scale = 1) {
  return value ? Json(scale * *value) : Json();
}

// As the user wrote it; empty: not known.
std::string typed_text(const Places& places, std::string_view key) {
  const auto place = places.keys.find(key);
  return place == places.keys.end() ? "" : place->second.typed;
}

Json typed(const Places& places, std::string_view key) {
  const std::string text = typed_text(places, key);
  return text.empty() ? Json() : Json(text);
}

struct NameOfRegion {
  std::string operator()(const AllNodes&) const { return "all"; }
  std::string operator()(const BoundaryNodes&) const { return "boundary"; }
  std::string operator()(const RigidMotions&) const { return "rigid-motions"; }
  std::string operator()(const BoxNodes&) const { return "a box"; }
  std::string operator()(const HalfSpaceNodes& half) const {
    return fmt::format("{} {}={:g}mm", half.below ? "below" : "above", "xyz"[half.axis], half.at);
  }
  std::string operator()(const SphereNodes&) const { return "a sphere"; }
  std::string operator()(const ListedNodes& list) const {
    return fmt::format("{} node{}", list.nodes.size(), list.nodes.size() == 1 ? "" : "s");
  }
  std::string operator()(const NearestNode&) const { return "a node"; }
  std::string operator()(const TouchingNodes&) const { return "what touches"; }
};

// A value as a scene file has it.
Json json_of(const std::string& value) {
  try {
    std::ostringstream text;
    text << toml::json_formatter(toml::parse("value = " + value));
    return Json::parse(text.str()).at("value");
  } catch (const toml::parse_error&) {  // a name of a file need not be UTF-8
    return value;
  }
}

// The whole scene as resolved, by section.
Json tables_of(const Scene& scene) {
  Json tables = Json::object();
  for_each_written_table(scene, {}, [&](std::string_view section, bool repeated, const WrittenKeys& keys) {
    Json table = Json::object();
    for (const auto& [key, value] : keys) {
      table[std::string(key)] = json_of(value);
    }
    Json& place = tables[std::string(section)];
    repeated ? place.push_back(std::move(table)) : place.update(table);
  });
  return tables;
}

// What is held, with its body where there are several.
std::string text_of(const SceneFix& fix, bool alone) {
  const std::string& written = fix.places.item.typed;
  const std::string region = written.empty() ? std::visit(NameOfRegion(), fix.where) : written;
  std::string held = written.empty() && fix.slide ? region + ":slide" : region;
  if (const auto& moved = fix.displacement) {
    held += fmt::format(", moved by ({:g}, {:g}, {:g}) mm", moved->x(), moved->y(), moved->z());
  }
  return alone ? held : fmt::format("{}: {}", fix.body, held);
}

bool is_linear(const RunSettings& run) {
  const auto* statics = std::get_if<StaticRun>(&run.kind);
  const auto* frequencies = std::get_if<FrequencyRun>(&run.kind);
  return (statics != nullptr && statics->linear) || (frequencies != nullptr && frequencies->preload.linear) ||
         std::holds_alternative<BucklingRun>(run.kind);
}

}  // namespace

Json stated_inputs(const Scene& scene) {
  constexpr double kg_per_m3 = 1e12;  // in a tonne / mm^3
  constexpr double n_per_m3 = 1e9;    // in an N / mm^3
  std::vector<SceneLoad> pressures;
  for (const SceneLoad& load : scene.loads) {
    if (std::holds_alternative<PressureLoad>(load.kind)) {
      pressures.push_back(load);
    }
  }
  const auto of_pressure = [](const SceneLoad& load) { return std::get<PressureLoad>(load.kind); };
  const auto of_shells = [&](const auto& value) { return common(scene.shells, value); };
  Json stated{{"kind", name_of(scene.run.kind)}, {"geometry", is_linear(scene.run) ? "linear" : "nonlinear"}};
  stated["young_mpa"] = of_shells(
      [](const SceneShell& shell) { return shell.material.young_stated ? Json(shell.material.young) : Json(); });
  stated["poisson"] = of_shells([](const SceneShell& shell) { return Json(shell.material.poisson); });
  stated["thickness_mm"] =
      of_shells([](const SceneShell& shell) { return shell.thickness_from ? Json() : Json(shell.thickness); });
  stated["density_kg_per_m3"] =
      of_shells([](const SceneShell& shell) { return known_or_null(shell.material.density, kg_per_m3); });
  stated["pressure_mpa"] = common(pressures, [&](const SceneLoad& load) { return Json(of_pressure(load).value); });
  stated["imaged_at_mpa"] =
      common(pressures, [&](const SceneLoad& load) { return known_or_null(of_pressure(load).imaged_at); });
  stated["law"] = scene.shells.empty() ? Json() : Json("linear");
  stated["support"] = common(scene.supports, [](const SceneSupport& support) {
    Json bed{{"stiffness_n_per_m3", n_per_m3 * support.stiffness},
             {"direction", support.normal_only ? "normal" : "all"}};
    if (support.where) {
      bed["where"] = std::visit(NameOfRegion(), *support.where);
    }
    return bed;
  });
  stated["membrane"] = of_shells([](const SceneShell& shell) { return Json(name_of(shell.membrane)); });
  stated["bending"] = of_shells([](const SceneShell& shell) { return Json(name_of(shell.bending)); });
  stated["solver"] = name_of(scene.run.solver);
  stated["fix"] = Json::array();
  const bool alone = scene.shells.size() + scene.solids.size() == 1;
  for (const SceneFix& fix : scene.fixes) {
    stated["fix"].push_back(text_of(fix, alone));
  }
  stated["loads"] = Json::array();
  for (const SceneLoad& load : scene.loads) {
    const std::string region = load.where ? std::visit(NameOfRegion(), *load.where) : "";
    Json& told = stated["loads"].emplace_back(Json{{"kind", name_of(load.kind)}});
    told["where"] = region.empty() ? Json() : Json(region);
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
      told["follower"] = pressure->follower;
    }
    told["ramped"] = !load.ramp.points.empty();
  }
  stated["scene"] = tables_of(scene);
  Json& written = stated["typed"] = Json::object();
  for (const char* key : {"young", "thickness", "density"}) {
    written[key] = of_shells([&](const SceneShell& shell) { return typed(shell.places, key); });
  }
  written["pressure"] = common(pressures, [](const SceneLoad& load) { return typed(load.places, "value"); });
  written["imaged_at"] = common(pressures, [](const SceneLoad& load) { return typed(load.places, "imaged_at"); });
  written["duration"] = typed(scene.run_places, "duration");
  written["step"] = typed(scene.run_places, "step");
  return stated;
}

std::string stated_line(const Scene& scene) {
  std::vector<std::string> parts;
  const auto say = [&](const char* name, const std::set<std::string>& values) {
    if (values.size() == 1 && !values.begin()->empty()) {
      parts.push_back(fmt::format("{} {}", name, *values.begin()));
    }
  };
  std::set<std::string> pressures;
  std::set<std::string> imaged;
  std::set<std::string> others;
  for (const SceneLoad& load : scene.loads) {
    if (std::holds_alternative<PressureLoad>(load.kind)) {
      pressures.insert(typed_text(load.places, "value"));
      imaged.insert(typed_text(load.places, "imaged_at"));
    } else {
      const std::string value = typed_text(load.places, "value");
      others.insert(std::string(name_of(load.kind)) + (value.empty() ? "" : " " + value));
    }
  }
  say("pressure", pressures);
  say("imaged at", imaged);
  if (!others.empty()) {
    parts.push_back(fmt::format("{}", fmt::join(others, ", ")));
  }
  const auto of_shells = [&](const auto& value) {
    std::set<std::string> values;
    for (const SceneShell& shell : scene.shells) {
      values.insert(value(shell));
    }
    return values;
  };
  say("wall", of_shells([](const SceneShell& shell) { return typed_text(shell.places, "thickness"); }));
  say("E", of_shells([](const SceneShell& shell) { return typed_text(shell.places, "young"); }));
  say("Poisson's ratio",
      of_shells([](const SceneShell& shell) { return fmt::format("{:g}", shell.material.poisson); }));
  std::string line = fmt::format("{}", fmt::join(parts, ", "));
  if (!line.empty()) {
    line.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(line.front())));
  }
  return line;
}

}  // namespace tunica
