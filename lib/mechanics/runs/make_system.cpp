#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/detail/loads.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/detail/terms.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

double mean_thickness(const ShellBody& body, const std::array<Index, 3>& triangle) {
  if (body.thickness.size() == 1) {
    return body.thickness[0];
  }
  return (body.thickness[triangle[0]] + body.thickness[triangle[1]] + body.thickness[triangle[2]]) / 3;
}

/// Area-weighted mean of the facets' normals at every vertex.
std::vector<Vec3> facet_normals_at_vertices(const ShellMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3 n = (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    for (const Index v : t) {
      normals[v] += n;
    }
  }
  for (Vec3& n : normals) {
    n.normalize();
  }
  return normals;
}

/// First fit: the smallest colour that no element around its nodes has yet. 64 colours are plenty for a mesh of sane
/// valence; a node of a higher valence opens further groups.
class Colouring {
public:
  explicit Colouring(std::size_t nodes) : taken_(nodes) {}

  template <typename Nodes>
  std::size_t next(const Nodes& nodes) {
    std::size_t colour = 0;
    while (std::any_of(nodes.begin(), nodes.end(),
                       [&](Index v) { return colour < taken_[v].size() && taken_[v][colour]; })) {
      ++colour;
    }
    for (const Index v : nodes) {
      if (taken_[v].size() <= colour) {
        taken_[v].resize(colour + 1, false);
      }
      taken_[v][colour] = true;
    }
    return colour;
  }

private:
  std::vector<std::vector<bool>> taken_;
};

void colour_elements(ShellSystem& system) {
  Colouring colouring(system.node_count());
  for (std::size_t e = 0; e < system.elements.size(); ++e) {
    const std::size_t colour = colouring.next(system.elements[e].nodes);
    if (system.colours.size() <= colour) {
      system.colours.resize(colour + 1);
    }
    std::vector<Batch>& batches = system.colours[colour];
    if (batches.empty() || batches.back().count == lane_count ||
        system.elements[batches.back().elements[0]].curved != system.elements[e].curved) {
      batches.emplace_back();
      batches.back().elements.fill(narrow<Index>(e));
    }
    batches.back().elements[batches.back().count++] = narrow<Index>(e);
  }
  Colouring of_solids(system.node_count());
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    const std::size_t colour = of_solids.next(system.solids[e].nodes);
    if (system.solid_colours.size() <= colour) {
      system.solid_colours.resize(colour + 1);
    }
    system.solid_colours[colour].push_back(narrow<Index>(e));
  }
}

void find_pieces(ShellSystem& system) {
  const Model& model = *system.model;
  DisjointSets joined(system.node_count());
  for (const ShellElement& e : system.elements) {
    joined.join(e.nodes[0], e.nodes[1]);
    joined.join(e.nodes[0], e.nodes[2]);
  }
  std::vector<std::size_t> piece_of(system.node_count(), SIZE_MAX);
  for (const SolidElement& e : system.solids) {
    for (std::size_t k = 1; k < 4; ++k) {
      joined.join(e.nodes[0], e.nodes[k]);
    }
  }
  for (std::size_t body = 0; body < model.body_count(); ++body) {
    for (std::size_t i = model.first_node(body); i < model.first_node(body + 1); ++i) {
      if (system.used[i] == 0) {
        continue;
      }
      std::size_t& piece = piece_of[joined.root(narrow<Index>(i))];
      if (piece == SIZE_MAX) {
        piece = system.pieces.size();
        system.pieces.push_back({body, {}});
      }
      system.pieces[piece].nodes.push_back(narrow<Index>(i));
    }
  }
}

/// What round_off() needs. The element matrices themselves, not E t: those of a sliver are larger by the square of its
/// edge over its height, and so is the noise that one unit in the last place of a rotation makes there.
void add_stiffness_norms(ShellSystem& system) {
  double translation = 0;
  double rotation = 0;
  for (const auto& term : system.terms) {
    const auto [by_displacement, by_rotation] = term->squared_stiffness(system);
    translation += by_displacement;
    rotation += by_rotation;
  }
  system.translation_stiffness = std::sqrt(translation);
  system.rotation_stiffness = std::sqrt(rotation);
}

void add_solids(ShellSystem& system, double& edges) {
  const Model& model = *system.model;
  system.first_solid_node = system.reference.size();
  for (std::size_t s = 0; s < model.solids.size(); ++s) {
    const SolidBody& body = model.solids[s];
    const std::size_t number = model.shells.size() + s;
    const auto offset = narrow<Index>(model.first_node(number));
    system.reference.insert(system.reference.end(), body.mesh.vertices.begin(), body.mesh.vertices.end());
    for (const auto& v : body.mesh.tetrahedra) {
      Corners4 corners;
      for (int k = 0; k < 4; ++k) {
        corners.col(k) = body.mesh.vertices[v[k]];
      }
      SolidElement element = make_solid_element(corners, body.material, body.law);
      element.body = number;
      for (int k = 0; k < 4; ++k) {
        element.nodes[k] = v[k] + offset;
        system.used[element.nodes[k]] = 1;
        for (int l = 0; l < k; ++l) {
          edges += (corners.col(k) - corners.col(l)).norm();
        }
      }
      system.solids.push_back(element);
    }
  }
}

}  // namespace

void stiffen_short_waves(ShellSystem& system) {
  for (ShellElement& element : system.elements) {
    element.skewing = element.short_waves;
  }
}

bool has_soft_waves(const ShellSystem& system) {
  return std::any_of(system.elements.begin(), system.elements.end(),
                     [](const ShellElement& element) { return element.thinness > 3; });
}

void make_pattern(ShellSystem& system, const std::vector<std::array<Index, 2>>& pairs) {
  std::vector<std::vector<Index>> neighbours(system.node_count());
  const auto join = [&](const auto& nodes) {
    for (const Index i : nodes) {
      for (const Index j : nodes) {
        neighbours[i].push_back(j);
      }
    }
  };
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    neighbours[i].push_back(narrow<Index>(i));
  }
  for (const ShellElement& e : system.elements) {
    join(e.nodes);
  }
  for (const SolidElement& e : system.solids) {
    join(e.nodes);
  }
  for (const auto& pair : pairs) {
    join(pair);
  }
  for (std::vector<Index>& of_node : neighbours) {
    std::sort(of_node.begin(), of_node.end());
    of_node.erase(std::unique(of_node.begin(), of_node.end()), of_node.end());
  }
  add_carried_pairs(system.carried, neighbours);
  system.pattern = make_block_matrix(neighbours);
  const auto place = [&](const auto& nodes, auto& placement) {
    const std::size_t count = nodes.size();
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        placement[count * i + j] = system.pattern.find(nodes[i], nodes[j]);
      }
    }
  };
  system.placement.resize(system.elements.size());
  for (std::size_t e = 0; e < system.elements.size(); ++e) {
    place(system.elements[e].nodes, system.placement[e]);
  }
  system.solid_placement.resize(system.solids.size());
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    place(system.solids[e].nodes, system.solid_placement[e]);
  }
}

ShellSystem make_system(const Model& model) {
  ShellSystem system;
  system.model = &model;
  const std::size_t nodes = model.node_count();
  system.reference.reserve(nodes);
  system.used.assign(nodes, 0);
  system.first_element.push_back(0);
  double edges = 0;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const auto offset = narrow<Index>(model.first_node(b));
    system.reference.insert(system.reference.end(), body.mesh.vertices.begin(), body.mesh.vertices.end());
    const std::vector<Vec3> at_vertices = facet_normals_at_vertices(body.mesh);
    const bool curved = body.curved && body.rest == Rest::curved;
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      const auto& v = body.mesh.triangles[t];
      const std::array<Vec3, 3> corners{body.mesh.vertices[v[0]], body.mesh.vertices[v[1]], body.mesh.vertices[v[2]]};
      const Vec3 facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
      const double thickness = mean_thickness(body, v);
      // The patch of a flat part is its facet, whatever is said of normals.
      constexpr double unlike = 1e-12;
      const bool flat_around =
          std::ranges::all_of(v, [&](Index node) { return (at_vertices[node] - facet).squaredNorm() < unlike; });
      ShellSurface surface;
      surface.curved = (curved || flat_around) && body.membrane == Membrane::adapt;
      std::array<Vec3, 3> bulge;  // the normals that tell how far the shell bulges over an edge
      for (std::size_t k = 0; k < 3; ++k) {
        surface.normals[k] = curved ? body.mesh.normal(t, k) : facet;
        bulge[k] = curved ? surface.normals[k] : at_vertices[v[k]];
      }
      const double scale = body.membrane == Membrane::adapt ? adapted_scale(corners, bulge, thickness) : 1;
      ShellElement element =
          make_shell_element(corners, surface, body.material, thickness, body.membrane, body.bending, scale);
      element.body = b;
      for (std::size_t k = 0; k < 3; ++k) {
        element.nodes[k] = v[k] + offset;
        system.used[element.nodes[k]] = 1;
        edges += (corners[(k + 1) % 3] - corners[k]).norm();
      }
      system.normals.push_back(surface.normals);
      system.heights.push_back(patch_height(corners, surface.normals));
      system.elements.push_back(element);
    }
    system.first_element.push_back(system.elements.size());
  }
  add_solids(system, edges);
  system.length = edges / real(std::max<std::size_t>(1, 3 * system.elements.size() + 6 * system.solids.size()));
  if (!model.solids.empty() || !model.attachments.empty() || !model.contacts.empty()) {
    system.surfaces = surface_faces(model);
  }
  system.carried = carried_nodes(model, system.surfaces, system.reference);
  if (!model.contacts.empty()) {
    system.contact = std::make_shared<ContactSystem>(model, system.surfaces, system.reference, system.carried);
  }
  system.area = VectorX::Zero(nodes);
  system.mass = system.area;
  system.inertia = system.area;
  for (const ShellElement& e : system.elements) {
    const double mass = model.shells[e.body].material.density.value_or(0) * e.thickness * e.area / 3;
    for (const Index node : e.nodes) {
      system.area[node] += e.area / 3;
      system.mass[node] += mass;
      system.inertia[node] += mass * e.thickness * e.thickness / 12;
    }
  }
  for (const SolidElement& e : system.solids) {
    const double density = model.solids[e.body - model.shells.size()].material.density.value_or(0);
    for (const Index node : e.nodes) {
      system.mass[node] += density * e.volume / 4;
    }
  }
  keep_held_edges(system);
  make_terms(system);
  add_stiffness_norms(system);

  make_pattern(system, {});
  colour_elements(system);
  find_pieces(system);

  make_loads(system);
  make_supports(system);
  return system;
}

}  // namespace tunica
