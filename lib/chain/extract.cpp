#include "tunica/chain/extract.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/cut_open.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/doubts.hpp"
#include "tunica/volume/cubes/openings.hpp"
#include "tunica/volume/cubes/outward.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/labels/hollows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace tunica::chain {
namespace {

struct VoxelSurface {
  TriangleMesh mesh;
  Mask mask;                                   // the selection the mesh bounds
  bool outward = false;                        // of the surface before the staircase was smoothed
  std::optional<StaircaseResult> staircase{};  // what that smoothing did
  Openings openings{};                         // of an open border
};

void warn_all(const std::vector<Warning>& warnings, const Context& context) {
  std::ranges::for_each(warnings, context.warn);
}

// By which a surface lies between the values of a grey volume: what the inner face of a wall bounds is its hollow.
Inside surface_rule(const SelectedVoxels& selected) {
  Inside rule = selected.inside;
  if (selected.face == WallFace::inner && rule.rule != Inside::Rule::label) {
    rule.rule = rule.rule == Inside::Rule::above ? Inside::Rule::below : Inside::Rule::above;
  }
  return rule;
}

Mask solid_of(const Mask& wall, const Hollows& hollows, WallFace face) {
  return face == WallFace::inner ? inner_solid(hollows) : outer_solid(wall, hollows);
}

// Keeps the pieces that are wanted, and says what that left out or filled, and what is odd about the rest.
void keep_and_doubt(const Subject& subject, SelectedVoxels& selected, const ExtractSettings& settings,
                    const Context& context) {
  Mask& mask = selected.mask;
  const std::size_t voxels = count_voxels(mask);
  std::optional<Hollows> hollows;
  if (!selected.face) {
    hollows = find_hollows(mask);
  }
  if (settings.largest) {
    keep_largest_piece(mask);
    warn_all(doubt_pieces(subject, 1 - real(count_voxels(mask)) / real(voxels)), context);
  }
  if (hollows) {
    Mask filled = mask;
    CavityFacts cavities{fill_cavities(filled), 0, settings.fill_cavities};
    cavities.voxels = count_voxels(filled) - count_voxels(mask);
    warn_all(doubt_hollows(subject, mask, *hollows, cavities), context);
    if (settings.fill_cavities) {
      mask = std::move(filled);
    }
  }
  warn_all(doubt_bridge(subject, find_bridge(mask)), context);
}

// Values that are not at hand are shown a second time.
TriangleMesh marching_cubes_of(const SelectedVoxels& selected, const MarchingCubesOptions& options) {
  const Inside inside = surface_rule(selected);
  if (inside.rule == Inside::Rule::label) {
    return marching_cubes(selected.mask, options);
  }
  if (selected.volume != nullptr) {
    return marching_cubes(*selected.volume, inside, selected.mask, options);
  }
  SlabMarchingCubes cubes(selected.mask, inside, options);
  selected.show_values([&](const Volume& slab, std::size_t first_slice) { cubes.add(slab, first_slice); });
  return cubes.finish();
}

// What Gaussian smoothing makes of a selection becomes its mask.
SmoothedField smooth(const Subject& subject, SelectedVoxels& selected, const ExtractSettings& settings,
                     const Context& context) {
  SmoothedField smoothed = [&] {
    const auto stage = context.stage("smooth");
    const auto progress = context.progress("smooth");
    return selected.volume != nullptr
               ? SmoothedField{smooth_values(*selected.volume, *settings.sigma, progress), selected.inside}
               : smooth_mask(selected.mask, *settings.sigma, progress);
  }();
  const auto stage = context.stage("extract");
  Mask mask = select(smoothed.field, smoothed.rule);
  if (selected.volume != nullptr && selected.face) {
    mask = solid_of(mask, find_hollows(mask), *selected.face);
    smoothed.rule = surface_rule(selected);
  }
  if (settings.largest) {
    keep_largest_piece(mask);
  }
  if (settings.fill_cavities) {
    fill_cavities(mask);
  }
  // Smoothing keeps the volume, so that only the voxels tell what it did to the shape.
  const double changed = real(count_differing(selected.mask, mask)) / real(count_voxels(selected.mask));
  warn_all(doubt_smoothing(subject, changed), context);
  selected.mask = std::move(mask);
  return smoothed;
}

// Along planes in the axes of the output. What is said of the image's border afterwards concerns what is left.
void cut_along_planes(VoxelSurface& surface, const Subject& subject, const std::string& file,
                      const ExtractSettings& settings) {
  TriangleMesh& mesh = surface.mesh;
  for (std::size_t i = 0; i < settings.cuts.size(); ++i) {
    const HalfSpaceNodes& half = settings.cuts[i];
    const double turned = subject.ras && half.axis < 2 ? -1 : 1;
    Interval range{infinity, -infinity};
    for (const Vec3& x : mesh.vertices) {
      range.lower = std::min(range.lower, turned * x[half.axis]);
      range.upper = std::max(range.upper, turned * x[half.axis]);
    }
    if (!(range.lower < half.at && half.at < range.upper)) {
      throw InputError(
          fmt::format("{}: --cut '{}' does not meet the surface of {}, which reaches from {:.6g} to {:.6g} "
                      "mm along {}",
                      file, settings.cuts_as_written[i], subject.name, range.lower, range.upper, "xyz"[half.axis]));
    }
    const double kept = half.below ? -1 : 1;  // what lies beyond is above the plane along this normal
    const Vec3 normal = kept * turned * Vec3::Unit(half.axis);
    const double offset = kept * half.at;
    mesh = cut_open(mesh, normal, offset);
    drop_beyond(surface.mask, normal, offset);
    std::erase_if(surface.openings.openings,
                  [&](const Opening& opening) { return !opening.is_end && normal.dot(opening.middle) > offset; });
  }
}

VoxelSurface surface_of(const Subject& subject, SelectedVoxels selected, const ExtractSettings& settings,
                        const Context& context) {
  {
    const auto stage = context.stage("extract");
    keep_and_doubt(subject, selected, settings, context);
  }
  MarchingCubesOptions options;
  options.open_border = settings.open_border;
  options.progress = context.progress("extract");
  std::optional<SmoothedField> smoothed;
  if (settings.sigma) {
    smoothed.emplace(smooth(subject, selected, settings, context));
  } else {
    options.bounds = selected.bounds;
  }
  const auto cubes = [&] {
    return smoothed ? marching_cubes(smoothed->field, smoothed->rule, selected.mask, options)
                    : marching_cubes_of(selected, options);
  };
  VoxelSurface surface{{}, selected.mask};
  {
    const auto stage = context.stage("extract");
    surface.mesh = cubes();
    if (settings.open_border && !surface.mesh.triangles.empty()) {
      surface.openings = find_openings(surface.mask, surface.mesh);
      if (surface.openings.lids.any()) {
        options.lids = &surface.openings.lids;
        surface.mesh = cubes();
      }
    }
  }
  if (surface.mesh.triangles.empty()) {
    throw InputError(fmt::format("{}: the surface of {} is empty: {}", selected.file, subject.name,
                                 settings.sigma ? "the smoothing removes it; pass a smaller sigma"
                                                : "it fills the whole image; leave out --open-border"));
  }
  surface.outward = faces_outward(surface.mesh, surface.mask, settings.open_border);
  if (settings.staircase) {
    const auto stage = context.stage("smooth");
    surface.staircase =
        smooth_staircase(surface.mesh, surface.mask, {settings.open_border, context.progress("smooth")});
  }
  cut_along_planes(surface, subject, selected.file, settings);
  return surface;
}

/// Errors: InternalError: the surface is not what marching cubes promises.
SurfaceNumbers measure(const VoxelSurface& surface, double voxel_volume, const ExtractSettings& settings) {
  const TriangleMesh& mesh = surface.mesh;
  const bool may_end = settings.open_border || !settings.cuts.empty();
  const MeshFacts facts = examine(mesh);
  if (const auto why = why_unfit(facts, may_end ? Boundary::allowed : Boundary::forbidden)) {
    throw InternalError("the extracted surface is not a manifold: " + *why);
  }
  const double volume = signed_volume(mesh);
  SurfaceNumbers numbers;
  numbers.vertices = facts.vertices;
  numbers.triangles = facts.triangles;
  numbers.components = facts.components;
  numbers.openings = boundary_loops(mesh).size();
  numbers.euler = facts.euler;
  numbers.closed = facts.closed;
  numbers.manifold = facts.manifold;
  numbers.oriented_outward = facts.oriented && surface.outward && (!facts.closed || volume > 0);
  if (facts.closed) {
    numbers.volume = volume;
  }
  numbers.voxel_volume = voxel_volume;
  numbers.area = area(mesh);
  numbers.diagonal = diagonal(mesh);
  numbers.staircase = surface.staircase;
  return numbers;
}

void doubt(const Subject& subject, const VoxelSurface& surface, const SurfaceNumbers& numbers, const Inside& inside,
           const ExtractSettings& settings, const Context& context) {
  if (numbers.volume) {
    warn_all(doubt_volume(subject, surface.mask, *numbers.volume), context);
  }
  if (settings.open_border) {
    if (settings.cuts.empty() || !surface.openings.openings.empty()) {
      warn_all(doubt_openings(subject, surface.openings, numbers.area), context);
    }
    warn_all(doubt_rims(subject, surface.mask, surface.mesh, boundary_loops(surface.mesh)), context);
  } else {
    warn_all(doubt_closed_border(subject, surface.mask, inside), context);
  }
}

// What is extracted of a wall: one face, and the other one.
std::array<SelectedVoxels, 2> both_faces(const Subject& subject, const SelectedVoxels& wall, WallFace which,
                                         const Context& context) {
  const Hollows hollows = find_hollows(wall.mask);
  if (hollows.sizes.empty()) {
    throw InputError(fmt::format(
        "{}: {} is no wall around a hollow, so it has no inner and no outer face: leave out --face; where it "
        "is a wall with a hole or a slit, close that in the segmentation, and where it ends within the image, crop the "
        "image so that its border cuts the wall",
        wall.file, wall.name));
  }
  warn_all(doubt_wall(subject, hollows), context);
  const auto of = [&](WallFace face) {
    SelectedVoxels bounded = wall;
    bounded.mask = solid_of(wall.mask, hollows, face);
    bounded.bounds.reset();
    bounded.face = face;
    bounded.name += fmt::format(", {} face", name_of(face));
    return bounded;
  };
  return {of(which), of(behind(which))};
}

}  // namespace

Extraction extract(SelectedVoxels selected, const ExtractSettings& settings, const Context& context) {
  const double voxel_volume = real(count_voxels(selected.mask)) * selected.mask.voxel_volume();
  const Inside inside = selected.inside;
  Subject subject{selected.name, settings.ras};
  std::optional<VoxelSurface> other;
  if (settings.face) {
    auto [face, hidden] = both_faces(subject, selected, *settings.face, context);
    const Subject of_hidden{hidden.name, settings.ras};
    other = surface_of(of_hidden, std::move(hidden), settings, context);
    selected = std::move(face);
    subject.name = selected.name;
  }
  Extraction found;
  found.name = selected.name;
  VoxelSurface surface = surface_of(subject, std::move(selected), settings, context);
  // Of an organ that was cut, what is left of it.
  const double left = real(count_voxels(surface.mask)) * surface.mask.voxel_volume();
  found.numbers = measure(surface, settings.cuts.empty() ? voxel_volume : left, settings);
  doubt(subject, surface, found.numbers, inside, settings, context);
  if (other) {
    const FaceDistance thickness =
        distance_of_faces(without_border(surface.mesh, surface.mask), without_border(other->mesh, other->mask));
    found.numbers.face = settings.face;
    found.numbers.thickness = thickness;
    found.other = std::move(other->mesh);
  }
  found.mesh = std::move(surface.mesh);
  return found;
}

SurfaceNumbers sum_of(const std::vector<SurfaceNumbers>& surfaces) {
  SurfaceNumbers total;
  for (const SurfaceNumbers& one : surfaces) {
    total.vertices += one.vertices;
    total.triangles += one.triangles;
    total.components += one.components;
    total.openings += one.openings;
    total.euler += one.euler;
    total.closed = total.closed && one.closed;
    total.manifold = total.manifold && one.manifold;
    total.oriented_outward = total.oriented_outward && one.oriented_outward;
    if (one.volume) {
      total.volume = total.volume.value_or(0) + *one.volume;
    }
    total.voxel_volume += one.voxel_volume;
    total.area += one.area;
  }
  return total;
}

}  // namespace tunica::chain
