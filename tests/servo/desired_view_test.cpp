// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/desired_view.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

TEST(DesiredPose, PutsTheTargetAtTheIsocenterAndTheBeamAlongTheAngles) {
  test::Random random(2);
  for (int i = 0; i < 50; ++i) {
    DesiredView view;
    view.angles = {degToRad(random.uniform(-100, 100)), degToRad(random.uniform(-50, 50))};
    view.target_model = random.vector(0.1);
    view.R_lps_model = expSO3(random.vector(1));
    const Pose T = desiredPose(view, 0.8);
    EXPECT_TRUE((T * view.target_model).isApprox(Eigen::Vector3d(0, 0, 0.8), 1e-12));
    const Eigen::Vector3d beam_lps = view.R_lps_model * T.linear().transpose() * Eigen::Vector3d::UnitZ();
    EXPECT_TRUE(beam_lps.isApprox(beamDirection(view.angles), 1e-12));
    const Eigen::Vector3d head = T.linear() * view.R_lps_model.transpose() * Eigen::Vector3d::UnitZ();
    EXPECT_NEAR(head.x(), 0, 1e-12);
    EXPECT_LT(head.y(), 0) << "up in the image is -y";
  }
}

// A patient who lies straight is seen by the arm's own angles.
TEST(DesiredPose, IsWhereTheArmsAnglesLeadWhenThePatientLiesStraight) {
  const CArmGeometry arm;
  const Eigen::Vector3d target(0.02, -0.03, 0.05);
  const ViewAngles angles{degToRad(35), degToRad(-20)};
  const Pose reached = arm.T_camera_patient(arm.jointsFor(angles, target));
  EXPECT_TRUE(reached.isApprox(
      desiredPose({angles, target, Eigen::Matrix3d::Identity()}, arm.source_isocenter_distance_m), 1e-12));
}

class ViewErrors : public testing::Test {
 protected:
  const DesiredView view_{{degToRad(30), degToRad(15)}, {0.01, 0.02, 0.03}, Eigen::Matrix3d::Identity()};
  const Pose desired_ = desiredPose(view_, 0.8);

  ViewError of(const Pose& T) const { return viewError(T, desired_, view_.target_model); }
  // Turned about the target, in camera axes.
  Pose turned(const Eigen::Vector3d& axis, double angle_rad) const {
    const Eigen::Translation3d target(0, 0, 0.8);
    return target * Eigen::AngleAxisd(angle_rad, axis.normalized()) * target.inverse() * desired_;
  }
};

TEST_F(ViewErrors, AreZeroAtTheGoal) {
  const ViewError e = of(desired_);
  EXPECT_EQ(e.direction_rad, 0);
  EXPECT_EQ(e.target_m, 0);
  EXPECT_NEAR(e.roll_rad, 0, 1e-9);  // An angle from a matrix with rounding.
}

TEST_F(ViewErrors, TellTurnsAboutTheBeamFromTurnsAcrossIt) {
  for (const double angle : {1e-4, 0.05, 0.7, 2.5}) {
    const ViewError roll = of(turned({0, 0, 1}, angle));
    EXPECT_NEAR(roll.direction_rad, 0, 1e-12);
    EXPECT_NEAR(roll.roll_rad, angle, 1e-9);
    EXPECT_NEAR(roll.target_m, 0, 1e-12);
    const ViewError tilt = of(turned({0.6, -0.8, 0}, angle));
    EXPECT_NEAR(tilt.direction_rad, angle, 1e-12);
    EXPECT_NEAR(tilt.roll_rad, 0, 1e-7) << "a square root of rounding";
    EXPECT_NEAR(tilt.target_m, 0, 1e-12);
  }
}

TEST_F(ViewErrors, AShiftIsOfTheTargetOnly) {
  const ViewError e = of(Eigen::Translation3d(0.003, 0.004, 0.012) * desired_);
  EXPECT_NEAR(e.target_m, 0.013, 1e-12);
  EXPECT_NEAR(e.direction_rad, 0, 1e-12);
}

}  // namespace
}  // namespace angio::test
