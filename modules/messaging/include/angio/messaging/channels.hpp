// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

namespace angio {

/// Names of the bus's channels, one for each type of message.
constexpr const char* kXrayFrameChannel = "XRAY_FRAME";
constexpr const char* kCArmStateChannel = "CARM_STATE";
constexpr const char* kCArmCommandChannel = "CARM_COMMAND";
constexpr const char* kRegistrationChannel = "REGISTRATION";
constexpr const char* kServoStatusChannel = "SERVO_STATUS";
constexpr const char* kServoInputChannel = "SERVO_INPUT";
constexpr const char* kServoRequestChannel = "SERVO_REQUEST";
constexpr const char* kCatheterStateChannel = "CATHETER_STATE";
constexpr const char* kCatheterCommandChannel = "CATHETER_COMMAND";
constexpr const char* kCatheterTipChannel = "CATHETER_TIP";

}  // namespace angio
