// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/messaging/bus_monitor.hpp"

namespace angio::apps {

/// Channels as a table for people: one line of numbers and one of the last value each.
std::string monitorTable(const std::vector<ChannelReport>& channels);

/// The same for programs: {"channels": {name: {...}}}; latency_s is null where clocks do not allow it.
nlohmann::ordered_json monitorAsJson(const std::vector<ChannelReport>& channels);

}  // namespace angio::apps
