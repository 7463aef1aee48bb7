// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>

#include "angio/messaging/bus.hpp"

namespace angio::messaging {

/// Opens a bus that records what is published, "file://name.lcm?mode=w". publish() throws std::runtime_error from the
/// message on that could not be written. Throws InputError when the file cannot be written.
std::unique_ptr<Bus> openLogBus(const std::string& url);

}  // namespace angio::messaging
