// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/centerline2d.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"

namespace angio::test {
namespace {

constexpr double kRadius = 200;  // [px]

// n points once around a circle about (500, 400), without the first point again.
Eigen::Matrix2Xd circle(int n) {
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) {
    const double a = 2 * kPi * i / n;
    points.col(i) << 500 + kRadius * std::cos(a), 400 + kRadius * std::sin(a);
  }
  return points;
}

double tangentError(const Centerline2d& line, int i) {
  const Eigen::Vector2d radial = line.points_px.col(i) - Eigen::Vector2d(500, 400);
  return std::abs(undirected(line.tangent_rad[i] - std::atan2(radial.x(), -radial.y())));
}

TEST(Undirected, BringsAnglesIntoHalfATurn) {
  for (const double a : {-7.0, -1.6, -0.3, 0.0, 1.5, 1.6, 3.0, 9.0}) {
    const double u = undirected(a);
    EXPECT_GE(u, -kPi / 2);
    EXPECT_LT(u, kPi / 2);
    EXPECT_NEAR(std::sin(a - u), 0, 1e-14) << "the same line";
  }
  EXPECT_EQ(undirected(kPi / 2), -kPi / 2);
}

TEST(Centerline2d, TangentsAlongABranchAreThoseOfTheCircle) {
  const int n = 90;
  const Centerline2d line = makeCenterline(circle(n), std::vector<int>(n, 0));
  // A chord between equal steps is exactly parallel to the tangent; at the ends it is half a step off.
  for (int i = 1; i + 1 < n; ++i) EXPECT_LT(tangentError(line, i), 1e-12);
  EXPECT_NEAR(tangentError(line, 0), kPi / n, 1e-12);
  EXPECT_NEAR(tangentError(line, n - 1), kPi / n, 1e-12);
}

TEST(Centerline2d, TangentsDoNotReachIntoTheNextBranch) {
  Eigen::Matrix2Xd points(2, 4);
  points << 0, 10, 10, 10,  //
      0, 0, 5, 15;
  const Centerline2d line = makeCenterline(points, {0, 0, 1, 1});
  EXPECT_NEAR(line.tangent_rad[1], 0, 1e-15);
  EXPECT_NEAR(std::abs(line.tangent_rad[2]), kPi / 2, 1e-15);
}

TEST(Centerline2d, TangentsOfAnUnorderedCloudAreThoseOfTheCircle) {
  const int n = 1256;
  const Eigen::Matrix2Xd ordered = circle(n);
  std::vector<int> order(n);
  for (int i = 0; i < n; ++i) order[i] = (i * 611) % n;  // 611 and 1256 share no factor: each point once.
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) points.col(i) = ordered.col(order[i]);
  const Centerline2d line = makeCenterline(points);
  EXPECT_FALSE(line.ordered());
  // Neighbours lie evenly on both sides, so the main axis is the tangent but for rounding of coordinates near 1e3.
  for (int i = 0; i < n; ++i) EXPECT_LT(tangentError(line, i), 1e-9);
}

TEST(Centerline2d, RefusesWhatDoesNotFit) {
  Eigen::Matrix2Xd points = circle(5);
  EXPECT_THAT(test::refusalOf([&] { makeCenterline(points, {0, 0}); }), testing::HasSubstr("branch"));
  EXPECT_THAT(test::refusalOf([&] { makeCenterline(points, {}, Eigen::VectorXd::Ones(4)); }),
              testing::HasSubstr("radius_px"));
  points(1, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(test::refusalOf([&] { makeCenterline(points); }), testing::HasSubstr("point 3: y_px = nan"));
  EXPECT_EQ(makeCenterline(Eigen::Matrix2Xd(2, 0)).size(), 0);
}

TEST(Densified, KeepsEveryPointAndFillsGapsWithinBranchesOnly) {
  Eigen::Matrix2Xd points(2, 5);
  points << 0, 10, 13, 100, 100,  //
      0, 0, 4, 0, 7;
  Eigen::VectorXd radius(5);
  radius << 1, 2, 3, 4, 5;
  const Centerline2d given = makeCenterline(points, {0, 0, 0, 1, 1}, radius);
  const Centerline2d dense = densified(given, 2);
  ASSERT_EQ(dense.size(), 1 + 5 + 3 + 1 + 4);  // Steps of 10/5, 5/3 and 7/4 px.
  int next = 0;
  for (int i = 0; i < dense.size(); ++i) {
    if (next < given.size() && dense.points_px.col(i) == given.points_px.col(next)) {
      EXPECT_EQ(dense.tangent_rad[i], given.tangent_rad[next]);
      EXPECT_EQ(dense.radius_px[i], given.radius_px[next]);
      ++next;
    }
    if (i > 0 && dense.branch[i] == dense.branch[i - 1]) {
      EXPECT_LE((dense.points_px.col(i) - dense.points_px.col(i - 1)).norm(), 2 + 1e-12);
    }
  }
  EXPECT_EQ(next, given.size()) << "a given point is missing";
  EXPECT_NEAR(dense.radius_px[1], 1.2, 1e-12);
  EXPECT_NEAR(dense.tangent_rad[6], std::atan2(4, 3), 1e-12);
}

TEST(OfKind, KeepsWhatIsKnownOfThePointsOfThatKind) {
  Centerline2d line = makeCenterline(circle(6), {0, 0, 0, 1, 1, 1}, Eigen::VectorXd::LinSpaced(6, 1, 6));
  EXPECT_EQ(ofKind(line, CurveKind::kVessel).size(), 6) << "without kinds all are vessels";
  EXPECT_EQ(ofKind(line, CurveKind::kDevice).size(), 0);
  line.std_px = Eigen::VectorXd::LinSpaced(6, 0.1, 0.6);
  line.kind = {CurveKind::kVessel, CurveKind::kVessel, CurveKind::kVessel,
               CurveKind::kDevice, CurveKind::kDevice, CurveKind::kDevice};
  const Centerline2d device = ofKind(line, CurveKind::kDevice);
  EXPECT_EQ(device.points_px, line.points_px.rightCols(3));
  EXPECT_EQ(device.tangent_rad, line.tangent_rad.tail(3));
  EXPECT_EQ(device.branch, (std::vector<int>{0, 0, 0}));
  EXPECT_EQ(device.radius_px, line.radius_px.tail(3));
  EXPECT_EQ(device.std_px, line.std_px.tail(3));
  EXPECT_EQ(densified(line, 20).std_px.size(), densified(line, 20).size());
}

TEST(VesselsToMatch, LeavesDevicesOutUnlessTheyAreMostOfAll) {
  Centerline2d line = makeCenterline(circle(5), {0, 0, 0, 1, 1});
  EXPECT_EQ(vesselsToMatch(line).size(), 5);
  const auto vessel = CurveKind::kVessel, device = CurveKind::kDevice;
  line.kind = {vessel, vessel, vessel, device, device};
  EXPECT_EQ(vesselsToMatch(line).size(), 3);
  line.kind = {device, device, device, vessel, vessel};
  EXPECT_EQ(vesselsToMatch(line).size(), 5);
}

TEST(PointsWhere, AGapIsNoVessel) {
  const Centerline2d line = makeCenterline(circle(8), {5, 5, 5, 5, 5, 2, 2, 2});
  const Centerline2d kept = pointsWhere(line, {true, true, false, true, true, true, false, false});
  EXPECT_EQ(kept.branch, (std::vector<int>{0, 0, 1, 1, 2}));
  EXPECT_EQ(kept.points_px.col(2), line.points_px.col(3));
}

TEST(Densified, LeavesAloneWhatHasNoOrderAndWhatIsDenseEnough) {
  const Centerline2d cloud = makeCenterline(circle(20));
  EXPECT_EQ(densified(cloud, 1).points_px, cloud.points_px);
  const Centerline2d line = makeCenterline(circle(20), std::vector<int>(20, 0));
  EXPECT_EQ(densified(line, 0).points_px, line.points_px);
  EXPECT_EQ(densified(line, 100).points_px, line.points_px);
}

}  // namespace
}  // namespace angio::test
