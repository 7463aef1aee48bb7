// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>
#include <variant>

#include "angio/servo/servo_law.hpp"
#include "angio/servo/task.hpp"
#include "angio/servo/task_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::servo {

/// What a task works with.
struct TaskContext {
  CArmGeometry carm;
  CArmLimits limits;
  const VesselTree& tree;        ///< Borrowed while the task is made, no longer.
  Eigen::Vector3d target_model;  ///< The point that matters [m].
  Eigen::Matrix3d R_lps_model;   ///< Patient axes L, P, S from the model's axes.
  ServoLawSettings law;
};

/// The settings type is the choice of the task.
using TaskSettings = std::variant<ViewTaskSettings, CenterTaskSettings, HoldTaskSettings, ResolveDepthTaskSettings>;

/// The name of the task that settings choose: "view".
std::string nameOf(const TaskSettings& settings);

/// Whether a task is for a patient who moves under it.
bool patientMoves(const TaskSettings& settings);

/// The directions in which a task needs to know its target's place.
TargetNeed targetNeed(const TaskSettings& settings);

/// Throws InputError when a setting is out of its range or of no use with this tree.
std::unique_ptr<Task> makeTask(const TaskSettings& settings, const TaskContext& context);

/// What makeTask() calls with settings that are in their ranges. Throws InputError when the tree has no such segment,
/// or a pose is none.
std::unique_ptr<Task> make(const ViewTaskSettings& settings, const TaskContext& context);

/// The target's place in the patient, from this frame's own registration, joints and what the image shows around it, is
/// predicted from when this frame's command will move the table on. The command is the first step of a plan that keeps
/// the table's acceleration and brings the predicted target nearest to the wanted ray over the next periods.
std::unique_ptr<Task> make(const CenterTaskSettings& settings, const TaskContext& context);

/// Predicts the model's pose in the patient frame, its target's place and its rotation, to when this frame's command
/// will move the arm. The command is the first step of a plan that keeps the joints' accelerations and brings the view
/// nearest to the one at the task's beginning over the next periods, along the predicted motion.
std::unique_ptr<Task> make(const HoldTaskSettings& settings, const TaskContext& context);

/// Another task before which the target's depth is resolved, as often as it is open: while a frame, read with what
/// turns have told, leaves the target more uncertain than settings.max_std_mm in its worst direction, resolve_depth is
/// asked, and otherwise `task`. Throws InputError as makeTask() does, and of a task that cannot go by it.
std::unique_ptr<Task> makeDepthFirst(const ResolveDepthTaskSettings& settings, const TaskSettings& task,
                                     const TaskContext& context);

/// Where a frame's covariance leaves the target's depth open, watches the patient breathe, turns the arm by the primary
/// angle, to the side where it has more room, stands still, and says what all frames together know.
std::unique_ptr<Task> make(const ResolveDepthTaskSettings& settings, const TaskContext& context);

}  // namespace angio::servo
