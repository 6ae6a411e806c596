#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <string>

/// A shell model for other finite-element programs: CalculiX and Abaqus (.inp), FEBio (.feb). The mesh, its wall and
/// material, loads and what is held, and one nonlinear (or, .inp, linear) static step; no result.
namespace tunica {

enum class Deck {
  inp,  ///< S6 of CalculiX; for Abaqus the type is to be called STRI65
  feb,  ///< FEBio 4 XML, tri6 shells
};

/// Throws UsageError that names what the file cannot express: solids, rigid bodies, contact, attachments; a run that is
/// not static; ramps; moments. Besides, .inp has no pressure of fixed direction in a nonlinear run; .feb no linear run,
/// no gravity, no edge loads, and of held rotations only those of a clamped edge or of a plane of symmetry.
void require_expressible(const Model& model, const RunSettings& run, Deck deck);

/// The file's text: mm, N, MPa, tonne. Nodes 1 ... #nodes are the model's in order, then come the middles of the edges,
/// on the curved surface. In .feb the nodes lie on the face that the normals point to, half a wall from the middle, as
/// FEBio takes them.
/// @param made_by  provenance, for the head of the file
/// Errors: as require_expressible().
/// Limits: an edge's middle is held where both its ends are, so that a free edge between two held nodes is held too.
std::string deck_text(const Model& model, const RunSettings& run, Deck deck, const std::string& made_by);

}  // namespace tunica
