// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_loop.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/errors.hpp"
#include "angio/test/not_a_number.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

class ServoLoops : public testing::Test {
 protected:
  void expectHold(const ServoReport& report, const std::string& words) {
    ASSERT_TRUE(report.hold_reason);
    EXPECT_NE(report.hold_reason->find(words), std::string::npos) << *report.hold_reason;
    EXPECT_TRUE(report.command.velocity.isZero(0));
    EXPECT_FALSE(report.task.view_error);
    EXPECT_GT(report.command.valid_for_us, 0) << "a hold is a command as well";
  }

  test::Stage stage_;
  ServoLoop loop_{stage_.settings, stage_.tree};
};

TEST_F(ServoLoops, MoveWhenTheyTrustWhatTheySee) {
  const ServoReport report = loop_.step(stage_.frame(1), stage_.state(1));
  ASSERT_FALSE(report.hold_reason) << *report.hold_reason;
  ASSERT_TRUE(report.task.view_error);
  // From straight through to LAO 20, CRA 10: cos = cos 20 cos 10. The loop sees the real view; its noise is far below
  // 0.3 deg.
  EXPECT_NEAR(radToDeg(report.task.view_error->direction_rad),
              radToDeg(std::acos(std::cos(degToRad(20)) * std::cos(degToRad(10)))), 0.3);
  EXPECT_GT(report.command.velocity[0], 0) << "towards LAO";
  EXPECT_GT(report.command.velocity[1], 0) << "towards CRA";
  EXPECT_EQ(report.command.frame_sequence, 1);
  EXPECT_EQ(report.command.time_us, 66'667);
  EXPECT_EQ(report.command.valid_for_us, 200'000);
}

TEST_F(ServoLoops, HoldWithoutVessels) {
  FluoroscopySettings without_contrast;
  without_contrast.contrast_attenuation_per_mm = 0;
  expectHold(loop_.step(stage_.frameOf(stage_.tree, 1, without_contrast), stage_.state(1)), "registration ");
  XrayFrame flat = stage_.frame(2);
  flat.image.setTo(30000);
  expectHold(loop_.step(flat, stage_.state(2)), "registration too_few_points");
}

TEST_F(ServoLoops, HoldBeforeAnotherPatient) {
  for (const unsigned seed : {21u, 22u, 23u}) {
    const VesselTree other = test::branchingTree(seed, stage_.tree.centroid());
    expectHold(loop_.step(stage_.frameOf(other, seed), stage_.state(seed)), "");
  }
}

TEST_F(ServoLoops, HoldWhenTheFrameOrTheJointsAreNoGood) {
  const XrayFrame good = stage_.frame(100);
  CArmState state = stage_.state(100);
  state.time_us -= 1'000'000;
  expectHold(loop_.step(good, state), "age of the joints");
  state = stage_.state(100);
  state.joints[1] = kNan;
  expectHold(loop_.step(good, state), "joints are not finite");
  state.joints[1] = 1e300;
  expectHold(loop_.step(good, state), "");
  state.joints[1] = 0;
  state.joints[4] = 1e300;
  expectHold(loop_.step(good, state), "");
  XrayFrame empty = good;
  empty.image = cv::Mat();
  expectHold(loop_.step(empty, stage_.state(100)), "image");
  XrayFrame late = good;
  late.time_us = std::numeric_limits<std::int64_t>::min();
  expectHold(loop_.step(late, stage_.state(100)), "different epochs");
  EXPECT_FALSE(loop_.step(good, stage_.state(100)).hold_reason) << "and go on when all is well again";
}

TEST_F(ServoLoops, CommandsCountUpHeldOrNot) {
  EXPECT_EQ(loop_.step(stage_.frame(7), stage_.state(7)).command.sequence, 1);
  CArmState stale = stage_.state(8);
  stale.time_us = 0;
  EXPECT_EQ(loop_.step(stage_.frame(8), stale).command.sequence, 2);
  const CArmCommand third = loop_.step(stage_.frame(9), stage_.state(9)).command;
  EXPECT_EQ(third.sequence, 3);
  EXPECT_EQ(third.frame_sequence, 9);
}

TEST_F(ServoLoops, TheSameFramesGiveTheSameCommandsBitForBit) {
  ServoLoop other(stage_.settings, stage_.tree);
  for (int k = 1; k <= 4; ++k) {
    const XrayFrame frame = stage_.frame(k);
    const CArmCommand a = loop_.step(frame, stage_.state(k)).command, b = other.step(frame, stage_.state(k)).command;
    EXPECT_FALSE(a.velocity.isZero(0));
    EXPECT_EQ(a.velocity, b.velocity);
    EXPECT_EQ(a.sequence, b.sequence);
    stage_.joints += a.velocity / 15;
  }
}

TEST_F(ServoLoops, RefuseASetUpThatCannotWork) {
  const auto refusal = [&](const auto& change) {
    ServoLoopSettings wrong = stage_.settings;
    change(wrong);
    return test::refusalOf([&] { ServoLoop(wrong, stage_.tree); });
  };
  EXPECT_NE(refusal([](auto& s) { std::get<ViewTaskSettings>(s.task).primary_deg = kNan; }).find("primary_deg = nan"),
            std::string::npos);
  EXPECT_NE(refusal([](auto& s) { s.target_model = Eigen::Vector3d(0, kNan, 0); }).find("target_model"),
            std::string::npos);
  EXPECT_NE(refusal([](auto& s) { s.T_dsa_cb.linear() *= 1.1; }).find("T_dsa_cb.rotation"), std::string::npos);
  EXPECT_NE(refusal([](auto& s) { s.R_lps_model.setZero(); }).find("R_lps_model"), std::string::npos);
  EXPECT_NE(refusal([](auto& s) { s.carm.pixel_spacing_m = 0; }), "");
}

TEST(OpenLoops, GoWhereTheCalibrationPointsToAndNoFurther) {
  const test::Stage stage;
  OpenLoop loop(stage.settings, stage.tree);
  CArmState state = stage.state(1);
  for (int k = 0; k < 150; ++k) state.joints += loop.step(state, 1.0 / 15).velocity / 15;
  const Pose calibrated = stage.settings.carm.T_camera_patient(state.joints) * stage.settings.T_dsa_cb;
  const Eigen::Vector3d target = stage.tree.centroid();
  const Pose desired = desiredPose({{degToRad(20), degToRad(10)}, target, Eigen::Matrix3d::Identity()},
                                   stage.settings.carm.source_isocenter_distance_m);
  const ViewError left = viewError(calibrated, desired, target);
  // Ten seconds are fifteen time constants, less the time under limits: exp(-12) of half a radian.
  EXPECT_LT(left.direction_rad, 1e-5);
  EXPECT_LT(left.target_m, 1e-5);
}

}  // namespace
}  // namespace angio::test
