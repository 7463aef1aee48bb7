// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/imaging/xray_frame.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio {

/// What the bus carries, in our own types; XrayFrame is the fifth. On the wire these are the .lcm types of the same
/// meaning.

/// Joints of the C-arm as its encoders read them.
struct CArmState {
  std::int64_t time_us = 0;                  ///< When the encoders were read, sender's monotonic clock [us].
  std::int64_t sequence = 0;                 ///< Rises by one per message.
  CArmJoints joints = CArmJoints::Zero();    ///< rad, rad, m, m, m.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

/// What a supervisor made of a frame and its answer. REFUSED: the frame was not even looked at; TAKEN_BACK: it was, but
/// no motion went out.
enum class ServoVerdict : std::int8_t { kPermitted = 0, kTakenBack = 1, kRefused = 2 };
constexpr int kServoVerdictCount = 3;

/// What the loop was given with one frame: a replay of a log asks for it.
struct ServoInput {
  std::int64_t time_us = 0;         ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;  ///< The frame.
  CArmState state;                  ///< The joints as the loop believed them to be at the exposure.
  ServoVerdict verdict = ServoVerdict::kPermitted;
};

/// Velocity command for the C-arm's joints. The default stands still.
struct CArmCommand {
  std::int64_t time_us = 0;                  ///< Exposure time of the frame behind this command [us].
  std::int64_t sequence = 0;                 ///< Rises by one per command.
  std::int64_t frame_sequence = 0;           ///< The frame it answers.
  std::int64_t valid_for_us = 0;             ///< How long it may be obeyed after it arrives [us]; silence means stop.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

/// What a registration said of one frame. `status` is the registration room's status by its number, `status_text` its
/// name.
struct RegistrationMessage {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree that was registered.
  std::int8_t status = 0;
  std::string status_text;
  Pose T_camera_model = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< [translation; rotation], m and rad.
  double mean_residual_px = 0;
  std::int32_t points_3d = 0;
  std::int32_t points_2d = 0;
};

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
};
constexpr int kServoCauseCount = 16;

/// In words, for people: "emergency stop", "a joint limit is broken".
const char* nameOf(ServoState state);
const char* nameOf(ServoCause cause);

enum class ServoRequestKind : std::int8_t { kStop = 0, kArm = 1, kStart = 2, kReset = 3, kEmergencyStop = 4 };
constexpr int kServoRequestKindCount = 5;

/// What the operator asks of the loop, and which status was seen when it was asked. The default stops.
struct ServoRequest {
  std::int64_t time_us = 0;         ///< When it was asked, sender's monotonic clock [us].
  std::int64_t sequence = 0;        ///< Rises by one per request.
  std::int64_t status_time_us = 0;  ///< Of the last status seen; 0: none.
  std::int64_t transitions = 0;     ///< Of that status.
  ServoRequestKind request = ServoRequestKind::kStop;
};

/// What the loop did with one frame, in which state it is, and why.
struct ServoStatus {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ServoState state = ServoState::kHold;
  std::string reason;                    ///< Why it stands still; empty while it servoes.
  std::int64_t transitions = 0;          ///< Changes of state so far.
  std::int64_t transition_time_us = 0;   ///< Of the last one, the loop's clock [us]; 0: there was none.
  ServoCause cause = ServoCause::kNone;  ///< Of the last one.
  double view_error_rad = 0;             ///< Angle between the seen and the desired beam.
  double target_error_m = 0;             ///< Distance of the target from its desired place in the camera frame.
  std::int64_t image_us = 0;             ///< Time spent on image to centreline [us].
  std::int64_t registration_us = 0;      ///< On registration [us].
  std::int64_t control_us = 0;           ///< On law, limits and supervisor [us].
};

/// The drive of a catheter as its encoders and its force sensor read it, all at the base.
struct CatheterState {
  std::int64_t time_us = 0;        ///< When it was read, sender's monotonic clock [us].
  std::int64_t sequence = 0;       ///< Rises by one per message.
  double insertion_m = 0;          ///< Length that the drive has pushed in, from its zero.
  double roll_rad = 0;             ///< Clockwise as seen from the base towards the tip, not wrapped.
  double bend_rad = 0;             ///< Of a steerable tip, from straight.
  double insertion_speed_mps = 0;  ///< [m/s]
  double roll_speed_radps = 0;     ///< [rad/s]
  double bend_speed_radps = 0;     ///< [rad/s]
  double insertion_force_n = 0;    ///< With which the drive pushes (+) or pulls (-) [N].
};

/// Velocity command for a catheter's drive. The default stands still.
struct CatheterCommand {
  std::int64_t time_us = 0;         ///< Exposure time of the frame behind this command [us].
  std::int64_t sequence = 0;        ///< Rises by one per command.
  std::int64_t frame_sequence = 0;  ///< The frame it answers.
  std::int64_t valid_for_us = 0;    ///< How long it may be obeyed after it arrives [us]; silence means stop.
  double insertion_speed_mps = 0;   ///< + pushes in [m/s].
  double roll_speed_radps = 0;      ///< + clockwise as seen from the base towards the tip [rad/s].
  double bend_speed_radps = 0;      ///< + bends a steerable tip further [rad/s].
};

/// What a catheter's loop was given with one frame: a replay of a log asks for it.
struct CatheterInput {
  std::int64_t time_us = 0;         ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;  ///< The frame.
  ServoVerdict verdict = ServoVerdict::kPermitted;
  CArmState arm;        ///< The joints as the loop believed them to be at the exposure.
  CatheterState drive;  ///< The drive as it was then.
};

enum class CatheterTipStatus : std::int8_t { kLost = 0, kAmbiguous = 1, kLocated = 2 };

/// Where a catheter's tip was seen in one frame. When it is lost, nothing but the reason counts.
struct CatheterTip {
  std::int64_t time_us = 0;              ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;       ///< The frame.
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree that holds it.
  CatheterTipStatus status = CatheterTipStatus::kLost;
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();   ///< In the model frame [m].
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of the tip, model axes [m^2].
  std::int32_t branch = 0;                               ///< Index of VesselTree::branches().
  std::int32_t tree_point = 0;                           ///< Index of the tree's point nearest before the tip.
  double arc_length_m = 0;                               ///< From the tree's root, along the vessels.
  double probability = 0;                                ///< That the tip is in this branch.
  std::string reason;                                    ///< Why it is not located; empty when it is.
};

}  // namespace angio
