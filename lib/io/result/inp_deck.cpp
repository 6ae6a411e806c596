// CalculiX and Abaqus input. Source: CalculiX CrunchiX User's Manual 2.20, chapters 6 (shell elements, expansion) and 7
// (input deck format); Abaqus Keywords Reference for what both share.
#include "tunica/core/narrow.hpp"
#include "tunica/io/result/detail/decks.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

// Abaqus takes 256 characters to a line, of comments too. A name may hold anything.
std::string inp_comment(const std::string& text) {
  constexpr std::size_t longest = 200;
  std::string lines;
  for (std::size_t begin = 0; begin < text.size(); begin += longest) {
    lines += "** ";
    for (const char c : text.substr(begin, longest)) {
      lines += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    }
    lines += '\n';
  }
  return lines;
}

void add_inp_mesh(std::string& text, const Model& model, const QuadraticShells& shells) {
  text += "*NODE, NSET=NALL\n";
  for (std::size_t n = 0; n < shells.nodes.size(); ++n) {
    const Vec3& p = shells.nodes[n];
    text += fmt::format("{}, {}, {}, {}\n", n + 1, deck_number(p.x()), deck_number(p.y()), deck_number(p.z()));
  }
  for (std::size_t b = 0; b < shells.bodies.size(); ++b) {
    const QuadraticShells::Body& body = shells.bodies[b];
    text += inp_comment(fmt::format("BODY{}: {}", b + 1, model.shells[b].name));
    text += fmt::format("*ELEMENT, TYPE=S6, ELSET=BODY{}\n", b + 1);
    for (std::size_t e = body.first_element; e < body.first_element + body.elements; ++e) {
      text += fmt::format("{}", e + 1);
      for (const std::size_t node : shells.elements[e]) {
        text += fmt::format(", {}", node + 1);
      }
      text += '\n';
    }
  }
}

void add_inp_properties(std::string& text, const Model& model, const QuadraticShells& shells) {
  for (std::size_t b = 0; b < shells.bodies.size(); ++b) {
    const QuadraticShells::Body& body = shells.bodies[b];
    const Material& material = model.shells[b].material;
    text += fmt::format("*MATERIAL, NAME=MATERIAL{}\n*ELASTIC\n{}, {}\n", b + 1, deck_number(material.young),
                        deck_number(material.poisson));
    if (material.density) {
      text += fmt::format("*DENSITY\n{}\n", deck_number(*material.density));
    }
    text += fmt::format("*SHELL SECTION, ELSET=BODY{0}, MATERIAL=MATERIAL{0}{1}\n{2}\n", b + 1,
                        body.thickness_of_nodes ? ", NODAL THICKNESS" : "", deck_number(body.thickness));
    if (body.thickness_of_nodes) {
      text += "*NODAL THICKNESS\n";
      for (const std::size_t node : body.nodes) {
        text += fmt::format("{}, {}\n", node + 1, deck_number(shells.thickness[node]));
      }
    }
  }
}

void add_inp_boundary(std::string& text, const QuadraticShells& shells) {
  std::string lines;
  for (std::size_t n = 0; n < shells.held.size(); ++n) {
    const HeldNode& held = shells.held[n];
    for (std::size_t k = 0; k < 6; ++k) {
      if (k < 3 ? held.translation[k] : held.rotation[k - 3]) {
        const double value = k < 3 ? held.displacement[narrow<Eigen::Index>(k)] : 0;
        lines += fmt::format("{}, {}, {}{}\n", n + 1, k + 1, k + 1, value != 0 ? ", " + deck_number(value) : "");
      }
    }
  }
  text += lines.empty() ? "" : "*BOUNDARY\n" + lines;
}

void add_inp_loads(std::string& text, const Model& model, const QuadraticShells& shells, double factor) {
  std::string spread;
  for (std::size_t b = 0; b < shells.bodies.size(); ++b) {
    if (shells.bodies[b].pressure != 0) {
      spread += fmt::format("BODY{}, P, {}\n", b + 1, deck_number(shells.bodies[b].pressure));
    }
  }
  for (const Load& load : model.loads) {
    if (const auto* gravity = std::get_if<GravityLoad>(&load.kind)) {
      const Vec3 towards = gravity->acceleration.stableNormalized();
      spread += fmt::format("BODY{}, GRAV, {}, {}, {}, {}\n", load.body + 1,
                            deck_number(factor * gravity->acceleration.norm()), deck_number(towards.x()),
                            deck_number(towards.y()), deck_number(towards.z()));
    }
  }
  text += spread.empty() ? "" : "*DLOAD\n" + spread;
  std::string single;
  for (std::size_t n = 0; n < shells.forces.size(); ++n) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (const double force = shells.forces[n][k]; force != 0) {
        single += fmt::format("{}, {}, {}\n", n + 1, k + 1, deck_number(force));
      }
    }
  }
  text += single.empty() ? "" : "*CLOAD\n" + single;
}

}  // namespace

std::string inp_text(const Model& model, const QuadraticShells& shells, const StaticRun& run,
                     const std::string& made_by) {
  std::string text = "*HEADING\nShells of tunica: mm, N, MPa, tonne\n" + inp_comment("made by " + made_by);
  text += "** S6 is CalculiX's name of the element; for Abaqus replace TYPE=S6 by TYPE=STRI65\n";
  add_inp_mesh(text, model, shells);
  add_inp_properties(text, model, shells);
  constexpr int most_increments = 1000;
  text += fmt::format("*STEP, INC={}{}\n*STATIC\n", most_increments, run.linear ? "" : ", NLGEOM");
  if (!run.linear) {
    const double first = first_increment(run);
    constexpr double least = 1e-5;
    text += fmt::format("{}, 1., {}, {}\n", deck_number(first), deck_number(least), deck_number(std::max(first, 0.5)));
  }
  add_inp_boundary(text, shells);
  add_inp_loads(text, model, shells, last_factor(run));
  return text + "*NODE PRINT, NSET=NALL\nU\n*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n";
}

}  // namespace tunica
