#include "tunica/mechanics/runs/prestress.hpp"

#include "tunica/mechanics/runs/detail/run.hpp"

#include <algorithm>

namespace tunica {
namespace {

RunSettings for_prestress(const RunSettings& settings) {
  RunSettings linear;
  linear.kind = StaticRun{true, {1}};
  linear.solver = settings.solver;
  linear.cg_tolerance = std::min(settings.cg_tolerance, linear.cg_tolerance);
  return linear;
}

}  // namespace

bool is_imaged_under_pressure(const Model& model) {
  return std::any_of(model.loads.begin(), model.loads.end(), [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure != nullptr && pressure->imaged_at.has_value();
  });
}

Model under_imaging_pressure(Model model) {
  std::erase_if(model.loads, [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure == nullptr || !pressure->imaged_at;
  });
  for (Load& load : model.loads) {
    auto& pressure = std::get<PressureLoad>(load.kind);
    pressure.value = *pressure.imaged_at;
    pressure.imaged_at.reset();
    load.ramp = {};
  }
  for (Fix& fix : model.fixes) {
    fix.displacement.setZero();
    fix.ramp = {};
  }
  model.supports.clear();  // without force in the imaged shape
  model.contacts.clear();
  model.rigids.clear();
  model.prestress.reset();
  return model;
}

Model prestressed(Model imaged, const RunSettings& settings) {
  if (!is_imaged_under_pressure(imaged)) {
    return imaged;
  }
  Model pressed = under_imaging_pressure(imaged);
  for (std::size_t body = 0; body < pressed.body_count(); ++body) {
    const auto names = [&](const auto& item) { return item.body == body; };
    const bool held =
        std::ranges::any_of(pressed.fixes, names) || std::ranges::any_of(pressed.rigid_motions, names) ||
        std::ranges::any_of(pressed.attachments, [&](const Attachment& a) { return a.body == body || a.to == body; });
    const bool on_bed = std::ranges::any_of(imaged.supports, names);
    if (!held || (on_bed && std::ranges::none_of(pressed.rigid_motions, names))) {  // by contact, inertia, or a bed
      pressed.rigid_motions.push_back({body});
    }
  }
  const RunSettings linear = for_prestress(settings);
  ShellSystem system = make_checked_system(pressed, linear);
  State solution;
  run_linear(system, pressed, linear, std::get<StaticRun>(linear.kind), [&](const State& state) { solution = state; },
             {}, {});
  Prestress& prestress = imaged.prestress.emplace();
  prestress.residual = solution.residual;
  for (const ShellElement& element : system.elements) {
    Vector18 moved;
    for (int k = 0; k < 3; ++k) {
      moved.segment<3>(6 * k) = solution.displacement[element.nodes[k]];
      moved.segment<3>(6 * k + 3) = solution.rotation[element.nodes[k]];
    }
    prestress.shells.push_back(linear_deformation(element, moved));
    prestress.shells.back().tail<3>().setZero();  // the edges' skewness is not stiff in statics
  }
  for (const SolidElement& element : system.solids) {
    SolidMotion motion;
    for (int k = 0; k < 4; ++k) {
      motion.displacement.col(k) = solution.displacement[element.nodes[k]];
      motion.pressure[k] = solution.pressure[element.nodes[k]];
    }
    prestress.solids.push_back(solid_stress(element, motion, true));
  }
  return imaged;
}

}  // namespace tunica
