// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <variant>

#include "angio/types/carm_motion.hpp"
#include "angio/types/catheter.hpp"
#include "angio/types/loop_input.hpp"
#include "angio/types/registration_message.hpp"
#include "angio/types/registration_points.hpp"
#include "angio/types/servo_request.hpp"
#include "angio/types/servo_session.hpp"
#include "angio/types/servo_status.hpp"
#include "angio/types/view_request.hpp"
#include "angio/types/xray_frame.hpp"

namespace angio::types {

/// Any of the values that programs send each other.
using AnyMessage = std::variant<XrayFrame, CArmState, ServoInput, CArmCommand, RegistrationMessage, ServoStatus,
                                ServoRequest, CatheterState, CatheterCommand, CatheterTip, CatheterInput, ViewRequest,
                                ServoSession, RegistrationPoints>;

}  // namespace angio::types
