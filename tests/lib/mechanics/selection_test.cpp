// What a region selects of triangles and edges is its area and its length, wherever the mesh has its nodes.
#include "tunica/mechanics/model/selection.hpp"

#include "benchmarks.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

namespace tunica {
namespace {

using namespace benchmarks;
using testing::Each;
using testing::HasSubstr;

/// A square of side 1.
ShellBody plate(int cells) {
  return flat_body(make_grid(cells, cells, [](double u, double v) { return Vec3(u, v, 0); }).mesh, 1000, 0.3, 0.01);
}

double selected_area(const ShellBody& body, const Selection& where) {
  const std::vector<double> shares = shares_of(SelectableBody(body), where, "here");
  double area = 0;
  for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = body.mesh.triangles[t];
    const auto& x = body.mesh.vertices;
    area += share_of(shares, t) * triangle_area(x[a], x[b], x[c]);
  }
  return area;
}

double selected_length(const ShellBody& body, const Selection& where) {
  const SelectedEdges selected = edges_of(SelectableBody(body), where, "here");
  double length = 0;
  for (std::size_t i = 0; i < selected.edges.size(); ++i) {
    const auto& [a, b] = selected.edges[i];
    length += selected.shares[i] * (body.mesh.vertices[a] - body.mesh.vertices[b]).norm();
  }
  return length;
}

TEST(Shares, OfARegionAddUpToItsArea) {
  constexpr double pi = std::numbers::pi;
  for (const int cells : {1, 3, 16}) {
    const ShellBody body = plate(cells);
    EXPECT_NEAR(selected_area(body, AllNodes{}), 1, 1e-12);
    EXPECT_NEAR(selected_area(body, HalfSpaceNodes{0, 0.37, false}), 0.63, 1e-12);
    EXPECT_NEAR(selected_area(body, HalfSpaceNodes{1, 0.37, true}), 0.37, 1e-12);
    EXPECT_NEAR(selected_area(body, BoxNodes{Vec3(0.13, 0.21, -1), Vec3(0.77, 2, 1)}), 0.64 * 0.79, 1e-12);
    EXPECT_NEAR(selected_area(body, SphereNodes{Vec3(0.5, 0.4, 0.1), 0.3}), 0.08 * pi, 1e-12);
    EXPECT_NEAR(selected_area(body, SphereNodes{Vec3(1, 1, 0), 0.3}), 0.0225 * pi, 1e-12);
    EXPECT_NEAR(selected_area(body, SphereNodes{Vec3(0.43, 0.36, 0), 0.01}), 1e-4 * pi, 1e-12) << "within a triangle";
  }
}

double area_of(const CubicPatch& patch) {
  constexpr int pieces = 24;
  double area = 0;
  for (int i = 0; i < pieces; ++i) {
    for (int j = 0; i + j < pieces; ++j) {
      const auto point = [&](int k, int l) {
        return patch.point(Vec2(static_cast<double>(k) / pieces, static_cast<double>(l) / pieces));
      };
      area += triangle_area(point(i, j), point(i + 1, j), point(i, j + 1));
      area += i + j + 1 < pieces ? triangle_area(point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)) : 0;
    }
  }
  return area;
}

/// The cap above z of a sphere of radius R has the area 2 pi R (R - z), whatever rises above the facets.
TEST(Shares, OfCurvedShellsAreThoseOfTheirPatches) {
  constexpr double radius = 30;
  ShellBody ball = flat_body(make_sphere(radius, 2), 1000, 0.3, 1);
  ball.curved = true;
  const std::vector<CubicPatch> patches = curved_patches(ball.mesh);
  for (const double height : {0.5, 1.0, 4.0, 20.0}) {
    const std::vector<double> shares =
        shares_of(SelectableBody(ball), HalfSpaceNodes{2, radius - height, false}, "here");
    double area = 0;
    for (std::size_t t = 0; t < patches.size(); ++t) {
      area += share_of(shares, t) * area_of(patches[t]);
    }
    const double cap = 2 * std::numbers::pi * radius * height;
    EXPECT_NEAR(area, cap, 0.03 * cap) << height;  // the whole of so few shells lacks 1.5 %
  }
}

TEST(Shares, AreWholeWhereABorderLiesOnNodes) {
  const ShellBody body = plate(4);
  const HalfSpaceNodes half{0, 0.5, true};
  for (const double share : shares_of(SelectableBody(body), half, "here")) {
    EXPECT_TRUE(share == 0 || share == 1) << share;
  }
  EXPECT_THAT(shares_of(SelectableBody(body), SphereNodes{Vec3(0.5, 0.5, 0), 2}, "here"), Each(1));
}

TEST(Shares, OfNodesAreWholeTriangles) {
  const ShellBody body = plate(2);
  const auto& [a, b, c] = body.mesh.triangles[3];
  const std::vector<double> shares = shares_of(SelectableBody(body), ListedNodes{{a, b, c}}, "here");
  for (std::size_t t = 0; t < shares.size(); ++t) {
    EXPECT_EQ(shares[t], t == 3 ? 1 : 0);
  }
}

TEST(Shares, OfEdgesAddUpToTheLength) {
  for (const int cells : {1, 5, 12}) {
    const ShellBody body = plate(cells);
    EXPECT_NEAR(selected_length(body, BoxNodes{Vec3(0.95, 0.1, -1), Vec3(2, 0.9, 1)}), 0.8, 1e-12);
    EXPECT_NEAR(selected_length(body, HalfSpaceNodes{0, 1, false}), 1, 1e-12) << "an end of the other sides only";
    EXPECT_NEAR(selected_length(body, SphereNodes{Vec3(0, 0, 0), 0.3}), 0.6, 1e-12);
    EXPECT_NEAR(selected_length(body, BoundaryNodes{}), 4, 1e-12);
  }
}

TEST(Shares, OfNothingAreRefused) {
  const ShellBody body = plate(2);
  const auto said = [&](const Selection& where, bool of_edges) -> std::string {
    try {
      const SelectableBody on(body);
      of_edges ? (void)edges_of(on, where, "here") : (void)shares_of(on, where, "here");
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  EXPECT_THAT(said(HalfSpaceNodes{0, 2, false}, false), HasSubstr("here: selects no node: the body reaches from"));
  EXPECT_THAT(said(HalfSpaceNodes{0, 1, false}, false), HasSubstr("nothing of the surface lies in it but 3 node(s)"));
  EXPECT_THAT(said(SphereNodes{Vec3(0.5, 0.5, 0), 0.1}, true), HasSubstr("no boundary edge has both its ends"));
  const ShellBody ball = flat_body(make_sphere(1, 0), 1000, 0.3, 0.01);
  const SelectableBody closed(ball);
  EXPECT_THAT(
      [&] {
        try {
          (void)edges_of(closed, AllNodes{}, "here");
          return std::string();
        } catch (const InputError& error) {
          return std::string(error.what());
        }
      }(),
      HasSubstr("the body is closed"));
}

}  // namespace
}  // namespace tunica
