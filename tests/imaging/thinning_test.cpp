// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/thinning.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Discs thrown at random: they overlap to branches, blobs and holes, and touch the image's edge.
cv::Mat blobs(unsigned seed) {
  test::Random random(seed);
  cv::Mat mask = cv::Mat::zeros(120, 160, CV_8UC1);
  for (int i = 0; i < 90; ++i) {
    const cv::Point center(static_cast<int>(random.uniform(0, 160)), static_cast<int>(random.uniform(0, 120)));
    cv::circle(mask, center, static_cast<int>(random.uniform(1, 9)), 255, cv::FILLED);
  }
  return mask;
}

int regions(const cv::Mat& mask) {
  cv::Mat labels;
  return cv::connectedComponents(mask, labels, 8) - 1;
}

// The outside is one 4-connected region, so that everything else that is empty is a hole.
int holes(const cv::Mat& mask) {
  cv::Mat framed, labels;
  cv::copyMakeBorder(mask, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  return cv::connectedComponents(framed == 0, labels, 4) - 2;
}

TEST(Thinning, KeepsEveryRegionAndEveryHole) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const cv::Mat mask = blobs(seed);
    cv::Mat lines = mask.clone();
    thin(lines);
    EXPECT_EQ(regions(lines), regions(mask)) << seed;
    EXPECT_EQ(holes(lines), holes(mask)) << seed;
    EXPECT_EQ(cv::countNonZero(lines & ~mask), 0) << seed;
  }
}

TEST(Thinning, LinesAreOnePixelWide) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    cv::Mat lines = blobs(seed), blocks;
    thin(lines);
    cv::erode(lines, blocks, cv::Mat::ones(2, 2, CV_8UC1), cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    EXPECT_EQ(cv::countNonZero(blocks), 0) << seed;
    cv::Mat again = lines.clone();
    thin(again);
    EXPECT_EQ(cv::countNonZero(again != lines), 0) << seed;
  }
}

// Strokes as wide as vessels are in the working image.
cv::Mat strokes(unsigned seed) {
  test::Random random(seed);
  cv::Mat mask = cv::Mat::zeros(400, 400, CV_8UC1);
  const auto place = [&] {
    return cv::Point(static_cast<int>(random.uniform(20, 380)), static_cast<int>(random.uniform(20, 380)));
  };
  for (int i = 0; i < 6; ++i) {
    const cv::Point from = place();
    cv::line(mask, from, place(), 255, 7);
  }
  return mask;
}

// A second opinion: where Zhang and Suen draw a line, one is found here as well.
TEST(Thinning, RunsWhereZhangAndSuenRun) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const cv::Mat mask = strokes(seed);
    cv::Mat ours = mask.clone(), theirs, distance;
    thin(ours);
    cv::ximgproc::thinning(mask, theirs, cv::ximgproc::THINNING_ZHANGSUEN);
    cv::distanceTransform(ours == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    // Peeling in another order moves ends and meeting points by more than the two pixels allowed; they are few.
    EXPECT_GT(cv::countNonZero(theirs & (distance <= 2)), 0.97 * cv::countNonZero(theirs)) << seed;
  }
}

TEST(Thinning, PutsTheLineInTheMiddleOfABar) {
  cv::Mat bar = cv::Mat::zeros(31, 100, CV_8UC1);
  bar(cv::Rect(10, 10, 80, 11)).setTo(255);
  thin(bar);
  for (int x = 20; x < 80; ++x) {
    EXPECT_EQ(cv::countNonZero(bar.col(x)), 1) << x;
    EXPECT_EQ(bar.at<std::uint8_t>(15, x), 255) << x;
  }
}

TEST(Thinning, RefusesOtherTypes) {
  cv::Mat wide(4, 4, CV_16UC1, cv::Scalar(1));
  EXPECT_THROW(thin(wide), InputError);
}

}  // namespace
}  // namespace angio::test
