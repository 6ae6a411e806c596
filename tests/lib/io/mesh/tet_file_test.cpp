#include "tunica/io/mesh/tet_file.hpp"

#include "io/mesh/tet_files.hpp"
#include "support/mutate.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <gmock/gmock.h>

namespace tunica {
namespace {

using test::TemporaryFolder;
using test::with;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string tet_refusal(const TemporaryFolder& folder, std::string_view bytes, const std::string& name) {
  const auto path = folder.file(name, bytes);
  return test::message_of<InputError>([&] { read_tetrahedra(path, 1.0, 1); });
}

double volume_of(const TetMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c, d] : mesh.tetrahedra) {
    sum += tet_volume(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c], mesh.vertices[d]);
  }
  return sum;
}

class TetFormat : public ::testing::TestWithParam<test::TetSample> {};
INSTANTIATE_TEST_SUITE_P(Tets, TetFormat, ::testing::ValuesIn(test::tet_samples));

TEST_P(TetFormat, GivesTheCube) {
  const TemporaryFolder folder;
  const auto path = folder.file(GetParam().name, GetParam().bytes());
  const TetFile file = read_tetrahedra(path, 10.0, 0.5);
  const TetMesh cube = test::tet_cube();
  const bool pieces = path.extension() == ".vtu";
  ASSERT_EQ(file.mesh.tetrahedra.size(), 6U);
  ASSERT_EQ(file.mesh.vertices.size(), pieces ? 12U : 8U) << "two of the tetrahedra have five corners, four have seven";
  for (std::size_t t = 0; t < 6; ++t) {
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3& p = file.mesh.vertices[file.mesh.tetrahedra[t][k]];
      EXPECT_LT((p - 5 * cube.vertices[cube.tetrahedra[t][k]]).norm(), 1e-15);
    }
  }
  EXPECT_NEAR(volume_of(file.mesh), 125 * 2 * 1.000123456789, 1e-10);
  ASSERT_EQ(file.notes.size(), pieces ? 3U : 1U);
  EXPECT_EQ(file.notes[0],
            path.string() + ": one line, one point, 2 triangles are passed over: only tetrahedra are read");
  if (pieces) {
    EXPECT_EQ(file.notes[1], path.string() + ": has 2 pieces, whose vertices are not joined");
    EXPECT_EQ(file.notes[2], path.string() + ": 4 vertices that no tetrahedron uses are left out");
  }
}

TEST_P(TetFormat, KnowsItsContentUnderAnyName) {
  const TemporaryFolder folder;
  EXPECT_EQ(read_tetrahedra(folder.file("mesh.dat", GetParam().bytes()), 1.0, 1).mesh.tetrahedra.size(), 6U);
}

TEST_P(TetFormat, NeedsAUnit) {
  const TemporaryFolder folder;
  const auto path = folder.file(GetParam().name, GetParam().bytes());
  EXPECT_EQ(test::message_of<InputError>([&] { read_tetrahedra(path, {}, 1); }),
            path.string() + ": is in a format that carries no unit of length: add unit = \"mm\" beside mesh");
}

TEST_P(TetFormat, RefusesWhatIsCutShort) {
  const TemporaryFolder folder;
  const std::string whole = GetParam().bytes();
  // Behind the cells nothing is missed.
  const std::size_t needed = std::min(whole.find("\nCELL_DATA"), whole.size());
  for (std::size_t size = 0; size < needed - 40; size += 7) {
    EXPECT_THAT(tet_refusal(folder, whole.substr(0, size), GetParam().name),
                StartsWith((folder / GetParam().name).string()))
        << size;
  }
}

TEST_P(TetFormat, EndsWithAMeshOrAnInputError) {
  const TemporaryFolder folder;
  const std::string whole = GetParam().bytes();
  int refused = 0;
  constexpr int rounds = 3000;
  for (std::uint64_t seed = 0; seed < rounds; ++seed) {
    const auto path = folder.file(GetParam().name, test::mutate(whole, seed));
    try {
      TetFile file = read_tetrahedra(path, 1.0, 1);
      ASSERT_EQ(require_sound(file.mesh, "again"), 0U) << seed;
    } catch (const InputError& error) {
      ASSERT_TRUE(std::string_view(error.what()).starts_with(path.string())) << seed << ": " << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, rounds / 8) << "the damage must be felt";
}

TEST(TetFile, TurnsTetrahedraAndLeavesOutVertices) {
  const TemporaryFolder folder;
  const std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n9 5 5 5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n"
      "$EndNodes\n$Elements\n2\n1 4 0 1 2 3 4\n2 4 0 2 3 5 4\n$EndElements\n";
  const auto path = folder.file("a.msh", text);
  const TetFile file = read_tetrahedra(path, 1.0, 1);
  EXPECT_EQ(file.mesh.vertices.size(), 5U);
  EXPECT_EQ(file.mesh.tetrahedra[0], (std::array<Index, 4>{0, 1, 2, 3}));
  EXPECT_EQ(file.mesh.tetrahedra[1], (std::array<Index, 4>{1, 2, 3, 4}));
  EXPECT_THAT(file.notes, ElementsAre(path.string() + ": 1 of 2 tetrahedra were inside out and are turned",
                                      path.string() + ": one vertex that no tetrahedron uses is left out"));
}

TEST(TetFile, RefusesOtherFiles) {
  const TemporaryFolder folder;
  EXPECT_THAT(tet_refusal(folder, "solid", "a.stl"), HasSubstr("is no file of tetrahedra of a known format"));
  EXPECT_THAT(tet_refusal(folder, "", "a.msh"), HasSubstr("is empty"));
  EXPECT_THAT(test::message_of<InputError>([&] { read_tetrahedra(folder / "none.msh", 1.0, 1); }),
              HasSubstr("none.msh"));
}

TEST(TetFile, RefusesBadMsh) {
  const TemporaryFolder folder;
  const auto two = [&](std::string_view from, std::string_view to) {
    return tet_refusal(folder, with(test::msh2(false), from, to), "a.msh");
  };
  EXPECT_THAT(two("2.2 0 8", "3.0 0 8"), HasSubstr("a.msh: line 2: version 3 is not understood"));
  EXPECT_THAT(two("2.2 0 8", "2.2 0 4"), HasSubstr("numbers of 4 bytes"));
  EXPECT_THAT(two("2.2 0 8", "2.2 2 8"), HasSubstr("0 for ASCII or 1 for binary"));
  EXPECT_THAT(two("100 0 0 0", "100 0 nan 0"), HasSubstr("vertex 0 lies at (0, nan, 0): coordinates must be finite"));
  EXPECT_THAT(two("100 0 0 0", "100 0 1e13 0"), HasSubstr("within 1000000000000 mm"));
  EXPECT_THAT(two("100 0 0 0", "100 0 x 0"), HasSubstr("line 10: a number is expected within $Nodes"));
  EXPECT_THAT(two("100 0 0 0", "93 0 0 0"), HasSubstr("vertex 93 is there twice"));
  EXPECT_THAT(two("$Nodes\n8", "$Nodes\n800000000000000"), HasSubstr("truncated: 800000000000000 vertices"));
  EXPECT_THAT(two("$Nodes\n8", "$Nodes\n9"), HasSubstr("ends within $Nodes"));
  EXPECT_THAT(two("$Nodes\n8", "$Nodes\n-8"), HasSubstr("-8 is no count"));
  EXPECT_THAT(two("$EndNodes", "$EndNods"), HasSubstr("$EndNodes is missing"));
  EXPECT_THAT(two("5 4 2 1 1 100 93 79 51", "5 4 2 1 1 100 93 79 52"),
              HasSubstr("tetrahedron 0 names vertex 52, which is not there"));
  EXPECT_THAT(two("5 4 2 1 1 100 93 79 51", "5 4 2 1 1 100 93 79 79"),
              HasSubstr("tetrahedron 0 near (0, 0, 0) has no volume"));
  EXPECT_THAT(two("5 4 2", "5 11 2"), HasSubstr("has quadratic tetrahedra, only linear tetrahedra are understood"));
  EXPECT_THAT(two("5 4 2", "5 5 2"), HasSubstr("has hexahedra"));
  EXPECT_THAT(two("5 4 2", "5 99 2"), HasSubstr("Gmsh's type 99"));
  EXPECT_THAT(tet_refusal(folder,
                          "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n"
                          "$Elements\n1\n1 15 0 1\n$EndElements\n",
                          "a.msh"),
              HasSubstr("has no tetrahedra"));
  const auto four = [&](std::string_view from, std::string_view to) {
    return tet_refusal(folder, with(test::msh4(false), from, to), "a.msh");
  };
  EXPECT_THAT(four("2 8 51", "2 9 51"), HasSubstr("9 vertices are promised, 8 are there"));
  EXPECT_THAT(four("2 8 51", "2 7 51"), HasSubstr("more vertices than the 7"));
  EXPECT_THAT(four("4 10 1", "4 4000000000000 1"), HasSubstr("truncated: 4000000000000 elements"));
  EXPECT_THAT(four("4 10 1", "4 9 1"), HasSubstr("more elements than the 9"));
  std::string big = test::msh2(true);
  std::swap(big[20], big[23]);
  EXPECT_THAT(tet_refusal(folder, big, "a.msh"), HasSubstr("little-endian"));
}

TEST(TetFile, RefusesBadVtk) {
  const TemporaryFolder folder;
  const auto bad = [&](bool binary, bool five, std::string_view from, std::string_view to) {
    return tet_refusal(folder, with(test::vtk(binary, five), from, to), "a.vtk");
  };
  EXPECT_THAT(bad(false, false, "UNSTRUCTURED_GRID", "POLYDATA"), HasSubstr("line 4: tetrahedra are read from"));
  EXPECT_THAT(bad(false, false, "ASCII", "UTF"), HasSubstr("line 3: ASCII or BINARY"));
  EXPECT_THAT(bad(true, false, "POINTS 8", "POINTS 800000000"), HasSubstr("truncated: 2400000000 coordinates"));
  EXPECT_THAT(bad(false, false, "POINTS 8", "POINTS 9223372036854775807"), HasSubstr("more than are understood"));
  EXPECT_THAT(bad(false, false, "POINTS 8", "POINTS 7"), HasSubstr("more coordinates stand here"));
  EXPECT_THAT(bad(false, false, "CELLS 10 43", "CELLS 11 43"), HasSubstr("11 cells are promised, CELLS holds 10"));
  EXPECT_THAT(bad(false, false, "4 0 1 3 7", "4 0 1 3 8"),
              HasSubstr("tetrahedron 0 names vertex 8, but there are only 8"));
  EXPECT_THAT(bad(false, false, "4 0 1 3 7", "4 0 1 3 -1"), HasSubstr("names vertex -1"));
  EXPECT_THAT(bad(false, false, "4 0 1 3 7", "400 0 1 3 7"), HasSubstr("cell 4 has 400 corners"));
  EXPECT_THAT(bad(false, false, "5 10 10", "5 24 10"), HasSubstr("has quadratic tetrahedra"));
  EXPECT_THAT(bad(false, false, "5 10 10", "5 12 10"), HasSubstr("cells of VTK's type 12"));
  EXPECT_THAT(bad(false, true, "OFFSETS vtktypeint64\n0 1", "OFFSETS vtktypeint64\n0 -1"),
              HasSubstr("the corners of cell 0"));
  EXPECT_THAT(bad(false, true, "OFFSETS vtktypeint64\n0", "OFFSETS vtktypeint64\n1"),
              HasSubstr("first of the OFFSETS"));
  EXPECT_THAT(bad(false, true, "vtktypeint64", "double"), HasSubstr("whole numbers"));
  EXPECT_THAT(bad(true, true, "vtktypeint64", "nonsense"), HasSubstr("a type of numbers is expected"));
  EXPECT_THAT(bad(true, true, "CELLS 11", "CELLS 1111111111111111111"), HasSubstr("truncated"));
  EXPECT_THAT(bad(false, true, "CELL_TYPES 10", "CELL_TYPES 9"), HasSubstr("more types of cells stand here"));
}

TEST(TetFile, RefusesBadVtu) {
  const TemporaryFolder folder;
  using test::VtuKind;
  const auto bad = [&](VtuKind kind, std::string_view from, std::string_view to) {
    return tet_refusal(folder, with(test::vtu(kind), from, to), "a.vtu");
  };
  EXPECT_THAT(bad(VtuKind::ascii, "UnstructuredGrid", "PolyData"),
              HasSubstr("line 3: is a VTK file of type \"PolyData\""));
  EXPECT_THAT(bad(VtuKind::ascii, "<UnstructuredGrid>", "<!ENTITY a>"), HasSubstr("declarations"));
  EXPECT_THAT(bad(VtuKind::ascii, "</PointData>", "</Points>"), HasSubstr("</Points> closes nothing"));
  EXPECT_THAT(bad(VtuKind::ascii, "\"8\"", "\"800000000\""),
              HasSubstr("2400000000 coordinates are promised, 24 are there"));
  EXPECT_THAT(bad(VtuKind::ascii, "\"8\"", "\"-8\""), HasSubstr("NumberOfPoints of Piece is no count"));
  EXPECT_THAT(bad(VtuKind::ascii, "\"8\"", "8"), HasSubstr("does not stand in quotes"));
  EXPECT_THAT(bad(VtuKind::ascii, "Name=\"types\"", "Name=\"kinds\""), HasSubstr("a Piece without types of cells"));
  EXPECT_THAT(bad(VtuKind::ascii, "0 1 3 7", "0 1 3 8"), HasSubstr("tetrahedron 0 names vertex 8"));
  EXPECT_THAT(bad(VtuKind::ascii, "0 1 3 7", "0 1 3 x"), HasSubstr("holds \"x\", which is no whole number"));
  EXPECT_THAT(bad(VtuKind::ascii, "Int64", "Float64"), HasSubstr("whole numbers are expected"));
  EXPECT_THAT(bad(VtuKind::zlib, "ZLib", "LZ4"), HasSubstr("vtkLZ4DataCompressor is not understood"));
  EXPECT_THAT(bad(VtuKind::raw, "offset=\"0\"", "offset=\"99999999999\""), HasSubstr("begins beyond the end"));
  EXPECT_THAT(bad(VtuKind::raw, "\n _", "\n "), HasSubstr("AppendedData, which is not there"));
  EXPECT_THAT(bad(VtuKind::raw, "encoding=\"raw\"", "encoding=\"rar\""), HasSubstr("base64 or raw"));
  EXPECT_THAT(bad(VtuKind::base64, "wAAAAA", "w*AAAA"), HasSubstr("the sign 0x2a"));
  // A gigabyte in a few bytes.
  std::string bomb = test::vtu(VtuKind::zlib);
  const std::size_t at = bomb.find("\n _") + 3;
  bomb.replace(at, 16, test::base64_of(test::raw(1U) + test::raw(0x7fffffffU) + test::raw(0U)));
  EXPECT_THAT(tet_refusal(folder, bomb, "a.vtu"), HasSubstr("truncated"));
}

}  // namespace
}  // namespace tunica
