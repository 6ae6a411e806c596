#include "tunica/mechanics/runs/detail/places.hpp"

#include <fmt/format.h>

namespace tunica {

std::string named(const std::string& said_at, const std::string& name) {
  return said_at.empty() ? name : said_at + ": " + name;
}

std::string where(const Vec3& p) { return fmt::format("({:.4g}, {:.4g}, {:.4g}) mm", p.x(), p.y(), p.z()); }

}  // namespace tunica
