#include "tunica/mechanics/contact/carried.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <map>

namespace tunica {
namespace {

constexpr double farthest_share = 1;  // of a corner, below zero: as far out as the tetrahedron is high
constexpr double inside = 1e-9;       // of a tetrahedron, by its smallest coordinate: round-off
constexpr int search_level = 4;       // pieces per edge of a face, on which the search for the nearest point begins

/// Nearest points of one body's surface in the reference.
class BodySurface {
public:
  BodySurface(const Surfaces& surfaces, std::size_t body, const std::vector<Vec3>& reference)
      : surfaces_(surfaces),
        reference_(reference),
        rest_(Configuration::at_rest(reference.size())),
        tree_(pieces(body)) {}

  /// @return face, and the parameters on it
  [[nodiscard]] std::pair<std::size_t, Vec2> nearest(const Vec3& p) const {
    const ClosestPoint::Hit hit = tree_.closest(p);
    const std::size_t face = faces_[hit.triangle];
    const PatchMap map(surfaces_.faces[face], reference_, rest_);
    Vec2 start = (at_[hit.triangle][0] + at_[hit.triangle][1] + at_[hit.triangle][2]) / 3;
    return {face, nearest_on_face(surfaces_.faces[face], map, p, start)};
  }

private:
  TriangleMesh pieces(std::size_t body) {
    TriangleMesh mesh;
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      const SurfaceFace& face = surfaces_.faces[f];
      const PatchMap map(face, reference_, rest_);
      const int level = face.curved ? search_level : 1;
      const auto add = [&](const Vec2& a, const Vec2& b, const Vec2& c) {
        const auto first = narrow<Index>(mesh.vertices.size());
        for (const Vec2& at : {a, b, c}) {
          mesh.vertices.push_back(map.point(patch_weights(face, at)));
        }
        mesh.triangles.push_back({first, first + 1, first + 2});
        faces_.push_back(f);
        at_.push_back({a, b, c});
      };
      for (int i = 0; i < level; ++i) {
        for (int j = 0; i + j < level; ++j) {
          const auto at = [&](int x, int y) { return Vec2(real(x) / level, real(y) / level); };
          add(at(i, j), at(i + 1, j), at(i, j + 1));
          if (i + j + 1 < level) {
            add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
          }
        }
      }
    }
    return mesh;
  }

  const Surfaces& surfaces_;
  const std::vector<Vec3>& reference_;
  Configuration rest_;
  std::vector<std::size_t> faces_;
  std::vector<std::array<Vec2, 3>> at_;
  ClosestPoint tree_;
};

/// Barycentric coordinates of a point's foot on the plane of a facet, and its height over that.
std::pair<Vec3, double> over_facet(const std::array<Index, 3>& nodes, const Vec3& p,
                                   const std::vector<Vec3>& reference) {
  const Vec3& origin = reference[nodes[0]];
  Eigen::Matrix<double, 3, 2> sides;
  sides << reference[nodes[1]] - origin, reference[nodes[2]] - origin;
  const Vec3 normal = sides.col(0).cross(sides.col(1)).normalized();
  const Vec2 parts = (sides.transpose() * sides).inverse() * (sides.transpose() * (p - origin));
  return {Vec3(1 - parts.sum(), parts[0], parts[1]), normal.dot(p - origin)};
}

/// Of the faces that meet in the nearest point, the one over which the point lies most.
std::size_t face_below(const Surfaces& surfaces, std::size_t body, std::size_t nearest, const Vec2& at, const Vec3& p,
                       const std::vector<Vec3>& reference) {
  constexpr double round_off = 1e-6;
  const auto& nodes = surfaces.faces[nearest].nodes;
  const Vec3 foot = (1 - at.sum()) * reference[nodes[0]] + at[0] * reference[nodes[1]] + at[1] * reference[nodes[2]];
  std::size_t best = nearest;
  double most = over_facet(nodes, p, reference).second;
  for (std::size_t f = surfaces.first[body]; f < surfaces.first[body + 1]; ++f) {
    const auto& others = surfaces.faces[f].nodes;
    if (std::ranges::find_first_of(nodes, others) == nodes.end()) {
      continue;
    }
    const auto [shares, off] = over_facet(others, foot, reference);
    const double height = over_facet(others, p, reference).second;
    const bool meets = shares.minCoeff() > -round_off &&
                       std::abs(off) < round_off * (reference[others[1]] - reference[others[0]]).norm();
    if (meets && height > most) {
      most = height;
      best = f;
    }
  }
  return best;
}

/// The tetrahedron that holds a point, or of several, or none, the one with the largest smallest coordinate.
/// Cost: linear in the tetrahedra, for each point.
std::pair<std::size_t, Eigen::Vector4d> find_tetrahedron(const TetMesh& mesh, const Vec3& p) {
  std::pair<std::size_t, Eigen::Vector4d> best{0, Eigen::Vector4d::Constant(-infinity)};
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const auto& v = mesh.tetrahedra[t];
    const Vec3& x0 = mesh.vertices[v[0]];
    Mat3 edges;
    edges << mesh.vertices[v[1]] - x0, mesh.vertices[v[2]] - x0, mesh.vertices[v[3]] - x0;
    const Vec3 b = edges.inverse() * (p - x0);
    const Eigen::Vector4d all(1 - b.sum(), b[0], b[1], b[2]);
    if (all.minCoeff() > best.second.minCoeff()) {
      best = {t, all};
    }
  }
  return best;
}

bool is_on_solid(const Carried& c) { return c.carriers.size() == 4 || c.height; }

/// The mean of three rotations, shared: the direction of the mean quaternion p = sum of b_k q_k.
class MeanRotation {
public:
  MeanRotation(const Carried& c, const Configuration& configuration) : shares_(c.shares.head<3>()) {
    const Eigen::Quaterniond& first = configuration.rotation[c.carriers[0]];
    std::array<Eigen::Vector4d, 3> q;
    Eigen::Vector4d p = Eigen::Vector4d::Zero();
    for (int k = 0; k < 3; ++k) {
      q[k] = configuration.rotation[c.carriers[k]].coeffs();
      q[k] *= q[k].dot(first.coeffs()) < 0 ? -1 : 1;  // both signs are the same rotation
      p += shares_[k] * q[k];
    }
    length_ = p.norm();
    rotation_.coeffs() = p / length_;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Quaterniond apart = Eigen::Quaterniond(q[k]) * rotation_.conjugate();
      cosine_[k] = apart.w();
      sine_[k] = apart.vec();
    }
  }

  [[nodiscard]] const Eigen::Quaterniond& rotation() const { return rotation_; }

  /// Its spin by that of node k.
  [[nodiscard]] Mat3 derivative(int k) const {
    return shares_[k] / length_ * (cosine_[k] * Mat3::Identity() - skew(sine_[k]));
  }

  /// Of the moment of node i under a moment on the mean, by the spin of node j.
  [[nodiscard]] Mat3 second_derivative(const Vec3& moment, int i, int j) const {
    const Mat3 turned = skew(moment);
    const Mat3 by_mean =
        0.5 * (moment * sine_[i].transpose() + turned * (cosine_[i] * Mat3::Identity() + skew(sine_[i])));
    Mat3 result = shares_[i] / length_ * by_mean * derivative(j) +
                  shares_[j] / (2 * length_) * derivative(i).transpose() * moment * sine_[j].transpose();
    if (i == j) {
      result -= shares_[i] / (2 * length_) *
                (moment * sine_[i].transpose() + turned * (cosine_[i] * Mat3::Identity() - skew(sine_[i])));
    }
    return result;
  }

private:
  Vec3 shares_;
  double length_ = 0;
  Eigen::Quaterniond rotation_;
  std::array<double, 3> cosine_{};  // of q_k q*, half the rotation from the mean to node k
  std::array<Vec3, 3> sine_;
};

/// The normal of a triangle of points, and how it turns with them; points 1 and 2 count from point 0.
class FacetNormal {
public:
  FacetNormal(const std::vector<Index>& nodes, const std::vector<Vec3>& reference, const Configuration& configuration)
      : FacetNormal(between(nodes, 1, reference, configuration), between(nodes, 2, reference, configuration)) {}
  FacetNormal(const Vec3& first, const Vec3& second) {
    const Vec3 twice = first.cross(second);
    length_ = twice.norm();
    normal_ = twice / length_;
    across_ = (Mat3::Identity() - normal_ * normal_.transpose()) / length_;
    of_points_ = {skew(second) - skew(first), -skew(second), skew(first)};
  }

  [[nodiscard]] const Vec3& normal() const { return normal_; }
  [[nodiscard]] Mat3 derivative(std::size_t k) const { return across_ * of_points_[k]; }  ///< by point k
  /// Of force.n, by points i and j.
  [[nodiscard]] Mat3 second_derivative(const Vec3& force, std::size_t i, std::size_t j) const {
    constexpr std::array<double, 3> first{-1, 1, 0}, second{-1, 0, 1};
    const Vec3 g = across_ * force;
    const Vec3 a = of_points_[i].transpose() * g, b = of_points_[j].transpose() * g;
    const Vec3 n_i = of_points_[i].transpose() * normal_, n_j = of_points_[j].transpose() * normal_;
    return (second[i] * first[j] - first[i] * second[j]) * skew(g) -
           (a * n_j.transpose() + n_i * b.transpose() +
            force.dot(normal_) * of_points_[i].transpose() * across_ * of_points_[j]) /
               length_;
  }

private:
  static Vec3 between(const std::vector<Index>& nodes, std::size_t k, const std::vector<Vec3>& reference,
                      const Configuration& configuration) {
    return reference[nodes[k]] - reference[nodes[0]] + configuration.displacement[nodes[k]] -
           configuration.displacement[nodes[0]];
  }

  double length_ = 0;
  Vec3 normal_;
  Mat3 across_;
  std::array<Mat3, 3> of_points_;  // derivatives of twice the area's vector
};

/// How the surface of a shell's face is turned in a point. The patch says how its normal n is, as it says where it is:
/// a moment on the mean of the nodes' rotations would bend a shell from within four times less than one on its normal.
/// About the normal it is a tangent e, turned by that mean and laid into the surface, that says it: e1 = e - s n, s =
/// e.n (normalised), e2 = n x e1. Spin: n x dn + n (n - k e1).mean - k n e2.dn, where k = s / (e.e1).
class SurfaceRotation {
public:
  using Matrix3x18 = Eigen::Matrix<double, 3, 18>;

  SurfaceRotation(const Carried& c, const PatchMap& map, const Configuration& configuration)
      : carried_(c),
        map_(map),
        mean_(c, configuration),
        normal_(map.from_origin(c.slopes[0]), map.from_origin(c.slopes[1])),
        n_(normal_.normal()),
        e_(mean_.rotation() * Vec3(c.frame.col(0))),
        e1_((e_ - n_.dot(e_) * n_).normalized()),
        e2_(n_.cross(e1_)),
        cosine_(e1_.dot(e_)),
        k_(n_.dot(e_) / cosine_) {
    Mat3 frame;
    frame << e1_, e2_, n_;
    rotation_ = frame * c.frame.transpose();
    by_normal_ = skew(n_) - k_ * n_ * e2_.transpose();
    by_mean_ = n_ * (n_ - k_ * e1_).transpose();
  }

  [[nodiscard]] const Mat3& rotation() const { return rotation_; }

  /// Its spin by the nodes' displacements and spins. @pre the map is linearised, here and below
  [[nodiscard]] Matrix3x18 derivative() const { return by_normal_ * of_normal() + by_mean_ * of_mean(); }

  /// Of the forces and moments of the nodes under a moment, by the nodes' displacements and spins.
  [[nodiscard]] Matrix18 second_derivative(const Vec3& moment) const {
    const double about = moment.dot(n_);
    const Vec3 on_normal = moment.cross(n_) - about * k_ * e2_, on_mean = about * (n_ - k_ * e1_);
    const Matrix3x18 normal = of_normal(), mean = of_mean(), spin = derivative();
    // Of k, by the normal and the spins that the tangents see.
    const Eigen::Matrix<double, 1, 18> of_k =
        (e_.transpose() * normal + e_.cross(n_).transpose() * mean -
         k_ * (e1_.cross(e_).transpose() * spin + e_.cross(e1_).transpose() * mean)) /
        cosine_;
    const Eigen::Matrix<double, 1, 18> of_about = moment.transpose() * normal;
    const Matrix3x18 of_on_normal =
        skew(moment) * normal - e2_ * (k_ * of_about + about * of_k) + about * k_ * skew(e2_) * spin;
    const Matrix3x18 of_on_mean = (n_ - k_ * e1_) * of_about + about * (normal - e1_ * of_k + k_ * skew(e1_) * spin);
    Matrix18 result = normal.transpose() * of_on_normal + mean.transpose() * of_on_mean;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        result.block<3, 3>(6 * i + 3, 6 * j + 3) += mean_.second_derivative(on_mean, i, j);
      }
    }
    PatchMap::Points forces = PatchMap::Points::Zero();
    PatchMap::Matrix27 of_points = PatchMap::Matrix27::Zero();
    for (std::size_t a = 0; a < 2; ++a) {
      forces += normal_.derivative(a + 1).transpose() * on_normal * carried_.slopes[a].transpose();
      for (std::size_t b = 0; b < 2; ++b) {
        const Mat3 second = normal_.second_derivative(on_normal, a + 1, b + 1);
        for (int i = 0; i < 9; ++i) {
          for (int j = 0; j < 9; ++j) {
            of_points.block<3, 3>(3 * i, 3 * j) += carried_.slopes[a][i] * carried_.slopes[b][j] * second;
          }
        }
      }
    }
    return result + map_.stiffness(of_points, forces);
  }

private:
  [[nodiscard]] Matrix3x18 of_normal() const {
    return normal_.derivative(1) * map_.derivative(carried_.slopes[0]) +
           normal_.derivative(2) * map_.derivative(carried_.slopes[1]);
  }
  [[nodiscard]] Matrix3x18 of_mean() const {
    Matrix3x18 result = Matrix3x18::Zero();
    for (int k = 0; k < 3; ++k) {
      result.block<3, 3>(0, 6 * k + 3) = mean_.derivative(k);
    }
    return result;
  }

  const Carried& carried_;
  const PatchMap& map_;
  MeanRotation mean_;
  FacetNormal normal_;
  Vec3 n_, e_, e1_, e2_;
  double cosine_, k_;
  Mat3 rotation_, by_normal_, by_mean_;
};

/// By 6 per carrier: of x, and of the spin where it turns.
using Derivative = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 24>;

Derivative derivative(const Carried& c, const Surfaces& surfaces, const std::vector<Vec3>& reference,
                      const Configuration& configuration) {
  const auto count = narrow<Eigen::Index>(c.carriers.size());
  Derivative result = Derivative::Zero(c.freedoms(), 6 * count);
  if (is_on_solid(c)) {
    for (Eigen::Index k = 0; k < count; ++k) {
      result.block<3, 3>(0, 6 * k).diagonal().setConstant(c.shares[k]);
    }
    if (c.height) {
      const FacetNormal facet(c.carriers, reference, configuration);
      for (std::size_t k = 0; k < 3; ++k) {
        result.block<3, 3>(0, first_freedom(k)) += *c.height * facet.derivative(k);
      }
    }
    return result;
  }
  PatchMap map(surfaces.faces[c.face], reference, configuration);
  map.linearise();
  result.topRows<3>() = map.derivative(c.weights);
  const SurfaceRotation surface(c, map, configuration);
  const SurfaceRotation::Matrix3x18 spin = surface.derivative();
  result.topRows<3>() -= skew(surface.rotation() * c.offset) * spin;
  if (c.turns) {
    result.bottomRows<3>() = spin;
  }
  return result;
}

}  // namespace

std::vector<Carried> carried_nodes(const Model& model, const Surfaces& surfaces, const std::vector<Vec3>& reference) {
  std::map<Index, Carried> found;
  std::map<std::size_t, BodySurface> carriers;
  const Configuration rest = Configuration::at_rest(reference.size());
  const auto nearest_of = [&](std::size_t body, const Vec3& x) {
    return carriers.try_emplace(body, surfaces, body, reference).first->second.nearest(x);
  };
  for (const Attachment& attachment : model.attachments) {
    const auto fail = [&](const std::string& what) {
      throw InputError(fmt::format("{}{} on {}: {}", attachment.said_at.empty() ? "" : attachment.said_at + ": ",
                                   model.name_of(attachment.body), model.name_of(attachment.to), what));
    };
    for (const Index local : attachment.nodes) {
      Carried c;
      c.node = narrow<Index>(model.first_node(attachment.body) + local);
      const Vec3& x = reference[c.node];
      if (model.is_solid(attachment.to)) {
        const TetMesh& mesh = model.solids[attachment.to - model.shells.size()].mesh;
        const auto [t, shares] = find_tetrahedron(mesh, x);
        if (shares.minCoeff() < -farthest_share) {
          fail(fmt::format(
              "node {} is out of reach, farther out than a tetrahedron: move the bodies together, or select "
              "fewer nodes",
              local));
        }
        if (shares.minCoeff() < -inside) {
          const auto [face, b] = nearest_of(attachment.to, x);
          c.face = face_below(surfaces, attachment.to, face, b, x, reference);
          const auto& nodes = surfaces.faces[c.face].nodes;
          c.carriers.assign(nodes.begin(), nodes.end());
          const auto [shares_on_face, height] = over_facet(nodes, x, reference);
          c.shares << shares_on_face, 0;
          c.height = height;
        } else {
          const auto offset = narrow<Index>(model.first_node(attachment.to));
          for (const Index v : mesh.tetrahedra[t]) {
            c.carriers.push_back(v + offset);
          }
          c.shares = shares;
        }
      } else {
        const auto [face, b] = nearest_of(attachment.to, x);
        c.face = face;
        const SurfaceFace& on = surfaces.faces[face];
        c.weights = patch_weights(on, b);
        c.shares << 1 - b[0] - b[1], b[0], b[1], 0;
        c.carriers.assign(on.nodes.begin(), on.nodes.end());
        const PatchMap map(on, reference, rest);
        c.offset = x - map.point(c.weights);
        c.foot = map.from_origin(c.weights);
        c.slopes = patch_weight_derivatives(on, b);
        const Vec3 along = map.from_origin(c.slopes[0]).normalized();
        const Vec3 normal = along.cross(map.from_origin(c.slopes[1])).normalized();
        c.frame << along, normal.cross(along), normal;
        c.turns = !model.is_solid(attachment.body);
        double longest = 0;
        for (int k = 0; k < 3; ++k) {
          longest = std::max(longest, (reference[on.nodes[(k + 1) % 3]] - reference[on.nodes[k]]).norm());
        }
        if (c.offset.norm() > longest + on.half_thickness) {
          fail(fmt::format(
              "node {} is {:.4g} mm away, out of reach of shells of {:.4g} mm: move the bodies together, or "
              "select fewer nodes",
              local, c.offset.norm(), longest));
        }
      }
      if (!found.emplace(c.node, c).second) {
        fail(fmt::format("node {} is carried twice: let one [[attach]] carry it", local));
      }
    }
  }
  // What carries comes after what it carries.
  std::vector<Carried> order;
  std::map<Index, int> state;  // 1: its carriers are looked at; 2: done
  const std::function<void(const Carried&)> visit = [&](const Carried& c) {
    state[c.node] = 1;
    for (const Index carrier : c.carriers) {
      const auto other = found.find(carrier);
      if (other == found.end() || state[carrier] == 2) {
        continue;
      }
      if (state[carrier] == 1) {
        throw InputError("attachments carry each other in a circle: leave out one [[attach]]");
      }
      visit(other->second);
    }
    state[c.node] = 2;
    order.push_back(c);
  };
  for (const auto& [node, c] : found) {
    if (state[node] == 0) {
      visit(c);
    }
  }
  std::reverse(order.begin(), order.end());
  return order;
}

void place_carried(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
                   Configuration& configuration) {
  for (auto c = carried.rbegin(); c != carried.rend(); ++c) {
    Vec3 u = Vec3::Zero();
    if (is_on_solid(*c)) {
      for (std::size_t k = 0; k < c->carriers.size(); ++k) {
        u += c->shares[narrow<Eigen::Index>(k)] * configuration.displacement[c->carriers[k]];
      }
      if (c->height) {
        u += *c->height * (FacetNormal(c->carriers, reference, configuration).normal() -
                           FacetNormal(c->carriers, reference, Configuration::at_rest(reference.size())).normal());
      }
    } else {
      const PatchMap map(surfaces.faces[c->face], reference, configuration);
      const Mat3 rotation = SurfaceRotation(*c, map, configuration).rotation();
      u = map.from_origin(c->weights) - c->foot + rotation * c->offset - c->offset;
      if (c->turns) {
        configuration.rotation[c->node] = Eigen::Quaterniond(rotation).normalized();
      }
    }
    configuration.displacement[c->node] = u;
  }
}

void add_carried_pairs(const std::vector<Carried>& carried, std::vector<std::vector<Index>>& neighbours) {
  const auto add = [&](Index a, Index b) {
    const auto place = std::lower_bound(neighbours[a].begin(), neighbours[a].end(), b);
    if (place == neighbours[a].end() || *place != b) {
      neighbours[a].insert(place, b);
    }
  };
  for (const Carried& c : carried) {
    const std::vector<Index> around = neighbours[c.node];
    for (const Index carrier : c.carriers) {
      for (const Index other : c.carriers) {
        add(carrier, other);
      }
      for (const Index j : around) {
        add(carrier, j);
        add(j, carrier);
      }
    }
  }
}

void expand_carried(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
                    const Configuration& configuration, VectorX& increment) {
  for (auto c = carried.rbegin(); c != carried.rend(); ++c) {
    VectorX of_carriers(6 * c->carriers.size());
    for (std::size_t k = 0; k < c->carriers.size(); ++k) {
      of_carriers.segment<6>(first_freedom(k)) = increment.segment<6>(first_freedom(c->carriers[k]));
    }
    const Derivative j = derivative(*c, surfaces, reference, configuration);
    increment.segment(first_freedom(c->node), j.rows()) = j * of_carriers;
  }
}

void condense(const std::vector<Carried>& carried, const Surfaces& surfaces, const std::vector<Vec3>& reference,
              const Configuration& configuration, VectorX& internal, BlockMatrix* tangent) {
  for (const Carried& c : carried) {
    const Derivative j = derivative(c, surfaces, reference, configuration);
    const Eigen::Index rows = j.rows();
    const Vector6 load = internal.segment<6>(first_freedom(c.node));
    const Vec3 force = load.head<3>();
    internal.segment(first_freedom(c.node), rows).setZero();
    const std::size_t count = c.carriers.size();
    for (std::size_t k = 0; k < count; ++k) {
      internal.segment<6>(first_freedom(c.carriers[k])) +=
          j.middleCols<6>(first_freedom(k)).transpose() * load.head(rows);
    }
    if (tangent == nullptr) {
      continue;
    }
    const std::size_t begin = tangent->row_start[c.node], end = tangent->row_start[c.node + 1];
    for (std::size_t place = begin; place < end; ++place) {  // its rows go to the carriers
      const Index column = tangent->column[place];
      const Matrix6 row = tangent->block(place);
      tangent->block(place).topRows(rows).setZero();
      for (std::size_t k = 0; k < count; ++k) {
        tangent->block(tangent->find(c.carriers[k], column)) +=
            j.middleCols<6>(first_freedom(k)).transpose() * row.topRows(rows);
      }
    }
    for (std::size_t place = begin; place < end; ++place) {  // and its columns
      const Index row = tangent->column[place];
      auto block = tangent->block(tangent->transposed[place]);
      const Matrix6 column = block;
      block.leftCols(rows).setZero();
      for (std::size_t k = 0; k < count; ++k) {
        tangent->block(tangent->find(row, c.carriers[k])) += column.leftCols(rows) * j.middleCols<6>(first_freedom(k));
      }
    }
    if (c.height) {
      const FacetNormal facet(c.carriers, reference, configuration);
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column) {
          tangent->block(tangent->find(c.carriers[row], c.carriers[column])).topLeftCorner<3, 3>() +=
              *c.height * facet.second_derivative(force, row, column);
        }
      }
    }
    if (is_on_solid(c)) {
      continue;
    }
    PatchMap map(surfaces.faces[c.face], reference, configuration);
    map.linearise();
    const SurfaceRotation surface(c, map, configuration);
    const SurfaceRotation::Matrix3x18 spin = surface.derivative();
    const Vec3 d = surface.rotation() * c.offset;
    const Vec3 moment = d.cross(force) + (c.turns ? Vec3(load.tail<3>()) : Vec3(Vec3::Zero()));
    const Mat3 by_spin = d * force.transpose() - d.dot(force) * Mat3::Identity();  // d turns with it
    const Matrix18 curvature = map.stiffness(PatchMap::Matrix27::Zero(), force * c.weights.transpose()) +
                               surface.second_derivative(moment) + spin.transpose() * by_spin * spin;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        tangent->block(tangent->find(c.carriers[row], c.carriers[column])) +=
            curvature.block<6, 6>(6 * row, 6 * column);
      }
    }
  }
}

}  // namespace tunica
