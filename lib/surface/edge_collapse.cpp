#include "surface/edge_collapse.hpp"

#include "core/error.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr Index none = 0xffffffff;
/// A triangle may turn by at most acos(0.2) = 78 degrees in one collapse.
constexpr double least_cosine = 0.2;
/// What a collapse may make of the triangles: cosine of the sharpest fold between neighbours, and height over longest
/// edge of the thinnest triangle (0.08 leaves no angle below 4.6 degrees), unless they were worse before. The next
/// limits count when the ones before leave nothing to collapse.
constexpr std::array<ShapeLimits, 3> shape_limits{{{0, 0.08}, {-0.5, 0.06}, {-0.9, 0.01}}};
constexpr std::array<ShapeLimits, 3> good_shape_limits{{{0, 0.25}, {-0.5, 0.15}, {-0.9, 0.01}}};
/// Uncertainty of the planes' normals, squared, where shape counts: vertices are drawn to the middle of the area that
/// they stand for (Trettner, Kobbelt, Fast and robust QEF minimization using probabilistic quadrics, 2020).
constexpr double normal_variance = 0.02;
/// Weight of the planes that stand on boundary edges. New boundary vertices lie on the curve, so all of their error is
/// on one side of it; and a ragged rim is seen before a rough surface.
constexpr double boundary_weight = 30;
/// How strongly a new vertex is held near the middle of its edge where the quadric is flat.
constexpr double pull = 1e-5;
/// Weight of an edge's squared length times its quadric's weight: on flat ground short edges go first.
constexpr double length_weight = 1e-7;

// A quadric sums squared distance times area. Divided by all of its area it would be a mean squared distance, which is
// closer to the largest distance but knows nothing of size; this power in between gave the least largest errors.
double per_area(double area) { return area > 0 ? 1 / std::sqrt(area * std::sqrt(area)) : 1; }     // area^-0.75
double length_to_quadric(double squared_length) { return std::sqrt(std::sqrt(squared_length)); }  // (length^2)^0.25

double height_over_longest(const Vec3& normal, const Vec3& a, const Vec3& b, const Vec3& c) {
  const double squared_longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return squared_longest > 0 ? normal.norm() / squared_longest : 0;
}

}  // namespace

Vec3 EdgeCollapse::Curve::at(double place) const {
  const auto n = static_cast<double>(points.size());
  const double wrapped = place >= n ? place - n : place;
  const auto i = std::min(points.size() - 1, static_cast<std::size_t>(wrapped));
  const double fraction = wrapped - static_cast<double>(i);
  return fraction == 0 ? points[i] : Vec3(points[i] + fraction * (points[(i + 1) % points.size()] - points[i]));
}

EdgeCollapse::EdgeCollapse(const TriangleMesh& mesh, Aim aim) : aim_(aim), heap_(0), triangles_(mesh.triangles.size()) {
  const Box box = bounding_box(mesh);
  TUNICA_ASSERT(box.diagonal() > 0);
  centre_ = 0.5 * (box.lower + box.upper);
  scale_ = box.diagonal();
  position_.reserve(mesh.vertices.size());
  for (const Vec3& v : mesh.vertices) {
    position_.push_back((v - centre_) / scale_);
  }
  connect(mesh);
  find_boundary(mesh);
  sum_quadrics();
  fill_heap();
}

/// Calls visit(h) for every half-edge that leaves the vertex, counter-clockwise.
template <typename Visit>
void EdgeCollapse::around(Index vertex, const Visit& visit) const {
  const HalfEdge first = outgoing_[vertex];
  HalfEdge h = first;
  do {
    visit(h);
    h = twin_[previous(h)];
  } while (h != none && h != first);
}

template <typename Visit>
void EdgeCollapse::neighbours_of(Index vertex, const Visit& visit) const {
  HalfEdge last = none;
  around(vertex, [&](HalfEdge h) {
    visit(to(h));
    last = h;
  });
  if (twin_[previous(last)] == none) {
    visit(from(previous(last)));
  }
}

void EdgeCollapse::connect(const TriangleMesh& mesh) {
  const std::size_t half_edges = 3 * mesh.triangles.size();
  corners_.resize(half_edges);
  twin_.assign(half_edges, none);
  edge_.assign(half_edges, none);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::copy(mesh.triangles[t].begin(), mesh.triangles[t].end(),
              corners_.begin() + static_cast<std::ptrdiff_t>(3 * t));
  }
  const Incidence triangles = incidence(mesh);
  for (HalfEdge h = 0; h < half_edges; ++h) {
    if (edge_[h] != none) {
      continue;
    }
    const auto edge = static_cast<Index>(half_of_.size());
    half_of_.push_back(h);
    edge_[h] = edge;
    for (const Index t : triangles.of(to(h))) {
      for (HalfEdge other = 3 * t; other < 3 * t + 3; ++other) {
        if (from(other) == to(h) && to(other) == from(h)) {
          twin_[h] = other;
          twin_[other] = h;
          edge_[other] = edge;
        }
      }
    }
  }
  placement_.assign(half_of_.size(), Placement::best);
  mark_.assign(mesh.vertices.size(), 0);
  outgoing_.assign(mesh.vertices.size(), none);
  for (HalfEdge h = 0; h < half_edges; ++h) {
    if (outgoing_[from(h)] == none || twin_[h] == none) {
      outgoing_[from(h)] = h;
    }
  }
}

void EdgeCollapse::find_boundary(const TriangleMesh& mesh) {
  curve_of_.assign(mesh.vertices.size(), none);
  curve_place_.assign(mesh.vertices.size(), 0);
  if (std::find(twin_.begin(), twin_.end(), none) == twin_.end()) {
    return;
  }
  for (const auto& loop : boundary_loops(mesh)) {
    Curve curve;
    for (const Index v : loop) {
      curve_of_[v] = static_cast<Index>(curves_.size());
      curve_place_[v] = static_cast<double>(curve.points.size());
      curve.points.push_back(position_[v]);
    }
    curves_.push_back(std::move(curve));
  }
}

void EdgeCollapse::sum_quadrics() {
  quadric_.assign(position_.size(), {});
  area_.assign(position_.size(), 0);
  facing_.assign(position_.size(), Vec3::Zero());
  wall_.assign(curves_.empty() ? 0 : position_.size(), {});
  for (HalfEdge h = 0; h < corners_.size(); h += 3) {
    const Vec3& a = position_[corners_[h]];
    const Vec3 normal = (position_[corners_[h + 1]] - a).cross(position_[corners_[h + 2]] - a);
    const double doubled_area = normal.norm();
    if (!(doubled_area > 0)) {
      continue;
    }
    const Vec3 unit = normal / doubled_area;
    Quadric plane = Quadric::plane(unit, a, doubled_area);
    if (aim_ == Aim::good_shape) {
      const Vec3 centre = (a + position_[corners_[h + 1]] + position_[corners_[h + 2]]) / 3;
      plane += Quadric::point(centre, normal_variance * doubled_area);
    }
    for (HalfEdge k = h; k < h + 3; ++k) {
      quadric_[corners_[k]] += plane;
      area_[corners_[k]] += doubled_area;
      facing_[corners_[k]] += normal;
      if (twin_[k] == none) {
        const Vec3 edge = position_[to(k)] - position_[from(k)];
        const Vec3 outward = edge.cross(unit);
        if (outward.norm() > 0) {
          const Quadric wall = Quadric::plane(outward.normalized(), position_[from(k)],
                                              boundary_weight * length_to_quadric(edge.squaredNorm()));
          wall_[from(k)] += wall;
          wall_[to(k)] += wall;
        }
      }
    }
  }
}

void EdgeCollapse::fill_heap() {
  heap_ = EdgeHeap(half_of_.size());
  for (Index edge = 0; edge < half_of_.size(); ++edge) {
    placement_[edge] = Placement::best;
    if (half_of_[edge] == none) {
      continue;
    }
    if (const auto found = target(half_of_[edge], Placement::best)) {
      heap_.append(edge, found->cost);
    }
  }
  heap_.order();
}

std::size_t EdgeCollapse::run(std::size_t triangles, const Progress& progress) {
  const std::size_t start = triangles_;
  const double work = static_cast<double>(start - std::min(start, triangles));
  for (std::size_t limits = 0; triangles_ > triangles && limits < shape_limits.size();) {
    limits_ = aim_ == Aim::good_shape ? good_shape_limits[limits] : shape_limits[limits];
    bool progressed = false;
    for (std::size_t step = 0; triangles_ > triangles && !heap_.empty(); ++step) {
      if (step % 4096 == 0) {
        advance(progress, static_cast<double>(start - triangles_) / work);
      }
      progressed = collapse_cheapest() || progressed;
    }
    if (triangles_ > triangles) {
      // What was refused may be possible now that the surroundings have changed, or with the next limits.
      limits += progressed ? 0 : 1;
      fill_heap();
    }
  }
  return triangles_;
}

bool EdgeCollapse::collapse_cheapest() {
  const Index edge = heap_.top();
  const HalfEdge h = half_of_[edge];
  const auto chosen = target(h, placement_[edge]);
  TUNICA_ASSERT(chosen.has_value());
  if (!keeps_topology(h)) {
    heap_.remove(edge);
    return false;
  }
  if (!keeps_shape(h, chosen->position)) {
    if (placement_[edge] == Placement::best) {
      evaluate(edge, Placement::end);
    } else {
      heap_.remove(edge);
    }
    return false;
  }
  collapse(h, *chosen);
  return true;
}

Quadric EdgeCollapse::cost_of(Index u, Index v) const {
  Quadric q = (quadric_[u] + quadric_[v]).times(per_area(area_[u] + area_[v]));
  if (!wall_.empty()) {
    q += wall_[u];
    q += wall_[v];
  }
  return q;
}

std::optional<EdgeCollapse::Target> EdgeCollapse::target(HalfEdge h, Placement placement) const {
  const Index u = from(h);
  const Index v = to(h);
  const Quadric q = cost_of(u, v);
  const Vec3& p = position_[u];
  const Vec3& r = position_[v];
  const double penalty = length_weight * q.trace() * (p - r).squaredNorm();
  const bool u_on_boundary = curve_of_[u] != none;
  const bool v_on_boundary = curve_of_[v] != none;
  const auto at = [&](const Vec3& x) { return std::max(0.0, q(x)) + penalty; };
  if (u_on_boundary && v_on_boundary && twin_[h] != none) {
    return std::nullopt;  // would pinch the surface
  }
  if (u_on_boundary != v_on_boundary) {
    return Target{u_on_boundary ? p : r, at(u_on_boundary ? p : r), curve_place_[u_on_boundary ? u : v]};
  }
  if (placement == Placement::end) {
    const double at_p = at(p);
    const double at_r = at(r);
    return at_p <= at_r ? Target{p, at_p, curve_place_[u]} : Target{r, at_r, curve_place_[v]};
  }
  if (u_on_boundary) {
    Target found = best_on_curve(h, q);
    found.cost = std::max(0.0, found.cost) + penalty;
    return found;
  }
  const Vec3 middle = 0.5 * (p + r);
  const auto minimum = q.minimum(middle, pull);
  const Vec3 best = minimum && (*minimum - middle).squaredNorm() <= 4 * (p - r).squaredNorm() ? *minimum : middle;
  return Target{best, at(best), 0};
}

/// The place on the boundary curve between the ends of a boundary edge where the quadric is least.
EdgeCollapse::Target EdgeCollapse::best_on_curve(HalfEdge h, const Quadric& q) const {
  const Curve& curve = curves_[curve_of_[from(h)]];
  const auto n = static_cast<double>(curve.points.size());
  const double begin = curve_place_[from(h)];
  double end = curve_place_[to(h)];
  if (end <= begin) {
    end += n;
  }
  const auto wrapped = [&](double place) { return place >= n ? place - n : place; };
  Target best{curve.at(begin), q(curve.at(begin)), begin};
  const auto try_place = [&](double place) {
    const Vec3 x = curve.at(wrapped(place));
    const double cost = q(x);
    if (cost < best.cost) {
      best = {x, cost, wrapped(place)};
    }
  };
  // Some of the curve's own vertices, then the segments beside the best of them.
  const double stride = std::max(1.0, std::floor((end - begin) / 24));
  for (double place = std::floor(begin) + 1; place < end; place += stride) {
    try_place(place);
  }
  try_place(end);
  const double around_best = best.curve < begin ? best.curve + n : best.curve;
  for (const double left : {std::max(begin, std::ceil(around_best) - 1), std::max(begin, std::floor(around_best))}) {
    const double right = std::min(end, std::floor(left) + 1);
    const Vec3 x = curve.at(wrapped(left));
    const Vec3 step = curve.at(wrapped(right)) - x;
    const double curvature = step.dot(q.times(step));
    if (right > left && curvature > 0) {
      const double along = std::clamp(-step.dot(q.half_gradient(x)) / curvature, 0.0, 1.0);
      try_place(left + along * (right - left));
    }
  }
  return best;
}

void EdgeCollapse::evaluate(Index edge, Placement placement) {
  placement_[edge] = placement;
  if (const auto found = target(half_of_[edge], placement)) {
    heap_.set(edge, found->cost);
  } else {
    heap_.remove(edge);
  }
}

/// The link condition of Dey, Edelsbrunner, Guha, Nekhayev, Topology preserving edge contraction (1999), for a
/// 2-manifold with boundary: the ends have no common neighbour but the corners opposite the edge, and those keep enough
/// neighbours for two triangles never to lie on the same corners.
bool EdgeCollapse::keeps_topology(HalfEdge h) {
  const Index u = from(h);
  const Index v = to(h);
  const std::size_t expected = twin_[h] == none ? 1 : 2;
  ++stamp_;
  neighbours_of(u, [&](Index w) { mark_[w] = stamp_; });
  std::size_t common = 0;
  neighbours_of(v, [&](Index w) { common += mark_[w] == stamp_ ? 1 : 0; });
  if (common != expected) {
    return false;
  }
  const auto keeps_enough = [&](Index apex) {
    std::size_t valence = 0;
    neighbours_of(apex, [&](Index) { ++valence; });
    return valence > (curve_of_[apex] == none ? 3U : 2U);
  };
  return keeps_enough(from(previous(h))) && (twin_[h] == none || keeps_enough(from(previous(twin_[h]))));
}

bool EdgeCollapse::keeps_shape(HalfEdge h, const Vec3& position) const {
  return fan_keeps_shape(from(h), to(h), position) && fan_keeps_shape(to(h), from(h), position);
}

/// Whether the triangles around `vertex` that do not hold `other` stay well when `vertex` moves to `position`.
bool EdgeCollapse::fan_keeps_shape(Index vertex, Index other, const Vec3& position) const {
  bool good = true;
  const Vec3& old_position = position_[vertex];
  const Vec3 facing = facing_[vertex] + facing_[other];
  around(vertex, [&](HalfEdge h) {
    const Index i = to(h);
    const Index j = to(next(h));
    if (!good || i == other || j == other) {
      return;
    }
    const Vec3& a = position_[i];
    const Vec3& b = position_[j];
    const Vec3 before = (a - old_position).cross(b - old_position);
    const Vec3 after = (a - position).cross(b - position);
    const double lengths = before.norm() * after.norm();
    const double old_height = height_over_longest(before, old_position, a, b);
    const double new_height = height_over_longest(after, position, a, b);
    const bool was_flat = !(old_height > 1e-9);
    // Many small turns may add up: the given surface that the three corners stand for must be faced as well.
    const Vec3 given = facing + facing_[i] + facing_[j];
    good = (was_flat || before.dot(after) > least_cosine * lengths) &&
           (after.dot(given) > 0 || before.dot(given) <= 0) &&
           new_height > std::min(limits_.least_height, 0.7 * old_height) && after.squaredNorm() > 0;
    const HalfEdge across = twin_[next(h)];
    if (good && across != none) {
      // The triangle on the outer side stays: the new one must not lie back on it.
      const Vec3& c = position_[from(previous(across))];
      const Vec3 outer = (a - b).cross(c - b);
      const double limit = limits_.fold_cosine * outer.norm();
      good = after.dot(outer) > limit * after.norm() || before.dot(outer) <= limit * before.norm();
    }
  });
  return good;
}

/// Makes the twins of two edges of a dying triangle each other's twins. The spoke's edge lives on, the rim's is gone.
void EdgeCollapse::unlink(HalfEdge spoke, HalfEdge rim) {
  const HalfEdge one = twin_[spoke];
  const HalfEdge other = twin_[rim];
  const Index edge = edge_[spoke];
  heap_.remove(edge_[rim]);
  half_of_[edge_[rim]] = none;
  if (one != none) {
    twin_[one] = other;
  }
  if (other != none) {
    twin_[other] = one;
    edge_[other] = edge;
  }
  half_of_[edge] = one != none ? one : other;
}

/// Stores a half-edge that leaves the vertex: of a boundary vertex the one that lies on the boundary.
void EdgeCollapse::set_outgoing(Index vertex, HalfEdge any) {
  HalfEdge h = any;
  while (twin_[h] != none) {
    h = next(twin_[h]);
    if (h == any) {
      break;
    }
  }
  outgoing_[vertex] = h;
}

void EdgeCollapse::collapse(HalfEdge h, const Target& chosen) {
  const Index u = from(h);
  const Index v = to(h);
  const HalfEdge o = twin_[h];
  const bool v_on_boundary = curve_of_[v] != none;
  around(v, [&](HalfEdge spoke) { corners_[spoke] = u; });
  // Triangle u v a dies: spoke a-u stays, rim v-a goes.
  const Index a = from(previous(h));
  heap_.remove(edge_[h]);
  half_of_[edge_[h]] = none;
  unlink(previous(h), next(h));
  triangles_ -= 1;
  Index b = none;
  if (o != none) {
    b = from(previous(o));
    unlink(next(o), previous(o));
    triangles_ -= 1;
  }
  position_[u] = chosen.position;
  quadric_[u] += quadric_[v];
  area_[u] += area_[v];
  facing_[u] += facing_[v];
  if (!wall_.empty()) {
    wall_[u] += wall_[v];
  }
  if (v_on_boundary) {
    curve_of_[u] = curve_of_[v];
  }
  curve_place_[u] = chosen.curve;
  // The spokes' edges live on, so their half-edges lie in living triangles.
  const auto leaving = [&](Index vertex, Index edge) {
    const HalfEdge half = half_of_[edge];
    return from(half) == vertex ? half : next(half);
  };
  set_outgoing(u, leaving(u, edge_[previous(h)]));
  set_outgoing(a, leaving(a, edge_[previous(h)]));
  if (b != none) {
    set_outgoing(b, leaving(b, edge_[next(o)]));
  }
  history_.push_back({u, v, static_cast<Index>(triangles_), centre_ + scale_ * chosen.position});
  around(u, [&](HalfEdge spoke) {
    evaluate(edge_[spoke], Placement::best);
    if (twin_[previous(spoke)] == none) {
      evaluate(edge_[previous(spoke)], Placement::best);
    }
  });
}

}  // namespace tunica
