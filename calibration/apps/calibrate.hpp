// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/apps/namespace.hpp"
#include "angio/cli/app_fwd.hpp"

namespace angio::apps {

/// Each adds its sub-command, which sets `work` when it is chosen.
void addCalibrateCamera(CLI::App& app, Work& work);
void addCalibrateGeometry(CLI::App& app, Work& work);
void addCalibrateHandEye(CLI::App& app, Work& work);
void addCalibrateRegistration(CLI::App& app, Work& work);
void addCalibrateSimulate(CLI::App& app, Work& work);

}  // namespace angio::apps
