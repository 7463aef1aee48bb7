// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/messaging/bus.hpp"

namespace angio::apps {

/// The bus of a program, to which bad things may be done on purpose: for trying a set-up before it is trusted.
/// @param url            LCM URL, as openSharedBus() takes it.
/// @param settings_path  What happens to all that this program says (.yaml, DisturbanceSettings), in real time; empty:
///                       nothing.
/// Throws InputError as openSharedBus() does, and when the file cannot be read.
std::unique_ptr<Bus> openSharedBus(const std::string& url, const std::string& settings_path);

}  // namespace angio::apps
