#include "tunica/io/scene/scene.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/io/scene/detail/body_files.hpp"
#include "tunica/io/scene/detail/scene_names.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>

namespace tunica {
namespace {

// Where the run looks for the factor of the loads, there must be some.
void require_load(const Scene& scene) {
  const bool buckles = std::holds_alternative<BucklingRun>(scene.run.kind);
  if (!buckles && !std::holds_alternative<ArcLengthRun>(scene.run.kind)) {
    return;
  }
  const auto prescribes = [](const SceneFix& fix) { return fix.displacement && !fix.displacement->isZero(0); };
  scene.run_places.of(buckles ? "kind" : "control")
      .require(!scene.loads.empty() || std::any_of(scene.fixes.begin(), scene.fixes.end(), prescribes),
               fmt::format("{} needs a load or a prescribed displacement: add a [[load]]",
                           buckles ? "buckling" : "arc length"));
}

// Where a fix or load was said; on the command line all is of one mesh.
std::string said_at(const Scene& scene, const Place& place) {
  return place.flag ? scene.shells.front().mesh.string() : place.text;
}

Load resolve_load(const Scene& scene, const SceneLoad& load, std::size_t body_number, const SelectableBody& body) {
  Load result{body_number, load.kind, load.ramp, said_at(scene, load.places.item)};
  if (load.where) {
    const std::string& where = load.places.of("where").text;
    if (auto* pressure = std::get_if<PressureLoad>(&result.kind)) {
      pressure->shares = shares_of(body, *load.where, where);
    } else if (auto* force = std::get_if<ForceLoad>(&result.kind)) {
      force->nodes = nodes_of(body, *load.where, where);
    } else if (auto* moment = std::get_if<MomentLoad>(&result.kind)) {
      moment->nodes = nodes_of(body, *load.where, where);
    } else if (auto* edge = std::get_if<EdgeLoad>(&result.kind)) {
      SelectedEdges selected = edges_of(body, *load.where, where);
      edge->edges = std::move(selected.edges);
      edge->shares = std::move(selected.shares);
    }
  }
  return result;
}

// A fix per rim.
void resolve_slide(const SceneFix& fix, std::size_t number, const SelectableBody& body, const std::string& said_at,
                   Model& model) {
  const std::string& where = fix.places.of("where").text;
  for (Rim& rim : rims_within(body, nodes_of(body, fix.where, where), where)) {
    Fix slide;
    slide.body = number;
    slide.nodes = std::move(rim.nodes);
    slide.said_at = said_at;
    slide.across = rim.normal;
    model.fixes.push_back(std::move(slide));
  }
}

// Where a body lies in a bed or slides on rims, and nothing else holds it, what these leave is held by rigid motions.
void hold_the_rest(const Scene& scene, Model& model) {
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const auto names = [&](const auto& item) { return item.body == b; };
    const bool held = std::ranges::any_of(model.fixes, [&](const Fix& fix) { return names(fix) && !fix.across; });
    const bool partly = std::ranges::any_of(model.fixes, names) || std::ranges::any_of(model.supports, names);
    const bool touched = std::ranges::any_of(scene.attachments, [&](const SceneAttach& attach) {
      return attach.body == scene.shells[b].name || attach.to == scene.shells[b].name;
    });
    if (partly && !held && !touched && std::ranges::none_of(model.rigid_motions, names)) {
      model.rigid_motions.push_back({b});
    }
  }
}

std::vector<Index> attached_nodes(const Model& model, const SceneAttach& attach, std::size_t to,
                                  const SelectableBody& body) {
  const std::string& where = attach.places.of("where").text;
  const auto* touching = std::get_if<TouchingNodes>(&attach.where);
  if (touching == nullptr) {
    return nodes_of(body, attach.where, where);
  }
  return model.is_solid(to) ? nodes_touching(body, touching->distance, model.solids[to - model.shells.size()], where)
                            : nodes_touching(body, touching->distance, model.shells[to], attach.side, where,
                                             attach.places.of("to").text);
}

// A node goes where one body carries it: no other may, and no fix hold it. Only of resolved fixes.
void resolve_attachments(const Scene& scene, const std::vector<SelectableBody>& bodies, Model& model) {
  using Node = std::pair<std::size_t, Index>;
  std::map<Node, std::string> taken;  // what took the node
  for (const Fix& fix : model.fixes) {
    for (const Index node : fix.nodes) {
      taken.try_emplace({fix.body, node}, fmt::format("is held by the [[fix]] at {}", fix.said_at));
    }
  }
  for (const SceneAttach& attach : scene.attachments) {
    const std::size_t b = body_index(scene, attach.body, attach.places, "body");
    const std::size_t to = body_index(scene, attach.to, attach.places, "to");
    const std::string& place = attach.places.item.text;
    Attachment result{b, attached_nodes(model, attach, to, bodies[b]), to, attach.side, place};
    for (const Index node : result.nodes) {
      const auto [before, fresh] =
          taken.try_emplace({b, node}, fmt::format("is carried by \"{}\" already, see {}", attach.to, place));
      attach.places.of("where").require(
          fresh, fmt::format("node {} of \"{}\" {}: select others", node, attach.body, before->second));
    }
    model.attachments.push_back(std::move(result));
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

void Place::fail_later(const std::string& what) const {
  throw UsageError(fmt::format("{}: {}: not available yet", text, what));
}

const Place& Places::of(std::string_view key) const {
  const auto found = keys.find(key);
  return found == keys.end() ? item : found->second;
}

std::vector<std::string> deforming_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const SceneShell& shell : scene.shells) {
    names.push_back(shell.name);
  }
  for (const SceneSolid& solid : scene.solids) {
    names.push_back(solid.name);
  }
  return names;
}

std::size_t body_index(const Scene& scene, const std::string& name, const Places& places, std::string_view key) {
  const std::vector<std::string> names = deforming_names(scene);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) {
    return narrow<std::size_t>(found - names.begin());
  }
  places.of(key).require(!rigid_index(scene, name),
                         fmt::format("\"{}\" is rigid and moves by its own motion: the bodies that deform are \"{}\"",
                                     name, fmt::join(names, "\", \"")));
  places.of(key).fail(fmt::format("there is no body \"{}\": the bodies are \"{}\"", name, fmt::join(names, "\", \"")));
}

std::optional<std::size_t> rigid_index(const Scene& scene, std::string_view name) {
  const auto found = std::ranges::find(scene.rigids, name, &SceneRigid::name);
  return found == scene.rigids.end() ? std::nullopt : std::optional(narrow<std::size_t>(found - scene.rigids.begin()));
}

ContactParty party_named(const Scene& scene, const std::string& name, const Place& place) {
  if (const auto rigid = rigid_index(scene, name)) {
    return {true, *rigid};
  }
  std::vector<std::string> names = deforming_names(scene);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    for (const SceneRigid& rigid : scene.rigids) {
      names.push_back(rigid.name);
    }
    place.fail(fmt::format("there is no body \"{}\": the bodies are \"{}\"", name, fmt::join(names, "\", \"")));
  }
  return {false, narrow<std::size_t>(found - names.begin())};
}

std::vector<std::filesystem::path> mesh_files(const Scene& scene) {
  std::vector<std::filesystem::path> files;
  const auto add = [&](const std::filesystem::path& path) {
    if (std::find(files.begin(), files.end(), path) == files.end()) {
      files.push_back(path);
    }
  };
  for (const SceneShell& shell : scene.shells) {
    add(shell.mesh);
  }
  for (const SceneSolid& solid : scene.solids) {
    add(solid.mesh);
  }
  for (const SceneRigid& rigid : scene.rigids) {
    if (const auto* mesh = std::get_if<SceneRigidMesh>(&rigid.shape)) {
      add(mesh->mesh);
    }
  }
  return files;
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
  if (!scene.until) {
    return;
  }
  const auto found = std::ranges::find(scene.probes, scene.until->probe, &SceneProbe::name);
  if (found == scene.probes.end()) {
    scene.run_places.of("until").fail(
        fmt::format("there is no [[probe]] \"{}\": add it, or name another", scene.until->probe));
  }
  std::get<ArcLengthRun>(scene.run.kind).until = {narrow<std::size_t>(found - scene.probes.begin()), scene.until->axis,
                                                  scene.until->reaches};
}

namespace {

/// A point that is meant to name a node and lies far from all: its unit, its axes or its sign may be another one.
void warn_of_far_point(const Vec3& point, std::size_t body, const Place& place, const Model& model,
                       std::vector<Warning>& warnings) {
  constexpr double far_from_all = 0.1;  // of the diagonal of the body's box
  Eigen::AlignedBox3d box;
  double distance = infinity;
  for (const Vec3& p : model.vertices_of(body)) {
    box.extend(p);
    distance = std::min(distance, (p - point).norm());
  }
  if (distance > far_from_all * box.diagonal().norm()) {
    const Vec3 low = box.min(), high = box.max();
    warnings.push_back(
        {Weight::minor, "far point",
         fmt::format("{}: the nearest node lies {:.4g} mm from this point, and the body reaches from "
                     "({:.4g}, {:.4g}, {:.4g}) to ({:.4g}, {:.4g}, {:.4g}) mm: check the point's unit and "
                     "axes",
                     place.text, distance, low.x(), low.y(), low.z(), high.x(), high.y(), high.z())});
  }
}

void warn_of_far_points(const Scene& scene, const Model& model, std::vector<Warning>& warnings) {
  for_each_where(scene, [&](const auto& item, const std::optional<Selection>& where) {
    if (const auto* nearest = where ? std::get_if<NearestNode>(&*where) : nullptr) {
      warn_of_far_point(nearest->point, body_index(scene, item.body, item.places), item.places.item, model, warnings);
    }
  });
  for (const SceneProbe& probe : scene.probes) {
    warn_of_far_point(probe.nearest, body_index(scene, probe.body, probe.places), probe.places.item, model, warnings);
  }
}

/// A region that is small beside the shells it lies on: its force is that of the region, its place is theirs.
void warn_of_small_region(const Model& model, std::size_t body, const std::vector<double>& shares,
                          const std::string& place, std::vector<Warning>& warnings) {
  constexpr double small = 0.5;
  double inside = 0, touched = 0;
  for (std::size_t t = 0; body < model.shells.size() && t < shares.size(); ++t) {
    const ShellMesh& mesh = model.shells[body].mesh;
    const auto& [a, b, c] = mesh.triangles[t];
    const double area = triangle_area(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
    inside += shares[t] * area;
    touched += shares[t] > 0 ? area : 0;
  }
  if (inside < small * touched) {
    warnings.push_back(
        {Weight::minor, "small region",
         fmt::format("{}: the region is small beside the shells: what acts there is spread over shells of "
                     "{:.2g} times its area; smaller shells there (more of them) place it better",
                     place, touched / inside)});
  }
}

/// Whether most of the line that attached nodes make lies within triangles of a shell, away from their edges.
bool lies_within(const TriangleMesh& facets, const ShellMesh& carried, const std::vector<Index>& nodes) {
  constexpr double on_edge = 0.1;  // of the height over it; a middle may lie on a diagonal
  const std::set<Index> attached(nodes.begin(), nodes.end());
  const ClosestPoint closest(facets);
  std::size_t sides = 0, within = 0;
  for (const auto& triangle : carried.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = triangle[k], b = triangle[(k + 1) % 3];
      if (!attached.contains(a) || !attached.contains(b)) {
        continue;
      }
      const ClosestPoint::Hit hit = closest.closest(0.7 * carried.vertices[a] + 0.3 * carried.vertices[b]);
      const auto& [x, y, z] = facets.triangles[hit.triangle];
      const Vec3 corners[3] = {facets.vertices[x], facets.vertices[y], facets.vertices[z]};
      double least = infinity;
      for (std::size_t l = 0; l < 3; ++l) {
        least = std::min(least, triangle_area(corners[l], corners[(l + 1) % 3], hit.point));
      }
      ++sides;
      within += least > on_edge * triangle_area(corners[0], corners[1], corners[2]) ? 1 : 0;
    }
  }
  return 2 * within > sides;
}

/// Of nodes that make no whole triangle, along a rim or a line. A solid lets them turn, so that they are a hinge; a
/// shell bends along its edges, not within.
void warn_of_joint(const Model& model, const Attachment& attachment, std::vector<Warning>& warnings) {
  if (model.is_solid(attachment.body) || attachment.nodes.size() < 2) {
    return;
  }
  const std::vector<double> whole = whole_triangles(model.shells[attachment.body].mesh.triangles, attachment.nodes);
  if (std::ranges::any_of(whole, [](double share) { return share != 0; })) {
    return;
  }
  if (!model.is_solid(attachment.to)) {
    const TriangleMesh facets = flat_facets(model.shells[attachment.to].mesh);
    if (lies_within(facets, model.shells[attachment.body].mesh, attachment.nodes)) {
      warnings.push_back({Weight::note, "joint within shells",
                          fmt::format("{}: the nodes that are carried lie along a line within shells of {}, which do "
                                      "not bend there: the joint is too stiff by what bends over a length like theirs; "
                                      "let nodes of {} lie along the line, or take finer shells there",
                                      attachment.said_at, model.name_of(attachment.to), model.name_of(attachment.to))});
    }
  } else {
    warnings.push_back(
        {Weight::major, "hinge",
         fmt::format("{}: the nodes that are carried lie along a line, and a solid lets them turn: the joint "
                     "is a hinge, which bears no bending; to clamp it let the bodies overlap by a shell "
                     "or more, and attach all of that strip",
                     attachment.said_at)});
  }
}

}  // namespace

LoadedScene load_scene(const Scene& scene) {
  require_load(scene);
  BodyFindings found;
  found.warnings = scene.warnings;
  SceneBodies bodies;
  for (const SceneShell& shell : scene.shells) {
    bodies.shells.push_back(load_shell(shell, found));
  }
  for (const SceneSolid& solid : scene.solids) {
    bodies.solids.push_back(load_solid(solid, found));
  }
  for (const SceneRigid& rigid : scene.rigids) {
    bodies.rigids.push_back(load_rigid(rigid, found));
  }
  LoadedScene loaded{resolve_scene(scene, std::move(bodies)), std::move(found.warnings), found.space};
  warn_of_far_points(scene, loaded.model, loaded.warnings);
  // The levels of an accuracy place a region better and better, and say by how much its area still changes.
  for (std::size_t i = 0; !scene.accuracy && i < loaded.model.supports.size(); ++i) {
    const Support& support = loaded.model.supports[i];
    warn_of_small_region(loaded.model, support.body, support.shares, support.said_at, loaded.warnings);
  }
  for (const Load& load : loaded.model.loads) {
    if (const auto* const pressure = std::get_if<PressureLoad>(&load.kind); pressure != nullptr && !scene.accuracy) {
      warn_of_small_region(loaded.model, load.body, pressure->shares, load.said_at, loaded.warnings);
    }
  }
  for (const Attachment& attachment : loaded.model.attachments) {
    warn_of_joint(loaded.model, attachment, loaded.warnings);
  }
  std::vector<bool> is_looked_at(loaded.model.shells.size(), false);
  for (const Load& load : loaded.model.loads) {
    const auto* const pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure != nullptr && load.body < is_looked_at.size() && !is_looked_at[load.body]) {
      is_looked_at[load.body] = true;
      const ShellMesh& mesh = loaded.model.shells[load.body].mesh;
      std::ranges::copy(
          pressed_side_warnings({mesh.vertices, mesh.triangles}, pressure->value, scene.shells[load.body].mesh),
          std::back_inserter(loaded.warnings));
    }
  }
  return loaded;
}

Model resolve_scene(const Scene& scene, std::vector<ShellBody> shells) {
  return resolve_scene(scene, SceneBodies{std::move(shells), {}, {}});
}

Model resolve_scene(const Scene& scene, SceneBodies parts) {
  Model model;
  model.shells = std::move(parts.shells);
  model.solids = std::move(parts.solids);
  model.rigids = std::move(parts.rigids);
  std::vector<SelectableBody> bodies;
  for (const ShellBody& shell : model.shells) {
    bodies.emplace_back(shell);
  }
  for (const SolidBody& solid : model.solids) {
    bodies.emplace_back(solid);
  }
  for (const SceneFix& fix : scene.fixes) {
    const std::size_t b = body_index(scene, fix.body, fix.places);
    if (std::holds_alternative<RigidMotions>(fix.where)) {
      model.rigid_motions.push_back({b});
    } else if (fix.slide) {
      resolve_slide(fix, b, bodies[b], said_at(scene, fix.places.item), model);
    } else {
      model.fixes.push_back({b, nodes_of(bodies[b], fix.where, fix.places.of("where").text), fix.translation,
                             fix.rotation, fix.displacement.value_or(Vec3::Zero()), fix.ramp,
                             said_at(scene, fix.places.item)});
    }
  }
  for (const SceneSupport& support : scene.supports) {
    const std::size_t b = body_index(scene, support.body, support.places);
    std::vector<double> shares =
        shares_of(bodies[b], support.where.value_or(AllNodes{}), support.places.of("where").text);
    model.supports.push_back(
        {b, std::move(shares), support.stiffness, support.normal_only, said_at(scene, support.places.item)});
  }
  hold_the_rest(scene, model);
  for (const SceneLoad& load : scene.loads) {
    const std::size_t b = body_index(scene, load.body, load.places);
    model.loads.push_back(resolve_load(scene, load, b, bodies[b]));
  }
  resolve_attachments(scene, bodies, model);
  for (const SceneContact& contact : scene.contacts) {
    const Place& place = contact.places.of("between");
    model.contacts.push_back(
        {contact.name,
         {party_named(scene, contact.between[0], place), party_named(scene, contact.between[1], place)},
         contact.friction,
         contact.resolution,
         contact.curved,
         contact.consistent,
         contact.places.item.text});
  }
  for (const SceneProbe& probe : scene.probes) {
    const std::size_t b = body_index(scene, probe.body, probe.places);
    model.probes.push_back(
        {probe.name, b, nodes_of(bodies[b], NearestNode{probe.nearest}, probe.places.of("where").text).front()});
  }
  return model;
}

}  // namespace tunica
