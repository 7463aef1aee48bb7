// SPDX-License-Identifier: GPL-2.0-or-later
#include "local_offset_estimator.hpp"

#include <gtest/gtest.h>

#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "latency_compensator.hpp"

namespace angio::test {
namespace {

class LocalShifts : public testing::Test {
 protected:
  const VesselTree tree_ = test::branchingTree(6);
  const XrayCamera camera_ = test::clinicalCamera();
  test::Random random_{4};
  const Pose T_ = test::viewOf(tree_, random_);
  const Eigen::Vector3d target_ = tree_.points().col(39);  // The first bifurcation: vessels run several ways.
  const double px_per_m_ = camera_.parameters().fx_px / (T_ * target_).z();
};

TEST_F(LocalShifts, FindWhereTheImageShowsThePlace) {
  const LocalOffsetEstimator near(tree_, {target_, 15e-3, 2e-3});
  for (int k = 0; k < 10; ++k) {
    const Eigen::Vector2d shift_px = 5 * Eigen::Vector2d(random_.normal(), random_.normal());
    Centerline2d seen = projectedCenterline(tree_, camera_, T_);
    seen.points_px.colwise() += shift_px;
    const auto found = near.observe(seen, camera_, T_);
    ASSERT_TRUE(found);
    // The prior of 2 mm pulls by some percent of 5 px. What is less than 1.5 px may be the image's error.
    EXPECT_LT((found->shift_px - shift_px).norm(), shift_px.norm() < 1.5 ? 1.5 : 1) << shift_px.transpose();
    EXPECT_TRUE(shift_px.norm() <= 3 || found->probability > 0.99) << found->probability;
    EXPECT_LT((found->probability * found->seen_px - found->shift_px).norm(), 1e-9);
    const Eigen::Vector2d error = found->shift_px - shift_px;
    EXPECT_LT(error.dot(found->covariance_px.inverse() * error), 9.2) << "99 % of two numbers";
  }
}

// Of the place's vessels most are seen, unsurely, where they are, and beside the others there is something sure.
TEST_F(LocalShifts, AreNotDrawnToANeighbour) {
  const LocalOffsetEstimator near(tree_, {target_, 15e-3, 2e-3});
  const Centerline2d all = projectedCenterline(tree_, camera_, T_);
  // Along the vessel that the place is on, nothing would tell the two apart.
  for (const double across_deg : {60.0, 90.0, 120.0, 240.0, 270.0, 300.0}) {
    const double angle_rad = all.tangent_rad[39] + degToRad(across_deg);
    const Eigen::Vector2d aside = 2.5e-3 * px_per_m_ * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
    Centerline2d seen = all;
    seen.std_px = Eigen::VectorXd::Constant(all.size(), 2);
    for (int i = 0; i < all.size(); ++i) {
      if (i / 4 % 4 != 0) continue;
      seen.points_px.col(i) += aside;
      seen.std_px[i] = 0.2;
    }
    const auto found = near.observe(seen, camera_, T_);
    ASSERT_TRUE(found);
    EXPECT_LT(found->shift_px.norm(), 0.3 * aside.norm())
        << aside.transpose() << " gives " << found->shift_px.transpose();
  }
}

TEST_F(LocalShifts, SayNothingAboutADirectionThatIsNotSeen) {
  // One straight vessel across the image, through the target.
  Eigen::Matrix3Xd points(3, 60);
  std::vector<int> parents;
  for (int i = 0; i < 60; ++i) {
    points.col(i) << (i - 30) * 1e-3, 0, 0;
    parents.push_back(i - 1);
  }
  const VesselTree line(points, parents);
  Pose T = Pose::Identity();
  T.translation().z() = 0.75;
  Centerline2d seen = projectedCenterline(line, camera_, T);
  seen.points_px.row(1).array() += 4;
  const auto found = LocalOffsetEstimator(line, {Eigen::Vector3d::Zero(), 15e-3, 2e-3}).observe(seen, camera_, T);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->shift_px.y(), 4, 0.2);
  EXPECT_NEAR(found->shift_px.x(), 0, 0.01);
  const double prior_px = 2e-3 * camera_.parameters().fx_px / 0.75;
  EXPECT_NEAR(std::sqrt(found->covariance_px(0, 0)), prior_px, 0.05 * prior_px);
  EXPECT_LT(std::sqrt(found->covariance_px(1, 1)), 0.2 * prior_px);
}

TEST_F(LocalShifts, NothingNearIsNothing) {
  const LocalOffsetEstimator near(tree_, {target_, 15e-3, 2e-3});
  EXPECT_FALSE(near.observe(Centerline2d{}, camera_, T_));
  Pose behind = T_;
  behind.translation().z() -= 2;
  EXPECT_FALSE(near.observe(projectedCenterline(tree_, camera_, T_), camera_, behind));
  Centerline2d far = projectedCenterline(tree_, camera_, T_);
  far.points_px.row(0).array() += 300;
  EXPECT_FALSE(near.observe(far, camera_, T_));
}

// What a loop expects of commands in transit is what the arm does with them.
TEST(LatencyCompensator, AreWhatTheArmWillHaveDone) {
  const CArmLimits limits = CArmLimits::typical();
  constexpr std::int64_t kPeriod_us = 66'000, kLatency_us = 80'000;
  test::Random random(5);
  SimulatedCArm arm(limits, CArmJoints::Zero(), 0);
  LatencyCompensator in_flight(limits);
  std::deque<std::pair<std::int64_t, CArmCommand>> in_transit;
  const auto advance = [&](std::int64_t until_us) {
    while (!in_transit.empty() && in_transit.front().first <= until_us) {
      arm.obey(in_transit.front().second, in_transit.front().first);
      in_transit.pop_front();
    }
    arm.advance(until_us);
  };
  CArmCommand last;
  for (int k = 0; k < 60; ++k) {
    const std::int64_t frame_us = k * kPeriod_us;
    advance(frame_us);
    TaskInput input{frame_us, test::clinicalCamera(), {}, {}, {}, arm.state()};
    input.last_velocity = last.velocity;
    input.period_s = 1e-6 * kPeriod_us;
    input.latency_s = 1e-6 * kLatency_us;
    const CArmState expected = in_flight.atArrival(input);
    SimulatedCArm copy = arm;
    for (const auto& [at_us, command] : in_transit) {
      if (at_us > frame_us + kLatency_us) break;
      copy.advance(at_us);
      copy.obey(command, at_us);
    }
    copy.advance(frame_us + kLatency_us);
    EXPECT_LT((copy.state().joints - expected.joints).norm(), 1e-9) << k;
    for (int i = 0; i < kCArmJointCount; ++i) last.velocity[i] = 0.02 * random.normal();
    last.time_us = frame_us;
    ++last.sequence;
    last.valid_for_us = 500'000;
    in_transit.emplace_back(frame_us + kLatency_us, last);
  }
}

}  // namespace
}  // namespace angio::test
