// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/servo/tasks.hpp"

namespace angio::servo {

/// Throws InputError when a setting is out of its range, the tree has no such segment, or a pose is none.
std::unique_ptr<Task> make(const ViewTaskSettings& settings, const TaskContext& context);

}  // namespace angio::servo
