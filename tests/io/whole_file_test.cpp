// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/whole_file.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

namespace angio::test {
namespace {

using test::contentOf;
using test::refusalOf;
using test::TemporaryFolder;

TEST(WholeFile, EveryByteComesBack) {
  const TemporaryFolder folder;
  std::string bytes;
  for (int i = 0; i < 200000; ++i) bytes += static_cast<char>(i * 7);
  writeWholeFile(folder.path("a"), "old");
  writeWholeFile(folder.path("a"), bytes);
  EXPECT_EQ(readWholeFile(folder.path("a")), bytes);
  EXPECT_EQ(folder.files(), 1U);
}

TEST(WholeFile, WhatCannotBeReadIsNamed) {
  const TemporaryFolder folder;
  const std::string pipe = folder.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const std::pair<std::string, std::string> cases[] = {
      {folder.path("none"), "No such file"}, {folder.path(""), "is a folder"}, {pipe, "not a regular file"}};
  for (const auto& [path, expected] : cases) {
    const std::string message = refusalOf([&, p = path] { readWholeFile(p); });
    EXPECT_EQ(message.find(path), 0U) << message;
    EXPECT_NE(message.find(expected), std::string::npos) << message;
  }
  EXPECT_NE(refusalOf([&] { readWholeFile(folder.write("b", "12345"), 4); }).find("must not exceed 4 bytes"),
            std::string::npos);
}

TEST(WholeFile, FailureLeavesNothingBehind) {
  const TemporaryFolder folder;
  const std::string target = folder.path("folder");
  std::filesystem::create_directory(target);
  EXPECT_NE(refusalOf([&] { writeWholeFile(target, "x"); }).find("is a folder"), std::string::npos);
  EXPECT_NE(refusalOf([&] { writeWholeFile(folder.path("none/x"), "x"); }).find("cannot be written"),
            std::string::npos);
  EXPECT_EQ(folder.files(), 1U);
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_NE(refusalOf([] { writeWholeFile("/dev/full", "x"); }).find("not a regular file"), std::string::npos);
  }
}

TEST(ClaimedFolder, IsOneProgramsUntilItEnds) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a/run");
  {
    const ClaimedFolder mine(path);
    EXPECT_EQ(refusalOf([&] { ClaimedFolder again(path); }), path + ": is being written by another program");
  }
  const ClaimedFolder again(path);
  folder.write("file", "");
  EXPECT_NE(refusalOf([&] { ClaimedFolder no_folder(folder.path("file")); }).find("cannot be"), std::string::npos);
}

TEST(WholeFile, LinkKeepsPointingToItsTarget) {
  const TemporaryFolder folder;
  folder.write("real", "old");
  std::filesystem::create_symlink("real", folder.path("link"));
  writeWholeFile(folder.path("link"), "new");
  EXPECT_EQ(contentOf(folder.path("real")), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path("link")));
}

}  // namespace
}  // namespace angio::test
