#include "tunica/io/scene/scene.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <set>

namespace tunica {
namespace {

// Lengths of run that would fill memory with history; nobody waits for them.
constexpr double most_steps = 1e9;

void require(bool fine, const Place& place, const std::string& what) {
  if (!fine) {
    place.fail(what);
  }
}

bool positive(double value) { return value > 0 && std::isfinite(value); }

void check_run(const Scene& scene) {
  const RunSettings& run = scene.run;
  const Places& places = scene.run_places;
  if (const auto* dynamic = std::get_if<DynamicRun>(&run.kind)) {
    require(positive(dynamic->duration), places.of("duration"), "duration must be greater than zero");
    require(positive(dynamic->step), places.of("step"), "step must be greater than zero");
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
    require(!path->max_factor || positive(*path->max_factor), places.of("max_factor"),
            "max_factor must be greater than 0");
    require(!path->until || path->until->reaches != 0, places.of("until"), "until reaches 0: the path begins there");
  }
  require(run.converge > 0 && run.converge < 1, places.of("converge"),
          "converge must be greater than 0 and less than 1");
}

/// @param needs_density  what of the run needs it; empty where nothing does
void check_shell(const SceneShell& shell, std::string_view needs_density) {
  const Places& places = shell.places;
  require(!shell.name.empty(), places.of("name"), "name is empty");
  require(!shell.mesh.filename().empty(), places.of("mesh"), "mesh names no file");
  require(positive(shell.scale), places.of("scale"), "scale must be greater than zero");
  require(shell.thickness_from || positive(shell.thickness), places.of("thickness"),
          "thickness must be greater than zero");
  require(positive(shell.material.young), places.of("young"), "young must be greater than zero");
  require(shell.material.poisson > -1 && shell.material.poisson < 0.5, places.of("poisson"),
          fmt::format("poisson {} is outside (-1, 0.5)", shell.material.poisson));
  require(!shell.material.density || positive(*shell.material.density), places.of("density"),
          "density must be greater than zero");
  require(needs_density.empty() || shell.material.density, places.item,
          fmt::format("[[shell]] \"{}\" has no density: {} needs it", shell.name, needs_density));
}

std::vector<std::string> body_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const SceneShell& shell : scene.shells) {
    names.push_back(shell.name);
  }
  return names;
}

// Index of the body, which must exist.
std::size_t body_index(const Scene& scene, const std::string& name, const Places& places) {
  for (std::size_t b = 0; b < scene.shells.size(); ++b) {
    if (scene.shells[b].name == name) {
      return b;
    }
  }
  places.of("body").fail(
      fmt::format("there is no body \"{}\": the bodies are \"{}\"", name, fmt::join(body_names(scene), "\", \"")));
}

// Names become keys of the report and groups of the result file.
void check_probe_name(const SceneProbe& probe) {
  const bool fine = !probe.name.empty() && std::all_of(probe.name.begin(), probe.name.end(), [](unsigned char c) {
    return c > ' ' && c != '/' && c != '.' && c != 0x7f;
  });
  require(fine, probe.places.of("name"),
          fmt::format("\"{}\" cannot name a probe: use letters, digits, - and _", probe.name));
}

void check_fix(const Scene& scene, const SceneFix& fix) {
  (void)body_index(scene, fix.body, fix.places);
  const auto any = [](const std::array<bool, 3>& held) { return held[0] || held[1] || held[2]; };
  require(any(fix.translation) || any(fix.rotation), fix.places.of("translation"),
          "this [[fix]] holds nothing: name an axis in translation or rotation, or remove it");
  if (fix.displacement) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      require(fix.translation[axis] || (*fix.displacement)[axis] == 0, fix.places.of("displacement"),
              fmt::format("displacement along {0} is prescribed but not held: add {0} to translation", "xyz"[axis]));
    }
  }
}

std::vector<Index> boundary_nodes(const std::vector<std::array<Index, 2>>& edges) {
  std::set<Index> nodes;
  for (const auto& edge : edges) {
    nodes.insert(edge.begin(), edge.end());
  }
  return {nodes.begin(), nodes.end()};
}

// The nodes of the boundary edges, in the direction of their triangles; in the order of (smaller, larger) node.
std::vector<std::array<Index, 2>> boundary_of(const ShellMesh& mesh) {
  const auto& triangles = mesh.triangles;
  std::vector<std::array<Index, 2>> boundary;
  for (const auto& [t, k] : boundary_edges(neighbours(triangles, incidence(mesh.vertices.size(), triangles)))) {
    boundary.push_back({triangles[t][k], triangles[t][(k + 1) % 3]});
  }
  std::ranges::sort(boundary, {},
                    [](const auto& edge) { return std::pair(std::min(edge[0], edge[1]), std::max(edge[0], edge[1])); });
  return boundary;
}

// What the selections on one body have in common.
struct Body {
  const ShellMesh& mesh;
  std::vector<std::array<Index, 2>> boundary;
  std::vector<char> used;  // by a triangle: loose vertices carry nothing
  double tolerance = 0;

  explicit Body(const ShellMesh& shell)
      : mesh(shell),
        boundary(boundary_of(shell)),
        used(shell.vertices.size(), 0),
        tolerance(region_tolerance * diagonal(flat_facets(shell))) {
    for (const auto& triangle : shell.triangles) {
      for (const Index v : triangle) {
        used[v] = 1;
      }
    }
  }

  template <typename Predicate>
  [[nodiscard]] std::vector<Index> nodes_where(const Predicate& inside) const {
    std::vector<Index> nodes;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      if (used[v] != 0 && inside(mesh.vertices[v])) {
        nodes.push_back(narrow<Index>(v));
      }
    }
    return nodes;
  }
};

std::vector<Index> select(const Body& body, const AllNodes&, const Place&) {
  return body.nodes_where([](const Vec3&) { return true; });
}

std::vector<Index> select(const Body& body, const BoundaryNodes&, const Place& place) {
  if (body.boundary.empty()) {
    throw InputError(place.text + ": the body is closed and has no boundary: use rigid-motions, or select nodes");
  }
  return boundary_nodes(body.boundary);
}

std::vector<Index> select(const Body&, const RigidMotions&, const Place&) {
  TUNICA_ASSERT(false && "rigid motions are no nodes");
  return {};
}

std::vector<Index> select(const Body& body, const BoxNodes& box, const Place&) {
  return body.nodes_where([&](const Vec3& p) {
    return (p.array() >= box.lower.array() - body.tolerance).all() &&
           (p.array() <= box.upper.array() + body.tolerance).all();
  });
}

std::vector<Index> select(const Body& body, const HalfSpaceNodes& half, const Place&) {
  return body.nodes_where([&](const Vec3& p) {
    const double above = p[half.axis] - half.at;
    return (half.below ? above : -above) <= body.tolerance;
  });
}

std::vector<Index> select(const Body& body, const SphereNodes& sphere, const Place&) {
  return body.nodes_where([&](const Vec3& p) { return (p - sphere.centre).norm() <= sphere.radius + body.tolerance; });
}

std::vector<Index> select(const Body& body, const ListedNodes& list, const Place& place) {
  std::set<Index> nodes;
  for (const Index node : list.nodes) {
    if (node >= body.mesh.vertices.size()) {
      throw InputError(fmt::format("{}: there is no node {}: the body has {} (0 to {})", place.text, node,
                                   body.mesh.vertices.size(), body.mesh.vertices.size() - 1));
    }
    if (!nodes.insert(node).second) {
      throw InputError(fmt::format("{}: node {} is listed twice", place.text, node));
    }
  }
  return {nodes.begin(), nodes.end()};
}

std::vector<Index> select(const Body& body, const NearestNode& nearest, const Place&) {
  std::optional<Index> best;
  for (std::size_t v = 0; v < body.mesh.vertices.size(); ++v) {
    const auto squared_distance = [&](std::size_t node) {
      return (body.mesh.vertices[node] - nearest.point).squaredNorm();
    };
    if (body.used[v] != 0 && (!best || squared_distance(v) < squared_distance(*best))) {
      best = narrow<Index>(v);
    }
  }
  return best ? std::vector<Index>{*best} : std::vector<Index>{};
}

std::vector<Index> nodes_of(const Body& body, const Selection& where, const Places& places) {
  const Place& place = places.of("where");
  std::vector<Index> nodes = std::visit([&](const auto& form) { return select(body, form, place); }, where);
  if (nodes.empty()) {
    const Box box = bounding_box(flat_facets(body.mesh));
    throw InputError(fmt::format(
        "{}: selects no node: the body reaches from ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) mm",
        place.text, box.lower.x(), box.lower.y(), box.lower.z(), box.upper.x(), box.upper.y(), box.upper.z()));
  }
  return nodes;
}

std::vector<std::array<Index, 2>> edges_of(const Body& body, const std::vector<Index>& nodes, const Places& places) {
  std::vector<std::array<Index, 2>> edges;
  const std::set<Index> chosen(nodes.begin(), nodes.end());
  for (const auto& edge : body.boundary) {
    if (chosen.count(edge[0]) != 0 && chosen.count(edge[1]) != 0) {
      edges.push_back(edge);
    }
  }
  if (edges.empty()) {
    throw InputError(fmt::format("{}: no boundary edge has both its ends among the {} selected nodes",
                                 places.of("where").text, nodes.size()));
  }
  return edges;
}

// The facets as they are: every corner carries its facet's normal, so the patches are flat. Node normals are the
// area-weighted means.
void make_flat(ShellMesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Vec3::Zero());
  mesh.corner_normals.clear();
  mesh.corner_normals.reserve(mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    const Vec3 area = (mesh.vertices[triangle[1]] - mesh.vertices[triangle[0]])
                          .cross(mesh.vertices[triangle[2]] - mesh.vertices[triangle[0]]);
    const Vec3 normal = area.stableNormalized();
    mesh.corner_normals.push_back({normal, normal, normal});
    for (const Index v : triangle) {
      mesh.normals[v] += area;
    }
  }
  for (Vec3& normal : mesh.normals) {
    normal = normal.squaredNorm() > 0 ? Vec3(normal.stableNormalized()) : Vec3::UnitZ();
  }
}

// Where a body, fix or load was said; on the command line all is of one mesh.
std::string said_at(const Place& place, const SceneShell& shell) {
  return place.flag ? shell.mesh.string() : place.text;
}

struct BodyMesh {
  MeshFile file;
  bool curved = false;
  ShellMesh shell;
};

BodyMesh read_body_mesh(const SceneShell& shell) {
  const auto read = [&] {
    BodyMesh mesh{read_mesh(shell.mesh, shell.unit_mm, true), false, {}};
    const MeshFile& file = mesh.file;
    require_no_other_unit(file, shell.unit_mm, shell.mesh);
    mesh.curved = shell.rest == Rest::curved && !(file.normals.empty() && file.corner_normals.empty());
    mesh.shell = mesh.curved
                     ? shell_of(file, shell.mesh)
                     : ShellMesh{file.mesh.vertices, file.mesh.triangles, {}, {}, file.patch.value_or(Patch::comas)};
    return mesh;
  };
  if (shell.places.item.flag) {
    return read();
  }
  try {
    return read();
  } catch (const UsageError&) {
    throw InputError(fmt::format("{}: {} is in a format that carries no unit of length: add unit = \"mm\" beside mesh",
                                 shell.places.of("mesh").text, shell.mesh.string()));
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", shell.places.of("mesh").text, error.what()));
  }
}

// One value per vertex, in the order of the file.
std::vector<double> thickness_of(const SceneShell& shell, const MeshFile& file) {
  if (!shell.thickness_from) {
    return {shell.thickness};
  }
  const Place& place = shell.places.of("thickness_from");
  std::vector<std::string> names;
  for (const auto& [name, values] : file.vertex_properties) {
    if (name == *shell.thickness_from) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        require(positive(values[i]), place,
                fmt::format("{}: '{}' is {} mm at vertex {}: a thickness must be greater than zero",
                            shell.mesh.string(), name, values[i], i));
      }
      return values;
    }
    names.push_back(name);
  }
  place.fail(fmt::format("{}: has no number '{}' at each vertex (a PLY property): {}{}", shell.mesh.string(),
                         *shell.thickness_from, names.empty() ? "it has none" : "it has ", fmt::join(names, ", ")));
}

ShellBody load_body(const SceneShell& shell, std::vector<std::string>& notes) {
  BodyMesh read = read_body_mesh(shell);
  ShellBody body;
  body.name = shell.name;
  body.said_at = said_at(shell.places.item, shell);
  body.curved = read.curved;
  body.mesh = std::move(read.shell);
  for (Vec3& vertex : body.mesh.vertices) {
    vertex *= shell.scale;
  }
  if (!body.curved) {
    make_flat(body.mesh);
    if (shell.rest == Rest::curved) {
      notes.push_back(
          fmt::format("{}: has no normals, so its flat facets are the shell (as rest = \"flat\"); "
                      "tunica-relax makes curved shells",
                      shell.mesh.string()));
    }
  }
  body.thickness = thickness_of(shell, read.file);
  body.material = shell.material;
  body.membrane = shell.membrane;
  body.bending = shell.bending;
  body.rest = body.curved ? Rest::curved : Rest::flat;
  return body;
}

// Where the run looks for the factor of the loads, there must be some.
void require_load(const Scene& scene) {
  const bool buckles = std::holds_alternative<BucklingRun>(scene.run.kind);
  if (!buckles && !std::holds_alternative<ArcLengthRun>(scene.run.kind)) {
    return;
  }
  const auto prescribes = [](const SceneFix& fix) { return fix.displacement && !fix.displacement->isZero(0); };
  require(
      !scene.loads.empty() || std::any_of(scene.fixes.begin(), scene.fixes.end(), prescribes),
      scene.run_places.of(buckles ? "kind" : "control"),
      fmt::format("{} needs a load or a prescribed displacement: add a [[load]]", buckles ? "buckling" : "arc length"));
}

Load resolve_load(const SceneLoad& load, const SceneShell& shell, std::size_t body_number, const Body& body) {
  Load result{body_number, load.kind, load.ramp, said_at(load.places.item, shell)};
  if (load.where) {
    const std::vector<Index> nodes = nodes_of(body, *load.where, load.places);
    if (auto* force = std::get_if<ForceLoad>(&result.kind)) {
      force->nodes = nodes;
    } else if (auto* moment = std::get_if<MomentLoad>(&result.kind)) {
      moment->nodes = nodes;
    } else if (auto* edge = std::get_if<EdgeLoad>(&result.kind)) {
      edge->edges = edges_of(body, nodes, load.places);
    }
  }
  return result;
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
    require(
        body != scene.shells.end(), places.of("target"),
        fmt::format("there is no body \"{}\": the bodies are \"{}\"", name, fmt::join(body_names(scene), "\", \"")));
  }
  const bool known = std::any_of(scene.probes.begin(), scene.probes.end(),
                                 [&](const SceneProbe& probe) { return probe.name == asked.probe; });
  require(asked.of != Quantity::probe || known, places.of("of"),
          fmt::format("there is no [[probe]] \"{}\": add it, or name another", asked.probe));
  // A finer mesh has nodes between those of a list, of which the list says nothing.
  const auto refuse_list = [](const std::optional<Selection>& where, const Places& of) {
    require(
        !where || !std::holds_alternative<ListedNodes>(*where), of.of("where"),
        "a list of nodes holds for one mesh, and an accuracy takes finer ones: select by place (box, below, sphere, "
        "nearest …)");
  };
  for (const SceneFix& fix : scene.fixes) {
    refuse_list(fix.where, fix.places);
  }
  for (const SceneLoad& load : scene.loads) {
    refuse_list(load.where, load.places);
  }
}

}  // namespace

void Place::fail(const std::string& what) const {
  const std::string message = text + ": " + what;
  if (flag) {
    throw UsageError(message);
  }
  throw InputError(message);
}

const Place& Places::of(std::string_view key) const {
  const auto found = keys.find(key);
  return found == keys.end() ? item : found->second;
}

std::vector<double> equal_load_factors(std::size_t steps) {
  std::vector<double> factors;
  for (std::size_t i = 1; i <= steps; ++i) {
    factors.push_back(real(i) / real(steps));
  }
  return factors;
}

void settle_solver(Scene& scene) {
  RunSettings& run = scene.run;
  if (!scene.cg_tolerance_stated && !run.cg_iterations) {
    return;
  }
  if (run.solver == Solver::direct) {
    scene.run_places.of(scene.cg_tolerance_stated ? "cg_tolerance" : "cg_iterations")
        .fail("a direct solver has no CG settings: remove them, or choose solver cg");
  }
  run.solver = Solver::cg;
  run.cg_fixed_count = !scene.cg_tolerance_stated;
  if (run.cg_fixed_count && !scene.run_places.keys.contains("newton_max")) {
    run.newton_max = 1;  // the paper's: one linearisation per step, and that many iterations
  }
}

void settle_until(Scene& scene) {
  auto* path = std::get_if<ArcLengthRun>(&scene.run.kind);
  if (path == nullptr || !path->until) {
    return;
  }
  const auto found = std::find_if(scene.probes.begin(), scene.probes.end(),
                                  [&](const SceneProbe& probe) { return probe.name == scene.until_probe; });
  if (found == scene.probes.end()) {
    scene.run_places.of("until").fail(
        fmt::format("there is no [[probe]] \"{}\": add it, or name another", scene.until_probe));
  }
  path->until->probe = narrow<std::size_t>(found - scene.probes.begin());
}

void check_scene(const Scene& scene) {
  check_run(scene);
  const std::string_view needs_density = std::holds_alternative<DynamicRun>(scene.run.kind) ? "a dynamic run"
                                         : std::holds_alternative<FrequencyRun>(scene.run.kind)
                                             ? "a run for frequencies"
                                             : "";
  if (scene.shells.empty()) {
    throw InputError(scene.run_places.item.text + ": the scene has no [[shell]]: add one");
  }
  std::set<std::string> names;
  for (const SceneShell& shell : scene.shells) {
    check_shell(shell, needs_density);
    require(names.insert(shell.name).second, shell.places.of("name"),
            fmt::format("there are two bodies named \"{}\"", shell.name));
  }
  for (const SceneFix& fix : scene.fixes) {
    check_fix(scene, fix);
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
    const SceneShell& shell = scene.shells[body_index(scene, load.body, load.places)];
    require(!std::holds_alternative<GravityLoad>(load.kind) || shell.material.density, shell.places.item,
            fmt::format("[[shell]] \"{}\" has no density: its gravity load needs it", shell.name));
  }
  names.clear();
  for (const SceneProbe& probe : scene.probes) {
    check_probe_name(probe);
    (void)body_index(scene, probe.body, probe.places);
    require(names.insert(probe.name).second, probe.places.of("name"),
            fmt::format("there are two probes named \"{}\"", probe.name));
  }
  if (scene.accuracy) {
    check_accuracy(scene);
  }
}

LoadedScene load_scene(const Scene& scene) {
  require_load(scene);
  LoadedScene loaded;
  loaded.notes = scene.notes;
  std::vector<ShellBody> bodies;
  for (const SceneShell& shell : scene.shells) {
    bodies.push_back(load_body(shell, loaded.notes));
  }
  loaded.model = resolve_scene(scene, std::move(bodies));
  return loaded;
}

Model resolve_scene(const Scene& scene, std::vector<ShellBody> shells) {
  Model model;
  model.shells = std::move(shells);
  std::vector<Body> bodies;
  for (const ShellBody& shell : model.shells) {
    bodies.emplace_back(shell.mesh);
  }
  for (const SceneFix& fix : scene.fixes) {
    const std::size_t b = body_index(scene, fix.body, fix.places);
    if (std::holds_alternative<RigidMotions>(fix.where)) {
      model.rigid_motions.push_back({b});
    } else {
      model.fixes.push_back({b, nodes_of(bodies[b], fix.where, fix.places), fix.translation, fix.rotation,
                             fix.displacement.value_or(Vec3::Zero()), fix.ramp,
                             said_at(fix.places.item, scene.shells[b])});
    }
  }
  for (const SceneLoad& load : scene.loads) {
    const std::size_t b = body_index(scene, load.body, load.places);
    model.loads.push_back(resolve_load(load, scene.shells[b], b, bodies[b]));
  }
  for (const SceneProbe& probe : scene.probes) {
    const std::size_t b = body_index(scene, probe.body, probe.places);
    model.probes.push_back({probe.name, b, nodes_of(bodies[b], NearestNode{probe.nearest}, probe.places).front()});
  }
  return model;
}

}  // namespace tunica
