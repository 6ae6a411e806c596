#include "tunica/io/scene/detail/scene_names.hpp"
#include "tunica/io/scene/detail/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

namespace tunica {
namespace {

void require(bool fine, const Place& place, const std::string& what) { place.require(fine, what); }

// Lengths of run that would fill memory with history; nobody waits for them.
constexpr double most_steps = 1e9;

void check_run(const Scene& scene) {
  const RunSettings& run = scene.run;
  const Places& places = scene.run_places;
  check_keys(scene_schema().run, scene, places);
  if (const auto* dynamic = std::get_if<DynamicRun>(&run.kind)) {
    require(dynamic->step <= dynamic->duration * (1 + 1e-9), places.of("step"), "step is longer than the duration");
    require(dynamic->duration / dynamic->step <= most_steps, places.of("step"),
            fmt::format("{:.3g} steps are too many (at most {:.0e}): lengthen step or shorten duration",
                        dynamic->duration / dynamic->step, most_steps));
  }
  const bool needs_direct = std::holds_alternative<FrequencyRun>(run.kind) ||
                            std::holds_alternative<BucklingRun>(run.kind) ||
                            std::holds_alternative<ArcLengthRun>(run.kind);
  require(!needs_direct || run.solver != Solver::cg,
          places.of(places.keys.contains("solver")         ? "solver"
                    : places.keys.contains("cg_tolerance") ? "cg_tolerance"
                                                           : "cg_iterations"),
          "frequencies, buckling and arc length need the direct solver: remove what asks for cg");
  if (const auto* path = std::get_if<ArcLengthRun>(&run.kind)) {
    require(!path->until || path->until->reaches != 0, places.of("until"), "until reaches 0: the path begins there");
  }
}

bool is_list(const std::optional<Selection>& where) { return where && std::holds_alternative<ListedNodes>(*where); }

bool any(const std::array<bool, 3>& held) { return held[0] || held[1] || held[2]; }

std::string_view needs_density(const Scene& scene) {
  return std::holds_alternative<DynamicRun>(scene.run.kind)     ? "a dynamic run"
         : std::holds_alternative<FrequencyRun>(scene.run.kind) ? "a run for frequencies"
                                                                : "";
}

/// @param body  a shell or a solid of the scene; section  its name in the file
/// @param needed_by  what of the run needs a density; empty where nothing does
template <typename SceneBody>
void check_material(const SceneBody& body, std::string_view section, std::string_view needed_by, bool needs_no_young) {
  const Places& places = body.places;
  const Material& material = body.material;
  require(!body.name.empty(), places.of("name"), "name is empty");
  require(
      material.young_stated || needs_no_young, places.item,
      fmt::format(
          "[[{}]] \"{}\" has no young, for example young = \"1MPa\": it can be left out only where a static run puts "
          "nothing on shells but the pressure that they were imaged under",
          section, body.name));
  require(needed_by.empty() || material.density, places.item,
          fmt::format("[[{}]] \"{}\" has no density: {} needs it", section, body.name, needed_by));
}

/// Whether the shells rest as they were imaged, so that equilibrium decides their stress, whatever their stiffness.
bool rests_as_imaged(const Scene& scene) {
  return is_of_shells_alone(scene) && std::holds_alternative<StaticRun>(scene.run.kind) && !scene.loads.empty() &&
         std::ranges::all_of(scene.loads,
                             [](const SceneLoad& load) {
                               const auto* pressure = std::get_if<PressureLoad>(&load.kind);
                               return pressure != nullptr && pressure->value != 0 &&
                                      pressure->imaged_at == pressure->value && !pressure->unload;
                             }) &&
         std::ranges::none_of(scene.fixes, [](const SceneFix& fix) { return fix.displacement.has_value(); }) &&
         std::ranges::none_of(scene.shells, [](const SceneShell& shell) { return shell.material.young_stated; });
}

void check_shell(const SceneShell& shell, std::string_view needed_by, bool needs_no_young) {
  require(!shell.mesh.filename().empty(), shell.places.of("mesh"), "mesh names no file");
  check_material(shell, "shell", needed_by, needs_no_young);
}

void check_solid(const SceneSolid& solid, std::string_view needed_by) {
  constexpr double largest_poisson = 0.4999;
  require(!solid.mesh.filename().empty(), solid.places.of(solid.fill_size ? "fill" : "mesh"),
          fmt::format("{} names no file", solid.fill_size ? "fill" : "mesh"));
  check_material(solid, "solid", needed_by, false);
  require(
      solid.material.poisson <= largest_poisson, solid.places.of("poisson"),
      fmt::format("poisson {} of a solid is above {}: choose at most that", solid.material.poisson, largest_poisson));
}

// The axis of a cylinder tells where its ends are: it must have a direction at all times.
void check_axis(const RigidCylinder& cylinder, const Places& places) {
  std::set<double> times;
  for (const auto* end : {&cylinder.from, &cylinder.to}) {
    for (const auto& [time, point] : end->points) {
      times.insert(time);
    }
  }
  std::optional<Vec3> before;
  for (const double time : times) {
    const Vec3 axis = cylinder.to.at(time) - cylinder.from.at(time);
    places.of("to").require(!axis.isZero(0), "from and to are one point: a cylinder needs an axis");
    // Between two entries the axis goes straight from one to the next: through nothing only where they are opposite.
    places.of("to").require(!before || axis.normalized().dot(before->normalized()) > -1 + 1e-12,
                            "the cylinder's axis turns over by passing through nothing: give the way that it turns");
    before = axis;
  }
}

void check_shape(const SceneRigid& rigid) {
  if (const auto* cylinder = std::get_if<RigidCylinder>(&rigid.shape)) {
    check_axis(*cylinder, rigid.places);
  } else if (const auto* mesh = std::get_if<SceneRigidMesh>(&rigid.shape)) {
    require(!mesh->mesh.filename().empty(), rigid.places.of("mesh"), "mesh names no file");
  }
}

// Names become keys of the report and groups of the result file.
void check_name(const std::string& name, const Place& place, std::string_view of) {
  const bool fine = !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return c > ' ' && c != '/' && c != '.' && c != 0x7f;
  });
  require(fine, place, fmt::format("\"{}\" cannot name a {}: use letters, digits, - and _", name, of));
}

void check_bodies(const Scene& scene) {
  require(!scene.shells.empty() || !scene.solids.empty(), scene.run_places.item,
          "the scene has no [[shell]] and no [[solid]]: add one");
  std::set<std::string, std::less<>> names;
  const auto require_new = [&](const auto& body) {
    require(names.insert(body.name).second, body.places.of("name"),
            fmt::format("there are two bodies named \"{}\"", body.name));
  };
  for (const SceneShell& shell : scene.shells) {
    check_shell(shell, needs_density(scene), rests_as_imaged(scene));
    require_new(shell);
  }
  for (const SceneSolid& solid : scene.solids) {
    check_solid(solid, needs_density(scene));
    check_name(solid.name, solid.places.of("name"), "solid");
    require_new(solid);
  }
  for (const SceneRigid& rigid : scene.rigids) {
    check_shape(rigid);
    check_name(rigid.name, rigid.places.of("name"), "rigid body");
    require_new(rigid);
  }
  for (const SceneContact& contact : scene.contacts) {
    check_name(contact.name, contact.places.of("name"), "contact");
    require(names.insert(contact.name).second, contact.places.of("name"),
            fmt::format("there are two bodies or contacts named \"{}\": give this contact another name", contact.name));
  }
}

void check_fix(const Scene& scene, const SceneFix& fix) {
  const std::size_t body = body_index(scene, fix.body, fix.places);
  if (is_solid(scene, body)) {
    if (std::holds_alternative<RigidMotions>(fix.where)) {
      fix.places.of("where").fail_later("rigid_motions of a [[solid]]");
    }
    require(!any(fix.rotation), fix.places.of("rotation"),
            "the nodes of a solid have no rotation: remove it, or write \"\"");
  }
  const bool rigid = std::holds_alternative<RigidMotions>(fix.where);
  const bool held_besides = std::ranges::any_of(scene.fixes, [&](const SceneFix& other) {
    return other.body == fix.body && !other.slide && !std::holds_alternative<RigidMotions>(other.where);
  });
  require(!rigid || !held_besides, fix.places.of("where"),
          fmt::format("\"{}\" is held by its rigid motions and by another fix: keep one of them", fix.body));
  require(!fix.slide || !is_solid(scene, body), fix.places.of("slide"),
          "a slide is of the rims of shells, and this is a solid: remove it");
  require(any(fix.translation) || any(fix.rotation), fix.places.of("translation"),
          "this [[fix]] holds nothing: name an axis in translation or rotation, or remove it");
  if (fix.displacement) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      require(fix.translation[axis] || (*fix.displacement)[axis] == 0, fix.places.of("displacement"),
              fmt::format("displacement along {0} is prescribed but not held: add {0} to translation", "xyz"[axis]));
    }
  }
}

void check_support(const Scene& scene, const SceneSupport& support) {
  require(!is_solid(scene, body_index(scene, support.body, support.places)), support.places.of("body"),
          "a bed supports shells, and this is a solid: hold it by a [[fix]]");
}

// What a load can act on.
void check_load(const Scene& scene, const SceneLoad& load) {
  const std::size_t body = body_index(scene, load.body, load.places);
  const bool solid = is_solid(scene, body);
  const Place& kind = load.places.of("kind");
  require(!solid || !std::holds_alternative<MomentLoad>(load.kind), kind,
          "the nodes of a solid have no rotation, on which a moment could act: use forces");
  require(!solid || !std::holds_alternative<EdgeLoad>(load.kind), kind,
          "a solid has no edges to load: use kind = \"force\", or a pressure");
  const auto require_density = [&](const auto& of, std::string_view section) {
    require(!std::holds_alternative<GravityLoad>(load.kind) || of.material.density, of.places.item,
            fmt::format("[[{}]] \"{}\" has no density: its gravity load needs it", section, of.name));
  };
  if (solid) {
    require_density(scene.solids[body - scene.shells.size()], "solid");
  } else {
    require_density(scene.shells[body], "shell");
  }
}

// The body that is carried, the one that carries.
std::pair<std::size_t, std::size_t> bodies_of(const Scene& scene, const SceneAttach& attach) {
  for (const auto& [key, name] : {std::pair("body", &attach.body), std::pair("to", &attach.to)}) {
    attach.places.of(key).require(!rigid_index(scene, *name),
                                  fmt::format("\"{}\" is rigid: only bodies that deform are attached to each other; "
                                              "nodes with a prescribed motion are a [[fix]] with displacement",
                                              *name));
  }
  return {body_index(scene, attach.body, attach.places, "body"), body_index(scene, attach.to, attach.places, "to")};
}

void check_attachments(const Scene& scene) {
  std::map<std::size_t, std::set<std::size_t>> carriers;  // of a body, directly or through others
  for (const SceneAttach& attach : scene.attachments) {
    const auto [body, to] = bodies_of(scene, attach);
    const Places& places = attach.places;
    places.of("to").require(body != to, fmt::format("\"{}\" is attached to itself: name another body", attach.to));
    places.of("side").require(
        !is_solid(scene, to) || (attach.side == Attachment::Side::middle && !places.keys.contains("side")),
        fmt::format("\"{}\" is a solid and has no side: side belongs to an attachment to a shell", attach.to));
    places.of("to").require(!carriers[to].contains(body),
                            fmt::format("\"{}\" carries \"{}\" already: bodies cannot carry each other in a circle",
                                        attach.body, attach.to));
    std::set<std::size_t> more = carriers[to];
    more.insert(to);
    for (auto& [carried, by] : carriers) {
      if (carried == body || by.contains(body)) {
        by.insert(more.begin(), more.end());
      }
    }
    carriers[body].insert(more.begin(), more.end());
  }
  for (const SceneFix& fix : scene.fixes) {
    const auto carried = std::find_if(scene.attachments.begin(), scene.attachments.end(),
                                      [&](const SceneAttach& attach) { return attach.body == fix.body; });
    fix.places.of("where").require(
        !std::holds_alternative<RigidMotions>(fix.where) || carried == scene.attachments.end(),
        fmt::format("\"{}\" is carried by \"{}\", so its rigid motions are held already: remove this [[fix]]", fix.body,
                    carried == scene.attachments.end() ? "" : carried->to));
  }
}

void check_contacts(const Scene& scene) {
  std::set<std::pair<std::string, std::string>> pairs;
  for (const SceneContact& contact : scene.contacts) {
    const Places& places = contact.places;
    const auto& [a, b] = contact.between;
    const Place& between = places.of("between");
    const bool rigid_a = party_named(scene, a, between).rigid;
    const bool rigid_b = party_named(scene, b, between).rigid;
    between.require(!rigid_a || a != b,
                    fmt::format("\"{}\" is rigid: it cannot touch itself, name a body that deforms", a));
    between.require(!rigid_a || !rigid_b,
                    fmt::format("\"{}\" and \"{}\" are both rigid: one of the two must deform", a, b));
    between.require(pairs.insert(std::minmax(a, b)).second,
                    fmt::format("there are two contacts between \"{}\" and \"{}\": keep one", a, b));
  }
}

// What --accuracy, or [accuracy], can be found for.
void check_accuracy(const Scene& scene) {
  const SceneAccuracy& asked = *scene.accuracy;
  const Places& places = asked.places;
  require(asked.within > 0 && asked.within <= 0.5, places.of("within"), "must be above 0 and at most 50%");
  const auto* statics = std::get_if<StaticRun>(&scene.run.kind);
  const auto* dynamics = std::get_if<DynamicRun>(&scene.run.kind);
  require(statics != nullptr || dynamics != nullptr, places.item,
          "is for states of rest and motions: frequencies, buckling and paths by arc length have no single answer");
  require(statics == nullptr || statics->load_factors.size() == 1, places.item,
          fmt::format("finds one answer: leave out {}", places.item.flag ? "--load-steps" : "the load steps"));
  require(dynamics == nullptr || !dynamics->adaptive, scene.run_places.of("adaptive"),
          "an accuracy finds the step itself: leave out adaptive");
  require(!scene.run.cg_fixed_count, places.item, "asks for convergence, a fixed count of CG iterations for none");
  for (const auto& [name, path] : asked.targets) {
    require(std::ranges::count(scene.shells, name, &SceneShell::name) > 0, places.of("target"),
            fmt::format("there is no body \"{}\": the bodies are \"{}\"", name,
                        fmt::join(deforming_names(scene), "\", \"")));
  }
  require(asked.of != Quantity::probe || std::ranges::count(scene.probes, asked.probe, &SceneProbe::name) > 0,
          places.of("of"), fmt::format("there is no [[probe]] \"{}\": add it, or name another", asked.probe));
  // A finer mesh has nodes between those of a list, of which the list says nothing.
  for_each_where(scene, [](const auto& item, const std::optional<Selection>& where) {
    require(
        !is_list(where), item.places.of("where"),
        "a list of nodes holds for one mesh, and an accuracy takes finer ones: select by place (box, below, sphere, "
        "nearest …)");
  });
}

// What is understood, but not yet solved.
void refuse_later(const Scene& scene) {
  const auto refuse = [](const auto& items, std::string_view section, std::string_view beside) {
    if (!items.empty()) {
      items.front().places.item.fail_later(fmt::format("[[{}]] {}", section, beside));
    }
  };
  const auto refuse_all = [&](std::string_view beside) {
    refuse(scene.solids, "solid", beside);
    refuse(scene.attachments, "attach", beside);
    refuse(scene.contacts, "contact", beside);
  };
  if (std::holds_alternative<FrequencyRun>(scene.run.kind)) {
    refuse_all("in a run for frequencies");
  } else if (std::holds_alternative<BucklingRun>(scene.run.kind)) {
    refuse_all("in a run for buckling");
  } else if (std::holds_alternative<ArcLengthRun>(scene.run.kind)) {
    refuse_all("in a run by arc length");
  }
  const auto* statics = std::get_if<StaticRun>(&scene.run.kind);
  if (statics != nullptr && statics->linear) {
    refuse(scene.contacts, "contact", "with geometry = \"linear\"");
  }
  if (scene.accuracy && !is_of_shells_alone(scene)) {
    scene.accuracy->places.item.fail_later("an accuracy beside [[solid]], [[rigid]], [[attach]] or [[contact]]");
  }
  for (const SceneLoad& load : scene.loads) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure == nullptr || !pressure->unload) {
      continue;
    }
    if (!scene.supports.empty()) {
      scene.supports.front().places.item.fail(
          "a bed is without force in the imaged shape, and the unloaded shape is another: remove one of them");
    }
    if (scene.accuracy) {
      load.places.of("unload").fail_later("an unloaded shape and an accuracy in one run");
    }
    if (!is_of_shells_alone(scene)) {
      load.places.of("unload").fail_later("an unloaded shape beside [[solid]], [[rigid]], [[attach]] or [[contact]]");
    }
  }
}
}  // namespace

void check_scene(const Scene& scene) {
  check_run(scene);
  refuse_later(scene);
  for_each_section(scene, [&](std::string_view, const auto& keys, const auto& items) {
    for (const auto& item : items) {
      check_keys(keys, item, item.places);
    }
  });
  for_each_where(scene, []<typename Item>(const Item& item, const std::optional<Selection>& where) {
    require(std::is_same_v<Item, SceneFix> || !where || !std::holds_alternative<RigidMotions>(*where),
            item.places.of("where"), "rigid_motions belongs to [[fix]]: select nodes");
  });
  check_bodies(scene);
  for (const SceneFix& fix : scene.fixes) {
    check_fix(scene, fix);
  }
  for (const SceneSupport& support : scene.supports) {
    check_support(scene, support);
  }
  for (const SceneLoad& load : scene.loads) {
    check_load(scene, load);
  }
  for_each_where(scene, [&](const auto& item, const auto&) {
    if constexpr (requires { item.ramp; }) {
      require(!std::holds_alternative<ArcLengthRun>(scene.run.kind) || item.ramp.points.empty(), item.places.of("ramp"),
              "arc length finds the load factor, so that nothing can have a ramp over it: remove the ramp");
    }
  });
  check_attachments(scene);
  check_contacts(scene);
  std::set<std::string> names;
  for (const SceneProbe& probe : scene.probes) {
    check_name(probe.name, probe.places.of("name"), "probe");
    (void)body_index(scene, probe.body, probe.places);
    require(names.insert(probe.name).second, probe.places.of("name"),
            fmt::format("there are two probes named \"{}\"", probe.name));
  }
  if (scene.accuracy) {
    check_accuracy(scene);
  }
}

bool holds_for_finer_meshes(const Scene& scene) {
  const auto listed = [](const auto& item) { return is_list(item.where); };
  return is_of_shells_alone(scene) && std::ranges::none_of(scene.fixes, listed) &&
         std::ranges::none_of(scene.loads, listed);
}

}  // namespace tunica
