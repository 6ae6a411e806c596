#pragma once

#include "tunica/report/detail/case_report.hpp"

namespace tunica::report {

/// How much room a page has for one case.
struct Room {
  std::size_t triangles = 0;  ///< of shells and of solids as drawn in 3-D, and half as many of the segmented surface
  std::size_t states = 0;     ///< at most
  std::size_t bytes = 0;      ///< of what moves in them, before it is packed; two states are drawn in any case
  int picture_longest = 0;    ///< pixels
  int slice = 0;              ///< pixels of each of nine
};

/// Rooms such that a page of so many cases stays below 25 MB.
Room room_for(std::size_t cases);

/// Reads the case's result, shells and surface and fills in what is drawn: what the picture is to show, its last
/// colour's stress by its own largest one, the packed organ, the resolved scene. What cannot be read is named in
/// `missing`. Cost: some 0.2 s for a surface of 10,000 triangles and as many shells as the pipeline makes.
void draw_organ(CaseReport& one, const Room& room);

/// Takes the pictures of what is to be seen. In a cohort the loaded organs of one kind share their last colour: the
/// largest 99th percentile of stress among them, so that one peak does not take the colours from all others.
void take_pictures(std::vector<CaseReport>& cases, const Room& room);

/// Fills in nine slices of the volume that the extraction read, with the shells' outline. What cannot be read is named
/// in `missing`. Cost: that of reading the volume, twice (it has to be the one that was read then).
void draw_slices(CaseReport& one, const Room& room);

}  // namespace tunica::report
