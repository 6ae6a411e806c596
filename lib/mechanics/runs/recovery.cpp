#include "tunica/mechanics/runs/detail/recovery.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace tunica {
namespace {

constexpr double same_normal = 1e-3;                 // rad: corner normals that differ by more are those of a crease
constexpr double sharp_fold = std::numbers::pi / 6;  // of facets without normals: beyond, they stand for no curve

/// Whether two shells go on smoothly in each other at a corner of each.
bool is_smooth(const ShellBody& body, const Vec3& one, const Vec3& other) {
  return std::acos(std::clamp(one.dot(other), -1.0, 1.0)) < (body.curved ? same_normal : sharp_fold);
}

}  // namespace

Recovery::Recovery(const ShellSystem& system) {
  const Model& model = *system.model;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const std::size_t first = system.first_element[b];
    add_body(model.shells[b], std::span(system.elements).subspan(first, system.first_element[b + 1] - first));
  }
}

void Recovery::add_body(const ShellBody& body, std::span<const ShellElement> elements) {
  const auto& triangles = body.mesh.triangles;
  const auto normal_at = [&](std::size_t corner) {
    return body.curved ? body.mesh.normal(corner / 3, corner % 3) : Vec3(elements[corner / 3].axes.row(2));
  };
  DisjointSets<std::size_t> smooth(3 * triangles.size());
  std::map<std::pair<Index, Index>, std::array<std::size_t, 2>> sides;  // of an edge: its corners in the first shell
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<std::size_t, 2> here{3 * t + k, 3 * t + (k + 1) % 3};
      std::array<Index, 2> ends{triangles[t][k], triangles[t][(k + 1) % 3]};
      if (ends[0] > ends[1]) {
        std::swap(ends[0], ends[1]);
        std::swap(here[0], here[1]);
      }
      const auto [other, is_first] = sides.emplace(std::pair{ends[0], ends[1]}, here);
      for (std::size_t end = 0; end < 2 && !is_first; ++end) {
        if (is_step(body, t) == is_step(body, other->second[end] / 3) &&
            is_smooth(body, normal_at(here[end]), normal_at(other->second[end]))) {
          smooth.join(here[end], other->second[end]);
        }
      }
    }
  }
  std::vector<Index> place(3 * triangles.size());
  std::vector<Vec3> normal;
  const std::size_t first_place = lumped_.size();
  for (std::size_t corner = 0; corner < place.size(); ++corner) {
    const std::size_t root = smooth.root(corner);  // the smallest of its set, so it has its place already
    if (root == corner) {
      place[corner] = narrow<Index>(normal.size());
      normal.emplace_back(Vec3::Zero());
      lumped_.push_back(0);
    }
    place[corner] = place[root];
    normal[place[corner]] += normal_at(corner);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Mat3& axes = elements[t].axes;
    const Vec3 x = axes.row(0), up = axes.row(2);
    const auto& [i, j, k] = triangles[t];
    const auto& v = body.mesh.vertices;
    area_.push_back((v[j] - v[i]).cross(v[k] - v[i]).norm() / 2);
    Corners& corners = corners_.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      const Index own = place[3 * t + c];
      const Vec3 to = normal[own].normalized();
      const Vec3 carried = Eigen::Quaterniond::FromTwoVectors(up, to) * x;
      const Vec3 u = to.unitOrthogonal();
      const Complex angle(carried.dot(u), carried.dot(to.cross(u)));
      corners[c] = {narrow<Index>(first_place + own), angle * angle / std::norm(angle)};
      lumped_[corners[c].place] += area_.back() / 3;
    }
  }
}

std::vector<Recovery::Complex> Recovery::solved(std::span<const Complex> of_elements, bool turns) const {
  constexpr double small = 1e-8;  // of the residual, as the error is
  constexpr int most = 50;
  const std::size_t places = lumped_.size();
  const auto dot = [](const std::vector<Complex>& a, const std::vector<Complex>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      sum += a[i].real() * b[i].real() + a[i].imag() * b[i].imag();
    }
    return sum;
  };
  const auto times_mass = [&](const std::vector<Complex>& values) {
    std::vector<Complex> result(places);
    for (std::size_t t = 0; t < corners_.size(); ++t) {
      std::array<Complex, 3> here;
      Complex sum = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        here[k] = std::conj(phase(corners_[t][k], turns)) * values[corners_[t][k].place];
        sum += here[k];
      }
      for (std::size_t k = 0; k < 3; ++k) {
        result[corners_[t][k].place] += area_[t] / 12 * phase(corners_[t][k], turns) * (here[k] + sum);
      }
    }
    return result;
  };
  const auto preconditioned = [&](std::vector<Complex> values) {
    for (std::size_t i = 0; i < places; ++i) {
      values[i] /= lumped_[i];
    }
    return values;
  };
  std::vector<Complex> residual(places);
  for (std::size_t t = 0; t < corners_.size(); ++t) {
    for (const Corner& corner : corners_[t]) {
      residual[corner.place] += area_[t] / 3 * phase(corner, turns) * of_elements[t];
    }
  }
  std::vector<Complex> values(places);
  std::vector<Complex> direction = preconditioned(residual);
  double size = dot(residual, direction);
  const double first = size;
  for (int i = 0; i < most && size > small * small * first; ++i) {
    const std::vector<Complex> moved = times_mass(direction);
    const double step = size / dot(direction, moved);
    for (std::size_t j = 0; j < places; ++j) {
      values[j] += step * direction[j];
      residual[j] -= step * moved[j];
    }
    const std::vector<Complex> next = preconditioned(residual);
    const double next_size = dot(residual, next);
    for (std::size_t j = 0; j < places; ++j) {
      direction[j] = next[j] + next_size / size * direction[j];
    }
    size = next_size;
  }
  return values;
}

std::vector<std::array<TensorPair, 3>> Recovery::at_corners(std::span<const TensorPair> of_elements) const {
  std::vector<Complex> traces, forces, moments;  // halves of the traces of both
  for (const auto& [force, moment] : of_elements) {
    traces.emplace_back((force[0] + force[1]) / 2, (moment[0] + moment[1]) / 2);
    forces.emplace_back((force[0] - force[1]) / 2, force[2]);
    moments.emplace_back((moment[0] - moment[1]) / 2, moment[2]);
  }
  traces = solved(traces, false);
  forces = solved(forces, true);
  moments = solved(moments, true);
  std::vector<std::array<TensorPair, 3>> result(of_elements.size());
  for (std::size_t t = 0; t < result.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& [place, turn] = corners_[t][k];
      const Complex force = std::conj(turn) * forces[place], moment = std::conj(turn) * moments[place];
      const Complex trace = traces[place];
      result[t][k] = {Vec3(trace.real() + force.real(), trace.real() - force.real(), force.imag()),
                      Vec3(trace.imag() + moment.real(), trace.imag() - moment.real(), moment.imag())};
    }
  }
  return result;
}

}  // namespace tunica
