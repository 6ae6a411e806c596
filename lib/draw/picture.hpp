#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tunica {

struct PictureOptions {
  std::string title = {};              ///< what is shown; empty: none
  std::string caption = {};            ///< a second, smaller line below the title
  std::string quantity = "Distance";   ///< what the colours stand for, above the colour bar
  std::string unit = "mm";             ///< of the values
  std::optional<double> maximum = {};  ///< in that unit, > 0, the top of the colour bar; none: the largest value, up to
                                       ///< a round number
  std::optional<double> diagonal = {};  ///< in that unit, > 0; gives the colour bar a second scale in percent of it
  std::vector<std::array<Vec3, 2>> lines =
      {};  ///< mm, segments on the surface drawn dark where there is room between them, e.g. the edges of the shells
  TriangleMesh others = {};   ///< drawn grey and from outside only: rigid bodies
  TriangleMesh outline = {};  ///< its outer line is drawn over everything: the unloaded shape
  std::string outline_name = {};
  std::string axes = "xyz";  ///< a letter for where each axis of the frame points, e.g. LPS
};

/// Draws a surface, coloured by a value per vertex, from two opposite sides, with a colour bar, a scale of lengths and
/// a ring around the largest value. @return a PNG of 1600 x 900. The views are along an axis of the frame, a little
/// from the right and above: the front (-y) and the back (+y) with z up, unless another side of the bounding
/// box of all that is drawn is larger by a quarter or more: values and mesh decide nothing. The same
/// input gives the same bytes whatever the number of threads.
/// Errors: InputError: no triangle, a corner that does not exist, a position that is not finite, not one value per
/// vertex, a diagonal or maximum that is not finite and above zero.
/// @param surface  at least one triangle, finite positions, mm
/// @param values   #V values >= 0; what is not finite is drawn grey and does not count. Empty: a plain surface
/// Cost: 20,000 triangles in about 0.1 s.
/// Limits: a pocket that neither side shows stays hidden; the letters are Latin, Greek and Cyrillic ones.
std::string surface_picture(const TriangleMesh& surface, const std::vector<double>& values,
                            const PictureOptions& options);

/// What is drawn at one moment.
struct PictureMoment {
  TriangleMesh surface;  ///< mm
  std::vector<double> values;
  std::vector<std::array<Vec3, 2>> lines;
  TriangleMesh others;
  std::string when;  ///< written below it
};

/// What of the surface lies beyond a plane is not drawn.
struct PictureCut {
  Vec3 normal;        ///< unit
  double offset = 0;  ///< mm

  /// mm: above zero it is not drawn.
  [[nodiscard]] double beyond(const Vec3& p) const { return normal.dot(p) - offset; }
};

/// Adds the faces at which a plane cuts tetrahedra open. @param tetrahedra  between vertices of the moment's surface,
/// which have values
void add_section(const PictureCut& cut, const std::vector<std::array<std::size_t, 4>>& tetrahedra,
                 PictureMoment& moment);

/// Draws moments of a motion or a path from one place, in rows, by one colour bar, which ends at the largest value of
/// all. What is cut is seen from where the rest was. @return, errors, cost: as surface_picture(); InputError too where
/// there is no moment, or a normal that is no unit vector.
/// @param options  lines, others and outline are left out
std::string moments_picture(const std::vector<PictureMoment>& moments, const PictureOptions& options,
                            const std::optional<PictureCut>& cut);

/// surface_picture() of a surface that is moved, its edges drawn dark, with the outline of the reference where it
/// differs visibly. The caption ends with magnification_text(). Errors: InputError
/// as surface_picture(), and not one displacement per vertex, an edge without vertices, a magnification that is none.
/// @param displacement  #V, mm
/// @param edges         vertices at both ends
/// @param magnify       > 0: displacements are drawn that many times as large
/// @param look          the rest: lines and outline are set here
std::string moved_picture(const TriangleMesh& reference, const std::vector<Vec3>& displacement,
                          const std::vector<std::array<std::size_t, 2>>& edges, const std::vector<double>& values,
                          double magnify, PictureOptions look);

/// How many times as large displacements are drawn, for a caption.
std::string magnification_text(double magnify);

/// To the right, upward, and towards the viewer of the first of surface_picture()'s two views, of points in mm, at
/// least one: unit vectors. Errors: InputError: none, or one that is not finite.
std::array<Vec3, 3> picture_axes(const std::vector<Vec3>& points);

/// The colours of surfaces, evenly spaced from zero to the largest value: red, green, blue in sRGB, linear between
/// them.
std::span<const std::array<std::uint8_t, 3>> surface_colours();

/// The colour of a value in the pictures: red, green, blue in sRGB, 0 to 1.
/// @param part  of the largest value, 0 to 1; grey where it is no number
std::array<double, 3> bar_colour(double part);

}  // namespace tunica
