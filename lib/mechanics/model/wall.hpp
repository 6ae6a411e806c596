#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <array>
#include <span>
#include <vector>

/// How large a field on the wall is.
/// Errors: InputError: a corner that does not exist, no thickness, or not as many values as said.
namespace tunica {

/// The thinnest place of all bodies, mm.
double least_thickness(const Model& model);

/// A triangle of which a field is known at the corners.
struct Facet {
  double area = 0;
  std::array<double, 3> values{};
};

/// The value that a field, linear within the facets, passes on the part `above` of their area. Exact but for the
/// halving of an interval, to 1e-12 of the field's range.
double area_quantile(std::span<const Facet> facets, double above);

/// The same of a field that is linear between the nodes, over all bodies.
/// @param of_nodes  #nodes of all bodies
double area_quantile(const Model& model, std::span<const double> of_nodes, double above);

/// The mean of a field, linear within the facets, over their area; 0 without area.
double area_mean(std::span<const Facet> facets);

}  // namespace tunica
