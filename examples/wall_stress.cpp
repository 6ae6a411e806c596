// A vessel under pressure: a model made in memory, solved, and its wall stress beside Laplace's law.
//
//   wall_stress
#include <tunica/mechanics/runs/fields.hpp>

#include <cmath>
#include <iostream>
#include <numbers>

int main() {
  using namespace tunica;
  constexpr double radius = 10, length = 40, wall = 0.5;  // mm
  constexpr double pressure = 0.001;                      // MPa
  constexpr Index around = 32, along = 24;

  // An open tube along z: nodes, their unit normals, and triangles that face outward.
  ShellBody vessel;
  for (Index row = 0; row <= along; ++row) {
    for (Index i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      const Vec3 normal(std::cos(angle), std::sin(angle), 0);
      vessel.mesh.vertices.emplace_back(radius * normal + Vec3(0, 0, length * row / along));
      vessel.mesh.normals.push_back(normal);
    }
  }
  for (Index row = 0; row < along; ++row) {
    for (Index i = 0; i < around; ++i) {
      const Index a = row * around + i, b = row * around + (i + 1) % around;
      vessel.mesh.triangles.push_back({a, b, b + around});
      vessel.mesh.triangles.push_back({a, b + around, a + around});
    }
  }
  vessel.name = "vessel";
  vessel.thickness = {wall};
  vessel.material.young = 1;  // MPa
  vessel.material.poisson = 0.45;

  Model model;
  model.shells.push_back(std::move(vessel));
  Fix rims;
  for (Index i = 0; i < around; ++i) {
    rims.nodes.push_back(i);
    rims.nodes.push_back(along * around + i);
  }
  model.fixes.push_back(std::move(rims));
  Load load;
  load.kind = PressureLoad{.value = pressure};
  model.loads.push_back(std::move(load));

  RunSettings settings;
  settings.kind = StaticRun{.linear = false, .load_factors = {1}};
  State last;
  const Summary summary = solve(model, settings, [&](const State& state) { last = state; });
  const ElementFields fields = element_fields(model, last);

  const std::size_t middle = (along / 2) * around;
  const double hoop = pressure * radius / wall;  // of a long tube; held at both ends its axial stress is nu times that
  const double laplace = hoop * std::sqrt(1 - 0.45 + 0.45 * 0.45);
  std::cout << "largest displacement " << fields.largest_displacement << " mm, von Mises stress half-way "
            << fields.von_mises[middle] << " MPa, by Laplace's law " << laplace << " MPa\n";
  return summary.converged && std::abs(fields.von_mises[middle] / laplace - 1) < 0.1 ? 0 : 1;
}
