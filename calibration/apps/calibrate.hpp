// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/apps/namespace.hpp"
#include "angio/campaign/program.hpp"
#include "angio/cli/command_line_fwd.hpp"

namespace angio::apps {

/// Each adds its sub-command, which sets `work` when it is chosen.
void addCalibrateCamera(cli::Command& app, Work& work);
void addCalibrateGeometry(cli::Command& app, Work& work);
void addCalibrateHandEye(cli::Command& app, Work& work);
void addCalibrateRegistration(cli::Command& app, Work& work);
void addCalibrateSimulate(cli::Command& app, Work& work, const Campaigns& campaigns);

}  // namespace angio::apps
