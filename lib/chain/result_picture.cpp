#include "tunica/chain/result_picture.hpp"

#include "tunica/draw/picture.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <array>

namespace tunica::chain {
namespace {

/// How values are told to people, in the order of Colouring.
struct ShownQuantity {
  const char* title;
  const char* name;
  const char* unit;
  double per_unit;  ///< units in MPa, mm or 1
};

// Stresses as on the report's page, whatever their size: pictures of a cohort stand beside each other.
constexpr std::array<ShownQuantity, 4> shown_quantities{
    {{"Membrane stress (von Mises)", "Membrane stress", "kPa", 1000},
     {"Stress at the faces (von Mises)", "Stress at the faces", "kPa", 1000},
     {"Displacement", "Displacement", "mm", 1},
     {"Largest principal strain", "Strain", "%", 100}}};

}  // namespace

std::string result_picture(const Model& model, const State& state, const ElementFields& fields,
                           const ResultPictureOptions& options) {
  DrawnState drawn = drawn_state(model, state, fields, options.colour);
  const ShownQuantity& quantity = shown_quantities.at(static_cast<std::size_t>(options.colour));
  for (double& value : drawn.values) {
    value *= quantity.per_unit;
  }
  PictureOptions look;
  look.title = fmt::format("{} {}", quantity.title, options.when);
  look.quantity = quantity.name;
  look.unit = quantity.unit;
  if (options.range) {
    look.maximum = *options.range * quantity.per_unit;
  }
  look.outline_name = options.is_unloaded ? "unloaded" : "as imaged";
  const Index first = drawn.reference.triangles.front()[0];
  const Vec3 middle = drawn.reference.vertices[first] + options.magnify * drawn.displacement[first];
  look.others = drawn_rigids(model, state.time, middle, diagonal(drawn.reference));
  return moved_picture(drawn.reference, drawn.displacement, drawn.edges, drawn.values, options.magnify,
                       std::move(look));
}

}  // namespace tunica::chain
