// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "angio/types/namespace.hpp"

namespace angio::types {

/// States of the servo loop; only in kServo does it move the machine.
enum class ServoState : std::int8_t {
  kHold = 0,           ///< Started, stands still, moves by itself once frames can be trusted.
  kServo = 1,          ///< Moves by what it sees.
  kIdle = 2,           ///< Until it is armed.
  kArmed = 3,          ///< Until it is started.
  kFault = 4,          ///< Latched, until it is reset.
  kEmergencyStop = 5,  ///< Latched, until it is reset.
};
constexpr int kServoStateCount = 6;

/// Why the loop's state changed; from kFramesGone on these are faults. Their meanings: types/servo_status_t.lcm.
enum class ServoCause : std::int8_t {
  kNone = 0,
  kStopRequested = 1,
  kArmRequested = 2,
  kStartRequested = 3,
  kResetRequested = 4,
  kEmergencyStopRequested = 5,
  kFramesTrusted = 6,
  kFrameDoubted = 7,
  kFramesLate = 8,
  kFramesGone = 9,
  kViewDisagrees = 10,
  kClockJumped = 11,
  kJointsNotFinite = 12,
  kJointsImplausible = 13,
  kJointLimitBroken = 14,
  kMotionDisagrees = 15,
  kSecondSender = 16,
};
constexpr int kServoCauseCount = 17;

/// In words, for people: "emergency stop", "a joint limit is broken".
const char* nameOf(ServoState state);
const char* nameOf(ServoCause cause);

/// What the loop did with one frame, in which state it is, and why.
struct ServoStatus {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ServoState state = ServoState::kHold;
  std::string reason;                    ///< Why it stands still; empty while it servoes.
  std::int64_t transitions = 0;          ///< Changes of state so far.
  std::int64_t transition_time_us = 0;   ///< Of the last one, the loop's clock [us]; 0: there was none.
  ServoCause cause = ServoCause::kNone;  ///< Of the last one.
  double view_error_rad = 0;             ///< Angle between the seen and the desired beam; 0 without a desired view.
  double target_error_m = 0;             ///< Distance of the target from its desired place in the camera frame; of a
                                         ///< task without a view across the beam alone.
  std::int64_t view_reached_us = 0;      ///< ViewRequest::time_us of the request whose view is reached; 0: none.
  std::int64_t image_us = 0;             ///< Time spent on image to centreline [us].
  std::int64_t registration_us = 0;      ///< On registration [us].
  std::int64_t control_us = 0;           ///< On law, limits and supervisor [us].
};

}  // namespace angio::types
