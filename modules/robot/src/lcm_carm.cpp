// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/lcm_carm.hpp"

#include <visp3/core/vpVelocityTwistMatrix.h>
#include <visp3/robot/vpRobotException.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <exception>

#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/geometry/visp.hpp"
#include "angio/robot/motion_time.hpp"
#include "angio/types/channels.hpp"

namespace angio::robot {
namespace {

bool allFinite(const vpColVector& v) {
  return std::all_of(v.data, v.data + v.size(), [](double x) { return std::isfinite(x); });
}

}  // namespace

LcmCArm::LcmCArm(const CArmGeometry& geometry, const CArmLimits& limits, Bus& bus,
                 std::chrono::microseconds command_validity)
    : geometry_(geometry),
      limits_(limits),
      bus_(bus),
      command_validity_(command_validity),
      states_(bus, kCArmStateChannel) {
  geometry_.check();
  checkJoints(limits_);
  requirePositive("c-arm", "command_validity_us", static_cast<double>(command_validity.count()));
  nDof = kCArmJointCount;
  eJeAvailable = fJeAvailable = 1;
}

LcmCArm::~LcmCArm() {
  if (getRobotState() != STATE_VELOCITY_CONTROL) return;
  try {
    send(CArmJoints::Zero());
  } catch (const std::exception&) {
    // A bus that no longer sends: the last command's validity stops the arm.
  }
}

const std::optional<CArmState>& LcmCArm::state() {
  bus_.handle(std::chrono::milliseconds(0));
  return states_.peek();
}

const CArmState& LcmCArm::requireState() {
  if (const auto& newest = state()) return *newest;
  const std::string refused = states_.lastError().empty() ? "" : "; refused: " + states_.lastError();
  throw vpRobotException(vpRobotException::communicationError,
                         std::string("no state has come from the C-arm on ") + kCArmStateChannel + refused);
}

void LcmCArm::getPosition(vpControlFrameType frame, vpColVector& q) {
  const CArmJoints& joints = requireState().joints;
  if (frame == ARTICULAR_FRAME) {
    q.resize(kCArmJointCount);
    std::copy(joints.begin(), joints.end(), q.data);
  } else if (frame == REFERENCE_FRAME) {
    const vpPoseVector pose(toVisp(geometry_.T_camera_patient(joints).inverse()));
    q = pose;
  } else {
    throw vpRobotException(vpRobotException::notImplementedError,
                           "the C-arm's position is given in the articular or the reference frame");
  }
}

void LcmCArm::get_eJe(vpMatrix& eJe_out) { eJe_out = toVisp(geometry_.eJe(requireState().joints)); }

void LcmCArm::get_fJe(vpMatrix& fJe_out) {
  const CArmJoints& joints = requireState().joints;
  const vpVelocityTwistMatrix fVe(toVisp(geometry_.T_camera_patient(joints).inverse()));
  fJe_out = fVe * toVisp(geometry_.eJe(joints));
}

CArmJoints LcmCArm::jointVelocity(vpControlFrameType frame, const vpColVector& velocity) {
  const bool articular = frame == ARTICULAR_FRAME;
  if (!articular && frame != CAMERA_FRAME && frame != END_EFFECTOR_FRAME) {
    throw vpRobotException(vpRobotException::notImplementedError,
                           "the C-arm takes velocities in the articular, camera or end-effector frame");
  }
  const unsigned length = articular ? kCArmJointCount : 6;
  if (velocity.size() != length) {
    throw vpRobotException(vpRobotException::dimensionError, "velocity has " + std::to_string(velocity.size()) +
                                                                 " entries: must have " + std::to_string(length));
  }
  if (!allFinite(velocity)) throw vpRobotException(vpRobotException::badValue, "velocity must be finite");
  const CArmState& newest = requireState();
  if (articular) return CArmJoints::Map(velocity.data);
  // No damping: the columns of eJe are independent at every pose, as the two axes stand at right angles.
  return geometry_.eJe(newest.joints).colPivHouseholderQr().solve(Vector6d::Map(velocity.data));
}

void LcmCArm::setVelocity(vpControlFrameType frame, const vpColVector& velocity) {
  CArmJoints wanted;
  try {
    wanted = jointVelocity(frame, velocity);
  } catch (...) {
    send(CArmJoints::Zero());
    throw;
  }
  if (getRobotState() != STATE_VELOCITY_CONTROL) {
    throw vpRobotException(vpRobotException::wrongStateError,
                           "the C-arm moves in STATE_VELOCITY_CONTROL only: call setRobotState() first");
  }
  send(withinSpeed(wanted, limits_));
}

vpRobot::vpRobotStateType LcmCArm::setRobotState(vpRobotStateType state) {
  if (state == STATE_VELOCITY_CONTROL) {
    if (getRobotState() != STATE_VELOCITY_CONTROL) announce();
    return vpRobot::setRobotState(state);
  }
  vpRobot::setRobotState(STATE_STOP);
  send(CArmJoints::Zero());
  if (state == STATE_STOP) return state;
  throw vpRobotException(vpRobotException::stateModificationError, "the C-arm offers velocity control only");
}

void LcmCArm::setPosition(vpControlFrameType, const vpColVector&) {
  throw vpRobotException(vpRobotException::notImplementedError, "the C-arm offers velocity control only");
}

void LcmCArm::getDisplacement(vpControlFrameType, vpColVector&) {
  throw vpRobotException(vpRobotException::notImplementedError, "the C-arm gives positions, not displacements");
}

void LcmCArm::announce() {
  ServoSession session;
  session.time_us = session.session = monotonic_us();
  session.sequence = ++sessions_;
  session.command_sequence = sequence_;
  publish(bus_, kServoSessionChannel, session);
}

void LcmCArm::send(const CArmJoints& velocity) {
  CArmCommand command;
  // A ViSP user has no frame behind the command; the state it was made from is what dates it.
  if (const auto& newest = states_.peek()) command.time_us = newest->time_us;
  command.sequence = ++sequence_;
  command.valid_for_us = command_validity_.count();
  command.velocity = velocity;
  publish(bus_, kCArmCommandChannel, command);
}

}  // namespace angio::robot
