#include "tunica/shell/patch/curved_surface.hpp"

#include "shell/families.hpp"
#include "tunica/core/error.hpp"
#include "tunica/shell/patch/shape_function.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace tunica {
namespace {

using ::testing::HasSubstr;
using testing::sphere_shell;

struct Facet {
  std::array<Vec3, 3> corners;
  std::array<Vec3, 3> normals;
};

std::vector<Facet> facets() {
  const auto tilted = [](const Facet& f, const std::array<Vec2, 3>& tilts) {
    Facet out = f;
    const Vec3 n = (f.corners[1] - f.corners[0]).cross(f.corners[2] - f.corners[0]).normalized();
    const Vec3 x = (f.corners[1] - f.corners[0]).normalized();
    for (std::size_t i = 0; i < 3; ++i) {
      out.normals[i] = (n + tilts[i].x() * x + tilts[i].y() * n.cross(x)).normalized();
    }
    return out;
  };
  const std::array<Vec2, 3> tilts{Vec2(0.3, -0.2), Vec2(-0.4, 0.1), Vec2(0.25, 0.5)};
  return {tilted({{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0.4, 0.9, 0)}, {}}, tilts),
          tilted({{Vec3(5, 1, 2), Vec3(7, -1, 3), Vec3(4, 4, 9)}, {}}, tilts),
          tilted({{Vec3(1, 1, 0), Vec3(2, 1, 0), Vec3(4, 1.05, 0.01)}, {}}, tilts)};
}

TEST(CurvedSurface, BezierFormIsTheShapeFunctionAveragedOverTheFirstVertex) {
  for (const Facet& facet : facets()) {
    const CubicPatch patch = comas_patch(facet.corners, facet.normals);
    for (double b2 = 0; b2 <= 1; b2 += 0.125) {
      for (double b3 = 0; b2 + b3 <= 1; b3 += 0.125) {
        const Vec3 flat = (1 - b2 - b3) * facet.corners[0] + b2 * facet.corners[1] + b3 * facet.corners[2];
        double w = 0;
        Vec3 n;
        for (std::size_t first = 0; first < 3; ++first) {
          const std::array<std::size_t, 3> order{first, (first + 1) % 3, (first + 2) % 3};
          const Vec3& origin = facet.corners[order[0]];
          const Vec3 to2 = facet.corners[order[1]] - origin, to3 = facet.corners[order[2]] - origin;
          n = to2.cross(to3).normalized();
          const Vec3 x = to2.normalized(), y = n.cross(x);
          Vector9 u;
          for (std::size_t i = 0; i < 3; ++i) {
            const Vec3& normal = facet.normals[order[i]];
            u.segment<3>(static_cast<Eigen::Index>(3 * i)) << 0, -normal.dot(y) / normal.dot(n),
                normal.dot(x) / normal.dot(n);
          }
          const Vector9 c = shape_coefficients({to2.norm(), to3.dot(x), to3.dot(y)}, u);
          w += c.dot(monomials((flat - origin).dot(x), (flat - origin).dot(y))) / 3;
        }
        EXPECT_LT((patch.point({b2, b3}) - (flat + w * n)).norm(), 1e-12 * (1 + flat.norm()));
      }
    }
  }
}

TEST(CurvedSurface, DoesNotDependOnTheOrderOfTheVertices) {
  for (const Facet& f : facets()) {
    const CubicPatch a = comas_patch(f.corners, f.normals);
    const CubicPatch b =
        comas_patch({f.corners[1], f.corners[2], f.corners[0]}, {f.normals[1], f.normals[2], f.normals[0]});
    for (const Vec2& p : {Vec2(0.2, 0.3), Vec2(0.7, 0.1), Vec2(1.0 / 3, 1.0 / 3)}) {
      EXPECT_LT((a.point(p) - b.point({p[1], 1 - p[0] - p[1]})).norm(), 1e-12);
    }
  }
}

TEST(CurvedSurface, PatchTouchesTheCornersWithTheGivenNormals) {
  for (const Facet& f : facets()) {
    const CubicPatch patch = comas_patch(f.corners, f.normals);
    const std::array<Vec2, 3> parameters{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_LT((patch.point(parameters[i]) - f.corners[i]).norm(), 1e-14);
      EXPECT_LT((patch.normal(parameters[i]) - f.normals[i]).norm(), 1e-12);
    }
  }
}

TEST(CurvedSurface, DerivativesAgreeWithDifferences) {
  const Facet f = facets()[1];
  const CubicPatch patch = comas_patch(f.corners, f.normals);
  const Vec2 b(0.3, 0.25);
  const double e = 1e-5;
  for (int i = 0; i < 2; ++i) {
    const Vec2 step = e * Vec2::Unit(i);
    const Vec3 difference = (patch.point(b + step) - patch.point(b - step)) / (2 * e);
    EXPECT_LT((patch.tangents(b)[static_cast<std::size_t>(i)] - difference).norm(), 1e-8);
    for (int j = i; j < 2; ++j) {
      const Vec3 second = (patch.tangents(b + step)[static_cast<std::size_t>(j)] -
                           patch.tangents(b - step)[static_cast<std::size_t>(j)]) /
                          (2 * e);
      EXPECT_LT((patch.second_derivatives(b)[static_cast<std::size_t>(i + j)] - second).norm(), 1e-7);
    }
  }
}

TEST(CurvedSurface, AFlatMeshStaysFlatAndTakesOneTriangleEach) {
  ShellMesh flat{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {3, Vec3(0, 0, 1)}, {}, Patch::comas};
  const Tessellation fine = tessellate(flat, 1e-9);
  EXPECT_EQ(fine.mesh.triangles.size(), 1u);
  EXPECT_LT(fine.deviation, 1e-15);
}

/// Largest distance between a patch and its fine triangles at equal parameters, densely sampled.
double sampled_deviation(const ShellMesh& shell, const Tessellation& fine) {
  double worst = 0;
  for (std::size_t f = 0; f < fine.mesh.triangles.size(); ++f) {
    const auto& v = fine.mesh.triangles[f];
    const CubicPatch patch = curved_patches(shell)[fine.shell[f]];
    for (int i = 0; i <= 10; ++i) {
      for (int j = 0; i + j <= 10; ++j) {
        const double l2 = i / 10.0, l3 = j / 10.0, l1 = 1 - l2 - l3;
        const Vec2 b = l1 * fine.barycentric[v[0]] + l2 * fine.barycentric[v[1]] + l3 * fine.barycentric[v[2]];
        const Vec3 flat = l1 * fine.mesh.vertices[v[0]] + l2 * fine.mesh.vertices[v[1]] + l3 * fine.mesh.vertices[v[2]];
        worst = std::max(worst, (patch.point(b) - flat).norm());
      }
    }
  }
  return worst;
}

TEST(CurvedSurface, CertifiedDeviationHoldsAndIsTight) {
  std::vector<ShellMesh> shells{sphere_shell(0), sphere_shell(1)};
  for (const Facet& f : facets()) {
    shells.push_back(
        {{f.corners.begin(), f.corners.end()}, {{0, 1, 2}}, {f.normals.begin(), f.normals.end()}, {}, Patch::comas});
  }
  for (const ShellMesh& shell : shells) {
    for (const double wanted : {1e-1, 1e-2, 1e-3, 1e-4}) {
      const Tessellation fine = tessellate(shell, wanted);
      EXPECT_LE(fine.deviation, wanted);
      const double sampled = sampled_deviation(shell, fine);
      EXPECT_LE(sampled, fine.deviation * (1 + 1e-12) + 1e-15);
      EXPECT_GE(sampled, 0.3 * fine.deviation);
    }
    const Tessellation uniform = tessellate_uniformly(shell, 5);
    EXPECT_EQ(uniform.mesh.triangles.size(), 25 * shell.triangles.size());
    EXPECT_LE(sampled_deviation(shell, uniform), uniform.deviation * (1 + 1e-12));
  }
}

TEST(CurvedSurface, ATessellationThatCannotFitInMemoryIsRefused) {
  EXPECT_THROW(tessellate(sphere_shell(0), 1e-15), RequirementError);
}

/// log2 of the ratio of the largest | |p| - 1 | between two sphere meshes.
double sphere_error(int times, bool curved) {
  ShellMesh shell = sphere_shell(times);
  double worst = 0;
  if (curved) {
    for (const Vec3& p : tessellate_uniformly(shell, 12).mesh.vertices) {
      worst = std::max(worst, std::abs(p.norm() - 1));
    }
  } else {
    for (const auto& t : shell.triangles) {
      worst = std::max(worst, 1 - (shell.vertices[t[0]] + shell.vertices[t[1]] + shell.vertices[t[2]]).norm() / 3);
    }
  }
  return worst;
}

TEST(CurvedSurface, ErrorOnASphereFallsFasterThanTheThirdPowerOfTheSizeAndFlatErrorWithTheSecond) {
  for (int times = 1; times <= 3; ++times) {
    const double curved_rate = std::log2(sphere_error(times, true) / sphere_error(times + 1, true));
    const double flat_rate = std::log2(sphere_error(times, false) / sphere_error(times + 1, false));
    EXPECT_GT(curved_rate, 3.0);
    EXPECT_LT(curved_rate, 4.5);
    EXPECT_NEAR(flat_rate, 2, 0.2);
  }
}

double cylinder_error(int around) {
  const TriangleMesh mesh = testing::cylinder(around, around / 2, 1, 2);
  ShellMesh shell{mesh.vertices, mesh.triangles, {}, {}, Patch::comas};
  for (const Vec3& p : mesh.vertices) {
    shell.normals.emplace_back(p.x(), p.y(), 0);
  }
  double worst = 0;
  for (const Vec3& p : tessellate_uniformly(shell, 12).mesh.vertices) {
    worst = std::max(worst, std::abs(std::hypot(p.x(), p.y()) - 1));
  }
  return worst;
}

TEST(CurvedSurface, ErrorOnACylinderFallsAtLeastWithTheThirdPowerOfTheSize) {
  for (const int around : {8, 16}) {
    const double rate = std::log2(cylinder_error(around) / cylinder_error(2 * around));
    EXPECT_GT(rate, 2.9) << around;
    EXPECT_LT(rate, 4.5) << around;
  }
}

/// Volume of a closed triangle soup about a far origin.
double soup_volume(const std::vector<std::array<Vec3, 3>>& soup, const Vec3& origin) {
  double volume = 0;
  for (const auto& t : soup) {
    volume += (t[0] - origin).dot((t[1] - origin).cross(t[2] - origin)) / 6;
  }
  return volume;
}

ShellMesh rough_ball() {
  ShellMesh shell = sphere_shell(1);
  for (std::size_t i = 0; i < shell.vertices.size(); ++i) {
    const double k = static_cast<double>(i);
    shell.vertices[i] *= 1 + 0.1 * std::sin(3 * k);
    shell.normals[i] = (shell.normals[i] + 0.3 * Vec3(std::sin(k), std::cos(2 * k), std::sin(5 * k))).normalized();
  }
  return shell;
}

/// Patches and the ruled gaps between them, cut into level pieces per edge.
std::vector<std::array<Vec3, 3>> patches_and_gaps(const ShellMesh& shell, int level) {
  const Tessellation fine = tessellate_uniformly(shell, level);
  std::vector<std::array<Vec3, 3>> soup;
  for (const auto& v : fine.mesh.triangles) {
    soup.push_back({fine.mesh.vertices[v[0]], fine.mesh.vertices[v[1]], fine.mesh.vertices[v[2]]});
  }
  std::map<std::pair<Index, Index>, std::vector<Vec3>> curves;
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    const CubicPatch patch = curved_patches(shell)[t];
    const std::array<Vec2, 3> at{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
    for (std::size_t i = 0; i < 3; ++i) {
      auto& curve = curves[{shell.triangles[t][i], shell.triangles[t][(i + 1) % 3]}];
      for (int k = 0; k <= level; ++k) {
        const double s = static_cast<double>(k) / level;
        curve.push_back(patch.point((1 - s) * at[i] + s * at[(i + 1) % 3]));
      }
    }
  }
  for (const auto& [edge, a] : curves) {
    if (edge.first < edge.second) {
      const auto& b = curves.at({edge.second, edge.first});
      for (std::size_t k = 0; k + 1 < a.size(); ++k) {  // patch a has its edge forward, so the gap has it backward
        const Vec3 &a0 = a[k], &a1 = a[k + 1], &b0 = b[b.size() - 1 - k], &b1 = b[b.size() - 2 - k];
        const Vec3 middle = (a0 + a1 + b0 + b1) / 4;
        soup.insert(soup.end(), {{a1, a0, middle}, {a0, b0, middle}, {b0, b1, middle}, {b1, a1, middle}});
      }
    }
  }
  return soup;
}

TEST(CurvedSurface, VolumeIsThatOfThePatchesAndTheRuledGapsBetweenThem) {
  const ShellMesh shell = rough_ball();
  const auto soup = patches_and_gaps(shell, 40);
  const double fine = soup_volume(soup, Vec3(0, 0, 0));
  EXPECT_NEAR(fine, soup_volume(soup, Vec3(10, 5, 2)), 1e-9);  // it is closed
  const double coarse = soup_volume(patches_and_gaps(shell, 20), Vec3(0, 0, 0));
  EXPECT_NEAR(curved_volume(shell), fine + (fine - coarse) / 3, 1e-7);  // the cut into pieces errs as level^-2
}

TEST(CurvedSurface, VolumeDoesNotDependOnTheOrigin) {
  ShellMesh shell = rough_ball();
  const double volume = curved_volume(shell);
  for (Vec3& p : shell.vertices) {
    p += Vec3(1000, -2000, 500);
  }
  EXPECT_NEAR(curved_volume(shell), volume, 1e-11 * volume);
}

TEST(CurvedSurface, VolumeOfASphereConvergesWithTheFourthPowerOfTheSize) {
  const double exact = 4 * M_PI / 3;
  for (int times = 1; times <= 2; ++times) {
    const double rate =
        std::log2((exact - curved_volume(sphere_shell(times))) / (exact - curved_volume(sphere_shell(times + 1))));
    EXPECT_GT(rate, 3.5);
    EXPECT_LT(rate, 4.5);
  }
  EXPECT_NEAR(curved_volume(sphere_shell(3)), exact, 2e-5 * exact);
}

TEST(CurvedSurface, VolumeOfAnOpenOrInconsistentSurfaceIsRefused) {
  ShellMesh shell = sphere_shell(1);
  shell.triangles.pop_back();
  EXPECT_THROW(curved_volume(shell), InputError);
  shell = sphere_shell(1);
  std::swap(shell.triangles[3][0], shell.triangles[3][1]);
  shell.normals = sphere_shell(1).normals;
  EXPECT_THROW(curved_volume(shell), InputError);
}

void expect_unfit(const ShellMesh& shell, const std::string& part) {
  try {
    require_fit(shell, "x.ply");
    FAIL() << "accepted: " << part;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(part));
    EXPECT_THAT(error.what(), HasSubstr("x.ply"));
  }
}

TEST(CurvedSurface, UnfitShellMeshesAreRefusedWithTheirPlace) {
  const ShellMesh good = sphere_shell(1);
  EXPECT_NO_THROW(require_fit(good, "x.ply"));
  ShellMesh bad = good;
  bad.normals.clear();
  expect_unfit(bad, "no normals");
  bad = good;
  bad.normals[3] *= 1.01;
  expect_unfit(bad, "vertex 3");
  bad = good;
  bad.vertices[2].x() = NAN;
  expect_unfit(bad, "not finite");
  bad = good;
  bad.triangles[5][1] = 1000;
  expect_unfit(bad, "triangle 5");
  bad = good;
  bad.triangles[5][1] = bad.triangles[5][0];
  expect_unfit(bad, "triangle 5");
  expect_unfit(bad, "has no area");
  bad = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {3, Vec3(0, 0, 1)}, {}, Patch::comas};
  bad.normals[1] = Vec3(0, 0, -1);
  expect_unfit(bad, "opposes it");
  for (const double agreement : {0.19, 0.21}) {
    bad = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {3, Vec3(0, 0, 1)}, {}, Patch::comas};
    bad.normals[1] = Vec3(0, std::sqrt(1 - agreement * agreement), agreement);
    if (agreement < 0.2) {
      expect_unfit(bad, "triangle 0");
    } else {
      EXPECT_NO_THROW(require_fit(bad, "x.ply"));
    }
  }
}

}  // namespace
}  // namespace tunica
