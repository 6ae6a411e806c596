#include "tunica/surface/decimation/detail/shape_patch.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/distance/facet_distances.hpp"
#include "tunica/surface/distance/surface_walk.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr std::size_t samples_per_triangle = 40;
constexpr std::size_t most_in_patch = 64;  // triangles of a change; larger ones are refused

double cosine(const Vec3& a, const Vec3& b) {
  const double lengths = a.norm() * b.norm();
  return lengths > 0 ? a.dot(b) / lengths : 1;
}

// The edge from corner k of new triangle i as the edge of another one: 3 j + l, or `most_edges` if there is none.
constexpr std::size_t most_edges = 3 * most_in_patch;
std::size_t other_edge(const PatchTrial& trial, std::size_t i, std::size_t k) {
  const Index from = trial.corners[i][k];
  const Index to = trial.corners[i][(k + 1) % 3];
  for (std::size_t j = 0; j < trial.corners.size(); ++j) {
    const auto& c = trial.corners[j];
    for (std::size_t l = 0; l < 3; ++l) {
      if (c[l] == to && c[(l + 1) % 3] == from) {
        return 3 * j + l;
      }
    }
  }
  return most_edges;
}

}  // namespace

TargetSamples sample_target(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree) {
  TargetSamples samples;
  // The target's vertices, every n-th in the order of its tree; with few of them the triangles' centres as well.
  const std::size_t wanted = samples_per_triangle * mesh.triangles.size();
  const double per_triangle = real(wanted) / real(target.triangles.size());
  std::vector<bool> taken(target.vertices.size(), false);
  double due = 0;
  for (const Index t : tree.spatial_order()) {
    due = std::min(due + per_triangle, 4.0);
    const auto& c = target.triangles[t];
    if (per_triangle >= 3 && due >= 1) {
      samples.points.push_back((target.vertices[c[0]] + target.vertices[c[1]] + target.vertices[c[2]]) / 3);
      due -= 1;
    }
    for (const Index v : c) {
      if (due >= 1 && !taken[v]) {
        taken[v] = true;
        samples.points.push_back(target.vertices[v]);
        due -= 1;
      }
    }
  }
  const ClosestPoint own(mesh);
  std::optional<Index> guess;
  for (const Vec3& p : samples.points) {
    const auto hit = guess ? own.closest(p, *guess) : own.closest(p);
    guess = hit.triangle;
    samples.owner.push_back(hit.triangle);
    samples.squared.push_back(hit.squared_distance);
  }
  samples.near.assign(mesh.triangles.size(), 0);
  return samples;
}

ShapedMesh::ShapedMesh(const TriangleMesh& mesh, const TriangleMesh& target, NearestPoint nearest,
                       TargetSamples samples, const BoundaryCurves& curves)
    : mesh_(mesh),
      target_(target),
      nearest_(std::move(nearest)),
      curves_(curves),
      parts_(
          truncated<int>(std::clamp(std::sqrt(real(target.triangles.size()) / real(mesh.triangles.size())), 4.0, 8.0))),
      sample_(std::move(samples.points)),
      on_target_(std::move(samples.on_target)),
      states_(mesh.triangles.size()),
      least_angle_(mesh.vertices.size(), not_pinned),
      shape_cost_(mesh.triangles.size(), unknown),
      middle_(mesh.triangles.size(), no_middles) {
  for (std::size_t t = 0; t < states_.size(); ++t) {
    states_[t].guess = samples.near[t];
  }
  std::vector<Index> owned(states_.size(), 0);
  for (const Index t : samples.owner) {
    ++owned[t];
  }
  for (std::size_t t = 0; t < states_.size(); ++t) {
    states_[t].samples.reserve(owned[t]);
  }
  for (std::size_t s = 0; s < sample_.size(); ++s) {
    State& state = states_[samples.owner[s]];
    state.samples.push_back(narrow<Index>(s));
    state.error = std::max(state.error, samples.squared[s]);
  }
  for (State& state : states_) {
    state.error = std::sqrt(state.error);
  }
  find_places();
}

void ShapedMesh::find_places() {
  places_.resize(mesh_.positions.size());
  if (curves_.empty()) {
    return;
  }
  for (const auto& loop : boundary_loops({mesh_.positions, mesh_.triangles})) {
    std::vector<Vec3> points;
    points.reserve(loop.size());
    for (const Index v : loop) {
      points.push_back(mesh_.positions[v]);
    }
    const Index curve = curves_.curve_of(points);
    for (const Index v : loop) {
      places_[v] = curves_.nearest(mesh_.positions[v], curve);
    }
  }
}

void ShapedMesh::set_weights(const ShapeWeights& weights) {
  const bool shapes_cost_the_same = weights.quality == weights_.quality && weights.angle == weights_.angle &&
                                    weights.angle_wanted == weights_.angle_wanted;
  if (!shapes_cost_the_same) {
    shape_cost_.assign(states_.size(), unknown);
  }
  weights_ = weights;
}

double ShapedMesh::cost(Index t) const {
  if (shape_cost_[t] < 0) {
    shape_cost_[t] = shape_cost(mesh_.triangles[t], corners(mesh_.triangles[t], {}));
  }
  return shape_cost_[t] + error_cost(states_[t].error);
}

std::array<Vec3, 3> ShapedMesh::corners(const std::array<Index, 3>& triangle, const PatchTrial& trial) const {
  std::array<Vec3, 3> result;
  for (std::size_t k = 0; k < 3; ++k) {
    result[k] = triangle[k] == trial.moved ? trial.position : mesh_.positions[triangle[k]];
  }
  return result;
}

double ShapedMesh::smallest_angle(Index t) const {
  return smallest_angle(mesh_.triangles[t], corners(mesh_.triangles[t], {}));
}

double ShapedMesh::smallest_angle(const std::array<Index, 3>& triangle, const std::array<Vec3, 3>& c) const {
  // Between two pinned vertices a triangle could be flat with a third angle of 180 degrees: it has no excuse.
  if (std::count_if(triangle.begin(), triangle.end(), [&](Index v) { return is_pinned(v); }) != 1) {
    return smallest_angle_degrees(c[0], c[1], c[2]);
  }
  double smallest = 180;
  for (std::size_t k = 0; k < 3; ++k) {
    const double angle = angle_degrees(c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
    if (!is_pinned(triangle[k]) || angle < least_angle_[triangle[k]]) {
      smallest = std::min(smallest, angle);
    }
  }
  return smallest;
}

bool ShapedMesh::pin(Index vertex, const Vec3& position, double least_angle) {
  PatchTrial trial;
  make_move(vertex, position, trial);
  if (!(evaluate(trial, infinity) < infinity)) {
    return false;
  }
  commit(trial);
  least_angle_[vertex] = least_angle;
  for (const Index t : mesh_.around[vertex]) {
    shape_cost_[t] = unknown;
  }
  return true;
}

std::optional<Vec3> ShapedMesh::farthest_sample(Index t) const {
  const auto c = corners(mesh_.triangles[t], {});
  const FlatTriangle flat(c[0], c[1], c[2]);
  std::optional<Vec3> farthest;
  double most = -1;
  for (const Index s : states_[t].samples) {
    const double squared = flat.squared_distance(sample_[s]);
    if (squared > most) {
      most = squared;
      farthest = sample_[s];
    }
  }
  return farthest;
}

double ShapedMesh::shape_cost(const std::array<Index, 3>& triangle, const std::array<Vec3, 3>& c) const {
  const double quality = radius_ratio(c[0], c[1], c[2]);
  double cost = weights_.quality * (1 - quality);
  // A ratio of 0.9 leaves no angle below 40 degrees: the isosceles triangle has 0.8999 there.
  if (quality < 0.9 && weights_.angle_wanted > 0) {
    const double lack = 1 - smallest_angle(triangle, c) / weights_.angle_wanted;
    cost += lack > 0 ? weights_.angle * lack * lack : 0;
  }
  return cost;
}

double ShapedMesh::error_cost(double error) const {
  double cost = error / weights_.error;
  for (int i = 0; i < weights_.doublings; ++i) {
    cost *= cost;
  }
  return cost;
}

bool ShapedMesh::faces_away(const std::array<Vec3, 3>& c, Index guess) const {
  const auto& [i, j, k] = target_.triangles[guess];
  return area_vector(c).dot(area_vector({target_.vertices[i], target_.vertices[j], target_.vertices[k]})) < 0;
}

double ShapedMesh::squared_of_samples(Index t, const std::array<Vec3, 3>& c) const {
  const FlatTriangle flat(c[0], c[1], c[2]);
  double squared = 0;
  for (const Index s : states_[t].samples) {
    squared = std::max(squared, flat.squared_distance(sample_[s]));
  }
  return squared;
}

void ShapedMesh::measure_corners(const NearestPoint& nearest) {
  vertex_error_.assign(mesh_.positions.size(), -1);
  for (std::size_t t = 0; t < states_.size(); ++t) {
    for (const Index v : mesh_.triangles[t]) {
      if (vertex_error_[v] < 0 && !on_target_.empty() && on_target_[v] != 0) {
        vertex_error_[v] = 0;
      }
      if (vertex_error_[v] < 0) {
        const auto hit = nearest(mesh_.positions[v], states_[t].guess, exact);
        vertex_error_[v] = std::sqrt(hit.squared_distance);
        states_[t].guess = hit.triangle;
      }
      states_[t].error = std::max(states_[t].error, vertex_error_[v]);
    }
  }
}

void ShapedMesh::measure_all() {
  measure_corners(nearest_);
  for (std::size_t t = 0; t < states_.size(); ++t) {
    measure_middle(narrow<Index>(t), nearest_);
  }
}

void ShapedMesh::measure_middle(Index t, const NearestPoint& nearest) {
  const auto c = corners(mesh_.triangles[t], {});
  State& state = states_[t];
  double squared = state.error * state.error;
  const auto hit = nearest((c[0] + c[1] + c[2]) / 3, state.guess, squared);
  state.guess = hit.triangle;
  squared = std::max(hit.squared_distance, squared);
  for (std::size_t k = 0; k < 3; ++k) {
    const double known = known_middle(t, k);
    if (known < 0 || known > squared) {
      middle_[t][k] = nearest(0.5 * (c[k] + c[(k + 1) % 3]), state.guess, squared).squared_distance;
      squared = std::max(squared, middle_[t][k]);
    }
  }
  state.error = std::sqrt(squared);
}

/// At points that cut each edge in `parts_`, at those between them and at the centre, but not less than `squared`.
double ShapedMesh::squared_within(const std::array<Vec3, 3>& c, Index guess, double squared) const {
  const int parts = parts_;
  const auto try_point = [&](const Vec3& p) {
    const auto hit = nearest_(p, guess, squared);
    squared = std::max(squared, hit.squared_distance);
    guess = hit.triangle;
  };
  try_point((c[0] + c[1] + c[2]) / 3);
  for (int i = 0; i <= parts; ++i) {
    for (int j = 0; i + j <= parts; ++j) {
      const bool corner = i == parts || j == parts || i + j == 0;
      if (!corner) {
        try_point(c[0] + (real(i) * (c[1] - c[0]) + real(j) * (c[2] - c[0])) / parts);
      }
    }
  }
  return squared;
}

void ShapedMesh::measure(Index t) {
  const auto c = corners(mesh_.triangles[t], {});
  State& state = states_[t];
  double squared = squared_of_samples(t, c);
  for (std::size_t k = 0; k < 3; ++k) {
    const double at_corner = nearest_(c[k], state.guess, exact).squared_distance;
    vertex_error_[mesh_.triangles[t][k]] = std::sqrt(at_corner);
    squared = std::max(squared, at_corner);
  }
  state.error = std::sqrt(squared_within(c, state.guess, squared));
}

double ShapedMesh::measure_within(PatchTrial& trial) const {
  double most = 0;
  for (std::size_t i = 0; i < trial.corners.size(); ++i) {
    double& error = trial.error[i];
    const double squared = error * error;
    const double within = squared_within(corners(trial.corners[i], trial), trial.guess[i], squared);
    if (within > squared) {
      trial.cost[i] += error_cost(std::sqrt(within)) - error_cost(error);
      error = std::sqrt(within);
    }
    most = std::max(most, error);
  }
  return most;
}

void ShapedMesh::make_move(Index vertex, const Vec3& position, PatchTrial& trial) const {
  trial.removed = mesh_.around[vertex];
  trial.corners.clear();
  for (const Index t : trial.removed) {
    trial.corners.push_back(mesh_.triangles[t]);
  }
  trial.moved = vertex;
  trial.position = position;
}

bool ShapedMesh::make_flip(Index u, Index v, PatchTrial& trial) const {
  if (!mesh_.may_flip(u, v)) {
    return false;
  }
  const auto on = mesh_.on_edge(u, v);
  const Index c = mesh_.apex(on[0], u, v);
  const Index d = mesh_.apex(on[1], u, v);
  trial.removed = {on[0], on[1]};
  trial.corners = {{u, d, c}, {d, v, c}};
  trial.moved = EditMesh::none;
  return true;
}

bool ShapedMesh::make_collapse(Index u, Index v, PatchTrial& trial) const {
  if (!mesh_.may_collapse(u, v)) {
    return false;
  }
  const bool v_is_kept = mesh_.on_boundary[u] == mesh_.on_boundary[v] ? is_pinned(v) : mesh_.on_boundary[v] != 0;
  const Index kept = v_is_kept ? v : u;
  const Index gone = v_is_kept ? u : v;
  if (is_pinned(gone)) {
    return false;
  }
  trial.removed = mesh_.around[kept];
  trial.corners.clear();
  for (const Index t : mesh_.around[gone]) {
    if (!mesh_.has(t, kept)) {
      trial.removed.push_back(t);
    }
  }
  for (const Index t : trial.removed) {
    auto c = mesh_.triangles[t];
    if (mesh_.has(t, kept) && mesh_.has(t, gone)) {
      continue;
    }
    std::replace(c.begin(), c.end(), gone, kept);
    trial.corners.push_back(c);
  }
  trial.moved = kept;
  const bool stays = is_pinned(kept) || mesh_.on_boundary[u] != mesh_.on_boundary[v];
  trial.position = stays ? mesh_.positions[kept] : middle(u, v);
  return true;
}

void ShapedMesh::make_split(Index u, Index v, PatchTrial& trial) const {
  trial.removed.clear();
  trial.corners.clear();
  trial.moved = narrow<Index>(mesh_.positions.size());
  trial.position = middle(u, v);
  for (const Index t : mesh_.on_edge(u, v)) {
    if (t != EditMesh::none) {
      trial.removed.push_back(t);
      for (const Index replaced : {u, v}) {
        auto c = mesh_.triangles[t];
        std::replace(c.begin(), c.end(), replaced, trial.moved);
        trial.corners.push_back(c);
      }
    }
  }
}

void ShapedMesh::make_centre_split(Index t, PatchTrial& trial) const {
  const auto& c = mesh_.triangles[t];
  trial.removed = {t};
  trial.moved = narrow<Index>(mesh_.positions.size());
  const Vec3 centre = (mesh_.positions[c[0]] + mesh_.positions[c[1]] + mesh_.positions[c[2]]) / 3;
  trial.position = nearest_(centre, states_[t].guess, exact).point;
  trial.corners = {{c[0], c[1], trial.moved}, {c[1], c[2], trial.moved}, {c[2], c[0], trial.moved}};
}

bool ShapedMesh::folds(const PatchTrial& trial) const {
  // Sharpest fold of the old patch with its surroundings, and whether the new one has a sharper one.
  const auto normal_of = [&](Index t) { return area_vector(corners(mesh_.triangles[t], {})); };
  double before = 1;
  for (const Index t : trial.removed) {
    const auto& c = mesh_.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      const Index across = mesh_.on_edge(c[k], c[(k + 1) % 3])[1];
      if (across != EditMesh::none) {
        before = std::min(before, cosine(normal_of(t), normal_of(across)));
      }
    }
  }
  const double limit = std::min(weights_.fold_cosine, before);
  std::array<Vec3, most_in_patch> normals;
  const std::size_t count = trial.corners.size();
  for (std::size_t i = 0; i < count; ++i) {
    normals[i] = area_vector(corners(trial.corners[i], trial));
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index from = trial.corners[i][k];
      const Index to = trial.corners[i][(k + 1) % 3];
      bool inner = false;
      for (std::size_t j = 0; j < count && !inner; ++j) {
        for (std::size_t l = 0; l < 3; ++l) {
          if (trial.corners[j][l] == to && trial.corners[j][(l + 1) % 3] == from) {
            inner = true;
            if (cosine(normals[i], normals[j]) < limit) {
              return true;
            }
          }
        }
      }
      if (inner || from >= mesh_.around.size() || to >= mesh_.around.size()) {
        continue;
      }
      const Index across = mesh_.on_edge(from, to)[1];
      if (across != EditMesh::none &&
          std::find(trial.removed.begin(), trial.removed.end(), across) == trial.removed.end() &&
          cosine(normals[i], normal_of(across)) < limit) {
        return true;
      }
    }
  }
  return false;
}

double ShapedMesh::evaluate(PatchTrial& trial, double limit) const {
  if (is_pinned(trial.moved) && trial.position != mesh_.positions[trial.moved]) {
    return infinity;
  }
  double before = 0;
  double most_error = weights_.most_error;
  bool faced_away = false;
  trial.samples.clear();
  for (const Index t : trial.removed) {
    before += cost(t);
    most_error = std::max(most_error, states_[t].error);
    trial.samples.insert(trial.samples.end(), states_[t].samples.begin(), states_[t].samples.end());
    faced_away = faced_away || faces_away(corners(mesh_.triangles[t], {}), states_[t].guess);
  }
  const double allowed = before + limit;
  double total = 0;
  const std::size_t count = trial.corners.size();
  if (count > most_in_patch) {
    return infinity;
  }
  trial.cost.assign(count, 0);
  trial.error.assign(count, 0);
  trial.guess.assign(count, states_[trial.removed[0]].guess);
  std::array<std::array<Vec3, 3>, most_in_patch> c;
  for (std::size_t i = 0; i < count; ++i) {
    c[i] = corners(trial.corners[i], trial);
    trial.cost[i] = shape_cost(trial.corners[i], c[i]);
    total += trial.cost[i];
  }
  if (total >= allowed || folds(trial)) {
    return infinity;
  }
  if (!assign_samples(trial, c.data(), allowed, most_error, total)) {
    return infinity;
  }
  if (trial.moved != EditMesh::none) {
    trial.moved_error = std::sqrt(nearest_(trial.position, trial.guess[0], exact).squared_distance);
    if (trial.moved_error > most_error) {
      return infinity;
    }
  }
  // The middle of an edge within the patch is measured once, and counts for both triangles.
  std::array<double, most_edges> middle;
  middle.fill(-1);
  for (std::size_t i = 0; i < count; ++i) {
    const auto hit = nearest_((c[i][0] + c[i][1] + c[i][2]) / 3, trial.guess[i], exact);
    trial.guess[i] = hit.triangle;
    if (!faced_away && faces_away(c[i], hit.triangle)) {
      return infinity;
    }
    double squared = std::max(hit.squared_distance, trial.error[i] * trial.error[i]);
    for (const Index v : trial.corners[i]) {
      const double at_corner = v == trial.moved ? trial.moved_error : vertex_error_[v];
      squared = std::max(squared, at_corner * at_corner);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t other = other_edge(trial, i, k);
      if (other < 3 * i) {
        squared = std::max(squared, middle[other]);
        continue;
      }
      double enough = squared;
      if (other < most_edges) {
        enough = std::min(enough, trial.error[other / 3] * trial.error[other / 3]);
      }
      middle[3 * i + k] = nearest_(0.5 * (c[i][k] + c[i][(k + 1) % 3]), hit.triangle, enough).squared_distance;
      squared = std::max(squared, middle[3 * i + k]);
    }
    total -= error_cost(trial.error[i]);
    trial.error[i] = std::sqrt(squared);
    total += error_cost(trial.error[i]);
    if (total >= allowed || trial.error[i] > most_error) {
      return infinity;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    trial.cost[i] += error_cost(trial.error[i]);
  }
  return total - before;
}

/// Every sample goes to the nearest of the new triangles and adds to its error and to the total cost. @return whether
/// these stay below what is allowed
bool ShapedMesh::assign_samples(PatchTrial& trial, const std::array<Vec3, 3>* c, double allowed, double most_error,
                                double& total) const {
  std::vector<FacetDistances> facets;
  facets.reserve(trial.corners.size());
  for (std::size_t i = 0; i < trial.corners.size(); ++i) {
    facets.emplace_back(c[i]);
  }
  const std::size_t end = trial.samples.size();
  trial.owner.resize(end);
  std::array<double, most_in_patch> squared_error{};
  for (std::size_t first = 0; first < end; first += lane_count) {
    const LaneVec3 p = lane_points(
        [&](std::size_t lane) -> const Vec3& { return sample_[trial.samples[std::min(first + lane, end - 1)]]; });
    NearestFacet nearest;
    for (std::size_t i = 0; i < facets.size(); ++i) {
      nearest.try_facet(facets[i], p, real(i));
    }
    for (std::size_t s = first; s < std::min(first + lane_count, end); ++s) {
      const double squared = nearest.squared[s - first];
      const auto owner = truncated<std::size_t>(nearest.which[s - first]);
      trial.owner[s] = narrow<Index>(owner);
      if (squared > squared_error[owner]) {
        squared_error[owner] = squared;
        double& error = trial.error[owner];
        total -= error_cost(error);
        error = std::sqrt(squared);
        total += error_cost(error);
        if (total >= allowed || error > most_error) {
          return false;
        }
      }
    }
  }
  return true;
}

void ShapedMesh::commit(const PatchTrial& trial) {
  on_target_.clear();  // from here on vertices are elsewhere
  const bool is_new = trial.moved == mesh_.positions.size();
  if (is_new) {
    const auto& first = trial.corners[0];
    // Of a boundary edge only one triangle was cut, in two.
    const bool boundary = trial.removed.size() == 1 && trial.corners.size() == 2;
    mesh_.add_vertex(trial.position, boundary);
    least_angle_.push_back(not_pinned);
    vertex_error_.push_back(trial.moved_error);
    BoundaryCurves::Place place;
    if (boundary) {
      for (const Index v : first) {
        if (v != trial.moved && mesh_.on_boundary[v] != 0) {
          place = curves_.nearest(trial.position, places_[v].curve);
        }
      }
    }
    places_.push_back(place);
  } else if (trial.moved != EditMesh::none) {
    mesh_.positions[trial.moved] = trial.position;
    vertex_error_[trial.moved] = trial.moved_error;
    if (mesh_.on_boundary[trial.moved] != 0) {
      places_[trial.moved] = curves_.nearest(trial.position, places_[trial.moved].curve);
    }
  }
  for (const Index t : trial.removed) {
    mesh_.remove_triangle(t);
    states_[t] = {};
    shape_cost_[t] = unknown;
    middle_[t] = no_middles;
  }
  std::vector<Index> made;
  for (std::size_t i = 0; i < trial.corners.size(); ++i) {
    const Index t = mesh_.add_triangle(trial.corners[i]);
    made.push_back(t);
    if (states_.size() < mesh_.triangles.size()) {
      states_.resize(mesh_.triangles.size());
      shape_cost_.resize(states_.size(), unknown);
      middle_.resize(states_.size(), no_middles);
    }
    states_[t].error = trial.error[i];
    states_[t].guess = trial.guess[i];
  }
  for (std::size_t s = 0; s < trial.samples.size(); ++s) {
    states_[made[trial.owner[s]]].samples.push_back(trial.samples[s]);
  }
}

}  // namespace tunica
