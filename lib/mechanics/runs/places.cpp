#include "tunica/mechanics/runs/detail/places.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tunica {

std::string named(const std::string& said_at, const std::string& name) {
  return said_at.empty() ? name : said_at + ": " + name;
}

std::string label_of(const Model& model, std::size_t body) {
  const std::string& name = model.name_of(body);
  return named(model.is_solid(body) ? model.solids[body - model.shells.size()].said_at : model.shells[body].said_at,
               name);
}

std::string where(const Vec3& p) {
  constexpr double round_off = 1e-9;  // of the largest coordinate
  const double negligible = round_off * p.cwiseAbs().maxCoeff();
  const Vec3 shown = p.unaryExpr([&](double x) { return std::abs(x) < negligible ? 0 : x; });
  return fmt::format("({:.4g}, {:.4g}, {:.4g}) mm", shown.x(), shown.y(), shown.z());
}

}  // namespace tunica
