#include "tunica/mechanics/contact/surface_faces.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <numeric>

namespace tunica {
namespace {

/// @param bends  between its nodes, as they turn: so do flat facets then
void add_shell(const ShellBody& body, std::size_t number, Index offset, bool bends, std::vector<SurfaceFace>& faces) {
  const TriangleMesh flat = flat_facets(body.mesh);
  const auto beside = neighbours(flat, incidence(flat));
  const auto normal = [&](std::size_t t, std::size_t k) -> Vec3 {
    if (body.curved) {
      return body.mesh.normal(t, k);
    }
    const auto& v = flat.triangles[t];
    return (flat.vertices[v[1]] - flat.vertices[v[0]]).cross(flat.vertices[v[2]] - flat.vertices[v[0]]).normalized();
  };
  const bool may_have_creases = !body.curved || !body.mesh.corner_normals.empty();
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    const auto& v = body.mesh.triangles[t];
    SurfaceFace face;
    face.body = number;
    face.curved = body.curved || bends;
    face.young = body.material.young;
    std::array<Vec3, 3> x;
    double thickness = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      face.nodes[k] = v[k] + offset;
      x[k] = body.mesh.vertices[v[k]];
      thickness += (body.thickness.size() == 1 ? body.thickness[0] : body.thickness[v[k]]) / 3;
    }
    face.half_thickness = thickness / 2;
    if (face.curved) {
      for (std::size_t k = 0; k < 3; ++k) {
        face.normals[k] = normal(t, k);
      }
      face.across = own_normals_across(face.normals);
      for (std::size_t k = 0; may_have_creases && k < 3; ++k) {
        const Index other = beside[t][k];
        for (std::size_t l = 0; other != no_neighbour && l < 3; ++l) {
          const Index at = body.mesh.triangles[other][l];
          if (at == v[k]) {
            face.across[k][0] = normal(other, l);
          } else if (at == v[(k + 1) % 3]) {
            face.across[k][1] = normal(other, l);
          }
        }
      }
      const std::array<Vec3, 3> edges{x[1] - x[0], x[2] - x[1], x[0] - x[2]};
      for (std::size_t k = 0; k < 9; ++k) {
        std::array<double, 10> unit{};
        unit[k] = 1;
        face.centre[k] = averaged_centre(edges, unit);
      }
    }
    faces.push_back(face);
  }
}

}  // namespace

Surfaces surface_faces(const Model& model) {
  Surfaces surfaces;
  for (std::size_t b = 0; b < model.body_count(); ++b) {
    surfaces.first.push_back(surfaces.faces.size());
    const auto offset = narrow<Index>(model.first_node(b));
    if (!model.is_solid(b)) {
      const bool carries =
          std::ranges::any_of(model.attachments, [b](const Attachment& attachment) { return attachment.to == b; });
      add_shell(model.shells[b], b, offset, carries, surfaces.faces);
      continue;
    }
    const SolidBody& body = model.solids[b - model.shells.size()];
    for (const auto& t : boundary_triangles(body.mesh)) {
      SurfaceFace face;
      face.nodes = {t[0] + offset, t[1] + offset, t[2] + offset};
      face.body = b;
      face.young = body.material.young;
      surfaces.faces.push_back(face);
    }
  }
  surfaces.first.push_back(surfaces.faces.size());
  return surfaces;
}

Vec2 nearest_on_face(const SurfaceFace& face, const PatchMap& map, const Vec3& p, const Vec2& start) {
  constexpr int most_iterations = 30;
  // Active set on the triangle: where a step leaves it, it is cut, and the next one slides along the side. The metric
  // stands for the second derivative: near a surface that is flat against the distance they differ by little.
  Vec2 b = start;
  const auto squared = [&](const Vec2& at) { return (map.point(patch_weights(face, at)) - p).squaredNorm(); };
  double value = squared(b);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const auto weights = patch_weight_derivatives(face, b);
    const Vec3 t0 = map.point(weights[0]), t1 = map.point(weights[1]);
    const Vec3 away = map.point(patch_weights(face, b)) - p;
    const Vec2 g(away.dot(t0), away.dot(t1));
    Eigen::Matrix2d h;
    h << t0.dot(t0), t0.dot(t1), t0.dot(t1), t1.dot(t1);
    // Sides that the point lies on and the descent direction leaves across are held.
    constexpr double on_side = 1e-12;
    Vec2 d = -h.inverse() * g;
    const std::array<Vec2, 3> outward{Vec2(-1, 0), Vec2(0, -1), Vec2(1, 1)};
    const auto at_side = [&](std::size_t k) {
      return k == 0 ? b[0] <= on_side : k == 1 ? b[1] <= on_side : b[0] + b[1] >= 1 - on_side;
    };
    for (std::size_t k = 0; k < 3; ++k) {
      if (at_side(k) && d.dot(outward[k]) > 0) {
        const Vec2 along(-outward[k][1], outward[k][0]);
        d = -along * (along.dot(g) / along.dot(h * along));
        for (std::size_t l = 0; l < 3; ++l) {
          if (l != k && at_side(l) && d.dot(outward[l]) > 0) {
            d.setZero();
          }
        }
        break;
      }
    }
    double length = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const double rate = d.dot(outward[k]);
      const double room = k == 0 ? b[0] : k == 1 ? b[1] : 1 - b[0] - b[1];
      if (rate > 0) {
        length = std::min(length, std::max(0.0, room) / rate);
      }
    }
    if ((length * d).norm() < 1e-11) {
      break;
    }
    Vec2 next = b + length * d;
    double then = squared(next);
    for (int cut = 0; then > value && cut < 20; ++cut) {
      length /= 2;
      next = b + length * d;
      then = squared(next);
    }
    if (!(then <= value)) {
      break;
    }
    b = next.cwiseMax(0.0);
    if (const double sum = b.sum(); sum > 1) {
      b /= sum;
    }
    value = then;
  }
  return b;
}

}  // namespace tunica
