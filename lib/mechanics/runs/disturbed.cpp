#include "tunica/mechanics/runs/disturbed.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/model/corner_normals.hpp"
#include "tunica/mechanics/model/curvature.hpp"
#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <queue>
#include <set>

namespace tunica {
namespace {

constexpr double step = 1.25;      // of the thickness within a shell, from which on it bends the wall
constexpr double layers = 2;       // bending lengths, within which stress is that of what disturbs it
constexpr double flattest = 1e-6;  // curvature times the body's diagonal, below which it is round-off

/// How the wall curves at places: the mean of what its shells do within two walls of them. Shells finer than that may
/// follow the facets of the surface that they were fitted to, whose bends are not the wall's.
class CurvatureOfWall {
public:
  explicit CurvatureOfWall(const ShellBody& body)
      : body_(body),
        facets_(flat_facets(body.mesh)),
        around_(incidence(facets_)),
        shapes_(shape_operators_of(body.mesh, body.curved)) {
    for (const auto& [i, j, k] : facets_.triangles) {
      const auto& v = facets_.vertices;
      areas_.push_back((v[j] - v[i]).cross(v[k] - v[i]).norm() / 2);
    }
  }

  [[nodiscard]] double thickness_at(Index node) const {
    return body_.thickness[body_.thickness.size() == 1 ? 0 : node];
  }
  /// mm^2, of the shells around a node.
  [[nodiscard]] double area_at(Index node) const {
    double area = 0;
    for (const Index t : around_.of(node)) {
      area += areas_[t];
    }
    return area;
  }
  /// 1/mm, the larger of the principal ones.
  [[nodiscard]] double largest_at(Index node) const {
    const double reach = within * thickness_at(node);
    std::set<Index> seen{node};
    std::vector<Index> next{node};
    std::set<Index> shells;
    while (!next.empty()) {
      const Index at = next.back();
      next.pop_back();
      for (const Index t : around_.of(at)) {
        shells.insert(t);
        for (const Index other : facets_.triangles[t]) {
          if ((facets_.vertices[other] - facets_.vertices[node]).norm() < reach && seen.insert(other).second) {
            next.push_back(other);
          }
        }
      }
    }
    double area = 0;
    Mat3 shape = Mat3::Zero();
    for (const Index t : shells) {
      area += areas_[t];
      shape += areas_[t] * shapes_[t];
    }
    return area > 0 ? Eigen::SelfAdjointEigenSolver<Mat3>(shape / area).eigenvalues().cwiseAbs().maxCoeff() : 0;
  }

private:
  static constexpr double within = 2;  // thicknesses
  const ShellBody& body_;
  TriangleMesh facets_;
  Incidence around_;
  std::vector<Mat3> shapes_;
  std::vector<double> areas_;
};

/// Per node of a body, the bending length of what it belongs to where it is disturbed, else 0.
std::vector<double> bending_lengths(const Model& model, std::size_t b) {
  const ShellBody& body = model.shells[b];
  const std::vector<std::uint8_t> disturbed = disturbed_nodes(model, b);
  std::vector<double> lengths(disturbed.size(), 0);
  if (std::ranges::find(disturbed, 1) == disturbed.end()) {
    return lengths;
  }
  DisjointSets<> together(disturbed.size());
  for (const auto& t : body.mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (disturbed[t[k]] != 0 && disturbed[t[(k + 1) % 3]] != 0) {
        together.join(t[k], t[(k + 1) % 3]);
      }
    }
  }
  const CurvatureOfWall wall(body);
  std::vector<double> area(disturbed.size(), 0), curvature(area), thickness(area);  // sums over what hangs together
  for (Index node = 0; node < disturbed.size(); ++node) {
    if (disturbed[node] != 0) {
      const Index root = together.root(node);
      const double own = wall.area_at(node);
      area[root] += own;
      curvature[root] += own * wall.largest_at(node);
      thickness[root] += own * wall.thickness_at(node);
    }
  }
  const double straight = flattest / diagonal(flat_facets(body.mesh));
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const Index root = together.root(narrow<Index>(i));
    if (disturbed[i] != 0 && curvature[root] > straight * area[root]) {
      lengths[i] = std::sqrt(thickness[root] / curvature[root]);
    }
  }
  return lengths;
}

/// How far a front has come at the third corner of a facet, where it passed the others at these distances and its speed
/// is 1; infinite where it comes to it from outside the facet (Kimmel and Sethian 1998).
double front_at(const Vec3& corner, const Vec3& a, double at_a, const Vec3& b, double at_b) {
  const Vec3 edge = b - a;
  const double length = edge.norm();
  const double x = edge.dot(corner - a) / length;
  const double y = (corner - a - x / length * edge).norm();
  const double along = (at_b - at_a) / length;
  if (!(std::abs(along) < 1)) {
    return infinity;
  }
  const double ahead = std::sqrt(1 - along * along);
  const double from = x - y * along / ahead;  // of the edge, where it came through
  return from >= 0 && from <= length ? at_a + along * x + ahead * y : infinity;
}

/// Distances of a body's nodes along its facets from those that have a length, in these lengths; infinite beyond.
std::vector<double> scaled_distances(const ShellMesh& mesh, std::vector<double> lengths) {
  const Incidence around = incidence(lengths.size(), mesh.triangles);
  std::vector<double> distances(lengths.size(), infinity);
  std::priority_queue<std::pair<double, Index>, std::vector<std::pair<double, Index>>, std::greater<>> next;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] > 0) {
      distances[i] = 0;
      next.emplace(0, narrow<Index>(i));
    }
  }
  while (!next.empty()) {
    const auto [distance, node] = next.top();
    next.pop();
    if (distance > distances[node]) {
      continue;
    }
    const double length = lengths[node];
    const auto at = [&](Index v) -> Vec3 { return mesh.vertices[v] / length; };
    const auto reach = [&](Index other, Index beside) {
      const double along_edge = distance + (at(other) - at(node)).norm();
      const double across = distances[beside] < infinity
                                ? front_at(at(other), at(node), distance, at(beside), distances[beside])
                                : infinity;
      if (const double there = std::min(along_edge, across); there < distances[other]) {
        distances[other] = there;
        lengths[other] = length;
        next.emplace(there, other);
      }
    };
    for (const Index t : around.of(node)) {
      const auto& corners = mesh.triangles[t];
      const std::size_t k = std::ranges::find(corners, node) - corners.begin();
      reach(corners[(k + 1) % 3], corners[(k + 2) % 3]);
      reach(corners[(k + 2) % 3], corners[(k + 1) % 3]);
    }
  }
  return distances;
}

/// Adds what of a shell lies at `layers` and beyond. @param d  at its corners, linear between them
void add_far_part(std::size_t shell, const std::array<double, 3>& d, std::vector<ShellPart>& parts) {
  const Mat3 corners = Mat3::Identity();
  const auto far = std::ranges::count_if(d, [](double at) { return at >= layers; });
  if (far == 0 || std::ranges::min(d) == 0) {
    return;
  }
  if (far == 3) {
    parts.push_back({shell, {corners.col(0), corners.col(1), corners.col(2)}});
    return;
  }
  // The corner that is alone on its side.
  const std::size_t a = std::ranges::find_if(d, [&](double at) { return (at >= layers) == (far == 1); }) - d.begin();
  const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
  const auto border = [&](std::size_t to) -> Vec3 {
    return corners.col(a) + (layers - d[a]) / (d[to] - d[a]) * (corners.col(to) - corners.col(a));
  };
  if (far == 1) {
    parts.push_back({shell, {corners.col(a), border(b), border(c)}});
  } else {
    parts.push_back({shell, {border(b), corners.col(b), corners.col(c)}});
    parts.push_back({shell, {border(b), corners.col(c), border(c)}});
  }
}

}  // namespace

std::optional<Vec3> plane_of_symmetry(const Fix& fix) {
  if (fix.across) {
    return fix.across;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const auto holds = [&](const std::array<bool, 3>& held, bool along) {
      return std::ranges::all_of(std::array{0, 1, 2},
                                 [&](int c) { return held[narrow<std::size_t>(c)] == ((c == axis) == along); });
    };
    if (holds(fix.translation, true) && holds(fix.rotation, false) && fix.displacement[axis] == 0) {
      return Vec3(Vec3::Unit(axis));
    }
  }
  return std::nullopt;
}

double slant_of_rim(const ShellBody& body, const Fix& fix) {
  const std::optional<Vec3> plane = plane_of_symmetry(fix);
  if (!plane) {
    return 0;
  }
  const std::set<Index> nodes(fix.nodes.begin(), fix.nodes.end());
  const CornerNormals normal(body.mesh, body.curved);
  const Vec3 aside = plane->unitOrthogonal(), across = plane->cross(aside);
  double length = 0;
  Mat3 left = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  const TriangleMesh facets = flat_facets(body.mesh);
  for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {
    const std::array<Index, 3>& v = facets.triangles[t];
    const std::size_t next = (k + 1) % 3;
    if (nodes.contains(v[k]) && nodes.contains(v[next])) {
      const double part = (facets.vertices[v[next]] - facets.vertices[v[k]]).norm();
      const Vec3 n = (normal(t, k) + normal(t, next)).normalized();
      const Vec3 terms(1, n.dot(aside), n.dot(across));
      length += part;
      left += part * terms * terms.transpose();
      right += part * n.dot(*plane) * terms;
    }
  }
  if (!(length > 0)) {
    return 0;
  }
  const Vec3 fitted = left.completeOrthogonalDecomposition().solve(right);
  return std::sqrt(2 * fitted.dot(left * fitted) / length);
}

bool is_step(const ShellBody& body, std::size_t triangle) {
  if (body.thickness.size() == 1) {
    return false;
  }
  if (triangle >= body.mesh.triangles.size() || body.thickness.size() != body.mesh.vertices.size()) {
    throw InputError(fmt::format("{}: there is no triangle {}, or not one thickness per node", body.name, triangle));
  }
  const auto& t = body.mesh.triangles[triangle];
  const auto [least, most] = std::minmax({body.thickness[t[0]], body.thickness[t[1]], body.thickness[t[2]]});
  return most > step * least;
}

std::vector<std::uint8_t> disturbed_nodes(const Model& model, std::size_t b) {
  require_valid(model);
  if (b >= model.shells.size()) {
    throw InputError(fmt::format("there is no shell {}", b));
  }
  const ShellBody& body = model.shells[b];
  std::vector<std::uint8_t> disturbed(body.mesh.vertices.size(), 0);
  const auto mark = [&](const std::vector<Index>& nodes) {
    for (const Index node : nodes) {
      disturbed[node] = 1;
    }
  };
  std::vector<std::uint8_t> slides(disturbed.size(), 0);  // as in a plane of symmetry: nothing bends there
  for (const Fix& fix : model.fixes) {
    if (fix.body == b && plane_of_symmetry(fix) && slant_of_rim(body, fix) <= negligible_slant) {
      for (const Index node : fix.nodes) {
        slides[node] = 1;
      }
    } else if (fix.body == b) {
      mark(fix.nodes);
    }
  }
  for (const Load& load : model.loads) {
    if (load.body != b) {
      continue;
    }
    if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      mark(force->nodes);
    } else if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
      mark(moment->nodes);
    }
  }
  const TriangleMesh facets = flat_facets(body.mesh);
  for (const auto& [t, k] : boundary_edges(neighbours(facets, incidence(facets)))) {  // edge loads act there too
    const auto& v = facets.triangles[t];
    if (slides[v[k]] == 0 || slides[v[(k + 1) % 3]] == 0) {
      mark({v[k], v[(k + 1) % 3]});
    }
  }
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    if (is_step(body, t)) {
      const auto& [i, j, k] = body.mesh.triangles[t];
      mark({i, j, k});
    }
  }
  return disturbed;
}

std::vector<ShellPart> far_from_disturbances(const Model& model) {
  require_valid(model);
  std::vector<ShellPart> parts;
  std::size_t shell = 0;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellMesh& mesh = model.shells[b].mesh;
    const std::vector<double> distances = scaled_distances(mesh, bending_lengths(model, b));
    for (const auto& [i, j, k] : mesh.triangles) {
      add_far_part(shell++, {distances[i], distances[j], distances[k]}, parts);
    }
  }
  return parts;
}

}  // namespace tunica
