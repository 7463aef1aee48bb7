// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/image_reading.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// Each reading does to points what OpenCV does to an image.
TEST(ImageReading, IsWhatTurningTheImageGives) {
  const XrayCamera camera = XrayCamera::centered(9, 9, 1e-3, 1);
  const auto turned = [](ImageReading reading, const cv::Mat& image) {
    cv::Mat out;
    switch (reading) {
      case ImageReading::kAsSent:
        return image.clone();
      case ImageReading::kMirrored:
        cv::flip(image, out, 1);
        return out;
      case ImageReading::kUpsideDown:
        cv::flip(image, out, 0);
        return out;
      case ImageReading::kTurnedHalf:
        cv::rotate(image, out, cv::ROTATE_180);
        return out;
      case ImageReading::kTurnedRight:
        cv::rotate(image, out, cv::ROTATE_90_CLOCKWISE);
        return out;
      case ImageReading::kTurnedLeft:
        cv::rotate(image, out, cv::ROTATE_90_COUNTERCLOCKWISE);
        return out;
      case ImageReading::kTransposed:
        cv::transpose(image, out);
        return out;
      case ImageReading::kAntiTransposed:
        cv::rotate(image, out, cv::ROTATE_180);
        cv::transpose(out, out);
        return out;
    }
    return out;
  };
  Centerline2d line;
  line.points_px.resize(2, 2);
  line.points_px << 1, 3, 2, 7;  // (1, 2) and (3, 7).
  line.tangent_rad = Eigen::VectorXd::Constant(2, std::atan2(5, 2));
  for (const ImageReading reading : kImageReadings) {
    const Centerline2d read = readAs(reading, line, camera);
    for (int i = 0; i < 2; ++i) {
      cv::Mat image(9, 9, CV_8U, cv::Scalar(0));
      image.at<uchar>(int(line.points_px(1, i)), int(line.points_px(0, i))) = 255;
      const cv::Mat there = turned(reading, image);
      EXPECT_EQ(there.at<uchar>(int(std::lround(read.points_px(1, i))), int(std::lround(read.points_px(0, i)))), 255)
          << nameOf(reading);
    }
    const Eigen::Vector2d along = read.points_px.col(1) - read.points_px.col(0);
    EXPECT_NEAR(std::sin(read.tangent_rad[0] - std::atan2(along.y(), along.x())), 0, 1e-12) << nameOf(reading);
  }
}

}  // namespace
}  // namespace angio::test
