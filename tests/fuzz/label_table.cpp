#include "fuzz/target.hpp"

#include "tunica/io/volume/label_names.hpp"

// Tables of label names: BIDS, ITK-SNAP, Slicer, FreeSurfer.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  const std::filesystem::path path = fuzz::file("labels.txt", fuzz::text_of(data, size));
  LabelNames names;
  const bool read = fuzz::accepted([&] { names = read_label_names(path); }, path.string());
  fuzz::require(!read || !names.empty(), "a table has names");
  for (std::size_t i = 0; i < names.size() && i < 3; ++i) {
    const std::string& name = names[i].second;
    fuzz::require(!name.empty() && name.size() <= 200, "a name is neither empty nor long");
    fuzz::accepted([&] { fuzz::require(find_label(names, name).has_value(), "a name is found"); });
    (void)nearest_label(names, name + "x");
  }
  return 0;
}
