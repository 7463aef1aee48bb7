// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/trajectory_preview.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "trajectory_bounds.hpp"

namespace angio::servo {
namespace {

constexpr double kPeriod_s = 1.0 / 15;
constexpr double kMaxDuration_s = 120;  // The longest motion of the slowest arm.
// Nearer than the image could tell: it has arrived.
constexpr double kArrived_rad = 1e-4, kArrived_m = 1e-4;

}  // namespace

TrajectoryPreview previewTrajectory(const ServoLoopSettings& settings, const VesselTree& tree,
                                    const CArmJoints& start) {
  const auto* view = std::get_if<ViewTaskSettings>(&settings.task);
  if (!view || view->goal == ViewGoal::kRequested) {
    throw InputError(
        "preview", "task", nameOf(settings.task),
        view ? "must have a view of its own, not one that is asked for" : "must be view: others have no way");
  }
  ServoLoopSettings ideal = settings;
  ideal.latency_s = 0;
  OpenLoop loop(ideal, tree);
  const Pose desired = *loop.task().desired_T_camera_model();
  const Eigen::Vector3d target = desired.inverse() * Eigen::Vector3d(0, 0, settings.carm.source_isocenter_distance_m);
  const auto error = [&](const CArmJoints& joints) {
    return viewError(settings.carm.T_camera_patient(joints) * settings.T_dsa_cb, desired, target);
  };
  TrajectoryPreview preview;
  CArmState state;
  state.joints = start;
  for (int k = 0; k * kPeriod_s <= kMaxDuration_s; ++k) {
    const ViewError off = error(state.joints);
    preview.points.push_back({k * kPeriod_s, state.joints, state.velocity, off.direction_rad, off.target_m});
    if (off.direction_rad <= kArrived_rad && off.target_m <= kArrived_m) break;
    state.time_us = std::llround(1e6 * k * kPeriod_s);
    state.velocity = loop.step(state, kPeriod_s).velocity;
    if (loop.holdReason()) {
      preview.hold_reason = loop.holdReason();
      break;
    }
    state.joints += kPeriod_s * state.velocity;
    ++state.sequence;
  }
  const TrajectoryPoint& last = preview.points.back();
  if (!preview.hold_reason && last.time_s > kMaxDuration_s - kPeriod_s) {
    preview.hold_reason = "the view is not reached in " + formatValue(kMaxDuration_s) + " s";
  }
  const TrajectoryStart trajectory{start, start};
  for (const TrajectoryPoint& point : preview.points) {
    const TrajectoryExcursion out = trajectory.excursion(
        point.joints, last.joints, [&](const CArmJoints& joints) { return error(joints).target_m; });
    preview.max_table_m = std::max(preview.max_table_m, out.table_m);
    preview.max_target_m = std::max(preview.max_target_m, out.target_m);
  }
  return preview;
}

}  // namespace angio::servo
