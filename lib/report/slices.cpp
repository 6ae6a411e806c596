#include "tunica/report/detail/organ.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/draw/slice_sheet.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/volume/label_names.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/report/detail/arguments.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <optional>
#include <ranges>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;

/// What the extraction read, and which of its samples are the organ.
struct Image {
  Volume volume;
  Mask organ;
  bool grey = false;  ///< a grey image at an isovalue, not labels
};

std::optional<std::size_t> count_in(const PipelineCase& one, const char* flag) {
  const auto text = argument(one, "extract", flag);
  const auto value = text ? parse_number(*text) : std::nullopt;
  return value && *value >= 0 && *value < 1e9 ? std::optional(truncated<std::size_t>(*value)) : std::nullopt;
}

// The rules by which the extraction chose: that of one of them is enough.
std::vector<Inside> rules_of(const PipelineCase& one, const Volume& volume) {
  if (const auto text = argument(one, "extract", "--label")) {
    std::vector<Inside> rules;
    if (const auto whole = find_label(volume.label_names, *text)) {
      return {Inside{Inside::Rule::label, *whole}};
    }
    for (const auto part : *text | std::views::split('+')) {
      const auto value = find_label(volume.label_names, std::string(part.begin(), part.end()));
      if (!value) {
        return {};
      }
      rules.push_back({Inside::Rule::label, *value});
    }
    return rules;
  }
  const auto level = argument(one, "extract", "--isovalue");
  const auto value = level ? parse_number(*level) : std::nullopt;
  const bool below = argument(one, "extract", "--inside") == "below";
  return value ? std::vector{Inside{below ? Inside::Rule::below : Inside::Rule::above, *value}} : std::vector<Inside>{};
}

// Errors: InputError that says why the volume cannot be shown.
Image read_image(const PipelineCase& one) {
  const std::vector<ReportedFile> inputs = one.files("extract", "inputs");
  if (inputs.empty() || inputs.front().path.empty()) {
    throw InputError("no slices: the report of the extraction names no volume");
  }
  const auto& [path, hash] = inputs.front();
  if (!hash.empty() && sha256_of_file(path) != hash) {
    throw InputError(path.string() + ": is not the volume that was extracted any more: no slices of it are shown");
  }
  VolumeOptions options;
  options.frame = count_in(one, "--frame");
  options.layer = count_in(one, "--layer");
  options.prefer_qform = arguments_of(one, "extract").contains("--prefer-qform");
  options.segment = argument(one, "extract", "--names") ? std::nullopt : argument(one, "extract", "--label");
  Volume volume = read_volume(path, options).volume;
  const std::vector<Inside> rules = rules_of(one, volume);
  if (rules.empty()) {
    throw InputError("no slices: what the extraction was given is no label of the volume, nor an isovalue");
  }
  Mask organ = select(volume, rules.front());
  for (const Inside& rule : rules | std::views::drop(1)) {
    unite(organ, select(volume, rule));
  }
  return {std::move(volume), std::move(organ), rules.front().rule != Inside::Rule::label};
}

// The shells in voxel coordinates.
TriangleMesh shells_in_voxels(const fs::path& path, const Volume& volume) {
  constexpr int pieces = 3;
  const MeshFile file = read_mesh(path);
  const ShellMesh shell = shell_of(file, path);
  require_fit(shell, path.string());
  TriangleMesh mesh = tessellate_uniformly(shell, pieces).mesh;
  const Mat3 inverse = volume.affine.leftCols<3>().inverse();
  const bool turned = file.space == "RAS";
  for (Vec3& p : mesh.vertices) {
    const Vec3 place = turned ? Vec3(-p.x(), -p.y(), p.z()) : p;
    p = inverse * (place - volume.affine.col(3));
  }
  return mesh;
}

double sample(const Volume& volume, std::size_t at) {
  return std::visit([&](const auto& data) { return static_cast<double>(data[at]); }, volume.data);
}

/// A direction of the voxels in a slice: which, and whether it runs against the picture's.
struct Direction {
  Eigen::Index axis = 0;
  Eigen::Index world = 0;  ///< 0: left-right, 1: front-back, 2: feet-head: where it mostly points to
  bool reversed = false;
};

// For each axis of the world the axis of the voxels along it; the picture shows right, down as left, back, feet.
std::array<Direction, 3> directions_of(const Volume& volume) {
  std::array<Direction, 3> directions;
  std::array<bool, 3> taken{};
  for (Eigen::Index world = 0; world < 3; ++world) {
    double most = -1;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double part = volume.affine(world, axis) / volume.affine.col(axis).norm();
      if (!taken[narrow<std::size_t>(axis)] && std::abs(part) > most) {
        most = std::abs(part);
        directions[narrow<std::size_t>(world)] = {axis, world, (part < 0) != (world == 2)};
      }
    }
    taken[narrow<std::size_t>(directions[narrow<std::size_t>(world)].axis)] = true;
  }
  return directions;
}

/// A range of voxels along each axis, the ends included.
struct Range {
  std::array<int, 3> first{};
  std::array<int, 3> last{};
};

Range range_of(const TriangleMesh& shells, const Volume& volume) {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const Vec3& p : shells.vertices) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  Range range;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = narrow<Eigen::Index>(k);
    const double margin = 2 + 0.1 * (upper[axis] - lower[axis]);
    const double most = real(volume.dims[k]) - 1;
    range.first[k] = truncated<int>(std::clamp(std::floor(lower[axis] - margin), 0.0, most));
    range.last[k] = truncated<int>(std::clamp(std::ceil(upper[axis] + margin), 0.0, most));
  }
  return range;
}

// Where the shells cross the plane at `level` of an axis.
std::vector<std::array<Vec3, 2>> crossings(const TriangleMesh& shells, Eigen::Index axis, double level) {
  std::vector<std::array<Vec3, 2>> found;
  for (const auto& triangle : shells.triangles) {
    std::vector<Vec3> ends;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& a = shells.vertices[triangle[k]];
      const Vec3& b = shells.vertices[triangle[(k + 1) % 3]];
      if ((a[axis] < level) != (b[axis] < level)) {
        ends.emplace_back(a + (level - a[axis]) / (b[axis] - a[axis]) * (b - a));
      }
    }
    if (ends.size() == 2) {
      found.push_back({ends[0], ends[1]});
    }
  }
  return found;
}

SlicePanel panel_of(const Image& image, const TriangleMesh& shells, const Range& range, const Direction& across,
                    const Direction& down, const Direction& through, int level) {
  const auto at = [](const Direction& direction) { return narrow<std::size_t>(direction.axis); };
  const auto first = [&](const Direction& d) { return d.reversed ? range.last[at(d)] : range.first[at(d)]; };
  const auto step = [](const Direction& d) { return d.reversed ? -1 : 1; };
  SlicePanel panel;
  panel.columns = range.last[at(across)] - range.first[at(across)] + 1;
  panel.rows = range.last[at(down)] - range.first[at(down)] + 1;
  panel.spacing = {image.volume.affine.col(across.axis).norm(), image.volume.affine.col(down.axis).norm()};
  std::vector<double> values;
  std::array<std::size_t, 3> voxel{};
  voxel[at(through)] = narrow<std::size_t>(level);
  for (int row = 0; row < panel.rows; ++row) {
    for (int column = 0; column < panel.columns; ++column) {
      voxel[at(across)] = narrow<std::size_t>(first(across) + step(across) * column);
      voxel[at(down)] = narrow<std::size_t>(first(down) + step(down) * row);
      const auto& dims = image.volume.dims;
      values.push_back(sample(image.volume, voxel[0] + dims[0] * (voxel[1] + dims[1] * voxel[2])));
      panel.selected.push_back(image.organ(voxel[0], voxel[1], voxel[2]) ? 1 : 0);
    }
  }
  const auto [least, most] = std::ranges::minmax(values);
  for (const double value : values) {
    const double grey = image.grey && most > least ? 255 * (value - least) / (most - least) : value != 0 ? 120 : 0;
    panel.grey.push_back(std::isfinite(grey) ? truncated<unsigned char>(std::clamp(grey, 0.0, 255.0)) : 0);
  }
  for (const auto& line : crossings(shells, through.axis, level)) {
    const auto place = [&](const Vec3& p) {
      return Vec2(step(across) * (p[across.axis] - first(across)), step(down) * (p[down.axis] - first(down)));
    };
    panel.outline.push_back({place(line[0]), place(line[1])});
  }
  return panel;
}

std::string sheet_of(const Image& image, const TriangleMesh& shells, int pixels) {
  const Range range = range_of(shells, image.volume);
  const auto [left_right, front_back, feet_head] = directions_of(image.volume);
  std::vector<SlicePanel> panels;
  for (const auto& [across, down, through] : {std::array{left_right, front_back, feet_head},
                                              {left_right, feet_head, front_back},
                                              {front_back, feet_head, left_right}}) {
    Vec2 extent(infinity, -infinity);
    for (const Vec3& p : shells.vertices) {
      extent = {std::min(extent.x(), p[through.axis]), std::max(extent.y(), p[through.axis])};
    }
    for (const double part : {0.25, 0.5, 0.75}) {
      const double level = std::round(extent.x() + part * (extent.y() - extent.x()));
      const double most = real(image.volume.dims[narrow<std::size_t>(through.axis)]) - 1;
      panels.push_back(
          panel_of(image, shells, range, across, down, through, truncated<int>(std::clamp(level, 0.0, most))));
    }
  }
  return slice_sheet(panels, 3, pixels);
}

}  // namespace

void draw_slices(CaseReport& one, const Room& room) {
  std::error_code error;
  if (one.source.folder.empty() || !fs::exists(one.source.folder / "shell.ply", error)) {
    return;
  }
  const fs::path shells = one.source.folder / (has_refined_shells(one.source) ? "refined.ply" : "shell.ply");
  try {
    const Image image = read_image(one.source);
    one.slices = sheet_of(image, shells_in_voxels(shells, image.volume), room.slice);
  } catch (const Error& failure) {
    if (failure.code() != ExitCode::input && failure.code() != ExitCode::usage) {
      throw;
    }
    one.missing.push_back(one.redacted(failure.what()));
  }
}

}  // namespace tunica::report
