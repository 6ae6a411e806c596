#include "tunica/mechanics/model/quadratic_shells.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/triangle_rule.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <map>

namespace tunica {
namespace {

using Edge = std::array<std::size_t, 2>;

Edge edge_of(std::size_t a, std::size_t b) { return {std::min(a, b), std::max(a, b)}; }

class QuadraticShellMaker {
public:
  QuadraticShellMaker(const Model& model, double factor) : model_(model), factor_(factor) {
    count_.resize(model.node_count(), 0);
    made_.nodes.reserve(model.node_count());
    for (std::size_t b = 0; b < model.shells.size(); ++b) {
      const std::vector<Vec3>& vertices = model.vertices_of(b);
      made_.nodes.insert(made_.nodes.end(), vertices.begin(), vertices.end());
    }
    made_.normals.resize(made_.nodes.size(), Vec3::Zero());
    made_.thickness.resize(made_.nodes.size(), 0);
  }

  QuadraticShells make() {
    for (std::size_t b = 0; b < model_.shells.size(); ++b) {
      add_body(b);
    }
    for (std::size_t n = 0; n < made_.nodes.size(); ++n) {
      if (n >= model_.node_count()) {
        made_.nodes[n] /= real(count_[n]);
      }
      if (count_[n] > 0) {
        made_.normals[n].normalize();
      }
    }
    made_.forces.resize(made_.nodes.size(), Vec3::Zero());
    made_.held.resize(made_.nodes.size());
    for (const Load& load : model_.loads) {
      add_load(load);
    }
    hold();
    return std::move(made_);
  }

private:
  std::size_t middle(std::size_t a, std::size_t b) {
    const auto [place, is_new] = middles_.try_emplace(edge_of(a, b), made_.nodes.size());
    if (is_new) {
      made_.nodes.push_back(Vec3::Zero());
      made_.normals.push_back(Vec3::Zero());
      made_.thickness.push_back((made_.thickness[a] + made_.thickness[b]) / 2);
      count_.push_back(0);
    }
    return place->second;
  }

  void add_body(std::size_t b) {
    // Parameters (b2, b3) of the six nodes.
    static const std::array<Vec2, 6> places{Vec2(0, 0),   Vec2(1, 0),     Vec2(0, 1),
                                            Vec2(0.5, 0), Vec2(0.5, 0.5), Vec2(0, 0.5)};
    const ShellBody& body = model_.shells[b];
    const std::size_t first = model_.first_node(b);
    const auto thickness = [&](std::size_t v) { return body.thickness[body.thickness.size() > 1 ? v : 0]; };
    for (std::size_t v = 0; v < body.mesh.vertices.size(); ++v) {
      made_.thickness[first + v] = thickness(v);
    }
    QuadraticShells::Body part;
    part.first_element = made_.elements.size();
    part.elements = body.mesh.triangles.size();
    part.thickness = thickness(0);
    part.thickness_of_nodes =
        std::ranges::any_of(body.thickness, [&](double value) { return value != part.thickness; });
    const std::vector<CubicPatch> patches = curved_patches(body.mesh);
    for (std::size_t t = 0; t < patches.size(); ++t) {
      std::array<std::size_t, 6> element{};
      for (std::size_t k = 0; k < 3; ++k) {
        element[k] = first + body.mesh.triangles[t][k];
        part.corners.push_back(element[k]);
      }
      for (std::size_t k = 0; k < 3; ++k) {
        element[k + 3] = middle(element[k], element[(k + 1) % 3]);
        made_.nodes[element[k + 3]] += patches[t].point(places[k + 3]);
      }
      for (std::size_t k = 0; k < 6; ++k) {
        ++count_[element[k]];
        made_.normals[element[k]] += patches[t].normal(places[k]);
        part.nodes.push_back(element[k]);
      }
      made_.elements.push_back(element);
    }
    for (auto* list : {&part.corners, &part.nodes}) {
      std::ranges::sort(*list);
      list->erase(std::ranges::unique(*list).begin(), list->end());
    }
    made_.bodies.push_back(std::move(part));
  }

  void add_load(const Load& load) {
    const std::size_t first = model_.first_node(load.body);
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
      made_.bodies[load.body].pressure += factor_ * pressure->value;
    } else if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      for (const Index node : force->nodes) {
        made_.forces[first + node] += factor_ * force->total / real(force->nodes.size());
      }
    } else if (const auto* edges = std::get_if<EdgeLoad>(&load.kind)) {
      for (std::size_t i = 0; i < edges->edges.size(); ++i) {
        const auto& [a, b] = edges->edges[i];
        const Vec3 whole = share_of(edges->shares, i) * factor_ * edges->per_length *
                           (made_.nodes[first + b] - made_.nodes[first + a]).norm();
        made_.forces[first + a] += whole / 6;
        made_.forces[first + b] += whole / 6;
        made_.forces[middles_.at(edge_of(first + a, first + b))] += whole * (2.0 / 3);
      }
    } else if (const auto* area = std::get_if<AreaLoad>(&load.kind)) {
      const QuadraticShells::Body& body = made_.bodies[load.body];
      for (std::size_t e = body.first_element; e < body.first_element + body.elements; ++e) {
        add_force_per_area(made_.elements[e], factor_ * area->per_area);
      }
    }
  }

  /// Consistent with the six-node element: its shape functions times its area.
  void add_force_per_area(const std::array<std::size_t, 6>& element, const Vec3& per_area) {
    for (const auto& [l, weight] : triangle_rule()) {
      const std::array<double, 6> shape{l[0] * (2 * l[0] - 1), l[1] * (2 * l[1] - 1), l[2] * (2 * l[2] - 1),
                                        4 * l[0] * l[1],       4 * l[1] * l[2],       4 * l[2] * l[0]};
      const std::array<double, 6> by_b2{1 - 4 * l[0], 4 * l[1] - 1, 0, 4 * (l[0] - l[1]), 4 * l[2], -4 * l[2]};
      const std::array<double, 6> by_b3{1 - 4 * l[0], 0, 4 * l[2] - 1, -4 * l[1], 4 * l[1], 4 * (l[0] - l[2])};
      Vec3 along_b2 = Vec3::Zero();
      Vec3 along_b3 = Vec3::Zero();
      for (std::size_t k = 0; k < 6; ++k) {
        along_b2 += by_b2[k] * made_.nodes[element[k]];
        along_b3 += by_b3[k] * made_.nodes[element[k]];
      }
      const double area = weight * along_b2.cross(along_b3).norm() / 2;
      for (std::size_t k = 0; k < 6; ++k) {
        made_.forces[element[k]] += area * shape[k] * per_area;
      }
    }
  }

  void hold() {
    std::ranges::copy(held_nodes(model_, factor_), made_.held.begin());
    for (const auto& [edge, node] : middles_) {
      const HeldNode& a = made_.held[edge[0]];
      const HeldNode& b = made_.held[edge[1]];
      for (std::size_t k = 0; k < 3; ++k) {
        made_.held[node].translation[k] = a.translation[k] && b.translation[k];
        made_.held[node].rotation[k] = a.rotation[k] && b.rotation[k];
      }
      made_.held[node].displacement = (a.displacement + b.displacement) / 2;
    }
    for (const RigidMotionsFix& fix : model_.rigid_motions) {
      hold_rigid_motions(fix.body);
    }
  }

  void hold_rigid_motions(std::size_t b) {
    const QuadraticShells::Body& body = made_.bodies[b];
    DisjointSets<std::size_t> pieces(model_.node_count());
    for (std::size_t e = body.first_element; e < body.first_element + body.elements; ++e) {
      pieces.join(made_.elements[e][0], made_.elements[e][1]);
      pieces.join(made_.elements[e][0], made_.elements[e][2]);
    }
    std::map<std::size_t, std::vector<std::size_t>> nodes_of;
    for (const std::size_t node : body.corners) {
      nodes_of[pieces.root(node)].push_back(node);
    }
    for (const auto& [root, nodes] : nodes_of) {
      hold_piece(nodes);
    }
  }

  /// Three components of a first node, the two across the way to the farthest one, and of the node farthest from their
  /// line the one in which a turn about it moves that node most.
  void hold_piece(const std::vector<std::size_t>& nodes) {
    const std::size_t first = nodes.front();
    const auto from_first = [&](std::size_t node) { return Vec3(made_.nodes[node] - made_.nodes[first]); };
    const auto second = *std::ranges::max_element(nodes, {}, [&](std::size_t n) { return from_first(n).norm(); });
    const Vec3 axis = from_first(second);
    const auto third =
        *std::ranges::max_element(nodes, {}, [&](std::size_t n) { return axis.cross(from_first(n)).norm(); });
    Eigen::Index along = 0;
    Eigen::Index turned = 0;
    axis.cwiseAbs().maxCoeff(&along);
    axis.cross(from_first(third)).cwiseAbs().maxCoeff(&turned);
    made_.held[first].translation = {true, true, true};
    made_.held[second].translation = {along != 0, along != 1, along != 2};
    made_.held[third].translation[narrow<std::size_t>(turned)] = true;
  }

  const Model& model_;
  double factor_;
  QuadraticShells made_;
  std::vector<std::size_t> count_;       ///< of the triangles at a node
  std::map<Edge, std::size_t> middles_;  ///< node of each edge
};

}  // namespace

std::vector<HeldNode> held_nodes(const Model& model, double factor) {
  std::vector<HeldNode> nodes(model.node_count());
  for (const Fix& fix : model.fixes) {
    for (const Index node : fix.nodes) {
      HeldNode& held = nodes[model.first_node(fix.body) + node];
      for (std::size_t k = 0; k < 3; ++k) {
        held.rotation[k] = held.rotation[k] || fix.rotation[k];
        if (fix.translation[k]) {
          held.translation[k] = true;
          held.displacement[narrow<Eigen::Index>(k)] = factor * fix.displacement[narrow<Eigen::Index>(k)];
        }
      }
    }
  }
  return nodes;
}

QuadraticShells quadratic_shells(const Model& model, double factor) {
  return QuadraticShellMaker(model, factor).make();
}

}  // namespace tunica
