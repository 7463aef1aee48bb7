// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/closed_loop.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/errors.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

ClosedLoopRun simulateHepaticLoop(const ScenarioSettings& settings) {
  const VesselTree tree = test::hepaticTree();
  const ViewTaskSettings view;
  const Scenario world = randomScenario(tree, test::hepaticCalibration(), settings,
                                        {degToRad(view.primary_deg), degToRad(view.secondary_deg)});
  return runClosedLoop(tree, world, settings, {}, {});
}

void expectWithinLimits(const std::vector<ClosedLoopFrame>& frames, double period_s) {
  const CArmLimits limits = CArmLimits::typical();
  CArmJoints last = CArmJoints::Zero();
  const double rounding = 1 + 1e-9, whole_us = 1 + 2e-5;  // Frames stand at whole microseconds of 66,667.
  for (const auto& f : frames) {
    const CArmJoints& v = f.command.velocity;
    EXPECT_TRUE((v.cwiseAbs().array() <= limits.velocity.array() * rounding).all()) << v.transpose();
    // A hold may stop at once; the arm then brakes by itself.
    const bool gentle = ((v - last).cwiseAbs().array() <= limits.acceleration.array() * period_s * whole_us).all();
    EXPECT_TRUE(gentle || f.hold_reason) << (v - last).transpose();
    EXPECT_TRUE((f.joints.array() >= limits.lower.array()).all() && (f.joints.array() <= limits.upper.array()).all());
    last = v;
  }
}

// How far the target's image is from its place once learning is over, at the isocentre.
double rmsAfter_mm(double begin_s, const std::vector<ClosedLoopFrame>& frames) {
  double sum_m2 = 0;
  int count = 0;
  for (const auto& f : frames) {
    if (f.time_s <= begin_s) continue;
    sum_m2 += f.target_off_m * f.target_off_m;
    ++count;
  }
  return 1e3 * std::sqrt(sum_m2 / count);
}

TEST(ClosedLoops, TheClosedLoopReachesTheViewThatTheOpenLoopMisses) {
  ScenarioSettings settings;
  settings.duration_s = test::kSanitized ? 0.4 : 6;
  const ClosedLoopRun r = simulateHepaticLoop(settings);
  expectWithinLimits(r.closed, 1 / settings.lab.frame_rate_hz);
  expectWithinLimits(r.open, 1 / settings.lab.frame_rate_hz);
  for (const auto& f : r.closed) {
    EXPECT_TRUE(!f.hold_reason || f.command.velocity.isZero(0));
    EXPECT_EQ(f.command.frame_sequence, &f - r.closed.data() + 1);
  }
  if (test::kSanitized) return;  // Too few frames to arrive.
  EXPECT_LT(radToDeg(r.closed_end.direction_rad), 0.2);
  EXPECT_LT(1e3 * r.closed_end.target_m, 1);
  // All of the calibration's error is left: six seconds are nine time constants.
  EXPECT_NEAR(radToDeg(r.open_end.direction_rad), settings.calibration_error_deg, 0.05);
  EXPECT_NEAR(1e3 * r.open_end.target_m, settings.calibration_error_mm, 0.1);
}

TEST(ClosedLoops, TheSameSeedGivesTheSameCommandsBitForBit) {
  ScenarioSettings settings;
  settings.duration_s = test::kSanitized ? 0.2 : 1;
  settings.seed = 5;
  const ClosedLoopRun a = simulateHepaticLoop(settings), b = simulateHepaticLoop(settings);
  ASSERT_EQ(a.closed.size(), b.closed.size());
  for (std::size_t k = 0; k < a.closed.size(); ++k) {
    const CArmCommand &x = a.closed[k].command, &y = b.closed[k].command;
    EXPECT_EQ(x.velocity, y.velocity) << k;
    EXPECT_EQ(x.time_us, y.time_us);
    EXPECT_EQ(x.sequence, y.sequence);
    EXPECT_EQ(x.frame_sequence, y.frame_sequence);
    EXPECT_EQ(x.valid_for_us, y.valid_for_us);
    EXPECT_EQ(a.open[k].command.velocity, b.open[k].command.velocity);
  }
  EXPECT_FALSE(a.closed.back().command.velocity.isZero(0)) << "a loop that never moves repeats itself easily";
}

TEST(ClosedLoops, AnotherSeedIsAnotherPatient) {
  ScenarioSettings settings;
  settings.duration_s = 0.1;
  const ClosedLoopRun a = simulateHepaticLoop(settings);
  settings.seed = 2;
  const ClosedLoopRun b = simulateHepaticLoop(settings);
  EXPECT_GT((a.closed[0].joints - b.closed[0].joints).norm(), 1e-3) << "the table's start follows the patient's place";
}

// A crooked arm with another camera and a patient off the middle: who knows them gets there without eyes, and who
// believes in the ideal arm needs them.
TEST(ClosedLoops, ACalibratedArmNeedsNoEyesAndAnIdealOneDoes) {
  const VesselTree tree = test::hepaticTree();
  Scenario world;
  world.truth = test::hepaticCalibration();
  world.truth.T_dsa_cb.translation() += Eigen::Vector3d(8e-3, -5e-3, 6e-3);
  CArmDeviations& d = world.truth.carm.deviations;
  d.secondary_offset_rad = degToRad(0.6);
  d.axis_gap_m = 3e-3;
  d.source_right_m = -2e-3;
  d.table(0, 0) = 1.01;
  d.principal_point_px = {6, -4};
  d.flex = CArmFlex::lowOrder();
  d.flex.terms[2].twist << 0, 1e-3, 0, degToRad(0.1), 0, 0;
  ScenarioSettings settings;
  settings.start_primary_deg = 29;
  settings.start_secondary_deg = 14.5;
  settings.duration_s = test::kSanitized ? 0.2 : 4;
  world.calibrated = world.truth;
  const ClosedLoopRun known = runClosedLoop(tree, world, settings, {}, {});
  world.calibrated.carm.deviations = {};
  world.calibrated.carm.deviations.principal_point_px = d.principal_point_px;
  const ClosedLoopRun ideal = runClosedLoop(tree, world, settings, {}, {});
  if (test::kSanitized) return;
  // What is left after 4 s at a gain of 1.5 per second: 2 deg exp(-6) = 0.005 deg.
  EXPECT_LT(radToDeg(known.open_end.direction_rad), 0.03);
  EXPECT_LT(1e3 * known.open_end.target_m, 0.05);
  EXPECT_LT(radToDeg(known.closed_end.direction_rad), 0.06);
  EXPECT_LT(1e3 * known.closed_end.target_m, 0.15);
  EXPECT_GT(radToDeg(ideal.open_end.direction_rad), 0.4);
  EXPECT_GT(1e3 * ideal.open_end.target_m, 2);
  EXPECT_LT(radToDeg(ideal.closed_end.direction_rad), 0.06);
  EXPECT_LT(1e3 * ideal.closed_end.target_m, 0.15);
}

// The patient breathes, and the table keeps the target's image where it belongs. What learning takes is over after two
// breaths; a hand's breadth of motion is left to none.
TEST(ClosedLoops, ABreathingTargetIsKeptInTheMiddle) {
  ScenarioSettings settings;
  settings.calibration_error_deg = 1;
  settings.calibration_error_mm = 3;
  settings.duration_s = test::kSanitized ? 0.2 : 14;
  ServoLoopSettings parts;
  parts.task = CenterTaskSettings{};
  SimulatedPatientSettings patient;
  patient.motion.breathing.amplitude_mm = 15;
  patient.motion.breathing.diaphragm_mm = 0;  // At the target.
  const VesselTree tree = test::hepaticTree();
  const ClosedLoopRun r =
      runClosedLoop(tree, randomScenario(tree, test::hepaticCalibration(), settings, {}), settings, parts, patient);
  if (test::kSanitized) return;
  EXPECT_LT(rmsAfter_mm(10, r.closed), 1);
  EXPECT_GT(rmsAfter_mm(10, r.open), 3) << "and without eyes it goes up and down";
}

// Contrast agent fills one territory, the rest of the tree is not to be seen.
TEST(ClosedLoops, AHalfFilledTreeLeadsToTheView) {
  ScenarioSettings settings;
  settings.calibration_error_deg = 1;
  settings.calibration_error_mm = 3;
  settings.duration_s = test::kSanitized ? 0.2 : 5;
  SimulatedPatientSettings patient;
  patient.filling.filled = 0.5;
  const VesselTree tree = test::hepaticTree();
  const ClosedLoopRun r =
      runClosedLoop(tree, randomScenario(tree, test::hepaticCalibration(), settings, {}), settings, {}, patient);
  if (test::kSanitized) return;
  EXPECT_LT(radToDeg(r.closed_end.direction_rad), 0.1);
  EXPECT_LT(1e3 * r.closed_end.target_m, 0.5);
  EXPECT_GT(1e3 * r.open_end.target_m, 2);
}

// No contrast agent: a catheter that is pushed on is all that frames show. Once they have told which vessels it lies
// in, a point of these is kept in the middle while the patient breathes, from images alone.
TEST(ClosedLoops, ACatheterAloneTellsWhereItsVesselsAre) {
  const VesselTree tree = test::hepaticTree();
  ScenarioSettings settings;
  settings.calibration_error_deg = 1;
  settings.calibration_error_mm = 5;
  settings.duration_s = test::kSanitized ? 0.2 : 7;
  ServoLoopSettings parts;
  parts.task = CenterTaskSettings{};
  parts.perception.by_catheter = true;
  parts.target_model = tree.points().col(30);  // 90 mm from where the catheter comes in, which lies 60 mm in at first.
  SimulatedPatientSettings patient;
  patient.bolus.enabled = true;
  patient.bolus.trigger = BolusTrigger::kDemand;
  patient.device.kind = DeviceKind::kCatheter;
  patient.device.tip_branch = 1;
  patient.device.speed_mm_per_s = 12;
  patient.motion.breathing.amplitude_mm = 6;
  const Scenario world = randomScenario(tree, test::hepaticCalibration(), settings, {});
  const ClosedLoopRun r = runClosedLoop(tree, world, settings, parts, patient);
  if (test::kSanitized) return;
  for (const auto& f : r.closed) EXPECT_TRUE(f.time_s > 1 || f.hold_reason) << "four frames, 0.4 s apart, make a run";
  EXPECT_LT(rmsAfter_mm(4, r.closed), 1.5);
  EXPECT_GT(rmsAfter_mm(4, r.open), 4);
}

TEST(ClosedLoops, RefuseATargetThatIsFarFromTheTree) {
  const VesselTree tree = test::hepaticTree();
  ServoLoopSettings parts;
  parts.target_model = 1e3 * tree.centroid();  // As if in millimetres.
  const std::string line =
      refusalOf([&] { runClosedLoop(tree, randomScenario(tree, test::hepaticCalibration(), {}, {}), {}, parts, {}); });
  EXPECT_NE(line.find("must be within 50 mm of the tree"), std::string::npos) << line;
}

TEST(ClosedLoops, RefuseSettingsOutOfRange) {
  ScenarioSettings settings;
  settings.lab.frame_rate_hz = 0;
  EXPECT_NE(test::refusalOf([&] { simulateHepaticLoop(settings); }).find("frame_rate_hz = 0"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
