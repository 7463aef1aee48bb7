// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// Says that the last messages of a channel cannot be decoded: how many in a row, of whom, and why; "31 messages on
/// XRAY_FRAME from 127.0.0.1:40123 cannot be decoded: xray_frame_t: another type's fingerprint". Nothing when the last
/// one could be.
std::optional<std::string> undecodable(const ChannelRecord& record);

/// Says why a loop has no frame to answer, by what it has heard.
///
/// @param states        Of the channels whose states a frame needs, the C-arm's first.
/// @param states_heard  Whether there is a state of the C-arm to answer a frame with.
/// @param awaited       Channels on which messages of frames that have come are awaited.
std::string silenceOf(const ChannelRecord& frames, const std::vector<ChannelRecord>& states, bool states_heard,
                      const std::vector<std::string>& awaited);

}  // namespace angio::servo
