#include "tunica/mechanics/runs/fields.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/mechanics/runs/detail/layers.hpp"
#include "tunica/mechanics/runs/detail/loads.hpp"
#include "tunica/mechanics/runs/detail/prestress.hpp"
#include "tunica/mechanics/runs/detail/recovery.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr double rare = 0.01;  // of the area, on which a 99th percentile is passed
constexpr std::array<double, 2> about_as_rare{0.02, 0.005};

std::vector<double> lengths(const std::vector<Vec3>& vectors) {
  std::vector<double> result;
  for (const Vec3& v : vectors) {
    result.push_back(v.norm());
  }
  return result;
}

/// Of ElementFields::solid_error. @param stresses  MPa, of all tetrahedra
std::vector<double> solid_errors(const ShellSystem& system, const std::vector<Mat3>& stresses) {
  const Model& model = *system.model;
  std::vector<Mat3> at_nodes(model.node_count(), Mat3::Zero());
  std::vector<double> volumes(model.node_count(), 0);
  for (std::size_t e = 0; e < stresses.size(); ++e) {
    for (const Index node : system.solids[e].nodes) {
      at_nodes[node] += system.solids[e].volume * stresses[e];
      volumes[node] += system.solids[e].volume;
    }
  }
  std::vector<std::array<double, 2>> energies(model.solids.size(), {0, 0});  // of the stress, of the differences
  std::vector<double> of_strain(model.solids.size(), 0);                     // of a strain of one
  for (std::size_t e = 0; e < stresses.size(); ++e) {
    const SolidElement& element = system.solids[e];
    const double bulk = element.bulk_of_displacement + element.bulk_of_pressure;
    const auto energy = [&](const Mat3& one, const Mat3& other) {
      const double volumetric = one.trace() * other.trace() / 9;
      return element.volume *
             ((one.cwiseProduct(other).sum() - 3 * volumetric) / (4 * element.shear) + volumetric / (2 * bulk));
    };
    std::array<Mat3, 4> off;
    Mat3 sum = Mat3::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      off[k] = at_nodes[element.nodes[k]] / volumes[element.nodes[k]] - stresses[e];
      sum += off[k];
    }
    auto& [whole, jumps] = energies[element.body - model.shells.size()];
    whole += energy(stresses[e], stresses[e]);
    of_strain[element.body - model.shells.size()] += element.volume * element.shear;
    jumps += energy(sum, sum) / 20;  // the mass matrix of linear functions has 1 / 10 and 1 / 20
    for (const Mat3& at_corner : off) {
      jumps += energy(at_corner, at_corner) / 20;
    }
  }
  std::vector<double> errors;
  for (std::size_t s = 0; s < energies.size(); ++s) {
    const auto [whole, jumps] = energies[s];
    errors.push_back(whole > of_strain[s] * least_strain * least_strain ? jumps / (whole + jumps) : 0);
  }
  return errors;
}

const Model& checked(const Model& model) {
  require_valid(model);
  return model;
}

ElementState state_of(const ShellElement& element, const State& state) {
  if (state.linear) {
    Vector18 moved;
    for (int k = 0; k < 3; ++k) {
      moved.segment<3>(6 * k) = state.displacement[element.nodes[k]];
      moved.segment<3>(6 * k + 3) = state.rotation[element.nodes[k]];
    }
    return linear_deformation(element, moved);
  }
  ElementState d = ElementState::Zero();
  CornerMotion motion;
  for (int k = 0; k < 3; ++k) {
    const Index node = element.nodes[k];
    motion.displacement.col(k) = state.displacement[node];
    motion.rotation[k] = exponential(state.rotation[node]).toRotationMatrix();
  }
  deformation(element, motion, d);
  return d;
}

double von_mises(const Vec3& s) {
  return std::sqrt(std::max(0.0, s[0] * s[0] - s[0] * s[1] + s[1] * s[1] + 3 * s[2] * s[2]));
}

/// Largest first, of a tensor's xx, yy and xy.
Vec2 principal(const Vec3& tensor) {
  const double mean = (tensor[0] + tensor[1]) / 2;
  const double radius = std::hypot((tensor[0] - tensor[1]) / 2, tensor[2]);
  return {mean + radius, mean - radius};
}

/// The symmetric part of F N for stretches F = 1 + strain.
Vec3 stretched(const Vec3& strain, const Vec3& tensor) {
  const double x = 1 + strain[0], y = 1 + strain[1], xy = strain[2] / 2;
  return {x * tensor[0] + xy * tensor[2], y * tensor[1] + xy * tensor[2],
          ((x + y) * tensor[2] + xy * (tensor[0] + tensor[1])) / 2};
}

/// What a place of the wall bears.
struct Bearing {
  Vec3 force, moment;  ///< per current length
  double top = 0, bottom = 0, membrane = 0, tension = 0;
  Vec2 strain_top, strain_bottom;
};

/// By the laws of a linear wall in its co-rotated frame.
/// @param stressed  force and moment per reference length, energy-conjugate to the strains: of Biot's stress
/// @param strained  those that the deformation alone makes
/// With F = R (1 + e), its in-plane part, Biot's stress T is pushed forward to F T sym / det F, and moments by what the
/// lever, the thickness, became.
Bearing bearing_of(const TensorPair& stressed, const TensorPair& strained, double thickness, const Material& material,
                   bool linear) {
  Bearing b;
  const Mat3 compliance = plane_stress(material).inverse();
  const Vec3 strain = compliance * strained.force / thickness;
  const Vec3 bend = compliance * strained.moment * 6 / (thickness * thickness);  // strain at the face by bending
  double now = thickness;
  b.force = stressed.force;
  b.moment = stressed.moment;
  if (!linear) {
    const double area = (1 + strain[0]) * (1 + strain[1]) - strain[2] * strain[2] / 4;
    now *= std::pow(area, -material.poisson / (1 - material.poisson));
    b.force = stretched(strain, stressed.force) / area;
    b.moment = stretched(strain, stressed.moment) / area * (now / thickness);
  }
  const Vec3 mean = b.force / now, side = 6 / (now * now) * b.moment;
  b.top = von_mises(mean + side);
  b.bottom = von_mises(mean - side);
  b.membrane = von_mises(mean);
  b.tension = principal(b.force)[0];
  const auto face = [](const Vec3& e) { return principal(Vec3(e[0], e[1], e[2] / 2)); };
  b.strain_top = face(strain + bend);
  b.strain_bottom = face(strain - bend);
  return b;
}

/// Recovered numbers at the corners of the shells.
struct CornerFields {
  std::vector<Facet> stress, membrane, tension, strain;
};

std::vector<ShellPart> wholes(std::size_t shells) {
  std::vector<ShellPart> parts;
  for (std::size_t t = 0; t < shells; ++t) {
    parts.push_back({t, {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}});
  }
  return parts;
}

/// The same of parts of the shells.
std::vector<Facet> of_parts(const std::vector<Facet>& shells, const std::vector<ShellPart>& parts) {
  std::vector<Facet> facets;
  for (const ShellPart& part : parts) {
    const Facet& shell = shells[part.shell];
    Facet& facet = facets.emplace_back(Facet{part.share() * shell.area, {}});
    for (std::size_t k = 0; k < 3; ++k) {
      facet.values[k] = part.corners[k].dot(Vec3(shell.values[0], shell.values[1], shell.values[2]));
    }
  }
  return facets;
}

/// Of parts of the shells.
WallNumbers numbers_of(const ShellSystem& system, const CornerFields& all, const std::vector<ShellPart>& parts) {
  const auto largest = [](const std::vector<Facet>& facets) {
    double most = -infinity;
    for (const Facet& facet : facets) {
      most = std::max(most, *std::ranges::max_element(facet.values));
    }
    return most;
  };
  const auto set_quantiles = [](const std::vector<Facet>& facets, double& p99, std::array<double, 2>& beside) {
    p99 = area_quantile(facets, rare);
    std::ranges::transform(about_as_rare, beside.begin(), [&](double part) { return area_quantile(facets, part); });
  };
  WallNumbers w;
  const std::vector<Facet> stress = of_parts(all.stress, parts), membrane = of_parts(all.membrane, parts);
  const std::vector<Facet> strain = of_parts(all.strain, parts);
  set_quantiles(stress, w.stress_p99, w.beside.stress);
  w.stress_max = largest(stress);
  set_quantiles(membrane, w.membrane_p99, w.beside.membrane);
  w.membrane_max = largest(membrane);
  w.membrane_mean = area_mean(membrane);
  set_quantiles(of_parts(all.tension, parts), w.tension_p99, w.beside.tension);
  set_quantiles(strain, w.strain_p99, w.beside.strain);
  w.strain_max = largest(strain);
  double of_faces = 0, of_middle = 0;
  std::optional<std::pair<std::size_t, std::size_t>> largest_at;
  // The first of equal ones, so that on a symmetric body it is not round-off that chooses.
  constexpr double equal_stress = 1e-6;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (stress[p].values[k] >= w.stress_p99) {
        of_faces += stress[p].area * stress[p].values[k];
        of_middle += stress[p].area * membrane[p].values[k];
      }
      if (!largest_at && stress[p].values[k] >= (1 - equal_stress) * w.stress_max) {
        largest_at = {p, k};
      }
    }
  }
  w.bending_share = of_faces > 0 ? 1 - of_middle / of_faces : 0;
  if (largest_at) {
    const auto& [shell, corners] = parts[largest_at->first];
    const ShellElement& element = system.elements[shell];
    const std::size_t first = system.model->first_node(element.body);
    for (std::size_t i = 0; i < 3; ++i) {
      w.stress_max_at += corners[largest_at->second][narrow<Eigen::Index>(i)] *
                         system.model->shells[element.body].mesh.vertices[element.nodes[i] - first];
    }
  }
  return w;
}

}  // namespace

struct ElementFieldEvaluator::Implementation {
  explicit Implementation(const System& of)
      : whole(of), model(whole->model()), system(whole->parts()), recovery(system), far(far_from_disturbances(model)) {}
  explicit Implementation(const Model& of)
      : alone(make_system(checked(of))), model(of), system(*alone), recovery(*alone), far(far_from_disturbances(of)) {
    add_prestress(*alone, RunSettings());
  }

  std::optional<System> whole;       ///< what `system` is part of
  std::optional<ShellSystem> alone;  ///< or not
  const Model& model;
  const ShellSystem& system;
  Recovery recovery;
  std::vector<ShellPart> far;  ///< far_from_disturbances()

  void add_shells(const State& state, ElementFields& fields) const;
  void add_solids(const State& state, ElementFields& fields) const;
  /// Thickness at a corner of a shell.
  [[nodiscard]] double thickness_at(std::size_t t, int corner) const;
  [[nodiscard]] bool is_held(const Vec3& place) const;
};

ElementFieldEvaluator::ElementFieldEvaluator(const System& system) : implementation_(new Implementation(system)) {}
ElementFieldEvaluator::ElementFieldEvaluator(const Model& model) : implementation_(new Implementation(model)) {}
ElementFieldEvaluator::~ElementFieldEvaluator() = default;

ElementFields element_fields(const Model& model, const State& state) { return ElementFieldEvaluator(model)(state); }

double ElementFieldEvaluator::Implementation::thickness_at(std::size_t t, int corner) const {
  const ShellElement& element = system.elements[t];
  const ShellBody& body = model.shells[element.body];
  if (body.thickness.size() == 1 || is_step(body, t - system.first_element[element.body])) {
    return element.thickness;
  }
  return body.thickness[element.nodes[corner] - model.first_node(element.body)];
}

bool ElementFieldEvaluator::Implementation::is_held(const Vec3& place) const {
  return std::ranges::any_of(model.fixes, [&](const Fix& fix) {
    return !model.is_solid(fix.body) && !plane_of_symmetry(fix) && std::ranges::any_of(fix.nodes, [&](Index node) {
      return model.shells[fix.body].mesh.vertices[node] == place;
    });
  });
}

void ElementFieldEvaluator::Implementation::add_shells(const State& state, ElementFields& fields) const {
  std::vector<TensorPair> stressed, strained;
  for (const ShellElement& element : system.elements) {
    const Material& material = model.shells[element.body].material;
    const ElementState d = state_of(element, state);
    const double t = element.thickness;
    const Mat3 elasticity = plane_stress(material);
    const auto pair_of = [&](const ElementState& y) {
      return TensorPair{t * elasticity * y.head<3>(),
                        t * t * t / 12 * elasticity * (element.curvature * y.segment<9>(3))};
    };
    strained.push_back(pair_of(d));
    stressed.push_back(pair_of(d + element.prestrain));
    const Bearing b = bearing_of(stressed.back(), strained.back(), t, material, state.linear);
    fields.membrane_force.push_back(b.force);
    fields.bending_moment.push_back(b.moment);
    fields.von_mises_top.push_back(b.top);
    fields.von_mises_bottom.push_back(b.bottom);
    fields.membrane_von_mises.push_back(b.membrane);
    fields.tension.push_back(b.tension);
    fields.principal_strain_top.push_back(b.strain_top);
    fields.principal_strain_bottom.push_back(b.strain_bottom);
  }
  const auto strained_corners = recovery.at_corners(strained);
  const auto stressed_corners = system.prestress_residual ? recovery.at_corners(stressed) : strained_corners;
  fields.layer_error = layer_errors(system, strained, strained_corners);
  fields.roughness.assign(model.shells.size(), 0);
  double round_off = 0;
  for (std::size_t e = 0; e < strained.size(); ++e) {
    const ShellElement& element = system.elements[e];
    const Material& material = model.shells[element.body].material;
    const ShellEnergy energy = shell_energy(element, material, strained[e], strained_corners[e]);
    fields.roughness[element.body] += energy.force_jumps + energy.moment_jumps;
    round_off += element.area * element.thickness * material.young * least_strain * least_strain;
  }
  for (double& roughness : fields.roughness) {
    roughness = state.strain_energy > round_off ? roughness / state.strain_energy : 0;
  }
  CornerFields corners;
  std::vector<double> weight(model.node_count(), 0);
  double whole = 0, far_area = 0;
  for (std::size_t t = 0; t < system.elements.size(); ++t) {
    const ShellElement& element = system.elements[t];
    const double area = recovery.area(t);
    whole += area;
    for (auto* list : {&corners.stress, &corners.membrane, &corners.tension, &corners.strain}) {
      list->push_back({area, {}});
    }
    for (int k = 0; k < 3; ++k) {
      const Bearing b = bearing_of(stressed_corners[t][k], strained_corners[t][k], thickness_at(t, k),
                                   model.shells[element.body].material, state.linear);
      const Index node = element.nodes[k];
      const double stress = std::max(b.top, b.bottom), strain = std::max(b.strain_top[0], b.strain_bottom[0]);
      corners.stress[t].values[k] = stress;
      corners.membrane[t].values[k] = b.membrane;
      corners.tension[t].values[k] = b.tension;
      corners.strain[t].values[k] = strain;
      weight[node] += area;
      fields.von_mises[node] += area * stress;
      fields.membrane_stress[node] += area * b.membrane;
      fields.strain[node] += area * strain;
    }
  }
  for (std::size_t i = 0; i < weight.size(); ++i) {
    fields.von_mises[i] /= weight[i] > 0 ? weight[i] : 1;
    fields.membrane_stress[i] /= weight[i] > 0 ? weight[i] : 1;
    fields.strain[i] /= weight[i] > 0 ? weight[i] : 1;
  }
  constexpr double hardly_any = 1e-9;
  for (const ShellPart& part : far) {
    far_area += part.share() * recovery.area(part.shell);
  }
  Wall& wall = fields.wall;
  wall.whole = numbers_of(system, corners, wholes(system.elements.size()));
  wall.is_all_near = !(far_area > hardly_any * whole);
  wall.left_out = wall.is_all_near || far_area > (1 - hardly_any) * whole ? 0 : 1 - far_area / whole;
  static_cast<WallNumbers&>(wall) = wall.left_out > 0 ? numbers_of(system, corners, far) : wall.whole;
  wall.is_max_on_held = is_held(wall.whole.stress_max_at);
}

void ElementFieldEvaluator::Implementation::add_solids(const State& state, ElementFields& fields) const {
  std::vector<Mat3> stresses;
  std::vector<double> sums(model.node_count(), 0);
  std::vector<double> volumes(model.node_count(), 0);
  std::vector<Facet> strains;
  for (const SolidElement& element : system.solids) {
    SolidMotion motion;
    for (int k = 0; k < 4; ++k) {
      motion.displacement.col(k) = state.displacement[element.nodes[k]];
      motion.pressure[k] = state.pressure[element.nodes[k]];
    }
    if (element.law == SolidLaw::corotational && !state.linear) {
      const Mat3 stretch = Mat3::Identity() + motion.displacement * element.gradients.transpose();
      const double strain = (stretch.transpose() * stretch - Mat3::Identity()).norm() / 2;
      strains.push_back({element.volume, {strain, strain, strain}});
    }
    const Mat3 stress = solid_stress(element, motion, state.linear);
    stresses.push_back(stress);
    const double mean = stress.trace() / 3;
    fields.solid_von_mises.push_back(std::sqrt(1.5) * (stress - mean * Mat3::Identity()).norm());
    fields.solid_pressure.push_back(-mean);
    const double volume = element.volume;
    for (const Index node : element.nodes) {
      sums[node] += volume * fields.solid_von_mises.back();
      volumes[node] += volume;
    }
  }
  fields.solid_strain_p99 = strains.empty() ? 0 : area_quantile(strains, rare);
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    if (volumes[i] > 0) {
      fields.von_mises[i] = fields.membrane_stress[i] = sums[i] / volumes[i];
    }
  }
  fields.solid_error = solid_errors(system, stresses);
}

ElementFields ElementFieldEvaluator::operator()(const State& state) const {
  const Model& model = implementation_->model;
  const ShellSystem& system = implementation_->system;
  const std::size_t nodes = model.node_count();
  require_valid(model, state);
  if (!system.solids.empty() && state.pressure.size() != nodes) {
    throw InputError(fmt::format("a state with {} pressures for {} nodes", state.pressure.size(), nodes));
  }
  std::vector<double> factors;
  for (const Load& load : model.loads) {
    factors.push_back(
        factor_of(load.ramp, state.velocity.empty(), state.velocity.empty() ? state.load_factor : state.time));
  }
  ElementFields fields;
  for (auto* of_nodes : {&fields.von_mises, &fields.membrane_stress, &fields.strain}) {
    of_nodes->assign(nodes, 0);
  }
  fields.pressure = shell_pressures(system, factors);
  if (!system.elements.empty()) {
    implementation_->add_shells(state, fields);
    fields.displacement_p99 = area_quantile(model, lengths(state.displacement), rare);
  }
  implementation_->add_solids(state, fields);
  fields.largest_displacement = largest_displacement(model, state);
  return fields;
}

}  // namespace tunica
