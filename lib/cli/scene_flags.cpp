#include "tunica/cli/scene_flags.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/core/spelling.hpp"
#include "tunica/io/scene/scene_manual.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica::cli {

std::optional<std::size_t> count_of(const std::optional<std::string>& text, const char* flag, double most) {
  if (!text) {
    return std::nullopt;
  }
  const auto value = parse_number(*text);
  if (!value || *value < 1 || *value > most || *value != std::floor(*value)) {
    throw UsageError(fmt::format("{}: '{}' is not a whole number from 1 to {:.0f}", flag, *text, most));
  }
  return truncated<std::size_t>(*value);
}

std::optional<double> degrees_of(const std::optional<std::string>& text, const char* flag, double least, double most) {
  if (!text) {
    return std::nullopt;
  }
  const auto number = parse_number(*text);
  if (!number || !(*number >= least && *number <= most)) {
    throw UsageError(
        fmt::format("{}: '{}' is not a number of degrees from {:.0f} to {:.0f}", flag, *text, least, most));
  }
  return number;
}

std::optional<HalfSpaceNodes> parse_half_space(const std::string& text, const char* flag) {
  HalfSpaceNodes half;
  half.below = text.starts_with("below ");
  if (!half.below && !text.starts_with("above ")) {
    return std::nullopt;
  }
  const std::size_t axis = text.find_first_not_of(' ', 6);
  const std::size_t equals = text.find('=');
  if (axis == std::string::npos || text[axis] < 'x' || text[axis] > 'z' || equals == std::string::npos ||
      text.find_first_not_of(' ', axis + 1) != equals) {
    return std::nullopt;
  }
  if (text.find(';') != std::string::npos) {
    throw UsageError(fmt::format("{} '{}': holds several: repeat {} for each", flag, text, flag));
  }
  half.axis = text[axis] - 'x';
  try {
    half.at = parse_quantity(text.substr(equals + 1), dimension::length);
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("{} '{}': {}", flag, text, error.what()));
  }
  return half;
}

namespace {

/// All but a probe's displacement, which only a scene file can ask for.
constexpr std::span<const Named<Quantity>> answers = std::span(names_of<Quantity>).first<6>();

template <typename Value>
Value required(const std::optional<Value>& value, const char* flag, const char* example) {
  if (!value) {
    throw UsageError(fmt::format("{0} is missing: give it, for example {0} {1}", flag, example));
  }
  return *value;
}

double number(const std::optional<std::string>& text, const char* flag, double otherwise) {
  if (!text) {
    return otherwise;
  }
  const auto value = parse_number(*text);
  if (!value) {
    const std::string way = advice(right_numbers(*text));
    throw UsageError(fmt::format("{}: '{}' is not a number{}{}", flag, *text, way.empty() ? "" : ": ", way));
  }
  return *value;
}

Places flags_as_places(std::initializer_list<const char*> keys) {
  Places places{{"command line", true}, {}};
  for (const char* key : keys) {
    std::string flag = std::string("--") + key;
    std::ranges::replace(flag, '_', '-');
    places.keys[key] = {flag, true};
  }
  return places;
}

// "boundary", "rims", "rigid-motions", "below z=-10mm", "above x = 3cm".
Selection parse_where(const std::string& text) {
  if (text == "boundary" || text == "rims") {
    return BoundaryNodes{};
  }
  if (text == "rigid-motions") {
    return RigidMotions{};
  }
  const auto half = parse_half_space(text, "--fix");
  if (!half) {
    throw UsageError(fmt::format(
        "--fix: '{}' is not understood: write boundary, rims:slide, rigid-motions, 'below z=-10mm' or 'above x=3cm'",
        text));
  }
  return *half;
}

void set_kind(const SceneFlags& a, Scene& scene, Ramp& load_ramp) {
  if (a.is_static) {
    for (const auto& [given, flag] :
         {std::pair{a.duration.has_value(), "--duration"}, std::pair{a.step.has_value(), "--step"},
          std::pair{a.ramp.has_value(), "--ramp"}}) {
      if (given) {
        throw UsageError(fmt::format("--static and {} contradict each other: give one", flag));
      }
    }
    scene.run.kind = StaticRun{false, equal_load_factors(count_of(a.load_steps, "--load-steps", 1e6).value_or(1))};
    return;
  }
  if (!a.duration && !a.step) {
    throw UsageError("--static is missing: give it, or --duration and --step for a dynamic run");
  }
  if (a.load_steps) {
    throw UsageError("--load-steps belongs to --static: in a dynamic run give --ramp");
  }
  DynamicRun& dynamic = scene.run.kind.emplace<DynamicRun>();
  dynamic.duration = required(a.duration, "--duration", "2s");
  dynamic.step = required(a.step, "--step", "40ms");
  if (a.ramp) {
    if (!(*a.ramp > 0)) {
      throw UsageError("--ramp: must be greater than zero");
    }
    load_ramp.points = {{0, 0}, {*a.ramp, 1}};
  }
}

}  // namespace

void SceneFlags::declare(Tool& tool) {
  CLI::App& app = tool.arguments();
  tool.group("Wall");
  tool.quantity("--young", young, dimension::pressure, help_of_key("shell", "young"));
  app.add_option("--poisson", poisson, help_of_key("shell", "poisson"))->type_name("NUMBER");
  tool.quantity("--thickness", thickness, dimension::length, help_of_key("shell", "thickness"));
  tool.quantity("--density", density, dimension::density, help_of_key("shell", "density"));
  tool.group("Load and supports");
  tool.quantity("--pressure", pressure, dimension::pressure, help_of_key("load", "value"));
  tool.quantity("--imaged-at", imaged_at, dimension::pressure,
                help_of_key("load", "imaged_at") + ". Without --pressure, or with the same, --young can be left out");
  app.add_option(
         "--fix", fixes,
         "what is held, may repeat: boundary | rims:slide (they widen and turn freely, and stay in their planes) "
         "| 'below z=-10mm' | 'above x=3cm' | rigid-motions (a closed organ under its own pressure)")
      ->type_name("boundary|rims:slide|rigid-motions|WHERE")
      ->expected(1)
      ->allow_extra_args(false)  // the next word is a file
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  tool.quantity("--support", support, dimension::bedding, help_of_key("support", "stiffness"));
  tool.group("Run");
  app.add_flag("--static", is_static, "solve for the state of rest");
  app.add_option("--load-steps", load_steps, help_of_key("run", "load_steps"))->type_name("N");
  tool.quantity("--duration", duration, dimension::time, help_of_key("run", "duration"));
  tool.quantity("--step", step, dimension::time, help_of_key("run", "step"));
  tool.quantity("--ramp", ramp, dimension::time, "dynamic: the load grows from zero over this time (default: at once)");
  tool.group("Elements");
  app.add_option("--membrane", membrane, help_of_key("shell", "membrane"))
      ->type_name(words_of(names_of<Membrane>, "|"));
  app.add_option("--bending", bending, help_of_key("shell", "bending"))->type_name(words_of(names_of<Bending>, "|"));
  tool.group("Solver");
  app.add_option("--solver", solver, help_of_key("run", "solver"))->type_name(words_of(names_of<Solver>, "|"));
  app.add_option("--cg-tolerance", cg_tolerance, help_of_key("run", "cg_tolerance"))->type_name("PERCENT");
  app.add_option("--cg-iterations", cg_iterations, help_of_key("run", "cg_iterations"))->type_name("N");
  app.add_option("--converge", converge, help_of_key("run", "converge"))->type_name("NUMBER");
  tool.group("Output");
  app.add_option("--every", every, help_of_key("run", "every"))->type_name("N");
  tool.group("Scene");
  app.add_option("--mesh-unit", mesh_unit, help_of_key("shell", "unit"))->type_name("mm|cm|m|um");
}

bool SceneFlags::pressure_is_imaged() const {
  return imaged_at.value_or(0) != 0 && is_static && pressure.value_or(*imaged_at) == *imaged_at;
}

Scene SceneFlags::scene(const std::filesystem::path& mesh) const {
  Scene scene;
  SceneLoad load{"shell", std::nullopt, PressureLoad{}, {}, flags_as_places({"imaged_at"})};
  scene.run_places =
      flags_as_places({"duration", "step", "solver", "converge", "every", "cg_tolerance", "cg_iterations"});
  set_kind(*this, scene, load.ramp);
  choose(solver, "--solver", scene.run.solver);
  if (cg_tolerance) {
    scene.run.cg_tolerance = parse_percent(*cg_tolerance);
    scene.cg_tolerance_stated = true;
  }
  scene.run.cg_iterations = count_of(cg_iterations, "--cg-iterations", 1e9);
  scene.run.converge = number(converge, "--converge", scene.run.converge);
  scene.run.every = count_of(every, "--every", 1e9).value_or(1);

  SceneShell shell;
  shell.name = load.body;
  shell.places = flags_as_places({"thickness", "young", "poisson", "density"});
  shell.mesh = mesh;
  if (mesh_unit) {
    shell.unit_mm = parse_length_unit(*mesh_unit);
  }
  if (!pressure && imaged_at == 0.0) {
    throw UsageError(
        "--pressure is missing: --imaged-at 0 is an image without pressure, so give the one that loads the wall, for "
        "example --pressure 100mmHg");
  }
  shell.material.young_stated = young || !pressure_is_imaged();
  shell.material.young = shell.material.young_stated ? required(young, "--young", "1MPa") : any_young;
  (void)required(poisson, "--poisson", "0.45");
  shell.material.poisson = number(poisson, "--poisson", 0);
  shell.thickness = required(thickness, "--thickness", "1.5mm");
  if (!is_static) {
    (void)required(density, "--density", "1100kg/m3");
  }
  shell.material.density = density;
  choose(membrane, "--membrane", shell.membrane);
  choose(bending, "--bending", shell.bending);
  scene.shells.push_back(shell);

  load.kind = PressureLoad{required(pressure ? pressure : imaged_at, "--pressure", "100mmHg"), true, imaged_at};
  scene.loads.push_back(load);
  for (const std::string& text : fixes) {
    SceneFix fix;
    fix.body = shell.name;
    constexpr std::string_view slide = ":slide";
    fix.slide = text.ends_with(slide);
    fix.where = parse_where(fix.slide ? text.substr(0, text.size() - slide.size()) : text);
    if (fix.slide && std::holds_alternative<RigidMotions>(fix.where)) {
      throw UsageError("--fix: rigid motions do not slide: write rims:slide");
    }
    fix.places = {{fmt::format("{}: --fix '{}'", shell.mesh.string(), text), true, text}, {}};
    scene.fixes.push_back(fix);
  }
  if (support) {
    SceneSupport bed;
    bed.body = shell.name;
    bed.stiffness = *support;
    bed.places = flags_as_places({});
    bed.places.item.text = "--support";
    bed.places.keys["stiffness"] = {"--support", true};
    scene.supports.push_back(bed);
  }
  settle_solver(scene);
  check_scene(scene);
  return scene;
}

void SceneFlags::keep_typed(const CLI::App& app, Scene& scene) {
  const auto keep = [&](Places& places, const char* key, const char* flag) {
    if (app.count(flag) > 0) {
      Place& place = places.keys.try_emplace(key, places.item).first->second;
      place.typed = app.get_option(flag)->results().front();
    }
  };
  for (SceneShell& shell : scene.shells) {
    keep(shell.places, "young", "--young");
    keep(shell.places, "thickness", "--thickness");
    keep(shell.places, "density", "--density");
  }
  for (SceneLoad& load : scene.loads) {
    keep(load.places, "value", "--pressure");
    keep(load.places, "imaged_at", "--imaged-at");
  }
  keep(scene.run_places, "duration", "--duration");
  keep(scene.run_places, "step", "--step");
}

void AccuracyFlags::declare(Tool& tool) {
  CLI::App& app = tool.arguments();
  tool.group("Accuracy");
  app.add_option("--accuracy", within,
                 "choose mesh and model: finer shells, until the estimated error of the answer is below this, e.g. 2%")
      ->type_name("PERCENT");
  app.add_option("--of", of, "the answer (default displacement)")->type_name(words_of(answers, "|"));
  app.add_option("--target", target,
                 "the surface that SHELL.ply was fitted to: finer shells are fitted to it too; without --accuracy one "
                 "refinement is solved besides, which says how far the answers may be off")
      ->type_name("SURFACE");
  app.add_option("--max-shells", max_shells, "no more shells than this (default 50,000)")->type_name("N");
  tool.quantity("--max-seconds", max_seconds, dimension::time,
                "a bound on the time of solution: the accuracy is then what is aimed at, and the run ends with what it "
                "has reached, exit 0, e.g. 60s");
  app.add_option("--shell-out", shell_out, "the shells that it ended with")->type_name("OUT.ply");
}

void AccuracyFlags::ask(const CLI::App& app, Scene& scene) const {
  if (target && scene.shells.size() > 1) {
    throw UsageError("--target: the scene has more than one body: name each one's in [accuracy]");
  }
  if (!within) {
    if (app.count("--of") > 0) {
      throw UsageError("--of belongs to --accuracy: give that too");
    }
    for (const char* flag : {"--max-shells", "--max-seconds", "--shell-out"}) {
      if (app.count(flag) > 0 && !scene.accuracy) {
        throw UsageError(fmt::format("{} belongs to --accuracy, or [accuracy] in a scene: give that too", flag));
      }
    }
    return;
  }
  if (scene.accuracy) {
    scene.accuracy->places.item.fail("[accuracy] and --accuracy contradict each other: give one");
  }
  SceneAccuracy& asked = scene.accuracy.emplace();
  asked.places = flags_as_places({"of", "target"});
  asked.places.item.text = "--accuracy";
  asked.within = parse_percent(*within);
  choose(of, "--of", asked.of, answers);
  if (target && !scene.shells.empty()) {  // without one, check_scene() refuses the accuracy
    asked.targets[scene.shells.front().name] = *target;
  }
  check_scene(scene);
}

}  // namespace tunica::cli
