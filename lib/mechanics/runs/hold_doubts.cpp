#include "tunica/mechanics/runs/hold_doubts.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/meeting_walls.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <set>

namespace tunica {
namespace {

/// The pressure at each node of a shell at the end of the load, with its sign, MPa: the mean of its triangles'.
std::vector<double> pressures_at(const Model& model, std::size_t body) {
  const ShellMesh& mesh = model.shells[body].mesh;
  std::vector<double> sum(mesh.vertices.size(), 0), count(mesh.vertices.size(), 0);
  for (const Load& load : model.loads) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    for (std::size_t t = 0; pressure != nullptr && load.body == body && t < mesh.triangles.size(); ++t) {
      for (const Index v : mesh.triangles[t]) {
        sum[v] += share_of(pressure->shares, t) * pressure->value;
      }
    }
  }
  for (const auto& triangle : mesh.triangles) {
    for (const Index v : triangle) {
      ++count[v];
    }
  }
  for (std::size_t v = 0; v < sum.size(); ++v) {
    sum[v] /= std::max(count[v], 1.0);
  }
  return sum;
}

bool is_pressed(const std::vector<double>& pressures) {
  return std::ranges::any_of(pressures, [](double pressure) { return pressure != 0; });
}

/// Nodes of the shells on which the nodes of another body lie.
std::vector<Index> carriers(const Model& model, const Attachment& attachment) {
  const TriangleMesh mesh = flat_facets(model.shells[attachment.to].mesh);
  const ClosestPoint closest(mesh);
  const std::vector<Vec3>& places = model.vertices_of(attachment.body);
  std::vector<Index> nodes;
  for (const Index node : attachment.nodes) {
    const auto& corners = mesh.triangles[closest.closest(places[node]).triangle];
    nodes.insert(nodes.end(), corners.begin(), corners.end());
  }
  return nodes;
}

/// Per node of a body: whether a fix, a load at nodes or edges, or another body takes hold of it.
std::vector<char> touched_nodes(const Model& model, std::size_t body) {
  std::vector<char> touched(model.vertices_of(body).size(), 0);
  const auto mark = [&](const std::vector<Index>& nodes) {
    for (const Index node : nodes) {
      touched[node] = 1;
    }
  };
  for (const Fix& fix : model.fixes) {
    if (fix.body == body) {
      mark(fix.nodes);
    }
  }
  for (const Attachment& attachment : model.attachments) {
    if (!model.is_solid(attachment.to) && attachment.nodes.size() == model.vertices_of(attachment.body).size()) {
      continue;  // a layer, which ends where what carries it ends
    }
    if (attachment.body == body) {
      mark(attachment.nodes);
    } else if (attachment.to == body) {
      mark(carriers(model, attachment));
    }
  }
  for (const Load& load : model.loads) {
    if (load.body != body) {
      continue;
    }
    if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      mark(force->nodes);
    } else if (const auto* edge = std::get_if<EdgeLoad>(&load.kind)) {
      for (const auto& ends : edge->edges) {
        mark({ends[0], ends[1]});
      }
    }
  }
  return touched;
}

/// What a rim encloses.
struct Lumen {
  Vec3 area = Vec3::Zero();  ///< mm^2, normal of the plane that sees most of it, as long as what it sees
  Vec3 centre = Vec3::Zero();
  double length = 0;    ///< mm
  double pressure = 0;  ///< MPa, of the wall at the rim
  bool touched = false;
};

std::vector<Lumen> lumens_of(const ShellMesh& mesh, const std::vector<char>& touched,
                             const std::vector<double>& pressures) {
  std::vector<Lumen> lumens;
  for (const std::vector<Index>& rim : boundary_loops(flat_facets(mesh))) {
    Lumen& lumen = lumens.emplace_back();
    for (std::size_t i = 0; i < rim.size(); ++i) {
      const Vec3& a = mesh.vertices[rim[i]];
      const Vec3& b = mesh.vertices[rim[(i + 1) % rim.size()]];
      const double length = (b - a).norm();
      lumen.area += a.cross(b) / 2;
      lumen.centre += length * (a + b) / 2;
      lumen.length += length;
      lumen.pressure += pressures.empty() ? 0 : pressures[rim[i]] / real(rim.size());
      lumen.touched = lumen.touched || (!touched.empty() && touched[rim[i]] != 0);
    }
    lumen.centre /= lumen.length;
  }
  return lumens;
}

/// Whether a body is a sheet, such as a plate, whose rim goes around it and is no end of a vessel.
bool is_sheet(const ShellMesh& mesh, const std::vector<Lumen>& lumens) {
  constexpr double most_of_it = 0.7;  // of its area: half a ball has a lumen of half its area
  const double whole = area(flat_facets(mesh));
  return std::ranges::any_of(lumens, [&](const Lumen& lumen) { return lumen.area.norm() > most_of_it * whole; });
}

/// The rim that slides farthest from across the wall, of a body under pressure.
void doubt_slides(const Model& model, std::size_t b, std::vector<Warning>& found) {
  constexpr double far_off = 0.2;
  const ShellBody& body = model.shells[b];
  const Fix* worst = nullptr;
  double slant = negligible_slant;
  for (const Fix& fix : model.fixes) {
    if (const double here = fix.body == b && fix.across ? slant_of_rim(body, fix) : 0; here > slant) {
      worst = &fix;
      slant = here;
    }
  }
  if (worst == nullptr) {
    return;
  }
  Vec3 middle = Vec3::Zero();
  for (const Index node : worst->nodes) {
    middle += body.mesh.vertices[node] / real(worst->nodes.size());
  }
  found.push_back(
      {slant > far_off ? Weight::major : Weight::minor, "slanting rim",
       fmt::format("{}: the rim at {} slides in its plane, which the wall meets some {:.0f} degrees off a right angle: "
                   "stress around it may be off by {:.0f} to {:.0f} %. Hold it instead (--fix boundary, FIX=boundary), "
                   "or cut the vessel straight across",
                   named(body.said_at, body.name), where(middle),
                   std::asin(std::min(1.0, slant)) * 180 / std::numbers::pi, 1e2 * slant, 2e2 * slant)});
}

/// Where two rims, or two sides of one, run beside each other nearer than half of the wall, over more than half of one.
void doubt_gaps(const Model& model, std::size_t b, std::vector<Warning>& found) {
  constexpr double most_of_it = 0.5, apart = 4;  // apart: along a rim, of what is beside each other
  const ShellBody& body = model.shells[b];
  const std::vector<Vec3>& x = body.mesh.vertices;
  const double reach = *std::ranges::min_element(body.thickness) / 2;
  struct Edge {
    std::size_t rim = 0;
    double at = 0;  // along it, mm
    Vec3 from, to;
  };
  std::vector<Edge> edges;
  std::vector<double> lengths;
  for (const std::vector<Index>& rim : boundary_loops(flat_facets(body.mesh))) {
    double along = 0;
    for (std::size_t i = 0; i < rim.size(); ++i) {
      edges.push_back({lengths.size(), along, x[rim[i]], x[rim[(i + 1) % rim.size()]]});
      along += (edges.back().to - edges.back().from).norm();
    }
    lengths.push_back(along);
  }
  std::ranges::sort(edges, {}, [](const Edge& edge) { return std::min(edge.from.x(), edge.to.x()); });
  double longest = 0;
  for (const Edge& edge : edges) {
    longest = std::max(longest, (edge.to - edge.from).norm());
  }
  std::vector<double> beside(lengths.size(), 0), gap(lengths.size(), 0);
  std::vector<Vec3> place(lengths.size());
  for (const Edge& own : edges) {
    const Vec3 middle = (own.from + own.to) / 2;
    double nearest = infinity;
    const auto first = std::ranges::lower_bound(edges, middle.x() - reach - longest, {},
                                                [](const Edge& edge) { return std::min(edge.from.x(), edge.to.x()); });
    for (auto other = first; other != edges.end() && std::min(other->from.x(), other->to.x()) <= middle.x() + reach;
         ++other) {
      const Vec3 along = other->to - other->from;
      const double part = std::clamp((middle - other->from).dot(along) / along.squaredNorm(), 0.0, 1.0);
      const double distance = (other->from + part * along - middle).norm();
      const double between = std::abs(other->at - own.at);
      const bool same_side =
          other->rim == own.rim && std::min(between, lengths[own.rim] - between) <= longest + apart * distance;
      nearest = same_side ? nearest : std::min(nearest, distance);
    }
    if (nearest < reach) {
      beside[own.rim] += (own.to - own.from).norm();
      gap[own.rim] = std::max(gap[own.rim], nearest);
      place[own.rim] = middle;
    }
  }
  for (std::size_t rim = 0; rim < lengths.size(); ++rim) {
    if (beside[rim] > most_of_it * lengths[rim]) {
      found.push_back(
          {Weight::major, "open seam",
           fmt::format("{}: its edge at {} runs beside another one within {:.2g} mm, less than half of the wall: parts "
                       "that should join are held and pressed there like ends of a vessel: close the gap in the mesh",
                       named(body.said_at, body.name), where(place[rim]), gap[rim])});
      return;
    }
  }
}

/// The connected pieces of a shell, by their nodes; without those that no triangle has.
std::vector<std::vector<Index>> pieces_of(const ShellMesh& mesh) {
  DisjointSets joined(mesh.vertices.size());
  std::vector<char> used(mesh.vertices.size(), 0);
  for (const auto& [a, b, c] : mesh.triangles) {
    joined.join(a, b);
    joined.join(a, c);
    used[a] = used[b] = used[c] = 1;
  }
  std::map<Index, std::vector<Index>> pieces;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] != 0) {
      pieces[joined.root(narrow<Index>(i))].push_back(narrow<Index>(i));
    }
  }
  std::vector<std::vector<Index>> found;
  for (auto& [root, nodes] : pieces) {
    found.push_back(std::move(nodes));
  }
  return found;
}

struct Swing {
  double largest = 0;  ///< mm, of the whole displacement
  double rigid = 0;    ///< mm, the largest displacement by the rigid motion
  double at_held = 0;  ///< mm, the mean displacement by it of what is held
  double turn = 0;     ///< rad
  Vec3 centre = Vec3::Zero();
};

/// @param displacement  of node i of the mesh at `first` + i
/// @param held  nodes of the mesh
Swing swing_of(const ShellMesh& mesh, const std::vector<Index>& nodes, const std::vector<Vec3>& displacement,
               std::size_t first, const std::vector<char>& held) {
  Swing swing;
  Vec3 shift = Vec3::Zero();
  for (const Index i : nodes) {
    swing.centre += mesh.vertices[i] / real(nodes.size());
    shift += displacement[first + i] / real(nodes.size());
    swing.largest = std::max(swing.largest, displacement[first + i].norm());
  }
  Mat3 spread = Mat3::Zero();
  for (const Index i : nodes) {
    const Vec3 arm = mesh.vertices[i] - swing.centre;
    spread += (arm + displacement[first + i] - shift) * arm.transpose();
  }
  // Source: Kabsch 1976, "A solution for the best rotation to relate two sets of vectors".
  const Eigen::JacobiSVD<Mat3> svd(spread, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Mat3 turn = svd.matrixU() * Vec3(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  swing.turn = Eigen::AngleAxisd(turn).angle();
  double count = 0;
  for (const Index i : nodes) {
    const Vec3 arm = mesh.vertices[i] - swing.centre;
    const double moved = (turn * arm - arm + shift).norm();
    swing.rigid = std::max(swing.rigid, moved);
    swing.at_held += held[i] != 0 ? moved : 0;
    count += held[i] != 0 ? 1 : 0;
  }
  swing.at_held /= std::max(1.0, count);
  return swing;
}

}  // namespace

std::vector<Warning> doubts_of_ends(const Model& model) {
  require_valid(model);
  constexpr double least_roundness = 0.05;  // of the area that a circle as long as the rim encloses
  std::vector<Warning> found = doubts_of_meeting_walls(model);
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    doubt_gaps(model, b, found);
    const std::vector<double> pressures = pressures_at(model, b);
    if (!is_pressed(pressures)) {
      continue;
    }
    doubt_slides(model, b, found);
    const std::vector<Lumen> lumens = lumens_of(body.mesh, touched_nodes(model, b), pressures);
    if (is_sheet(body.mesh, lumens)) {
      continue;
    }
    std::size_t count = 0;
    const Lumen* widest = nullptr;
    for (const Lumen& lumen : lumens) {
      const double roundness = lumen.area.norm() * 4 * std::numbers::pi / (lumen.length * lumen.length);
      if (lumen.touched || lumen.pressure == 0 || roundness < least_roundness) {
        continue;
      }
      ++count;
      widest = widest == nullptr || lumen.area.norm() > widest->area.norm() ? &lumen : widest;
    }
    if (count > 0) {
      found.push_back(
          {Weight::minor, "free end",
           fmt::format(
               "{}: {} free, {}at {}. In the body the rest of the organ pulls there with the pressure times the lumen, "
               "{:.3g} N, which is missing here: hold the ends (--fix boundary, FIX=boundary), or let those "
               "that are cut straight across slide in their planes (--fix rims:slide, FIX=rims:slide)",
               named(body.said_at, body.name), count == 1 ? "an open end is" : fmt::format("{} open ends are", count),
               count == 1 ? "" : "the widest ", where(widest->centre),
               std::abs(widest->pressure) * widest->area.norm())});
    }
  }
  return found;
}

namespace {

std::string_view remedy_of_swings(const Model& model, std::size_t body) {
  const auto bed = std::ranges::find(model.supports, body, &Support::body);
  return bed == model.supports.end() ? "put it into a bed (--support 1e5N/m3, SUPPORT=1e5N/m3)"
         : bed->normal_only          ? "let its bed hold it in all directions (direction = \"all\" of the [[support]])"
                                     : "make its bed stiffer";
}

}  // namespace

std::vector<Warning> swings_of(const Model& model, const State& state) {
  require_valid(model);
  require_valid(model, state);
  std::vector<Warning> found;
  constexpr double most_of_it = 0.5;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const bool pushed =
        std::ranges::any_of(model.fixes, [&](const Fix& fix) { return fix.body == b && prescribes(fix); }) ||
        std::ranges::any_of(model.contacts, [&](const Contact& contact) { return contact.is_of(b); });
    if (pushed || !is_pressed(pressures_at(model, b)) || is_sheet(body.mesh, lumens_of(body.mesh, {}, {}))) {
      continue;
    }
    const double thickness = *std::ranges::max_element(body.thickness);
    std::vector<char> held(body.mesh.vertices.size(), 0);
    for (const Fix& fix : model.fixes) {
      for (const Index node :
           fix.body == b && !fix.across ? fix.nodes : std::vector<Index>()) {  // what slides may turn
        held[node] = 1;
      }
    }
    const auto pieces = pieces_of(body.mesh);
    for (const std::vector<Index>& nodes : pieces) {
      const Swing swing = swing_of(body.mesh, nodes, state.displacement, model.first_node(b), held);
      // A plate that is held all around and pressed flat moves as one, too; what is held turns about its hold.
      if (swing.rigid <= most_of_it * swing.largest || swing.rigid <= most_of_it * thickness ||
          swing.at_held > most_of_it * swing.rigid) {
        continue;
      }
      found.push_back(
          {Weight::major, "swing",
           fmt::format("{}{} moves mostly as a rigid body: {:.0f} % of its largest displacement, {:.3g} mm, by {:.2g} "
                       "degrees. What holds it in the body is missing: {}, or hold its other end, too (--fix, FIX)",
                       named(body.said_at, body.name),
                       pieces.size() > 1 ? fmt::format(", the piece at {},", where(swing.centre)) : "",
                       1e2 * std::min(swing.rigid / swing.largest, 1.0), swing.largest,
                       swing.turn * 180 / std::numbers::pi, remedy_of_swings(model, b))});
    }
  }
  return found;
}

std::vector<Warning> doubts_of_loose_bodies(const Model& model, const RunSettings& settings) {
  std::vector<Warning> found;
  if (!std::holds_alternative<StaticRun>(settings.kind) || model.contacts.empty()) {
    return found;
  }
  require_valid(model);
  const ShellSystem system = make_system(model);
  std::set<std::size_t> said;
  for (const Piece& piece : system.pieces) {
    const auto touches = [&](const Contact& contact) { return contact.is_of(piece.body); };
    const bool touched = std::ranges::any_of(model.contacts, touches);
    const bool sticks = std::ranges::any_of(
        model.contacts, [&](const Contact& contact) { return touches(contact) && contact.friction > 0; });
    const bool attached = std::ranges::any_of(
        model.attachments, [&](const Attachment& tie) { return tie.body == piece.body || tie.to == piece.body; });
    const int motions = touched && !sticks && !attached ? free_rigid_motions(system, piece) : 0;
    if (motions > 0 && said.insert(piece.body).second) {
      found.push_back(
          {Weight::note, "held by contact",
           fmt::format("{}: {} of its 6 rigid motions are held by contact without friction alone: where it is round or "
                       "flat it may spin or slide, and displacements count that: hold what should not (a [[fix]] of "
                       "single components)",
                       label_of(model, piece.body), motions)});
    }
  }
  return found;
}

std::vector<Warning> doubts_of_suction(const Model& model, const RunSettings& settings,
                                       const std::vector<Snap>& snaps) {
  constexpr double sensitive = 0.2;
  require_valid(model);
  const bool alone =
      model.solids.empty() && model.rigids.empty() && model.contacts.empty() && model.attachments.empty();
  if (!alone || !std::holds_alternative<StaticRun>(settings.kind)) {
    return {};
  }
  const auto sucked = std::ranges::find_if(model.loads, [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure != nullptr && pressure->value < 0;
  });
  if (sucked == model.loads.end()) {
    return {};
  }
  RunSettings buckling = settings;
  buckling.kind = BucklingRun{1};
  buckling.solver = Solver::direct;
  double factor = 0;
  try {
    factor = solve(model, buckling, [](const State&) {}).buckling_factors.front();
  } catch (const RequirementError&) {  // it does not buckle, or the run itself fails
    return {};
  } catch (const InputError&) {  // nothing of the kind can be asked of it
    return {};
  } catch (const MemoryError&) {  // it would take more than the run, by cg, itself
    return {};
  }
  factor = snaps.empty() ? factor : std::min(factor, snaps.front().load_factor);
  // The factor multiplies what comes on top of the image.
  const auto& pressure = std::get<PressureLoad>(sucked->kind);
  const double imaged = pressure.imaged_at.value_or(0);
  const double part = pressure.value / (imaged + factor * (pressure.value - imaged));
  if (!(part > sensitive)) {
    return {};
  }
  return {
      {Weight::major, "near buckling",
       fmt::format("{}: the suction of {} is {:.0f} % of the load at which the perfect shell buckles: a real "
                   "wall, with dents as deep as it is thick, buckles at about a third of that load. Ask for less, "
                   "or follow the path (control = \"arc-length\") of a shell with its dents",
                   named(sucked->said_at, model.name_of(sucked->body)), pressure_text(-pressure.value), 100 * part)}};
}

}  // namespace tunica
