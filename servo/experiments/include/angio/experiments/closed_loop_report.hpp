// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "angio/experiments/closed_loop.hpp"

namespace angio::experiments {

/// Frames, registered, held, a fingerprint of all commands, final errors of both loops, latency p50/p99/max per stage.
nlohmann::ordered_json closedLoopSummary(const ClosedLoopRun& scenario);

/// The same as a table for people.
std::string closedLoopTable(const nlohmann::ordered_json& summary);

/// One row per frame of the closed loop, with the open loop's error beside it; header with units.
std::string closedLoopTrace(const ClosedLoopRun& scenario);

/// Makes the folder when it is missing. Throws InputError when that cannot be done.
void makeFolder(const std::string& folder);

/// Writes overlay_first.png, overlay_last.png, plot.png, all three on sheet.jpg, trace.csv and summary.json into
/// `folder`, which is made when it is missing. `summary` is what summary.json holds. Throws InputError when a file
/// cannot be written.
void writeClosedLoop(const std::string& folder, const ClosedLoopRun& scenario, const VesselTree& tree,
                     const nlohmann::ordered_json& summary);

}  // namespace angio::experiments
