#include "tunica/mechanics/runs/doubts.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "tunica/mechanics/model/corner_normals.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <optional>
#include <utility>

namespace tunica {
namespace {

// Of the body's area: one crease, rim or branch says nothing of the whole wall.
constexpr double most_of_it = 0.5;
// Of the diagonal of the body's box. Thin shells leave out the shear through the wall: of a clamped disc of radius a
// 3.2 / (1 - nu) (t / a)^2 of its deflection, 10 % where t is .15 a (nu = .3), a twentieth of the diagonal.
constexpr double thickest = 0.05;
// Times the sum of the principal curvatures. Pressure on the inner face of a thicker wall moves it 10 % less than a
// thin one (Lamé), for that face is smaller by half of this.
constexpr double thickest_curved = 0.25;
// MPa. Blood and bladders reach some 300 mmHg.
constexpr double mmhg = 133.322387415e-6, most_in_image = 450 * mmhg;

// Mean thickness at the corners of a triangle, mm.
double thickness_of(const ShellBody& body, std::size_t triangle) {
  if (body.thickness.size() == 1) {
    return body.thickness.front();
  }
  const auto& v = body.mesh.triangles[triangle];
  return (body.thickness[v[0]] + body.thickness[v[1]] + body.thickness[v[2]]) / 3;
}

double area_of(const ShellMesh& mesh, std::size_t triangle) {
  const auto& v = mesh.triangles[triangle];
  return triangle_area(mesh.vertices[v[0]], mesh.vertices[v[1]], mesh.vertices[v[2]]);
}

/// Of the area, where the wall is thicker than this times the radius of curvature.
double share_thicker(const ShellBody& body, const std::vector<Curvature>& curvatures, double radii) {
  double whole = 0, thicker = 0;
  for (std::size_t t = 0; t < curvatures.size(); ++t) {
    const double area = area_of(body.mesh, t);
    whole += area;
    thicker += thickness_of(body, t) * curvatures[t].largest > radii ? area : 0;
  }
  return whole > 0 ? thicker / whole : 0;
}

/// "; was 1 kPa or 1 MPa meant?": the values with another prefix that are plausible.
std::string meant(double value, std::initializer_list<double> factors, const std::array<double, 2>& plausible,
                  const std::function<std::string(double)>& text) {
  std::string list;
  for (const double factor : factors) {
    if (value * factor >= plausible[0] && value * factor <= plausible[1]) {
      list += (list.empty() ? "" : " or ") + text(value * factor);
    }
  }
  return list.empty() ? ": is its unit right?" : fmt::format(": was {} meant?", list);
}

/// Thickness times the sum of both curvatures over the area, mm^2, and the area: with its sign, since what the steps of
/// an image leave bulges both ways.
std::pair<double, double> thickness_by_radius(const ShellBody& body, const std::vector<Curvature>& curvatures) {
  double whole = 0, by_radius = 0;
  for (std::size_t t = 0; t < curvatures.size(); ++t) {
    const double area = area_of(body.mesh, t);
    whole += area;
    by_radius += area * thickness_of(body, t) * curvatures[t].sum;
  }
  return {std::abs(by_radius), whole};
}

void doubt_thickness(const ShellBody& body, std::vector<Warning>& found) {
  const double most = *std::max_element(body.thickness.begin(), body.thickness.end());
  const std::vector<Curvature> curvatures = curvatures_of(body.mesh, body.curved);
  if (const double share = share_thicker(body, curvatures, 1); share > most_of_it) {
    found.push_back(
        {Weight::major, "thick wall",
         fmt::format("{}: its thickness, {:.4g} mm, is more than the radius of curvature over {:.0f} % of its area, so "
                     "that a thin shell does not stand for this wall: is the unit right?",
                     named(body.said_at, body.name), most, 100 * share)});
    return;
  }
  if (const double diagonal_mm = diagonal(flat_facets(body.mesh)); most > thickest * diagonal_mm) {
    found.push_back(
        {Weight::major, "thick wall",
         fmt::format("{}: its thickness, {:.4g} mm, is more than a twentieth of the body's diagonal, {:.4g} mm: "
                     "this is no thin shell, whose wall does not shear; is the unit right?",
                     named(body.said_at, body.name), most, diagonal_mm)});
    return;
  }
  const auto [by_radius, whole] = thickness_by_radius(body, curvatures);
  if (by_radius > thickest_curved * whole) {
    found.push_back(
        {Weight::minor, "thick wall",
         fmt::format("{}: its thickness, {:.4g} mm, is more than a quarter of a vessel's radius, or an eighth of a "
                     "ball's, in the mean over its area: pressure on the inner face moves so thick a wall at least "
                     "some 10 % less than this thin one",
                     named(body.said_at, body.name), most)});
  }
}

/// Of the area, where a face of the wall, half of it away from the middle, lies nearer to the middle of a part of the
/// same wall that lies along it than to its own: walls that overlap, and leave no lumen between them. At a crease they
/// only meet.
double share_overlapping(const ShellBody& body) {
  constexpr double nearer = 0.8;  // what noise and curvature take of the own distance
  constexpr double along = 0.5;   // the cosine of 60 degrees
  const TriangleMesh mesh{body.mesh.vertices, body.mesh.triangles};
  const ClosestPoint middle(mesh);
  const auto normal_of = [&](std::size_t t) -> Vec3 {
    const auto& [a, b, c] = mesh.triangles[t];
    return (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]).normalized();
  };
  double whole = 0, overlapping = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& v = mesh.triangles[t];
    const Vec3 normal = normal_of(t), centre = (mesh.vertices[v[0]] + mesh.vertices[v[1]] + mesh.vertices[v[2]]) / 3;
    const double half = thickness_of(body, t) / 2;
    const double area = area_of(body.mesh, t);
    whole += area;
    const bool overlaps = std::ranges::any_of(std::array{-half, half}, [&](double away) {
      const ClosestPoint::Hit hit = middle.closest(centre + away * normal, narrow<Index>(t));
      return hit.squared_distance < nearer * nearer * half * half &&
             std::abs(normal.dot(normal_of(hit.triangle))) > along;
    });
    overlapping += overlaps ? area : 0;
  }
  return whole > 0 ? overlapping / whole : 0;
}

void doubt_overlaps(const ShellBody& body, std::vector<Warning>& found) {
  constexpr double notable = 0.1;
  if (const double share = share_overlapping(body); share > notable) {
    found.push_back(
        {share > most_of_it ? Weight::major : Weight::minor, "thick wall",
         fmt::format("{}: over {:.0f} % of its area its walls, {:.4g} mm thick, are nearer to each other than "
                     "that and overlap, so that no lumen is left there: is the unit right?",
                     named(body.said_at, body.name), 100 * share,
                     *std::max_element(body.thickness.begin(), body.thickness.end()))});
  }
}

/// What a body may be, by what else is known of it.
enum class Kind { organ, inflated, any };

void doubt_material(const std::string& where, const Material& material, Kind kind, std::vector<Warning>& found) {
  // MPa. Fat and brain reach down to a few hundred Pa; tungsten, the stiffest metal, has 410 GPa; the walls of
  // balloons, the stiffest that pressure is put on from inside, some GPa; arteries and tendon-like sheets up to some
  // hundred MPa.
  constexpr std::array<double, 2> of_tissue{1e-3, 100};
  constexpr double softest = 1e-4, stiffest = 5e5, stiffest_inflated = 1e4, stiffest_organ = 1e3;
  const bool soft = material.young < softest;
  if (soft || material.young > (kind == Kind::any     ? stiffest
                                : kind == Kind::organ ? stiffest_organ
                                                      : stiffest_inflated)) {
    found.push_back({Weight::major, "stiffness",
                     fmt::format("{}: its Young's modulus, {}, is {}{}", where, pressure_text(material.young),
                                 soft                     ? "less than that of any tissue"
                                 : kind == Kind::organ    ? "more than that of any hollow organ"
                                 : kind == Kind::inflated ? "more than that of any wall that is inflated"
                                                          : "more than that of any metal",
                                 meant(material.young, {1e3, 1e6, 1e-3, 1e-6}, of_tissue, pressure_text))});
  }
  // kg / m^3. Lungs with air have 200, tissue about 1,050, platinum 21,500.
  constexpr double lightest = 100, heaviest = 25e3;
  const double density = 1e12 * material.density.value_or(1e-9);
  if (density < lightest || density > heaviest) {
    found.push_back({Weight::major, "density",
                     fmt::format("{}: its density, {:.4g} kg/m3, is {} than that of any {}{}", where, density,
                                 density < lightest ? "less" : "more", density < lightest ? "tissue" : "metal",
                                 meant(density, {1e3, 1e-3, 1e-6}, {500, heaviest},
                                       [](double kg) { return fmt::format("{:.4g} kg/m3", kg); }))});
  }
}

void doubt_bed(const std::string& where, const Support& bed, std::vector<Warning>& found) {
  // MPa/mm. What is used for the tissue around vessels goes from 1e4 to 1e7 N/m3.
  constexpr double softest = 1e-7, stiffest = 1;
  constexpr double newtons_per_cubic_metre = 1e9;
  if (bed.stiffness < softest || bed.stiffness > stiffest) {
    found.push_back(
        {Weight::major, "stiffness",
         fmt::format("{}: its bed of {:.3g} N/m3 is {} than that of any tissue around, 1e4 to 1e7 N/m3: is "
                     "its unit right?",
                     where, bed.stiffness * newtons_per_cubic_metre, bed.stiffness < softest ? "softer" : "stiffer")});
  }
}

bool is_pressed(const Model& model, std::size_t body) {
  return std::ranges::any_of(model.loads, [&](const Load& load) {
    return load.body == body && std::holds_alternative<PressureLoad>(load.kind);
  });
}

void doubt_voxels(const ShellBody& body, std::vector<Warning>& found) {
  if (!body.voxel) {
    return;
  }
  // A surface goes through slices that are thick against its pixels in steps of up to half a slice; voxels that are
  // about as long as wide are smoothed to a fraction of that.
  constexpr double anisotropic = 2;
  constexpr double thinnest = 0.01;  // of a voxel
  const auto [shortest, longest] = *body.voxel;
  const double wall = *std::min_element(body.thickness.begin(), body.thickness.end());
  const auto millimetres = [](double mm) { return fmt::format("{:.3g} mm", mm); };
  if (wall < thinnest * shortest) {
    found.push_back({Weight::major, "thin wall",
                     fmt::format("{}: its thickness, {}, is less than a hundredth of the voxels of its image, {}{}",
                                 named(body.said_at, body.name), millimetres(wall), millimetres(shortest),
                                 meant(wall, {1e3, 10}, {shortest / 20, 100 * longest}, millimetres))});
    return;
  }
  const bool slices = longest >= anisotropic * shortest;
  if (longest > wall) {
    found.push_back(
        {Weight::minor, "large voxels",
         fmt::format(
             "{}: the {} of its image, {:.3g} mm, leave the surface uncertain by up to {:.3g} mm, "
             "{:.2g} times the wall: what is left of its steps bends the wall; 99th percentiles may be "
             "too high by 10 to 20 % (membrane), and at the faces be two to three times those of a smooth organ; go "
             "by the mean membrane stress, or take a finer image",
             named(body.said_at, body.name), slices ? "slices" : "voxels", longest, longest / 2, longest / 2 / wall)});
  } else if (longest > wall / 2) {
    found.push_back(
        {Weight::note, "large voxels",
         fmt::format("{}: the voxels of its image, {:.3g} mm, are {:.2g} times the wall: the steps of the "
                     "voxels show in the surface. The 99th percentile of stress at the faces may be twice that of a "
                     "smooth vessel; the membrane stress is right to some per cent",
                     named(body.said_at, body.name), longest, longest / wall)});
  }
}

/// How much of a triangle's bending stretches it, as it does not stretch the surface, relative to the strain by bending
/// at the faces: the ends of an edge of length l whose normals lean by b against the facet, across the edge, turn in
/// its plane where the shell bends; the bow of the edge that follows strains the triangle, of area A, by l^3 b / (8 A)
/// per curvature. On a cylinder it is h^2 / (8 R t), on a sphere two thirds of that.
double bow_share(const ShellBody& body, const CornerNormals& normal, std::size_t triangle) {
  const auto& v = body.mesh.triangles[triangle];
  const auto& x = body.mesh.vertices;
  const Vec3 across = (x[v[1]] - x[v[0]]).cross(x[v[2]] - x[v[0]]);
  if (!(across.norm() > 0)) {
    return 0;
  }
  double largest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    const Vec3 edge = x[v[next]] - x[v[k]];
    const double lean =
        std::abs((normal(triangle, k) + normal(triangle, next)).dot(edge.cross(across).normalized())) / 2;
    largest = std::max(largest, std::pow(edge.norm(), 3) * lean);
  }
  return largest / (4 * across.norm() * thickness_of(body, triangle));
}

/// Of the triangles, the share of bending that over half of the area is exceeded: one crease or branch says nothing.
double median_bow_share(const ShellBody& body) {
  const CornerNormals normals(body.mesh, body.curved);
  std::vector<std::pair<double, double>> shares;  // with the areas
  double left = 0;
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    shares.emplace_back(bow_share(body, normals, t), area_of(body.mesh, t));
    left += most_of_it * shares.back().second;
  }
  std::sort(shares.begin(), shares.end());
  const auto median = std::find_if(shares.begin(), shares.end(), [&](const auto& share) {
    left -= share.second;
    return left <= 0;
  });
  return median == shares.end() ? 0 : median->first;
}

/// Mean height of the waves that normals leave, over the wall. An edge whose ends lean alike against it, by a, is an S:
/// its mean height is a sixteenth of a times its length. On a smooth surface normals lean against each other, so that
/// an S is what noise of normals leaves.
double waves_of(const ShellBody& body) {
  if (!body.curved || body.mesh.normals.size() != body.mesh.vertices.size()) {
    return 0;
  }
  constexpr double mean_height = 1.0 / 16;
  double waves = 0;
  double whole = 0;
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    const auto& v = body.mesh.triangles[t];
    const auto& x = body.mesh.vertices;
    const double area = area_of(body.mesh, t);
    whole += area;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      const double lean = (body.mesh.normal(t, k) + body.mesh.normal(t, next)).dot(x[v[next]] - x[v[k]]) / 2;
      waves += area / 3 * mean_height * std::abs(lean) / thickness_of(body, t);
    }
  }
  return whole > 0 ? waves / whole : 0;
}

/// What long shells and what waves leave of an answer adds up. The factors bound what is seen of balls of 60 to 1,000
/// shells and a wall of R / 8 to R / 250, whose displacements come out too large, and of organs, whose stress at the
/// faces comes out too low. Frequencies go with the root of the stiffness.
void doubt_coarseness(const ShellBody& body, bool rings, std::vector<Warning>& found) {
  constexpr double notable_displacement = 0.25, notable_stress = 0.15;  // bounds: the errors are half of them
  const double bow = median_bow_share(body);
  const double waves = waves_of(body);
  const double of_displacement = 0.7 * bow + 10 * waves;
  const double of_stress = 0.3 * bow + 50 * waves;
  const auto up_to = [](double part) {
    return part > 1 ? std::string("more than 100 %") : fmt::format("up to {:.0f} %", 100 * part);
  };
  if (of_displacement > notable_displacement || of_stress > notable_stress) {
    found.push_back(
        {Weight::minor, "coarse shells",
         fmt::format(
             "{}: its shells are coarse for so thin a curved wall: {}: take more shells, as far as the surface has "
             "them{}",
             named(body.said_at, body.name),
             rings ? fmt::format("frequencies may be off by {}", up_to(of_displacement / 2))
                   : fmt::format("displacements may be off by {}, and stress, at its faces and in the mean over the "
                                 "wall, by {}",
                                 up_to(of_displacement), up_to(of_stress)),
             rings ? ""
                   : ", or name the surface that they were fitted to (--target), by which the error of each number is "
                     "estimated")});
  }
}

// Freedoms that the fixes hold, 6 per node of one body: translations, rotations.
std::vector<std::array<bool, 6>> held_freedoms(const Model& model, std::size_t body) {
  std::vector<std::array<bool, 6>> held(model.vertices_of(body).size());
  for (const Fix& fix : model.fixes) {
    if (fix.body != body || fix.across) {
      continue;
    }
    for (const Index node : fix.nodes) {
      for (std::size_t c = 0; c < 3; ++c) {
        held[node][c] |= fix.translation[c];
        held[node][c + 3] |= fix.rotation[c];
      }
    }
  }
  return held;
}

bool cannot_move(const Model& model, std::size_t body, const std::vector<std::array<bool, 6>>& held) {
  const bool moved = std::any_of(model.fixes.begin(), model.fixes.end(),
                                 [&](const Fix& fix) { return fix.body == body && prescribes(fix); });
  const auto& triangles = model.shells[body].mesh.triangles;
  return !moved && std::all_of(triangles.begin(), triangles.end(), [&](const auto& triangle) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](Index node) { return held[node][0] && held[node][1] && held[node][2]; });
  });
}

// The nodes, vector and first freedom of a load that nodes share; none of a load on the whole body.
struct Shared {
  std::vector<Index> nodes;
  Vec3 value;
  std::size_t first;
  const char* name;
};

std::optional<Shared> shared(const Load& load) {
  if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
    return Shared{force->nodes, force->total, 0, "force"};
  }
  if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
    return Shared{moment->nodes, moment->total, 3, "moment"};
  }
  if (const auto* edge = std::get_if<EdgeLoad>(&load.kind)) {
    Shared on_edges{{}, edge->per_length, 0, "edge load"};
    for (const auto& ends : edge->edges) {
      on_edges.nodes.insert(on_edges.nodes.end(), ends.begin(), ends.end());
    }
    return on_edges;
  }
  return {};
}

bool only_held_nodes_bear(const Shared& load, const std::vector<std::array<bool, 6>>& held) {
  for (std::size_t c = 0; c < 3; ++c) {
    if (load.value[c] != 0 &&
        !std::all_of(load.nodes.begin(), load.nodes.end(), [&](Index node) { return held[node][load.first + c]; })) {
      return false;
    }
  }
  return true;
}

bool is_zero(const Load& load) {
  if (const auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
    return pressure->value == 0 && pressure->imaged_at.value_or(0) == 0;  // else the wall shrinks
  }
  if (const auto* area = std::get_if<AreaLoad>(&load.kind)) {
    return area->per_area.isZero(0);
  }
  if (const auto* gravity = std::get_if<GravityLoad>(&load.kind)) {
    return gravity->acceleration.isZero(0);
  }
  return shared(load)->value.isZero(0);
}

// Whether a ramp is zero in all states of the run; of a motion it is linear between its points.
bool stays_zero(const Ramp& ramp, const RunSettings& settings) {
  std::vector<double> times;
  if (const auto* dynamic = std::get_if<DynamicRun>(&settings.kind)) {
    times.push_back(dynamic->duration);
    for (const auto& [time, factor] : ramp.points) {
      if (time < dynamic->duration) {
        times.push_back(time);
      }
    }
  } else if (const auto* statics = std::get_if<StaticRun>(&settings.kind)) {
    times = statics->load_factors;
  } else if (const auto* frequencies = std::get_if<FrequencyRun>(&settings.kind)) {
    times = frequencies->preload.load_factors;
  }
  return !ramp.points.empty() && !times.empty() &&
         std::all_of(times.begin(), times.end(), [&](double time) { return ramp.at(time) == 0; });
}

std::string zero_when(const RunSettings& settings, const char* so) {
  return std::holds_alternative<StaticRun>(settings.kind)
             ? "at every load step: it acts between them alone, and no state is written under it; take more "
               "(--load-steps, load_steps)"
         : std::holds_alternative<FrequencyRun>(settings.kind)
             ? "where the frequencies are found: they are those without it"
             : fmt::format("during the whole run, {}", so);
}

// Whether a ramp changes by more than a tenth of its largest factor in less time than one step of a motion.
bool jumps_within_a_step(const Ramp& ramp, const RunSettings& settings) {
  const auto* dynamic = std::get_if<DynamicRun>(&settings.kind);
  if (dynamic == nullptr || dynamic->adaptive) {
    return false;
  }
  constexpr double notable = 0.1;
  double largest = 0;
  for (const auto& [time, factor] : ramp.points) {
    largest = std::max(largest, std::abs(factor));
  }
  for (std::size_t i = 0; i + 1 < ramp.points.size(); ++i) {
    const auto& [begin, from] = ramp.points[i];
    const auto& [end, to] = ramp.points[i + 1];
    if (end - begin < dynamic->step && std::abs(to - from) > notable * largest) {
      return true;
    }
  }
  return false;
}

void doubt_steps(const std::string& where, const char* what, const Ramp& ramp, const RunSettings& settings,
                 std::vector<Warning>& found) {
  if (jumps_within_a_step(ramp, settings)) {
    found.push_back({Weight::minor, "long steps",
                     fmt::format("{}: the ramp of this {} changes within less than a step, so what it sets swinging is "
                                 "lost: take shorter steps",
                                 where, what)});
  }
}

void doubt_loads(const Model& model, const RunSettings& settings,
                 const std::vector<std::vector<std::array<bool, 6>>>& held, std::vector<Warning>& found) {
  for (const Load& load : model.loads) {
    const std::string where = named(load.said_at, model.name_of(load.body));
    if (is_zero(load)) {
      found.push_back({Weight::minor, "no load", where + ": this load is zero"});
    } else if (stays_zero(load.ramp, settings)) {
      found.push_back({Weight::minor, "no load",
                       where + ": the ramp of this load is zero " + zero_when(settings, "so it never acts")});
    } else if (const auto on = shared(load); on && only_held_nodes_bear(*on, held[load.body])) {
      found.push_back({Weight::minor, "no load",
                       fmt::format("{}: this {} acts on held nodes only, so it moves nothing", where, on->name)});
    }
    doubt_steps(where, "load", load.ramp, settings, found);
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind);
        pressure != nullptr && pressure->imaged_at && pressure->value * *pressure->imaged_at < 0) {
      found.push_back({Weight::major, "imaging pressure",
                       where + ": imaged_at presses on the other face of the wall than the load: is its sign right?"});
    } else if (pressure != nullptr && pressure->imaged_at.value_or(0) < 0 && !model.is_solid(load.body)) {
      found.push_back({Weight::minor, "imaging pressure",
                       where + ": imaged_at is a suction, by which the wall is pressed together: is its sign right?"});
    } else if (pressure != nullptr && pressure->imaged_at.value_or(0) > most_in_image) {
      found.push_back({Weight::major, "imaging pressure",
                       fmt::format("{}: no organ is imaged under {}, {:.3g} mmHg{}", where,
                                   pressure_text(*pressure->imaged_at), *pressure->imaged_at / mmhg,
                                   meant(*pressure->imaged_at, {1e-3, mmhg / 1e-3}, {7e-4, most_in_image},
                                         [](double mpa) { return fmt::format("{:.4g} mmHg", mpa / mmhg); }))});
    } else if (pressure != nullptr && pressure->imaged_at.value_or(0) > 0 && pressure->value > most_in_image) {
      found.push_back(
          {Weight::minor, "imaging pressure",
           fmt::format("{}: {}, {:.3g} mmHg, is more than any organ bears, imaged under {:.3g} mmHg{}", where,
                       pressure_text(pressure->value), pressure->value / mmhg, *pressure->imaged_at / mmhg,
                       meant(pressure->value, {1e-3, mmhg / 1e-3}, {7e-4, most_in_image},
                             [](double mpa) { return fmt::format("{:.4g} mmHg", mpa / mmhg); }))});
    }
  }
  for (const Fix& fix : model.fixes) {
    if (prescribes(fix) && stays_zero(fix.ramp, settings)) {
      found.push_back({Weight::minor, "no load",
                       named(fix.said_at, model.name_of(fix.body)) + ": the ramp of this displacement is zero " +
                           zero_when(settings, "so it moves nothing")});
    }
    doubt_steps(named(fix.said_at, model.name_of(fix.body)), "displacement", fix.ramp, settings, found);
  }
}

}  // namespace

bool prescribes(const Fix& fix) {
  for (int c = 0; c < 3; ++c) {
    if (fix.translation[c] && fix.displacement[c] != 0) {
      return true;
    }
  }
  return false;
}

namespace {

bool moves(const RigidBody& body) {
  return std::ranges::any_of(tables_of(body), [](const auto& table) { return table.points.size() > 1; });
}

}  // namespace

bool is_loaded(const Model& model) {
  return !std::all_of(model.loads.begin(), model.loads.end(), is_zero) ||
         std::any_of(model.fixes.begin(), model.fixes.end(), prescribes) ||
         std::any_of(model.rigids.begin(), model.rigids.end(), moves);
}

std::vector<Warning> doubts(const Model& model, const RunSettings& settings, bool has_estimates) {
  require_valid(model);
  std::vector<Warning> found;
  std::vector<std::vector<std::array<bool, 6>>> held;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const std::size_t before = found.size();
    doubt_thickness(body, found);
    if (found.size() == before) {
      doubt_overlaps(body, found);
    }
    const Kind kind = !is_pressed(model, b) ? Kind::any : body.voxel ? Kind::organ : Kind::inflated;
    doubt_material(named(body.said_at, body.name), body.material, kind, found);
    doubt_voxels(body, found);
    if (!has_estimates) {
      doubt_coarseness(body, std::holds_alternative<FrequencyRun>(settings.kind), found);
    }
    held.push_back(held_freedoms(model, b));
    if (cannot_move(model, b, held.back())) {
      found.push_back({Weight::major, "held altogether",
                       named(body.said_at, body.name) + ": all its nodes are held, so nothing of it can move"});
    }
  }
  for (std::size_t b = model.shells.size(); b < model.body_count(); ++b) {
    const SolidBody& solid = model.solids[b - model.shells.size()];
    doubt_material(named(solid.said_at, solid.name), solid.material, Kind::any, found);
    held.push_back(held_freedoms(model, b));
  }
  doubt_loads(model, settings, held, found);
  for (const Support& bed : model.supports) {
    doubt_bed(named(bed.said_at, model.name_of(bed.body)), bed, found);
  }
  for (const Contact& contact : model.contacts) {
    if (!contact.consistent) {
      found.push_back({Weight::minor, "the paper's transfer",
                       named(contact.said_at, contact.name) +
                           ": transfer = \"paper\" spreads forces by the paper's rule, which is not in balance"});
    }
  }
  const bool needs_load =
      std::holds_alternative<StaticRun>(settings.kind) || std::holds_alternative<DynamicRun>(settings.kind);
  if (needs_load && !is_loaded(model) && !model.is_imaged_under_pressure()) {
    const std::string& place = model.shells.empty() ? model.solids.front().said_at : model.shells.front().said_at;
    found.push_back(
        {Weight::minor, "no load", named(place, "nothing loads the model, so it stays as it is: add a load")});
  }
  return found;
}

namespace {

double mean_edge(const std::vector<Vec3>& vertices, const std::vector<std::array<Index, 3>>& triangles) {
  double sum = 0;
  for (const auto& [a, b, c] : triangles) {
    sum +=
        ((vertices[b] - vertices[a]).norm() + (vertices[c] - vertices[b]).norm() + (vertices[a] - vertices[c]).norm()) /
        3;
  }
  return sum / real(std::max<std::size_t>(1, triangles.size()));
}

/// A shell on a solid whose tetrahedra are smaller than its triangles: its nodes press dents between which nothing
/// does. One whose triangles are the smaller ones bends at the edges of the flat faces, and what bends there is its
/// own.
std::optional<Warning> doubt_of_skin(const Model& model, std::size_t solid, const std::vector<double>& roughness) {
  constexpr double much_finer = 0.75, notable = 0.02, large = 0.2;
  // Of skins two to four times as fine as the faces.
  constexpr double most_of_estimate = 2.5, largest_loss = 0.95;
  const std::size_t body = model.shells.size() + solid;
  const TetMesh& mesh = model.solids[solid].mesh;
  for (const Attachment& attachment : model.attachments) {
    if (attachment.to != body || model.is_solid(attachment.body)) {
      continue;
    }
    const ShellBody& skin = model.shells[attachment.body];
    const double carried = mean_edge(skin.mesh.vertices, skin.mesh.triangles);
    const double carries = mean_edge(mesh.vertices, boundary_triangles(mesh));
    if (carries < much_finer * carried) {
      return Warning{Weight::minor, "coarse skin",
                     fmt::format("{}: carries {}, whose edges of {:.3g} mm are longer than its own of {:.3g} mm: the "
                                 "nodes dent it, so that it gives way too much, by up to about its strain times {:.3g} "
                                 "mm; take a finer mesh of {}, or larger tetrahedra",
                                 named(model.solids[solid].said_at, model.solids[solid].name), skin.name, carried,
                                 carries, carried, skin.name)};
    }
    if (const double share = roughness[attachment.body]; carried < much_finer * carries && share > notable) {
      return Warning{
          share > large ? Weight::major : Weight::minor, "fine skin",
          fmt::format("{}: carries {}, whose edges of {:.3g} mm are shorter than those of its faces, {:.3g} "
                      "mm: that shell bends where flat faces meet, and what there is may be too stiff, "
                      "so that it gives way by {:.0f} to {:.0f} % too little; attach the solid to the shell "
                      "instead, or take a mesh of {} as coarse as the faces",
                      named(model.solids[solid].said_at, model.solids[solid].name), skin.name, carried, carries,
                      100 * share, 100 * std::min(largest_loss, most_of_estimate * share), skin.name)};
    }
  }
  return std::nullopt;
}

}  // namespace

std::vector<Warning> doubts_of_solids(const Model& model, const std::vector<double>& errors,
                                      const std::vector<double>& roughness) {
  constexpr double notable = 0.05, large = 0.2;
  // Of beams and blocks that are one to ten tetrahedra thick, of any Poisson's ratio.
  constexpr double most_of_estimate = 2.2, largest_loss = 0.95;
  if (errors.size() != model.solids.size() || roughness.size() != model.shells.size()) {
    throw InputError(fmt::format("{} errors for {} solids, {} shares for {} shells", errors.size(), model.solids.size(),
                                 roughness.size(), model.shells.size()));
  }
  std::vector<Warning> found;
  for (std::size_t s = 0; s < errors.size(); ++s) {
    if (auto skin = doubt_of_skin(model, s, roughness)) {
      found.push_back(*std::move(skin));  // what the jumps of stress say, too, is of its dents
    } else if (const double error = errors[s]; error > notable) {
      const SolidBody& body = model.solids[s];
      found.push_back(
          {error > large ? Weight::major : Weight::minor, "coarse solid",
           fmt::format("{}: its tetrahedra are coarse for what it bears: by the jumps of stress between them "
                       "the body is too stiff, so that under a load it gives way by {:.0f} to {:.0f} % too little, and "
                       "forces are too high where its motion is given; take smaller ones: half their size leaves about "
                       "half of that, and then a quarter",
                       named(body.said_at, body.name), 100 * error,
                       100 * std::min(largest_loss, most_of_estimate * error))});
    }
  }
  return found;
}

std::vector<Warning> doubts_of_layers(const Model& model, const std::vector<double>& errors) {
  constexpr double notable = 0.05, large = 0.2;
  const auto worst = std::ranges::max_element(errors);
  const bool on_solid = std::ranges::any_of(model.attachments, [&](const Attachment& attachment) {
    return !model.is_solid(attachment.body) && model.is_solid(attachment.to);
  });
  if (worst == errors.end() || *worst < notable || on_solid) {  // jumps of shells on faces are of what these do
    return {};
  }
  const ShellBody& body = model.shells[narrow<std::size_t>(worst - errors.begin())];
  return {{*worst > large ? Weight::major : Weight::minor, "coarse layers",
           fmt::format("{}: the shells of layers that are attached to each other are coarse for how they bend: by the "
                       "jumps of membrane force between them, the layers give way by some {:.0f} % too much; "
                       "take finer meshes: half the size leaves a quarter of that",
                       named(body.said_at, body.name), 100 * *worst)}};
}

std::string pressure_text(double mpa) {
  constexpr std::array<std::pair<double, const char*>, 5> units{
      {{1e6, "TPa"}, {1e3, "GPa"}, {1, "MPa"}, {1e-3, "kPa"}, {1e-6, "Pa"}}};
  const auto* const unit =
      std::ranges::find_if(units, [&](const auto& u) { return std::abs(mpa) >= 0.9999999 * u.first; });
  const auto& [size, name] = unit == units.end() ? units[mpa == 0 ? 3 : 4] : *unit;
  return fmt::format("{:.4g} {}", mpa / size, name);
}

double open_at_faces(const Model& model) {
  double by_radius = 0, whole = 0;
  for (const ShellBody& body : model.shells) {
    const auto [of_body, area] = thickness_by_radius(body, curvatures_of(body.mesh, body.curved));
    by_radius += of_body / 2;
    whole += area;
  }
  return whole > 0 ? by_radius / whole : 0;
}

double share_without_inner_face(const ShellBody& body) {
  if (body.thickness.size() != 1 && body.thickness.size() != body.mesh.vertices.size()) {
    throw InputError(fmt::format("{}: {} thicknesses for {} nodes: give one, or one per node", body.name,
                                 body.thickness.size(), body.mesh.vertices.size()));
  }
  return share_thicker(body, curvatures_of(body.mesh, body.curved), 2);
}

}  // namespace tunica
