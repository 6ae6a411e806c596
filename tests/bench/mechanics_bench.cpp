// How long steps and static solves take, against one CHOLMOD factorisation of the same static matrix in the same run:
// seconds depend on the machine and on what else runs there, the ratio much less. The vessel is that of
// tests/lib/mechanics: 1 kPa ramped over 1 s, both ends held, E 1 MPa, nu 0.45, t 1 mm, 1100 kg/m^3, steps of 40 ms.
// Processor time on one thread, but for `real-time`: wall time on all threads that are allowed.
// Prints tab-separated lines; a ratio has its bar beside it.

#include "mechanics/benchmarks.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/algebra/linear_solver.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include <cholmod.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <time.h>

#include <chrono>
#include <cstring>
#include <stdexcept>

// CHOLMOD opens parallel regions of its own, which would hide behind the other threads; OpenMP's library may be absent.
extern "C" {
void omp_set_max_active_levels(int) __attribute__((weak));
}

namespace tunica::benchmarks {
namespace {

struct Size {
  std::size_t around, along;
};
constexpr std::array<Size, 8> sizes{
    {{25, 20}, {50, 50}, {100, 50}, {100, 100}, {200, 125}, {250, 200}, {400, 312}, {500, 500}}};

double processor_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double peak_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : values[values.size() / 2];
}

Model vessel(const Size& size) {
  Model model;
  ShellBody body = flat_body(make_vessel(size.around, size.along), 1, 0.45, 1);
  body.name = "vessel";
  body.curved = true;
  body.rest = Rest::curved;
  body.material.density = 1.1e-9;
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& p) { return p.z() < 1e-9 || p.z() > 60 - 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{1e-3, true}, Ramp{{{0, 0}, {1, 1}}}});
  return model;
}

/// What CHOLMOD alone takes for the static matrix, with its default ordering and its supernodal method.
struct Reference {
  double analyse = 0;  ///< s
  double factor = 0;   ///< s
  double entries = 0;  ///< of the factor
};

class StaticMatrix {
public:
  explicit StaticMatrix(const Model& model) {
    const ShellSystem system = make_system(model);
    BlockMatrix blocks = system.pattern;
    linear_stiffness(system, blocks);
    cholmod_start(&common_);
    std::vector<int> number(system.held.size(), -1);
    int count = 0;
    for (std::size_t i = 0; i < number.size(); ++i) {
      number[i] = system.held[i] ? -1 : count++;
    }
    std::vector<int> starts{0}, rows;
    std::vector<double> values;
    for (std::size_t f = 0; f < number.size(); ++f) {
      for (std::size_t k = blocks.row_start[f / 6]; number[f] >= 0 && k < blocks.row_start[f / 6 + 1]; ++k) {
        for (std::size_t r = 0; r < 6; ++r) {
          const int row = number[6 * blocks.column[k] + r];
          if (row >= 0 && row <= number[f]) {
            rows.push_back(row);
            values.push_back(
                blocks.block(blocks.transposed[k])(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(f % 6)));
          }
        }
      }
      if (number[f] >= 0) {
        starts.push_back(static_cast<int>(rows.size()));
      }
    }
    const auto n = static_cast<std::size_t>(count);
    matrix_ = cholmod_allocate_sparse(n, n, rows.size(), 1, 1, 1, CHOLMOD_REAL, &common_);
    std::copy(starts.begin(), starts.end(), static_cast<int*>(matrix_->p));
    std::copy(rows.begin(), rows.end(), static_cast<int*>(matrix_->i));
    std::copy(values.begin(), values.end(), static_cast<double*>(matrix_->x));
    common_.supernodal = CHOLMOD_SUPERNODAL;
  }
  ~StaticMatrix() {
    cholmod_free_sparse(&matrix_, &common_);
    cholmod_finish(&common_);
  }
  StaticMatrix(const StaticMatrix&) = delete;
  StaticMatrix& operator=(const StaticMatrix&) = delete;

  Reference measure() {
    Reference result;
    const double start = processor_seconds();
    cholmod_factor* factor = cholmod_analyze(matrix_, &common_);
    const double analysed = processor_seconds();
    cholmod_factorize(matrix_, factor, &common_);
    result.factor = processor_seconds() - analysed;
    result.analyse = analysed - start;
    result.entries = common_.lnz;
    if (common_.status != CHOLMOD_OK) {
      throw std::runtime_error("CHOLMOD cannot factor the static matrix");
    }
    cholmod_free_factor(&factor, &common_);
    return result;
  }

private:
  cholmod_common common_{};
  cholmod_sparse* matrix_ = nullptr;
};

/// The middle of several measurements.
Reference measure_reference(StaticMatrix& matrix, int repetitions) {
  std::vector<double> analyse, factor;
  Reference last;
  for (int k = 0; k < repetitions; ++k) {
    last = matrix.measure();
    analyse.push_back(last.analyse);
    factor.push_back(last.factor);
  }
  return {median(analyse), median(factor), last.entries};
}

RunSettings steps_of_40_ms(double duration) {
  RunSettings settings;
  settings.kind = DynamicRun{duration, 0.04, {}, Integrator::backward_euler};
  settings.every = std::numeric_limits<std::size_t>::max();
  return settings;
}

struct Steps {
  std::vector<double> seconds;
  Summary summary;
};

Steps run_steps(const Model& model, const RunSettings& settings, double (*clock)()) {
  Steps steps;
  double before = 0;
  const auto on_state = [&](const State&) { before = clock(); };
  const auto on_step = [&](double) {
    const double now = clock();
    steps.seconds.push_back(now - before);
    before = now;
  };
  steps.summary = solve(model, settings, on_state, on_step);
  return steps;
}

void print_ratio(std::string_view what, std::size_t shells, double seconds, double reference, double bar,
                 std::string_view note) {
  fmt::print("{}\t{}\t{:.4g}\t{:.4g}\t{:.3g}\t{}\t{:.0f}\t{}\n", what, shells, 1e3 * seconds, 1e3 * reference,
             seconds / reference, bar > 0 ? fmt::format("{:.3g}", bar) : "-", peak_mib(), note);
  std::fflush(stdout);
}

void print_steps(const std::string& what, std::size_t shells, const Steps& steps, double reference, double bar) {
  const std::vector<double> ramp(steps.seconds.begin(), steps.seconds.begin() + 25);
  const std::string note =
      fmt::format("{} linearisations, {} Krylov iterations, longest step {:.4g} ms, largest displacement {:.6g} mm",
                  steps.summary.newton_iterations, steps.summary.cg_iterations,
                  1e3 * *std::max_element(steps.seconds.begin(), steps.seconds.end()), steps.summary.max_displacement);
  print_ratio(what, shells, median(steps.seconds), reference, bar, note);
  print_ratio(what + ", of the ramp", shells, median(ramp), reference, bar, "");
}

/// 100 steps each; bars of 1,000 and 10,000 shells.
void measure_steps(std::size_t most) {
  for (const Size& size : sizes) {
    const std::size_t shells = 2 * size.around * size.along;
    if (shells > std::min<std::size_t>(most, 20'000)) {
      break;
    }
    const Model model = vessel(size);
    StaticMatrix matrix(model);
    const Reference reference = measure_reference(matrix, 5);
    const double bar = shells == 1000 ? 0.7 : shells == 10'000 ? 0.32 : 0;
    RunSettings settings = steps_of_40_ms(4);
    settings.newton_max = 1;
    print_steps("one linearisation", shells, run_steps(model, settings, processor_seconds), reference.factor, bar);
    settings.newton_max = 20;
    print_steps("Newton to 1e-8", shells, run_steps(model, settings, processor_seconds), reference.factor, 2.5 * bar);
    if (shells == 1000) {
      settings.newton_max = 1;
      settings.solver = Solver::cg;
      settings.cg_iterations = 100;
      settings.cg_fixed_count = true;
      // 5 ms where the factorisation takes 11 ms.
      print_steps("100 CG iterations", shells, run_steps(model, settings, processor_seconds), reference.factor,
                  5.0 / 11);
    }
  }
}

void measure_static(std::size_t most) {
  for (const Size& size : sizes) {
    const std::size_t shells = 2 * size.around * size.along;
    if (shells > most) {
      break;
    }
    const Model model = vessel(size);
    const int repetitions = shells <= 20'000 ? 5 : 1;
    const Reference reference = [&] {
      StaticMatrix matrix(model);
      return measure_reference(matrix, repetitions);
    }();
    std::vector<double> seconds;
    State last;
    Summary summary;
    for (int k = 0; k < repetitions; ++k) {
      const double start = processor_seconds();
      summary = solve(model, linear_run(), [](const State&) {});
      seconds.push_back(processor_seconds() - start);
    }
    print_ratio("static linear", shells, median(seconds), reference.analyse + reference.factor, 1.15,
                fmt::format("CHOLMOD analyse {:.4g} ms, {:.3g} entries; residual {:.2g}", 1e3 * reference.analyse,
                            reference.entries, summary.residual));
  }
}

void measure_real_time() {
  const Model model = vessel({100, 50});
  RunSettings settings = steps_of_40_ms(10);
  settings.newton_max = 1;
  const double start = wall_seconds();
  const Steps steps = run_steps(model, settings, wall_seconds);
  const double seconds = wall_seconds() - start;
  double inside = 0;
  for (const double s : steps.seconds) {
    inside += s;
  }
  fmt::print(
      "real time, {} threads\t10000\t{:.4g}\t-\t{:.3g}\t1\t{:.0f}\tlongest step {:.4g} ms of 120, {:.3g} with set-up\n",
      thread_count(), 1e3 * median(steps.seconds), 10 / inside, peak_mib(),
      1e3 * *std::max_element(steps.seconds.begin(), steps.seconds.end()), 10 / seconds);
}

}  // namespace
}  // namespace tunica::benchmarks

int main(int argc, char** argv) {
  using namespace tunica;
  const std::string what = argc > 1 ? argv[1] : "";
  const std::size_t most = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 20'000;
  if ((what != "step" && what != "static" && what != "real-time") || argc > 3 || most == 0) {
    fmt::print(stderr, "bench_mechanics step|static|real-time [MOST_SHELLS, default 20000]\n");
    return 2;
  }
  fmt::print("what\tshells\tms\tCHOLMOD ms\tratio\tbar\tpeak MiB\tnote\n");
  if (what == "real-time") {
    benchmarks::measure_real_time();
    return 0;
  }
  set_thread_count(1);
  if (omp_set_max_active_levels != nullptr) {
    omp_set_max_active_levels(0);
  }
  what == "step" ? benchmarks::measure_steps(most) : benchmarks::measure_static(most);
  return 0;
}
