// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/volume/coverage.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

TEST(ExtractTreeProgram, WritesEveryFormatInTheFrameAskedFor) {
  const test::TemporaryFolder folder;
  const VesselTree truth = test::bentFork();
  const std::string volume = folder.write(
      "v.mha", test::metaImage(test::tubes(truth, test::obliqueGrid({90, 90, 60}, {0.6e-3, 0.7e-3, 1.1e-3}))));
  writeVesselTree(folder.path("truth.csv"), truth, PatientFrame::kRas);
  for (const char* name : {"t.csv", "t.swc", "t.vtp", "t.mrk.json", "t.tre"}) {
    const test::Ended ended = test::run(
        "angio-extract-tree", {volume, "--threshold", "500", "--out", folder.path(name), "--frame", "RAS", "--picture",
                               folder.path("p.png"), "--compare", folder.path("truth.csv"), "--compare-frame", "RAS"});
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_NE(ended.out.find("1 trees, 3 branches, 2 ends"), std::string::npos) << ended.out;
    EXPECT_NE(ended.out.find("reference near tree: "), std::string::npos);
    VesselTree tree = readVesselTree(folder.path(name));
    if (!saysItsFrame(folder.path(name))) tree = withOtherFrame(tree);
    EXPECT_GT(coverage(truth, tree, 0.6e-3).share, 0.95) << name;
  }
}

TEST(ExtractTreeProgram, WrongInputEndsWithOneLineAndItsCode) {
  const test::TemporaryFolder folder;
  const std::string out = folder.path("t.csv");
  const test::Ended missing = test::run("angio-extract-tree", {folder.path("none.mha"), "--out", out});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_EQ(std::count(missing.err.begin(), missing.err.end(), '\n'), 1) << missing.err;
  EXPECT_EQ(test::run("angio-extract-tree", {"v.mha"}).exit_code, 2);
  EXPECT_EQ(test::run("angio-extract-tree", {"v.mha", "--out", out, "--seed", "1,2"}).exit_code, 2);
  EXPECT_EQ(test::run("angio-extract-tree", {"v.mha", "--out", out, "--frame", "LAS"}).exit_code, 2);
  EXPECT_EQ(folder.files(), 0U);
}

}  // namespace
}  // namespace angio::test
