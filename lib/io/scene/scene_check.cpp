#include "tunica/io/scene/detail/scene_checks.hpp"
#include "tunica/io/scene/detail/scene_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace tunica {
namespace {

void require(bool fine, const Place& place, const std::string& what) { place.require(fine, what); }

// Lengths of run that would fill memory with history; nobody waits for them.
constexpr double most_steps = 1e9;

void check_run(const Scene& scene) {
  const RunSettings& run = scene.run;
  const Places& places = scene.run_places;
  if (const auto* dynamic = std::get_if<DynamicRun>(&run.kind)) {
    require(is_positive(dynamic->duration), places.of("duration"), "duration must be greater than zero");
    require(is_positive(dynamic->step), places.of("step"), "step must be greater than zero");
    require(dynamic->step <= dynamic->duration * (1 + 1e-9), places.of("step"), "step is longer than the duration");
    require(dynamic->duration / dynamic->step <= most_steps, places.of("step"),
            fmt::format("{:.3g} steps are too many (at most {:.0e}): lengthen step or shorten duration",
                        dynamic->duration / dynamic->step, most_steps));
    require(dynamic->spectral_radius >= 0 && dynamic->spectral_radius <= 1, places.of("spectral_radius"),
            fmt::format("spectral_radius {} is outside [0, 1]: 1 damps nothing, 0 the most", dynamic->spectral_radius));
  }
  const bool needs_direct = std::holds_alternative<FrequencyRun>(run.kind) ||
                            std::holds_alternative<BucklingRun>(run.kind) ||
                            std::holds_alternative<ArcLengthRun>(run.kind);
  require(!needs_direct || run.solver != Solver::cg,
          places.of(places.keys.contains("solver")         ? "solver"
                    : places.keys.contains("cg_tolerance") ? "cg_tolerance"
                                                           : "cg_iterations"),
          "frequencies, buckling and arc length need the direct solver: remove what asks for cg");
  require(run.cg_tolerance > 0 && run.cg_tolerance < 1, places.of("cg_tolerance"),
          "cg_tolerance must be greater than 0 and less than 1 (100%)");
  if (const auto* path = std::get_if<ArcLengthRun>(&run.kind)) {
    require(!path->max_factor || is_positive(*path->max_factor), places.of("max_factor"),
            "max_factor must be greater than 0");
    require(!path->until || path->until->reaches != 0, places.of("until"), "until reaches 0: the path begins there");
  }
  require(run.converge > 0 && run.converge < 1, places.of("converge"),
          "converge must be greater than 0 and less than 1");
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
  require(is_positive(body.scale), places.of("scale"), "scale must be greater than zero");
  require(is_positive(material.young), places.of("young"), "young must be greater than zero");
  require(
      material.young_stated || needs_no_young, places.item,
      fmt::format(
          "[[{}]] \"{}\" has no young, for example young = \"1MPa\": it can be left out only where a static run puts "
          "nothing on shells but the pressure that they were imaged under",
          section, body.name));
  require(material.poisson > -1 && material.poisson < 0.5, places.of("poisson"),
          fmt::format("poisson {} is outside (-1, 0.5)", material.poisson));
  require(!material.density || is_positive(*material.density), places.of("density"),
          "density must be greater than zero");
  require(needed_by.empty() || material.density, places.item,
          fmt::format("[[{}]] \"{}\" has no density: {} needs it", section, body.name, needed_by));
}

/// Whether the shells rest as they were imaged, so that equilibrium decides their stress, whatever their stiffness.
bool rests_as_imaged(const Scene& scene) {
  const bool alone =
      scene.solids.empty() && scene.rigids.empty() && scene.contacts.empty() && scene.attachments.empty();
  return alone && std::holds_alternative<StaticRun>(scene.run.kind) && !scene.loads.empty() &&
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
  require(shell.thickness_from || is_positive(shell.thickness), shell.places.of("thickness"),
          "thickness must be greater than zero");
  check_material(shell, "shell", needed_by, needs_no_young);
}

void check_solid(const SceneSolid& solid, std::string_view needed_by) {
  constexpr double largest_poisson = 0.4999;
  require(!solid.mesh.filename().empty(), solid.places.of(solid.fill_size ? "fill" : "mesh"),
          fmt::format("{} names no file", solid.fill_size ? "fill" : "mesh"));
  require(!solid.fill_size || is_positive(*solid.fill_size), solid.places.of("size"), "size must be greater than zero");
  check_material(solid, "solid", needed_by, false);
  require(
      solid.material.poisson <= largest_poisson, solid.places.of("poisson"),
      fmt::format("poisson {} of a solid is above {}: choose at most that", solid.material.poisson, largest_poisson));
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
    check_rigid(rigid);
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
  require(is_positive(support.stiffness), support.places.of("stiffness"), "stiffness must be greater than zero");
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
    const auto body = std::find_if(scene.shells.begin(), scene.shells.end(),
                                   [&, &wanted = name](const SceneShell& shell) { return shell.name == wanted; });
    require(body != scene.shells.end(), places.of("target"),
            fmt::format("there is no body \"{}\": the bodies are \"{}\"", name,
                        fmt::join(deforming_names(scene), "\", \"")));
  }
  const bool known = std::any_of(scene.probes.begin(), scene.probes.end(),
                                 [&](const SceneProbe& probe) { return probe.name == asked.probe; });
  require(asked.of != Quantity::probe || known, places.of("of"),
          fmt::format("there is no [[probe]] \"{}\": add it, or name another", asked.probe));
  // A finer mesh has nodes between those of a list, of which the list says nothing.
  const auto refuse_list = [](const std::optional<Selection>& where, const Places& of) {
    require(
        !is_list(where), of.of("where"),
        "a list of nodes holds for one mesh, and an accuracy takes finer ones: select by place (box, below, sphere, "
        "nearest …)");
  };
  for (const SceneFix& fix : scene.fixes) {
    refuse_list(fix.where, fix.places);
  }
  for (const SceneSupport& support : scene.supports) {
    refuse_list(support.where, support.places);
  }
  for (const SceneLoad& load : scene.loads) {
    refuse_list(load.where, load.places);
  }
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
  if (scene.accuracy &&
      !(scene.solids.empty() && scene.rigids.empty() && scene.attachments.empty() && scene.contacts.empty())) {
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
    if (!(scene.solids.empty() && scene.rigids.empty() && scene.attachments.empty() && scene.contacts.empty())) {
      load.places.of("unload").fail_later("an unloaded shape beside [[solid]], [[rigid]], [[attach]] or [[contact]]");
    }
  }
}
}  // namespace

void check_scene(const Scene& scene) {
  check_run(scene);
  refuse_later(scene);
  check_bodies(scene);
  for (const SceneFix& fix : scene.fixes) {
    check_fix(scene, fix);
  }
  for (const SceneSupport& support : scene.supports) {
    check_support(scene, support);
  }
  const bool finds_factor = std::holds_alternative<ArcLengthRun>(scene.run.kind);
  const auto refuse_ramp = [&](const Ramp& ramp, const Places& places) {
    require(!finds_factor || ramp.points.empty(), places.of("ramp"),
            "arc length finds the load factor, so that nothing can have a ramp over it: remove the ramp");
  };
  for (const SceneFix& fix : scene.fixes) {
    refuse_ramp(fix.ramp, fix.places);
  }
  for (const SceneLoad& load : scene.loads) {
    refuse_ramp(load.ramp, load.places);
    check_load(scene, load);
  }
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
  return scene.solids.empty() && scene.rigids.empty() && scene.attachments.empty() && scene.contacts.empty() &&
         std::ranges::none_of(scene.fixes, listed) && std::ranges::none_of(scene.loads, listed);
}

}  // namespace tunica
