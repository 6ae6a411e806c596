// A vessel under 13 kPa at once, in steps of 40 ms, without damping: it comes to rest where the static run does, or the
// run says what the wall can carry.

#include "benchmarks.hpp"
#include "tunica/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

namespace tunica {
namespace {

using namespace benchmarks;

Model vessel(std::size_t around, std::size_t along, double thickness, Membrane membrane = Membrane::adapt) {
  Model model;
  ShellBody body = flat_body(make_vessel(around, along), 1, 0.45, thickness);
  body.name = "vessel";
  body.curved = true;
  body.rest = Rest::curved;
  body.membrane = membrane;
  body.material.density = 1.1e-9;
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& p) { return p.z() < 1e-9 || p.z() > 60 - 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{0.013, true}, {}});
  return model;
}

RunSettings seconds(double duration) {
  RunSettings settings;
  settings.kind = DynamicRun{duration, 0.04, {}, Integrator::backward_euler};
  return settings;
}

double largest(const State& state) {
  double most = 0;
  for (const Vec3& u : state.displacement) {
    most = std::max(most, u.norm());
  }
  return most;
}

TEST(Vessel, ComesToRestWhereTheStaticRunDoes) {
  for (const double thickness : {3.0, 1.0}) {
    for (const std::size_t along : {10, 20}) {
      const Model model = vessel(20, along, thickness);
      const double at_rest = largest(last_state(model, nonlinear_run({0.5, 1})));
      EXPECT_NEAR(largest(last_state(model, seconds(0.4))), at_rest, 1e-6 * at_rest) << thickness << ' ' << along;
    }
  }
}

std::string message_of(const Model& model, const RunSettings& settings) {
  try {
    solve(model, settings, [](const State& state) {
      for (const Vec3& u : state.displacement) {
        ASSERT_TRUE(u.allFinite());
      }
    });
  } catch (const RequirementError& error) {
    return error.what();
  }
  return "";
}

TEST(Vessel, ThinWallCarriesTheLoadThatTheMembraneCan) {
  // Of 13 kPa 0.3 mm carry all; flat facets agree. Drilling moments against the facets made 2.8 kPa of it.
  for (const Membrane membrane : {Membrane::adapt, Membrane::cst}) {
    const State state = last_state(vessel(20, 10, 0.3, membrane), nonlinear_run({0.5, 1}));
    EXPECT_TRUE(state.converged);
    EXPECT_NEAR(largest(state), 10.2, 0.3);
  }
}

class ThinVessel : public testing::TestWithParam<Membrane> {};
INSTANTIATE_TEST_SUITE_P(Vessel, ThinVessel, testing::Values(Membrane::adapt, Membrane::cst),
                         [](const auto& p) { return p.param == Membrane::cst ? "cst" : "adapt"; });

TEST_P(ThinVessel, EndsWithTheLimitLoadNamed) {
  const Model model = vessel(20, 10, 0.1, GetParam());
  for (const RunSettings& settings : {seconds(0.4), nonlinear_run({0.5, 1})}) {
    const std::string message = message_of(model, settings);
    EXPECT_THAT(message, testing::HasSubstr("limit load"));
    EXPECT_THAT(message, testing::HasSubstr("of 13 kPa on vessel, 0.1 mm thick"));
    std::smatch found;
    ASSERT_TRUE(std::regex_search(message, found, std::regex("([0-9.]+) kPa of"))) << message;
    EXPECT_NEAR(std::stod(found[1]), 5.5, 0.2);
  }
}

TEST(Vessel, LastGoodStateIsHandedOverWhateverIsWanted) {
  Model model = vessel(10, 10, 0.1);
  model.loads[0].ramp = Ramp{{{0, 0}, {1, 1}}};
  RunSettings settings = seconds(1);
  settings.every = 1000;
  double last = -1;
  std::string message;
  try {
    solve(model, settings, [&](const State& state) { last = state.time; });
  } catch (const RequirementError& error) {
    message = error.what();
  }
  std::smatch found;
  ASSERT_TRUE(std::regex_search(message, found, std::regex("last good state is at ([0-9.]+) s"))) << message;
  EXPECT_GT(last, 0);
  EXPECT_NEAR(std::stod(found[1]), last, 1e-6);
}

TEST(Vessel, NoThicknessEndsInNonsense) {
  for (const double thickness : {0.1, 0.01}) {
    EXPECT_THAT(message_of(vessel(10, 10, thickness), seconds(0.08)), testing::HasSubstr("limit load")) << thickness;
  }
}

}  // namespace
}  // namespace tunica
