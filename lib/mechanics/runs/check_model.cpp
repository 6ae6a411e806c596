#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/mechanics/runs/detail/prestress.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <unordered_map>

namespace tunica {
namespace {

std::string place(const Vec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g}) mm", p.x(), p.y(), p.z()); }

/// What a message begins with.
[[noreturn]] void refuse(const std::string& said_at, const std::string& name, const std::string& what) {
  throw InputError(fmt::format("{}: {}", named(said_at, name), what));
}

[[noreturn]] void refuse(const ShellBody& body, const std::string& what) { refuse(body.said_at, body.name, what); }

[[noreturn]] void refuse(const Model& model, std::size_t body, const std::string& what) {
  refuse(model.is_solid(body) ? model.solids[body - model.shells.size()].said_at : model.shells[body].said_at,
         model.name_of(body), what);
}

const Material& material_of(const Model& model, std::size_t body) {
  return model.is_solid(body) ? model.solids[body - model.shells.size()].material : model.shells[body].material;
}

bool is_finite(double value) { return std::isfinite(value); }
bool is_finite(const Vec3& value) { return value.allFinite(); }

/// Times increase, and what is said of them is finite.
template <typename Value>
bool is_table(const std::vector<std::pair<double, Value>>& points) {
  double before = -infinity;
  for (const auto& [time, value] : points) {
    if (!std::isfinite(time) || time <= before || !is_finite(value)) {
      return false;
    }
    before = time;
  }
  return true;
}

void check_material(const Material& material, double largest_poisson, const std::string& of) {
  if (!(material.young > 0) || !std::isfinite(material.young)) {
    throw InputError(fmt::format("{}: Young's modulus is {:.6g} MPa: it must be positive", of, material.young));
  }
  if (!(material.poisson > -1 && material.poisson <= largest_poisson)) {
    throw InputError(fmt::format("{}: Poisson's ratio is {:.6g}: it must be above -1 and at most {}", of,
                                 material.poisson, largest_poisson));
  }
  if (material.density && (!(*material.density > 0) || !std::isfinite(*material.density))) {
    throw InputError(of + ": the density must be positive");
  }
}

/// Also of nodes that no element has: they are counted in the body's size.
void check_places(const std::vector<Vec3>& nodes, const std::string& of) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!std::isfinite(nodes[i].squaredNorm())) {
      throw InputError(fmt::format("{}: the position of node {} is not finite, or too far out to reckon with", of, i));
    }
  }
}

void check_body(const ShellBody& body) {
  const ShellMesh& mesh = body.mesh;
  if (mesh.triangles.empty()) {
    refuse(body, "the shell has no triangles");
  }
  const std::string name = named(body.said_at, body.name);
  check_places(mesh.vertices, name);
  naming(name, [&] {
    if (body.curved) {
      require_valid(mesh);
    } else {
      require_corners(mesh.vertices.size(), mesh.triangles);
    }
  });
  check_material(body.material, 0.5, name);
  if (body.thickness.size() != 1 && body.thickness.size() != mesh.vertices.size()) {
    refuse(body, fmt::format("{} thicknesses for {} nodes: give one, or one per node", body.thickness.size(),
                             mesh.vertices.size()));
  }
  // Bending goes by the cube of the thickness, stretching by the thickness itself.
  constexpr double least_thinness = 1e-9;
  Vec3 low = mesh.vertices.front();
  Vec3 high = low;
  for (const Vec3& x : mesh.vertices) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  const double size = (high - low).maxCoeff();
  const double diagonal = (high - low).norm();
  for (std::size_t i = 0; i < body.thickness.size(); ++i) {
    if (!(body.thickness[i] > 0) || !std::isfinite(body.thickness[i])) {
      refuse(body, fmt::format("the thickness at node {} is {:.6g} mm: it must be positive", i, body.thickness[i]));
    }
    if (body.thickness[i] < least_thinness * size) {
      refuse(body,
             fmt::format("the thickness at node {} is {:.6g} mm, less than {:.0e} of the shell's size: its bending "
                         "stiffness would be lost in round-off",
                         i, body.thickness[i], least_thinness));
    }
    if (body.thickness[i] > diagonal) {
      refuse(body, fmt::format("the thickness at node {} is {:.6g} mm, more than the {:.6g} mm that the whole body "
                               "measures: it is no shell; is its unit right?",
                               i, body.thickness[i], diagonal));
    }
  }
}

void check_triangles(const ShellBody& body) {
  const ShellMesh& mesh = body.mesh;
  std::unordered_map<std::uint64_t, std::size_t> half_edges;
  std::unordered_map<std::uint64_t, int> edges;
  half_edges.reserve(3 * mesh.triangles.size());
  edges.reserve(3 * mesh.triangles.size());
  const auto key = [](Index a, Index b) { return (std::uint64_t{a} << 32) | b; };
  std::set<std::array<Index, 3>> seen;
  std::string inconsistent;  // said only when no third triangle meets there
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& v = mesh.triangles[t];
    const Vec3& a = mesh.vertices[v[0]];
    if (!has_area({a, mesh.vertices[v[1]], mesh.vertices[v[2]]})) {
      refuse(body, fmt::format("element {} (nodes {}, {}, {}) at {} is degenerate: it has no area; mend the mesh", t,
                               v[0], v[1], v[2], place(a)));
    }
    std::array<Index, 3> sorted = v;
    std::sort(sorted.begin(), sorted.end());
    if (!seen.insert(sorted).second) {
      refuse(body, fmt::format("element {} (nodes {}, {}, {}) at {} is there twice", t, v[0], v[1], v[2], place(a)));
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const Index from = v[k];
      const Index to = v[(k + 1) % 3];
      if (++edges[key(std::min(from, to), std::max(from, to))] > 2) {
        refuse(body, fmt::format("the edge between nodes {} and {} at {} is non-manifold: more than two elements meet "
                                 "there (one is {})",
                                 from, to, place(mesh.vertices[from]), t));
      }
      const auto [other, is_new] = half_edges.emplace(key(from, to), t);
      if (!is_new && inconsistent.empty()) {
        inconsistent = fmt::format(
            "elements {} and {} at {} have inconsistent orientation: the normals of one point "
            "inward; orient the mesh",
            other->second, t, place(mesh.vertices[from]));
      }
    }
  }
  if (!inconsistent.empty()) {
    refuse(body, inconsistent);
  }
  if (body.curved && body.rest == Rest::curved) {
    require_fit(mesh, named(body.said_at, body.name));
  }
}

/// Half a wall stands on either side of its middle.
void check_inner_face(const ShellBody& body) {
  constexpr double most_of_it = 0.5;
  if (const double share = share_without_inner_face(body); share > most_of_it) {
    refuse(body,
           fmt::format("its thickness, {:.6g} mm, is more than twice the radius of curvature over {:.0f} % of its "
                       "area, so that no inner face is left: is its unit right?",
                       *std::max_element(body.thickness.begin(), body.thickness.end()), 100 * share));
  }
}

/// All numbers of a load.
Vec3 numbers_of(const Load& load) {
  return std::visit(
      [](const auto& kind) -> Vec3 {
        if constexpr (requires { kind.imaged_at; }) {
          return {kind.value, kind.imaged_at.value_or(0), 0};
        } else if constexpr (requires { kind.total; }) {
          return kind.total;
        } else if constexpr (requires { kind.per_length; }) {
          return kind.per_length;
        } else if constexpr (requires { kind.per_area; }) {
          return kind.per_area;
        } else {
          return kind.acceleration;
        }
      },
      load.kind);
}

/// Parts of some triangles or edges. @param count  of these
void check_shares(const std::vector<double>& shares, std::size_t count, const std::string& of) {
  const auto is_share = [](double share) { return share >= 0 && share <= 1; };
  if (!shares.empty() && (shares.size() != count || !std::ranges::all_of(shares, is_share))) {
    throw InputError(fmt::format("{}: {} parts for {} triangles or edges: one from 0 to 1 for each is needed", of,
                                 shares.size(), count));
  }
  if (!shares.empty() && std::ranges::all_of(shares, [](double share) { return share == 0; })) {
    throw InputError(of + ": no part of a triangle or edge lies in the selection: select more");
  }
}

/// How many triangles the surface of a body has.
std::size_t face_count(const Model& model, std::size_t body) {
  return model.is_solid(body) ? boundary_triangles(model.solids[body - model.shells.size()].mesh).size()
                              : model.shells[body].mesh.triangles.size();
}

void check_rigid(const RigidBody& body) {
  for (const auto& table : tables_of(body)) {
    if (table.points.empty() || !is_table(table.points)) {
      refuse(body.said_at, body.name,
             "a table of its shape or motion has no points, times that do not increase, or values that are not finite");
    }
  }
  const auto check_axis = [&](const Vec3& point, const Vec3& direction) {
    if (!point.allFinite() || !is_unit(direction)) {
      refuse(body.said_at, body.name, "an axis of its shape or motion has no unit vector, or no finite point");
    }
  };
  const auto refuse_negative = [&](const auto& shape) {
    if constexpr (requires { shape.radius; }) {
      if (std::ranges::any_of(shape.radius.points, [](const auto& point) { return point.second < 0; })) {
        refuse(body.said_at, body.name, "its radius is negative somewhere");
      }
    }
  };
  std::visit(refuse_negative, body.shape);
  if (const auto* plane = std::get_if<RigidPlane>(&body.shape)) {
    check_axis(Vec3::Zero(), plane->normal);
  } else if (const auto* mesh = std::get_if<RigidMesh>(&body.shape)) {
    naming(named(body.said_at, body.name), [&] { require_surface(mesh->surface); });
    if (mesh->turn) {
      check_axis(mesh->turn->point, mesh->turn->axis);
    }
    if (mesh->expansion) {
      check_axis(mesh->expansion->point, mesh->expansion->axis);
    }
  }
}

/// Contacts and attachments.
void check_meetings(const Model& model) {
  for (const Contact& contact : model.contacts) {
    for (const ContactParty& party : contact.between) {
      if (party.index >= (party.rigid ? model.rigids.size() : model.body_count())) {
        refuse(contact.said_at, contact.name,
               fmt::format("the contact names {}body {}, but there are {}", party.rigid ? "rigid " : "", party.index,
                           party.rigid ? model.rigids.size() : model.body_count()));
      }
    }
    if (contact.between[0].rigid && contact.between[1].rigid) {
      refuse(contact.said_at, contact.name, "two rigid bodies cannot be in contact");
    }
    naming(named(contact.said_at, contact.name), [&] {
      require_not_negative(contact.friction, "the friction");
      require_positive(contact.resolution, "the resolution");
    });
  }
  for (const Attachment& attachment : model.attachments) {
    for (const std::size_t body : {attachment.body, attachment.to}) {
      if (body >= model.body_count()) {
        refuse(attachment.said_at, "an attachment",
               fmt::format("it names body {}, but there are {}", body, model.body_count()));
      }
    }
    for (const Index i : attachment.nodes) {
      if (i >= model.vertices_of(attachment.body).size()) {
        refuse(
            model, attachment.body,
            fmt::format("an attachment names node {}, but there are {}", i, model.vertices_of(attachment.body).size()));
      }
    }
  }
}

/// Of a load or a fix.
void check_numbers(const Vec3& numbers, const Ramp& ramp, const std::string& of) {
  if (!numbers.allFinite()) {
    throw InputError(of + ": is not finite");
  }
  if (!is_table(ramp.points)) {
    throw InputError(of + ": the times of its ramp must increase, and its factors be finite");
  }
}

void check_selections(const Model& model) {
  const auto check = [&](std::size_t body, const std::vector<Index>& nodes, std::string_view what) {
    if (body >= model.body_count()) {
      throw InputError(fmt::format("a {} names body {}, but there are {}", what, body, model.body_count()));
    }
    if (nodes.empty()) {
      refuse(model, body, fmt::format("a {} selects no node", what));
    }
    for (const Index i : nodes) {
      if (i >= model.vertices_of(body).size()) {
        refuse(model, body,
               fmt::format("a {} names node {}, but there are {}", what, i, model.vertices_of(body).size()));
      }
    }
  };
  for (const Fix& fix : model.fixes) {
    check(fix.body, fix.nodes, "fix");
    check_numbers(fix.displacement, fix.ramp, named(fix.said_at, "this fix on " + model.name_of(fix.body)));
    if (fix.across && !is_unit(*fix.across)) {
      refuse(fix.said_at, "this fix on " + model.name_of(fix.body), "the plane of a slide has no unit normal");
    }
    if (fix.across && model.is_solid(fix.body)) {
      refuse(model, fix.body, "a slide is of the rims of shells, and this is a solid");
    }
  }
  for (const Support& support : model.supports) {
    check(support.body, {0}, "support");
    if (model.is_solid(support.body)) {
      refuse(model, support.body, "a bed supports shells, and this is a solid: hold it by a fix");
    }
    naming(named(support.said_at, "this support of " + model.name_of(support.body)),
           [&] { require_positive(support.stiffness, "the stiffness"); });
    check_shares(support.shares, model.shells[support.body].mesh.triangles.size(),
                 named(support.said_at, "this support of " + model.name_of(support.body)));
  }
  for (const RigidMotionsFix& fix : model.rigid_motions) {
    check(fix.body, {0}, "fix of the rigid motions");
  }
  for (const Load& load : model.loads) {
    check(load.body, {0}, "load");
    check_numbers(numbers_of(load), load.ramp, named(load.said_at, "this load on " + model.name_of(load.body)));
    std::visit(
        [&]<typename Kind>(const Kind& kind) {
          if constexpr (requires { kind.nodes; }) {
            check(load.body, kind.nodes, Kind::name);
          } else if constexpr (requires { kind.edges; }) {
            std::vector<Index> ends;
            for (const auto& edge : kind.edges) {
              ends.insert(ends.end(), edge.begin(), edge.end());
            }
            check(load.body, ends, "edge load");
          }
          if constexpr (requires { kind.shares; }) {
            std::size_t count = 0;
            if constexpr (requires { kind.edges; }) {
              count = kind.edges.size();
            } else {
              count = face_count(model, load.body);
            }
            check_shares(kind.shares, count, named(load.said_at, "this load on " + model.name_of(load.body)));
          }
        },
        load.kind);
    if (std::holds_alternative<GravityLoad>(load.kind) && !material_of(model, load.body).density) {
      refuse(model, load.body, "gravity acts on it, but it has no density");
    }
  }
  for (const Probe& probe : model.probes) {
    check(probe.body, {probe.node}, "probe");
  }
}

/// Norms take squares of loads, which have to be numbers.
void check_load_sizes(const Model& model, const RunSettings& settings) {
  const auto* run = std::get_if<StaticRun>(&settings.kind);
  for (const Load& load : model.loads) {
    double factor = load.ramp.points.empty() && run != nullptr ? run->load_factors.back() : 1;
    for (const auto& point : load.ramp.points) {
      factor = std::max(factor, std::abs(point.second));
    }
    const double most = factor * numbers_of(load).cwiseAbs().maxCoeff();
    if (!std::isfinite(most * most)) {
      throw InputError(
          named(load.said_at, fmt::format("this load on {}, with its ramp, is larger than any force: is its "
                                          "unit right?",
                                          model.name_of(load.body))));
    }
  }
}

constexpr double largest_solid_poisson = 0.4999;

void check_solid_bodies(const Model& model) {
  for (std::size_t b = model.shells.size(); b < model.body_count(); ++b) {
    const SolidBody& body = model.solids[b - model.shells.size()];
    if (body.mesh.tetrahedra.empty()) {
      refuse(model, b, "the solid has no tetrahedra");
    }
    const std::string name = named(body.said_at, body.name);
    check_places(body.mesh.vertices, name);
    naming(name, [&] { require_valid(body.mesh); });
    for (std::size_t t = 0; t < body.mesh.tetrahedra.size(); ++t) {
      const auto& [i, j, k, l] = body.mesh.tetrahedra[t];
      const std::vector<Vec3>& x = body.mesh.vertices;
      if (!(tet_volume(x[i], x[j], x[k], x[l]) > 0)) {
        refuse(model, b, fmt::format("tetrahedron {} at {} is inside out or has no volume", t, place(x[i])));
      }
    }
    check_material(body.material, largest_solid_poisson, name);
  }
}

void check_solids(const Model& model, const RunSettings& settings) {
  for (std::size_t b = model.shells.size(); b < model.body_count(); ++b) {
    if (settings.solver == Solver::cg) {
      refuse(model, b, "conjugate gradients cannot follow the pressure in a solid: use solver = \"direct\"");
    }
    if (std::holds_alternative<FrequencyRun>(settings.kind) || std::holds_alternative<BucklingRun>(settings.kind)) {
      refuse(model, b, "frequencies and buckling of solids are not available yet");
    }
    if (held_by_rigid_motions(model, b)) {
      refuse(model, b, "a solid cannot be held by its rigid motions yet: hold it by a fix");
    }
    const auto* dynamic = std::get_if<DynamicRun>(&settings.kind);
    if (dynamic != nullptr && dynamic->damping.stiffness > 0) {
      refuse(model, b, "damping by stiffness does not reach solids: remove it, or damp by mass");
    }
  }
}

void require_densities(const Model& model, const char* kind) {
  for (std::size_t b = 0; b < model.body_count(); ++b) {
    if (!material_of(model, b).density) {
      refuse(model, b, fmt::format("{} needs its density", kind));
    }
  }
}

void check_load_factors(const StaticRun& run) {
  double previous = 0;
  for (const double factor : run.load_factors) {
    if (!std::isfinite(factor) || factor <= previous) {
      throw InputError("the load factors must be positive and increase");
    }
    previous = factor;
  }
  if (run.load_factors.empty()) {
    throw InputError("a static run needs at least one load factor");
  }
}

void require_load(const Model& model, const char* kind) {
  if (!is_loaded(model)) {
    const std::string zero = model.loads.empty() ? "" : model.loads.front().said_at;
    throw InputError(fmt::format("{}{} needs a load or a prescribed displacement{}", zero.empty() ? "" : zero + ": ",
                                 kind, model.loads.empty() ? "" : ", and this is zero"));
  }
}

/// Whether a state of rest is looked for, so that nothing may move freely.
bool finds_rest(const Model& model, const RunSettings& settings) {
  return std::holds_alternative<StaticRun>(settings.kind) || std::holds_alternative<BucklingRun>(settings.kind) ||
         std::holds_alternative<ArcLengthRun>(settings.kind) ||
         (std::holds_alternative<FrequencyRun>(settings.kind) &&
          (!model.loads.empty() || std::any_of(model.fixes.begin(), model.fixes.end(), prescribes)));
}

void check_path(const Model& model, const ArcLengthRun& run) {
  require_load(model, "arc length");
  const auto ramped = [](const auto& item) { return !item.ramp.points.empty(); };
  if (std::any_of(model.loads.begin(), model.loads.end(), ramped) ||
      std::any_of(model.fixes.begin(), model.fixes.end(), ramped)) {
    throw InputError("arc length finds the load factor, so that no load can have a ramp over it: remove the ramps");
  }
  if (run.max_steps == 0 || !(run.first_factor > 0) || !std::isfinite(run.first_factor) ||
      (run.max_factor && (!(*run.max_factor > 0) || !std::isfinite(*run.max_factor)))) {
    throw InputError("arc length: max_steps must be at least 1, the first step and max_factor positive");
  }
  if (run.until && (run.until->probe >= model.probes.size() || run.until->axis < 0 || run.until->axis > 2 ||
                    !std::isfinite(run.until->reaches) || run.until->reaches == 0)) {
    throw InputError("arc length: until names a probe, an axis and a displacement other than zero");
  }
}

void check_run(const Model& model, const RunSettings& settings) {
  constexpr double most_steps = 9e15;  // to 2^53 a double counts them
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (const auto* dynamic = std::get_if<DynamicRun>(&settings.kind)) {
    if (!positive(dynamic->duration) || !positive(dynamic->step)) {
      throw InputError("a dynamic run needs a positive duration and a positive step");
    }
    require_not_negative(dynamic->damping.mass, "damping by mass");
    require_not_negative(dynamic->damping.stiffness, "damping by stiffness");
    if (!(dynamic->spectral_radius >= 0 && dynamic->spectral_radius <= 1)) {
      throw InputError(fmt::format("the spectral radius is {}: it must be from 0 to 1", dynamic->spectral_radius));
    }
    if (dynamic->adaptive) {
      require_positive(dynamic->adaptive->value, "the error of a step");
    }
    if (!(dynamic->duration / dynamic->step < most_steps)) {
      throw InputError("a dynamic run of more steps than can be counted: are the units of duration and step right?");
    }
    require_densities(model, "a dynamic run");
  } else if (const auto* frequencies = std::get_if<FrequencyRun>(&settings.kind)) {
    require_densities(model, "a run for frequencies");
    check_load_factors(frequencies->preload);
  } else if (std::holds_alternative<BucklingRun>(settings.kind)) {
    require_load(model, "buckling");
  } else if (const auto* path = std::get_if<ArcLengthRun>(&settings.kind)) {
    check_path(model, *path);
  } else {
    check_load_factors(std::get<StaticRun>(settings.kind));
  }
  const auto* frequencies = std::get_if<FrequencyRun>(&settings.kind);
  const auto* buckling = std::get_if<BucklingRun>(&settings.kind);
  if ((frequencies != nullptr && frequencies->count == 0) || (buckling != nullptr && buckling->count == 0)) {
    throw InputError("count must be at least 1");
  }
  if ((frequencies != nullptr || buckling != nullptr || std::holds_alternative<ArcLengthRun>(settings.kind)) &&
      settings.solver == Solver::cg) {
    throw InputError("frequencies, buckling and arc length need the direct solver: remove what asks for cg");
  }
  if (settings.newton_max == 0 || settings.every == 0 || !positive(settings.converge)) {
    throw InputError("newton_max and every must be at least 1, and converge positive");
  }
  require_not_negative(settings.settled, "the increment that ends Newton's method");
  if (settings.solver == Solver::cg && !settings.cg_fixed_count && !positive(settings.cg_tolerance)) {
    throw InputError("the tolerance of conjugate gradients must be positive");
  }
  if (settings.cg_fixed_count && (!settings.cg_iterations || *settings.cg_iterations == 0)) {
    throw InputError("a fixed count of CG iterations must be at least 1");
  }
}

/// Net load at the end of the ramps; follower pressure at the reference.
void check_balance(const ShellSystem& system) {
  const Model& model = *system.model;
  if (model.rigid_motions.empty()) {
    return;
  }
  std::vector<double> factors;
  for (const Load& load : model.loads) {
    factors.push_back(load.ramp.points.empty() ? 1 : load.ramp.points.back().second);
  }
  Forces forces;
  evaluate(system, {reference_configuration(system), factors}, forces, nullptr);
  for (const Piece& piece : system.pieces) {
    if (!piece.balanced) {
      continue;
    }
    const double relative = imbalance(system, piece, forces.external);
    if (relative > largest_imbalance) {
      refuse(model, piece.body,
             fmt::format("net force or moment is {:.3g} of the load on the piece with node {}: its rigid motions may "
                         "only be held when the loads are in balance (a closed shell under its own pressure); hold it "
                         "by a fix",
                         relative, piece.nodes.front() - model.first_node(piece.body)));
    }
  }
}

/// Pieces that attachments join move as one; what is carried there holds nothing by itself, and is left out.
struct JoinedPieces {
  Piece whole;                      ///< of the first body
  std::vector<std::size_t> bodies;  ///< of the pieces
};

std::vector<JoinedPieces> joined_pieces(const ShellSystem& system) {
  std::vector<std::size_t> piece_of(system.node_count(), 0);
  for (std::size_t p = 0; p < system.pieces.size(); ++p) {
    for (const Index node : system.pieces[p].nodes) {
      piece_of[node] = p;
    }
  }
  DisjointSets<std::size_t> joined(system.pieces.size());
  std::vector<char> is_carried(system.node_count(), 0);
  for (const Carried& carried : system.carried) {
    is_carried[carried.node] = 1;
    for (const Index carrier : carried.carriers) {
      joined.join(piece_of[carried.node], piece_of[carrier]);
    }
  }
  std::vector<JoinedPieces> groups(system.pieces.size());
  for (std::size_t p = 0; p < system.pieces.size(); ++p) {
    const Piece& piece = system.pieces[p];
    JoinedPieces& group = groups[joined.root(p)];
    group.bodies.push_back(piece.body);
    std::vector<Index>& nodes = group.whole.nodes;
    group.whole.body = nodes.empty() ? piece.body : group.whole.body;
    std::ranges::copy_if(piece.nodes, std::back_inserter(nodes), [&](Index node) { return is_carried[node] == 0; });
  }
  std::erase_if(groups, [](const JoinedPieces& group) { return group.whole.nodes.empty(); });
  return groups;
}

/// A static run wants every rigid motion held, or touched by something that may hold it.
void require_held(const ShellSystem& system) {
  const Model& model = *system.model;
  for (const auto& [whole, bodies] : joined_pieces(system)) {
    const bool touched = std::ranges::any_of(model.contacts, [&bodies = bodies](const Contact& contact) {
      return std::ranges::any_of(bodies, [&](std::size_t body) { return contact.is_of(body); });
    });
    if (const int motions = touched ? 0 : free_rigid_motions(system, whole); motions > 0) {
      const Index node = whole.nodes.front();
      refuse(
          model, whole.body,
          fmt::format("the piece with node {} at {} can move freely{} ({} of its 6 rigid motions are not held): add a "
                      "fix, or hold its rigid motions",
                      node - model.first_node(whole.body), place(system.reference[node]),
                      bodies.size() > 1 ? ", with all that is attached to it" : "", motions));
    }
  }
}

}  // namespace

void require_valid(const ShellBody& body) { check_body(body); }

void require_valid(const Model& model) {
  if (model.body_count() == 0) {
    throw InputError("the model has no shell and no solid");
  }
  for (const ShellBody& body : model.shells) {
    check_body(body);
  }
  check_solid_bodies(model);
  check_selections(model);
  for (const RigidBody& body : model.rigids) {
    check_rigid(body);
  }
  check_meetings(model);
}

void require_valid(const Model& model, const State& state) {
  const std::size_t nodes = model.node_count();
  if (state.displacement.size() != nodes || state.rotation.size() != nodes) {
    throw InputError(fmt::format("a state of {} displacements and {} rotations is not of a model of {} nodes",
                                 state.displacement.size(), state.rotation.size(), nodes));
  }
}

ShellSystem make_checked_system(const Model& model, const RunSettings& settings) {
  require_valid(model);
  for (const ShellBody& body : model.shells) {
    check_triangles(body);
    check_inner_face(body);
  }
  check_solids(model, settings);
  check_run(model, settings);
  check_load_sizes(model, settings);
  ShellSystem system = make_system(model);
  if (std::holds_alternative<FrequencyRun>(settings.kind) || std::holds_alternative<BucklingRun>(settings.kind)) {
    stiffen_short_waves(system);
  }
  check_balance(system);
  if (finds_rest(model, settings)) {
    require_held(system);
  }
  return system;
}

struct System::Implementation {
  Implementation(Model of, const RunSettings& by)
      : model(std::move(of)), settings(by), parts(make_checked_system(model, settings)) {}

  Model model;
  RunSettings settings;
  ShellSystem parts;  // some of it refers to the model
};

System::System(Model model, const RunSettings& settings)
    : implementation_(std::make_shared<Implementation>(std::move(model), settings)) {}

const Model& System::model() const { return implementation_->model; }
const RunSettings& System::settings() const { return implementation_->settings; }

ShellSystem& System::parts() const {
  add_prestress(implementation_->parts, implementation_->settings);
  return implementation_->parts;
}

std::optional<double> System::prestress_residual() const { return parts().prestress_residual; }
std::optional<bool> System::rests_as_imaged() const { return tunica::rests_as_imaged(parts(), settings()); }

void check_model(const Model& model, const RunSettings& settings) { (void)make_checked_system(model, settings); }

}  // namespace tunica
