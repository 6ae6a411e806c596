// The public functions of lib/shell, lib/fit and lib/wall check what they are given.
#include "damaged.hpp"
#include "shell/families.hpp"
#include "tunica/fit/fit.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/distance/curved_hausdorff.hpp"
#include "tunica/shell/distance/mean_bound.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/shell/distance/shell_quality.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/refine.hpp"
#include "tunica/shell/patch/tessellate_conforming.hpp"
#include "tunica/wall/face_distance.hpp"
#include "tunica/wall/mid_surface.hpp"

namespace tunica {
namespace {

using namespace arguments;
using testing::sphere;
using testing::sphere_shell;

const Target& ball() {
  static const Target target(sphere(3));
  return target;
}

ShellDistanceOptions wide(double width, std::optional<double> limit = {}) {
  ShellDistanceOptions options;
  options.width = width;
  options.limit = limit;
  return options;
}

FitOptions few_rounds() {
  FitOptions options;
  options.max_iterations = 1;
  return options;
}

TEST(ShellArguments, MeshesAreChecked) {
  const std::vector<Call<TriangleMesh>> calls{
      {"Target", [](const TriangleMesh& m) { Target{m}; }},
      {"fit", [](const TriangleMesh& m) { fit(m, ball(), few_rounds()); }},
      {"relax_by_barycentre", [](const TriangleMesh& m) { relax_by_barycentre(m, ball(), few_rounds()); }},
      {"distance_of_faces", [](const TriangleMesh& m) { distance_of_faces(m, sphere(1)); }},
      {"distance_of_faces to", [](const TriangleMesh& m) { distance_of_faces(sphere(1), m); }},
  };
  expect_checked(sphere(1), calls);
  for (const auto& call : calls) {
    expect_refused(call.name, [&] { call.of({}); });
  }
  expect_checked<TriangleMesh>(
      sphere(1),
      {
          {"facet_normals", [](const TriangleMesh& m) { facet_normals(m); }},
          {"vertex_normals", [](const TriangleMesh& m) { vertex_normals(m); }},
          {"faces_other_way", [](const TriangleMesh& m) { faces_other_way(m, ball()); }},
          {"move_by_barycentre", [](TriangleMesh m) { move_by_barycentre(ball(), m, 0.1); }},
          {"moved_half_way", [](const TriangleMesh& m) { moved_half_way(m, ball(), WallFace::outer, 0.1, ball()); }},
      });
}

const std::vector<Call<ShellMesh>> of_shells{
    {"curved_hausdorff", [](const ShellMesh& s) { curved_hausdorff(s, ball(), wide(0.1)); }},
    {"shell_distance", [](const ShellMesh& s) { shell_distance(s, ball(), wide(0.1)); }},
    {"flat_distance", [](const ShellMesh& s) { flat_distance(s, ball(), wide(0.1)); }},
    {"mean_distance", [](const ShellMesh& s) { mean_distance(s, ball()); }},
    {"mean_distance_bound", [](const ShellMesh& s) { mean_distance_bound(s, ball(), 0.1); }},
    {"shell_errors", [](const ShellMesh& s) { shell_errors(s, ball(), 0.1); }},
    {"shell_quality", [](const ShellMesh& s) { shell_quality(s, ball()); }},
    {"mean_distance_from_target", [](const ShellMesh& s) { mean_distance_from_target(s, ball()); }},
    {"refit", [](const ShellMesh& s) { refit(s, ball()); }},
    {"fit_normals", [](ShellMesh s) { fit_normals(ball(), s); }},
    {"half_wall_error", [](const ShellMesh& s) { half_wall_error(s, ball(), 0.1); }},
};

TEST(ShellArguments, ShellMeshesAreChecked) {
  expect_checked(sphere_shell(1), of_shells);
  for (const auto& call : of_shells) {
    expect_refused(call.name, [&] { call.of({}); });
  }
  expect_checked<ShellMesh>(
      sphere_shell(1),
      {
          {"curved_patches", [](const ShellMesh& s) { curved_patches(s); }},
          {"tessellate", [](const ShellMesh& s) { tessellate(s, 0.1); }},
          {"tessellate_conforming",
           [](ShellMesh s) {
             s.patch = Patch::watertight;
             tessellate_conforming(s, 0.1);
           }},
          {"tessellation_size", [](const ShellMesh& s) { tessellation_size(s, 0.1); }},
          {"tessellate_uniformly", [](const ShellMesh& s) { tessellate_uniformly(s, 2); }},
          {"curved_volume", [](const ShellMesh& s) { curved_volume(s); }},
          {"require_fit", [](const ShellMesh& s) { require_fit(s, "shells"); }},
          {"count_without_area", [](const ShellMesh& s) { count_without_area(s); }},
          {"crossing_patches", [](const ShellMesh& s) { crossing_patches(s); }},
          {"boundary_curves", [](const ShellMesh& s) { boundary_curves(s); }},
          {"take_normals_from", [](ShellMesh s) { take_normals_from(ball(), s); }},
          {"split_shells",
           [](const ShellMesh& s) { split_shells(s, std::vector<Split>(s.triangles.size(), Split::all_edges)); }},
          {"refine_where", [](const ShellMesh& s) { refine_where(s, std::vector<double>(80, 1.0), 0.1, 1000); }},
      });
}

TEST(ShellArguments, NormalsAreChecked) {
  ShellMesh none = sphere_shell(1), few = none, no_number = none, few_corners = none;
  none.normals.clear();
  few.normals.pop_back();
  no_number.normals[3].x() = nan;
  few_corners.corner_normals.resize(5);
  for (const ShellMesh& bad : {none, few, no_number, few_corners}) {
    for (const auto& call : of_shells) {
      if (call.name != "flat_distance") {
        expect_refused(call.name, [&] { call.of(bad); });
      }
    }
    expect_refused("curved_patches", [&] { curved_patches(bad); });
    expect_refused("require_fit", [&] { require_fit(bad, "shells"); });
  }
}

TEST(ShellArguments, NumbersAreChecked) {
  const ShellMesh shell = sphere_shell(1);
  expect_numbers_checked({
      {"width", [&](double x) { curved_hausdorff(shell, ball(), wide(x)); }},
      {"limit", [&](double x) { shell_distance(shell, ball(), wide(0.1, x)); }},
      {"flat width", [&](double x) { flat_distance(shell, ball(), wide(x)); }},
      {"deviation", [&](double x) { tessellate(shell, x); }},
      {"deviation", [&](double x) { tessellate_conforming(shell, x); }},
      {"deviation of errors", [&](double x) { shell_errors(shell, ball(), x); }},
      {"slack", [&](double x) { mean_distance_bound(shell, ball(), x); }},
      {"width of boundaries", [&](double x) { boundary_distance({}, ball(), x); }},
      {"tolerance of splits", [&](double x) { refine_where(shell, std::vector<double>(80, 1.0), x, 1000); }},
      {"tolerance",
       [&](double x) {
         FitOptions options = few_rounds();
         options.tolerance = x;
         fit(sphere(1), ball(), options);
       }},
      {"tolerance of the rule",
       [&](double x) {
         FitOptions options = few_rounds();
         options.tolerance = x;
         relax_by_barycentre(sphere(1), ball(), options);
       }},
      {"width of the fit",
       [&](double x) {
         FitOptions options = few_rounds();
         options.width = x;
         fit(sphere(1), ball(), options);
       }},
      {"min_angle",
       [&](double x) {
         FitOptions options = few_rounds();
         options.min_angle = x;
         fit(sphere(1), ball(), options);
       }},
      {"thickness", [&](double x) { half_way_surface(ball(), WallFace::outer, x); }},
      {"thickness of the error", [&](double x) { half_wall_error(shell, ball(), x); }},
  });
  expect_refused("pieces", [&] { tessellate_uniformly(shell, 0); });
  expect_refused("splits", [&] { split_shells(shell, {}); });
}

}  // namespace
}  // namespace tunica
