#include "tunica/surface/mesh/checks.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tunica {
namespace {

std::string near(const Vec3& p) { return fmt::format("near ({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z()); }

bool has_repeated_corner(const std::array<Index, 3>& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

bool has_no_height(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  const double coordinate = std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
  // Doubled area = longest edge times height; a height below the spacing of the coordinates is none.
  return !((b - a).cross(c - a).norm() > 4 * std::numeric_limits<double>::epsilon() * coordinate * longest);
}

// A half-edge at a vertex: the edge to `other`, the triangle, and whether it runs from the vertex to `other`.
struct Spoke {
  Index other;
  Index triangle;
  bool outgoing;
};

class Examiner {
public:
  explicit Examiner(const TriangleMesh& mesh)
      : mesh_(mesh), around_(incidence(mesh)), pieces_(mesh.triangles.size()), rim_(mesh.vertices.size()) {}

  MeshFacts run() {
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
      look_at_vertex(narrow<Index>(v));
    }
    look_at_triangles();
    facts_.triangles = mesh_.triangles.size();
    facts_.components = facts_.triangles - joined_pieces_;
    facts_.boundary_loops = rim_vertices_ - joined_rims_;
    facts_.euler = narrow<long>(facts_.vertices) - narrow<long>(facts_.edges) + narrow<long>(facts_.triangles);
    facts_.closed = facts_.boundary_edges == 0;
    facts_.oriented = facts_.inconsistent_edges == 0;
    facts_.manifold = facts_.non_manifold_edges == 0 && facts_.non_manifold_vertices == 0 &&
                      facts_.duplicate_triangles == 0 && repeated_corners_ == 0;
    return facts_;
  }

private:
  void look_at_vertex(Index v) {
    const auto triangles = around_.of(v);
    if (triangles.empty()) {
      ++facts_.unused_vertices;
      return;
    }
    ++facts_.vertices;
    if (!mesh_.vertices[v].allFinite() && facts_.non_finite_vertices++ == 0) {
      facts_.first_non_finite_vertex = fmt::format("vertex {}", v);
    }
    spokes_.clear();
    for (const Index t : triangles) {
      const auto& corners = mesh_.triangles[t];
      if (has_repeated_corner(corners)) {
        continue;
      }
      const std::size_t k = std::find(corners.begin(), corners.end(), v) - corners.begin();
      spokes_.push_back({corners[(k + 1) % 3], t, true});
      spokes_.push_back({corners[(k + 2) % 3], t, false});
    }
    std::sort(spokes_.begin(), spokes_.end(), [](const Spoke& l, const Spoke& r) {
      return std::pair(l.other, l.triangle) < std::pair(r.other, r.triangle);
    });
    bool edges_are_manifold = true;
    bool on_rim = false;
    fan_.resize(triangles.size());
    std::iota(fan_.begin(), fan_.end(), Index{0});
    std::size_t fans = spokes_.size() / 2;
    for (auto begin = spokes_.begin(); begin != spokes_.end();) {
      const auto end = std::find_if(begin, spokes_.end(), [&](const Spoke& s) { return s.other != begin->other; });
      const std::size_t count = end - begin;
      edges_are_manifold = edges_are_manifold && count <= 2;
      on_rim = on_rim || count == 1;
      fans -= join_fan(triangles, begin->triangle, (end - 1)->triangle);
      if (v < begin->other) {
        look_at_edge(v, {begin, end});
      }
      begin = end;
    }
    rim_vertices_ += on_rim ? 1 : 0;
    if (edges_are_manifold && fans > 1 && facts_.non_manifold_vertices++ == 0) {
      facts_.first_non_manifold_vertex = fmt::format("vertex {} {}", v, near(mesh_.vertices[v]));
    }
  }

  // Joins the fans of two triangles around one vertex. @return 1 when they were apart, else 0.
  std::size_t join_fan(std::span<const Index> triangles, Index one, Index other) {
    const auto local = [&](Index t) {
      auto i = narrow<Index>(std::lower_bound(triangles.begin(), triangles.end(), t) - triangles.begin());
      while (fan_[i] != i) {
        fan_[i] = fan_[fan_[i]];
        i = fan_[i];
      }
      return i;
    };
    const Index i = local(one);
    const Index j = local(other);
    fan_[std::max(i, j)] = std::min(i, j);
    return i != j ? 1 : 0;
  }

  void look_at_edge(Index v, std::span<const Spoke> sharing) {
    const Index w = sharing.front().other;
    const auto place = [&] {
      return fmt::format("between vertices {} and {} {}", v, w, near(0.5 * (mesh_.vertices[v] + mesh_.vertices[w])));
    };
    ++facts_.edges;
    for (const Spoke& spoke : sharing.subspan(1)) {
      joined_pieces_ += pieces_.join(sharing.front().triangle, spoke.triangle) ? 1 : 0;
    }
    if (sharing.size() == 1) {
      joined_rims_ += rim_.join(v, w) ? 1 : 0;
      if (facts_.boundary_edges++ == 0) {
        facts_.first_boundary_edge = place();
      }
    } else if (sharing.size() > 2) {
      if (facts_.non_manifold_edges++ == 0) {
        facts_.first_non_manifold_edge = place();
      }
      look_for_duplicates(sharing);
    } else {
      if (sharing[0].outgoing == sharing[1].outgoing && facts_.inconsistent_edges++ == 0) {
        facts_.first_inconsistent_edge = place();
      }
      look_for_duplicates(sharing);
    }
  }

  // Every pair of triangles on the same corners shares three edges: count it at the one without the largest corner.
  void look_for_duplicates(std::span<const Spoke> sharing) {
    for (std::size_t i = 1; i < sharing.size(); ++i) {
      auto later = mesh_.triangles[sharing[i].triangle];
      std::sort(later.begin(), later.end());
      const bool at_lowest_edge = sharing[i].other == later[1];
      for (std::size_t j = 0; j < i && at_lowest_edge; ++j) {
        auto earlier = mesh_.triangles[sharing[j].triangle];
        std::sort(earlier.begin(), earlier.end());
        if (earlier == later && sharing[i].triangle != sharing[j].triangle) {
          if (facts_.duplicate_triangles++ == 0) {
            facts_.first_duplicate_triangle = fmt::format("triangles {} and {} {}", sharing[j].triangle,
                                                          sharing[i].triangle, near(mesh_.vertices[later[0]]));
          }
          break;
        }
      }
    }
  }

  void look_at_triangles() {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& corners = mesh_.triangles[t];
      const bool repeated = has_repeated_corner(corners);
      repeated_corners_ += repeated ? 1 : 0;
      if ((repeated ||
           has_no_height(mesh_.vertices[corners[0]], mesh_.vertices[corners[1]], mesh_.vertices[corners[2]])) &&
          facts_.degenerate_triangles++ == 0) {
        facts_.first_degenerate_triangle = fmt::format("triangle {} {}", t, near(mesh_.vertices[corners[0]]));
      }
    }
  }

  const TriangleMesh& mesh_;
  const Incidence around_;
  MeshFacts facts_;
  DisjointSets<> pieces_;
  DisjointSets<> rim_;
  std::size_t joined_pieces_ = 0;
  std::size_t joined_rims_ = 0;
  std::size_t rim_vertices_ = 0;
  std::size_t repeated_corners_ = 0;
  std::vector<Spoke> spokes_;
  std::vector<Index> fan_;
};

std::string phrase(std::size_t count, const char* one, const char* many, const std::string& first) {
  return count == 1 ? fmt::format("one {}, {}", one, first) : fmt::format("{} {}, the first {}", count, many, first);
}

}  // namespace

void require_corners(std::size_t vertices, std::span<const std::array<Index, 3>> triangles) {
  if (vertices > max_index || triangles.size() > max_index) {
    throw InputError(fmt::format("a mesh of {} vertices and {} triangles: at most {} of each are understood", vertices,
                                 triangles.size(), max_index));
  }
  for (const auto& corners : triangles) {
    const Index largest = std::max({corners[0], corners[1], corners[2]});
    if (largest >= vertices) {
      throw InputError(
          fmt::format("triangle {} names vertex {}, but there are {}", &corners - triangles.data(), largest, vertices));
    }
  }
}

void require_valid(std::span<const Vec3> vertices, std::span<const std::array<Index, 3>> triangles) {
  require_corners(vertices.size(), triangles);
  for (const auto& corners : triangles) {
    for (const Index v : corners) {
      if (!std::isfinite(vertices[v].squaredNorm())) {
        throw InputError(fmt::format(
            "{}: vertex {} of triangle {} is at ({:.6g}, {:.6g}, {:.6g})",
            vertices[v].allFinite() ? "its vertices are too far apart to reckon with" : "a vertex is not finite", v,
            &corners - triangles.data(), vertices[v].x(), vertices[v].y(), vertices[v].z()));
      }
    }
  }
}

void require_surface(const TriangleMesh& mesh) {
  require_valid(mesh);
  if (mesh.triangles.empty()) {
    throw InputError("the surface has no triangles");
  }
}

MeshFacts examine(const TriangleMesh& mesh) { return Examiner(mesh).run(); }

TriangleMesh without_unused(TriangleMesh mesh) {
  require_corners(mesh.vertices.size(), mesh.triangles);
  std::vector<std::uint8_t> used(mesh.vertices.size(), 0);
  for (const auto& corners : mesh.triangles) {
    for (const Index v : corners) {
      used[v] = 1;
    }
  }
  std::vector<Index> number(mesh.vertices.size());
  Index count = 0;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    number[v] = count;
    if (used[v] != 0) {
      mesh.vertices[count++] = mesh.vertices[v];
    }
  }
  mesh.vertices.resize(count);
  for (auto& corners : mesh.triangles) {
    for (Index& v : corners) {
      v = number[v];
    }
  }
  return mesh;
}

std::optional<std::string> why_unfit(const MeshFacts& facts, Boundary boundary) {
  if (facts.triangles == 0) {
    return "it has no triangles";
  }
  if (facts.non_finite_vertices > 0) {
    return phrase(facts.non_finite_vertices, "vertex is not finite", "vertices are not finite",
                  facts.first_non_finite_vertex);
  }
  if (facts.non_manifold_edges > 0) {
    return phrase(facts.non_manifold_edges, "edge is shared by three or more triangles",
                  "edges are shared by three or more triangles", facts.first_non_manifold_edge);
  }
  if (facts.duplicate_triangles > 0) {
    return phrase(facts.duplicate_triangles, "triangle is there twice", "triangles are there twice",
                  facts.first_duplicate_triangle);
  }
  if (facts.non_manifold_vertices > 0) {
    return phrase(facts.non_manifold_vertices, "vertex joins parts that only touch there",
                  "vertices join parts that only touch there", facts.first_non_manifold_vertex);
  }
  if (facts.inconsistent_edges > 0) {
    return phrase(facts.inconsistent_edges, "edge lies between triangles that face opposite ways",
                  "edges lie between triangles that face opposite ways", facts.first_inconsistent_edge);
  }
  if (!facts.manifold) {
    return phrase(facts.degenerate_triangles, "triangle has a corner twice", "triangles are degenerate",
                  facts.first_degenerate_triangle);
  }
  if (boundary == Boundary::forbidden && !facts.closed) {
    return phrase(facts.boundary_edges, "edge has a triangle on one side only",
                  "edges have a triangle on one side only", facts.first_boundary_edge);
  }
  return std::nullopt;
}

}  // namespace tunica
