#include "tunica/wall/detail/continued_face.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int most_smoothings = 200;
constexpr double flat_enough = 0.02;  // of a rim's size: how far it may be from its plane
constexpr double least_cut = 0.5;     // the sine of the angle between face and plane

/// For each vertex of a rim the unit direction in which the face goes on there.
std::vector<Vec3> directions_at(const Target& face, const std::vector<Index>& rim, double length) {
  const auto& x = face.mesh().vertices;
  const std::size_t size = rim.size();
  std::vector<Vec3> away(size, Vec3::Zero());
  double around = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const Index from = rim[i], to = rim[(i + 1) % size];
    const Vec3 edge = x[to] - x[from];
    around += edge.norm();
    for (const Index t : face.around().of(from)) {
      const auto& v = face.mesh().triangles[t];
      const bool beside = std::ranges::any_of(std::array{0U, 1U, 2U},
                                              [&](std::size_t k) { return v[k] == from && v[(k + 1) % 3] == to; });
      if (beside) {
        const Vec3 outward = edge.cross(face.facet_normals()[t]);
        away[i] += outward;
        away[(i + 1) % size] += outward;
      }
    }
  }
  const double steps = length * real(size) / std::max(around, 1e-300);
  for (int step = std::clamp(truncated<int>(std::min(steps * steps, 1e6)), 1, most_smoothings); step > 0; --step) {
    const std::vector<Vec3> before = away;
    for (std::size_t i = 0; i < size; ++i) {
      away[i] = 0.5 * before[i] + 0.25 * (before[(i + 1) % size] + before[(i + size - 1) % size]);
    }
  }
  for (Vec3& direction : away) {
    direction.stableNormalize();
  }
  return away;
}

ContinuedFace::Rim rim_of(const std::vector<Vec3>& points, const std::vector<Vec3>& away) {
  ContinuedFace::Rim rim;
  Vec3 mean = Vec3::Zero();
  double size = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    rim.middle += points[i] / real(points.size());
    mean += away[i];
    size = std::max(size, (points[i] - points[0]).norm());
  }
  Mat3 moments = Mat3::Zero();
  for (const Vec3& p : points) {
    moments += (p - rim.middle) * (p - rim.middle).transpose();
  }
  rim.away = Eigen::SelfAdjointEigenSolver<Mat3>(moments).eigenvectors().col(0);
  if (rim.away.dot(mean) < 0) {
    rim.away = -rim.away;
  }
  rim.is_flat = true;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool in_plane = std::abs((points[i] - rim.middle).dot(rim.away)) <= flat_enough * size;
    rim.is_flat = rim.is_flat && in_plane && away[i].dot(rim.away) >= least_cut;
  }
  return rim;
}

}  // namespace

ContinuedFace::ContinuedFace(const Target& face, double half, double reach)
    : mesh_(face.mesh()), face_triangles_(mesh_.triangles.size()), face_(face) {
  std::size_t segments = 0;
  for (std::size_t number = 0; number < face.boundary().size(); ++number) {
    first_segment_.push_back(segments);
    segments += face.boundary()[number].size();
    continue_rim(face, number, half, reach);
  }
  distance_.emplace(mesh_);
}

void ContinuedFace::continue_rim(const Target& face, std::size_t number, double half, double reach) {
  const std::vector<Index>& rim = face.boundary_vertices()[number];
  const std::vector<Vec3>& points = face.boundary()[number];
  const std::vector<Vec3> away = directions_at(face, rim, half);
  rims_.push_back(rim_of(points, away));
  const auto first = narrow<Index>(mesh_.vertices.size());
  const auto size = narrow<Index>(rim.size());
  for (Index i = 0; i < size; ++i) {
    mesh_.vertices.emplace_back(points[i] + reach * away[i]);
    const Index next = (i + 1) % size;
    mesh_.triangles.push_back({rim[next], rim[i], first + i});
    mesh_.triangles.push_back({rim[next], first + i, first + next});
  }
}

ContinuedFace::Hit ContinuedFace::at(const Vec3& p, Index guess) const {
  Hit hit{distance_->at(p, guess)};
  hit.on_strip = hit.triangle >= face_triangles_;
  if (hit.on_strip) {
    // Of a strip's two triangles the second one has the end, as its edge 1 between its corners 1 and 2.
    const bool second = (hit.triangle - face_triangles_) % 2 == 1;
    hit.at_end = second ? hit.part == 2 || hit.part == 5 || hit.part == 6 : hit.part == 6;
  }
  return hit;
}

ContinuedFace::AtRim ContinuedFace::nearest_rim(const Vec3& p) const {
  TUNICA_ASSERT(!rims_.empty());
  const ClosestPoint::Hit hit = face_.boundary_tree()->closest(p);
  const auto after = std::upper_bound(first_segment_.begin(), first_segment_.end(), hit.triangle);
  return {&rims_[narrow<std::size_t>(after - first_segment_.begin()) - 1], hit.point, std::sqrt(hit.squared_distance)};
}

}  // namespace tunica
