// tunica-phantom: a segmented volume whose true surface is known.
#include "tunica/volume/phantom/phantom.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/format.h>

namespace {

/// "1.5" or "0.8,0.8,5", in mm.
tunica::Vec3 parse_spacing(const std::string& text) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::optional<double> number = tunica::parse_number(std::string_view(text).substr(begin, end - begin));
    if (!number) {
      break;
    }
    numbers.push_back(*number);
    begin = end + 1;
  }
  if (begin <= text.size() || (numbers.size() != 1 && numbers.size() != 3)) {
    throw tunica::UsageError(fmt::format(
        "--spacing '{}' is not one or three numbers of mm: write --spacing 1.5 or --spacing 0.8,0.8,5", text));
  }
  return numbers.size() == 1 ? tunica::Vec3::Constant(numbers[0]) : tunica::Vec3(numbers[0], numbers[1], numbers[2]);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace tunica;
  cli::Tool tool("phantom", "Makes a segmented volume whose true surface is known.",
                 "tunica-phantom aneurysm aneurysm.nii.gz --size 64 --spacing 1.5 --truth truth.ply");
  std::string shape;
  std::string spacing = "1";
  std::filesystem::path out;
  std::filesystem::path truth;
  PhantomOptions options;
  tool.arguments().add_option("SHAPE", shape, "sphere, tube, aneurysm, capsule, bladder or colon")->required();
  tool.arguments().add_option("OUT.nii.gz", out, "volume: 1 inside, 0 outside")->required();
  tool.group("Voxels");
  tool.arguments().add_option("--size", options.size, "voxels on the longest side (default 128)")->type_name("N");
  tool.arguments().add_option("--spacing", spacing, "size of a voxel in mm (default 1)")->type_name("X[,Y,Z]");
  tool.arguments()
      .add_option("--noise", options.noise, "probability with which a border voxel is flipped (default 0)")
      ->type_name("P");
  tool.arguments().add_option("--seed", options.seed, "of the noise (default 1)")->type_name("N");
  tool.group("Output");
  tool.arguments().add_option("--truth", truth, "the true surface as a dense mesh, PLY")->type_name("OUT.ply");
  tool.stages({"make", "truth", "write"});
  return tool.run(argc, argv, [&] {
    const std::optional<PhantomShape> known = phantom_shape(shape);
    if (!known) {
      throw UsageError(
          fmt::format("'{}' is not a shape: choose sphere, tube, aneurysm, capsule, bladder or colon", shape));
    }
    options.shape = *known;
    options.spacing = parse_spacing(spacing);
    tool.output(out, {".nii.gz", ".nii"});
    if (!truth.empty()) {
      tool.output(truth, {".ply"});
    }

    Phantom phantom;
    {
      const auto stage = tool.stage("make");
      options.progress = tool.progress("voxels");
      phantom = make_phantom(options);
    }
    tool.result()["shape"] = shape;
    tool.result()["dims"] = phantom.volume.dims;
    tool.result()["spacing_mm"] = {options.spacing[0], options.spacing[1], options.spacing[2]};
    tool.result()["voxels"] = phantom.inside;
    tool.result()["voxel_volume_mm3"] = real(phantom.inside) * options.spacing.prod();
    tool.result()["flipped_voxels"] = phantom.flipped;
    for (const char* key : {"truth_triangles", "truth_volume_mm3", "truth_area_mm2"}) {
      tool.result()[key] = nullptr;
    }

    TriangleMesh surface;
    if (!truth.empty()) {
      const auto stage = tool.stage("truth");
      options.progress = tool.progress("true surface");
      surface = phantom_surface(options);
      tool.result()["truth_triangles"] = surface.triangles.size();
      tool.result()["truth_volume_mm3"] = phantom_volume(surface);
      tool.result()["truth_area_mm2"] = area(surface);
    }

    const auto stage = tool.stage("write");
    write_nifti(out, phantom.volume, tool.force(), "made by " + tool.made_by());
    if (!truth.empty()) {
      PlyOptions ply;
      ply.comments = {"made by " + tool.made_by()};
      ply.overwrite = tool.force();
      write_ply(truth, surface, ply);
    }
  });
}
