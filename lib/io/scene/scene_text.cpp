#include "tunica/io/scene/scene.hpp"

#include "tunica/core/quantity.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

// The shortest decimal that reads as the same double again. Where no decimal does (a conversion skips some doubles),
// that of the nearest value that has one.
// @param text_with  the value with so many digits; read  what that is read as
template <typename TextWith, typename Read>
std::string shortest(double value, const TextWith& text_with, const Read& read) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    for (int digits = 1; digits <= 17; ++digits) {
      const std::string text = text_with(value, digits);
      if (read(text) == value) {
        return text;
      }
    }
    value = read(text_with(value, 17));
  }
  return text_with(value, 17);
}

std::string quantity(double value, std::string_view unit, Dimension dimension) {
  const double size = parse_quantity(fmt::format("1{}", unit), dimension);
  return shortest(
      value, [&](double wanted, int digits) { return fmt::format("{:.{}g}{}", wanted / size, digits, unit); },
      [&](const std::string& text) { return parse_quantity(text, dimension); });
}

std::string toml_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (code < 0x20 || code == 0x7f) {
      result += fmt::format("\\u{:04X}", code);
    } else {
      result += c;
    }
  }
  return result + "\"";
}

// A TOML float: "1" alone would be an integer, which reads the same but says less.
std::string number(double value) {
  std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

// An angle in rad, written in degrees.
std::string degrees(double angle) {
  const std::string text = shortest(
      angle, [](double wanted, int digits) { return fmt::format("{:.{}g}", wanted * 180 / std::numbers::pi, digits); },
      [](const std::string& written) { return parse_number(written).value_or(0) * std::numbers::pi / 180; });
  return number(parse_number(text).value_or(0));
}

std::string vector(const Vec3& value, std::string_view unit, Dimension dimension) {
  return fmt::format("[{}, {}, {}]", toml_string(quantity(value.x(), unit, dimension)),
                     toml_string(quantity(value.y(), unit, dimension)),
                     toml_string(quantity(value.z(), unit, dimension)));
}

std::string point(const Vec3& value) { return vector(value, "m", dimension::length); }

std::string length(double value) { return toml_string(quantity(value, "m", dimension::length)); }

std::string direction(const Vec3& value) {
  return fmt::format("[{}, {}, {}]", number(value.x()), number(value.y()), number(value.z()));
}

// [[time, value], …]; in a static run the load factor plays the part of time.
template <typename Value, typename Write>
std::string pairs_text(const std::vector<std::pair<double, Value>>& points, bool dynamic, const Write& write) {
  std::vector<std::string> pairs;
  for (const auto& [time, value] : points) {
    const std::string when = dynamic ? toml_string(quantity(time, "s", dimension::time)) : number(time);
    pairs.push_back(fmt::format("[{}, {}]", when, write(value)));
  }
  return fmt::format("[{}]", fmt::join(pairs, ", "));
}

// A value alone, or a table over time.
template <typename Value, typename Write>
std::string table_text(const Table<Value>& table, bool dynamic, const Write& write) {
  const bool constant = table.points.size() == 1 && table.points.front().first == 0;
  return constant ? write(table.points.front().second) : pairs_text(table.points, dynamic, write);
}

class Text {
public:
  explicit Text(const std::filesystem::path& file)
      : folder_(file.empty() ? file : std::filesystem::absolute(file).lexically_normal().parent_path()) {}

  void section(std::string_view header) { text_ += fmt::format("{}{}\n", text_.empty() ? "" : "\n", header); }
  void line(std::string_view key, const std::string& value) { text_ += fmt::format("{} = {}\n", key, value); }
  void word(std::string_view key, std::string_view value) { line(key, toml_string(value)); }
  /// A path as the file may say it; absolute where it leaves the file's folder, for a link on the way up leads
  /// elsewhere.
  [[nodiscard]] std::string place(const std::filesystem::path& path) const {
    const std::filesystem::path whole = std::filesystem::absolute(path).lexically_normal();
    const std::filesystem::path within = folder_.empty() ? folder_ : whole.lexically_relative(folder_);
    return within.empty() || *within.begin() == ".." ? whole.string() : within.string();
  }
  void value(std::string_view key, double value, std::string_view unit, Dimension dimension) {
    word(key, quantity(value, unit, dimension));
  }
  void ramp(const Ramp& ramp, bool dynamic) {
    if (ramp.points.empty()) {
      return;
    }
    line("ramp", pairs_text(ramp.points, dynamic, number));
  }
  [[nodiscard]] const std::string& str() const { return text_; }

private:
  std::string text_;
  std::filesystem::path folder_;
};

void write_load_factors(const std::vector<double>& factors, Text& text) {
  const std::size_t steps = factors.size();
  if (factors == equal_load_factors(steps)) {
    text.line("load_steps", std::to_string(steps));
    return;
  }
  std::vector<std::string> numbers;
  for (const double factor : factors) {
    numbers.push_back(number(factor));
  }
  text.line("load_factors", fmt::format("[{}]", fmt::join(numbers, ", ")));
}

void write_kind_of_run(const StaticRun& run, Text& text) {
  text.word("kind", "static");
  text.word("geometry", run.linear ? "linear" : "nonlinear");
  text.word("control", "load");
  write_load_factors(run.load_factors, text);
}

void write_kind_of_run(const DynamicRun& run, Text& text) {
  text.word("kind", "dynamic");
  text.word("geometry", "nonlinear");
  text.value("duration", run.duration, "s", dimension::time);
  text.value("step", run.step, "s", dimension::time);
  text.line("damping",
            fmt::format("{{mass = {}, stiffness = {}}}", toml_string(quantity(run.damping.mass, "/s", dimension::rate)),
                        toml_string(quantity(run.damping.stiffness, "s", dimension::time))));
  if (run.integrator == Integrator::generalised_alpha) {
    text.word("integrator", "generalised-alpha");
    text.line("spectral_radius", number(run.spectral_radius));
  } else {
    text.word("integrator", "backward-euler");
  }
  if (run.adaptive) {
    text.word("adaptive", run.adaptive->relative ? number(1e2 * run.adaptive->value) + "%"
                                                 : quantity(run.adaptive->value, "m", dimension::length));
  }
}

void write_kind_of_run(const FrequencyRun& run, Text& text) {
  text.word("kind", "frequencies");
  text.line("count", std::to_string(run.count));
  text.word("geometry", run.preload.linear ? "linear" : "nonlinear");
  if (!run.preload.linear) {
    write_load_factors(run.preload.load_factors, text);
  }
}

void write_kind_of_run(const ArcLengthRun&, Text&) { TUNICA_ASSERT(false && "needs the probe's name"); }

void write_kind_of_run(const BucklingRun& run, Text& text) {
  text.word("kind", "buckling");
  text.line("count", std::to_string(run.count));
}

void write_path(const ArcLengthRun& run, const std::string& probe, Text& text) {
  text.word("kind", "static");
  text.word("geometry", "nonlinear");
  text.word("control", "arc-length");
  text.line("load_steps", std::to_string(std::lround(1 / run.first_factor)));
  text.line("max_steps", std::to_string(run.max_steps));
  if (run.max_factor) {
    text.line("max_factor", number(*run.max_factor));
  }
  if (run.until) {
    text.line("until", fmt::format("{{probe = {}, axis = \"{}\", reaches = {}}}", toml_string(probe),
                                   "xyz"[run.until->axis], length(run.until->reaches)));
  }
}

void write_run(const Scene& scene, Text& text) {
  const RunSettings& run = scene.run;
  text.section("[run]");
  if (const auto* path = std::get_if<ArcLengthRun>(&run.kind)) {
    write_path(*path, scene.until_probe, text);
  } else {
    std::visit([&](const auto& kind) { write_kind_of_run(kind, text); }, run.kind);
  }
  text.word("solver", run.solver == Solver::cg ? "cg" : run.solver == Solver::direct ? "direct" : "auto");
  if (scene.cg_tolerance_stated) {
    text.line("cg_tolerance", number(run.cg_tolerance));
  }
  if (run.cg_iterations) {
    text.line("cg_iterations", std::to_string(*run.cg_iterations));
  }
  text.line("converge", number(run.converge));
  text.line("newton_max", std::to_string(run.newton_max));
  text.line("every", std::to_string(run.every));
}

}  // namespace

std::string_view name_of(Membrane membrane) {
  switch (membrane) {
    case Membrane::cst:
      return "cst";
    case Membrane::opt:
      return "opt";
    case Membrane::adapt:
      return "adapt";
  }
  return {};
}

std::string_view name_of(Bending bending) {
  switch (bending) {
    case Bending::comas:
      return "comas";
    case Bending::comas_consistent:
      return "comas-consistent";
    case Bending::dkt:
      return "dkt";
    case Bending::dkt_comas:
      return "dkt-comas";
  }
  return {};
}

namespace {

void write_file(std::string_view key, const std::filesystem::path& mesh, std::optional<double> unit_mm, double scale,
                Text& text) {
  text.word(key, text.place(mesh));
  if (unit_mm) {
    text.word("unit", *unit_mm == 1 ? "mm" : *unit_mm == 10 ? "cm" : *unit_mm == 1000 ? "m" : "um");
  }
  text.line("scale", number(scale));
}

void write_material(const Material& material, Text& text) {
  if (material.young_stated) {
    text.value("young", material.young, "Pa", dimension::pressure);
  }
  text.line("poisson", number(material.poisson));
  if (material.density) {
    text.value("density", *material.density, "kg/m3", dimension::density);
  }
}

void write_shell(const SceneShell& shell, Text& text) {
  text.section("[[shell]]");
  text.word("name", shell.name);
  write_file("mesh", shell.mesh, shell.unit_mm, shell.scale, text);
  if (shell.thickness_from) {
    text.word("thickness_from", *shell.thickness_from);
  } else {
    text.value("thickness", shell.thickness, "m", dimension::length);
  }
  write_material(shell.material, text);
  text.word("membrane", name_of(shell.membrane));
  text.word("bending", name_of(shell.bending));
  text.word("rest", shell.rest == Rest::curved ? "curved" : "flat");
}

void write_solid(const SceneSolid& solid, Text& text) {
  text.section("[[solid]]");
  text.word("name", solid.name);
  write_file(solid.fill_size ? "fill" : "mesh", solid.mesh, solid.unit_mm, solid.scale, text);
  if (solid.fill_size) {
    text.line("size", length(*solid.fill_size));
  }
  write_material(solid.material, text);
  text.word("law", solid.law == SolidLaw::corotational ? "corotational" : "neo-hookean");
}

void write_shape(const RigidSphere& sphere, bool dynamic, Text& text) {
  text.word("shape", "sphere");
  text.line("centre", table_text(sphere.centre, dynamic, point));
  text.line("radius", table_text(sphere.radius, dynamic, length));
}
template <typename Rod>
void write_rod(std::string_view shape, const Rod& rod, bool dynamic, Text& text) {
  text.word("shape", shape);
  text.line("from", table_text(rod.from, dynamic, point));
  text.line("to", table_text(rod.to, dynamic, point));
  text.line("radius", table_text(rod.radius, dynamic, length));
}
void write_shape(const RigidCapsule& capsule, bool dynamic, Text& text) {
  write_rod("capsule", capsule, dynamic, text);
}
void write_shape(const RigidCylinder& cylinder, bool dynamic, Text& text) {
  write_rod("cylinder", cylinder, dynamic, text);
}
void write_shape(const RigidPlane& plane, bool dynamic, Text& text) {
  text.word("shape", "plane");
  text.line("point", table_text(plane.point, dynamic, point));
  text.line("normal", direction(plane.normal));
}
void write_shape(const SceneRigidMesh& mesh, bool dynamic, Text& text) {
  write_file("mesh", mesh.mesh, mesh.unit_mm, mesh.scale, text);
  if (mesh.turn) {
    text.line("turn", fmt::format("{{point = {}, axis = {}, angle = {}}}", point(mesh.turn->point),
                                  direction(mesh.turn->axis), table_text(mesh.turn->angle, dynamic, degrees)));
  }
  if (mesh.expansion) {
    text.line("expand",
              fmt::format("{{point = {}, axis = {}, factor = {}}}", point(mesh.expansion->point),
                          direction(mesh.expansion->axis), table_text(mesh.expansion->factor, dynamic, number)));
  }
}

void write_rigid(const SceneRigid& rigid, bool dynamic, Text& text) {
  text.section("[[rigid]]");
  text.word("name", rigid.name);
  std::visit([&](const auto& shape) { write_shape(shape, dynamic, text); }, rigid.shape);
  if (rigid.motion) {
    text.line("motion", table_text(*rigid.motion, dynamic, point));
  }
}

std::string text_of(const AllNodes&) { return "all = true"; }
std::string text_of(const BoundaryNodes&) { return "boundary = true"; }
std::string text_of(const RigidMotions&) { return "rigid_motions = true"; }
std::string text_of(const BoxNodes& box) { return fmt::format("box = [{}, {}]", point(box.lower), point(box.upper)); }
std::string text_of(const HalfSpaceNodes& half) {
  return fmt::format("{} = {{axis = \"{}\", at = {}}}", half.below ? "below" : "above", "xyz"[half.axis],
                     length(half.at));
}
std::string text_of(const SphereNodes& sphere) {
  return fmt::format("sphere = {{centre = {}, radius = {}}}", point(sphere.centre), length(sphere.radius));
}
std::string text_of(const ListedNodes& list) { return fmt::format("nodes = [{}]", fmt::join(list.nodes, ", ")); }
std::string text_of(const TouchingNodes& touching) { return fmt::format("touching = {}", length(touching.distance)); }
std::string text_of(const NearestNode& nearest) { return fmt::format("nearest = {}", point(nearest.point)); }

std::string where_text(const Selection& where) {
  return fmt::format("{{{}}}", std::visit([](const auto& form) { return text_of(form); }, where));
}

std::string components(const std::array<bool, 3>& held) {
  std::string text;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (held[axis]) {
      text += "xyz"[axis];
    }
  }
  return text;
}

void write_fix(const SceneFix& fix, bool dynamic, Text& text) {
  text.section("[[fix]]");
  text.word("body", fix.body);
  text.line("where", where_text(fix.where));
  if (std::holds_alternative<RigidMotions>(fix.where)) {
    return;
  }
  if (fix.slide) {
    text.line("slide", "true");
    return;
  }
  text.word("translation", components(fix.translation));
  text.word("rotation", components(fix.rotation));
  if (fix.displacement) {
    text.line("displacement", point(*fix.displacement));
  }
  text.ramp(fix.ramp, dynamic);
}

void write_support(const SceneSupport& support, Text& text) {
  text.section("[[support]]");
  text.word("body", support.body);
  if (support.where) {
    text.line("where", where_text(*support.where));
  }
  text.value("stiffness", support.stiffness, "N/m3", dimension::bedding);
  text.word("direction", support.normal_only ? "normal" : "all");
}

void write_kind(const PressureLoad& load, Text& text) {
  text.word("kind", "pressure");
  text.value("value", load.value, "Pa", dimension::pressure);
  text.line("follower", load.follower ? "true" : "false");
  if (load.imaged_at) {
    text.value("imaged_at", *load.imaged_at, "Pa", dimension::pressure);
    text.line("unload", load.unload ? "true" : "false");
  }
}
void write_kind(const ForceLoad& load, Text& text) {
  text.word("kind", "force");
  text.line("value", vector(load.total, "N", dimension::force));
}
void write_kind(const MomentLoad& load, Text& text) {
  text.word("kind", "moment");
  text.line("value", vector(load.total, "N*m", dimension::moment));
}
void write_kind(const EdgeLoad& load, Text& text) {
  text.word("kind", "edge");
  text.line("value", vector(load.per_length, "N/m", dimension::force_per_length));
}
void write_kind(const AreaLoad& load, Text& text) {
  text.word("kind", "area");
  text.line("value", vector(load.per_area, "Pa", dimension::pressure));
}
void write_kind(const GravityLoad& load, Text& text) {
  text.word("kind", "gravity");
  text.line("value", vector(load.acceleration, "m/s2", dimension::acceleration));
}

void write_attach(const Scene& scene, const SceneAttach& attach, Text& text) {
  text.section("[[attach]]");
  text.word("body", attach.body);
  text.line("where", where_text(attach.where));
  text.word("to", attach.to);
  const bool to_shell = std::any_of(scene.shells.begin(), scene.shells.end(),
                                    [&](const SceneShell& shell) { return shell.name == attach.to; });
  if (to_shell) {
    text.word("side", attach.side == Attachment::Side::inner   ? "inner"
                      : attach.side == Attachment::Side::outer ? "outer"
                                                               : "middle");
  }
}

void write_contact(const SceneContact& contact, Text& text) {
  text.section("[[contact]]");
  text.word("name", contact.name);
  text.line("between", fmt::format("[{}, {}]", toml_string(contact.between[0]), toml_string(contact.between[1])));
  text.line("friction", number(contact.friction));
  text.line("resolution", number(contact.resolution));
  text.word("surface", contact.curved ? "curved" : "facets");
  text.word("transfer", contact.consistent ? "consistent" : "paper");
}

void write_accuracy(const SceneAccuracy& accuracy, Text& text) {
  text.section("[accuracy]");
  text.line("within", number(accuracy.within));
  if (accuracy.of == Quantity::probe) {
    text.line("of", fmt::format("{{probe = {}, axis = \"{}\"}}", toml_string(accuracy.probe), "xyz"[accuracy.axis]));
  } else {
    text.word("of", name_of(accuracy.of));
  }
  std::vector<std::string> targets;
  for (const auto& [body, path] : accuracy.targets) {
    targets.push_back(fmt::format("{} = {}", toml_string(body), toml_string(text.place(path))));
  }
  text.line("target", fmt::format("{{{}}}", fmt::join(targets, ", ")));
}

}  // namespace

std::string scene_text(const Scene& scene, const std::filesystem::path& file) {
  Text text(file);
  const bool dynamic = std::holds_alternative<DynamicRun>(scene.run.kind);
  write_run(scene, text);
  for (const SceneShell& shell : scene.shells) {
    write_shell(shell, text);
  }
  for (const SceneSolid& solid : scene.solids) {
    write_solid(solid, text);
  }
  for (const SceneRigid& rigid : scene.rigids) {
    write_rigid(rigid, dynamic, text);
  }
  for (const SceneFix& fix : scene.fixes) {
    write_fix(fix, dynamic, text);
  }
  for (const SceneSupport& support : scene.supports) {
    write_support(support, text);
  }
  for (const SceneLoad& load : scene.loads) {
    text.section("[[load]]");
    text.word("body", load.body);
    if (load.where) {
      text.line("where", where_text(*load.where));
    }
    std::visit([&](const auto& kind) { write_kind(kind, text); }, load.kind);
    text.ramp(load.ramp, dynamic);
  }
  for (const SceneAttach& attach : scene.attachments) {
    write_attach(scene, attach, text);
  }
  for (const SceneContact& contact : scene.contacts) {
    write_contact(contact, text);
  }
  for (const SceneProbe& probe : scene.probes) {
    text.section("[[probe]]");
    text.word("name", probe.name);
    text.word("body", probe.body);
    text.line("nearest", point(probe.nearest));
  }
  if (scene.accuracy) {
    write_accuracy(*scene.accuracy, text);
  }
  return text.str();
}

}  // namespace tunica
