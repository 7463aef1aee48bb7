// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/servo/servo_loop.hpp"

namespace angio::servo {

/// One moment of a way that has not been gone.
struct WayPoint {
  double time_s = 0;
  CArmJoints joints = CArmJoints::Zero();
  CArmJoints velocity = CArmJoints::Zero();
  double view_off_rad = 0, target_off_m = 0;  ///< From the desired view, as ViewError.
};

/// The way that a view's task would take if the patient lay as calibrated and the arm did what it is told.
struct WayPreview {
  std::vector<WayPoint> points;              ///< From the start on, a frame's time apart.
  double max_table_m = 0, max_target_m = 0;  ///< As WayExcursion, the largest; no less than zero.
  std::optional<std::string> hold_reason;    ///< Why the task would not go on: it ends there. Nothing where it arrives.
};

/// Goes the way by the task, law and limits of a loop, in thought. Latency is none.
///
/// Throws InputError as ServoLoop does, and when the task is no view or waits to be asked for one.
WayPreview previewWay(const ServoLoopSettings& settings, const VesselTree& tree, const CArmJoints& start);

}  // namespace angio::servo
