// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include "angio/geometry/carm.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

CArmGeometry armWith(double l_arm_deg, bool deviating) {
  CArmGeometry arm;
  arm.l_arm_rad = degToRad(l_arm_deg);
  if (deviating) {
    CArmDeviations& d = arm.deviations;
    d.primary_offset_rad = 0.02;
    d.secondary_offset_rad = -0.01;
    d.axis_skew_rad = 0.01;
    d.axis_gap_m = 0.004;
    d.source_right_m = -0.003;
    d.detector_turn_rad = 0.01;
    d.table(0, 0) = 1.01;
    d.table(2, 1) = 0.02;
    d.flex = CArmFlex::lowOrder();
    d.flex.terms[0].twist << 1e-3, 0, 1e-3, 0.004, 0, 0.002;
  }
  return arm;
}

CArmJoints jointsWithin(test::Random& random, const CArmLimits& limits) {
  return CArmJoints::NullaryExpr([&](Eigen::Index i) { return random.uniform(limits.lower[i], limits.upper[i]); });
}

// What a camera looks at: its beam in the patient, and the patient's point on the beam at the isocentre's distance.
ViewAngles anglesSeen(const Pose& T_camera_patient) {
  return viewAnglesOf(Eigen::Vector3d(T_camera_patient.linear().row(2).transpose()));
}
Eigen::Vector3d targetSeen(const CArmGeometry& arm, const Pose& T_camera_patient) {
  return T_camera_patient.inverse() * Eigen::Vector3d(0, 0, arm.source_isocenter_distance_m);
}

TEST(CArmKinematics, JointsComeBackFromWhatTheCameraSees) {
  const CArmLimits limits = CArmLimits::typical();
  for (const double l_arm_deg : {0.0, 30.0, -90.0}) {
    for (const bool deviating : {false, true}) {
      const CArmGeometry arm = armWith(l_arm_deg, deviating);
      test::Random random(1);
      for (int i = 0; i < 200; ++i) {
        const CArmJoints joints = jointsWithin(random, limits);
        const Pose T = arm.T_camera_patient(joints);
        // Newton's steps end at the rounding of a metre; cos 60 deg doubles it.
        EXPECT_LT((arm.jointsFor(anglesSeen(T), targetSeen(arm, T)) - joints).norm(), 1e-11) << l_arm_deg << deviating;
        const auto nearest = arm.reachable(anglesSeen(T), targetSeen(arm, T), limits, joints);
        // At the very end of the range rounding may put the joints outside.
        if (nearest) {
          EXPECT_LT((*nearest - joints).norm(), 1e-11);
        }
      }
    }
  }
}

TEST(CArmKinematics, BothFamiliesSeeTheSameOneOfThemUpsideDown) {
  for (const bool deviating : {false, true}) {
    const CArmGeometry arm = armWith(deviating ? 10 : 0, deviating);
    test::Random random(2);
    for (int i = 0; i < 100; ++i) {
      const ViewAngles angles{random.uniform(-3, 3), random.uniform(-1.4, 1.4)};
      const Eigen::Vector3d target = random.vector(0.1);
      const auto all = arm.allJointsFor(angles, target);
      ASSERT_EQ(all.size(), 2u);
      for (const CArmJoints& joints : all) {
        const Pose T = arm.T_camera_patient(joints);
        EXPECT_LT((T.linear().row(2).transpose() - beamDirection(angles)).norm(), 1e-12);
        EXPECT_LT((T * target - Eigen::Vector3d(0, 0, arm.source_isocenter_distance_m)).norm(), 1e-12);
      }
      const Eigen::Vector3d up[2] = {arm.T_camera_patient(all[0]).linear().row(1),
                                     arm.T_camera_patient(all[1]).linear().row(1)};
      EXPECT_LT(up[0].dot(up[1]), -0.9);  // -1 for an ideal arm; a skew of 0.01 rad turns a steep image further.
    }
  }
}

TEST(CArmKinematics, TheNearestJointsWithinRangeAndEnvelopeAreChosen) {
  const CArmGeometry arm;
  CArmLimits limits = CArmLimits::typical();
  const ViewAngles view{degToRad(170), degToRad(20)};
  EXPECT_FALSE(arm.reachable(view, {0, 0, 0}, limits, CArmJoints::Zero())) << "primary ends at 120 deg";
  limits.upper[1] = degToRad(170);
  const auto over_the_head = arm.reachable(view, {0, 0, 0}, limits, CArmJoints::Zero());
  ASSERT_TRUE(over_the_head);
  EXPECT_NEAR(radToDeg((*over_the_head)[0]), -10, 1e-9);
  EXPECT_NEAR(radToDeg((*over_the_head)[1]), 160, 1e-9);
  // An arm that turns all around takes the shorter way.
  limits.upper[0] = degToRad(300);
  limits.lower = -limits.upper;
  CArmJoints near = CArmJoints::Zero();
  near[0] = degToRad(-150);
  EXPECT_NEAR(radToDeg((*arm.reachable(view, {0, 0, 0}, limits, near))[0]), -190, 1e-9);
  CArmJoints normal = CArmJoints::Zero();
  normal[0] = -1;
  limits.envelope.faces.push_back({"wall", normal, degToRad(100)});
  EXPECT_NEAR(radToDeg((*arm.reachable(view, {0, 0, 0}, limits, near))[0]), -10, 1e-9)
      << "neither -190 deg nor the way that is nearest then";
}

TEST(CArmKinematics, AnLArmTurnsBothAxesAboutTheVertical) {
  const CArmGeometry straight, turned = armWith(25, false);
  const Eigen::AngleAxisd turn(degToRad(25), Eigen::Vector3d::UnitY());
  test::Random random(3);
  for (int i = 0; i < 50; ++i) {
    const CArmJoints joints = jointsWithin(random, CArmLimits::typical());
    CArmJoints angles = joints;
    angles.tail<3>().setZero();
    // Where the source is, seen from the patient.
    const Eigen::Vector3d source = straight.T_camera_patient(angles).inverse().translation();
    EXPECT_LT((turned.T_camera_patient(angles).inverse().translation() - turn * source).norm(), 1e-14);
    // The table goes with the patient, not with the arm.
    EXPECT_LT((turned.T_camera_patient(joints).inverse().translation() -
               (turned.T_camera_patient(angles).inverse().translation() - joints.tail<3>()))
                  .norm(),
              1e-14);
  }
  // The base's head end goes left: an arm tilted cranially leans there.
  CArmJoints cranial = CArmJoints::Zero();
  cranial[1] = degToRad(40);
  EXPECT_GT(turned.T_camera_patient(cranial).linear()(2, 0), 0.2);
}

TEST(CArmKinematics, EJeOfAnLArmIsTheCamerasVelocity) {
  test::Random random(4);
  for (const bool deviating : {false, true}) {
    const CArmGeometry arm = armWith(-35, deviating);
    for (int i = 0; i < 20; ++i) {
      const CArmJoints at = jointsWithin(random, CArmLimits::typical());
      const Pose T = arm.T_camera_patient(at);
      const auto motion = [&](const Eigen::VectorXd& joints) -> Eigen::VectorXd {
        return logSE3(T * arm.T_camera_patient(joints).inverse());
      };
      // Third derivatives are below one: a step of 1e-5 is off by 1e-10, rounding by 1e-11.
      EXPECT_LT((arm.eJe(at) - test::centralDifferences(motion, at, 1e-5)).cwiseAbs().maxCoeff(), 1e-9);
      CArmPoseJacobian J;
      EXPECT_TRUE(arm.T_camera_patient(at, &J).isApprox(T, 1e-13));
    }
  }
}

TEST(CArmKinematics, CheckRefusesAnLArmThatIsNoAngle) {
  CArmGeometry arm;
  arm.l_arm_rad = degToRad(181);
  EXPECT_NE(test::refusalOf([&] { arm.check(); }).find("l_arm_deg = 181"), std::string::npos);
}

// Every corner of each face's reasoning, by the geometry it was made from: the detector's front against the table's
// edge.
TEST(CArmEnvelope, NeverLetsTheDetectorTouchTheTable) {
  const CArmLimits limits = CArmLimits::typical();
  const double d = 0.303;
  const CArmEnvelope envelope = CArmEnvelope::typical(d);
  EXPECT_FALSE(envelope.violated(CArmJoints::Zero()));
  test::Random random(5);
  int inside = 0;
  for (int i = 0; i < 20000; ++i) {
    const CArmJoints joints = jointsWithin(random, limits);
    if (envelope.violated(joints)) continue;
    ++inside;
    for (const double side : {1.0, -1.0}) {
      const double towards = std::sin(side * joints[0]) * (0.23 + side * joints[2]) - std::cos(joints[0]) * 0.15;
      EXPECT_LE(towards, d - 0.015);
    }
    EXPECT_LE(0.1 - joints[3] + 0.1 * std::abs(joints[1]), d);
  }
  EXPECT_GT(inside, 5000);
  EXPECT_EQ(envelope.violated(CArmJoints::Constant(std::nan(""))), &envelope.faces.front());
  CArmJoints steep = CArmJoints::Zero();
  steep.head<2>() << degToRad(110), degToRad(50);
  ASSERT_TRUE(envelope.violated(steep));
  EXPECT_EQ(envelope.violated(steep)->name, "arm and patient");
}

}  // namespace
}  // namespace angio::test
