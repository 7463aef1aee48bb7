// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/types/servo_status.hpp"

namespace angio::types {

const char* nameOf(ServoState state) {
  switch (state) {
    case ServoState::kHold:
      return "hold";
    case ServoState::kServo:
      return "servo";
    case ServoState::kIdle:
      return "idle";
    case ServoState::kArmed:
      return "armed";
    case ServoState::kFault:
      return "fault";
    case ServoState::kEmergencyStop:
      return "emergency stop";
  }
  return "unknown";
}

const char* nameOf(ServoCause cause) {
  switch (cause) {
    case ServoCause::kNone:
      return "none";
    case ServoCause::kStopRequested:
      return "stop was requested";
    case ServoCause::kArmRequested:
      return "arming was requested";
    case ServoCause::kStartRequested:
      return "start was requested";
    case ServoCause::kResetRequested:
      return "reset was requested";
    case ServoCause::kEmergencyStopRequested:
      return "emergency stop was requested";
    case ServoCause::kFramesTrusted:
      return "frames are trusted";
    case ServoCause::kFrameDoubted:
      return "a frame is in doubt";
    case ServoCause::kFramesLate:
      return "frames are late";
    case ServoCause::kFramesGone:
      return "no frame can be used";
    case ServoCause::kViewDisagrees:
      return "frames contradict joints and calibration";
    case ServoCause::kClockJumped:
      return "a clock jumped";
    case ServoCause::kJointsNotFinite:
      return "joints are not finite";
    case ServoCause::kJointsImplausible:
      return "joints are implausible";
    case ServoCause::kJointLimitBroken:
      return "a joint limit is broken";
    case ServoCause::kMotionDisagrees:
      return "a joint does not do what was commanded";
    case ServoCause::kSecondSender:
      return "a second sender";
  }
  return "unknown";
}

}  // namespace angio::types
