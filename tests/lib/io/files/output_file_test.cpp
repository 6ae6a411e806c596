#include "tunica/io/file/output_file.hpp"

#include "tunica/core/error.hpp"

#include <gtest/gtest.h>

#include <fcntl.h>
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

TEST_F(OutputFileTest, WhatALinkLeadsToIsLookedAtBeforeTheWork) {
  fs::create_symlink("b", in("to_a_file"));
  write_file(in("to_a_file"), "whole", false);
  EXPECT_EQ(read_file(in("b")), "whole");
  EXPECT_TRUE(fs::is_symlink(in("to_a_file")));
  fs::create_symlink("no/folder", in("astray"));
  EXPECT_THROW(require_writable(in("astray"), true), OutputError);
  struct stat here {};
  struct stat there {};
  const fs::path other = "/dev/shm";
  if (::stat(folder_.c_str(), &here) != 0 || ::stat(other.c_str(), &there) != 0 || here.st_dev == there.st_dev) {
    GTEST_SKIP() << "no second file system at " << other;
  }
  fs::create_symlink(other / "tunica-test-never-written", in("abroad"));
  EXPECT_THROW(require_writable(in("abroad"), true), OutputError);
}

TEST_F(OutputFileTest, WhatCannotBeRenamedIsKept) {
  {
    OutputFile file(in("a"), false);
    std::ofstream(file.partial_path()) << "an hour of work";
    fs::create_directory(in("a"));
    EXPECT_THROW(file.commit(), OutputError);
  }
  EXPECT_EQ(read_file(in("a.part")), "an hour of work");
}

TEST_F(OutputFileTest, ADeviceOrAPipeIsNotReplaced) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(write_file(pipe, "bytes", true), OutputError);
  EXPECT_TRUE(fs::is_fifo(pipe));
}

// What another program holds: a lock of another open file.
class ForeignLock {
public:
  explicit ForeignLock(const fs::path& path) : descriptor_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    struct flock whole {};
    whole.l_type = F_WRLCK;
    EXPECT_EQ(::fcntl(descriptor_, F_OFD_SETLK, &whole), 0);
  }
  ~ForeignLock() { ::close(descriptor_); }
  ForeignLock(const ForeignLock&) = delete;
  ForeignLock& operator=(const ForeignLock&) = delete;

private:
  int descriptor_;
};

TEST_F(OutputFileTest, TwoRunsNeverWriteOneFile) {
  std::ofstream(in("a.part")) << "half of the other run's";
  {
    const ForeignLock other(in("a.part"));
    EXPECT_THROW(write_file(in("a"), "mine", true), OutputError);
    EXPECT_EQ(read_file(in("a.part")), "half of the other run's");
    EXPECT_FALSE(fs::exists(in("a")));
  }
  write_file(in("a"), "mine", true);
  EXPECT_EQ(read_file(in("a")), "mine");
}

TEST_F(OutputFileTest, AnEmptyPartOfAnotherRunStays) {
  const ForeignLock other(in("a.part"));
  EXPECT_THROW(PartLock::take(in("a.part")), OutputError);
  EXPECT_TRUE(fs::exists(in("a.part")));
}

TEST_F(OutputFileTest, TheLockKeepsOthersOutUntilItsLastHolderIsGone) {
  const auto locked = [&] {
    const int descriptor = ::open(in("a.part").c_str(), O_RDWR | O_CLOEXEC);
    struct flock whole {};
    whole.l_type = F_WRLCK;
    const bool refused = ::fcntl(descriptor, F_OFD_SETLK, &whole) != 0;
    ::close(descriptor);
    return refused;
  };
  auto lock = PartLock::take(in("a.part"));
  EXPECT_TRUE(locked());
  EXPECT_EQ(PartLock::take(in("a.part")), lock);
  {
    OutputFile file(in("a"), false);
    std::ofstream(file.partial_path()) << "best so far";
    file.keep_partial();
  }
  EXPECT_TRUE(locked());
  lock.reset();
  EXPECT_FALSE(locked());
  EXPECT_EQ(read_file(in("a.part")), "best so far");
  lock = PartLock::take(in("a.part"));
  write_file(in("a"), "done", false);
  EXPECT_NE(PartLock::take(in("a.part")), lock) << "what was renamed is locked no more";
}

TEST_F(OutputFileTest, ALockAloneLeavesNothing) {
  { const auto lock = PartLock::take(in("a.part")); }
  EXPECT_TRUE(fs::is_empty(folder_));
  std::ofstream(in("a.part")) << "of an earlier run";
  { const auto lock = PartLock::take(in("a.part")); }
  EXPECT_EQ(read_file(in("a.part")), "of an earlier run");
}

TEST_F(OutputFileTest, APartThatIsNoFileOfItsOwnIsRefused) {
  const auto refused = [&](const char* name) {
    EXPECT_THROW(write_file(in(name), "bytes", true), OutputError) << name;
    EXPECT_FALSE(fs::exists(in(name))) << name;
  };
  write_file(in("precious"), "kept", false);
  fs::create_symlink(in("precious"), in("link.part"));
  refused("link");
  fs::create_symlink(in("nowhere"), in("dangling.part"));
  refused("dangling");
  fs::create_hard_link(in("precious"), in("twin.part"));
  refused("twin");
  fs::create_directory(in("folder.part"));
  refused("folder");
  ASSERT_EQ(::mkfifo(in("pipe.part").c_str(), 0600), 0);
  refused("pipe");  // and is not waited for
  EXPECT_EQ(read_file(in("precious")), "kept");
  EXPECT_FALSE(fs::exists(in("nowhere")));
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
