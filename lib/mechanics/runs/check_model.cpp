#include "tunica/core/error.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

namespace tunica {
namespace {

std::string place(const Vec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g}) mm", p.x(), p.y(), p.z()); }

[[noreturn]] void refuse(const std::string& said_at, const std::string& name, const std::string& what) {
  throw InputError(fmt::format("{}{}: {}", said_at.empty() ? "" : said_at + ": ", name, what));
}

[[noreturn]] void refuse(const ShellBody& body, const std::string& what) { refuse(body.said_at, body.name, what); }

[[noreturn]] void refuse(const Model& model, std::size_t body, const std::string& what) {
  refuse(model.is_solid(body) ? model.solids[body - model.shells.size()].said_at : model.shells[body].said_at,
         model.name_of(body), what);
}

const Material& material_of(const Model& model, std::size_t body) {
  return model.is_solid(body) ? model.solids[body - model.shells.size()].material : model.shells[body].material;
}

void check_body(const ShellBody& body) {
  const ShellMesh& mesh = body.mesh;
  if (mesh.triangles.empty()) {
    refuse(body, "the shell has no triangles");
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) {
      refuse(body, fmt::format("the position of node {} is not finite", i));
    }
  }
  if (!(body.material.young > 0) || !std::isfinite(body.material.young)) {
    refuse(body, fmt::format("Young's modulus is {:.6g} MPa: it must be positive", body.material.young));
  }
  if (!(body.material.poisson > -1 && body.material.poisson <= 0.5)) {
    refuse(body, fmt::format("Poisson's ratio is {:.6g}: it must be above -1 and at most 0.5", body.material.poisson));
  }
  if (body.material.density && (!(*body.material.density > 0) || !std::isfinite(*body.material.density))) {
    refuse(body, "the density must be positive");
  }
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
    for (const Index i : v) {
      if (i >= mesh.vertices.size()) {
        refuse(body, fmt::format("element {} names node {}, but there are {}", t, i, mesh.vertices.size()));
      }
    }
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
  if (body.curved && mesh.corner_normals.empty() && mesh.normals.size() != mesh.vertices.size()) {
    refuse(body, fmt::format("{} normals for {} nodes", mesh.normals.size(), mesh.vertices.size()));
  }
  if (body.curved && body.rest == Rest::curved) {
    require_fit(mesh, body.said_at.empty() ? body.name : body.said_at + ": " + body.name);
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

void check_selections(const Model& model) {
  const auto check = [&](std::size_t body, const std::vector<Index>& nodes, const char* what) {
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
  }
  for (const RigidMotionsFix& fix : model.rigid_motions) {
    check(fix.body, {0}, "fix of the rigid motions");
    if (std::any_of(model.fixes.begin(), model.fixes.end(), [&](const Fix& other) { return other.body == fix.body; })) {
      refuse(model, fix.body, "it is held by its rigid motions and by another fix: keep one of them");
    }
  }
  for (const Load& load : model.loads) {
    check(load.body, {0}, "load");
    if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      check(load.body, force->nodes, "force");
    } else if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
      check(load.body, moment->nodes, "moment");
    } else if (const auto* edge = std::get_if<EdgeLoad>(&load.kind)) {
      std::vector<Index> ends;
      for (const auto& e : edge->edges) {
        ends.insert(ends.end(), e.begin(), e.end());
      }
      check(load.body, ends, "edge load");
    } else if (std::holds_alternative<GravityLoad>(load.kind) && !material_of(model, load.body).density) {
      refuse(model, load.body, "gravity acts on it, but it has no density");
    }
  }
  for (const Probe& probe : model.probes) {
    check(probe.body, {probe.node}, "probe");
  }
}

double size_of(const PressureLoad& load) { return std::abs(load.value); }
double size_of(const ForceLoad& load) { return load.total.cwiseAbs().maxCoeff(); }
double size_of(const MomentLoad& load) { return load.total.cwiseAbs().maxCoeff(); }
double size_of(const EdgeLoad& load) { return load.per_length.cwiseAbs().maxCoeff(); }
double size_of(const AreaLoad& load) { return load.per_area.cwiseAbs().maxCoeff(); }
double size_of(const GravityLoad& load) { return load.acceleration.cwiseAbs().maxCoeff(); }

/// Norms take squares of loads, which have to be numbers.
void check_sizes(const Model& model, const RunSettings& settings) {
  const auto* run = std::get_if<StaticRun>(&settings.kind);
  for (const Load& load : model.loads) {
    double factor = load.ramp.points.empty() && run != nullptr ? run->load_factors.back() : 1;
    for (const auto& point : load.ramp.points) {
      factor = std::max(factor, std::abs(point.second));
    }
    const double most = factor * std::visit([](const auto& kind) { return size_of(kind); }, load.kind);
    if (!std::isfinite(most * most)) {
      throw InputError(fmt::format("{}this load on {}, with its ramp, is larger than any force: is its unit right?",
                                   load.said_at.empty() ? "" : load.said_at + ": ", model.name_of(load.body)));
    }
  }
}

constexpr double largest_solid_poisson = 0.4999;

void check_solids(const Model& model, const RunSettings& settings) {
  for (std::size_t b = model.shells.size(); b < model.body_count(); ++b) {
    const SolidBody& body = model.solids[b - model.shells.size()];
    if (body.mesh.tetrahedra.empty()) {
      refuse(model, b, "the solid has no tetrahedra");
    }
    if (!(body.material.young > 0) || !std::isfinite(body.material.young)) {
      refuse(model, b, fmt::format("Young's modulus is {:.6g} MPa: it must be positive", body.material.young));
    }
    if (!(body.material.poisson > -1 && body.material.poisson <= largest_solid_poisson)) {
      refuse(model, b,
             fmt::format("Poisson's ratio is {:.6g}: it must be above -1 and at most {}", body.material.poisson,
                         largest_solid_poisson));
    }
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
  if (run.max_steps == 0 || !(run.first_factor > 0) || (run.max_factor && !(*run.max_factor > 0))) {
    throw InputError("arc length: max_steps must be at least 1, the first step and max_factor positive");
  }
  if (run.until && (run.until->probe >= model.probes.size() || run.until->axis < 0 || run.until->axis > 2 ||
                    !std::isfinite(run.until->reaches) || run.until->reaches == 0)) {
    throw InputError("arc length: until names a probe, an axis and a displacement other than zero");
  }
}

void check_run(const Model& model, const RunSettings& settings) {
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (const auto* dynamic = std::get_if<DynamicRun>(&settings.kind)) {
    if (!positive(dynamic->duration) || !positive(dynamic->step)) {
      throw InputError("a dynamic run needs a positive duration and a positive step");
    }
    if (!(dynamic->damping.mass >= 0) || !(dynamic->damping.stiffness >= 0)) {
      throw InputError("damping must not be negative");
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
  if (settings.solver == Solver::cg && !settings.cg_fixed_count && !positive(settings.cg_tolerance)) {
    throw InputError("the tolerance of conjugate gradients must be positive");
  }
  if (settings.cg_fixed_count && (!settings.cg_iterations || *settings.cg_iterations == 0)) {
    throw InputError("a fixed count of CG iterations must be at least 1");
  }
}

/// Net load at the end of the ramps; follower pressure at the reference.
void check_balance(const ShellSystem& system, const Model& model) {
  if (model.rigid_motions.empty()) {
    return;
  }
  std::vector<double> factors;
  for (const Load& load : model.loads) {
    factors.push_back(load.ramp.points.empty() ? 1 : load.ramp.points.back().second);
  }
  Forces forces;
  evaluate(system, model, reference_configuration(system), factors, {}, forces, nullptr);
  for (const Piece& piece : system.pieces) {
    if (!held_by_rigid_motions(model, piece.body)) {
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

/// Contact holds what it presses on, and attachments what they carry.
bool may_be_held_by_others(const Model& model, const ShellSystem& system, const Piece& piece) {
  const auto names = [&](const ContactParty& party) { return !party.rigid && party.index == piece.body; };
  if (std::any_of(model.contacts.begin(), model.contacts.end(),
                  [&](const Contact& c) { return names(c.between[0]) || names(c.between[1]); })) {
    return true;
  }
  return std::any_of(system.carried.begin(), system.carried.end(), [&](const Carried& c) {
    return std::binary_search(piece.nodes.begin(), piece.nodes.end(), c.node) ||
           std::any_of(c.carriers.begin(), c.carriers.end(),
                       [&](Index i) { return std::binary_search(piece.nodes.begin(), piece.nodes.end(), i); });
  });
}

}  // namespace

ShellSystem make_checked_system(const Model& model, const RunSettings& settings) {
  if (model.body_count() == 0) {
    throw InputError("the model has no shell and no solid");
  }
  for (const ShellBody& body : model.shells) {
    check_body(body);
    check_triangles(body);
    check_inner_face(body);
  }
  check_solids(model, settings);
  check_selections(model);
  check_run(model, settings);
  check_sizes(model, settings);
  ShellSystem system = make_system(model);
  if (std::holds_alternative<FrequencyRun>(settings.kind) || std::holds_alternative<BucklingRun>(settings.kind)) {
    stiffen_short_waves(system);
  }
  check_balance(system, model);
  if (finds_rest(model, settings)) {
    for (const Piece& piece : system.pieces) {
      if (may_be_held_by_others(model, system, piece)) {
        continue;
      }
      const int motions = free_rigid_motions(system, piece);
      if (motions > 0) {
        const Index node = piece.nodes.front();
        refuse(
            model, piece.body,
            fmt::format("the piece with node {} at {} can move freely ({} of its 6 rigid motions are not held): add a "
                        "fix, or hold its rigid motions",
                        node - model.first_node(piece.body), place(system.reference[node]), motions));
      }
    }
  }
  return system;
}

void check_model(const Model& model, const RunSettings& settings) { (void)make_checked_system(model, settings); }

}  // namespace tunica
