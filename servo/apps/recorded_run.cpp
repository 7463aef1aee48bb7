// SPDX-License-Identifier: GPL-2.0-or-later
#include "recorded_run.hpp"

#include <filesystem>
#include <utility>

#include "angio/io/whole_file.hpp"

namespace angio::apps {
namespace {

mcap::Attachment attachedFile(const std::string& kind, const std::string& path) {
  const std::filesystem::path file(path);
  const std::string extension = file.extension().string();
  const char* type = extension == ".csv"                           ? "text/csv"
                     : extension == ".yaml" || extension == ".yml" ? "application/yaml"
                                                                   : "application/octet-stream";
  return {0, kind + "/" + file.filename().string(), type, readWholeFile(path)};
}

}  // namespace

RecordedRun recordedRun(const VesselTree& tree, const CArmCalibration& calibration, const std::string& tree_path,
                        const std::string& calibration_path, const std::string& settings_yaml) {
  return {{tree, calibration.carm, calibration.T_dsa_cb},
          {attachedFile("tree", tree_path),
           attachedFile("calibration", calibration_path),
           {0, "settings/settings.yaml", "application/yaml", settings_yaml}}};
}

bool namesMcap(const std::string& path) { return std::filesystem::path(path).extension() == ".mcap"; }

std::unique_ptr<messaging::LogSink> openMcap(const std::string& path, RecordedRun run) {
  return std::make_unique<recording::McapLog>(path, std::move(run.scene), std::move(run.attachments));
}

}  // namespace angio::apps
