#include "tunica/surface/distance/closest_point.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

// The hierarchy: binned surface-area heuristic (Wald, On fast construction of SAH-based bounding volume hierarchies,
// 2007), four children per node (Wald, Benthin, Boulos, Getting rid of packets, 2008).
namespace tunica {
namespace {

using Lanes = Eigen::Array<double, 4, 1>;

Eigen::Map<const Lanes, Eigen::Aligned32> lanes(const std::array<double, 4>& values) {
  return Eigen::Map<const Lanes, Eigen::Aligned32>(values.data());
}

struct Lanes3 {
  Lanes x, y, z;
};
Lanes3 operator-(const Lanes3& a, const Lanes3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Lanes dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Lanes3 cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Lanes squared_norm_of_difference(const Lanes3& p, const Lanes& s, const Lanes3& d) {
  const Lanes x = p.x - s * d.x;
  const Lanes y = p.y - s * d.y;
  const Lanes z = p.z - s * d.z;
  return x * x + y * y + z * z;
}
// Where the foot of the perpendicular lies on an edge, in [0, 1]; 0 on an edge of no length.
Lanes clamped_ratio(const Lanes& numerator, const Lanes& squared_length) {
  const Lanes t = numerator / squared_length.max(std::numeric_limits<double>::min());
  return t.max(0.0).min(1.0);
}

// Squared distances from points to triangles, both given relative to the triangle's first corner: the least over the
// inside and the three edges. The edges always count: where a triangle is so thin that the foot of the perpendicular is
// wrong, they are as good as the inside.
Lanes squared_distances(const Lanes3& ap, const Lanes3& ab, const Lanes3& ac) {
  const Lanes3 bc = ac - ab;
  const Lanes3 bp = ap - ab;
  const Lanes along_ab = clamped_ratio(dot(ap, ab), dot(ab, ab));
  const Lanes along_ac = clamped_ratio(dot(ap, ac), dot(ac, ac));
  const Lanes along_bc = clamped_ratio(dot(bp, bc), dot(bc, bc));
  const Lanes squared = squared_norm_of_difference(ap, along_ab, ab)
                            .min(squared_norm_of_difference(ap, along_ac, ac))
                            .min(squared_norm_of_difference(bp, along_bc, bc));
  const Lanes3 n = cross(ab, ac);
  const Lanes squared_n = dot(n, n);
  const Lanes v = dot(n, cross(ap, ac));
  const Lanes w = dot(n, cross(ab, ap));
  const Lanes inverse = squared_n.max(std::numeric_limits<double>::min()).inverse();
  const Lanes v1 = v * inverse;
  const Lanes w1 = w * inverse;
  const Lanes3 rest{ap.x - v1 * ab.x - w1 * ac.x, ap.y - v1 * ab.y - w1 * ac.y, ap.z - v1 * ab.z - w1 * ac.z};
  const Lanes inside = dot(rest, rest);
  return (squared_n > 0 && v >= 0 && w >= 0 && v + w <= squared_n).select(squared.min(inside), squared);
}

/// Among distances that are no numbers none is the least.
void require_place(const Vec3& p) {
  if (!p.allFinite()) {
    throw InputError("the closest point of a place that is not finite was asked for");
  }
}

struct Primitive {
  Vec3 lower, upper;
  Index triangle;
  [[nodiscard]] double centre(int axis) const { return lower[axis] + upper[axis]; }
};

struct Bounds {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = Vec3::Constant(-infinity);
  void add(const Vec3& l, const Vec3& u) {
    lower = lower.cwiseMin(l);
    upper = upper.cwiseMax(u);
  }
  [[nodiscard]] double half_area() const {
    const Vec3 d = upper - lower;
    return d.x() * d.y() + d.y() * d.z() + d.z() * d.x();
  }
};

constexpr std::size_t leaf_size = 4;
constexpr std::size_t parallel_from = 20'000;  // triangles: below, threads cost more than they bring

}  // namespace

Vec3 barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 e1 = b - a, e2 = c - a, d = p - a;
  const double d11 = e1.dot(e1), d12 = e1.dot(e2), d22 = e2.dot(e2), r1 = d.dot(e1), r2 = d.dot(e2);
  const double determinant = d11 * d22 - d12 * d12;
  const double at_b = (d22 * r1 - d12 * r2) / determinant, at_c = (d11 * r2 - d12 * r1) / determinant;
  const Vec3 all = Vec3(1 - at_b - at_c, at_b, at_c).cwiseMax(0.0);
  return all / all.sum();
}

Vec3 closest_point_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = p - a;
  const Vec3 n = ab.cross(ac);
  const double squared_n = n.squaredNorm();
  // Barycentric coordinates of the foot of the perpendicular, times squared_n.
  const double v = n.dot(ap.cross(ac));
  const double w = n.dot(ab.cross(ap));
  Vec3 best = a;
  double squared_best = infinity;
  if (squared_n > 0 && v >= 0 && w >= 0 && v + w <= squared_n) {
    best = a + (v / squared_n) * ab + (w / squared_n) * ac;
    squared_best = (p - best).squaredNorm();
  }
  // The edges always count: in a triangle thin enough for the foot to be wrong they are as good as the inside.
  const auto try_edge = [&](const Vec3& from, const Vec3& edge) {
    const double t =
        std::clamp((p - from).dot(edge) / std::max(edge.squaredNorm(), std::numeric_limits<double>::min()), 0.0, 1.0);
    const Vec3 candidate = from + t * edge;
    const double squared = (p - candidate).squaredNorm();
    if (squared < squared_best) {
      squared_best = squared;
      best = candidate;
    }
  };
  try_edge(a, ab);
  try_edge(a, ac);
  try_edge(b, c - b);
  return best;
}

struct ClosestPoint::Builder {
  ClosestPoint& tree;
  std::vector<Primitive> primitives;

  // A part of the hierarchy, numbered from zero: parts are built side by side.
  struct Part {
    std::vector<Node> nodes;
    std::vector<Leaf> leaves;
    std::vector<Index> order;
  };

  struct Range {
    std::size_t begin, end;
    Bounds bounds;
    [[nodiscard]] std::size_t size() const { return end - begin; }
  };

  [[nodiscard]] Range range(std::size_t begin, std::size_t end) const {
    Range result{begin, end, {}};
    for (std::size_t i = begin; i < end; ++i) {
      result.bounds.add(primitives[i].lower, primitives[i].upper);
    }
    return result;
  }

  // Where to cut a range in two; the primitives are rearranged accordingly.
  std::size_t split(const Range& whole) {
    constexpr std::size_t bins = 16;
    Bounds centres;
    for (std::size_t i = whole.begin; i < whole.end; ++i) {
      const Vec3 centre = primitives[i].lower + primitives[i].upper;
      centres.add(centre, centre);
    }
    const Vec3 extent = centres.upper - centres.lower;
    double best_cost = infinity;
    int best_axis = -1;
    std::size_t best_bin = 0;
    const auto bin_of = [&](const Primitive& p, int axis) {
      const double scaled = (p.centre(axis) - centres.lower[axis]) / extent[axis] * real(bins);
      return std::min(bins - 1, truncated<std::size_t>(scaled));
    };
    for (int axis = 0; axis < 3; ++axis) {
      if (!(extent[axis] > 0)) {
        continue;
      }
      std::array<Bounds, bins> bounds;
      std::array<std::size_t, bins> counts{};
      for (std::size_t i = whole.begin; i < whole.end; ++i) {
        const std::size_t bin = bin_of(primitives[i], axis);
        bounds[bin].add(primitives[i].lower, primitives[i].upper);
        ++counts[bin];
      }
      std::array<double, bins> cost_below{};
      Bounds below;
      std::size_t count = 0;
      for (std::size_t bin = 0; bin + 1 < bins; ++bin) {
        below.add(bounds[bin].lower, bounds[bin].upper);
        count += counts[bin];
        cost_below[bin] = count > 0 ? below.half_area() * real(count) : 0;
      }
      Bounds above;
      count = 0;
      for (std::size_t bin = bins - 1; bin > 0; --bin) {
        above.add(bounds[bin].lower, bounds[bin].upper);
        count += counts[bin];
        if (count == 0 || count == whole.size()) {
          continue;
        }
        const double cost = cost_below[bin - 1] + above.half_area() * real(count);
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = bin;
        }
      }
    }
    const auto first = primitives.begin() + whole.begin;
    const auto last = primitives.begin() + whole.end;
    if (best_axis < 0) {  // all centres coincide
      return whole.begin + whole.size() / 2;
    }
    const auto middle =
        std::partition(first, last, [&](const Primitive& p) { return bin_of(p, best_axis) < best_bin; });
    return middle - primitives.begin();
  }

  std::int32_t make_leaf(const Range& content, Part& part) const {
    const std::size_t index = part.leaves.size();
    Leaf& leaf = part.leaves.emplace_back();
    for (std::size_t lane = 0; lane < leaf_size; ++lane) {
      // A leaf with fewer triangles repeats its last one.
      const Index t = primitives[std::min(content.begin + lane, content.end - 1)].triangle;
      const auto [a, b, c] = tree.corners(t);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Eigen::Index i = axis;
        leaf.origin[axis][lane] = a[i];
        leaf.edge1[axis][lane] = b[i] - a[i];
        leaf.edge2[axis][lane] = c[i] - a[i];
      }
      leaf.triangle[lane] = t;
    }
    for (std::size_t i = content.begin; i < content.end; ++i) {
      part.order.push_back(primitives[i].triangle);
    }
    return ~narrow<std::int32_t>(index);
  }

  // Up to four parts of a range.
  std::size_t divide(const Range& whole, std::array<Range, 4>& parts) {
    parts = {whole};
    std::size_t count = 1;
    while (count < 4) {
      // The part that costs most is divided next.
      std::size_t widest = count;
      double cost = -1;
      for (std::size_t i = 0; i < count; ++i) {
        const double own = parts[i].bounds.half_area() * real(parts[i].size());
        if (parts[i].size() > leaf_size && own > cost) {
          cost = own;
          widest = i;
        }
      }
      if (widest == count) {
        break;
      }
      const std::size_t middle = split(parts[widest]);
      const std::size_t end = parts[widest].end;
      parts[widest] = range(parts[widest].begin, middle);
      std::move_backward(parts.begin() + widest + 1, parts.begin() + count, parts.begin() + count + 1);
      parts[widest + 1] = range(middle, end);
      ++count;
    }
    return count;
  }

  static void set_child(Node& node, std::size_t lane, const Range* content, std::int32_t child) {
    node.child[lane] = child;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Eigen::Index i = axis;
      node.lower[axis][lane] = content != nullptr ? content->bounds.lower[i] : infinity;
      node.upper[axis][lane] = content != nullptr ? content->bounds.upper[i] : -infinity;
    }
  }

  std::int32_t make_node(const Range& whole, Part& part) {
    if (whole.size() <= leaf_size) {
      return make_leaf(whole, part);
    }
    std::array<Range, 4> parts;
    const std::size_t count = divide(whole, parts);
    const auto index = narrow<std::int32_t>(part.nodes.size());
    part.nodes.emplace_back();
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const std::int32_t child = lane < count ? make_node(parts[lane], part) : 0;
      set_child(part.nodes[index], lane, lane < count ? &parts[lane] : nullptr, child);
    }
    return index;
  }

  // Appends a part and numbers its nodes and leaves on. @return the number of its root
  std::int32_t append(Part& part, std::int32_t root) {
    const auto first_node = narrow<std::int32_t>(tree.nodes_.size());
    const auto first_leaf = narrow<std::int32_t>(tree.leaves_.size());
    const auto moved = [&](std::int32_t child) { return child < 0 ? child - first_leaf : child + first_node; };
    for (Node& node : part.nodes) {
      for (std::size_t lane = 0; lane < 4; ++lane) {
        const bool used = node.lower[0][lane] <= node.upper[0][lane];
        node.child[lane] = used ? moved(node.child[lane]) : 0;
      }
    }
    tree.nodes_.insert(tree.nodes_.end(), part.nodes.begin(), part.nodes.end());
    tree.leaves_.insert(tree.leaves_.end(), part.leaves.begin(), part.leaves.end());
    tree.order_.insert(tree.order_.end(), part.order.begin(), part.order.end());
    return moved(root);
  }

  // The whole tree: sixteen parts side by side under two levels of nodes.
  std::int32_t build() {
    const Range whole = range(0, primitives.size());
    if (whole.size() < parallel_from) {
      Part part;
      const std::int32_t root = make_node(whole, part);
      return append(part, root);
    }
    std::array<Range, 4> quarters;
    const std::size_t count = divide(whole, quarters);
    std::array<std::array<Range, 4>, 4> ranges;
    std::array<std::size_t, 4> counts{};
    parallel_for_blocks(count, 1, [&](std::size_t i, std::size_t) { counts[i] = divide(quarters[i], ranges[i]); });
    std::array<Part, 16> parts;
    std::array<std::int32_t, 16> roots{};
    parallel_for_blocks(16, 1, [&](std::size_t i, std::size_t) {
      if (i / 4 < count && i % 4 < counts[i / 4]) {
        roots[i] = make_node(ranges[i / 4][i % 4], parts[i]);
      }
    });
    tree.nodes_.emplace_back();
    for (std::size_t i = 0; i < 4; ++i) {
      set_child(tree.nodes_[0], i, i < count ? &quarters[i] : nullptr, 0);
      if (i >= count) {
        continue;
      }
      const std::size_t index = tree.nodes_.size();
      tree.nodes_[0].child[i] = narrow<std::int32_t>(index);
      tree.nodes_.emplace_back();
      for (std::size_t j = 0; j < 4; ++j) {
        const std::int32_t child = j < counts[i] ? append(parts[4 * i + j], roots[4 * i + j]) : 0;
        set_child(tree.nodes_[index], j, j < counts[i] ? &ranges[i][j] : nullptr, child);
      }
    }
    return 0;
  }
};

ClosestPoint::ClosestPoint(const TriangleMesh& mesh) : vertices_(mesh.vertices), triangles_(mesh.triangles) {
  require_surface(mesh);
  Builder builder{*this, {}};
  builder.primitives.reserve(triangles_.size());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const auto [a, b, c] = corners(narrow<Index>(t));
    builder.primitives.push_back({a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c), narrow<Index>(t)});
    largest_coordinate_ =
        std::max({largest_coordinate_, a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
    const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    const double height = longest > 0 ? 2 * triangle_area(a, b, c) / longest : 0;
    if (height * 100 < longest) {
      const double aspect = height > 0 ? longest / height : 1e16;
      const auto decade = truncated<std::size_t>(std::clamp(std::ceil(std::log10(aspect)), 0.0, 16.0));
      inradius_of_aspect_[decade] = std::max(inradius_of_aspect_[decade], 0.5 * height);
    }
  }
  order_.reserve(triangles_.size());
  leaves_.reserve(triangles_.size() / 2);
  nodes_.reserve(triangles_.size() / 4);
  const std::int32_t root = builder.build();
  if (root < 0) {  // a single leaf: searches start at a node all the same
    Node& node = nodes_.emplace_back();
    const Bounds bounds = builder.range(0, triangles_.size()).bounds;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node.lower[axis].fill(infinity);
      node.upper[axis].fill(-infinity);
      node.lower[axis][0] = bounds.lower[axis];
      node.upper[axis][0] = bounds.upper[axis];
    }
    node.child = {root, 0, 0, 0};
  }
}

std::array<Vec3, 3> ClosestPoint::corners(Index triangle) const {
  const auto& [i, j, k] = triangles_[triangle];
  return {vertices_[i], vertices_[j], vertices_[k]};
}

double ClosestPoint::squared_distance_to(const Vec3& p, Index triangle) const {
  const auto [a, b, c] = corners(triangle);
  return (p - closest_point_on_triangle(p, a, b, c)).squaredNorm();
}

double ClosestPoint::max_squared_distance_to(const std::array<Vec3, 3>& points, Index triangle) const {
  const auto [a, b, c] = corners(triangle);
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const auto broadcast = [](const Vec3& v) {
    return Lanes3{Lanes::Constant(v.x()), Lanes::Constant(v.y()), Lanes::Constant(v.z())};
  };
  const Vec3 p = points[0] - a;
  const Vec3 q = points[1] - a;
  const Vec3 r = points[2] - a;
  const Lanes3 ap{{p.x(), q.x(), r.x(), r.x()}, {p.y(), q.y(), r.y(), r.y()}, {p.z(), q.z(), r.z(), r.z()}};
  return squared_distances(ap, broadcast(ab), broadcast(ac)).maxCoeff();
}

double ClosestPoint::rounding(double reach) const {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  double thin = 0;
  for (std::size_t decade = 0; decade < inradius_of_aspect_.size(); ++decade) {
    // The foot inside a thin triangle is off by the error of its normal; the edges are never farther than the inradius.
    const double foot = 16 * epsilon * std::pow(10.0, real(decade)) * (reach + largest_coordinate_);
    thin = std::max(thin, std::min(inradius_of_aspect_[decade], foot));
  }
  return 16 * epsilon * (largest_coordinate_ + reach) + thin;
}

void ClosestPoint::visit_leaf(const Leaf& leaf, const Vec3& p, double& best, Index& triangle) const {
  const Lanes3 ab{lanes(leaf.edge1[0]), lanes(leaf.edge1[1]), lanes(leaf.edge1[2])};
  const Lanes3 ac{lanes(leaf.edge2[0]), lanes(leaf.edge2[1]), lanes(leaf.edge2[2])};
  const Lanes3 ap{p.x() - lanes(leaf.origin[0]), p.y() - lanes(leaf.origin[1]), p.z() - lanes(leaf.origin[2])};
  const Lanes squared = squared_distances(ap, ab, ac);
  for (std::size_t lane = 0; lane < leaf_size; ++lane) {
    if (squared[lane] < best) {
      best = squared[lane];
      triangle = leaf.triangle[lane];
    }
  }
}

ClosestPoint::Hit ClosestPoint::search(const Vec3& p, double best, Index triangle) const {
  struct Pending {
    double squared_distance;
    std::int32_t child;
  };
  // Every level leaves at most three siblings behind; the builder's depth stays far below this.
  std::array<Pending, 256> stack;
  std::vector<Pending> overflow;
  std::size_t top = 0;
  std::int32_t current = 0;
  while (true) {
    if (current < 0) {
      visit_leaf(leaves_[~current], p, best, triangle);
    } else {
      const Node& node = nodes_[current];
      const Lanes dx = (lanes(node.lower[0]) - p.x()).max(p.x() - lanes(node.upper[0])).max(0.0);
      const Lanes dy = (lanes(node.lower[1]) - p.y()).max(p.y() - lanes(node.upper[1])).max(0.0);
      const Lanes dz = (lanes(node.lower[2]) - p.z()).max(p.z() - lanes(node.upper[2])).max(0.0);
      const Lanes squared = dx * dx + dy * dy + dz * dz;
      std::array<Pending, 4> nearer;
      std::size_t count = 0;
      for (std::size_t lane = 0; lane < 4; ++lane) {
        const double distance = squared[lane];
        if (distance < best) {
          std::size_t at = count++;
          for (; at > 0 && nearer[at - 1].squared_distance < distance; --at) {
            nearer[at] = nearer[at - 1];
          }
          nearer[at] = {distance, node.child[lane]};
        }
      }
      for (std::size_t i = 0; i < count; ++i) {  // farthest first, so that the nearest is on top
        if (top < stack.size()) {
          stack[top++] = nearer[i];
        } else {
          overflow.push_back(nearer[i]);
        }
      }
    }
    Pending next{};
    do {
      if (!overflow.empty()) {
        next = overflow.back();
        overflow.pop_back();
      } else if (top > 0) {
        next = stack[--top];
      } else {
        Hit hit;
        hit.triangle = triangle;
        const auto [a, b, c] = corners(triangle);
        hit.point = closest_point_on_triangle(p, a, b, c);
        hit.squared_distance = (p - hit.point).squaredNorm();
        return hit;
      }
    } while (!(next.squared_distance < best));
    current = next.child;
  }
}

ClosestPoint::Hit ClosestPoint::closest(const Vec3& p) const {
  require_place(p);
  return search(p, infinity, leaves_.front().triangle[0]);
}

ClosestPoint::Hit ClosestPoint::closest(const Vec3& p, Index guess) const {
  require_place(p);
  if (guess >= triangles_.size()) {
    throw InputError(fmt::format("there is no triangle {} to begin at, but {}", guess, triangles_.size()));
  }
  const double squared = squared_distance_to(p, guess);
  // A little more than its distance: the guess itself may come out again, in whatever rounding.
  return search(p, squared * (1 + 1e-12), guess);
}

}  // namespace tunica
