// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>
#include <variant>

#include "angio/servo/centre_task_settings.hpp"
#include "angio/servo/hold_task_settings.hpp"
#include "angio/servo/servo_law.hpp"
#include "angio/servo/task.hpp"
#include "angio/servo/view_task_settings.hpp"
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
using TaskSettings = std::variant<ViewTaskSettings, CenterTaskSettings, HoldTaskSettings>;

/// The name of the task that settings choose: "view".
std::string nameOf(const TaskSettings& settings);

/// Whether a task is for a patient who moves under it.
bool patientMoves(const TaskSettings& settings);

/// The directions in which a task needs to know its target's place.
TargetNeed targetNeed(const TaskSettings& settings);

/// Throws InputError when a setting is out of its range or of no use with this tree.
std::unique_ptr<Task> makeTask(const TaskSettings& settings, const TaskContext& context);

}  // namespace angio::servo
