// SPDX-License-Identifier: GPL-2.0-or-later
// What is done with frames before lines are sought in them: the collimator, and subtraction.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/imaging/collimator_opening.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/imaging/subtraction.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

using test::Scene;

Scene treeScene(unsigned noise_seed) {
  Scene scene;
  scene.vessels = {test::randomTree(2, 512, 512)};
  scene.seed = noise_seed;
  return scene;
}

// The frame with lead outside of a polygon; the focal spot blurs its edge.
cv::Mat collimated(const cv::Mat& image, const std::vector<cv::Point>& field, double shadow) {
  cv::Mat open(image.size(), CV_32FC1, cv::Scalar(shadow)), result;
  cv::fillConvexPoly(open, field, cv::Scalar(1), cv::LINE_AA);
  cv::GaussianBlur(open, open, cv::Size(), 1.5);
  image.convertTo(result, CV_32F);
  result = result.mul(open);
  result.convertTo(result, CV_16U);
  return result;
}

std::vector<cv::Point> octagon() {
  return {{90, 40}, {420, 40}, {470, 90}, {470, 420}, {420, 470}, {90, 470}, {40, 420}, {40, 90}};
}

std::vector<cv::Point> circle() {
  std::vector<cv::Point> corners;
  for (int k = 0; k < 72; ++k)
    corners.emplace_back(256 + 230 * std::cos(k * M_PI / 36), 256 + 230 * std::sin(k * M_PI / 36));
  return corners;
}

TEST(OpenField, IsFoundForThreeShapes) {
  const std::vector<cv::Point> rectangle{{60, 80}, {450, 80}, {450, 430}, {60, 430}};
  for (const auto& shape : {rectangle, octagon(), circle()}) {
    for (const double shadow : {0.03, 2.6}) {
      const cv::Mat image = collimated(0.4 * test::render(treeScene(3)), shape, shadow);
      const OpenField field = findOpenField(image);
      ASSERT_GE(field.polygon_px.size(), 3u) << shape.size() << " " << shadow;
      cv::Mat truth(image.size(), CV_8UC1, cv::Scalar(0)), both, either;
      cv::fillConvexPoly(truth, shape, cv::Scalar(255));
      cv::bitwise_and(truth, field.mask, both);
      cv::bitwise_or(truth, field.mask, either);
      // A pixel and a half all around is two per cent of the area.
      EXPECT_GT(cv::countNonZero(both), 0.975 * cv::countNonZero(either)) << shape.size() << " " << shadow;
    }
  }
}

TEST(OpenField, AnatomyIsNoCollimator) {
  const cv::Mat image = test::render(treeScene(1));
  EXPECT_TRUE(findOpenField(image).polygon_px.empty());
  EXPECT_EQ(cv::countNonZero(findOpenField(image).mask), 512 * 512);
  // A dark heart at the image's edge is not straight.
  cv::Mat dark(image.size(), CV_32FC1, cv::Scalar(1)), result;
  cv::circle(dark, {120, 400}, 200, cv::Scalar(0.4), cv::FILLED, cv::LINE_AA);
  image.convertTo(result, CV_32F);
  cv::Mat heart = result.mul(dark);
  heart.convertTo(heart, CV_16U);
  EXPECT_TRUE(findOpenField(heart).polygon_px.empty());
  EXPECT_TRUE(findOpenField(cv::Mat(5, 5, CV_8UC1, cv::Scalar(3))).polygon_px.empty());
  EXPECT_THROW(findOpenField(cv::Mat()), InputError);
}

TEST(OpenField, LinesEndAtIt) {
  const cv::Mat image = test::render(treeScene(3));
  const Centerline2d found = makeExtractor(RidgeSettings{})->extract(collimated(image, octagon(), 0.03));
  ASSERT_GT(found.size(), 100);
  for (int i = 0; i < found.size(); ++i) {
    const cv::Point2f p(static_cast<float>(found.points_px(0, i)), static_cast<float>(found.points_px(1, i)));
    EXPECT_GT(cv::pointPolygonTest(octagon(), p, true), 0) << p;
  }
  Scene seen = treeScene(3);
  EXPECT_GT(test::precision(seen, found, 3), 0.95);
}

// Ribs are in both frames, the tree in one; the patient has breathed in between.
TEST(Subtraction, TakesTheRibsAwayThoughThePatientMoved) {
  Scene with = treeScene(1), without = treeScene(7);
  const test::Vessel ribs{test::arcTube({256, -300}, 560, 0.9, 2.2, 7), test::arcTube({256, -200}, 560, 0.9, 2.2, 7),
                          test::arcTube({256, -100}, 560, 0.9, 2.2, 7)};
  without.vessels = {ribs};
  with.vessels.push_back(ribs);
  with.background = without.background = 0;
  with.noise = without.noise = 0.005;  // Both frames' noise is in the difference.
  const Eigen::Vector2d shift(2.6, -4.3);
  cv::Mat mask;
  cv::warpAffine(test::render(without), mask, cv::Matx23d(1, 0, -shift.x(), 0, 1, -shift.y()), {512, 512},
                 cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  const cv::Mat live = test::render(with);
  EXPECT_LT((maskShift(live, mask, 16) - shift).norm(), 0.3);
  const Scene truth = treeScene(1);
  const auto extractor = makeExtractor(RidgeSettings{});
  const Centerline2d found = extractor->extract(subtracted(live, mask));
  EXPECT_GT(test::coverage(truth, found, 3), 0.9);
  EXPECT_GT(test::precision(truth, found, 3), 0.95);
  // Without subtraction, and without the shift, ribs are lines.
  EXPECT_LT(test::precision(truth, extractor->extract(live), 3), 0.8);
  SubtractionSettings still;
  still.max_shift_px = 0;
  EXPECT_LT(test::precision(truth, extractor->extract(subtracted(live, mask, still)), 3),
            test::precision(truth, found, 3));
}

TEST(Subtraction, KeepsTheLevelAndRefusesWhatDoesNotFit) {
  const cv::Mat mask(64, 64, CV_8UC1, cv::Scalar(200)), live(64, 64, CV_8UC1, cv::Scalar(100));
  EXPECT_NEAR(subtracted(mask, mask).at<std::uint16_t>(9, 9), kSubtractedLevel, 1);
  // Half of the beam: half of the level, but for the dark level of both.
  EXPECT_NEAR(subtracted(live, mask).at<std::uint16_t>(9, 9), 0.505 * kSubtractedLevel, 0.005 * kSubtractedLevel);
  EXPECT_THROW(subtracted(live, cv::Mat(64, 65, CV_8UC1, cv::Scalar(1))), InputError);
  EXPECT_THROW(subtracted(live, cv::Mat(64, 64, CV_16UC1, cv::Scalar(1))), InputError);
  EXPECT_THROW(subtracted(cv::Mat(), mask), InputError);
  SubtractionSettings settings;
  settings.max_shift_px = -1;
  EXPECT_THROW(subtracted(live, mask, settings), InputError);
}

}  // namespace
}  // namespace angio::test
