#include "tunica/mechanics/model/selection.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/shell/distance/patch_search.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>
#include <Eigen/Dense>

#include <algorithm>
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

std::vector<Index> select(const SelectableBody& body, const BoxNodes& box, const std::string&) {
  return body.nodes_where([&](const Vec3& p) {
    return (p.array() >= box.lower.array() - body.tolerance()).all() &&
           (p.array() <= box.upper.array() + body.tolerance()).all();
  });
}

std::vector<Index> select(const SelectableBody& body, const HalfSpaceNodes& half, const std::string&) {
  return body.nodes_where([&](const Vec3& p) {
    const double above = p[half.axis] - half.at;
    return (half.below ? above : -above) <= body.tolerance();
  });
}

std::vector<Index> select(const SelectableBody& body, const SphereNodes& sphere, const std::string&) {
  return body.nodes_where(
      [&](const Vec3& p) { return (p - sphere.centre).norm() <= sphere.radius + body.tolerance(); });
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

std::vector<std::array<Index, 2>> edges_of(const SelectableBody& body, const std::vector<Index>& nodes,
                                           const std::string& said_at) {
  std::vector<std::array<Index, 2>> edges;
  const std::set<Index> chosen(nodes.begin(), nodes.end());
  for (const auto& edge : body.boundary_edges()) {
    if (chosen.count(edge[0]) != 0 && chosen.count(edge[1]) != 0) {
      edges.push_back(edge);
    }
  }
  if (edges.empty()) {
    throw InputError(
        fmt::format("{}: no boundary edge has both its ends among the {} selected nodes", said_at, nodes.size()));
  }
  return edges;
}

void require_triangle(const SelectableBody& body, const std::vector<Index>& nodes, const std::string& said_at) {
  std::vector<char> chosen(body.vertices().size(), 0);
  for (const Index node : nodes) {
    chosen[node] = 1;
  }
  const bool any = std::ranges::any_of(
      body.triangles(), [&](const auto& t) { return (chosen[t[0]] & chosen[t[1]] & chosen[t[2]]) != 0; });
  if (!any) {
    throw InputError(
        fmt::format("{}: no triangle has all its nodes among the {} selected: select more", said_at, nodes.size()));
  }
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
