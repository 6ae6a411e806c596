#include "fuzz/target.hpp"

#include "tunica/io/result/drawn_result.hpp"

// HDF5 1.10 loses some hundred bytes of a file that it finds damaged.
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5\n"; }
// It asks for as much memory as that file says, and takes a no for an answer. Less memory is forked faster, and each
// file is opened by a child first.
extern "C" const char* __asan_default_options() {
  return "allocator_may_return_null=1:max_allocation_size_mb=2048:hard_rss_limit_mb=2048:quarantine_size_mb=16";
}

// Results of tunica-simulate, as reports read them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  const std::filesystem::path path = fuzz::file("a.hdf", fuzz::text_of(data, size));
  fuzz::accepted(
      [&] {
        const DrawnResult result = read_drawn_result(path, 4);
        const std::size_t points = result.reference.vertices.size();
        fuzz::require(!result.states.empty() && result.states.size() <= 4, "as many states as asked for");
        for (const auto& triangle : result.reference.triangles) {
          for (const Index corner : triangle) {
            fuzz::require(corner < points, "corners are there");
          }
        }
        for (const DrawnResult::State& state : result.states) {
          fuzz::require(state.displacement.size() == points && state.membrane.size() == points &&
                            state.von_mises.size() == points,
                        "a value each");
        }
      },
      path.string());
  return 0;
}
