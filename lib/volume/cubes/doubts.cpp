#include "tunica/volume/cubes/doubts.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/volume/labels/shelter.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace tunica {
namespace {

// Of the volume within the outer face. The lumen of a vessel whose wall is twice as thick as the lumen is wide still
// has a ninth; stones, catheters and bubbles in an organ have less.
constexpr double share_of_wall = 0.1;
// Of a volume: less lies within what a surface through voxels leaves open anyway.
constexpr double notable_share = 0.01;
// Of a volume: not worth a word.
constexpr double least_share = 0.001;
// Of what an open wall and the hollow that it stands around fill together: as of a tube whose wall is as thick as its
// lumen's radius. A kidney around its hilum, a vertebra around its canal or an aorta in its bends has half of that at
// most.
constexpr double share_of_open_wall = 0.25;
constexpr double notable_few = 0.05;       // of the volume of the voxels
constexpr double notable_smoothing = 0.1;  // of the voxels
constexpr std::size_t narrow_rim = 12;     // vertices, one per face of a voxel around it: 3 x 3 voxels
constexpr std::size_t places_told = 3;

// "at (1, 2, 3) mm and (4, 5, 6) mm", the first of them.
std::string list_places(const Subject& subject, const std::vector<Vec3>& places) {
  std::string text;
  for (std::size_t i = 0; i < std::min(places.size(), places_told); ++i) {
    text += (i > 0 ? ", " : "") + subject.at(places[i]);
  }
  return places.size() > places_told ? text + ", ..." : text;
}

Vec3 middle_of(const TriangleMesh& mesh, const std::vector<Index>& rim) {
  Vec3 sum = Vec3::Zero();
  for (const Index v : rim) {
    sum += mesh.vertices[v];
  }
  return sum / real(rim.size());
}

// The faces of the image, 2 * axis + side, that a rim runs over: one if all of it lies on that.
std::set<std::size_t> faces_of(const Mask& mask, const Mat3& to_index, const TriangleMesh& mesh,
                               const std::vector<Index>& rim) {
  std::array<std::size_t, 6> edges{};
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const Vec3 middle = (mesh.vertices[rim[i]] + mesh.vertices[rim[(i + 1) % rim.size()]]) / 2;
    const Vec3 index = to_index * (middle - mask.affine().col(3));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = index[narrow<Eigen::Index>(axis)];
      edges[2 * axis] += std::abs(x + 0.5) < on_grid ? 1 : 0;
      edges[2 * axis + 1] += std::abs(x - (real(mask.dims()[axis]) - 0.5)) < on_grid ? 1 : 0;
    }
  }
  std::set<std::size_t> faces;
  for (std::size_t face = 0; face < edges.size(); ++face) {
    if (edges[face] == rim.size()) {
      return {face};
    }
    if (edges[face] > 0) {
      faces.insert(face);
    }
  }
  return faces;
}

bool opposite(const std::set<std::size_t>& faces) {
  return (faces.contains(0) && faces.contains(1)) || (faces.contains(2) && faces.contains(3)) ||
         (faces.contains(4) && faces.contains(5));
}

}  // namespace

std::string Subject::at(const Vec3& place) const {
  const double side = ras ? -1 : 1;
  return fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", side * place.x(), side * place.y(), place.z());
}

std::vector<Warning> doubt_hollows(const Subject& subject, const Mask& mask, const Hollows& hollows,
                                   const CavityFacts& cavities) {
  const double percent = 1e2 * hollows.share;
  const double share = real(cavities.voxels) / real(cavities.voxels + count_voxels(mask));
  if (hollows.share >= share_of_wall) {
    if (cavities.filled && share >= share_of_wall) {
      return {
          {Weight::major, "wall with two faces",
           fmt::format("{}: its cavities are filled, which are {:.3g} % of the volume that the surface encloses, the "
                       "largest around {}: if the label is a wall, it has two faces, and the outer one alone is "
                       "left; --face inner or --face outer says which is meant, --label A+B takes what lies in the "
                       "cavity as part of the organ",
                       subject.name, 1e2 * share, subject.at(hollows.middle))}};
    }
    return {{Weight::major, "wall with two faces",
             fmt::format(
                 "{}: it is a wall with two faces around a hollow, which is {:.3g} % of the volume within its outer "
                 "face, around {}: both faces become surfaces, and one pressure presses them in opposite "
                 "directions; --face inner or --face outer takes one of them",
                 subject.name, percent, subject.at(hollows.middle))}};
  }
  if (const Shelter shelter = find_shelter(mask); shelter.share >= share_of_open_wall) {
    return {{Weight::major, "wall with two faces",
             fmt::format(
                 "{}: it may be a wall with two faces that is open along a slit, at an end or by a hole within the "
                 "image: it stands on most sides around a hollow, {:.3g} % of what both fill, around {}: both faces of "
                 "a wall become one surface, and one pressure presses them in opposite directions; close the slit or "
                 "hole in the segmentation, or crop the image so that its border cuts the open end, and pass --face "
                 "inner or --face outer. Where it is a solid that bends around something, all is well",
                 subject.name, 1e2 * shelter.share, subject.at(shelter.middle))}};
  }
  if (real(cavities.voxels) < least_share * real(count_voxels(mask))) {
    return {};
  }
  if (cavities.filled) {
    return {{share >= notable_share ? Weight::minor : Weight::note, "cavities filled",
             fmt::format("{}: {} of its cavities filled, {:.2g} % of the volume that the surface encloses, the largest "
                         "around {}; without --fill-cavities, with FILL=0 of the pipeline, they stay",
                         subject.name, cavities.count, 1e2 * share, subject.at(hollows.middle))}};
  }
  return {
      {share >= notable_share ? Weight::major : Weight::minor, "nested surfaces",
       fmt::format("{}: {} of its cavities are surfaces within its surface, {:.2g} % of its volume, the largest around "
                   "{}: their normals point into the hollow, so that pressure presses them the wrong way; "
                   "--fill-cavities, FILL=1 of the pipeline, fills them, and --face takes one face of a wall",
                   subject.name, cavities.count, 1e2 * share, subject.at(hollows.middle))}};
}

std::vector<Warning> doubt_wall(const Subject& subject, const Hollows& hollows) {
  std::vector<Warning> found;
  if (hollows.share < notable_share) {
    found.push_back(
        {Weight::major, "small hollow",
         fmt::format("{}: the hollow that it encloses is {:.2g} % of the volume within, around {}: it may be "
                     "no wall, and its hollow a gap in the segmentation; without --face its own surface is "
                     "extracted",
                     subject.name, 1e2 * hollows.share, subject.at(hollows.middle))});
  }
  if (hollows.sizes.size() > 1) {
    found.push_back(
        {Weight::minor, "several hollows",
         fmt::format("{}: it encloses {} hollows, the largest around {}, the smallest {:.2g} % of that: each of "
                     "them gives a surface; --largest, LARGEST=1 of the pipeline, takes the largest alone",
                     subject.name, hollows.sizes.size(), subject.at(hollows.middle),
                     1e2 * real(hollows.sizes.back()) / real(hollows.sizes.front()))});
  }
  return found;
}

std::vector<Warning> doubt_bridge(const Subject& subject, const std::optional<Bridge>& bridge) {
  if (!bridge) {
    return {};
  }
  return {{Weight::major, "narrow bridge",
           fmt::format(
               "{}: two large parts of it are joined at {} by a bridge {} voxel(s) in section, the smaller one "
               "{:.2g} % of its voxels: they may be two organs that touch there, and the stress at the bridge means "
               "nothing; part them in the segmentation, or smooth it if they are one",
               subject.name, subject.at(bridge->place), bridge->section, 1e2 * bridge->share)}};
}

std::vector<Warning> doubt_openings(const Subject& subject, const Openings& openings, double area) {
  if (openings.openings.empty()) {
    return {{Weight::minor, "no opening",
             fmt::format("{}: 0 openings found: the image's border does not cut it, so that it stays closed as without "
                         "--open-border (OPEN=1); open a vessel that ends within the image by --cut 'above z=40mm' "
                         "(CUT='above z=40mm')",
                         subject.name)}};
  }
  std::vector<Vec3> places;
  double lids = 0;
  for (const Opening& opening : openings.openings) {
    if (!opening.is_end) {
      places.push_back(opening.middle);
      lids += opening.area;
    }
  }
  if (places.empty()) {
    return {};
  }
  return {{lids >= notable_share * area ? Weight::major : Weight::minor, "side cut",
           fmt::format(
               "{}: the image's border cuts off a side of it at {}: that is no end of a vessel, so a flat lid closes "
               "it there, {:.2g} % of the surface; shape and stress are wrong on the lid and around it; take an "
               "image that holds its whole width, or cut the part beside the border off (--cut, of the pipeline CUT)",
               subject.name, list_places(subject, places), 1e2 * lids / area)}};
}

std::vector<Warning> doubt_rims(const Subject& subject, const Mask& mask, const TriangleMesh& surface,
                                const std::vector<std::vector<Index>>& rims) {
  const Mat3 to_index = mask.affine().leftCols<3>().inverse();
  std::vector<Vec3> narrow_ones;
  std::vector<Vec3> bent;
  bool across = false;
  for (const auto& rim : rims) {
    if (rim.size() < narrow_rim) {
      narrow_ones.push_back(middle_of(surface, rim));
    }
    const auto faces = faces_of(mask, to_index, surface, rim);
    if (faces.size() > 1) {
      bent.push_back(middle_of(surface, rim));
      across |= opposite(faces);
    }
  }
  std::vector<Warning> found;
  if (!bent.empty()) {
    found.push_back(
        {across ? Weight::major : Weight::minor, "bent rim",
         fmt::format("{}: {} of its {} opening(s) run over several faces of the image, at {}: that is no plane "
                     "section of a vessel, but supports at the boundary hold all of it, so that displacement "
                     "and stress near it are not those of a vessel's end; crop the image so that one face cuts "
                     "across it",
                     subject.name, bent.size(), rims.size(), list_places(subject, bent))});
  }
  if (!narrow_ones.empty()) {
    found.push_back(
        {Weight::minor, "narrow opening",
         fmt::format(
             "{}: {} of its {} opening(s) are only a few voxels wide, at {}: supports at the boundary hold them as "
             "they do the ends of a vessel; crop the outermost slices, or hold the ends by where they are "
             "(--fix 'above z=...', FIX of the pipeline)",
             subject.name, narrow_ones.size(), rims.size(), list_places(subject, narrow_ones))});
  }
  return found;
}

std::vector<Warning> doubt_closed_border(const Subject& subject, const Mask& mask, const Inside& inside) {
  const std::size_t cut = count_at_border(mask);
  if (cut == 0) {
    return {};
  }
  std::vector<Warning> found;
  const auto& dims = mask.dims();
  const auto inner = [](std::size_t count) { return count - std::min<std::size_t>(count, 2); };
  const std::size_t border = dims[0] * dims[1] * dims[2] - inner(dims[0]) * inner(dims[1]) * inner(dims[2]);
  if (inside.rule != Inside::Rule::label && 2 * cut > border) {
    found.push_back(
        {Weight::major, "other side",
         fmt::format("{}: it is most of the image's border, so what is meant may be the other side (--inside {})",
                     subject.name, inside.rule == Inside::Rule::above ? "below" : "above")});
  }
  found.push_back(
      {Weight::minor, "cut by the border",
       fmt::format("{}: the image's border cuts it ({} voxels), and flat lids close it there, which bulge under "
                   "pressure as no vessel does; --open-border, OPEN=1 of the pipeline, leaves it open",
                   subject.name, cut)});
  return found;
}

std::vector<Warning> doubt_pieces(const Subject& subject, double share) {
  if (!(share > notable_share)) {
    return {};
  }
  return {{Weight::minor, "pieces left out",
           fmt::format("{}: only its largest piece is taken: {:.3g} % of its voxels lie in others, which are left out; "
                       "without --largest, LARGEST=0 of the pipeline, they stay",
                       subject.name, 1e2 * share)}};
}

std::vector<Warning> doubt_smoothing(const Subject& subject, double share) {
  if (!(share > notable_smoothing)) {
    return {};
  }
  return {
      {Weight::minor, "smoothing",
       fmt::format("{}: smoothing changes the shape: it moves as many voxels in or out as {:.3g} % of its own; pass a "
                   "smaller sigma",
                   subject.name, 1e2 * share)}};
}

std::vector<Warning> doubt_volume(const Subject& subject, const Mask& mask, double volume) {
  const double change = volume / (real(count_voxels(mask)) * mask.voxel_volume()) - 1;
  if (!(std::abs(change) > notable_few)) {
    return {};
  }
  return {{Weight::minor, "few voxels",
           fmt::format(
               "{}: the surface encloses {:.3g} % {} than its voxels, for it is only a few voxels thick: its volume, "
               "and what pressure does to it, may be off by as much; take an image of finer voxels",
               subject.name, 1e2 * std::abs(change), change < 0 ? "less" : "more")}};
}

}  // namespace tunica
