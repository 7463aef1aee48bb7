// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/robot/vpRobot.h>

#include <chrono>
#include <optional>

#include "angio/geometry/carm.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/robot/namespace.hpp"

namespace angio::robot {

/// A C-arm at the other end of a bus, as a ViSP user knows robots. Five joints in the order and units of CArmJoints;
/// the end effector is the camera, the reference frame is the patient (iso with the table at zero).
///
/// Hears CARM_STATE and sends CARM_COMMAND and SERVO_SESSION. Calls that need the arm's state hand out what waits on
/// the bus first, so they must not be made from a bus handler; before a first state has come they throw
/// vpRobotException. The arm moves in STATE_VELOCITY_CONTROL only, and stops by itself when a command has outlived its
/// validity: call setVelocity() again in time.
class LcmCArm : public vpRobot {
 public:
  using vpRobot::getPosition;

  /// Borrows the bus, which must outlive it. Throws InputError when the geometry, a limit or the validity [> 0] is
  /// wrong.
  LcmCArm(const CArmGeometry& geometry, const CArmLimits& limits, Bus& bus, std::chrono::microseconds command_validity);
  LcmCArm(const LcmCArm&) = delete;
  LcmCArm& operator=(const LcmCArm&) = delete;

  /// Stops the arm if it was under velocity control.
  ~LcmCArm() override;

  /// Nothing to do: the connection is made at construction.
  void init() override {}

  /// The newest state, however old, or nothing when none has come yet. Valid until the bus is handled again.
  const std::optional<CArmState>& state();

  /// ARTICULAR_FRAME: the five joints. REFERENCE_FRAME: the camera's pose in the patient frame as ViSP's pose vector
  /// (x, y, z [m], theta u [rad]). Other frames throw.
  void getPosition(vpControlFrameType frame, vpColVector& q) override;

  /// The camera's velocity relative to the patient, in the camera frame, by joint velocity (6 x 5).
  void get_eJe(vpMatrix& eJe_out) override;

  /// The same in the patient frame: fVe * eJe, with the velocity of the point at that frame's origin, as
  /// vpServo::L_cVf_fJe wants it (6 x 5).
  void get_fJe(vpMatrix& fJe_out) override;

  /// Commands a velocity, shortened as a whole to the joints' speed limits.
  ///
  /// ARTICULAR_FRAME: joint velocities (5). CAMERA_FRAME and END_EFFECTOR_FRAME: the camera's velocity in the camera
  /// frame [m/s, rad/s] (6), met by the joints in the least squares sense, since five joints cannot turn the image
  /// about the beam. Throws vpRobotException for other frames, a wrong length, a number that is not finite, and when no
  /// state has come yet (all after sending a command that stands still), and outside STATE_VELOCITY_CONTROL (nothing is
  /// sent). The ends of the joints' ranges are for the caller to keep: see CArmMotionLimiter.
  void setVelocity(vpControlFrameType frame, const vpColVector& velocity) override;

  /// STATE_VELOCITY_CONTROL announces a session (SERVO_SESSION), so that the arm obeys this program from now on.
  /// STATE_STOP sends a command that stands still. States other than STATE_STOP and STATE_VELOCITY_CONTROL throw, after
  /// stopping the arm.
  vpRobotStateType setRobotState(vpRobotStateType state) override;

  /// Not offered: throws vpRobotException.
  void setPosition(vpControlFrameType frame, const vpColVector& q) override;

  /// Not offered: throws vpRobotException.
  void getDisplacement(vpControlFrameType frame, vpColVector& q) override;

 private:
  const CArmState& requireState();
  CArmJoints jointVelocity(vpControlFrameType frame, const vpColVector& velocity);
  void announce();
  void send(const CArmJoints& velocity);

  CArmGeometry geometry_;
  CArmLimits limits_;
  Bus& bus_;
  std::chrono::microseconds command_validity_;
  LatestMessage<CArmState> states_;
  std::int64_t sequence_ = 0, sessions_ = 0;
};

}  // namespace angio::robot
