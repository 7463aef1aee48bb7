// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/servo/tasks.hpp"

namespace angio::servo {

/// Predicts the model's pose in the patient frame, its target's place and its rotation, to when this frame's command
/// will move the arm; the law brings the view back from there, and the predicted motion's own speed is added.
std::unique_ptr<Task> make(const HoldTaskSettings& settings, const TaskContext& context);

}  // namespace angio::servo
