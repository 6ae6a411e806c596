#include "tunica/mechanics/runs/detail/prestress.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/mechanics/runs/detail/linear_statics.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace tunica {
namespace {

bool is_attached(const ShellSystem& system, const Piece& piece) {
  const auto has = [&](Index node) { return std::binary_search(piece.nodes.begin(), piece.nodes.end(), node); };
  return std::any_of(system.carried.begin(), system.carried.end(), [&](const Carried& carried) {
    return has(carried.node) || std::any_of(carried.carriers.begin(), carried.carriers.end(), has);
  });
}

/// Of all pieces that only contact, inertia or a bed holds. Errors: InputError: the loads on one are not in balance.
void hold_loose_pieces(ShellSystem& system, const std::vector<double>& factors) {
  const Model& model = *system.model;
  Forces forces;
  evaluate(system, {reference_configuration(system), factors}, forces, nullptr);
  for (const Piece& piece : system.pieces) {
    if (is_attached(system, piece) || free_rigid_motions(system, piece) == 0) {
      continue;
    }
    Piece loose = piece;
    set_free_motions(system, loose);
    if (const double relative = imbalance(system, loose, forces.external); relative > largest_imbalance) {
      throw InputError(
          fmt::format("{}: net force or moment of the pressure that it was imaged under is {:.3g} of it, and nothing "
                      "holds the body "
                      "that is not without force in the image: hold it by a fix",
                      model.name_of(piece.body), relative));
    }
    hold_free_motions(system, piece);
  }
}

}  // namespace

void add_stress(ShellSystem& system, const VectorX& moved) {
  for (ShellElement& element : system.elements) {
    Vector18 of_corners;
    for (int k = 0; k < 3; ++k) {
      of_corners.segment<6>(6 * k) = moved.segment<6>(first_freedom(element.nodes[k]));
    }
    ElementState strain = linear_deformation(element, of_corners);
    strain.tail<3>() = strain.tail<3>().cwiseProduct(
        element.skewing.unaryExpr([](double stiffness) { return stiffness > 0 ? 1.0 : 0.0; }));
    element.prestrain += strain;
  }
  for (SolidElement& element : system.solids) {
    SolidMotion motion;
    for (int k = 0; k < 4; ++k) {
      motion.displacement.col(k) = moved.segment<3>(first_freedom(element.nodes[k]));
      motion.pressure[k] = moved[first_freedom(element.nodes[k]) + 3];
    }
    element.prestress += solid_stress(element, motion, true);
  }
}

void add_prestress(ShellSystem& system, const RunSettings& settings) {
  const Model& model = *system.model;
  if (!model.is_imaged_under_pressure() || system.prestress_residual) {
    return;
  }
  const std::vector<double> factors(model.loads.size(), 0.0);  // there only the pressures of the image act
  const auto contact = std::exchange(system.contact, nullptr);
  const auto bed = std::exchange(system.bed, nullptr);
  const auto terms = system.terms;
  std::erase_if(system.terms, [](const auto& term) { return !term->acts_in_image(); });
  const auto held = system.held;
  hold_loose_pieces(system, factors);
  RunSettings exact = settings;
  exact.cg_fixed_count = false;
  exact.cg_iterations.reset();
  exact.cg_tolerance = std::min(settings.cg_tolerance, RunSettings().cg_tolerance);
  LinearSolver solver(system, exact);
  const LinearSolution solution = solver.solve(factors, VectorX::Zero(first_freedom(system.node_count())));
  const double residual = solver.residual(solution);
  add_stress(system, solution.moved);
  system.prestress_residual = residual;
  system.held = held;
  system.terms = terms;
  system.bed = bed;
  system.contact = contact;
}

std::optional<bool> rests_as_imaged(ShellSystem& system, RunSettings settings) {
  const Model& model = *system.model;
  const auto is_known = [](const ShellBody& body) { return body.material.young_stated; };
  if (!system.prestress_residual || system.contact || !std::ranges::all_of(model.shells, is_known)) {
    return {};
  }
  const std::vector<double> factors(model.loads.size(), 0.0);
  const auto held = system.held;
  hold_loose_pieces(system, factors);
  settings.solver = Solver::direct;
  BlockMatrix tangent = system.pattern;
  Forces forces;
  evaluate(system, {reference_configuration(system), factors}, forces, &tangent);
  VectorX unbalanced = forces.external - forces.internal;
  condense(system, reference_configuration(system), unbalanced, &tangent);
  symmetrise(tangent);
  VectorX none;
  const bool rests =
      TangentSolver(system, settings).solve(tangent, VectorX::Zero(unbalanced.size()), none).positive_definite;
  system.held = held;
  return rests;
}

}  // namespace tunica
