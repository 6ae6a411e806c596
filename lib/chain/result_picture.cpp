#include "tunica/chain/result_picture.hpp"

#include "tunica/draw/picture.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
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

PictureMoment moment_of(DrawnState drawn, double magnify, const std::optional<PictureCut>& cut) {
  PictureMoment moment;
  moment.surface = std::move(drawn.reference);
  moment.values = std::move(drawn.values);
  for (std::size_t v = 0; v < drawn.displacement.size(); ++v) {
    moment.surface.vertices[v] += magnify * drawn.displacement[v];
  }
  for (const auto& [from, to] : drawn.edges) {
    moment.lines.push_back({moment.surface.vertices[from], moment.surface.vertices[to]});
  }
  if (cut) {
    add_section(*cut, drawn.tetrahedra, moment);
  }
  return moment;
}

}  // namespace

std::string result_picture(const Model& model, const std::vector<PicturedState>& states,
                           const ResultPictureOptions& options) {
  const ShownQuantity& quantity = shown_quantities.at(static_cast<std::size_t>(options.colour));
  PictureOptions look;
  look.quantity = quantity.name;
  look.unit = quantity.unit;
  look.caption = options.caption.empty() ? "" : options.caption + ". ";
  look.axes = options.axes;
  look.outline_name = options.is_unloaded ? "unloaded" : "as imaged";
  if (options.range) {
    look.maximum = *options.range * quantity.per_unit;
  }
  std::vector<PictureMoment> moments;
  std::optional<PictureCut> cut;
  for (const auto& [state, fields, when] : states) {
    DrawnState drawn = drawn_state(model, state, fields, options.colour);
    for (double& value : drawn.values) {
      value *= quantity.per_unit;
    }
    const Index first = drawn.reference.triangles.front()[0];
    const Vec3 middle = drawn.reference.vertices[first] + options.magnify * drawn.displacement[first];
    TriangleMesh rigids = drawn_rigids(model, state.time, middle, diagonal(drawn.reference));
    if (options.moments.empty() && !options.cut) {
      look.title = fmt::format("{} {}", quantity.title, when);
      look.others = std::move(rigids);
      return moved_picture(drawn.reference, drawn.displacement, drawn.edges, drawn.values, options.magnify,
                           std::move(look));
    }
    if (options.cut && !cut) {
      const auto [lower, upper] = bounding_box(drawn.reference);
      cut = PictureCut{*options.cut, options.cut_at.value_or(options.cut->dot((lower + upper) / 2))};
    }
    moments.push_back(moment_of(std::move(drawn), options.magnify, cut));
    moments.back().others = std::move(rigids);
    moments.back().when = when;
  }
  const auto is_left = [&](const Vec3& p) { return !cut || cut->beyond(p) <= 0; };
  const bool shows = std::ranges::any_of(
      moments, [&](const PictureMoment& moment) { return std::ranges::any_of(moment.surface.vertices, is_left); });
  look.title = shows ? quantity.title : "The cut leaves nothing: all bodies lie beyond it";
  look.caption += magnification_text(options.magnify);
  return moments_picture(moments, look, cut);
}

}  // namespace tunica::chain
