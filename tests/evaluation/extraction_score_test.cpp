// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/geometry/se3.hpp"

namespace angio::test {
namespace {

// A straight branch from one point to another, a point every `step_px`.
Eigen::Matrix2Xd straight(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double step_px) {
  const int pieces = static_cast<int>(std::lround((to - from).norm() / step_px));
  Eigen::Matrix2Xd points(2, pieces + 1);
  for (int i = 0; i <= pieces; ++i) points.col(i) = from + (to - from) * i / pieces;
  return points;
}

Centerline2d curve(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double step_px = 2) {
  Eigen::Matrix2Xd points = straight(from, to, step_px);
  std::vector<int> branch(static_cast<std::size_t>(points.cols()), 0);
  return makeCenterline(std::move(points), std::move(branch));
}

TEST(ExtractionScore, CountsLengthNotPoints) {
  // The truth is 100 px long. Found are its first 60 px, half a pixel off, and 20 px that are nowhere near; densely.
  const Centerline2d truth = curve({100, 100}, {200, 100}, 10);
  Eigen::Matrix2Xd points(2, 0);
  std::vector<int> branch;
  int number = 0;
  for (const auto& piece : {straight({100, 100.5}, {160, 100.5}, 0.5), straight({100, 300}, {120, 300}, 5)}) {
    Eigen::Matrix2Xd all(2, points.cols() + piece.cols());
    all << points, piece;
    points = all;
    branch.insert(branch.end(), static_cast<std::size_t>(piece.cols()), number++);
  }
  ExtractionScore score(1.5);
  score.add(makeCenterline(points, branch), truth);
  EXPECT_NEAR(score.asJson()["covered"], 0.61, 0.02);  // The tolerance reaches a pixel further.
  EXPECT_NEAR(score.asJson()["median_error_px"], 0.5, 1e-9);
  EXPECT_NEAR(score.asJson()["median_tangent_error_deg"], 0, 1e-9);
  EXPECT_FALSE(score.asJson().contains("error_over_sigma"));

  // Points twice as dense as a pixel stay as they are: 121 right ones, 21 wrong.
  EXPECT_NEAR(score.asJson()["correct"], 121.0 / 142, 1e-9);
}

TEST(ExtractionScore, KnowsTurnedLinesAndClaimedUncertainty) {
  const Centerline2d truth = curve({0, 50}, {200, 50});
  Centerline2d found = curve({20, 50.4}, {180, 50.4});
  found.tangent_rad.array() += degToRad(7);
  found.std_px = Eigen::VectorXd::Constant(found.size(), 0.2);
  ExtractionScore score(1.5);
  score.add(found, truth);
  EXPECT_NEAR(score.asJson()["error_over_sigma"], 2, 1e-6);
  EXPECT_NEAR(score.asJson()["median_tangent_error_deg"], 7, 1e-9);
  EXPECT_EQ(score.asJson()["correct"], 1);
}

TEST(ExtractionScore, WhatMayBeFoundIsNotWhatMust) {
  const Centerline2d shown = curve({0, 50}, {100, 50}), all = curve({0, 50}, {200, 50});
  ExtractionScore score(1.5);
  score.add(all, shown, all);
  EXPECT_EQ(score.asJson()["covered"], 1);
  EXPECT_EQ(score.asJson()["correct"], 1);
  ExtractionScore strict(1.5);
  strict.add(all, shown);
  EXPECT_NEAR(strict.asJson()["correct"], 0.51, 0.01);
}

// Two vessels run as one line for 50 px, then part. An extractor that finds one line there, and both beyond, has all
// that is to be had; the plain figures count the second vessel as missed.
TEST(ExtractionScore, CountsWhatHasALineOfItsOwnApartAndHidesNothing) {
  Eigen::Matrix2Xd points(2, 202);
  std::vector<int> branch(202, 0);
  std::vector<bool> own(202, true);
  for (int i = 0; i <= 100; ++i) {
    points.col(i) << i, 50;
    points.col(101 + i) << i, i < 50 ? 53 : 60;
    branch[static_cast<std::size_t>(101 + i)] = 1;
    own[static_cast<std::size_t>(101 + i)] = i >= 50;
  }
  const Centerline2d truth = makeCenterline(points, branch, Eigen::VectorXd::Constant(202, 3));
  std::vector<bool> seen(202, true);
  for (int i = 0; i < 50; ++i) seen[static_cast<std::size_t>(101 + i)] = false;
  ExtractionScore score(1.5);
  score.add(pointsWhere(truth, seen), truth, truth, own);
  EXPECT_NEAR(score.asJson()["covered"], 0.75, 0.03);
  EXPECT_NEAR(score.asJson()["own_line_covered"], 1,
              0.03);  // The step of 7 px between the second vessel's two parts is not found.
  EXPECT_NEAR(score.asJson()["own_line_part"], 0.75, 0.03);
  EXPECT_EQ(score.asJson()["own_line_correct"], 1);

  // A line between the two is wrong by the plain count, and nobody's by the other; one outside both is wrong by both.
  ExtractionScore between(1.5);
  between.add(curve({5, 51.6}, {45, 51.6}), truth, truth, own);
  EXPECT_NEAR(between.asJson()["correct"], 1, 1e-9);
  ExtractionScore outside(1.5);
  outside.add(curve({5, 57}, {45, 57}), truth, truth, own);
  EXPECT_EQ(outside.asJson()["correct"], 0);
  EXPECT_EQ(outside.asJson()["own_line_correct"], 0);
  EXPECT_TRUE(outside.asJson().contains("own_line_part"));
}

TEST(ExtractionScore, NothingFoundIsNothingCoveredAndNothingWrong) {
  ExtractionScore score(1.5);
  score.add({}, curve({0, 0}, {50, 0}));
  EXPECT_EQ(score.asJson()["covered"], 0);
  EXPECT_EQ(score.asJson()["correct"], 0);
}

TEST(ExtractionScore, MasksAreRightToTheirRimAndWantedAlongTheirMiddle) {
  cv::Mat mask = cv::Mat::zeros(200, 300, CV_8U);
  cv::rectangle(mask, {50, 95}, {249, 105}, 255, cv::FILLED);
  ExtractionScore score(3);
  score.addMask(curve({50, 107.5}, {248, 107.5}), mask);  // Half-way between rim and tolerance, not on the middle.
  EXPECT_EQ(score.asJson()["correct"], 1);
  EXPECT_LT(score.asJson()["covered"], 0.1);
  ExtractionScore middle(3);
  middle.addMask(curve({50, 101}, {150, 101}), mask);
  EXPECT_NEAR(middle.asJson()["covered"], 0.5, 0.05);
}

TEST(ShownIn, FindsWhatTheImageShowsThroughARampAndNoise) {
  cv::Mat image(200, 400, CV_16UC1);
  cv::RNG random(5);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double vessel = x < 200 ? 0.15 * std::exp(-0.5 * std::pow((y - 100) / 2.0, 2)) : 0;
      image.at<ushort>(y, x) = static_cast<ushort>(20000 * std::exp(0.002 * y - vessel) + random.gaussian(200));
    }
  }
  const Centerline2d projected = curve({20, 102}, {380, 102});
  const Centerline2d shown = shownIn(image, projected, 4, 0.05);
  EXPECT_NEAR(shown.size(), 90, 5);  // Of 181 points, those left of the middle; the last few lie beside its end.
  EXPECT_LT(shown.points_px.row(0).maxCoeff(), 206);
}

}  // namespace
}  // namespace angio::test
