// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/pose_error.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr double kRounding_m = 1e-12;  // Of sums over some hundred points of a metre's size.

class PoseErrors : public testing::Test {
 protected:
  VesselTree tree_ = test::branchingTree(3, {0.01, -0.02, 0.03});
  test::Random random_{5};
  Pose truth_ = test::viewOf(tree_, random_);
  XrayCamera camera_ = test::clinicalCamera();

  Pose shifted(const Eigen::Vector3d& by) const { return Eigen::Translation3d(by) * truth_; }
};

TEST_F(PoseErrors, TheTruthHasNone) {
  const PoseError e = poseError(tree_, camera_, {truth_, {}}, {truth_, {}});
  EXPECT_EQ(e.mtre_m, 0);
  EXPECT_EQ(e.mpd_px, 0);
  EXPECT_EQ(e.mpd_isocenter_m, 0);
  EXPECT_EQ(e.centroid_m, 0);
  EXPECT_NEAR(e.rotation_rad, 0, 1e-12);
}

TEST_F(PoseErrors, AShiftAlongTheBeamIsAllDepth) {
  const PoseError e = poseError(tree_, camera_, {shifted({0, 0, 0.007}), {}}, {truth_, {}});
  EXPECT_NEAR(e.mtre_m, 0.007, kRounding_m);
  EXPECT_NEAR(e.depth_m, 0.007, kRounding_m);
  EXPECT_NEAR(e.in_plane_m, 0, kRounding_m);
  EXPECT_NEAR(e.centroid_m, 0.007, kRounding_m);
  EXPECT_NEAR(e.source_m, 0.007, kRounding_m);
  EXPECT_NEAR(e.rotation_rad, 0, 1e-12);
}

// Rays diverge: a tree that is scaled about the source projects where it did, and is off parallel to the image.
TEST_F(PoseErrors, AScaleAboutTheSourceIsNothingAcrossTheBeam) {
  const double scale = 1.01;
  const Eigen::Matrix3Xd seen = truth_ * tree_.points();
  const Eigen::Matrix3Xd nearer = truth_.inverse() * Eigen::Matrix3Xd(scale * seen) - tree_.points();
  const PoseError e = poseError(tree_, camera_, {truth_, nearer}, {truth_, {}});
  EXPECT_NEAR(e.across_beam_m, 0, kRounding_m);
  EXPECT_NEAR(e.in_plane_m, (scale - 1) * seen.topRows<2>().colwise().norm().mean(), kRounding_m);
  EXPECT_NEAR(e.depth_m, (scale - 1) * seen.row(2).mean(), kRounding_m);
}

TEST_F(PoseErrors, AShiftAcrossTheBeamIsSeen) {
  const PoseError e = poseError(tree_, camera_, {shifted({0.003, -0.004, 0}), {}}, {truth_, {}});
  EXPECT_LE(e.across_beam_m, 0.005);
  EXPECT_NEAR(e.across_beam_m, 0.005, 0.005 * 0.01) << "rays are up to 8 deg off the axis";
  EXPECT_NEAR(e.in_plane_m, 0.005, kRounding_m);
  EXPECT_NEAR(e.depth_m, 0, kRounding_m);
  // Nearer points show more of it: the mean of 1/z exceeds 1/mean(z) by var(z)/mean(z)^2, about (0.04/0.75)^2 = 0.3 %
  // here.
  ASSERT_TRUE(e.mpd_isocenter_m);
  EXPECT_NEAR(*e.mpd_isocenter_m, 0.005, 0.005 * 0.005);
  EXPECT_NEAR(*e.mpd_px, 0.005 / 0.75 * camera_.parameters().fx_px, 0.005 * *e.mpd_px);
}

TEST_F(PoseErrors, ATurnAboutTheBeamThroughTheCentroid) {
  const double angle = 0.02;
  const Eigen::Translation3d center(truth_ * tree_.centroid());
  const Pose turned = center * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) * center.inverse() * truth_;
  const PoseError e = poseError(tree_, camera_, {turned, {}}, {truth_, {}});
  const Eigen::Matrix3Xd seen = truth_ * tree_.points();
  const double arm = (seen.topRows<2>().colwise() - center.translation().head<2>()).colwise().norm().mean();
  EXPECT_NEAR(e.rotation_rad, angle, 1e-12);
  EXPECT_NEAR(e.centroid_m, 0, kRounding_m);
  EXPECT_NEAR(e.depth_m, 0, kRounding_m);
  EXPECT_NEAR(e.mtre_m, 2 * std::sin(angle / 2) * arm, kRounding_m);
  // The source goes round the beam through the centroid.
  EXPECT_NEAR(e.source_m, 2 * std::sin(angle / 2) * center.translation().head<2>().norm(), kRounding_m);
}

TEST_F(PoseErrors, DisplacementsAreOfTheModelAndCountWithThePose) {
  const Eigen::Matrix3Xd d = Eigen::Vector3d(0.001, 0.002, -0.002).replicate(1, tree_.size());
  EXPECT_NEAR(poseError(tree_, camera_, {truth_, d}, {truth_, {}}).mtre_m, 0.003, kRounding_m);
  EXPECT_NEAR(poseError(tree_, camera_, {truth_, d}, {truth_, d}).mtre_m, 0, kRounding_m);
  // A pose that makes up for the deformation leaves no point wrong, but the pose stays wrong.
  const Pose makes_up = truth_ * Eigen::Translation3d(-d.col(0));
  const PoseError e = poseError(tree_, camera_, {makes_up, d}, {truth_, {}});
  EXPECT_NEAR(e.mtre_m, 0, kRounding_m);
  EXPECT_NEAR(e.centroid_m, 0.003, kRounding_m);
}

TEST_F(PoseErrors, APoseBehindTheSourceHasNoProjection) {
  const PoseError e = poseError(tree_, camera_, {shifted({0, 0, -1.5}), {}}, {truth_, {}});
  EXPECT_FALSE(e.mpd_px);
  EXPECT_FALSE(e.mpd_isocenter_m);
  EXPECT_NEAR(e.mtre_m, 1.5, kRounding_m);
}

}  // namespace
}  // namespace angio::test
