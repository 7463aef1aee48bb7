// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm_deviations.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/geometry/carm.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kDegree = kPi / 180;

CArmJoints anyJoints(test::Random& random) {
  CArmJoints joints;
  const double primary = random.uniform(-110, 110), secondary = random.uniform(-55, 55);
  joints << primary * kDegree, secondary * kDegree, random.vector(0.1);
  return joints;
}

// Larger than any real one, so that second orders show.
CArmGeometry crooked(test::Random& random) {
  CArmGeometry carm;
  auto values = carm.poseParameters();
  for (int i = 0; i < kCArmPoseParameters; ++i) {
    const double unit = kCArmPoseParameterNames[static_cast<std::size_t>(i)].unit;
    values[i] += (unit == 1 ? 0.02 : unit == 1e-3 ? 0.008 : 0.03) * random.normal();
  }
  carm.setPoseParameters(values);
  CArmFlex& flex = carm.deviations.flex;
  flex.count = 3;
  for (int i = 0; i < flex.count; ++i) {
    flex.terms[static_cast<std::size_t>(i)] = {random.twist(2e-3, 5e-3), random.uniform(0.5, 2.5),
                                               random.uniform(-2.5, 2.5), random.uniform(-3, 3)};
  }
  return carm;
}

// Turns and shifts one after the other, each as a matrix of its own, as the header's chain says.
Pose byTheChain(const CArmGeometry& carm, const CArmJoints& q) {
  const CArmDeviations& d = carm.deviations;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d R_zero;  // The ideal camera at zero: right is the patient's right, down the feet, the beam anterior.
  R_zero << -1, 0, 0, 0, 0, -1, 0, -1, 0;
  Pose T_iso_camera = Pose::Identity();
  T_iso_camera.rotate(Eigen::AngleAxisd(q[0] + d.primary_offset_rad, z));
  T_iso_camera.translate(d.axis_gap_m * y);
  T_iso_camera.rotate(Eigen::AngleAxisd(d.axis_skew_rad, y));
  T_iso_camera.rotate(Eigen::AngleAxisd(q[1] + d.secondary_offset_rad, -x));
  T_iso_camera.rotate(R_zero.transpose());
  T_iso_camera.translate(Eigen::Vector3d(d.source_right_m, d.source_down_m, -carm.source_isocenter_distance_m));
  T_iso_camera.rotate(Eigen::AngleAxisd(d.detector_turn_rad, y));
  T_iso_camera.rotate(Eigen::AngleAxisd(d.detector_roll_rad, z));
  T_iso_camera = T_iso_camera * expSE3(d.flex.at(q[0], q[1]));
  return T_iso_camera.inverse() * Eigen::Translation3d(d.table * q.tail<3>());
}

TEST(CArmDeviations, TheChainIsTheOneThatIsWrittenDown) {
  test::Random random(11);
  for (int i = 0; i < 50; ++i) {
    const CArmGeometry carm = crooked(random);
    const CArmJoints q = anyJoints(random);
    EXPECT_LT((carm.T_camera_patient(q).matrix() - byTheChain(carm, q).matrix()).cwiseAbs().maxCoeff(), 1e-14);
  }
}

TEST(CArmDeviations, NoneIsTheIdealArm) {
  test::Random random(12);
  const CArmGeometry ideal;
  EXPECT_FALSE(ideal.deviations.movesCamera());
  for (int i = 0; i < 50; ++i) {
    const CArmJoints q = anyJoints(random);
    CArmPoseJacobian J;
    const Pose by_chain = ideal.T_camera_patient(q, &J);  // Which takes no short cut.
    EXPECT_LT((by_chain.matrix() - ideal.T_camera_patient(q).matrix()).cwiseAbs().maxCoeff(), 1e-15);
    CArmGeometry nearly = ideal;
    nearly.deviations.axis_gap_m = 1e-15;
    EXPECT_LT((nearly.eJe(q) - ideal.eJe(q)).cwiseAbs().maxCoeff(), 1e-14);
  }
}

TEST(CArmDeviations, EJeIsTheCamerasVelocityRelativeToThePatient) {
  test::Random random(13);
  for (int i = 0; i < 50; ++i) {
    const CArmGeometry carm = crooked(random);
    const CArmJoints at = anyJoints(random);
    const Pose T = carm.T_camera_patient(at);
    const auto motion = [&](const Eigen::VectorXd& q) -> Eigen::VectorXd {
      return logSE3(T * carm.T_camera_patient(q).inverse());
    };
    // As for the ideal arm: a step of 1e-5 is off by 1e-10, rounding by 1e-11.
    EXPECT_LT((carm.eJe(at) - test::centralDifferences(motion, at, 1e-5)).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(CArmDeviations, ParametersMoveTheCameraAsTheirJacobianSays) {
  test::Random random(14);
  for (int i = 0; i < 50; ++i) {
    const CArmGeometry carm = crooked(random);
    const CArmJoints q = anyJoints(random);
    CArmPoseJacobian J;
    const Pose T = carm.T_camera_patient(q, &J);
    const auto motion = [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
      CArmGeometry other = carm;
      other.setPoseParameters(values);
      return logSE3(T * other.T_camera_patient(q).inverse());
    };
    EXPECT_LT((J - test::centralDifferences(motion, carm.poseParameters(), 1e-5)).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(CArmDeviations, JointsForATargetPutItOnTheBeam) {
  test::Random random(15);
  for (int i = 0; i < 200; ++i) {
    const CArmGeometry carm = crooked(random);
    const ViewAngles angles{random.uniform(-110, 110) * kDegree, random.uniform(-55, 55) * kDegree};
    const Eigen::Vector3d target = random.vector(0.1);
    const Pose T = carm.T_camera_patient(carm.jointsFor(angles, target));
    EXPECT_LT((T * target - Eigen::Vector3d(0, 0, carm.source_isocenter_distance_m)).norm(), 1e-12);
    EXPECT_LT((T.linear().row(2).transpose() - beamDirection(angles)).norm(), 1e-12);
  }
}

TEST(CArmDeviations, TheCameraFollowsTheDistance) {
  CArmGeometry carm;
  carm.deviations.source_detector_offset_m = 2e-3;
  carm.deviations.pixel_aspect = 1e-3;
  carm.deviations.principal_point_px = {5, -3};
  carm.deviations.principal_point_slope_px_per_m = {10, 20};
  const auto near = carm.camera().parameters(), far = carm.camera(carm.source_detector_distance_m + 0.1).parameters();
  EXPECT_NEAR(near.fx_px, 1.115 / carm.pixel_spacing_m, 1e-9);
  EXPECT_NEAR(far.fx_px, 1.215 / carm.pixel_spacing_m, 1e-9);
  EXPECT_NEAR(far.fy_px, far.fx_px * 1.001, 1e-9);
  EXPECT_NEAR(near.cx_px, 511.5 + 5, 1e-9);
  EXPECT_NEAR(far.cx_px, 511.5 + 6, 1e-9);
  EXPECT_NEAR(far.cy_px, 511.5 - 1, 1e-9);
  EXPECT_FALSE(carm.deviations.movesCamera()) << "the image is not the camera's place";
}

TEST(CArmDeviations, CheckNamesWhatIsNoDeviation) {
  const auto refusal = [](const std::function<void(CArmDeviations&)>& spoil) {
    CArmGeometry carm;
    spoil(carm.deviations);
    return test::refusalOf([&] { carm.check(); });
  };
  using testing::HasSubstr;
  EXPECT_THAT(refusal([](auto& d) { d.secondary_offset_rad = 1; }), HasSubstr("deviations.secondary_offset_deg = 57"));
  EXPECT_THAT(refusal([](auto& d) { d.axis_gap_m = std::nan(""); }), HasSubstr("deviations.axis_gap_mm"));
  EXPECT_THAT(refusal([](auto& d) { d.table *= 1000; }), HasSubstr("deviations.table"));
  EXPECT_THAT(refusal([](auto& d) { d.table(1, 0) = 0.1; }), HasSubstr("deviations.table[3] = 0.1"));
  EXPECT_THAT(refusal([](auto& d) {
                d.flex = CArmFlex::lowOrder();
                d.flex.terms[2].twist[4] = 1;
              }),
              HasSubstr("deviations.flex"));
}

}  // namespace
}  // namespace angio::test
