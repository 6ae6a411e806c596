#include "io/output_file.hpp"

#include "core/error.hpp"

#include <gtest/gtest.h>

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

namespace tunica {
namespace {
namespace fs = std::filesystem;

class OutputFileTest : public testing::Test {
protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "tunica-test-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path in(const char* name) const { return folder_ / name; }

  fs::path folder_;
};

TEST_F(OutputFileTest, IsWholeOrNotThere) {
  {
    OutputFile file(in("a"), false);
    std::ofstream(file.partial_path()) << "half";
    EXPECT_FALSE(fs::exists(in("a")));
  }
  EXPECT_TRUE(fs::is_empty(folder_)) << "neither the file nor its .part stays behind";
  write_file(in("a"), "whole", false);
  EXPECT_EQ(read_file(in("a")), "whole");
  EXPECT_FALSE(fs::exists(in("a.part")));
}

TEST_F(OutputFileTest, ThePartStaysWhenAsked) {
  {
    OutputFile file(in("a"), false);
    std::ofstream(file.partial_path()) << "best so far";
    file.keep_partial();
  }
  EXPECT_EQ(read_file(in("a.part")), "best so far");
  write_file(in("a"), "done", false);
  EXPECT_FALSE(fs::exists(in("a.part"))) << "a stale .part is overwritten";
}

TEST_F(OutputFileTest, ExistingFilesAreSafe) {
  write_file(in("a"), "old", false);
  EXPECT_THROW(write_file(in("a"), "new", false), OutputError);
  EXPECT_EQ(read_file(in("a")), "old");
  write_file(in("a"), "new", true);
  EXPECT_EQ(read_file(in("a")), "new");
}

TEST_F(OutputFileTest, WhatCannotBeWrittenIsSaidBeforeTheWork) {
  EXPECT_THROW(require_writable(in("no/such/folder"), true), OutputError);
  EXPECT_THROW(require_writable(folder_, true), OutputError);
  EXPECT_THROW(OutputFile(in("no/file"), true), OutputError);
}

TEST_F(OutputFileTest, ADeviceOrAPipeIsNotReplaced) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(write_file(pipe, "bytes", true), OutputError);
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST_F(OutputFileTest, ReadingRefusesWhatIsNotAFile) {
  EXPECT_THROW(read_file(in("missing")), InputError);
  EXPECT_THROW(read_file(folder_), InputError);
  EXPECT_THROW(read_file("/dev/zero"), InputError);
  write_file(in("a"), "12345", false);
  EXPECT_THROW(read_file(in("a"), 4), InputError);
}

TEST_F(OutputFileTest, Sha256OfAKnownText) {
  write_file(in("a"), "abc", false);
  EXPECT_EQ(sha256_of_file(in("a")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace tunica
