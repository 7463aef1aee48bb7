// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/imaging/visp.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

using test::branches;
using test::clinicalScene;
using test::coverage;
using test::distanceTo;
using test::median;
using test::medianDistance;
using test::precision;
using test::Scene;

Centerline2d extractOtsu(const cv::Mat& image, const OtsuSettings& settings = {}) {
  return makeExtractor(settings)->extract(image);
}

// Vessels of 1 to 6 mm: 5 to 30 px.
class VesselWidth : public testing::TestWithParam<double> {};

TEST_P(VesselWidth, LineRadiusAndTangentAreThoseOfTheTube) {
  const double radius = GetParam();
  const Eigen::Vector2d from(100, 200), to(900, 520);
  const Scene scene = clinicalScene({{test::straightTube(from, to, radius)}});
  const Centerline2d found = extractOtsu(test::render(scene));
  ASSERT_GT(found.size(), 0);
  EXPECT_EQ(branches(found), 1u);
  // The goal is 0.4 px; measured 0.04 to 0.07 at this noise.
  EXPECT_LT(medianDistance(found, scene), 0.2);
  std::vector<double> tangent_errors;
  const double along = std::atan2(to.y() - from.y(), to.x() - from.x());
  for (int i = 0; i < found.size(); ++i) tangent_errors.push_back(std::abs(undirected(found.tangent_rad[i] - along)));
  EXPECT_LT(median(tangent_errors), 2 * kPi / 180);
  std::vector<double> radii(found.radius_px.data(), found.radius_px.data() + found.size());
  EXPECT_NEAR(median(radii), radius, 1);
  // The tube's round ends lie a radius beyond its line, the found ends somewhere in them.
  EXPECT_LT(distanceTo(found, from), 2);
  EXPECT_LT(distanceTo(found, to), 2);
}

INSTANTIATE_TEST_SUITE_P(OneToSixMillimetres, VesselWidth, testing::Values(2.5, 4.0, 7.5, 15.0));

TEST(OtsuExtractor, FollowsBendsWithoutCuttingThem) {
  for (const double bend_px : {50.0, 150.0}) {
    const Scene scene = clinicalScene({{test::arcTube({500, 500}, bend_px, 0.3, 4.0, 6)}});
    const Centerline2d found = extractOtsu(test::render(scene));
    // Smoothing over 2 working pixels pulls a bend of 50 px inwards by 0.2 px.
    EXPECT_LT(medianDistance(found, scene), 0.3) << bend_px;
    std::vector<double> errors;
    for (int i = 0; i < found.size(); ++i) {
      const Eigen::Vector2d arm = found.points_px.col(i) - Eigen::Vector2d(500, 500);
      errors.push_back(std::abs(undirected(found.tangent_rad[i] - std::atan2(arm.x(), -arm.y()))));
    }
    EXPECT_LT(median(errors), 3 * kPi / 180) << bend_px;
  }
}

TEST(OtsuExtractor, VesselsReachTheEdgeOfTheImage) {
  const Scene scene = clinicalScene({{test::straightTube({-50, 200}, {1100, 520}, 6)}});
  const Centerline2d found = extractOtsu(test::render(scene));
  EXPECT_EQ(branches(found), 1u);
  // Four pixels of border, and the last step of the line.
  EXPECT_LT(found.points_px.row(0).minCoeff(), 8);
  EXPECT_GT(found.points_px.row(0).maxCoeff(), 1023 - 8);
}

TEST(OtsuExtractor, BifurcationIsThreeBranchesThatMeet) {
  const Scene scene =
      clinicalScene({{test::straightTube({500, 100}, {500, 500}, 10), test::straightTube({500, 500}, {250, 850}, 7),
                      test::straightTube({500, 500}, {750, 850}, 7)}});
  const Centerline2d found = extractOtsu(test::render(scene));
  EXPECT_EQ(branches(found), 3u);
  int meeting = 0;
  for (int i = 0; i < found.size(); ++i) {
    const bool end = i == 0 || i + 1 == found.size() || found.branch[i - 1] != found.branch[i] ||
                     found.branch[i + 1] != found.branch[i];
    // The thick vessels overlap for 20 px; the lines meet well within a radius of where they do.
    if (end && (found.points_px.col(i) - Eigen::Vector2d(500, 500)).norm() < 5) ++meeting;
  }
  EXPECT_EQ(meeting, 3);
}

TEST(OtsuExtractor, CrossingIsFourBranches) {
  const Scene scene =
      clinicalScene({{test::straightTube({200, 300}, {820, 740}, 8)}, {test::straightTube({250, 800}, {760, 240}, 6)}});
  const Centerline2d found = extractOtsu(test::render(scene));
  EXPECT_EQ(branches(found), 4u);
  EXPECT_LT(medianDistance(found, scene), 0.3);
  EXPECT_GT(coverage(scene, found, 2), 0.98);
}

TEST(OtsuExtractor, FindsTheWholeTreeAndNothingElse) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Scene scene = clinicalScene({test::randomTree(seed, 1024, 1024)});
    scene.seed = seed;
    const Centerline2d found = extractOtsu(test::render(scene));
    EXPECT_GT(coverage(scene, found, 3), 0.95) << seed;
    EXPECT_GT(precision(scene, found, 3), 0.95) << seed;
    EXPECT_LT(medianDistance(found, scene), 0.3) << seed;
  }
}

// A thick vessel and a thin one beside it. Otsu's threshold of all pixels parts the thick one from all else, the thin
// one among it; a part of the threshold, held off the noise, keeps both.
TEST(OtsuExtractor, ThePlainCutLosesTheFaintVessel) {
  const Scene scene = clinicalScene(
      {{test::straightTube({100, 200}, {900, 300}, 15)}, {test::straightTube({100, 700}, {900, 800}, 2.5)}});
  const cv::Mat image = test::render(scene);
  const auto found = [&](OtsuCut cut, double from_v_px) {
    OtsuSettings settings;
    settings.cut = cut;
    const Centerline2d lines = extractOtsu(image, settings);
    return (lines.points_px.row(1).array() > from_v_px && lines.points_px.row(1).array() < from_v_px + 300).count();
  };
  EXPECT_GT(found(OtsuCut::kGated, 100), 300);  // 800 px in steps of 2.
  EXPECT_GT(found(OtsuCut::kGated, 600), 300);
  EXPECT_GT(found(OtsuCut::kPlain, 100), 300);
  EXPECT_LT(found(OtsuCut::kPlain, 600), 50);
}

TEST(OtsuExtractor, PointsOfABranchAreInOrderAndEvenlySpaced) {
  const Scene scene = clinicalScene({test::randomTree(2, 1024, 1024)});
  OtsuSettings settings;
  settings.spacing_px = 3;
  const Centerline2d found = extractOtsu(test::render(scene), settings);
  std::vector<double> steps;
  for (int i = 1; i < found.size(); ++i) {
    if (found.branch[i] != found.branch[i - 1]) continue;
    steps.push_back((found.points_px.col(i) - found.points_px.col(i - 1)).norm());
    // A branch is cut into the nearest whole number of steps, and the shortest has one: up to half a step longer.
    EXPECT_LE(steps.back(), 4.5) << i;
  }
  EXPECT_NEAR(median(steps), 3, 0.1);
}

TEST(OtsuExtractor, FindsNoVesselWhereThereIsNone) {
  for (const double noise : {0.0, 0.005, 0.02, 0.05}) {
    Scene scene = clinicalScene({});
    scene.noise = noise;
    EXPECT_EQ(extractOtsu(test::render(scene)).size(), 0) << noise;
  }
  EXPECT_EQ(extractOtsu(cv::Mat(600, 800, CV_16UC1, cv::Scalar(20000))).size(), 0);
  EXPECT_EQ(extractOtsu(cv::Mat(600, 800, CV_8UC1, cv::Scalar(0))).size(), 0);
  EXPECT_EQ(extractOtsu(cv::Mat(1, 1, CV_8UC1, cv::Scalar(7))).size(), 0);
}

TEST(OtsuExtractor, CollimatorIsNoVessel) {
  cv::Mat image = test::render(clinicalScene({}));
  for (const cv::Rect& blade : {cv::Rect(0, 0, 1024, 40), cv::Rect(0, 0, 90, 1024)}) image(blade).setTo(900);
  EXPECT_EQ(extractOtsu(image).size(), 0);
  image(cv::Rect(1020, 0, 4, 1024)).setTo(0);
  EXPECT_EQ(extractOtsu(image).size(), 0);
}

TEST(OtsuExtractor, NegativeGivesTheSameCentreline) {
  const cv::Mat image = test::render(clinicalScene({test::randomTree(3, 1024, 1024)}));
  OtsuSettings bright;
  bright.polarity = Polarity::kBright;
  const Centerline2d dark = extractOtsu(image), negative = extractOtsu(test::negative(image), bright);
  ASSERT_EQ(negative.size(), dark.size());
  // Rounding of the shrunken image goes the other way in the negative: half a grey value of 30,000.
  EXPECT_LT((negative.points_px - dark.points_px).colwise().norm().maxCoeff(), 0.05);
}

TEST(OtsuExtractor, EightBitsGiveTheSameCentreline) {
  const Scene scene = clinicalScene({test::randomTree(3, 1024, 1024)});
  const cv::Mat image = test::render(scene);
  cv::Mat eight;
  image.convertTo(eight, CV_8U, 1.0 / 257);
  const Centerline2d fine = extractOtsu(image), coarse = extractOtsu(eight);
  std::vector<double> distances;
  for (int i = 0; i < coarse.size(); ++i) distances.push_back(distanceTo(fine, coarse.points_px.col(i)));
  // Points lie 2 px apart, so that the nearest is up to 1 px away along the line.
  EXPECT_LT(median(distances), 1);
  EXPECT_LT(medianDistance(coarse, scene), 0.3);
  EXPECT_GT(coverage(scene, coarse, 3), 0.95);
}

TEST(OtsuExtractor, ExposureDoesNotMatter) {
  const Scene scene = clinicalScene({test::randomTree(3, 1024, 1024)});
  const cv::Mat image = test::render(scene);
  cv::Mat dim;
  image.convertTo(dim, CV_16U, 0.1);
  EXPECT_LT(medianDistance(extractOtsu(dim), scene), 0.3);
  EXPECT_GT(coverage(scene, extractOtsu(dim), 3), 0.95);
}

TEST(OtsuExtractor, MirroredImageGivesTheMirroredCentreline) {
  const cv::Mat image = test::render(clinicalScene({test::randomTree(1, 1024, 1024)}));
  cv::Mat mirrored;
  cv::flip(image, mirrored, 1);
  const Centerline2d found = extractOtsu(image), seen = extractOtsu(mirrored);
  std::vector<double> distances;
  for (int i = 0; i < seen.size(); ++i) {
    distances.push_back(distanceTo(found, Eigen::Vector2d(1023 - seen.points_px(0, i), seen.points_px(1, i))));
  }
  // As above, 1 px along the line; across it, thinning from the other side leaves spurs and ends a pixel away.
  EXPECT_LT(median(distances), 1);
  std::sort(distances.begin(), distances.end());
  EXPECT_LT(distances[distances.size() * 95 / 100], 2);
}

TEST(OtsuExtractor, SecondFrameIsLikeTheFirst) {
  const cv::Mat image = test::render(clinicalScene({test::randomTree(4, 1024, 1024)}));
  const auto extractor = makeExtractor(OtsuSettings{});
  const Centerline2d first = extractor->extract(image);
  // Other sizes and images in between: buffers must not remember them.
  extractor->extract(test::render(Scene{}));
  const Centerline2d again = extractor->extract(image);
  EXPECT_EQ(again.points_px, first.points_px);
  EXPECT_EQ(again.tangent_rad, first.tangent_rad);
  EXPECT_EQ(again.radius_px, first.radius_px);
  EXPECT_EQ(again.branch, first.branch);
}

TEST(OtsuExtractor, ReadsViewsAndVispImages) {
  Scene scene;
  scene.vessels = {{test::straightTube({60, 60}, {440, 400}, 4)}};
  const cv::Mat image = test::render(scene);
  EXPECT_LT(medianDistance(extractOtsu(fromVisp(toVisp(image))), scene), 0.4);
  cv::Mat wide(600, 700, CV_16UC1, cv::Scalar(1));
  const cv::Mat view = wide(cv::Rect(31, 17, image.cols, image.rows));
  image.copyTo(view);
  EXPECT_EQ(extractOtsu(view).points_px, extractOtsu(image).points_px);
}

TEST(OtsuExtractor, RefusesWrongImagesAndSettings) {
  EXPECT_THROW(extractOtsu(cv::Mat()), InputError);
  EXPECT_THROW(extractOtsu(cv::Mat(64, 64, CV_32FC1, cv::Scalar(1))), InputError);
  EXPECT_THROW(extractOtsu(cv::Mat(64, 64, CV_8UC3, cv::Scalar(1))), InputError);
  OtsuSettings settings;
  settings.spacing_px = 0;
  EXPECT_THROW(makeExtractor(settings), InputError);
}

}  // namespace
}  // namespace angio::test
