// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate camera on rendered pictures of a cube of equal beads: several of one camera, and mirrored ones.
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/test/program.hpp"
#include "angio/test/temporary_folder.hpp"
#include "cube_scenes.hpp"

namespace angio::test {
namespace {

class CalibratePictures : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream beads(folder_.path("beads.csv"));
    beads << "x_mm,y_mm,z_mm\n";
    for (const Bead& bead : cubePhantom().beads) {
      beads << (1e3 * bead.position_m).transpose().format(Eigen::IOFormat(9, 0, ",", ",")) << "\n";
    }
    poses_ = {cubeView(), cubeView()};
    poses_[1].linear() = expSO3({0, degToRad(-40), 0}) * cubeView().linear();
    poses_[1].translation() = Eigen::Vector3d(-0.01, 0.01, 0.95) - poses_[1].linear() * cubePhantom().center_m();
  }

  // The pictures, as a detector shows them that may be read from its other side, with the poses known to some degrees.
  std::vector<std::string> arguments(bool from_behind) {
    Random random(11);
    BeadPhantom balls = cubePhantom();
    for (Bead& bead : balls.beads) bead.radius_m = 1.5e-3;
    std::vector<std::string> given = {"camera"};
    for (std::size_t v = 0; v < 2; ++v) {
      cv::Mat picture = beadImage(balls, cubeCamera(), poses_[v], {}, random);
      if (from_behind) cv::flip(picture, picture, 1);
      given.push_back(folder_.path("cube-" + std::to_string(v) + ".png"));
      cv::imwrite(given.back(), picture);
    }
    for (std::size_t v = 0; v < 2; ++v) {
      Pose rough = poses_[v];
      rough.linear() = expSO3({0.03, -0.02, 0.03}) * rough.linear();
      const std::string near = folder_.path("near-" + std::to_string(v) + ".yaml");
      writePose(near, {rough, {}});
      given.insert(given.end(), {"--near", near, "--out-pose", folder_.path("pose-" + std::to_string(v) + ".yaml")});
    }
    given.insert(given.end(), {"--phantom", folder_.path("beads.csv"), "--out", folder_.path("camera.yaml")});
    return given;
  }

  void expectTruth() const {
    const XrayCamera::Parameters p = readCamera(folder_.path("camera.yaml")).parameters();
    // Two views of some 30 beads each, whose centres are found to some hundredths of a pixel.
    EXPECT_NEAR(p.fx_px, 4450, 6);
    EXPECT_NEAR(p.fy_px, 4450, 6);
    EXPECT_NEAR(p.cx_px, 480, 6);
    EXPECT_NEAR(p.cy_px, 560, 6);
    for (std::size_t v = 0; v < 2; ++v) {
      const Pose T = readPose(folder_.path("pose-" + std::to_string(v) + ".yaml")).T_camera_model;
      EXPECT_LT((T.inverse().translation() - poses_[v].inverse().translation()).norm(), 1.5e-3);
      EXPECT_LT(radToDeg(rotationAngle(T.linear() * poses_[v].linear().transpose())), 0.1);
    }
  }

  TemporaryFolder folder_;
  std::vector<Pose> poses_;
};

TEST_F(CalibratePictures, SeveralViewsGiveOneCamera) {
  const auto ended = run("angio-calibrate", arguments(false));
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  expectTruth();
  // A cube of one piece is found to be one.
  EXPECT_NE(ended.out.find("| none | "), std::string::npos) << ended.out;
  EXPECT_EQ(ended.out.find("plate_0_x_mm"), std::string::npos) << ended.out;
}

// The pose that is roughly known is of the picture that is flipped back; without --mirrored no reading is near to it.
TEST_F(CalibratePictures, MirroredPicturesAreFlippedFirst) {
  std::vector<std::string> given = arguments(true);
  const auto refused = run("angio-calibrate", given);
  EXPECT_EQ(refused.exit_code, 1) << refused.out;
  EXPECT_NE(refused.err.find("cube-0.png"), std::string::npos) << refused.err;
  given.push_back("--mirrored");
  const auto ended = run("angio-calibrate", given);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  expectTruth();
}

}  // namespace
}  // namespace angio::test
