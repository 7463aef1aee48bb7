// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/recording/mcap_log.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::apps {

/// What stands in an MCAP file of a run beside its messages.
struct RecordedRun {
  recording::RecordedScene scene;
  std::vector<mcap::Attachment> attachments;  ///< Tree and calibration as their files are, and settings in force.
};

/// Reads the files for it. @param settings_yaml  As --print-settings prints them. Throws InputError.
RecordedRun recordedRun(const VesselTree& tree, const CArmCalibration& calibration, const std::string& tree_path,
                        const std::string& calibration_path, const std::string& settings_yaml);

/// Whether a log of this name is an MCAP file: by its extension.
bool namesMcap(const std::string& path);

/// The MCAP file of a run. Throws InputError when it cannot be written.
std::unique_ptr<messaging::LogSink> openMcap(const std::string& path, RecordedRun run);

}  // namespace angio::apps
