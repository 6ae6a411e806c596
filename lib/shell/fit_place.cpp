#include "shell/fit_place.hpp"

#include "core/progress.hpp"
#include "shell/normal_equations.hpp"
#include "surface/facet_distances.hpp"
#include "surface/measure.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr double largest_tilt = 0.4;  // rad
constexpr double largest_move = 0.3;  // of the mean edge
constexpr double kept_angle = 0.98;   // of an angle below the limit
constexpr double hopeless = 8;        // times give_up after the first step

struct Measured {
  double cost = std::numeric_limits<double>::infinity();
  double error = std::numeric_limits<double>::infinity();
};

/// At first all residuals count alike, then the largest.
struct StepWeight {
  bool alike;
  double largest;  // mm
  Lanes operator()(const Lanes& distance) const {
    if (alike) {
      return 1.0;
    }
    const Lanes part = std::experimental::max(distance / largest, Lanes(0.1));
    const Lanes squared = part * part;
    return squared * squared;
  }
};

void put(std::vector<PlacedPatch>& patches, const PlacedNode& node) {
  for (PlacedPatch& p : patches) {
    if (p.corner != PlacedPatch::no_corner) {
      p.shape.corners[p.corner] = node.position;
      p.shape.normals[p.corner] = node.normals[p.slot];
      if (p.shape.across) {
        (*p.shape.across)[p.corner][0] = node.normals[p.beside[0]];
        (*p.shape.across)[(p.corner + 2) % 3][1] = node.normals[p.beside[1]];
      }
    }
  }
}

/// Attaches a point of the boundary to the patch whose boundary edge is closest. @return whether there is one
bool attach_to_edge(const Vec3& point, Index number, std::vector<PlacedPatch>& patches) {
  PlacedPatch* closest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (PlacedPatch& p : patches) {
    for (std::size_t k = 0; k < 3; ++k) {
      if ((p.boundary >> k & 1) == 0) {
        continue;
      }
      const Vec3 &a = p.shape.corners[k], along = p.shape.corners[(k + 1) % 3] - a;
      const double part = std::clamp((point - a).dot(along) / std::max(along.squaredNorm(), 1e-300), 0.0, 1.0);
      if (const double squared = (point - a - part * along).squaredNorm(); squared < least) {
        least = squared;
        closest = &p;
      }
    }
  }
  if (closest != nullptr) {
    closest->attached.push_back(number);
  }
  return closest != nullptr;
}

/// Each point to the patch whose facet, or boundary edge, is closest.
void attach_to_closest(const FitSamples& samples, const std::vector<Index>& points, std::vector<PlacedPatch>& patches) {
  std::vector<FacetDistances> facets;
  facets.reserve(patches.size());
  for (const PlacedPatch& p : patches) {
    facets.emplace_back(p.shape.corners);
  }
  std::array<Index, lane_count> group{};
  std::size_t count = 0;
  const auto attach_group = [&] {
    const LaneVec3 at = lane_points(
        [&](std::size_t k) -> const Vec3& { return samples.points()[group[std::min(k, count - 1)]].point; });
    NearestFacet nearest;
    for (std::size_t j = 0; j < facets.size(); ++j) {
      nearest.try_facet(facets[j], at, static_cast<double>(j));
    }
    for (std::size_t k = 0; k < count; ++k) {
      patches[static_cast<std::size_t>(nearest.which[k])].attached.push_back(group[k]);
    }
    count = 0;
  };
  for (const Index i : points) {
    if (samples.points()[i].of_boundary && attach_to_edge(samples.points()[i].point, i, patches)) {
      continue;
    }
    group[count++] = i;
    if (count == lane_count) {
      attach_group();
    }
  }
  if (count > 0) {
    attach_group();
  }
}

/// @param scale  mm, for the powers of the cost; doubted  mm: distances above it are looked for everywhere
Measured measure(const FitSamples& samples, std::vector<PlacedPatch>& patches, const std::vector<Index>& points,
                 const FitLimits& limits, double scale, double doubted) {
  for (const PlacedPatch& p : patches) {
    if (!is_sound(p.shape, limits.agreement, limits.angle)) {
      return {};
    }
  }
  for (PlacedPatch& p : patches) {
    p.attached.clear();
    p.residuals.clear();
  }
  attach_to_closest(samples, points, patches);
  std::vector<CubicPatch> curved;
  for (const PlacedPatch& p : patches) {
    curved.push_back(p.shape.patch());
  }
  Measured sum{0, 0};
  for (std::size_t i = 0; i < patches.size(); ++i) {
    PlacedPatch& p = patches[i];
    const CubicPatch& patch = curved[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const PlacedPatch::Across& across = p.across[k];
      if (p.shape.kind == Patch::watertight) {
        break;  // it meets its neighbours
      }
      if (across.patch != PlacedPatch::Across::none) {
        FitSamples::from_gap(patch, k, (k + 1) % 3, edge_points(curved[across.patch], across.from, across.to),
                             p.residuals);
      } else if (across.points) {
        FitSamples::from_gap(patch, k, (k + 1) % 3, *across.points, p.residuals);
      }
    }
    const Vec3 facing = facing_of(p.shape.corners);
    const PatchPowers powers(patch);
    // Downhill from a wrong start a point may seem far that is not.
    samples.from_patch(powers, facing, doubted, p.guesses, p.residuals);
    samples.from_target(patch, powers, facing, p.boundary, p.attached, p.residuals);
    samples.from_boundary(patch, facing, p.boundary, p.residuals);
    p.error = 0;
    for (const Residual& r : p.residuals) {
      const double d = std::abs(r.distance);
      p.error = std::max(p.error, d);
      const double squared = d * d / (scale * scale);
      sum.cost += squared * squared;
    }
    sum.error = std::max(sum.error, p.error);
  }
  return sum;
}

/// What was measured of the patches with the node at its best, while another place is tried.
class Findings {
public:
  /// The patches keep the guesses only: walks from those of a failed trial may end elsewhere.
  void put_aside(std::vector<PlacedPatch>& patches) {
    exchange(patches);
    for (std::size_t i = 0; i < patches.size(); ++i) {
      patches[i].guesses = kept_[i].guesses;
    }
  }

  void take_back(std::vector<PlacedPatch>& patches) { exchange(patches); }

private:
  struct OfPatch {
    std::vector<Index> guesses;
    std::vector<Index> attached;
    std::vector<Residual> residuals;
    double error = 0;
  };

  void exchange(std::vector<PlacedPatch>& patches) {
    kept_.resize(patches.size());
    for (std::size_t i = 0; i < patches.size(); ++i) {
      std::swap(kept_[i].guesses, patches[i].guesses);
      std::swap(kept_[i].attached, patches[i].attached);
      std::swap(kept_[i].residuals, patches[i].residuals);
      std::swap(kept_[i].error, patches[i].error);
    }
  }

  std::vector<OfPatch> kept_;
};

}  // namespace

std::array<Vec3, 2> tilt_axes(const Vec3& normal) {
  const Vec3 first = normal.unitOrthogonal();
  return {first, normal.cross(first)};
}

void hold_together(std::vector<Vec3>& normals, const std::vector<Index>& sectors, double kink) {
  const double half = kink * std::numbers::pi / 360;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    Vec3 sum = Vec3::Zero();
    std::size_t count = 0;
    for (std::size_t j = 0; j < normals.size(); ++j) {
      if (sectors[j] == sectors[i]) {
        count += j < i ? normals.size() : 1;  // done already
        sum += normals[j];
      }
    }
    if (count < 2 || count > normals.size() || !(sum.norm() > 1e-3)) {
      continue;
    }
    const Vec3 mean = sum.normalized();
    for (std::size_t j = i; j < normals.size(); ++j) {
      const double along = normals[j].dot(mean);
      const Vec3 beside = normals[j] - along * mean;
      if (sectors[j] == sectors[i] && std::atan2(beside.norm(), along) > half) {
        normals[j] = std::cos(half) * mean + std::sin(half) * beside.stableNormalized();
      }
    }
  }
}

Vec3 facing_of(const std::array<Vec3, 3>& corners) {
  return (corners[1] - corners[0]).cross(corners[2] - corners[0]).stableNormalized();
}

double least_angle(double limit, double now) { return now >= limit ? limit : kept_angle * now; }

bool is_sound(const PatchShape& shape, double agreement, double angle) {
  const auto& c = shape.corners;
  return normal_agreement(c, shape.normals) >= agreement && smallest_angle_degrees(c[0], c[1], c[2]) >= angle;
}

Eigen::Matrix<double, 30, 5> corner_jacobian(const PatchShape& shape, std::size_t corner) {
  const auto flat = [](const CubicPatch& patch) {
    return Eigen::Map<const Eigen::Matrix<double, 30, 1>>(patch.control[0].data());
  };
  const CubicPatch base = shape.patch();
  const double step = 1e-6 * std::sqrt((shape.corners[1] - shape.corners[0]).squaredNorm() +
                                       (shape.corners[2] - shape.corners[0]).squaredNorm());
  constexpr double tilt = 1e-6;
  Eigen::Matrix<double, 30, 5> jacobian;
  PatchShape changed = shape;
  for (Eigen::Index k = 0; k < 3; ++k) {
    changed.corners[corner][k] += step;
    jacobian.col(k) = (flat(changed.patch()) - flat(base)) / step;
    changed.corners[corner] = shape.corners[corner];
  }
  const auto axes = tilt_axes(shape.normals[corner]);
  for (std::size_t k = 0; k < 2; ++k) {
    changed.normals[corner] = shape.normals[corner] + tilt * axes[k];
    jacobian.col(static_cast<Eigen::Index>(3 + k)) = (flat(changed.patch()) - flat(base)) / tilt;
  }
  return jacobian;
}

Eigen::Matrix<double, 30, 12> across_jacobian(const PatchShape& shape) {
  const CubicPatch base = shape.patch();
  constexpr double tilt = 1e-6;
  Eigen::Matrix<double, 30, 12> jacobian;
  PatchShape changed = shape;
  for (std::size_t i = 0; i < 6; ++i) {
    Vec3& normal = (*changed.across)[i / 2][i % 2];
    const Vec3 before = normal;
    const auto axes = tilt_axes(before);
    for (std::size_t k = 0; k < 2; ++k) {
      normal = before + tilt * axes[k];
      const CubicPatch tilted = changed.patch();
      for (std::size_t j = 0; j < 10; ++j) {
        jacobian.block<3, 1>(static_cast<Eigen::Index>(3 * j), static_cast<Eigen::Index>(2 * i + k)) =
            (tilted.control[j] - base.control[j]) / tilt;
      }
    }
    normal = before;
  }
  return jacobian;
}

PatchJacobian patch_jacobian(const PatchShape& shape) {
  PatchJacobian jacobian;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto own = corner_jacobian(shape, i);
    jacobian.middleCols<3>(static_cast<Eigen::Index>(3 * i)) = own.leftCols<3>();
    jacobian.middleCols<2>(static_cast<Eigen::Index>(9 + 2 * i)) = own.rightCols<2>();
  }
  return jacobian;
}

namespace {

/// What a patch with creases adds to the equations of its node: its edges also follow the normals across.
void add_creased(const PlacedPatch& p, const StepWeight& weights, Eigen::MatrixXd& h, Eigen::VectorXd& g) {
  Eigen::Matrix<double, 30, 9> jacobian;
  jacobian.leftCols<5>() = corner_jacobian(p.shape, p.corner);
  const Eigen::Matrix<double, 30, 12> across = across_jacobian(p.shape);
  jacobian.middleCols<2>(5) = across.middleCols<2>(static_cast<Eigen::Index>(4 * p.corner));
  jacobian.middleCols<2>(7) = across.middleCols<2>(static_cast<Eigen::Index>(4 * ((p.corner + 2) % 3) + 2));
  Eigen::Matrix<double, 9, 9> own = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> side = Eigen::Matrix<double, 9, 1>::Zero();
  add_normal_equations<9>(jacobian, p.residuals, weights, own, side);
  // Several of the three may be one.
  std::array<Eigen::Index, 9> to{0, 1, 2};
  std::size_t n = 3;
  for (const std::size_t slot : {p.slot, p.beside[0], p.beside[1]}) {
    to[n++] = static_cast<Eigen::Index>(3 + 2 * slot);
    to[n++] = static_cast<Eigen::Index>(4 + 2 * slot);
  }
  for (std::size_t a = 0; a < 9; ++a) {
    g[to[a]] += side[static_cast<Eigen::Index>(a)];
    for (std::size_t b = 0; b < 9; ++b) {
      h(to[a], to[b]) += own(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    }
  }
}

}  // namespace

void place_node(const FitSamples& samples, std::vector<PlacedPatch>& patches, const std::vector<Index>& points,
                const FitLimits& limits, double give_up, int steps, PlacedNode& node, double far) {
  check_interrupt();  // all that takes long comes by here
  hold_together(node.normals, node.sectors, limits.kink);
  put(patches, node);
  const double scale = samples.target().diagonal();
  Measured now = measure(samples, patches, points, limits, scale, give_up);
  node.error = now.error;
  if (!std::isfinite(now.error)) {
    return;
  }
  using Matrix = Eigen::MatrixXd;
  const auto size = static_cast<Eigen::Index>(3 + 2 * node.normals.size());
  PlacedNode best = node;
  Findings findings;
  for (int step = 0; step < steps; ++step) {
    Matrix h = Matrix::Zero(size, size);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
    const StepWeight weights{step == 0, now.error};
    double edge = 0;
    std::size_t edges = 0;
    for (const PlacedPatch& p : patches) {
      if (p.corner == PlacedPatch::no_corner) {
        continue;
      }
      edge += (p.shape.corners[(p.corner + 1) % 3] - node.position).norm();
      ++edges;
      if (p.shape.across) {
        add_creased(p, weights, h, g);
        continue;
      }
      Eigen::Matrix<double, 5, 5> own = Eigen::Matrix<double, 5, 5>::Zero();
      Eigen::Matrix<double, 5, 1> side = Eigen::Matrix<double, 5, 1>::Zero();
      add_normal_equations<5>(corner_jacobian(p.shape, p.corner), p.residuals, weights, own, side);
      const auto s = static_cast<Eigen::Index>(3 + 2 * p.slot);
      h.topLeftCorner<3, 3>() += own.topLeftCorner<3, 3>();
      h.block<3, 2>(0, s) += own.topRightCorner<3, 2>();
      h.block<2, 3>(s, 0) += own.bottomLeftCorner<2, 3>();
      h.block<2, 2>(s, s) += own.bottomRightCorner<2, 2>();
      g.head<3>() += side.head<3>();
      g.segment<2>(s) += side.tail<2>();
    }
    edge /= static_cast<double>(std::max<std::size_t>(edges, 1));
    const double stiffness = h.topLeftCorner<3, 3>().trace();
    const double slide = std::min(1.0, std::pow(now.error / edge, 2));  // how far sliding may pay
    h.topLeftCorner<3, 3>().diagonal().array() += stiffness * (1e-6 + 0.3 * slide);
    for (Eigen::Index i = 3; i < size; ++i) {
      h(i, i) += 1e-4 * h(i, i) + 1e-6 * stiffness * edge * edge + 1e-300;
    }
    const Eigen::VectorXd x = h.ldlt().solve(g);
    if (!x.allFinite()) {
      break;
    }
    bool better = false;
    for (const double length : {1.0, 0.35}) {
      PlacedNode moved = best;
      Vec3 move = length * x.head<3>();
      if (const double way = move.norm(); way > largest_move * edge) {
        move *= largest_move * edge / way;
      }
      moved.position += move;
      for (std::size_t s = 0; s < moved.normals.size(); ++s) {
        Vec2 tilt = length * x.segment<2>(static_cast<Eigen::Index>(3 + 2 * s));
        if (const double angle = tilt.norm(); angle > largest_tilt) {
          tilt *= largest_tilt / angle;
        }
        const auto axes = tilt_axes(best.normals[s]);
        moved.normals[s] = (best.normals[s] + tilt[0] * axes[0] + tilt[1] * axes[1]).normalized();
      }
      hold_together(moved.normals, moved.sectors, limits.kink);
      put(patches, moved);
      findings.put_aside(patches);
      const Measured then = measure(samples, patches, points, limits, scale, give_up);
      if (then.cost < now.cost) {
        now = then;
        moved.error = then.error;
        best = moved;
        better = true;
        break;
      }
      findings.take_back(patches);
    }
    if (!better || now.error > hopeless * give_up || (now.error > far && now.error <= give_up)) {
      break;
    }
  }
  put(patches, best);
  node = best;
}

void turn_normals(const FitSamples& samples, PlacedPatch& patch, const FitLimits& limits, int steps) {
  const double scale = samples.target().diagonal();
  const std::vector<Index> points = patch.attached;
  std::vector<PlacedPatch> one{patch};
  one[0].corner = PlacedPatch::no_corner;
  Measured now = measure(samples, one, points, limits, scale, 0);
  PlacedPatch best = one[0];
  for (int step = 0; step < steps && std::isfinite(now.error); ++step) {
    Eigen::Matrix<double, 6, 6> h = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    add_normal_equations<6>(patch_jacobian(one[0].shape).rightCols<6>(), one[0].residuals,
                            StepWeight{step == 0, now.error}, h, g);
    h.diagonal().array() += 1e-3 * h.trace() / 6 + 1e-300;
    const Eigen::Matrix<double, 6, 1> x = h.ldlt().solve(g);
    if (!x.allFinite()) {
      break;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      Vec2 tilt = x.segment<2>(static_cast<Eigen::Index>(2 * k));
      if (const double far = tilt.norm(); far > largest_tilt) {
        tilt *= largest_tilt / far;
      }
      const auto axes = tilt_axes(best.shape.normals[k]);
      one[0].shape.normals[k] = (best.shape.normals[k] + tilt[0] * axes[0] + tilt[1] * axes[1]).normalized();
    }
    const Measured then = measure(samples, one, points, limits, scale, 0);
    if (!(then.cost < now.cost)) {
      break;
    }
    now = then;
    best = one[0];
    best.error = then.error;
  }
  best.error = now.error;
  patch = std::move(best);
}

}  // namespace tunica
