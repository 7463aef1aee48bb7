// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/servo/servo_loop.hpp"

namespace angio::apps {

/// Writes the way that a view's task would take into a folder (preview.png, preview.json), which the caller has
/// claimed, prints it for people, and moves nothing. Throws InputError as previewTrajectory() does, when a file cannot
/// be written, and, with the files written, when the task would not arrive.
int previewTo(const std::string& folder, const ServoLoopSettings& settings, const VesselTree& tree,
              const CArmJoints& start);

}  // namespace angio::apps
