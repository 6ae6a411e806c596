#include "tunica/mechanics/runs/detail/contact_steps.hpp"

namespace tunica {

void begin_contact(ShellSystem& system, const RunSettings& settings, double from, double to,
                   const Configuration& configuration, std::optional<TangentSolver>& solver, BlockMatrix& matrix) {
  if (!system.contact) {
    return;
  }
  system.contact->set_step(from, to, configuration);
  if (system.contact->find_pairs(configuration)) {
    make_pattern(system, system.contact->pairs());
    const bool tells = solver->tells_direct_error();
    solver.emplace(system, settings);
    solver->tell_direct_error(tells);
    matrix = system.pattern;
  }
}

void accept_contact(const ShellSystem& system, const Configuration& configuration) {
  if (system.contact) {
    system.contact->accept(configuration);
  }
}

}  // namespace tunica
