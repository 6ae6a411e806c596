#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/mechanics/model/model.hpp"

#include <string>
#include <vector>

namespace tunica {

/// Whether a fix moves something.
bool prescribes(const Fix& fix);

/// Whether any load or prescribed displacement is other than zero, ramps aside.
bool is_loaded(const Model& model);

/// What of a model can be solved but hardly be meant, a sentence each that begins with where it was said: walls thicker
/// than a quarter of a vessel's radius or an eighth of a ball's in the mean over a body, or than a twentieth of its
/// diagonal; stiffness and density that no material has; pressure on a cavity inside the body; images whose voxels are
/// large for the wall; shells that are coarse for a curved wall so thin; bodies that cannot move; forces and moments
/// that only held nodes bear; loads that are zero or stay so during the run, or jump within a step; nothing that loads
/// at all (static and dynamic runs). The model must have passed check_model(). Errors: InputError as require_valid() of
/// the model. Cost: linear.
/// @param has_estimates  the errors of the answers are estimated: that says more of the shells than their shape
std::vector<Warning> doubts(const Model& model, const RunSettings& settings, bool has_estimates = false);

/// Solids whose tetrahedra are coarse for what they bear, or finer than a skin that they carry.
/// @param errors, roughness  ElementFields::solid_error and roughness of the state
/// Errors: InputError: not one per solid, or shell. Cost: linear.
std::vector<Warning> doubts_of_solids(const Model& model, const std::vector<double>& errors,
                                      const std::vector<double>& roughness);

/// What doubts that layers of shells are fine enough for what they bear, at most one.
/// @param errors  ElementFields::layer_error of the state
std::vector<Warning> doubts_of_layers(const Model& model, const std::vector<double>& errors);

/// A pressure or a stiffness (MPa) with the unit that suits it, Pa to TPa: "16 kPa".
std::string pressure_text(double mpa);

/// How much of the stress at the faces of shells thin-shell theory leaves open, in the mean over the area: half of the
/// thickness over a vessel's radius, all of it over a ball's. What bends by strain over radius is no bending there, and
/// shells of different pattern count it differently. Source: Koiter 1960, "A consistent first approximation in the
/// general theory of thin elastic shells". Errors: InputError: as curvatures_of(). Cost: linear.
double open_at_faces(const Model& model);

/// The part of a body's area on which the wall is thicker than twice the radius of curvature, so that no inner face is
/// left. Errors: InputError: as curvatures_of(), or not one thickness, nor one per node.
double share_without_inner_face(const ShellBody& body);

}  // namespace tunica
