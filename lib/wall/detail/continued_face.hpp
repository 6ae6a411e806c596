#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/surface/distance/signed_distance.hpp"

namespace tunica {

/// A face of a wall, continued beyond its rims by strips that go on as it ends: what is half of the wall away from it
/// then reaches over the rims.
class ContinuedFace {
public:
  /// @param half  mm, of the wall: over this length the direction of a strip is smoothed; reach  mm: how far it goes
  ContinuedFace(const Target& face, double half, double reach);

  [[nodiscard]] bool is_closed() const { return rims_.empty(); }
  [[nodiscard]] const TriangleMesh& mesh() const { return mesh_; }

  struct Hit : SignedDistance::Hit {
    bool at_end = false;  ///< on the end of a strip: there the sign means nothing
    bool on_strip = false;
  };
  [[nodiscard]] Hit at(const Vec3& p, Index guess) const;

  struct Rim {
    bool is_flat = false;        ///< lies in a plane that cuts the face at 30 degrees or more
    Vec3 middle = Vec3::Zero();  ///< of its vertices
    Vec3 away = Vec3::Zero();    ///< unit: its plane's normal, away from the face
  };
  /// The rim that is closest to a point. Errors: TUNICA_ASSERT of a closed face.
  struct AtRim {
    const Rim* rim;
    Vec3 point;
    double distance;
  };
  [[nodiscard]] AtRim nearest_rim(const Vec3& p) const;

private:
  void continue_rim(const Target& face, std::size_t number, double half, double reach);

  TriangleMesh mesh_;
  std::size_t face_triangles_;
  std::vector<Rim> rims_;
  const Target& face_;
  std::vector<std::size_t> first_segment_;  // of each rim, in the tree of the boundary
  std::optional<SignedDistance> distance_;
};

}  // namespace tunica
