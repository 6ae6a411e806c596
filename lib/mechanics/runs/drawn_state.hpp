#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <array>
#include <vector>

namespace tunica {

enum class Colouring {
  membrane,      ///< von Mises stress of the mean over the wall; of solids of the stress
  stress,        ///< von Mises: of shells the larger of both faces
  displacement,  ///< its length
  strain,        ///< the largest principal one: as stress
};

/// A state of all bodies that deform, as it is drawn.
struct DrawnState {
  TriangleMesh reference;  ///< mm: the curved shells, welded where patches do not quite meet; solids' outer faces
  std::vector<Vec3> displacement;                      ///< #V, mm
  std::vector<std::array<std::size_t, 2>> edges;       ///< of the shells, in pieces: vertices of the reference
  std::vector<double> values;                          ///< #V, MPa, mm or 1
  std::vector<std::array<std::size_t, 4>> tetrahedra;  ///< of solids: vertices of the reference
};

/// What a picture shows of a state. Limits: a model without bodies that deform has no picture.
DrawnState drawn_state(const Model& model, const State& state, const ElementFields& fields, Colouring colour);

/// All rigid bodies at a time, as rigid_surface().
TriangleMesh drawn_rigids(const Model& model, double time, const Vec3& near, double reach);

}  // namespace tunica
