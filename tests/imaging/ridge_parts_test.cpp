// SPDX-License-Identifier: GPL-2.0-or-later
// What the ridge extractor's passes over images are made of, against slower ways to the same numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "area_resampler.hpp"
#include "field_outline.hpp"
#include "finer_lines.hpp"
#include "largest_region.hpp"
#include "line_metrics.hpp"
#include "quantile.hpp"

namespace angio::test {
namespace {

TEST(Quantile, IsWhatSortingFinds) {
  test::Random random(1);
  enum class Values { kFar, kAlike, kAlikeAndNegative };
  for (const Values kind : {Values::kFar, Values::kAlike, Values::kAlikeAndNegative}) {
    for (int count = 1; count < 70; ++count) {
      std::vector<float> values;
      // Ties and, in values that are far apart, zeros and both signs, from very small to large.
      for (int i = 0; i < count; ++i) {
        const double far = std::pow(10.0, random.uniform(-20, 5)) * (random.uniform(0, 1) < 0.5 ? -1 : 1);
        const double alike = random.uniform(2.5, 3.5) * (kind == Values::kAlike ? 1 : -1);
        const bool is_zero = kind == Values::kFar && i % 7 == 3;
        values.push_back(i % 5 == 4 ? values[i / 2]
                         : is_zero  ? 0.0f
                                    : static_cast<float>(kind == Values::kFar ? far : alike));
      }
      std::vector<float> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      for (int place = 0; place < count; ++place) {
        ASSERT_EQ(imaging::valueAt(static_cast<std::size_t>(place), values), sorted[place]) << count;
      }
    }
  }
}

// A row above an outline has no pixel, nor any beyond the image.
TEST(RowsInside, AreWithinTheImage) {
  const std::vector<cv::Point2f> outline{{20, 30}, {90, 20}, {70, 80}, {30, 90}};
  int empty = 0;
  for (const imaging::RowRange& row : imaging::rowsInside(outline, {64, 64}, 3)) {
    EXPECT_GE(row.begin, 0);
    EXPECT_LE(row.begin, row.end);
    EXPECT_LE(row.end, 64);
    empty += row.begin == row.end ? 1 : 0;
  }
  EXPECT_GT(empty, 20);
}

// Shrunk a little, to what vectors of neighbours hold, and by more.
TEST(AreaResampler, IsWhatOpenCvsAreasAre) {
  imaging::AreaResampler shrink;
  imaging::Plane shrunk;
  for (const int depth : {CV_8U, CV_16U}) {
    cv::Mat image(301, 397, depth), expected;
    cv::theRNG().state = 5;
    cv::randu(image, 0, 255);
    for (const cv::Size size : {cv::Size(397, 301), cv::Size(275, 209), cv::Size(199, 151), cv::Size(62, 47)}) {
      shrink(image, size, shrunk);
      image.convertTo(expected, CV_32F);
      cv::resize(expected, expected, size, 0, 0, cv::INTER_AREA);
      EXPECT_LT(cv::norm(shrunk.mat(), expected, cv::NORM_INF), 1e-2) << size;
    }
  }
}

TEST(LargestRegion, IsWhatOpenCvFinds) {
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5});
  cv::theRNG().state = 7;
  int seen = 0;
  for (int trial = 0; trial < 40; ++trial) {
    cv::Mat noise(60 + trial, 71, CV_32F), opened, labels, stats, centroids;
    cv::randn(noise, 0, 1);
    cv::GaussianBlur(noise, noise, {}, 1 + trial % 4);
    const cv::Mat mask = noise > (trial % 3 - 1) * 0.05;
    cv::morphologyEx(mask, opened, cv::MORPH_OPEN, disc, {-1, -1}, 1, cv::BORDER_REPLICATE);
    ASSERT_EQ(cv::norm(imaging::openedByDisc(mask), opened, cv::NORM_INF), 0);
    const cv::Mat region = imaging::largestRegion(opened);
    const int count = cv::connectedComponentsWithStats(opened, labels, stats, centroids, 4, CV_32S);
    if (count == 1) {
      EXPECT_TRUE(region.empty());
      continue;
    }
    int largest = 1;
    for (int label = 2; label < count; ++label) {
      if (stats.at<int>(label, cv::CC_STAT_AREA) > stats.at<int>(largest, cv::CC_STAT_AREA)) largest = label;
    }
    ASSERT_EQ(cv::norm(region, labels == largest, cv::NORM_INF), 0);
    ++seen;
  }
  EXPECT_GT(seen, 20);
}

// Lines in some rows of an image whose size fills no vectors, and other lines in the next image.
TEST(LargestNear, IsWhatOpenCvsDilationFinds) {
  imaging::LinePlane lines;
  imaging::Plane dense, halved, halved_lines, spread;
  imaging::LargestNear largest;
  test::Random random(2);
  const cv::Size size(83, 47);
  lines.resize(size.width, size.height);
  dense.resize(size.width, size.height);
  for (int frame = 0; frame < 2; ++frame) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const bool is_line = (x / imaging::LinePlane::kBlock + y) % 5 == frame;
        lines.marks(y)[x / imaging::LinePlane::kBlock] = is_line ? 1 : 0;
        dense.row(y)[x] = lines.row(y)[x] = is_line ? static_cast<float>(random.uniform(0, 1)) : 0;
      }
    }
    for (const int reach : {1, 2, 3}) {
      cv::Mat expected;
      cv::dilate(dense.mat(), expected, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
      largest.spread(dense, reach, spread);
      EXPECT_EQ(cv::norm(spread.mat(), expected, cv::NORM_INF), 0) << reach;
      if (reach > 1) continue;
      largest.halve(dense, halved);
      largest.halve(lines, halved_lines);
      for (int y = 0; y < halved.height(); ++y) {
        for (int x = 0; x < halved.width(); ++x) {
          ASSERT_EQ(halved.row(y)[x], expected.at<float>(2 * y, 2 * x));
          ASSERT_EQ(halved_lines.row(y)[x], expected.at<float>(2 * y, 2 * x));
        }
      }
    }
  }
}

// Blocks without lines are not written: what an image before had there must be gone.
TEST(RidgeExtractor, ForgetsTheImageBefore) {
  Scene one, other;
  one.vessels = {{test::straightTube({60, 100}, {450, 130}, 3)}, {test::straightTube({80, 420}, {420, 380}, 8)}};
  other.vessels = {{test::straightTube({100, 60}, {130, 450}, 4)}};
  one.noise = other.noise = 0.01;
  const cv::Mat first = test::render(one), second = test::render(other);
  const auto fresh = makeExtractor(RidgeSettings())->extract(second);
  const auto extractor = makeExtractor(RidgeSettings());
  extractor->extract(first);
  const auto found = extractor->extract(second);
  ASSERT_GT(fresh.size(), 0);
  ASSERT_EQ(found.size(), fresh.size());
  EXPECT_EQ(found.points_px, fresh.points_px);
  EXPECT_EQ(found.radius_px, fresh.radius_px);
  EXPECT_EQ(found.std_px, fresh.std_px);
}

}  // namespace
}  // namespace angio::test
