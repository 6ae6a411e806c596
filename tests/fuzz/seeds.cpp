// Writes the files that fuzzing starts from, a folder per harness: by tunica's own writers, and by hand as the readers'
// tests make them. What is text lies in tests/fuzz/seeds.
#include "fuzz/journal_model.hpp"
#include "io/mesh/tet_files.hpp"
#include "io/scene/scene_fixture.hpp"
#include "io/volume/builders.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/surface_file.hpp"
#include "tunica/io/result/page_file.hpp"
#include "tunica/io/result/run_journal.hpp"

namespace tunica::fuzz {
namespace {

namespace fs = std::filesystem;

/// The folder of one harness.
class Seeds {
public:
  Seeds(const fs::path& all, const std::string& harness) : folder_(all / harness) { fs::create_directories(folder_); }

  [[nodiscard]] fs::path operator/(const std::string& name) const { return folder_ / name; }
  void put(const std::string& name, std::string_view bytes) const { write_file(folder_ / name, bytes, true); }

private:
  fs::path folder_;
};

std::vector<std::uint8_t> grey(std::size_t count) { return test::sample_values<std::uint8_t>(count); }
std::string voxels() { return test::encoded(grey(60), test::Endian::little); }

void nifti(const Seeds& seeds) {
  Volume volume;
  volume.dims = {3, 4, 5};
  volume.data = grey(60);
  write_nifti(seeds / "own.nii", volume, true);
  write_nifti(seeds / "own.nii.gz", volume, true);
  test::NiftiOptions options;
  options.version = 2;
  options.dims = {3, 4, 5, 2};
  options.slope = 2;
  options.qform_code = 1;
  options.quatern = {0, 0, 1, 5, 6, 7};
  seeds.put("frames.nii", test::nifti_file(options));
  options = {};
  options.dims = {1, 3, 4, 5};
  options.sform = {};
  options.qform_code = 1;
  seeds.put("channel.nii", test::nifti_file(options));
  options = {};
  options.endian = test::Endian::big;
  seeds.put("big.nii.gz", test::deflated(test::nifti_file(options)));
  options.pair = true;
  seeds.put("pair.hdr", test::nifti_header(options, 2, 8).substr(0, 348));
  const std::string table =
      "<?xml version=\"1.0\"?><CaretExtension><VolumeInformation Index=\"0\"><LabelTable><Label Key=\"1\">aorta</Label>"
      "</LabelTable></VolumeInformation></CaretExtension>";
  const auto size = static_cast<std::int32_t>((table.size() + 8 + 15) / 16 * 16);
  options = {};
  options.vox_offset = 352 + size;
  std::string named = test::nifti_file(options);
  std::string padded = table;
  padded.resize(static_cast<std::size_t>(size) - 8, '\0');
  named[348] = 1;
  named.insert(352, test::encoded(size, test::Endian::little) + test::encoded(0, test::Endian::little) + padded);
  seeds.put("named.nii", named);
}

void other_volumes(const fs::path& all) {
  const Seeds nrrd(all, "nrrd");
  nrrd.put("raw.nrrd", test::nrrd_header() + voxels());
  nrrd.put("gzip.nrrd", test::nrrd_header("uint8", "encoding: gzip\n") + test::deflated(voxels()));
  std::string numbers;
  for (int i = 0; i < 60; ++i) {
    numbers += std::to_string(i % 5) + (i % 3 == 2 ? "\n" : " ");
  }
  nrrd.put("text.nrrd", test::nrrd_header("short", "encoding: ascii\n") + numbers);
  nrrd.put("beside.nhdr", test::nrrd_header("uint8", "encoding: raw\nbyte skip: 4\ndata file: data.raw\n"));
  nrrd.put("layers.seg.nrrd",
           "NRRD0005\ntype: uchar\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 3 2 5\n"
           "space directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nencoding: raw\n"
           "space origin: (0,0,0)\nSegment0_ID:=a\nSegment0_Name:=aorta\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
           "Segment1_Name:=left atrium\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n\n" +
               voxels());
  nrrd.put("old.seg.nrrd",
           "NRRD0004\ntype: uchar\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 3 2 5\n"
           "space directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nencoding: raw\n"
           "space origin: (0,0,0)\nSegment0_ID:=a\nSegment0_Name:=aorta\nSegment1_ID:=b\n\n" +
               voxels());
  const std::string plain = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 3 4 5\nspacings: 2 3 4\n";
  nrrd.put("minima.nrrd",
           plain + "axis mins: 1 2 3\naxis maxs: 4 5 6\ncenters: cell node cell\nencoding: raw\n\n" + voxels());
  nrrd.put("end.nrrd",
           plain + "encoding: gzip\nline skip: 1\nbyte skip: -3\n\na\n" + test::deflated("abc" + voxels() + "de"));
  nrrd.put("channel.nrrd", "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 1 3 4 5\nencoding: raw\n\n" + voxels());
  const Seeds meta(all, "metaimage");
  meta.put("channel.mha",
           test::replaced(
               test::replaced(
                   test::replaced(test::replaced(test::replaced(test::metaimage_header(), "NDims = 3", "NDims = 4"),
                                                 "1 0 0 0 1 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"),
                                  "10 20 30", "0 10 20 30"),
                   "2 3 4", "1 2 3 4"),
               "3 4 5", "1 3 4 5") +
               voxels());
  meta.put("raw.mha", test::metaimage_header() + voxels());
  const std::string packed = test::deflated(voxels(), 15);
  meta.put("packed.mha", test::metaimage_header("MET_UCHAR", "CompressedData = True\nCompressedDataSize = " +
                                                                 std::to_string(packed.size()) + "\n") +
                             packed);
  meta.put("beside.mhd", test::metaimage_header("MET_SHORT", "ElementByteOrderMSB = True\n", "data.raw"));
  const Seeds slices(all, "slices");
  for (const int compression : {1, 5, 8, 32773}) {
    test::TiffOptions options;
    options.compression = compression;
    options.big_tiff = compression == 5;
    options.endian = compression == 8 ? test::Endian::big : test::Endian::little;
    options.rows = compression == 1 ? 0 : 2;
    options.tile = compression == 32773 ? 3 : 0;
    slices.put("c" + std::to_string(compression) + ".tif",
               test::tiff_file<std::uint8_t>(7, 5, {grey(35), grey(35), grey(35)}, options));
  }
  const std::vector<std::uint8_t> bits(35, 1);
  slices.put("1-bit.png", test::packed_png(7, 5, bits, 1, 0));
  slices.put("palette.png", test::packed_png(7, 5, bits, 4, 3));
  std::string utf16 = test::encoded<std::uint16_t>(0xfeff, test::Endian::little);
  for (const char c : std::string_view("index;name\r\n1;aorta\r\n")) {
    utf16 += {c, '\0'};
  }
  Seeds(all, "label_table").put("utf16.csv", utf16);
  slices.put("8.png", test::png_file(7, 5, grey(35)));
  slices.put("16.png", test::png_file(7, 5, test::sample_values<std::uint16_t>(35)));
}

void meshes(const fs::path& all) {
  const TriangleMesh square = test::square(2);
  const ShellMesh ball = test::octahedron(10);
  const Seeds ply(all, "ply");
  PlyOptions options;
  options.overwrite = true;
  write_ply(ply / "square.ply", square, std::vector<double>(square.vertices.size(), 0.5), options);
  write_ply(ply / "ball.ply", ball, options);
  ply.put("text.ply",
          "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 5\nproperty double x\nproperty double y\n"
          "property double z\nproperty list uchar float lobes\nproperty short s\nelement face 2\n"
          "property list uchar int vertex_indices\nproperty uchar red\nend_header\n"
          "0 0 0 0 1\n1 0 0 2 0.5 0.5 1\n1 1 0 0 1\n0 1 0 0 1\n0.5 0.5 1 0 -7\n4 0 1 2 3 255\n3 0 1 4 0\n");
  for (const char* format : {"obj", "stl", "glb"}) {
    const Seeds seeds(all, format);
    write_surface(seeds / (std::string("own.") + format), square, options);
  }
  Seeds(all, "obj").put("tetrahedron.obj", test::tetrahedron_obj);
  Seeds(all, "stl").put("text.stl", test::ascii_stl());
  Seeds(all, "stl").put("binary.stl", test::binary_stl());
  Seeds(all, "off").put("tetrahedron.off", test::tetrahedron_off);
  Seeds(all, "glb").put("tetrahedron.glb", test::tetrahedron_glb());
}

void tetrahedra(const fs::path& all) {
  const Seeds msh(all, "msh");
  const Seeds vtk(all, "vtk");
  for (const bool binary : {false, true}) {
    const std::string kind = binary ? "binary" : "text";
    msh.put("2-" + kind + ".msh", test::msh2(binary));
    msh.put("4-" + kind + ".msh", test::msh4(binary));
    vtk.put("old-" + kind + ".vtk", test::vtk(binary, false));
    vtk.put("new-" + kind + ".vtk", test::vtk(binary, true));
  }
  const Seeds vtu(all, "vtu");
  for (const auto& [name, kind] : {std::pair("ascii", test::VtuKind::ascii), std::pair("base64", test::VtuKind::base64),
                                   std::pair("raw", test::VtuKind::raw), std::pair("appended", test::VtuKind::appended),
                                   std::pair("zlib", test::VtuKind::zlib), std::pair("big", test::VtuKind::big)}) {
    vtu.put(std::string(name) + ".vtu", test::vtu(kind));
  }
}

State state_of(const Model& model, double time) {
  State state;
  state.time = state.load_factor = time;
  state.displacement.assign(model.node_count(), Vec3(time, 0, 0));
  state.rotation.assign(model.node_count(), Vec3::Zero());
  if (time > 0) {
    state.contacts.resize(model.contacts.size());
    state.rigids.resize(model.rigids.size());
  }
  return state;
}

void pages(const Seeds& seeds) {
  const ShellMesh ball = test::octahedron(10);
  DrawnResult drawn;
  drawn.reference = drawn.solids = {ball.vertices, ball.triangles};
  drawn.shells = ball.triangles.size();
  const std::size_t points = ball.vertices.size();
  for (const double time : {0.0, 0.5, 1.0}) {
    drawn.states.push_back({drawn.states.size(), time, time, std::vector<Vec3>(points, Vec3(time, 0, 0)),
                            std::vector<double>(points, time), std::vector<double>(points, time),
                            std::vector<Vec3>(points, Vec3::Zero())});
  }
  write_page_file(seeds / "static.page", drawn, true);
  drawn.solids = {};
  drawn.states.pop_back();
  for (DrawnResult::State& state : drawn.states) {
    state.of_solids.clear();
  }
  drawn.kind = DrawnResult::Kind::buckling;
  write_page_file(seeds / "modes.page", drawn, true);
}

void journals(const Seeds& seeds) {
  const Model model = journal_model();
  const fs::path part = seeds / "a.hdf.part";
  RunJournal journal = RunJournal::create(
      part, {version, "[run]\n", "tunica-simulate", {{"a", "0"}}, {{"a", "0"}}, {{"--export", "x"}}});
  journal.append(state_of(model, 0));
  journal.append(state_of(model, 1));
  journal.offer([&] {
    Checkpoint checkpoint;
    checkpoint.displacement.assign(model.node_count(), Vec3::Zero());
    checkpoint.summary.steps = 1;
    checkpoint.summary.seconds_per_step = {0.5};
    checkpoint.motion.emplace().velocity = Eigen::Vector3d(1, 2, 3);
    return checkpoint;
  });
  const std::string states = read_file(fs::path(part) += ".states");
  const std::string checkpoint = read_file(fs::path(part) += ".checkpoint");
  const auto length = test::encoded(static_cast<std::uint32_t>(states.size()), test::Endian::little);
  journal.remove();
  fs::remove(part);
  seeds.put("whole", length + states + checkpoint);
  seeds.put("without checkpoint", length + states);
}

void quantities(const Seeds& seeds) {
  int number = 0;
  for (const char* text :
       {"100mmHg", "-90 MPa", "2.5e-07N", "1.1g/cm3", "0.1/s", "1kN*mm", "1e-3kg*m^-3", "0.5%", "0.2mm", "um"}) {
    seeds.put(std::to_string(++number), text);
  }
}

// A folder of the pipeline as its harness takes it apart: the reports of tests/fuzz/seeds/report, and what they name.
void folders(const Seeds& seeds, const fs::path& all, const fs::path& texts) {
  std::string bundle = "=== .cases\nvessel/1\tcase\tsimulate\t0\tdone\nother\tcase\trelax\t4\t\n";
  for (const char* stage : {"extract", "decimate", "relax", "simulate"}) {
    bundle +=
        std::string("=== case/") + stage + ".json\n" + read_file(texts / "report" / (stage + std::string(".json")));
    bundle += "\n";
  }
  bundle += "=== case/simulate.log\ntunica-simulate: it failed\n";
  seeds.put("reports", bundle);
  const std::string mesh = read_file(all / "ply" / "ball.ply");
  const std::string page = read_file(all / "page" / "static.page");
  seeds.put("whole", bundle + "=== case/surface.ply\n" + mesh + "\n=== case/shell.ply\n" + mesh +
                         "\n=== case/result.page\n" + page + "\n");
}

}  // namespace
}  // namespace tunica::fuzz

// usage: fuzz_seeds TEXTS OUT
int main(int count, char** arguments) {
  using namespace tunica::fuzz;
  if (count != 3) {
    return 2;
  }
  const std::filesystem::path texts = arguments[1];
  const std::filesystem::path all = arguments[2];
  nifti({all, "nifti"});
  other_volumes(all);
  meshes(all);
  tetrahedra(all);
  pages({all, "page"});
  journals({all, "journal"});
  quantities({all, "quantity"});
  folders({all, "pipeline"}, all, texts);
  return 0;
}
