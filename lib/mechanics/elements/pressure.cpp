#include "tunica/mechanics/elements/pressure.hpp"

#include "tunica/mechanics/elements/element_lanes.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

namespace tunica {
namespace {

/// The mean of the ten ordinates of the patch is sum_ij weight_ij b_ij / 10 over its six edge ordinates
/// b_ij = slope_i . (x_j - x_i) / 3; the centre ordinate is the mean of the three that make the slope across one edge
/// linear. With mu the place of the opposite corner's foot on the edge, from i on: weight = 3/2 - mu/2.
double weight(const Vec3& edge, const Vec3& to_opposite) {
  return 1.5 - 0.5 * edge.dot(to_opposite) / edge.squaredNorm();
}

std::size_t next(std::size_t i) { return (i + 1) % 3; }

struct End {
  int corner = 0;
  Lanes weight = 0;
  LaneVec3 carried;
};

/// What an edge's own change does to the height: of its length, its direction, and the vectors carried by its ends.
void add_edge(const LaneVec3& edge, const Lanes& area, const Lanes& of_length, int k, const std::array<End, 2>& ends,
              LaneMatrix18& t) {
  const int start = 6 * k;
  const int stop = 6 * ((k + 1) % 3);
  const Lanes length = edge.norm();
  const LaneVec3 direction = edge / length;
  const LaneMat3 stretch = area * of_length / length * (LaneMat3::Identity() - direction * direction.transpose());
  t.block<3, 3>(stop, stop) += stretch;
  t.block<3, 3>(start, start) += stretch;
  t.block<3, 3>(stop, start) -= stretch;
  t.block<3, 3>(start, stop) -= stretch;
  for (const End& end : ends) {
    const int spin = 6 * end.corner + 3;
    const LaneMat3 turned = area * end.weight * skew(end.carried);
    t.block<3, 3>(stop, spin) += turned;
    t.block<3, 3>(start, spin) -= turned;
    t.block<3, 3>(spin, stop) -= turned;
    t.block<3, 3>(spin, start) += turned;
    t.block<3, 3>(spin, spin) +=
        area * end.weight * (edge.dot(end.carried) * LaneMat3::Identity() - end.carried * edge.transpose());
  }
}

}  // namespace

PatchHeight patch_height(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  const Vec3 area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  const double twice_area = area.norm();
  const Vec3 n = area / twice_area;
  // T with trace T = mean height: sum of weight_ij / 30 slope_i (x_j - x_i)', symmetric part.
  Mat3 t = Mat3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 slope = n - normals[i] / normals[i].dot(n);
    for (const std::size_t j : {next(i), next(next(i))}) {
      const std::size_t k = 3 - i - j;
      const Vec3 edge = corners[j] - corners[i];
      t += weight(edge, corners[k] - corners[i]) / 30 * slope * edge.transpose();
    }
  }
  // Stretch C = sum_kl (x_k.x_l) g_k g_l' with the gradients g of the barycentric coordinates; height = T:(1 + C) / 2.
  Mat3 gradients;
  for (std::size_t k = 0; k < 3; ++k) {
    gradients.col(k) = n.cross(corners[next(next(k))] - corners[next(k)]) / twice_area;
  }
  return {t.trace(), gradients.transpose() * (0.5 * (t + t.transpose())) * gradients};
}

double patch_volume(const std::array<Vec3, 3>& corners, const PatchHeight& height) {
  double mean = height.constant;
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < 3; ++l) {
      // Relative to the first corner, to keep the digits.
      mean += height.coupling(k, l) * (corners[k] - corners[0]).dot(corners[l] - corners[0]);
    }
  }
  return mean / 2 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm() / 2;
}

void unit_pressure(const std::array<Vec3, 3>& corners, const PatchHeight& height, Vector9& force, Matrix9* stiffness) {
  Mat3 x;
  for (int k = 0; k < 3; ++k) {
    x.col(k) = corners[k] - corners[0];
  }
  const Vec3 twice = x.col(1).cross(x.col(2));
  const double twice_area = twice.norm();
  const double area = twice_area / 2;
  const Vec3 n = twice / twice_area;
  const Mat3 height_gradient = x * height.coupling;  // columns, per corner
  const double mean = (height.constant + (x.transpose() * x).cwiseProduct(height.coupling).sum()) / 2;
  Mat3 area_gradient;
  Mat3 opposite;
  for (int k = 0; k < 3; ++k) {
    opposite.col(k) = x.col((k + 2) % 3) - x.col((k + 1) % 3);
    area_gradient.col(k) = 0.5 * n.cross(opposite.col(k));
    force.segment<3>(3 * k) = twice / 6 + mean * area_gradient.col(k) + area * height_gradient.col(k);
  }
  if (stiffness == nullptr) {
    return;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      // With o_i the edge opposite to corner i: dA/dx_i = n x o_i / 2, and d(2A n)/dx_j = skew(o_j).
      Mat3 second = 0.25 / area * (opposite.col(i).dot(opposite.col(j)) * n * n.transpose());
      if (i != j) {
        const double sign = j == (i + 1) % 3 ? -0.5 : 0.5;
        second += sign * skew(n);
      }
      auto block = stiffness->block<3, 3>(3 * i, 3 * j);
      block = skew(opposite.col(j)) / 6 + mean * second + area_gradient.col(i) * height_gradient.col(j).transpose() +
              height_gradient.col(i) * area_gradient.col(j).transpose() +
              area * height.coupling(i, j) * Mat3::Identity();
    }
  }
}

void unit_pressure(const ElementLanes& element, const MotionLanes& motion, LaneVector18& force, LaneMatrix18* stiffness,
                   Lanes* volume) {
  LaneMat3 x;
  for (int k = 0; k < 3; ++k) {
    x.col(k) = element.from_centroid.col(k) - element.from_centroid.col(0) +
               (motion.displacement.col(k) - motion.displacement.col(0));
  }
  const LaneVec3 twice = x.col(1).cross(x.col(2));
  const Lanes twice_area = twice.norm();
  const Lanes area = twice_area / 2;
  const LaneVec3 n = twice / twice_area;
  // Height: sum over the ends of the edges of length x slope x weight / 30, with the sign of the edge's direction.
  Lanes height = 0;
  LaneVector18 height_gradient = LaneVector18::Zero();
  LaneMat3 opposite;
  LaneMat3 area_gradient;
  std::array<std::array<End, 2>, 3> ends;
  std::array<Lanes, 3> of_length{Lanes(0), Lanes(0), Lanes(0)};
  for (int k = 0; k < 3; ++k) {
    const int next_corner = (k + 1) % 3;
    opposite.col(k) = x.col((k + 2) % 3) - x.col(next_corner);
    area_gradient.col(k) = 0.5 * n.cross(opposite.col(k));
    const LaneVec3 edge = x.col(next_corner) - x.col(k);
    const Lanes length = edge.norm();
    const LaneVec3 normal = element.axes.transpose() * element.edge_normals.col(k);
    LaneVec3 carried = LaneVec3::Zero();
    for (int e = 0; e < 2; ++e) {
      End& end = ends[k][e];
      end.corner = e == 0 ? k : next_corner;
      end.weight = element.height_weights[2 * k + e];
      end.carried = motion.rotation[end.corner] * normal;
      of_length[k] += end.weight * (element.slopes[2 * k + e] + element.rest_normals[2 * k + e]);
      carried += end.weight * end.carried;
      height_gradient.segment<3>(6 * end.corner + 3) -= end.weight * end.carried.cross(edge);
    }
    height += of_length[k] * length - edge.dot(carried);
    const LaneVec3 along = of_length[k] / length * edge - carried;
    height_gradient.segment<3>(6 * next_corner) += along;
    height_gradient.segment<3>(6 * k) -= along;
  }
  force = area * height_gradient;
  for (int k = 0; k < 3; ++k) {
    force.segment<3>(6 * k) += twice / 6 + height * area_gradient.col(k);
  }
  if (volume != nullptr) {
    *volume = area * height;
  }
  if (stiffness == nullptr) {
    return;
  }
  LaneMatrix18& t = *stiffness;
  t.setZero();
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    add_edge(x.col((k + 1) % 3) - x.col(k), area, of_length[s], k, ends[s], t);
  }
  // height x d2A/dx_i dx_j + d(2A n / 6)/dx_j + what the gradients of area and height make together.
  const LaneMat3 across = 0.25 * height / area * n * n.transpose();
  for (int j = 0; j < 3; ++j) {
    t.middleRows<3>(6 * j).noalias() += area_gradient.col(j) * height_gradient.transpose();
    t.middleCols<3>(6 * j).noalias() += height_gradient * area_gradient.col(j).transpose();
    for (int i = 0; i < 3; ++i) {
      const double sign = i == j ? 0 : j == (i + 1) % 3 ? -0.5 : 0.5;
      const LaneVec3 axis = opposite.col(j) / 6 + sign * height * n;
      t.block<3, 3>(6 * i, 6 * j) += opposite.col(i).dot(opposite.col(j)) * across + skew(axis);
    }
  }
}

void unit_pressure(const ShellElement& element, const CornerMotion& motion, Vector18& force, Matrix18* stiffness,
                   double* volume) {
  LaneVector18 forces;
  LaneMatrix18 stiffnesses;
  Lanes volumes;
  unit_pressure(same(element), same(motion), forces, stiffness == nullptr ? nullptr : &stiffnesses, &volumes);
  force = lane(forces, 0);
  if (stiffness != nullptr) {
    *stiffness = lane(stiffnesses, 0);
  }
  if (volume != nullptr) {
    *volume = volumes[0];
  }
}

PlateLoad plate_load(const std::array<Vec3, 3>& corners) {
  const double area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm() / 2;
  PlateLoad load;
  load.force.fill(area / 3);
  load.director.fill(Vec3::Zero());
  for (std::size_t i = 0; i < 3; ++i) {
    for (const std::size_t j : {next(i), next(next(i))}) {
      const Vec3 edge = corners[j] - corners[i];
      const double share = area / 30 * weight(edge, corners[3 - i - j] - corners[i]);
      load.force[i] += share;
      load.force[j] -= share;
      load.director[i] -= share * edge;
    }
  }
  return load;
}

}  // namespace tunica
