#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <memory>

namespace tunica {

struct ShellSystem;

/// A model that is checked and made ready for solving, once for all that is asked of it: elements, loads, supports.
/// Where a pressure has an `imaged_at` the reference bears the stress that is in balance with it
/// (detail/prestress.hpp); that is found when it is first asked for. Copies share it.
class System {
public:
  /// Errors: InputError, of all that makes a model unsolvable, before any time is spent: what require_valid() asks;
  /// degenerate or non-manifold elements, inconsistent orientation, a normal nearly in its facet's plane, pieces that
  /// can move freely (static), a non-positive thickness, net force on a body held by its rigid motions only; settings
  /// out of their range.
  System(Model model, const RunSettings& settings);

  [[nodiscard]] const Model& model() const;
  [[nodiscard]] const RunSettings& settings() const;

  /// Relative, of the balance of the stress that the reference bears; none where it bears none. Errors: as solve().
  [[nodiscard]] std::optional<double> prestress_residual() const;
  /// Whether the reference, with this stress, is a stable state of rest; none where it bears none, where Young's
  /// modulus of some shell is not known, and with contact. Errors: as solve(). Cost: one factorisation.
  [[nodiscard]] std::optional<bool> rests_as_imaged() const;

  /// For the runs themselves: the reference bears its stress.
  [[nodiscard]] ShellSystem& parts() const;

private:
  struct Implementation;
  std::shared_ptr<Implementation> implementation_;
};

}  // namespace tunica
