// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/volume/coverage.hpp"
#include "phantom.hpp"
#include "surfaces.hpp"

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

TEST(ExtractTreeProgram, SaysWhatItMendedAndWhere) {
  const test::TemporaryFolder folder;
  const std::string pipe = folder.write("pipe.stl", binaryStl(openPipe()));
  const test::Ended ended = test::run("angio-extract-tree", {pipe, "--out", folder.path("t.csv"), "--frame", "RAS",
                                                             "--result", folder.path("t.json"), "--kissing", "keep"});
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("\nopen ends: 2, closed by a flat lid: at -20.0,-30.0,"), std::string::npos) << ended.out;
  const auto json = nlohmann::json::parse(readWholeFile(folder.path("t.json")));
  EXPECT_EQ(json.at("settings").at("kissing"), "keep");
  EXPECT_EQ(json.at("branches"), 1);
  ASSERT_EQ(json.at("repairs").size(), 2U);
  for (const auto& repair : json.at("repairs")) {
    EXPECT_EQ(repair.at("kind"), "open_end");
    EXPECT_NEAR(repair.at("at_mm").at(0), -20, 1e-3);
    EXPECT_NEAR(repair.at("radius_mm"), 3, 0.01);
  }
  // Refused before anything is written.
  const Volume ring = [&] {
    Eigen::Matrix3Xd points(3, 61);
    std::vector<int> parents(61);
    for (int i = 0; i < 61; ++i) {
      points.col(i) = 10e-3 * Eigen::Vector3d(std::cos(kPi * i / 30), std::sin(kPi * i / 30), 0);
      parents[static_cast<std::size_t>(i)] = i - 1;
    }
    return tubes({points, parents, std::vector<std::optional<double>>(61, 2e-3)},
                 obliqueGrid({60, 60, 60}, Eigen::Vector3d::Constant(0.6e-3)));
  }();
  const std::string volume = folder.write("ring.mha", metaImage(ring));
  const std::size_t files = folder.files();
  const test::Ended refused = test::run(
      "angio-extract-tree", {volume, "--threshold", "500", "--out", folder.path("r.csv"), "--cycles", "refuse"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find("cycles = 1: must be none"), std::string::npos) << refused.err;
  EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1) << refused.err;
  EXPECT_EQ(folder.files(), files);
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
