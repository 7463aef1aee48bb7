// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

namespace angio::servo {

// What two poses have between them along the beam is their own noise in depth.
Pose TaskInput::trackedPoseAt(const Eigen::Vector3d& p_model) const {
  Pose T = T_camera_model_tracked;
  if (!places) return T;
  const Eigen::Vector3d shown = places->placeAt(p_model), ray = shown.normalized();
  const Eigen::Vector3d averaged = T * p_model - T_camera_model * p_model;
  T.pretranslate(shown + averaged - ray * ray.dot(averaged) - T * p_model);
  return T;
}

std::string nameOf(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return std::string(chosen.kName); }, settings);
}

bool patientMoves(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return chosen.kPatientMoves; }, settings);
}

TargetNeed targetNeed(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return chosen.targetNeed(); }, settings);
}

std::unique_ptr<Task> makeTask(const TaskSettings& settings, const TaskContext& context) {
  return madeOf(settings, [&](const auto& chosen) { return make(chosen, context); });
}

}  // namespace angio::servo
