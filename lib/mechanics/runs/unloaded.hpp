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
  std::size_t iterations = 0;  ///< corrections of u
  /// Roundness (section_roundness()) of the section that loses most of it, in the image and without the pressure: of 15
  /// planes across the long axis. None where no section is closed.
  struct Roundness {
    double image = 0, unloaded = 0;
  };
  std::optional<Roundness> roundness;
};

/// Finds the reference X whose state of rest under the pressures `imaged_at` lies where the shells of `imaged` lie. The
/// forces are in balance on the image x; what is unknown is where they come from: X = x - u, normals alike, by the
/// rotations. Source: Govindjee, Mihalic 1996, "Computational methods for inverse finite elastostatics". What is out of
/// balance corrects u by the linear stiffness of the image, accelerated (Anderson 1965), and with a growing pressure
/// where that does not converge at once. Then the pressures load X, and that state has to be the image: a balance
/// that is not stable is none. By what it misses the image u is corrected in the same way (Sellier 2011). What holds
/// nodes holds them where the image shows them; other loads and prescribed displacements act only afterwards. Errors:
/// InputError: the model has solids, rigid bodies or attachments, or as check_model(). RequirementError: there is no
/// such shape within 1 % of the mean displacement (the wall would fold, or the image lies beyond a limit load), with
/// the reason. Cost: one factorisation, some ten solutions by it and assemblies of the forces, and a static solution;
/// where there is no such shape up to some two hundred assemblies.
/// @param on_iteration  part of the pressure, mean change by the iteration in mm
Unloaded find_unloaded(const Model& imaged, const RunSettings& settings,
                       const std::function<void(double part, double mean_change)>& on_iteration = {});

}  // namespace tunica
