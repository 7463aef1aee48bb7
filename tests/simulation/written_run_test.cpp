// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

std::vector<std::string> simulation(const std::string& out, const std::string& settings) {
  return {"--tree",          test::exampleData("hepatic-tace/tree.csv"),
          "--calibration",   test::exampleData("hepatic-tace/carm.yaml"),
          "--out",           out,
          "--frames",        "3",
          "--frame-rate-hz", "1",
          "--settings",      settings};
}

// Grey value at a pixel, the mean of a few around it.
double greyAt(const cv::Mat& image, const Eigen::Vector2d& p) {
  const cv::Rect around(static_cast<int>(std::lround(p.x())) - 1, static_cast<int>(std::lround(p.y())) - 1, 3, 3);
  return cv::mean(image(around & cv::Rect({}, image.size())))[0];
}

TEST(WrittenRun, ReadsBackAndItsTruthLiesOnTheDarkRidge) {
  const test::TemporaryFolder folder;
  const std::string settings = folder.write("scene.yaml", R"(anatomy: {region: liver}
bolus: {enabled: true, start_s: 0}
motion:
  breathing: {amplitude_mm: 12}
  shift: {sudden_mm: [4, 0, 3], sudden_turn_deg: 3, sudden_at_s: 0.5}
device: {kind: catheter, inserted_mm: 40}
collimator: {shutter: octagon}
)");
  auto arguments = simulation(folder.path("run"), settings);
  arguments.insert(arguments.end(), {"--start-primary-deg", "20", "--end-primary-deg", "-10"});
  const test::Ended ended = test::run("angio-simulate", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;

  const CaseSet set = readCaseSet(folder.path("run/cases.yaml"));
  EXPECT_TRUE(set.sequence);
  ASSERT_EQ(set.cases.size(), 3U);
  EXPECT_EQ(set.cases[0].views[0].collimator_px.size(), 8U);
  EXPECT_FALSE(set.cases[1].truth_pose->isApprox(*set.cases[0].truth_pose, 1e-3));
  // Half a second of flow has filled the trunk, two seconds the tree.
  const Case& last = set.cases[2];
  const View& view = last.views[0];
  const cv::Mat image = readXrayImage(*view.image_path, view.camera);
  const VesselTree tree = readVesselTree(last.tree_path);
  const Eigen::Matrix3Xd moved = tree.points() + readDisplacements(*last.truth_displacements_path, tree.size());
  int darker = 0, compared = 0;
  const Eigen::Matrix3Xd tangents = tree.tangents();
  for (int i = 0; i < tree.size(); ++i) {
    const Eigen::Vector3d p = *last.truth_pose * moved.col(i);
    const Eigen::Vector2d px = *view.camera.project(p);
    if ((px.array() - 511.5).abs().maxCoeff() > 400 || !tree.radii()[i] || *tree.radii()[i] < 1.2e-3) continue;
    const Eigen::Vector3d side = p.cross(last.truth_pose->linear() * tangents.col(i));
    if (side.norm() < 0.3 * p.norm()) continue;  // Seen from its end.
    const Eigen::Vector3d off = 2.5 * *tree.radii()[i] * side.normalized();
    const double beside =
        0.5 * (greyAt(image, *view.camera.project(p + off)) + greyAt(image, *view.camera.project(p - off)));
    darker += greyAt(image, px) < 0.97 * beside;
    ++compared;
  }
  ASSERT_GT(compared, 60);
  EXPECT_GT(darker, 0.85 * compared);  // Where vessels cross or run side by side, what is beside is dark too.

  const CaseSet lines = readCaseSet(folder.path("run/centerlines.yaml"));
  ASSERT_FALSE(lines.cases.empty());
  const int early = readCenterline(*lines.cases.front().views[0].centerline_path).size();
  EXPECT_GT(readCenterline(*lines.cases.back().views[0].centerline_path).size(), early);
  EXPECT_GT(readCenterline(folder.path("run/device0001.csv")).size(), 50);
}

TEST(WrittenRun, IsTheSameAgainAndAnotherWithAnotherSeed) {
  const test::TemporaryFolder folder;
  const std::string settings = folder.write("scene.yaml", "threads: 2\nmotion: {breathing: {amplitude_mm: 10}}\n");
  const auto frameOf = [&](const std::string& name, const std::string& seed) {
    auto arguments = simulation(folder.path(name), settings);
    arguments.insert(arguments.end(), {"--seed", seed, "--format", "run"});
    EXPECT_EQ(test::run("angio-simulate", arguments).exit_code, 0);
    EXPECT_EQ(XrayFrames(folder.path(name + "/frames.tif")).count(), 3);
    return readXrayImage(folder.path(name + "/frames.tif"), 2);
  };
  const cv::Mat first = frameOf("a", "4");
  EXPECT_EQ(cv::norm(frameOf("b", "4"), first, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(frameOf("c", "5"), first, cv::NORM_INF), 0);
}

TEST(WrittenRun, RefusesSettingsWithALine) {
  const test::TemporaryFolder folder;
  const std::string settings = folder.write("scene.yaml", "bolus:\n  enabled: true\n  wash_in_s: -3\n");
  const test::Ended ended = test::run("angio-simulate", simulation(folder.path("run"), settings));
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.err.find("scene.yaml:3: wash_in_s = -3: "), std::string::npos) << ended.err;
  EXPECT_EQ(test::run("angio-simulate", {"--frames", "3"}).exit_code, 2);  // Without a folder there is no run.
}

}  // namespace
}  // namespace angio::test
