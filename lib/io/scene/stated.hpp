#pragma once

#include "tunica/core/json.hpp"
#include "tunica/io/scene/scene.hpp"

namespace tunica {

/// What a scene states of wall, load and supports, for a report: `young_mpa, poisson, thickness_mm, density_kg_per_m3,
/// pressure_mpa, imaged_at_mpa, law, support, fix[], kind, geometry, membrane, bending, solver`, and in `typed` the
/// quantities as the user wrote them ("120mmHg"). What differs from body to body, is not stated or not one number is
/// null.
Json stated_inputs(const Scene& scene);

/// Loads and wall in a line, as the user wrote them: "Pressure 120mmHg, wall 1.5mm, E 1MPa, Poisson's ratio 0.45". What
/// differs from body to body is left out.
std::string stated_line(const Scene& scene);

}  // namespace tunica
