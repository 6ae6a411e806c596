#pragma once

#include "tunica/mechanics/runs/solve.hpp"

/// The shape that an organ has without the pressure under which it was imaged.
namespace tunica {

/// Of a model whose shells were imaged under pressure.
struct Unloaded {
  Model model;                   ///< the same, its shells as they are without that pressure
  std::optional<double> volume;  ///< mm^3, of closed shells
  double mean_distance = 0;      ///< mm: of the loaded shape's nodes from the image
  double largest_distance = 0;
  std::size_t iterations = 0;  ///< static solutions
};

/// Finds the reference X whose state of rest under the pressures `imaged_at` lies where the shells of `imaged` lie:
/// X = x - u(X), x the image and u(X) the displacement from X under those pressures; normals alike, by the rotations.
/// The fixed point is accelerated (Anderson 1965), and approached by a growing pressure where it is not found at once.
/// What holds nodes holds them where the image shows them; other loads and prescribed displacements act only
/// afterwards. Source: Sellier 2011, "An iterative method for the inverse elasto-static problem". Errors: InputError:
/// the model has solids, rigid bodies or attachments, or as check_model(). RequirementError: there is no such shape
/// within 1 % of the mean displacement (beyond a limit load, or the unloaded shell would buckle on the way), with the
/// reason. Cost: some ten static solutions of few iterations each; where there is
/// no such shape up to some two hundred before that is told.
/// @param on_iteration  part of the pressure, mean distance so far in mm
Unloaded find_unloaded(const Model& imaged, const RunSettings& settings,
                       const std::function<void(double part, double mean_distance)>& on_iteration = {});

/// Whether some pressure says that the image was taken under it.
bool is_imaged_under_pressure(const Model& model);

}  // namespace tunica
