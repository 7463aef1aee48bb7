// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/bucket_grid.hpp"

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

Eigen::Matrix2Xd pointsInGrid(test::Random& random, int n) {
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) {
    const double x = random.uniform(0, 1000), y = random.uniform(0, 1000);
    points.col(i) << x, y;
  }
  return points;
}

void expectExact(const BucketGrid& grid, const Eigen::Matrix2Xd& points, test::Random& random, int queries) {
  ASSERT_EQ(grid.size(), points.cols());
  for (int q = 0; q < queries; ++q) {
    const double x = random.uniform(-600, 1600), y = random.uniform(-600, 1600);
    const Eigen::Vector2d query(x, y);
    const Eigen::RowVectorXd distance2 = (points.colwise() - query).colwise().squaredNorm();
    const auto match = grid.nearest(query);
    // The same product of differences on both sides, but for a fused multiply-add.
    ASSERT_NEAR(match.distance2_px2, distance2.minCoeff(), 1e-9);
    ASSERT_NEAR(distance2[match.index], match.distance2_px2, 1e-9);
  }
}

TEST(BucketGrid, FindsWhatTryingEveryPointFinds) {
  test::Random random(1);
  BucketGrid grid;
  for (const int n : {400, 1, 2, 12, 3000}) {
    const Eigen::Matrix2Xd points = pointsInGrid(random, n);
    grid.build(points);
    expectExact(grid, points, random, 200);
  }
  // Two heaps with nothing between them, and a line: cells are mostly empty, or in one row.
  Eigen::Matrix2Xd heaps = 0.01 * pointsInGrid(random, 500);
  heaps.rightCols(250).array() += 990;
  grid.build(heaps);
  expectExact(grid, heaps, random, 200);
  Eigen::Matrix2Xd line = pointsInGrid(random, 300);
  line.row(1).setConstant(500);
  grid.build(line);
  expectExact(grid, line, random, 200);
}

TEST(BucketGrid, PlacesOnPointsAndOnBordersOfCellsAreNoExceptions) {
  Eigen::Matrix2Xd points(2, 41 * 41);
  for (int i = 0; i < points.cols(); ++i) points.col(i) << 4 * (i % 41), 4 * (i / 41);
  BucketGrid grid;
  grid.build(points);
  for (int i = 0; i < points.cols(); ++i) {
    const auto match = grid.nearest(points.col(i));
    EXPECT_EQ(match.index, i);
    EXPECT_EQ(match.distance2_px2, 0);
    EXPECT_EQ(grid.nearest(points.col(i) + Eigen::Vector2d(2, 2)).distance2_px2, 8);
  }
}

TEST(BucketGrid, OfPointsInOnePlaceTheFirstIsTaken) {
  test::Random random(2);
  Eigen::Matrix2Xd points = pointsInGrid(random, 300);
  points.rightCols(100) = points.leftCols(100);  // Bifurcations stand in a centreline several times.
  BucketGrid grid;
  grid.build(points);
  for (int i = 200; i < 300; ++i) EXPECT_EQ(grid.nearest(points.col(i)).index, i - 200);
  grid.build(Eigen::Matrix2Xd::Constant(2, 500, 7.0));
  EXPECT_EQ(grid.nearest({10, 11}).index, 0);
  EXPECT_NEAR(grid.nearest({10, 11}).distance2_px2, 25, 1e-12);
}

TEST(BucketGrid, NothingIsNearestToNothingAndTheFarthestPlacesEnd) {
  BucketGrid grid;
  EXPECT_EQ(grid.nearest({1, 1}).index, -1);
  grid.build(Eigen::Matrix2Xd(2, 0));
  EXPECT_EQ(grid.nearest({1, 1}).index, -1);
  // As far apart as numbers go: squares overflow, and still it ends, with one of them.
  grid.build((Eigen::Matrix2Xd(2, 2) << -1.5e308, 1.5e308, 0, 0).finished());
  EXPECT_GE(grid.nearest({0, 0}).index, 0);
  EXPECT_GE(grid.nearest({1e308, -1e308}).index, 0);
}

}  // namespace
}  // namespace angio::test
