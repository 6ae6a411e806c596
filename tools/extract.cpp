// tunica-extract VOLUME OUT.ply: the surface of a label, or of an isovalue.
#include "tunica/chain/extract_file.hpp"
#include "tunica/chain/report.hpp"
#include "tunica/cli/extract_flags.hpp"
#include "tunica/cli/tool.hpp"
#include "tunica/cli/usage.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace {

using namespace tunica;

struct Arguments {
  chain::ExtractFiles files;
  chain::ExtractSettings settings;
  std::optional<std::string> isovalue, inside, face, spacing;
  std::string smooth = "none", space = "lps";
  bool info = false;
  std::optional<std::size_t> shells;  // of which the memory is told
};

void declare(cli::Tool& tool, Arguments& given) {
  auto& [files, settings, isovalue, inside, face, spacing, smooth, space, info, shells] = given;
  CLI::App& app = tool.arguments();
  app.add_option("VOLUME", files.volume, "segmented or grey volume: NIfTI, NRRD, MetaImage, slices")->required();
  app.add_option("OUT.ply", files.out,
                 "the surface (.ply, .glb, .obj, .stl or .3mf); with --all-labels {label} in it is the label");
  tool.group("What is inside");
  app.add_option(
         "--label", files.label,
         "the label whose surface is wanted, by value or by the name that the volume, --names or a table beside "
         "the volume (scan.tsv, .ctbl, .label, .lut, .txt, .csv of scan.nii.gz) gives it; A+B: several as one organ")
      ->type_name("N[+N]");
  app.add_option(
         "--names", files.names,
         "a table of label names: BIDS _dseg.tsv, ITK-SNAP's, Slicer's .ctbl, FreeSurfer's look-up table, CSV, JSON")
      ->type_name("FILE");
  app.add_option("--isovalue", isovalue, "the value on the surface of a grey volume")->type_name("V");
  app.add_option("--inside", inside,
                 "which side of the isovalue is inside (default above; a sample equal to it is outside)")
      ->check(CLI::IsMember({"above", "below"}))
      ->type_name("above|below");
  app.add_flag("--all-labels", files.all_labels, "one file per label");
  tool.group("Surface");
  app.add_flag("--largest", settings.largest, "keep the largest component only");
  app.add_flag("--fill-cavities", settings.fill_cavities, "drop the surfaces of cavities");
  app.add_flag("--open-border", settings.open_border,
               "leave open, trimmed flat, the ends of vessels that the image's border cuts, instead of closing them");
  app.add_option("--cut", settings.cuts_as_written,
                 "cut the surface open along a plane and drop what lies beyond, may repeat: 'above z=40mm', 'below "
                 "x=-2cm', in the axes of --space")
      ->type_name("WHERE")
      ->expected(1)
      ->allow_extra_args(false)  // the next word is a file
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--face", face,
                 "of a label that is the wall itself: this face alone, closed or open as a vessel, normals outward")
      ->check(CLI::IsMember({"inner", "outer"}))
      ->type_name("inner|outer");
  app.add_option("--other-face", files.other_face, "with --face: write the wall's other face here")
      ->type_name("OUT.ply");
  app.add_option("--smooth", smooth,
                 "none, staircase (steps of the voxels, within half a voxel), or a Gaussian's sigma such as 1.5mm")
      ->type_name("none|staircase|SIGMA");
  app.add_option("--space", space, "world axes of the surface (default lps)")
      ->check(CLI::IsMember({"lps", "ras"}))
      ->type_name("lps|ras");
  tool.group("Reading");
  app.add_option("--frame", files.reading.frame, "which volume of a time series, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_option("--layer", files.reading.layer, "which layer of overlapping segments, from 0")
      ->check(cli::whole_number(0))
      ->type_name("N");
  app.add_flag("--prefer-qform", files.reading.prefer_qform,
               "NIfTI: take the qform where sform and qform are both set");
  app.add_option("--spacing", spacing, "mm per column, row and slice of a slice stack")->type_name("X,Y,Z");
  app.add_option(
         "--slab", files.slab,
         "read N slices at a time and never hold the whole volume; the same surface (default: 64 MiB at a time, a grey "
         "volume up to 1 GiB at once)")
      ->check(cli::whole_number(1))
      ->type_name("N");
  app.add_flag("--info", info,
               "print size, spacing, orientation and labels with volumes, names and the memory they take, and stop");
  app.add_option("--shells", shells,
                 "with --info: the shells of the chain whose memory is estimated (default 800, as the pipeline's)")
      ->check(cli::whole_number(4))
      ->type_name("N");
}

void refuse_contradictions(const Arguments& given) {
  const auto refuse = [](const char* message) { throw UsageError(message); };
  const chain::ExtractFiles& files = given.files;
  if (files.label && given.isovalue) {
    refuse("--label and --isovalue contradict each other: give one");
  }
  if (files.all_labels && (files.label || given.isovalue)) {
    refuse("--all-labels contradicts --label and --isovalue: give one of them");
  }
  if (given.inside && !given.isovalue) {
    refuse("--inside says which side of an isovalue is inside: give --isovalue V too, or leave it out");
  }
  if (given.isovalue && !parse_number(*given.isovalue)) {
    throw UsageError(fmt::format("--isovalue: '{}' is not a number", *given.isovalue));
  }
  for (const std::string& cut : given.settings.cuts_as_written) {
    (void)cli::parse_cut(cut);
  }
  if (given.face && files.all_labels) {
    refuse("--face is of one wall: name it by --label instead of --all-labels");
  }
  if (files.other_face && !given.face) {
    refuse("--other-face needs --face inner or outer, which says what OUT.ply is");
  }
  if (given.info) {
    return;
  }
  if (given.shells) {
    refuse("--shells is of the estimate that --info prints: leave it out here; tunica-relax --shells takes a count");
  }
  if (files.out.empty()) {
    refuse("OUT.ply is missing: name the surface to write, or pass --info to look at the volume");
  }
  if (files.all_labels && files.out.string().find("{label}") == std::string::npos) {
    throw UsageError(
        fmt::format("{}: --all-labels writes a file per label: put {{label}} into the name, for example "
                    "organ-{{label}}.ply",
                    files.out.string()));
  }
}

void understand(Arguments& given) {
  auto& [files, settings, isovalue, inside, face, spacing, smooth, space, info, shells] = given;
  refuse_contradictions(given);
  cli::take_smoothing(smooth, settings);
  if (spacing) {
    files.reading.spacing = cli::parse_spacing(*spacing);
  }
  if (isovalue) {
    files.grey = {inside == "below" ? Inside::Rule::below : Inside::Rule::above, *parse_number(*isovalue)};
  }
  if (face) {
    settings.face = *face == "inner" ? WallFace::inner : WallFace::outer;
  }
  settings.ras = space == "ras";
  std::ranges::transform(settings.cuts_as_written, std::back_inserter(settings.cuts), cli::parse_cut);
}

void run(cli::Tool& tool, Arguments& given) {
  understand(given);
  const chain::Context context = tool.context();
  const chain::OpenedVolume volume = chain::open_volume(given.files, context);
  if (given.info) {
    constexpr std::size_t usual_shells = 800;
    const auto [text, facts] = chain::describe_volume(volume, given.shells.value_or(usual_shells), context);
    tool.result() = chain::report(std::nullopt);
    tool.result().update(facts);
    tool.print(text);
    return;
  }
  const chain::VolumeSelection selection = chain::select_voxels(volume, given.settings, context);
  tool.result()["warnings"] = texts_of(selection.warnings);
  if (selection.nothing) {
    throw InputError(*selection.nothing);
  }
  if (!given.files.all_labels) {
    tool.result().update(chain::report(chain::extract_to_file(volume, selection.take(0), given.settings, context)));
    return;
  }
  std::vector<chain::SurfaceNumbers> surfaces;
  Json labels;
  for (std::size_t i = 0; i < selection.labels.size(); ++i) {
    surfaces.push_back(chain::extract_to_file(volume, selection.take(i), given.settings, context));
    labels[selection.labels[i]] = chain::report(surfaces.back());
  }
  tool.result().update(chain::report(chain::sum_of(surfaces)));
  tool.result()["labels"] = labels;
}

}  // namespace

int main(int argc, char** argv) {
  cli::Tool tool("extract", "Marching cubes: the closed surface of a label, or of an isovalue, in world millimetres.",
                 "tunica-extract aneurysm.nii.gz --info\n"
                 "  tunica-extract aneurysm.nii.gz surface.ply --label 1 --largest --open-border --smooth staircase\n"
                 "  tunica-extract aneurysm.nii.gz grey.ply --isovalue 0.5 --smooth 1mm");
  Arguments given;
  declare(tool, given);
  tool.stages({"read", "smooth", "extract", "write"});
  return tool.run(argc, argv, [&] { run(tool, given); });
}
