#include "fuzz/target.hpp"

#include "tunica/io/result/page_file.hpp"

// What a page shows of a result, as tunica-simulate leaves it beside.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  const std::filesystem::path path = fuzz::file("a.page", fuzz::text_of(data, size));
  fuzz::accepted(
      [&] {
        const DrawnResult result = read_page_file(path);
        const std::size_t points = result.reference.vertices.size();
        fuzz::require(!result.states.empty() && !result.reference.triangles.empty(), "there is something to draw");
        for (const TriangleMesh* mesh : {&result.reference, &result.solids}) {
          for (const auto& triangle : mesh->triangles) {
            for (const Index corner : triangle) {
              fuzz::require(corner < mesh->vertices.size(), "corners are there");
            }
          }
        }
        for (const DrawnResult::State& state : result.states) {
          fuzz::require(state.displacement.size() == points && state.membrane.size() == points &&
                            state.von_mises.size() == points && state.of_solids.size() == result.solids.vertices.size(),
                        "a value each");
        }
      },
      path.string());
  return 0;
}
