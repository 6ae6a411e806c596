#include "tunica/io/mesh/mesh_pair.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/mesh/surface_doubts.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace tunica {
namespace {

constexpr std::array<std::string_view, 4> units{"um", "mm", "cm", "m"};
constexpr double slack = 1.25;              // a coarse mesh may be smaller than what it stands for
constexpr double largest_unit_ratio = 500;  // half of the ratio of neighbouring prefixes, whatever the shapes
constexpr double diagonals_away = 1;        // as much as the whole thing: it lies somewhere else

bool about(double value, double expected) { return value < slack * expected && value > expected / slack; }

// The ratio of two units nearest to `factor`, 1 and more.
double ratio_of_units(double factor) {
  double nearest = 1;
  for (const std::string_view large : units) {
    for (const std::string_view small : units) {
      const double ratio = parse_length_unit(large) / parse_length_unit(small);
      if (std::abs(std::log(ratio / factor)) < std::abs(std::log(nearest / factor))) {
        nearest = ratio;
      }
    }
  }
  return nearest;
}

// Whether every extent of `large` is about `factor` times that of `small`; extents that vanish in both say nothing.
bool similar(const Box& large, const Box& small, double factor) {
  constexpr double flat = 0.01;  // of the diagonal
  for (int axis = 0; axis < 3; ++axis) {
    const double of_large = large.upper[axis] - large.lower[axis];
    const double of_small = small.upper[axis] - small.lower[axis];
    const bool vanish = of_large < flat * large.diagonal() && of_small < flat * small.diagonal();
    if (!vanish && !about(of_large, factor * of_small)) {
      return false;
    }
  }
  return true;
}

// "um, not mm" for a mesh that is `factor` times as large as it should be; nothing where no unit explains it.
std::optional<std::string> likely_unit(const MeshFile& file, std::optional<double> unit_mm, double factor) {
  const double read = file.units ? parse_length_unit(*file.units) : unit_mm.value_or(1);
  std::string_view said = "mm";
  std::optional<std::string_view> meant;
  for (const std::string_view unit : units) {
    said = parse_length_unit(unit) == read ? unit : said;
    meant = about(parse_length_unit(unit), read / factor) ? std::optional(unit) : meant;
  }
  return meant ? std::optional(fmt::format("{}, not {}", *meant, said)) : std::nullopt;
}

}  // namespace

MeshFacts require_surface(const MeshFile& file, const std::filesystem::path& path) {
  MeshFacts facts = examine(file.mesh);
  if (const auto why = why_unfit_surface(file.mesh, facts)) {
    throw InputError(
        fmt::format("{}: {}; mend it with tunica-decimate --repair, --triangles as many as it has to keep all",
                    path.string(), *why));
  }
  if (!(bounding_box(file.mesh).diagonal() > 0)) {
    throw InputError(fmt::format("{}: the mesh has no extent", path.string()));
  }
  return facts;
}

void require_same_scale(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                        const std::filesystem::path& path_b, std::optional<double> unit_mm) {
  const Box box_a = bounding_box(a.mesh);
  const Box box_b = bounding_box(b.mesh);
  if (!(box_a.diagonal() > 0 && box_b.diagonal() > 0)) {
    return;  // a point has no scale
  }
  const double a_to_b = box_a.diagonal() / box_b.diagonal();
  const double factor = std::max(a_to_b, 1 / a_to_b);
  const double ratio = ratio_of_units(factor);
  const bool wrong_unit =
      ratio > 1 && about(factor, ratio) && (a_to_b > 1 ? similar(box_a, box_b, factor) : similar(box_b, box_a, factor));
  if (!wrong_unit && factor < largest_unit_ratio) {
    return;
  }
  const auto of_a = likely_unit(a, unit_mm, a_to_b);
  const auto of_b = likely_unit(b, unit_mm, 1 / a_to_b);
  std::string guess = "one of them is probably in another unit";
  if (of_a || of_b) {
    guess = fmt::format("the numbers of {} are probably {}", (of_a ? path_a : path_b).string(), of_a ? *of_a : *of_b);
    if (of_a && of_b) {
      guess += fmt::format(", or those of {} {}", path_b.string(), *of_b);
    }
  }
  const std::string times = wrong_unit ? fmt::format("about {:.0f}", ratio) : fmt::format("{:.4g}", factor);
  throw InputError(
      fmt::format("{}: is {} times as {} as {}: {}; correct the unit (--mesh-unit, or the comment "
                  "\"units\" of a PLY) or scale it",
                  path_a.string(), times, a_to_b > 1 ? "large" : "small", path_b.string(), guess));
}

void require_near(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                  const std::filesystem::path& path_b) {
  const Box box_a = bounding_box(a.mesh);
  const Box box_b = bounding_box(b.mesh);
  const Vec3 apart = (box_a.lower - box_b.upper).cwiseMax(box_b.lower - box_a.upper).cwiseMax(0.0);
  const double larger = std::max(box_a.diagonal(), box_b.diagonal());
  if (apart.norm() >= diagonals_away * larger && larger > 0) {
    throw InputError(
        fmt::format("{}: lies {:.4g} mm away from {}, {:.4g} times the larger one's diagonal: they are probably not in "
                    "the same frame or unit; bring them together first",
                    path_a.string(), apart.norm(), path_b.string(), apart.norm() / larger));
  }
}

}  // namespace tunica
