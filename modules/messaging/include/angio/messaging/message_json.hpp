// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/messaging/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::messaging {

/// The type of a message, "xray_frame_t".
std::string typeOf(const AnyMessage& message);

/// The message as a JSON object with the fields of its .lcm type, names, units and all; numbers as exact as they are.
/// The pixels of a frame are left out: they are no text.
std::string jsonOf(const AnyMessage& message);

/// The JSON schema (draft 2020-12) of what jsonOf() makes of messages of one type.
struct JsonSchema {
  std::string type, schema;
};

/// Those of all messages, in the order of AnyMessage.
std::vector<JsonSchema> jsonSchemas();

}  // namespace angio::messaging
