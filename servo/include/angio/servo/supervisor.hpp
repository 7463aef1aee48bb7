// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/registration/registration.hpp"
#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/servo/target_need.hpp"

namespace angio {

/// Gates between what is seen and what moves. Every gate that fails ends in a hold.
struct SupervisorSettings {
  double most_state_age_ms = 200;   ///< Between the frame and the joints it is read with.
  double most_correction_deg = 12;  ///< Largest disagreement with the calibration: a creeping error ends here.
  double most_correction_mm = 40;
  double most_jump_deg = 2.5;      ///< Largest disagreement with the prediction while tracking.
  double most_jump_mm = 10;        ///< Across the beam.
  double most_jump_depth_mm = 30;  ///< Along it: one view sees depth poorly, above all of a tree that bends.
  double most_target_std_mm = 3;   ///< Standard deviation of the target, in the worst direction that the task needs.
  double command_valid_ms = 200;   ///< How long a command may be obeyed: three frames at 15 a second.

  void visit(SettingsVisitor& v) {
    v.number("most_state_age_ms", most_state_age_ms, 1, 10000);
    v.number("most_correction_deg", most_correction_deg, 0.01, 180);
    v.number("most_correction_mm", most_correction_mm, 0.01, 1000);
    v.number("most_jump_deg", most_jump_deg, 0.01, 180);
    v.number("most_jump_mm", most_jump_mm, 0.01, 1000);
    v.number("most_jump_depth_mm", most_jump_depth_mm, 0.01, 1000);
    v.number("most_target_std_mm", most_target_std_mm, 1e-3, 1000);
    v.number("command_valid_ms", command_valid_ms, 10, 1000);
  }
};

/// The gates of one loop and the limits of its machine. Has to hear of every frame, once: limit() or rest().
class Supervisor {
 public:
  /// @param target_model  The point whose place matters [m].
  /// @param need          The directions in which it matters.
  Supervisor(const SupervisorSettings& settings, const CArmLimits& limits, const Eigen::Vector3d& target_model,
             TargetNeed need = TargetNeed::kEverywhere);

  /// Why a frame must not be read with these joints; nothing when it may.
  std::optional<std::string> objection(const XrayFrame& frame, const CArmState& state) const;

  /// Why a registration must not move the machine; nothing when it may.
  ///
  /// @param calibrated  Pose of the model by joints and calibration alone.
  /// @param predicted   Pose by joints and what was tracked; nothing while nothing is.
  std::optional<std::string> objection(const RegistrationResult& seen, const Pose& calibrated,
                                       const std::optional<Pose>& predicted) const;

  /// The velocity to command [rad/s, m/s]: within speed, acceleration and jerk, and so that the arm stays within its
  /// range and envelope, whether or not a next command comes (CArmMotionLimiter). Zero when anything is not finite.
  ///
  /// @param age_s     From when the joints were as in `state` until this command moves the arm.
  /// @param period_s  Since the frame before; zero or less stands still.
  CArmJoints limit(const CArmJoints& wanted, const CArmState& state, double age_s, double period_s) {
    return limiter_.limit(wanted, state.joints, age_s, period_s);
  }

  /// The frame holds: the arm brakes.
  void rest(double period_s) { limiter_.rest(period_s); }

  /// The last velocity did not go out; a command to stand still did.
  void takeBack() { limiter_.takeBack(); }

  /// How long commands may be obeyed [us].
  std::int64_t commandValidity_us() const;

 private:
  std::optional<std::string> tooFar(const Pose& seen, const Pose& expected, double most_deg, double most_mm,
                                    double most_depth_mm, const char* what) const;

  SupervisorSettings settings_;
  Eigen::Vector3d target_;
  TargetNeed need_;
  CArmMotionLimiter limiter_;
};

}  // namespace angio
