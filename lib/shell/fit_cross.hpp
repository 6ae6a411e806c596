#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// The pairs of shells that share no node and whose curved surfaces cross, each drawn by 16 triangles: crossings that
/// are shallower than the drawing's deviation, a few per cent of a patch's bulge, are not seen. Cost: n log n, 0.1 ms
/// per shell.
std::vector<std::array<Index, 2>> crossing_shells(const ShellMesh& shell);

/// Parts what crosses: the nodes of both patches are placed anew, as close to the target as they get, whatever error is
/// allowed; where that does not do, both are split. Where the target's own sheets do not cross, patches that are close
/// enough to it do not either. Steps that leave more pairs than before are taken back.
/// @param limit  mm: no error gets above this and above what it was; @param most  shells
/// @return how many pairs are left
std::size_t part_crossings(FitState& state, double limit, std::size_t most);

}  // namespace tunica
