// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/reading_search.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/servo/servo_loop.hpp"
#include "drawn_frames.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

// The image as a display sends it that has to be read so: what the reading does, undone.
cv::Mat sentFor(ImageReading reading, const cv::Mat& image) {
  cv::Mat sent;
  switch (reading) {
    case ImageReading::kAsSent:
      return image;
    case ImageReading::kMirrored:
      cv::flip(image, sent, 1);
      break;
    case ImageReading::kUpsideDown:
      cv::flip(image, sent, 0);
      break;
    case ImageReading::kTurnedHalf:
      cv::rotate(image, sent, cv::ROTATE_180);
      break;
    case ImageReading::kTurnedRight:
      cv::rotate(image, sent, cv::ROTATE_90_COUNTERCLOCKWISE);
      break;
    case ImageReading::kTurnedLeft:
      cv::rotate(image, sent, cv::ROTATE_90_CLOCKWISE);
      break;
    case ImageReading::kTransposed:
      cv::transpose(image, sent);
      break;
    case ImageReading::kAntiTransposed:
      cv::transpose(image, sent);
      cv::rotate(sent, sent, cv::ROTATE_180);
      break;
  }
  return sent;
}

std::string adviceOf(const std::string& reason) {
  const std::string begin = "the image matches when ";
  return reason.rfind(begin, 0) == 0 ? reason.substr(begin.size(), reason.find(':') - begin.size()) : "";
}

class WrongReading : public testing::TestWithParam<ImageReading> {};

TEST_P(WrongReading, IsNamedInTheHoldReason) {
  test::Stage stage;
  ServoLoop loop(stage.settings, stage.tree), other(stage.settings, stage.tree);
  std::string named;
  for (int k = 1; k <= 16; ++k) {
    XrayFrame frame = stage.frame(k);
    frame.image = sentFor(GetParam(), frame.image);
    const ServoReport report = loop.step(frame, stage.state(k));
    ASSERT_TRUE(report.hold_reason) << "a frame that is read wrongly must not move the arm";
    EXPECT_TRUE(report.command.velocity.isZero(0));
    EXPECT_EQ(other.step(frame, stage.state(k)).hold_reason, report.hold_reason) << "the same for the same frames";
    named = adviceOf(*report.hold_reason);
    EXPECT_TRUE(k > 11 || named.empty()) << "before the seven have been compared";
    loop.learn();
    other.learn();
  }
  EXPECT_EQ(named, nameOf(GetParam()));
  // As soon as frames come as they should, the loop goes on.
  const ServoReport right = loop.step(stage.frame(17), stage.state(17));
  EXPECT_FALSE(right.hold_reason) << *right.hold_reason;
}

INSTANTIATE_TEST_SUITE_P(All, WrongReading,
                         testing::Values(ImageReading::kMirrored, ImageReading::kUpsideDown, ImageReading::kTurnedHalf,
                                         ImageReading::kTurnedRight, ImageReading::kTurnedLeft,
                                         ImageReading::kTransposed, ImageReading::kAntiTransposed));

// The examples' liver as drawn lines, from beams in which a tree looks quite different.
TEST(ReadingSearch, NamesTheReadingOfALiverFromEverySide) {
  const VesselTree tree = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  CArmCalibration calibration = readCArmCalibration(exampleData("hepatic-tace/carm.yaml"));
  calibration.carm.image_width_px = calibration.carm.image_height_px = 512;
  calibration.carm.pixel_spacing_m *= 2;
  GatedPerceptionSettings settings;
  settings.carm = calibration.carm;
  settings.T_dsa_cb = calibration.T_dsa_cb;
  for (const ViewAngles& angles : {ViewAngles{0, 0}, ViewAngles{degToRad(35), degToRad(15)}}) {
    CArmState state;
    state.joints = calibration.carm.jointsFor(angles, calibration.T_dsa_cb * tree.centroid());
    const Pose T = calibration.carm.T_camera_patient(state.joints) * calibration.T_dsa_cb;
    const Eigen::Matrix3Xd points = T * tree.points();
    XrayFrame frame{0, 0, {}, calibration.carm.camera()};
    const cv::Mat image = drawnFrame(tree, points, frame.camera, 1, 512);
    for (const ImageReading reading : kImageReadings) {
      frame.image = sentFor(reading, image);
      GatedPerception perception(settings, tree);
      std::optional<std::string> why;
      for (int k = 0; k < 13; ++k) {
        why = perception.observe(frame, state).rejection;
        perception.learn();
      }
      EXPECT_EQ(why.has_value(), reading != ImageReading::kAsSent) << nameOf(reading) << why.value_or("");
      EXPECT_EQ(adviceOf(why.value_or("")), reading == ImageReading::kAsSent ? "" : nameOf(reading))
          << why.value_or("");
    }
  }
}

TEST(ReadingSearch, NamesNothingForAnotherPatient) {
  test::Stage stage;
  for (const unsigned seed : {21u, 22u, 23u, 24u}) {
    const VesselTree other = test::branchingTree(seed, stage.tree.centroid());
    ServoLoop loop(stage.settings, stage.tree);
    for (int k = 1; k <= 20; ++k) {
      const ServoReport report = loop.step(stage.frameOf(other, k), stage.state(k));
      ASSERT_TRUE(report.hold_reason);
      EXPECT_EQ(adviceOf(*report.hold_reason), "") << *report.hold_reason;
      loop.learn();
    }
  }
}

// Contrast agent that comes after the first search.
TEST(ReadingSearch, LooksAgainWhenTheVesselsComeLate) {
  test::Stage stage;
  const VesselTree nothing_like_it = test::branchingTree(21, stage.tree.centroid());
  ServoLoop loop(stage.settings, stage.tree);
  std::string named;
  for (int k = 1; k <= 50 && named.empty(); ++k) {
    XrayFrame frame = k <= 12 ? stage.frameOf(nothing_like_it, k) : stage.frame(k);
    frame.image = sentFor(ImageReading::kMirrored, frame.image);
    const ServoReport report = loop.step(frame, stage.state(k));
    ASSERT_TRUE(report.hold_reason);
    named = adviceOf(*report.hold_reason);
    loop.learn();
  }
  EXPECT_EQ(named, nameOf(ImageReading::kMirrored));
}

}  // namespace
}  // namespace angio::test
