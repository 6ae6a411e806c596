#include "tunica/io/result/shell_deck.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/result/detail/decks.hpp"

#include <fmt/format.h>

namespace tunica {
namespace {

[[noreturn]] void refuse(Deck deck, const std::string& what) {
  throw UsageError(fmt::format("--export {}: {}; leave it out", deck == Deck::inp ? "inp" : "feb", what));
}

void require_loads(const Model& model, bool linear, Deck deck) {
  for (const Load& load : model.loads) {
    if (!load.ramp.points.empty()) {
      refuse(deck, "a load has a ramp, and the file has one step in which loads grow in proportion");
    }
    if (std::holds_alternative<MomentLoad>(load.kind)) {
      refuse(deck, "the file has no moments");
    }
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure != nullptr && std::ranges::any_of(pressure->shares, [](double share) { return share < 1; })) {
      refuse(deck, "the file presses whole bodies, and a pressure acts on a region (where)");
    }
    if (deck == Deck::inp && pressure != nullptr && !pressure->follower && !linear) {
      refuse(deck, "in a nonlinear step of the file pressure follows the surface (follower = true)");
    }
    if (deck == Deck::feb &&
        (std::holds_alternative<GravityLoad>(load.kind) || std::holds_alternative<EdgeLoad>(load.kind))) {
      refuse(deck, "the file has neither gravity nor edge loads");
    }
  }
}

// FEBio's shells have no rotations: their other face moves instead.
void require_no_lone_rotations(const Model& model) {
  for (const HeldNode& held : held_nodes(model, 1)) {
    for (std::size_t k = 0; k < 3; ++k) {
      const bool director = held.rotation[(k + 1) % 3] && held.rotation[(k + 2) % 3];
      if (director && !held.translation[k]) {
        refuse(Deck::feb, "rotations are held where displacements are free, which FEBio's shells do not know");
      }
    }
    if (int{held.rotation[0]} + int{held.rotation[1]} + int{held.rotation[2]} == 1) {
      refuse(Deck::feb, "one rotation alone is held, which FEBio's shells do not know");
    }
  }
}

}  // namespace

std::string deck_number(double value) { return fmt::format("{:.13g}", value); }

void require_expressible(const Model& model, const RunSettings& run, Deck deck) {
  const auto* statics = std::get_if<StaticRun>(&run.kind);
  if (statics == nullptr) {
    refuse(deck, "the file holds a static step, and the run is not static");
  }
  if (deck == Deck::feb && statics->linear) {
    refuse(deck, "FEBio solves nonlinear problems, and the run is linear");
  }
  if (!model.solids.empty() || !model.rigids.empty()) {
    refuse(deck, "the file holds shells alone, and the scene has solids or rigid bodies");
  }
  if (!model.contacts.empty() || !model.attachments.empty()) {
    refuse(deck, "the file holds neither contact nor attachments");
  }
  for (const Fix& fix : model.fixes) {
    if (!fix.ramp.points.empty()) {
      refuse(deck, "a fix has a ramp, and the file has one step in which displacements grow in proportion");
    }
    if (fix.across) {
      refuse(deck, "the file holds nodes along the axes of the world, and rims slide in planes of their own");
    }
  }
  if (!model.supports.empty()) {
    refuse(deck, "the file has no elastic beds, and a shell lies in one");
  }
  if (model.is_imaged_under_pressure()) {
    refuse(deck, "the file has no prestress, and the wall is imaged under pressure");
  }
  require_loads(model, statics->linear, deck);
  if (deck == Deck::feb) {
    require_no_lone_rotations(model);
  }
}

std::string deck_text(const Model& model, const RunSettings& run, Deck deck, const std::string& made_by) {
  require_expressible(model, run, deck);
  const auto& statics = std::get<StaticRun>(run.kind);
  const QuadraticShells shells = quadratic_shells(model, last_factor(statics));
  return deck == Deck::inp ? inp_text(model, shells, statics, made_by) : feb_text(model, shells, statics, made_by);
}

}  // namespace tunica
