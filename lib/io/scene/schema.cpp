#include "tunica/io/scene/detail/schema.hpp"

#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tunica {
namespace schema {
namespace {

const Form<std::string> name = form::text("\"vessel\"");
const Form<double> length = form::quantity(dimension::length, "m", "\"1mm\"");
const Form<double> pressure = form::quantity(dimension::pressure, "Pa", "\"100mmHg\"");
const Form<double> time = form::quantity(dimension::time, "s", "\"40ms\"");
const Form<double> number = form::number("1.0");
const Form<Vec3> point = form::vector(dimension::length, "m", R"(["0mm", "0mm", "10mm"])");
const Form<Table<Vec3>> moving_point = form::over_time(point);
const Form<Table<double>> radius = form::over_time(length.in(not_negative));

/// One of the kinds of a variant.
template <typename Variant, typename... Kinds>
Form<Variant> kind_of() {
  Form<Variant> form = form::one_of_kinds<Variant>({{Kinds::name, Kinds{}}...});
  form.write = [](const Variant& value, const Writing&) { return form::in_quotes(name_of(value)); };
  return form;
}

template <typename Item>
SceneKey<Item> ramp_key() {
  return key("ramp", &Item::ramp, form::ramp(), "factor over time, in a static run over the load factor")
      .without_default()
      .written_if([](const Item& item) { return !item.ramp.points.empty(); });
}

// ---- [run]

using Run = RunSettings;
using RunKind = decltype(Run::kind);

std::string of_other_run(std::string_view key, std::string_view owner, const Run& run) {
  return fmt::format("{} belongs to a {} run, and kind is \"{}\": remove it", key, owner, name_of(run.kind));
}

/// What says so of a key.
auto of_runs(std::string_view owner) {
  return [owner](std::string_view key, const Run& run) { return of_other_run(key, owner, run); };
}

template <typename Kind>
auto if_kind() {
  return [](auto& run) { return std::get_if<Kind>(&run.kind); };
}

/// The static run that a run is, or begins with.
template <typename Settings>
auto static_part(Settings& run) -> decltype(std::get_if<StaticRun>(&run.kind)) {
  auto* frequencies = std::get_if<FrequencyRun>(&run.kind);
  return frequencies != nullptr ? &frequencies->preload : std::get_if<StaticRun>(&run.kind);
}

/// That part, where the load may come in steps.
template <typename Settings>
auto stepped_part(Settings& run) {
  auto* part = static_part(run);
  return part != nullptr && part->linear && std::holds_alternative<FrequencyRun>(run.kind) ? nullptr : part;
}

std::string without_steps(std::string_view key, const Run& run) {
  return std::holds_alternative<ArcLengthRun>(run.kind)
             ? "arc length finds the load factors: remove load_factors"
             : of_other_run(key, std::holds_alternative<FrequencyRun>(run.kind) ? "nonlinear" : "static", run);
}

/// The geometry of a run that has no linear one.
template <typename Kind>
struct NonlinearOnly : KeyAccess<Kind> {
  using Refusal = void (*)(const Place&);

  Form<bool> linear = form::choice<bool>({{"nonlinear", false}, {"linear", true}});
  Refusal refuse;

  explicit NonlinearOnly(Refusal with) : refuse(with) {}
  [[nodiscard]] std::string_view like() const override { return linear.like; }
  void read(const SceneTable& table, const toml::node& node, Kind&) const override {
    if (linear.read(table, node, "geometry")) {
      refuse(table.at(node));
    }
  }
  [[nodiscard]] std::string write(const Kind&, const Writing& to) const override { return linear.write(false, to); }

  static SceneKeys<Kind> keys(Refusal with) {
    const auto access = std::make_shared<const NonlinearOnly>(with);
    return {{"geometry", "", access}};
  }
};

bool in_equal_steps(const StaticRun& run) { return run.load_factors == equal_load_factors(run.load_factors.size()); }

SceneKeys<StaticRun> step_keys(const Form<std::size_t>& count) {
  const Form<std::vector<double>> equal =
      form::made_of(count, equal_load_factors, [](const std::vector<double>& factors) { return factors.size(); });
  return {key("load_steps", &StaticRun::load_factors, equal,
              "static: steps in which the load grows, each written (default: all at once)")
              .without_default()
              .written_if(in_equal_steps),
          key("load_factors", &StaticRun::load_factors, form::increasing_numbers("[0.1, 0.2, 1.0]"),
              "static: the load factors of the states, in place of load_steps")
              .without_default()
              .contradicting("load_steps")
              .written_if([](const StaticRun& run) { return !in_equal_steps(run); })};
}

SceneKeys<ArcLengthRun> path_keys(const Form<std::size_t>& count) {
  const auto first_factor = [](std::size_t steps) { return 1 / real(steps); };
  const auto steps = [](double factor) { return narrow<std::size_t>(std::lround(1 / factor)); };
  return {key("load_steps", &ArcLengthRun::first_factor, form::made_of(count, first_factor, steps),
              "arc-length: one over the change of the load factor in the first step"),
          key("max_steps", &ArcLengthRun::max_steps, count, "arc-length: the path ends after so many"),
          key("max_factor", &ArcLengthRun::max_factor, number.in({0, infinity, "{key} must be greater than 0"}),
              "arc-length: the path ends where the load factor reaches it, up or down")};
}

SceneKeys<DynamicRun> dynamic_keys() {
  constexpr Range damping{0, infinity, "damping {key} must not be negative", true};
  const SceneKeys<Damping> dampings{
      key("mass", &Damping::mass, form::quantity(dimension::rate, "/s", "\"0.1/s\"").in(damping)),
      key("stiffness", &Damping::stiffness, time.in(damping))};
  return {
      key("duration", &DynamicRun::duration, time.in(positive), "dynamic: time simulated, e.g. 2s")
          .needed(" (a dynamic run needs it)"),
      key("step", &DynamicRun::step, time.in(positive), "dynamic: time step, e.g. 40ms")
          .needed(" (a dynamic run needs it)"),
      key("damping", &DynamicRun::damping, form::inner(dampings, R"({mass = "0.1/s", stiffness = "2ms"})"),
          "dynamic: in proportion to the masses and to the stiffness, of beds not"),
      key("integrator", &DynamicRun::integrator, form::choice<Integrator>(), "dynamic; see Integrators").deciding(),
      key("spectral_radius", &DynamicRun::spectral_radius,
          form::number("0.8").in({0, 1, "{key} {value} is outside [0, 1]: 1 damps nothing, 0 the most", true, true}),
          "dynamic, generalised-alpha: what a step keeps of what is too fast for it")
          .unless([](const DynamicRun& run) { return run.integrator != Integrator::generalised_alpha; },
                  "spectral_radius belongs to integrator = \"generalised-alpha\": remove it, or choose that "
                  "integrator"),
      key("adaptive", &DynamicRun::adaptive, form::length_tolerance("\"0.01%\""),
          "dynamic: steps are cut into parts that each add at most this error")};
}

SceneKeys<Run> kind_keys() {
  const Form<std::size_t> steps = form::count(1'000'000);
  const Form<std::size_t> modes = form::count(10'000);
  SceneKeys<Run> keys{
      key("kind", &Run::kind, kind_of<RunKind, StaticRun, DynamicRun, FrequencyRun, BucklingRun>(), "below")
          .needed()
          .deciding()};
  const auto add = [&]<typename Kind>(const SceneKeys<Kind>& own, std::string_view owner) {
    append(keys, own, if_kind<Kind>(), of_runs(owner));
  };
  add(SceneKeys<FrequencyRun>{key("count", &FrequencyRun::count, modes, "frequencies, buckling: how many modes")},
      "frequencies or buckling");
  add(SceneKeys<BucklingRun>{key("count", &BucklingRun::count, modes)}, "frequencies or buckling");
  append(
      keys,
      SceneKeys<StaticRun>{key(
          "geometry", &StaticRun::linear, form::choice<bool>({{"nonlinear", false}, {"linear", true}}),
          "static, frequencies; linear: one solve with the stiffness of the reference, without what it bears already")},
      [](auto& run) { return static_part(run); }, of_runs("static"));
  add(NonlinearOnly<ArcLengthRun>::keys([](const Place& place) {
        place.fail("a linear run has no path to follow: remove control = \"arc-length\"");
      }),
      "static");
  add(NonlinearOnly<DynamicRun>::keys(
          [](const Place& place) { place.fail_later("geometry = \"linear\" in a dynamic run"); }),
      "static");
  keys.push_back(key("control", &Run::kind,
                     form::one_of_kinds<RunKind>({{"load", StaticRun{}}, {"arc-length", ArcLengthRun{}}}),
                     "static; arc-length follows the path of equilibria through limit points")
                     .deciding()
                     .refused([](const Run& run) {
                       const bool is_static = name_of(run.kind) == StaticRun::name;
                       return is_static ? "" : of_other_run("control", "static", run);
                     }));
  append(
      keys, step_keys(steps), [](auto& run) { return stepped_part(run); }, without_steps);
  add(path_keys(steps), "control = \"arc-length\"");
  add(dynamic_keys(), "dynamic");
  return keys;
}

SceneKeys<Scene> run_keys() {
  const auto settings = [](auto& scene) { return &scene.run; };
  const SceneKeys<SceneUntil> until{key("probe", &SceneUntil::probe, name).needed(),
                                    key("axis", &SceneUntil::axis, form::axis()).needed(),
                                    key("reaches", &SceneUntil::reaches, length).needed()};
  SceneKeys<Scene> keys;
  append(keys, kind_keys(), settings);
  keys.push_back(key("until", &Scene::until, form::inner(until, R"({probe = "tip", axis = "z", reaches = "30mm"})"),
                     "arc-length: the path ends where a probe's displacement reaches this")
                     .refused([](const Scene& scene) {
                       return std::holds_alternative<ArcLengthRun>(scene.run.kind)
                                  ? ""
                                  : of_other_run("until", "control = \"arc-length\"", scene.run);
                     }));
  append(keys, SceneKeys<Run>{key("solver", &Run::solver, form::choice<Solver>(), "linear solver")}, settings);
  keys.push_back(key<Scene>(
                     "cg_tolerance", [](auto& scene) -> auto& { return scene.run.cg_tolerance; },
                     form::part("\"5%\"").in({0, 1, "{key} must be greater than 0 and less than 1 (100%)"}),
                     "relative residual at which CG stops, e.g. 5% (the paper's)")
                     .without_default()
                     .then([](Scene& scene) { scene.cg_tolerance_stated = true; })
                     .written_if([](const Scene& scene) { return scene.cg_tolerance_stated; }));
  append(keys,
         SceneKeys<Run>{key("cg_iterations", &Run::cg_iterations, form::count(),
                            "at most N CG iterations; without a tolerance a fixed count that asks for no convergence"),
                        key("converge", &Run::converge,
                            form::number("1e-8").in({0, 1, "{key} must be greater than 0 and less than 1"}),
                            "relative residual at which a step counts as solved (default 1e-8)"),
                        key("newton_max", &Run::newton_max, form::count(), "1: one linearisation per step"),
                        key("every", &Run::every, form::count(),
                            "write every N-th state (default 1); the first and the last always")},
         settings);
  return keys;
}

// ---- bodies

/// What makes millimetres of a mesh's coordinates.
template <typename Body>
void append_size(SceneKeys<Body>& keys) {
  keys.push_back(key("unit", &Body::unit_mm, form::unit_of_length(),
                     "unit of length of a mesh that says none (OBJ, STL, OFF, tetrahedra)"));
  keys.push_back(key("scale", &Body::scale, number.in(positive), "factor of the mesh's coordinates"));
}

/// @param needs_young  else it may be left out, where nothing depends on it
template <typename Body>
void append_material(SceneKeys<Body>& keys, bool needs_young) {
  SceneKeys<Material> own{
      key("young", &Material::young, form::quantity(dimension::pressure, "Pa", "\"1MPa\"").in(positive),
          "Young's modulus, e.g. 1MPa")
          .needed()
          .written_if([](const Material& material) { return material.young_stated; }),
      key("poisson", &Material::poisson,
          form::number("0.45").in(
              {-1, 0.5, "{key} {value} is outside (-1, 0.5): of what keeps its volume it is nearly 0.5, such as 0.49"}),
          "Poisson's ratio, in (-1, 0.5)")
          .needed(),
      key("density", &Material::density, form::quantity(dimension::density, "kg/m3", "\"1100kg/m3\"").in(positive),
          "mass density, e.g. 1100kg/m3 (dynamic runs need it)")};
  own.front().is_needed = needs_young;
  append(keys, own, [](auto& body) { return &body.material; });
}

SceneKeys<SceneShell> shell_keys() {
  using Shell = SceneShell;
  SceneKeys<Shell> keys{key("name", &Shell::name, name, "of the body, in the report and the result file").needed(),
                        key("mesh", &Shell::mesh, form::file("\"vessel.ply\""), "relative to the scene file").needed()};
  append_size(keys);
  keys.push_back(key("thickness", &Shell::thickness, length.in(positive), "thickness of the shell, e.g. 1.5mm")
                     .needed(" (nor thickness_from)", "thickness_from")
                     .written_if([](const Shell& shell) { return !shell.thickness_from; }));
  keys.push_back(key("thickness_from", &Shell::thickness_from, form::text("\"wall\""),
                     "in place of thickness: a number at each vertex of the mesh file, in mm")
                     .contradicting("thickness"));
  append_material(keys, false);
  keys.push_back(key("membrane", &Shell::membrane, form::choice<Membrane>(), "membrane element"));
  keys.push_back(key("bending", &Shell::bending, form::choice<Bending>(), "bending element"));
  keys.push_back(key("rest", &Shell::rest, form::choice<Rest>(), "flat: the facets are the shell"));
  return keys;
}

SceneKeys<SceneSolid> solid_keys() {
  using Solid = SceneSolid;
  const auto is_filled = [](const Solid& solid) { return solid.fill_size.has_value(); };
  const auto is_read = [](const Solid& solid) { return !solid.fill_size; };
  SceneKeys<Solid> keys{
      key("name", &Solid::name, name).needed(),
      key("mesh", &Solid::mesh, form::file("\"plaque.msh\""), "tetrahedra: Gmsh .msh, VTK .vtk or .vtu")
          .needed(" (nor fill)", "fill")
          .written_if(is_read),
      key("fill", &Solid::mesh, form::file("\"surface.ply\""), "in place of mesh: a closed surface to be filled")
          .without_default()
          .contradicting("mesh")
          .deciding()
          .then([](Solid& solid) { solid.fill_size = 0; })
          .written_if(is_filled)};
  append_size(keys);
  keys.push_back(key("size", &Solid::fill_size, length.in(positive), "edge of the tetrahedra of fill")
                     .needed(" (the edge of the tetrahedra that fill the surface)")
                     .unless(is_read, "size belongs to fill: remove it"));
  append_material(keys, true);
  keys.push_back(key("law", &Solid::law, form::choice<SolidLaw>(), "neo-hookean: for what is crushed"));
  return keys;
}

constexpr const char* of_round_ones = "of a sphere, capsule or cylinder";

template <typename Rod>
SceneKeys<Rod> rod_keys() {
  return {key("from", &Rod::from, moving_point, "of a capsule or cylinder: one end of its axis").needed(),
          key("to", &Rod::to, moving_point, "and the other").needed(),
          key("radius", &Rod::radius, radius, of_round_ones).needed()};
}

/// A motion of a rigid mesh about an axis, by an amount.
template <typename Motion>
Form<Motion> about_axis(std::string_view name, Table<double> Motion::*amount, const Form<double>& form,
                        std::string_view like) {
  return form::inner(SceneKeys<Motion>{key("point", &Motion::point, point).needed(),
                                       key("axis", &Motion::axis, form::direction()).needed(),
                                       key(name, amount, form::over_time(form)).needed()},
                     fmt::format(R"({{point = ["0mm", "0mm", "0mm"], axis = [0.0, 0.0, 1.0], {} = {}}})", name, like));
}

SceneKeys<SceneRigidMesh> rigid_mesh_keys() {
  SceneKeys<SceneRigidMesh> keys;
  append_size(keys);
  keys.push_back(
      key("turn", &SceneRigidMesh::turn,
          about_axis("angle", &RigidMesh::Turn::angle, form::angle("90.0"), R"([["0s", 0.0], ["1s", 90.0]])"),
          "degrees about an axis"));
  keys.push_back(key("expand", &SceneRigidMesh::expansion,
                     about_axis("factor", &RigidMesh::Expansion::factor, form::number("1.5").in(positive),
                                R"([["0s", 1.0], ["1s", 1.5]])"),
                     "factor of the distances from an axis"));
  return keys;
}

SceneKeys<SceneRigid> rigid_keys() {
  using Shape = decltype(SceneRigid::shape);
  const auto is_mesh = [](const SceneRigid& rigid) { return std::holds_alternative<SceneRigidMesh>(rigid.shape); };
  const auto mesh_in = [](const std::filesystem::path& path) { return Shape(SceneRigidMesh{path, {}, 1, {}, {}}); };
  const auto path_of = [](const Shape& shape) { return std::get<SceneRigidMesh>(shape).mesh; };
  SceneKeys<SceneRigid> keys{
      key("name", &SceneRigid::name, name).needed(),
      key("shape", &SceneRigid::shape, kind_of<Shape, RigidSphere, RigidCapsule, RigidCylinder, RigidPlane>(),
          "each with its keys of the next rows; a table is over time, in a static run over the load factor")
          .needed(" (nor mesh)", "mesh")
          .contradicting("mesh")
          .deciding()
          .written_if([=](const SceneRigid& rigid) { return !is_mesh(rigid); })};
  const auto add = [&]<typename Kind>(const SceneKeys<Kind>& own, std::string_view owner) {
    append(
        keys, own, [](auto& rigid) { return std::get_if<Kind>(&rigid.shape); },
        [owner](std::string_view key, const SceneRigid& rigid) {
          return fmt::format("{} belongs to a rigid body of the shape {}, this is a {}: remove it", key,
                             key == "radius" ? "sphere, capsule, cylinder" : owner, name_of(rigid.shape));
        });
  };
  add(SceneKeys<RigidSphere>{key("centre", &RigidSphere::centre, moving_point, "of a sphere").needed(),
                             key("radius", &RigidSphere::radius, radius, of_round_ones).needed()},
      "sphere");
  add(rod_keys<RigidCapsule>(), "capsule, cylinder");
  add(rod_keys<RigidCylinder>(), "capsule, cylinder");
  add(
      SceneKeys<RigidPlane>{
          key("point", &RigidPlane::point, moving_point, "of a plane").needed(),
          key("normal", &RigidPlane::normal, form::direction(), "of a plane: away from the body").needed()},
      "plane");
  keys.push_back(key("mesh", &SceneRigid::shape, form::made_of(form::file("\"stent.ply\""), mesh_in, path_of),
                     "in place of shape: a closed surface")
                     .without_default()
                     .deciding()
                     .written_if(is_mesh));
  add(rigid_mesh_keys(), "mesh");
  keys.push_back(key("motion", &SceneRigid::motion, moving_point, "added to the places above"));
  return keys;
}

// ---- what holds and loads them

/// Why a fix holds no axes.
std::string without_axes(std::string_view key, const SceneFix& fix) {
  const bool rigid = std::holds_alternative<RigidMotions>(fix.where);
  return rigid || fix.slide
             ? fmt::format("{} means nothing beside {}: remove it", key, rigid ? "rigid_motions" : "slide = true")
             : "";
}

SceneKeys<SceneFix> fix_keys() {
  using Fix = SceneFix;
  SceneKeys<Fix> keys{
      key("body", &Fix::body, name).needed(), key("where", &Fix::where, form::selection()).needed().deciding(),
      key("slide", &Fix::slide, form::flag(),
          "in place of translation and rotation: the rims wholly in `where` widen, turn and move freely within their "
          "planes; planes less than 0.1 degrees apart count as parallel")
          .deciding()
          .unless([](const Fix& fix) { return std::holds_alternative<RigidMotions>(fix.where); },
                  "slide means nothing beside rigid_motions: remove it")
          .written_if([](const Fix& fix) { return fix.slide; })};
  SceneKeys<Fix> of_axes{
      key("translation", &Fix::translation, form::axes(), "held components in world axes, \"\" for none")
          .needed(axes_are_said),
      key("rotation", &Fix::rotation, form::axes(),
          "likewise, of a shell's nodes, where it is needed; a plane of symmetry across z: translation z, rotation xy")
          .without_default(),
      key("displacement", &Fix::displacement, form::vector(dimension::length, "m", R"(["0mm", "0mm", "1mm"])"),
          "prescribed instead of held")
          .deciding(),
      ramp_key<Fix>().unless([](const Fix& fix) { return !fix.displacement; },
                             "ramp in [[fix]] needs a displacement: add it, or remove the ramp")};
  append(
      keys, of_axes, [](auto& fix) { return without_axes("", fix).empty() ? &fix : nullptr; }, without_axes);
  return keys;
}

SceneKeys<SceneSupport> support_keys() {
  using Support = SceneSupport;
  return {key("body", &Support::body, name).needed(),
          key("where", &Support::where, form::selection(), "the region that lies in the bed; else all of it"),
          key("stiffness", &Support::stiffness, form::quantity(dimension::bedding, "N/m3", "\"1e5N/m3\"").in(positive),
              "stiffness of the tissue around, an elastic bed per area, e.g. 1e5N/m3; without force in the shape given")
              .needed(),
          key("direction", &Support::normal_only, form::choice<bool>({{"all", false}, {"normal", true}}),
              "normal: the wall slides on the bed, which presses along its normals alone")};
}

SceneKeys<PressureLoad> pressure_keys() {
  using Load = PressureLoad;
  return {key("value", &Load::value, pressure,
              "pressure that follows the surface; positive pushes along the normals, outward")
              .needed(),
          key("follower", &Load::follower, form::flag(), "turns and grows with the surface"),
          key("imaged_at", &Load::imaged_at, pressure,
              "the organ was under this pressure when it was imaged: there it is at rest, and its wall bears that "
              "already")
              .deciding(),
          key("unload", &Load::unload, form::flag(),
              "the shape without that pressure is found, and the load begins at zero")
              .unless([](const Load& load) { return !load.imaged_at; },
                      "unload takes off the pressure of the image: add imaged_at, or remove unload")};
}

/// Of the kinds of load that have one: where it acts.
SceneKey<SceneLoad> where_key(std::string_view says, bool of_pressure) {
  return key("where", &SceneLoad::where, form::selection(), says).refused([=](const SceneLoad& load) {
    const bool on_all = std::holds_alternative<AreaLoad>(load.kind) || std::holds_alternative<GravityLoad>(load.kind);
    return !on_all && of_pressure == std::holds_alternative<PressureLoad>(load.kind)
               ? ""
               : fmt::format("a load of kind {} acts on the whole body: remove where", name_of(load.kind));
  });
}

SceneKeys<SceneLoad> load_keys() {
  using Kind = decltype(SceneLoad::kind);
  SceneKeys<SceneLoad> keys{
      key("body", &SceneLoad::body, name).needed(),
      where_key("of a force or moment: the nodes that carry it; of an edge load: the part of the boundary", false)
          .needed(" (which nodes carry the load)"),
      where_key("of a pressure: the region it acts on, cut out of the triangles; else all of the surface", true),
      key("kind", &SceneLoad::kind,
          kind_of<Kind, PressureLoad, ForceLoad, MomentLoad, EdgeLoad, AreaLoad, GravityLoad>(), "see Loads")
          .needed()
          .deciding()};
  const auto add = [&]<typename Load>(const SceneKeys<Load>& own) {
    append(
        keys, own, [](auto& load) { return std::get_if<Load>(&load.kind); },
        [](std::string_view key, const SceneLoad&) { return fmt::format("{} belongs to a pressure: remove it", key); });
  };
  const auto add_value = [&]<typename Load>(Vec3 Load::*value, Dimension dimension, std::string_view unit,
                                            std::string_view like, std::string_view says) {
    add(SceneKeys<Load>{key("value", value, form::vector(dimension, unit, like), says).needed()});
  };
  add(pressure_keys());
  add_value(&ForceLoad::total, dimension::force, "N", R"(["0N", "0N", "-1N"])",
            "of a force: of all its nodes together");
  add_value(&MomentLoad::total, dimension::moment, "N*m", R"(["0N*mm", "0N*mm", "1N*mm"])",
            "of a moment: of all its nodes together");
  add_value(&EdgeLoad::per_length, dimension::force_per_length, "N/m", R"(["0N/mm", "0N/mm", "1N/mm"])",
            "of an edge load: per length of the edge");
  add_value(&AreaLoad::per_area, dimension::pressure, "Pa", R"(["0kPa", "0kPa", "1kPa"])",
            "of an area load: per area, in one direction");
  add_value(&GravityLoad::acceleration, dimension::acceleration, "m/s2", R"(["0m/s2", "0m/s2", "-9.81m/s2"])",
            "of gravity: the acceleration");
  keys.push_back(ramp_key<SceneLoad>());
  return keys;
}

// ---- what is between them, and what is asked

/// Written where the body that carries has sides.
struct AttachedSide : MemberAccess<SceneAttach, Attachment::Side SceneAttach::*, Attachment::Side> {
  using MemberAccess::MemberAccess;

  [[nodiscard]] std::string write(const SceneAttach& attach, const Writing& to) const override {
    const bool is_to_shell =
        to.scene == nullptr || std::ranges::count(to.scene->shells, attach.to, &SceneShell::name) > 0;
    return is_to_shell ? MemberAccess::write(attach, to) : "";
  }
};

SceneKeys<SceneAttach> attach_keys() {
  using Attach = SceneAttach;
  const Form<Attachment::Side> side = form::choice<Attachment::Side>();
  return {key("body", &Attach::body, name).needed(),
          key("where", &Attach::where, form::selection(true),
              "also {touching = \"0.1mm\"}: nodes at most that far from `side`; all other forms attach up to a shell's "
              "length away. Shells turn with a shell that carries them; a solid lets them turn: along a line or a "
              "rim alone that is a hinge")
              .needed(),
          key("to", &Attach::to, name, "the body that carries them").needed(),
          {"side", "where on the wall of a shell `touching` measures; what is carried keeps its distance",
           std::make_shared<const AttachedSide>("side", &Attach::side, side)}};
}

SceneKeys<SceneContact> contact_keys() {
  using Contact = SceneContact;
  return {key("name", &Contact::name, name, "else the names of the two, joined by a hyphen").without_default(),
          key("between", &Contact::between, form::two_names(R"(["balloon", "plaque"])"), "the same twice: with itself")
              .needed(),
          key("friction", &Contact::friction, form::number("0.2").in(not_negative), "Coulomb's coefficient"),
          key("resolution", &Contact::resolution,
              form::part("\"5%\"").in({0, 0.5, "{key} must be above 0 and at most 50%", false, true}),
              "of the thinner wall, of solids of the mean edge: the distance over which contact pressure builds up"),
          key("surface", &Contact::curved, form::choice<bool>({{"curved", true}, {"facets", false}})),
          key("transfer", &Contact::consistent, form::choice<bool>({{"consistent", true}, {"paper", false}}),
              "paper: the paper's rule, which is not in balance")};
}

SceneKeys<SceneProbe> probe_keys() {
  return {
      key("name", &SceneProbe::name, name).needed(), key("body", &SceneProbe::body, name).needed(),
      key("nearest", &SceneProbe::nearest, point, "the node closest to this point in the reference geometry").needed()};
}

/// A quantity by its name, or a probe's displacement along an axis.
Form<SceneAnswer> answer() {
  const Form<Quantity> quantity = form::choice(std::vector(names_of<Quantity>.begin(), names_of<Quantity>.end() - 1));
  const Form<SceneAnswer> of_probe =
      form::inner(SceneKeys<SceneAnswer>{key("probe", &SceneAnswer::probe, name).needed(),
                                         key("axis", &SceneAnswer::axis, form::axis()).needed()},
                  R"({probe = "tip", axis = "z"})");
  return {quantity.like + ", " + of_probe.like,
          [=](const SceneTable& table, const toml::node& node, std::string_view key) {
            SceneAnswer answer;
            if (node.is_table()) {
              answer = of_probe.read(table, node, key);
              answer.of = Quantity::probe;
            } else {
              answer.of = quantity.read(table, node, key);
            }
            return answer;
          },
          [=](const SceneAnswer& answer, const Writing& to) {
            return answer.of == Quantity::probe ? of_probe.write(answer, to) : quantity.write(answer.of, to);
          }};
}

SceneKeys<SceneAccuracy> accuracy_keys() {
  SceneKeys<SceneAccuracy> keys{
      key("within", &SceneAccuracy::within, form::part("\"2%\""), "estimated error of the answer").needed()};
  append(keys,
         SceneKeys<SceneAnswer>{
             key<SceneAnswer>("of", std::identity{}, answer(), "the answer, of a motion the largest it comes to")},
         [](auto& accuracy) { return &accuracy; });
  keys.push_back(key("target", &SceneAccuracy::targets, form::files_by_name(R"({vessel = "surface.ply"})"),
                     "by body: the surface that its mesh was fitted to")
                     .without_default());
  return keys;
}

}  // namespace
}  // namespace schema

const SceneSchema& scene_schema() {
  static const SceneSchema all{schema::run_keys(),   schema::shell_keys(),   schema::solid_keys(),
                               schema::rigid_keys(), schema::fix_keys(),     schema::support_keys(),
                               schema::load_keys(),  schema::attach_keys(),  schema::contact_keys(),
                               schema::probe_keys(), schema::accuracy_keys()};
  return all;
}

}  // namespace tunica
