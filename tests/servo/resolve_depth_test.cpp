// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <string>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/test/phantoms.hpp"
#include "drawn_frames.hpp"

namespace angio::test {
namespace {

// The examples' liver in a patient whose own is deformed, under an arm that obeys at once.
class DeformedLiver : public testing::Test {
 protected:
  DeformedLiver() {
    const double side_m = calibration_.carm.pixel_spacing_m * calibration_.carm.image_width_px;
    calibration_.carm.image_width_px = calibration_.carm.image_height_px = kSide_px;
    calibration_.carm.pixel_spacing_m = side_m / kSide_px;
    settings_.carm = calibration_.carm;
    settings_.T_dsa_cb = calibration_.T_dsa_cb;
    settings_.R_lps_model = calibration_.R_lps_model;
    settings_.task = ResolveDepthTaskSettings{};
    OrientedKernelSettings deformable;
    deformable.deformation = Deformation::kNonrigid;
    settings_.perception.search = settings_.perception.tracking = deformable;
    settings_.latency_s = 0;
  }

  struct Outcome {
    ServoReport last;
    double max_turn_rad = 0, other_joints = 0;
    double depth_off_m = 0;           // Of the target where it was resolved.
    Eigen::Vector3d target_camera;    // Where it really is at the end ...
    Eigen::AlignedBox3d last_breath;  // ... and in the last 4 s.
    std::optional<ResolvedDepth> resolved;
  };

  Outcome run(double deformation_mm, double breathing_mm, double duration_s, bool until_reached = true) {
    const Eigen::Vector3d target = tree_.centroid();
    ServoLoop loop(settings_, tree_);
    SimulatedPatientSettings patient_settings;
    patient_settings.motion.deformation.rms_mm = deformation_mm;
    patient_settings.motion.breathing.amplitude_mm = breathing_mm;
    const SimulatedPatient patient(tree_, patient_settings, {calibration_.R_lps_model, {}});
    CArmState state;
    state.joints = settings_.carm.jointsFor({degToRad(20), degToRad(10)}, calibration_.T_dsa_cb * target);
    const CArmJoints begin = state.joints;
    Outcome outcome;
    for (std::int64_t k = 0; static_cast<double>(k) * kPeriod_s < duration_s; ++k) {
      const double time_s = static_cast<double>(k) * kPeriod_s;
      state.time_us = std::llround(1e6 * time_s);
      state.sequence = k;
      const Pose T = settings_.carm.T_camera_patient(state.joints) * calibration_.T_dsa_cb;
      XrayFrame frame{state.time_us, k, {}, settings_.carm.camera()};
      const XrayScene scene = patient.scene(T, time_s);
      frame.image =
          drawnFrame(tree_, (T * scene.pointsOf(tree_)).eval(), frame.camera, static_cast<std::uint64_t>(k), kSide_px);
      outcome.last = loop.step(frame, state);
      outcome.target_camera = T * patient.moved(target, time_s);
      if (time_s > duration_s - 4) outcome.last_breath.extend(outcome.target_camera);
      const bool before = loop.resolvedDepth().has_value();
      loop.learn();
      if (loop.resolvedDepth() && !before) {
        outcome.resolved = loop.resolvedDepth();
        outcome.depth_off_m = outcome.resolved->target_camera.z() - (T * patient.moved(target, time_s)).z();
      }
      state.velocity = outcome.last.command.velocity;
      state.joints += kPeriod_s * state.velocity;
      outcome.max_turn_rad = std::max(outcome.max_turn_rad, std::abs(state.joints[0] - begin[0]));
      outcome.other_joints = std::max(outcome.other_joints, (state.joints - begin).tail<4>().norm());
      if (until_reached && outcome.last.task.reached) break;
    }
    return outcome;
  }

  const VesselTree tree_ = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  CArmCalibration calibration_ = readCArmCalibration(exampleData("hepatic-tace/carm.yaml"));
  ServoLoopSettings settings_;
};

TEST_F(DeformedLiver, IsFoundInDepthByATurn) {
  const Outcome outcome = run(3, 0, 8);
  ASSERT_TRUE(outcome.resolved) << outcome.last.hold_reason.value_or("");
  std::printf("depth off by %.2f mm, claimed %.2f mm, turned by %.2f deg\n", 1e3 * outcome.depth_off_m,
              1e3 * outcome.resolved->worstStd_m(), radToDeg(outcome.max_turn_rad));
  EXPECT_TRUE(outcome.last.task.reached) << outcome.last.hold_reason.value_or("");
  EXPECT_LE(std::abs(outcome.depth_off_m), 3e-3);
  EXPECT_LE(std::abs(outcome.depth_off_m), 3 * outcome.resolved->worstStd_m());
  EXPECT_NEAR(radToDeg(outcome.max_turn_rad), 6, 0.15);
  EXPECT_LE(radToDeg(outcome.max_turn_rad), 6.01);
  EXPECT_EQ(outcome.other_joints, 0);
  EXPECT_TRUE(outcome.last.command.velocity.isZero(0));
  // What it cost, and what is known, for the one who asked.
  const std::string said = servoStatus(outcome.last).reason;
  EXPECT_NE(said.find("frames"), std::string::npos) << said;
  EXPECT_NE(said.find("turn of 6.0 deg"), std::string::npos) << said;
}

TEST_F(DeformedLiver, IsFoundInDepthWhileItBreathes) {
  const Outcome outcome = run(3, 12, 8);
  ASSERT_TRUE(outcome.resolved) << outcome.last.hold_reason.value_or("");
  std::printf("breathing: depth off by %.2f mm, claimed %.2f mm\n", 1e3 * outcome.depth_off_m,
              1e3 * outcome.resolved->worstStd_m());
  EXPECT_LE(std::abs(outcome.depth_off_m), 6e-3);
  EXPECT_LE(std::abs(outcome.depth_off_m), 3 * outcome.resolved->worstStd_m());
}

// What no single frame of a deformed tree would allow: a view, with the target at the isocentre's distance.
TEST_F(DeformedLiver, IsViewedByWhatATurnHasTold) {
  ViewTaskSettings view;
  view.primary_deg = 32;
  view.secondary_deg = 14;
  // A deformed tree's direction and place are known to about as much.
  view.reached_deg = 2;
  view.reached_mm = 2;
  settings_.task = view;
  const Outcome without = run(3, 0, 3);
  EXPECT_FALSE(without.last.task.reached);
  EXPECT_EQ(without.max_turn_rad, 0);
  EXPECT_NE(without.last.hold_reason.value_or("").find("resolve_depth turns the arm for it"), std::string::npos);

  settings_.depth_first = ResolveDepthTaskSettings{};
  settings_.depth_first->max_std_mm = 100;  // The gate's bound holds.
  for (const double breathing_mm : {0.0, 6.0}) {
    const Outcome outcome = run(3, breathing_mm, 16);
    const Eigen::Vector3d off_mm =
        1e3 * (outcome.target_camera - Eigen::Vector3d(0, 0, settings_.carm.source_isocenter_distance_m));
    std::printf("breathing %.0f mm: target off by %.2f %.2f %.2f mm, turned %.1f deg, %s\n", breathing_mm, off_mm.x(),
                off_mm.y(), off_mm.z(), radToDeg(outcome.max_turn_rad), outcome.last.hold_reason.value_or("").c_str());
    // Of a patient who breathes the direction is not known so well.
    EXPECT_TRUE(outcome.last.task.reached || breathing_mm > 0) << outcome.last.hold_reason.value_or("");
    EXPECT_LE(off_mm.head<2>().norm(), 2);
    EXPECT_LE(std::abs(off_mm.z()), 3);
  }
}

TEST_F(DeformedLiver, IsHeldByWhatATurnHasTold) {
  settings_.task = HoldTaskSettings{};
  settings_.depth_first = ResolveDepthTaskSettings{};
  const Outcome outcome = run(3, 6, 20, false);
  const Eigen::Vector3d moved_mm = 1e3 * outcome.last_breath.sizes();
  std::printf("the target moves by %.2f %.2f %.2f mm in the camera\n", moved_mm.x(), moved_mm.y(), moved_mm.z());
  EXPECT_TRUE(outcome.last.task.reached) << outcome.last.hold_reason.value_or("");
  EXPECT_LE(moved_mm.norm(), 2);  // Of 6 that the patient breathes, and 8 that one frame has open.
}

TEST_F(DeformedLiver, IsNotResolvedForATaskThatDoesNotAsk) {
  settings_.depth_first = ResolveDepthTaskSettings{};
  settings_.task = CenterTaskSettings{};
  EXPECT_THROW(ServoLoop(settings_, tree_), InputError);
  settings_.task = ViewTaskSettings{};
  settings_.external_registration = true;  // Says nothing of what was matched.
  EXPECT_THROW(ServoLoop(settings_, tree_), InputError);
}

// No dose for what one frame says.
TEST_F(DeformedLiver, StraightIsKnownAtOnce) {
  const Outcome outcome = run(0, 0, 2);
  EXPECT_TRUE(outcome.last.task.reached) << outcome.last.hold_reason.value_or("");
  EXPECT_EQ(outcome.max_turn_rad, 0);
}

// An arm at the end of its range turns to the other side; one without room says that it cannot know.
TEST_F(DeformedLiver, TurnsToTheSideThatHasRoom) {
  settings_.limits.upper[0] = degToRad(21);
  const Outcome outcome = run(3, 0, 8);
  ASSERT_TRUE(outcome.resolved);
  EXPECT_NEAR(radToDeg(outcome.max_turn_rad), 6, 0.15);
  settings_.limits.lower[0] = degToRad(19.9);
  settings_.limits.upper[0] = degToRad(20.3);
  const Outcome without = run(3, 0, 7);
  EXPECT_FALSE(without.last.task.reached);
  EXPECT_NE(without.last.hold_reason.value_or("").find("look from elsewhere"), std::string::npos)
      << without.last.hold_reason.value_or("");
  EXPECT_TRUE(without.last.command.velocity.isZero(0));
}

}  // namespace
}  // namespace angio::test
