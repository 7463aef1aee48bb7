// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/resolved_tree.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

constexpr std::int64_t kEnd_us = 5'000'000;
constexpr double kContradicts = 25;

// A line of vessel 0.8 m from a camera that turned about the patient's y; the turn knows it to 1 mm everywhere.
class TreeOfATurn : public testing::Test {
 protected:
  static VesselTree line() {
    Eigen::Matrix3Xd points(3, 21);
    for (int i = 0; i < 21; ++i) points.col(i) = Eigen::Vector3d(0, 0.005 * (i - 10), 0);
    std::vector<int> parents(21);
    for (int i = 0; i < 21; ++i) parents[static_cast<std::size_t>(i)] = i - 1;
    return VesselTree(points, parents);
  }

  static Matrix6d covariance(double across_m, double along_m) {
    Vector6d variances = Vector6d::Zero();
    variances << across_m * across_m, across_m * across_m, along_m * along_m, 0, 0, 0;
    return variances.asDiagonal();
  }

  static Pose camera(double turned_rad) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::AngleAxisd(turned_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T.translation() = Eigen::Vector3d(0, 0, 0.8);
    return T;
  }

  TreeOfATurn() {
    DepthFromMotion fit;
    fit.registration.T_camera_model = camera(0);
    fit.registration.covariance = covariance(1e-3, 1e-3);
    fit.axis = Eigen::Vector3d::UnitY();
    tree_ = std::make_shared<ResolvedTree>(line(), fit, camera(0), kEnd_us);
  }

  // A frame's own fit of a patient who has moved: right across the beam, and wrong along it.
  static RegistrationResult frame(double turned_rad, const Eigen::Vector3d& moved_m, double depth_off_m) {
    RegistrationResult seen;
    seen.T_camera_model = camera(turned_rad) * Eigen::Translation3d(moved_m);
    seen.T_camera_model.pretranslate(depth_off_m * (seen.T_camera_model * target_).normalized());
    seen.covariance = covariance(0.2e-3, 8e-3);
    return seen;
  }

  ResolvedTree::Place place(double turned_rad, const Eigen::Vector3d& moved_m, double depth_off_m,
                            std::int64_t time_us = kEnd_us) const {
    return tree_->at(target_, frame(turned_rad, moved_m, depth_off_m), camera(turned_rad), time_us);
  }

  inline static const Eigen::Vector3d target_{0.004, 0.01, 0};
  std::shared_ptr<const ResolvedTree> tree_;
};

TEST_F(TreeOfATurn, IsWhereItWasAlongTheBeam) {
  for (const double turned_rad : {0.0, 0.3, 0.7}) {
    const auto p = place(turned_rad, Eigen::Vector3d::Zero(), 12e-3);
    EXPECT_LE((p.camera - camera(turned_rad) * target_).norm(), 0.05e-3) << turned_rad;
    EXPECT_NEAR(std::sqrt(p.covariance_m2(2, 2)), 1.05e-3, 0.05e-3) << turned_rad;
    EXPECT_LE(std::sqrt(p.covariance_m2(0, 0)), 0.25e-3) << turned_rad;
    EXPECT_LE(p.mismatch, 0.1) << turned_rad;
  }
}

// The way of a breath, which only the frame knows; what it may have meant for the depth is added.
TEST_F(TreeOfATurn, FollowsTheFrameAlongTheAxisOfTheTurn) {
  const Eigen::Vector3d moved_m(0, 9e-3, 0);
  const auto p = place(0.4, moved_m, -10e-3);
  EXPECT_LE((p.camera - camera(0.4) * (target_ + moved_m)).norm(), 0.4e-3);
  EXPECT_NEAR(std::sqrt(p.covariance_m2(2, 2)), std::hypot(1e-3, 3e-3), 0.3e-3);
  EXPECT_LE(p.mismatch, 1);
}

TEST_F(TreeOfATurn, IsContradictedByAPatientWhoHasMovedOtherwise) {
  EXPECT_GT(place(0, {8e-3, 0, 0}, 0).mismatch, kContradicts);
  EXPECT_LT(place(0, {1e-3, 0, 0}, 0).mismatch, kContradicts);
  // What the frame at the turn's end could not see, another view does.
  EXPECT_LT(place(0, {0, 0, 15e-3}, 0).mismatch, kContradicts);
  EXPECT_GT(place(0.6, {0, 0, 15e-3}, 0).mismatch, kContradicts);
}

TEST_F(TreeOfATurn, IsKnownLessAsTimePasses) {
  const std::int64_t later_us = kEnd_us + 120'000'000;
  EXPECT_GT(place(0, Eigen::Vector3d::Zero(), 0, later_us).covariance_m2(2, 2),
            place(0, Eigen::Vector3d::Zero(), 0).covariance_m2(2, 2) + 1.5e-6);
  EXPECT_FALSE(tree_->outdated(later_us));
  EXPECT_TRUE(tree_->outdated(kEnd_us + 200'000'000));
  EXPECT_TRUE(tree_->outdated(kEnd_us - 200'000'000));  // Another clock.
}

// One view of a deformed tree shows how it is turned about the beam, and hardly about the axes across it.
TEST_F(TreeOfATurn, IsTurnedAsTheTurnToldAndAsTheFrameShowsAboutTheBeam) {
  const double roll_rad = 0.02, tilt_rad = 0.05;
  for (const double turned_rad : {0.0, 0.5}) {
    RegistrationResult seen = frame(turned_rad, Eigen::Vector3d::Zero(), 9e-3);
    const Eigen::Vector3d at = seen.T_camera_model * target_, ray = at.normalized();
    const Eigen::Matrix3d rolled = expSO3(roll_rad * ray) * seen.T_camera_model.linear();
    seen.T_camera_model.linear() = expSO3(tilt_rad * ray.unitOrthogonal()) * rolled;
    seen.T_camera_model.translation() = at - seen.T_camera_model.linear() * target_;
    const auto p = tree_->at(target_, seen, camera(turned_rad), kEnd_us);
    const PatientObservation patient = tree_->pose(target_, p, seen, camera(turned_rad));
    EXPECT_LE(rotationAngle(patient.T_camera_model.linear() * rolled.transpose()), 2e-3) << turned_rad;
    EXPECT_LE((patient.T_camera_model * target_ - p.camera).norm(), 1e-12);
    // Without `points`, the covariance says the same of the point.
    EXPECT_LE((patient.pointCovariance(target_) - p.covariance_m2).norm(), 1e-15);
  }
}

TEST_F(TreeOfATurn, SaysTheSameByItsPoints) {
  const auto seen = frame(0.3, Eigen::Vector3d::Zero(), 5e-3);
  const ResolvedPoints points(tree_, seen, camera(0.3), kEnd_us, target_);
  const auto p = tree_->at(target_, seen, camera(0.3), kEnd_us);
  EXPECT_EQ(points.placeAt(target_), p.camera);
  EXPECT_EQ(points.covarianceAt(target_), p.covariance_m2);
  const Eigen::Vector3d other(0, -0.02, 0.001);
  EXPECT_EQ(points.placeAt(other), tree_->at(other, seen, camera(0.3), kEnd_us).camera);
}

}  // namespace
}  // namespace angio::test
