#include "tunica/io/scene/scene_file.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/scene/detail/scene_parts.hpp"
#include "tunica/io/scene/detail/scene_table.hpp"
#include "tunica/io/scene/detail/toml_depth.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t most_bytes = std::size_t{64} << 20;
constexpr std::int64_t most_load_steps = 1'000'000;
constexpr std::int64_t most_modes = 10'000;

// A fix says which components it holds: neither "all" nor "none" may be meant by silence.
std::array<bool, 3> read_components(const SceneTable& item, std::string_view key) {
  const std::string text = item.text_of(item.required(key, R"( ("xyz" holds all axes, "" none))"), key);
  std::array<bool, 3> held{false, false, false};
  for (const char c : text) {
    const std::size_t axis = std::string_view("xyz").find(c);
    if (axis == std::string_view::npos || held[axis]) {
      item.place(key).fail(
          fmt::format("{} = \"{}\" must name each held axis once: \"xyz\", \"z\", or \"\" for none", key, text));
    }
    held[axis] = true;
  }
  return held;
}

// Which kinds of run a key belongs to; `kind` is none of them.
void refuse_keys(const SceneTable& run, std::string_view kind, std::string_view owners,
                 std::initializer_list<std::string_view> keys) {
  for (const std::string_view key : keys) {
    if (run.has(key)) {
      run.place(key).fail(fmt::format("{} belongs to a {} run, and kind is \"{}\": remove it", key, owners, kind));
    }
  }
}

void read_static(const SceneTable& run, StaticRun& settings) {
  run.choice<bool>("geometry", settings.linear, {{"nonlinear", false}, {"linear", true}});
  if (run.has("load_steps") && run.has("load_factors")) {
    run.place("load_factors").fail("load_steps and load_factors contradict each other: give one");
  }
  if (!run.has("load_factors")) {
    settings.load_factors = equal_load_factors(run.has("load_steps") ? run.count("load_steps", most_load_steps) : 1);
    return;
  }
  for (const toml::node& node : run.array("load_factors", "[0.1, 0.2, 1.0]")) {
    const double factor = run.number_of(node, "load_factors");
    if (!(factor > (settings.load_factors.empty() ? 0 : settings.load_factors.back()))) {
      run.at(node.source()).fail("load_factors must increase from above 0");
    }
    settings.load_factors.push_back(factor);
  }
  if (settings.load_factors.empty()) {
    run.place("load_factors").fail("load_factors is empty: write for example [0.1, 0.2, 1.0]");
  }
}

void read_arc_length(const SceneTable& run, Scene& scene) {
  auto& settings = scene.run.kind.emplace<ArcLengthRun>();
  bool linear = false;
  run.choice<bool>("geometry", linear, {{"nonlinear", false}, {"linear", true}});
  if (linear) {
    run.place("geometry").fail("a linear run has no path to follow: remove control = \"arc-length\"");
  }
  if (run.has("load_factors")) {
    run.place("load_factors").fail("arc length finds the load factors: remove load_factors");
  }
  if (run.has("load_steps")) {
    settings.first_factor = 1 / real(run.count("load_steps", most_load_steps));
  }
  if (run.has("max_steps")) {
    settings.max_steps = run.count("max_steps", most_load_steps);
  }
  if (run.has("max_factor")) {
    settings.max_factor = run.number("max_factor");
  }
  if (run.has("until")) {
    constexpr std::array<std::string_view, 3> keys{"probe", "axis", "reaches"};
    const SceneTable until(run.table("until", R"({probe = "tip", axis = "z", reaches = "30mm"})"), run.file(), "until",
                           keys);
    scene.until_probe = until.text("probe");
    ArcLengthRun::Until& goal = settings.until.emplace(ArcLengthRun::Until{});
    (void)until.required("axis");
    until.choice<int>("axis", goal.axis, {{"x", 0}, {"y", 1}, {"z", 2}});
    goal.reaches = until.quantity("reaches", dimension::length);
  } else if (!settings.max_factor && !run.has("max_steps")) {
    settings.max_factor = 1;
  }
}

void read_dynamic(const SceneTable& run, DynamicRun& settings) {
  bool linear = false;
  run.choice<bool>("geometry", linear, {{"nonlinear", false}, {"linear", true}});
  if (linear) {
    throw UsageError(
        fmt::format("{}: geometry = \"linear\" in a dynamic run: not available yet", run.place("geometry").text));
  }
  settings.duration = run.quantity("duration", dimension::time, " (a dynamic run needs it)");
  settings.step = run.quantity("step", dimension::time, " (a dynamic run needs it)");
  run.choice<Integrator>(
      "integrator", settings.integrator,
      {{"backward-euler", Integrator::backward_euler}, {"generalised-alpha", Integrator::generalised_alpha}});
  if (run.has("spectral_radius")) {
    if (settings.integrator != Integrator::generalised_alpha) {
      run.place("spectral_radius")
          .fail("spectral_radius belongs to integrator = \"generalised-alpha\": remove it, or choose that integrator");
    }
    settings.spectral_radius = run.number("spectral_radius");
  }
  if (run.has("adaptive")) {
    try {
      settings.adaptive = parse_length_tolerance(run.text("adaptive"));
    } catch (const UsageError& error) {
      run.place("adaptive").fail(fmt::format("adaptive: {}", error.what()));
    }
  }
  if (run.has("damping")) {
    constexpr std::array<std::string_view, 2> keys{"mass", "stiffness"};
    const SceneTable damping(run.table("damping", R"({mass = "0.1/s", stiffness = "2ms"})"), run.file(), "damping",
                             keys);
    settings.damping.mass = damping.has("mass") ? damping.quantity("mass", dimension::rate) : 0;
    settings.damping.stiffness = damping.has("stiffness") ? damping.quantity("stiffness", dimension::time) : 0;
    for (const std::string_view key : keys) {
      if ((key == "mass" ? settings.damping.mass : settings.damping.stiffness) < 0) {
        damping.place(key).fail(fmt::format("damping {} must not be negative", key));
      }
    }
  }
}

void read_run(const toml::table& table, const std::string& file, Scene& scene) {
  constexpr std::array<std::string_view, 21> keys{
      "kind",    "geometry",   "load_steps",      "load_factors", "control",       "duration",   "step",
      "damping", "integrator", "solver",          "cg_tolerance", "cg_iterations", "converge",   "newton_max",
      "every",   "count",      "spectral_radius", "adaptive",     "max_steps",     "max_factor", "until"};
  const SceneTable run(table, file, "[run]", keys);
  scene.run_places = run.places();

  enum class Kind { is_static, dynamic, frequencies, buckling } kind = Kind::is_static;
  const std::string name = run.text("kind");
  run.choice<Kind>("kind", kind,
                   {{"static", Kind::is_static},
                    {"dynamic", Kind::dynamic},
                    {"frequencies", Kind::frequencies},
                    {"buckling", Kind::buckling}});
  if (kind != Kind::dynamic) {
    refuse_keys(run, name, "dynamic", {"duration", "step", "damping", "integrator", "spectral_radius", "adaptive"});
  }
  if (kind != Kind::is_static) {
    refuse_keys(run, name, "control = \"arc-length\"", {"max_steps", "max_factor", "until"});
  }
  if (kind != Kind::frequencies && kind != Kind::buckling) {
    refuse_keys(run, name, "frequencies or buckling", {"count"});
  }
  const auto read_count = [&](std::size_t& count) {
    if (run.has("count")) {
      count = run.count("count", most_modes);
    }
  };
  switch (kind) {
    case Kind::is_static: {
      bool by_arc_length = false;
      run.choice<bool>("control", by_arc_length, {{"load", false}, {"arc-length", true}});
      if (by_arc_length) {
        read_arc_length(run, scene);
      } else {
        refuse_keys(run, name, "control = \"arc-length\"", {"max_steps", "max_factor", "until"});
        read_static(run, scene.run.kind.emplace<StaticRun>());
      }
      break;
    }
    case Kind::dynamic:
      refuse_keys(run, name, "static", {"load_steps", "load_factors", "control"});
      read_dynamic(run, scene.run.kind.emplace<DynamicRun>());
      break;
    case Kind::frequencies: {
      refuse_keys(run, name, "static", {"control"});
      auto& frequencies = scene.run.kind.emplace<FrequencyRun>();
      read_static(run, frequencies.preload);
      if (frequencies.preload.linear) {
        refuse_keys(run, name, "nonlinear", {"load_steps", "load_factors"});
      }
      read_count(frequencies.count);
      break;
    }
    case Kind::buckling:
      refuse_keys(run, name, "static", {"geometry", "load_steps", "load_factors", "control"});
      read_count(scene.run.kind.emplace<BucklingRun>().count);
      break;
  }

  run.choice<Solver>("solver", scene.run.solver,
                     {{"auto", Solver::automatic}, {"cg", Solver::cg}, {"direct", Solver::direct}});
  if (run.has("cg_tolerance")) {
    scene.run.cg_tolerance = run.part("cg_tolerance");
    scene.cg_tolerance_stated = true;
  }
  if (run.has("cg_iterations")) {
    scene.run.cg_iterations = run.count("cg_iterations");
  }
  if (run.has("converge")) {
    scene.run.converge = run.number("converge");
  }
  if (run.has("newton_max")) {
    scene.run.newton_max = run.count("newton_max");
  }
  if (run.has("every")) {
    scene.run.every = run.count("every");
  }
}

void read_accuracy(const toml::table& node, const std::string& file, const fs::path& folder, Scene& scene) {
  constexpr std::array<std::string_view, 3> keys{"within", "of", "target"};
  const SceneTable table(node, file, "[accuracy]", keys);
  SceneAccuracy& accuracy = scene.accuracy.emplace();
  accuracy.places = table.places();
  accuracy.within = table.part("within");
  if (table.has("of") && table.required("of").is_table()) {
    constexpr std::array<std::string_view, 2> of_probe{"probe", "axis"};
    const SceneTable of(table.table("of", ""), file, "of", of_probe);
    accuracy.of = Quantity::probe;
    accuracy.probe = of.text("probe");
    (void)of.required("axis");
    of.choice<int>("axis", accuracy.axis, {{"x", 0}, {"y", 1}, {"z", 2}});
  } else {
    table.choice<Quantity>("of", accuracy.of,
                           {{"displacement", Quantity::displacement},
                            {"energy", Quantity::energy},
                            {"volume", Quantity::volume},
                            {"stress", Quantity::stress},
                            {"membrane", Quantity::membrane},
                            {"tension", Quantity::tension}});
  }
  if (table.has("target")) {
    for (const auto& [name, path] : table.table("target", R"({vessel = "surface.ply"})")) {
      accuracy.targets[std::string(name.str())] = folder / table.text_of(path, "target");
    }
  }
}

void read_fix(const SceneTable& table, bool dynamic, Scene& scene) {
  SceneFix fix;
  fix.places = table.places();
  fix.body = table.text("body");
  fix.where = read_where(table);
  fix.slide = table.has("slide") && table.flag("slide");
  if (std::holds_alternative<RigidMotions>(fix.where) && table.has("slide")) {
    table.place("slide").fail("slide means nothing beside rigid_motions: remove it");
  }
  if (fix.slide) {
    for (const std::string_view key : {"translation", "rotation", "displacement", "ramp"}) {
      if (table.has(key)) {
        table.place(key).fail(fmt::format("{} means nothing beside slide = true: remove it", key));
      }
    }
  } else if (std::holds_alternative<RigidMotions>(fix.where)) {
    for (const std::string_view key : {"translation", "rotation", "displacement", "ramp"}) {
      if (table.has(key)) {
        table.place(key).fail(fmt::format("{} means nothing beside rigid_motions: remove it", key));
      }
    }
  } else {
    fix.translation = read_components(table, "translation");
    const bool of_solid = std::any_of(scene.solids.begin(), scene.solids.end(),
                                      [&](const SceneSolid& solid) { return solid.name == fix.body; });
    if (of_solid && !table.has("rotation")) {
      fix.rotation = {false, false, false};  // the nodes of a solid have none
    } else {
      fix.rotation = read_components(table, "rotation");
    }
    if (table.has("displacement")) {
      fix.displacement = table.vector("displacement", dimension::length, R"(["0mm", "0mm", "1mm"])");
    }
    if (table.has("ramp") && !fix.displacement) {
      table.place("ramp").fail("ramp in [[fix]] needs a displacement: add it, or remove the ramp");
    }
    fix.ramp = read_ramp(table, dynamic, scene);
  }
  scene.fixes.push_back(std::move(fix));
}

void read_support(const toml::table& node, const std::string& file, Scene& scene) {
  constexpr std::array<std::string_view, 4> keys{"body", "where", "stiffness", "direction"};
  const SceneTable table(node, file, "[[support]]", keys);
  SceneSupport support;
  support.places = table.places();
  support.body = table.text("body");
  if (table.has("where")) {
    support.where = read_where(table);
    if (std::holds_alternative<RigidMotions>(*support.where)) {
      table.place("where").fail("rigid_motions belongs to [[fix]]: select nodes");
    }
  }
  support.stiffness = table.quantity("stiffness", dimension::bedding);
  table.choice<bool>("direction", support.normal_only, {{"all", false}, {"normal", true}});
  scene.supports.push_back(std::move(support));
}

void read_load(const toml::table& node, const std::string& file, bool dynamic, Scene& scene) {
  constexpr std::array<std::string_view, 8> all{"body", "kind",  "value",     "follower",
                                                "ramp", "where", "imaged_at", "unload"};
  const SceneTable table(node, file, "[[load]]", all);
  SceneLoad load;
  load.places = table.places();
  load.body = table.text("body");

  enum class Kind { pressure, force, moment, edge, area, gravity } kind = Kind::pressure;
  (void)table.required("kind");
  table.choice<Kind>("kind", kind,
                     {{"pressure", Kind::pressure},
                      {"force", Kind::force},
                      {"moment", Kind::moment},
                      {"edge", Kind::edge},
                      {"area", Kind::area},
                      {"gravity", Kind::gravity}});
  for (const char* key : {"follower", "imaged_at", "unload"}) {
    if (kind != Kind::pressure && table.has(key)) {
      table.place(key).fail(fmt::format("{} belongs to a pressure: remove it", key));
    }
  }
  const bool of_nodes = kind == Kind::force || kind == Kind::moment || kind == Kind::edge;
  if (of_nodes || (kind == Kind::pressure && table.has("where"))) {
    (void)table.required("where", " (which nodes carry the load)");
    load.where = read_where(table);
    if (std::holds_alternative<RigidMotions>(*load.where)) {
      table.place("where").fail("rigid_motions belongs to [[fix]]: select nodes");
    }
  } else if (table.has("where")) {
    table.place("where").fail(
        fmt::format("a load of kind {} acts on the whole body: remove where", table.text("kind")));
  }
  switch (kind) {
    case Kind::pressure:
      load.kind = PressureLoad{
          table.quantity("value", dimension::pressure), !table.has("follower") || table.flag("follower"),
          table.has("imaged_at") ? std::optional(table.quantity("imaged_at", dimension::pressure)) : std::nullopt,
          table.has("unload") && table.flag("unload")};
      if (table.has("unload") && !table.has("imaged_at")) {
        table.place("unload").fail("unload takes off the pressure of the image: add imaged_at, or remove unload");
      }
      break;
    case Kind::force:
      load.kind = ForceLoad{{}, table.vector("value", dimension::force, R"(["0N", "0N", "-1N"])")};
      break;
    case Kind::moment:
      load.kind = MomentLoad{{}, table.vector("value", dimension::moment, R"(["0N*mm", "0N*mm", "1N*mm"])")};
      break;
    case Kind::edge:
      load.kind = EdgeLoad{{}, table.vector("value", dimension::force_per_length, R"(["0N/mm", "0N/mm", "1N/mm"])")};
      break;
    case Kind::area:
      load.kind = AreaLoad{table.vector("value", dimension::pressure, R"(["0kPa", "0kPa", "1kPa"])")};
      break;
    case Kind::gravity:
      load.kind = GravityLoad{table.vector("value", dimension::acceleration, R"(["0m/s2", "0m/s2", "-9.81m/s2"])")};
      break;
  }
  load.ramp = read_ramp(table, dynamic, scene);
  scene.loads.push_back(std::move(load));
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
      top.at(item.source()).fail(fmt::format("{0} must be written as [[{0}]], once per item", name));
    }
    tables.push_back(item.as_table());
  }
  return tables;
}

}  // namespace

Scene read_scene(const fs::path& path) { return parse_scene(read_file(path, most_bytes), path); }

Scene parse_scene(const std::string& text, const fs::path& name) {
  const std::string file = name.string();
  const toml::table root = parse_toml(text, file);
  constexpr std::array<std::string_view, 11> sections{"run",  "shell",  "solid",   "rigid", "fix",     "support",
                                                      "load", "attach", "contact", "probe", "accuracy"};
  const SceneTable top(root, file, "the scene", sections);

  Scene scene;
  const toml::table* run = top.required("run").as_table();
  if (run == nullptr) {
    top.place("run").fail("run must be written as [run], once");
  }
  read_run(*run, file, scene);
  const bool dynamic = std::holds_alternative<DynamicRun>(scene.run.kind);

  const fs::path folder = name.parent_path();
  for (const toml::table* table : tables_of(root, "shell", top)) {
    read_shell(*table, file, folder, scene);
  }
  for (const toml::table* table : tables_of(root, "solid", top)) {
    read_solid(*table, file, folder, scene);
  }
  for (const toml::table* table : tables_of(root, "rigid", top)) {
    read_rigid(*table, file, folder, dynamic, scene);
  }
  constexpr std::array<std::string_view, 7> fix_keys{"body",         "where", "translation", "rotation",
                                                     "displacement", "ramp",  "slide"};
  for (const toml::table* table : tables_of(root, "fix", top)) {
    read_fix(SceneTable(*table, file, "[[fix]]", fix_keys), dynamic, scene);
  }
  for (const toml::table* table : tables_of(root, "support", top)) {
    read_support(*table, file, scene);
  }
  for (const toml::table* table : tables_of(root, "load", top)) {
    read_load(*table, file, dynamic, scene);
  }
  for (const toml::table* table : tables_of(root, "attach", top)) {
    read_attach(*table, file, scene);
  }
  for (const toml::table* table : tables_of(root, "contact", top)) {
    read_contact(*table, file, scene);
  }
  constexpr std::array<std::string_view, 3> probe_keys{"name", "body", "nearest"};
  for (const toml::table* node : tables_of(root, "probe", top)) {
    const SceneTable table(*node, file, "[[probe]]", probe_keys);
    scene.probes.push_back({table.text("name"), table.text("body"),
                            table.vector("nearest", dimension::length, like_point), table.places()});
  }
  if (const toml::node* node = root.get("accuracy")) {
    if (!node->is_table()) {
      top.place("accuracy").fail("accuracy must be written as [accuracy], once");
    }
    read_accuracy(*node->as_table(), file, folder, scene);
  }
  settle_until(scene);
  settle_solver(scene);
  check_scene(scene);
  note_idle_rigids(scene);
  return scene;
}

}  // namespace tunica
