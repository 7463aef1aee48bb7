// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/test/namespace.hpp"
#include "angio/types/channels.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

constexpr std::chrono::milliseconds kNoWait(0);

TEST(Safety, SilenceStopsTheArm) {
  const auto bus = openBus("memq://");
  const CArmLimits limits = CArmLimits::typical();
  SimulatedCArmNode arm(*bus, limits, CArmJoints::Zero(), 0);
  CArmCommand command;
  command.sequence = 1;
  command.valid_for_us = 200'000;
  command.velocity = limits.velocity;
  publish(*bus, kCArmCommandChannel, command);
  bus->handle(kNoWait);
  arm.listen(0);
  arm.report(200'000);
  EXPECT_GT(arm.arm().state().velocity.minCoeff(), 0) << "it obeyed while it was told to";

  // It had 0.2 s to gain speed, so it needs no more than that to lose it.
  arm.report(400'001);
  const CArmState at_rest = arm.arm().state();
  EXPECT_LT(at_rest.velocity.cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_TRUE((at_rest.joints.array() <= limits.acceleration.array() * 0.2 * 0.2 * (1 + 1e-9)).all());
  arm.report(10'000'000);
  EXPECT_EQ(arm.arm().state().joints, at_rest.joints);
}

// A loop whose X-ray shows other vessels than its tree.
void expectRest(const VesselTree& loops, const VesselTree& patients, const std::string& what) {
  const CArmCalibration calibration = test::hepaticCalibration();
  const Eigen::Vector3d target = loops.centroid();
  ServoLoopSettings settings;
  settings.carm = calibration.carm;
  settings.T_dsa_cb = calibration.T_dsa_cb;
  settings.R_lps_model = calibration.R_lps_model;
  const auto bus = openBus("memq://");
  const CArmJoints start = settings.carm.jointsFor({0, 0}, settings.T_dsa_cb * target);
  SimulatedCArmNode arm(*bus, settings.limits, start, 0);
  SimulatedXrayNode xray(patients, {}, settings.carm, settings.T_dsa_cb);
  LatestMessage<XrayFrame> shown(*bus, kXrayFrameChannel);
  ServoLoop servo(settings, loops);  // Started, so to speak: nobody but itself holds it.
  const int frames = test::kSanitized ? 1 : 3;
  for (int k = 1; k <= frames; ++k) {
    arm.report(k * 66'667);
    bus->handle(kNoWait);
    publish(*bus, kXrayFrameChannel, xray.render(k * 66'667, arm.arm().state().joints));
    bus->handle(kNoWait);
    const auto frame = shown.take();
    ASSERT_TRUE(frame);
    const ServoReport report = servo.step(*frame, arm.arm().state());
    EXPECT_TRUE(report.hold_reason) << what << ": registration " << statusName(report.observation.registration.status);
    publish(*bus, kCArmCommandChannel, report.command);
    bus->handle(kNoWait);
    arm.listen(k * 66'667 + 50'000);
  }
  arm.report(1'000'000);
  EXPECT_EQ(arm.arm().state().joints, start) << what;
}

TEST(Safety, AnotherPatientsVesselsNeverMoveTheArm) {
  const VesselTree hepatic = test::hepaticTree();
  for (const unsigned seed : {1u, 2u}) {
    const VesselTree other = test::branchingTree(seed, hepatic.centroid());
    expectRest(hepatic, other, "X-ray of tree " + std::to_string(seed));
    expectRest(other, hepatic, "loop with tree " + std::to_string(seed));
  }
}

// The right vessels, but left for right: what a wrong orientation of the image would show.
TEST(Safety, AMirroredPatientNeverMovesTheArm) {
  const VesselTree hepatic = test::hepaticTree();
  Eigen::Matrix3Xd mirrored = hepatic.points();
  mirrored.row(0) = 2 * hepatic.centroid().x() - mirrored.row(0).array();
  expectRest(hepatic, VesselTree(mirrored, hepatic.parents(), hepatic.radii()), "mirrored");
}

}  // namespace
}  // namespace angio::test
