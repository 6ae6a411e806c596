#include "tunica/mechanics/elements/shell_element.hpp"

#include "tunica/mechanics/elements/detail/element_kinematics.hpp"
#include "tunica/mechanics/elements/detail/shell_element_reference.hpp"

namespace tunica {
ShellElement make_shell_element(const std::array<Vec3, 3>& corners, const ShellSurface& surface,
                                const Material& material, double thickness, Membrane membrane, Bending bending,
                                double higher_order_scale) {
  ShellElement element;
  element.thickness = thickness;
  const Vec3 first = corners[1] - corners[0];
  const Vec3 second = corners[2] - corners[0];
  const Vec3 normal = first.cross(second);
  element.area = normal.norm() / 2;
  const Vec3 mean = (first + second) / 3;
  element.from_centroid.col(0) = -mean;
  element.from_centroid.col(1) = first - mean;
  element.from_centroid.col(2) = second - mean;
  const Vec3 e1 = first.normalized();
  const Vec3 e3 = normal.normalized();
  const PlaneTriangle triangle{first.norm(), e1.dot(second), e3.cross(e1).dot(second)};
  element.gradients = barycentric_gradients(triangle);
  Frame frame;
  find_frame(element.from_centroid.cast<Lanes>(), element.gradients.cast<Lanes>(), frame);
  element.axes = lane(frame.axes, 0);
  element.plane = lane(frame.plane, 0);
  double spread = 1;  // area of the patch to that of the facet
  element.curved = surface.curved;
  if (surface.curved) {
    find_edges(surface, element);
    find_bulging(element);
    for (int i = 0; i < 2; ++i) {
      spread += 0.5 * element.slopes.dot(element.bulging[i] * element.slopes);
      for (int k = 0; k < 3; ++k) {
        spread += element.sideways(i, k) * (element.slopes[2 * k] - element.slopes[2 * k + 1]) * element.tilts[k];
      }
    }
  }

  const Mat3 elasticity = plane_stress(material);
  const MembraneStiffness in_plane = membrane == Membrane::cst
                                         ? membrane_cst(triangle, elasticity, thickness)
                                         : membrane_opt(triangle, elasticity, thickness, higher_order_scale);
  PlaneStiffness out_of_plane;
  switch (bending) {
    case Bending::comas:
      out_of_plane = bending_comas(triangle, elasticity, thickness);
      break;
    case Bending::comas_consistent:
      out_of_plane = bending_comas_consistent(triangle, elasticity, thickness);
      break;
    case Bending::dkt:
      out_of_plane = bending_dkt(triangle, elasticity, thickness);
      break;
    case Bending::dkt_comas:
      out_of_plane = bending_dkt_comas(triangle, elasticity, thickness);
      break;
  }
  element.membrane = spread * in_plane.basic;
  element.bow = in_plane.bow;
  find_rotational(surface, out_of_plane, in_plane.higher_order, element);

  element.rotational *= spread;
  if (surface.curved) {
    find_short_waves(surface, material.young * thickness, element);
  }
  element.area *= spread;
  if (surface.curved) {
    element.rest_normals.setZero();
    element.rest_sides.setZero();
    Kinematics rest;
    find_kinematics(same(element), no_motion(), rest);
    for (int i = 0; i < 6; ++i) {
      const EdgeNow& edge = rest.edges[i / 2];
      element.rest_normals[i] = edge.direction.dot(edge.normal[i % 2])[0];
      element.rest_sides[i] = edge.direction.dot(edge.side[i % 2])[0];
    }
  }
  return element;
}

bool deformation(const ShellElement& element, const CornerMotion& motion, ElementState& result) {
  LaneState state;
  const LaneMask valid = deformation(same(element), same(motion), state);
  result = lane(state, 0);
  return valid[0];
}

ElementState linear_deformation(const ShellElement& element, const Vector18& motion) {
  return lane(linear_deformation(same(element), motion.cast<Lanes>()), 0);
}

double strain_energy(const ShellElement& element, const ElementState& deformation) {
  const ElementState mean = 0.5 * deformation + element.prestrain;
  return deformation.head<3>().dot(element.membrane * mean.head<3>()) +
         deformation.segment<9>(3).dot(element.rotational * mean.segment<9>(3)) +
         deformation.tail<3>().dot(element.skewing.cwiseProduct(mean.tail<3>()));
}

Matrix18 linear_stiffness(const ShellElement& element) { return lane(linear_stiffness(same(element)), 0); }

bool corotational_response(const ShellElement& element, const CornerMotion& motion, const Viscous& viscous,
                           ElementResponse& response, Matrix18* tangent) {
  ViscousLanes damping;
  damping.factor = viscous.factor;
  if (viscous.factor > 0) {
    damping.previous = viscous.previous->cast<Lanes>();
  }
  ResponseLanes responses;
  LaneMatrix18 tangents;
  const LaneMask valid =
      corotational_response(same(element), same(motion), damping, responses, tangent == nullptr ? nullptr : &tangents);
  response.deformation = lane(responses.deformation, 0);
  response.force = lane(responses.force, 0);
  response.energy = responses.energy[0];
  if (tangent != nullptr) {
    *tangent = lane(tangents, 0);
  }
  return valid[0];
}

}  // namespace tunica
