#include "io/mesh/helpers.hpp"
#include "tunica/io/mesh/surface_file.hpp"

#include <gmock/gmock.h>

#include <fmt/format.h>

#include <Eigen/Geometry>

namespace tunica {
namespace {

using test::TemporaryFolder;
using test::with;
using ::testing::HasSubstr;

double volume(const TriangleMesh& mesh) {
  double six = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    six += mesh.vertices[a].dot(mesh.vertices[b].cross(mesh.vertices[c]));
  }
  return six / 6;
}

TEST(Obj, ReadsEveryKindOfCornerInFullPrecision) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(folder.file("a.OBJ", test::tetrahedron_obj));
  ASSERT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.mesh.vertices[3].z(), 1.000123456789);
  ASSERT_EQ(file.mesh.triangles.size(), 4U);
  EXPECT_DOUBLE_EQ(volume(file.mesh), 1.000123456789 / 6);
}

TEST(Obj, KeepsVerticesThatNoFaceUsesAndEqualOnes) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(
      folder.file("a.obj", "v 9 9 9\n" + with(test::tetrahedron_obj, "v 0 0 0", "v 9 9 9\nv 0 0 0") + "f 3 4 5\n"));
  EXPECT_EQ(file.mesh.vertices.size(), 6U);
  EXPECT_EQ(file.mesh.triangles.size(), 5U);
}

TEST(Obj, JoinsAFileWhoseFacesShareNoVertex) {
  const TemporaryFolder folder;
  const MeshFile file =
      read_mesh(folder.file("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 0 0\nv 0 0 0\nv 0 -1 0\nf 4 5 6\n"));
  EXPECT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.mesh.triangles[1], (std::array<Index, 3>{1, 0, 3}));
}

TEST(Obj, JoinsPolygonsThatShareNoVertex) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(folder.file(
      "a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nv 1 0 0\nv 0 0 0\nv 0 0 1\nv 1 0 1\nf 5 6 7 8\n"));
  EXPECT_EQ(file.mesh.vertices.size(), 6U);
  EXPECT_EQ(file.mesh.triangles.size(), 4U);
}

TEST(Obj, RefusesWhatIsWrong) {
  const TemporaryFolder folder;
  const auto bad = [&](std::string_view from, std::string_view to) {
    return test::refusal(folder, with(test::tetrahedron_obj, from, to), "a.obj");
  };
  EXPECT_THAT(bad("v 0 1 0", "v 0 1"), HasSubstr("a.obj: line 6: a vertex needs three numbers"));
  EXPECT_THAT(bad("v 0 1 0", "v 0 1 x"), HasSubstr("three numbers"));
  EXPECT_THAT(bad("v 0 1 0", "v 0 1 inf"), HasSubstr("must be finite"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 0/1 3/1"), HasSubstr("counted from 1"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 a/1 3/1"), HasSubstr("counted from 1"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 5/1 3/1"), HasSubstr("face 3 names vertex 4, but there are only 4"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 -5/1 3/1"), HasSubstr("-5 is no index"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 99999999999999999999/1 3/1"), HasSubstr("no index"));
  EXPECT_THAT(bad("1/1 4/1 3/1", "1/1 4/1"), HasSubstr("has 2 corners"));
  EXPECT_THAT(test::refusal(folder, "v 0 0 0\n", "a.obj"), HasSubstr("has no triangles"));
  EXPECT_THAT(test::refusal(folder, "v 0 0 0\nf 1 1 \\\n", "a.obj"), HasSubstr("ends within a face"));
}

TEST(Off, ReadsCommentsColoursAndALastLineWithoutEnd) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(folder.file("a.off", test::tetrahedron_off));
  EXPECT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_DOUBLE_EQ(volume(file.mesh), 1.000123456789 / 6);
  const std::string coloured =
      with(with(test::tetrahedron_off, "OFF\n# made by hand\n", "COFF "), "0 0 0\n", "0 0 0 1 1 1 1\n");
  EXPECT_DOUBLE_EQ(volume(read_mesh(folder.file("b.off", coloured)).mesh), 1.000123456789 / 6);
}

TEST(Off, RefusesWhatIsWrong) {
  const TemporaryFolder folder;
  const auto bad = [&](std::string_view from, std::string_view to) {
    return test::refusal(folder, with(test::tetrahedron_off, from, to), "a.off");
  };
  EXPECT_THAT(bad("OFF", "4OFF"), HasSubstr("begins with OFF"));
  EXPECT_THAT(bad("OFF", "OFF BINARY"), HasSubstr("binary OFF"));
  EXPECT_THAT(bad("4 4 0", "4 x 0"), HasSubstr("line 3: the numbers of vertices and faces"));
  EXPECT_THAT(bad("4 4 0", "4 -4 0"), HasSubstr("the numbers of vertices and faces"));
  EXPECT_THAT(bad("4 4 0", "4 400000000000000000 0"), HasSubstr("truncated"));
  EXPECT_THAT(bad("4 4 0", "4 5 0"), HasSubstr("truncated: it ends before face 4"));
  EXPECT_THAT(bad("4 4 0", "4 3 0"), HasSubstr("text follows the last face"));
  EXPECT_THAT(bad("1 0 0", "1 0"), HasSubstr("three numbers"));
  EXPECT_THAT(bad("1 0 0", "1 nan 0"), HasSubstr("vertex 1 lies at"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1 4"), HasSubstr("face 1 names vertex 4"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1"), HasSubstr("counted from 0"));
  EXPECT_THAT(bad("3 0 1 3", "9 0 1 3"), HasSubstr("counted from 0"));
  EXPECT_THAT(bad("3 0 1 3", "2 0 1 3"), HasSubstr("at least 3"));
  EXPECT_THAT(test::refusal(folder, "# nothing\n", "a.off"), HasSubstr("no OFF file"));
  EXPECT_THAT(test::refusal(folder, "OFF\n", "a.off"), HasSubstr("within the header"));
}

TEST(Stl, AsciiIsReadInFullPrecisionAndJoinedExactly) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(folder.file("a.stl", test::ascii_stl()));
  EXPECT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.mesh.triangles.size(), 4U);
  EXPECT_DOUBLE_EQ(volume(file.mesh), 1.000123456789 / 6);
  // The last bit makes another vertex: nothing is joined by a tolerance.
  const MeshFile torn =
      read_mesh(folder.file("b.stl", with(test::ascii_stl(), "1.000123456789", "1.0001234567890002")));
  EXPECT_EQ(torn.mesh.vertices.size(), 5U);
}

TEST(Stl, BinaryIsKnownByItsLength) {
  const TemporaryFolder folder;
  for (const char* header : {"solid, but binary", "COLOR=", ""}) {
    const MeshFile file = read_mesh(folder.file("a.stl", test::binary_stl(header)));
    EXPECT_EQ(file.mesh.vertices.size(), 4U);
    EXPECT_DOUBLE_EQ(volume(file.mesh), 1.0 / 6);
  }
}

TEST(Stl, RefusesWhatIsWrong) {
  const TemporaryFolder folder;
  const auto bad = [&](std::string_view from, std::string_view to) {
    return test::refusal(folder, with(test::ascii_stl(), from, to), "a.stl");
  };
  EXPECT_THAT(bad("vertex 1 0 0", "vertex 1 0"), HasSubstr("three numbers"));
  EXPECT_THAT(bad("vertex 1 0 0", "vortex 1 0 0"), HasSubstr("line 6: \"vertex\" is expected"));
  EXPECT_THAT(bad("vertex 1 0 0", "vertex 1 0 -inf"), HasSubstr("must be finite"));
  EXPECT_THAT(bad("    endloop\n", ""), HasSubstr("\"endloop\" is expected"));
  EXPECT_THAT(bad("endsolid a name with words", ""), HasSubstr("truncated: it ends after 4 triangles"));
  EXPECT_THAT(bad("facet normal", "facette"), HasSubstr("\"facet\" or \"endsolid\""));
  const std::string ascii = test::ascii_stl();
  EXPECT_THAT(test::refusal(folder, ascii.substr(0, 100), "a.stl"), HasSubstr("it ends within a facet"));
  const std::string binary = test::binary_stl("VCG");
  EXPECT_THAT(test::refusal(folder, binary.substr(0, 284 - 7), "a.stl"),
              HasSubstr("4 triangles are promised, 7 bytes are missing"));
  EXPECT_THAT(test::refusal(folder, binary + "12345", "a.stl"), HasSubstr("5 bytes follow the 4 triangles"));
  EXPECT_THAT(test::refusal(folder, binary.substr(0, 40), "a.stl"), HasSubstr("truncated: 40 bytes"));
  EXPECT_THAT(test::refusal(folder, "solid nothing\nendsolid\n", "a.stl"), HasSubstr("has no triangles"));
}

TEST(Glb, FollowsNodesMirrorsAndMetres) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.glb", test::tetrahedron_glb());
  const MeshFile file = read_mesh(path, {}, true);
  ASSERT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.units, "m");
  EXPECT_EQ(file.mesh.vertices[1], Vec3(-2000, 0, 5000));
  EXPECT_DOUBLE_EQ(volume(file.mesh), 8e9 / 6) << "a mirrored node must not turn the surface inside out";
  EXPECT_EQ(read_mesh(path, 1.0).mesh.vertices[1], Vec3(-2, 0, 5)) << "--mesh-unit overrules the format's metres";
}

TEST(Glb, ReadsTheSceneShownOrEveryRoot) {
  const TemporaryFolder folder;
  const std::string data = test::tetrahedron_glb_data();
  const std::string none =
      with(with(test::tetrahedron_glb_json, "\"scene\":0,", ""), "\"scenes\":[{\"nodes\":[1]}],", "");
  EXPECT_EQ(read_mesh(folder.file("a.glb", test::glb(none, data))).mesh.triangles.size(), 4U);
  const std::string twice = with(with(test::tetrahedron_glb_json, "\"nodes\":[1]", "\"nodes\":[1,2]"),
                                 "\"name\":\"parent\"}", "\"name\":\"parent\"},{\"mesh\":0}");
  const MeshFile file = read_mesh(folder.file("b.glb", test::glb(twice, data)));
  EXPECT_EQ(file.mesh.triangles.size(), 8U);
  EXPECT_EQ(file.mesh.vertices.size(), 8U);
}

TEST(Glb, RefusesWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string data = test::tetrahedron_glb_data();
  const auto bad = [&](std::string_view from, std::string_view to) {
    return test::refusal(folder, test::glb(with(test::tetrahedron_glb_json, from, to), data), "a.glb");
  };
  EXPECT_THAT(bad("\"count\":12", "\"count\":13"), HasSubstr("reaches beyond"));
  EXPECT_THAT(bad("\"count\":12", "\"count\":11"), HasSubstr("11 corners are no number of triangles"));
  EXPECT_THAT(bad("\"count\":4", "\"count\":4294967295"), HasSubstr("more memory than its size justifies"));
  EXPECT_THAT(bad("\"count\":4", "\"count\":3"), HasSubstr("names vertex 3, but there are only 3"));
  EXPECT_THAT(bad("\"count\":4", "\"count\":-4"), HasSubstr("no whole number"));
  EXPECT_THAT(bad("\"byteStride\":16", "\"byteStride\":4"), HasSubstr("reaches beyond"));
  EXPECT_THAT(bad("\"byteOffset\":64", "\"byteOffset\":4294967295"), HasSubstr("reaches beyond"));
  EXPECT_THAT(bad("5126", "5123"), HasSubstr("no vectors of floats"));
  EXPECT_THAT(bad("5123", "5126"), HasSubstr("no unsigned whole numbers"));
  EXPECT_THAT(bad("\"children\":[0]", "\"children\":[1]"), HasSubstr("no tree"));
  EXPECT_THAT(bad("\"children\":[0]", "\"children\":[0,0]"), HasSubstr("no tree"));
  EXPECT_THAT(bad("\"children\":[0]", "\"children\":[7]"), HasSubstr("nodes 7, which is not there"));
  EXPECT_THAT(bad("\"children\":[0]", "\"children\":{}"), HasSubstr("wrong type"));
  EXPECT_THAT(bad("\"mesh\":0", "\"mesh\":1"), HasSubstr("meshes 1"));
  EXPECT_THAT(bad("\"mesh\":0", "\"skin\":0"), HasSubstr("has no triangles"));
  EXPECT_THAT(bad("\"POSITION\"", "\"POSITIONS\""), HasSubstr("\"POSITION\" is missing"));
  EXPECT_THAT(bad("[-2,2,2]", "[-2,2]"), HasSubstr("needs 3 numbers"));
  EXPECT_THAT(bad("[-2,2,2]", "[-2,2,1e300]"), HasSubstr("needs 3 numbers"));
  EXPECT_THAT(bad("\"indices\":1", "\"indices\":1,\"mode\":5"), HasSubstr("strips and fans"));
  EXPECT_THAT(bad("\"indices\":1", "\"indices\":1,\"mode\":0"), HasSubstr("has no triangles"));
  EXPECT_THAT(bad("{\"byteLength\":88}", "{\"byteLength\":88,\"uri\":\"other.bin\"}"), HasSubstr("another file"));
  EXPECT_THAT(bad("{\"asset\"", "{\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\""),
              HasSubstr("KHR_draco_mesh_compression"));
  EXPECT_THAT(bad("{\"asset\"", "{\"asset"), HasSubstr("JSON is broken"));
  const std::string whole = test::tetrahedron_glb();
  EXPECT_THAT(test::refusal(folder, whole.substr(0, whole.size() - 9), "a.glb"),
              HasSubstr("truncated: 9 bytes are missing"));
  EXPECT_THAT(test::refusal(folder, whole + "123", "a.glb"), HasSubstr("3 bytes follow"));
  EXPECT_THAT(test::refusal(folder, whole.substr(0, 9), "a.glb"), HasSubstr("truncated within its header"));
  EXPECT_THAT(test::refusal(folder, with(whole, std::string("glTF\2", 5), std::string("glTF\1", 5)), "a.glb"),
              HasSubstr("version 1"));
}

TEST(Glb, PassesOverDeepNestingWithoutTheMemoryForIt) {
  const TemporaryFolder folder;
  const std::string deep = "\"extras\":" + std::string(1000000, '[') + std::string(1000000, ']') + ",\"asset\":";
  const std::string json = with(test::tetrahedron_glb_json, "\"asset\":", deep);
  EXPECT_EQ(read_mesh(folder.file("a.glb", test::glb(json, test::tetrahedron_glb_data()))).mesh.triangles.size(), 4U);
}

TEST(Glb, RefusesToMultiplyASmallFile) {
  const TemporaryFolder folder;
  std::string nodes = "{\"mesh\":0}";
  std::string roots = "2";
  for (int n = 3; n < 200; ++n) {
    nodes += ",{\"mesh\":0}";
    roots += "," + std::to_string(n);
  }
  std::string json = with(test::tetrahedron_glb_json, "\"nodes\":[1]", "\"nodes\":[1," + roots + "]");
  json = with(json, "\"name\":\"parent\"}", "\"name\":\"parent\"}," + nodes);
  EXPECT_EQ(read_mesh(folder.file("a.glb", test::glb(json, test::tetrahedron_glb_data()))).mesh.triangles.size(),
            4 * 199U);
  std::string many = "\"indices\":1}";
  for (int p = 0; p < 50; ++p) {
    many += ",{\"attributes\":{\"POSITION\":0},\"indices\":1}";
  }
  const std::string bomb = with(json, "\"indices\":1,\"material\":0}", many);
  EXPECT_THAT(test::refusal(folder, test::glb(bomb, test::tetrahedron_glb_data()), "a.glb"),
              HasSubstr("more memory than its size justifies"));
}

TEST(Glb, HasAsManyNodesAsItLikes) {
  const TemporaryFolder folder;
  constexpr int count = 400'000;
  std::string nodes = "{\"mesh\":0}";
  std::string children = "2";
  for (int n = 3; n < count; ++n) {
    nodes += ",{\"mesh\":0}";
    children += "," + std::to_string(n);
  }
  std::string json = with(test::tetrahedron_glb_json, "\"children\":[0]", "\"children\":[0," + children + "]");
  json = with(json, "\"name\":\"parent\"}", "\"name\":\"parent\"}," + nodes);
  EXPECT_EQ(read_mesh(folder.file("a.glb", test::glb(json, test::tetrahedron_glb_data()))).mesh.triangles.size(),
            4U * (count - 1));
}

TEST(MeshFile, AsksForTheUnitOfFilesThatSayNone) {
  const TemporaryFolder folder;
  const auto asks = [&](const std::string& name, const std::string& bytes) {
    const auto path = folder.file(name, bytes);
    EXPECT_THAT(test::message_of<UsageError>([&] { read_mesh(path, {}, true); }), HasSubstr("--mesh-unit mm|cm|m|um"));
    EXPECT_EQ(read_mesh(path, 10.0, true).mesh.vertices.at(1).cwiseAbs().maxCoeff(), 10);
    EXPECT_EQ(read_mesh(path).mesh.vertices.at(1).cwiseAbs().maxCoeff(), 1);
  };
  asks("a.obj", test::tetrahedron_obj);
  asks("a.off", test::tetrahedron_off);
  asks("a.stl", test::binary_stl());
}

TEST(MeshFile, RefusesWhatIsNoMesh) {
  const TemporaryFolder folder;
  EXPECT_THAT(test::refusal(folder, "# vtk DataFile Version 4.2\n", "a.vtk"),
              HasSubstr("PLY, OBJ, STL, OFF and GLB are understood"));
  EXPECT_THAT(test::refusal(folder, "<VTKFile/>", "a.vtp"), HasSubstr("PLY, OBJ, STL, OFF and GLB are understood"));
  EXPECT_THAT(test::refusal(folder, "", "a.stl"), HasSubstr("is empty"));
  EXPECT_THAT(test::message_of<InputError>([&] { read_mesh(folder / "none.ply"); }), HasSubstr("no such file"));
  std::filesystem::create_directory(folder / "folder.ply");
  EXPECT_THAT(test::message_of<InputError>([&] { read_mesh(folder / "folder.ply"); }), HasSubstr("not a regular file"));
  EXPECT_EQ(read_mesh(folder.file("misnamed.obj", test::tetrahedron_glb())).units, "m") << "the content decides";
}

/// What a file of these bytes says of its axes.
std::string space_of(const TemporaryFolder& folder, const std::string& name, const std::string& bytes) {
  return read_mesh(folder.file(name, bytes)).space.value_or("none");
}

TEST(Space, IsReadWhereverAFormatHasRoomForIt) {
  const TemporaryFolder folder;
  EXPECT_EQ(space_of(folder, "a.stl", test::binary_stl("3D Slicer output. SPACE=RAS")), "RAS");
  EXPECT_EQ(space_of(folder, "b.stl", with(test::ascii_stl(), "a name with words", "Slicer output. SPACE=LPS")), "LPS");
  EXPECT_EQ(space_of(folder, "c.obj", "# exported, space = ras, today\n" + test::tetrahedron_obj), "RAS");
  EXPECT_EQ(space_of(folder, "f.obj", test::tetrahedron_obj + "\ng organ # SPACE=RAS\n"), "RAS");
  EXPECT_EQ(space_of(folder, "g.stl", with(test::ascii_stl(), "endsolid", "endsolid organ SPACE=RAS")), "RAS");
  EXPECT_EQ(space_of(folder, "d.off", with(test::tetrahedron_off, "made by hand", "SPACE: Right-Anterior-Superior.")),
            "RAS");
  for (const auto& [from, to] : {std::pair(R"("version":"2.0")", R"("version":"2.0","extras":{"SPACE":"RAS"})"),
                                 {R"("asset":)", R"("extras":{"SPACE":"RAS"},"asset":)"},
                                 {R"("name":"parent")", R"("name":"SPACE=RAS; made by a program")"},
                                 {R"("meshes":[{)", R"("meshes":[{"name":"SPACE=RAS",)"},
                                 {R"("meshes":[{)", R"("meshes":[{"extras":{"note":"in SPACE=RAS"},)"}}) {
    EXPECT_EQ(
        space_of(folder, "e.glb", test::glb(with(test::tetrahedron_glb_json, from, to), test::tetrahedron_glb_data())),
        "RAS");
  }
}

TEST(Space, IsNoPartOfOtherWords) {
  const TemporaryFolder folder;
  for (const char* text : {"whitespace=RAS", "SPACE=RASTER", "SPACE RAS", "spaces=LPS", "my_space=LPS",
                           "SPACE=", "a space", "--space ras", "SPACE=RAS-like"}) {
    EXPECT_EQ(space_of(folder, "a.stl", test::binary_stl(text)), "none") << text;
    EXPECT_EQ(space_of(folder, "a.obj", "# " + std::string(text) + "\n" + test::tetrahedron_obj), "none") << text;
  }
}

TEST(Space, OneFileSaysOne) {
  const TemporaryFolder folder;
  EXPECT_THAT(test::refusal(folder, "# SPACE=RAS\n# SPACE=LPS\n" + test::tetrahedron_obj, "a.obj"),
              HasSubstr("says both"));
  EXPECT_THAT(test::refusal(folder, test::binary_stl("SPACE=RAS SPACE=LPS"), "a.stl"), HasSubstr("says both"));
}

/// What a file of these bytes says of its unit, and its second vertex in mm.
std::string unit_of(const TemporaryFolder& folder, const std::string& name, const std::string& bytes) {
  const MeshFile file = read_mesh(folder.file(name, bytes), {}, false);
  return file.units.value_or("none") + fmt::format(" {}", file.mesh.vertices.at(1).cwiseAbs().maxCoeff());
}

TEST(Unit, IsReadWhereverAFormatHasRoomForIt) {
  const TemporaryFolder folder;
  for (const auto& [text, unit] : {std::pair("units cm", "cm 10"),
                                   {"UNITS=cm", "cm 10"},
                                   {"a program. File units = centimetres", "cm 10"},
                                   {"unit: Micron", "um 0.001"},
                                   {"all units are millimeters.", "mm 1"},
                                   {"SPACE=LPS; units=m; by hand", "m 1000"},
                                   {"SPACE=RAS UNITS=  mm COLOR=red", "mm 1"},
                                   {"units 'cm', by hand", "cm 10"},
                                   {"{\"unit\": \"M\"}", "m 1000"}}) {
    const std::string comment = fmt::format("# {}\n", text);
    EXPECT_EQ(unit_of(folder, "a.obj", comment + test::tetrahedron_obj), unit);
    EXPECT_EQ(unit_of(folder, "a.stl", test::binary_stl(text)), unit);
    EXPECT_EQ(unit_of(folder, "b.stl", with(test::ascii_stl(), "a name with words", text)), unit);
    EXPECT_EQ(unit_of(folder, "a.off", with(test::tetrahedron_off, "made by hand", text)), unit);
    EXPECT_EQ(unit_of(folder, "b.off", with(test::tetrahedron_off, "OFF", fmt::format("OFF # {}", text))), unit);
    EXPECT_EQ(unit_of(folder, "a.ply",
                      fmt::format("ply\nformat ascii 1.0\ncomment {}\nelement vertex 3\n"
                                  "property double x\nproperty double y\nproperty double z\n"
                                  "element face 1\nproperty list uchar int vertex_indices\n"
                                  "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                                  text)),
              unit);
  }
  for (const char* text :
       {"unit normals", "units of the scanner: mm", "subunit = cm", "unity mm", "unit m of the house",
        "units=", "units", "unit: none", "velocity, unit: m/s", "pressure unit: mm Hg", "unit: mm Hg", "time unit: m",
        "colour units m", "the unit: m. Miller", "flow unit: cm3/s", "units: m m"}) {
    EXPECT_EQ(unit_of(folder, "a.obj", fmt::format("# {}\n", text) + test::tetrahedron_obj), "none 1") << text;
  }
}

TEST(Unit, OfAFileIsOneThatIsUnderstoodAndHoldsAgainstAnother) {
  const TemporaryFolder folder;
  EXPECT_THAT(test::refusal(folder, "# units mm\n# unit: m\n" + test::tetrahedron_obj, "a.obj"),
              HasSubstr("contradict each other"));
  EXPECT_THAT(test::refusal(folder, test::binary_stl("UNITS=inch"), "a.stl"), HasSubstr("its unit is inches, which"));
  const auto path = folder.file("b.obj", "# units mm\n" + test::tetrahedron_obj);
  const MeshFile file = read_mesh(path, 1000.0);
  EXPECT_EQ(file.mesh.vertices.at(1).cwiseAbs().maxCoeff(), 1);
  EXPECT_THAT(test::message_of<InputError>([&] { require_no_other_unit(file, 1000.0, path); }),
              HasSubstr("do not state another one"));
  ASSERT_TRUE(unit_note(file, path, 1000.0));
  EXPECT_THAT(unit_note(file, path, 1000.0)->text, HasSubstr("says that its unit is mm, and is taken in that"));
  EXPECT_FALSE(unit_note(file, path, 1.0));
}

/// What is written in mm is read in mm, whatever is stated for files that say no unit.
TEST(Unit, IsWrittenByEveryFormatThatIsRead) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = read_mesh(folder.file("t.obj", test::tetrahedron_obj)).mesh;
  for (const char* name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
    write_surface(folder / name, mesh, {});
    EXPECT_NEAR(read_mesh(folder / name, {}, true).mesh.vertices.at(1).cwiseAbs().maxCoeff(), 1, 1e-6) << name;
  }
}

TEST(Glb, IsInTheUnitThatIsStated) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.glb", test::tetrahedron_glb());
  const MeshFile in_mm = read_mesh(path, 1.0);
  require_no_other_unit(in_mm, 1.0, path);
  EXPECT_NEAR((read_mesh(path).mesh.vertices[1] - 1000 * in_mm.mesh.vertices[1]).norm(), 0, 1e-9);
}

}  // namespace
}  // namespace tunica
