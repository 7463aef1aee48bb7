// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/lcm_carm.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>
#include <visp3/core/vpPoseVector.h>
#include <visp3/robot/vpRobotException.h>

#include <limits>

#include "angio/base/errors.hpp"
#include "angio/geometry/visp.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

using namespace std::chrono_literals;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

vpColVector toVector(const CArmJoints& joints) {
  vpColVector v(kCArmJointCount);
  std::copy(joints.begin(), joints.end(), v.data);
  return v;
}

struct LcmCArmTest : testing::Test {
  CArmGeometry geometry;
  CArmLimits limits = CArmLimits::typical();
  std::unique_ptr<Bus> bus = openBus("memq://");
  LatestMessage<CArmCommand> commands{*bus, kCArmCommandChannel};
  LcmCArm robot{geometry, limits, *bus, 200ms};
  CArmState state;

  LcmCArmTest() {
    state.time_us = 1234;
    state.joints << 0.4, -0.3, 0.05, -0.02, 0.1;
  }
  void sendState() {
    ++state.sequence;
    publish(*bus, kCArmStateChannel, state);
  }
  std::optional<CArmCommand> sent() {
    bus->handle(0ms);
    return commands.take();
  }
  void expectStandsStill() {
    const auto command = sent();
    ASSERT_TRUE(command) << "no command was sent";
    EXPECT_TRUE(command->velocity.isZero(0));
  }
};

TEST_F(LcmCArmTest, KnowsNothingBeforeTheArmHasSpoken) {
  vpColVector q;
  vpMatrix J;
  EXPECT_FALSE(robot.state());
  EXPECT_THROW(robot.getPosition(vpRobot::ARTICULAR_FRAME, q), vpRobotException);
  EXPECT_THROW(robot.get_eJe(J), vpRobotException);
  EXPECT_THROW(robot.get_fJe(J), vpRobotException);
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  EXPECT_THROW(robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(limits.velocity)), vpRobotException);
  expectStandsStill();
}

TEST_F(LcmCArmTest, AnnouncesASessionWheneverItTakesTheArmOver) {
  MessageQueue<ServoSession> sessions(*bus, kServoSessionChannel);
  const auto announced = [&] {
    bus->handle(0ms);
    return sessions.take();
  };
  robot.setRobotState(vpRobot::STATE_STOP);
  EXPECT_TRUE(announced().empty());
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  const auto first = announced();
  ASSERT_EQ(first.size(), 1u);
  EXPECT_EQ(first[0].command_sequence, 1);
  sendState();
  robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(0.1 * limits.velocity));
  robot.setRobotState(vpRobot::STATE_STOP);
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  const auto second = announced();
  ASSERT_EQ(second.size(), 1u);
  EXPECT_EQ(second[0].command_sequence, 3);
  EXPECT_NE(second[0].session, first[0].session);
}

TEST_F(LcmCArmTest, PositionIsTheNewestState) {
  sendState();
  state.joints[4] = 0.2;
  sendState();
  vpColVector q;
  robot.getPosition(vpRobot::ARTICULAR_FRAME, q);
  EXPECT_EQ(q, toVector(state.joints));
  robot.getPosition(vpRobot::REFERENCE_FRAME, q);
  const vpHomogeneousMatrix fMe(vpPoseVector(q[0], q[1], q[2], q[3], q[4], q[5]));
  const Pose closed = fromVisp(fMe) * geometry.T_camera_patient(state.joints);
  EXPECT_LT(logSE3(closed).norm(), 1e-9);  // theta u and back costs a few digits of 1e-16.
}

TEST_F(LcmCArmTest, JacobiansAreTheMotionOfTheCameraInBothFrames) {
  sendState();
  vpMatrix eJe, fJe;
  robot.get_eJe(eJe);
  robot.get_fJe(fJe);
  const double step = 1e-6;
  for (unsigned i = 0; i < kCArmJointCount; ++i) {
    CArmJoints ahead = state.joints, behind = state.joints;
    ahead[i] += step;
    behind[i] -= step;
    const Pose fMe = geometry.T_camera_patient(state.joints).inverse();
    const Pose fMe_ahead = geometry.T_camera_patient(ahead).inverse();
    const Pose fMe_behind = geometry.T_camera_patient(behind).inverse();
    const Twist in_camera = (logSE3(fMe.inverse() * fMe_ahead) - logSE3(fMe.inverse() * fMe_behind)) / (2 * step);
    const Twist in_patient = (logSE3(fMe_ahead * fMe.inverse()) - logSE3(fMe_behind * fMe.inverse())) / (2 * step);
    for (unsigned r = 0; r < 6; ++r) {
      // Central differences: rounding 1e-16 over a step of 1e-6, and the log's noise near zero.
      EXPECT_NEAR(eJe[r][i], in_camera[r], 1e-8) << "row " << r << " joint " << i;
      EXPECT_NEAR(fJe[r][i], in_patient[r], 1e-8) << "row " << r << " joint " << i;
    }
  }
}

TEST_F(LcmCArmTest, CommandsJointVelocitiesWithTheirValidityAndRisingSequence) {
  sendState();
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  const CArmJoints slow = 0.5 * limits.velocity;
  robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(slow));
  const auto first = sent();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->velocity, slow);
  EXPECT_EQ(first->valid_for_us, 200000);
  EXPECT_EQ(first->time_us, state.time_us);
  robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(slow));
  EXPECT_EQ(sent()->sequence, first->sequence + 1);
}

TEST_F(LcmCArmTest, FastVelocitiesKeepTheirDirection) {
  sendState();
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  CArmJoints wanted = 0.5 * limits.velocity;
  wanted[2] = -4 * limits.velocity[2];
  robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(wanted));
  EXPECT_LT((sent()->velocity - 0.25 * wanted).norm(), 1e-15);  // One rounding of numbers below one.
}

TEST_F(LcmCArmTest, CameraVelocityTheArmCanMakeIsMadeExactly) {
  sendState();
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  CArmJoints qdot;
  qdot << 0.1, -0.2, 0.01, 0.02, -0.03;
  const Twist v = geometry.eJe(state.joints) * qdot;
  vpColVector velocity(6);
  std::copy(v.begin(), v.end(), velocity.data);
  for (const auto frame : {vpRobot::CAMERA_FRAME, vpRobot::END_EFFECTOR_FRAME}) {
    robot.setVelocity(frame, velocity);
    EXPECT_LT((sent()->velocity - qdot).norm(), 1e-12);  // A well-conditioned solve in doubles.
  }
}

TEST_F(LcmCArmTest, NoUnsoundVelocityReachesTheBus) {
  sendState();
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  const auto expectRefused = [&](vpRobot::vpControlFrameType frame, const vpColVector& v) {
    EXPECT_THROW(robot.setVelocity(frame, v), vpRobotException);
    expectStandsStill();
  };
  for (const double wrong : {kNan, std::numeric_limits<double>::infinity()}) {
    expectRefused(vpRobot::ARTICULAR_FRAME, vpColVector(5, wrong));
    expectRefused(vpRobot::CAMERA_FRAME, vpColVector(6, wrong));
  }
  expectRefused(vpRobot::ARTICULAR_FRAME, vpColVector());
  expectRefused(vpRobot::ARTICULAR_FRAME, vpColVector(6, 0.01));
  expectRefused(vpRobot::CAMERA_FRAME, vpColVector(5, 0.01));
  expectRefused(vpRobot::REFERENCE_FRAME, vpColVector(6, 0.01));
  expectRefused(vpRobot::MIXT_FRAME, vpColVector(6, 0.01));
}

TEST_F(LcmCArmTest, MovesUnderVelocityControlOnlyAndStopsWhenItIsLeft) {
  sendState();
  EXPECT_THROW(robot.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(limits.velocity)), vpRobotException);
  EXPECT_FALSE(sent());
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  robot.setRobotState(vpRobot::STATE_STOP);
  expectStandsStill();
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  EXPECT_THROW(robot.setRobotState(vpRobot::STATE_POSITION_CONTROL), vpRobotException);
  expectStandsStill();
  EXPECT_EQ(robot.getRobotState(), vpRobot::STATE_STOP);
}

TEST_F(LcmCArmTest, StopsTheArmWhenItEnds) {
  {
    LcmCArm brief(geometry, limits, *bus, 200ms);
    sendState();
    brief.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
    brief.setVelocity(vpRobot::ARTICULAR_FRAME, toVector(limits.velocity));
    EXPECT_FALSE(sent()->velocity.isZero(0));
  }
  expectStandsStill();
}

TEST_F(LcmCArmTest, RefusesWrongSetUp) {
  EXPECT_THROW(LcmCArm(geometry, limits, *bus, 0us), InputError);
  limits.velocity[2] = kNan;
  EXPECT_THROW(LcmCArm(geometry, limits, *bus, 200ms), InputError);
}

}  // namespace
}  // namespace angio::test
