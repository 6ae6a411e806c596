#pragma once

#include "tunica/mechanics/model/model.hpp"

/// The stress that a wall bears where the image shows it, from the pressure that it was imaged under.
namespace tunica {

/// Whether some pressure says that the image was taken under it.
bool is_imaged_under_pressure(const Model& model);

/// The model under the pressures of the image alone, held where the image shows it: without other loads, prescribed
/// displacements, rigid bodies and contacts. Its pressures have no `imaged_at` any more.
Model under_imaging_pressure(Model model);

/// Gives a model the stress that balances the pressures `imaged_at` on the shape of the image: that of the linear
/// solution there, whose displacements are dropped. The reference is then at rest under these pressures, and a load
/// moves it on from there. Where equilibrium alone decides the stress (membrane forces of a closed shell), it is that
/// of the living wall; its bending part is that of a wall without residual stress. Young's modulus has no influence
/// where all bodies have the same. Source: Joldes, Miller, Wittek, Doyle 2016, "A simple, effective and clinically
/// applicable method to compute abdominal aortic aneurysm wall stress"; Gee, Forster, Wall 2010, "A computational
/// strategy for prestressing patient-specific biomechanical problems under finite deformation". Errors: InputError, as
/// check_model(); RequirementError: the linear stiffness is not positive definite. Cost: one linear solve. A model that
/// nothing was imaged under pressure of comes back as it is.
Model prestressed(Model imaged, const RunSettings& settings);

}  // namespace tunica
