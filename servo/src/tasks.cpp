// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

namespace angio::servo {

std::string nameOf(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return std::string(chosen.kName); }, settings);
}

bool patientMoves(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return chosen.kPatientMoves; }, settings);
}

TargetNeed targetNeed(const TaskSettings& settings) {
  return std::visit([](const auto& chosen) { return chosen.kTargetNeed; }, settings);
}

std::unique_ptr<Task> makeTask(const TaskSettings& settings, const TaskContext& context) {
  return std::visit([&](const auto& chosen) { return make(chosen, context); }, settings);
}

}  // namespace angio::servo
