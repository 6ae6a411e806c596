#pragma once

#include "tunica/mechanics/model/quadratic_shells.hpp"

#include <string>

/// Inside lib/io: the two files that hold a model. See shell_deck.hpp.
namespace tunica {

std::string inp_text(const Model& model, const QuadraticShells& shells, const StaticRun& run,
                     const std::string& made_by);
std::string feb_text(const Model& model, const QuadraticShells& shells, const StaticRun& run,
                     const std::string& made_by);

/// A number as these files hold it, to 13 digits: CalculiX reads the first 20 characters, and more would lose the
/// exponent.
std::string deck_number(double value);

/// What the loads are multiplied by at the end.
inline double last_factor(const StaticRun& run) { return run.load_factors.empty() ? 1 : run.load_factors.back(); }

/// The part of the load in the first increment: what the run was asked for, else a tenth, which either program enlarges
/// where it converges.
inline double first_increment(const StaticRun& run) {
  return run.load_factors.size() > 1 ? run.load_factors.front() / run.load_factors.back() : 0.1;
}

}  // namespace tunica
