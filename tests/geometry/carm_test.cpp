// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm.hpp"

#include <gmock/gmock.h>

#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio {
namespace {

const Eigen::Vector3d kLeft = Eigen::Vector3d::UnitX(), kPosterior = Eigen::Vector3d::UnitY(),
                      kHead = Eigen::Vector3d::UnitZ();

ViewAngles randomAngles(test::Random& random) {
  return {random.uniform(-degToRad(170), degToRad(170)), random.uniform(-degToRad(85), degToRad(85))};
}

CArmJoints randomJoints(test::Random& random) {
  const ViewAngles angles = randomAngles(random);
  CArmJoints joints;
  joints << angles.primary_rad, angles.secondary_rad, random.vector(0.1);
  return joints;
}

TEST(CArm, BeamDirectionsAreThoseOfDicom) {
  const double quarter = degToRad(90);
  EXPECT_LT((beamDirection({0, 0}) + kPosterior).norm(), 1e-15) << "the detector is above the patient";
  EXPECT_LT((beamDirection({quarter, 0}) - kLeft).norm(), 1e-15) << "LAO is towards the patient's left";
  EXPECT_LT((beamDirection({-quarter, 0}) + kLeft).norm(), 1e-15) << "RAO is towards the patient's right";
  EXPECT_LT((beamDirection({0, quarter}) - kHead).norm(), 1e-15) << "CRA is towards the head";
  const Eigen::Vector3d lao_cra = beamDirection({degToRad(30), degToRad(20)});
  EXPECT_GT(lao_cra.dot(kLeft), 0);
  EXPECT_GT(lao_cra.dot(kHead), 0);
  EXPECT_LT(lao_cra.dot(kPosterior), 0);
}

TEST(CArm, AnglesOfABeamComeBack) {
  test::Random random(1);
  for (int i = 0; i < 200; ++i) {
    const ViewAngles angles = randomAngles(random);
    const ViewAngles back = viewAnglesOf(random.uniform(0.1, 5) * beamDirection(angles));
    EXPECT_NEAR(back.primary_rad, angles.primary_rad, 1e-12);  // cos 85 deg makes ten times the rounding.
    EXPECT_NEAR(back.secondary_rad, angles.secondary_rad, 1e-12);
  }
  EXPECT_EQ(viewAnglesOf(kHead).primary_rad, 0);
  EXPECT_NEAR(viewAnglesOf(kHead).secondary_rad, degToRad(90), 1e-12);
}

TEST(CArm, ViewRotationLooksAlongTheBeamWithTheHeadUp) {
  test::Random random(2);
  for (int i = 0; i < 200; ++i) {
    const ViewAngles angles = randomAngles(random);
    const Eigen::Matrix3d R = viewRotation(angles);
    EXPECT_LT(rotationDefect(R), 1e-14);
    EXPECT_LT((R.row(2).transpose() - beamDirection(angles)).norm(), 1e-15);
    EXPECT_LT((R * kHead).y(), 0) << "image y runs down, so the head is at negative y";
    EXPECT_NEAR((R * kHead).x(), 0, 1e-15);
  }
  // Seen from the source, behind the patient's back: the patient's left is on the image's left.
  EXPECT_LT((viewRotation({0, 0}) * kLeft + Eigen::Vector3d::UnitX()).norm(), 1e-15);
}

TEST(CArm, EJeIsTheCamerasVelocityRelativeToThePatient) {
  test::Random random(3);
  const CArmGeometry geometry;
  for (int i = 0; i < 50; ++i) {
    const CArmJoints at = randomJoints(random);
    const Pose T_camera_patient = geometry.T_camera_patient(at);
    // The camera moves in the patient by T_patient_camera exp(xi), with xi in camera axes.
    const auto motion = [&](const Eigen::VectorXd& joints) -> Eigen::VectorXd {
      return logSE3(T_camera_patient * geometry.T_camera_patient(joints).inverse());
    };
    // Third derivatives are below one: a step of 1e-5 is off by 1e-10, rounding by 1e-11.
    const Eigen::MatrixXd numeric = test::centralDifferences(motion, at, 1e-5);
    EXPECT_LT((geometry.eJe(at) - numeric).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(CArm, JointsForATargetPutItAtTheIsocentre) {
  test::Random random(4);
  CArmGeometry geometry;
  geometry.source_isocentre_distance_m = 0.77;
  for (int i = 0; i < 20; ++i) {
    const ViewAngles angles = randomAngles(random);
    const Eigen::Vector3d target = random.vector(0.1);
    const CArmJoints joints = geometry.jointsFor(angles, target);
    const Pose T = geometry.T_camera_patient(joints);
    EXPECT_LT((T * target - Eigen::Vector3d(0, 0, 0.77)).norm(), 1e-14);
    EXPECT_LT((T.linear() - viewRotation(angles)).norm(), 1e-15);
  }
}

TEST(CArm, MovingTheTableMovesThePatientWithIt) {
  const CArmGeometry geometry;
  CArmJoints joints = CArmJoints::Zero();
  joints[4] = 0.05;  // Headwards: in a frontal view the patient moves up in the image.
  const Eigen::Vector3d moved = geometry.T_camera_patient(joints) * Eigen::Vector3d::Zero();
  EXPECT_LT((moved - Eigen::Vector3d(0, -0.05, geometry.source_isocentre_distance_m)).norm(), 1e-15);
}

TEST(CArm, CheckNamesTheBadLength) {
  CArmGeometry geometry;
  EXPECT_NO_THROW(geometry.check());
  geometry.source_detector_distance_m = 0.7;
  EXPECT_EQ(test::refusalOf([&] { geometry.check(); }),
            "c-arm: source_detector_distance_mm = 700: must exceed source_isocentre_distance_mm");
  geometry = CArmGeometry();
  geometry.source_isocentre_distance_m = -0.8;
  EXPECT_THAT(test::refusalOf([&] { geometry.check(); }), testing::HasSubstr("source_isocentre_distance_mm = -800"));
  geometry = CArmGeometry();
  geometry.pixel_spacing_m = 0;
  EXPECT_THAT(test::refusalOf([&] { geometry.check(); }), testing::HasSubstr("pixel_spacing_mm"));
}

}  // namespace
}  // namespace angio
