// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/campaign/program.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/results/statistics.hpp"

namespace angio::apps {

/// Prints an experiment's table, and writes all of it with its settings, and the machine unless it is null, as JSON
/// where `out` names a file. Returns 0.
int report(Json json, const std::string& table, const Json& settings, const Json& machine, const std::string& out);

/// Adds the sub-command navigate, which sets `work` when it is chosen.
void addSimulateNavigate(cli::Command& app, Work& work, const Campaigns& campaigns);

}  // namespace angio::apps
