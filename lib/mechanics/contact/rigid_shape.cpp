#include "tunica/mechanics/contact/rigid_shape.hpp"

#include <Eigen/Geometry>

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

/// Of a point at `away` from the nearest point of a convex core, radius around it.
RigidDistance around(const Vec3& away, double radius, const Mat3& free) {
  const double length = away.norm();
  RigidDistance result;
  result.normal = length > 0 ? Vec3(away / length) : Vec3(Vec3::UnitZ());
  result.distance = length - radius;
  // Only along the directions in which the nearest point stays.
  result.curvature = Mat3::Zero();
  if (length > 0) {
    result.curvature = (free - result.normal * result.normal.transpose()) / length;
  }
  return result;
}

RigidDistance to_segment(const Vec3& p, const Vec3& from, const Vec3& to, double radius) {
  const Vec3 axis = to - from;
  const double squared = axis.squaredNorm();
  const double at = squared > 0 ? (p - from).dot(axis) / squared : 0;
  if (at <= 0 || at >= 1) {
    return around(p - (at <= 0 ? from : to), radius, Mat3::Identity());
  }
  const Vec3 direction = axis / std::sqrt(squared);
  return around(p - (from + at * axis), radius, Mat3::Identity() - direction * direction.transpose());
}

RigidDistance to_cylinder(const Vec3& p, const Vec3& from, const Vec3& to, double radius) {
  const double length = (to - from).norm();
  const Vec3 axis = (to - from) / length;
  const double along = (p - from).dot(axis);
  const Vec3 across = p - from - along * axis;
  const double off = across.norm();
  const double beyond = std::max(along - length, -along);
  const bool high = along - length > -along;
  const Vec3 end = high ? axis : Vec3(-axis);
  if (beyond > 0 && off > radius) {  // off the rim
    const Vec3 rim = across * (radius / off);
    RigidDistance result = around(beyond * end + across - rim, 0, Mat3::Identity());
    const Vec3 tangent = axis.cross(across / off);
    // Along the rim the nearest point follows, on a circle of the radius.
    const double follows = radius / off;
    result.curvature -= (follows / result.distance) * tangent * tangent.transpose();
    return result;
  }
  if (beyond > 0 || (beyond > off - radius)) {
    return {beyond, end, Mat3::Zero()};
  }
  return around(across, radius, Mat3::Identity() - axis * axis.transpose());
}

}  // namespace

RigidShape::RigidShape(const RigidBody& body) : body_(&body) { set_time(0); }

/// The surface as far as it is expanded: its nearest points are not those of the surface before.
void RigidShape::expand(const RigidMesh& mesh) {
  TriangleMesh m = mesh.surface;
  for (Vec3& x : m.vertices) {
    x = expanded(x, factor_);
  }
  surface_ = std::make_shared<SignedDistance>(m);
}

Vec3 RigidShape::expanded(const Vec3& x, double factor) const {
  const auto& expansion = std::get<RigidMesh>(body_->shape).expansion;
  if (!expansion) {
    return x;
  }
  const Vec3 arm = x - expansion->point;
  const Vec3 along = expansion->axis * expansion->axis.dot(arm);
  return expansion->point + along + (arm - along) * factor;
}

void RigidShape::set_time(double time) {
  shift_ = body_->motion ? body_->motion->at(time) : Vec3(Vec3::Zero());
  const auto line = [&](const auto& shape) {
    first_ = shape.from.at(time) + shift_;
    second_ = shape.to.at(time) + shift_;
    radius_ = shape.radius.at(time);
  };
  std::visit(Overloaded{[&](const RigidSphere& s) {
                          first_ = second_ = s.centre.at(time) + shift_;
                          radius_ = s.radius.at(time);
                        },
                        [&](const RigidCapsule& s) { line(s); }, [&](const RigidCylinder& s) { line(s); },
                        [&](const RigidPlane& s) { first_ = second_ = s.point.at(time) + shift_; },
                        [&](const RigidMesh& s) {
                          angle_ = s.turn ? s.turn->angle.at(time) : 0;
                          const double factor = s.expansion ? s.expansion->factor.at(time) : 1;
                          if (factor != factor_ || !surface_) {
                            factor_ = factor;
                            expand(s);
                          }
                        }},
             body_->shape);
}

Vec3 RigidShape::to_mesh(const Vec3& p) const {
  const auto& s = std::get<RigidMesh>(body_->shape);
  const Vec3 x = p - shift_;
  return s.turn ? Vec3(s.turn->point + Eigen::AngleAxisd(-angle_, s.turn->axis) * (x - s.turn->point)) : x;
}

Vec3 RigidShape::from_mesh(const Vec3& p) const {
  const auto& s = std::get<RigidMesh>(body_->shape);
  return shift_ + (s.turn ? Vec3(s.turn->point + Eigen::AngleAxisd(angle_, s.turn->axis) * (p - s.turn->point)) : p);
}

RigidDistance RigidShape::at(const Vec3& p) const {
  return std::visit(Overloaded{[&](const RigidSphere&) { return around(p - first_, radius_, Mat3::Identity()); },
                               [&](const RigidCapsule&) { return to_segment(p, first_, second_, radius_); },
                               [&](const RigidCylinder&) { return to_cylinder(p, first_, second_, radius_); },
                               [&](const RigidPlane& s) {
                                 return RigidDistance{s.normal.dot(p - first_), s.normal, Mat3::Zero()};
                               },
                               [&](const RigidMesh&) {
                                 const Vec3 local = to_mesh(p);
                                 const SignedDistance::Hit hit = surface_->at(local);
                                 const Vec3 here = from_mesh(hit.point);
                                 const double length = std::abs(hit.distance);
                                 const Vec3 away =
                                     length > 1e-12
                                         ? Vec3((p - here) / hit.distance)
                                         : Vec3((from_mesh(hit.point + hit.pseudo_normal) - here).normalized());
                                 return RigidDistance{hit.distance, away, Mat3::Zero()};
                               }},
                    body_->shape);
}

double RigidShape::support(const Vec3& n) const {
  return std::visit(
      Overloaded{[&](const RigidSphere&) { return n.dot(first_) + radius_; },
                 [&](const RigidCapsule&) { return std::max(n.dot(first_), n.dot(second_)) + radius_; },
                 [&](const RigidCylinder&) {
                   const Vec3 axis = (second_ - first_).normalized();
                   return std::max(n.dot(first_), n.dot(second_)) + radius_ * (n - axis * axis.dot(n)).norm();
                 },
                 [&](const RigidPlane& s) { return n.dot(s.normal) > 1 - 1e-12 ? n.dot(first_) : infinity; },
                 [&](const RigidMesh&) { return infinity; }},
      body_->shape);
}

Vec3 RigidShape::carried(const Vec3& p, const RigidShape& before) const {
  if (!convex()) {
    return from_mesh(expanded(before.to_mesh(p), factor_ / before.factor_));
  }
  return p + (first_ + second_ - before.first_ - before.second_) / 2;
}

double RigidShape::growth_since(const RigidShape& before) const {
  if (!convex()) {
    return 0;
  }
  const Vec3 stretch = (second_ - first_) - (before.second_ - before.first_);
  return std::abs(radius_ - before.radius_) + stretch.norm() / 2;
}

double RigidShape::detour_since(const RigidShape& before, const Vec3& p) const {
  const auto* mesh = std::get_if<RigidMesh>(&body_->shape);
  if (mesh == nullptr || !mesh->turn || angle_ == before.angle_) {
    return 0;
  }
  const Vec3 arm = p - before.shift_ - mesh->turn->point;
  const double radius = mesh->turn->axis.cross(arm).norm(), angle = std::abs(angle_ - before.angle_);
  return radius * (angle - 2 * std::abs(std::sin(angle / 2)));
}

bool RigidShape::moves_to(const RigidShape& then) const {
  return first_ != then.first_ || second_ != then.second_ || radius_ != then.radius_ || shift_ != then.shift_ ||
         angle_ != then.angle_ || factor_ != then.factor_;
}

double RigidShape::deepest() const { return std::holds_alternative<RigidPlane>(body_->shape) ? infinity : radius_ / 2; }

std::vector<std::array<Vec3, 3>> RigidShape::triangles_near(const Vec3& lower, const Vec3& upper, double reach) const {
  std::vector<std::array<Vec3, 3>> near;
  for (const auto& v : std::get<RigidMesh>(body_->shape).surface.triangles) {
    std::array<Vec3, 3> x;
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = from_mesh(surface_->vertices()[v[k]]);
    }
    const Vec3 least = x[0].cwiseMin(x[1]).cwiseMin(x[2]), most = x[0].cwiseMax(x[1]).cwiseMax(x[2]);
    if ((least.array() - reach <= upper.array()).all() && (lower.array() - reach <= most.array()).all()) {
      near.push_back(x);
    }
  }
  return near;
}

std::optional<Vec3> RigidShape::inner_point() const {
  if (std::holds_alternative<RigidPlane>(body_->shape)) {
    return {};
  }
  return convex() ? position() : from_mesh(surface_->vertices().front());
}

Vec3 RigidShape::position() const { return convex() ? Vec3((first_ + second_) / 2) : shift_; }

std::vector<Vec3> RigidShape::corners_and_edges(double spacing) const {
  const TriangleMesh& mesh = std::get<RigidMesh>(body_->shape).surface;
  constexpr double sharp = 0.94;  // cosine of 20 degrees
  constexpr std::size_t most_per_edge = 64;
  std::vector<Vec3> points = mesh.vertices;
  const auto normal = [&](std::size_t t) {
    const auto& v = mesh.triangles[t];
    const auto& x = mesh.vertices;
    return Vec3((x[v[1]] - x[v[0]]).cross(x[v[2]] - x[v[0]]).normalized());
  };
  const auto beside = neighbours(mesh, incidence(mesh));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = beside[t][k];
      if (other == no_neighbour || other < t || normal(t).dot(normal(other)) > sharp) {
        continue;
      }
      const Vec3 &a = mesh.vertices[mesh.triangles[t][k]], &b = mesh.vertices[mesh.triangles[t][(k + 1) % 3]];
      const auto pieces =
          std::min<std::size_t>(most_per_edge, truncated<std::size_t>(std::ceil((b - a).norm() / spacing)));
      for (std::size_t i = 1; i < pieces; ++i) {
        points.emplace_back(a + (b - a) * (real(i) / real(pieces)));
      }
    }
  }
  return points;
}

std::vector<Table<Vec3>> tables_of(const RigidBody& body) {
  std::vector<Table<Vec3>> tables;
  const auto add = [&](const auto&... of_shape) {
    const auto from = [&](const auto& table) {
      Table<Vec3>& added = tables.emplace_back();
      for (const auto& [time, value] : table.points) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, double>) {
          added.points.emplace_back(time, Vec3(value, 0, 0));
        } else {
          added.points.emplace_back(time, value);
        }
      }
    };
    (from(of_shape), ...);
  };
  std::visit(
      Overloaded{[&](const RigidSphere& s) { add(s.centre, s.radius); }, [&](const RigidPlane& s) { add(s.point); },
                 [&](const RigidMesh& s) {
                   if (s.turn) {
                     add(s.turn->angle);
                   }
                   if (s.expansion) {
                     add(s.expansion->factor);
                   }
                 },
                 [&](const auto& s) { add(s.from, s.to, s.radius); }},
      body.shape);
  if (body.motion) {
    add(*body.motion);
  }
  return tables;
}

double RigidShape::largest_curvature() const {
  const auto of_radius = [](const Table<double>& radius) {
    double smallest = infinity;
    for (const auto& [time, r] : radius.points) {
      smallest = std::min(smallest, r);
    }
    return smallest > 0 ? 1 / smallest : 0;
  };
  return std::visit(Overloaded{[&](const RigidSphere& s) { return of_radius(s.radius); },
                               [&](const RigidCapsule& s) { return of_radius(s.radius); },
                               [&](const RigidCylinder& s) { return of_radius(s.radius); },
                               [](const RigidPlane&) { return 0.0; }, [](const RigidMesh&) { return 0.0; }},
                    body_->shape);
}

}  // namespace tunica
