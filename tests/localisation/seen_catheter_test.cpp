// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/seen_catheter.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::test {
namespace {

const XrayCamera kCamera = XrayCamera::centered(1024, 1024, 0.00025, 1.0);

// A smooth curve that comes in at the bottom; `from` and `to` in [0, 1].
std::vector<Eigen::Vector2d> curve(double from, double to, int count) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < count; ++i) {
    const double s = from + (to - from) * i / (count - 1);
    points.push_back({400 + 150 * std::sin(2.5 * s), 1015 - 700 * s});
  }
  return points;
}

Centerline2d centerlineOf(const std::vector<std::vector<Eigen::Vector2d>>& pieces,
                          CurveKind kind = CurveKind::kDevice) {
  std::vector<Eigen::Vector2d> all;
  std::vector<int> branch;
  for (std::size_t b = 0; b < pieces.size(); ++b) {
    for (const auto& p : pieces[b]) all.push_back(p), branch.push_back(static_cast<int>(b));
  }
  Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(all.size()));
  for (std::size_t i = 0; i < all.size(); ++i) points.col(static_cast<Eigen::Index>(i)) = all[i];
  Centerline2d result = makeCenterline(points, branch);
  result.kind.assign(all.size(), kind);
  return result;
}

TEST(SeenCatheter, JoinsBrokenPiecesInWhateverOrderAndDirection) {
  // The middle runs backwards and comes first; gaps of about 35 px.
  const Centerline2d seen = centerlineOf({curve(0.65, 0.35, 40), curve(0.7, 1, 40), curve(0, 0.3, 40)});
  const auto catheter = seenCatheter(seen, kCamera);
  ASSERT_TRUE(catheter);
  EXPECT_EQ(catheter->tip_end, TipEnd::kLast);
  ASSERT_EQ(catheter->points_px.cols(), 120);
  EXPECT_LT((catheter->points_px.col(0) - curve(0, 1, 2).front()).norm(), 1e-9);
  EXPECT_LT((catheter->points_px.col(119) - curve(0, 1, 2).back()).norm(), 1e-9);
  for (int i = 1; i < 120; ++i) EXPECT_LT(catheter->points_px(1, i), catheter->points_px(1, i - 1));  // Steadily up.
}

TEST(SeenCatheter, LeavesFalseBitsOut) {
  // A clip beside the catheter, a speck before its tip, and a wire across it, shorter than it is.
  const std::vector<Eigen::Vector2d> clip = {{800, 300}, {805, 320}, {812, 341}};
  const Eigen::Vector2d tip = curve(0, 1, 2).back();
  const std::vector<Eigen::Vector2d> speck = {tip + Eigen::Vector2d(-8, -30), tip + Eigen::Vector2d(-9, -38)};
  const std::vector<Eigen::Vector2d> wire = {{300, 600}, {400, 602}, {520, 604}, {700, 606}};
  const auto catheter = seenCatheter(centerlineOf({clip, curve(0, 1, 90), speck, wire}), kCamera);
  ASSERT_TRUE(catheter);
  EXPECT_EQ(catheter->points_px.cols(), 90);
  EXPECT_LT((catheter->points_px.rightCols(1) - tip).norm(), 1e-9);
}

TEST(SeenCatheter, IsSilentWithoutADevice) {
  EXPECT_FALSE(seenCatheter(centerlineOf({curve(0, 1, 50)}, CurveKind::kVessel), kCamera));
  EXPECT_FALSE(seenCatheter(centerlineOf({curve(0.5, 0.52, 5)}), kCamera));
  EXPECT_FALSE(seenCatheter(Centerline2d{}, kCamera));
  SeenCatheterSettings settings;
  settings.std_px = -1;
  EXPECT_THROW(seenCatheter(Centerline2d{}, kCamera, settings), InputError);
}

TEST(SeenCatheter, AsksTheHintWhereTheBorderDoesNotTell) {
  const Centerline2d seen = centerlineOf({curve(0.9, 0.2, 60)});
  const auto unknown = seenCatheter(seen, kCamera);
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->tip_end, TipEnd::kUnknown);
  const auto hinted = seenCatheter(seen, kCamera, {}, CatheterHint{curve(0, 1, 11)[9]});
  ASSERT_TRUE(hinted);
  EXPECT_EQ(hinted->tip_end, TipEnd::kLast);
  EXPECT_LT((hinted->points_px.rightCols(1) - curve(0.9, 0.2, 60).front()).norm(), 1e-9);
}

TEST(SeenCatheter, TakesTheExtractorsUncertainty) {
  Centerline2d seen = centerlineOf({curve(0, 1, 50)});
  seen.std_px = Eigen::VectorXd::Constant(50, 0.4);
  EXPECT_DOUBLE_EQ(seenCatheter(seen, kCamera)->std_px, 0.4);
}

}  // namespace
}  // namespace angio::test
