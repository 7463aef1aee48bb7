// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/servo/servo_loop.hpp"

namespace angio::servo {

/// One moment of a predicted trajectory.
struct TrajectoryPoint {
  double time_s = 0;
  CArmJoints joints = CArmJoints::Zero();
  CArmJoints velocity = CArmJoints::Zero();
  double view_off_rad = 0, target_off_m = 0;  ///< From the desired view, as ViewError.
};

/// The trajectory of a view task if the patient lies as calibrated and the arm follows every command.
struct TrajectoryPreview {
  std::vector<TrajectoryPoint> points;       ///< From the start on, a frame's time apart.
  double max_table_m = 0, max_target_m = 0;  ///< As TrajectoryExcursion, the largest; no less than zero.
  std::optional<std::string> hold_reason;    ///< Why the task would not go on: it ends there. Nothing where it arrives.
};

/// Predicts the trajectory by the task, law and limits of a loop, without latency. Nothing moves.
///
/// Throws InputError as ServoLoop does, and when the task is no view or waits to be asked for one.
TrajectoryPreview previewTrajectory(const ServoLoopSettings& settings, const VesselTree& tree, const CArmJoints& start);

}  // namespace angio::servo
