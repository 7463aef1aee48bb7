// SPDX-License-Identifier: GPL-2.0-or-later
#include "point_matcher.hpp"

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

Eigen::Matrix2Xd randomPoints(test::Random& random, int n) {
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) points.col(i) << random.uniform(0, 1000), random.uniform(0, 1000);
  return points;
}

TEST(PointMatcher, FindsWhatTryingEveryPointFindsWhateverTheLastSearchLeft) {
  test::Random random(1);
  Eigen::Matrix2Xd points = randomPoints(random, 400);
  points.rightCols(30) = points.leftCols(30);  // Bifurcations stand in a centreline several times.
  const PointMatcher matcher(points);
  for (int q = 0; q < 300; ++q) {
    const Eigen::Vector2d query(random.uniform(-500, 1500), random.uniform(-500, 1500));
    const double expected = (points.colwise() - query).colwise().squaredNorm().minCoeff();
    PointMatcher::Nearby nearby;
    if (q % 3 != 0) nearby.nearest = static_cast<int>(random.uniform(0, 400));
    const auto match = matcher.nearest(query, nearby);
    EXPECT_NEAR(match.distance2_px2, expected, 1e-9 * expected);
    EXPECT_NEAR((points.col(match.index) - query).squaredNorm(), match.distance2_px2, 1e-9 * expected);
  }
}

TEST(PointMatcher, StandsManyPointsInOnePlace) {
  const PointMatcher matcher(Eigen::Matrix2Xd::Constant(2, 500, 7.0));
  PointMatcher::Nearby nearby;
  EXPECT_NEAR(matcher.nearest({10, 11}, nearby).distance2_px2, 25, 1e-12);
}

}  // namespace
}  // namespace angio::test
