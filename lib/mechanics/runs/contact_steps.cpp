#include "tunica/mechanics/runs/detail/contact_steps.hpp"

#include <algorithm>
#include <utility>

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

void brace_contact(const ShellSystem& system, const VectorX& velocity, double length) {
  if (!system.contact) {
    return;
  }
  const Model& model = *system.model;
  std::vector<double> speeds(model.body_count(), 0);
  for (std::size_t b = 0; b < speeds.size(); ++b) {
    const std::size_t first = model.first_node(b);
    for (std::size_t i = first; i < first + model.vertices_of(b).size(); ++i) {
      speeds[b] = std::max(speeds[b], velocity.segment<3>(first_freedom(i)).norm());
    }
  }
  system.contact->brace(speeds, length);
}

ContactWork::ContactWork(const ShellSystem& system)
    : contact_(system.contact),
      rubs_(std::ranges::any_of(system.model->contacts, [](const Contact& contact) { return contact.friction > 0; })) {}

void ContactWork::keep(VectorX forces) { touched_ = std::exchange(touching_, std::move(forces)); }

ContactWork::Work ContactWork::over(const VectorX& change) {
  if (!contact_) {
    return {};
  }
  const double before = std::exchange(stored_, contact_->potential());
  const double rest = 0.5 * (touched_ + touching_).dot(change) + stored_ - before - contact_->take_hardening();
  return contact_->is_driven() ? Work{rest, 0} : Work{0, rubs_ ? -std::min(rest, 0.0) : 0};
}

void ContactWork::recall(const VectorX& touching) {
  touching_ = touching;
  stored_ = contact_ ? contact_->accepted_potential() : 0;
}

}  // namespace tunica
