// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>

#include "angio/evaluation/overlay.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The middle of an antialiased line keeps nine tenths of its colour.
bool isOf(const cv::Vec3b& pixel, const cv::Scalar& color) {
  return cv::norm(cv::Vec3d(pixel) - cv::Vec3d(color[0], color[1], color[2])) < 30;
}

// 100 pixels a millimetre in the plane z = 1 m: two points on the image's column 300.
class Overlays : public testing::Test {
 protected:
  VesselTree upright_{(Eigen::Matrix3Xd(3, 2) << 0.001, 0.001, -0.001, 0.001, 1, 1).finished(), {-1, 0}};
  XrayCamera camera_{{400, 420, 1e5, 1e5, 200, 210, {}, {}}};

  OverlayTree shownAt(const Eigen::Vector3d& shift) const {
    return {Pose(Eigen::Translation3d(shift)), {}, kModelColor, "tree"};
  }
  cv::Mat draw(const OverlayTree& what, const cv::Mat& image = {}) const {
    OverlayScene scene;
    scene.image = image;
    scene.trees = {what};
    return drawOverlay(scene, upright_, camera_);
  }
};

TEST_F(Overlays, TheTreeIsDrawnInItsColorWhereItProjects) {
  const cv::Mat canvas = draw(shownAt({0, 0, 0}));
  ASSERT_EQ(canvas.type(), CV_8UC3);
  ASSERT_EQ(canvas.size(), cv::Size(400, 420));
  for (const int row : {120, 210, 300}) {
    EXPECT_TRUE(isOf(canvas.at<cv::Vec3b>(row, 300), kModelColor)) << row;
    EXPECT_FALSE(isOf(canvas.at<cv::Vec3b>(row, 295), kModelColor)) << row;
  }
  EXPECT_FALSE(isOf(canvas.at<cv::Vec3b>(340, 300), kModelColor)) << "beyond the tree's end";
}

TEST_F(Overlays, PoseAndDisplacementsMoveTheTree) {
  EXPECT_TRUE(isOf(draw(shownAt({-0.0005, 0, 0})).at<cv::Vec3b>(210, 250), kModelColor));
  OverlayTree displaced = shownAt({0, 0, 0});
  displaced.displacements_m = Eigen::Vector3d(0.0005, 0, 0).replicate(1, 2);
  EXPECT_TRUE(isOf(draw(displaced).at<cv::Vec3b>(210, 350), kModelColor));
}

TEST_F(Overlays, TheImageIsTheGround) {
  cv::Mat large(500, 500, CV_16UC1, cv::Scalar(1000));
  large(cv::Rect(50, 40, 200, 420)).setTo(60000);
  const cv::Mat canvas = draw(shownAt({0, 0, 0}), large(cv::Rect(50, 40, 400, 420)));  // A window: its rows are apart.
  ASSERT_EQ(canvas.size(), cv::Size(400, 420));
  EXPECT_EQ(canvas.at<cv::Vec3b>(380, 100), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(canvas.at<cv::Vec3b>(380, 380), cv::Vec3b(0, 0, 0));
}

TEST_F(Overlays, PosesThatMeanNothingLeaveTheGround) {
  for (const Eigen::Vector3d& nowhere :
       {Eigen::Vector3d(0, 0, -2), Eigen::Vector3d(kNan, kNan, kNan), Eigen::Vector3d(1e6, 1e6, 0)}) {
    OverlayTree what = shownAt(nowhere);
    what.label.clear();
    const cv::Mat canvas = draw(what);
    EXPECT_EQ(
        cv::countNonZero(canvas.reshape(1) != draw({Pose::Identity(), {}, cv::Scalar(24, 20, 18), ""}).reshape(1)), 0)
        << nowhere.transpose();
  }
}

// Pixels of a colour between the axes, where no legend stands.
int pixelsOf(const cv::Mat& plot, const cv::Scalar& color) {
  const cv::Mat inside = plot.colRange(80, plot.cols - 120);
  cv::Mat same;
  cv::inRange(inside, color, color, same);
  return cv::countNonZero(same);
}

Plot plotOf(std::vector<double> x, std::vector<double> y, bool log = false) {
  return {"title", {"x"}, {"y", log}, {{"series", std::move(x), std::move(y), 0}}};
}

TEST(Plots, StandBelowEachOther) {
  const cv::Mat plot = drawPlots({plotOf({0, 1, 2}, {1, 2, 1}), plotOf({0, 1, 2}, {1e-3, 10, 1}, true)}, 700, 200);
  ASSERT_EQ(plot.type(), CV_8UC3);
  ASSERT_EQ(plot.size(), cv::Size(700, 400));
  // A line across 500 pixels, two wide.
  EXPECT_GT(pixelsOf(plot.rowRange(0, 200), plotColor(0)), 400);
  EXPECT_GT(pixelsOf(plot.rowRange(200, 400), plotColor(0)), 400);
}

TEST(Plots, WhatIsNotANumberLeavesAGap) {
  const int whole = pixelsOf(drawPlots({plotOf({0, 1, 2, 3, 4}, {1, 1, 1, 1, 1})}), plotColor(0));
  const int gap = pixelsOf(drawPlots({plotOf({0, 1, 2, 3, 4}, {1, 1, kNan, 1, 1})}), plotColor(0));
  EXPECT_NEAR(gap, whole / 2, whole / 10);
}

TEST(Plots, SurviveSeriesWithNothingToShow) {
  const cv::Size size(900, 260);
  for (const bool log : {false, true}) {
    for (const auto& y : std::vector<std::vector<double>>{
             {}, {3}, {0}, {kNan}, {-1, -1}, {kInfinity, kNan}, {5e-324, 1}, {1e-300, 1e300}, {1e12, 1e12}}) {
      std::vector<double> x(y.size());
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<double>(i);
      EXPECT_EQ(drawPlots({plotOf(x, y, log)}).size(), size);
    }
    EXPECT_EQ(drawPlots({{"", {}, {"", log}}}).size(), size);
    EXPECT_EQ(drawPlots({plotOf({0, 1, 2}, {1}, log)}).size(), size) << "lists of different length";
  }
  EXPECT_TRUE(drawPlots({}).empty());
}

}  // namespace
}  // namespace angio::test
