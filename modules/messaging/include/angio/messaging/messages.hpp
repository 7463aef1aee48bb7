// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/imaging/xray_frame.hpp"

namespace angio {

/// What the bus carries, in our own types; XrayFrame is the fifth. On the wire these are the .lcm types of the same meaning.

/// Joints of the C-arm as its encoders read them.
struct CArmState {
  std::int64_t time_us = 0;   ///< When the encoders were read, sender's monotonic clock [us].
  std::int64_t sequence = 0;  ///< Rises by one per message.
  CArmJoints joints = CArmJoints::Zero();    ///< rad, rad, m, m, m.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

/// Velocity command for the C-arm's joints. The default stands still.
struct CArmCommand {
  std::int64_t time_us = 0;         ///< Exposure time of the frame behind this command [us].
  std::int64_t sequence = 0;        ///< Rises by one per command.
  std::int64_t frame_sequence = 0;  ///< The frame it answers.
  std::int64_t valid_for_us = 0;    ///< How long it may be obeyed after it arrives [us]; silence means stop.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

/// What a registration said of one frame. `status` is the registration room's status by its number, `status_text` its name.
struct RegistrationMessage {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  std::int8_t status = 0;
  std::string status_text;
  Pose T_camera_model = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< [translation; rotation], m and rad.
  double mean_residual_px = 0;
  std::int32_t points_3d = 0;
  std::int32_t points_2d = 0;
};

enum class ServoState : std::int8_t { kHold = 0, kServo = 1 };

/// What the loop did with one frame, and why.
struct ServoStatus {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ServoState state = ServoState::kHold;
  std::string reason;              ///< Why it holds; empty while it servoes.
  double view_error_rad = 0;       ///< Angle between the seen and the desired beam.
  double target_error_m = 0;       ///< Distance of the target from its desired place in the camera frame.
  std::int64_t image_us = 0;         ///< Time spent on image to centreline [us].
  std::int64_t registration_us = 0;  ///< On registration [us].
  std::int64_t control_us = 0;       ///< On law, limits and supervisor [us].
};

}  // namespace angio
