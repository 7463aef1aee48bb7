// SPDX-License-Identifier: GPL-2.0-or-later
// What every extractor must do, whatever its method.
#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/test/types_of.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

using test::clinicalScene;
using test::Scene;

template <typename Settings>
struct ExtractorConformance : testing::Test {
  static Centerline2d extract(const cv::Mat& image, const Settings& settings = {}) {
    return makeExtractor(settings)->extract(image);
  }

  static Scene tree(unsigned seed) {
    Scene scene;
    scene.vessels = {test::randomTree(seed, 512, 512)};
    scene.seed = seed;
    return scene;
  }

  // Part of the points of `a` that have one of `b` within two pixels: points lie two pixels apart along the line.
  static double agreement(const Centerline2d& a, const Centerline2d& b) {
    int near = 0;
    for (int i = 0; i < a.size(); ++i) near += test::distanceTo(b, a.points_px.col(i)) < 2 ? 1 : 0;
    return static_cast<double>(near) / std::max(1, a.size());
  }
};
TYPED_TEST_SUITE(ExtractorConformance, typename test::TypesOf<ExtractorSettings>::type);

TYPED_TEST(ExtractorConformance, FindsTheTreeAndNothingElse) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Scene scene = this->tree(seed);
    const Centerline2d found = this->extract(test::render(scene));
    // Thin ends of 0.8 px radius are at the limit of what is seen.
    EXPECT_GT(test::coverage(scene, found, 3), 0.9) << seed;
    EXPECT_GT(test::precision(scene, found, 3), 0.95) << seed;
    EXPECT_LT(test::medianDistance(found, scene), 0.3) << seed;
  }
}

TYPED_TEST(ExtractorConformance, AllFieldsAreOfOneLength) {
  const Centerline2d found = this->extract(test::render(this->tree(1)));
  ASSERT_GT(found.size(), 0);
  const auto n = static_cast<std::size_t>(found.size());
  EXPECT_EQ(found.branch.size(), n);
  EXPECT_EQ(found.tangent_rad.size(), found.size());
  EXPECT_EQ(found.radius_px.size(), found.size());
  for (const auto* values : {&found.std_px, &found.contrast}) {
    if (values->size() == 0) continue;
    ASSERT_EQ(values->size(), found.size());
    EXPECT_TRUE(values->allFinite());
    EXPECT_GE(values->minCoeff(), 0);
  }
  EXPECT_TRUE(found.kind.empty() || found.kind.size() == n);
  EXPECT_TRUE(found.points_px.allFinite());
  EXPECT_GE(found.points_px.minCoeff(), -0.5);
  EXPECT_LE(found.points_px.maxCoeff(), 511.5);
  EXPECT_GE(found.tangent_rad.minCoeff(), -M_PI / 2);
  EXPECT_LT(found.tangent_rad.maxCoeff(), M_PI / 2);
}

TYPED_TEST(ExtractorConformance, EightBitsAndGainGiveTheSameLines) {
  const Scene scene = this->tree(2);
  const cv::Mat image = test::render(scene);
  const Centerline2d found = this->extract(image);
  cv::Mat eight, dim;
  image.convertTo(eight, CV_8U, 1.0 / 130);
  image.convertTo(dim, CV_16U, 0.1);
  for (const cv::Mat& other : {eight, dim}) {
    const Centerline2d again = this->extract(other);
    EXPECT_GT(this->agreement(found, again), 0.97);
    EXPECT_GT(this->agreement(again, found), 0.97);
  }
}

TYPED_TEST(ExtractorConformance, NegativeGivesTheSameLines) {
  const cv::Mat image = test::render(this->tree(3));
  TypeParam bright;
  bright.polarity = Polarity::kBright;
  const Centerline2d found = this->extract(image), negative = this->extract(test::negative(image), bright);
  EXPECT_GT(this->agreement(found, negative), 0.99);
  EXPECT_GT(this->agreement(negative, found), 0.99);
}

// Both work on grids and blocks, so that a few ends come and go.
TYPED_TEST(ExtractorConformance, LinesMoveWithTheImage) {
  const cv::Mat image = test::render(this->tree(1));
  const Eigen::Vector2d shift(7, -5);
  cv::Mat moved;
  cv::warpAffine(image, moved, cv::Matx23d(1, 0, shift.x(), 0, 1, shift.y()), image.size(), cv::INTER_NEAREST,
                 cv::BORDER_REFLECT_101);
  Centerline2d found = this->extract(image);
  found.points_px.colwise() += shift;
  const Centerline2d seen = this->extract(moved);
  EXPECT_GT(this->agreement(found, seen), 0.95);
  EXPECT_GT(this->agreement(seen, found), 0.95);
}

TYPED_TEST(ExtractorConformance, LinesTurnWithTheImage) {
  const cv::Mat image = test::render(this->tree(2));
  cv::Mat turned;
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  Centerline2d found = this->extract(image);
  for (int i = 0; i < found.size(); ++i) {
    found.points_px.col(i) = Eigen::Vector2d(511 - found.points_px(1, i), found.points_px(0, i));
  }
  const Centerline2d seen = this->extract(turned);
  EXPECT_GT(this->agreement(found, seen), 0.95);
  EXPECT_GT(this->agreement(seen, found), 0.95);
}

TYPED_TEST(ExtractorConformance, FindsNothingWhereNothingIs) {
  for (const double noise : {0.0, 0.01, 0.05}) {
    Scene scene;
    scene.noise = noise;
    EXPECT_EQ(this->extract(test::render(scene)).size(), 0) << noise;
  }
  EXPECT_EQ(this->extract(cv::Mat(300, 400, CV_16UC1, cv::Scalar(20000))).size(), 0);
  EXPECT_EQ(this->extract(cv::Mat(300, 400, CV_8UC1, cv::Scalar(0))).size(), 0);
  EXPECT_EQ(this->extract(cv::Mat(1, 1, CV_8UC1, cv::Scalar(7))).size(), 0);
  EXPECT_EQ(this->extract(cv::Mat(3, 700, CV_16UC1, cv::Scalar(7))).size(), 0);
}

TYPED_TEST(ExtractorConformance, CollimatorIsNoVessel) {
  cv::Mat image = test::render(Scene());
  for (const cv::Rect& blade : {cv::Rect(0, 0, 512, 30), cv::Rect(0, 0, 60, 512)}) image(blade).setTo(900);
  EXPECT_EQ(this->extract(image).size(), 0);
}

TYPED_TEST(ExtractorConformance, SecondFrameIsLikeTheFirst) {
  const cv::Mat image = test::render(this->tree(3));
  const auto extractor = makeExtractor(TypeParam{});
  const Centerline2d first = extractor->extract(image);
  // Other sizes and images in between: buffers must not remember them.
  extractor->extract(test::render(clinicalScene({test::randomTree(4, 1024, 1024)})));
  extractor->extract(cv::Mat(40, 90, CV_8UC1, cv::Scalar(7)));
  const Centerline2d again = extractor->extract(image);
  EXPECT_EQ(again.points_px, first.points_px);
  EXPECT_EQ(again.tangent_rad, first.tangent_rad);
  EXPECT_EQ(again.radius_px, first.radius_px);
  EXPECT_EQ(again.branch, first.branch);
  EXPECT_EQ(again.kind, first.kind);
}

TYPED_TEST(ExtractorConformance, RefusesWrongImagesAndSettings) {
  EXPECT_THROW(this->extract(cv::Mat()), InputError);
  EXPECT_THROW(this->extract(cv::Mat(64, 64, CV_32FC1, cv::Scalar(1))), InputError);
  EXPECT_THROW(this->extract(cv::Mat(64, 64, CV_8UC3, cv::Scalar(1))), InputError);
  TypeParam settings;
  settings.spacing_px = 0;
  try {
    makeExtractor(settings);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(std::string(TypeParam::kName) + ": spacing_px = 0"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace angio::test
