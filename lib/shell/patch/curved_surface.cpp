// The curved surface of Comas, Duriez, Cotin, "Shell Model for Reconstruction and Real-Time Simulation of Thin
// Anatomical Structures", MICCAI 2010, written as cubic Bezier triangles: eq. (1) is a cubic, so this is exact.
#include "tunica/shell/patch/curved_surface.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/patch/detail/pieces.hpp"
#include "tunica/shell/patch/shape_function.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <fmt/core.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace tunica {
namespace {

constexpr int most_pieces_per_edge = 10'000;

constexpr std::size_t patches_per_task = 64;
constexpr double least_height = 1e-6;  // of the longest edge: less has no usable stiffness in double precision

/// The quadratic Bezier triangle of derivatives along the direction with barycentric components d (sum 0), divided by
/// 3: control points 200, 020, 002, 110, 011, 101.
std::array<Vec3, 6> directional(const std::array<Vec3, 10>& p, const Vec3& d) {
  return {d[0] * p[0] + d[1] * p[3] + d[2] * p[8], d[0] * p[4] + d[1] * p[1] + d[2] * p[5],
          d[0] * p[7] + d[1] * p[6] + d[2] * p[2], d[0] * p[3] + d[1] * p[4] + d[2] * p[9],
          d[0] * p[9] + d[1] * p[5] + d[2] * p[6], d[0] * p[8] + d[1] * p[9] + d[2] * p[7]};
}

Vec3 quadratic_point(const std::array<Vec3, 6>& q, double l1, double l2, double l3) {
  return l1 * l1 * q[0] + l2 * l2 * q[1] + l3 * l3 * q[2] + 2 * (l1 * l2 * q[3] + l2 * l3 * q[4] + l3 * l1 * q[5]);
}

/// Second derivative along d then e, divided by 6, at the three corners; linear in between.
std::array<Vec3, 3> second_difference(const std::array<Vec3, 10>& p, const Vec3& d, const Vec3& e) {
  const auto q = directional(p, d);
  return {e[0] * q[0] + e[1] * q[3] + e[2] * q[5], e[0] * q[3] + e[1] * q[1] + e[2] * q[4],
          e[0] * q[5] + e[1] * q[4] + e[2] * q[2]};
}

const Vec3 along_b2(-1, 1, 0);
const Vec3 along_b3(-1, 0, 1);

double largest_norm(const std::array<Vec3, 3>& v) {
  return std::sqrt(std::max({v[0].squaredNorm(), v[1].squaredNorm(), v[2].squaredNorm()}));
}

/// Maximum of a l1 l2 + b l2 l3 + c l3 l1 over the triangle, for a, b, c >= 0: the squared radius of the smallest
/// circle around a triangle with squared sides a, b, c.
double largest_product_sum(double a, double b, double c) {
  const double largest = std::max({a, b, c});
  if (2 * largest >= a + b + c) {
    return largest / 4;
  }
  return a * b * c / (2 * (a * b + b * c + c * a) - a * a - b * b - c * c);
}

/// flatness() at level 1; level m divides it by m^2.
double coarsest_flatness(const CubicPatch& patch) { return flatness(patch, {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}); }

std::array<Vec3, 3> corners_of(const ShellMesh& shell, std::size_t t) {
  const auto& v = shell.triangles[t];
  return {shell.vertices[v[0]], shell.vertices[v[1]], shell.vertices[v[2]]};
}

std::array<Vec3, 3> normals_of(const ShellMesh& shell, std::size_t t) {
  return {shell.normal(t, 0), shell.normal(t, 1), shell.normal(t, 2)};
}

Tessellation tessellate_by(const ShellMesh& shell, const std::vector<CubicPatch>& patches,
                           const std::vector<int>& levels) {
  const std::size_t count = patches.size();
  std::vector<std::size_t> first_vertex(count + 1, 0), first_triangle(count + 1, 0);
  for (std::size_t t = 0; t < count; ++t) {
    const std::size_t m = levels[t];
    first_vertex[t + 1] = first_vertex[t] + (m + 1) * (m + 2) / 2;
    first_triangle[t + 1] = first_triangle[t] + m * m;
  }
  if (std::max(first_vertex[count], first_triangle[count]) > max_index) {
    throw RequirementError("the curved surface would need more than 2^31 fine triangles; allow a larger deviation");
  }
  Tessellation out;
  out.mesh.vertices.resize(first_vertex[count]);
  out.vertex_shell.resize(first_vertex[count]);
  out.barycentric.resize(first_vertex[count]);
  out.mesh.triangles.resize(first_triangle[count]);
  out.shell.resize(first_triangle[count]);
  parallel_for_blocks(count, patches_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const int m = levels[t];
      // Row r holds the points with b3 = r / m; its first vertex stands at row_start(r).
      const auto row_start = [&](int r) { return first_vertex[t] + narrow<std::size_t>(r * (2 * m + 3 - r) / 2); };
      std::size_t triangle = first_triangle[t];
      for (int r = 0; r <= m; ++r) {
        for (int c = 0; c <= m - r; ++c) {
          const std::size_t v = row_start(r) + narrow<std::size_t>(c);
          const Vec2 b(real(c) / m, real(r) / m);
          out.barycentric[v] = b;
          out.vertex_shell[v] = narrow<Index>(t);
          out.mesh.vertices[v] = patches[t].point(b);
          if (c < m - r) {
            const auto here = narrow<Index>(v);
            const auto above = narrow<Index>(row_start(r + 1) + narrow<std::size_t>(c));
            out.shell[triangle] = narrow<Index>(t);
            out.mesh.triangles[triangle++] = {here, here + 1, above};
            if (c + 1 < m - r) {
              out.shell[triangle] = narrow<Index>(t);
              out.mesh.triangles[triangle++] = {here + 1, above + 1, above};
            }
          }
        }
      }
      // The corners are the nodes themselves, to the bit.
      const auto corners = corners_of(shell, t);
      out.mesh.vertices[row_start(0)] = corners[0];
      out.mesh.vertices[row_start(0) + narrow<std::size_t>(m)] = corners[1];
      out.mesh.vertices[row_start(m)] = corners[2];
    }
  });
  for (std::size_t t = 0; t < count; ++t) {
    out.deviation = std::max(out.deviation, flatness(patches[t], levels[t]));
  }
  return out;
}

/// What a patch of a closed surface adds to its volume: a third of the flux of the position, about `origin`. The
/// integrand is of degree 7; five Gauss points each way on the square that collapses to the triangle are exact to 8
/// and 9.
double flux_volume(const CubicPatch& patch, const Vec3& origin) {
  constexpr std::array<double, 5> points{-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                         0.9061798459386640};
  constexpr std::array<double, 5> weights{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                          0.4786286704993665, 0.2369268850561891};
  double sum = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < 5; ++j) {
      const double u = (1 + points[i]) / 2, v = (1 + points[j]) / 2;
      const Vec2 at(u, v * (1 - u));
      const auto [along_2, along_3] = patch.tangents(at);
      sum += weights[i] * weights[j] / 4 * (1 - u) * (patch.point(at) - origin).dot(along_2.cross(along_3)) / 3;
    }
  }
  return sum;
}

/// One at each vertex, or at each corner of each triangle.
void require_normals(const ShellMesh& shell) {
  if (shell.corner_normals.empty() ? shell.normals.size() != shell.vertices.size()
                                   : shell.corner_normals.size() != shell.triangles.size()) {
    throw InputError("has no normals; a shell mesh needs a unit normal per vertex (make one by tunica-relax)");
  }
}

}  // namespace

std::array<double, 10> bernstein(const Vec2& b) {
  const double l1 = 1 - b[0] - b[1], l2 = b[0], l3 = b[1];
  return {l1 * l1 * l1,     l2 * l2 * l2,     l3 * l3 * l3,     3 * l1 * l1 * l2, 3 * l1 * l2 * l2,
          3 * l2 * l2 * l3, 3 * l2 * l3 * l3, 3 * l3 * l3 * l1, 3 * l3 * l1 * l1, 6 * l1 * l2 * l3};
}

Vec3 CubicPatch::point(const Vec2& b) const {
  const auto basis = bernstein(b);
  Vec3 sum = basis[0] * control[0];
  for (std::size_t i = 1; i < 10; ++i) {
    sum += basis[i] * control[i];
  }
  return sum;
}

std::array<Vec3, 2> CubicPatch::tangents(const Vec2& b) const {
  const double l1 = 1 - b[0] - b[1];
  return {3 * quadratic_point(directional(control, along_b2), l1, b[0], b[1]),
          3 * quadratic_point(directional(control, along_b3), l1, b[0], b[1])};
}

std::array<Vec3, 3> CubicPatch::second_derivatives(const Vec2& b) const {
  const double l1 = 1 - b[0] - b[1];
  const auto at = [&](const Vec3& d, const Vec3& e) -> Vec3 {
    const auto s = second_difference(control, d, e);
    return 6 * (l1 * s[0] + b[0] * s[1] + b[1] * s[2]);
  };
  return {at(along_b2, along_b2), at(along_b2, along_b3), at(along_b3, along_b3)};
}

Vec3 CubicPatch::normal(const Vec2& b) const {
  const auto d = tangents(b);
  return d[0].cross(d[1]).stableNormalized();
}

double averaged_centre(const std::array<Vec3, 3>& edges, const std::array<double, 10>& ordinates) {
  const auto& b = ordinates;
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {  // edge i is the x axis
    const std::size_t next = (i + 1) % 3;
    const std::size_t previous = (i + 2) % 3;
    const double foot = -edges[previous].dot(edges[i]) / edges[i].squaredNorm();
    sum += centre_ordinate(foot, b[i], b[3 + 2 * i], b[4 + 2 * i], b[next], b[4 + 2 * previous], b[3 + 2 * next]);
  }
  return sum / 3;
}

Deflection comas_deflection(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  const std::array<Vec3, 3> edges{corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};
  Deflection w;
  w.normal = edges[0].cross(-edges[2]).stableNormalized();
  auto& b = w.ordinates;
  b[0] = b[1] = b[2] = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t previous = (i + 2) % 3;
    const double agreement = normals[i].dot(w.normal);
    // A third of the slope along the edge that leaves corner i, and along the one that arrives, seen from i.
    b[3 + 2 * i] = -normals[i].dot(edges[i]) / (3 * agreement);
    b[4 + 2 * previous] = normals[i].dot(edges[previous]) / (3 * agreement);
  }
  b[9] = averaged_centre(edges, b);
  return w;
}

CubicPatch comas_patch(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  const Deflection w = comas_deflection(corners, normals);
  const Vec3 &p1 = corners[0], &p2 = corners[1], &p3 = corners[2];
  CubicPatch patch{{p1, p2, p3, (2 * p1 + p2) / 3, (p1 + 2 * p2) / 3, (2 * p2 + p3) / 3, (p2 + 2 * p3) / 3,
                    (2 * p3 + p1) / 3, (p3 + 2 * p1) / 3, (p1 + p2 + p3) / 3}};
  for (std::size_t i = 3; i < 10; ++i) {
    patch.control[i] += w.ordinates[i] * w.normal;
  }
  return patch;
}

Vec3 watertight_edge_point(const Vec3& here, const Vec3& there, const std::array<Vec3, 2>& normals) {
  const Vec3 edge = there - here;
  const double squared_length = edge.squaredNorm();
  const Vec3 mean = (normals[0] + normals[1]).normalized();
  Vec3 tangent = edge - mean.dot(edge) * mean;
  const Vec3 difference = normals[0] - normals[1];
  if (const double squared = difference.squaredNorm(); squared > 0) {
    // Its direction is at right angles to the mean's: one after the other is the projection on both planes.
    const double along = difference.dot(edge);
    const double across = along * along / (squared * squared_length);
    const double share = std::min(1.0, squared / crease_squared) * std::clamp(2 - 4 * across, 0.0, 1.0);
    tangent -= share * along / squared * difference;
  }
  const double cosine = std::clamp(tangent.norm() / std::sqrt(squared_length), 1e-9, 1.0);
  return here + 2 / (3 * (1 + cosine) * cosine) * tangent;
}

NormalsAcross own_normals_across(const std::array<Vec3, 3>& normals) {
  return {{{normals[0], normals[1]}, {normals[1], normals[2]}, {normals[2], normals[0]}}};
}

CubicPatch watertight_patch(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals,
                            const NormalsAcross& across) {
  CubicPatch patch;
  auto& p = patch.control;
  std::array<Vec3, 3> edges;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3;
    p[i] = corners[i];
    p[3 + 2 * i] = watertight_edge_point(corners[i], corners[next], {normals[i], across[i][0]});
    p[4 + 2 * i] = watertight_edge_point(corners[next], corners[i], {normals[next], across[i][1]});
    edges[i] = corners[next] - corners[i];
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::array<double, 10> coordinate{};
    for (std::size_t i = 0; i < 9; ++i) {
      coordinate[i] = p[i][axis] - corners[0][axis];
    }
    p[9][axis] = corners[0][axis] + averaged_centre(edges, coordinate);
  }
  return patch;
}

CubicPatch smooth_patch(Patch kind, const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  return kind == Patch::comas ? comas_patch(corners, normals)
                              : watertight_patch(corners, normals, own_normals_across(normals));
}

void require_valid(const ShellMesh& shell) {
  require_valid(shell.vertices, shell.triangles);
  require_normals(shell);
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      if (!shell.normal(t, c).allFinite()) {
        throw InputError(fmt::format("the normal at vertex {} of triangle {} is not finite", shell.triangles[t][c], t));
      }
    }
  }
}

void require_shells(const ShellMesh& shell) {
  require_valid(shell);
  if (shell.triangles.empty()) {
    throw InputError("the shell mesh has no triangles");
  }
}

std::vector<CubicPatch> curved_patches(const ShellMesh& shell) {
  require_valid(shell);
  const bool creased = shell.patch == Patch::watertight && !shell.corner_normals.empty();
  std::vector<std::array<Index, 3>> beside;
  if (creased) {
    const TriangleMesh flat = flat_facets(shell);
    beside = neighbours(flat, incidence(flat));
  }
  std::vector<CubicPatch> patches(shell.triangles.size());
  parallel_for_blocks(patches.size(), patches_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto corners = corners_of(shell, t);
      const auto normals = normals_of(shell, t);
      if (!creased) {
        patches[t] = smooth_patch(shell.patch, corners, normals);
        continue;
      }
      auto across = own_normals_across(normals);
      for (std::size_t k = 0; k < 3; ++k) {
        const Index other = beside[t][k];
        for (std::size_t l = 0; other != no_neighbour && l < 3; ++l) {
          const Index v = shell.triangles[other][l];
          if (v == shell.triangles[t][k]) {
            across[k][0] = shell.normal(other, l);
          } else if (v == shell.triangles[t][(k + 1) % 3]) {
            across[k][1] = shell.normal(other, l);
          }
        }
      }
      patches[t] = watertight_patch(corners, normals, across);
    }
  });
  return patches;
}

double normal_agreement(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals) {
  const Vec3 n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).stableNormalized();
  if (!(n.squaredNorm() > 0.5)) {
    return -1;
  }
  return std::min({n.dot(normals[0]), n.dot(normals[1]), n.dot(normals[2])});
}

double normal_agreement(const ShellMesh& shell, std::size_t triangle) {
  if (triangle >= shell.triangles.size()) {
    throw InputError(fmt::format("there is no triangle {}, but {}", triangle, shell.triangles.size()));
  }
  require_corners(shell.vertices.size(), {&shell.triangles[triangle], 1});
  require_normals(shell);
  return normal_agreement(corners_of(shell, triangle), normals_of(shell, triangle));
}

bool has_area(const std::array<Vec3, 3>& corners) {
  const Vec3 u = corners[1] - corners[0], v = corners[2] - corners[0];
  return u.cross(v).norm() > least_height * std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
}

std::size_t count_without_area(const ShellMesh& shell) {
  require_valid(shell.vertices, shell.triangles);
  std::size_t count = 0;
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    count += has_area(corners_of(shell, t)) ? 0 : 1;
  }
  return count;
}

void require_fit(const ShellMesh& shell, const std::string& name) {
  const auto is_unit = [](const Vec3& n) { return std::abs(n.squaredNorm() - 1) < 1e-6; };  // false for NaN
  naming(name, [&] { require_normals(shell); });
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const Index v = shell.triangles[t][c];
      if (v >= shell.vertices.size()) {
        throw InputError(fmt::format("{}: triangle {} names vertex {} of {}", name, t, v, shell.vertices.size()));
      }
      const Vec3& p = shell.vertices[v];
      if (!p.allFinite()) {
        throw InputError(fmt::format("{}: vertex {} of triangle {} has a coordinate that is not finite", name, v, t));
      }
      if (!is_unit(shell.normal(t, c))) {
        throw InputError(fmt::format("{}: the normal at vertex {} ({:.6g}, {:.6g}, {:.6g} mm) is not of unit length",
                                     name, v, p.x(), p.y(), p.z()));
      }
    }
    const auto corners = corners_of(shell, t);
    const Vec3 at = (corners[0] + corners[1] + corners[2]) / 3;
    if (!has_area(corners)) {
      throw InputError(fmt::format("{}: triangle {} at ({:.6g}, {:.6g}, {:.6g}) mm has no area; remove it", name, t,
                                   at.x(), at.y(), at.z()));
    }
    const double agreement = normal_agreement(shell, t);
    if (!(agreement >= least_normal_agreement)) {
      if (agreement < 0) {
        throw InputError(
            fmt::format("{}: triangle {} at ({:.6g}, {:.6g}, {:.6g}) mm has a normal N that opposes it "
                        "(N·n = {:.3g}); turn the normal or the triangle round",
                        name, t, at.x(), at.y(), at.z(), agreement));
      }
      throw InputError(
          fmt::format("{}: triangle {} at ({:.6g}, {:.6g}, {:.6g}) mm has a normal N nearly in its "
                      "plane (N·n = {:.3g}, at least {} is needed); relax the mesh again",
                      name, t, at.x(), at.y(), at.z(), agreement, least_normal_agreement));
    }
  }
}

double flatness(const CubicPatch& patch, const std::array<Vec2, 3>& piece) {
  // Interpolation error = -3 sum_edges l_i l_j S_e, S_e the second difference along the edge at some points of the
  // piece, each at most its largest over the patch.
  std::array<double, 3> differences{};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2 along = piece[(k + 1) % 3] - piece[k];
    const Vec3 edge(-along.sum(), along[0], along[1]);
    differences[k] = largest_norm(second_difference(patch.control, edge, edge));
  }
  return 3 * largest_product_sum(differences[0], differences[1], differences[2]);
}

double flatness(const CubicPatch& patch, int level) { return coarsest_flatness(patch) / (real(level) * real(level)); }

double pieces_for(const CubicPatch& patch, double deviation) {
  return std::max(1.0, std::ceil(std::sqrt(coarsest_flatness(patch) / deviation * (1 + 1e-12))));
}

void require_few_triangles(double triangles, std::size_t most, double deviation) {
  if (!(triangles <= real(most))) {
    throw RequirementError(
        fmt::format("the curved surface within {:.3g} mm would need more than {} fine triangles; "
                    "allow a larger deviation",
                    deviation, most));
  }
}

double tessellation_size(const ShellMesh& shell, double deviation) {
  require_positive(deviation, "the deviation of the fine triangles");
  double total = 0;
  for (const CubicPatch& patch : curved_patches(shell)) {
    total += std::pow(pieces_for(patch, deviation), 2);
  }
  return total;
}

Tessellation tessellate(const ShellMesh& shell, double deviation, std::size_t most_triangles) {
  require_positive(deviation, "the deviation of the fine triangles");
  const auto patches = curved_patches(shell);
  std::vector<int> levels(patches.size());
  double total = 0;
  for (std::size_t t = 0; t < patches.size(); ++t) {
    const double level = pieces_for(patches[t], deviation);
    total += level * level;
    require_few_triangles(total, most_triangles, deviation);
    levels[t] = truncated<int>(level);
  }
  return tessellate_by(shell, patches, levels);
}

Tessellation tessellate_uniformly(const ShellMesh& shell, int level) {
  if (level < 1 || level > most_pieces_per_edge) {
    throw InputError(fmt::format("{} pieces per edge: choose 1 to {}", level, most_pieces_per_edge));
  }
  const auto patches = curved_patches(shell);
  return tessellate_by(shell, patches, std::vector<int>(patches.size(), level));
}

double curved_volume(const ShellMesh& shell) {
  // A patch, its facet, and the plane walls between their edges enclose the integral of w. Between the walls of two
  // adjacent patches and the ruled surface over their edge curves lies a wedge: at each point of the edge the triangle
  // 0, w_a n_a, w_b n_b. The facets, these integrals and these wedges sum up to the whole.
  struct Side {
    double from_start, from_end;  // the two inner ordinates along the edge, as its first triangle runs
    Vec3 normal;
  };
  require_valid(shell);
  if (shell.triangles.empty()) {
    return 0;
  }
  const Vec3 origin = shell.vertices[shell.triangles[0][0]];
  std::unordered_map<std::uint64_t, Side> half_edges;
  half_edges.reserve(3 * shell.triangles.size());
  const std::vector<CubicPatch> watertight =
      shell.patch == Patch::watertight ? curved_patches(shell) : std::vector<CubicPatch>{};
  double volume = 0;
  const auto key = [](Index from, Index to) { return (std::uint64_t{from} << 32) | to; };
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    Deflection w{{}, Vec3::Zero()};  // between watertight patches there is no gap
    if (!watertight.empty()) {
      volume += flux_volume(watertight[t], origin);
    } else {
      const auto corners = corners_of(shell, t);
      w = comas_deflection(corners, normals_of(shell, t));
      const Vec3 p1 = corners[0] - origin, p2 = corners[1] - origin, p3 = corners[2] - origin;
      double mean = 0;
      for (const double b : w.ordinates) {
        mean += b / 10;
      }
      volume += p1.dot(p2.cross(p3)) / 6 + mean * (p2 - p1).cross(p3 - p1).norm() / 2;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const Side side{w.ordinates[3 + 2 * i], w.ordinates[4 + 2 * i], w.normal};
      if (!half_edges.emplace(key(shell.triangles[t][i], shell.triangles[t][(i + 1) % 3]), side).second) {
        throw InputError("an edge has more than two triangles, or two that face opposite ways: there is no volume");
      }
    }
  }
  for (const auto& [edge, a] : half_edges) {
    const auto from = narrow<Index>(edge >> 32);
    const auto to = static_cast<Index>(edge);
    const auto opposite = half_edges.find(key(to, from));
    if (opposite == half_edges.end()) {
      throw InputError("the surface is open: it encloses no volume");
    }
    if (from < to) {
      const Side& b = opposite->second;
      // Integral of w_a w_b over the unit edge; b runs the other way.
      const double product = (a.from_start * b.from_end + a.from_end * b.from_start) * 3 / 35 +
                             (a.from_start * b.from_start + a.from_end * b.from_end) * 9 / 140;
      volume += product * a.normal.cross(b.normal).dot(shell.vertices[to] - shell.vertices[from]) / 2;
    }
  }
  return volume;
}

}  // namespace tunica
