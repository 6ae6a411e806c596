#include "tunica/io/result/run_journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(RunIdentity, MeshesMayHaveOtherNamesButNothingElseMayChange) {
  const auto run = [](const std::string& scene, const std::string& hash) {
    return RunIdentity{"1", scene, "", {}, {{"a.ply", hash}}, {}};
  };
  for (const std::string key : {"mesh", "fill"}) {
    const RunIdentity before = run("[[solid]]\n" + key + " = \"a.ply\"\nsize = \"1mm\"\n", "1");
    EXPECT_THAT(difference(before, run("[[solid]]\n" + key + " = \"/b.ply\"\nsize = \"1mm\"\n", "1")), IsEmpty());
    EXPECT_THAT(difference(before, run("[[solid]]\n" + key + " = \"/b.ply\"\nsize = \"2mm\"\n", "1")),
                HasSubstr("in [[solid]] 'size = \"2mm\"' was 'size = \"1mm\"'"));
    EXPECT_THAT(difference(before, run(before.scene, "2")), HasSubstr("a.ply is not the one"));
  }
  EXPECT_THAT(difference(run("mesh = \"a.ply\"\n", "1"), run("fill = \"a.ply\"\n", "1")), HasSubstr("was 'mesh"));
}

}  // namespace
}  // namespace tunica
