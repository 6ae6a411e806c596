#include "tunica/cli/surface_result.hpp"

#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

namespace tunica::cli {

Json undefined_surface() {
  Json result;
  for (const char* key : {"vertices", "triangles", "components", "euler", "closed", "manifold", "oriented_outward",
                          "volume_mm3", "voxel_volume_mm3", "area_mm2", "diagonal_mm", "openings"}) {
    result[key] = nullptr;
  }
  return result;
}

Json measure_surface(const TriangleMesh& mesh, bool outward, bool open_border) {
  const MeshFacts facts = examine(mesh);
  if (const auto why = why_unfit(facts, open_border ? Boundary::allowed : Boundary::forbidden)) {
    throw InternalError("the extracted surface is not a manifold: " + *why);
  }
  const double volume = signed_volume(mesh);
  Json result = undefined_surface();
  result["vertices"] = facts.vertices;
  result["triangles"] = facts.triangles;
  result["components"] = facts.components;
  result["euler"] = facts.euler;
  result["closed"] = facts.closed;
  result["manifold"] = facts.manifold;
  result["oriented_outward"] = facts.oriented && outward && (!facts.closed || volume > 0);
  result["volume_mm3"] = facts.closed ? Json(volume) : Json();
  result["area_mm2"] = area(mesh);
  result["diagonal_mm"] = diagonal(mesh);
  return result;
}

Json sum_of_surfaces(const Json& surfaces) {
  Json total = undefined_surface();
  for (const auto& [label, result] : surfaces.items()) {
    for (const auto& [key, value] : result.items()) {
      if (key == "diagonal_mm") {
        continue;  // boxes of several surfaces do not add up
      }
      if (value.is_boolean()) {
        total[key] = (total[key].is_null() || total[key].get<bool>()) && value.get<bool>();
      } else if (value.is_number_integer()) {
        total[key] = (total[key].is_null() ? 0L : total[key].get<long>()) + value.get<long>();
      } else if (value.is_number()) {
        total[key] = (total[key].is_null() ? 0.0 : total[key].get<double>()) + value.get<double>();
      }
    }
  }
  return total;
}

}  // namespace tunica::cli
