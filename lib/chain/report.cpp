#include "tunica/chain/report.hpp"

#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

namespace tunica::chain {
namespace {

Json interval(const Interval& mm, double scale) { return {{"lower", mm.lower * scale}, {"upper", mm.upper * scale}}; }

Json triple(const Vec3& x) { return {x.x(), x.y(), x.z()}; }

}  // namespace

Json report(const std::optional<SurfaceNumbers>& surface) {
  if (!surface) {
    Json undefined = report(SurfaceNumbers());
    for (Json& value : undefined) {
      value = nullptr;
    }
    return undefined;
  }
  Json result{{"vertices", surface->vertices},
              {"triangles", surface->triangles},
              {"components", surface->components},
              {"euler", surface->euler},
              {"closed", surface->closed},
              {"manifold", surface->manifold},
              {"oriented_outward", surface->oriented_outward},
              {"volume_mm3", or_null(surface->volume)},
              {"voxel_volume_mm3", surface->voxel_volume},
              {"area_mm2", surface->area},
              {"diagonal_mm", or_null(surface->diagonal)},
              {"openings", surface->openings}};
  if (const auto& staircase = surface->staircase) {
    result["staircase"] = {{"largest_move_voxels", staircase->largest_move},
                           {"volume_change", staircase->volume_change},
                           {"held_back", staircase->held_back}};
  }
  if (const auto& thickness = surface->thickness) {
    result["face"] = name_of(*surface->face);
    result["wall_thickness_mm"] = {{"mean", thickness->mean}, {"p5", thickness->p5}, {"p95", thickness->p95}};
  }
  return result;
}

Json report(const Comparison& found) {
  const HausdorffResult& distance = found.distance;
  const double percent = 100 / found.diagonal;
  Json result{
      {"hausdorff_mm", interval(distance.both, 1)},
      {"hausdorff_percent", interval(distance.both, percent)},
      {"one_sided_percent",
       {{"a_to_b", interval(distance.a_to_b, percent)}, {"b_to_a", interval(distance.b_to_a, percent)}}},
      {"mean_percent", distance.mean * percent},
      {"rms_percent", distance.rms * percent},
      {"diagonal_mm", found.diagonal},
      {"triangles_a", found.triangles_a},
      {"triangles_b", found.triangles_b},
      {"farthest_mm", {{"a", triple(distance.worst_a)}, {"b", triple(distance.worst_b)}}},
  };
  if (found.of_shells) {
    result["boundary_percent"] = found.boundary ? interval(*found.boundary, percent) : Json();
  }
  return result;
}

Json report(const Decimation& found) {
  const TriangleMesh& mesh = found.made.mesh;
  const MeshFacts facts = examine(mesh);
  Json result{
      {"triangles_in", found.triangles_in},
      {"triangles", mesh.triangles.size()},
      {"hausdorff_percent", interval(found.distance, 100 / found.diagonal)},
      {"hausdorff_mm", interval(found.distance, 1)},
      {"min_angle_deg", found.angle},
      {"min_angle_held", found.min_angle ? Json(found.made.angle_held) : Json()},
      {"mean_quality", mean_quality(mesh)},
      {"manifold", facts.manifold && facts.oriented},
      {"euler", facts.euler},
      {"boundary_loops", facts.boundary_loops},
      {"self_intersections", found.crossings.size()},
      {"degenerate_triangles", found.degenerate},
      {"closed_loops", found.made.closed_loops},
      {"longest_spike_mm", found.made.longest_spike},
      {"diagonal_mm", found.diagonal},
  };
  if (const auto& repairs = found.repairs) {
    result["repairs"] = {{"dropped_triangles", repairs->dropped_triangles},
                         {"joined_edges", repairs->joined_edges},
                         {"split_edges", repairs->split_edges},
                         {"turned_triangles", repairs->turned_triangles},
                         {"opened_edges", repairs->opened_edges},
                         {"split_vertices", repairs->split_vertices},
                         {"cut_edges", repairs->cut_edges}};
  }
  return result;
}

Json report(const Relaxation& found) {
  const double percent = 100 / found.diagonal;
  const ShellDistance& distance = found.distance;
  Json iterations = Json::array();
  for (const RelaxIteration& iteration : found.relaxed.iterations) {
    iterations.push_back({{"shells", iteration.shells},
                          {"hausdorff_percent", interval(iteration.hausdorff, percent)},
                          {"seconds", iteration.seconds}});
  }
  Json result{
      {"shells", found.relaxed.shell.triangles.size()},
      {"hausdorff_mm", interval(distance.both, 1)},
      {"hausdorff_percent", interval(distance.both, percent)},
      {"one_sided_percent",
       {{"shell_to_target", interval(distance.shell_to_target, percent)},
        {"target_to_shell", interval(distance.target_to_shell, percent)}}},
      {"boundary_percent", distance.boundary ? interval(*distance.boundary, percent) : Json()},
      {"mean_percent", distance.mean * percent},
      {"rms_percent", distance.rms * percent},
      {"flat_hausdorff_percent", interval(found.flat, percent)},
      {"iterations", iterations},
      {"reached", or_null(found.relaxed.reached)},
      {"stopped", found.relaxed.stopped},
      {"diagonal_mm", found.diagonal},
      {"mean_distance_bound_mm", or_null(found.mean_bound)},
      {"min_angle_deg", found.angle},
      {"self_intersections", found.crossings},
      {"mean_distance_mm", found.quality.mean_distance},
      {"normal_error_deg", {{"mean", found.quality.mean_normal_error}, {"max", found.quality.max_normal_error}}},
      {"gap_mm", found.quality.gap},
      {"size_ratio", found.quality.size_ratio},
  };
  if (const auto& middle = found.middle) {
    Json& said = result["mid_surface"];
    if (const auto& half_way = middle->half_way) {
      said["grid_mm"] = half_way->cell;
      said["left_out"] = {{"pieces", half_way->left_out}, {"area_mm2", half_way->left_out_area}};
    }
    if (middle->face) {
      said["error_mm"] = middle->error ? Json{{"mean", (*middle->error)[0]}, {"max", (*middle->error)[1]}} : Json();
      said["thickness_mm"] = {{"min", middle->range[0]}, {"max", middle->range[1]}};
      said["target"] = name_of(*middle->face);
    }
  }
  return result;
}

}  // namespace tunica::chain
