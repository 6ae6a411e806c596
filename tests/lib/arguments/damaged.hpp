#pragma once

#include "tunica/core/error.hpp"
#include "tunica/core/types.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

/// What a caller may get wrong, and that it is told so.
namespace tunica::arguments {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();
/// No lengths, tolerances or widths.
inline const std::vector<double> no_numbers{nan, infinity, -infinity, -1.0};

/// A mesh of triangles and what is wrong with it.
template <typename Mesh>
struct Damaged {
  std::string how;
  Mesh mesh;
};

/// An index beyond the vertices, the largest there is, a coordinate that is not a number, infinite, or so large that
/// its square is; nothing at all.
template <typename Mesh>
std::vector<Damaged<Mesh>> damaged(const Mesh& good) {
  std::vector<Damaged<Mesh>> all;
  const auto add = [&](const char* how, const auto& damage) {
    all.push_back({how, good});
    damage(all.back().mesh);
  };
  add("index", [](Mesh& m) { m.triangles.back()[1] = static_cast<Index>(m.vertices.size()); });
  add("largest index", [](Mesh& m) { m.triangles.front()[2] = 0xffffffff; });
  add("nan", [](Mesh& m) { m.vertices[m.triangles[1][0]].y() = nan; });
  add("infinite", [](Mesh& m) { m.vertices[m.triangles[1][0]].z() = infinity; });
  add("far", [](Mesh& m) { m.vertices[m.triangles[1][0]].x() = 1e300; });
  add("no vertices", [](Mesh& m) { m.vertices.clear(); });
  return all;
}

/// A public function with the argument in question.
template <typename Argument>
struct Call {
  std::string name;
  std::function<void(const Argument&)> of;
};

inline void expect_refused(const std::string& what, const std::function<void()>& call) {
  try {
    call();
    ADD_FAILURE() << what << ": accepted";
  } catch (const InputError& error) {
    EXPECT_FALSE(std::string(error.what()).empty()) << what;
  } catch (const std::exception& error) {
    ADD_FAILURE() << what << ": " << error.what();
  }
}

/// Every call takes the good mesh and refuses every damaged one.
template <typename Mesh>
void expect_checked(const Mesh& good, const std::vector<Call<Mesh>>& calls) {
  for (const Call<Mesh>& call : calls) {
    EXPECT_NO_THROW(call.of(good)) << call.name;
    for (const auto& [how, mesh] : damaged(good)) {
      expect_refused(call.name + ", " + how, [&] { call.of(mesh); });
    }
  }
}

inline void expect_numbers_checked(const std::vector<Call<double>>& calls) {
  for (const Call<double>& call : calls) {
    for (const double value : no_numbers) {
      expect_refused(call.name + " " + std::to_string(value), [&] { call.of(value); });
    }
  }
}

}  // namespace tunica::arguments
