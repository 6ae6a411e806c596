#include "io/mesh/helpers.hpp"

#include <ostream>

namespace tunica {
namespace {

struct Fact {
  const char* file;
  std::size_t vertices;
  std::size_t triangles;
};
void PrintTo(const Fact& fact, std::ostream* out) { *out << fact.file; }

/// Counts of vertices and faces as the README beside the data gives them.
class RealMesh : public ::testing::TestWithParam<Fact> {};
INSTANTIATE_TEST_SUITE_P(
    All, RealMesh,
    ::testing::Values(
        Fact{"meshes/vmtk_aorta_gold.stl", 6468, 12932}, Fact{"meshes/vmtk_aorta_open.stl", 6068, 11887},
        Fact{"meshes/sofa_aneurysm3D_1.off", 7095, 14186}, Fact{"meshes/sofa_aneurysm3D_1.obj", 7095, 14186},
        Fact{"meshes/sofa_liver-smooth.obj", 2194, 4384}, Fact{"meshes/sofa_liver.obj", 181, 274},
        Fact{"meshes/sofaenv_gallbladder.stl", 7352, 14700}, Fact{"meshes/openhelp_stomach.stl", 4864, 9724},
        Fact{"meshes/gca_colon_90_20k.obj", 10000, 20000},
        Fact{"meshes/awkward_colon_VHF_nonmanifold.obj", 10137, 20419},
        Fact{"meshes/awkward_liver_pieces.stl", 14462, 28716}, Fact{"meshes/awkward_skull_polys.obj", 3305, 6597},
        Fact{"meshes/awkward_aorta_3pieces.obj", 18732, 37304}, Fact{"paper/aneurysmHighRes.obj", 14186, 28368},
        Fact{"paper/aneurysm200.obj", 102, 200}, Fact{"paper/aneurysm400.obj", 202, 400},
        Fact{"paper/aneurysm600.obj", 302, 600}, Fact{"paper/aneurysm800.obj", 402, 800},
        Fact{"paper/aneurysm1000.obj", 502, 1000}, Fact{"paper/anevrismLowRes300WithHoles.obj", 152, 290},
        Fact{"paper/anevrismLowRes300WithHoles_iteration1.obj", 595, 1160},
        Fact{"paper/anevrismLowRes400WithHoles.obj", 201, 387}, Fact{"paper/liverHighRes.obj", 3996, 8000},
        Fact{"paper/liverLowRes300.obj", 147, 300}, Fact{"paper/liverLowRes300_iteration1.obj", 596, 1200},
        Fact{"paper/cylinderHighRes.obj", 8080, 16000}, Fact{"paper/cylinderLowRes.obj", 24, 40},
        Fact{"paper/lens_implant_refinedHaptics.obj", 473, 743}));

TEST_P(RealMesh, HasTheCountsOfItsReadme) {
  const std::filesystem::path path = std::filesystem::path(TUNICA_SHARED_DATA) / GetParam().file;
  if (!std::filesystem::exists(path)) {
    GTEST_SKIP() << path << " is not on this machine";
  }
  const MeshFile file = read_mesh(path);
  EXPECT_EQ(file.mesh.vertices.size(), GetParam().vertices);
  EXPECT_EQ(file.mesh.triangles.size(), GetParam().triangles);
}

}  // namespace
}  // namespace tunica
