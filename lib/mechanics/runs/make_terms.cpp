#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/terms.hpp"

#include <Eigen/Dense>

#include <limits>
#include <utility>

namespace tunica {
namespace {

class ContactTerm : public Term {
public:
  explicit ContactTerm(std::shared_ptr<ContactSystem> contact) : contact_(std::move(contact)) {}

  bool add(const ShellSystem& /*system*/, const Instant& at, Forces& forces, BlockMatrix* tangent) const override {
    forces.contact.setZero(forces.external.size());
    const bool valid = contact_->add(at.configuration, forces.contact, tangent);
    forces.external += forces.contact;
    return valid;
  }
  [[nodiscard]] bool acts_in_image() const override { return false; }

private:
  std::shared_ptr<ContactSystem> contact_;
};

}  // namespace

bool DeadLoadTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  const Configuration& configuration = at.configuration;
  const std::vector<double>& factors = at.factors;
  VectorX& external = forces.external;
  for (std::size_t l = 0; l < system.dead.size(); ++l) {
    const DeadLoad& load = system.dead[l];
    const double factor = load.begin + factors[l] * (load.end - load.begin);
    if (load.force.size() == 0 || factor == 0) {
      continue;
    }
    external += factor * load.force;
    for (std::size_t i = 0; i < load.director.size(); ++i) {
      // Moment: sum of (R n) x g. With M = R n g' its spin derivative is M - trace(M).
      const Mat3 m = factor * (configuration.rotation[i] * load.director[i]);
      external.segment<3>(first_freedom(i) + 3) += Vec3(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0));
      if (tangent != nullptr) {
        auto block = tangent->block(tangent->find(narrow<Index>(i), narrow<Index>(i)));
        block.block<3, 3>(3, 3) += m.trace() * Mat3::Identity() - m;
      }
    }
  }
  return true;
}

InertiaTerm::InertiaTerm(const ShellSystem& system) : masses_(lumped_masses(system)) {
  VectorX of_places = masses_;
  const double longest = longest_side(system);
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    of_places.segment<3>(first_freedom(i)) *= longest;
  }
  noise_ = std::numeric_limits<double>::epsilon() * force_norm(system, of_places);
}

bool InertiaTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  if (at.movement == nullptr) {
    return true;
  }
  const Movement& movement = *at.movement;
  forces.inertia += masses_.cwiseProduct(movement.acceleration + movement.mass_damping * movement.velocity);
  forces.noise += movement.acceleration_factor * noise_;
  if (tangent == nullptr) {
    return true;
  }
  const double factor = movement.acceleration_factor + movement.mass_damping * movement.velocity_factor;
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    auto block = tangent->block(tangent->find(narrow<Index>(i), narrow<Index>(i)));
    block.diagonal().head<3>() += factor * masses_.segment<3>(first_freedom(i));
    const Vec3 turn = movement.change.segment<3>(first_freedom(i) + 3);
    block.block<3, 3>(3, 3) +=
        factor * masses_[first_freedom(i) + 3] * spin_to_rate(turn, spin_coefficients(turn.squaredNorm()).eta);
  }
  return true;
}

void make_terms(ShellSystem& system) {
  system.terms.push_back(std::make_shared<ShellTerm>());
  if (!system.solids.empty()) {
    system.terms.push_back(std::make_shared<SolidTerm>());
    system.terms.push_back(std::make_shared<SolidPressureTerm>());
  }
  system.terms.push_back(std::make_shared<DeadLoadTerm>());
  if (!system.model->supports.empty()) {
    system.bed = std::make_shared<SupportTerm>(*system.model, system.elements, system.normals);
    system.terms.push_back(system.bed);
  }
  if (system.contact) {
    system.terms.push_back(std::make_shared<ContactTerm>(system.contact));
  }
  system.terms.push_back(std::make_shared<InertiaTerm>(system));
}

}  // namespace tunica
