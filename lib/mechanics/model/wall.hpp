#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <span>

/// Fields that shells hold constant, made continuous: what their neighbours say at the nodes, and what of it is large.
/// Errors: InputError: a corner that does not exist, no thickness, or not as many values as said.
namespace tunica {

/// The thinnest place of all bodies, mm.
double least_thickness(const Model& model);

/// Means at the nodes, within each body, of the triangles around, weighted by their area.
/// @param of_triangles  of all bodies in order
/// @return #nodes of all bodies; 0 at nodes without triangles
std::vector<double> averaged_at_nodes(const Model& model, std::span<const double> of_triangles);

/// The value that a field, linear between the nodes, passes on the part `above` of the area of all bodies' facets.
/// Exact but for the halving of an interval, to 1e-12 of the field's range.
/// @param of_nodes  #nodes of all bodies
double area_quantile(const Model& model, std::span<const double> of_nodes, double above);

}  // namespace tunica
