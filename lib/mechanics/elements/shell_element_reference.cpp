#include "tunica/mechanics/elements/detail/shell_element_reference.hpp"

#include "tunica/shell/patch/curved_surface.hpp"

#include <cmath>

namespace tunica {

void find_bulging(ShellElement& element) {
  std::array<Vec3, 3> vectors;
  for (int k = 0; k < 3; ++k) {
    vectors[k] << element.plane.col(next_corner(k)) - element.plane.col(k), 0;
  }
  // Dunavant's six points, exact to degree 4: gradients are quadratic.
  constexpr std::array<std::array<double, 2>, 2> orbits{
      {{0.445948490915965, 0.223381589678011}, {0.091576213509771, 0.109951743655322}}};
  for (Matrix6& form : element.bulging) {
    form.setZero();
  }
  // Ordinates of every unit slope; in Deflection's order the edge ordinates follow the corners.
  Eigen::Matrix<double, 6, 6> ordinates = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 centre;
  for (int k = 0; k < 3; ++k) {
    const double third = vectors[k].norm() / 3;
    ordinates(2 * k, 2 * k) = third;
    ordinates(2 * k + 1, 2 * k + 1) = -third;
  }
  for (int column = 0; column < 6; ++column) {
    std::array<double, 10> all{};
    for (int i = 0; i < 6; ++i) {
      all[3 + i] = ordinates(i, column);
    }
    centre[column] = averaged_centre(vectors, all);
    element.height_weights[column] = (ordinates(column, column) + centre[column]) / (10 * vectors[column / 2].norm());
  }
  for (const auto& [near, weight] : orbits) {
    for (int point = 0; point < 3; ++point) {
      std::array<double, 3> l{near, near, near};
      l[point] = 1 - 2 * near;
      Eigen::Matrix<double, 2, 6> slope = Eigen::Matrix<double, 2, 6>::Zero();
      for (int k = 0; k < 3; ++k) {
        const int j = next_corner(k);
        const double lk = l[k], lj = l[j];
        slope +=
            3 * (2 * lk * lj * element.gradients.col(k) + lk * lk * element.gradients.col(j)) * ordinates.row(2 * k);
        slope += 3 * (2 * lk * lj * element.gradients.col(j) + lj * lj * element.gradients.col(k)) *
                 ordinates.row(2 * k + 1);
        const int other = next_corner(j);
        slope += 6 * lk * lj * element.gradients.col(other) * centre.transpose();
      }
      element.bulging[0] += weight * slope.row(0).transpose() * slope.row(0);
      element.bulging[1] += weight * slope.row(1).transpose() * slope.row(1);
      element.bulging[2] +=
          weight * (slope.row(0).transpose() * slope.row(1) + slope.row(1).transpose() * slope.row(0));
    }
  }
  for (int k = 0; k < 3; ++k) {
    const Vec2 edge = element.plane.col(next_corner(k)) - element.plane.col(k);
    const Vec2 out = Vec2(edge.y(), -edge.x()).normalized();
    element.edge_directions.col(k) = edge.normalized();
    element.tilts[k] = element.edge_normals.col(k).head<2>().dot(out);
    // The mean of the cubic with these slopes and zero ends is length x (a_start - a_end) / 12.
    element.sideways.col(k) =
        edge.squaredNorm() / (12 * element.area) * Vec3(out.x() * out.x(), out.y() * out.y(), 2 * out.x() * out.y());
  }
}

void find_edges(const ShellSurface& surface, ShellElement& element) {
  for (int k = 0; k < 3; ++k) {
    Vec3 direction;
    direction << element.plane.col(next_corner(k)) - element.plane.col(k), 0;
    direction.normalize();
    const std::array<Vec3, 2> normals{element.axes * surface.normals[k],
                                      element.axes * surface.normals[next_corner(k)]};
    Vec3 m = normals[0] + normals[1];
    m = (m - direction * direction.dot(m)).normalized();
    element.edge_normals.col(k) = m;
    element.edge_sides.col(k) = m.cross(direction);
    for (int end = 0; end < 2; ++end) {
      const double sine = normals[end].dot(direction);
      element.slopes[2 * k + end] = -sine / std::sqrt(1 - sine * sine);
    }
  }
}

void find_short_waves(const ShellSurface& surface, double stretching, ShellElement& element) {
  Eigen::Matrix2d gradient = Eigen::Matrix2d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 normal = element.axes * surface.normals[k];
    gradient += normal.head<2>() * element.gradients.col(k).transpose();
  }
  const Eigen::Matrix2d curvature = 0.5 * (gradient + gradient.transpose());
  const double mean = curvature.trace() / 2;
  const double largest = std::abs(mean) + std::sqrt(std::max(mean * mean - curvature.determinant(), 0.0));
  element.thinness = 4 / std::sqrt(3.0) * element.area * largest / element.thickness;
  for (int k = 0; k < 3; ++k) {
    const Vec2 edge = element.plane.col(next_corner(k)) - element.plane.col(k);
    const Vec2 across(edge.y(), -edge.x());
    const double bulge = across.dot(curvature * across) / across.norm();  // b h
    element.short_waves[k] = stretching * element.area * bulge * bulge / 9;
  }
}

void find_rotational(const ShellSurface& surface, const PlaneStiffness& bending, const Mat3& higher_order,
                     ShellElement& element) {
  Matrix39 drilling = Matrix39::Zero();
  element.curvature.setZero();
  element.rotational.setZero();
  for (int i = 0; i < 3; ++i) {
    const Vec3 normal = surface.curved ? Vec3(element.axes * surface.normals[i]) : Vec3(Vec3::UnitZ());
    drilling.block<1, 3>(i, 3 * i) << 0.5 * normal.x() / normal.z(), 0.5 * normal.y() / normal.z(), 1;
    element.curvature.middleCols<2>(3 * i) = bending.mean_strain.middleCols<2>(3 * i + 1);
    for (int j = 0; j < 3; ++j) {
      element.rotational.block<2, 2>(3 * i, 3 * j) = bending.stiffness.block<2, 2>(3 * i + 1, 3 * j + 1);
    }
  }
  element.rotational += drilling.transpose() * higher_order * drilling;
}

}  // namespace tunica
