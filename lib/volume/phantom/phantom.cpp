#include "tunica/volume/phantom/phantom.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace tunica {
namespace {

/// A shape in its own units. `distance` is negative inside, smooth near 0, and changes by at most the distance walked,
/// so that its size says how far the nearest surface is at least.
struct Solid {
  Vec3 lower;
  Vec3 upper;
  bool open_along_z = false;
  std::function<double(const Vec3&)> distance;
};

double sphere(const Vec3& p, const Vec3& centre, double radius) { return (p - centre).norm() - radius; }

double segment(const Vec3& p, const Vec3& a, const Vec3& b, double radius) {
  const Vec3 axis = b - a;
  const double t = std::clamp((p - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - a - t * axis).norm() - radius;
}

/// Tube of `radius` around the circle of radius `bend` in the xz plane through `nearest`, its point of largest x.
double torus(const Vec3& p, const Vec3& nearest, double bend, double radius) {
  const Vec3 q = p - nearest + Vec3(bend, 0, 0);
  return std::hypot(std::hypot(q[0], q[2]) - bend, q[1]) - radius;
}

/// Union whose seam is rounded over about `width`; polynomial, so 1-Lipschitz when a and b are.
double smooth_union(double a, double b, double width) {
  const double h = std::max(0.0, 1 - std::abs(a - b) / width);
  return std::min(a, b) - 0.25 * h * h * width;
}

double smooth_difference(double a, double b, double width) { return -smooth_union(-a, b, width); }

/// Centres of the colon's pouches: evenly along a Catmull-Rom curve.
std::vector<Vec3> colon_centres() {
  const std::vector<Vec3> path{{-0.42, 0.00, -0.60}, {-0.40, 0.00, -0.42}, {-0.42, 0.03, -0.10}, {-0.39, 0.00, 0.24},
                               {-0.20, -0.08, 0.25}, {0.00, -0.12, 0.14},  {0.20, -0.06, 0.25},  {0.39, 0.02, 0.30},
                               {0.42, 0.05, -0.06},  {0.37, 0.04, -0.33},  {0.17, -0.02, -0.40}, {0.02, -0.06, -0.22},
                               {0.00, -0.08, -0.10}};
  std::vector<Vec3> curve;
  for (std::size_t i = 1; i + 2 < path.size(); ++i) {
    for (int step = 0; step < 64; ++step) {
      const double t = step / 64.0;
      curve.emplace_back(0.5 * (2 * path[i] + t * (path[i + 1] - path[i - 1]) +
                                t * t * (2 * path[i - 1] - 5 * path[i] + 4 * path[i + 1] - path[i + 2]) +
                                t * t * t * (3 * path[i] - path[i - 1] - 3 * path[i + 1] + path[i + 2])));
    }
  }
  constexpr double spacing = 0.085;
  std::vector<Vec3> centres{curve.front()};
  double walked = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    walked += (curve[i] - curve[i - 1]).norm();
    if (walked >= spacing) {
      centres.push_back(curve[i]);
      walked -= spacing;
    }
  }
  return centres;
}

Solid make_solid(PhantomShape shape) {
  switch (shape) {
    case PhantomShape::sphere:
      return {Vec3::Constant(-0.5), Vec3::Constant(0.5), false,
              [](const Vec3& p) { return sphere(p, Vec3::Zero(), 0.5); }};
    case PhantomShape::tube:
      return {{-0.20, -0.13, -0.5}, {0.19, 0.13, 0.5}, true, [](const Vec3& p) {
                return torus(p, Vec3(0.06, 0, 0), 1.2, 0.13);
              }};
    case PhantomShape::aneurysm:
      return {{-0.30, -0.17, -0.5}, {0.31, 0.17, 0.5}, true, [](const Vec3& p) {
                return smooth_union(torus(p, Vec3(-0.07, 0, 0), 1.2, 0.1), sphere(p, Vec3(0.14, 0, 0.03), 0.17), 0.08);
              }};
    case PhantomShape::capsule: {
      const Vec3 end(0.12, 0.06, 0.28);
      const double radius = 0.17;
      return {-end - Vec3::Constant(radius), end + Vec3::Constant(radius), false,
              [end, radius](const Vec3& p) { return segment(p, -end, end, radius); }};
    }
    case PhantomShape::bladder:
      return {{-0.42, -0.30, -0.44}, {0.42, 0.31, 0.36}, false, [](const Vec3& p) {
                const double lobes =
                    smooth_union(sphere(p, Vec3(-0.13, 0, 0.06), 0.28), sphere(p, Vec3(0.14, 0.01, 0.05), 0.27), 0.1);
                const double neck = segment(p, Vec3(0, 0, 0), Vec3(0.01, -0.04, -0.36), 0.07);
                return smooth_difference(smooth_union(lobes, neck, 0.14), sphere(p, Vec3(0, 0.02, 0.62), 0.33), 0.1);
              }};
    case PhantomShape::colon:
      return {{-0.53, -0.22, -0.53}, {0.53, 0.16, 0.41}, false, [centres = colon_centres()](const Vec3& p) {
                double distance = sphere(p, centres[0], 0.095);
                for (std::size_t i = 1; i < centres.size(); ++i) {
                  distance = smooth_union(distance, sphere(p, centres[i], i % 3 == 0 ? 0.075 : 0.09), 0.03);
                }
                return distance;
              }};
  }
  throw InternalError("a phantom shape without a solid");
}

/// The shape in world millimetres, in the middle of an image.
struct Scene {
  Solid solid;
  double scale;  ///< mm per unit of the solid
  Vec3 centre;   ///< of the image, in the solid's units
  std::array<std::size_t, 3> dims;
  Vec3 extent;  ///< mm, of the image up to the voxels' outer faces

  [[nodiscard]] double distance(const Vec3& world) const { return scale * solid.distance(world / scale + centre); }
};

Scene make_scene(const PhantomOptions& options) {
  if (options.size < 16 || options.size > 4096) {
    throw UsageError(fmt::format("a phantom of {} voxels on the longest side: choose 16 to 4096", options.size));
  }
  for (const double spacing : options.spacing) {
    if (!(spacing >= 1e-6 && spacing <= 1e6)) {
      throw UsageError(fmt::format("a voxel spacing of {} mm: choose 1e-6 to 1e6", spacing));
    }
  }
  if (!(options.noise >= 0 && options.noise <= 1)) {
    throw UsageError(fmt::format("noise {} is not a probability: choose 0 to 1", options.noise));
  }
  Scene scene{make_solid(options.shape), HUGE_VAL, Vec3::Zero(), {}, Vec3::Zero()};
  const Vec3 size = scene.solid.upper - scene.solid.lower;
  const auto margin = [&](int axis) { return axis == 2 && scene.solid.open_along_z ? 0.0 : 4.0; };
  for (int axis = 0; axis < 3; ++axis) {
    scene.scale = std::min(scene.scale, (real(options.size) - margin(axis)) * options.spacing[axis] / size[axis]);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double voxels = std::ceil(size[axis] * scene.scale / options.spacing[axis] - 1e-9) + margin(axis);
    scene.dims[axis] = truncated<std::size_t>(std::max(voxels, 1.0));
    scene.extent[axis] = real(scene.dims[axis]) * options.spacing[axis];
  }
  scene.centre = 0.5 * (scene.solid.lower + scene.solid.upper);
  return scene;
}

Eigen::Matrix<double, 3, 4> centred_affine(const std::array<std::size_t, 3>& dims, const Vec3& spacing) {
  Eigen::Matrix<double, 3, 4> affine = Eigen::Matrix<double, 3, 4>::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    affine(axis, axis) = spacing[axis];
    affine(axis, 3) = -0.5 * (real(dims[axis]) - 1) * spacing[axis];
  }
  return affine;
}

void refuse_what_memory_cannot_hold(const std::array<std::size_t, 3>& dims, const PhantomOptions& options) {
  constexpr double gib = 1024.0 * 1024 * 1024;
  const double copies = options.noise > 0 ? 2 : 1;
  const double wanted = copies * real(dims[0]) * real(dims[1]) * real(dims[2]) / gib;
  const double present = real(sysconf(_SC_PHYS_PAGES)) * real(sysconf(_SC_PAGESIZE)) / gib;
  if (wanted > present) {
    throw UsageError(
        fmt::format("a phantom of {} x {} x {} voxels takes {:.1f} GiB, and this machine has {:.1f} GiB of memory: "
                    "choose a smaller "
                    "--size, at most {} here",
                    dims[0], dims[1], dims[2], wanted, present,
                    truncated<std::size_t>(real(options.size) * std::cbrt(0.9 * present / wanted))));
  }
}

/// Calls visit(row, i, distance, count) for runs of voxels along i: `distance` is that of the first, and all `count`
/// have its sign and, but for the first, are at least `clearance` from the surface.
template <typename Visit>
void walk_rows(const Scene& scene, const std::array<std::size_t, 3>& dims, const Vec3& spacing, double clearance,
               const Progress& progress, const Visit& visit) {
  const Eigen::Matrix<double, 3, 4> affine = centred_affine(dims, spacing);
  parallel_for_blocks(dims[2], 1, [&](std::size_t begin, std::size_t) {
    check_interrupt();
    const std::size_t k = begin;
    for (std::size_t j = 0; j < dims[1]; ++j) {
      const std::size_t row = j + dims[1] * k;
      for (std::size_t i = 0; i < dims[0];) {
        const Vec3 voxel(real(i), real(j), real(k));
        const double distance = scene.distance(affine.leftCols<3>() * voxel + affine.col(3));
        const double clear = std::floor((std::abs(distance) * (1 - 1e-9) - clearance) / spacing[0]);
        const std::size_t count =
            std::min(dims[0] - i, clear > 0 ? truncated<std::size_t>(std::min(clear, 1e9)) : std::size_t{1});
        visit(row, i, distance, count);
        i += count;
      }
    }
  });
  advance(progress, 1.0);
}

/// A number in [0, 1) from a seed and a place: splitmix64, so that noise does not depend on the order of the work.
double random_at(std::uint64_t seed, std::uint64_t place) {
  std::uint64_t z = seed * 0xd1342543de82ef95U + (place + 1) * 0x9e3779b97f4a7c15U;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return real((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

std::size_t add_noise(const std::array<std::size_t, 3>& dims, double probability, std::uint64_t seed,
                      std::vector<std::uint8_t>& values) {
  const std::vector<std::uint8_t> clean = values;
  const std::array<std::size_t, 3> step{1, dims[0], dims[0] * dims[1]};
  std::size_t flipped = 0;
  for (std::size_t at = 0; at < clean.size(); ++at) {
    bool border = false;
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t coordinate = at / step[axis] % dims[axis];
      border = border || (coordinate > 0 && clean[at - step[axis]] != clean[at]) ||
               (coordinate + 1 < dims[axis] && clean[at + step[axis]] != clean[at]);
    }
    if (border && random_at(seed, at) < probability) {
      values[at] ^= 1;
      ++flipped;
    }
  }
  return flipped;
}

/// Moves a point near the surface onto it by Newton steps along the gradient; in the plane of its z with `flat`.
Vec3 project(const Scene& scene, Vec3 p, bool flat) {
  const double step = 1e-5 * scene.scale;
  for (int iteration = 0; iteration < 4; ++iteration) {
    Vec3 gradient = Vec3::Zero();
    for (int axis = 0; axis < (flat ? 2 : 3); ++axis) {
      const Vec3 e = step * Vec3::Unit(axis);
      gradient[axis] = (scene.distance(p + e) - scene.distance(p - e)) / (2 * step);
    }
    p -= scene.distance(p) / gradient.squaredNorm() * gradient;
  }
  return p;
}

}  // namespace

std::optional<PhantomShape> phantom_shape(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, PhantomShape>, 6> names{{{"sphere", PhantomShape::sphere},
                                                                            {"tube", PhantomShape::tube},
                                                                            {"aneurysm", PhantomShape::aneurysm},
                                                                            {"capsule", PhantomShape::capsule},
                                                                            {"bladder", PhantomShape::bladder},
                                                                            {"colon", PhantomShape::colon}}};
  const auto* const found = std::ranges::find(names, name, [](const auto& entry) { return entry.first; });
  return found == names.end() ? std::nullopt : std::optional(found->second);
}

Phantom make_phantom(const PhantomOptions& options) {
  const Scene scene = make_scene(options);
  refuse_what_memory_cannot_hold(scene.dims, options);
  Phantom phantom;
  phantom.volume.dims = scene.dims;
  phantom.volume.affine = centred_affine(scene.dims, options.spacing);
  std::vector<std::uint8_t> values(phantom.volume.voxels(), 0);
  walk_rows(scene, scene.dims, options.spacing, 0, options.progress,
            [&](std::size_t row, std::size_t i, double distance, std::size_t count) {
              std::fill_n(values.data() + row * scene.dims[0] + i, count, distance < 0 ? 1 : 0);
            });
  if (options.noise > 0) {
    phantom.flipped = add_noise(scene.dims, options.noise, options.seed, values);
  }
  phantom.inside = narrow<std::size_t>(std::ranges::count(values, std::uint8_t{1}));
  phantom.volume.data = std::move(values);
  return phantom;
}

TriangleMesh phantom_surface(const PhantomOptions& options) {
  const Scene scene = make_scene(options);
  // A finer image of the same extent, of distances instead of zeros and ones.
  const double edge = scene.extent.maxCoeff() / 256;
  Volume field;
  Vec3 spacing;
  for (int axis = 0; axis < 3; ++axis) {
    field.dims[axis] = truncated<std::size_t>(std::ceil(scene.extent[axis] / edge - 1e-9));
    spacing[axis] = scene.extent[axis] / real(field.dims[axis]);
  }
  field.affine = centred_affine(field.dims, spacing);
  std::vector<float> values(field.voxels());
  // Samples that were passed over are further from the surface than any of their neighbours.
  walk_rows(scene, field.dims, spacing, 2 * edge, options.progress,
            [&](std::size_t row, std::size_t i, double distance, std::size_t count) {
              std::fill_n(values.data() + row * field.dims[0] + i, count, static_cast<float>(distance));
            });
  field.data = std::move(values);

  MarchingCubesOptions extraction;
  extraction.open_border = true;
  TriangleMesh surface = marching_cubes(field, {Inside::Rule::below, 0}, extraction);
  const double end = 0.5 * scene.extent[2];
  parallel_for_blocks(surface.vertices.size(), 1024, [&](std::size_t begin, std::size_t stop) {
    check_interrupt();
    for (std::size_t v = begin; v < stop; ++v) {
      Vec3& p = surface.vertices[v];
      const bool at_end = std::abs(std::abs(p[2]) - end) < 1e-9 * end;
      if (at_end) {
        p[2] = std::copysign(end, p[2]);
      }
      p = project(scene, p, at_end);
    }
  });
  return surface;
}

double phantom_volume(const TriangleMesh& surface) {
  // Flow of (x, 0, 0) through the surface: none passes the lids, which are normal to z.
  double volume = 0;
  for (const auto& [a, b, c] : surface.triangles) {
    const Vec3& p = surface.vertices[a];
    const Vec3& q = surface.vertices[b];
    const Vec3& r = surface.vertices[c];
    volume += (q - p).cross(r - p)[0] * (p[0] + q[0] + r[0]) / 6;
  }
  return volume;
}

}  // namespace tunica
