// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "angio/geometry/se3.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

using test::clinicalScene;
using test::Scene;

Centerline2d extract(const cv::Mat& image, const RidgeSettings& settings = {}) {
  return makeExtractor(settings)->extract(image);
}

class RidgeWidth : public testing::TestWithParam<double> {};

TEST_P(RidgeWidth, LineRadiusContrastAndTangentAreThoseOfTheTube) {
  const double radius = GetParam();
  const Eigen::Vector2d from(100.3, 200.6), to(900.1, 520.2);
  const Scene scene = clinicalScene({{test::straightTube(from, to, radius)}});
  const Centerline2d found = extract(test::render(scene));
  ASSERT_GT(found.size(), 0);
  EXPECT_EQ(test::branches(found), 1u);
  EXPECT_LT(test::medianDistance(found, scene), 0.15);
  std::vector<double> tangents, radii, contrasts;
  const double along = std::atan2(to.y() - from.y(), to.x() - from.x());
  for (int i = 0; i < found.size(); ++i) {
    tangents.push_back(std::abs(undirected(found.tangent_rad[i] - along)));
    radii.push_back(found.radius_px[i]);
    contrasts.push_back(found.contrast[i]);
  }
  EXPECT_LT(test::median(tangents), 1.5 * kPi / 180);
  EXPECT_NEAR(test::median(radii), radius, 0.15 * radius + 0.3);
  // The dark level that tames the logarithm takes a twentieth of it; a thin tube's contrast and radius look alike under
  // the pixels' blur.
  EXPECT_NEAR(test::median(contrasts) / (2 * radius * scene.absorption_per_px), 0.95, radius < 2.5 ? 0.2 : 0.12);
  EXPECT_GT(test::coverage(scene, found, 2), 0.98);
}

INSTANTIATE_TEST_SUITE_P(OneToSixMillimetres, RidgeWidth, testing::Values(2.0, 2.5, 4.0, 7.5, 15.0));

// If sigma is right, two thirds of the errors are below it and 95 % below its double. Neighbouring points share their
// error, so that the parts scatter by some per cent over 12 lines. A line allows for bends and tapers, which these
// tubes have not: with little noise beside that it may be better than it says, but not worse.
TEST(RidgeExtractor, SigmaIsTheErrorAcrossTheLine) {
  for (const double noise : {0.005, 0.01, 0.02}) {
    int within_one = 0, within_two = 0, total = 0;
    for (unsigned seed = 1; seed <= 12; ++seed) {
      test::Random random(seed);
      const double angle = random.uniform(0, kPi), radius = random.uniform(2, 8);
      const Eigen::Vector2d middle(256 + random.uniform(-30, 30), 256 + random.uniform(-30, 30));
      const Eigen::Vector2d arm = 180 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      Scene scene;
      scene.vessels = {{test::straightTube(middle - arm, middle + arm, radius)}};
      scene.noise = noise;
      scene.seed = seed;
      const Centerline2d found = extract(test::render(scene));
      for (int i = 0; i < found.size(); ++i) {
        const Eigen::Vector2d d = found.points_px.col(i) - middle;
        if (d.norm() > 170) continue;
        const double error = std::abs(d.x() * std::sin(angle) - d.y() * std::cos(angle));
        within_one += error < found.std_px[i] ? 1 : 0;
        within_two += error < 2 * found.std_px[i] ? 1 : 0;
        ++total;
      }
    }
    ASSERT_GT(total, 1000);
    EXPECT_GT(static_cast<double>(within_one) / total, 0.68 - 0.15) << noise;
    EXPECT_GT(static_cast<double>(within_two) / total, 0.95 - 0.07) << noise;
    if (noise > 0.015) {
      EXPECT_LT(static_cast<double>(within_one) / total, 0.68 + 0.15) << noise;
    }
  }
}

TEST(RidgeExtractor, FollowsBendsWithoutCuttingThem) {
  for (const double bend_px : {50.0, 150.0}) {
    const Scene scene = clinicalScene({{test::arcTube({500, 500}, bend_px, 0.3, 4.0, 6)}});
    const Centerline2d found = extract(test::render(scene));
    EXPECT_LT(test::medianDistance(found, scene), 0.3) << bend_px;
    EXPECT_GT(test::coverage(scene, found, 2), 0.95) << bend_px;
  }
}

// The edge of an organ: all is brighter on one side.
TEST(RidgeExtractor, StepIsNoVessel) {
  const cv::Mat image = test::render(Scene());
  for (const double angle : {0.0, 0.4, 1.2, 3.5}) {
    cv::Mat step = image.clone();
    for (int y = 0; y < step.rows; ++y) {
      for (int x = 0; x < step.cols; ++x) {
        if ((x - 256) * std::cos(angle) + (y - 256) * std::sin(angle) < 0) continue;
        step.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(step.at<std::uint16_t>(y, x) * 0.7);
      }
    }
    EXPECT_EQ(extract(step).size(), 0) << angle;
  }
}

// A rib: a tube of 24 px that absorbs 5 % beside vessels of 6 px that absorb 12 %. Over its width that is a tenth of
// what the vessels hold, and far above the noise.
TEST(RidgeExtractor, WideFaintShadowBesideVesselsIsNoVessel) {
  Scene scene;
  scene.vessels = {{test::straightTube({60, 100}, {450, 130}, 3)}, {test::straightTube({80, 420}, {420, 380}, 3)}};
  cv::Mat image = test::render(scene);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double off = (y - 250.0 - 0.1 * x) / 12;
      if (std::abs(off) >= 1) continue;
      auto& value = image.at<std::uint16_t>(y, x);
      value = static_cast<std::uint16_t>(value * std::exp(-0.05 * std::sqrt(1 - off * off)));
    }
  }
  const Centerline2d found = extract(image);
  EXPECT_GT(test::coverage(scene, found, 1.5), 0.95);
  EXPECT_GT(test::precision(scene, found, 3), 0.98);
}

// Round tips are 60 % as dark as the tube 0.8 radii beyond their centre; half of a radius and a pixel of noise is what
// a line may overshoot it.
TEST(RidgeExtractor, LinesEndWhereTheirVesselsEnd) {
  for (const double radius : {4.0, 8.0}) {
    const Scene scene = clinicalScene({{test::straightTube({250, 300}, {760, 640}, radius)}});
    const Centerline2d found = extract(test::render(scene));
    ASSERT_EQ(test::branches(found), 1u) << radius;
    for (const int end : {0, found.size() - 1}) {
      EXPECT_LT(test::distanceToLines(scene, found.points_px.col(end)), 0.5 * radius + 1) << radius;
    }
    EXPECT_GT(test::coverage(scene, found, 3), 0.99) << radius;
  }
}

// A thin vessel on a wide one's flank pulls at its fit, or hides it: points there must not claim what they have
// elsewhere.
TEST(RidgeExtractor, SigmaGrowsWhereVesselsOverlap) {
  const Eigen::Vector2d from(100, 500), to(900, 500);
  const Scene scene =
      clinicalScene({{test::straightTube(from, to, 12)}, {test::straightTube({400, 513}, {600, 513}, 4)}});
  const Centerline2d found = extract(test::render(scene));
  std::vector<double> alone, beside;
  for (int i = 0; i < found.size(); ++i) {
    const Eigen::Vector2d p = found.points_px.col(i);
    if (std::abs(p.y() - 500) > 8) continue;
    if (p.x() > 430 && p.x() < 570) beside.push_back(found.std_px[i]);
    if (p.x() < 330 || p.x() > 670) alone.push_back(found.std_px[i]);
  }
  ASSERT_GT(alone.size(), 50u);
  ASSERT_GT(beside.size(), 20u);
  EXPECT_GT(test::median(beside), 3 * test::median(alone));
}

// Two vessels whose shadows overlap along a stretch: each pulls at the other's fit, by 0.7 px,
// unless both are known.
TEST(RidgeExtractor, VesselsSideBySideDoNotPullAtEachOther) {
  const Scene scene = clinicalScene(
      {{test::straightTube({100, 500}, {900, 500}, 10)}, {test::straightTube({200, 519}, {800, 519}, 7)}});
  const Centerline2d found = extract(test::render(scene));
  std::vector<double> errors;
  for (int i = 0; i < found.size(); ++i) {
    const Eigen::Vector2d p = found.points_px.col(i);
    if (p.x() > 300 && p.x() < 700) errors.push_back(test::distanceToLines(scene, p));
  }
  ASSERT_GT(errors.size(), 350u);
  EXPECT_LT(test::median(errors), 0.5);
}

// Neither grid nor its rounding moves a line: images whose sides the working grid does not divide.
TEST(RidgeExtractor, LineIsInPlaceAtAnySize) {
  for (const int side : {704, 760, 997}) {
    Scene scene;
    scene.width_px = scene.height_px = side;
    scene.vessels = {{test::straightTube({60, 0.93 * side}, {0.95 * side, 0.9 * side}, 4)}};
    const Centerline2d found = extract(test::render(scene));
    ASSERT_GT(found.size(), 100) << side;
    EXPECT_LT(test::medianDistance(found, scene), 0.2) << side;
  }
}

// A slope of the background moves the darkest place of a vessel, but not its middle.
TEST(RidgeExtractor, SlopeOfTheBackgroundDoesNotMoveTheLine) {
  const Eigen::Vector2d from(256.4, 40), to(256.4, 470);
  Scene scene;
  scene.vessels = {{test::straightTube(from, to, 4)}};
  scene.background = 0;
  cv::Mat image = test::render(scene);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      auto& value = image.at<std::uint16_t>(y, x);
      value = static_cast<std::uint16_t>(value * std::exp(-0.004 * x));
    }
  }
  const Centerline2d found = extract(image);
  ASSERT_GT(found.size(), 100);
  EXPECT_NEAR(found.points_px.row(0).mean(), 256.4, 0.15);
}

TEST(RidgeExtractor, VesselThatPassesOverAnotherGoesStraightOn) {
  for (const double turn : {0.45, 0.9, 1.5}) {
    const Eigen::Vector2d middle(512, 512), along(1, 0), across(std::cos(turn), std::sin(turn));
    const Scene scene = clinicalScene({{test::straightTube(middle - 350 * along, middle + 350 * along, 8)},
                                       {test::straightTube(middle - 350 * across, middle + 350 * across, 6)}});
    const Centerline2d found = extract(test::render(scene));
    EXPECT_EQ(test::branches(found), 2u) << turn;
    EXPECT_LT(test::medianDistance(found, scene), 0.3) << turn;
    EXPECT_GT(test::coverage(scene, found, 2.5), 0.97) << turn;
  }
}

TEST(RidgeExtractor, ParentGoesOnPastItsChild) {
  const Scene scene =
      clinicalScene({{test::straightTube({512, 60}, {512, 960}, 9), test::straightTube({512, 500}, {800, 740}, 4)}});
  const Centerline2d found = extract(test::render(scene));
  ASSERT_EQ(test::branches(found), 2u);
  EXPECT_GT(test::coverage(scene, found, 2.5), 0.97);
  // The child begins on its parent's line; it is seen from the parent's wall on, 9 px away, and led on straight.
  double nearest = 1e9;
  for (int i = 0; i < found.size(); ++i) {
    const bool end = i == 0 || i + 1 == found.size() || found.branch[i - 1] != found.branch[i] ||
                     found.branch[i + 1] != found.branch[i];
    if (end) nearest = std::min(nearest, (found.points_px.col(i) - Eigen::Vector2d(512, 500)).norm());
  }
  EXPECT_LT(nearest, 12);
}

TEST(RidgeExtractor, ClosesAGapAndLeavesOutASpur) {
  Scene gap;
  gap.vessels = {{test::straightTube({60, 256}, {246, 256}, 3)}, {test::straightTube({262, 256}, {450, 256}, 3)}};
  const Centerline2d closed = extract(test::render(gap));
  EXPECT_EQ(test::branches(closed), 1u);
  const auto withStumpUpTo = [](double y_px) {
    Scene spur;
    spur.vessels = {{test::straightTube({60, 256}, {450, 256}, 4), test::straightTube({250, 256}, {250, y_px}, 3)}};
    return test::branches(extract(test::render(spur)));
  };
  EXPECT_EQ(withStumpUpTo(250), 1u);  // Its axis ends 2 px from the wall: a spur.
  EXPECT_GT(withStumpUpTo(240), 1u);  // 12 px: a short branch.
}

TEST(RidgeExtractor, ParallelVesselsStayTwo) {
  const Scene scene =
      clinicalScene({{test::straightTube({100, 500}, {900, 500}, 5)}, {test::straightTube({100, 522}, {900, 522}, 5)}});
  const Centerline2d found = extract(test::render(scene));
  EXPECT_EQ(test::branches(found), 2u);
  EXPECT_GT(test::coverage(scene, found, 1.5), 0.97);
}

TEST(RidgeExtractor, AFinerGridTellsThinVesselsFromTheirNeighbours) {
  const Scene scene = clinicalScene(
      {{test::straightTube({100, 500}, {900, 500}, 1.5)}, {test::straightTube({100, 505.5}, {900, 505.5}, 1.5)}});
  const cv::Mat image = test::render(scene);
  RidgeSettings settings;
  EXPECT_LT(test::coverage(scene, extract(image, settings), 1), 0.8);
  settings.working_side_px = 1024;
  EXPECT_GT(test::coverage(scene, extract(image, settings), 1), 0.95);
}

}  // namespace
}  // namespace angio::test
