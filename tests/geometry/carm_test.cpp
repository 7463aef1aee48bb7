// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <array>

#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
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

// What xray_frame_t.lcm and the own robot's checklist say of the image.
TEST(CArm, ImagesAreAsSeenFromTheSource) {
  const CArmGeometry carm;
  const auto seen = [&](double primary_deg, const Eigen::Vector3d& place) {
    CArmJoints joints = CArmJoints::Zero();
    joints[0] = degToRad(primary_deg);
    const auto from_middle = carm.camera().project(carm.T_camera_patient(joints) * (0.05 * place));
    const XrayCamera::Parameters k = carm.camera().parameters();
    return Eigen::Vector2d(*from_middle - Eigen::Vector2d(k.cx_px, k.cy_px));
  };
  EXPECT_LT(seen(0, kLeft).x(), -100) << "the patient's left on the image's left";
  EXPECT_LT(seen(0, kHead).y(), -100) << "the head up";
  EXPECT_GT(seen(90, -kPosterior).x(), 100) << "LAO 90: the front on the right";
  EXPECT_LT(seen(90, kHead).y(), -100);
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

TEST(CArm, JointsForATargetPutItAtTheIsocenter) {
  test::Random random(4);
  CArmGeometry geometry;
  geometry.source_isocenter_distance_m = 0.77;
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
  EXPECT_LT((moved - Eigen::Vector3d(0, -0.05, geometry.source_isocenter_distance_m)).norm(), 1e-15);
}

TEST(CArm, CheckNamesTheBadLength) {
  CArmGeometry geometry;
  EXPECT_NO_THROW(geometry.check());
  geometry.source_detector_distance_m = 0.7;
  EXPECT_EQ(test::refusalOf([&] { geometry.check(); }),
            "c-arm: source_detector_distance_mm = 700: must exceed source_isocentre_distance_mm");
  geometry = CArmGeometry();
  geometry.source_isocenter_distance_m = -0.8;
  EXPECT_THAT(test::refusalOf([&] { geometry.check(); }), testing::HasSubstr("source_isocentre_distance_mm = -800"));
  geometry = CArmGeometry();
  geometry.pixel_spacing_m = 0;
  EXPECT_THAT(test::refusalOf([&] { geometry.check(); }), testing::HasSubstr("pixel_spacing_mm"));
}

IsocenterAngles randomIsocenterAngles(test::Random& random) {
  const ViewAngles beam = randomAngles(random);
  return {beam.primary_rad, beam.secondary_rad, random.uniform(-degToRad(170), degToRad(170))};
}

constexpr PatientPosition kPositions[] = {
    PatientPosition::kHeadFirstSupine,        PatientPosition::kHeadFirstProne,
    PatientPosition::kHeadFirstDecubitusLeft, PatientPosition::kHeadFirstDecubitusRight,
    PatientPosition::kFeetFirstSupine,        PatientPosition::kFeetFirstProne,
    PatientPosition::kFeetFirstDecubitusLeft, PatientPosition::kFeetFirstDecubitusRight};

// The matrices as DICOM writes them (PS3.17 Z.2-3 to Z.2-5), which no line of the code does.
TEST(IsocenterAngles, DetectorRotationIsThatOfTheStandard) {
  test::Random random(5);
  for (int i = 0; i < 100; ++i) {
    const IsocenterAngles a = randomIsocenterAngles(random);
    const double c1 = std::cos(a.primary_rad), s1 = std::sin(a.primary_rad), c2 = std::cos(a.secondary_rad),
                 s2 = std::sin(a.secondary_rad), c3 = std::cos(a.detector_rotation_rad),
                 s3 = std::sin(a.detector_rotation_rad);
    Eigen::Matrix3d R1, R2, R3, camera_positioner;
    R1 << c1, s1, 0, -s1, c1, 0, 0, 0, 1;
    R2 << 1, 0, 0, 0, c2, -s2, 0, s2, c2;
    R3 << c3, 0, -s3, 0, 1, 0, s3, 0, c3;
    // The positioner's x is right as seen from the detector, y is to the source, z is up.
    camera_positioner << -1, 0, 0, 0, 0, -1, 0, -1, 0;
    EXPECT_LT((detectorRotation(a) - camera_positioner * R3 * R2 * R1).norm(), 1e-14);
  }
}

TEST(IsocenterAngles, BothConventionsAreOneForAPatientHeadFirstSupineOnALevelTable) {
  test::Random random(6);
  const Eigen::Matrix3d R = patientRotation(PatientPosition::kHeadFirstSupine);
  EXPECT_LT((R - Eigen::Matrix3d::Identity()).norm(), 1e-15);
  for (int i = 0; i < 100; ++i) {
    const ViewAngles angles = randomAngles(random);
    const IsocenterAngles same = isocenterAnglesOf(angles, R);
    EXPECT_NEAR(same.primary_rad, angles.primary_rad, 1e-12);
    EXPECT_NEAR(same.secondary_rad, angles.secondary_rad, 1e-12);
    EXPECT_NEAR(same.detector_rotation_rad, 0, 1e-12);
    EXPECT_LT((detectorRotation(same) - viewRotation(angles)).norm(), 1e-12);
  }
}

TEST(IsocenterAngles, PositionsPutLeftPosteriorAndHeadWhereTheyLie) {
  // Of the table: x is left, y down, z its head. Which side of the patient is down, and where the head is.
  const std::array<Eigen::Vector3d, 8> down = {kPosterior, -kPosterior, kLeft, -kLeft,
                                               kPosterior, -kPosterior, kLeft, -kLeft};
  for (std::size_t i = 0; i < down.size(); ++i) {
    const Eigen::Matrix3d R = patientRotation(kPositions[i]);
    EXPECT_LT(rotationDefect(R), 1e-15) << i;
    EXPECT_LT((R * down[i] - Eigen::Vector3d::UnitY()).norm(), 1e-15) << i;
    EXPECT_LT((R * kHead - (i < 4 ? 1 : -1) * Eigen::Vector3d::UnitZ()).norm(), 1e-15) << i;
  }
}

TEST(IsocenterAngles, TableAnglesTurnWhatTheStandardSays) {
  const auto turned = [](const TableAngles& table) {
    return patientRotation(PatientPosition::kHeadFirstSupine, table);
  };
  EXPECT_GT((turned({0.1, 0, 0}) * kHead).x(), 0) << "the table's head goes towards X";
  EXPECT_LT((turned({0, 0.1, 0}) * kHead).y(), 0) << "the head goes up";
  EXPECT_LT((turned({0, 0, 0.1}) * kLeft).y(), 0) << "the left goes up";
  // In this order: the table's head stands in the same direction whatever the cradle does.
  EXPECT_LT((turned({0.4, 0.2, 0.3}) * kHead - turned({0.4, 0.2, 0}) * kHead).norm(), 1e-15);
  EXPECT_NEAR((turned({0.4, 0.2, 0.3}) * kHead).y(), -std::sin(0.2), 1e-15);
}

TEST(IsocenterAngles, ThereAndBackIsTheSameBeamWithTheHeadUp) {
  test::Random random(7);
  for (const PatientPosition position : kPositions) {
    const TableAngles table{random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)};
    const Eigen::Matrix3d R = patientRotation(position, table);
    for (int i = 0; i < 20; ++i) {
      const ViewAngles angles = randomAngles(random);
      const IsocenterAngles isocenter = isocenterAnglesOf(angles, R);
      EXPECT_LT((detectorRotation(isocenter) * R - viewRotation(angles)).norm(), 1e-12);
      const ViewAngles back = viewAnglesOf(isocenter, R);
      EXPECT_NEAR(back.primary_rad, angles.primary_rad, 1e-11);  // cos 85 deg twice.
      EXPECT_NEAR(back.secondary_rad, angles.secondary_rad, 1e-11);
    }
  }
}

// By hand: feet first supine turns the patient about the vertical by 180 deg, so the arm that is over the table's left
// and head is over the patient's right and feet; the picture is upside down unless the detector turns by 180 deg.
TEST(IsocenterAngles, AWorkedExampleFeetFirst) {
  const Eigen::Matrix3d R = patientRotation(PatientPosition::kFeetFirstSupine);
  const ViewAngles seen = viewAnglesOf({degToRad(30), degToRad(20), 0}, R);
  EXPECT_NEAR(radToDeg(seen.primary_rad), -30, 1e-12);
  EXPECT_NEAR(radToDeg(seen.secondary_rad), -20, 1e-12);
  const IsocenterAngles upright = isocenterAnglesOf(seen, R);
  EXPECT_NEAR(radToDeg(upright.primary_rad), 30, 1e-12);
  EXPECT_NEAR(radToDeg(upright.secondary_rad), 20, 1e-12);
  EXPECT_NEAR(std::abs(radToDeg(upright.detector_rotation_rad)), 180, 1e-12);
}

}  // namespace
}  // namespace angio::test
