#include "tunica/surface/decimation/detail/edge_collapse.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/distance/facet_distances.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunica {
namespace {

/// Twice the area, in a mesh of diagonal 1, from which on a triangle needs no closer look at whether it has any.
constexpr double most_without_area = 1e-8;
/// A triangle may turn by at most acos(0.2) = 78 degrees in one collapse.
constexpr double least_cosine = 0.2;
/// What a collapse may make of the triangles: cosine of the sharpest fold between neighbours, height over longest edge
/// of the thinnest triangle, and the height below which it has to be worth it (0.08 leaves no angle below 4.6 degrees),
/// unless they were worse before. The next limits count when the ones before leave nothing to collapse.
constexpr std::array<ShapeLimits, 3> shape_limits{{{0, 0.002, 0.08}, {-0.5, 0.002, 0.06}, {-0.9, 0.001, 0.01}}};
constexpr std::array<ShapeLimits, 3> good_shape_limits{{{0, 0.25, 0.25}, {-0.5, 0.15, 0.15}, {-0.9, 0.01, 0.01}}};
/// Uncertainty of the planes' normals, squared, where shape counts: vertices are drawn to the middle of the area that
/// they stand for (Trettner, Kobbelt, Fast and robust QEF minimization using probabilistic quadrics, 2020).
constexpr double normal_variance = 0.02;
/// Weight of the planes that stand on boundary edges, by Aim. With more for the least error (30) a wavy rim takes most
/// of the vertices, and open sheets come out up to twice as far off; with less (0.1) the rim itself does. With less
/// where shape counts corners would go rather than good triangles. Where all planes count alike 5 to 100 do.
constexpr std::array<double, 3> boundary_weight{0.3, 6, 10};
/// There the planes of the triangles beside, which are fewer around a boundary vertex than around others (5 to 200 do).
constexpr double even_rim_weight = 5;
/// Down to this many times the triangles wanted, edges collapse in sweeps, unless shape counts (rough surfaces then
/// come out worse by a quarter).
constexpr std::size_t sweep_factor = 8;
/// An edge waits while more triangles stand around its ends: to look at all of them for each of as many edges would
/// take the square of their number. Ordinary vertices have six, poles of globes dozens; where there are more, edges
/// around them lessen them first, so that this sets the time alone.
constexpr Index most_around = 256;
/// How strongly a new vertex is held near the middle of its edge where the quadric is flat. Where few planes have met
/// it must be weak: on a fine mesh even what looks flat is curved, and the held vertices are the first to be off.
constexpr double pull = 1e-5;
constexpr double weak_pull = 1e-10;
/// At a tip the sum of the normals is shorter than this share of the areas' sum: at a right-angled edge it is 0.71.
constexpr double tip_share = 0.8;
/// What the squared distance of a vertex that goes counts for where all planes count alike: as much as from three
/// planes, of the ten or more that it comes from where nothing is lost.
constexpr double loss_weight = 3;
/// Squared distances below it, in squared diagonals, are rounding.
constexpr double invisible = 1e-17;
/// Weight of an edge's squared length times its quadric's weight: on flat ground short edges go first.
constexpr double length_weight = 1e-10;

// A quadric sums squared distance times area. Divided by all of its area it would be a mean squared distance, which is
// closer to the largest distance but knows nothing of size; this power in between gave the least largest errors.
double per_area(double area) {  // area^-0.875
  return area > 0 ? 1 / std::sqrt(area * std::sqrt(area * std::sqrt(area))) : 1;
}
double length_to_quadric(double squared_length) {  // (length^2)^0.125
  return std::sqrt(std::sqrt(std::sqrt(squared_length)));
}

// Of the triangle p a b with that doubled area and that squared length of a b.
double height_over_longest(double doubled_area, const Vec3& p, const Vec3& a, const Vec3& b, double squared_ab) {
  const double squared_longest = std::max({squared_ab, (a - p).squaredNorm(), (b - p).squaredNorm()});
  return squared_longest > 0 ? doubled_area / squared_longest : 0;
}

}  // namespace

Vec3 EdgeCollapse::Curve::at(double place) const {
  const auto n = real(points.size());
  const double wrapped = place >= n ? place - n : place;
  const auto i = std::min(points.size() - 1, truncated<std::size_t>(wrapped));
  const double fraction = wrapped - real(i);
  return fraction == 0 ? points[i] : Vec3(points[i] + fraction * (points[(i + 1) % points.size()] - points[i]));
}

EdgeCollapse::EdgeCollapse(const TriangleMesh& mesh, Aim aim)
    : aim_(aim), pull_(aim == Aim::few_collapses ? weak_pull : pull), heap_(0), triangles_(mesh.triangles.size()) {
  const Box box = bounding_box(mesh);
  centre_ = 0.5 * (box.lower + box.upper);
  scale_ = box.diagonal();
  if (!(scale_ > 0) || !std::isfinite(scale_) || !number_vertices(mesh) || !connect(mesh)) {
    return;
  }
  fit_ = true;
  find_boundary();
  sum_quadrics();
}

/// Vertices in the order in which the triangles name them: what is near in space is then near in memory. @return
/// whether they are finite and no triangle has a corner twice
bool EdgeCollapse::number_vertices(const TriangleMesh& mesh) {
  number_.assign(mesh.vertices.size(), none);
  vertex_.reserve(mesh.vertices.size());
  given_.reserve(mesh.vertices.size());
  for (const auto& triangle : mesh.triangles) {
    for (const Index v : triangle) {
      if (number_[v] == none) {
        number_[v] = narrow<Index>(vertex_.size());
        given_.push_back(v);
        vertex_.push_back({});
        vertex_.back().position = (mesh.vertices[v] - centre_) / scale_;
        if (!vertex_.back().position.allFinite()) {
          return false;
        }
      }
    }
    if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) {
      return false;
    }
  }
  return true;
}

/// @return whether the triangles are an oriented manifold
bool EdgeCollapse::connect(const TriangleMesh& mesh) {
  half_.resize(3 * mesh.triangles.size());
  HalfEdge corner = 0;
  for (const auto& triangle : mesh.triangles) {
    for (const Index v : triangle) {
      half_[corner++].from = number_[v];
    }
  }
  // The edges known so far at their end with fewer triangles, each as the far end and the edge before it in the same
  // list.
  struct Known {
    Index far, before;
  };
  for (const Half& half : half_) {
    ++vertex_[half.from].triangles;
  }
  std::vector<Known> known;
  known.reserve(half_.size() / 2 + 1);
  half_of_.reserve(half_.size() / 2 + 1);
  std::vector<Index> last(vertex_.size(), none);
  for (HalfEdge h = 0; h < half_.size(); ++h) {
    const auto [near, far] = std::minmax({from(h), to(h)}, [&](Index u, Index v) {
      return std::pair(vertex_[u].triangles, u) < std::pair(vertex_[v].triangles, v);
    });
    Index edge = last[near];
    while (edge != none && known[edge].far != far) {
      edge = known[edge].before;
    }
    if (edge == none) {
      half_[h].edge = narrow<Index>(known.size());
      known.push_back({far, last[near]});
      last[near] = half_[h].edge;
      half_of_.push_back(h);
      continue;
    }
    const HalfEdge other = half_of_[edge];
    if (half_[other].twin != none || from(other) == from(h) || from(previous(other)) == from(previous(h))) {
      return false;  // a third triangle, one that faces the other way, or two on the same corners
    }
    half_[h] = {from(h), other, edge};
    half_[other].twin = h;
  }
  placement_.assign(half_of_.size(), Placement::best);
  for (HalfEdge h = 0; h < half_.size(); ++h) {
    if (vertex_[from(h)].outgoing == none || half_[h].twin == none) {
      vertex_[from(h)].outgoing = h;
    }
  }
  return has_one_fan_per_vertex();
}

bool EdgeCollapse::has_one_fan_per_vertex() const {
  std::size_t reached = 0;
  for (Index v = 0; v < vertex_.size(); ++v) {
    around(v, [&](HalfEdge /*spoke*/) { ++reached; });
  }
  return reached == half_.size();
}

/// The boundary loops, each from the vertex that was given first.
void EdgeCollapse::find_boundary() {
  curve_place_.assign(vertex_.size(), 0);
  if (std::all_of(half_.begin(), half_.end(), [](const Half& half) { return half.twin != none; })) {
    return;
  }
  for (Index given = 0; given < number_.size(); ++given) {
    const Index first = number_[given];
    if (first == none || half_[vertex_[first].outgoing].twin != none || vertex_[first].curve != none) {
      continue;
    }
    Curve curve;
    for (Index v = first; vertex_[v].curve == none; v = to(vertex_[v].outgoing)) {
      vertex_[v].curve = narrow<Index>(curves_.size());
      curve_place_[v] = real(curve.points.size());
      curve.points.push_back(vertex_[v].position);
    }
    curves_.push_back(std::move(curve));
  }
}

double EdgeCollapse::wall_weight(double squared_length) const {
  return boundary_weight.at(static_cast<std::size_t>(aim_)) *
         (aim_ == Aim::few_collapses ? 1 : length_to_quadric(squared_length));
}

/// The boundary edges of a triangle without area have no plane that would stop their ends from sliding along them: a
/// spike would be lost at no cost.
void EdgeCollapse::pin_boundary(HalfEdge triangle) {
  for (HalfEdge k = triangle; k < triangle + 3; ++k) {
    if (half_[k].twin == none) {
      const double squared_length = (vertex_[to(k)].position - vertex_[from(k)].position).squaredNorm();
      const double weight = wall_weight(squared_length);
      for (const Index end : {from(k), to(k)}) {
        wall_[end] += Quadric::point(vertex_[end].position, weight);
      }
    }
  }
}

void EdgeCollapse::sum_quadrics() {
  wall_.assign(curves_.empty() ? 0 : vertex_.size(), {});
  for (HalfEdge h = 0; h < half_.size(); h += 3) {
    const Vec3& a = vertex_[half_[h].from].position;
    const Vec3 normal = (vertex_[half_[h + 1].from].position - a).cross(vertex_[half_[h + 2].from].position - a);
    const double doubled_area = normal.norm();
    if (doubled_area < most_without_area &&
        is_degenerate(a, vertex_[half_[h + 1].from].position, vertex_[half_[h + 2].from].position)) {
      pin_boundary(h);
      continue;
    }
    const Vec3 unit = normal / doubled_area;
    const bool by_area = aim_ != Aim::few_collapses;
    Quadric plane = Quadric::plane(unit, a, by_area ? doubled_area : 1);
    if (aim_ == Aim::good_shape) {
      const Vec3 centre = (a + vertex_[half_[h + 1].from].position + vertex_[half_[h + 2].from].position) / 3;
      plane += Quadric::point(centre, normal_variance * doubled_area);
    }
    for (HalfEdge k = h; k < h + 3; ++k) {
      vertex_[half_[k].from].quadric += plane;
      vertex_[half_[k].from].area += by_area ? doubled_area : 0;
      vertex_[half_[k].from].facing += normal;
      vertex_[half_[k].from].given_area += doubled_area;
      if (half_[k].twin == none) {
        const Vec3 edge = vertex_[to(k)].position - vertex_[from(k)].position;
        const Vec3 outward = edge.cross(unit);
        if (outward.norm() > 0) {
          const double weight = wall_weight(edge.squaredNorm());
          Quadric wall = Quadric::plane(outward.normalized(), vertex_[from(k)].position, weight);
          if (!by_area) {
            wall += Quadric::plane(unit, vertex_[from(k)].position, even_rim_weight);
          }
          wall_[from(k)] += wall;
          wall_[to(k)] += wall;
        }
      }
    }
  }
}

void EdgeCollapse::fill_heap() {
  heap_ = EdgeHeap(half_of_.size());
  std::vector<Index> edges;
  edges.reserve(half_of_.size());
  for (Index edge = 0; edge < half_of_.size(); ++edge) {
    placement_[edge] = Placement::best;
    if (half_of_[edge] != none) {
      edges.push_back(edge);
    }
  }
  std::vector<double> costs;
  costs_of(edges, costs);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (costs[i] < forbidden_cost) {
      heap_.append(edges[i], costs[i]);
    }
  }
  heap_.order();
}

std::size_t EdgeCollapse::run(std::size_t triangles, const Progress& progress, bool in_order) {
  const std::size_t start = triangles_;
  const double work = real(start - std::min(start, triangles));
  const Progress part = [&](double) { tunica::advance(progress, real(start - triangles_) / work); };
  const auto& all_limits = aim_ == Aim::good_shape ? good_shape_limits : shape_limits;
  if (!in_order && aim_ == Aim::least_error && triangles > 0 && triangles_ > sweep_factor * triangles) {
    limits_ = all_limits[0];
    sweep(sweep_factor * triangles, part);
  }
  while (triangles_ > triangles && limits_used_ < all_limits.size()) {
    limits_ = all_limits[limits_used_];
    if (heap_.empty()) {
      // What was refused may be possible now that the surroundings have changed, or with the next limits.
      fill_heap();
    }
    bool progressed = false;
    for (std::size_t step = 0; triangles_ > triangles && !heap_.empty(); ++step) {
      if (step % 4096 == 0) {
        tunica::advance(part, 0.0);
      }
      progressed = collapse_cheapest() || progressed;
    }
    if (triangles_ > triangles && !progressed) {
      ++limits_used_;
    }
  }
  return triangles_;
}

/// Whether the given triangles that an edge's ends stand for face so many ways that their normals cancel.
bool EdgeCollapse::is_at_tip(HalfEdge h) const {
  const Vertex& u = vertex_[from(h)];
  const Vertex& v = vertex_[to(h)];
  const double least = tip_share * (u.given_area + v.given_area);
  return (u.facing + v.facing).squaredNorm() < least * least;
}

/// The larger squared distance of a collapse's two ends to the triangles that it makes, which planes do not know at
/// a thin tip: it lies in the planes of what stays.
double EdgeCollapse::squared_loss(HalfEdge h, const Vec3& position) const {
  const Index u = from(h);
  const Index v = to(h);
  const LaneVec3 ends = lane_points([&](std::size_t k) -> const Vec3& { return vertex_[k == 0 ? u : v].position; });
  Lanes least = forbidden_cost;
  for (const Index end : {u, v}) {
    around(end, [&](HalfEdge spoke) {
      const Index i = to(spoke);
      const Index j = to(next(spoke));
      if (i != u && i != v && j != u && j != v) {
        const FacetDistances facet({position, vertex_[i].position, vertex_[j].position});
        least = simd::min(least, facet.squared_distance(ends));
      }
    });
  }
  return std::max(least[0], least[1]);
}

/// How far its shapes raise it is found out only when its turn comes.
bool EdgeCollapse::collapse_cheapest() {
  const Index edge = heap_.top();
  const HalfEdge h = half_of_[edge];
  const double known = heap_.top_key() * (1 + 1e-6);  // rounding differs with what is computed together
  const auto chosen = target(h, placement_[edge]);
  TUNICA_ASSERT(chosen.has_value());
  if (!keeps_topology(h)) {
    heap_.remove(edge);
    return false;
  }
  const double penalty = shape_penalty(h, chosen->position);
  if (penalty == forbidden_cost) {
    if (placement_[edge] == Placement::best) {
      evaluate(edge, Placement::end);
    } else {
      heap_.remove(edge);
    }
    return false;
  }
  double cost = chosen->cost(penalty);
  if (aim_ == Aim::few_collapses && cost <= known && is_at_tip(h)) {
    cost = std::max(cost, loss_weight * squared_loss(h, chosen->position));
  }
  if (cost > known) {
    heap_.set(edge, cost);
    return false;
  }
  const Index kept = from(h);
  collapse(h, *chosen);
  changed_.clear();
  around(kept, [&](HalfEdge spoke) {
    changed_.push_back(half_[spoke].edge);
    if (half_[previous(spoke)].twin == none) {
      changed_.push_back(half_[previous(spoke)].edge);
    }
  });
  costs_of(changed_, changed_cost_);
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    placement_[changed_[i]] = Placement::best;
    if (changed_cost_[i] < forbidden_cost) {
      heap_.set(changed_[i], changed_cost_[i]);
    } else {
      heap_.remove(changed_[i]);
    }
  }
  return true;
}

Quadric EdgeCollapse::cost_of(Index u, Index v) const {
  Quadric q = (vertex_[u].quadric + vertex_[v].quadric).times(per_area(vertex_[u].area + vertex_[v].area));
  if (!wall_.empty()) {
    q += wall_[u];
    q += wall_[v];
  }
  return q;
}

EdgeCollapse::Target EdgeCollapse::inner_target(const Vertex& u, const Vertex& v) const {
  const Quadric sum = u.quadric + v.quadric;
  const double weight = per_area(u.area + v.area);
  const Vec3 middle = 0.5 * (u.position + v.position);
  const double squared_length = (u.position - v.position).squaredNorm();
  const auto minimum = sum.minimum(middle, pull_);
  const Vec3 best = minimum && (*minimum - middle).squaredNorm() <= 4 * squared_length ? *minimum : middle;
  const double trace = sum.trace();
  return {best, weight * std::max(0.0, sum(best) - invisible * trace), 0,
          length_weight * weight * trace * squared_length};
}

/// What inner_target() would cost, for several edges at once.
Lanes EdgeCollapse::inner_costs(const std::array<HalfEdge, lane_count>& edges) const {
  const auto sum = [&](double Quadric::*member) {
    return lanes_of(
        [&](std::size_t k) { return vertex_[from(edges[k])].quadric.*member + vertex_[to(edges[k])].quadric.*member; });
  };
  const Lanes xx = sum(&Quadric::xx), xy = sum(&Quadric::xy), xz = sum(&Quadric::xz), yy = sum(&Quadric::yy),
              yz = sum(&Quadric::yz), zz = sum(&Quadric::zz), bx = sum(&Quadric::bx), by = sum(&Quadric::by),
              bz = sum(&Quadric::bz), c = sum(&Quadric::c);
  const Lanes area = lanes_of([&](std::size_t k) { return vertex_[from(edges[k])].area + vertex_[to(edges[k])].area; });
  const LaneVec3 p = lane_points([&](std::size_t k) -> const Vec3& { return vertex_[from(edges[k])].position; });
  const LaneVec3 r = lane_points([&](std::size_t k) -> const Vec3& { return vertex_[to(edges[k])].position; });
  const Lanes mx = 0.5 * (p[0] + r[0]), my = 0.5 * (p[1] + r[1]), mz = 0.5 * (p[2] + r[2]);
  const Lanes ex = p[0] - r[0], ey = p[1] - r[1], ez = p[2] - r[2];
  const Lanes squared_length = ex * ex + ey * ey + ez * ez;
  const Lanes trace = xx + yy + zz;
  const Lanes a = xx + pull_ * trace, d = yy + pull_ * trace, f = zz + pull_ * trace;
  const Lanes c00 = d * f - yz * yz, c01 = xz * yz - xy * f, c02 = xy * yz - xz * d;
  const Lanes c11 = a * f - xz * xz, c12 = xy * xz - a * yz, c22 = a * d - xy * xy;
  const Lanes determinant = a * c00 + xy * c01 + xz * c02;
  const Lanes gx = xx * mx + xy * my + xz * mz + bx, gy = xy * mx + yy * my + yz * mz + by,
              gz = xz * mx + yz * my + zz * mz + bz;
  const LaneMask solvable = determinant > Quadric::least_determinant * trace * trace * trace;
  Lanes inverse = 0.0;
  simd::where(solvable, inverse) = 1.0 / determinant;
  Lanes sx = -(c00 * gx + c01 * gy + c02 * gz) * inverse, sy = -(c01 * gx + c11 * gy + c12 * gz) * inverse,
        sz = -(c02 * gx + c12 * gy + c22 * gz) * inverse;
  const LaneMask too_far = sx * sx + sy * sy + sz * sz > 4 * squared_length;
  simd::where(too_far, sx) = 0.0;
  simd::where(too_far, sy) = 0.0;
  simd::where(too_far, sz) = 0.0;
  const Lanes x = mx + sx, y = my + sy, z = mz + sz;
  const Lanes at_best = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) +
                        z * (xz * x + yz * y + zz * z) + 2 * (bx * x + by * y + bz * z) + c;
  const Lanes power = area * simd::sqrt(area * simd::sqrt(area));  // per_area()
  Lanes weight = 1.0;
  simd::where(area > 0.0, weight) = 1.0 / simd::sqrt(power);
  const Lanes error = simd::max(at_best - invisible * trace, Lanes(0.0));
  return weight * (error + length_weight * trace * squared_length);
}

std::optional<EdgeCollapse::Target> EdgeCollapse::target(HalfEdge h, Placement placement) const {
  const Index u = from(h);
  const Index v = to(h);
  const bool u_on_boundary = vertex_[u].curve != none;
  const bool v_on_boundary = vertex_[v].curve != none;
  if (u_on_boundary && v_on_boundary && half_[h].twin != none) {
    return std::nullopt;  // would pinch the surface
  }
  const Vec3& p = vertex_[u].position;
  const Vec3& r = vertex_[v].position;
  if (!u_on_boundary && !v_on_boundary && placement == Placement::best) {
    return inner_target(vertex_[u], vertex_[v]);
  }
  const Quadric q = cost_of(u, v);
  const auto at = [&](const Vec3& x) { return std::max(0.0, q(x)); };
  Target found;
  if (u_on_boundary != v_on_boundary) {
    const Vec3& fixed = u_on_boundary ? p : r;
    found = {fixed, at(fixed), curve_place_[u_on_boundary ? u : v]};
  } else if (placement == Placement::end) {
    const double at_p = at(p);
    const double at_r = at(r);
    found = at_p <= at_r ? Target{p, at_p, curve_place_[u]} : Target{r, at_r, curve_place_[v]};
  } else {
    found = best_on_curve(h, q);
    found.error = std::max(0.0, found.error);
  }
  found.length_cost = length_weight * q.trace() * (p - r).squaredNorm();
  return found;
}

/// The place on the boundary curve between the ends of a boundary edge where the quadric is least.
EdgeCollapse::Target EdgeCollapse::best_on_curve(HalfEdge h, const Quadric& q) const {
  const Curve& curve = curves_[vertex_[from(h)].curve];
  const auto n = real(curve.points.size());
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
    if (cost < best.error) {
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
    heap_.set(edge, found->cost());
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
  if (vertex_[u].triangles + vertex_[v].triangles > most_around) {
    return false;
  }
  const std::size_t expected = half_[h].twin == none ? 1 : 2;
  ++stamp_;
  neighbours_of(u, [&](Index w) { vertex_[w].mark = stamp_; });
  std::size_t common = 0;
  neighbours_of(v, [&](Index w) { common += vertex_[w].mark == stamp_ ? 1 : 0; });
  if (common != expected) {
    return false;
  }
  const auto keeps_enough = [&](Index apex) {
    return vertex_[apex].triangles >= (vertex_[apex].curve == none ? 4 : 2);  // one more neighbour at a boundary
  };
  return keeps_enough(from(previous(h))) && (half_[h].twin == none || keeps_enough(from(previous(half_[h].twin))));
}

/// By what factor the triangles' shapes raise the cost of a collapse; `forbidden_cost` where it would fold or flatten
/// any.
double EdgeCollapse::shape_penalty(HalfEdge h, const Vec3& position) const {
  const double one = fan_penalty(from(h), to(h), position);
  return one == forbidden_cost ? forbidden_cost : std::max(one, fan_penalty(to(h), from(h), position));
}

/// The same for the triangles around `vertex` that do not hold `other`, when `vertex` moves to `position`.
double EdgeCollapse::fan_penalty(Index vertex, Index other, const Vec3& position) const {
  double penalty = 1;
  bool good = true;
  const Vec3& old_position = vertex_[vertex].position;
  const Vec3 facing = vertex_[vertex].facing + vertex_[other].facing;
  around(vertex, [&](HalfEdge h) {
    const Index i = to(h);
    const Index j = to(next(h));
    if (!good || i == other || j == other) {
      return;
    }
    const Vec3& a = vertex_[i].position;
    const Vec3& b = vertex_[j].position;
    const Vec3 before = (a - old_position).cross(b - old_position);
    const Vec3 after = (a - position).cross(b - position);
    const double length_before = before.norm();
    const double length_after = after.norm();
    const double rim = (b - a).squaredNorm();
    const double old_height = height_over_longest(length_before, old_position, a, b, rim);
    const double new_height = height_over_longest(length_after, position, a, b, rim);
    const bool was_flat = !(old_height > 1e-9);
    // Many small turns may add up: the given surface that the three corners stand for must be faced as well.
    const Vec3 given = facing + vertex_[i].facing + vertex_[j].facing;
    good = (was_flat || before.dot(after) > least_cosine * length_before * length_after) &&
           (after.dot(given) > 0 || before.dot(given) <= 0) &&
           new_height > std::min(limits_.least_height, 0.7 * old_height) && length_after > 0;
    const double wanted = std::min(limits_.good_height, 0.7 * old_height);
    if (new_height < wanted) {
      penalty = std::max(penalty, wanted / new_height);
    }
    const HalfEdge across = half_[next(h)].twin;
    if (good && across != none) {
      // The triangle on the outer side stays: the new one must not lie back on it.
      const Vec3& c = vertex_[from(previous(across))].position;
      const Vec3 outer = (a - b).cross(c - b);
      const double limit = limits_.fold_cosine * outer.norm();
      good = after.dot(outer) > limit * length_after || before.dot(outer) <= limit * length_before;
    }
  });
  return good ? penalty : forbidden_cost;
}

/// Makes the twins of two edges of a dying triangle each other's twins. The spoke's edge lives on, the rim's is gone.
void EdgeCollapse::unlink(HalfEdge spoke, HalfEdge rim) {
  const HalfEdge one = half_[spoke].twin;
  const HalfEdge other = half_[rim].twin;
  const Index edge = half_[spoke].edge;
  heap_.remove(half_[rim].edge);
  half_of_[half_[rim].edge] = none;
  if (one != none) {
    half_[one].twin = other;
  }
  if (other != none) {
    half_[other].twin = one;
    half_[other].edge = edge;
  }
  half_of_[edge] = one != none ? one : other;
}

/// Stores a half-edge that leaves the vertex: of a boundary vertex the one that lies on the boundary.
void EdgeCollapse::set_outgoing(Index vertex, HalfEdge any) {
  HalfEdge h = any;
  while (vertex_[vertex].curve != none && half_[h].twin != none) {
    h = next(half_[h].twin);
  }
  vertex_[vertex].outgoing = h;
}

void EdgeCollapse::collapse(HalfEdge h, const Target& chosen) {
  const Index u = from(h);
  const Index v = to(h);
  const HalfEdge o = half_[h].twin;
  const bool v_on_boundary = vertex_[v].curve != none;
  around(v, [&](HalfEdge spoke) { half_[spoke].from = u; });
  // Triangle u v a dies: spoke a-u stays, rim v-a goes.
  const Index a = from(previous(h));
  heap_.remove(half_[h].edge);
  half_of_[half_[h].edge] = none;
  unlink(previous(h), next(h));
  triangles_ -= 1;
  vertex_[a].triangles -= 1;
  vertex_[u].triangles += vertex_[v].triangles - 2;
  Index b = none;
  if (o != none) {
    b = from(previous(o));
    unlink(next(o), previous(o));
    triangles_ -= 1;
    vertex_[b].triangles -= 1;
    vertex_[u].triangles -= 2;
  }
  vertex_[u].position = chosen.position;
  vertex_[u].quadric += vertex_[v].quadric;
  vertex_[u].area += vertex_[v].area;
  vertex_[u].facing += vertex_[v].facing;
  vertex_[u].given_area += vertex_[v].given_area;
  if (!wall_.empty()) {
    wall_[u] += wall_[v];
  }
  if (v_on_boundary) {
    vertex_[u].curve = vertex_[v].curve;
  }
  curve_place_[u] = chosen.curve;
  // The spokes' edges live on, so their half-edges lie in living triangles.
  const auto leaving = [&](Index vertex, Index edge) {
    const HalfEdge half = half_of_[edge];
    return from(half) == vertex ? half : next(half);
  };
  set_outgoing(u, leaving(u, half_[previous(h)].edge));
  // Many triangles may stand around the corners opposite the edge: they are walked only where none is at hand.
  const auto keep_outgoing = [&](Index apex, HalfEdge dead, HalfEdge spoke) {
    if (vertex_[apex].outgoing / 3 == dead / 3 || vertex_[apex].curve == none) {
      set_outgoing(apex, leaving(apex, half_[spoke].edge));
    }
  };
  keep_outgoing(a, h, previous(h));
  if (b != none) {
    keep_outgoing(b, o, next(o));
  }
  history_.push_back({given_[u], given_[v], narrow<Index>(triangles_), centre_ + scale_ * chosen.position});
}

}  // namespace tunica
