// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/pose_set.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/calibration/hand_eye_simulation.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

constexpr const char* kHand = "{rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation_mm: [10, 20, 30]}";
constexpr const char* kSeen = "{rotation: [0, -1, 0, 1, 0, 0, 0, 0, 1], translation_mm: [1, 2, 800]}";

class PoseSetFiles : public testing::Test {
 protected:
  PoseSet read(const std::string& content, const CArmGeometry* carm = nullptr) {
    return readPoseSet(folder_.write("poses.yaml", content), carm);
  }
  // A file with one pose that says this.
  std::string with(const std::string& pose, const std::string& head = "setup: eye_in_hand\n") {
    return head + "poses:\n  - name: a\n" + pose;
  }
  void expectRefusal(const std::string& content, const std::string& words) {
    const std::string said = test::refusalOf([&] { read(content); });
    EXPECT_NE(said.find("poses.yaml"), std::string::npos) << said;
    EXPECT_NE(said.find(words), std::string::npos) << said;
  }
  static std::string poses(const std::string& hand, const std::string& seen) {
    return "    T_base_hand: " + hand + "\n    T_camera_object: " + seen + "\n";
  }

  test::TemporaryFolder folder_;
};

TEST_F(PoseSetFiles, NumbersComeOutInMetresAndRadians) {
  const PoseSet set =
      read(with(poses(kHand, kSeen),
                "setup: eye_to_hand\nmachine: lab-1\ncamera_sigma: {rotation_deg: 0.1, translation_mm: 0.3}\n"));
  EXPECT_EQ(set.setup, HandEyeSetup::kEyeToHand);
  EXPECT_EQ(set.machine, "lab-1");
  EXPECT_NEAR(set.camera_std->rotation_rad, degToRad(0.1), 1e-15);
  EXPECT_NEAR(set.camera_std->translation_m, 0.3e-3, 1e-15);
  ASSERT_EQ(set.poses.size(), 1u);
  EXPECT_TRUE(set.poses[0].T_base_hand.translation().isApprox(Eigen::Vector3d(0.01, 0.02, 0.03)));
  // Rows of the file are rows of the matrix.
  EXPECT_TRUE((set.poses[0].T_camera_object * Eigen::Vector3d(0.1, 0, 0)).isApprox(Eigen::Vector3d(0.001, 0.102, 0.8)));
}

TEST_F(PoseSetFiles, AnglesBecomeTheCArmsCamera) {
  const CArmGeometry carm;
  const std::string content =
      with("    primary_deg: 30\n    secondary_deg: -10\n    table_mm: [1, 2, 3]\n    T_camera_object: " +
           std::string(kSeen) + "\n");
  const PoseSet set = read(content, &carm);
  CArmJoints joints;
  joints << degToRad(30), degToRad(-10), 0.001, 0.002, 0.003;
  EXPECT_TRUE(set.poses[0].T_base_hand.isApprox(carm.T_camera_patient(joints).inverse(), 1e-12));
  expectRefusal(content, "needs the C-arm's geometry (--carm)");
}

TEST_F(PoseSetFiles, HostileFilesAreNamed) {
  expectRefusal("", "setup: is missing");
  expectRefusal("setup: hand_in_eye\nposes: []\n", "must be eye_in_hand or eye_to_hand");
  expectRefusal("setup: eye_in_hand\nposes: []\n", "at least one pose");
  expectRefusal("setup: eye_in_hand\nposes: 3\n", "must be a list");
  expectRefusal(with(poses(kHand, kSeen) + "    T_camera_objekt: 3\n"), "T_camera_objekt");
  expectRefusal(with("    T_base_hand: " + std::string(kHand) + "\n"), "T_camera_object: is missing");
  expectRefusal(with(poses(kHand, kSeen)) + "  - name: a\n" + poses(kSeen, kHand), "must be given once");
  expectRefusal(with(poses("{rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1], translation_mm: [1, 2, 3]}", kSeen)),
                "this one mirrors");
  expectRefusal(with(poses("{rotation: [1, 0, 0, 0, 1, 0, 0, 0, 2], translation_mm: [1, 2, 3]}", kSeen)),
                "must be a rotation");
  expectRefusal(with(poses("{translation_mm: [1, 2, 3]}", kSeen)), "T_base_hand.rotation: is missing");
  expectRefusal(with(poses("{rotation: [1, 0, 0, 0, 1, 0, 0, 0, .nan], translation_mm: [1, 2, 3]}", kSeen)),
                "rotation");
  expectRefusal(with(poses("{rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation_mm: [1, 2, 1e9]}", kSeen)),
                "translation_mm");
  expectRefusal(with(poses(kHand, "{rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation_mm: [0, 0, 0.8]}")),
                "is the file in millimetres?");
  expectRefusal(with("    T_base_hand: " + std::string(kHand) + "\n    points: p.csv\n"), "needs the set's camera");
  expectRefusal(with(poses(kHand, kSeen), "setup: eye_in_hand\nhand_sigma: {rotation_deg: -1, translation_mm: 0}\n"),
                "rotation_deg = -1");
}

TEST_F(PoseSetFiles, WhatIsWrittenIsReadBack) {
  SimulatedPoseSet simulated = simulatedOrbit(CArmGeometry(), OrbitSettings(), 1);
  simulated.set.poses[0].joints = std::nullopt;
  simulated.set.poses[0].covariance = Vector6d(1e-8 * Vector6d::LinSpaced(1, 6)).asDiagonal();
  writePoseSet(folder_.path("poses.yaml"), simulated.set);
  const CArmGeometry carm;
  const PoseSet back = readPoseSet(folder_.path("poses.yaml"), &carm);
  ASSERT_EQ(back.poses.size(), simulated.set.poses.size());
  for (std::size_t i = 0; i < back.poses.size(); ++i) {
    EXPECT_TRUE(back.poses[i].T_base_hand.isApprox(simulated.set.poses[i].T_base_hand, 1e-12));
    EXPECT_TRUE(back.poses[i].T_camera_object.isApprox(simulated.set.poses[i].T_camera_object, 1e-12));
  }
  EXPECT_TRUE(back.poses[0].covariance->isApprox(*simulated.set.poses[0].covariance));
}

TEST_F(PoseSetFiles, MoveItSamplesThatAreNoneAreNamed) {
  for (const char* content : {"", "{}", "[]", "[1]", "[[1, 2]]", "[[[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]],[]]]"}) {
    const std::string path = folder_.write("samples.json", content);
    EXPECT_NE(test::refusalOf([&] { readMoveItSamples(path, HandEyeSetup::kEyeToHand); }).find("samples.json"),
              std::string::npos);
  }
}

// A board of 9 x 6 points and where a camera sees it.
struct SeenBoard {
  XrayCamera camera = XrayCamera::centered(640, 480, 1e-5, 6e-3);
  Eigen::Matrix3Xd object{3, 54};
  Eigen::Matrix2Xd pixels{2, 54};
  Pose truth;

  explicit SeenBoard(test::Random& random, double noise_px) {
    truth = expSE3((Twist() << -0.1, -0.05, 0.6, random.vector(0.3)).finished());
    for (int i = 0; i < 54; ++i) {
      object.col(i) << 0.0236 * (i % 9), 0.0236 * (i / 9), 0;
      const double u = noise_px * random.normal(), v = noise_px * random.normal();
      pixels.col(i) = *camera.project(truth * object.col(i)) + Eigen::Vector2d(u, v);
    }
  }
};

TEST(PoseOfPoints, CovarianceIsRight) {
  test::Random random(3);
  const int trials = 200;
  double nees = 0;
  for (int i = 0; i < trials; ++i) {
    const SeenBoard seen(random, 0.2);
    const PoseOfPoints found = poseOfPoints("board", seen.camera, seen.object, seen.pixels);
    Vector6d error;
    error << seen.truth.translation() - found.T_camera_object.translation(),
        logSO3(seen.truth.linear() * found.T_camera_object.linear().transpose());
    nees += squaredMahalanobis(error, found.covariance) / trials;
  }
  // The noise is measured from 102 numbers, which widens the mean by 2 %; 3.3 standard deviations.
  EXPECT_NEAR(nees, 6 * 102.0 / 100, 3.3 * std::sqrt(12.0 / trials));
}

TEST(PoseOfPoints, RefusesWhatNoPoseExplains) {
  test::Random random(4);
  SeenBoard seen(random, 0.1);
  seen.pixels.row(0) =
      (640 - seen.pixels.row(0).array()).matrix().eval();  // Mirrored: a planar board hides it, but for
  seen.pixels.col(0).swap(seen.pixels.col(53));            // points that are out of order.
  EXPECT_NE(test::refusalOf([&] {
              poseOfPoints("a.csv", seen.camera, seen.object, seen.pixels);
            }).find("no pose of the object"),
            std::string::npos);
  Eigen::Matrix3Xd line = seen.object;
  line.row(1).setZero();
  EXPECT_NE(
      test::refusalOf([&] { poseOfPoints("a.csv", seen.camera, line, seen.pixels); }).find("must not lie in a line"),
      std::string::npos);
  EXPECT_NE(test::refusalOf([&] {
              poseOfPoints("a.csv", seen.camera, seen.object.leftCols(3), seen.pixels.leftCols(3));
            }).find("at least 4"),
            std::string::npos);
}

}  // namespace
}  // namespace angio::test
