// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/visp.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"

namespace angio::test {
namespace {

TEST(VispImage, GoesThereAndBack) {
  // A view into a wider image: its rows do not follow each other in memory.
  cv::Mat wide(20, 50, CV_8UC1);
  cv::randu(wide, 0, 256);
  const cv::Mat image = wide(cv::Rect(7, 3, 30, 12));
  const vpImage<unsigned char> visp = toVisp(image);
  ASSERT_EQ(visp.getHeight(), 12u);
  ASSERT_EQ(visp.getWidth(), 30u);
  EXPECT_EQ(visp[5][11], image.at<unsigned char>(5, 11));
  EXPECT_EQ(cv::norm(fromVisp(visp), image, cv::NORM_INF), 0);
}

TEST(VispImage, SpreadsSixteenBitsOverEight) {
  const cv::Mat image = (cv::Mat_<std::uint16_t>(1, 3) << 1000, 2000, 3000);
  const vpImage<unsigned char> visp = toVisp(image);
  EXPECT_EQ(visp[0][0], 0);
  EXPECT_NEAR(visp[0][1], 127.5, 0.5);
  EXPECT_EQ(visp[0][2], 255);
  EXPECT_EQ(toVisp(cv::Mat(2, 2, CV_16UC1, cv::Scalar(700)))[1][1], 0);
}

TEST(VispImage, RefusesWhatItCannotShow) {
  EXPECT_THROW(toVisp(cv::Mat(2, 2, CV_32FC1, cv::Scalar(0))), InputError);
  EXPECT_THROW(toVisp(cv::Mat()), InputError);
  EXPECT_THROW(fromVisp(vpImage<unsigned char>()), InputError);
}

}  // namespace
}  // namespace angio::test
