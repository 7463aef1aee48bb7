// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/servo/tasks.hpp"

namespace angio::servo {

/// The target's place in the patient, from this frame's own registration, joints and what the image shows around it, is
/// predicted from when this frame's command will move the table on. The command is the first step of a plan that keeps
/// the table's acceleration and brings the predicted target nearest to the wanted ray over the next periods.
std::unique_ptr<Task> make(const CenterTaskSettings& settings, const TaskContext& context);

}  // namespace angio::servo
