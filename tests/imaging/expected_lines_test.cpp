// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

// Two vessels that any extractor finds, and one that is too faint and too far away to be found for itself.
const Vessel kStrong = {test::arcTube({256, 700}, 480, 4.3, 5.2, 5), test::straightTube({120, 250}, {400, 330}, 4)};
const Vessel kFaint = {test::arcTube({120, 60}, 160, 0.3, 1.0, 1.1)};
const Vessel kEmpty = {test::arcTube({420, 150}, 70, 3.6, 5.6, 2)};

Scene sceneOf(std::vector<Vessel> vessels) {
  Scene scene;
  scene.vessels = std::move(vessels);
  return scene;
}

// As a tracker has it: moved by 4 px and turned by half a degree about the middle.
Centerline2d expected(const std::vector<Vessel>& vessels) {
  const Eigen::Rotation2Dd turn(0.009);
  const Eigen::Vector2d middle(256, 256), move(3, -2.5);
  std::vector<Eigen::Vector2d> points;
  std::vector<int> branch;
  int tubes = 0;
  for (const Vessel& vessel : vessels) {
    for (const Tube& tube : vessel) {
      for (const Eigen::Vector2d& p : tube.line) {
        points.push_back(middle + turn * (p - middle) + move);
        branch.push_back(tubes);
      }
      ++tubes;
    }
  }
  Eigen::Matrix2Xd px(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) px.col(static_cast<Eigen::Index>(i)) = points[i];
  return makeCenterline(px, branch);
}

class ExpectedVessels : public testing::Test {
 protected:
  const cv::Mat image_ = test::render(sceneOf({kStrong, kFaint}));
  std::unique_ptr<CenterlineExtractor> extractor_ = makeExtractor(RidgeSettings{});
};

// Where the image has it, not where it was expected, which is 4 px away.
TEST_F(ExpectedVessels, AFaintVesselIsFoundWhereItIsExpected) {
  const Scene faint = sceneOf({kFaint});
  ASSERT_LT(test::coverage(faint, extractor_->extract(image_), 3), 0.2);
  const Centerline2d found = extractor_->extract(image_, expected({kStrong, kFaint}));
  EXPECT_GT(test::coverage(faint, found, 1.5), 0.8);
  EXPECT_GT(test::precision(sceneOf({kStrong, kFaint}), found, 1.5), 0.95);
}

TEST_F(ExpectedVessels, NothingIsFoundWhereTheImageShowsNothing) {
  const Centerline2d found = extractor_->extract(image_, expected({kStrong, kFaint, kEmpty}));
  EXPECT_LT(test::coverage(sceneOf({kEmpty}), found, 3), 0.1);
}

// The belief is wrong, or of another tree: what the image shows is found as before, and nothing else.
TEST_F(ExpectedVessels, AWrongExpectationAddsNothing) {
  const Centerline2d found = extractor_->extract(image_, expected({kEmpty}));
  EXPECT_EQ(found.points_px, extractor_->extract(image_).points_px);
}

TEST_F(ExpectedVessels, WithoutAnyItIsAsWithout) {
  const Eigen::Matrix2Xd points = extractor_->extract(image_).points_px;
  EXPECT_EQ(extractor_->extract(image_, Centerline2d()).points_px, points);
  const auto otsu = makeExtractor(OtsuSettings{});
  EXPECT_EQ(otsu->extract(image_, expected({kStrong})).points_px, otsu->extract(image_).points_px);
}

}  // namespace
}  // namespace angio::test
