#include "tunica/mechanics/runs/detail/supports.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <map>
#include <set>

namespace tunica {
namespace {

using Row6 = Eigen::Matrix<double, 1, 6>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

Vec3 centre_of(const ShellSystem& system, const Piece& piece) {
  Vec3 centre = Vec3::Zero();
  for (const Index i : piece.nodes) {
    centre += system.reference[i];
  }
  return centre / real(piece.nodes.size());
}

double size_of(const ShellSystem& system, const Piece& piece, const Vec3& centre) {
  double size = 0;
  for (const Index i : piece.nodes) {
    size = std::max(size, (system.reference[i] - centre).norm());
  }
  return size;
}

/// How a freedom moves in the six rigid motions: translations, rotations about the centre times its size.
Row6 rigid_row(const Vec3& arm, double size, int component) {
  Row6 row = Row6::Zero();
  if (component < 3) {
    row[component] = 1;
    // (w x arm)_c = w . (arm x e_c)
    row.tail<3>() = arm.cross(Vec3(Vec3::Unit(component))).transpose() / size;
  } else {
    row[component] = 1;
  }
  return row;
}

using Matrix36Row = Eigen::Matrix<double, 3, 6>;

/// How a node's translations (part 0) or rotations (3) move in the six rigid motions, along its own axes if it has any.
Matrix36Row rigid_rows(Index node, const Vec3& arm, double size, int part, const std::vector<const NodeAxes*>& own) {
  Matrix36Row rows;
  for (int c = 0; c < 3; ++c) {
    rows.row(c) = rigid_row(arm, size, part + c);
  }
  return own[node] == nullptr ? rows : Matrix36Row(own[node]->axes * rows);
}

std::vector<const NodeAxes*> axes_of_nodes(const ShellSystem& system) {
  std::vector<const NodeAxes*> own(system.node_count(), nullptr);
  for (const NodeAxes& axes : system.held.own_axes) {
    own[axes.node] = &axes;
  }
  return own;
}

/// A bed holds a rigid motion that it resists by more than this part of what it does to the one that it resists most.
constexpr double least_part_of_bed = 1e-4;

/// The rigid motions (columns: translation, rotation about `centre` times `size`) that held freedoms and beds leave.
Eigen::Matrix<double, 6, Eigen::Dynamic> free_motions(const ShellSystem& system, const Piece& piece, const Vec3& centre,
                                                      double size, const Configuration& configuration) {
  const std::vector<const NodeAxes*> own = axes_of_nodes(system);
  Mat6 normal = Mat6::Zero();
  Mat6 of_bed = Mat6::Zero();
  for (const Index i : piece.nodes) {
    const Vec3 arm = system.reference[i] - centre + configuration.displacement[i];
    for (const int part : {0, 3}) {
      if (part == 3 && i >= system.first_solid_node) {
        continue;
      }
      const Matrix36Row rows = rigid_rows(i, arm, size, part, own);
      for (int c = 0; c < 3; ++c) {
        if (system.held[freedom(i, narrow<std::size_t>(part + c))]) {
          normal += rows.row(c).transpose() * rows.row(c);
        }
      }
    }
    if (system.bed) {
      Matrix36Row rows;
      for (int c = 0; c < 3; ++c) {
        rows.row(c) = rigid_row(arm, size, c);
      }
      of_bed += rows.transpose() * system.bed->at(i) * rows;
    }
  }
  const Eigen::SelfAdjointEigenSolver<Mat6> bed(of_bed);
  for (int k = 0; k < 6; ++k) {
    if (bed.eigenvalues()[k] > least_part_of_bed * bed.eigenvalues()[5]) {
      normal += bed.eigenvectors().col(k) * bed.eigenvectors().col(k).transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Mat6> eigen(normal);
  const Eigen::Index count = (eigen.eigenvalues().array() < 1e-10).count();
  return eigen.eigenvectors().leftCols(count);
}

/// Translations of three nodes far apart that stop these rigid motions and nothing else: their reactions vanish when
/// the loads are in balance.
std::vector<std::size_t> determinate_supports(const ShellSystem& system, const Piece& piece, const Vec3& centre,
                                              double size, const Eigen::Matrix<double, 6, Eigen::Dynamic>& motions) {
  if (motions.cols() == 0) {
    return {};
  }
  const auto farthest = [&](auto distance) {
    return *std::max_element(piece.nodes.begin(), piece.nodes.end(),
                             [&](Index a, Index b) { return distance(a) < distance(b); });
  };
  const auto& x = system.reference;
  const Index a = farthest([&](Index i) { return (x[i] - centre).squaredNorm(); });
  const Index b = farthest([&](Index i) { return (x[i] - x[a]).squaredNorm(); });
  const Vec3 axis = (x[b] - x[a]).normalized();
  const Index c = farthest([&](Index i) { return (x[i] - x[a]).cross(axis).squaredNorm(); });
  const std::vector<const NodeAxes*> own = axes_of_nodes(system);
  Eigen::MatrixXd columns(motions.cols(), 9);
  const std::array<Index, 3> nodes{a, b, c};
  for (int k = 0; k < 3; ++k) {
    columns.middleCols<3>(3 * k) =
        motions.transpose() * rigid_rows(nodes[k], x[nodes[k]] - centre, size, 0, own).transpose();
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns);
  std::vector<std::size_t> freedoms;
  for (Eigen::Index k = 0; k < motions.cols(); ++k) {
    const int chosen = qr.colsPermutation().indices()[k];
    freedoms.push_back(freedom(nodes[chosen / 3], narrow<std::size_t>(chosen % 3)));
  }
  return freedoms;
}

/// Projectors on the translations among rigid motions and on the axes about which they turn: those of rotations about
/// the centre. A motion that is neither, such as one about a node that is held, has no part in them.
void set_projectors(const Eigen::Matrix<double, 6, Eigen::Dynamic>& motions, Piece& piece) {
  constexpr double negligible = 1e-6;
  const Mat6 onto = motions * motions.transpose();
  const auto project = [&](Eigen::Index part) {
    // Unit vectors that stay as they are.
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(onto.block<3, 3>(part, part));
    Mat3 projector = Mat3::Zero();
    for (int k = 0; k < 3; ++k) {
      if (eigen.eigenvalues()[k] > 1 - negligible) {
        projector += eigen.eigenvectors().col(k) * eigen.eigenvectors().col(k).transpose();
      }
    }
    return projector;
  };
  piece.shifts = project(0);
  piece.turns = project(3);
}

void hold_slide(ShellSystem& system, const Fix& fix, std::set<std::size_t>& sliding) {
  const Model& model = *system.model;
  const Vec3 normal = *fix.across;
  const Vec3 first = normal.unitOrthogonal();
  Mat3 axes;
  axes << normal.transpose(), first.transpose(), normal.cross(first).transpose();
  for (const Index node : fix.nodes) {
    const std::size_t global = model.first_node(fix.body) + node;
    const auto held = system.held.begin() + first_freedom(global);
    const auto count = std::count(held, held + 6, true);
    if (count == 6) {
      continue;
    }
    if (!sliding.insert(global).second) {
      throw InputError(fmt::format("{}{}: two fixes let node {} slide, each in its plane: keep one",
                                   fix.said_at.empty() ? "" : fix.said_at + ": ", model.name_of(fix.body), node));
    }
    if (count > 0) {
      throw InputError(
          fmt::format("{}{}: node {} slides in a plane, and another fix holds a part of its freedoms: hold "
                      "it altogether, or let it slide",
                      fix.said_at.empty() ? "" : fix.said_at + ": ", model.name_of(fix.body), node));
    }
    system.held.own_axes.push_back({narrow<Index>(global), axes});
    held[0] = held[4] = held[5] = true;
  }
}

}  // namespace

bool held_by_rigid_motions(const Model& model, std::size_t body) {
  return std::any_of(model.rigid_motions.begin(), model.rigid_motions.end(),
                     [&](const RigidMotionsFix& fix) { return fix.body == body; });
}

namespace {

void hold_balanced_motions(ShellSystem& system) {
  const Model& model = *system.model;
  system.balancing.clear();
  for (Piece& piece : system.pieces) {
    piece.balanced = held_by_rigid_motions(model, piece.body);
    if (!piece.balanced) {
      continue;
    }
    const Vec3 centre = centre_of(system, piece);
    const double size = size_of(system, piece, centre);
    const auto motions = free_motions(system, piece, centre, size, reference_configuration(system));
    set_projectors(motions, piece);
    for (const std::size_t freedom : determinate_supports(system, piece, centre, size, motions)) {
      system.held[freedom] = true;
      system.balancing.push_back(freedom);
    }
  }
}

/// Per node, 1 along the world axes that the fixes' components hold. Nodes that slide in planes have none: they do not
/// turn about the wall's normal, nor about the axis by which their edges would bulge.
struct HeldDirections {
  std::vector<Vec3> translations, rotations;
};

HeldDirections held_directions(const ShellSystem& system) {
  const Model& model = *system.model;
  const std::vector<Vec3> none(system.node_count(), Vec3::Zero());
  HeldDirections held{none, none};
  for (const Fix& fix : model.fixes) {
    for (const Index node : fix.nodes) {
      const std::size_t global = model.first_node(fix.body) + node;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto k = narrow<Eigen::Index>(c);
        held.translations[global][k] = std::max(held.translations[global][k], fix.translation[c] ? 1.0 : 0.0);
        held.rotations[global][k] = std::max(held.rotations[global][k], fix.rotation[c] ? 1.0 : 0.0);
      }
    }
  }
  return held;
}

using Edges = std::set<std::pair<Index, Index>>;  // by their ends

/// Of rims that other bodies carry, and that may turn there.
Edges carried_edges(const ShellSystem& system) {
  const Model& model = *system.model;
  std::vector<char> is_carried(system.node_count(), 0);
  for (const Carried& carried : system.carried) {
    is_carried[carried.node] = carried.turns ? 0 : 1;
  }
  Edges edges;
  for (std::size_t b = 0; !system.carried.empty() && b < model.shells.size(); ++b) {
    const TriangleMesh facets = flat_facets(model.shells[b].mesh);
    const auto first = narrow<Index>(model.first_node(b));
    for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {
      const Index i = facets.triangles[t][k] + first, j = facets.triangles[t][(k + 1) % 3] + first;
      if (is_carried[i] != 0 && is_carried[j] != 0) {
        edges.insert(std::minmax(i, j));
      }
    }
  }
  return edges;
}

Edges loaded_edges(const Model& model) {
  Edges edges;
  for (const Load& load : model.loads) {
    const auto* of_edges = std::get_if<EdgeLoad>(&load.kind);
    if (of_edges != nullptr && !model.is_solid(load.body)) {
      const auto first = narrow<Index>(model.first_node(load.body));
      for (const auto& [a, b] : of_edges->edges) {
        edges.insert(std::minmax(a + first, b + first));
      }
    }
  }
  return edges;
}

}  // namespace

void keep_held_edges(ShellSystem& system) {
  const HeldDirections held = held_directions(system);
  const Edges loaded = loaded_edges(*system.model), carried = carried_edges(system);
  for (ShellElement& element : system.elements) {
    const Vec3 normal = element.axes.row(2).transpose();
    for (std::size_t k = 0; k < 3; ++k) {
      const auto next = (k + 1) % 3;
      const Vec3 along = (element.from_centroid.col(next) - element.from_centroid.col(k)).normalized();
      const Vec3 across = along.cross(normal);
      double in_plane = 1, out_of_plane = 1, turning = 0;
      for (const Index node : {element.nodes[k], element.nodes[next]}) {
        in_plane = std::min(in_plane, held.translations[node].dot(across.cwiseAbs2()));
        out_of_plane = std::min(out_of_plane, held.translations[node].dot(normal.cwiseAbs2()));
        turning = std::max(turning, 1 - held.rotations[node].dot(normal.cwiseAbs2()));
      }
      element.bow.col(k) *= 1 - in_plane * (element.curved ? 1 : turning);
      element.bending_edges[k] = 1 - in_plane * out_of_plane;
      const std::pair<Index, Index> edge = std::minmax(element.nodes[k], element.nodes[next]);
      if (carried.contains(edge) || (element.curved && loaded.contains(edge))) {
        element.bow.col(k).setZero();
        element.bending_edges[k] = 0;
      }
    }
  }
}

void make_supports(ShellSystem& system) {
  const Model& model = *system.model;
  system.held.assign(freedom(system.node_count(), 0), false);
  system.held.own_axes.clear();
  system.prescribed.clear();
  std::map<std::size_t, std::pair<double, std::size_t>> values;  // freedom -> (displacement, fix)
  for (std::size_t f = 0; f < model.fixes.size(); ++f) {
    const Fix& fix = model.fixes[f];
    if (fix.across) {
      continue;
    }
    for (const Index node : fix.nodes) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t moved = freedom(model.first_node(fix.body) + node, c);
        if (fix.translation[c]) {
          const double value = fix.displacement[c];
          const auto [place, is_new] = values.emplace(moved, std::pair(value, f));
          if (!is_new && place->second.first != value) {
            const Fix& other = model.fixes[place->second.second];
            throw InputError(fmt::format(
                "{}{}: two fixes prescribe different displacements {} mm{} and {} mm along {} of node {}: keep one",
                fix.said_at.empty() ? "" : fix.said_at + ": ", model.name_of(fix.body), place->second.first,
                other.said_at.empty() ? "" : " (" + other.said_at + ")", value, "xyz"[c], node));
          }
          system.held[moved] = true;
        }
        if (fix.rotation[c] && !model.is_solid(fix.body)) {
          system.held[moved + 3] = true;
        }
      }
    }
  }
  for (const auto& [freedom, entry] : values) {
    if (entry.first != 0) {
      system.prescribed.push_back({freedom, entry.first, entry.second});
    }
  }
  std::set<std::size_t> sliding;
  const Fix* slide = nullptr;
  for (const Fix& fix : model.fixes) {
    if (fix.across) {
      slide = &fix;
      hold_slide(system, fix, sliding);
    }
  }
  if (slide != nullptr && sliding.empty()) {
    throw InputError(
        fmt::format("{}{}: no rim is left to slide, for other fixes hold all of them altogether: keep one "
                    "of them",
                    slide->said_at.empty() ? "" : slide->said_at + ": ", model.name_of(slide->body)));
  }
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    if (system.used[i] == 0) {
      std::fill_n(system.held.begin() + first_freedom(i), 6, true);
    } else if (i >= system.first_solid_node) {  // the fourth is the pressure
      std::fill_n(system.held.begin() + first_freedom(i) + 4, 2, true);
    }
  }
  hold_balanced_motions(system);
  for (const Carried& c : system.carried) {
    std::fill_n(system.held.begin() + first_freedom(c.node), c.freedoms(), true);
  }
}

void set_free_motions(const ShellSystem& system, Piece& piece) {
  const Vec3 centre = centre_of(system, piece);
  set_projectors(free_motions(system, piece, centre, size_of(system, piece, centre), reference_configuration(system)),
                 piece);
}

void hold_free_motions(ShellSystem& system, const Piece& piece) {
  const Vec3 centre = centre_of(system, piece);
  const double size = size_of(system, piece, centre);
  const auto motions = free_motions(system, piece, centre, size, reference_configuration(system));
  for (const std::size_t freedom : determinate_supports(system, piece, centre, size, motions)) {
    system.held[freedom] = true;
  }
}

void release_rigid_motion_supports(ShellSystem& system) {
  for (const std::size_t freedom : system.balancing) {
    system.held[freedom] = false;
  }
  system.balancing.clear();
}

int free_rigid_motions(const ShellSystem& system, const Piece& piece) {
  return narrow<int>(free_rigid_modes(system, piece, reference_configuration(system)).size());
}

std::vector<VectorX> free_rigid_modes(const ShellSystem& system, const Piece& piece,
                                      const Configuration& configuration) {
  const Vec3 centre = centre_of(system, piece);
  const double size = size_of(system, piece, centre);
  const auto motions = free_motions(system, piece, centre, size, configuration);
  std::vector<VectorX> modes;
  for (Eigen::Index k = 0; k < motions.cols(); ++k) {
    VectorX mode = VectorX::Zero(first_freedom(system.node_count()));
    for (const Index i : piece.nodes) {
      const Vec3 arm = system.reference[i] - centre + configuration.displacement[i];
      for (int c = 0; c < 6; ++c) {
        const double motion = rigid_row(arm, size, c) * motions.col(k);
        mode[first_freedom(i) + c] = c < 3 ? motion : motion / size;
      }
    }
    modes.push_back(mode);
  }
  return modes;
}

double imbalance(const ShellSystem& system, const Piece& piece, const VectorX& external) {
  const Vec3 centre = centre_of(system, piece);
  const double size = size_of(system, piece, centre);
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
  double magnitude = 0;
  for (const Index i : piece.nodes) {
    const Vec3 f = external.segment<3>(first_freedom(i));
    const Vec3 m = external.segment<3>(first_freedom(i) + 3);
    force += f;
    moment += (system.reference[i] - centre).cross(f) + m;
    magnitude += f.norm() + m.norm() / size;
  }
  return magnitude > 0 ? std::max((piece.shifts * force).norm(), (piece.turns * moment).norm() / size) / magnitude : 0;
}

void take_out_rigid_motion(const ShellSystem& system, const Piece& piece, Configuration& configuration) {
  double weight = 0;
  Vec3 centre = Vec3::Zero();
  for (const Index i : piece.nodes) {
    weight += system.area[i];
    centre += system.area[i] * system.reference[i];
  }
  centre /= weight;
  for (int iteration = 0; iteration < 30; ++iteration) {
    Vec3 shift = Vec3::Zero();
    Vec3 moment = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (const Index i : piece.nodes) {
      shift += system.area[i] / weight * configuration.displacement[i];
    }
    for (const Index i : piece.nodes) {
      const Vec3 arm = system.reference[i] - centre;
      const Vec3 now = arm + configuration.displacement[i] - shift;
      moment += system.area[i] * arm.cross(configuration.displacement[i] - shift);
      inertia += system.area[i] * (arm.dot(now) * Mat3::Identity() - now * arm.transpose());
    }
    shift = piece.shifts * shift;
    const Vec3 turn = -(piece.turns * inertia * piece.turns + inertia.trace() * (Mat3::Identity() - piece.turns))
                           .partialPivLu()
                           .solve(piece.turns * moment);
    const Eigen::Quaterniond q = exponential(turn);
    // (q - 1) x, so that small displacements keep their digits.
    const auto change = [&](const Vec3& x) {
      const Vec3 t = 2 * q.vec().cross(x);
      return Vec3(q.w() * t + q.vec().cross(t));
    };
    for (const Index i : piece.nodes) {
      Vec3& u = configuration.displacement[i];
      u -= shift;
      u += change(system.reference[i] - centre + u);
      configuration.rotation[i] = (q * configuration.rotation[i]).normalized();
    }
    if (!(turn.norm() > 1e-14)) {
      break;
    }
  }
}

void take_out_linear_rigid_motion(const ShellSystem& system, VectorX& displacement) {
  for (const Piece& piece : system.pieces) {
    if (!piece.balanced) {
      continue;
    }
    double weight = 0;
    Vec3 centre = Vec3::Zero();
    Vec3 shift = Vec3::Zero();
    for (const Index i : piece.nodes) {
      weight += system.area[i];
      centre += system.area[i] * system.reference[i];
      shift += system.area[i] * displacement.segment<3>(first_freedom(i));
    }
    centre /= weight;
    shift /= weight;
    Vec3 moment = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (const Index i : piece.nodes) {
      const Vec3 arm = system.reference[i] - centre;
      moment += system.area[i] * arm.cross(displacement.segment<3>(first_freedom(i)) - shift);
      inertia += system.area[i] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
    }
    const Vec3 turn = (piece.turns * inertia * piece.turns + inertia.trace() * (Mat3::Identity() - piece.turns))
                          .ldlt()
                          .solve(piece.turns * moment);
    shift = piece.shifts * shift;
    for (const Index i : piece.nodes) {
      displacement.segment<3>(first_freedom(i)) -= shift + turn.cross(system.reference[i] - centre);
      displacement.segment<3>(first_freedom(i) + 3) -= turn;
    }
  }
}

}  // namespace tunica
