// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/patient_tracker.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

class PatientTrackers : public testing::Test {
 protected:
  CArmJoints anyJoints() {
    CArmJoints q;
    q << random_.uniform(-1.5, 1.5), random_.uniform(-0.8, 0.8), random_.vector(0.05);
    return q;
  }
  // What a registration would say of a patient who lies so, with `noise` about the tree's centroid.
  Pose measured(const Pose& T_dsa_cb, const CArmJoints& q, const Twist& noise = Twist::Zero()) const {
    const Eigen::Translation3d center(centroid_);
    return arm_.T_camera_patient(q) * T_dsa_cb * center * expSE3(noise) * center.inverse();
  }
  void update(const Pose& seen, const CArmJoints& q) { tracker_.update(seen, {0, arm_.T_camera_patient(q)}, {}); }
  // Of the point that matters, and of the rotation.
  static double errorMm(const Pose& a, const Pose& b, const Eigen::Vector3d& p) { return 1e3 * (a * p - b * p).norm(); }
  static double errorDeg(const Pose& a, const Pose& b) {
    return radToDeg(rotationAngle(a.linear() * b.linear().transpose()));
  }

  test::Random random_{9};
  CArmGeometry arm_;
  PatientTrackerSettings settings_;
  Eigen::Vector3d centroid_{0.05, -0.08, 0.03};
  Pose calibrated_ = expSE3(random_.twist(0.05, 0.3));
  Pose truth_ = calibrated_ * expSE3(random_.twist(0.01, 0.05));
  PatientTracker tracker_{settings_, arm_, calibrated_, centroid_};
};

// Frames of a deformed tree see its depth badly, each fits it about what is tracked, and all are drawn the same way:
// here by 3 % of the way to 50 mm off. The calibration holds what no frame knows, and only along the beam.
TEST_F(PatientTrackers, DoNotWanderAlongTheBeamByWhatFramesShare) {
  const CArmJoints q = anyJoints();
  const Pose T_camera_patient = arm_.T_camera_patient(q);
  const auto offAfter = [&](bool follow_motion, double shared_std_m) {
    PatientTrackerSettings settings;
    settings.follow_motion = follow_motion;
    PatientTracker tracker(settings, arm_, calibrated_, centroid_);
    const Eigen::Vector3d calibrated = T_camera_patient * (calibrated_ * centroid_);
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (int k = 0; k < 300; ++k) {
      const CameraPlace place{k * 66'667, T_camera_patient};
      Pose seen = tracker.predict(place).T_camera_model;
      off = seen * centroid_ - calibrated;
      seen.pretranslate(Eigen::Vector3d(0.5 * (4e-3 - off.x()), 0, 0.03 * (0.05 - off.z())));
      tracker.update(seen, place, {}, shared_std_m * shared_std_m);
    }
    return Eigen::Vector3d(1e3 * off);
  };
  for (const bool follow_motion : {false, true}) {
    EXPECT_GT(offAfter(follow_motion, 0).z(), 25) << "nothing is shared: each frame says something new";
    const Eigen::Vector3d held = offAfter(follow_motion, 7e-3);
    EXPECT_LT(std::abs(held.z()), 6) << "the calibration's standard deviation";
    EXPECT_NEAR(held.x(), 4, 0.3) << "what frames do see is followed";
    // A rigid tree's depth, known to half a millimetre, hardly notices.
    EXPECT_GT(offAfter(follow_motion, 0.5e-3).z(), 0.75 * offAfter(follow_motion, 0).z());
  }
}

TEST_F(PatientTrackers, BelieveTheCalibrationFirst) {
  const CArmJoints q = anyJoints();
  const PosePrior prior = tracker_.predict(q);
  EXPECT_FALSE(tracker_.tracking());
  EXPECT_TRUE(prior.T_camera_model.isApprox(arm_.T_camera_patient(q) * calibrated_, 1e-12));
  ASSERT_TRUE(prior.covariance);
  const double rotation_std = degToRad(settings_.calibration_rotation_std_deg);
  EXPECT_DOUBLE_EQ((*prior.covariance)(0, 0), std::pow(settings_.calibration_translation_std_mm * 1e-3, 2));
  EXPECT_DOUBLE_EQ((*prior.covariance)(5, 5), rotation_std * rotation_std);
}

TEST_F(PatientTrackers, OnePerfectFrameSaysHowThePatientLies) {
  const CArmJoints q = anyJoints();
  update(measured(truth_, q), q);
  EXPECT_TRUE(tracker_.tracking());
  for (int i = 0; i < 10; ++i) {
    const CArmJoints other = anyJoints();
    EXPECT_TRUE(tracker_.predict(other).T_camera_model.isApprox(measured(truth_, other), 1e-9));
  }
  EXPECT_LT((*tracker_.predict(q).covariance)(0, 0), std::pow(settings_.calibration_translation_std_mm * 1e-3, 2));
}

// A mean that forgets with gain g has 1 / (2/g - 1) of the variance: with g = 1/8 a standard deviation of 0.26.
TEST_F(PatientTrackers, AverageNoiseAway) {
  double single_mm = 0, tracked_mm = 0, single_deg = 0, tracked_deg = 0;
  for (int k = 0; k < 300; ++k) {
    const CArmJoints q = anyJoints();
    const Pose seen = measured(truth_, q, random_.twist(1e-3, degToRad(0.3)));
    update(seen, q);
    if (k < 30) continue;
    const Pose single = arm_.T_camera_patient(q).inverse() * seen;
    single_mm += errorMm(single, truth_, centroid_);
    single_deg += errorDeg(single, truth_);
    tracked_mm += errorMm(tracker_.T_dsa_cb(), truth_, centroid_);
    tracked_deg += errorDeg(tracker_.T_dsa_cb(), truth_);
  }
  // The mean over 270 frames of which every 15 are alike is itself off by some 20 %.
  EXPECT_NEAR(tracked_mm / single_mm, 0.26, 0.08);
  EXPECT_NEAR(tracked_deg / single_deg, 0.26, 0.08);
}

TEST_F(PatientTrackers, AreFastAtFirstAndForgetLater) {
  const CArmJoints q = anyJoints();
  for (int k = 0; k < 20; ++k) update(measured(truth_, q), q);
  Twist step = Twist::Zero();
  step.head<3>() << 2e-3, 0, 0;
  const Eigen::Translation3d center(centroid_);
  const Pose moved = truth_ * center * expSE3(step) * center.inverse();
  for (int k = 0; k < 8; ++k) update(measured(moved, q), q);
  // (1 - 1/8)^8 of 2 mm: a pure shift is averaged exactly.
  EXPECT_NEAR(errorMm(tracker_.T_dsa_cb(), moved, centroid_), 2 * std::pow(7.0 / 8, 8), 1e-6);
}

TEST_F(PatientTrackers, LookWideAgainAfterMissesInARow) {
  const CArmJoints q = anyJoints();
  const double wide = tracker_.predict(q).covariance->trace();
  update(measured(truth_, q), q);
  const double narrow = tracker_.predict(q).covariance->trace();
  EXPECT_LT(narrow, wide);
  for (int k = 1; k < settings_.frames_until_lost; ++k) tracker_.miss();
  update(measured(truth_, q), q);  // One trusted frame and the count begins again.
  for (int k = 1; k < settings_.frames_until_lost; ++k) tracker_.miss();
  EXPECT_TRUE(tracker_.tracking());
  EXPECT_EQ(tracker_.predict(q).covariance->trace(), narrow);
  tracker_.miss();
  EXPECT_FALSE(tracker_.tracking());
  EXPECT_EQ(tracker_.predict(q).covariance->trace(), wide);
  // What it found afterwards replaces what it lost.
  update(measured(calibrated_, q), q);
  EXPECT_TRUE(tracker_.T_dsa_cb().isApprox(calibrated_, 1e-9));
}

TEST_F(PatientTrackers, RefuseSettingsOutOfRange) {
  settings_.frames_until_lost = 0;
  EXPECT_NE(
      test::refusalOf([&] { PatientTracker(settings_, arm_, calibrated_, centroid_); }).find("frames_until_lost = 0"),
      std::string::npos);
}

}  // namespace
}  // namespace angio::test
