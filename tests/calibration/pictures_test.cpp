// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "angio/calibration/geometry_pictures.hpp"
#include "angio/calibration/pose_pictures.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

// Pixels of about this colour, BGR; the pictures' ground is white.
int pixelsOf(const cv::Mat& picture, const cv::Scalar& color) {
  cv::Mat near;
  const cv::Scalar reach = cv::Scalar::all(20);
  cv::inRange(picture, color - reach, color + reach, near);
  return cv::countNonZero(near);
}

const cv::Scalar kRed(40, 40, 214), kBlue(178, 114, 0);

GeometryCalibration oneView(double residual, bool left_out) {
  GeometryCalibration result;
  result.record.residual_unit = "px";
  GeometryViewFit view;
  view.name = "v1";
  view.joints << 0.3, 0.2, 0, 0, 0;
  view.residual = residual;
  view.left_out = left_out;
  result.views = {view, view};
  result.views[1].left_out = false;
  result.views[1].residual = 0.5;
  return result;
}

TEST(CalibrationPictures, AViewThatIsLeftOutIsSeen) {
  const int usual = pixelsOf(residualsByAngle(oneView(0.5, false)), kRed);
  EXPECT_GT(pixelsOf(residualsByAngle(oneView(50, true)), kRed), usual + 100);
}

TEST(CalibrationPictures, TurnsAboutOneAxisAreOneSpot) {
  PoseSet single, spread;
  for (int i = 0; i < 8; ++i) {
    HandEyePose pose;
    pose.T_base_hand.linear() = expSO3(Eigen::Vector3d(0, 0, 0.1 * i));
    single.poses.push_back(pose);
    pose.T_base_hand.linear() = expSO3(Eigen::Vector3d(0.3 * (i % 3), 0.2 * (i % 2), 0.1 * i));
    spread.poses.push_back(pose);
  }
  const int one = pixelsOf(turnAxes(single), kBlue), many = pixelsOf(turnAxes(spread), kBlue);
  EXPECT_GT(one, 20);
  EXPECT_GT(many, 4 * one);
}

TEST(CalibrationPictures, AnIdealArmsAxesMeetInTheMiddle) {
  GeometryCalibration ideal, gap;
  gap.carm.deviations.axis_gap_m = 4e-3;
  const cv::Mat meets = axesSketch(ideal), misses = axesSketch(gap);
  ASSERT_EQ(meets.size(), misses.size());
  // The secondary axis, horizontal from the front, stands above or below the other with the gap.
  const auto rowOfGreen = [](const cv::Mat& picture) {
    cv::Mat near;
    const cv::Scalar green(115, 158, 0), reach = cv::Scalar::all(20);
    // Right half of the left picture, away from texts and other lines.
    cv::inRange(picture(cv::Rect(400, 140, 100, 320)), green - reach, green + reach, near);
    const cv::Moments m = cv::moments(near, true);
    return m.m00 > 0 ? m.m01 / m.m00 : -1;
  };
  EXPECT_GT(rowOfGreen(meets), 0);
  EXPECT_GT(std::abs(rowOfGreen(meets) - rowOfGreen(misses)), 40);
}

}  // namespace
}  // namespace angio::test
