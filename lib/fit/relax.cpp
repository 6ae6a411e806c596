#include "tunica/fit/relax.hpp"

#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/fit/detail/edits.hpp"
#include "tunica/fit/detail/start.hpp"
#include "tunica/fit/fit.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/refine.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/core.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int mending_passes = 10;  // while facets fold
constexpr int default_iterations = 20;
constexpr int default_iterations_refining = 60;
constexpr double default_off_target = 1e-3;  // of the diagonal
constexpr double iteration_worth_it = 0.99;  // an iteration that brings less than 1 % brings nothing
constexpr std::size_t triangles_judged = 5000;
constexpr int fruitless_iterations = 3;                    // iterations that bring nothing
constexpr double least_angle = 10, least_agreement = 0.4;  // degrees, cosine: what curved shells can stand on

class Relaxation {
public:
  Relaxation(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options)
      : target_(target), options_(options), width_(options.width.value_or(default_width * target.diagonal())) {
    if (options.tolerance) {
      width_ = std::min(width_, *options.tolerance / 10);
    }
    TriangleMesh start = without_unused(coarse);
    current_.vertices = std::move(start.vertices);
    current_.triangles = std::move(start.triangles);
    current_.patch = options.surface;
  }

  RelaxResult run() {
    const int most =
        options_.max_iterations.value_or(options_.refine ? default_iterations_refining : default_iterations);
    int fruitless = 0;
    double level_best = infinity;
    result_.stopped = "the limit of iterations was reached";
    for (int i = 0; i < most; ++i) {
      advance(options_.progress, real(i) / most);
      const auto iterated = iterate();
      if (!iterated) {
        result_.stopped = "the facets fold where no normal suits them";
        break;
      }
      const double upper = *iterated;
      if (options_.tolerance && upper <= *options_.tolerance) {
        result_.reached = true;
        result_.stopped = "the tolerance holds";
        break;
      }
      fruitless = upper < iteration_worth_it * level_best ? 0 : fruitless + 1;
      level_best = std::min(level_best, upper);
      if (options_.refine) {
        // Far from the tolerance another move of the same nodes is not worth its time.
        const bool far = !options_.tolerance || upper > 2 * *options_.tolerance;
        if ((far || fruitless > 0) && i + 1 < most) {
          if (!refine()) {
            break;
          }
          fruitless = 0;
          level_best = infinity;
        }
      } else if (fruitless >= fruitless_iterations) {
        result_.stopped = "further moves bring nothing: the rule has settled";
        break;
      }
    }
    if (options_.tolerance && !result_.reached) {
      result_.reached = false;
    }
    return std::move(result_);
  }

private:
  /// @return the distance's upper bound; nothing when the mesh has folded beyond repair
  std::optional<double> iterate() {
    const auto start = Clock::now();
    RelaxIteration iteration;
    TriangleMesh mesh = flat_facets(current_);
    const double off_target =
        std::min(default_off_target * target_.diagonal(), options_.tolerance.value_or(infinity) / 4);
    iteration.moves = move_by_barycentre(target_, mesh, off_target);
    std::vector<Index> folded;
    for (int pass = 0; pass == 0 || (pass < mending_passes && !folded.empty()); ++pass) {
      mesh = mended(mesh, pass == 0 ? off_target : infinity);
      current_.vertices = mesh.vertices;
      current_.triangles = mesh.triangles;
      folded = take_normals_from(target_, current_);
    }
    if (!folded.empty() && !result_.iterations.empty()) {
      return {};
    }
    if (!folded.empty()) {
      const Vec3& p = current_.vertices[folded[0]];
      throw InputError(
          fmt::format("the triangles at {} node{} fold so sharply that no normal suits them all, the first "
                      "is node {} near ({:.6g}, {:.6g}, {:.6g}) mm; take a coarse mesh with more triangles",
                      folded.size(), folded.size() == 1 ? "" : "s", folded[0], p.x(), p.y(), p.z()));
    }
    fit_normals(target_, current_);
    const ShellDistance distance = measure();
    if (result_.iterations.empty() || distance.both.upper < result_.distance.both.upper) {
      result_.shell = current_;
      result_.distance = distance;
    }
    iteration.shells = current_.triangles.size();
    iteration.hausdorff = distance.both;
    iteration.seconds = seconds_since(start);
    result_.iterations.push_back(iteration);
    if (options_.on_iteration) {
      options_.on_iteration(iteration, result_.shell);
    }
    return distance.both.upper;
  }

  /// Thin triangles, and nodes whose facets fold, are mended by edits that stray no farther from the target, mm.
  [[nodiscard]] TriangleMesh mended(const TriangleMesh& moved, double stray) const {
    ShellMesh shell{moved.vertices, moved.triangles, {}, {}, current_.patch};
    take_normals_from(target_, shell);
    FitMesh mesh(shell);
    const FitSamples samples(target_, mesh.alive, true);
    samples.attach(mesh);
    samples.measure(mesh);
    FitLimits limits;
    limits.shape.min_angle = least_angle;
    limits.shape.agreement = least_agreement;
    limits.shape.size_ratio = infinity;
    limits.error = stray;
    mend_shapes(mesh, samples, limits, mesh.alive);
    return flat_facets(mesh.shell());
  }

  /// A tenth of the distance is narrow enough to compare iterates; to decide on the tolerance it gets narrower.
  ShellDistance measure() {
    errors_ = shell_errors(current_, target_, options_.tolerance.value_or(default_off_target * target_.diagonal()) / 4);
    ShellDistanceOptions measuring;
    measuring.width = std::max(width_, *std::max_element(errors_.begin(), errors_.end()) / 10);
    while (true) {
      const ShellDistance distance = shell_distance(current_, target_, measuring);
      const bool open_question =
          options_.tolerance && distance.both.lower <= *options_.tolerance && distance.both.upper > *options_.tolerance;
      if (!open_question || measuring.width <= width_) {
        return distance;
      }
      measuring.width = std::max(width_, measuring.width / 3);
    }
  }

  bool refine() {
    const std::size_t before = current_.triangles.size();
    const std::size_t most = options_.max_shells.value_or(max_index);
    if (options_.tolerance) {
      // What the samples of the errors miss must not keep the distance above the tolerance.
      const double largest = *std::max_element(errors_.begin(), errors_.end());
      const double wanted = std::min(0.8 * *options_.tolerance, 0.95 * largest);
      current_ = refine_where(current_, errors_, wanted, most);
    } else if (4 * before <= most) {
      current_ = split_shells(current_, std::vector<Split>(before, Split::all_edges));
    }
    if (current_.triangles.size() == before) {
      result_.stopped = "no shell can be split within the limit of shells";
      return false;
    }
    return true;
  }

  const Target& target_;
  const RelaxOptions& options_;
  double width_;
  ShellMesh current_;
  std::vector<double> errors_;  // of each current shell, mm
  RelaxResult result_;
};

}  // namespace

void require_valid(const RelaxOptions& options) {
  if (options.tolerance) {
    require_positive(*options.tolerance, "the tolerance");
  }
  if (options.width) {
    require_positive(*options.width, "the width of the interval");
  }
  if (options.max_iterations && *options.max_iterations < 0) {
    throw InputError(fmt::format("{} iterations at most: none or more are needed", *options.max_iterations));
  }
}

bool faces_other_way(const TriangleMesh& mesh, const Target& target) {
  require_valid(mesh);
  const std::size_t stride = std::max<std::size_t>(1, mesh.triangles.size() / triangles_judged);
  double agreement = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
    agreement += (q - p).cross(r - p).dot(target.closest((p + q + r) / 3).facet_normal);
  }
  return agreement < 0;
}

TriangleMesh turned_around(TriangleMesh mesh) {
  for (auto& v : mesh.triangles) {
    std::swap(v[1], v[2]);
  }
  return mesh;
}

RelaxResult relax_by_barycentre(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options) {
  require_surface(coarse);
  require_valid(options);
  return Relaxation(coarse, target, options).run();
}

}  // namespace tunica
