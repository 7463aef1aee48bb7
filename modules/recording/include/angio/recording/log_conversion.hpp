// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/recording/mcap_log.hpp"

namespace angio::recording {

/// What became of a log.
struct Converted {
  std::int64_t messages = 0;
  std::int64_t skipped_bytes = 0;  ///< Of the log that was read, that were no messages.
  bool whole = true;               ///< Whether the log that was read has its end.
};

/// Hears how much is done, 0 to 1.
using ConversionProgress = std::function<void(double part)>;

/// Makes an MCAP file of a log of LCM's or of another MCAP file. The file appears whole or not at all. Throws
/// InputError that names the file: one that cannot be read or written, a message that MCAP cannot hold.
Converted convertToMcap(const std::string& log, const std::string& mcap, const std::optional<RecordedScene>& scene,
                        const std::vector<mcap::Attachment>& attachments, const mcap::WriterSettings& settings = {},
                        const ConversionProgress& progress = {});

/// Makes a log of LCM's of the LCM messages of an MCAP file, with their numbers and times: of an MCAP file that was
/// made of a log, the same bytes as that log. The rest as convertToMcap().
Converted convertToLcm(const std::string& mcap, const std::string& log, const ConversionProgress& progress = {});

}  // namespace angio::recording
