// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/types/namespace.hpp"

namespace angio::types {

/// Names of the bus's channels.
constexpr const char* kXrayFrameChannel = "XRAY_FRAME";
constexpr const char* kCArmStateChannel = "CARM_STATE";
constexpr const char* kCArmCommandChannel = "CARM_COMMAND";
constexpr const char* kRegistrationChannel = "REGISTRATION";
constexpr const char* kRegistrationPointsChannel = "REGISTRATION_POINTS";
constexpr const char* kServoStatusChannel = "SERVO_STATUS";
constexpr const char* kServoInputChannel = "SERVO_INPUT";
constexpr const char* kServoRequestChannel = "SERVO_REQUEST";
constexpr const char* kCatheterStateChannel = "CATHETER_STATE";
constexpr const char* kCatheterCommandChannel = "CATHETER_COMMAND";
constexpr const char* kViewRequestChannel = "VIEW_REQUEST";
constexpr const char* kCatheterTipChannel = "CATHETER_TIP";
constexpr const char* kCatheterInputChannel = "CATHETER_INPUT";
constexpr const char* kCatheterStatusChannel = "CATHETER_STATUS";    ///< A servo_status_t, of the catheter's loop.
constexpr const char* kCatheterRequestChannel = "CATHETER_REQUEST";  ///< A servo_request_t, for it.
constexpr const char* kServoSessionChannel = "SERVO_SESSION";        ///< A servo_session_t, of the C-arm's loop.
constexpr const char* kCatheterSessionChannel = "CATHETER_SESSION";  ///< The same of the catheter's loop.

}  // namespace angio::types
