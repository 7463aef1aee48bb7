// SPDX-License-Identifier: GPL-2.0-or-later
#include "drawn_frames.hpp"

#include <gtest/gtest.h>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr int kSide_px = 512;
constexpr double kPeriod_s = 1.0 / 15;

// How far the target really was from the image's middle, as a distance at the isocentre.
struct Kept {
  Eigen::Vector2d mean_mm = Eigen::Vector2d::Zero();
  double rms_mm = 0;
  int held = 0;
};

// The examples' liver, a point of which the loop keeps in the middle by drawn frames, from 20 and 10 mm beside it. The
// arm obeys at once, so that what is left is what the loop sees wrongly.
class DrawnLiver : public testing::Test {
 protected:
  DrawnLiver() {
    const double side_m = calibration_.carm.pixel_spacing_m * calibration_.carm.image_width_px;
    calibration_.carm.image_width_px = calibration_.carm.image_height_px = kSide_px;
    calibration_.carm.pixel_spacing_m = side_m / kSide_px;
  }

  Kept run(double share_of_tree, double breathing_mm, double duration_s, double from_s) {
    const Eigen::Vector3d target = tree_.points().col(static_cast<Eigen::Index>(share_of_tree * tree_.size()));
    ServoLoopSettings settings;
    settings.carm = calibration_.carm;
    settings.T_dsa_cb = calibration_.T_dsa_cb;
    settings.R_lps_model = calibration_.R_lps_model;
    settings.target_model = target;
    settings.task = CenterTaskSettings{};
    settings.latency_s = 0;
    ServoLoop loop(settings, tree_);
    SimulatedPatientSettings patient_settings;
    patient_settings.motion.breathing.amplitude_mm = breathing_mm;
    patient_settings.motion.breathing.diaphragm_mm = 0;
    const SimulatedPatient patient(tree_, patient_settings, {calibration_.R_lps_model, {}});
    CArmState state;
    state.joints = settings.carm.jointsFor({degToRad(20), degToRad(10)}, calibration_.T_dsa_cb * target);
    state.joints[2] += 20e-3;
    state.joints[4] += 10e-3;
    Kept kept;
    double squares = 0;
    int counted = 0;
    for (std::int64_t k = 0; static_cast<double>(k) * kPeriod_s < duration_s; ++k) {
      const double time_s = static_cast<double>(k) * kPeriod_s;
      state.time_us = std::llround(1e6 * time_s);
      state.sequence = k;
      const Pose T = settings.carm.T_camera_patient(state.joints) * calibration_.T_dsa_cb;
      const Eigen::Vector3d there = T * patient.moved(target, time_s);
      XrayFrame frame{state.time_us, k, {}, settings.carm.camera()};
      const Eigen::Matrix3Xd points = T * patient.scene(T, time_s).pointsOf(tree_);
      frame.image = drawnFrame(tree_, points, frame.camera, static_cast<std::uint64_t>(k), kSide_px);
      const ServoReport report = loop.step(frame, state);
      loop.learn();
      state.velocity = report.command.velocity;
      state.joints += kPeriod_s * state.velocity;
      if (time_s < from_s) continue;
      const Eigen::Vector2d off_mm = 1e3 * settings.carm.source_isocenter_distance_m / there.z() * there.head<2>();
      kept.mean_mm += off_mm;
      squares += off_mm.squaredNorm();
      kept.held += report.hold_reason.has_value();
      ++counted;
    }
    kept.mean_mm /= counted;
    kept.rms_mm = std::sqrt(squares / counted);
    return kept;
  }

  const VesselTree tree_ = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  CArmCalibration calibration_ = readCArmCalibration(exampleData("hepatic-tace/carm.yaml"));
};

// The look around the target must not override a fit that has converged: at the first and the last of these places
// there are vessels beside the target's that a shift of 2 px explains a little better.
TEST_F(DrawnLiver, StaysCentredWithoutBias) {
  for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    const Kept kept = run(share, 0, 4, 2.5);
    EXPECT_EQ(kept.held, 0);
    EXPECT_LE(kept.mean_mm.norm(), 0.1) << "at " << share << ": " << kept.mean_mm.transpose();
    EXPECT_LE(kept.rms_mm, 0.1) << "at " << share;
  }
}

TEST_F(DrawnLiver, IsFollowedWhileItBreathes) {
  for (const double share : {0.1, 0.9}) {
    const Kept kept = run(share, 15, 14, 9);
    EXPECT_EQ(kept.held, 0);
    EXPECT_LE(kept.rms_mm, 0.3) << "at " << share;
  }
}

}  // namespace
}  // namespace angio::test
