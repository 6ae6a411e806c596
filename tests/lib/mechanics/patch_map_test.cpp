// From the nodes to the points of the curved surface, and back with forces.

#include "benchmarks.hpp"
#include "random.hpp"
#include "tunica/mechanics/contact/surface_faces.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/shell/patch/shape_function.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace tunica {
namespace {

using namespace benchmarks;

using Points = PatchMap::Points;
using Matrix27 = PatchMap::Matrix27;
using Vector27 = Eigen::Matrix<double, 27, 1>;

class RandomSample : public Random {
public:
  RandomSample() : Random(5) {}

  Points points(double most) {
    return Points::NullaryExpr([&](Eigen::Index, Eigen::Index) { return (*this)(most); });
  }
  Vec2 barycentric() {
    const double u = std::abs((*this)(1)), v = std::abs((*this)(1));
    return u + v > 1 ? Vec2(1 - u, 1 - v) : Vec2(u, v);
  }
};

Configuration at_rest(std::size_t nodes) {
  return {std::vector<Vec3>(nodes, Vec3::Zero()),
          std::vector<Eigen::Quaterniond>(nodes, Eigen::Quaterniond::Identity())};
}

/// How far the normals of a triangle and those across its edges are apart.
enum class Edges { smooth, between, creases };

constexpr std::array<Edges, 3> all_edges{Edges::smooth, Edges::between, Edges::creases};

/// One face of edges of about 1, in a random place, and nodes that have moved.
struct Sample {
  std::vector<Vec3> reference;
  SurfaceFace face;
  Configuration configuration;
};

Sample random_sample(RandomSample& random, Edges edges, double spin = 0.3) {
  Sample s;
  const Eigen::Quaterniond turn = random.rotation(1.7);
  const Vec3 place = random.vector(3);
  for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0.4, 0.9, 0)}) {
    s.reference.push_back(place + turn * (corner + random.vector(0.15)));
  }
  SurfaceFace& face = s.face;
  face.nodes = {0, 1, 2};
  face.curved = true;
  const auto& x = s.reference;
  const Vec3 facet = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
  for (Vec3& n : face.normals) {
    n = (facet + random.vector(0.25)).normalized();
  }
  face.across = own_normals_across(face.normals);
  for (std::size_t k = 0; edges != Edges::smooth && k < 3; ++k) {
    const Vec3 along = (x[(k + 1) % 3] - x[k]).normalized();
    for (Vec3& n : face.across[k]) {  // 20 degrees is a crease
      const double angle = edges == Edges::creases ? 0.7 + random(0.2) : 0.17 + random(0.15);
      n = Eigen::AngleAxisd(angle, along) * (n + random.vector(0.05)).normalized();
    }
  }
  const std::array<Vec3, 3> sides{x[1] - x[0], x[2] - x[1], x[0] - x[2]};
  for (std::size_t k = 0; k < 9; ++k) {
    std::array<double, 10> unit{};
    unit[k] = 1;
    face.centre[k] = averaged_centre(sides, unit);
  }
  s.configuration = at_rest(3);
  const Eigen::Quaterniond moved = random.rotation(1.5);
  for (std::size_t k = 0; k < 3; ++k) {
    s.configuration.displacement[k] = moved * (x[k] + random.vector(0.1)) - x[k];
    s.configuration.rotation[k] = random.rotation(spin) * moved;
  }
  return s;
}

PatchMap map_of(const Sample& s) {
  PatchMap map(s.face, s.reference, s.configuration);
  map.linearise();
  return map;
}

/// Displacements and spins added.
Sample advanced(const Sample& s, const Vector18& step) {
  Sample result = s;
  for (int k = 0; k < 3; ++k) {
    result.configuration.displacement[k] += step.segment<3>(6 * k);
    result.configuration.rotation[k] = exponential(step.segment<3>(6 * k + 3)) * s.configuration.rotation[k];
  }
  return result;
}

template <typename Check>
void for_all_samples(const Check& check) {
  RandomSample random;
  for (const Edges edges : all_edges) {
    SCOPED_TRACE("edges: " + std::to_string(static_cast<int>(edges)));
    for (int i = 0; i < 40; ++i) {
      check(random_sample(random, edges), random);
    }
  }
}

CubicPatch patch_at(const std::vector<Vec3>& x, const std::array<Vec3, 3>& normals, const NormalsAcross& across) {
  return watertight_patch({x[0], x[1], x[2]}, normals, across);
}

TEST(PatchMap, AtTheReferenceItIsTheWatertightPatch) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const PatchMap map(s.face, s.reference, at_rest(3));
    const CubicPatch patch = patch_at(s.reference, s.face.normals, s.face.across);
    for (int i = 0; i < 9; ++i) {
      ASSERT_LT((map.points().col(i) - patch.control[i]).norm(), 1e-13) << i;
    }
    for (int i = 0; i < 5; ++i) {
      const Vec2 b = random.barycentric();
      ASSERT_LT((map.point(patch_weights(s.face, b)) - patch.point(b)).norm(), 1e-13);
    }
  });
}

/// Edge points follow the watertight rule with the normals that the nodes carry, wherever they have gone.
TEST(PatchMap, MovedItHasTheEdgesOfTheWatertightPatchOfTheMovedNormals) {
  for_all_samples([](const Sample& s, RandomSample&) {
    const PatchMap map = map_of(s);
    std::vector<Vec3> x = s.reference;
    std::array<Vec3, 3> normals;
    NormalsAcross across;
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] += s.configuration.displacement[k];
      normals[k] = s.configuration.rotation[k] * s.face.normals[k];
      across[k] = {s.configuration.rotation[k] * s.face.across[k][0],
                   s.configuration.rotation[(k + 1) % 3] * s.face.across[k][1]};
    }
    const CubicPatch patch = patch_at(x, normals, across);
    for (int i = 0; i < 9; ++i) {
      ASSERT_LT((map.points().col(i) - patch.control[i]).norm(), 1e-13) << i;
    }
  });
}

TEST(PatchMap, WeightDerivativesAreThoseOfTheWeights) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const Vec2 b = random.barycentric();
    const auto derivatives = patch_weight_derivatives(s.face, b);
    for (int along = 0; along < 2; ++along) {
      const Vec2 step = 1e-6 * Vec2::Unit(along);
      const PatchWeights change = (patch_weights(s.face, b + step) - patch_weights(s.face, b - step)) / 2e-6;
      ASSERT_LT((change - derivatives[along]).norm(), 1e-8);
      ASSERT_NEAR(derivatives[along].sum(), 0, 1e-14);
    }
    ASSERT_NEAR(patch_weights(s.face, b).sum(), 1, 1e-14);
  });
}

TEST(PatchMap, ChangeIsTheDerivativeOfThePoints) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    constexpr double step = 1e-6;
    const PatchMap map = map_of(s);
    const PatchWeights weights = patch_weights(s.face, random.barycentric());
    const auto derivative = map.derivative(weights);
    for (int i = 0; i < 18; ++i) {
      const Vector18 one = Vector18::Unit(i);
      const Points after = map_of(advanced(s, step * one)).points(), before = map_of(advanced(s, -step * one)).points();
      const Points change = map.change(one);
      ASSERT_LT((change - (after - before) / (2 * step)).norm(), 3e-8) << "freedom " << i;
      ASSERT_LT((derivative.col(i) - change * weights).norm(), 1e-13);
    }
  });
}

TEST(PatchMap, WorkIsTheSameOnBothSides) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const PatchMap map = map_of(s);
    const Points forces = random.points(1);
    const Vector18 motion = Vector18::NullaryExpr([&](Eigen::Index) { return random(1); });
    ASSERT_NEAR(map.to_nodes(forces).dot(motion), forces.cwiseProduct(map.change(motion)).sum(), 1e-12);
  });
}

TEST(PatchMap, ForcesAndMomentsAreInBalance) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const PatchMap map = map_of(s);
    const PatchWeights weights = patch_weights(s.face, random.barycentric());
    const Vec3 force = random.vector(1), point = map.point(weights);
    const Vector18 on_nodes = map.to_nodes(force * weights.transpose());
    Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      const Vec3 f = on_nodes.segment<3>(6 * k), x = s.reference[k] + s.configuration.displacement[k];
      sum += f;
      moment += (x - point).cross(f) + on_nodes.segment<3>(6 * k + 3);
    }
    ASSERT_LT((sum - force).norm(), 1e-12 * force.norm());
    ASSERT_LT(moment.norm(), 1e-12 * force.norm());
  });
}

/// For forces that the points' places change (of_points), and for the change of the map itself.
TEST(PatchMap, StiffnessIsTheDerivativeOfTheForcesOnTheNodes) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    constexpr double step = 1e-5;
    const PatchMap map = map_of(s);
    const Matrix27 any = Matrix27::NullaryExpr([&](Eigen::Index, Eigen::Index) { return random(1); });
    const Matrix27 of_points = any + any.transpose();
    const Points forces = random.points(1);
    const auto on_nodes = [&](const Vector18& moved) {
      const Sample place = advanced(s, moved);
      const PatchMap there = map_of(place);
      Points now = there.points() - map.points();
      const Vector27 change = of_points * Eigen::Map<const Vector27>(now.data());
      return Vector18(there.to_nodes(forces + Eigen::Map<const Points>(change.data())));
    };
    const Matrix18 stiffness = map.stiffness(of_points, forces);
    for (int i = 0; i < 18; ++i) {
      const Vector18 along = step * Vector18::Unit(i);
      const Vector18 difference = (on_nodes(along) - on_nodes(-along)) / (2 * step);
      ASSERT_LT((stiffness.col(i) - difference).norm(), 1e-7 * stiffness.norm()) << "freedom " << i;
    }
  });
}

/// Spins do not commute: what is not symmetric is half the moments on the nodes, and nothing else.
TEST(PatchMap, StiffnessIsSymmetricButForTheMoments) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const PatchMap map = map_of(s);
    const Points forces = random.points(1);
    Matrix18 stiffness = map.stiffness(Matrix27::Zero(), forces);
    const Vector18 on_nodes = map.to_nodes(forces);
    for (int k = 0; k < 3; ++k) {
      stiffness.block<3, 3>(6 * k + 3, 6 * k + 3) += 0.5 * skew(Vec3(on_nodes.segment<3>(6 * k + 3)));
    }
    ASSERT_LT((stiffness - stiffness.transpose()).norm(), 1e-12 * stiffness.norm());
  });
}

TEST(PatchMap, RigidMotionsMoveAllPointsRigidly) {
  for_all_samples([](const Sample& s, RandomSample& random) {
    const Eigen::Quaterniond turn = random.rotation(1.7);
    const Vec3 shift = random.vector(5);
    Sample moved = s;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 x = s.reference[k] + s.configuration.displacement[k];
      moved.configuration.displacement[k] = turn * x + shift - s.reference[k];
      moved.configuration.rotation[k] = turn * s.configuration.rotation[k];
    }
    const PatchWeights weights = patch_weights(s.face, random.barycentric());
    ASSERT_LT((map_of(moved).point(weights) - (turn * map_of(s).point(weights) + shift)).norm(), 2e-14);
  });
}

TEST(PatchMap, FlatFacesAreBarycentric) {
  RandomSample random;
  Sample s = random_sample(random, Edges::smooth);
  s.face.curved = false;
  const PatchMap map = map_of(s);
  const Vec2 b = random.barycentric();
  const Vec3 shares(1 - b[0] - b[1], b[0], b[1]);
  Vec3 expected = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    expected += shares[static_cast<int>(k)] * (s.reference[k] + s.configuration.displacement[k]);
  }
  EXPECT_LT((map.point(patch_weights(s.face, b)) - expected).norm(), 1e-15);
  const Vec3 force = random.vector(1);
  const Vector18 on_nodes = map.to_nodes(force * patch_weights(s.face, b).transpose());
  for (int k = 0; k < 3; ++k) {
    EXPECT_LT((on_nodes.segment<3>(6 * k) - shares[k] * force).norm(), 1e-15);
    EXPECT_EQ(on_nodes.segment<3>(6 * k + 3).norm(), 0);
  }
  const Matrix27 any = Matrix27::NullaryExpr([&](Eigen::Index, Eigen::Index) { return random(1); });
  const Matrix18 stiffness = map.stiffness(any, random.points(1));
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_LT((stiffness.block<3, 3>(6 * i, 6 * j) - any.block<3, 3>(3 * i, 3 * j)).norm(), 1e-14);
    }
  }
}

Model shell_model(const ShellMesh& mesh) {
  Model model;
  ShellBody body = flat_body(mesh, 1, 0.3, 0.1);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  return model;
}

/// The largest gap between neighbours along their edges, after nodes have moved and turned as they like.
double largest_gap(const ShellMesh& mesh, double spin) {
  RandomSample random;
  const Surfaces surfaces = surface_faces(shell_model(mesh));
  Configuration moved = at_rest(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    moved.displacement[i] = random.vector(0.2 * spin);
    moved.rotation[i] = random.rotation(spin);
  }
  std::map<std::pair<Index, Index>, std::vector<Vec3>> seen;
  double gap = 0;
  std::size_t met = 0;
  for (const SurfaceFace& face : surfaces.faces) {
    const PatchMap map(face, mesh.vertices, moved);
    const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = face.nodes[k], b = face.nodes[(k + 1) % 3];
      std::vector<Vec3> points;
      for (int i = 0; i <= 8; ++i) {
        const double t = a < b ? i / 8.0 : 1 - i / 8.0;
        points.push_back(map.point(patch_weights(face, (1 - t) * corners[k] + t * corners[(k + 1) % 3])));
      }
      const auto [place, is_new] = seen.emplace(std::minmax(a, b), points);
      for (std::size_t i = 0; !is_new && i < points.size(); ++i) {
        gap = std::max(gap, (points[i] - place->second[i]).norm());
      }
      met += is_new ? 0 : 1;
    }
  }
  EXPECT_GT(met, mesh.triangles.size());
  return gap;
}

TEST(PatchMap, NeighboursMeetAlongTheirEdges) {
  const ShellMesh sphere = make_sphere(2, 2);
  EXPECT_LT(largest_gap(sphere, 0), 1e-14);
  EXPECT_LT(largest_gap(sphere, 0.4), 1e-14);
}

/// The normals across a crease are the neighbour's own.
TEST(PatchMap, NeighboursMeetAtCreases) {
  ShellMesh cone = make_sphere(2, 2);
  cone.corner_normals.resize(cone.triangles.size());
  for (std::size_t t = 0; t < cone.triangles.size(); ++t) {
    const auto& v = cone.triangles[t];
    const Vec3 facet =
        (cone.vertices[v[1]] - cone.vertices[v[0]]).cross(cone.vertices[v[2]] - cone.vertices[v[0]]).normalized();
    for (std::size_t k = 0; k < 3; ++k) {  // none of them smooth, angles of all sizes
      cone.corner_normals[t][k] =
          (0.3 * cone.normals[v[k]] + 0.7 * facet + 0.2 * std::sin(static_cast<double>(t)) * Vec3::UnitX())
              .normalized();
    }
  }
  EXPECT_LT(largest_gap(cone, 0), 1e-14);
  EXPECT_LT(largest_gap(cone, 0.4), 1e-14);
}

/// What the paper's rule makes of a force across a facet: forces by barycentric coordinates, torques by the inverse of
/// C (eq. 2). The torques belong to the forces of the cubic; beside others they leave a couple that nothing balances.
TEST(PatchMap, ThePapersRuleLosesACoupleOfATenthOfForceTimesEdge) {
  constexpr double edge = 1;
  const PlaneTriangle plane{edge, edge / 2, edge * std::sqrt(3.0) / 2};
  const Matrix9 inverse = inverse_shape_matrix(plane);
  const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(plane.a, 0), Vec2(plane.b, plane.h)};
  double largest = 0;
  for (int i = 0; i <= 20; ++i) {
    for (int j = 0; i + j <= 20; ++j) {
      const Vec3 shares(1 - (i + j) / 20.0, i / 20.0, j / 20.0);
      const Vec2 at = shares[0] * corners[0] + shares[1] * corners[1] + shares[2] * corners[2];
      // Of a unit force across the facet: nodal torques (about x and y) are the work of the cubic's slopes.
      const Vector9 on_nodes = inverse.transpose() * monomials(at.x(), at.y());
      Vec2 moment = Vec2::Zero(), consistent = Vec2::Zero();  // about the point, of what acts on the nodes
      for (int k = 0; k < 3; ++k) {
        const Vec2 arm = corners[k] - at;
        moment += shares[k] * Vec2(arm.y(), -arm.x()) + on_nodes.segment<2>(3 * k + 1);
        consistent += on_nodes[3 * k] * Vec2(arm.y(), -arm.x()) + on_nodes.segment<2>(3 * k + 1);
      }
      EXPECT_LT(consistent.norm(), 1e-13);
      largest = std::max(largest, moment.norm());
    }
  }
  EXPECT_GT(largest, 0.1 * edge);
  EXPECT_LT(largest, 0.2 * edge);
}

}  // namespace
}  // namespace tunica
