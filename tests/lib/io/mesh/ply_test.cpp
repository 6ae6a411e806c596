#include "io/mesh/helpers.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tunica {
namespace {

using test::message_of;
using test::TemporaryFolder;
using test::with;
using ::testing::HasSubstr;

std::string refusal(const TemporaryFolder& folder, std::string_view bytes) {
  return test::refusal(folder, bytes, "mesh.ply");
}

template <typename T>
void append(std::string& bytes, T value, bool big_endian) {
  std::array<char, sizeof value> raw;
  std::memcpy(raw.data(), &value, sizeof value);
  if (big_endian) {
    std::reverse(raw.begin(), raw.end());
  }
  bytes.append(raw.data(), raw.size());
}

const std::string tetrahedron_ascii =
    "ply\nformat ascii 1.0\ncomment SPACE=RAS\ncomment units cm\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n0 0 1.5e-1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

/// A binary tetrahedron with everything a stranger's file may hold besides.
std::string crowded_binary(bool big_endian) {
  std::string bytes = fmt::format(
      "ply\r\nformat binary_{}_endian 1.0\r\nobj_info from elsewhere\r\ncomment units um\r\n"
      "element camera 2\r\nproperty list ushort short knobs\r\nproperty double angle\r\n"
      "element vertex 4\r\nproperty uchar red\r\nproperty double z\r\nproperty list uint float lobes\r\n"
      "property int16 x\r\nproperty float32 y\r\nproperty double thickness\r\n"
      "element face 4\r\nproperty float area\r\nproperty list int32 ushort vertex_index\r\n"
      "property list uchar uchar colours\r\nelement tail 1\r\nproperty char c\r\nend_header\r\n",
      big_endian ? "big" : "little");
  for (int camera = 0; camera < 2; ++camera) {
    append<std::uint16_t>(bytes, static_cast<std::uint16_t>(camera), big_endian);
    for (int knob = 0; knob < camera; ++knob) {
      append<std::int16_t>(bytes, -7, big_endian);
    }
    append(bytes, 0.5, big_endian);
  }
  const int corners[4][3] = {{0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}, {0, 0, 1000}};
  for (std::uint32_t v = 0; v < 4; ++v) {
    append<std::uint8_t>(bytes, static_cast<std::uint8_t>(200 + v), big_endian);
    append<double>(bytes, corners[v][2], big_endian);
    append<std::uint32_t>(bytes, v, big_endian);
    for (std::uint32_t lobe = 0; lobe < v; ++lobe) {
      append(bytes, 2.5F, big_endian);
    }
    append<std::int16_t>(bytes, static_cast<std::int16_t>(corners[v][0]), big_endian);
    append<float>(bytes, static_cast<float>(corners[v][1]), big_endian);
    append<double>(bytes, 0.1 * v, big_endian);
  }
  const std::uint16_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  for (const auto& face : faces) {
    append(bytes, 1.0F, big_endian);
    append<std::int32_t>(bytes, 3, big_endian);
    for (const std::uint16_t corner : face) {
      append(bytes, corner, big_endian);
    }
    append<std::uint8_t>(bytes, 2, big_endian);
    bytes += "\x01\x02";
  }
  return bytes + "!";
}

TriangleMesh grid(std::size_t n) {
  TriangleMesh mesh;
  for (std::size_t j = 0; j <= n; ++j) {
    for (std::size_t i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(std::sqrt(static_cast<double>(i)), std::cbrt(static_cast<double>(j)),
                                 1.0 / static_cast<double>(1 + i + j));
    }
  }
  const auto at = [&](std::size_t i, std::size_t j) { return static_cast<Index>(j * (n + 1) + i); };
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

bool same_bits(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
}

TEST(PlyRoundTrip, KeepsEveryBitOfAMesh) {
  const TemporaryFolder folder;
  TriangleMesh mesh = grid(20);
  mesh.vertices[3] = {5e-324, -0.0, 1e12};
  mesh.vertices[4] = {std::nextafter(1.0, 2.0), 0.1 + 0.2, -1e-310};
  write_ply(folder / "a.ply", mesh, {.comments = {"made by\na test"}, .space = "RAS"});
  const MeshFile file = read_mesh(folder / "a.ply", {}, true);
  EXPECT_TRUE(same_bits(file.mesh.vertices, mesh.vertices));
  EXPECT_EQ(file.mesh.triangles, mesh.triangles);
  EXPECT_EQ(file.space, "RAS");
  EXPECT_EQ(file.units, "mm");
  EXPECT_FALSE(file.patch.has_value());
  EXPECT_THAT(file.comments, ::testing::Contains("made by a test"));
}

TEST(PlyRoundTrip, KeepsEveryBitOfAShell) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = grid(7);
  ShellMesh shell{mesh.vertices, mesh.triangles, {}, {}, Patch::watertight};
  for (const Vec3& vertex : mesh.vertices) {
    shell.normals.push_back((vertex + Vec3(0.3, 0.2, 1)).normalized());
  }
  for (const auto& triangle : mesh.triangles) {
    const Vec3 normal = mesh.vertices[triangle[1]].normalized();
    shell.corner_normals.push_back({normal, -normal, Vec3::UnitY()});
  }
  write_ply(folder / "a.ply", shell, {});
  const ShellMesh read = shell_of(read_mesh(folder / "a.ply"), folder / "a.ply");
  EXPECT_TRUE(same_bits(read.vertices, shell.vertices));
  EXPECT_TRUE(same_bits(read.normals, shell.normals));
  EXPECT_EQ(read.triangles, shell.triangles);
  EXPECT_EQ(read.corner_normals, shell.corner_normals);
  EXPECT_EQ(read.patch, Patch::watertight);
}

TEST(PlyRoundTrip, KeepsTheQualityOfAnErrorMap) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = grid(2);
  const std::vector<double> quality = {0, 1e-9, 0.1, 3, 4, 5, 6, 7, 1.0 / 3};
  write_ply(folder / "map.ply", mesh, quality, {});
  const MeshFile file = read_mesh(folder / "map.ply");
  ASSERT_EQ(file.vertex_properties.size(), 1U);
  EXPECT_EQ(file.vertex_properties[0].first, "quality");
  EXPECT_EQ(file.vertex_properties[0].second, quality);
}

TEST(PlyWriter, RefusesToOverwriteAndLeavesNothingBehind) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.ply", "mine");
  EXPECT_THAT(message_of<OutputError>([&] { write_ply(path, grid(1), PlyOptions{}); }), HasSubstr("--force"));
  EXPECT_EQ(test::bytes_of(path), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder / "a.ply.part"));
  write_ply(path, grid(1), {.overwrite = true});
  EXPECT_EQ(read_mesh(path).mesh.triangles.size(), 2U);
}

TEST(PlyWriter, LeavesThePartialFileOfAFailedRun) {
  const TemporaryFolder folder;
  write_ply(folder / "a.ply", grid(1), {.partial = true});
  EXPECT_FALSE(std::filesystem::exists(folder / "a.ply"));
  std::filesystem::rename(folder / "a.ply.part", folder / "b.ply");
  EXPECT_EQ(read_mesh(folder / "b.ply").mesh.triangles.size(), 2U);
}

TEST(PlyReader, ReadsAsciiInFullPrecisionAndScalesToMillimetres) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.ply", with(tetrahedron_ascii, "1.5e-1", "+1000.123456789"));
  const MeshFile file = read_mesh(path);
  ASSERT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.mesh.vertices[3], Vec3(0, 0, 10 * 1000.123456789));
  EXPECT_EQ(file.mesh.triangles[3], (std::array<Index, 3>{0, 3, 2}));
  EXPECT_EQ(file.space, "RAS");
  EXPECT_EQ(file.units, "cm");
}

TEST(PlyReader, TwoMeshesShareTheSpaceThatEitherNames) {
  MeshFile lps, ras, silent;
  lps.space = "LPS";
  ras.space = "RAS";
  EXPECT_EQ(common_space(lps, "a", lps, "b"), "LPS");
  EXPECT_EQ(common_space(ras, "a", ras, "b"), "RAS");
  EXPECT_EQ(common_space(ras, "a", silent, "b"), "RAS");
  EXPECT_EQ(common_space(silent, "a", ras, "b"), "RAS");
  EXPECT_EQ(common_space(silent, "a", silent, "b"), "LPS");
  MeshFile small = lps;
  small.space = "lps";
  EXPECT_NO_THROW(common_space(small, "a", lps, "b"));
  try {
    common_space(lps, "shell.ply", ras, "organ.ply");
    FAIL();
  } catch (const InputError& error) {
    for (const char* part : {"shell.ply", "organ.ply", "SPACE=LPS", "SPACE=RAS", "--space"}) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(part));
    }
  }
}

TEST(PlyReader, OtherAxesAreNotMendedByTheSignsOfXAndY) {
  MeshFile lps;
  lps.space = "LPS";
  for (const char* other : {"LAS", "RAI"}) {
    MeshFile odd;
    odd.space = other;
    for (const auto& [a, b] : {std::pair(lps, odd), std::pair(odd, lps)}) {
      try {
        common_space(a, "a.ply", b, "b.ply");
        FAIL();
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("only LPS and RAS are known"));
        EXPECT_THAT(error.what(), ::testing::Not(::testing::HasSubstr("sign of x")));
      }
    }
  }
}

TEST(PlyReader, OwnUnitWinsOverTheFlagAndNoneIsMillimetres) {
  const TemporaryFolder folder;
  const auto with_unit = folder.file("cm.ply", tetrahedron_ascii);
  EXPECT_EQ(read_mesh(with_unit, 1000.0).mesh.vertices[1].x(), 10);
  EXPECT_THAT(refusal(folder, with(tetrahedron_ascii, "units cm", "units cm\ncomment units mm")),
              HasSubstr("contradict"));
  const auto without = folder.file("none.ply", with(tetrahedron_ascii, "comment units cm\n", ""));
  EXPECT_EQ(read_mesh(without, 1000.0).mesh.vertices[1].x(), 1000);
  EXPECT_EQ(read_mesh(without, {}, true).mesh.vertices[1].x(), 1);
  EXPECT_THAT(refusal(folder, with(tetrahedron_ascii, "units cm", "units parsec")), HasSubstr("um, mm, cm and m"));
}

TEST(PlyReader, ReadsCarriageReturnsAndBlankLinesInAscii) {
  const TemporaryFolder folder;
  std::string text = with(tetrahedron_ascii, "0 1 0\n", "\n  0\t1 0  \n\n");
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) {
    text.replace(at, 1, "\r\n");
  }
  EXPECT_EQ(read_mesh(folder.file("a.ply", text)).mesh.vertices[2], Vec3(0, 10, 0));
  text.resize(text.size() - 2);
  EXPECT_EQ(read_mesh(folder.file("a.ply", text)).mesh.triangles.size(), 4U);
}

class PlyEndian : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Both, PlyEndian, ::testing::Bool());

TEST_P(PlyEndian, ReadsEveryTypeAndSkipsWhatItDoesNotKnow) {
  const TemporaryFolder folder;
  const MeshFile file = read_mesh(folder.file("a.ply", crowded_binary(GetParam())));
  ASSERT_EQ(file.mesh.vertices.size(), 4U);
  EXPECT_EQ(file.mesh.vertices[1], Vec3(1, 0, 0));
  EXPECT_EQ(file.mesh.vertices[2], Vec3(0, 1, 0));
  EXPECT_EQ(file.mesh.vertices[3], Vec3(0, 0, 1));
  EXPECT_EQ(file.mesh.triangles[1], (std::array<Index, 3>{0, 1, 3}));
  ASSERT_EQ(file.vertex_properties.size(), 2U);
  EXPECT_EQ(file.vertex_properties[0].first, "red");
  EXPECT_EQ(file.vertex_properties[0].second[3], 203);
  EXPECT_EQ(file.vertex_properties[1].first, "thickness");
  EXPECT_EQ(file.vertex_properties[1].second[3], 0.1 * 3);
  EXPECT_TRUE(file.normals.empty());
}

TEST_P(PlyEndian, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  const std::string whole = crowded_binary(GetParam());
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_NE(refusal(folder, whole.substr(0, length)), "no such error") << length;
  }
}

TEST(PlyReader, SaysHowManyBytesAreMissing) {
  const TemporaryFolder folder;
  write_ply(folder / "a.ply", grid(4), {});
  const std::string whole = test::bytes_of(folder / "a.ply");
  for (const std::size_t missing : {std::size_t{1}, std::size_t{13}, std::size_t{32 * 13 + 5}}) {
    EXPECT_THAT(refusal(folder, whole.substr(0, whole.size() - missing)),
                HasSubstr(fmt::format("truncated: {} bytes follow the header, at least {} bytes are missing",
                                      whole.size() - missing - whole.find("end_header") - 11, missing)));
  }
  EXPECT_THAT(refusal(folder, whole + "x"), HasSubstr("1 bytes follow the last record"));
}

TEST(PlyReader, SaysWhatIsMissingAfterALongList) {
  const TemporaryFolder folder;
  const std::string whole = crowded_binary(false);
  // The lists of unknown properties are longer than the least: only reading finds the end.
  EXPECT_THAT(refusal(folder, whole.substr(0, whole.size() - 8)), HasSubstr("is truncated: it ends in face 3"));
}

TEST(PlyReader, SplitsPolygonsWithoutLosingOrAddingArea) {
  const TemporaryFolder folder;
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 9\nproperty double x\nproperty double y\nproperty double z\n"
      "element face 3\nproperty list uchar uint vertex_indices\nend_header\n"
      "0 0 0\n4 0 0\n4 4 0\n2 1 0\n0 4 0\n5 0 0\n7 0 0\n7 2 0\n5 2 0\n"
      "5 0 1 2 3 4\n3 0 1 2\n4 5 6 7 8\n";
  const MeshFile file = read_mesh(folder.file("a.ply", text));
  ASSERT_EQ(file.mesh.triangles.size(), 6U);
  EXPECT_EQ(file.mesh.triangles[3], (std::array<Index, 3>{0, 1, 2}));
  double concave = 0;
  for (std::size_t t = 0; t < 3; ++t) {
    const auto& [a, b, c] = file.mesh.triangles[t];
    const Vec3 u = file.mesh.vertices[b] - file.mesh.vertices[a];
    const Vec3 v = file.mesh.vertices[c] - file.mesh.vertices[a];
    const double twice = u.x() * v.y() - u.y() * v.x();
    EXPECT_GT(twice, 0);
    concave += twice / 2;
  }
  EXPECT_DOUBLE_EQ(concave, 16 - 6);
  EXPECT_EQ(file.mesh.triangles[4], (std::array<Index, 3>{5, 6, 7}));
  EXPECT_EQ(file.mesh.triangles[5], (std::array<Index, 3>{5, 7, 8}));
}

TEST(PlyReader, RefusesEveryWrongHeader) {
  const TemporaryFolder folder;
  const auto bad = [&](std::string_view from, std::string_view to) {
    return refusal(folder, with(tetrahedron_ascii, from, to));
  };
  EXPECT_THAT(bad("ply\n", "plx\n"), HasSubstr("mesh.ply: is not a PLY file"));
  EXPECT_THAT(bad("format ascii 1.0\n", ""), HasSubstr("no format line"));
  EXPECT_THAT(bad("ascii 1.0", "ascii 2.0"), HasSubstr("version 1.0"));
  EXPECT_THAT(bad("format ascii", "format utf8"), HasSubstr("line 2: the format must be"));
  EXPECT_THAT(bad("end_header", "endheader"), HasSubstr("no keyword of PLY"));
  EXPECT_THAT(bad("property float y", "property float x"), HasSubstr("declared twice"));
  EXPECT_THAT(bad("property float y", "property float w"), HasSubstr("no coordinate y"));
  EXPECT_THAT(bad("property float y", "property list uchar float y"), HasSubstr("no coordinate y"));
  EXPECT_THAT(bad("property float y", "property quad y"), HasSubstr("\"quad\" is no type"));
  EXPECT_THAT(bad("property float y", "property float"), HasSubstr("needs a type and a name"));
  EXPECT_THAT(bad("property float y", "property float y\nproperty float nx"), HasSubstr("nx, ny and nz"));
  EXPECT_THAT(bad("element face 4", "element vertex 4"), HasSubstr("declared twice"));
  EXPECT_THAT(bad("element face 4", "element strip 4"), HasSubstr("no element face"));
  EXPECT_THAT(bad("element face 4", "element face -4"), HasSubstr("a name and a count"));
  EXPECT_THAT(bad("element face 4", "element face 5"), HasSubstr("truncated"));
  EXPECT_THAT(bad("element face 4", "element face 3"), HasSubstr("text follows the last record"));
  EXPECT_THAT(bad("element vertex 4", "property float a\nelement vertex 4"), HasSubstr("before the first element"));
  EXPECT_THAT(bad("list uchar int vertex_indices", "list float int vertex_indices"), HasSubstr("whole-number type"));
  EXPECT_THAT(bad("list uchar int vertex_indices", "list uchar float vertex_indices"), HasSubstr("whole numbers"));
  EXPECT_THAT(bad("list uchar int vertex_indices", "list uchar int corners"), HasSubstr("need one list"));
  EXPECT_THAT(bad("comment units cm", "comment surface=flat"), HasSubstr("surface=comas or surface=watertight"));
  EXPECT_THAT(refusal(folder, ""), HasSubstr("is empty"));
  EXPECT_THAT(refusal(folder, "ply\nformat ascii 1.0\nelement vertex 4\n"), HasSubstr("ends within the header"));
  EXPECT_THAT(refusal(folder, "ply\n" + std::string(2 << 20, 'c') + "\nend_header\n"), HasSubstr("no end_header"));
}

TEST(PlyReader, RefusesEveryWrongBody) {
  const TemporaryFolder folder;
  const auto bad = [&](std::string_view from, std::string_view to) {
    return refusal(folder, with(tetrahedron_ascii, from, to));
  };
  EXPECT_THAT(bad("0 1 0\n", "0 1\n"), HasSubstr("line 14: z: a number is expected"));
  EXPECT_THAT(bad("0 1 0\n", "0 1 0 0\n"), HasSubstr("line 14: more values"));
  EXPECT_THAT(bad("0 1 0\n", "0 1,0 0\n"), HasSubstr("line 14: y: a number is expected"));
  EXPECT_THAT(bad("0 1 0\n", "0 nan 0\n"), HasSubstr("vertex 2 lies at"));
  EXPECT_THAT(bad("0 1 0\n", "0 1e999 0\n"), HasSubstr("must be finite"));
  EXPECT_THAT(bad("0 1 0\n", "0 1e300 0\n"), HasSubstr("within 1000000000000 mm"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1 4"), HasSubstr("face 1 names vertex 4, but there are only 4"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1 -1"), HasSubstr("-1 is no index"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1 99999999999"), HasSubstr("a whole number of the type declared"));
  EXPECT_THAT(bad("3 0 1 3", "3 0 1 1.5"), HasSubstr("a whole number"));
  EXPECT_THAT(bad("3 0 1 3", "2 0 1  "), HasSubstr("a face of 2 corners"));
  EXPECT_THAT(bad("3 0 1 3", "256 0 1 3"), HasSubstr("the length of a list"));
  std::string none = with(tetrahedron_ascii, "element face 4", "element face 0");
  EXPECT_THAT(refusal(folder, none.substr(0, none.find("3 0 2 1"))), HasSubstr("has no triangles"));
}

TEST(PlyReader, BelievesNoCountBeforeTheBytes) {
  const TemporaryFolder folder;
  write_ply(folder / "a.ply", grid(2), {});
  const std::string whole = test::bytes_of(folder / "a.ply");
  for (const char* count : {"2147483647", "1000000000", "9223372036854775807"}) {
    EXPECT_NE(refusal(folder, with(whole, "element vertex 9", fmt::format("element vertex {}", count))),
              "no such error");
    EXPECT_NE(refusal(folder, with(whole, "element face 8", fmt::format("element face {}", count))), "no such error");
  }
  EXPECT_THAT(refusal(folder, with(whole, "element face 8", "element empty 999999999999\nelement face 9")),
              HasSubstr("truncated"));
}

TEST(PlyShell, NeedsUnitNormals) {
  const TemporaryFolder folder;
  const std::string plain = tetrahedron_ascii;
  const auto flat = folder.file("a.ply", plain);
  EXPECT_THAT(message_of<InputError>([&] { shell_of(read_mesh(flat), flat); }), HasSubstr("tunica-relax"));
  ShellMesh shell{grid(1).vertices, grid(1).triangles, std::vector<Vec3>(4, Vec3::UnitZ()), {}, Patch::comas};
  shell.normals[2] = {0, 0, 1.1};
  write_ply(folder / "b.ply", shell, {});
  EXPECT_THAT(message_of<InputError>([&] { shell_of(read_mesh(folder / "b.ply"), folder / "b.ply"); }),
              HasSubstr("the normal of vertex 2 has the length 1.1"));
  shell.normals[2] = {0, std::numeric_limits<double>::quiet_NaN(), 1};
  write_ply(folder / "c.ply", shell, {});
  EXPECT_THAT(message_of<InputError>([&] { shell_of(read_mesh(folder / "c.ply"), folder / "c.ply"); }),
              HasSubstr("the normal of vertex 2"));
}

TEST(PlyReader, ReadsAMillionTriangles) {
  const TemporaryFolder folder;
  write_ply(folder / "a.ply", grid(708), {});
  EXPECT_EQ(read_mesh(folder / "a.ply").mesh.triangles.size(), 1002528U);
}

}  // namespace
}  // namespace tunica
