// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/case_run.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/io/camera_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {
namespace {

// Files of one tree, seen from one side.
class CaseRuns : public testing::Test {
 protected:
  CaseRuns() {
    writeVesselTree(folder_.path("tree.csv"), tree_);
    writeCamera(folder_.path("camera.yaml"), camera_);
  }

  void writeView(const std::string& name, const Pose& truth, const Pose& start) {
    writeCenterline(folder_.path("c" + name + ".csv"), projectedCenterline(tree_, camera_, truth));
    writePose(folder_.path("t" + name + ".yaml"), {truth, {}});
    writePose(folder_.path("i" + name + ".yaml"), {start, {}});
    cases_ += "  - {name: \"" + name + "\", centerline: c" + name + ".csv, initial_pose: i" + name +
              ".yaml, truth_pose: t" + name + ".yaml}\n";
  }
  Pose nearby(const Pose& T) { return test::perturbed(T, tree_, random_.twist(0.002, degToRad(1))); }
  CaseSet readSet(const std::string& head = "") {
    return readCaseSet(folder_.write("cases.yaml", head + "tree: tree.csv\ncamera: camera.yaml\ncases:\n" + cases_));
  }

  test::TemporaryFolder folder_;
  test::Random random_{11};
  VesselTree tree_ = test::branchingTree(2);
  XrayCamera camera_ = test::clinicalCamera();
  Pose truth_ = test::viewOf(tree_, random_);
  std::string cases_;
  CaseRunSettings settings_{IterativePnpSettings{}, {}, OtsuSettings{}, {}};
};

TEST_F(CaseRuns, CleanViewsAreFoundAndSummedUp) {
  for (const char* name : {"a", "b", "c"}) {
    const Pose truth = nearby(truth_);
    writeView(name, truth, nearby(truth));
  }
  int last_done = 0;
  const auto outcomes = runCases(readSet(), settings_, [&](int done) { last_done = done; });
  ASSERT_EQ(outcomes.size(), 3u);
  EXPECT_EQ(last_done, 3);
  for (const auto& o : outcomes) {
    ASSERT_EQ(o.result.status, RegistrationStatus::kConverged) << o.name << ": " << o.result.reason;
    ASSERT_TRUE(o.error && o.start_error);
    EXPECT_GT(o.start_error->mtre_m, 1e-3);
    // What the view tells is found; of depth, which it tells least, the paper's prior keeps some of the start's.
    EXPECT_LT(o.error->in_plane_m, 2e-4) << o.name;
    EXPECT_LT(radToDeg(o.error->rotation_rad), 0.2) << o.name;
    EXPECT_LT(o.error->mtre_m, 0.7 * o.start_error->mtre_m) << o.name;
    EXPECT_NEAR(o.pixel_at_isocenter_m, 0.75 / camera_.parameters().fx_px, 0.01 * o.pixel_at_isocenter_m);
  }
  const auto summary = summaryOf(outcomes);
  EXPECT_EQ(summary["cases"], 3);
  EXPECT_EQ(summary["status"]["converged"], 3);
  EXPECT_EQ(summary["cases_with_truth"], 3);
  EXPECT_EQ(summary["success_mtre_2mm_percent"], 100);
  EXPECT_EQ(summary["failed_and_trusted_percent"], 0);
  EXPECT_NE(summaryTable({{"iterative_pnp", summary}}).find("| iterative_pnp | 3 of 3 |"), std::string::npos);
}

TEST_F(CaseRuns, ASecondViewIsUsed) {
  const Eigen::Translation3d to_center(0, 0, 0.75);
  const Pose T_side_first = to_center * expSE3((Twist() << 0, 0, 0, 0, kPi / 2, 0).finished()) * to_center.inverse();
  writePose(folder_.path("side.yaml"), {T_side_first, {}});
  writeView("a", truth_, nearby(truth_));
  writeCenterline(folder_.path("sa.csv"), projectedCenterline(tree_, camera_, T_side_first * truth_));
  cases_ =
      "  - {name: one, centerline: ca.csv, initial_pose: ia.yaml, truth_pose: ta.yaml}\n"
      "  - {name: two, camera: [camera.yaml, camera.yaml], T_view_first: side.yaml, centerline: [ca.csv, sa.csv],\n"
      "     initial_pose: ia.yaml, truth_pose: ta.yaml}\n";
  const auto outcomes = runCases(readSet(), settings_);
  ASSERT_EQ(outcomes[1].result.status, RegistrationStatus::kConverged) << outcomes[1].result.reason;
  EXPECT_GT(outcomes[1].result.points_2d, 1.8 * outcomes[0].result.points_2d);
  // From the side, depth is what an image shows best.
  EXPECT_LT(outcomes[1].error->depth_m, 0.1 * outcomes[0].error->depth_m);
  EXPECT_LT(outcomes[1].error->mtre_m, 1e-4);
}

// The files' poses are all off by the same 6 mm and 4 degrees, as by a calibration: the first frame tells by how much,
// an empty one is no frame to learn from, and a camera that goes away takes what was learnt with it.
TEST_F(CaseRuns, ASequenceGoesOnFromWhatItsFramesHaveShown) {
  const Pose off = test::perturbed(truth_, tree_, random_.twist(0.006, degToRad(4)));
  const Eigen::Translation3d to_center(0, 0, 0.75);
  const auto moved = [&](double by_rad) {
    return Pose(to_center * expSE3((Twist() << 0, 0, 0, 0, by_rad, 0).finished()) * to_center.inverse());
  };
  writeView("first", truth_, off);
  writeView("empty", truth_, off);
  folder_.write("cempty.csv", "x_px,y_px\n1,1\n2,2\n3,3\n");
  writeView("next", moved(degToRad(5)) * truth_, moved(degToRad(5)) * off);
  writeView("far", moved(degToRad(40)) * truth_, moved(degToRad(40)) * off);

  const auto sequence = runCases(readSet("sequence: true\n"), settings_);
  ASSERT_EQ(sequence[0].result.status, RegistrationStatus::kConverged) << sequence[0].result.reason;
  EXPECT_TRUE(sequence[0].followed.value());
  EXPECT_GT(sequence[0].start_error->mtre_m, 3e-3);
  EXPECT_EQ(sequence[1].result.status, RegistrationStatus::kTooFewPoints);
  EXPECT_FALSE(sequence[1].followed.value());
  EXPECT_FALSE(sequence[1].rejection.value().empty());
  for (int k : {2, 3}) {
    EXPECT_EQ(sequence[k].result.status, RegistrationStatus::kConverged) << sequence[k].result.reason;
    EXPECT_TRUE(sequence[k].followed.value()) << sequence[k].rejection.value_or("");
    EXPECT_FALSE(sequence[k].rejection);
    // Depth is what the first frame leaves open: its own error is what the next one starts from.
    EXPECT_LT(sequence[k].start_error->mtre_m, 1.5 * sequence[0].error->mtre_m + 1e-4) << k;
  }
  // On its own each starts where the files say.
  EXPECT_NEAR(runCases(readSet(), settings_)[2].start_error->mtre_m, sequence[0].start_error->mtre_m, 1e-4);
}

// A breath of 12 mm and 2 degrees over 4 s, half a pixel of noise. The motion is followed where the settings say so.
TEST_F(CaseRuns, ASequenceOfABreathingTreeIsNeverLost) {
  const Twist breath =
      (Twist() << Eigen::Vector3d(8, 8, 4) * 1e-3, degToRad(2) * Eigen::Vector3d(0.6, 0, 0.8)).finished();
  const Pose start = nearby(truth_);
  constexpr int kFrames = 120;
  for (int i = 0; i < kFrames; ++i) {
    const Pose truth = test::perturbed(truth_, tree_, std::sin(2 * kPi * i / 60) * breath);
    const std::string name = "b" + std::to_string(i);
    writeView(name, truth, start);
    Centerline2d seen = projectedCenterline(tree_, camera_, truth);
    for (Eigen::Index k = 0; k < seen.points_px.size(); ++k) seen.points_px.data()[k] += 0.5 * random_.normal();
    writeCenterline(folder_.path("c" + name + ".csv"), seen);
  }
  settings_.tracker.follow_motion = true;
  const auto outcomes = runCases(readSet("sequence: true\n"), settings_);
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_TRUE(outcomes[i].followed.value()) << i << ": " << outcomes[i].rejection.value_or("");
    // Depth is what half a pixel leaves open: about 0.2 mm; five of these.
    EXPECT_LT(outcomes[i].error->mtre_m, 1e-3) << i;
    // A frame moves the tree by up to 1.3 mm; at rest it would start up to 12 mm off.
    if (i < 30) continue;
    EXPECT_LT(outcomes[i].start_error->mtre_m, 2e-3) << i;
  }
}

TEST_F(CaseRuns, AnImageMustBeOfItsCamerasSize) {
  writeView("a", truth_, truth_);
  writeImage(folder_.path("small.png"), cv::Mat(64, 64, CV_8UC1, cv::Scalar(128)));
  cases_ = "  - {name: \"a\", image: small.png, initial_pose: ia.yaml}\n";
  const CaseSet set = readSet();
  const std::string line = test::refusalOf([&] { runCases(set, settings_); });
  EXPECT_NE(line.find("small.png: size = 64 x 64"), std::string::npos) << line;
}

TEST_F(CaseRuns, ABlankImageIsAStatusWithATime) {
  writeView("a", truth_, truth_);
  writeImage(folder_.path("blank.png"), cv::Mat(camera_.height_px(), camera_.width_px(), CV_16UC1, cv::Scalar(30000)));
  cases_ = "  - {name: \"a\", image: blank.png, initial_pose: ia.yaml}\n";
  const auto outcomes = runCases(readSet(), settings_);
  EXPECT_EQ(outcomes[0].result.status, RegistrationStatus::kTooFewPoints);
  EXPECT_GT(outcomes[0].image_s, 0);
  EXPECT_FALSE(outcomes[0].error);
}

// The nominal pose of these frames leaves out where the table stood, 35 mm away. A line of another vessel is 13 px off.
// The curve of a catheter fits a dense tree in several places; four of them, one after the other, in one.
TEST(ClinicalCatheter, IsFoundFromANominalPoseAndPinnedByItsFrames) {
  CaseSet set = readCaseSet(exampleData("hepatic-tace/cases.yaml"));
  ASSERT_TRUE(set.sequence);
  set.cases.resize(7);
  const auto outcomes = runCases(set, {OrientedKernelSettings{}, {}, RidgeSettings{}});
  ASSERT_EQ(outcomes.size(), 7);
  double residual_px = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_FALSE(outcomes[k].followed.value());
    residual_px += outcomes[k].result.alignment.image_residual_px / 4;
  }
  EXPECT_LT(residual_px, 4.5);
  for (std::size_t k = 4; k < 7; ++k) {
    EXPECT_TRUE(outcomes[k].by_catheter);
    EXPECT_TRUE(outcomes[k].followed.value()) << *outcomes[k].rejection;
    EXPECT_LT(outcomes[k].result.alignment.image_residual_px, 2);
    EXPECT_EQ(outcomes[k].usable_for, (std::vector<std::string>{"centre", "navigate"})) << "depth is open";
  }
}

}  // namespace
}  // namespace angio::test
