// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/messaging/messages.hpp"

namespace angio::rules {

/// The first rule of the wire that a value breaks, in one line; nothing when it may go on the wire. Sender and receiver
/// ask the same, so that whatever is decoded could have been encoded.
std::optional<std::string> broken(const XrayFrame& frame);
std::optional<std::string> broken(const CArmState& state);
std::optional<std::string> broken(const ServoInput& input);
std::optional<std::string> broken(const CArmCommand& command);
std::optional<std::string> broken(const RegistrationMessage& registration);
std::optional<std::string> broken(const ServoStatus& status);
std::optional<std::string> broken(const ServoRequest& request);
std::optional<std::string> broken(const CatheterState& state);
std::optional<std::string> broken(const CatheterCommand& command);
std::optional<std::string> broken(const CatheterTip& tip);
std::optional<std::string> broken(const CatheterInput& input);

/// Longest message [bytes]: LCM counts in int, and its headers need room.
constexpr std::int64_t kLongestMessage = 2'000'000'000;

}  // namespace angio::rules
