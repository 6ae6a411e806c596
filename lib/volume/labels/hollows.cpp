#include "tunica/volume/labels/hollows.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/labels/detail/voxel_runs.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <map>
#include <utility>

namespace tunica {
namespace {

/// Of the largest one: smaller hollows are noise of the segmentation, not lumens.
constexpr double least_of_largest = 0.01;
/// Of a selection's voxels: a smaller part is a branch or noise, not another organ.
constexpr double least_part = 0.05;
constexpr std::size_t widest_bridge = 9;

/// How many of the bits [begin, end) are set.
std::size_t count_in(const std::uint64_t* words, std::size_t begin, std::size_t end) {
  std::size_t count = 0;
  for (std::size_t at = begin; at < end;) {
    const std::size_t stop = std::min(end, (at / 64 + 1) * 64);
    const std::uint64_t below = stop % 64 == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << (stop % 64)) - 1;
    count += std::popcount((words[at / 64] & below) >> (at % 64));
    at = stop;
  }
  return count;
}

/// A component of what is outside.
struct Component {
  std::size_t voxels = 0;
  double border = 0;     ///< mm^2 that it has in common with the image's border
  double selection = 0;  ///< and with the selection
  bool at_edge = false;  ///< it has a voxel on two faces of the image
  Vec3 sum = Vec3::Zero();
};

Vec3 face_areas(const Mask& mask) {
  const Mat3 a = mask.affine().leftCols<3>();
  return {a.col(1).cross(a.col(2)).norm(), a.col(2).cross(a.col(0)).norm(), a.col(0).cross(a.col(1)).norm()};
}

void add_run(Component& to, const Mask& mask, const VoxelRuns::Run& run, std::size_t j, std::size_t k,
             const Vec3& area) {
  const auto& dims = mask.dims();
  const std::size_t length = run.end - run.begin;
  int faces = 0;  // of the image that it touches, at one voxel
  // One side of a row: on the border, or with neighbours of which some are selected.
  const auto side = [&](bool at_border, std::size_t axis, std::size_t row, std::size_t slice) {
    if (at_border) {
      to.border += real(length) * area[narrow<Eigen::Index>(axis)];
      ++faces;
    } else {
      to.selection += real(count_in(mask.row(row, slice), run.begin, run.end)) * area[narrow<Eigen::Index>(axis)];
    }
  };
  if (dims[0] > 1) {
    const int ends = (run.begin == 0 ? 1 : 0) + (run.end == dims[0] ? 1 : 0);
    to.border += ends * area[0];
    to.selection += (2 - ends) * area[0];
    faces += ends > 0 ? 1 : 0;
  }
  if (dims[1] > 1) {
    side(j == 0, 1, j - 1, k);
    side(j + 1 == dims[1], 1, j + 1, k);
  }
  if (dims[2] > 1) {
    side(k == 0, 2, j, k - 1);
    side(k + 1 == dims[2], 2, j, k + 1);
  }
  to.at_edge |= faces > 1;
  to.voxels += length;
  to.sum += real(length) * Vec3(0.5 * real(run.begin + run.end - 1), real(j), real(k));
}

/// The component that is the outside; the number of components where there is none.
std::size_t outside_of(const std::vector<Component>& components) {
  std::size_t outside = components.size();
  for (std::size_t i = 0; i < components.size(); ++i) {
    const Component& one = components[i];
    if (one.at_edge && (outside == components.size() || one.border > components[outside].border)) {
      outside = i;
    }
  }
  return outside;
}

/// The selection without its outermost voxels: those with a neighbour, across a face, that is outside. Beyond the image
/// everything is as it is at the border.
Mask eroded(const Mask& mask) {
  Mask inner(mask.dims(), mask.affine());
  const auto [columns, rows, slices] = mask.dims();
  const std::size_t words = mask.words_per_row();
  for (std::size_t k = 0; k < slices; ++k) {
    check_interrupt();
    for (std::size_t j = 0; j < rows; ++j) {
      const std::uint64_t* const row = mask.row(j, k);
      const std::array around{mask.row(j > 0 ? j - 1 : j, k), mask.row(j + 1 < rows ? j + 1 : j, k),
                              mask.row(j, k > 0 ? k - 1 : k), mask.row(j, k + 1 < slices ? k + 1 : k)};
      for (std::size_t w = 0; w < words; ++w) {
        const std::uint64_t before = w > 0 ? row[w - 1] >> 63 : row[0] & 1;
        std::uint64_t left = row[w] << 1 | before;
        std::uint64_t right = row[w] >> 1 | (w + 1 < words ? row[w + 1] << 63 : 0);
        if (w == (columns - 1) / 64) {
          right |= row[w] & std::uint64_t{1} << ((columns - 1) % 64);
        }
        std::uint64_t kept = row[w] & left & right;
        for (const std::uint64_t* const other : around) {
          kept &= other[w];
        }
        inner.row(j, k)[w] = kept;
      }
    }
  }
  return inner;
}

/// Numbers of a mask's voxels, in memory order.
class Numbers {
public:
  explicit Numbers(const Mask& mask) : mask_(mask) {
    const auto [columns, rows, slices] = mask.dims();
    first_.push_back(0);
    for (std::size_t row = 0; row < rows * slices; ++row) {
      first_.push_back(first_.back() + count_in(mask.row(row % rows, row / rows), 0, columns));
    }
  }
  [[nodiscard]] std::size_t size() const { return first_.back(); }
  [[nodiscard]] std::size_t operator()(const std::array<std::size_t, 3>& at) const {
    return first_[at[1] + mask_.dims()[1] * at[2]] + count_in(mask_.row(at[1], at[2]), 0, at[0]);
  }

private:
  const Mask& mask_;
  std::vector<std::size_t> first_;  ///< of each row, and one more
};

template <typename Visit>
void for_each_neighbour(const std::array<std::size_t, 3>& dims, const std::array<std::size_t, 3>& at,
                        const Visit& visit) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    auto next = at;
    if (at[axis] > 0) {
      --next[axis];
      visit(next);
      ++next[axis];
    }
    if (at[axis] + 1 < dims[axis]) {
      ++next[axis];
      visit(next);
    }
  }
}

/// Grows parts into the rest of a selection, all at once, until they meet.
class Growth {
public:
  Growth(const Mask& mask, const std::vector<Mask>& parts) : mask_(mask), parts_(parts), rest_(mask) {
    const std::size_t words = mask.words_per_row() * mask.dims()[1] * mask.dims()[2];
    for (const Mask& part : parts) {
      std::transform(rest_.row(0, 0), rest_.row(0, 0) + words, part.row(0, 0), rest_.row(0, 0),
                     [](std::uint64_t all, std::uint64_t of_part) { return all & ~of_part; });
    }
  }

  struct Meeting {
    std::array<std::size_t, 3> first;  ///< voxel where they met first
    std::size_t seen = 0;              ///< faces between them, each from both of its voxels
  };

  /// By pair of parts. @return where they meet
  std::map<std::pair<std::size_t, std::size_t>, Meeting> run() {
    const Numbers number(rest_);
    constexpr std::uint32_t none = 0xffffffff;
    std::vector<std::uint32_t> owner(number.size(), none);
    std::vector<std::array<std::size_t, 3>> front = seeds(number, owner);
    std::map<std::pair<std::size_t, std::size_t>, Meeting> meetings;
    while (!front.empty()) {
      check_interrupt();
      std::vector<std::array<std::size_t, 3>> next_front;
      for (const auto& at : front) {
        const std::uint32_t mine = owner[number(at)];
        for_each_neighbour(mask_.dims(), at, [&](const std::array<std::size_t, 3>& next) {
          if (!rest_(next[0], next[1], next[2])) {
            return;
          }
          std::uint32_t& its = owner[number(next)];
          if (its == none) {
            its = mine;
            next_front.push_back(next);
          } else if (its != mine) {
            auto& meeting = meetings.try_emplace(std::minmax<std::size_t>(mine, its), Meeting{at, 0}).first->second;
            ++meeting.seen;
          }
        });
      }
      front = std::move(next_front);
    }
    return meetings;
  }

private:
  /// What lies beside a part is its own.
  std::vector<std::array<std::size_t, 3>> seeds(const Numbers& number, std::vector<std::uint32_t>& owner) const {
    std::vector<std::array<std::size_t, 3>> front;
    const VoxelRuns runs(rest_, true);
    runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
      for (std::size_t i = runs[run].begin; i < runs[run].end; ++i) {
        const std::array at{i, j, k};
        std::optional<std::uint32_t> part;
        for_each_neighbour(mask_.dims(), at, [&](const std::array<std::size_t, 3>& next) {
          for (std::uint32_t p = 0; !part && p < parts_.size(); ++p) {
            if (parts_[p](next[0], next[1], next[2])) {
              part = p;
            }
          }
        });
        if (part) {
          owner[number(at)] = *part;
          front.push_back(at);
        }
      }
    });
    return front;
  }

  const Mask& mask_;
  const std::vector<Mask>& parts_;
  Mask rest_;
};

}  // namespace

Hollows find_hollows(const Mask& mask) {
  VoxelRuns runs(mask, false);
  runs.connect(false);
  std::vector<std::size_t> number(runs.size(), runs.size());  // of its component, at each root
  std::vector<Component> components;
  const Vec3 area = face_areas(mask);
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    std::size_t& its = number[runs.root(run)];
    if (its == runs.size()) {
      its = components.size();
      components.emplace_back();
    }
    add_run(components[its], mask, runs[run], j, k, area);
  });
  const std::size_t outside = outside_of(components);
  std::size_t largest = components.size();
  std::vector<bool> hollow(components.size());
  for (std::size_t i = 0; i < components.size(); ++i) {
    const Component& one = components[i];
    hollow[i] = i != outside && (!one.at_edge || one.selection > one.border);
    if (hollow[i] && (largest == components.size() || one.voxels > components[largest].voxels)) {
      largest = i;
    }
  }
  Hollows found{Mask(mask.dims(), mask.affine()), Mask(mask.dims(), mask.affine()), {}};
  if (largest == components.size()) {
    return found;
  }
  const auto counts = [&](std::size_t i) {
    return hollow[i] && real(components[i].voxels) >= least_of_largest * real(components[largest].voxels);
  };
  std::size_t voxels = 0;
  for (std::size_t i = 0; i < components.size(); ++i) {
    if (counts(i)) {
      found.sizes.push_back(components[i].voxels);
      voxels += components[i].voxels;
      found.closed = found.closed && components[i].border == 0;
    }
  }
  std::ranges::sort(found.sizes, std::greater{});
  found.share = real(voxels) / real(voxels + count_voxels(mask));
  found.middle =
      mask.affine().leftCols<3>() * (components[largest].sum / real(components[largest].voxels)) + mask.affine().col(3);
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    const std::size_t its = number[runs.root(run)];
    if (hollow[its]) {
      set_run(found.all, runs[run], j, k, true);
    }
    if (counts(its)) {
      set_run(found.voxels, runs[run], j, k, true);
    }
  });
  return found;
}

Mask inner_solid(const Hollows& hollows) {
  Mask solid = hollows.voxels;
  fill_cavities(solid);
  return solid;
}

Mask outer_solid(const Mask& wall, const Hollows& hollows) {
  if (wall.dims() != hollows.all.dims()) {
    throw InputError("a wall and its hollows have different dimensions");
  }
  Mask solid = wall;
  const std::size_t words = wall.words_per_row() * wall.dims()[1] * wall.dims()[2];
  std::transform(solid.row(0, 0), solid.row(0, 0) + words, hollows.all.row(0, 0), solid.row(0, 0),
                 [](std::uint64_t a, std::uint64_t b) { return a | b; });
  return solid;
}

std::optional<Bridge> find_bridge(const Mask& mask) {
  const Mask inner = eroded(mask);
  VoxelRuns runs(inner, true);
  runs.connect(false);
  const std::vector<std::size_t> sizes = runs.component_sizes();
  const double least = least_part * real(count_voxels(mask));
  std::vector<std::size_t> part_of(runs.size(), runs.size());
  std::vector<Mask> parts;
  std::vector<std::size_t> voxels;
  for (std::size_t run = 0; run < runs.size(); ++run) {
    if (sizes[run] > 0 && real(sizes[run]) >= least) {
      part_of[run] = parts.size();
      parts.emplace_back(mask.dims(), mask.affine());
      voxels.push_back(sizes[run]);
    }
  }
  if (parts.size() < 2) {
    return {};
  }
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    const std::size_t part = part_of[runs.root(run)];
    if (part < parts.size()) {
      set_run(parts[part], runs[run], j, k, true);
    }
  });
  std::optional<Bridge> narrowest;
  for (const auto& [pair, meeting] : Growth(mask, parts).run()) {
    const std::size_t section = meeting.seen / 2;
    if (section > widest_bridge || (narrowest && narrowest->section <= section)) {
      continue;
    }
    const Vec3 at(real(meeting.first[0]), real(meeting.first[1]), real(meeting.first[2]));
    narrowest = Bridge{mask.affine().leftCols<3>() * at + mask.affine().col(3), section,
                       real(std::min(voxels[pair.first], voxels[pair.second])) / real(count_voxels(mask))};
  }
  return narrowest;
}

}  // namespace tunica
