#include "tunica/mechanics/model/selection.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/shell/distance/patch_search.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>
#include <Eigen/Dense>

#include <algorithm>
#include <concepts>
#include <map>
#include <set>

namespace tunica {
namespace {

std::vector<std::array<Index, 2>> boundary_edges_of(const ShellMesh& mesh) {
  const auto& triangles = mesh.triangles;
  std::vector<std::array<Index, 2>> boundary;
  for (const auto& [t, k] : boundary_edges(neighbours(triangles, incidence(mesh.vertices.size(), triangles)))) {
    boundary.push_back({triangles[t][k], triangles[t][(k + 1) % 3]});
  }
  std::ranges::sort(boundary, {},
                    [](const auto& edge) { return std::pair(std::min(edge[0], edge[1]), std::max(edge[0], edge[1])); });
  return boundary;
}

template <typename Elements>
std::vector<Index> nodes_in(const Elements& elements) {
  std::set<Index> nodes;
  for (const auto& element : elements) {
    nodes.insert(element.begin(), element.end());
  }
  return {nodes.begin(), nodes.end()};
}

template <typename Elements>
std::vector<char> used_by(const Elements& elements, std::size_t vertices) {
  std::vector<char> used(vertices, 0);
  for (const auto& element : elements) {
    for (const Index v : element) {
      used[v] = 1;
    }
  }
  return used;
}

std::vector<Index> select(const SelectableBody& body, const AllNodes&, const std::string&) {
  return body.nodes_where([](const Vec3&) { return true; });
}

std::vector<Index> select(const SelectableBody& body, const BoundaryNodes&, const std::string& said_at) {
  if (body.boundary_nodes().empty()) {
    throw InputError(said_at + ": the body is closed and has no boundary: use rigid-motions, or select nodes");
  }
  return body.boundary_nodes();
}

std::vector<Index> select(const SelectableBody&, const RigidMotions&, const std::string&) {
  TUNICA_ASSERT(false && "rigid motions are no nodes");
  return {};
}

std::vector<Index> select(const SelectableBody&, const TouchingNodes&, const std::string&) {
  TUNICA_ASSERT(false && "touching needs the other body");
  return {};
}

bool holds(const BoxNodes& box, const Vec3& p, double tolerance) {
  return (p.array() >= box.lower.array() - tolerance).all() && (p.array() <= box.upper.array() + tolerance).all();
}

bool holds(const HalfSpaceNodes& half, const Vec3& p, double tolerance) {
  const double above = p[half.axis] - half.at;
  return (half.below ? above : -above) <= tolerance;
}

bool holds(const SphereNodes& sphere, const Vec3& p, double tolerance) {
  return (p - sphere.centre).norm() <= sphere.radius + tolerance;
}

template <typename Form>
concept Region = std::same_as<Form, BoxNodes> || std::same_as<Form, HalfSpaceNodes> || std::same_as<Form, SphereNodes>;

template <Region Form>
std::vector<Index> select(const SelectableBody& body, const Form& region, const std::string&) {
  return body.nodes_where([&](const Vec3& p) { return holds(region, p, body.tolerance()); });
}

std::vector<Index> select(const SelectableBody& body, const ListedNodes& list, const std::string& said_at) {
  std::set<Index> nodes;
  for (const Index node : list.nodes) {
    if (node >= body.vertices().size()) {
      throw InputError(fmt::format("{}: there is no node {}: the body has {} (0 to {})", said_at, node,
                                   body.vertices().size(), body.vertices().size() - 1));
    }
    if (!nodes.insert(node).second) {
      throw InputError(fmt::format("{}: node {} is listed twice", said_at, node));
    }
  }
  return {nodes.begin(), nodes.end()};
}

std::vector<Index> select(const SelectableBody& body, const NearestNode& nearest, const std::string&) {
  std::optional<Index> best;
  for (std::size_t v = 0; v < body.vertices().size(); ++v) {
    const auto squared_distance = [&](std::size_t node) {
      return (body.vertices()[node] - nearest.point).squaredNorm();
    };
    if (body.used(v) && (!best || squared_distance(v) < squared_distance(*best))) {
      best = narrow<Index>(v);
    }
  }
  return best ? std::vector<Index>{*best} : std::vector<Index>{};
}

[[noreturn]] void fail_empty(const SelectableBody& body, const std::string& said_at, const std::string& why) {
  const Box& box = body.box();
  throw InputError(fmt::format(
      "{}: selects no node: {}the body reaches from ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) mm", said_at,
      why, box.lower.x(), box.lower.y(), box.lower.z(), box.upper.x(), box.upper.y(), box.upper.z()));
}

// @param distance_to  of a point from the surface
template <typename Distance>
std::vector<Index> within(const SelectableBody& body, double distance, const std::string& said_at,
                          const Distance& distance_to) {
  double closest = infinity;
  std::vector<Index> nodes = body.nodes_where([&](const Vec3& p) {
    const double here = distance_to(p);
    closest = std::min(closest, here);
    return here <= distance + body.tolerance();
  });
  if (nodes.empty()) {
    fail_empty(body, said_at,
               fmt::format("the closest lies {:.4g} mm from the surface that it should touch; ", closest));
  }
  return nodes;
}

double thickness_at(const ShellBody& shell, Index triangle, const Vec2& at) {
  if (shell.thickness.size() == 1) {
    return shell.thickness.front();
  }
  const auto& corners = shell.mesh.triangles[triangle];
  return (1 - at[0] - at[1]) * shell.thickness[corners[0]] + at[0] * shell.thickness[corners[1]] +
         at[1] * shell.thickness[corners[2]];
}

}  // namespace

SelectableBody::SelectableBody(const ShellBody& shell)
    : vertices_(shell.mesh.vertices),
      solid_(false),
      triangles_(shell.mesh.triangles),
      edges_(boundary_edges_of(shell.mesh)),
      boundary_(nodes_in(edges_)),
      used_(used_by(shell.mesh.triangles, vertices_.size())) {
  curved_ = shell.curved ? &shell.mesh : nullptr;
  measure();
}

SelectableBody::SelectableBody(const SolidBody& solid)
    : vertices_(solid.mesh.vertices),
      solid_(true),
      triangles_(boundary_triangles(solid.mesh)),
      boundary_(nodes_in(triangles_)),
      used_(used_by(solid.mesh.tetrahedra, vertices_.size())) {
  measure();
}

void SelectableBody::measure() {
  bool first = true;
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    if (used(v)) {
      box_.lower = first ? vertices_[v] : Vec3(box_.lower.cwiseMin(vertices_[v]));
      box_.upper = first ? vertices_[v] : Vec3(box_.upper.cwiseMax(vertices_[v]));
      first = false;
    }
  }
  tolerance_ = region_tolerance * box_.diagonal();
}

template <typename Predicate>
std::vector<Index> SelectableBody::nodes_where(const Predicate& inside) const {
  std::vector<Index> nodes;
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    if (used(v) && inside(vertices_[v])) {
      nodes.push_back(narrow<Index>(v));
    }
  }
  return nodes;
}

std::vector<Index> nodes_of(const SelectableBody& body, const Selection& where, const std::string& said_at) {
  std::vector<Index> nodes = std::visit([&](const auto& form) { return select(body, form, said_at); }, where);
  if (nodes.empty()) {
    fail_empty(body, said_at, "");
  }
  return nodes;
}

namespace {

constexpr double hardly_any = 1e-9;  // of a triangle or an edge: rounding

/// Half of space: normal * x <= offset.
struct HalfSpace {
  Vec3 normal;
  double offset;
};

/// The region that a form stands for, as its areas and lengths are measured.
std::vector<HalfSpace> convex(const BoxNodes& box) {
  std::vector<HalfSpace> all;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    all.push_back({Vec3::Unit(axis), box.upper[axis]});
    all.push_back({-Vec3::Unit(axis), -box.lower[axis]});
  }
  return all;
}

std::vector<HalfSpace> convex(const HalfSpaceNodes& half) {
  const double sign = half.below ? 1 : -1;
  return {{sign * Vec3::Unit(half.axis), sign * half.at}};
}

const SphereNodes& convex(const SphereNodes& ball) { return ball; }

/// Where a segment enters and leaves a region, as parts of the way; 0, 0: nowhere.
std::pair<double, double> inner_part(const std::vector<HalfSpace>& region, const Vec3& from, const Vec3& to) {
  double enters = 0, leaves = 1;
  for (const auto& [normal, offset] : region) {
    const double at_from = normal.dot(from) - offset, at_to = normal.dot(to) - offset;
    if (at_from > 0 && at_to > 0) {
      return {0, 0};
    }
    if (at_from > 0) {
      enters = std::max(enters, at_from / (at_from - at_to));
    } else if (at_to > 0) {
      leaves = std::min(leaves, at_from / (at_from - at_to));
    }
  }
  return enters < leaves ? std::pair(enters, leaves) : std::pair(0.0, 0.0);
}

std::pair<double, double> inner_part(const SphereNodes& ball, const Vec3& from, const Vec3& to) {
  const Vec3 p = from - ball.centre, d = to - from;
  const double a = d.squaredNorm(), b = p.dot(d), root = b * b - a * (p.squaredNorm() - ball.radius * ball.radius);
  if (!(root > 0) || !(a > 0)) {
    return {0, 0};
  }
  return {std::clamp((-b - std::sqrt(root)) / a, 0.0, 1.0), std::clamp((-b + std::sqrt(root)) / a, 0.0, 1.0)};
}

/// Source: Sutherland, Hodgman, "Reentrant polygon clipping", CACM 17, 1974.
double inner_area(const std::vector<HalfSpace>& region, const std::array<Vec3, 3>& corners) {
  std::vector<Vec3> polygon(corners.begin(), corners.end());
  for (const auto& [normal, offset] : region) {
    std::vector<Vec3> clipped;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec3 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
      const double at_p = normal.dot(p) - offset, at_q = normal.dot(q) - offset;
      if (at_p <= 0) {
        clipped.push_back(p);
      }
      if ((at_p < 0 && at_q > 0) || (at_p > 0 && at_q < 0)) {
        clipped.emplace_back(p + at_p / (at_p - at_q) * (q - p));
      }
    }
    polygon = std::move(clipped);
  }
  Vec3 twice = Vec3::Zero();
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    twice += (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]);
  }
  return twice.norm() / 2;
}

/// In the triangle's plane: edge by edge what a disc and the triangle of the edge and its centre have in common, with
/// its sign.
double inner_area(const SphereNodes& ball, const std::array<Vec3, 3>& corners) {
  const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).stableNormalized();
  const double height = normal.dot(corners[0] - ball.centre), squared = ball.radius * ball.radius - height * height;
  if (!(squared > 0)) {
    return 0;
  }
  const SphereNodes disc{ball.centre + height * normal, std::sqrt(squared)};
  const auto twice = [&](const Vec3& p, const Vec3& q) { return normal.dot(p.cross(q)); };
  const auto sector = [&](const Vec3& p, const Vec3& q) { return squared * std::atan2(twice(p, q), p.dot(q)); };
  double area = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 p = corners[k] - disc.centre, q = corners[(k + 1) % 3] - disc.centre;
    const auto [enters, leaves] = inner_part(disc, corners[k], corners[(k + 1) % 3]);
    const Vec3 in = p + enters * (q - p), out = p + leaves * (q - p);
    area += (sector(p, in) + twice(in, out) + sector(out, q)) / 2;
  }
  return area;
}

/// Whether some points, and all between them, are certainly outside.
bool misses(const std::vector<HalfSpace>& region, std::span<const Vec3> points) {
  return std::ranges::any_of(region, [&](const HalfSpace& half) {
    return std::ranges::all_of(points, [&](const Vec3& p) { return half.normal.dot(p) > half.offset; });
  });
}

bool misses(const SphereNodes& ball, std::span<const Vec3> points) {
  Vec3 lower = points[0], upper = points[0];
  for (const Vec3& p : points) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  return (ball.centre.cwiseMax(lower).cwiseMin(upper) - ball.centre).norm() > ball.radius;
}

/// Of a flat triangle the area that lies in a region.
template <typename Form>
double area_within(const Form& form, const std::array<Vec3, 3>& corners, double tolerance) {
  const bool is_inside = std::ranges::all_of(corners, [&](const Vec3& p) { return holds(form, p, tolerance); });
  return is_inside ? triangle_area(corners[0], corners[1], corners[2]) : inner_area(convex(form), corners);
}

/// Of a patch the part of its area that lies in a region, by flat pieces where the border cuts it.
template <typename Form>
double share_of_patch(const Form& form, const CubicPatch& patch, double tolerance) {
  constexpr int pieces = 8;  // per edge: what a patch rises above its facet becomes a 64th
  if (std::ranges::all_of(patch.control, [&](const Vec3& p) { return holds(form, p, tolerance); })) {
    return 1;  // regions are convex, and the patch lies between its control points
  }
  if (misses(convex(form), patch.control)) {
    return 0;
  }
  const auto point = [&](int i, int j) { return patch.point(Vec2(real(i) / pieces, real(j) / pieces)); };
  double whole = 0, inside = 0;
  const auto add = [&](const std::array<Vec3, 3>& corners) {
    whole += triangle_area(corners[0], corners[1], corners[2]);
    inside += area_within(form, corners, tolerance);
  };
  for (int i = 0; i < pieces; ++i) {
    for (int j = 0; i + j < pieces; ++j) {
      add({point(i, j), point(i + 1, j), point(i, j + 1)});
      if (i + j + 1 < pieces) {
        add({point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)});
      }
    }
  }
  return inside / whole;
}

}  // namespace

std::vector<double> whole_triangles(std::span<const std::array<Index, 3>> triangles, const std::vector<Index>& nodes) {
  const std::set<Index> chosen(nodes.begin(), nodes.end());
  std::vector<double> shares;
  for (const auto& corners : triangles) {
    shares.push_back(std::ranges::all_of(corners, [&](Index v) { return chosen.contains(v); }) ? 1 : 0);
  }
  return shares;
}

std::vector<double> shares_of(const SelectableBody& body, const Selection& where, const std::string& said_at) {
  if (std::holds_alternative<AllNodes>(where)) {
    return {};
  }
  const std::vector<Index> nodes = std::visit([&](const auto& form) { return select(body, form, said_at); }, where);
  std::vector<double> shares = whole_triangles(body.triangles(), nodes);
  const std::vector<CubicPatch> patches =
      body.curved() != nullptr ? curved_patches(*body.curved()) : std::vector<CubicPatch>();
  std::visit(
      [&]<typename Form>(const Form& form) {
        if constexpr (Region<Form>) {
          for (std::size_t t = 0; t < shares.size(); ++t) {
            const auto& [a, b, c] = body.triangles()[t];
            const std::array corners{body.vertices()[a], body.vertices()[b], body.vertices()[c]};
            const double whole = triangle_area(corners[0], corners[1], corners[2]);
            const double share = !patches.empty() ? share_of_patch(form, patches[t], body.tolerance())
                                 : whole > 0      ? area_within(form, corners, body.tolerance()) / whole
                                                  : shares[t];
            shares[t] = share < hardly_any ? 0 : share > 1 - hardly_any ? 1 : share;
          }
        }
      },
      where);
  if (std::ranges::all_of(shares, [](double share) { return share == 0; })) {
    if (nodes.empty()) {
      fail_empty(body, said_at, "");
    }
    throw InputError(
        fmt::format("{}: nothing of the surface lies in it but {} node(s): no triangle has all its nodes "
                    "there, or a part of its area: select more",
                    said_at, nodes.size()));
  }
  return shares;
}

SelectedEdges edges_of(const SelectableBody& body, const Selection& where, const std::string& said_at) {
  const std::vector<Index> nodes = std::visit([&](const auto& form) { return select(body, form, said_at); }, where);
  const std::set<Index> chosen(nodes.begin(), nodes.end());
  SelectedEdges found;
  for (const auto& edge : body.boundary_edges()) {
    double share = chosen.contains(edge[0]) && chosen.contains(edge[1]) ? 1 : 0;
    std::visit(
        [&]<typename Form>(const Form& form) {
          if constexpr (Region<Form>) {
            const auto [enters, leaves] = inner_part(convex(form), body.vertices()[edge[0]], body.vertices()[edge[1]]);
            share = share > 0 ? share : leaves - enters;
          }
        },
        where);
    if (share > hardly_any) {
      found.edges.push_back(edge);
      found.shares.push_back(share);
    }
  }
  if (found.edges.empty()) {
    if (nodes.empty()) {
      fail_empty(body, said_at, "");
    }
    throw InputError(
        body.boundary_edges().empty()
            ? said_at + ": the body is closed and has no boundary edges: an edge load needs an open one"
            : fmt::format("{}: no boundary edge has both its ends among the {} selected nodes", said_at, nodes.size()));
  }
  return found;
}

namespace {

/// Planes that differ by less than what fitting a surface leaves are one: the pressure would squeeze the vessel
/// sideways out of so slight a wedge, without friction and without end.
void make_parallel(std::vector<Rim>& rims) {
  constexpr double slight = 0.002;  // rad
  for (const Rim& first : std::vector<Rim>(rims)) {
    Vec3 sum = Vec3::Zero();
    for (const bool assigns : {false, true}) {
      const Vec3 mean = sum.normalized();
      for (Rim& rim : rims) {
        if (rim.normal.cross(first.normal).norm() < slight) {
          const double sign = rim.normal.dot(first.normal) < 0 ? -1 : 1;
          sum += sign * rim.normal;
          rim.normal = assigns ? Vec3(sign * mean) : rim.normal;
        }
      }
    }
  }
}

}  // namespace

std::vector<Rim> rims_within(const SelectableBody& body, const std::vector<Index>& nodes, const std::string& said_at) {
  DisjointSets joined(body.vertices().size());
  for (const auto& [from, to] : body.boundary_edges()) {
    joined.join(from, to);
  }
  std::map<Index, Rim> loops;  // by root
  for (const Index node : body.boundary_nodes()) {
    loops[joined.root(node)].nodes.push_back(node);
  }
  std::vector<Rim> rims;
  for (auto& [root, rim] : loops) {
    if (!std::ranges::includes(nodes, rim.nodes)) {
      continue;
    }
    Vec3 centre = Vec3::Zero();
    for (const Index node : rim.nodes) {
      centre += body.vertices()[node] / real(rim.nodes.size());
    }
    Mat3 spread = Mat3::Zero();
    for (const Index node : rim.nodes) {
      const Vec3 arm = body.vertices()[node] - centre;
      spread += arm * arm.transpose();
    }
    rim.normal = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors().col(0);
    rims.push_back(std::move(rim));
  }
  make_parallel(rims);
  if (rims.empty()) {
    throw InputError(fmt::format("{}: no rim has all its nodes among the {} selected: select more, or all by boundary",
                                 said_at, nodes.size()));
  }
  std::ranges::sort(rims, {}, [](const Rim& rim) { return rim.nodes.front(); });
  return rims;
}

std::vector<Index> nodes_touching(const SelectableBody& body, double distance, const ShellBody& carrier,
                                  Attachment::Side side, const std::string& said_at,
                                  const std::string& carrier_said_at) {
  require_fit(carrier.mesh, carrier_said_at);
  const std::vector<CubicPatch> patches = curved_patches(carrier.mesh);
  const PatchSearch search(carrier.mesh, patches);
  const double offset = side == Attachment::Side::outer ? 0.5 : side == Attachment::Side::inner ? -0.5 : 0;
  std::optional<Index> guess;
  return within(body, distance, said_at, [&](const Vec3& p) {
    const SurfaceFoot foot = search.near(p, guess);
    const Vec3 face =
        foot.point + offset * thickness_at(carrier, foot.patch, foot.at) * patches[foot.patch].normal(foot.at);
    return (p - face).norm();
  });
}

std::vector<Index> nodes_touching(const SelectableBody& body, double distance, const SolidBody& carrier,
                                  const std::string& said_at) {
  const ClosestPoint surface({carrier.mesh.vertices, boundary_triangles(carrier.mesh)});
  return within(body, distance, said_at, [&](const Vec3& p) { return std::sqrt(surface.closest(p).squared_distance); });
}

}  // namespace tunica
