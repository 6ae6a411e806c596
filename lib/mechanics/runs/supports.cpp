#include "tunica/mechanics/runs/detail/supports.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <map>

namespace tunica {
namespace {

using Row6 = Eigen::Matrix<double, 1, 6>;

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

/// Six translations of three nodes far apart that stop every rigid motion and nothing else: their reactions vanish
/// when the loads are in balance.
std::vector<std::size_t> determinate_supports(const ShellSystem& system, const Piece& piece) {
  const auto farthest = [&](auto distance) {
    return *std::max_element(piece.nodes.begin(), piece.nodes.end(),
                             [&](Index a, Index b) { return distance(a) < distance(b); });
  };
  const Vec3 centre = centre_of(system, piece);
  const double size = size_of(system, piece, centre);
  const auto& x = system.reference;
  const Index a = farthest([&](Index i) { return (x[i] - centre).squaredNorm(); });
  const Index b = farthest([&](Index i) { return (x[i] - x[a]).squaredNorm(); });
  const Vec3 axis = (x[b] - x[a]).normalized();
  const Index c = farthest([&](Index i) { return (x[i] - x[a]).cross(axis).squaredNorm(); });
  Eigen::Matrix<double, 6, 9> columns;
  const std::array<Index, 3> nodes{a, b, c};
  for (int k = 0; k < 9; ++k) {
    const Index node = nodes[k / 3];
    columns.col(k) = rigid_row(x[node] - centre, size, k % 3).transpose();
  }
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 6, 9>> qr(columns);
  std::vector<std::size_t> freedoms;
  for (int k = 0; k < 6; ++k) {
    const int chosen = qr.colsPermutation().indices()[k];
    freedoms.push_back(freedom(nodes[chosen / 3], narrow<std::size_t>(chosen % 3)));
  }
  return freedoms;
}

}  // namespace

bool held_by_rigid_motions(const Model& model, std::size_t body) {
  return std::any_of(model.rigid_motions.begin(), model.rigid_motions.end(),
                     [&](const RigidMotionsFix& fix) { return fix.body == body; });
}

void make_supports(ShellSystem& system, const Model& model) {
  system.held.assign(freedom(system.node_count(), 0), false);
  system.prescribed.clear();
  std::map<std::size_t, std::pair<double, std::size_t>> values;  // freedom -> (displacement, fix)
  for (std::size_t f = 0; f < model.fixes.size(); ++f) {
    const Fix& fix = model.fixes[f];
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
  for (const Piece& piece : system.pieces) {
    if (held_by_rigid_motions(model, piece.body)) {
      for (const std::size_t freedom : determinate_supports(system, piece)) {
        system.held[freedom] = true;
      }
    }
  }
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    if (system.used[i] == 0) {
      std::fill_n(system.held.begin() + first_freedom(i), 6, true);
    } else if (i >= system.first_solid_node) {  // the fourth is the pressure
      std::fill_n(system.held.begin() + first_freedom(i) + 4, 2, true);
    }
  }
  for (const Carried& c : system.carried) {
    std::fill_n(system.held.begin() + first_freedom(c.node), 3, true);
  }
}

void hold_free_motions(ShellSystem& system, const Piece& piece) {
  const std::vector<VectorX> modes = free_rigid_modes(system, piece, reference_configuration(system));
  Eigen::MatrixXd moves(modes.size(), 3 * piece.nodes.size());
  for (Eigen::Index k = 0; k < moves.rows(); ++k) {
    for (std::size_t i = 0; i < piece.nodes.size(); ++i) {
      moves.block<1, 3>(k, narrow<Eigen::Index>(3 * i)) =
          modes[k].segment<3>(first_freedom(piece.nodes[i])).transpose();
    }
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(moves);
  for (Eigen::Index k = 0; k < moves.rows(); ++k) {
    const auto chosen = narrow<std::size_t>(qr.colsPermutation().indices()[k]);
    system.held[freedom(piece.nodes[chosen / 3], chosen % 3)] = true;
  }
}

void release_rigid_motion_supports(ShellSystem& system, const Model& model) {
  for (const Piece& piece : system.pieces) {
    if (held_by_rigid_motions(model, piece.body)) {
      for (const Index i : piece.nodes) {
        std::fill_n(system.held.begin() + first_freedom(i), 6, false);
      }
    }
  }
}

int free_rigid_motions(const ShellSystem& system, const Piece& piece) {
  return narrow<int>(free_rigid_modes(system, piece, reference_configuration(system)).size());
}

std::vector<VectorX> free_rigid_modes(const ShellSystem& system, const Piece& piece,
                                      const Configuration& configuration) {
  const Vec3 centre = centre_of(system, piece);
  const double size = size_of(system, piece, centre);
  const auto row_of = [&](Index node, int component) {
    return rigid_row(system.reference[node] - centre + configuration.displacement[node], size, component);
  };
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Index i : piece.nodes) {
    for (int c = 0; c < 6; ++c) {
      if (system.held[freedom(i, narrow<std::size_t>(c))] && (c < 3 || i < system.first_solid_node)) {
        const Row6 row = row_of(i, c);
        normal += row.transpose() * row;
      }
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(normal);
  std::vector<VectorX> modes;
  for (int k = 0; k < 6; ++k) {
    if (eigen.eigenvalues()[k] < 1e-10) {
      VectorX mode = VectorX::Zero(first_freedom(system.node_count()));
      for (const Index i : piece.nodes) {
        for (int c = 0; c < 6; ++c) {
          const double motion = row_of(i, c) * eigen.eigenvectors().col(k);
          mode[first_freedom(i) + c] = c < 3 ? motion : motion / size;
        }
      }
      modes.push_back(mode);
    }
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
  return magnitude > 0 ? std::max(force.norm(), moment.norm() / size) / magnitude : 0;
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
    const Vec3 turn = -inertia.partialPivLu().solve(moment);
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

void take_out_linear_rigid_motion(const ShellSystem& system, const Model& model, VectorX& displacement) {
  for (const Piece& piece : system.pieces) {
    if (!held_by_rigid_motions(model, piece.body)) {
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
    const Vec3 turn = inertia.ldlt().solve(moment);
    for (const Index i : piece.nodes) {
      displacement.segment<3>(first_freedom(i)) -= shift + turn.cross(system.reference[i] - centre);
      displacement.segment<3>(first_freedom(i) + 3) -= turn;
    }
  }
}

}  // namespace tunica
