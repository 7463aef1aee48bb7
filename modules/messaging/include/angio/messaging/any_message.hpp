// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/codec.hpp"
#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// The name of the .lcm type whose fingerprint these bytes begin with; nothing when it is none of ours.
std::optional<std::string> messageType(const std::uint8_t* data, std::size_t size);

/// Reads one message of whatever type its fingerprint says, from bytes that may come from anywhere, as decode() does.
Decoded<AnyMessage> decodeAny(const std::uint8_t* data, std::size_t size);

/// When the message was made or its frame exposed, by its sender's clock [us].
std::int64_t timeOf(const AnyMessage& message);

/// The number that orders the messages of one sender.
std::int64_t sequenceOf(const AnyMessage& message);

/// What the numbers of a type's messages say, of one sender.
struct Numbering {
  bool gaps_are_losses = true;     ///< A number that is left out is a message that was lost.
  bool repeats_are_copies = true;  ///< A number that comes again is the same message again.
};

/// Requests are numbered by the clock, so that gaps between them mean nothing. A status is said again with each change
/// of state, and a request for a view until it is obeyed.
Numbering numberingOf(const AnyMessage& message);

/// The message in one line for people: degrees, millimetres and milliseconds; what came as text is shortened, and shown
/// without control characters.
std::string describe(const AnyMessage& message);

}  // namespace angio::messaging
