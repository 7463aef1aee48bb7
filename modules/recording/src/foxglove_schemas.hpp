// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/recording/namespace.hpp"

namespace angio::recording {

/// The JSON schema of one of Foxglove's well-known schemas that FoxgloveTopics uses, by its name. Source:
/// https://docs.foxglove.dev/docs/sdk/schemas. Throws std::out_of_range for others.
std::string foxgloveSchema(const std::string& name);

}  // namespace angio::recording
